/* What karst mesh, karst points, karst voxels and karst heights share: a world, a box, a file that appears whole or not
 * at all. */
#ifndef KARST_DEMOS_COMMAND_EXPORT_H
#define KARST_DEMOS_COMMAND_EXPORT_H

#include <limits.h>

#include <jansson.h>

#include "command.h"

enum { COMMAND_EXPORT_MOST_OPTIONS = 24 };

/* What all of them are told. */
typedef struct {
    const char *world, *box, *output, *edits;
    command_parameters parameters;
    uint64_t seed, num_threads;
    double footprint_m;
    bool has_seed, json;
    command_talk *talk;
    const karst_log *log;
    char world_file[PATH_MAX]; /* what the world's name stands for */
    uint64_t start_ns;         /* since when it works */
} command_export;

/* One of them. */
typedef struct {
    const char *name, *example;    /* such as "mesh" and what would do behind "karst mesh hills" */
    const char *output_example;    /* such as "out.glb, or .ply" */
    const char *about, *examples;  /* of its help: before and behind the options */
    const command_option *options; /* its own; those of `command_export` follow */
    size_t num_options;
    bool (*check)(void *own, command_export *e, karst_error *error); /* before anything is opened */
    bool (*run)(void *own, command_export *e, karst_error *error);
} command_export_kind;

/* All of the command: options, help, what is missing, then `check` and `run`. `own` is what they get; it begins with a
 * command_export, zeroed. */
bool command_export_main(int argc, char **argv, const command_export_kind *kind, void *own, command_talk *talk,
                         karst_error *error);

/* ---- for `run` ---- */

karst_world *command_export_open(command_export *e, karst_world_part part, const karst_log *log, karst_error *error);
/* The edits that were asked for, malloc'ed; *edits is NULL without any. */
bool command_export_edits(const command_export *e, int voxel_log2_m, karst_edit **edits, size_t *num,
                          karst_error *error);
/* From here on interrupts are noticed, and time runs. */
void command_export_begin(command_export *e);
/* For the library, with a command_export as user. */
bool command_export_progress(void *user, double share);
/* After the work: ends the progress line; what failed because it was interrupted says so. Returns `done`. */
bool command_export_end(command_export *e, bool done, karst_error *error);
double command_export_seconds(const command_export *e);
/* Prints it, with so many digits of its numbers, and lets go of it. */
bool command_export_print(json_t *object, int num_digits, karst_error *error);

#endif
