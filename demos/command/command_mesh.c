/* karst mesh: the surface in a box, as triangles in a file. */
#include "command_export.h"

#include <stdlib.h>

static const char about[] =
    "karst mesh WORLD --box X0,Y0,Z0,X1,Y1,Z1 --voxel S -o FILE.glb|.ply|.obj [OPTIONS]\n"
    "Writes the surface in a box as triangles: watertight and manifold up to the box's faces, sharp edges kept,\n"
    "with exact normals and the world's colours. Space that bounds prove to be empty is never looked at.\n"
    "With --lods a .glb has chunks of 128 cells, each at several levels, which meet without cracks whatever\n"
    "levels are shown side by side (the extension MSFT_lod).\n"
    "Coordinates are decimal metres of any length, and exact; those in the file count from the box's lower\n"
    "corner, which the file names. docs/EXPORT.md says more.";
static const char examples[] =
    "\n"
    "Examples:\n"
    "  karst mesh hills --box 0,-100,0,500,200,500 --voxel 1 -o hills.glb\n"
    "  karst mesh hills --box 0,-100,0,5000,200,5000 --voxel 10 --footprint 10 -o far.ply\n"
    "  karst mesh hills --box 0,-100,0,1000,200,1000 --voxel 1 --lods 4 -o levels.glb\n"
    "  karst mesh asteroid --box 1e15,-500,-500,1000000000000500,500,500 --voxel 2 -o out.obj\n"
    "  karst mesh glass --clear --box -4,0,-4,4,6,4 --voxel 0.1 -o glass.glb\n"
    "  karst mesh lattice --box 0,0,0,8,8,8 --voxel 0.05 -o lattice.glb --json | jq .triangles\n"
    "\n"
    "JSON is one object: file, vertices, triangles, sharp_vertices, cells, open_cells, samples, with --lods\n"
    "chunks and level_triangles (of each level), seconds.\n"
    "\n"
    "Exit code: 0 done (also without a surface), 1 failed, 2 wrong usage, 4 no such world, or one that does\n"
    "not compile, 5 a file of edits that cannot be read.";

typedef struct {
    command_export common;
    double voxel_m;
    uint64_t num_levels; /* 0: --lods was not given */
    bool has_voxel, clear;
} mesh_options;

/* What was written. */
typedef struct {
    karst_mesh_stats mesh;
    karst_mesh_level_stats levels;
} mesh_found;

static json_t *list_levels(const mesh_options *o, const karst_mesh_level_stats *levels)
{
    json_t *array = json_array();
    for (uint64_t level = 0; level < o->num_levels; level++)
        json_array_append_new(array, json_integer((json_int_t)levels->num_triangles[level]));
    return array;
}

static bool report(const mesh_options *o, const mesh_found *found, karst_error *error)
{
    const command_export *e = &o->common;
    const karst_mesh_stats *stats = &found->mesh;
    if (!e->json) {
        if (stats->num_triangles == 0)
            command_say(e->talk, "no surface is in the box: %s holds no triangle", e->output);
        else
            command_say(e->talk, "%s: %llu triangles, %llu vertices, in %.1f s; of %.4g cells %.2g %% were looked at",
                        e->output, (unsigned long long)stats->num_triangles, (unsigned long long)stats->num_vertices,
                        command_export_seconds(e), stats->num_cells,
                        100 * (double)stats->num_open_cells / stats->num_cells);
        for (uint64_t level = 0; stats->num_triangles && level < o->num_levels; level++)
            command_say(e->talk, "level %llu: %llu triangles in %llu chunks", (unsigned long long)level,
                        (unsigned long long)found->levels.num_triangles[level],
                        (unsigned long long)found->levels.num_chunks);
        return true;
    }
    json_t *object = json_object();
    json_object_set_new(object, "file", json_string(e->output));
    json_object_set_new(object, "vertices", json_integer((json_int_t)stats->num_vertices));
    json_object_set_new(object, "triangles", json_integer((json_int_t)stats->num_triangles));
    json_object_set_new(object, "sharp_vertices", json_integer((json_int_t)stats->num_sharp));
    json_object_set_new(object, "cells", json_real(stats->num_cells));
    json_object_set_new(object, "open_cells", json_integer((json_int_t)stats->num_open_cells));
    json_object_set_new(object, "samples", json_integer((json_int_t)stats->num_samples));
    if (o->num_levels) {
        json_object_set_new(object, "chunks", json_integer((json_int_t)found->levels.num_chunks));
        json_object_set_new(object, "level_triangles", list_levels(o, &found->levels));
    }
    json_object_set_new(object, "seconds", json_real(command_export_seconds(e)));
    return command_export_print(object, 6, error);
}

static bool write_mesh(mesh_options *o, const karst_world *world, karst_error *error)
{
    command_export *e = &o->common;
    const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    karst_mesh_config config = {
        .cell_m = o->voxel_m, .footprint_m = e->footprint_m, .num_threads = (int)e->num_threads};
    mesh_found found = {.mesh = {0}};
    karst_edit *edits;
    if (!command_parse_box(e->box, o->voxel_m, "cells", KARST_MESH_MAX_CELLS, voxel_log2_m, &config.corner,
                           config.num_cells, error) ||
        !command_export_edits(e, voxel_log2_m, &edits, &config.num_edits, error))
        return false;
    config.edits = edits;
    command_export_begin(e);
    bool done = o->num_levels ? karst_mesh_write_levels(world, &config, (int)o->num_levels, e->output,
                                                        command_export_progress, e, &found.mesh, &found.levels, error)
                              : karst_mesh_write(world, &config, e->output, KARST_MESH_OF_SUFFIX,
                                                 command_export_progress, e, &found.mesh, error);
    free(edits);
    return command_export_end(e, done, error) && report(o, &found, error);
}

static bool check(void *own, command_export *e, karst_error *error)
{
    const mesh_options *o = own;
    karst_mesh_format format;
    if (!o->has_voxel)
        return karst_fail(error, KARST_USAGE, "how wide are the cells? For example: --voxel 1");
    if (!e->output)
        return true;
    if (!karst_mesh_format_of(e->output, &format, error))
        return false;
    return !o->num_levels || format == KARST_MESH_GLB ||
           karst_fail(error, KARST_USAGE, "-o %s: several levels stand in a .glb", e->output);
}

static bool run(void *own, command_export *e, karst_error *error)
{
    mesh_options *o = own;
    karst_world *world = command_export_open(e, o->clear ? KARST_WORLD_CLEAR : KARST_WORLD_LAND, e->log, error);
    const bool done = world && write_mesh(o, world, error);
    karst_world_close(world);
    return done;
}

bool command_mesh(int argc, char **argv, command_talk *talk, karst_error *error)
{
    mesh_options o = {.voxel_m = 0};
    const command_option options[] = {
        {"box", 0, COMMAND_TEXT, "X0,Y0,Z0,X1,Y1,Z1", "lower and upper corner, in metres", &o.common.box, 0, 0, NULL},
        {"voxel", 0, COMMAND_NUMBER, "S", "how wide a cell is, in metres", &o.voxel_m, 1e-30, 1e30, &o.has_voxel},
        {"output", 'o', COMMAND_TEXT, "FILE", "a .glb (glTF 2.0), .ply or .obj", &o.common.output, 0, 0, NULL},
        {"lods", 0, COMMAND_INTEGER, "N", "so many levels of detail, each with a quarter of the triangles (.glb)",
         &o.num_levels, 1, KARST_MESH_MAX_LEVELS, NULL},
        {"clear", 0, COMMAND_FLAG, NULL, "the world's clear matter instead of its land", &o.clear, 0, 0, NULL},
    };
    const command_export_kind kind = {.name = "mesh",
                                      .example = "--box 0,-100,0,500,200,500 --voxel 1 -o out.glb",
                                      .output_example = "out.glb, or .ply, or .obj",
                                      .about = about,
                                      .examples = examples,
                                      .options = options,
                                      .num_options = sizeof options / sizeof *options,
                                      .check = check,
                                      .run = run};
    return command_export_main(argc, argv, &kind, &o, talk, error);
}
