/* What the parts of karst bench share.
 *
 *   command_bench.c          options; the order of things; the table on stdout
 *   command_bench_run.c      runs: start, settle, rounds of settled frames beside floor and ceilings, the flight
 *   command_bench_report.c   figures of the runs as JSON and CSV
 *   command_bench_chart.c    the SVG and the trace
 *   command_bench_smoke.c    particles that move, and groups, beside the figures of a thesis
 *   command_bench_compare.c  two reports side by side
 *   command_bench_table.c    what effects cost, by size and detail
 *   command_bench_points.c   models of points, as surfaces and as discs
 */
#ifndef KARST_DEMOS_COMMAND_BENCH_H
#define KARST_DEMOS_COMMAND_BENCH_H

#include "command.h"

#include <jansson.h>

/* When a frame was drawn. */
typedef enum {
    BENCH_SETTLING,
    BENCH_SETTLED, /* each after another frame */
    BENCH_COLD,    /* the same after memory was copied: nothing of the picture is in caches */
    BENCH_FLIGHT,
    BENCH_BESIDE, /* of a second engine, in turns with those of the first */
    BENCH_NUM_PHASES
} bench_phase;
/* As reports and traces have them. */
extern const char *const bench_phase_names[BENCH_NUM_PHASES];

/* What a second engine shows, if there is one. */
typedef enum {
    BENCH_BESIDE_NOTHING,
    BENCH_BESIDE_NO_SHADOWS, /* the same view without shadows, beside settled frames */
    BENCH_BESIDE_NO_MIRROR,  /* the same without mirrors, in the bytes of a picture's short way */
    BENCH_BESIDE_STANDING,   /* the view where the flight begins, beside the flight's frames */
    BENCH_NUM_BESIDE
} bench_beside;
/* As --beside and reports have them; of BENCH_BESIDE_NOTHING: NULL. */
extern const char *const bench_beside_names[BENCH_NUM_BESIDE];
/* A second engine's frames come before every so many of the flight. */
#define BENCH_STANDING_EVERY 15u

/* One frame, and what of its statistics is kept. */
typedef struct {
    bench_phase phase;
    unsigned run;
    size_t index;      /* within its phase of its run; of a second engine's: of the frame that comes next */
    double time_s;     /* of the flight; of settling: since its start */
    uint64_t ended_ns; /* on karst_clock */
    uint64_t frame_ns, production_ns, cpu_ns, stage_ns[KARST_NUM_STAGES];
    uint64_t num_rays[KARST_NUM_STREAMS], stream_ns[KARST_NUM_STREAMS];
    uint64_t num_requests, num_produced, num_evicted, num_reproduced, num_deferred;
    uint64_t num_tiles, num_bricks, num_constant; /* produced */
    uint64_t num_pixels, num_hits, num_provisional, num_incomplete;
    uint64_t used_tiles, used_bricks, resident_tiles, resident_bricks;
    double given_px;
    uint64_t num_coarser;
} bench_frame;

/* Of one run, what is no frame's. Times in ms. */
typedef struct {
    double opened_ms; /* display, device, memory and programs, from the start of the run (of the process, in run 0) */
    double hole_free_ms; /* until the first frame in which every ray met data */
    double complete_ms;  /* until the first settled frame */
    size_t settling_frames;
    uint64_t hit_bricks; /* in which rays of the settled picture ended */
} bench_run;

#define BENCH_MAX_RUNS 50
#define BENCH_MAX_ROUNDS 1000

typedef struct {
    /* as asked for */
    const char *world, *path; /* path: NULL for none */
    char world_file[4096], path_file[4096];
    const char *camera, *device;
    karst_display_kind display_kind;
    int size_px[2];
    uint64_t num_runs, num_rounds, seed, brick_bits, lanes, max_frames, num_pictures;
    double pool_mib, detail_px, view_distance_m, budget_ms, fps;
    double mirror;
    bool has_size, has_seed, no_shadows, no_blend, no_beam, refine, has_mirror, occlusion, no_occlusion;
    karst_scattering scattering;
    const char *edits;
    bench_beside beside;
    command_parameters parameters;
    karst_helper *helper; /* shares the compiling of the first start; NULL: none */
    uint64_t process_start_ns;

    /* as found */
    char display[64], camera_text[512];
    karst_stats settled; /* of the last run's settled view: device, memory, pools */
    int num_cores;
    bench_frame *frames;
    size_t num_frames, max_frames_kept;
    bench_run runs[BENCH_MAX_RUNS];
    unsigned runs_done;
    karst_ceilings *ceilings; /* num_rounds of each run */
    karst_span *spans;        /* of the last run, with tracing */
    size_t num_spans, max_spans;
    bool tracing;
} bench;

/* command_bench_run.c. Does one run and adds what it finds. Errors: as the library's. */
bool bench_do_run(bench *b, command_talk *talk, const karst_log *log, karst_error *error);

/* `is_beside`: the second engine, which has no display: it would have to be made current in every turn. */
karst_engine *bench_open_engine(bench *b, bool is_beside, const karst_log *log, karst_error *error);
/* To where the run looks at first: --camera, the path's start, or the world's own view. */
bool bench_set_first_camera(bench *b, karst_engine *engine, const karst_path *path, karst_error *error);

/* One frame, its statistics and its ms: CPU time over the cores where that is known, as what else runs on the machine
 * does not count then. Errors: as the library's, and KARST_FAILED where one is interrupted. */
bool bench_time_frame(karst_engine *engine, karst_stats *stats, double *ms, karst_error *error);
double bench_median(double *values, size_t num); /* which are sorted */
bool bench_interrupted(karst_error *error);      /* false, and says so */

/* command_bench_smoke.c. The tables of --particles and --groups, lists of numbers or NULL, on stdout and as JSON (NULL:
 * none; -: stdout). Errors: KARST_USAGE, and as the library's. */
bool bench_smoke(bench *b, const char *particles, const char *groups, const char *json, command_talk *talk,
                 const karst_log *log, karst_error *error);

/* command_bench_points.c. The table of --points on stdout and as JSON, likewise. Errors: KARST_USAGE, and as the
 * library's. */
bool bench_points(bench *b, const char *json, command_talk *talk, karst_error *error);

/* command_bench_report.c. The report; NULL: out of memory. */
json_t *bench_report(const bench *b);
/* Lines of all frames, malloc'ed. NULL: out of memory. */
char *bench_csv(const bench *b);
/* JSON as a file's text, malloc'ed. */
char *bench_json_text(const json_t *json, size_t flags);

/* command_bench_chart.c. malloc'ed texts. */
char *bench_chart(const bench *b, karst_error *error);
char *bench_trace(const bench *b, karst_error *error);

/* command_bench_compare.c. Prints a table of ratios, this run to the report in `file`. Errors: KARST_BAD_DATA. */
bool bench_compare(const json_t *report, const char *file, FILE *out, karst_error *error);
/* Whether `file` holds a report, before long work is done for it. Errors: KARST_BAD_DATA. */
bool bench_compare_check(const char *file, karst_error *error);

/* command_bench_table.c. Lists as options give them; NULL: the usual ones. */
typedef struct {
    const char *effects, *sizes, *details;
} bench_effect_lists;
/* Files; NULL: none. */
typedef struct {
    const char *json, *plot;
} bench_effect_outputs;
/* Measures each effect on the world glass and writes the table. Errors: KARST_USAGE, and as the library's. */
bool bench_effects(bench *b, const bench_effect_lists *lists, const bench_effect_outputs *out, command_talk *talk,
                   karst_error *error);

#endif
