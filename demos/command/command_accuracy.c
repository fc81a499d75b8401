/* karst accuracy: what each quality setting costs, and how wrong its pixels are. */
#include "command_accuracy.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Pictures are compared at this part of the size: each of their pixels costs the reference 16 rays. */
#define PICTURE_SHARE 5

typedef struct {
    const char *json, *csv, *plot;
    bool quick, samples_alone, media, help;
} outputs;

static void print_help(const command_option *options, size_t num_options)
{
    puts("karst accuracy WORLD [OPTIONS]\n"
         "Draws a view at many quality settings, and compares each pixel with a reference that meets the world's "
         "density\n"
         "itself, on the host in double, by intervals: what each setting costs, and how wrong it is.\n"
         "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nWorlds (or the path of a world file, which ends in .karst):");
    command_print_worlds(stdout);
    puts("\nExamples:\n"
         "  karst accuracy hills\n"
         "  karst accuracy hills --samples\n"
         "  karst accuracy docs/accuracy/cloud.karst --media --size 64x48 --param depth=10\n"
         "  karst accuracy alps --plot alps.svg --csv alps.csv\n"
         "  karst accuracy hills --quick --json - | jq '.settings[] | select(.default) | .depth_footprints'\n"
         "\ndepth: distance along the ray to where the reference meets the density at the ray's own footprint, one "
         "pixel\n"
         "wide and blended between levels as the default picture is; in footprints.\n"
         "missed, false: pixels where only the reference, only the engine hits.\n"
         "rms, PSNR, SSIM: a small picture against one of 16 rays a pixel of the full density.\n"
         "samples: pictures as karst render draws them, against 1024 samples of a quarter of a pixel a voxel, "
         "refined.\n"
         "media: light that a medium scatters, in each way of --scattering, against delta tracking in double.\n"
         "Land, sky and haze are left out of the truth: a world without them tells what the scattering is off.\n"
         "d, p: on the front of depth error, of picture error, over time (cast, refine and shade).\n"
         "\nExit code: 0 done, 1 failed, 2 wrong usage, 3 no usable device, 4 no such world.");
}

static bool parse_options(int argc, char **argv, command_talk *talk, accuracy *a, outputs *out, karst_error *error)
{
    const command_option options[] = {
        {"size", 0, COMMAND_SIZE, "WxH", "pixels (default: 320x240)", a->size_px, 1, 4096, NULL},
        {"camera", 0, COMMAND_TEXT, "X,Y,Z,YAW,PITCH[,FOV]",
         "metres, exact at any distance, and degrees (default: the world's)", &a->camera, 0, 0, NULL},
        {"quick", 0, COMMAND_FLAG, NULL, "only the default settings, refined and not", &out->quick, 0, 0, NULL},
        {"samples", 0, COMMAND_FLAG, NULL, "only pictures of 1, 4, 16 and 64 samples, with shadows",
         &out->samples_alone, 0, 0, NULL},
        {"media", 0, COMMAND_FLAG, NULL, "only what the world's medium scatters", &out->media, 0, 0, NULL},
        {"paths", 0, COMMAND_INTEGER, "N", "of each pixel, for the truth of --media (default: 1000)", &a->paths_px, 2,
         16777216, NULL},
        {"detail", 0, COMMAND_NUMBER, "PX", "pixels a voxel, of --media alone (default: 1)", &a->media_detail_px, 0.25,
         64, NULL},
        {"frames", 0, COMMAND_INTEGER, "N", "settled frames to time each setting by (default: 9)", &a->num_frames, 1,
         100, NULL},
        {"json", 0, COMMAND_TEXT, "FILE", "the report; - is stdout, instead of the table", &out->json, 0, 0, NULL},
        {"csv", 0, COMMAND_TEXT, "FILE", "a line for each setting; - is stdout, likewise", &out->csv, 0, 0, NULL},
        {"plot", 0, COMMAND_TEXT, "FILE", "an SVG: error over time", &out->plot, 0, 0, NULL},
        {"view-distance", 0, COMMAND_NUMBER, "M", "metres at which rays end (default: the world's)",
         &a->view_distance_m, 1e-9, 1e18, NULL},
        {"seed", 0, COMMAND_INTEGER, "N", "instead of the world's own", &a->seed, 0, 4294967295.0, &a->has_seed},
        {"param", 0, COMMAND_PARAMETERS, "NAME=VALUE", "a parameter of the world file; may be given again",
         &a->parameters, 0, 0, NULL},
        {"device", 0, COMMAND_TEXT, "DEVICE", "number or part of the name from karst info; cpu; gpu", &a->device, 0, 0,
         NULL},
        {"lanes", 0, COMMAND_INTEGER, "N",
         "rays and samples a work-item handles, 1 or 16 (default: what suits the device)", &a->lanes, 1, 16, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "say nothing but warnings and errors", &talk->quiet, 0, 0, NULL},
        {"verbose", 'v', COMMAND_FLAG, NULL, "say what the library does", &talk->verbose, 0, 0, NULL},
    };
    const size_t num_options = sizeof options / sizeof *options;
    size_t num_words;
    if (!command_parse(argc, argv, options, num_options, &a->world, 1, &num_words, &out->help, error))
        return false;
    if (out->help) {
        print_help(options, num_options);
        return true;
    }
    if (!num_words)
        return karst_fail(error, KARST_USAGE,
                          "which world? For example: karst accuracy hills (karst help accuracy lists them)");
    return true;
}

static bool check_options(accuracy *a, const outputs *out, karst_error *error)
{
    const char *const paths[] = {out->json, out->csv, out->plot}, *const names[] = {"--json", "--csv", "--plot"};
    int num_stdout = 0;
    for (int i = 0; i < 3; i++) {
        if (paths[i] && !command_check_output(paths[i], names[i], false, error))
            return false;
        num_stdout += paths[i] && strcmp(paths[i], "-") == 0;
    }
    if (out->samples_alone && out->media)
        return karst_fail(error, KARST_USAGE, "--samples and --media: only one of them at a time");
    if ((out->samples_alone || out->media) && (out->quick || out->csv || out->plot))
        return karst_fail(error, KARST_USAGE, "--%s and --%s: that is about settings, of which none is drawn",
                          out->media ? "media" : "samples", out->quick ? "quick"
                          : out->csv ? "csv"
                                     : "plot");
    if (num_stdout > 1)
        return karst_fail(error, KARST_USAGE, "only one of --json, --csv and --plot can have stdout");
    if (a->lanes != 0 && a->lanes != 1 && a->lanes != 16)
        return karst_fail(error, KARST_USAGE, "--lanes %d: must be 1 or 16", (int)a->lanes);
    return command_find_world(a->world, a->world_file, sizeof a->world_file, error);
}

/* The camera's text, in the world's voxels. */
static bool find_camera(accuracy *a, karst_error *error)
{
    if (!a->camera)
        return true;
    karst_world_config config = {
        .world = a->world_file, .parameters = a->parameters.values, .num_parameters = a->parameters.num_values};
    karst_world *world = karst_world_open(&config, error);
    if (!world)
        return false;
    a->camera_used = (karst_camera){.fov_deg = 60};
    a->has_camera =
        karst_camera_parse(a->camera, karst_world_get_metadata(world)->voxel_log2_m, &a->camera_used, error);
    karst_world_close(world);
    return a->has_camera;
}

/* A setting like `like` at each of these pixels a voxel; they end with 0. */
static void add_family(accuracy *a, accuracy_setting like, const double *details_px)
{
    for (; *details_px > 0; details_px++) {
        like.detail_px = *details_px;
        a->settings[a->num_settings++] = like;
    }
}

static void choose_settings(accuracy *a, bool quick)
{
    const double all[] = {0.5, M_SQRT1_2, 1, M_SQRT2, 2, 4, 0}, some[] = {0.5, 1, 2, 0}, one[] = {1, 0};
    add_family(a, (accuracy_setting){.family = "bricks", .brick_bits = 16}, quick ? one : all);
    add_family(a, (accuracy_setting){.family = "refined", .brick_bits = 16, .refine = true}, quick ? one : all);
    for (size_t i = 0; i < a->num_settings; i++)
        a->settings[i].is_default = !a->settings[i].refine && a->settings[i].detail_px == 1;
    if (quick)
        return;
    add_family(a, (accuracy_setting){.family = "8 bits", .brick_bits = 8}, some);
    add_family(a, (accuracy_setting){.family = "32 bits", .brick_bits = 32}, some);
    add_family(a, (accuracy_setting){.family = "8 bits refined", .brick_bits = 8, .refine = true}, one);
    add_family(a, (accuracy_setting){.family = "32 bits refined", .brick_bits = 32, .refine = true}, one);
    add_family(a, (accuracy_setting){.family = "no blend", .brick_bits = 16, .no_blend = true}, one);
    add_family(a, (accuracy_setting){.family = "no beam", .brick_bits = 16, .no_beam = true}, one);
    add_family(a, (accuracy_setting){.family = "cell by cell", .brick_bits = 16, .safe_steps = -1}, one);
    add_family(a, (accuracy_setting){.family = "steps x 2", .brick_bits = 16, .safe_steps = 2}, one);
    add_family(a, (accuracy_setting){.family = "steps x 4", .brick_bits = 16, .safe_steps = 4}, one);
}

static void print_table(const accuracy *a)
{
    printf("%s at %s, %dx%d, on %s\n", a->world, a->camera_text, a->size_px[0], a->size_px[1], a->device_name);
    printf("reference: %.1f s, and %.1f s for %d rays a pixel at %dx%d; %llu rays given up; settings: %.1f s\n\n",
           a->reference_s, a->picture_s, ACCURACY_RAYS_PX * ACCURACY_RAYS_PX, a->picture_px[0], a->picture_px[1],
           (unsigned long long)a->num_unresolved, a->sweep_s);
    puts("family           px/voxel   cast refine  shade  frame  bricks    MiB   depth: median     p99      max  "
         "missed false  normal: median  p99     rms  PSNR   SSIM");
    puts("                              ms     ms     ms     ms                    footprints                      "
         "                 degrees           dB");
    for (size_t i = 0; i < a->num_settings; i++) {
        const accuracy_setting *s = &a->settings[i];
        const accuracy_result *r = &a->results[i];
        printf("%-16s %8.2f %6.2f %6.2f %6.2f %6.2f %7llu %6.1f %15.5f %7.3f %8.2f %7llu %5llu %15.3f %5.2f %7.2f "
               "%5.1f %6.4f %s%s%s\n",
               s->family, s->detail_px, r->cast_ms, r->refine_ms, r->shade_ms, r->frame_ms,
               (unsigned long long)r->num_bricks, r->brick_mib, r->depth_median, r->depth_p99, r->depth_max,
               (unsigned long long)r->num_missed, (unsigned long long)r->num_false, r->normal_median_deg,
               r->normal_p99_deg, r->rmse, r->psnr_db, r->ssim, r->on_depth_front ? "d" : " ",
               r->on_picture_front ? "p" : " ", s->is_default ? " default" : "");
    }
}

static bool write_text(const char *path, char *text, karst_error *error)
{
    bool written = text ? command_write_text(path, text, error) : karst_fail(error, KARST_FAILED, "out of memory");
    free(text);
    return written;
}

bool command_accuracy(int argc, char **argv, command_talk *talk, karst_error *error)
{
    accuracy *a = calloc(1, sizeof *a);
    outputs out = {0};
    if (!a)
        return karst_fail(error, KARST_FAILED, "out of memory");
    a->size_px[0] = 320;
    a->size_px[1] = 240;
    a->num_frames = 9;
    a->paths_px = 1000;
    bool good = parse_options(argc, argv, talk, a, &out, error);
    if (!good || out.help) {
        free(a);
        return good;
    }
    command_catch_interrupts();
    command_open_driver(talk);
    for (int i = 0; i < 2; i++)
        a->picture_px[i] = a->size_px[i] < PICTURE_SHARE ? 1 : a->size_px[i] / PICTURE_SHARE;
    const bool has_settings = !out.samples_alone && !out.media;
    if (has_settings)
        choose_settings(a, out.quick);
    good = check_options(a, &out, error) && find_camera(a, error) && (!has_settings || accuracy_trace(a, talk, error));
    uint64_t sweep_ns = command_clock_ns();
    for (size_t i = 0; good && i < a->num_settings; i++)
        good = accuracy_measure(a, i, talk, error);
    a->sweep_s = (double)(command_clock_ns() - sweep_ns) * 1e-9;
    good = good && (out.quick || out.media || accuracy_measure_samples(a, talk, error)) &&
           (!out.media || accuracy_measure_media(a, talk, error));
    command_end_progress(talk);
    if (good) {
        accuracy_mark_fronts(a);
        bool to_stdout = (out.json && strcmp(out.json, "-") == 0) || (out.csv && strcmp(out.csv, "-") == 0) ||
                         (out.plot && strcmp(out.plot, "-") == 0);
        if (!to_stdout && has_settings)
            print_table(a);
        if (!to_stdout) {
            accuracy_print_samples(a);
            accuracy_print_media(a);
        }
        good = (!out.json || write_text(out.json, accuracy_json(a), error)) &&
               (!out.csv || write_text(out.csv, accuracy_csv(a), error));
        char *svg = good && out.plot ? accuracy_plot(a, error) : NULL;
        if (good && out.plot)
            good = svg && write_text(out.plot, svg, error);
        if (good && a->num_unresolved)
            command_say(talk, "%llu rays of the reference were given up; their pixels are left out",
                        (unsigned long long)a->num_unresolved);
    }
    accuracy_free(a);
    free(a);
    return good;
}
