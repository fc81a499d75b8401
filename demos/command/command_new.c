/* karst new: a saved world. */
#include "command.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const char *path, *world, *camera, *edits;
    command_parameters parameters;
    uint64_t seed;
    bool has_seed, embed, json, help;
} new_options;

static void print_help(const command_option *options, size_t num_options)
{
    puts("karst new FILE.karstdb --from WORLD [OPTIONS]\n"
         "Makes a saved world: one file with a world, its parameters and seed, a camera and bookmarks, and a log of\n"
         "edits that karst edit adds to. It works wherever a world is taken. docs/SAVED.md says more.\n"
         "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nWorlds (or the path of a world file, which ends in .karst):");
    command_print_worlds(stdout);
    puts("\nExamples:\n"
         "  karst new mine.karstdb --from hills\n"
         "  karst new mine.karstdb --from alps --param relief=900 --seed 3 --camera 0,900,0,45,-10\n"
         "  karst new gift.karstdb --from my.karst --embed --edits tunnel.json\n"
         "  karst render mine.karstdb -o mine.png\n"
         "\nExit code: 0 done, 1 failed (the file is there already), 2 wrong usage, 4 no such world, or one that does "
         "not\n"
         "compile, 5 a file of edits that cannot be read.");
}

static bool add_edits(const new_options *o, karst_saved *saved, size_t *num, karst_error *error)
{
    int voxel_log2_m = karst_saved_get_about(saved)->voxel_log2_m;
    karst_edit *edits = command_load_edits(o->edits, voxel_log2_m, num, NULL, error);
    bool done =
        edits && karst_saved_append(saved, edits, *num, voxel_log2_m, error) && karst_saved_commit(saved, error);
    free(edits);
    return done;
}

static bool make(const new_options *o, command_talk *talk, karst_error *error)
{
    char world[PATH_MAX];
    const karst_log log = command_log(talk);
    /* What comes from stdin has no file that it could be found in again. */
    bool is_stdin = strcmp(o->world, "-") == 0;
    if (!command_find_world(o->world, world, sizeof world, error))
        return false;
    const karst_saved_config config = {.world = strchr(o->world, '/') || is_stdin ? world : o->world,
                                       .embed = o->embed || is_stdin,
                                       .parameters = o->parameters.values,
                                       .num_parameters = o->parameters.num_values,
                                       .has_seed = o->has_seed,
                                       .seed = (uint32_t)o->seed,
                                       .camera = o->camera,
                                       .log = &log};
    if (!karst_saved_create(o->path, &config, error))
        return false;
    size_t num = 0;
    karst_saved *saved = o->edits ? karst_saved_open(o->path, true, &log, error) : NULL;
    bool done = !o->edits || (saved && add_edits(o, saved, &num, error));
    karst_saved_close(saved);
    if (!done)
        remove(o->path);
    else
        command_say(talk, "%s: %s%s, %zu edits", o->path, o->world, config.embed ? " (its text is inside)" : "", num);
    return done;
}

bool command_new(int argc, char **argv, command_talk *talk, karst_error *error)
{
    new_options o = {0};
    const command_option options[] = {
        {"from", 0, COMMAND_TEXT, "WORLD", "the world: a name, a world file, or - for stdin", &o.world, 0, 0, NULL},
        {"param", 0, COMMAND_PARAMETERS, "NAME=VALUE", "a parameter of the world file; may be given again",
         &o.parameters, 0, 0, NULL},
        {"seed", 0, COMMAND_INTEGER, "N", "instead of the world's own", &o.seed, 0, 4294967295.0, &o.has_seed},
        {"camera", 0, COMMAND_TEXT, "X,Y,Z,YAW,PITCH[,FOV]", "where one begins (default: the world's)", &o.camera, 0, 0,
         NULL},
        {"edits", 0, COMMAND_TEXT, "FILE", "with the edits of a file, or of another saved world", &o.edits, 0, 0, NULL},
        {"embed", 0, COMMAND_FLAG, NULL, "keep the world's text in the file, not only its name", &o.embed, 0, 0, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "say nothing but warnings and errors", &talk->quiet, 0, 0, NULL},
    };
    const size_t num_options = sizeof options / sizeof *options;
    size_t num_words;
    if (!command_parse(argc, argv, options, num_options, &o.path, 1, &num_words, &o.help, error))
        return false;
    if (o.help) {
        print_help(options, num_options);
        return true;
    }
    if (!num_words)
        return karst_fail(error, KARST_USAGE, "which file? For example: karst new mine.karstdb --from hills");
    if (!karst_saved_is_name(o.path))
        return karst_fail(error, KARST_USAGE, "%s: a saved world's name ends in .karstdb", o.path);
    if (!o.world)
        return karst_fail(error, KARST_USAGE, "of which world? For example: karst new %s --from hills", o.path);
    return make(&o, talk, error);
}
