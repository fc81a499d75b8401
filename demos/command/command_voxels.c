/* karst voxels: fields of a box as grids in a NanoVDB file. */
#include "command_export.h"

#include <stdlib.h>
#include <string.h>

#include "karst/voxels.h"

/* What --grids may name, and what of the world that is. */
static const struct {
    const char *name;
    karst_voxels_kind kind;
    karst_world_part part;
} grid_kinds[] = {{"distance", KARST_VOXELS_DISTANCE, KARST_WORLD_LAND},
                  {"density", KARST_VOXELS_DENSITY, KARST_WORLD_LAND},
                  {"extinction", KARST_VOXELS_FOG, KARST_WORLD_AIR},
                  {"clear", KARST_VOXELS_DISTANCE, KARST_WORLD_CLEAR}};
enum { NUM_KINDS = sizeof grid_kinds / sizeof *grid_kinds, NUM_PARTS = KARST_WORLD_AIR + 1 };

static const char about[] =
    "karst voxels WORLD --box X0,Y0,Z0,X1,Y1,Z1 --voxel S -o FILE.nvdb [OPTIONS]\n"
    "Writes fields of a box as grids of voxels, in a file of NanoVDB 32.4.\n"
    "--grids names one or several, with commas between them:\n"
    "  distance    a level set: metres to the surface, below 0 in matter, three voxels on each side of it\n"
    "  density     the world's density at the middle of every voxel, bit for bit\n"
    "  extinction  what the air takes of light, per metre: a fog volume (medium air(vec3 p))\n"
    "  clear       a level set of clear matter (float clear(vec3 p))\n"
    "Coordinates are decimal metres of any length, and exact; those in the file count from the box's lower\n"
    "corner. docs/EXPORT.md says more.";
static const char examples[] =
    "\n"
    "Examples:\n"
    "  karst voxels hills --box 0,-100,0,500,200,500 --voxel 2 -o hills.nvdb\n"
    "  karst voxels asteroid --box -600,-600,-600,600,600,600 --voxel 5 --footprint 5 -o far.nvdb\n"
    "  karst voxels fog --box 0,0,0,800,200,800 --voxel 8 --grids distance,extinction -o fog.nvdb\n"
    "  karst voxels hills --box 0,0,0,32,32,32 --voxel 1 --grids density -o box.nvdb --json | jq .active\n"
    "\n"
    "JSON is one object: file, grids, voxels (along each axis), active, leaves, samples, seconds.\n"
    "\n"
    "Exit code: 0 done, 1 failed, 2 wrong usage, 4 no such world, or one that does not compile, 5 a file of\n"
    "edits that cannot be read.";

typedef struct {
    command_export common;
    const char *grids;
    double voxel_m;
    bool has_voxel;
    int kinds[KARST_VOXELS_MOST_GRIDS]; /* indices into grid_kinds */
    size_t num_grids;
} voxels_options;

/* Which grids: indices into grid_kinds. 0: an error. */
static size_t parse_grids(const char *text, int kinds[KARST_VOXELS_MOST_GRIDS], karst_error *error)
{
    size_t num = 0;
    for (const char *at = text;; at++) {
        const size_t length = strcspn(at, ",");
        int kind = 0;
        while (kind < NUM_KINDS &&
               (strlen(grid_kinds[kind].name) != length || strncmp(grid_kinds[kind].name, at, length)))
            kind++;
        if (kind == NUM_KINDS) {
            karst_fail(error, KARST_USAGE,
                       "--grids %.64s: '%.*s' is none: write distance, density, extinction, clear, or several with "
                       "commas between them",
                       text, (int)(length < 32 ? length : 32), at);
            return 0;
        }
        for (size_t i = 0; i < num; i++)
            if (kinds[i] == kind) {
                karst_fail(error, KARST_USAGE, "--grids %.64s: it names '%s' twice", text, grid_kinds[kind].name);
                return 0;
            }
        kinds[num++] = kind;
        at += length;
        if (!*at)
            return num;
    }
}

static bool report(const voxels_options *o, const karst_voxels_config *config, const karst_voxels_stats *stats,
                   karst_error *error)
{
    const command_export *e = &o->common;
    if (!e->json) {
        command_say(e->talk, "%s: %lld x %lld x %lld voxels, %llu of them active, in %.1f s", e->output,
                    (long long)config->num_voxels[0], (long long)config->num_voxels[1],
                    (long long)config->num_voxels[2], (unsigned long long)stats->num_active, command_export_seconds(e));
        return true;
    }
    json_t *object = json_object(), *voxels = json_array();
    for (int axis = 0; axis < 3; axis++)
        json_array_append_new(voxels, json_integer((json_int_t)config->num_voxels[axis]));
    json_object_set_new(object, "file", json_string(e->output));
    json_object_set_new(object, "grids", json_string(o->grids));
    json_object_set_new(object, "voxels", voxels);
    json_object_set_new(object, "active", json_integer((json_int_t)stats->num_active));
    json_object_set_new(object, "leaves", json_integer((json_int_t)stats->num_leaves));
    json_object_set_new(object, "samples", json_integer((json_int_t)stats->num_samples));
    json_object_set_new(object, "seconds", json_real(command_export_seconds(e)));
    return command_export_print(object, 6, error);
}

static bool write_voxels(voxels_options *o, karst_world *const worlds[NUM_PARTS], karst_error *error)
{
    command_export *e = &o->common;
    const int voxel_log2_m = karst_world_get_metadata(worlds[grid_kinds[o->kinds[0]].part])->voxel_log2_m;
    karst_voxels_config config = {
        .voxel_m = o->voxel_m, .footprint_m = e->footprint_m, .num_threads = (int)e->num_threads};
    karst_voxels_grid grids[KARST_VOXELS_MOST_GRIDS];
    karst_voxels_stats stats;
    size_t num_edits;
    karst_edit *edits;
    if (!command_parse_box(e->box, o->voxel_m, "voxels", KARST_VOXELS_MAX_SIDE, voxel_log2_m, &config.corner,
                           config.num_voxels, error) ||
        !command_export_edits(e, voxel_log2_m, &edits, &num_edits, error))
        return false;
    for (size_t i = 0; i < o->num_grids; i++) {
        const int kind = o->kinds[i];
        const bool is_land = grid_kinds[kind].part == KARST_WORLD_LAND;
        grids[i] = (karst_voxels_grid){.world = worlds[grid_kinds[kind].part],
                                       .name = grid_kinds[kind].name,
                                       .kind = grid_kinds[kind].kind,
                                       .edits = is_land ? edits : NULL,
                                       .num_edits = is_land ? num_edits : 0};
    }
    command_export_begin(e);
    const bool done =
        karst_voxels_write(e->output, &config, grids, o->num_grids, command_export_progress, e, &stats, error);
    free(edits);
    return command_export_end(e, done, error) && report(o, &config, &stats, error);
}

static bool check(void *own, command_export *e, karst_error *error)
{
    voxels_options *o = own;
    if (!o->has_voxel)
        return karst_fail(error, KARST_USAGE, "how wide are the voxels? For example: --voxel 2");
    o->num_grids = e->output ? parse_grids(o->grids, o->kinds, error) : 0;
    return !e->output || o->num_grids > 0;
}

static bool run(void *own, command_export *e, karst_error *error)
{
    voxels_options *o = own;
    karst_world *worlds[NUM_PARTS] = {NULL};
    bool done = true;
    for (size_t i = 0; done && i < o->num_grids; i++) {
        const karst_world_part part = grid_kinds[o->kinds[i]].part;
        if (!worlds[part])
            done = (worlds[part] =
                        command_export_open(e, part, i == 0 || part == KARST_WORLD_AIR ? e->log : NULL, error)) != NULL;
    }
    done = done && write_voxels(o, worlds, error);
    for (int i = 0; i < NUM_PARTS; i++)
        karst_world_close(worlds[i]);
    return done;
}

bool command_voxels(int argc, char **argv, command_talk *talk, karst_error *error)
{
    voxels_options o = {.grids = "distance"};
    const command_option options[] = {
        {"box", 0, COMMAND_TEXT, "X0,Y0,Z0,X1,Y1,Z1", "lower and upper corner, in metres", &o.common.box, 0, 0, NULL},
        {"voxel", 0, COMMAND_NUMBER, "S", "how wide a voxel is, in metres", &o.voxel_m, 1e-30, 1e30, &o.has_voxel},
        {"output", 'o', COMMAND_TEXT, "FILE", "a .nvdb", &o.common.output, 0, 0, NULL},
        {"grids", 0, COMMAND_TEXT, "NAMES", "which fields (default: distance)", &o.grids, 0, 0, NULL},
    };
    const command_export_kind kind = {.name = "voxels",
                                      .example = "--box 0,-100,0,500,200,500 --voxel 2 -o out.nvdb",
                                      .output_example = "out.nvdb",
                                      .about = about,
                                      .examples = examples,
                                      .options = options,
                                      .num_options = sizeof options / sizeof *options,
                                      .check = check,
                                      .run = run};
    return command_export_main(argc, argv, &kind, &o, talk, error);
}
