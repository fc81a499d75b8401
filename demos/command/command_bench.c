/* karst bench: frame time by stage, production, churn and memory, beside what the device can do at most. */
#include "command_bench.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    const char *json, *csv, *plot, *trace, *compare, *display, *beside, *particles, *groups, *scattering;
    bench_effect_lists lists;
    bool help, points;
} outputs;

static void print_help(const command_option *options, size_t num_options)
{
    puts(
        "karst bench WORLD [--path PATH] [OPTIONS]\n"
        "karst bench smoke --particles N,... --groups N,... [OPTIONS]\n"
        "karst bench WORLD --points [OPTIONS]\n"
        "Measures a world's view, and a flight along a path: each run starts afresh, settles, draws settled frames in\n"
        "turns with a floor and ceilings of the device, and then flies. Prints a table; ratios are what counts.\n"
        "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nWorlds (or the path of a world file, which ends in .karst):");
    command_print_worlds(stdout);
    puts("\nExamples:\n"
         "  karst bench hills --size 800x600 --no-shadows\n"
         "  karst bench hills --path low-flight --size 800x600 --budget 8 --plot flight.svg --json now.json\n"
         "  karst bench hills --compare then.json\n"
         "  karst bench glass --effects none,shadows,reflection,translucency --plot effects.svg\n"
         "  karst bench smoke --particles 250,500,750,1000,1250,1500 --groups 1,2,4,8,16,32 --frames 30\n"
         "  karst bench rabbit.karst --points --json points.json\n"
         "  karst bench karst --trace karst.json          (to be opened in ui.perfetto.dev or chrome://tracing)\n"
         "\nsettled frame: after another one, as a view that stands is drawn; with empty caches: after memory was "
         "copied.\n"
         "floor: for each ray 8 dependent reads of a node table and 8 trilinear samples of a brick, nothing else.\n"
         "jank: the share of frames that take more than twice the median.\n"
         "beside: a second engine takes the pools once more, and has no display. no-shadows, no-mirror: the same view\n"
         "without, after each settled frame; standing: where the path begins, before every 15th frame of the flight.\n"
         "\nExit code: 0 done, 1 failed or not settled, 2 wrong usage, 3 no usable device, 4 no such world,\n"
         "5 a path or a report that cannot be read.");
}

static bool parse_options(int argc, char **argv, command_talk *talk, bench *b, outputs *out, karst_error *error)
{
    const command_option options[] = {
        {"size", 0, COMMAND_SIZE, "WxH", "pixels (default: 800x600; of --points 512x512)", b->size_px, 1, 16384,
         &b->has_size},
        {"camera", 0, COMMAND_TEXT, "X,Y,Z,YAW,PITCH[,FOV]",
         "metres, exact at any distance, and degrees (default: the world's)", &b->camera, 0, 0, NULL},
        {"path", 0, COMMAND_TEXT, "PATH", "fly: a file, or walk, low-flight, orbit, dive or jump", &b->path, 0, 0,
         NULL},
        {"budget", 0, COMMAND_NUMBER, "MS", "of production a frame of the flight (default: 8)", &b->budget_ms, 0.001,
         60000, NULL},
        {"fps", 0, COMMAND_NUMBER, "F", "frames for a second of the path, however long they take (default: 30)",
         &b->fps, 0.001, 1000, NULL},
        {"frames", 0, COMMAND_INTEGER, "N", "of the flight at most", &b->num_pictures, 1, 10000000, NULL},
        {"runs", 0, COMMAND_INTEGER, "N", "each from nothing (default: 3)", &b->num_runs, 1, BENCH_MAX_RUNS, NULL},
        {"rounds", 0, COMMAND_INTEGER, "N", "settled frames of each run (default: 15)", &b->num_rounds, 1,
         BENCH_MAX_ROUNDS, NULL},
        {"json", 0, COMMAND_TEXT, "FILE", "the report; - is stdout, instead of the table", &out->json, 0, 0, NULL},
        {"csv", 0, COMMAND_TEXT, "FILE", "a line for each frame; - is stdout, likewise", &out->csv, 0, 0, NULL},
        {"plot", 0, COMMAND_TEXT, "FILE", "an SVG: time by stage, requests and churn", &out->plot, 0, 0, NULL},
        {"trace", 0, COMMAND_TEXT, "FILE", "who did what when, for Perfetto or Chrome", &out->trace, 0, 0, NULL},
        {"beside", 0, COMMAND_TEXT, "VIEW",
         "frames of a second engine, in turns: no-shadows, no-mirror or standing, see below", &out->beside, 0, 0, NULL},
        {"particles", 0, COMMAND_TEXT, "LIST", "frames in which so many particles move, such as 250,500,1500",
         &out->particles, 0, 0, NULL},
        {"groups", 0, COMMAND_TEXT, "LIST",
         "frames in which the sun turns and depths to it are made in so many parts, such as 1,8,32", &out->groups, 0, 0,
         NULL},
        {"effects", 0, COMMAND_TEXT, "LIST",
         "of glass, what each costs: none,shadows,reflection,translucency,refraction or some",
         &out->lists.effects, 0, 0, NULL},
        {"sizes", 0, COMMAND_TEXT, "LIST", "of those pictures, not --size (default: 768x768,1024x1024,1920x1080)",
         &out->lists.sizes, 0, 0, NULL},
        {"details", 0, COMMAND_TEXT, "LIST", "of those pictures, not --detail (default: 4,2,1)",
         &out->lists.details, 0, 0, NULL},
        {"points", 0, COMMAND_FLAG, NULL, "what models of points cost and how right they are, as surfaces and splats",
         &out->points, 0, 0, NULL},
        {"compare", 0, COMMAND_TEXT, "FILE", "print ratios to the report of an earlier --json", &out->compare, 0, 0,
         NULL},
        {"detail", 0, COMMAND_NUMBER, "PX", "pixels that a voxel may be wide (default: 1)", &b->detail_px, 0.25, 64,
         NULL},
        {"view-distance", 0, COMMAND_NUMBER, "M", "metres at which rays end (default: the world's)",
         &b->view_distance_m, 1e-9, 1e18, NULL},
        {"seed", 0, COMMAND_INTEGER, "N", "instead of the world's own", &b->seed, 0, 4294967295.0, &b->has_seed},
        {"param", 0, COMMAND_PARAMETERS, "NAME=VALUE", "a parameter of the world file; may be given again",
         &b->parameters, 0, 0, NULL},
        {"edits", 0, COMMAND_TEXT, "FILE", "show the world with the edits of a file: docs/EDITS.md", &b->edits, 0, 0,
         NULL},
        {"refine", 0, COMMAND_FLAG, NULL, "move each hit to the true density, with its exact gradient as normal",
         &b->refine, 0, 0, NULL},
        {"no-shadows", 0, COMMAND_FLAG, NULL, "cast no shadow rays", &b->no_shadows, 0, 0, NULL},
        COMMAND_OCCLUSION_OPTIONS(&b->occlusion, &b->no_occlusion),
        COMMAND_MIRROR_OPTION(&b->mirror, &b->has_mirror),
        {"scattering", 0, COMMAND_TEXT, "HOW", "of light in media: once, octaves, fluence or paths (default: octaves)",
         &out->scattering, 0, 0, NULL},
        {"no-blend", 0, COMMAND_FLAG, NULL, "let levels of detail change at once", &b->no_blend, 0, 0, NULL},
        {"brick-bits", 0, COMMAND_INTEGER, "N", "bits of a density sample in memory: 8, 16 or 32 (default: 16)",
         &b->brick_bits, 8, 32, NULL},
        {"no-beam", 0, COMMAND_FLAG, NULL, "let each packet of rays find its way alone", &b->no_beam, 0, 0, NULL},
        {"pool", 0, COMMAND_NUMBER, "MIB", "memory for tiles and bricks together (default: 512)", &b->pool_mib, 0,
         16777216, NULL},
        {"frames-max", 0, COMMAND_INTEGER, "N", "frames to settle in at most (default: 1000)", &b->max_frames, 1,
         1000000, NULL},
        {"device", 0, COMMAND_TEXT, "DEVICE", "number or part of the name from karst info; cpu; gpu", &b->device, 0, 0,
         NULL},
        {"display", 0, COMMAND_TEXT, "WAY", "auto, egl, osmesa or none (default: auto)", &out->display, 0, 0, NULL},
        {"lanes", 0, COMMAND_INTEGER, "N",
         "rays and samples a work-item handles, 1 or 16 (default: what suits the device)", &b->lanes, 1, 16, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "say nothing but warnings and errors", &talk->quiet, 0, 0, NULL},
        {"verbose", 'v', COMMAND_FLAG, NULL, "say what the library does", &talk->verbose, 0, 0, NULL},
    };
    const size_t num_options = sizeof options / sizeof *options;
    size_t num_words;
    if (!command_parse(argc, argv, options, num_options, &b->world, 1, &num_words, &out->help, error))
        return false;
    if (out->help) {
        print_help(options, num_options);
        return true;
    }
    if (!num_words)
        return karst_fail(error, KARST_USAGE,
                          "which world? For example: karst bench hills (karst help bench lists them)");
    return true;
}

static bool parse_beside(bench *b, const char *word, karst_error *error)
{
    if (!word)
        return true;
    for (int i = BENCH_BESIDE_NOTHING + 1; i < BENCH_NUM_BESIDE; i++)
        if (strcmp(word, bench_beside_names[i]) == 0)
            b->beside = (bench_beside)i;
    if (b->beside == BENCH_BESIDE_NOTHING)
        return karst_fail(error, KARST_USAGE, "--beside %s: must be no-shadows, no-mirror or standing", word);
    if (b->beside == BENCH_BESIDE_STANDING && !b->path)
        return karst_fail(error, KARST_USAGE, "--beside standing needs a flight to stand beside: give a --path");
    if (b->beside == BENCH_BESIDE_NO_MIRROR && b->has_mirror && !(b->mirror > 0))
        return karst_fail(error, KARST_USAGE, "--beside no-mirror and --mirror 0: both views would be the same");
    return !(b->beside == BENCH_BESIDE_NO_SHADOWS && b->no_shadows) ||
           karst_fail(error, KARST_USAGE,
                      "--beside no-shadows and --no-shadows: both views would be the same; leave one of them out");
}

/* All that can be wrong and is found without opening a device. */
static bool check_options(bench *b, const outputs *out, command_talk *talk, karst_error *error)
{
    const command_scene scene = {b->world_file,  sizeof b->world_file, b->path ? NULL : &b->camera, &b->edits,
                                 &b->parameters, &b->has_seed,         &b->seed};
    const struct {
        const char *file, *option;
    } files[] = {{out->json, "--json"}, {out->csv, "--csv"}, {out->plot, "--plot"}, {out->trace, "--trace"}};
    const size_t num_files = sizeof files / sizeof *files;
    int num_stdout = 0;
    karst_camera camera = {.fov_deg = 60};
    if (b->lanes != 0 && b->lanes != 1 && b->lanes != 16)
        return karst_fail(error, KARST_USAGE, "--lanes %d: must be 1 or 16", (int)b->lanes);
    const bool is_of_smoke = out->particles || out->groups;
    if (is_of_smoke && (b->path || out->csv || out->plot || out->trace || out->compare || out->beside))
        return karst_fail(error, KARST_USAGE,
                          "--particles and --groups make tables of their own, which go with --json alone, and with no "
                          "--path");
    if (!b->path && ((b->num_pictures && !is_of_smoke) || b->fps > 0 || b->budget_ms > 0))
        return karst_fail(error, KARST_USAGE, "%s is about a flight: name a --path",
                          b->num_pictures ? "--frames"
                          : b->fps > 0    ? "--fps"
                                          : "--budget");
    if (b->camera && b->path)
        return karst_fail(error, KARST_USAGE, "--camera and --path: the path says where the camera is");
    if (b->camera && !karst_camera_parse(b->camera, KARST_VOXEL_LOG2_MAX, &camera, error))
        return false;
    if (out->scattering && !karst_scattering_parse(out->scattering, &b->scattering, error))
        return false;
    if (!parse_beside(b, out->beside, error) || !karst_display_kind_parse(out->display, &b->display_kind, error) ||
        !command_find_scene(b->world, &scene, talk, error))
        return false;
    if (b->path && (!command_find_path(b->path, b->path_file, sizeof b->path_file, error) ||
                    !karst_path_check(b->path_file, error)))
        return false;
    for (size_t i = 0; i < num_files; i++) {
        for (size_t k = 0; k < i; k++)
            if (files[i].file && files[k].file && strcmp(files[i].file, "-") != 0 &&
                strcmp(files[i].file, files[k].file) == 0)
                return karst_fail(error, KARST_USAGE, "%s and %s are the same file, %s: give each its own",
                                  files[k].option, files[i].option, files[i].file);
        num_stdout += files[i].file && strcmp(files[i].file, "-") == 0;
        if (files[i].file && !command_check_output(files[i].file, files[i].option, false, error))
            return false;
    }
    if (num_stdout > 1)
        return karst_fail(error, KARST_USAGE, "only one of --json, --csv, --plot and --trace can have stdout (-)");
    enum { AT_CAMERA = 5 };
    const char *const alone[] = {b->path ? "--path" : NULL,       out->beside ? "--beside" : NULL,
                                 out->csv ? "--csv" : NULL,       out->trace ? "--trace" : NULL,
                                 out->compare ? "--compare" : NULL, b->camera ? "--camera" : NULL,
                                 out->particles ? "--particles" : NULL, out->groups ? "--groups" : NULL};
    const bool has_lists = out->lists.effects || out->lists.sizes || out->lists.details;
    for (size_t i = 0; has_lists && i < sizeof alone / sizeof *alone; i++)
        if (alone[i])
            return karst_fail(error, KARST_USAGE, "--effects makes a table of its own: leave %s out", alone[i]);
    for (size_t i = 0; out->points && i < sizeof alone / sizeof *alone; i++)
        if ((alone[i] && alone[i] != alone[AT_CAMERA]) || has_lists || out->plot)
            return karst_fail(error, KARST_USAGE, "--points makes a table of its own: leave %s out",
                              has_lists ? "--effects" : out->plot ? "--plot" : alone[i]);
    return !out->compare || bench_compare_check(out->compare, error);
}

/* ---- the table ---- */

static double number(const json_t *root, const char *a, const char *b, const char *c)
{
    const json_t *value = json_object_get(root, a);
    value = b ? json_object_get(value, b) : value;
    value = c ? json_object_get(value, c) : value;
    return json_number_value(value);
}

static void print_phase(FILE *file, const json_t *report, const char *phase)
{
    const json_t *times = json_object_get(json_object_get(report, phase), "time_ms");
    const char *stage;
    json_t *t;
    if (!times)
        return;
    fprintf(file, "\n%-24s %9s %9s %9s %9s %7s   (%.0f frames)\n", phase, "median", "p95", "p99", "max", "jank %",
            number(report, phase, "frames", NULL));
    json_object_foreach((json_t *)times, stage, t)
    {
        if (number(t, "max", NULL, NULL) > 0)
            fprintf(file, "  %-22s %9.3f %9.3f %9.3f %9.3f %7.1f\n", stage, number(t, "median", NULL, NULL),
                    number(t, "p95", NULL, NULL), number(t, "p99", NULL, NULL), number(t, "max", NULL, NULL),
                    100 * number(t, "jank", NULL, NULL));
    }
    const json_t *churn = json_object_get(json_object_get(report, phase), "churn_per_frame");
    fprintf(file, "  a frame: %.4g requests, %.4g produced, %.4g evicted, %.4g produced again, %.4g put off\n",
            number(churn, "requests", NULL, NULL), number(churn, "produced", NULL, NULL),
            number(churn, "evicted", NULL, NULL), number(churn, "reproduced", NULL, NULL),
            number(churn, "deferred", NULL, NULL));
    const json_t *at_level = json_object_get(json_object_get(report, phase), "at_level");
    fprintf(file, "  hits at the level asked for: median %.2f %%, 99 %% of frames have %.2f %%\n",
            100 * number(at_level, "median", NULL, NULL), 100 * number(at_level, "p1", NULL, NULL));
    const json_t *own = json_object_get(json_object_get(report, phase), "at_own_level");
    const json_t *given = json_object_get(json_object_get(report, phase), "given_px");
    if (number(own, "median", NULL, NULL) < number(at_level, "median", NULL, NULL))
        fprintf(file, "  voxels of %.2f px asked for in the median frame, %.2f at most; at --detail's level: %.2f %%\n",
                number(given, "median", NULL, NULL), number(given, "max", NULL, NULL),
                100 * number(own, "median", NULL, NULL));
}

static void print_streams(FILE *file, const json_t *report)
{
    json_t *streams = json_object_get(json_object_get(report, "settled"), "streams"), *stream;
    const char *name, *before = "  ns a ray:";
    json_object_foreach(streams, name, stream)
    {
        if (number(stream, "rays", NULL, NULL) > 0)
            fprintf(file, "%s %s %.1f of %.0f", before, name, number(stream, "ns_per_ray", "median", NULL),
                    number(stream, "rays", NULL, NULL));
        before = ",";
    }
    fputs("\n", file);
}

static void print_ratio(FILE *file, const json_t *report, const char *name, const char *text)
{
    if (json_object_get(json_object_get(report, "ratios"), name))
        fprintf(file, "%-42s %8.2f   (%.2f to %.2f)\n", text, number(report, "ratios", name, "median"),
                number(report, "ratios", name, "min"), number(report, "ratios", name, "max"));
}

static void print_table(FILE *file, const bench *b, const json_t *report)
{
    const karst_stats *s = &b->settled;
    fprintf(file, "%s%s%s, %dx%d, %s shadows, %.3g px a voxel, %u runs on %s, %d cores; times in ms\n\n", b->world,
            b->path ? ", path " : "", b->path ? b->path : "", b->size_px[0], b->size_px[1],
            b->no_shadows ? "no" : "sun", s->detail_given_px, b->runs_done, s->device, b->num_cores);
    print_ratio(file, report, "settled_frame_per_floor", "settled frame / floor");
    print_ratio(file, report, "cold_frame_per_settled_frame", "frame with empty caches / settled frame");
    print_ratio(file, report, "refined_frame_per_frame_without", "settled frame / what it is without refine");
    print_ratio(file, report, "flight_frame_per_settled_frame", "flight, median / settled frame");
    print_ratio(file, report, "flight_p99_per_settled_frame", "flight, p99 / settled frame");
    print_ratio(file, report, "settled_frame_per_frame_without_shadows", "settled frame / the same without shadows");
    print_ratio(file, report, "settled_frame_per_frame_without_mirror", "settled frame / the same without mirrors");
    print_ratio(file, report, "flight_frame_per_standing_frame", "flight, median / standing frame, in turns");
    print_ratio(file, report, "flight_p99_per_standing_frame", "flight, p99 / standing frame, in turns");
    print_ratio(file, report, "used_bricks_per_hit_brick", "bricks used / bricks hit");
    print_phase(file, report, "settled");
    print_streams(file, report);
    print_phase(file, report, "flight");
    print_phase(file, report, "beside");
    fprintf(file,
            "\nfloor %.2f ms, %.1f Gfma/s, %.1f GB/s, bare noise (8 octaves, pointwise) %.1f Mvoxel/s: all cores\n",
            number(report, "ceilings", "floor_ms", "median"), number(report, "ceilings", "fma_per_s", "median") * 1e-9,
            number(report, "ceilings", "memory_bytes_per_s", "median") * 1e-9,
            number(report, "ceilings", "noise_samples_per_s", "median") * 1e-6);
    fprintf(file,
            "production while settling, a core: %.0f bricks/s, %.1f Mvoxel/s; loads alone %.1f Mvoxel/s, %.2f x bare "
            "noise, 1 voxel for %.1f fma; bounds %.2f us a node\n",
            number(report, "production", "bricks_per_core_s", "median"),
            number(report, "production", "voxels_per_core_s", "median") * 1e-6,
            number(report, "production", "load_voxels_per_core_s", "median") * 1e-6,
            number(report, "production", "load_per_noise", "median"),
            1 / number(report, "production", "load_voxels_per_fma", "median"),
            number(report, "production", "bounds_core_us_per_node", "median"));
    fprintf(file, "  %.0f bricks (%.0f constant after all) and %.0f tiles in %.0f frames\n",
            number(report, "production", "bricks", NULL), number(report, "production", "bricks_constant", NULL),
            number(report, "production", "tiles", NULL), number(report, "start", "frames", "median"));
    fprintf(file, "start of the process: open %.0f ms, first picture without a hole %.0f ms, complete %.0f ms\n",
            number(report, "start", "process", "opened_ms"), number(report, "start", "process", "hole_free_ms"),
            number(report, "start", "process", "complete_ms"));
    fprintf(file, "in use when settled: %llu of %llu bricks, %llu of %llu tiles, %.1f MB\n",
            (unsigned long long)s->bricks.num_used, (unsigned long long)s->bricks.num_total,
            (unsigned long long)s->tiles.num_used, (unsigned long long)s->tiles.num_total,
            number(report, "cache", "used_bytes", NULL) * 1e-6);
    fprintf(file, "memory %.1f MB:", number(report, "memory_total_bytes", NULL, NULL) * 1e-6);
    for (size_t i = 0; i < s->num_memory; i++)
        fprintf(file, " %s %.1f%s", s->memory[i].name, (double)s->memory[i].size_bytes * 1e-6,
                i + 1 < s->num_memory ? "," : "\n");
}

/* ---- the command ---- */

static bool write_and_free(const char *file, char *text, karst_error *error)
{
    bool written = text ? command_write_text(file, text, error)
                        : error->status != KARST_OK || karst_fail(error, KARST_FAILED, "out of memory");
    free(text);
    return written && error->status == KARST_OK;
}

static bool write_outputs(const bench *b, const outputs *out, karst_error *error)
{
    json_t *report = bench_report(b);
    bool ok = report || karst_fail(error, KARST_FAILED, "out of memory for the report");
    const char *const on_stdout[] = {out->json, out->csv, out->plot, out->trace};
    FILE *table = stdout;
    for (size_t i = 0; i < sizeof on_stdout / sizeof *on_stdout; i++)
        if (on_stdout[i] && strcmp(on_stdout[i], "-") == 0)
            table = NULL;
    ok = ok && (!out->json || write_and_free(out->json, bench_json_text(report, JSON_INDENT(2)), error)) &&
         (!out->csv || write_and_free(out->csv, bench_csv(b), error)) &&
         (!out->plot || write_and_free(out->plot, bench_chart(b, error), error)) &&
         (!out->trace || write_and_free(out->trace, bench_trace(b, error), error));
    if (ok && table)
        print_table(table, b, report);
    ok = ok && (!out->compare || bench_compare(report, out->compare, table ? table : stderr, error));
    json_decref(report);
    return ok;
}

bool command_bench(int argc, char **argv, command_talk *talk, karst_error *error)
{
    static bench b;
    b = (bench){.size_px = {800, 600}, .pool_mib = 512, .max_frames = 1000, .detail_px = 1, .num_runs = 3};
    b.num_rounds = 15;
    b.process_start_ns = karst_clock();
    outputs out = {.display = "auto"};
    if (!parse_options(argc, argv, talk, &b, &out, error))
        return false;
    if (out.help)
        return true;
    if (!check_options(&b, &out, talk, error))
        return false;
    if (out.lists.effects || out.lists.sizes || out.lists.details) {
        const bench_effect_outputs files = {out.json, out.plot};
        return bench_effects(&b, &out.lists, &files, talk, error);
    }
    if (out.points)
        return bench_points(&b, out.json, talk, error);
    b.budget_ms = b.budget_ms > 0 ? b.budget_ms : 8;
    b.fps = b.fps > 0 ? b.fps : 30;
    command_catch_interrupts();
    command_open_driver(talk);
    const karst_log log = command_log(talk);
    if (out.particles || out.groups)
        return bench_smoke(&b, out.particles, out.groups, out.json, talk, &log, error);
    b.tracing = out.trace != NULL;
    b.ceilings = calloc((size_t)(b.num_runs * b.num_rounds), sizeof *b.ceilings);
    bool done = b.ceilings || karst_fail(error, KARST_FAILED, "out of memory");
    b.helper = karst_helper_create(NULL); /* without one the first start only takes longer */
    while (done && b.runs_done < b.num_runs)
        done = bench_do_run(&b, talk, &log, error);
    done = done && write_outputs(&b, &out, error);
    karst_helper_destroy(b.helper);
    free(b.ceilings);
    free(b.frames);
    free(b.spans);
    return done;
}
