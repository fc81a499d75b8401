/* The fronts, and files for machines and people. */
#include "command_accuracy.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "plot.h"

static double device_ms(const accuracy_result *r) { return r->cast_ms + r->refine_ms + r->shade_ms; }

/* The factor on what is proven. */
static double steps_of(const accuracy_setting *s) { return s->safe_steps != 0 ? fmax(s->safe_steps, 0) : 1; }

static bool beats(double ms, double error, double than_ms, double than_error)
{
    return ms <= than_ms && error <= than_error && (ms < 0.95 * than_ms || error < 0.95 * than_error);
}

void accuracy_mark_fronts(accuracy *a)
{
    for (size_t i = 0; i < a->num_settings; i++) {
        accuracy_result *r = &a->results[i];
        r->on_depth_front = r->on_picture_front = true;
        for (size_t k = 0; k < a->num_settings; k++) {
            const accuracy_result *s = &a->results[k];
            if (a->settings[k].safe_steps > 1 || a->settings[k].no_blend)
                continue;
            if (beats(device_ms(s), s->depth_median, device_ms(r), r->depth_median))
                r->on_depth_front = false;
            if (beats(device_ms(s), s->rmse, device_ms(r), r->rmse))
                r->on_picture_front = false;
        }
    }
}

static json_t *samples_json(const accuracy *a)
{
    json_t *pictures = json_array();
    for (int i = 0; i < ACCURACY_NUM_SAMPLES; i++) {
        const accuracy_samples *s = &a->samples[i];
        json_array_append_new(pictures, json_pack("{s:I, s:f, s:f, s:f, s:f, s:f}", "samples",
                                                  (json_int_t)s->num_samples, "detail_px", s->detail_px, "ms", s->ms,
                                                  "rmse", s->rmse, "psnr_db", s->psnr_db, "ssim", s->ssim));
    }
    return json_pack("{s:{s:I, s:f, s:b}, s:o}", "reference", "samples", (json_int_t)a->truth.num_samples, "detail_px",
                     a->truth.detail_px, "refine", true, "pictures", pictures);
}

static json_t *media_json(const accuracy *a)
{
    json_t *media = json_array(), *truths = json_object();
    static const char *const ways[] = {"octaves", "once", "paths", "fluence"};
    for (int t = 0; t < 2; t++) {
        const karst_reference_light_stats *s = &a->light_stats[t];
        json_object_set_new(truths, t ? "often" : "once",
                            json_pack("{s:f, s:f, s:f, s:I, s:I, s:I, s:I}", "mean", a->light_mean[t], "noise",
                                      a->light_noise[t], "s", a->light_s[t], "num_paths", (json_int_t)s->num_paths,
                                      "num_lookups", (json_int_t)s->num_lookups, "num_collisions",
                                      (json_int_t)s->num_collisions, "num_nodes", (json_int_t)s->num_nodes));
    }
    for (int i = 0; i < ACCURACY_NUM_MEDIA; i++) {
        const accuracy_media *m = &a->media[i];
        json_array_append_new(media,
                              json_pack("{s:s, s:i, s:f, s:f, s:f}", "scattering", ways[m->scattering], "samples",
                                        (int)m->num_samples, "ms", m->ms, "bias", m->bias, "rms", m->rms));
    }
    return json_pack("{s:o, s:o}", "truth", truths, "pictures", media);
}

char *accuracy_json(const accuracy *a)
{
    json_t *settings = json_array();
    for (size_t i = 0; i < a->num_settings; i++) {
        const accuracy_setting *s = &a->settings[i];
        const accuracy_result *r = &a->results[i];
        json_array_append_new(
            settings,
            json_pack(
                "{s:s, s:f, s:b, s:b, s:i, s:b, s:b, s:f, s:{s:f, s:f, s:f, s:f, s:f}, s:I, s:f, s:f, s:{s:I, s:f, "
                "s:f, s:f}, s:I, s:I, s:I, s:{s:f, s:f}, s:{s:f, s:f, s:f}, s:b, s:b}",
                "family", s->family, "detail_px", s->detail_px, "refine", s->refine, "default", s->is_default,
                "brick_bits", s->brick_bits, "blend", !s->no_blend, "beam", !s->no_beam, "safe_steps", steps_of(s),
                "time_ms", "cast", r->cast_ms, "refine", r->refine_ms, "shade", r->shade_ms, "device", device_ms(r),
                "frame", r->frame_ms, "num_bricks", (json_int_t)r->num_bricks, "brick_mib", r->brick_mib,
                "detail_given_px", r->given_px, "depth_footprints", "num", (json_int_t)r->num_compared, "median",
                r->depth_median, "p99", r->depth_p99, "max", r->depth_max, "num_missed", (json_int_t)r->num_missed,
                "num_false", (json_int_t)r->num_false, "num_off_silhouettes", (json_int_t)r->num_elsewhere,
                "normal_deg", "median", r->normal_median_deg, "p99", r->normal_p99_deg, "picture", "rmse", r->rmse,
                "psnr_db", r->psnr_db, "ssim", r->ssim, "depth_front", r->on_depth_front, "picture_front",
                r->on_picture_front));
    }
    json_t *root = json_pack("{s:s, s:s, s:s, s:[i, i], s:[i, i], s:i, s:f, s:f, s:I, s:o}", "world", a->world,
                             "camera", a->camera_text, "device", a->device_name, "size_px", a->size_px[0],
                             a->size_px[1], "picture_px", a->picture_px[0], a->picture_px[1], "picture_rays_px",
                             ACCURACY_RAYS_PX * ACCURACY_RAYS_PX, "reference_s", a->reference_s, "picture_s",
                             a->picture_s, "num_unresolved", (json_int_t)a->num_unresolved, "settings", settings);
    if (root && a->has_samples)
        json_object_set_new(root, "samples", samples_json(a));
    if (root && a->has_media)
        json_object_set_new(root, "media", media_json(a));
    char *text = root ? json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(9)) : NULL;
    json_decref(root);
    if (!text)
        return NULL;
    /* Files end with a newline. */
    size_t length = strlen(text);
    char *lines = realloc(text, length + 2);
    if (!lines) {
        free(text);
        return NULL;
    }
    memcpy(lines + length, "\n", 2);
    return lines;
}

char *accuracy_csv(const accuracy *a)
{
    char *text = NULL;
    size_t size_bytes;
    FILE *file = open_memstream(&text, &size_bytes);
    if (!file)
        return NULL;
    fputs("family,detail_px,refine,default,brick_bits,blend,beam,safe_steps,cast_ms,refine_ms,shade_ms,frame_ms,num_"
          "bricks,brick_mib,depth_median,depth_"
          "p99,"
          "depth_max,num_missed,num_false,num_off_silhouettes,normal_median_deg,normal_p99_deg,rmse,psnr_db,ssim,"
          "depth_front,picture_front\n",
          file);
    for (size_t i = 0; i < a->num_settings; i++) {
        const accuracy_setting *s = &a->settings[i];
        const accuracy_result *r = &a->results[i];
        fprintf(
            file,
            "%s,%g,%d,%d,%d,%d,%d,%g,%.4f,%.4f,%.4f,%.4f,%llu,%.3f,%.6g,%.6g,%.6g,%llu,%llu,%llu,%.5g,%.5g,%.5g,%.5g,"
            "%.6g,%d,%d\n",
            s->family, s->detail_px, s->refine, s->is_default, s->brick_bits, !s->no_blend, !s->no_beam, steps_of(s),
            r->cast_ms, r->refine_ms, r->shade_ms, r->frame_ms,
            (unsigned long long)r->num_bricks, r->brick_mib, r->depth_median, r->depth_p99, r->depth_max,
            (unsigned long long)r->num_missed, (unsigned long long)r->num_false, (unsigned long long)r->num_elsewhere,
            r->normal_median_deg, r->normal_p99_deg, r->rmse, r->psnr_db, r->ssim, r->on_depth_front,
            r->on_picture_front);
    }
    if (fclose(file) != 0) {
        free(text);
        return NULL;
    }
    return text;
}

/* ---- the chart ---- */

typedef struct {
    double x[ACCURACY_MAX_SETTINGS], depth[ACCURACY_MAX_SETTINGS], rmse[ACCURACY_MAX_SETTINGS];
    size_t num;
    const char *name;
} curve;

/* The settings of each family, from the fastest. */
static size_t make_curves(const accuracy *a, curve *curves)
{
    size_t num_curves = 0;
    for (size_t i = 0; i < a->num_settings; i++) {
        size_t c = 0;
        while (c < num_curves && strcmp(curves[c].name, a->settings[i].family) != 0)
            c++;
        if (c == num_curves) {
            if (num_curves == PLOT_MAX_SERIES)
                continue;
            curves[num_curves++] = (curve){.name = a->settings[i].family};
        }
        curve *to = &curves[c];
        const accuracy_result *r = &a->results[i];
        size_t at = to->num++;
        for (; at > 0 && to->x[at - 1] > device_ms(r); at--) {
            to->x[at] = to->x[at - 1];
            to->depth[at] = to->depth[at - 1];
            to->rmse[at] = to->rmse[at - 1];
        }
        to->x[at] = device_ms(r);
        to->depth[at] = r->depth_median;
        to->rmse[at] = r->rmse;
    }
    return num_curves;
}

char *accuracy_plot(const accuracy *a, karst_error *error)
{
    curve *curves = calloc(PLOT_MAX_SERIES, sizeof *curves);
    plot_series depth[PLOT_MAX_SERIES], rmse[PLOT_MAX_SERIES];
    char title[256], subtitle[512];
    if (!curves) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    size_t num_curves = make_curves(a, curves);
    for (size_t c = 0; c < num_curves; c++) {
        depth[c] = (plot_series){.name = curves[c].name,
                                 .kind = PLOT_LINE_AND_POINTS,
                                 .num = curves[c].num,
                                 .x = curves[c].x,
                                 .y = curves[c].depth};
        rmse[c] = depth[c];
        rmse[c].y = curves[c].rmse;
    }
    snprintf(title, sizeof title, "%s: error over time", a->world);
    snprintf(subtitle, sizeof subtitle,
             "%d x %d on %s; picture error at %d x %d against %d rays a pixel of the full density", a->size_px[0],
             a->size_px[1], a->device_name, a->picture_px[0], a->picture_px[1], ACCURACY_RAYS_PX * ACCURACY_RAYS_PX);
    const plot_axis time = {"cast, refine and shade, ms", true, 0, 0};
    const plot_panel panels[] = {
        {.title = "depth",
         .x = time,
         .y = {"median error, footprints", true, 0, 0},
         .series = depth,
         .num_series = num_curves,
         .height = 1},
        {.title = "picture",
         .x = time,
         .y = {"rms error, 8-bit steps", true, 0, 0},
         .series = rmse,
         .num_series = num_curves,
         .height = 1},
    };
    const plot_page page = {
        .title = title, .subtitle = subtitle, .width_pt = 720, .height_pt = 720, .panels = panels, .num_panels = 2};
    char *svg = plot_svg(&page, error);
    free(curves);
    return svg;
}
