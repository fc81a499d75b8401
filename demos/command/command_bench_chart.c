/* karst bench: the chart of the last run's flight (or of its settling, without a path), and the trace. */
#include "command_bench.h"
#include "plot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NUM_COUNTS 4
#define MAX_COLUMNS 1200 /* of a chart: more frames than these are put together, the worst of them shown */

typedef struct {
    size_t num;
    double *time_s, *stage_ms[KARST_NUM_STAGES], *frame_ms, *counts[NUM_COUNTS], *at_level;
    double *memory;
} columns;

static double larger(double a, double b) { return a > b ? a : b; }

/* The frames of the last run's phase, in columns. */
static bool make_columns(const bench *b, bench_phase phase, columns *c)
{
    size_t num_frames = 0, seen = 0;
    for (size_t i = 0; i < b->num_frames; i++)
        num_frames += b->frames[i].phase == phase && b->frames[i].run + 1 == b->runs_done;
    size_t each = (num_frames + MAX_COLUMNS - 1) / MAX_COLUMNS;
    const size_t num_rows = 3 + KARST_NUM_STAGES + NUM_COUNTS;
    each = each ? each : 1;
    c->num = (num_frames + each - 1) / each;
    c->memory = calloc(num_rows * (c->num + 1), sizeof *c->memory);
    if (!c->memory)
        return false;
    double *row = c->memory;
    double **rows[3 + KARST_NUM_STAGES + NUM_COUNTS] = {&c->time_s, &c->frame_ms, &c->at_level};
    for (int stage = 0; stage < KARST_NUM_STAGES; stage++)
        rows[3 + stage] = &c->stage_ms[stage];
    for (int count = 0; count < NUM_COUNTS; count++)
        rows[3 + KARST_NUM_STAGES + count] = &c->counts[count];
    for (size_t i = 0; i < num_rows; i++, row += c->num + 1)
        *rows[i] = row;
    for (size_t i = 0; i < b->num_frames; i++) {
        const bench_frame *f = &b->frames[i];
        if (f->phase != phase || f->run + 1 != b->runs_done)
            continue;
        size_t column = seen++ / each;
        double share = f->num_hits ? 100 * (1 - (double)f->num_provisional / (double)f->num_hits) : 100;
        if (seen % each == 1 || each == 1) {
            c->time_s[column] = f->time_s;
            c->at_level[column] = share;
        }
        c->at_level[column] = fmin(c->at_level[column], share);
        /* The stages of the slowest frame, so that they add up. */
        if ((double)f->frame_ns * 1e-6 >= c->frame_ms[column]) {
            c->frame_ms[column] = (double)f->frame_ns * 1e-6;
            for (int stage = 0; stage < KARST_NUM_STAGES; stage++)
                c->stage_ms[stage][column] = (double)f->stage_ns[stage] * 1e-6;
        }
        const uint64_t counts[NUM_COUNTS] = {f->num_requests, f->num_produced, f->num_evicted, f->num_reproduced};
        for (int count = 0; count < NUM_COUNTS; count++)
            c->counts[count][column] = larger(c->counts[count][column], (double)counts[count]);
    }
    return true;
}

static double median_settled_ms(const bench *b)
{
    double sum = 0;
    size_t num = 0;
    for (size_t i = 0; i < b->num_frames; i++)
        if (b->frames[i].phase == BENCH_SETTLED && b->frames[i].run + 1 == b->runs_done) {
            sum += (double)b->frames[i].frame_ns * 1e-6;
            num++;
        }
    return num ? sum / (double)num : 0;
}

char *bench_chart(const bench *b, karst_error *error)
{
    columns c;
    bench_phase phase = b->path ? BENCH_FLIGHT : BENCH_SETTLING;
    if (!make_columns(b, phase, &c)) {
        karst_fail(error, KARST_FAILED, "out of memory for a chart");
        return NULL;
    }
    plot_series times[KARST_NUM_STAGES + 1], counts[NUM_COUNTS];
    static const char *const names[NUM_COUNTS] = {"requests", "produced", "evicted", "produced again"};
    for (int stage = 0; stage < KARST_NUM_STAGES; stage++)
        times[stage + 1] = (plot_series){
            .name = karst_stage_name(stage), .kind = PLOT_STACKED, .num = c.num, .x = c.time_s, .y = c.stage_ms[stage]};
    times[0] =
        (plot_series){.name = "frame (wall clock)", .kind = PLOT_LINE, .num = c.num, .x = c.time_s, .y = c.frame_ms};
    for (int count = 0; count < NUM_COUNTS; count++)
        counts[count] =
            (plot_series){.name = names[count], .kind = PLOT_LINE, .num = c.num, .x = c.time_s, .y = c.counts[count]};
    plot_series at_level = {.name = "at their level", .kind = PLOT_LINE, .num = c.num, .x = c.time_s, .y = c.at_level};
    plot_level settled = {"settled frame", median_settled_ms(b)};
    const char *label = b->path ? "flight (s)" : "since the first frame began (s)";
    const plot_panel panels[] = {
        {.title = "Time of a frame by stage (device time, stacked)",
         .x = {.label = label},
         .y = {.label = "ms"},
         .series = times,
         .num_series = KARST_NUM_STAGES + 1,
         .levels = &settled,
         .num_levels = 1,
         .height = 3},
        {.title = "Requests and churn",
         .x = {.label = label},
         .y = {.label = "a frame", .logarithmic = true, .min = 1, .max = 20000},
         .series = counts,
         .num_series = NUM_COUNTS,
         .height = 2},
        {.title = "Hits at the level asked for",
         .x = {.label = label},
         .y = {.label = "%", .min = 0, .max = 100},
         .series = &at_level,
         .num_series = 1,
         .height = 1},
    };
    char title[300], subtitle[300];
    snprintf(title, sizeof title, "karst bench %s%s%s", b->world, b->path ? " --path " : "", b->path ? b->path : "");
    snprintf(subtitle, sizeof subtitle, "%dx%d, %s shadows, %s, run %u of %u", b->size_px[0], b->size_px[1],
             b->no_shadows ? "no" : "sun", b->settled.device, b->runs_done, b->runs_done);
    const plot_page page = {.title = title,
                            .subtitle = subtitle,
                            .width_pt = 1000,
                            .height_pt = 760,
                            .panels = panels,
                            .num_panels = sizeof panels / sizeof *panels};
    char *svg = plot_svg(&page, error);
    free(c.memory);
    return svg;
}

/* ---- trace: https://ui.perfetto.dev and chrome://tracing read it ---- */

#define TRACE_FRAMES KARST_NUM_TRACKS /* a track of their own, after the engine's */

static void name_track(json_t *events, int track, const char *name)
{
    json_array_append_new(events, json_pack("{s:s, s:s, s:i, s:i, s:{s:s}}", "name", "thread_name", "ph", "M", "pid", 1,
                                            "tid", track, "args", "name", name));
    json_array_append_new(events,
                          json_pack("{s:s, s:s, s:i, s:i, s:{s:i}}", "name", "thread_sort_index", "ph", "M", "pid", 1,
                                    "tid", track, "args", "sort_index", track == TRACE_FRAMES ? -1 : track));
}

static void add_counter(json_t *events, const char *name, double time_us, const char *const *names,
                        const uint64_t *values, size_t num)
{
    json_t *args = json_object();
    for (size_t i = 0; i < num; i++)
        json_object_set_new(args, names[i], json_integer((json_int_t)values[i]));
    json_array_append_new(
        events, json_pack("{s:s, s:s, s:f, s:i, s:o}", "name", name, "ph", "C", "ts", time_us, "pid", 1, "args", args));
}

char *bench_trace(const bench *b, karst_error *error)
{
    static const char *const churn[] = {"requests", "produced", "evicted"};
    json_t *events = json_array();
    uint64_t first_ns = UINT64_MAX;
    for (size_t i = 0; i < b->num_spans; i++)
        first_ns = b->spans[i].start_ns < first_ns ? b->spans[i].start_ns : first_ns;
    for (size_t i = 0; i < b->num_frames; i++)
        if (b->frames[i].run + 1 == b->runs_done && b->frames[i].ended_ns - b->frames[i].frame_ns < first_ns)
            first_ns = b->frames[i].ended_ns - b->frames[i].frame_ns;
    json_array_append_new(events, json_pack("{s:s, s:s, s:i, s:{s:s}}", "name", "process_name", "ph", "M", "pid", 1,
                                            "args", "name", "karst bench"));
    name_track(events, TRACE_FRAMES, "frames");
    name_track(events, KARST_TRACK_HOST, "host thread");
    name_track(events, KARST_TRACK_QUEUE, "device queue");
    for (size_t i = 0; i < b->num_frames; i++) {
        const bench_frame *f = &b->frames[i];
        if (f->run + 1 != b->runs_done)
            continue;
        char name[64];
        snprintf(name, sizeof name, "%s %zu", bench_phase_names[f->phase], f->index);
        double start_us = (double)(f->ended_ns - f->frame_ns - first_ns) * 1e-3;
        json_array_append_new(events, json_pack("{s:s, s:s, s:s, s:f, s:f, s:i, s:i}", "name", name, "cat", "frame",
                                                "ph", "X", "ts", start_us, "dur", (double)f->frame_ns * 1e-3, "pid", 1,
                                                "tid", TRACE_FRAMES));
        const uint64_t values[] = {f->num_requests, f->num_produced, f->num_evicted};
        add_counter(events, "churn", start_us, churn, values, 3);
    }
    for (size_t i = 0; i < b->num_spans; i++) {
        const karst_span *s = &b->spans[i];
        json_array_append_new(events, json_pack("{s:s, s:s, s:s, s:f, s:f, s:i, s:i}", "name", s->name, "cat",
                                                karst_stage_name(s->stage), "ph", "X", "ts",
                                                (double)(s->start_ns - first_ns) * 1e-3, "dur",
                                                (double)(s->end_ns - s->start_ns) * 1e-3, "pid", 1, "tid", s->track));
    }
    json_t *root = json_pack("{s:o, s:s}", "traceEvents", events, "displayTimeUnit", "ms");
    /* Microseconds with three digits behind the point need more digits than other figures. */
    char *dump = root ? json_dumps(root, JSON_COMPACT | JSON_REAL_PRECISION(15)) : NULL;
    json_decref(root);
    if (!dump)
        karst_fail(error, KARST_FAILED, "out of memory for a trace");
    return dump;
}
