/* karst bench glass --effects: what each effect costs, by size and detail, beside what a thesis measured with its own
 * renderer: "Real-time rendering of volumetric effects" on a GTX 670, figures of its chapter 4. */
#include "command_bench.h"
#include "plot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef enum { NONE, SHADOWS, REFLECTION, TRANSLUCENCY, REFRACTION, NUM_EFFECTS } effect;

/* What the body is made of, by the world's own parameter, and how it is drawn; and how many times a frame without took
 * there, where translucent bodies also refract: that is two effects here, light that passes straight, and glass. */
static const struct {
    const char *name;
    double matter;
    bool shadows, mirrors;
    double of_thesis;
} effects[NUM_EFFECTS] = {{"none", 2, false, false, 1},
                          {"shadows", 2, true, false, 1.31},
                          {"reflection", 1, false, true, 1.47},
                          {"translucency", 3, false, true, 2.87},
                          {"refraction", 0, false, true, 2.87}};

/* There the data had 512, 1024 and 2048 voxels on a side. */
static const struct {
    double detail_px, megabytes;
} memory_of_thesis[] = {{4, 34}, {2, 137}, {1, 544}};

#define MOST_IN_LIST 8
#define MOST_ROUNDS 101

typedef struct {
    double frame_ms, ratio, rays, memory_mb;
    bool is_there;
} cell;

typedef struct {
    bench *b;
    command_talk *talk;
    const karst_log *log;
    bool wanted[NUM_EFFECTS];
    int sizes_px[MOST_IN_LIST][2];
    double details_px[MOST_IN_LIST];
    size_t num_sizes, num_details, num_done;
    FILE *rows; /* where rows go as they are done; NULL: nowhere */
    const bench_effect_outputs *out;
    cell cells[MOST_IN_LIST][MOST_IN_LIST][NUM_EFFECTS]; /* by detail and size */
    karst_stats stats;
    const char *doing;
} table;

/* ---- lists ---- */

/* The next word of a list, without its comma; false: there is none left. A word may be empty. */
static bool next_word(const char **list, char *word, size_t size_bytes)
{
    if (!*list)
        return false;
    const size_t length = strcspn(*list, ",");
    snprintf(word, size_bytes, "%.*s", (int)(length < size_bytes ? length : size_bytes - 1), *list);
    *list = (*list)[length] ? *list + length + 1 : NULL;
    return true;
}

static bool parse_effects(table *t, const char *list, karst_error *error)
{
    char word[32];
    while (next_word(&list, word, sizeof word)) {
        int found = 0;
        while (found < NUM_EFFECTS && strcmp(word, effects[found].name) != 0)
            found++;
        if (found == NUM_EFFECTS)
            return karst_fail(error, KARST_USAGE,
                              "--effects: nothing is called '%s'; there are: none, shadows, reflection, translucency, "
                              "refraction",
                              word);
        t->wanted[found] = true;
    }
    t->wanted[NONE] = true; /* what the others are compared with */
    return true;
}

static bool parse_sizes(table *t, const char *list, karst_error *error)
{
    char word[32];
    while (next_word(&list, word, sizeof word)) {
        char *end, *last;
        const long width = strtol(word, &end, 10), height = *end == 'x' ? strtol(end + 1, &last, 10) : 0;
        if (*end != 'x' || last == end + 1 || *last || width < 1 || width > 16384 || height < 1 || height > 16384)
            return karst_fail(error, KARST_USAGE,
                              "--sizes: '%s' is no size; write such as 768x768,1920x1080, each side 1 to 16384", word);
        if (t->num_sizes == MOST_IN_LIST)
            return karst_fail(error, KARST_USAGE, "--sizes: %d at most", MOST_IN_LIST);
        t->sizes_px[t->num_sizes][0] = (int)width;
        t->sizes_px[t->num_sizes++][1] = (int)height;
    }
    return true;
}

static bool parse_details(table *t, const char *list, karst_error *error)
{
    char word[32];
    while (next_word(&list, word, sizeof word)) {
        char *end;
        const double detail = strtod(word, &end);
        if (end == word || *end || !(detail >= 0.25 && detail <= 64))
            return karst_fail(error, KARST_USAGE,
                              "--details: '%s' is no detail; write such as 4,2,1: pixels a voxel, each 0.25 to 64",
                              word);
        if (t->num_details == MOST_IN_LIST)
            return karst_fail(error, KARST_USAGE, "--details: %d at most", MOST_IN_LIST);
        t->details_px[t->num_details++] = detail;
    }
    return true;
}

/* ---- measuring ---- */

static bool note_frame(void *user, const karst_stats *stats)
{
    const table *t = user;
    command_progress(t->talk, "%s   %llu bricks", t->doing, (unsigned long long)stats->num_resident_bricks);
    return !command_interrupted();
}

static karst_engine *open_engine(const table *t, effect what, size_t detail, size_t size, karst_error *error)
{
    const bench *b = t->b;
    const karst_parameter matter = {"matter", effects[what].matter};
    const karst_engine_config config = {.world = b->world_file,
                                        .device = b->device,
                                        .display = KARST_DISPLAY_NONE,
                                        .parameters = &matter,
                                        .num_parameters = 1,
                                        .width_px = t->sizes_px[size][0],
                                        .height_px = t->sizes_px[size][1],
                                        .pool_bytes = (uint64_t)(b->pool_mib * 1048576),
                                        .detail_px = t->details_px[detail],
                                        .no_shadows = !effects[what].shadows,
                                        .mirror = effects[what].mirrors ? 0 : -1,
                                        .lanes = (int)b->lanes,
                                        .log = t->log};
    return karst_engine_create(&config, error);
}

static bool interrupted(const table *t, karst_error *error)
{
    return t->num_done ? karst_fail(error, KARST_FAILED, "interrupted after %zu rows, which were written", t->num_done)
                       : bench_interrupted(error);
}

static bool settle(table *t, karst_engine *engine, karst_error *error)
{
    bool settled = false;
    if (!karst_engine_settle(engine, (uint32_t)t->b->max_frames, note_frame, t, &settled, error))
        return false;
    if (command_interrupted())
        return interrupted(t, error);
    return settled || karst_fail(error, KARST_FAILED, "a view did not settle within %u frames; raise --frames-max",
                                 (unsigned)t->b->max_frames);
}

static cell make_cell(const karst_stats *stats, double *ms, double *ratios, size_t num)
{
    cell c = {.is_there = true};
    for (int stream = 0; stream < KARST_NUM_STREAMS; stream++)
        c.rays += (double)stats->num_rays[stream];
    for (size_t i = 0; i < stats->num_stores; i++)
        c.memory_mb += (double)stats->stores[i].bricks.size_bytes * (double)stats->stores[i].bricks.num_used /
                       (double)stats->stores[i].bricks.num_total * 1e-6;
    c.memory_mb += (double)stats->tiles.size_bytes * (double)stats->tiles.num_used / (double)stats->tiles.num_total *
                       1e-6 +
                   (double)stats->bricks.size_bytes * (double)stats->bricks.num_used /
                       (double)stats->bricks.num_total * 1e-6;
    c.frame_ms = bench_median(ms, num);
    c.ratio = bench_median(ratios, num);
    return c;
}

/* An effect's frames and those without any, in turns: a machine's pace changes meanwhile. */
static bool measure(table *t, karst_engine *without, effect what, size_t detail, size_t size, karst_error *error)
{
    static double ms[MOST_ROUNDS], ratios[MOST_ROUNDS];
    const size_t rounds = t->b->num_rounds < MOST_ROUNDS ? (size_t)t->b->num_rounds : MOST_ROUNDS;
    karst_engine *engine = what == NONE ? without : open_engine(t, what, detail, size, error);
    bool done = engine && settle(t, engine, error);
    double unused;
    for (size_t i = 0; done && i < rounds; i++) {
        double plain = 1;
        /* Of each the second of two frames counts: as those of a view that stands follow one another. */
        done = what == NONE || (bench_time_frame(without, &t->stats, &unused, error) &&
                                bench_time_frame(without, &t->stats, &plain, error));
        done = done && bench_time_frame(engine, &t->stats, &unused, error) &&
               bench_time_frame(engine, &t->stats, &ms[i], error);
        ratios[i] = what == NONE ? 1 : ms[i] / plain;
        done = done && (!command_interrupted() || interrupted(t, error));
    }
    if (done) {
        t->cells[detail][size][what] = make_cell(&t->stats, ms, ratios, rounds);
        t->num_done++;
    }
    if (what != NONE)
        karst_engine_destroy(engine);
    return done;
}

/* ---- what comes of it ---- */

/* Of a detail the thesis has data for; 0: it has none. */
static double thesis_megabytes(double detail_px)
{
    for (size_t i = 0; i < sizeof memory_of_thesis / sizeof *memory_of_thesis; i++)
        if (memory_of_thesis[i].detail_px == detail_px)
            return memory_of_thesis[i].megabytes;
    return 0;
}

static void print_head(FILE *file, const table *t)
{
    fprintf(file,
            "%s on %s: what effects cost, each alone, as ratio to a frame without, in turns\n"
            "thesis: with a renderer of its own on a GTX 670; its memory is of data of another kind\n\n"
            "%-7s %-10s %-13s %9s %7s %7s %10s %9s %9s\n",
            t->b->world, t->stats.device, "detail", "size", "effect", "frame ms", "ratio", "thesis", "rays",
            "in use MB", "thesis MB");
}

static void print_row(FILE *file, const table *t, effect what, size_t detail, size_t size)
{
    const cell *c = &t->cells[detail][size][what];
    char pixels[32], megabytes[32] = "-";
    snprintf(pixels, sizeof pixels, "%dx%d", t->sizes_px[size][0], t->sizes_px[size][1]);
    if (thesis_megabytes(t->details_px[detail]) > 0)
        snprintf(megabytes, sizeof megabytes, "%.0f", thesis_megabytes(t->details_px[detail]));
    fprintf(file, "%-7g %-10s %-13s %9.2f %7.2f %7.2f %10.0f %9.1f %9s\n", t->details_px[detail], pixels,
            effects[what].name, c->frame_ms, c->ratio, effects[what].of_thesis, c->rays, c->memory_mb, megabytes);
}

static size_t num_cells(const table *t)
{
    size_t num_effects = 0;
    for (int what = NONE; what < NUM_EFFECTS; what++)
        num_effects += t->wanted[what];
    return num_effects * t->num_details * t->num_sizes;
}

static char *as_json(const table *t)
{
    json_t *cells = json_array();
    for (size_t detail = 0; detail < t->num_details; detail++)
        for (size_t size = 0; size < t->num_sizes; size++)
            for (int what = NONE; what < NUM_EFFECTS; what++) {
                const cell *c = &t->cells[detail][size][what];
                if (!c->is_there)
                    continue;
                const double megabytes = thesis_megabytes(t->details_px[detail]);
                json_array_append_new(
                    cells, json_pack("{s:s, s:f, s:i, s:i, s:f, s:f, s:f, s:f, s:f, s:o}", "effect", effects[what].name,
                                     "detail_px", t->details_px[detail], "width_px", t->sizes_px[size][0], "height_px",
                                     t->sizes_px[size][1], "frame_ms", c->frame_ms, "ratio", c->ratio, "thesis_ratio",
                                     effects[what].of_thesis, "rays", c->rays, "memory_mb", c->memory_mb,
                                     "thesis_memory_mb", megabytes > 0 ? json_real(megabytes) : json_null()));
            }
    json_t *report = json_pack("{s:i, s:s, s:s, s:I, s:b, s:o}", "karst_bench_effects", 1, "world", t->b->world,
                               "device", t->stats.device, "rounds", (json_int_t)t->b->num_rounds, "complete",
                               t->num_done == num_cells(t), "cells", cells);
    char *text = report ? bench_json_text(report, JSON_INDENT(2)) : NULL;
    json_decref(report);
    return text;
}

/* A panel for each detail: ratios over pixels, and the thesis' as levels. */
static char *as_svg(const table *t, karst_error *error)
{
    static plot_panel panels[MOST_IN_LIST];
    static plot_series series[MOST_IN_LIST][NUM_EFFECTS];
    static double x[MOST_IN_LIST], y[MOST_IN_LIST][NUM_EFFECTS][MOST_IN_LIST];
    static char titles[MOST_IN_LIST][64];
    static plot_level levels[NUM_EFFECTS];
    static char names[NUM_EFFECTS][48];
    size_t num_levels = 0;
    for (int what = NONE + 1; what < NUM_EFFECTS; what++)
        if (t->wanted[what]) {
            snprintf(names[what], sizeof names[what], "thesis: %s %.2f", effects[what].name, effects[what].of_thesis);
            levels[num_levels++] = (plot_level){names[what], effects[what].of_thesis};
        }
    for (size_t size = 0; size < t->num_sizes; size++)
        x[size] = t->sizes_px[size][0] * (double)t->sizes_px[size][1] * 1e-6;
    for (size_t detail = 0; detail < t->num_details; detail++) {
        size_t num = 0;
        for (int what = NONE; what < NUM_EFFECTS; what++) {
            for (size_t size = 0; size < t->num_sizes; size++)
                y[detail][what][size] =
                    t->cells[detail][size][what].is_there ? t->cells[detail][size][what].ratio : NAN;
            if (t->wanted[what])
                series[detail][num++] = (plot_series){.name = effects[what].name,
                                                      .kind = PLOT_POINTS,
                                                      .num = t->num_sizes,
                                                      .x = x,
                                                      .y = y[detail][what]};
        }
        snprintf(titles[detail], sizeof titles[detail], "voxels of %g pixels", t->details_px[detail]);
        panels[detail] = (plot_panel){.title = titles[detail],
                                      .x = {.label = "million pixels"},
                                      .y = {.label = "frame / frame without effects"},
                                      .series = series[detail],
                                      .num_series = num,
                                      .levels = levels,
                                      .num_levels = num_levels,
                                      .height = 1};
    }
    const plot_page page = {.title = "What effects cost",
                            .subtitle = t->stats.device,
                            .width_pt = 900,
                            .height_pt = 100 + 260 * (double)t->num_details,
                            .panels = panels,
                            .num_panels = t->num_details};
    return plot_svg(&page, error);
}

static bool write_text(const char *file, char *text, karst_error *error)
{
    const bool written = text ? command_write_text(file, text, error)
                              : error->status != KARST_OK || karst_fail(error, KARST_FAILED, "out of memory");
    free(text);
    return written && error->status == KARST_OK;
}

static bool is_stdout(const char *file) { return file && strcmp(file, "-") == 0; }

/* Files, or what of them goes to stdout. */
static bool write_outputs(const table *t, bool to_stdout, karst_error *error)
{
    const bench_effect_outputs *out = t->out;
    command_hold_interrupts(true);
    const bool written =
        (!out->json || is_stdout(out->json) != to_stdout || write_text(out->json, as_json(t), error)) &&
        (!out->plot || is_stdout(out->plot) != to_stdout || write_text(out->plot, as_svg(t, error), error));
    command_hold_interrupts(false);
    return written;
}

/* Once it is measured: a table takes long, and who ends it is to keep what there is. */
static bool show_row(table *t, effect what, size_t detail, size_t size, karst_error *error)
{
    command_end_progress(t->talk);
    if (t->rows) {
        if (t->num_done == 1)
            print_head(t->rows, t);
        print_row(t->rows, t, what, detail, size);
        fflush(t->rows);
    }
    return write_outputs(t, false, error);
}

static bool measure_all(table *t, karst_error *error)
{
    char doing[96];
    t->doing = doing;
    bool done = true;
    for (size_t detail = 0; done && detail < t->num_details; detail++)
        for (size_t size = 0; done && size < t->num_sizes; size++) {
            karst_engine *without = NULL;
            for (int what = NONE; done && what < NUM_EFFECTS; what++) {
                if (!t->wanted[what])
                    continue;
                snprintf(doing, sizeof doing, "%dx%d, detail %g: %s", t->sizes_px[size][0], t->sizes_px[size][1],
                         t->details_px[detail], effects[what].name);
                if (what == NONE)
                    done = (without = open_engine(t, NONE, detail, size, error)) != NULL;
                done = done && measure(t, without, (effect)what, detail, size, error) &&
                       show_row(t, (effect)what, detail, size, error);
            }
            karst_engine_destroy(without);
        }
    command_end_progress(t->talk);
    return done;
}

bool bench_effects(bench *b, const bench_effect_lists *lists, const bench_effect_outputs *out, command_talk *talk,
                   karst_error *error)
{
    static table t;
    t = (table){.b = b, .talk = talk};
    if (strcmp(b->world, "glass") != 0)
        return karst_fail(error, KARST_USAGE,
                          "--effects, --sizes and --details are about the world glass: karst bench glass --effects "
                          "none,shadows");
    const char *all = "none,shadows,reflection,translucency,refraction";
    if (!parse_effects(&t, lists->effects ? lists->effects : all, error) ||
        !parse_sizes(&t, lists->sizes ? lists->sizes : "768x768,1024x1024,1920x1080", error) ||
        !parse_details(&t, lists->details ? lists->details : "4,2,1", error))
        return false;
    command_catch_interrupts();
    command_open_driver(talk);
    const karst_log log = command_log(talk);
    t.log = &log;
    t.out = out;
    t.rows = is_stdout(out->json) || is_stdout(out->plot) ? NULL : stdout;
    const bool measured = measure_all(&t, error);
    karst_error of_writing = {0};
    const bool written = !t.num_done || write_outputs(&t, true, measured ? error : &of_writing);
    return measured && written;
}
