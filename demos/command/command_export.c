#include "command_export.h"

#include <stdlib.h>
#include <string.h>

/* Behind a command's own options: those that all have. */
static size_t list_options(command_export *e, const command_export_kind *kind,
                           command_option options[COMMAND_EXPORT_MOST_OPTIONS])
{
    const command_option common[] = {
        {"footprint", 0, COMMAND_NUMBER, "W", "metres: without finer detail, as a voxel of that width (default: 0)",
         &e->footprint_m, 0, 1e30, NULL},
        {"edits", 0, COMMAND_TEXT, "FILE", "with the edits of a file, on the land: docs/EDITS.md", &e->edits, 0, 0,
         NULL},
        {"json", 0, COMMAND_FLAG, NULL, "what was written, as one JSON object", &e->json, 0, 0, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "say errors and warnings only", &e->talk->quiet, 0, 0, NULL},
        {"threads", 0, COMMAND_INTEGER, "N", "how many work (default: one for each core)", &e->num_threads, 1, 256,
         NULL},
        {"seed", 0, COMMAND_INTEGER, "N", "instead of the world's own", &e->seed, 0, 4294967295.0, &e->has_seed},
        {"param", 0, COMMAND_PARAMETERS, "NAME=VALUE", "another value for a parameter; may be given again",
         &e->parameters, 0, 0, NULL},
    };
    size_t num = 0;
    for (size_t i = 0; i < kind->num_options; i++)
        options[num++] = kind->options[i];
    for (size_t i = 0; i < sizeof common / sizeof *common; i++)
        options[num++] = common[i];
    return num;
}

static void print_help(const command_export_kind *kind, const command_option *options, size_t num_options)
{
    puts(kind->about);
    puts("\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nWorlds (or the path of a world file, which ends in .karst):");
    command_print_worlds(stdout);
    puts(kind->examples);
}

static bool run(command_export *e, const command_export_kind *kind, void *own, karst_error *error)
{
    const command_scene scene = {e->world_file,  sizeof e->world_file, NULL,    &e->edits,
                                 &e->parameters, &e->has_seed,         &e->seed};
    if (!e->box)
        return karst_fail(error, KARST_USAGE, "which box? For example: karst %s %s %s", kind->name, e->world,
                          kind->example);
    if (!kind->check(own, e, error))
        return false;
    if (!e->output)
        return karst_fail(error, KARST_USAGE, "which file? For example: -o %s", kind->output_example);
    return command_check_output(e->output, "-o", true, error) && command_find_scene(e->world, &scene, e->talk, error) &&
           kind->run(own, e, error);
}

bool command_export_main(int argc, char **argv, const command_export_kind *kind, void *own, command_talk *talk,
                         karst_error *error)
{
    command_export *e = own;
    command_option options[COMMAND_EXPORT_MOST_OPTIONS];
    const karst_log log = command_log(talk);
    e->talk = talk;
    e->log = &log;
    const size_t num_options = list_options(e, kind, options);
    size_t num_words;
    bool help;
    if (!command_parse(argc, argv, options, num_options, &e->world, 1, &num_words, &help, error))
        return false;
    if (help) {
        print_help(kind, options, num_options);
        return true;
    }
    if (num_words == 0)
        return karst_fail(error, KARST_USAGE, "which world? For example: karst %s hills %s", kind->name, kind->example);
    return run(e, kind, own, error);
}

karst_world *command_export_open(command_export *e, karst_world_part part, const karst_log *log, karst_error *error)
{
    const karst_world_config config = {.world = e->world_file,
                                       .parameters = e->parameters.values,
                                       .num_parameters = e->parameters.num_values,
                                       .has_seed = e->has_seed,
                                       .seed = (uint32_t)e->seed,
                                       .log = log,
                                       .part = part};
    return karst_world_open(&config, error);
}

bool command_export_edits(const command_export *e, int voxel_log2_m, karst_edit **edits, size_t *num,
                          karst_error *error)
{
    *num = 0;
    *edits = e->edits ? command_load_edits(e->edits, voxel_log2_m, num, NULL, error) : NULL;
    return *edits || !e->edits;
}

void command_export_begin(command_export *e)
{
    e->start_ns = command_clock_ns();
    command_catch_interrupts();
}

bool command_export_progress(void *user, double share)
{
    const command_export *e = user;
    command_progress(e->talk, "%3.0f %%", 100 * share);
    return !command_interrupted();
}

bool command_export_end(command_export *e, bool done, karst_error *error)
{
    command_end_progress(e->talk);
    if (!done && command_interrupted())
        return command_fail_interrupted(error, "interrupted: %s was not written", e->output);
    return done;
}

double command_export_seconds(const command_export *e) { return (double)(command_clock_ns() - e->start_ns) / 1e9; }

bool command_export_print(json_t *object, int num_digits, karst_error *error)
{
    char *text = json_dumps(object, JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(num_digits));
    json_decref(object);
    if (!text)
        return karst_fail(error, KARST_FAILED, "out of memory");
    puts(text);
    free(text);
    return true;
}
