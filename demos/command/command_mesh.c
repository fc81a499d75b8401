/* karst mesh: the surface in a box, as triangles in a file. */
#include "command.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

typedef struct {
    const char *world, *box, *output, *edits;
    command_parameters parameters;
    uint64_t seed, num_threads;
    double voxel_m, footprint_m;
    bool has_seed, has_voxel, json, clear;
    command_talk *talk;
} mesh_options;

static void print_help(const command_option *options, size_t num_options)
{
    puts("karst mesh WORLD --box X0,Y0,Z0,X1,Y1,Z1 --voxel S -o FILE.glb|.ply|.obj [OPTIONS]\n"
         "Writes the surface in a box as triangles: watertight and manifold up to the box's faces, sharp edges kept,\n"
         "with exact normals and the world's colours. Space that bounds prove to be empty is never looked at.\n"
         "Coordinates are decimal metres of any length, and exact; those in the file count from the box's lower\n"
         "corner, which the file names. docs/EXPORT.md says more.\n"
         "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nWorlds (or the path of a world file, which ends in .karst):");
    command_print_worlds(stdout);
    puts("\nExamples:\n"
         "  karst mesh hills --box 0,-100,0,500,200,500 --voxel 1 -o hills.glb\n"
         "  karst mesh hills --box 0,-100,0,5000,200,5000 --voxel 10 --footprint 10 -o far.ply\n"
         "  karst mesh asteroid --box 1e15,-500,-500,1000000000000500,500,500 --voxel 2 -o out.obj\n"
         "  karst mesh glass --clear --box -4,0,-4,4,6,4 --voxel 0.1 -o glass.glb\n"
         "  karst mesh lattice --box 0,0,0,8,8,8 --voxel 0.05 -o lattice.glb --json | jq .triangles\n"
         "\nJSON is one object: file, vertices, triangles, sharp_vertices, cells, open_cells, samples, seconds.\n"
         "\nExit code: 0 done (also without a surface), 1 failed, 2 wrong usage, 4 no such world, or one that does\n"
         "not compile, 5 a file of edits that cannot be read.");
}

static bool show_progress(void *user, double share)
{
    const mesh_options *o = user;
    command_progress(o->talk, "%3.0f %%", 100 * share);
    return !command_interrupted();
}

static bool report(const mesh_options *o, const karst_mesh_stats *stats, double seconds, karst_error *error)
{
    if (!o->json) {
        if (stats->num_triangles == 0)
            command_say(o->talk, "no surface is in the box: %s holds no triangle", o->output);
        else
            command_say(o->talk, "%s: %llu triangles, %llu vertices, in %.1f s; of %.4g cells %.2g %% were looked at",
                        o->output, (unsigned long long)stats->num_triangles, (unsigned long long)stats->num_vertices,
                        seconds, stats->num_cells, 100 * (double)stats->num_open_cells / stats->num_cells);
        return true;
    }
    json_t *object = json_object();
    json_object_set_new(object, "file", json_string(o->output));
    json_object_set_new(object, "vertices", json_integer((json_int_t)stats->num_vertices));
    json_object_set_new(object, "triangles", json_integer((json_int_t)stats->num_triangles));
    json_object_set_new(object, "sharp_vertices", json_integer((json_int_t)stats->num_sharp));
    json_object_set_new(object, "cells", json_real(stats->num_cells));
    json_object_set_new(object, "open_cells", json_integer((json_int_t)stats->num_open_cells));
    json_object_set_new(object, "samples", json_integer((json_int_t)stats->num_samples));
    json_object_set_new(object, "seconds", json_real(seconds));
    char *text = json_dumps(object, JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(6));
    json_decref(object);
    if (!text)
        return karst_fail(error, KARST_FAILED, "out of memory");
    puts(text);
    free(text);
    return true;
}

static bool write_mesh(mesh_options *o, const karst_world *world, karst_error *error)
{
    const karst_world_metadata *about = karst_world_get_metadata(world);
    karst_mesh_config config = {
        .cell_m = o->voxel_m, .footprint_m = o->footprint_m, .num_threads = (int)o->num_threads};
    karst_mesh_stats stats;
    if (!command_parse_box(o->box, o->voxel_m, "cells", KARST_MESH_MAX_CELLS, about->voxel_log2_m, &config.corner,
                           config.num_cells, error))
        return false;
    karst_edit *edits =
        o->edits ? command_load_edits(o->edits, about->voxel_log2_m, &config.num_edits, NULL, error) : NULL;
    if (o->edits && !edits)
        return false;
    config.edits = edits;
    const uint64_t start_ns = command_clock_ns();
    command_catch_interrupts();
    bool done = karst_mesh_write(world, &config, o->output, KARST_MESH_OF_SUFFIX, show_progress, o, &stats, error);
    free(edits);
    command_end_progress(o->talk);
    if (!done && command_interrupted())
        return command_fail_interrupted(error, "interrupted: %s was not written", o->output);
    return done && report(o, &stats, (double)(command_clock_ns() - start_ns) / 1e9, error);
}

static bool run(mesh_options *o, const karst_log *log, karst_error *error)
{
    char path[PATH_MAX];
    const command_scene scene = {path, sizeof path, NULL, &o->edits, &o->parameters, &o->has_seed, &o->seed};
    karst_mesh_format format;
    if (!o->box)
        return karst_fail(error, KARST_USAGE, "which box? For example: karst mesh %s --box 0,-100,0,500,200,500 "
                                              "--voxel 1 -o out.glb",
                          o->world);
    if (!o->has_voxel)
        return karst_fail(error, KARST_USAGE, "how wide are the cells? For example: --voxel 1");
    if (!o->output)
        return karst_fail(error, KARST_USAGE, "which file? For example: -o out.glb, or .ply, or .obj");
    if (!karst_mesh_format_of(o->output, &format, error) || !command_check_output(o->output, "-o", true, error) ||
        !command_find_scene(o->world, &scene, o->talk, error))
        return false;
    const karst_world_config config = {.world = path,
                                       .parameters = o->parameters.values,
                                       .num_parameters = o->parameters.num_values,
                                       .has_seed = o->has_seed,
                                       .seed = (uint32_t)o->seed,
                                       .log = log,
                                       .part = o->clear ? KARST_WORLD_CLEAR : KARST_WORLD_LAND};
    karst_world *world = karst_world_open(&config, error);
    bool done = world && write_mesh(o, world, error);
    karst_world_close(world);
    return done;
}

bool command_mesh(int argc, char **argv, command_talk *talk, karst_error *error)
{
    mesh_options o = {.talk = talk};
    const command_option options[] = {
        {"box", 0, COMMAND_TEXT, "X0,Y0,Z0,X1,Y1,Z1", "lower and upper corner, in metres", &o.box, 0, 0, NULL},
        {"voxel", 0, COMMAND_NUMBER, "S", "how wide a cell is, in metres", &o.voxel_m, 1e-30, 1e30, &o.has_voxel},
        {"output", 'o', COMMAND_TEXT, "FILE", "a .glb (glTF 2.0), .ply or .obj", &o.output, 0, 0, NULL},
        {"footprint", 0, COMMAND_NUMBER, "W", "metres: without finer detail, as a voxel of that width (default: 0)",
         &o.footprint_m, 0, 1e30, NULL},
        {"edits", 0, COMMAND_TEXT, "FILE", "with the edits of a file: docs/EDITS.md", &o.edits, 0, 0, NULL},
        {"clear", 0, COMMAND_FLAG, NULL, "the world's clear matter instead of its land", &o.clear, 0, 0, NULL},
        {"json", 0, COMMAND_FLAG, NULL, "what was written, as one JSON object", &o.json, 0, 0, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "say errors and warnings only", &talk->quiet, 0, 0, NULL},
        {"threads", 0, COMMAND_INTEGER, "N", "how many work (default: one for each core)", &o.num_threads, 1, 256,
         NULL},
        {"seed", 0, COMMAND_INTEGER, "N", "instead of the world's own", &o.seed, 0, 4294967295.0, &o.has_seed},
        {"param", 0, COMMAND_PARAMETERS, "NAME=VALUE", "another value for a parameter; may be given again",
         &o.parameters, 0, 0, NULL},
    };
    const size_t num_options = sizeof options / sizeof *options;
    const karst_log log = command_log(talk);
    size_t num_words;
    bool help;
    if (!command_parse(argc, argv, options, num_options, &o.world, 1, &num_words, &help, error))
        return false;
    if (help) {
        print_help(options, num_options);
        return true;
    }
    if (num_words == 0)
        return karst_fail(error, KARST_USAGE, "which world? For example: karst mesh hills --box 0,-100,0,500,200,500 "
                                              "--voxel 1 -o out.glb");
    return run(&o, &log, error);
}
