/* What the parts of the karst command share. Names of the library begin with karst_, the command's own with command_.
 *
 *   karst.c            main: finds the subcommand, prints help, turns an error into a line and an exit code
 *   command_options.c  options from a table: parsing and their help
 *   command_descriptors.c  stdin, stdout and stderr as they are found
 *   command_stdin.c    a world from stdin
 *   command_talk.c     messages and the progress line on stderr
 *   command_output.c   files that appear whole or not at all
 *   command_world.c    which world is meant
 *   command_interrupt.c  Ctrl-C and its like
 *   command_environment.c  variables that mean nothing
 *   command_driver.c   what is asked of the OpenCL driver before it is opened
 *   command_process.c  stacks, limits, and what is said when the program dies
 *   command_record.c   figures of a run, and their JSON
 *   command_render.c   karst render
 *   command_bands.c    pictures in bands of rows
 *   command_begun.c    an .exr whose samples are gone on with
 *   command_flight.c   karst render --path
 *   command_pictures.c   many pictures: numbered PNGs or EXRs, or a video through ffmpeg
 *   command_parts.c, command_manifest.c, command_verify.c  jobs in parts: see command_farm.h
 *   command_accuracy*.c  karst accuracy; see command_accuracy.h
 *   command_bench*.c   karst bench; see command_bench.h
 *   command_check.c    karst check
 *   command_sample.c   karst sample
 *   command_mesh.c     karst mesh
 *   command_heights.c  karst heights
 *   command_voxels.c   karst voxels
 *   command_points.c   karst points
 *   command_export.c   what these four share: see command_export.h
 *   command_bake.c     karst bake
 *   command_box.c      boxes cut into cells
 *   view/              karst view; see view/view.h
 *   command_saved.c    saved worlds where a world is taken
 *   command_new.c      karst new
 *   command_edit.c     karst edit
 *   command_import.c   karst import
 *   command_info.c     karst info, karst --version
 */
#ifndef KARST_DEMOS_COMMAND_H
#define KARST_DEMOS_COMMAND_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <karst/karst.h>

/* ---- command_options.c ---- */

typedef enum {
    COMMAND_FLAG,      /* bool */
    COMMAND_TEXT,      /* const char * */
    COMMAND_INTEGER,   /* uint64_t, within [min, max] */
    COMMAND_NUMBER,    /* double, within [min, max] */
    COMMAND_SIZE,      /* int[2]: WIDTHxHEIGHT, each within [min, max] */
    COMMAND_LIST,      /* command_list: a text; may be given again */
    COMMAND_PARAMETERS /* command_parameters: NAME=VALUE; may be given again */
} command_option_kind;

#define COMMAND_MAX_PARAMETERS 64
typedef struct {
    karst_parameter values[COMMAND_MAX_PARAMETERS];
    char names[COMMAND_MAX_PARAMETERS][64];
    size_t num_values;
} command_parameters;

typedef struct {
    const char **items; /* the caller's: room for as many as there are arguments */
    size_t num_items;
} command_list;

/* One option: --name VALUE, --name=VALUE, or -letter VALUE. `value` points at what its kind says; `given` may be NULL.
 */
typedef struct {
    const char *name;
    char letter; /* 0: none */
    command_option_kind kind;
    const char *argument; /* as help names it, such as "WxH"; NULL for flags */
    const char *help;
    void *value;
    double min, max;
    bool *given;
} command_option;

/* Parses arguments (without the subcommand's name). At most max_words that are no options go to words; `help` becomes
 * true on --help or -h, and then nothing more is looked at. Errors: KARST_USAGE, naming the option and what would do.
 */
bool command_parse(int argc, char **argv, const command_option *options, size_t num_options, const char **words,
                   size_t max_words, size_t *num_words, bool *help, karst_error *error);
/* A line for each option. */
void command_print_options(FILE *file, const command_option *options, size_t num_options);
/* The most similar of `names` (ended by NULL), or NULL if none is near. */
const char *command_nearest(const char *word, const char *const *names);

/* ---- command_descriptors.c ---- */

/* First of all: descriptors 0 to 2 that are closed become ones that cannot be read or written (stderr: that say
 * nothing), so that no file opened later takes their place. */
void command_open_descriptors(void);
bool command_can_write_stdout(void); /* false: it was closed */
bool command_can_read_stdin(void);
/* All of it into a file descriptor; false with errno. */
bool command_write_all(int fd, const void *data, size_t size_bytes);

/* ---- command_stdin.c ---- */

/* Copies a world's text from stdin, once, into a file of its own that goes when the process ends, and gives its name.
 * Errors: KARST_USAGE (stdin is closed, or a terminal), KARST_BAD_WORLD (it cannot be read), KARST_FAILED. */
bool command_read_stdin(char *world, size_t size_bytes, karst_error *error);
const char *command_stdin_file(void); /* that file; "": none */

/* ---- command_talk.c ---- */

/* How the command talks: to stderr, and only what was wished for. */
typedef struct {
    bool quiet;           /* errors and warnings only */
    bool verbose;         /* the library's own remarks too */
    bool on_terminal;     /* stderr is one: show progress */
    bool colour;          /* on a terminal, unless NO_COLOR is set */
    bool progress_shown;  /* a progress line stands there now */
    uint64_t shown_at_ns; /* when */
    char said[1024];      /* the first mistake in a world's text that was said: file:line:column: what */
} command_talk;

void command_talk_init(command_talk *talk);
/* One line, unless quiet. */
void command_say(command_talk *talk, const char *format, ...) __attribute__((format(printf, 2, 3)));
void command_say_error(command_talk *talk, const char *message);
/* One line, also of who is quiet. */
void command_warn(command_talk *talk, const char *message);
/* A line of what a world's text is told (file:line:column: error: what, or what stands under that), as it is, so that
 * editors find the place. */
void command_say_diagnostic(command_talk *talk, const char *line);
/* A line in which the file that holds what came from stdin is called what people know it by; `text` may hold it. */
const char *command_name_stdin(const char *line, char *text, size_t size_bytes);
/* The last line of a failed command: the message, or less if it is a mistake that has been said. */
void command_say_failure(command_talk *talk, const char *message);
/* Replaces the progress line, at most ten times a second; nothing unless on a terminal and not quiet. */
void command_progress(command_talk *talk, const char *format, ...) __attribute__((format(printf, 2, 3)));
void command_end_progress(command_talk *talk);
/* The library's log, through `talk`, which must outlive it. */
karst_log command_log(command_talk *talk);
uint64_t command_clock_ns(void); /* monotonic */

/* ---- command_output.c ---- */

/* Whether a file could be written at `path` ("-": stdout, which must not be a terminal if it is `binary`), before long
 * work is done for it. Leaves nothing behind. Errors: KARST_FAILED, KARST_USAGE. */
bool command_check_output(const char *path, const char *option, bool binary, karst_error *error);
/* Writes a text whole or not at all; "-": stdout. Errors: KARST_FAILED. */
bool command_write_text(const char *path, const char *text, karst_error *error);
/* Opens a new file in the folder of `path`, whose name ends in `suffix` and goes to *temporary (malloc'ed); -1 with
 * errno if there can be none, or `path` could not be a file's name. */
int command_open_beside(const char *path, const char *suffix, char **temporary);
bool command_is_exr(const char *path); /* by its suffix */
/* What a picture to stdout is written to first; then it is copied there, if it was `written`, and removed. Errors:
 * KARST_FAILED. */
bool command_begin_stdout(char *picture, size_t size_bytes, karst_error *error);
bool command_end_stdout(char *picture, bool written, karst_error *error);
/* Leaves of rows of width_px pixels those of a part (x, y, width, height) alone, in place. */
void command_crop(void *values, size_t pixel_bytes, int width_px, const int part_px[4]);
/* What an .exr has of each pixel. */
typedef struct {
    unsigned aovs;  /* bits 1 << karst_aov */
    bool has_bytes; /* its colours are those of the bytes, as there is no light */
    const char *names[KARST_IMAGE_MAX_CHANNELS];
    karst_image_channel channels[KARST_IMAGE_MAX_CHANNELS]; /* num_filled of them */
    float *values[KARST_NUM_AOVS + 1];
    int num_channels, num_filled, num_values;
} command_layers;
/* aovs 0: light, or without any the bytes' colours, depth and normals. */
void command_layers_init(command_layers *layers, unsigned aovs, bool keeps_radiance);
/* Reads them of a part (x, y, width, height) of the last frame, whose pixels are `rgba`. Errors: KARST_FAILED. */
bool command_layers_read(command_layers *layers, karst_engine *engine, const uint8_t *rgba, const int drawn_px[2],
                         const int part_px[4], karst_error *error);
void command_layers_free(command_layers *layers); /* the values alone */
/* What is wanted of an .exr: zeros are light, depth and normals. */
typedef struct {
    unsigned aovs;
    const char *note; /* karst_image_begin_exr; NULL: none */
} command_exr;
/* The engine's last frame, whose pixels are `rgba`, whole or not at all: an EXR if `path` ends in .exr, else a PNG;
 * "-": a PNG to stdout. Errors: KARST_FAILED. */
bool command_write_picture(const char *path, karst_engine *engine, const uint8_t *rgba, int width_px, int height_px,
                           const command_exr *exr, karst_error *error);
/* Names of karst_aov with commas between them, as bits 1 << karst_aov. Errors: KARST_USAGE. */
bool command_parse_aovs(const char *text, unsigned *aovs, karst_error *error);

/* ---- command_six_way.c ---- */

/* Light maps of moments that are step_s apart, on one sheet for each map. */
typedef struct {
    const char *pattern; /* of two files: %s becomes positive and negative */
    int size_px[2];      /* of a moment's map */
    uint64_t num;        /* moments, at least 1 */
    double start_s, step_s;
    uint32_t max_frames;
} command_six_way;
/* Errors: KARST_USAGE, KARST_FAILED (a file that cannot be written). */
bool command_six_way_check(const command_six_way *maps, karst_error *error);
/* Draws and writes them, each file whole or not at all, and says so. Errors: as karst_engine_six_way; KARST_FAILED also
 * of what did not settle, once it is written. */
bool command_six_way_run(karst_engine *engine, const command_six_way *maps, command_talk *talk, karst_error *error);

/* ---- command_ray.c ---- */

/* How `karst sample --ray` looks, and what it prints: JSON or text, an empty line before what is not the first. */
typedef struct {
    double footprint_m;
    const char *device;
    bool json, is_later;
    const karst_log *log;
    double time_s;
} command_ray_look;
/* Prints what the ray "X,Y,Z,DX,DY,DZ" passes of the world's medium. Errors: KARST_USAGE, and those of
 * karst_world_medium_depth. */
bool command_sample_ray(const karst_world *world, const char *text, const command_ray_look *look, karst_error *error);

/* ---- command_look.c ---- */

/* How a picture looks: samples, mirrors, tone, exposure. Texts and numbers as options give them. */
typedef struct {
    uint64_t samples;
    double mirror;
    bool has_mirror, occlusion, no_occlusion;
    const char *light; /* NULL: direct */
    uint64_t bounces;
    uint64_t caustics;
    karst_integrator parsed_light;
    const char *tone;     /* NULL: filmic */
    const char *exposure; /* NULL: what the world or the picture says */
    const char *sun;      /* NULL: where the world says */
    const char *media;    /* NULL: full */
    karst_media_mode parsed_media;
    const char *scattering; /* NULL: octaves */
    karst_scattering parsed_scattering;
    karst_sun parsed_sun;
    karst_tone parsed_tone;
    bool has_exposure, auto_exposure;
    double exposure_stops;
} command_look;

/* Lines of an option table. */
#define COMMAND_MIRROR_OPTION(share, given)                                                                          \
    {                                                                                                                \
        "mirror", 0, COMMAND_NUMBER, "SHARE", "of its light that land mirrors, 0 to 1 (default: the world's, or 0)", \
            share, 0, 1, given                                                                                       \
    }
#define COMMAND_OCCLUSION_OPTIONS(on, off)                                                                           \
    {"occlusion", 0, COMMAND_FLAG, NULL, "darken what little light from all around reaches (default: the world's)",  \
     on, 0, 0, NULL},                                                                                                \
    {                                                                                                                \
        "no-occlusion", 0, COMMAND_FLAG, NULL, "whatever the world says: light from all around comes everywhere",    \
            off, 0, 0, NULL                                                                                          \
    }
#define COMMAND_TONE_OPTIONS(look)                                                                                   \
    COMMAND_OCCLUSION_OPTIONS(&(look)->occlusion, &(look)->no_occlusion),                                            \
    COMMAND_MIRROR_OPTION(&(look)->mirror, &(look)->has_mirror),                                                     \
        {"light", 0, COMMAND_TEXT, "LIGHT", "direct, or full: all of it, by many samples (default: direct)",         \
         &(look)->light, 0, 0, NULL},                                                                                \
        {"bounces", 0, COMMAND_INTEGER, "N", "surfaces that light meets: full 64, clear matter 6 by default",          \
         &(look)->bounces, 1, KARST_ENGINE_MAX_BOUNCES, NULL},                                                       \
        {"caustics", 0, COMMAND_INTEGER, "N", "photons for the light that mirrors and clear matter throw",           \
         &(look)->caustics, 1, KARST_ENGINE_MAX_PHOTONS, NULL},                                                      \
        {"tone", 0, COMMAND_TEXT, "TONE", "from light to colours: filmic or plain (default: filmic)", &(look)->tone, \
         0,      0, NULL},                                                                                           \
    {                                                                                                                \
        "exposure", 0, COMMAND_TEXT, "STOPS",                                                                        \
            "each twice as bright, or auto: by the picture's median (default: the world's, or auto)",                \
            &(look)->exposure, 0, 0, NULL                                                                            \
    },                                                                                                               \
    {                                                                                                                \
        "sun", 0, COMMAND_TEXT, "AZIMUTH,ELEVATION",                                                                 \
            "where the sun stands, in degrees: a compass bearing, and how high (default: the world's)",              \
            &(look)->sun, 0, 0, NULL                                                                                 \
    },                                                                                                               \
    {                                                                                                                \
        "media", 0, COMMAND_TEXT, "MODE",                                                                            \
            "light in clouds, fog and smoke: full, shadow (land knows nothing of it) or basic (default: full)",      \
            &(look)->media, 0, 0, NULL                                                                               \
    },                                                                                                               \
    {                                                                                                                \
        "scattering", 0, COMMAND_TEXT, "HOW",                                                                        \
            "of light in them: once, octaves of it, fluence (all, from a grid), or paths (all) (default: octaves)",  \
            &(look)->scattering, 0, 0, NULL                                                                          \
    }

/* Errors: KARST_USAGE. */
bool command_check_look(command_look *look, karst_error *error);
void command_set_look(const command_look *look, karst_engine_config *config);
/* What karst_engine_config has for --occlusion and --no-occlusion, of which the latter counts. */
karst_occlusion_mode command_occlusion(bool on, bool off);
/* What karst_engine_config has for --mirror. */
double command_mirror(double share, bool given);

/* ---- command_find.c ---- */

/* What the engine is to be given for WORLD: a path, or the name of a shipped world; "-" is a temporary file that holds
 * what stdin gave. Errors: KARST_BAD_WORLD, with a suggestion and what there is; KARST_USAGE and KARST_FAILED of
 * stdin. */
bool command_find_world(const char *name, char *world, size_t size_bytes, karst_error *error);
/* The file of a camera path, likewise. Errors: KARST_BAD_DATA. */
bool command_find_path(const char *name, char *path, size_t size_bytes, karst_error *error);

/* ---- command_saved.c ---- */

/* Where a command keeps what a saved world may say as well: what is set already stays. `camera` and `edits` may be
 * NULL: the command has no use for them. Texts live as long as the program. */
typedef struct {
    char *world_file; /* becomes what the engine is to be given */
    size_t size_bytes;
    const char **camera, **edits;
    command_parameters *parameters;
    bool *has_seed;
    uint64_t *seed;
} command_scene;

/* command_find_world, and for a saved world (.karstdb) all that it says. Errors: also KARST_BAD_DATA (it cannot be
 * read), KARST_USAGE (edits are given beside its own). */
bool command_find_scene(const char *name, const command_scene *scene, command_talk *talk, karst_error *error);
/* Whether that file holds a text from inside a saved world, for as long as the program runs. */
bool command_is_from_inside(const char *world_file);
/* What a saved world holds, for karst info. */
bool command_print_saved(const char *name, bool json, command_talk *talk, karst_error *error);
/* The edits of a file of edits or of a saved world: karst_edits_load, karst_saved_load_edits. */
karst_edit *command_load_edits(const char *path, int voxel_log2_m, size_t *num, const karst_log *log,
                               karst_error *error);

/* ---- command_import.c ---- */

/* What imported points hold, for karst info. */
bool command_print_points(const char *name, bool json, karst_error *error);

/* ---- command_world.c ---- */

/* Of a picture without a surface: warns if there would be one beyond the view distance, even of who is quiet; else says
 * that there is none in view. `view_m` as the picture had it; 0: the world's own. */
void command_say_no_surface(command_talk *talk, const karst_world_config *world, const karst_camera *camera,
                            int voxel_log2_m, const int size_px[2], double view_m);
/* Says so if a camera stands inside solid ground, and where there is air above it: its picture is a puzzle. */
void command_say_if_inside(command_talk *talk, const karst_world_config *world, const karst_camera *camera,
                           int voxel_log2_m);
/* A line for each shipped world. */
void command_print_worlds(FILE *file);

/* ---- command_environment.c ---- */

/* Warns of variables KARST_... that nobody reads, or whose values mean nothing. */
void command_check_environment(command_talk *talk);

/* ---- command_interrupt.c ---- */

void command_catch_interrupts(void);
/* By SIGINT, SIGTERM or SIGHUP, since then. Who sees it has 750 ms to clean up, then the program ends by the signal, as
 * it does if nobody looks for so long. */
bool command_interrupted(void);
/* Meanwhile the program does not end for having taken too long: it is writing what was asked for. */
void command_hold_interrupts(bool held);
/* As long as there is something that only this program knows, it is given five seconds. */
void command_have_much_to_lose(bool much);
/* What is still to do are things that the end of a process does as well. */
void command_have_all_saved(void);
/* Ends the program by the signal that interrupted it, so that a shell's loop ends too. A command that is done all the
 * same (a window that was asked to close) does so only by SIGINT. */
void command_end_if_interrupted(bool done);
/* From then on SIGTERM ends the program with exit code COMMAND_AGAIN, as what is being done is part of a job: whoever
 * started it is to start it again. */
#define COMMAND_AGAIN 75
void command_be_part_of_job(void);
/* Files to be removed if the program has to end in the middle of something; a few at a time. */
void command_add_temporary(const char *path);
void command_drop_temporary(const char *path);
/* Fails with this instead of what *error says: LLVM, inside PoCL, answers those signals by removing its temporary
 * files, so what was being built then fails, and that is not what to tell. Returns false. */
bool command_fail_interrupted(karst_error *error, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* ---- command_driver.c ---- */

/* Before anything of OpenCL: gives the driver a store of Karst's own (karst/driver.h), and asks PoCL to bind its
 * threads to a CPU each, where that is safe and nobody else has set POCL_AFFINITY: the work of a frame is many short
 * launches, and a thread that wakes where the other one runs waits for milliseconds before it is moved to an idle
 * CPU. */
void command_open_driver(command_talk *talk);

/* ---- command_process.c ---- */

/* Runs `function` where the stack is large enough for a compiler, on a thread of its own if need be, and sees to it
 * that threads that are started later have such stacks. Returns what it returns. */
int command_run_with_stack(int (*function)(int, char **), int argc, char **argv);
/* Fails if a limit of this process's addresses leaves no room for a pool and a driver. */
bool command_check_memory(command_talk *talk, double pool_mib, bool with_display, karst_error *error);
/* From then on a crash says a line on stderr before the program dies of it. */
void command_catch_crashes(void);

/* ---- command_record.c ---- */

/* What a run was, and the times of all its frames. Zero-initialise; command_record_free frees the times. */
typedef struct {
    const char *world;
    char camera[512];
    const char *display, *display_description;
    int width_px, height_px;
    bool settled;     /* all pictures */
    bool live;        /* one frame for each picture */
    const char *path; /* NULL: a single view */
    uint64_t elapsed_ns;
    uint64_t start_ns; /* when the command began, on command_clock_ns; 0: not known */
    uint64_t hole_free_ns,
        complete_ns; /* from then to the first picture without a hole, and to the first settled one */
    size_t num_frames, max_frames;
    uint64_t *times_ns; /* of each frame: KARST_NUM_STAGES stages, then the frame */
    uint64_t num_requests, num_produced, num_evicted, num_reproduced, num_deferred;
    size_t num_pictures, num_settled, max_pictures;
    size_t frames_to_settle; /* the most that any picture took */
    double *at_level;        /* of each picture: the share of its hits that are at the level asked for */
    double *at_own_level;    /* the same at the level that --detail stands for */
    karst_stats last;
} command_record;

/* Adds a frame. Errors: KARST_FAILED (memory). */
bool command_record_add(command_record *record, const karst_stats *stats, karst_error *error);
/* Notes that the frame last added is a picture, for which so many frames were drawn. Errors: KARST_FAILED (memory). */
bool command_record_picture(command_record *record, const karst_stats *stats, size_t num_frames, bool settled,
                            karst_error *error);
/* The statistics file's text, malloc'ed. The names in it are a contract; README.md lists them. NULL: out of memory. */
char *command_record_json(command_record *record); /* sorts both */
void command_record_free(command_record *record);

/* ---- command_pictures.c ---- */

/* Where many pictures go. */
typedef struct command_pictures command_pictures;

bool command_pictures_is_video(const char *output); /* by its suffix */
/* Whether a picture's name ends as one that can be written: not in .jpg, say, or without a path in .mp4. Names without
 * a suffix are PNGs. Errors: KARST_USAGE. */
bool command_check_picture(const char *path, karst_error *error);
/* The file of picture `index` of a pattern; malloc'ed; NULL: out of memory. */
char *command_picture_name(const char *pattern, size_t index);
/* Whether `output` will do, before long work is done for it: a pattern with one %05d (without, if there is only one
 * picture) in a folder that can be written, or a video, with ffmpeg installed. Errors: KARST_USAGE, KARST_FAILED naming
 * what to install. */
bool command_pictures_check(const char *output, bool only_one, int width_px, int height_px, karst_error *error);
/* `output` is borrowed. End it with finish or discard. */
command_pictures *command_pictures_open(const char *output, int width_px, int height_px, double fps,
                                        karst_error *error);
/* Pictures in their order, from index 0; each is on disk, or in ffmpeg's hands, when it returns. */
bool command_pictures_add(command_pictures *pictures, size_t index, karst_engine *engine, const uint8_t *rgba,
                          karst_error *error);
/* A video appears now, whole. Also ends `pictures` if it fails. */
bool command_pictures_finish(command_pictures *pictures, karst_error *error);
/* Leaves no video behind; single pictures stay. NULL is fine. */
void command_pictures_discard(command_pictures *pictures);

/* ---- command_flight.c ---- */

/* How to fly; zeros mean left out. */
typedef struct {
    const char *file; /* the path; NULL: the camera stands still, for num_pictures */
    const char *output;
    size_t num_pictures;
    double fps, start_s, end_s;
    double world_s, world_step_s; /* the world's time at the first picture, and from one to the next */
    bool has_start, has_end;
    bool live;           /* one frame for each picture, whatever it lacks, after having settled at the start */
    uint32_t max_frames; /* to settle a picture */
    size_t first, end;   /* only the pictures from `first` to before `end`; end 0: all */
    struct command_manifest *manifest; /* notes each settled picture, and says which are done; NULL: none */
} command_flight;

/* How many pictures a flight has. Errors: KARST_USAGE (beyond the path), KARST_BAD_DATA (the path). */
bool command_flight_count(const command_flight *flight, size_t *num, karst_error *error);

/* Flies along the path and writes the pictures; fills all of `record` that a run fills. Errors: also KARST_BAD_DATA
 * (the path). */
bool command_flight_run(karst_engine *engine, const command_flight *flight, int width_px, int height_px,
                        command_talk *talk, command_record *record, karst_error *error);

/* ---- subcommands: arguments without their own names ---- */

/* A subcommand. `run` returns false with an error; on --help it prints its help to stdout and returns true. */
/* ---- command_box.c ---- */

/* --box: X0,Y0,Z0,X1,Y1,Z1 in metres, of cells so wide; `most` of them along an axis, called so for people. Errors:
 * KARST_USAGE. */
bool command_parse_box(const char *box, double cell_m, const char *cells_name, int64_t most, int voxel_log2_m,
                       karst_position *corner, int64_t num_cells[3], karst_error *error);

typedef struct {
    const char *name, *summary;
    bool (*run)(int argc, char **argv, command_talk *talk, karst_error *error);
} command;

bool command_render(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_view(int argc, char **argv, command_talk *talk, karst_error *error);
/* Whether a variable KARST_VIEW_... stands for one of its options. */
bool command_view_has_variable(const char *name);
bool command_bench(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_accuracy(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_check(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_verify(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_sample(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_new(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_edit(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_heights(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_bake(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_voxels(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_mesh(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_points(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_import(int argc, char **argv, command_talk *talk, karst_error *error);
bool command_info(int argc, char **argv, command_talk *talk, karst_error *error);
void command_print_version(FILE *file);

#endif
