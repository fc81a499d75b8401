/* karst voxels: fields of a box as grids in a NanoVDB file. */
#include "command.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

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

typedef struct {
    const char *world, *box, *output, *edits, *grids;
    command_parameters parameters;
    uint64_t seed, num_threads;
    double voxel_m, footprint_m;
    bool has_seed, has_voxel, json;
    command_talk *talk;
} voxels_options;

static void print_help(const command_option *options, size_t num_options)
{
    puts("karst voxels WORLD --box X0,Y0,Z0,X1,Y1,Z1 --voxel S -o FILE.nvdb [OPTIONS]\n"
         "Writes fields of a box as grids of voxels, in a file of NanoVDB 32.4.\n"
         "--grids names one or several, with commas between them:\n"
         "  distance    a level set: metres to the surface, below 0 in matter, three voxels on each side of it\n"
         "  density     the world's density at the middle of every voxel, bit for bit\n"
         "  extinction  what the air takes of light, per metre: a fog volume (medium air(vec3 p))\n"
         "  clear       a level set of clear matter (float clear(vec3 p))\n"
         "Coordinates are decimal metres of any length, and exact; those in the file count from the box's lower\n"
         "corner. docs/EXPORT.md says more.\n"
         "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nWorlds (or the path of a world file, which ends in .karst):");
    command_print_worlds(stdout);
    puts("\nExamples:\n"
         "  karst voxels hills --box 0,-100,0,500,200,500 --voxel 2 -o hills.nvdb\n"
         "  karst voxels asteroid --box -600,-600,-600,600,600,600 --voxel 5 --footprint 5 -o far.nvdb\n"
         "  karst voxels fog --box 0,0,0,800,200,800 --voxel 8 --grids distance,extinction -o fog.nvdb\n"
         "  karst voxels hills --box 0,0,0,32,32,32 --voxel 1 --grids density -o box.nvdb --json | jq .active\n"
         "\nJSON is one object: file, grids, voxels (along each axis), active, leaves, samples, seconds.\n"
         "\nExit code: 0 done, 1 failed, 2 wrong usage, 4 no such world, or one that does not compile, 5 a file of\n"
         "edits that cannot be read.");
}

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

static bool show_progress(void *user, double share)
{
    const voxels_options *o = user;
    command_progress(o->talk, "%3.0f %%", 100 * share);
    return !command_interrupted();
}

static bool report(const voxels_options *o, const karst_voxels_config *config, const karst_voxels_stats *stats,
                   double seconds, karst_error *error)
{
    if (!o->json) {
        command_say(o->talk, "%s: %lld x %lld x %lld voxels, %llu of them active, in %.1f s", o->output,
                    (long long)config->num_voxels[0], (long long)config->num_voxels[1],
                    (long long)config->num_voxels[2], (unsigned long long)stats->num_active, seconds);
        return true;
    }
    json_t *object = json_object(), *voxels = json_array();
    for (int axis = 0; axis < 3; axis++)
        json_array_append_new(voxels, json_integer((json_int_t)config->num_voxels[axis]));
    json_object_set_new(object, "file", json_string(o->output));
    json_object_set_new(object, "grids", json_string(o->grids));
    json_object_set_new(object, "voxels", voxels);
    json_object_set_new(object, "active", json_integer((json_int_t)stats->num_active));
    json_object_set_new(object, "leaves", json_integer((json_int_t)stats->num_leaves));
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

static bool write_voxels(voxels_options *o, karst_world *const worlds[NUM_PARTS], const int *kinds, size_t num_grids,
                         karst_error *error)
{
    const int voxel_log2_m = karst_world_get_metadata(worlds[grid_kinds[kinds[0]].part])->voxel_log2_m;
    karst_voxels_config config = {
        .voxel_m = o->voxel_m, .footprint_m = o->footprint_m, .num_threads = (int)o->num_threads};
    karst_voxels_grid grids[KARST_VOXELS_MOST_GRIDS];
    karst_voxels_stats stats;
    size_t num_edits = 0;
    if (!command_parse_box(o->box, o->voxel_m, "voxels", KARST_VOXELS_MAX_SIDE, voxel_log2_m, &config.corner,
                           config.num_voxels, error))
        return false;
    karst_edit *edits = o->edits ? command_load_edits(o->edits, voxel_log2_m, &num_edits, NULL, error) : NULL;
    if (o->edits && !edits)
        return false;
    for (size_t i = 0; i < num_grids; i++) {
        const bool is_land = grid_kinds[kinds[i]].part == KARST_WORLD_LAND;
        grids[i] = (karst_voxels_grid){.world = worlds[grid_kinds[kinds[i]].part],
                                       .name = grid_kinds[kinds[i]].name,
                                       .kind = grid_kinds[kinds[i]].kind,
                                       .edits = is_land ? edits : NULL,
                                       .num_edits = is_land ? num_edits : 0};
    }
    const uint64_t start_ns = command_clock_ns();
    command_catch_interrupts();
    bool done = karst_voxels_write(o->output, &config, grids, num_grids, show_progress, o, &stats, error);
    free(edits);
    command_end_progress(o->talk);
    if (!done && command_interrupted())
        return command_fail_interrupted(error, "interrupted: %s was not written", o->output);
    return done && report(o, &config, &stats, (double)(command_clock_ns() - start_ns) / 1e9, error);
}

static bool run(voxels_options *o, const karst_log *log, karst_error *error)
{
    char path[PATH_MAX];
    int kinds[KARST_VOXELS_MOST_GRIDS];
    const command_scene scene = {path, sizeof path, NULL, &o->edits, &o->parameters, &o->has_seed, &o->seed};
    if (!o->box)
        return karst_fail(error, KARST_USAGE,
                          "which box? For example: karst voxels %s --box 0,-100,0,500,200,500 "
                          "--voxel 2 -o out.nvdb",
                          o->world);
    if (!o->has_voxel)
        return karst_fail(error, KARST_USAGE, "how wide are the voxels? For example: --voxel 2");
    if (!o->output)
        return karst_fail(error, KARST_USAGE, "which file? For example: -o out.nvdb");
    const size_t num_grids = parse_grids(o->grids, kinds, error);
    if (num_grids == 0 || !command_check_output(o->output, "-o", true, error) ||
        !command_find_scene(o->world, &scene, o->talk, error))
        return false;
    karst_world *worlds[NUM_PARTS] = {NULL};
    bool done = true;
    for (size_t i = 0; done && i < num_grids; i++) {
        const karst_world_part part = grid_kinds[kinds[i]].part;
        const karst_world_config config = {.world = path,
                                           .parameters = o->parameters.values,
                                           .num_parameters = o->parameters.num_values,
                                           .has_seed = o->has_seed,
                                           .seed = (uint32_t)o->seed,
                                           .log = i == 0 || part == KARST_WORLD_AIR ? log : NULL,
                                           .part = part};
        if (!worlds[part])
            done = (worlds[part] = karst_world_open(&config, error)) != NULL;
    }
    done = done && write_voxels(o, worlds, kinds, num_grids, error);
    for (int i = 0; i < NUM_PARTS; i++)
        karst_world_close(worlds[i]);
    return done;
}

bool command_voxels(int argc, char **argv, command_talk *talk, karst_error *error)
{
    voxels_options o = {.talk = talk, .grids = "distance"};
    const command_option options[] = {
        {"box", 0, COMMAND_TEXT, "X0,Y0,Z0,X1,Y1,Z1", "lower and upper corner, in metres", &o.box, 0, 0, NULL},
        {"voxel", 0, COMMAND_NUMBER, "S", "how wide a voxel is, in metres", &o.voxel_m, 1e-30, 1e30, &o.has_voxel},
        {"output", 'o', COMMAND_TEXT, "FILE", "a .nvdb", &o.output, 0, 0, NULL},
        {"grids", 0, COMMAND_TEXT, "NAMES", "which fields (default: distance)", &o.grids, 0, 0, NULL},
        {"footprint", 0, COMMAND_NUMBER, "W", "metres: without finer detail, as a voxel of that width (default: 0)",
         &o.footprint_m, 0, 1e30, NULL},
        {"edits", 0, COMMAND_TEXT, "FILE", "with the edits of a file, on the land: docs/EDITS.md", &o.edits, 0, 0,
         NULL},
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
        return karst_fail(error, KARST_USAGE,
                          "which world? For example: karst voxels hills --box 0,-100,0,500,200,500 "
                          "--voxel 2 -o out.nvdb");
    return run(&o, &log, error);
}
