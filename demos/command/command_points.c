/* karst points: points on the surface in a box. */
#include "command_export.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

static const char about[] =
    "karst points WORLD --box X0,Y0,Z0,X1,Y1,Z1 --spacing S -o FILE.ply|.karstpoints [OPTIONS]\n"
    "Writes points on the surface in a box, with exact normals and the world's colours: one for each piece of\n"
    "surface in a cell S metres wide. The points are the same however many threads work.\n"
    "A .karstpoints is a model that worlds can show (docs/POINTS.md), as karst import makes it of the .ply.\n"
    "Coordinates are decimal metres of any length, and exact; those in the file count from the box's lower\n"
    "corner, which a .ply names. docs/EXPORT.md says more.";
static const char examples[] =
    "\n"
    "Examples:\n"
    "  karst points hills --box 0,-100,0,500,200,500 --spacing 1 -o hills.ply\n"
    "  karst points asteroid --box -600,-600,-600,600,600,600 --spacing 5 -o rock.karstpoints\n"
    "  karst points hills --box 0,-100,0,100,200,100 --spacing 0.5 -o a.ply --json | jq .points\n"
    "\n"
    "JSON is one object: file, points, samples, seconds.\n"
    "\n"
    "Exit code: 0 done (also a .ply without a point), 1 failed, 2 wrong usage, 4 no such world, or one that\n"
    "does not compile, 5 a file of edits that cannot be read.";

typedef struct {
    command_export common;
    double spacing_m;
    bool has_spacing, clear;
} points_options;

static bool report(const points_options *o, const karst_mesh_stats *stats, karst_error *error)
{
    const command_export *e = &o->common;
    if (!e->json) {
        if (stats->num_vertices == 0)
            command_say(e->talk, "no surface is in the box: %s holds no point", e->output);
        else
            command_say(e->talk, "%s: %llu points, in %.1f s", e->output, (unsigned long long)stats->num_vertices,
                        command_export_seconds(e));
        return true;
    }
    json_t *object = json_object();
    json_object_set_new(object, "file", json_string(e->output));
    json_object_set_new(object, "points", json_integer((json_int_t)stats->num_vertices));
    json_object_set_new(object, "samples", json_integer((json_int_t)stats->num_samples));
    json_object_set_new(object, "seconds", json_real(command_export_seconds(e)));
    return command_export_print(object, 6, error);
}

static bool show_import(void *user, const char *what, double share)
{
    const command_export *e = user;
    command_progress(e->talk, "%s, %3.0f %%", what, 100 * share);
    return !command_interrupted();
}

/* A model is imported from a .ply beside it, which goes again. */
static bool write_model(command_export *e, const karst_world *world, const karst_mesh_config *config,
                        karst_mesh_stats *stats, karst_error *error)
{
    char *beside = NULL;
    const int fd = command_open_beside(e->output, ".ply", &beside);
    if (fd < 0)
        return karst_fail(error, KARST_FAILED, "cannot write %s: there is no room beside it", e->output);
    close(fd);
    command_add_temporary(beside);
    const karst_points_import_config import = {.input = beside,
                                               .output = e->output,
                                               .axes = KARST_POINTS_AS_THEY_ARE,
                                               .keep_outliers = true,
                                               .num_threads = (uint32_t)(e->num_threads < 64 ? e->num_threads : 64),
                                               .progress = show_import,
                                               .user = e};
    bool done = karst_mesh_write_points(world, config, beside, command_export_progress, e, stats, error);
    if (done && stats->num_vertices == 0)
        done = karst_fail(error, KARST_FAILED, "no surface is in the box, so there is no model to write");
    done = done && karst_points_import(&import, NULL, error);
    unlink(beside);
    command_drop_temporary(beside);
    free(beside);
    return done;
}

static bool write_points(points_options *o, const karst_world *world, karst_error *error)
{
    command_export *e = &o->common;
    const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    karst_mesh_config config = {
        .cell_m = o->spacing_m, .footprint_m = e->footprint_m, .num_threads = (int)e->num_threads};
    karst_mesh_stats stats;
    karst_edit *edits;
    if (!command_parse_box(e->box, o->spacing_m, "cells", KARST_MESH_MAX_CELLS, voxel_log2_m, &config.corner,
                           config.num_cells, error) ||
        !command_export_edits(e, voxel_log2_m, &edits, &config.num_edits, error))
        return false;
    config.edits = edits;
    command_export_begin(e);
    const bool done =
        karst_points_is_name(e->output)
            ? write_model(e, world, &config, &stats, error)
            : karst_mesh_write_points(world, &config, e->output, command_export_progress, e, &stats, error);
    free(edits);
    return command_export_end(e, done, error) && report(o, &stats, error);
}

static bool check(void *own, command_export *e, karst_error *error)
{
    const points_options *o = own;
    if (!o->has_spacing)
        return karst_fail(error, KARST_USAGE, "how far apart are the points? For example: --spacing 1");
    const char *dot = e->output ? strrchr(e->output, '.') : NULL;
    return !e->output || karst_points_is_name(e->output) || (dot && strcasecmp(dot, ".ply") == 0) ||
           karst_fail(error, KARST_USAGE, "-o %s: points are a .ply or a .karstpoints", e->output);
}

static bool run(void *own, command_export *e, karst_error *error)
{
    points_options *o = own;
    karst_world *world = command_export_open(e, o->clear ? KARST_WORLD_CLEAR : KARST_WORLD_LAND, e->log, error);
    const bool done = world && write_points(o, world, error);
    karst_world_close(world);
    return done;
}

bool command_points(int argc, char **argv, command_talk *talk, karst_error *error)
{
    points_options o = {.spacing_m = 0};
    const command_option options[] = {
        {"box", 0, COMMAND_TEXT, "X0,Y0,Z0,X1,Y1,Z1", "lower and upper corner, in metres", &o.common.box, 0, 0, NULL},
        {"spacing", 0, COMMAND_NUMBER, "S", "how far apart points are, in metres", &o.spacing_m, 1e-30, 1e30,
         &o.has_spacing},
        {"output", 'o', COMMAND_TEXT, "FILE", "a .ply, or a model (.karstpoints)", &o.common.output, 0, 0, NULL},
        {"clear", 0, COMMAND_FLAG, NULL, "on the world's clear matter instead of its land", &o.clear, 0, 0, NULL},
    };
    const command_export_kind kind = {.name = "points",
                                      .example = "--box 0,-100,0,500,200,500 --spacing 1 -o out.ply",
                                      .output_example = "out.ply, or .karstpoints",
                                      .about = about,
                                      .examples = examples,
                                      .options = options,
                                      .num_options = sizeof options / sizeof *options,
                                      .check = check,
                                      .run = run};
    return command_export_main(argc, argv, &kind, &o, talk, error);
}
