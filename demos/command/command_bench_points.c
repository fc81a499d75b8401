/* karst bench WORLD --points: what a world's models cost, and how right they are, as surfaces and as discs, beside what
 * a thesis says of its own renderer: S. Kashyap, "Fast Raytracing of Point Based Models using GPUs" (Bombay 2010). Its
 * chapters 3 and 4 have a model of a million points, 512x512 pixels, on a GTX 275. */
#include "command_bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOST_ROUNDS 101
#define SIDE_PX 512

typedef enum { SURFACE, DEEP_ALL, DEEP_CULLED, LEAF_ALL, LEAF_CULLED, NUM_WAYS } way;

/* of_thesis: frames a second, and discs for each point; 0: it does not say. */
static const struct {
    const char *name;
    karst_models_as as;
    double fps_of_thesis, copies_of_thesis;
} ways[NUM_WAYS] = {{"surface", KARST_MODELS_SURFACE, 0, 0},
                    {"splats, deep, all copies", KARST_MODELS_SPLATS, 2, 11},
                    {"splats, deep, culled", KARST_MODELS_SPLATS_CULLED, 6.5, 2},
                    {"splats, by leaf, all copies", KARST_MODELS_SPLATS_LEAF, 0, 11},
                    {"splats, by leaf, culled", KARST_MODELS_SPLATS_LEAF_CULLED, 0, 2}};

/* Pictures that errors are told by. */
typedef struct {
    float *depth_m, *normal; /* of width * height pixels */
} seen;

typedef struct {
    double frame_ms, ratio;      /* to the surface's, in turns */
    double open_ms;              /* until the first picture is complete */
    double memory_mb;            /* what is in use of the pools, and all of what discs take */
    double discs_a_point;        /* copies included, all levels; 0: none */
    double rms_px, turned_deg;   /* against the models' own function */
    double holes, beyond;        /* shares of the models' pixels: not seen; seen where nothing is */
} row;

typedef struct {
    bench *b;
    command_talk *talk;
    const karst_log *log;
    int size_px[2];
    row rows[NUM_WAYS];
    seen land, truth; /* without models; with their own function */
    double pixel;     /* how wide one is, a metre away */
    uint64_t num_points;
    karst_stats stats;
    const char *doing;
} table;

static bool note_frame(void *user, const karst_stats *stats)
{
    const table *t = user;
    command_progress(t->talk, "%s   %llu bricks", t->doing, (unsigned long long)stats->num_resident_bricks);
    return !command_interrupted();
}

static karst_engine *open_engine(table *t, karst_models_as as, bool refine, karst_error *error)
{
    const bench *b = t->b;
    const karst_engine_config config = {.world = b->world_file,
                                        .device = b->device,
                                        .display = KARST_DISPLAY_NONE,
                                        .parameters = b->parameters.values,
                                        .num_parameters = b->parameters.num_values,
                                        .width_px = t->size_px[0],
                                        .height_px = t->size_px[1],
                                        .pool_bytes = (uint64_t)(b->pool_mib * 1048576),
                                        .detail_px = b->detail_px,
                                        .no_shadows = b->no_shadows,
                                        .lanes = (int)b->lanes,
                                        .refine = refine,
                                        .models = as,
                                        .log = t->log};
    karst_engine *engine = karst_engine_create(&config, error);
    bool settled = false, done = engine && (!b->camera || bench_set_first_camera(t->b, engine, NULL, error)) &&
                                 karst_engine_settle(engine, (uint32_t)b->max_frames, note_frame, t, &settled, error);
    if (done && command_interrupted())
        done = bench_interrupted(error);
    else if (done && !settled)
        done = karst_fail(error, KARST_FAILED, "a view did not settle within %u frames; raise --frames-max",
                          (unsigned)b->max_frames);
    if (done)
        return engine;
    karst_engine_destroy(engine);
    return NULL;
}

/* ---- errors ---- */

static bool look(const table *t, karst_engine *engine, seen *s, karst_error *error)
{
    const size_t num = (size_t)t->size_px[0] * (size_t)t->size_px[1];
    s->depth_m = malloc(num * sizeof *s->depth_m);
    s->normal = malloc(3 * num * sizeof *s->normal);
    if (!s->depth_m || !s->normal)
        return karst_fail(error, KARST_FAILED, "out of memory");
    return karst_engine_read_depth(engine, s->depth_m, num, error) &&
           karst_engine_read_aov(engine, KARST_AOV_NORMAL, s->normal, 3 * num, error);
}

static void forget(seen *s)
{
    free(s->depth_m);
    free(s->normal);
    *s = (seen){.depth_m = NULL};
}

/* Whether a pixel shows a model: the land without it is farther off. */
static bool shows_model(const table *t, const seen *s, size_t i)
{
    const double land_m = (double)t->land.depth_m[i], depth_m = (double)s->depth_m[i];
    return depth_m < land_m && (isinf(land_m) || land_m - depth_m > 0.25 * t->pixel * depth_m);
}

static void compare(const table *t, const seen *s, row *r)
{
    const size_t num = (size_t)t->size_px[0] * (size_t)t->size_px[1];
    size_t models = 0, both = 0, holes = 0, beyond = 0;
    double square = 0, turned = 0;
    for (size_t i = 0; i < num; i++) {
        const bool is_there = shows_model(t, &t->truth, i), is_seen = shows_model(t, s, i);
        models += is_there;
        holes += is_there && !is_seen;
        beyond += !is_there && is_seen;
        if (!is_there || !is_seen)
            continue;
        const double depth_m = (double)t->truth.depth_m[i];
        const double off = ((double)s->depth_m[i] - depth_m) / (t->pixel * depth_m);
        double along = 0;
        for (int a = 0; a < 3; a++)
            along += (double)s->normal[3 * i + (size_t)a] * (double)t->truth.normal[3 * i + (size_t)a];
        if (fabs(off) > 50) { /* another part of it */
            holes += off > 0;
            beyond += off < 0;
            continue;
        }
        both++;
        square += off * off;
        turned += acos(fmin(fmax(along, -1), 1)) * 57.29577951308232;
    }
    r->rms_px = both ? sqrt(square / (double)both) : 0;
    r->turned_deg = both ? turned / (double)both : 0;
    r->holes = models ? (double)holes / (double)models : 0;
    r->beyond = models ? (double)beyond / (double)models : 0;
}

/* What others are compared with. */
static bool look_at_truth(table *t, karst_error *error)
{
    t->doing = "the land alone";
    karst_engine *engine = open_engine(t, KARST_MODELS_NONE, true, error);
    bool done = engine && look(t, engine, &t->land, error);
    if (done) {
        const karst_camera camera = karst_engine_camera(engine);
        t->pixel = 2 * tan(camera.fov_deg * 0.5 / 57.29577951308232) / t->size_px[1];
    }
    karst_engine_destroy(engine);
    t->doing = "the models' own function";
    engine = done ? open_engine(t, KARST_MODELS_SURFACE, true, error) : NULL;
    done = engine && look(t, engine, &t->truth, error);
    karst_engine_destroy(engine);
    if (!done)
        return false;
    for (size_t i = 0, num = (size_t)t->size_px[0] * (size_t)t->size_px[1]; i < num; i++)
        if (shows_model(t, &t->truth, i))
            return true;
    return karst_fail(error, KARST_USAGE, "%s shows no model of points there: --points is about worlds with \"models\"",
                      t->b->world);
}

/* ---- times ---- */

static double used_mb(const karst_stats_pool *pool)
{
    return (double)pool->size_bytes * (double)pool->num_used / (double)pool->num_total * 1e-6;
}

/* A way's frames and those of the surface, in turns: a machine's pace changes meanwhile. */
static bool measure(table *t, karst_engine *surface, way what, karst_error *error)
{
    static double ms[MOST_ROUNDS], ratios[MOST_ROUNDS];
    const size_t rounds = t->b->num_rounds < MOST_ROUNDS ? (size_t)t->b->num_rounds : MOST_ROUNDS;
    row *r = &t->rows[what];
    seen own = {.depth_m = NULL};
    const uint64_t start_ns = karst_clock();
    t->doing = ways[what].name;
    karst_engine *engine = what == SURFACE ? surface : open_engine(t, ways[what].as, false, error);
    double unused;
    bool done = engine != NULL;
    r->open_ms = (double)(karst_clock() - start_ns) * 1e-6;
    for (size_t i = 0; done && i < rounds; i++) {
        double plain = 1;
        /* Of each the second of two frames counts: as those of a view that stands follow one another. */
        done = what == SURFACE || (bench_time_frame(surface, &t->stats, &unused, error) &&
                                   bench_time_frame(surface, &t->stats, &plain, error));
        done = done && bench_time_frame(engine, &t->stats, &unused, error) &&
               bench_time_frame(engine, &t->stats, &ms[i], error);
        ratios[i] = what == SURFACE ? 1 : ms[i] / plain;
    }
    done = done && look(t, engine, &own, error);
    if (done) {
        const karst_stats_splats *splats = &t->stats.splats;
        r->frame_ms = bench_median(ms, rounds);
        r->ratio = bench_median(ratios, rounds);
        r->memory_mb = used_mb(&t->stats.tiles) + used_mb(&t->stats.bricks) + (double)splats->size_bytes * 1e-6;
        r->discs_a_point = splats->num_points ? (double)splats->num_discs / (double)splats->num_points : 0;
        t->num_points = splats->num_points ? splats->num_points : t->num_points;
        compare(t, &own, r);
    }
    forget(&own);
    if (what != SURFACE)
        karst_engine_destroy(engine);
    return done;
}

static bool measure_all(table *t, karst_error *error)
{
    bool done = look_at_truth(t, error);
    t->doing = ways[SURFACE].name;
    const uint64_t start_ns = karst_clock();
    karst_engine *surface = done ? open_engine(t, KARST_MODELS_SURFACE, false, error) : NULL;
    const double open_ms = (double)(karst_clock() - start_ns) * 1e-6;
    done = surface != NULL;
    for (int what = SURFACE; done && what < NUM_WAYS; what++)
        done = measure(t, surface, (way)what, error);
    t->rows[SURFACE].open_ms = open_ms;
    karst_engine_destroy(surface);
    forget(&t->land);
    forget(&t->truth);
    command_end_progress(t->talk);
    return done;
}

/* ---- what comes of it ---- */

static void print_table(FILE *file, const table *t)
{
    fprintf(file,
            "%s on %s, %dx%d, %llu points: models as surfaces and as discs, frames in turns\n"
            "errors against the models' own function (--refine), rms along rays in pixels' widths; thesis: its own "
            "renderer on a\nGTX 275, with a model of a million points\n\n"
            "%-28s %9s %7s %9s %9s %7s %8s %8s %8s %8s %10s %7s\n",
            t->b->world, t->stats.device, t->size_px[0], t->size_px[1], (unsigned long long)t->num_points, "models as",
            "frame ms", "ratio", "start ms", "memory MB", "discs", "rms px", "normals", "holes %", "beyond %",
            "thesis fps", "discs");
    for (int what = SURFACE; what < NUM_WAYS; what++) {
        const row *r = &t->rows[what];
        char fps[32] = "-", discs[32] = "-";
        if (ways[what].fps_of_thesis > 0)
            snprintf(fps, sizeof fps, "%.1f", ways[what].fps_of_thesis);
        if (ways[what].copies_of_thesis > 0)
            snprintf(discs, sizeof discs, "%.0f", ways[what].copies_of_thesis);
        fprintf(file, "%-28s %9.2f %7.2f %9.0f %9.1f %7.2f %8.3f %8.2f %8.3f %8.2f %10s %7s\n", ways[what].name,
                r->frame_ms, r->ratio, r->open_ms, r->memory_mb, r->discs_a_point, r->rms_px, r->turned_deg,
                100 * r->holes, 100 * r->beyond, fps, discs);
    }
}

static json_t *or_null(double value) { return value > 0 ? json_real(value) : json_null(); }

static char *as_json(const table *t)
{
    json_t *rows = json_array();
    for (int what = SURFACE; what < NUM_WAYS; what++) {
        const row *r = &t->rows[what];
        json_array_append_new(rows,
                              json_pack("{s:s, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:o, s:o}", "models_as",
                                        ways[what].name, "frame_ms", r->frame_ms, "ratio", r->ratio, "start_ms",
                                        r->open_ms, "memory_mb", r->memory_mb, "discs_a_point", r->discs_a_point,
                                        "rms_px", r->rms_px, "normals_deg", r->turned_deg, "holes", r->holes, "beyond",
                                        r->beyond, "thesis_fps", or_null(ways[what].fps_of_thesis),
                                        "thesis_discs_a_point", or_null(ways[what].copies_of_thesis)));
    }
    json_t *report = json_pack("{s:i, s:s, s:s, s:i, s:i, s:I, s:I, s:o}", "karst_bench_points", 1, "world",
                               t->b->world, "device", t->stats.device, "width_px", t->size_px[0], "height_px",
                               t->size_px[1], "points", (json_int_t)t->num_points, "rounds",
                               (json_int_t)t->b->num_rounds, "rows", rows);
    char *text = report ? bench_json_text(report, JSON_INDENT(2)) : NULL;
    json_decref(report);
    return text;
}

bool bench_points(bench *b, const char *json, command_talk *talk, karst_error *error)
{
    static table t;
    t = (table){.b = b, .talk = talk, .size_px = {SIDE_PX, SIDE_PX}};
    if (b->has_size)
        memcpy(t.size_px, b->size_px, sizeof t.size_px);
    command_catch_interrupts();
    command_open_driver(talk);
    const karst_log log = command_log(talk);
    t.log = &log;
    if (!measure_all(&t, error))
        return false;
    if (!json || strcmp(json, "-") != 0)
        print_table(stdout, &t);
    if (!json)
        return true;
    char *text = as_json(&t);
    const bool written =
        text ? command_write_text(json, text, error) : karst_fail(error, KARST_FAILED, "out of memory for the report");
    free(text);
    return written;
}
