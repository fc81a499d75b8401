/* karst bake: a light map, from pictures of the light that falls on land. */
#include "command.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <jansson.h>

#define MOST_POINTS 4194304 /* of a map: raycast/light/light_map.h */
#define NUM_FACES 6
#define POINT_BYTES 52
#define WRITTEN_POINTS 1024
/* Points count this many of their pixels' widths around them, and are not taken to be wider than at this cosine. */
#define REACH_PX 1.5
#define LEAST_COSINE 0.1

typedef struct {
    double at_m[3];
    float normal[3], light[3], radius_m;
} bake_point;

typedef struct {
    const char *world, *output, *device, *edits, *sun;
    command_list cameras;
    command_parameters parameters;
    uint64_t seed, side_px, samples, bounces, max_frames;
    double pool_mib, detail_px, view_distance_m;
    bool has_seed, json, refine;
    command_look look;
    command_talk *talk;
    char world_file[PATH_MAX];
    bake_point *points;
    size_t num_points, num_views, view; /* views: faces of cubes around cameras */
    uint64_t start_ns;
} bake_options;

static void print_help(const command_option *options, size_t num_options)
{
    puts("karst bake WORLD -o FILE.ply [OPTIONS]\n"
         "Finds what light falls on land, by --light full, and writes it as a light map: points with normals and\n"
         "colours, as far as they are seen from a camera, all around it. A world that names the map in its header,\n"
         "\"light_map\": \"FILE.ply\", has that light in every picture, without noise: light that surfaces throw at\n"
         "one another, that glows, and of a sky that is partly hidden. Suns and lamps still shine by\n"
         "themselves. docs/LIGHT.md says more.\n"
         "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nWorlds (or the path of a world file, which ends in .karst):");
    command_print_worlds(stdout);
    puts("\nExamples:\n"
         "  karst bake ruins -o ruins.ply\n"
         "  karst bake mine.karst -o mine.ply --side 256 --samples 256\n"
         "  karst bake mine.karst -o mine.ply --camera 0,2,0,0,0 --camera 0,2,30,0,0\n"
         "\nJSON is one object: file, points, views, samples, seconds.\n"
         "\nExit code: 0 done, 1 failed or not settled, 2 wrong usage, 3 no usable device, 4 no such world, or one\n"
         "that does not compile, 5 a file of edits that cannot be read.");
}

/* ---- pictures of light ---- */

static bool note_frame(void *user, const karst_stats *stats)
{
    const bake_options *o = user;
    command_progress(o->talk, "view %zu of %zu   sample %u of %llu   %zu points   %.1f s", o->view + 1, o->num_views,
                     stats->num_samples, (unsigned long long)o->samples, o->num_points,
                     (double)(command_clock_ns() - o->start_ns) / 1e9);
    return !command_interrupted();
}

typedef struct {
    float *light, *depth_m, *normal;
} face;

static bool make_face(face *f, size_t num_px, karst_error *error)
{
    f->light = malloc(3 * num_px * sizeof *f->light);
    f->depth_m = malloc(num_px * sizeof *f->depth_m);
    f->normal = malloc(3 * num_px * sizeof *f->normal);
    return (f->light && f->depth_m && f->normal) ||
           karst_fail(error, KARST_FAILED, "out of memory for a view of %zu pixels", num_px);
}

static void free_face(face *f)
{
    free(f->light);
    free(f->depth_m);
    free(f->normal);
}

/* The points that a settled face shows. */
static void add_points(bake_options *o, const face *f, const karst_camera *camera, int voxel_log2_m)
{
    const int side = (int)o->side_px;
    const karst_position origin = {{0}, {0}};
    double right[3], up[3], forward[3];
    karst_camera_axes(camera, right, up, forward);
    for (int i = 0; i < side * side; i++) {
        const double across = (2 * (i % side) + 1.0) / side - 1, high = 1 - (2 * (i / side) + 1.0) / side,
                     per = 1 / sqrt(1 + across * across + high * high), t = (double)f->depth_m[i];
        const float *light = f->light + 3 * i, *normal = f->normal + 3 * i;
        if (!(light[0] >= 0) || !isfinite(t) || (normal[0] == 0 && normal[1] == 0 && normal[2] == 0))
            continue;
        double way_m[3], toward = 0;
        for (int axis = 0; axis < 3; axis++) {
            const double d = (forward[axis] + across * right[axis] + high * up[axis]) * per;
            way_m[axis] = d * t;
            toward -= d * (double)normal[axis];
        }
        bake_point *point = &o->points[o->num_points++];
        const karst_position at = karst_position_add_m(camera->position, way_m, voxel_log2_m);
        karst_position_difference_m(origin, at, voxel_log2_m, point->at_m);
        memcpy(point->normal, normal, sizeof point->normal);
        memcpy(point->light, light, sizeof point->light);
        point->radius_m = (float)(REACH_PX * 2 / side * t * per / fmax(toward, LEAST_COSINE));
    }
}

/* All around a camera. */
static bool bake_around(bake_options *o, karst_engine *engine, karst_camera camera, face *f, karst_error *error)
{
    static const double turns[NUM_FACES][2] = {{0, 0}, {90, 0}, {180, 0}, {270, 0}, {0, 90}, {0, -90}};
    const size_t num_px = (size_t)o->side_px * (size_t)o->side_px;
    const int voxel_log2_m = karst_engine_voxel_log2_m(engine);
    for (int i = 0; i < NUM_FACES; i++, o->view++) {
        bool settled = false;
        camera.yaw_deg = turns[i][0];
        camera.pitch_deg = turns[i][1];
        camera.fov_deg = 90;
        if (!karst_engine_set_camera(engine, &camera, error) ||
            !karst_engine_settle(engine, (uint32_t)o->max_frames, note_frame, o, &settled, error))
            return false;
        if (command_interrupted())
            return command_fail_interrupted(error, "interrupted after %zu of %zu views; nothing was written", o->view,
                                            o->num_views);
        if (!settled)
            return karst_fail(error, KARST_FAILED,
                              "view %zu of %zu did not settle within %llu frames: raise --frames-max or --pool; "
                              "nothing was written",
                              o->view + 1, o->num_views, (unsigned long long)o->max_frames);
        if (!karst_engine_read_radiance(engine, f->light, 3 * num_px, error) ||
            !karst_engine_read_aov(engine, KARST_AOV_DEPTH, f->depth_m, num_px, error) ||
            !karst_engine_read_aov(engine, KARST_AOV_NORMAL, f->normal, 3 * num_px, error))
            return false;
        add_points(o, f, &camera, voxel_log2_m);
    }
    return true;
}

/* ---- the file ---- */

static uint8_t *put_float(uint8_t *to, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < 4; i++)
        *to++ = (uint8_t)(bits >> 8 * i);
    return to;
}

static uint8_t *put_double(uint8_t *to, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < 8; i++)
        *to++ = (uint8_t)(bits >> 8 * i);
    return to;
}

static bool write_head(const bake_options *o, int fd)
{
    char text[1024];
    const int length = snprintf(text, sizeof text,
                                "ply\nformat binary_little_endian 1.0\n"
                                "comment light that falls on land, as bright as a white surface would be: linear\n"
                                "comment metres in the world: x right, y up, z forward, which is left-handed\n"
                                "comment karst bake, %llu samples\nelement vertex %zu\n"
                                "property double x\nproperty double y\nproperty double z\n"
                                "property float nx\nproperty float ny\nproperty float nz\n"
                                "property float red\nproperty float green\nproperty float blue\n"
                                "property float radius\nend_header\n",
                                (unsigned long long)o->samples, o->num_points);
    return command_write_all(fd, text, (size_t)length);
}

static bool write_points(const bake_options *o, int fd)
{
    uint8_t bytes[WRITTEN_POINTS * POINT_BYTES], *to = bytes;
    for (size_t i = 0; i < o->num_points; i++) {
        const bake_point *p = &o->points[i];
        for (int axis = 0; axis < 3; axis++)
            to = put_double(to, p->at_m[axis]);
        for (int axis = 0; axis < 3; axis++)
            to = put_float(to, p->normal[axis]);
        for (int c = 0; c < 3; c++)
            to = put_float(to, p->light[c]);
        to = put_float(to, p->radius_m);
        if (to == bytes + sizeof bytes || i + 1 == o->num_points) {
            if (!command_write_all(fd, bytes, (size_t)(to - bytes)))
                return false;
            to = bytes;
        }
    }
    return true;
}

/* Whole or not at all. */
static bool write_map(const bake_options *o, karst_error *error)
{
    char *temporary = NULL;
    command_hold_interrupts(true);
    const int fd = command_open_beside(o->output, "", &temporary);
    mode_t mask = umask(0);
    umask(mask);
    bool written = fd >= 0 && write_head(o, fd) && write_points(o, fd) && fchmod(fd, 0666 & ~mask) == 0;
    written = fd >= 0 && close(fd) == 0 && written && rename(temporary, o->output) == 0;
    if (!written) {
        karst_fail(error, KARST_FAILED, "cannot write %s: %s", o->output, strerror(errno));
        if (temporary)
            unlink(temporary);
    }
    free(temporary);
    command_hold_interrupts(false);
    return written;
}

static bool report(const bake_options *o, karst_error *error)
{
    const double seconds = (double)(command_clock_ns() - o->start_ns) / 1e9;
    if (!o->json) {
        command_say(o->talk, "%s: %zu points of %zu views, %llu samples, in %.1f s", o->output, o->num_points,
                    o->num_views, (unsigned long long)o->samples, seconds);
        return true;
    }
    json_t *object = json_pack("{s:s, s:I, s:I, s:I, s:f}", "file", o->output, "points", (json_int_t)o->num_points,
                               "views", (json_int_t)o->num_views, "samples", (json_int_t)o->samples, "seconds",
                               seconds);
    char *text = object ? json_dumps(object, JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(6)) : NULL;
    json_decref(object);
    if (!text)
        return karst_fail(error, KARST_FAILED, "out of memory");
    puts(text);
    free(text);
    return true;
}

/* ---- the command ---- */

static bool bake_all(bake_options *o, const char *camera_text, karst_engine *engine, karst_error *error)
{
    face f = {0};
    const size_t num_px = (size_t)o->side_px * (size_t)o->side_px;
    bool done = make_face(&f, num_px, error);
    if (done && !(o->points = malloc(o->num_views * num_px * sizeof *o->points)))
        done = karst_fail(error, KARST_FAILED, "out of memory for %zu points", o->num_views * num_px);
    for (size_t i = 0; done && i < o->num_views / NUM_FACES; i++) {
        const char *text = o->cameras.num_items ? o->cameras.items[i] : camera_text;
        karst_camera camera = karst_engine_default_camera(engine);
        done = (!text || karst_camera_parse(text, karst_engine_voxel_log2_m(engine), &camera, error)) &&
               bake_around(o, engine, camera, &f, error);
    }
    command_end_progress(o->talk);
    free_face(&f);
    if (done && o->num_points == 0)
        done = karst_fail(error, KARST_FAILED, "no land is seen from there: nothing was written");
    return done && write_map(o, error) && report(o, error);
}

static bool run(bake_options *o, const karst_log *log, karst_error *error)
{
    const char *camera_text = NULL;
    const command_scene scene = {o->world_file, sizeof o->world_file, &camera_text, &o->edits,
                                 &o->parameters, &o->has_seed, &o->seed};
    karst_camera camera = {.fov_deg = 60};
    o->num_views = NUM_FACES * (o->cameras.num_items ? o->cameras.num_items : 1);
    if (!o->output)
        return karst_fail(error, KARST_USAGE, "which file? For example: -o light.ply");
    if (o->num_views * o->side_px * o->side_px > MOST_POINTS)
        return karst_fail(error, KARST_USAGE,
                          "%zu views of %llux%llu: a light map may have %d points; give a smaller --side", o->num_views,
                          (unsigned long long)o->side_px, (unsigned long long)o->side_px, MOST_POINTS);
    /* The widest voxel takes any coordinate. */
    for (size_t i = 0; i < o->cameras.num_items; i++)
        if (!karst_camera_parse(o->cameras.items[i], KARST_VOXEL_LOG2_MAX, &camera, error))
            return false;
    o->look.sun = o->sun;
    if (!command_check_look(&o->look, error) || !command_check_output(o->output, "-o", true, error) ||
        !command_find_scene(o->world, &scene, o->talk, error) ||
        !command_check_memory(o->talk, o->pool_mib, false, error))
        return false;
    command_catch_interrupts();
    command_open_driver(o->talk);
    karst_engine_config config = {.world = o->world_file,
                                  .parameters = o->parameters.values,
                                  .num_parameters = o->parameters.num_values,
                                  .device = o->device,
                                  .display = KARST_DISPLAY_NONE,
                                  .width_px = (int)o->side_px,
                                  .height_px = (int)o->side_px,
                                  .pool_bytes = o->pool_mib > 0 ? (uint64_t)(o->pool_mib * 1048576) : 1,
                                  .detail_px = o->detail_px,
                                  .view_distance_m = o->view_distance_m,
                                  .has_seed = o->has_seed,
                                  .seed = (uint32_t)o->seed,
                                  .edits = o->edits,
                                  .refine = o->refine,
                                  .log = log};
    command_set_look(&o->look, &config);
    config.samples = (uint32_t)o->samples;
    config.bounces = (uint32_t)o->bounces;
    config.integrator = KARST_INTEGRATOR_FULL;
    config.irradiance = true;
    karst_engine *engine = karst_engine_create(&config, error);
    const bool done = engine && bake_all(o, camera_text, engine, error);
    karst_engine_destroy(engine);
    free(o->points);
    if (!done && command_interrupted())
        return command_fail_interrupted(error, "interrupted: %s was not written", o->output);
    return done;
}

bool command_bake(int argc, char **argv, command_talk *talk, karst_error *error)
{
    bake_options o = {.talk = talk,
                      .side_px = 128,
                      .samples = 64,
                      .max_frames = 10000,
                      .pool_mib = 512,
                      .detail_px = 1,
                      .start_ns = command_clock_ns()};
    const command_option options[] = {
        {"output", 'o', COMMAND_TEXT, "FILE", "the light map, a .ply", &o.output, 0, 0, NULL},
        {"camera", 0, COMMAND_LIST, "X,Y,Z,YAW,PITCH",
         "from where; may be given again, and where it looks does not matter (default: the world's)", &o.cameras, 0, 0,
         NULL},
        {"side", 0, COMMAND_INTEGER, "N", "points along each side of the six views around a camera (default: 128)",
         &o.side_px, 8, 2048, NULL},
        {"samples", 0, COMMAND_INTEGER, "N", "paths for each point (default: 64)", &o.samples, 2,
         KARST_ENGINE_MAX_SAMPLES, NULL},
        {"bounces", 0, COMMAND_INTEGER, "N", "surfaces that light meets (default: 64)", &o.bounces, 1,
         KARST_ENGINE_MAX_BOUNCES, NULL},
        {"sun", 0, COMMAND_TEXT, "AZIMUTH,ELEVATION", "where the sun stands, in degrees (default: the world's)", &o.sun,
         0, 0, NULL},
        {"edits", 0, COMMAND_TEXT, "FILE", "with the edits of a file: docs/EDITS.md", &o.edits, 0, 0, NULL},
        {"seed", 0, COMMAND_INTEGER, "N", "instead of the world's own", &o.seed, 0, 4294967295.0, &o.has_seed},
        {"param", 0, COMMAND_PARAMETERS, "NAME=VALUE", "another value for a parameter; may be given again",
         &o.parameters, 0, 0, NULL},
        {"detail", 0, COMMAND_NUMBER, "PX", "pixels that a voxel may be wide (default: 1)", &o.detail_px, 0.25, 64,
         NULL},
        {"refine", 0, COMMAND_FLAG, NULL, "points lie on the true density, with its exact normals", &o.refine, 0, 0,
         NULL},
        {"view-distance", 0, COMMAND_NUMBER, "M", "metres at which rays end (default: the world's)",
         &o.view_distance_m, 1e-9, 1e18, NULL},
        {"pool", 0, COMMAND_NUMBER, "MIB", "memory for tiles and bricks together (default: 512)", &o.pool_mib, 0,
         16777216, NULL},
        {"frames-max", 0, COMMAND_INTEGER, "N", "frames to settle a view in at most (default: 10000)", &o.max_frames, 1,
         1000000, NULL},
        {"device", 0, COMMAND_TEXT, "DEVICE", "number or part of the name from karst info; cpu; gpu", &o.device, 0, 0,
         NULL},
        {"json", 0, COMMAND_FLAG, NULL, "what was written, as one JSON object", &o.json, 0, 0, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "say nothing but warnings and errors", &talk->quiet, 0, 0, NULL},
        {"verbose", 'v', COMMAND_FLAG, NULL, "say what the library does", &talk->verbose, 0, 0, NULL},
    };
    const size_t num_options = sizeof options / sizeof *options;
    const karst_log log = command_log(talk);
    size_t num_words;
    bool help;
    if (!(o.cameras.items = malloc(((size_t)argc + 1) * sizeof *o.cameras.items)))
        return karst_fail(error, KARST_FAILED, "out of memory");
    bool done = command_parse(argc, argv, options, num_options, &o.world, 1, &num_words, &help, error);
    if (done && help)
        print_help(options, num_options);
    else if (done && num_words == 0)
        done = karst_fail(error, KARST_USAGE, "which world? For example: karst bake ruins -o ruins.ply");
    else if (done)
        done = run(&o, &log, error);
    free(o.cameras.items);
    return done;
}
