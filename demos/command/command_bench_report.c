/* karst bench: the report. A figure that has one value for each run is told as median, min and max of the runs, so that
 * two reports can be compared with their spread. */
#include "command_bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A frame is jank if it takes longer than this times its phase's median. */
#define JANK 2.0

const char *const bench_phase_names[BENCH_NUM_PHASES] = {"settling", "settled", "cold", "flight", "beside"};
const char *const bench_beside_names[BENCH_NUM_BESIDE] = {NULL, "no-shadows", "no-mirror", "standing"};

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Of sorted values, the one that `share` of them do not exceed (nearest rank). */
static double quantile(const double *sorted, size_t num, double share)
{
    size_t rank = num ? (size_t)ceil((double)num * share) : 0;
    return num ? sorted[rank ? rank - 1 : 0] : 0;
}

/* Median, min and max of some values, which are sorted for it. */
static json_t *describe_spread(double *values, size_t num)
{
    qsort(values, num, sizeof *values, compare_doubles);
    return json_pack("{s:f, s:f, s:f}", "median", quantile(values, num, 0.5), "min", num ? values[0] : 0, "max",
                     num ? values[num - 1] : 0);
}

#define WHOLE_FRAME KARST_NUM_STAGES
#define PRODUCTION (KARST_NUM_STAGES + 1) /* as a budget in ms counts it */
#define CPU (KARST_NUM_STAGES + 2)        /* time of all threads over the cores */

/* Time of a frame, or of one of its stages. */
static double frame_ms(const bench_frame *frame, int stage)
{
    uint64_t ns = stage == WHOLE_FRAME  ? frame->frame_ns
                  : stage == PRODUCTION ? frame->production_ns
                  : stage == CPU        ? frame->cpu_ns
                                        : frame->stage_ns[stage];
    return (double)ns * 1e-6;
}

static size_t take_times(const bench *b, bench_phase phase, int run, int stage, double *times_ms)
{
    size_t num = 0;
    for (size_t i = 0; i < b->num_frames; i++)
        if (b->frames[i].phase == phase && (run < 0 || b->frames[i].run == (unsigned)run))
            times_ms[num++] = frame_ms(&b->frames[i], stage);
    qsort(times_ms, num, sizeof *times_ms, compare_doubles);
    return num;
}

static double median_of(const bench *b, bench_phase phase, int run, int stage, double *scratch)
{
    return quantile(scratch, take_times(b, phase, run, stage, scratch), 0.5);
}

static json_t *describe_stage(const bench *b, bench_phase phase, int stage, double *scratch)
{
    double medians[BENCH_MAX_RUNS];
    for (unsigned run = 0; run < b->runs_done; run++)
        medians[run] = median_of(b, phase, (int)run, stage, scratch);
    size_t num = take_times(b, phase, -1, stage, scratch), num_jank = 0;
    double median_ms = quantile(scratch, num, 0.5);
    for (size_t i = 0; i < num; i++)
        num_jank += scratch[i] > JANK * median_ms;
    /* Short stages jitter by the clock's own grain. */
    json_t *stage_json =
        json_pack("{s:f, s:f, s:f, s:f, s:f}", "median", median_ms, "p95", quantile(scratch, num, 0.95), "p99",
                  quantile(scratch, num, 0.99), "max", num ? scratch[num - 1] : 0, "jank",
                  num && median_ms > 0.1 ? (double)num_jank / (double)num : 0);
    json_object_set_new(stage_json, "runs", describe_spread(medians, b->runs_done));
    return stage_json;
}

static json_t *describe_churn(const bench *b, bench_phase phase)
{
    uint64_t sums[5] = {0};
    size_t num = 0;
    for (size_t i = 0; i < b->num_frames; i++) {
        const bench_frame *frame = &b->frames[i];
        if (frame->phase != phase)
            continue;
        num++;
        sums[0] += frame->num_requests;
        sums[1] += frame->num_produced;
        sums[2] += frame->num_evicted;
        sums[3] += frame->num_reproduced;
        sums[4] += frame->num_deferred;
    }
    double n = num ? (double)num : 1;
    return json_pack("{s:f, s:f, s:f, s:f, s:f}", "requests", (double)sums[0] / n, "produced", (double)sums[1] / n,
                     "evicted", (double)sums[2] / n, "reproduced", (double)sums[3] / n, "deferred",
                     (double)sums[4] / n);
}

/* Shares of the hits, frame by frame: at the level that the frame asked for, or `own`, at the one that --detail stands
 * for. */
static json_t *describe_at_level(const bench *b, bench_phase phase, bool own, double *scratch)
{
    size_t num = 0;
    double sum = 0;
    for (size_t i = 0; i < b->num_frames; i++) {
        const bench_frame *f = &b->frames[i];
        if (f->phase != phase)
            continue;
        uint64_t num_short = own ? f->num_coarser : f->num_provisional;
        scratch[num] = f->num_hits ? 1 - (double)num_short / (double)f->num_hits : 1;
        sum += scratch[num++];
    }
    qsort(scratch, num, sizeof *scratch, compare_doubles);
    return json_pack("{s:f, s:f, s:f, s:f}", "mean", num ? sum / (double)num : 0, "median", quantile(scratch, num, 0.5),
                     "p1", quantile(scratch, num, 0.01), "min", num ? scratch[0] : 0);
}

/* Pixels a voxel, frame by frame. */
static json_t *describe_given_px(const bench *b, bench_phase phase, double *scratch)
{
    size_t num = 0;
    for (size_t i = 0; i < b->num_frames; i++)
        if (b->frames[i].phase == phase)
            scratch[num++] = b->frames[i].given_px;
    qsort(scratch, num, sizeof *scratch, compare_doubles);
    return json_pack("{s:f, s:f, s:f}", "median", quantile(scratch, num, 0.5), "p99", quantile(scratch, num, 0.99),
                     "max", num ? scratch[num - 1] : 0);
}

/* Rays of a frame's picture, and what casting one takes of all cores. */
static json_t *describe_streams(const bench *b, bench_phase phase, double *scratch)
{
    json_t *streams = json_object();
    for (int stream = 0; stream < KARST_NUM_STREAMS; stream++) {
        size_t num = 0;
        uint64_t rays = 0;
        for (size_t i = 0; i < b->num_frames; i++) {
            const bench_frame *f = &b->frames[i];
            if (f->phase != phase)
                continue;
            rays = f->num_rays[stream];
            if (rays)
                scratch[num++] = (double)f->stream_ns[stream] / (double)rays;
        }
        qsort(scratch, num, sizeof *scratch, compare_doubles);
        json_object_set_new(streams, karst_stream_name((karst_stream)stream),
                            json_pack("{s:I, s:{s:f, s:f, s:f}}", "rays", (json_int_t)rays, "ns_per_ray", "median",
                                      quantile(scratch, num, 0.5), "p99", quantile(scratch, num, 0.99), "max",
                                      num ? scratch[num - 1] : 0));
    }
    return streams;
}

static json_t *describe_phase(const bench *b, bench_phase phase, double *scratch)
{
    size_t num = take_times(b, phase, -1, WHOLE_FRAME, scratch);
    if (num == 0)
        return json_null();
    json_t *phase_json = json_pack("{s:I}", "frames", (json_int_t)num), *times = json_object();
    json_object_set_new(times, "frame", describe_stage(b, phase, WHOLE_FRAME, scratch));
    for (int stage = 0; stage < KARST_NUM_STAGES; stage++)
        json_object_set_new(times, karst_stage_name(stage), describe_stage(b, phase, stage, scratch));
    json_object_set_new(times, "production", describe_stage(b, phase, PRODUCTION, scratch));
    json_object_set_new(times, "cpu", describe_stage(b, phase, CPU, scratch));
    json_object_set_new(phase_json, "time_ms", times);
    json_object_set_new(phase_json, "streams", describe_streams(b, phase, scratch));
    json_object_set_new(phase_json, "churn_per_frame", describe_churn(b, phase));
    json_object_set_new(phase_json, "at_level", describe_at_level(b, phase, false, scratch));
    json_object_set_new(phase_json, "at_own_level", describe_at_level(b, phase, true, scratch));
    json_object_set_new(phase_json, "given_px", describe_given_px(b, phase, scratch));
    return phase_json;
}

/* One field of the ceilings: the median of each run's rounds, spread over the runs. */
static void medians_of_ceilings(const bench *b, size_t offset_bytes, double medians[BENCH_MAX_RUNS], double *scratch)
{
    for (unsigned run = 0; run < b->runs_done; run++) {
        for (uint64_t round = 0; round < b->num_rounds; round++)
            memcpy(&scratch[round], (const char *)&b->ceilings[run * b->num_rounds + round] + offset_bytes,
                   sizeof *scratch);
        qsort(scratch, (size_t)b->num_rounds, sizeof *scratch, compare_doubles);
        medians[run] = quantile(scratch, (size_t)b->num_rounds, 0.5);
    }
}

static void divide(double *values, const double *by, unsigned num, double factor)
{
    for (unsigned i = 0; i < num; i++)
        values[i] = by[i] > 0 ? values[i] * factor / by[i] : 0;
}

static void add_ceilings(const bench *b, json_t *root, double *scratch)
{
    double values[BENCH_MAX_RUNS];
    json_t *ceilings = json_object();
    static const struct {
        const char *name;
        size_t offset_bytes;
        double unit;
    } fields[] = {
        {"floor_ms", offsetof(karst_ceilings, floor_ns), 1e-6},
        {"fma_per_s", offsetof(karst_ceilings, fma_per_s), 1},
        {"memory_bytes_per_s", offsetof(karst_ceilings, bytes_per_s), 1},
        {"noise_samples_per_s", offsetof(karst_ceilings, noise_per_s), 1},
    };
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) {
        medians_of_ceilings(b, fields[i].offset_bytes, values, scratch);
        for (unsigned run = 0; run < b->runs_done; run++)
            values[run] *= fields[i].unit;
        json_object_set_new(ceilings, fields[i].name, describe_spread(values, b->runs_done));
    }
    json_object_set_new(root, "ceilings", ceilings);
}

/* A run's frames of a second engine around the `i`th of them: the median of up to five. A machine's pace changes within
 * seconds, a single frame may be disturbed. */
static double beside_ms_around(const double *frames_ms, size_t num, size_t i)
{
    double nearest_ms[5];
    size_t first = i < 2 ? 0 : i - 2, n = 0;
    while (n < 5 && first + n < num) {
        nearest_ms[n] = frames_ms[first + n];
        n++;
    }
    qsort(nearest_ms, n, sizeof *nearest_ms, compare_doubles);
    return quantile(nearest_ms, n, 0.5);
}

/* Frames of a phase of a run, each as a ratio to the second engine's frames around it, sorted: `every` of them to each
 * of those. `ratios` and `scratch` have room for all frames. */
static size_t take_beside_ratios(const bench *b, bench_phase phase, unsigned run, size_t every, double *ratios,
                                 double *scratch)
{
    size_t num_beside = 0, num = 0;
    for (size_t i = 0; i < b->num_frames; i++)
        if (b->frames[i].phase == BENCH_BESIDE && b->frames[i].run == run)
            scratch[num_beside++] = frame_ms(&b->frames[i], WHOLE_FRAME);
    for (size_t i = 0; i < b->num_frames; i++) {
        const bench_frame *f = &b->frames[i];
        if (f->phase != phase || f->run != run)
            continue;
        const double beside_ms = beside_ms_around(scratch, num_beside, f->index / every);
        ratios[num++] = beside_ms > 0 ? frame_ms(f, WHOLE_FRAME) / beside_ms : 0;
    }
    qsort(ratios, num, sizeof *ratios, compare_doubles);
    return num;
}

/* What a second engine's frames are for. */
static bool add_ratios_beside(const bench *b, json_t *ratios, double *scratch)
{
    double medians[BENCH_MAX_RUNS], p99[BENCH_MAX_RUNS];
    const bool standing = b->beside == BENCH_BESIDE_STANDING;
    double *of_run = malloc((b->num_frames + 1) * sizeof *of_run);
    for (unsigned run = 0; of_run && run < b->runs_done; run++) {
        const size_t num = take_beside_ratios(b, standing ? BENCH_FLIGHT : BENCH_SETTLED, run,
                                              standing ? BENCH_STANDING_EVERY : 1, of_run, scratch);
        medians[run] = quantile(of_run, num, 0.5);
        p99[run] = quantile(of_run, num, 0.99);
    }
    if (of_run)
        json_object_set_new(ratios,
                            standing                              ? "flight_frame_per_standing_frame"
                            : b->beside == BENCH_BESIDE_NO_MIRROR ? "settled_frame_per_frame_without_mirror"
                                                                  : "settled_frame_per_frame_without_shadows",
                            describe_spread(medians, b->runs_done));
    if (of_run && standing)
        json_object_set_new(ratios, "flight_p99_per_standing_frame", describe_spread(p99, b->runs_done));
    free(of_run);
    return of_run != NULL;
}

/* What is judged: each a ratio of two things measured in the same run. */
static bool add_ratios(const bench *b, json_t *root, double *scratch)
{
    double floor_ns[BENCH_MAX_RUNS], settled_ms[BENCH_MAX_RUNS], values[BENCH_MAX_RUNS];
    json_t *ratios = json_object();
    medians_of_ceilings(b, offsetof(karst_ceilings, floor_ns), floor_ns, scratch);
    for (unsigned run = 0; run < b->runs_done; run++)
        values[run] = settled_ms[run] = median_of(b, BENCH_SETTLED, (int)run, WHOLE_FRAME, scratch);
    divide(values, floor_ns, b->runs_done, 1e6);
    json_object_set_new(ratios, "settled_frame_per_floor", describe_spread(values, b->runs_done));
    for (unsigned run = 0; run < b->runs_done; run++)
        values[run] = median_of(b, BENCH_COLD, (int)run, WHOLE_FRAME, scratch);
    divide(values, settled_ms, b->runs_done, 1);
    json_object_set_new(ratios, "cold_frame_per_settled_frame", describe_spread(values, b->runs_done));
    for (unsigned run = 0; b->refine && run < b->runs_done; run++)
        values[run] = settled_ms[run] /
                      (settled_ms[run] - median_of(b, BENCH_SETTLED, (int)run, (int)KARST_STAGE_REFINE, scratch));
    if (b->refine)
        json_object_set_new(ratios, "refined_frame_per_frame_without", describe_spread(values, b->runs_done));
    for (unsigned run = 0; b->path && run < b->runs_done; run++)
        values[run] = median_of(b, BENCH_FLIGHT, (int)run, WHOLE_FRAME, scratch);
    if (b->path) {
        divide(values, settled_ms, b->runs_done, 1);
        json_object_set_new(ratios, "flight_frame_per_settled_frame", describe_spread(values, b->runs_done));
        for (unsigned run = 0; run < b->runs_done; run++)
            values[run] = quantile(scratch, take_times(b, BENCH_FLIGHT, (int)run, WHOLE_FRAME, scratch), 0.99);
        divide(values, settled_ms, b->runs_done, 1);
        json_object_set_new(ratios, "flight_p99_per_settled_frame", describe_spread(values, b->runs_done));
    }
    for (unsigned run = 0; run < b->runs_done; run++) {
        double used = 0;
        for (size_t i = 0; i < b->num_frames; i++)
            if (b->frames[i].run == run && b->frames[i].phase == BENCH_SETTLED)
                used = (double)b->frames[i].used_bricks;
        values[run] = b->runs[run].hit_bricks ? used / (double)b->runs[run].hit_bricks : 0;
    }
    json_object_set_new(ratios, "used_bricks_per_hit_brick", describe_spread(values, b->runs_done));
    bool added = b->beside == BENCH_BESIDE_NOTHING || add_ratios_beside(b, ratios, scratch);
    json_object_set_new(root, "ratios", ratios);
    return added;
}

/* Bricks and tiles made while settling, and the device time that took. */
static void add_production(const bench *b, json_t *root, double *scratch)
{
    double rates[6][BENCH_MAX_RUNS], fma[BENCH_MAX_RUNS], noise[BENCH_MAX_RUNS];
    uint64_t num_bricks = 0, num_tiles = 0, num_constant = 0;
    medians_of_ceilings(b, offsetof(karst_ceilings, fma_per_s), fma, scratch);
    medians_of_ceilings(b, offsetof(karst_ceilings, noise_per_s), noise, scratch);
    for (unsigned run = 0; run < b->runs_done; run++) {
        double bricks = 0, nodes = 0, evaluate_s = 0, finalise_s = 0, subdivide_s = 0;
        for (size_t i = 0; i < b->num_frames; i++) {
            const bench_frame *frame = &b->frames[i];
            if (frame->run != run || frame->phase != BENCH_SETTLING)
                continue;
            bricks += (double)frame->num_bricks;
            nodes += 8 * (double)frame->num_tiles;
            num_bricks += frame->num_bricks;
            num_tiles += frame->num_tiles;
            num_constant += frame->num_constant;
            evaluate_s += (double)frame->stage_ns[KARST_STAGE_EVALUATE] * 1e-9;
            finalise_s += (double)frame->stage_ns[KARST_STAGE_FINALISE] * 1e-9;
            subdivide_s += (double)frame->stage_ns[KARST_STAGE_SUBDIVIDE] * 1e-9;
        }
        double load_s = evaluate_s + finalise_s, production_s = load_s + subdivide_s, cores = b->num_cores;
        double samples = bricks * karst_brick_num_samples();
        rates[0][run] = production_s > 0 ? bricks / (production_s * cores) : 0;
        rates[1][run] = production_s > 0 ? samples / (production_s * cores) : 0;
        rates[2][run] = load_s > 0 ? samples / (load_s * cores) : 0;
        rates[3][run] = nodes > 0 ? subdivide_s * cores / nodes * 1e6 : 0;
        rates[4][run] = rates[2][run] * cores / noise[run];
        rates[5][run] = rates[2][run] * cores / fma[run];
    }
    static const char *const names[] = {"bricks_per_core_s",       "voxels_per_core_s", "load_voxels_per_core_s",
                                        "bounds_core_us_per_node", "load_per_noise",    "load_voxels_per_fma"};
    json_t *production = json_object();
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        json_object_set_new(production, names[i], describe_spread(rates[i], b->runs_done));
    double runs = b->runs_done;
    json_object_set_new(production, "bricks", json_real((double)num_bricks / runs));
    json_object_set_new(production, "tiles", json_real((double)num_tiles / runs));
    json_object_set_new(production, "bricks_constant", json_real((double)num_constant / runs));
    json_object_set_new(root, "production", production);
}

static void add_start(const bench *b, json_t *root)
{
    double values[4][BENCH_MAX_RUNS];
    static const char *const names[] = {"opened_ms", "hole_free_ms", "complete_ms", "frames"};
    json_t *start = json_object();
    for (unsigned run = 0; run < b->runs_done; run++) {
        values[0][run] = b->runs[run].opened_ms;
        values[1][run] = b->runs[run].hole_free_ms;
        values[2][run] = b->runs[run].complete_ms;
        values[3][run] = (double)b->runs[run].settling_frames;
    }
    /* The first run holds the process's own start. */
    json_object_set_new(start, "process",
                        json_pack("{s:f, s:f, s:f, s:f}", names[0], values[0][0], names[1], values[1][0], names[2],
                                  values[2][0], names[3], values[3][0]));
    for (size_t i = 0; i < 4; i++)
        json_object_set_new(start, names[i], describe_spread(values[i], b->runs_done));
    json_object_set_new(root, "start", start);
}

static json_t *describe_pool(const karst_stats_pool *pool, uint64_t num_resident)
{
    return json_pack("{s:I, s:I, s:I, s:I}", "used", (json_int_t)pool->num_used, "resident", (json_int_t)num_resident,
                     "total", (json_int_t)pool->num_total, "bytes", (json_int_t)pool->size_bytes);
}

/* Bytes that the used slots of a pool take. */
static double used_bytes(const karst_stats_pool *pool)
{
    return pool->num_total ? (double)pool->size_bytes * (double)pool->num_used / (double)pool->num_total : 0;
}

json_t *bench_report(const bench *b)
{
    size_t max_values = b->num_frames > b->num_rounds ? b->num_frames : (size_t)b->num_rounds;
    double *scratch = malloc((max_values + 1) * sizeof *scratch);
    if (!scratch)
        return NULL;
    const karst_stats *settled = &b->settled;
    json_t *root = json_pack("{s:i, s:s, s:s, s:s, s:s, s:s, s:i, s:i, s:i, s:b, s:f, s:I, s:I}", "karst_bench", 1,
                             "version", karst_version(), "world", b->world, "camera", b->camera_text, "device",
                             settled->device, "display", b->display, "cores", b->num_cores, "width_px", b->size_px[0],
                             "height_px", b->size_px[1], "shadows", !b->no_shadows, "pool_mib", b->pool_mib, "runs",
                             (json_int_t)b->runs_done, "rounds", (json_int_t)b->num_rounds);
    json_object_set_new(root, "path", b->path ? json_string(b->path) : json_null());
    json_object_set_new(root, "budget_ms", b->path ? json_real(b->budget_ms) : json_null());
    json_object_set_new(root, "fps", b->path ? json_real(b->fps) : json_null());
    json_object_set_new(root, "beside_view", b->beside ? json_string(bench_beside_names[b->beside]) : json_null());
    /* What makes frames dearer or cheaper; null: the world's or the device's own. */
    json_object_set_new(root, "settings",
                        json_pack("{s:f, s:b, s:b, s:b, s:I, s:I}", "detail_px", b->detail_px, "blend", !b->no_blend,
                                  "beam", !b->no_beam, "refine", b->refine, "brick_bits",
                                  (json_int_t)(b->brick_bits ? b->brick_bits : 16), "lanes", (json_int_t)b->lanes));
    json_t *settings = json_object_get(root, "settings");
    if (b->occlusion && !b->no_occlusion)
        json_object_set_new(settings, "occlusion", json_true());
    if (b->scattering != KARST_SCATTERING_OCTAVES)
        json_object_set_new(settings, "scattering",
                            json_string(b->scattering == KARST_SCATTERING_ONCE      ? "once"
                                        : b->scattering == KARST_SCATTERING_FLUENCE ? "fluence"
                                                                                    : "paths"));
    if (b->has_mirror)
        json_object_set_new(settings, "mirror", json_real(b->mirror));
    json_object_set_new(settings, "seed", b->has_seed ? json_integer((json_int_t)b->seed) : json_null());
    json_object_set_new(settings, "view_distance_m",
                        b->view_distance_m > 0 ? json_real(b->view_distance_m) : json_null());
    add_start(b, root);
    add_ceilings(b, root, scratch);
    bool complete = add_ratios(b, root, scratch);
    for (int phase = 0; phase < BENCH_NUM_PHASES; phase++)
        json_object_set_new(root, bench_phase_names[phase], describe_phase(b, phase, scratch));
    add_production(b, root, scratch);
    json_object_set_new(root, "cache",
                        json_pack("{s:o, s:o, s:f, s:I}", "tiles",
                                  describe_pool(&settled->tiles, settled->num_resident_tiles), "bricks",
                                  describe_pool(&settled->bricks, settled->num_resident_bricks), "used_bytes",
                                  used_bytes(&settled->tiles) + used_bytes(&settled->bricks), "hit_bricks",
                                  (json_int_t)(b->runs_done ? b->runs[b->runs_done - 1].hit_bricks : 0)));
    json_object_set_new(
        root, "detail",
        json_pack("{s:f, s:f}", "asked_px", settled->detail_asked_px, "given_px", settled->detail_given_px));
    json_t *memory = json_object();
    uint64_t sum = 0;
    for (size_t i = 0; i < settled->num_memory; i++) {
        json_object_set_new(memory, settled->memory[i].name, json_integer((json_int_t)settled->memory[i].size_bytes));
        sum += settled->memory[i].size_bytes;
    }
    json_object_set_new(root, "memory_bytes", memory);
    json_object_set_new(root, "memory_total_bytes", json_integer((json_int_t)sum));
    free(scratch);
    if (!complete) {
        json_decref(root);
        root = NULL;
    }
    return root;
}

char *bench_json_text(const json_t *json, size_t flags)
{
    char *dump = json ? json_dumps(json, flags | JSON_REAL_PRECISION(9)) : NULL;
    size_t length = dump ? strlen(dump) : 0;
    char *text = dump ? malloc(length + 2) : NULL;
    if (text) {
        memcpy(text, dump, length);
        memcpy(text + length, "\n", 2);
    }
    free(dump);
    return text;
}

char *bench_csv(const bench *b)
{
    char *text = NULL;
    size_t size = 0;
    FILE *file = open_memstream(&text, &size);
    if (!file)
        return NULL;
    fputs("phase,run,frame,time_s,frame_ms,production_ms,cpu_ms", file);
    for (int stage = 0; stage < KARST_NUM_STAGES; stage++)
        fprintf(file, ",%s_ms", karst_stage_name(stage));
    fputs(",requests,produced,evicted,reproduced,deferred,tiles_produced,bricks_produced,pixels,hits,provisional,"
          "incomplete,tiles_used,bricks_used,tiles_resident,bricks_resident,coarser,given_px\n",
          file);
    for (size_t i = 0; i < b->num_frames; i++) {
        const bench_frame *f = &b->frames[i];
        fprintf(file, "%s,%u,%zu,%.6f", bench_phase_names[f->phase], f->run, f->index, f->time_s);
        fprintf(file, ",%.6f,%.6f,%.6f", frame_ms(f, WHOLE_FRAME), frame_ms(f, PRODUCTION), frame_ms(f, CPU));
        for (int stage = 0; stage < KARST_NUM_STAGES; stage++)
            fprintf(file, ",%.6f", frame_ms(f, stage));
        const uint64_t counts[] = {f->num_requests, f->num_produced,    f->num_evicted,     f->num_reproduced,
                                   f->num_deferred, f->num_tiles,       f->num_bricks,      f->num_pixels,
                                   f->num_hits,     f->num_provisional, f->num_incomplete,  f->used_tiles,
                                   f->used_bricks,  f->resident_tiles,  f->resident_bricks, f->num_coarser};
        for (size_t n = 0; n < sizeof counts / sizeof *counts; n++)
            fprintf(file, ",%llu", (unsigned long long)counts[n]);
        fprintf(file, ",%.6g\n", f->given_px);
    }
    if (fclose(file) != 0) {
        free(text);
        return NULL;
    }
    return text;
}
