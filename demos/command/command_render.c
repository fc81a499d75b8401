/* karst render: one picture, settled before it is written, or a flight's. */
#include "command_bands.h"
#include "command_begun.h"
#include "command_farm.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

#define DEFAULT_SAMPLES 8
#define MANY_SAMPLES 16 /* noise is below what voxels a pixel wide leave out: docs/ACCURACY.md, samples */

typedef struct {
    const char *world, *output, *stats, *camera, *device, *display, *path;
    char path_file[PATH_MAX], world_file[PATH_MAX];
    command_parameters parameters;
    int size_px[2];
    const char *thin;
    karst_thin thin_kind;
    uint64_t seed, budget_bricks, max_frames, brick_bits, lanes, num_pictures;
    double pool_mib, detail_px, view_distance_m, budget_ms, fps;
    command_look look;
    const char *aov;
    unsigned aovs;
    command_flight flight;
    bool has_seed, no_shadows, no_blend, no_beam, refine, help;
    bool has_time, has_time_step;
    bool flies; /* more pictures than one: along a path, or while time goes */
    const char *six_way; /* files of light maps, in place of pictures; NULL: none */
    const char *edits;
    const char *part_text, *window_text, *manifest_file;
    uint64_t rows;     /* drawn at once; 0: what suits */
    uint64_t num_jobs; /* 0: draw; else only print the commands of so many parts */
    bool resume;
    bool goes_on;         /* with the samples of the .exr that is there */
    char *note;           /* of an .exr that may be gone on from; NULL: it holds no sums */
    command_begun *begun; /* samples that are there; NULL: none */
    command_part part;
    int window_px[4];   /* x, y, width, height: what is drawn of a picture of size_px */
    char *part_output;  /* the file of a tile; NULL: o->output */
    command_manifest *manifest;
} render_options;

typedef struct {
    command_talk *talk;
    command_record *record;
    karst_error *error;
    uint64_t start_ns, num_samples;
} run_state;

static void print_help(const command_option *options, size_t num_options)
{
    puts("karst render WORLD [-o out.png] [OPTIONS]\n"
         "karst render WORLD --path PATH -o frames/%05d.png|out.mp4 [OPTIONS]\n"
         "karst render WORLD --time-step S --frames N -o frames/%05d.png|out.mp4 [OPTIONS]\n"
         "Renders a world to a PNG, or to an EXR with depth and normals. The picture is settled before it is written:\n"
         "it has all the detail that was asked for, or all that the pools can hold. Along a path, each picture is.\n"
         "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nWorlds (or the path of a world file, which ends in .karst):");
    command_print_worlds(stdout);
    puts("\nExamples:\n"
         "  karst render hills\n"
         "  karst render hills -o far.png --size 1920x1080 --camera 1e9,320,-1e9,30,-12\n"
         "  karst render asteroid --display none --no-shadows --stats - | jq .time_ms.cast\n"
         "  karst render hills -o - --pool 2048 --detail 0.5 | display\n"
         "  karst render mine.karst --param relief=250 --seed 3\n"
         "  karst render hills -o poster.png --size 16384x16384\n"
         "  karst render glass --light full --samples 256 -o glass.exr --resume\n"
         "  karst render hills --path low-flight -o flight.mp4 --size 800x600\n"
         "  karst render hills --path low-flight --frames 10 -o %02d.png\n"
         "  karst render hills --path low-flight -o frames/%05d.exr --jobs 8 | parallel -j 4\n"
         "  karst render smoke --time-step 0.04 --frames 100 -o smoke/%03d.png\n"
         "  karst render smoke --six-way out_%s.exr --size 256x256 --time-step 0.1 --frames 64\n"
         "\nExit code: 0 done, 1 failed or not settled, 2 wrong usage, 3 no usable device, 4 no such world,\n"
         "5 a path, a file of edits or a manifest that cannot be read, 75 ended by SIGTERM with --manifest: run it\n"
         "again.");
}

static bool parse_options(int argc, char **argv, command_talk *talk, render_options *o, karst_error *error)
{
    const command_option options[] = {
        {"output", 'o', COMMAND_TEXT, "FILE",
         "the picture, .png or .exr; - is stdout (default: out.png); of a path: with %05d, or a .mp4", &o->output, 0, 0,
         NULL},
        {"size", 0, COMMAND_SIZE, "WxH", "pixels (default: 1280x720)", o->size_px, 1, 16384, NULL},
        {"camera", 0, COMMAND_TEXT, "X,Y,Z,YAW,PITCH[,FOV]",
         "metres, exact at any distance, and degrees (default: the world's)", &o->camera, 0, 0, NULL},
        {"path", 0, COMMAND_TEXT, "PATH", "fly: a file, or walk, low-flight, orbit, dive or jump", &o->path, 0, 0,
         NULL},
        {"frames", 0, COMMAND_INTEGER, "N", "pictures of the path, spread evenly unless --fps is given",
         &o->num_pictures, 1, 10000000, NULL},
        {"fps", 0, COMMAND_NUMBER, "F", "pictures a second (default: 30)", &o->fps, 0.001, 1000, NULL},
        {"start", 0, COMMAND_NUMBER, "S", "seconds of the path at the first picture", &o->flight.start_s, -1e9, 1e9,
         &o->flight.has_start},
        {"end", 0, COMMAND_NUMBER, "S", "seconds of the path at which to stop", &o->flight.end_s, -1e9, 1e9,
         &o->flight.has_end},
        {"time", 0, COMMAND_NUMBER, "S", "the world's time, of its particles and iTime (default: 0)",
         &o->flight.world_s, -1e9, 1e9, &o->has_time},
        {"time-step", 0, COMMAND_NUMBER, "S",
         "from picture to picture, along a path, or with --frames where the camera is (default: time stands still)",
         &o->flight.world_step_s, -1e9, 1e9, &o->has_time_step},
        {"six-way", 0, COMMAND_TEXT, "FILES",
         "two light maps of the media alone, for game engines, such as smoke_%s.exr; with --frames and --time-step a "
         "sheet of moments (docs/EXPORT.md)",
         &o->six_way, 0, 0, NULL},
        {"jobs", 0, COMMAND_INTEGER, "N",
         "draw nothing: print N commands, one a line, that together do it (docs/FARM.md)", &o->num_jobs, 1,
         COMMAND_MAX_PARTS, NULL},
        {"part", 0, COMMAND_TEXT, "K/N", "only part K of N, as --jobs prints it", &o->part_text, 0, 0, NULL},
        {"rows", 0, COMMAND_INTEGER, "N",
         "draw a picture by so many rows at a time, in less memory, with the same bytes (default: all of it, or of "
         "large ones about a million pixels)",
         &o->rows, 16, 16384, NULL},
        {"window", 0, COMMAND_TEXT, "X,Y,W,H", "only these pixels of the picture, counted from its upper left corner",
         &o->window_text, 0, 0, NULL},
        {"manifest", 0, COMMAND_TEXT, "FILE", "note what is done, with checksums: karst verify looks at them",
         &o->manifest_file, 0, 0, NULL},
        {"resume", 0, COMMAND_FLAG, NULL,
         "leave out what the manifest says is done, if it is there and right; without one, go on with the samples of "
         "the .exr of -o",
         &o->resume, 0, 0, NULL},
        {"live", 0, COMMAND_FLAG, NULL, "draw each picture once, as it then is, for measuring", &o->flight.live, 0, 0,
         NULL},
        {"detail", 0, COMMAND_NUMBER, "PX",
         "pixels that a voxel may be wide (default: 1; of pictures of 16 samples and more 0.5)", &o->detail_px, 0.25,
         64, NULL},
        {"view-distance", 0, COMMAND_NUMBER, "M", "metres at which rays end (default: the world's)",
         &o->view_distance_m, 1e-9, 1e18, NULL},
        {"seed", 0, COMMAND_INTEGER, "N", "instead of the world's own", &o->seed, 0, 4294967295.0, &o->has_seed},
        {"param", 0, COMMAND_PARAMETERS, "NAME=VALUE", "a parameter of the world file; may be given again",
         &o->parameters, 0, 0, NULL},
        {"samples", 0, COMMAND_INTEGER, "N",
         "rays for each pixel: smooth edges, soft shadows (default: 8; 1 with --live)", &o->look.samples, 1,
         KARST_ENGINE_MAX_SAMPLES, NULL},
        COMMAND_TONE_OPTIONS(&o->look),
        {"aov", 0, COMMAND_TEXT, "LIST",
         "what an .exr holds: radiance,albedo,depth,normal,position,level,samples,sums,occlusion,openness "
         "(default: radiance,depth,normal; "
         "with --light full also sums, which --resume goes on from)",
         &o->aov, 0, 0, NULL},
        {"edits", 0, COMMAND_TEXT, "FILE", "show the world with the edits of a file: docs/EDITS.md", &o->edits, 0, 0,
         NULL},
        {"refine", 0, COMMAND_FLAG, NULL, "move each hit to the true density, with its exact gradient as normal",
         &o->refine, 0, 0, NULL},
        {"thin", 0, COMMAND_TEXT, "WHEN",
         "show matter thinner than two voxels two voxels wide: always, never, or auto: if the world has no noise "
         "(default: auto)",
         &o->thin, 0, 0, NULL},
        {"no-shadows", 0, COMMAND_FLAG, NULL, "cast no shadow rays", &o->no_shadows, 0, 0, NULL},
        {"no-blend", 0, COMMAND_FLAG, NULL, "let levels of detail change at once", &o->no_blend, 0, 0, NULL},
        {"brick-bits", 0, COMMAND_INTEGER, "N", "bits of a density sample in memory: 8, 16 or 32 (default: 16)",
         &o->brick_bits, 8, 32, NULL},
        {"no-beam", 0, COMMAND_FLAG, NULL, "let each packet of rays find its way alone", &o->no_beam, 0, 0, NULL},
        {"pool", 0, COMMAND_NUMBER, "MIB", "memory for tiles and bricks together (default: 512)", &o->pool_mib, 0,
         16777216, NULL},
        {"budget-bricks", 0, COMMAND_INTEGER, "N", "bricks to produce in a frame at most (default: 4096)",
         &o->budget_bricks, 1, 8192, NULL},
        {"budget", 0, COMMAND_NUMBER, "MS",
         "and what is expected to take so long (default: no clock, which is reproducible)", &o->budget_ms, 0.001, 60000,
         NULL},
        {"frames-max", 0, COMMAND_INTEGER, "N", "frames to settle a picture in at most (default: 1000)", &o->max_frames,
         1, 1000000, NULL},
        {"device", 0, COMMAND_TEXT, "DEVICE", "number or part of the name from karst info; cpu; gpu", &o->device, 0, 0,
         NULL},
        {"display", 0, COMMAND_TEXT, "WAY", "auto, egl, osmesa or none (default: auto)", &o->display, 0, 0, NULL},
        {"lanes", 0, COMMAND_INTEGER, "N",
         "rays and samples a work-item handles, 1 or 16 (default: what suits the device)", &o->lanes, 1, 16, NULL},
        {"stats", 0, COMMAND_TEXT, "FILE", "write figures of the run as JSON; - is stdout", &o->stats, 0, 0, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "say nothing but warnings and errors", &talk->quiet, 0, 0, NULL},
        {"verbose", 'v', COMMAND_FLAG, NULL, "say what the library does", &talk->verbose, 0, 0, NULL},
    };
    const size_t num_options = sizeof options / sizeof *options;
    size_t num_words;
    if (!command_parse(argc, argv, options, num_options, &o->world, 1, &num_words, &o->help, error))
        return false;
    if (o->help) {
        print_help(options, num_options);
        return true;
    }
    if (!num_words)
        return karst_fail(error, KARST_USAGE,
                          "which world? For example: karst render hills (karst help render lists them)");
    return true;
}

static command_six_way six_way_of(const render_options *o)
{
    return (command_six_way){.pattern = o->six_way,
                             .size_px = {o->size_px[0], o->size_px[1]},
                             .num = o->num_pictures ? o->num_pictures : 1,
                             .start_s = o->flight.world_s,
                             .step_s = o->flight.world_step_s,
                             .max_frames = (uint32_t)o->max_frames};
}

/* Light maps are of one view, and files of their own. */
static bool check_six_way(const render_options *o, karst_error *error)
{
    const char *stray = o->path               ? "path"
                        : o->output           ? "output"
                        : o->aov              ? "aov"
                        : o->stats            ? "stats"
                        : o->flight.live      ? "live"
                        : o->flight.has_start ? "start"
                        : o->flight.has_end   ? "end"
                        : o->fps > 0          ? "fps"
                        : o->rows             ? "rows"
                        : o->window_text      ? "window"
                        : o->part_text        ? "part"
                        : o->manifest_file    ? "manifest"
                        : o->num_jobs         ? "jobs"
                        : o->resume           ? "resume"
                                              : NULL;
    const command_six_way maps = six_way_of(o);
    if (stray)
        return karst_fail(error, KARST_USAGE, "--six-way draws light maps of one view: --%s is not for them", stray);
    if (maps.num > 1 && !o->has_time_step)
        return karst_fail(error, KARST_USAGE, "--six-way with --frames: how far apart? For example --time-step 0.1");
    if (maps.num == 1 && o->has_time_step)
        return karst_fail(error, KARST_USAGE, "--six-way with --time-step: how many moments? For example --frames 64");
    return command_six_way_check(&maps, error);
}

/* What concerns a path; fills in the flight. */
static bool check_flight(render_options *o, karst_error *error)
{
    command_flight *flight = &o->flight;
    if (o->has_time_step && !o->path && !o->num_pictures)
        return karst_fail(error, KARST_USAGE, "--time-step: how many pictures? For example --frames 100");
    if (!o->path) {
        const char *stray = o->num_pictures && !o->flies    ? "frames"
                            : o->fps > 0 && !o->flies ? "fps"
                            : flight->has_start ? "start"
                            : flight->has_end   ? "end"
                            : flight->live      ? "live"
                                                : NULL;
        if (stray || !o->flies)
            return !stray ||
                   karst_fail(error, KARST_USAGE, "--%s is about a path: name one, such as --path low-flight", stray);
    }
    if (o->rows)
        return karst_fail(error, KARST_USAGE, "--rows is about one picture, and %s draws many",
                          o->path ? "--path" : "--time-step");
    if (o->path && o->camera)
        return karst_fail(error, KARST_USAGE, "--camera and --path: the path says where the camera is");
    if (!o->output)
        return karst_fail(error, KARST_USAGE, "where to? For example -o frames/%%05d.png or -o out.mp4");
    if (flight->live && o->look.samples > 1)
        return karst_fail(error, KARST_USAGE, "--samples and --live: a picture that is drawn once has one sample");
    flight->file = o->path ? o->path_file : NULL;
    flight->output = o->output;
    flight->num_pictures = (size_t)o->num_pictures;
    flight->fps = o->fps;
    flight->max_frames = (uint32_t)o->max_frames;
    return (!o->path || (command_find_path(o->path, o->path_file, sizeof o->path_file, error) &&
                         karst_path_check(o->path_file, error))) &&
           command_pictures_check(o->output, o->num_pictures == 1, o->window_px[2], o->window_px[3], error);
}

static bool parse_thin(const char *text, karst_thin *thin, karst_error *error)
{
    static const char *const names[] = {"auto", "always", "never"};
    *thin = KARST_THIN_AUTO;
    for (int i = 0; text && i < 3; i++)
        if (strcmp(text, names[i]) == 0) {
            *thin = (karst_thin)i;
            return true;
        }
    return !text || karst_fail(error, KARST_USAGE, "--thin %s: must be auto, always or never", text);
}

/* Whether it is known before the picture is drawn; a world may still say so. */
static bool is_exposure_fixed(const render_options *o)
{
    return o->look.has_exposure ? !o->look.auto_exposure : o->look.parsed_tone == KARST_TONE_OF_PLAIN;
}

/* Tiles of bytes must agree on how bright they are; those of light do. */
static bool check_tile(const render_options *o, karst_error *error)
{
    return is_exposure_fixed(o) || command_is_exr(o->output) ||
           karst_fail(error, KARST_USAGE,
                      "parts of a .png: each would choose an exposure of its own; give --exposure STOPS, such as "
                      "--exposure 0, or write an .exr");
}

/* Which part is drawn of what, and its manifest's place among the job's. */
static bool check_part(render_options *o, karst_error *error)
{
    const bool has_job = o->num_jobs || o->part_text || o->manifest_file;
    o->goes_on = o->resume && !o->manifest_file && !o->num_jobs && !o->flies && command_is_exr(o->output);
    if (o->resume && !o->manifest_file && !o->num_jobs && !o->goes_on)
        return karst_fail(error, KARST_USAGE,
                          "--resume: of which job? Name its manifest with --manifest, or an .exr with -o, to "
                          "go on with its samples");
    if (o->num_jobs && (o->part_text || o->stats))
        return karst_fail(error, KARST_USAGE, "--jobs prints commands: --%s is for one of them",
                          o->part_text ? "part" : "stats");
    if (has_job && (o->flight.live || (o->output && strcmp(o->output, "-") == 0) ||
                    (o->output && command_pictures_is_video(o->output))))
        return karst_fail(error, KARST_USAGE,
                          "a job draws settled pictures to files, such as -o frames/%%05d.png, not %s",
                          o->flight.live ? "--live" : o->output);
    if (has_job && strcmp(o->world, "-") == 0)
        return karst_fail(error, KARST_USAGE, "a job needs a world that all of its parts can read, not stdin");
    if (o->part_text && !command_parse_part(o->part_text, &o->part, error))
        return false;
    if (o->num_jobs)
        o->part = (command_part){1, (uint32_t)o->num_jobs};
    if (o->window_text && !o->flies && o->part.num)
        return karst_fail(error, KARST_USAGE, "--window and parts of one picture: a part is a window itself");
    if (o->window_text)
        return command_parse_window(o->window_text, o->size_px, o->window_px, error);
    return o->flies || !o->part.num ||
           (command_part_tile(o->part, o->size_px, o->window_px, error) && check_tile(o, error));
}

/* An .exr of full light can be gone on from, unless somebody chose what it holds; and one that is gone on with. */
static void choose_sums(render_options *o)
{
    const bool is_exr = !o->flies && !o->six_way && command_is_exr(o->output);
    if (o->goes_on || (is_exr && !o->aov && o->look.parsed_light == KARST_INTEGRATOR_FULL))
        o->aovs = (o->aovs ? o->aovs : 1u << KARST_AOV_RADIANCE | 1u << KARST_AOV_DEPTH | 1u << KARST_AOV_NORMAL) |
                  1u << KARST_AOV_SUMS;
}

/* Where nobody says how fine: many samples are worth finer voxels. A picture that is gone on with stays as it is. */
static bool choose_detail(render_options *o, karst_error *error)
{
    if (o->detail_px > 0)
        return true;
    o->detail_px = o->look.samples >= MANY_SAMPLES ? 0.5 : 1;
    return !o->goes_on || command_begun_detail(o->output, &o->detail_px, error);
}

/* All that can be wrong and is found without opening a device. */
static bool check_options(render_options *o, karst_display_kind *display, command_talk *talk, karst_error *error)
{
    memcpy(o->window_px + 2, o->size_px, sizeof o->size_px);
    o->flies = !o->six_way && (o->path || (o->has_time_step && o->num_pictures));
    /* A path says where the camera is. */
    const command_scene scene = {o->world_file,  sizeof o->world_file, o->path ? NULL : &o->camera, &o->edits,
                                 &o->parameters, &o->has_seed,         &o->seed};
    if (o->six_way && !check_six_way(o, error))
        return false;
    if (!o->output && !o->flies && !o->six_way)
        o->output = "out.png";
    if (!o->look.samples)
        o->look.samples = o->flight.live ? 1 : DEFAULT_SAMPLES;
    karst_camera camera = {.fov_deg = 60};
    if (o->lanes != 0 && o->lanes != 1 && o->lanes != 16)
        return karst_fail(error, KARST_USAGE, "--lanes %d: must be 1 or 16", (int)o->lanes);
    if (o->output && strcmp(o->output, "-") == 0 && o->stats && strcmp(o->stats, "-") == 0)
        return karst_fail(error, KARST_USAGE, "-o - and --stats - both want stdout; give one of them a file");
    /* The widest voxel takes any coordinate: what is wrong with one of this world's shows when the world is open. */
    if (o->camera && !karst_camera_parse(o->camera, KARST_VOXEL_LOG2_MAX, &camera, error))
        return false;
    if (!parse_thin(o->thin, &o->thin_kind, error))
        return false;
    if (!command_check_look(&o->look, error) || !check_part(o, error))
        return false;
    if (o->aov && (o->flies || !command_is_exr(o->output)))
        return karst_fail(error, KARST_USAGE, "--aov is about one .exr: name it with -o");
    if (o->aov && !command_parse_aovs(o->aov, &o->aovs, error))
        return false;
    choose_sums(o);
    if (!choose_detail(o, error))
        return false;
    return karst_display_kind_parse(o->display, display, error) && command_find_scene(o->world, &scene, talk, error) &&
           (o->six_way || check_flight(o, error)) &&
           (o->flies || o->six_way ||
            (command_check_picture(o->output, error) && command_check_output(o->output, "-o", true, error))) &&
           (!o->stats || command_check_output(o->stats, "--stats", false, error));
}

static bool note_frame(void *user, const karst_stats *stats)
{
    run_state *state = user;
    command_progress(state->talk, "frame %u   sample %u of %llu   %llu bricks   %llu requests   %.1f s", stats->frame,
                     stats->num_samples, (unsigned long long)state->num_samples,
                     (unsigned long long)stats->num_resident_bricks, (unsigned long long)stats->num_requests,
                     (double)(command_clock_ns() - state->start_ns) / 1e9);
    return command_record_add(state->record, stats, state->error) && !command_interrupted();
}

/* Settles, reads the picture, writes it. */
static bool render_whole(karst_engine *engine, const render_options *o, command_talk *talk, command_record *record,
                         karst_error *error)
{
    karst_error frame_error = {0};
    run_state state = {talk, record, &frame_error, command_clock_ns(), o->look.samples};
    if (o->begun && !command_begun_give(o->begun, engine, o->size_px, error))
        return false;
    bool ran = karst_engine_settle(engine, (uint32_t)o->max_frames, note_frame, &state, &record->settled, error);
    record->elapsed_ns = command_clock_ns() - state.start_ns;
    command_end_progress(talk);
    if (command_interrupted())
        return command_fail_interrupted(error, "interrupted after %zu frames; nothing was written", record->num_frames);
    const int width_px = o->size_px[0], height_px = o->size_px[1];
    if (!ran)
        return false;
    karst_stats stats;
    karst_engine_stats(engine, &stats);
    if (frame_error.status != KARST_OK)
        return karst_fail(error, frame_error.status, "%s", frame_error.message);

    const command_exr exr = {o->aovs, record->settled ? o->note : NULL};
    size_t size_bytes = (size_t)width_px * (size_t)height_px * 4;
    uint8_t *rgba = malloc(size_bytes);
    if (!rgba)
        return karst_fail(error, KARST_FAILED, "out of memory for a picture of %dx%d", width_px, height_px);
    bool written = command_record_picture(record, &stats, record->num_frames, record->settled, error) &&
                   karst_engine_read_pixels(engine, rgba, size_bytes, error) &&
                   command_write_picture(o->output, engine, rgba, width_px, height_px, &exr, error);
    free(rgba);
    return written;
}

/* One picture, or a tile of it. */
static bool render(karst_engine *engine, const render_options *o, command_talk *talk, command_record *record,
                   karst_error *error)
{
    const char *output = o->part_output ? o->part_output : o->output;
    const command_bands bands = {.size_px = o->size_px,
                                 .window_px = o->window_px,
                                 .output = output,
                                 .exr = {o->aovs, o->note},
                                 .has_exposure = is_exposure_fixed(o),
                                 .num_samples = o->look.samples,
                                 .max_frames = (uint32_t)o->max_frames,
                                 .rows = (int)o->rows,
                                 .begun = o->begun};
    return (command_bands_suit(o->size_px, o->window_px, bands.rows)
                ? command_bands_run(engine, &bands, talk, record, error)
                : render_whole(engine, o, talk, record, error)) &&
           (!o->manifest || !record->settled ||
            (command_manifest_add(o->manifest, o->part.num ? o->part.number - 1 : 0, output, error) &&
             command_manifest_write(o->manifest, error)));
}

/* What the picture's light depends on, where it is to be kept; and the samples that are there. */
static bool begin_samples(render_options *o, const karst_engine_config *config, const char *camera, command_talk *talk,
                          bool *is_done, karst_error *error)
{
    const char *output = o->part_output ? o->part_output : o->output;
    if (!(o->aovs >> KARST_AOV_SUMS & 1) || o->flies)
        return true;
    o->note = command_describe_picture(config, camera, o->flight.world_s, o->size_px, o->window_px, error);
    if (!o->note || (o->goes_on && !command_begun_open(output, o->note, &o->begun, is_done, error)))
        return false;
    if (*is_done)
        command_say(talk, "%s: has its %llu samples: nothing is left to draw", output,
                    (unsigned long long)o->look.samples);
    else if (o->begun)
        command_say(talk, "%s: goes on after %u samples", output, command_begun_samples(o->begun));
    return true;
}

static bool write_stats(const char *path, command_record *record, karst_error *error)
{
    char *text = command_record_json(record);
    bool written = text ? command_write_text(path, text, error)
                        : karst_fail(error, KARST_FAILED, "out of memory for the statistics");
    free(text);
    return written;
}

static void say_result(command_talk *talk, const render_options *o, const command_record *record)
{
    const karst_stats *last = &record->last;
    if (o->flies)
        command_say(talk, "%s: %zu pictures of %dx%d, %zu settled, %zu frames in %.2f s, %llu bricks, on %s", o->output,
                    record->num_pictures, o->window_px[2], o->window_px[3], record->num_settled, record->num_frames,
                    (double)record->elapsed_ns / 1e9, (unsigned long long)last->num_resident_bricks, last->device);
    else
        command_say(talk, "%s: %dx%d, %s after %zu frames in %.2f s, %llu bricks, on %s",
                    strcmp(o->output, "-") == 0 ? "stdout" : o->part_output ? o->part_output : o->output,
                    o->window_px[2], o->window_px[3],
                    record->settled ? "settled" : "not settled", record->num_frames, (double)record->elapsed_ns / 1e9,
                    (unsigned long long)last->num_resident_bricks, last->device);
    if (last->detail_given_px > last->detail_asked_px * 1.001)
        command_say(talk,
                    "detail: voxels of %.2f pixels instead of %.2f, which is what fits into the pools; a larger --pool "
                    "gives more",
                    last->detail_given_px, last->detail_asked_px);
}

static karst_engine_config make_config(const render_options *o, karst_display_kind display, karst_helper *helper,
                                       const karst_log *log)
{
    karst_engine_config config = {
        .world = o->world_file, .device = o->device, .display = display, .helper = helper, .log = log};
    config.parameters = o->parameters.values;
    config.num_parameters = o->parameters.num_values;
    int drawn_px[4];
    memcpy(drawn_px, o->window_px, sizeof drawn_px);
    if (!o->flies && !o->six_way && command_bands_suit(o->size_px, o->window_px, (int)o->rows))
        command_bands_first(o->size_px, o->window_px, (int)o->rows, drawn_px);
    config.width_px = drawn_px[2];
    config.height_px = drawn_px[3];
    if (config.width_px != o->size_px[0] || config.height_px != o->size_px[1])
        config.window = (karst_engine_window){o->size_px[0], o->size_px[1], drawn_px[0], drawn_px[1]};
    /* 0 bytes would mean the default: with 1 the library says how much is needed. */
    config.pool_bytes = o->pool_mib > 0 ? (uint64_t)(o->pool_mib * 1048576) : 1;
    config.detail_px = o->detail_px;
    config.view_distance_m = o->view_distance_m;
    config.budget_bricks = (uint32_t)o->budget_bricks;
    config.budget_ms = o->budget_ms;
    config.has_seed = o->has_seed;
    config.seed = (uint32_t)o->seed;
    config.no_shadows = o->no_shadows;
    config.thin = o->thin_kind;
    config.refine = o->refine;
    config.edits = o->edits;
    config.no_blend = o->no_blend;
    config.brick_bits = (int)o->brick_bits;
    config.no_beam = o->no_beam;
    config.lanes = (int)o->lanes;
    command_set_look(&o->look, &config);
    if (o->aovs && config.exposure == KARST_EXPOSURE_OF_WORLD && config.tone == KARST_TONE_OF_PLAIN)
        config.exposure = KARST_EXPOSURE_GIVEN; /* of 0 stops: the same picture, with its light */
    return config;
}

/* ---- jobs ---- */

/* How many pictures or tiles there are, and which of them are this part's. */
static bool find_share(render_options *o, size_t *num, karst_error *error)
{
    *num = o->flies || !o->part.num ? 1 : o->part.num;
    if (!o->flies)
        return true;
    if (!command_flight_count(&o->flight, num, error))
        return false;
    command_part_pictures(o->part, *num, &o->flight.first, &o->flight.end);
    return true;
}

static bool print_jobs(const render_options *o, size_t num, int argc, char **argv, karst_error *error)
{
    char *manifest = NULL;
    const char *slash = strrchr(o->output, '/'), *name = slash ? slash + 1 : o->output, *dot = strrchr(name, '.');
    const int folder_length = (int)(name - o->output);
    const int stem_length = dot && dot != name ? (int)(dot - o->output) : (int)strlen(o->output);
    const int made = o->manifest_file ? asprintf(&manifest, "%s", o->manifest_file)
                     : o->flies       ? asprintf(&manifest, "%.*smanifest.json", folder_length, o->output)
                                      : asprintf(&manifest, "%.*s.manifest.json", stem_length, o->output);
    if (made < 0)
        return karst_fail(error, KARST_FAILED, "out of memory");
    const bool printed =
        command_print_jobs(argc, argv, num < o->num_jobs ? (uint32_t)num : (uint32_t)o->num_jobs, manifest, error);
    free(manifest);
    return printed;
}

/* Opens the manifest; *is_done if nothing is left to draw. */
static bool begin_part(render_options *o, size_t num, int argc, char **argv, command_talk *talk, bool *is_done,
                       karst_error *error)
{
    const size_t first = o->flies ? o->flight.first : o->part.num ? o->part.number - 1 : 0;
    const size_t end = o->flies ? o->flight.end : first + 1;
    *is_done = first == end;
    if (*is_done)
        command_say(talk, "--part %s: has none of the %zu pictures", o->part_text, num);
    if (!o->flies && o->part.num && !(o->part_output = command_part_name(o->output, o->part)))
        return karst_fail(error, KARST_FAILED, "out of memory");
    if (*is_done || !o->manifest_file)
        return true;
    command_be_part_of_job();
    command_job job = {.manifest = o->manifest_file,
                       .part = o->part,
                       .output = o->output,
                       .num = num,
                       .tiles = !o->flies && o->part.num,
                       .size_px = {o->size_px[0], o->size_px[1]},
                       .inputs = {o->world_file},
                       .argc = argc,
                       .argv = argv};
    size_t num_inputs = 1;
    if (o->path)
        job.inputs[num_inputs++] = o->path_file;
    if (o->edits)
        job.inputs[num_inputs++] = o->edits;
    o->flight.manifest = o->manifest = command_manifest_open(&job, o->resume, talk, error);
    if (command_interrupted())
        return command_fail_interrupted(error, "interrupted");
    if (!o->manifest)
        return false;
    *is_done = true;
    for (size_t i = first; i < end; i++)
        *is_done = *is_done && command_manifest_has(o->manifest, i);
    if (*is_done)
        command_say(talk, "%s: %zu of %zu are there and right: nothing is left to draw", o->manifest_file, end - first,
                    end - first);
    else if (command_manifest_count(o->manifest))
        command_say(talk, "%s: %zu of %zu are there and right", o->manifest_file, command_manifest_count(o->manifest),
                    end - first);
    return true;
}

bool command_render(int argc, char **argv, command_talk *talk, karst_error *error)
{
    render_options o = {.display = "auto",
                        .size_px = {1280, 720},
                        .pool_mib = 512,
                        .max_frames = 1000,
                        .look = {.samples = 0}};
    karst_display_kind display_kind;
    uint64_t start_ns = command_clock_ns();
    if (!parse_options(argc, argv, talk, &o, error))
        return false;
    if (o.help)
        return true;
    size_t num_all;
    bool done = false;
    if (!check_options(&o, &display_kind, talk, error) || !find_share(&o, &num_all, error))
        return false;
    if (o.num_jobs)
        return print_jobs(&o, num_all, argc, argv, error);
    if (!command_check_memory(talk, o.pool_mib, display_kind != KARST_DISPLAY_NONE, error))
        return false;
    command_catch_interrupts();
    const bool has_begun = begin_part(&o, num_all, argc, argv, talk, &done, error);
    if (!has_begun || done) {
        command_manifest_close(o.manifest);
        free(o.part_output);
        return has_begun;
    }
    command_open_driver(talk);
    const karst_log log = command_log(talk);
    command_record record = {
        .world = o.world, .width_px = o.window_px[2], .height_px = o.window_px[3], .live = o.flight.live};
    record.path = o.flight.file;
    record.start_ns = o.flight.live ? 0 : start_ns; /* whose first view is not counted */
    karst_engine *engine = NULL;
    karst_helper *helper = NULL;

    command_progress(talk, "opening the device; new kernels take some seconds to build");
    helper = karst_helper_create(NULL); /* without one it only takes longer */
    const karst_engine_config config = make_config(&o, display_kind, helper, &log);
    engine = karst_engine_create(&config, error);
    if (!engine)
        goto out;
    command_catch_crashes(); /* once more: LLVM, in PoCL, has put its own handlers in front */
    record.display = karst_display_kind_name(karst_display_get_kind(karst_engine_display(engine)));
    record.display_description = karst_display_description(karst_engine_display(engine));
    if (!o.has_time) /* a parameter may say it */
        o.flight.world_s = karst_engine_time(engine);
    if (o.camera) {
        karst_camera camera = karst_engine_default_camera(engine);
        if (!karst_camera_parse(o.camera, karst_engine_voxel_log2_m(engine), &camera, error) ||
            !karst_engine_set_camera(engine, &camera, error))
            goto out;
    }
    if (o.six_way) {
        const command_six_way maps = six_way_of(&o);
        done = command_six_way_run(engine, &maps, talk, error);
        goto out;
    }
    karst_camera camera = karst_engine_camera(engine);
    karst_camera_format(&camera, karst_engine_voxel_log2_m(engine), record.camera, sizeof record.camera);
    if ((!o.flies && !karst_engine_set_time(engine, o.flight.world_s, error)) ||
        !begin_samples(&o, &config, record.camera, talk, &done, error) || done)
        goto out;
    if (!(o.flies ? command_flight_run(engine, &o.flight, o.window_px[2], o.window_px[3], talk, &record, error)
                  : render(engine, &o, talk, &record, error)) ||
        (o.stats && !write_stats(o.stats, &record, error)))
        goto out;
    say_result(talk, &o, &record);
    const karst_world_config world = {.world = o.world_file,
                                      .parameters = o.parameters.values,
                                      .num_parameters = o.parameters.num_values,
                                      .has_seed = o.has_seed,
                                      .seed = (uint32_t)o.seed};
    const bool is_whole = !o.flies && memcmp(o.window_px + 2, o.size_px, sizeof o.size_px) == 0;
    if (is_whole && record.last.num_hits == record.last.num_pixels)
        command_say_if_inside(talk, &world, &camera, karst_engine_voxel_log2_m(engine));
    else if (is_whole && record.settled && record.last.num_hits == 0)
        command_say_no_surface(talk, &world, &camera, karst_engine_voxel_log2_m(engine), o.size_px, o.view_distance_m);
    done =
        record.settled || record.live ||
        karst_fail(error, KARST_FAILED, "not settled within %d frames: %s is written as it stands; raise --frames-max",
                   (int)o.max_frames, o.output);
out:
    command_end_progress(talk);
    karst_engine_destroy(engine);
    karst_helper_destroy(helper);
    command_record_free(&record);
    command_manifest_close(o.manifest);
    command_begun_close(o.begun);
    free(o.note);
    free(o.part_output);
    return done;
}
