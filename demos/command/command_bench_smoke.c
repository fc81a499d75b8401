/* karst bench WORLD --particles, --groups: what a frame takes as particles move, and as the sun does, beside the
 * figures of the thesis that the world smoke follows. */
#include "command_bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MAX_ROWS 32u
#define MAX_FRAMES 200u
#define DEFAULT_FRAMES 20u
#define STEP_S (1.0 / 30)
#define TURN_DEG 1.0
#define FIRST_AZIMUTH_DEG 200.0
#define ELEVATION_DEG 50.0
#define GROUPS_PARTICLES 1024 /* of both tubes, as the thesis has them */

/* What is measured of a frame, in ms. */
enum { FRAME, MOVE, MEDIA, SUN_DEPTH, PRODUCTION, NUM_FIGURES };
static const char *const figure_names[NUM_FIGURES] = {"frame_ms", "move_ms", "media_ms", "sun_depth_ms",
                                                      "production_ms"};

typedef struct {
    uint32_t number; /* particles, or groups */
    double median_ms[NUM_FIGURES];
} row;

/* Tables B.1 and B.3 of L. Mattsson, "Simulating Optical Depth for Participating Media Using Ray Tracing" (Lund 2022),
 * in ms: a whole frame, and its passes of optical depth (tracing and counting) together. */
typedef struct {
    uint32_t number;
    double frame_ms, sun_depth_ms;
} thesis_row;
static const thesis_row of_particles[] = {{250, 1.7041, 0.2203},  {500, 2.2836, 0.2632},  {750, 2.6057, 0.2531},
                                          {1000, 2.8396, 0.2592}, {1250, 2.9780, 0.2682}, {1500, 3.2789, 0.2828}};
static const thesis_row of_groups[] = {{1, 2.8231, 0.2523}, {2, 2.8007, 0.2218},  {4, 2.7958, 0.2220},
                                       {8, 2.7939, 0.1976}, {16, 2.7515, 0.1636}, {32, 2.7826, 0.1608}};
#define NUM_THESIS_ROWS (sizeof of_particles / sizeof *of_particles)

typedef struct {
    const bench *b;
    command_talk *talk;
    uint32_t num_frames, num_turns;
    double samples_ms[NUM_FIGURES][MAX_FRAMES];
} measuring;

/* "250,500,750" */
static bool parse_list(const char *text, const char *option, uint32_t most, uint32_t *numbers, uint32_t *num,
                       karst_error *error)
{
    *num = 0;
    while (text && *text) {
        char *end;
        const unsigned long number = strtoul(text, &end, 10);
        if (end == text || *text == '-' || (*end && *end != ',') || number < 1 || number > most || *num == MAX_ROWS)
            return karst_fail(error, KARST_USAGE, "--%s: up to %u whole numbers from 1 to %u, such as 250,500,1500",
                              option, MAX_ROWS, most);
        numbers[(*num)++] = (uint32_t)number;
        text = *end ? end + 1 : end;
    }
    return true;
}

static int compare_doubles(const void *a, const void *b)
{
    const double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

static void add_frame(measuring *m, uint32_t index, double frame_ms, double move_ms, const karst_stats *stats)
{
    const uint64_t *ns = stats->time_ns;
    m->samples_ms[FRAME][index] = frame_ms;
    m->samples_ms[MOVE][index] = move_ms;
    m->samples_ms[MEDIA][index] = (double)ns[KARST_STAGE_MEDIA] * 1e-6;
    m->samples_ms[SUN_DEPTH][index] = (double)ns[KARST_STAGE_SUN_DEPTH] * 1e-6;
    m->samples_ms[PRODUCTION][index] =
        (double)(ns[KARST_STAGE_SUBDIVIDE] + ns[KARST_STAGE_EVALUATE] + ns[KARST_STAGE_FINALISE]) * 1e-6;
}

/* One frame after the world has moved: its particles by a step of time, or else its sun. */
static bool draw_one(measuring *m, karst_engine *engine, uint32_t index, bool moves_sun, karst_error *error)
{
    const uint64_t start_ns = karst_clock();
    const karst_sun sun = {fmod(FIRST_AZIMUTH_DEG + TURN_DEG * m->num_turns, 360), ELEVATION_DEG};
    karst_stats stats;
    m->num_turns += moves_sun;
    if (!(moves_sun ? karst_engine_set_sun(engine, &sun, error)
                    : karst_engine_set_time(engine, karst_engine_time(engine) + STEP_S, error)))
        return false;
    const uint64_t moved_ns = karst_clock();
    if (!karst_engine_frame(engine, error))
        return false;
    karst_engine_stats(engine, &stats);
    add_frame(m, index, (double)(karst_clock() - start_ns) * 1e-6, (double)(moved_ns - start_ns) * 1e-6, &stats);
    return true;
}

static bool measure(measuring *m, karst_engine *engine, uint32_t groups, row *to, karst_error *error)
{
    const uint32_t num_warm = 2;
    bool settled;
    if (!karst_engine_set_media_groups(engine, groups ? groups : 1, error) ||
        !karst_engine_settle(engine, (uint32_t)m->b->max_frames, NULL, NULL, &settled, error))
        return false;
    for (uint32_t i = 0; i < num_warm + m->num_frames; i++) {
        if (command_interrupted())
            return command_fail_interrupted(error, "interrupted");
        command_progress(m->talk, "%u %s   frame %u of %u", to->number, groups ? "groups" : "particles", i,
                         m->num_frames);
        if (!draw_one(m, engine, i < num_warm ? 0 : i - num_warm, groups > 0, error))
            return false;
    }
    for (int figure = 0; figure < NUM_FIGURES; figure++) {
        qsort(m->samples_ms[figure], m->num_frames, sizeof(double), compare_doubles);
        to->median_ms[figure] = m->samples_ms[figure][m->num_frames / 2];
    }
    return true;
}

static bool set_particles(karst_engine *engine, uint32_t of_both_tubes, karst_error *error)
{
    const karst_parameter each = {"particles", of_both_tubes / 2.0};
    return karst_engine_set_parameters(engine, &each, 1, error);
}

/* ---- what is said ---- */

static const thesis_row *find(const thesis_row *rows, uint32_t number)
{
    for (size_t i = 0; i < NUM_THESIS_ROWS; i++)
        if (rows[i].number == number)
            return &rows[i];
    return NULL;
}

static void print_rows(const char *what, const row *rows, uint32_t num, const thesis_row *thesis)
{
    printf("\n%10s %9s %9s %9s %9s %10s   thesis: %7s %9s\n", what, "frame ms", "move", "media", "sun depth",
           "production", "frame", "sun depth");
    for (uint32_t i = 0; i < num; i++) {
        const double *ms = rows[i].median_ms;
        const thesis_row *of = find(thesis, rows[i].number);
        printf("%10u %9.3f %9.3f %9.3f %9.3f %10.3f", rows[i].number, ms[FRAME], ms[MOVE], ms[MEDIA], ms[SUN_DEPTH],
               ms[PRODUCTION]);
        if (of)
            printf("           %7.3f %9.3f", of->frame_ms, of->sun_depth_ms);
        putchar('\n');
    }
}

static json_t *describe_rows(const char *what, const row *rows, uint32_t num, const thesis_row *thesis)
{
    json_t *list = json_array();
    for (uint32_t i = 0; i < num; i++) {
        json_t *object = json_object();
        const thesis_row *of = find(thesis, rows[i].number);
        json_object_set_new(object, what, json_integer(rows[i].number));
        for (int figure = 0; figure < NUM_FIGURES; figure++)
            json_object_set_new(object, figure_names[figure], json_real(rows[i].median_ms[figure]));
        if (of)
            json_object_set_new(object, "thesis",
                                json_pack("{s:f,s:f}", "frame_ms", of->frame_ms, "sun_depth_ms", of->sun_depth_ms));
        json_array_append_new(list, object);
    }
    return list;
}

static bool write_report(const bench *b, const char *file, const char *device, uint32_t num_frames, json_t *particles,
                         json_t *groups, karst_error *error)
{
    json_t *report = json_pack("{s:s,s:s,s:s,s:i,s:i,s:i,s:o,s:o}", "report", "particles", "world", b->world, "device",
                               device, "width_px", b->size_px[0], "height_px", b->size_px[1], "frames", (int)num_frames,
                               "particles", particles, "groups", groups);
    char *text = report ? bench_json_text(report, JSON_INDENT(2)) : NULL;
    const bool written =
        text ? command_write_text(file, text, error) : karst_fail(error, KARST_FAILED, "out of memory for the report");
    free(text);
    json_decref(report);
    return written;
}

bool bench_smoke(bench *b, const char *particles, const char *groups, const char *json, command_talk *talk,
                 const karst_log *log, karst_error *error)
{
    static measuring m;
    uint32_t numbers[2][MAX_ROWS], num[2];
    row rows[2][MAX_ROWS] = {{{0}}};
    double value;
    karst_stats stats;
    m = (measuring){.b = b, .talk = talk, .num_frames = DEFAULT_FRAMES};
    if (b->num_pictures)
        m.num_frames = b->num_pictures < MAX_FRAMES ? (uint32_t)b->num_pictures : MAX_FRAMES;
    if (!parse_list(particles, "particles", 1000000, numbers[0], &num[0], error) ||
        !parse_list(groups, "groups", KARST_ENGINE_MAX_MEDIA_GROUPS, numbers[1], &num[1], error))
        return false;
    karst_engine *engine = bench_open_engine(b, false, log, error);
    bool done = engine && bench_set_first_camera(b, engine, NULL, error);
    if (done && !karst_engine_parameter(engine, "particles", &value, NULL))
        done = karst_fail(error, KARST_USAGE,
                          "--particles and --groups: %s has no parameter \"particles\"; smoke has, for each of its two "
                          "tubes",
                          b->world);
    for (uint32_t i = 0; done && i < num[0]; i++) {
        rows[0][i].number = numbers[0][i];
        done = set_particles(engine, numbers[0][i], error) && measure(&m, engine, 0, &rows[0][i], error);
    }
    if (done && num[1])
        done = set_particles(engine, GROUPS_PARTICLES, error);
    for (uint32_t i = 0; done && i < num[1]; i++) {
        rows[1][i].number = numbers[1][i];
        done = measure(&m, engine, numbers[1][i], &rows[1][i], error);
    }
    command_end_progress(talk);
    if (done) {
        karst_engine_stats(engine, &stats);
        if (!json || strcmp(json, "-") != 0) {
            printf("%s, %dx%d, %s: medians of %u frames, one sample a pixel\n", b->world, b->size_px[0], b->size_px[1],
                   stats.device, m.num_frames);
            if (num[0])
                print_rows("particles", rows[0], num[0], of_particles);
            if (num[1])
                print_rows("groups", rows[1], num[1], of_groups);
            puts("\nparticles: all move, 1/30 s a frame. groups: 1024 particles stand and the sun turns a degree a\n"
                 "frame, where those of the thesis move. move: finding where they are, and forgetting what they meet.\n"
                 "production: bricks. thesis: tables B.1 and B.3 of L. Mattsson, Lund 2022, at 1024x1024 on an\n"
                 "RTX 2080 Ti.");
        }
        done = !json || write_report(b, json, stats.device, m.num_frames,
                                     describe_rows("particles", rows[0], num[0], of_particles),
                                     describe_rows("groups", rows[1], num[1], of_groups), error);
    }
    karst_engine_destroy(engine);
    return done;
}
