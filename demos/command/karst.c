/* The karst command. See command.h for its parts. */
#include "command.h"

#include <errno.h>
#include <signal.h>
#include <string.h>

static const command commands[] = {
    {"render", "one picture of a world, to a file; or a flight", command_render},
    {"view", "a window on a world: fly, walk, change it and see", command_view},
    {"bench", "measures a world: frame time by stage, production, churn, memory", command_bench},
    {"accuracy", "speed against error: what each quality setting costs, and how wrong it is", command_accuracy},
    {"check", "what there is to say of a world file: mistakes, bounds, precision, cost", command_check},
    {"sample", "a world's density, gradient and bounds at points", command_sample},
    {"new", "a saved world: one file with a world, its edits, a camera", command_new},
    {"edit", "edits of a saved world: add, undo, redo, log, check, backup", command_edit},
    {"heights", "a map of heights: the topmost surface under each pixel", command_heights},
    {"bake", "what light falls on land, as a light map for worlds", command_bake},
    {"voxels", "fields of a box as grids of voxels: NanoVDB", command_voxels},
    {"points", "points on the surface in a box: PLY", command_points},
    {"mesh", "the surface in a box as triangles: glTF, PLY, OBJ", command_mesh},
    {"verify", "whether the pictures of a job are all there and right", command_verify},
    {"import", "a file of points (PLY, OBJ, LAS, XYZ) becomes a model for worlds", command_import},
    {"info", "devices, ways to display, limits; how to mend what is missing", command_info},
};
#define NUM_COMMANDS (sizeof commands / sizeof *commands)

static void print_help(FILE *file)
{
    fputs("karst ray-casts procedural landscapes straight from a density function.\n\nCommands:\n", file);
    for (size_t i = 0; i < NUM_COMMANDS; i++)
        fprintf(file, "  karst %-10s %s\n", commands[i].name, commands[i].summary);
    fputs("  karst help COMMAND, karst --help, karst --version (or -V)\n"
          "\nExamples:\n"
          "  karst render hills                         the world \"hills\", to out.png\n"
          "  karst render asteroid -o a.png --size 800x600 --camera 0,0,-900,0,0\n"
          "  karst check mine.karst                     what there is to say of a world file\n"
          "  karst sample hills --at 0,120,0            its density there\n"
          "\nData goes to stdout, talk to stderr. Exit code: 0 done, 1 failed, 2 wrong usage, 3 no usable device,\n"
          "4 world that does not compile or does not exist, 5 other data that cannot be read, 75 part of a job that\n"
          "is to be run again.\n",
          file);
}

static const command *find_command(const char *name, karst_error *error)
{
    const char *names[NUM_COMMANDS + 2] = {"help"};
    for (size_t i = 0; i < NUM_COMMANDS; i++) {
        if (strcmp(commands[i].name, name) == 0)
            return &commands[i];
        names[i + 1] = commands[i].name;
    }
    const char *nearest = command_nearest(name, names);
    if (nearest)
        karst_fail(error, KARST_USAGE, "unknown command '%s'; did you mean '%s'?", name, nearest);
    else
        karst_fail(error, KARST_USAGE, "unknown command '%s'; karst --help lists the commands", name);
    return NULL;
}

static bool run_help(int argc, char **argv, command_talk *talk, karst_error *error)
{
    if (argc == 0 || strcmp(argv[0], "help") == 0) {
        print_help(stdout);
        return true;
    }
    const command *found = find_command(argv[0], error);
    return found && found->run(1, (char *[]){(char[]){"--help"}, NULL}, talk, error);
}

static bool run(int argc, char **argv, command_talk *talk, karst_error *error)
{
    const char *name = argc > 1 ? argv[1] : "";
    if (!*name) {
        print_help(stderr);
        return karst_fail(error, KARST_USAGE, "which command? For example: karst render hills");
    }
    if (strcmp(name, "--version") == 0 || strcmp(name, "-V") == 0 || strcmp(name, "version") == 0) {
        command_open_driver(talk);
        command_print_version(stdout);
        return true;
    }
    if (strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0 || strcmp(name, "help") == 0)
        return run_help(argc - 2, argv + 2, talk, error);
    const command *found = find_command(name, error);
    return found && found->run(argc - 2, argv + 2, talk, error);
}

static int run_all(int argc, char **argv)
{
    if (karst_helper_is_this_process())
        return karst_helper_run();
    karst_error error = {0};
    command_talk talk;
    command_talk_init(&talk);
    command_catch_crashes();
    /* A reader that goes away is a failed write, which is told and cleaned up after; so is a file that may grow no
     * further. */
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN);
    command_check_environment(&talk);
    bool done = run(argc, argv, &talk, &error);
    if (done && (fflush(stdout) != 0 || ferror(stdout)))
        done = karst_fail(&error, KARST_FAILED, "cannot write to stdout: %s", strerror(errno));
    if (!done && command_interrupted() && strncmp(error.message, "interrupted", strlen("interrupted")) != 0)
        command_fail_interrupted(&error, "interrupted");
    if (!done)
        command_say_failure(&talk, error.status == KARST_OK ? "failed without saying why" : error.message);
    if (!done && karst_driver_is_suspect())
        command_say(&talk, "note: if this was the driver's store of compiled kernels, the next run sets it aside");
    karst_driver_end();
    command_end_if_interrupted(done);
    return done ? KARST_OK : error.status == KARST_OK ? KARST_FAILED : (int)error.status;
}

int main(int argc, char **argv)
{
    command_open_descriptors();
    return command_run_with_stack(run_all, argc, argv);
}
