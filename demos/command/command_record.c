/* Figures of a run, and their JSON. */
#include "command.h"

#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#define TIMES_PER_FRAME (KARST_NUM_STAGES + 1)

bool command_record_add(command_record *record, const karst_stats *stats, karst_error *error)
{
    if (record->num_frames == record->max_frames) {
        size_t max_frames = record->max_frames ? 2 * record->max_frames : 128;
        uint64_t *times_ns = realloc(record->times_ns, max_frames * TIMES_PER_FRAME * sizeof *times_ns);
        if (!times_ns)
            return karst_fail(error, KARST_FAILED, "out of memory for the times of %zu frames", max_frames);
        record->times_ns = times_ns;
        record->max_frames = max_frames;
    }
    uint64_t *times_ns = record->times_ns + record->num_frames++ * TIMES_PER_FRAME;
    memcpy(times_ns, stats->time_ns, sizeof stats->time_ns);
    times_ns[KARST_NUM_STAGES] = stats->time_ns_frame;
    record->num_requests += stats->num_requests;
    record->num_produced += stats->num_produced;
    record->num_evicted += stats->num_evicted;
    record->num_reproduced += stats->num_reproduced;
    record->num_deferred += stats->num_deferred;
    record->last = *stats;
    uint64_t now_ns = command_clock_ns() - record->start_ns;
    if (!record->complete_ns) {
        /* A hole later on, such as by looking elsewhere, takes it back. */
        record->hole_free_ns = stats->num_incomplete ? 0 : record->hole_free_ns ? record->hole_free_ns : now_ns;
        record->complete_ns = stats->settled ? now_ns : 0;
    }
    return true;
}

bool command_record_picture(command_record *record, const karst_stats *stats, size_t num_frames, bool settled,
                            karst_error *error)
{
    if (record->num_pictures == record->max_pictures) {
        size_t max_pictures = record->max_pictures ? 2 * record->max_pictures : 128;
        double *at_level = realloc(record->at_level, max_pictures * sizeof *at_level);
        record->at_level = at_level ? at_level : record->at_level;
        double *at_own_level = realloc(record->at_own_level, max_pictures * sizeof *at_own_level);
        record->at_own_level = at_own_level ? at_own_level : record->at_own_level;
        if (!at_level || !at_own_level)
            return karst_fail(error, KARST_FAILED, "out of memory for the figures of %zu pictures", max_pictures);
        record->max_pictures = max_pictures;
    }
    double num_hits = (double)stats->num_hits;
    record->at_level[record->num_pictures] = num_hits > 0 ? 1 - (double)stats->num_provisional / num_hits : 1;
    record->at_own_level[record->num_pictures++] = num_hits > 0 ? 1 - (double)stats->num_coarser / num_hits : 1;
    record->num_settled += settled;
    record->settled = record->num_settled == record->num_pictures;
    if (num_frames > record->frames_to_settle)
        record->frames_to_settle = num_frames;
    return true;
}

void command_record_free(command_record *record)
{
    free(record->times_ns);
    free(record->at_level);
    free(record->at_own_level);
    record->times_ns = NULL;
    record->at_level = record->at_own_level = NULL;
    record->num_frames = record->max_frames = record->num_pictures = record->max_pictures = 0;
}

static int compare_times(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

static int compare_shares(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The place of the value that `percent` of the sorted values do not exceed (nearest rank). */
static size_t rank_of(size_t num, unsigned percent)
{
    size_t rank = (num * percent + 99) / 100;
    return rank ? rank - 1 : 0;
}

static double percentile_ms(const uint64_t *sorted_ns, size_t num, unsigned percent)
{
    return num ? (double)sorted_ns[rank_of(num, percent)] / 1e6 : 0;
}

/* Median, p95, p99 and max of one column of the times, in ms. */
static json_t *describe_times(const command_record *record, int column, uint64_t *scratch_ns)
{
    for (size_t i = 0; i < record->num_frames; i++)
        scratch_ns[i] = record->times_ns[i * TIMES_PER_FRAME + (size_t)column];
    qsort(scratch_ns, record->num_frames, sizeof *scratch_ns, compare_times);
    return json_pack("{s:f, s:f, s:f, s:f}", "median", percentile_ms(scratch_ns, record->num_frames, 50), "p95",
                     percentile_ms(scratch_ns, record->num_frames, 95), "p99",
                     percentile_ms(scratch_ns, record->num_frames, 99), "max",
                     percentile_ms(scratch_ns, record->num_frames, 100));
}

static json_t *describe_all_times(const command_record *record)
{
    uint64_t *scratch_ns = malloc((record->num_frames + 1) * sizeof *scratch_ns);
    if (!scratch_ns)
        return NULL;
    json_t *times = json_object();
    json_object_set_new(times, "frame", describe_times(record, KARST_NUM_STAGES, scratch_ns));
    for (int stage = 0; stage < KARST_NUM_STAGES; stage++)
        json_object_set_new(times, karst_stage_name(stage), describe_times(record, stage, scratch_ns));
    free(scratch_ns);
    return times;
}

/* Median, worst hundredth and worst of the pictures; sorts them. */
static json_t *describe_at_level(const command_record *record, double *at_level)
{
    size_t num = record->num_pictures;
    if (!num)
        return json_null();
    qsort(at_level, num, sizeof *at_level, compare_shares);
    return json_pack("{s:f, s:f, s:f}", "median", at_level[rank_of(num, 50)], "p1", at_level[rank_of(num, 1)], "min",
                     at_level[0]);
}

static json_t *describe_pool(const karst_stats_pool *pool, uint64_t num_resident)
{
    return json_pack("{s:I, s:I, s:I, s:I}", "used", (json_int_t)pool->num_used, "resident", (json_int_t)num_resident,
                     "total", (json_int_t)pool->num_total, "bytes", (json_int_t)pool->size_bytes);
}

static json_t *describe_memory(const karst_stats *stats)
{
    json_t *memory = json_object();
    for (size_t i = 0; i < stats->num_memory; i++)
        json_object_set_new(memory, stats->memory[i].name, json_integer((json_int_t)stats->memory[i].size_bytes));
    return memory;
}

char *command_record_json(command_record *record)
{
    const karst_stats *last = &record->last;
    json_t *root =
        json_pack("{s:s, s:s, s:s, s:i, s:i, s:s, s:s, s:s}", "version", karst_version(), "world", record->world,
                  "camera", record->camera, "width_px", record->width_px, "height_px", record->height_px, "device",
                  last->device, "display", record->display, "display_description", record->display_description);
    if (!root)
        return NULL;
    json_object_set_new(root, "settled", json_boolean(record->settled));
    json_object_set_new(root, "path", record->path ? json_string(record->path) : json_null());
    json_object_set_new(root, "live", json_boolean(record->live));
    json_object_set_new(root, "pictures", json_integer((json_int_t)record->num_pictures));
    json_object_set_new(root, "frames", json_integer((json_int_t)record->num_frames));
    json_object_set_new(root, "frames_to_settle",
                        record->settled && !record->live ? json_integer((json_int_t)record->frames_to_settle)
                                                         : json_null());
    json_object_set_new(root, "samples", json_integer((json_int_t)last->num_samples));
    json_object_set_new(root, "elapsed_ms", json_real((double)record->elapsed_ns / 1e6));
    if (record->start_ns)
        json_object_set_new(
            root, "start_ms",
            json_pack("{s:o, s:o}", "hole_free",
                      record->hole_free_ns ? json_real((double)record->hole_free_ns / 1e6) : json_null(), "complete",
                      record->complete_ns ? json_real((double)record->complete_ns / 1e6) : json_null()));
    json_object_set_new(root, "time_ms", describe_all_times(record));
    json_object_set_new(root, "cache",
                        json_pack("{s:o, s:o}", "tiles", describe_pool(&last->tiles, last->num_resident_tiles),
                                  "bricks", describe_pool(&last->bricks, last->num_resident_bricks)));
    json_object_set_new(root, "churn",
                        json_pack("{s:I, s:I, s:I, s:I, s:I}", "requests", (json_int_t)record->num_requests, "produced",
                                  (json_int_t)record->num_produced, "evicted", (json_int_t)record->num_evicted,
                                  "reproduced", (json_int_t)record->num_reproduced, "deferred",
                                  (json_int_t)record->num_deferred));
    json_object_set_new(root, "detail",
                        json_pack("{s:f, s:f, s:o, s:o}", "asked_px", last->detail_asked_px, "given_px",
                                  last->detail_given_px, "at_level", describe_at_level(record, record->at_level),
                                  "at_own_level", describe_at_level(record, record->at_own_level)));
    json_object_set_new(root, "pixels",
                        json_pack("{s:I, s:I, s:I, s:I}", "total", (json_int_t)last->num_pixels, "hits",
                                  (json_int_t)last->num_hits, "provisional", (json_int_t)last->num_provisional,
                                  "incomplete", (json_int_t)last->num_incomplete));
    json_object_set_new(root, "non_finite", json_integer((json_int_t)last->num_non_finite));
    json_object_set_new(root, "thin",
                        json_pack("{s:I, s:I}", "raised", (json_int_t)last->num_thin_raised, "given_up",
                                  (json_int_t)last->num_thin_given_up));
    const karst_stats_caustics *light = &last->caustics;
    if (light->num_photons)
        json_object_set_new(
            root, "caustics",
            json_pack("{s:I, s:I, s:f, s:f, s:f, s:f, s:f, s:f}", "photons", (json_int_t)light->num_photons, "landed",
                      (json_int_t)light->num_landed, "emitted", light->emitted, "deposited", light->deposited,
                      "direct", light->direct, "absorbed", light->absorbed, "escaped", light->escaped, "cut_off",
                      light->cut_off));
    json_object_set_new(root, "memory_bytes", describe_memory(last));
    char *dump = json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    json_decref(root);
    if (!dump)
        return NULL;
    size_t length = strlen(dump);
    char *text = malloc(length + 2);
    if (text) {
        memcpy(text, dump, length);
        memcpy(text + length, "\n", 2);
    }
    free(dump);
    return text;
}
