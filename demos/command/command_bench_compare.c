/* karst bench --compare: this report's figures as ratios to an older one's, with the spread that the runs had. */
#include "command_bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Objects with median, min and max, by their place in a report; whether less is better. */
typedef struct {
    const char *path;
    enum { LESS, MORE } better;
} figure;

static const figure figures[] = {
    {"ratios.settled_frame_per_floor", LESS},
    {"ratios.cold_frame_per_settled_frame", LESS},
    {"ratios.flight_frame_per_settled_frame", LESS},
    {"ratios.flight_p99_per_settled_frame", LESS},
    {"ratios.settled_frame_per_frame_without_shadows", LESS},
    {"ratios.flight_frame_per_standing_frame", LESS},
    {"ratios.flight_p99_per_standing_frame", LESS},
    {"ratios.used_bricks_per_hit_brick", LESS},
    {"ceilings.floor_ms", LESS},
    {"ceilings.fma_per_s", MORE},
    {"ceilings.memory_bytes_per_s", MORE},
    {"ceilings.noise_samples_per_s", MORE},
    {"settled.time_ms.frame.runs", LESS},
    {"settled.time_ms.cast.runs", LESS},
    {"settled.time_ms.shade.runs", LESS},
    {"settled.time_ms.collect.runs", LESS},
    {"settled.time_ms.display.runs", LESS},
    {"flight.time_ms.frame.runs", LESS},
    {"flight.time_ms.cast.runs", LESS},
    {"flight.time_ms.shade.runs", LESS},
    {"flight.time_ms.collect.runs", LESS},
    {"flight.time_ms.subdivide.runs", LESS},
    {"flight.time_ms.evaluate.runs", LESS},
    {"flight.time_ms.finalise.runs", LESS},
    {"production.bricks_per_core_s", MORE},
    {"production.load_voxels_per_core_s", MORE},
    {"production.bounds_core_us_per_node", LESS},
    {"production.load_per_noise", MORE},
    {"production.load_voxels_per_fma", MORE},
    {"start.opened_ms", LESS},
    {"start.hole_free_ms", LESS},
    {"start.complete_ms", LESS},
};

/* What must be the same for ratios to mean anything. */
static const char *const conditions[] = {"world",  "camera",      "path",      "width_px", "height_px",
                                         "device", "shadows",     "budget_ms", "display",  "pool_mib",
                                         "fps",    "beside_view", "settings"};

static const json_t *find(const json_t *root, const char *path)
{
    char part[64];
    while (root && *path) {
        size_t length = strcspn(path, ".");
        snprintf(part, sizeof part, "%.*s", (int)length, path);
        root = json_object_get(root, part);
        path += length + (path[length] == '.');
    }
    return root;
}

static json_t *load(const char *file, karst_error *error)
{
    json_error_t reason;
    json_t *root = json_load_file(file, 0, &reason);
    if (!root) {
        if (reason.line > 0)
            karst_fail(error, KARST_BAD_DATA, "cannot read %s: %s, line %d", file, reason.text, reason.line);
        else /* the text names the file */
            karst_fail(error, KARST_BAD_DATA, "--compare: %s", reason.text);
        return NULL;
    }
    if (json_integer_value(json_object_get(root, "karst_bench")) != 1) {
        karst_fail(error, KARST_BAD_DATA, "%s is no report of karst bench --json", file);
        json_decref(root);
        return NULL;
    }
    return root;
}

bool bench_compare_check(const char *file, karst_error *error)
{
    json_t *root = load(file, error);
    json_decref(root);
    return root != NULL;
}

static void print_figure(FILE *out, const figure *f, const json_t *now, const json_t *old)
{
    const json_t *n = find(now, f->path), *o = find(old, f->path);
    double n_median = json_number_value(json_object_get(n, "median"));
    double o_median = json_number_value(json_object_get(o, "median"));
    double n_min = json_number_value(json_object_get(n, "min")), n_max = json_number_value(json_object_get(n, "max"));
    double o_min = json_number_value(json_object_get(o, "min")), o_max = json_number_value(json_object_get(o, "max"));
    if (!(n_median > 0 && o_median > 0 && n_min > 0 && o_min > 0))
        return;
    double least = n_min / o_max, most = n_max / o_min;
    /* Different only where the runs of one report lie apart from those of the other; files hold nine digits. */
    const double grain = 1e-6;
    const char *verdict = least <= 1 + grain && most >= 1 - grain ? ""
                          : (most < 1) == (f->better == LESS)     ? "better"
                                                                  : "worse";
    fprintf(out, "%-47s %12.5g %12.5g %8.3f  %6.3f to %6.3f  %s\n", f->path, o_median, n_median, n_median / o_median,
            least, most, verdict);
}

bool bench_compare(const json_t *report, const char *file, FILE *out, karst_error *error)
{
    json_t *old = load(file, error);
    if (!old)
        return false;
    fprintf(out, "\ncompared with %s\n", file);
    for (size_t i = 0; i < sizeof conditions / sizeof *conditions; i++) {
        json_t *a = json_object_get(report, conditions[i]), *b = json_object_get(old, conditions[i]);
        if (!b) /* older reports do not say all */
            continue;
        bool same = a && (json_is_number(a) && json_is_number(b) ? fabs(json_number_value(a) - json_number_value(b)) <
                                                                       1e-6 * (1 + fabs(json_number_value(a)))
                                                                 : json_equal(a, b));
        if (same)
            continue;
        char *now_text = json_dumps(a, JSON_ENCODE_ANY), *old_text = json_dumps(b, JSON_ENCODE_ANY);
        fprintf(out, "not the same %s: %s now, %s then\n", conditions[i], now_text ? now_text : "nothing",
                old_text ? old_text : "nothing");
        free(now_text);
        free(old_text);
    }
    fprintf(out, "%-47s %12s %12s %8s  %s\n", "", "then", "now", "ratio", "spread of the runs");
    for (size_t i = 0; i < sizeof figures / sizeof *figures; i++)
        print_figure(out, &figures[i], report, old);
    json_decref(old);
    return true;
}
