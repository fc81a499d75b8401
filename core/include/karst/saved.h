/* Saved worlds: one file (.karstdb) that holds a world, its edits, and where one was. docs/SAVED.md has the format. */
#ifndef KARST_SAVED_H
#define KARST_SAVED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/edit.h"
#include "karst/error.h"
#include "karst/log.h"
#include "karst/world.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The file is a database of SQLite 3. Its log of edits is the truth: edits are appended in order, an undo takes the
 * log's end out of force, and edits that were undone are there until the next one is appended. What was committed
 * survives the end of the process at any moment and, on disks that keep what they say they wrote, a loss of power. One
 * process at a time may write; others read meanwhile. A file may come from a stranger: nothing in it is believed before
 * it was checked, and no part of it is run.
 *
 * A handle may be used by one thread at a time, different handles by different threads, also of one file. */
typedef struct karst_saved karst_saved;

/* The newest version of the format; all up to it are read and written. A file is of version 1 until it holds what that
 * does not know: edits that smooth make it one of version 2, so that an older Karst says that it is too old for it. */
#define KARST_SAVED_VERSION 2
#define KARST_SAVED_NUM_BOOKMARKS 9
#define KARST_SAVED_MAX_PARAMETERS 64

/* What a new file holds. Zero-initialised fields mean the default that stands beside them; borrowed during the call. */
typedef struct {
    const char *world; /* as karst_world_config's: the name of a shipped world, or the path of a world file; required */
    bool embed;        /* keep its text in the file, not only its name */
    const karst_parameter *parameters; /* at most KARST_SAVED_MAX_PARAMETERS: values instead of the header's */
    size_t num_parameters;
    bool has_seed;
    uint32_t seed;        /* instead of the world's own */
    const char *camera;   /* as karst_camera_parse takes it; NULL: the world's own */
    const karst_log *log; /* gets what there is to say of the world's text; NULL: silent */
} karst_saved_config;

/* Makes a file that is not there yet; it appears whole or not at all. The world is compiled, to know that it can be. A
 * path of a world file below the new file's folder is kept relative to that, so that both may be moved; any other is
 * kept absolute. Errors: KARST_USAGE (the camera, too many parameters), KARST_BAD_WORLD (of the world), KARST_FAILED
 * (a file of that name is there already, a full or failing disk). Thread-safe. */
bool karst_saved_create(const char *path, const karst_saved_config *config, karst_error *error);

/* Whether a path is a saved world's by its name: it ends in ".karstdb". */
bool karst_saved_is_name(const char *path);

/* Errors of all functions below, beside those that they name: KARST_FAILED (memory, a full or failing disk, another
 * process that writes). */

/* Opens a file to be read, or (`for_writing`) to be read and written. Where it cannot be written (another process
 * writes it, or its permissions say so) it is opened for reading all the same: karst_saved_is_writable says whether.
 * `log` (borrowed; may be NULL) gets a warning for that, and for each fact in the file that is damaged, and is there as
 * if it had never been set. Close it with karst_saved_close. Errors: KARST_BAD_DATA (no such file, a file of something
 * else or of a newer Karst, a schema that is not this format's). */
karst_saved *karst_saved_open(const char *path, bool for_writing, const karst_log *log, karst_error *error);
/* What was not committed is gone. NULL is fine. */
void karst_saved_close(karst_saved *saved);
bool karst_saved_is_writable(const karst_saved *saved, const char **why_not); /* why_not may be NULL */

/* What the file says beside its edits. Texts are the handle's, valid until it is closed or the fact is set. */
typedef struct {
    int version;         /* of the format */
    const char *made_by; /* the Karst that made it; NULL: lost */
    const char *world;   /* as karst_world_config takes it: a shipped world's name, or a path; NULL: lost, or `text` is
                          * all there is */
    const char *text;    /* the world's text, if it is inside; NULL: it is not */
    size_t text_bytes;
    uint64_t text_sum; /* of the world's text when the file was made: see karst_saved_sum; 0: lost */
    int voxel_log2_m;  /* the world's, when the file was made */
    bool has_seed;
    uint32_t seed;
    const char *camera;                               /* NULL: the world's own */
    const char *bookmarks[KARST_SAVED_NUM_BOOKMARKS]; /* cameras; NULL: none */
    const karst_parameter *parameters;
    size_t num_parameters;
    size_t num_damaged; /* facts of which the log was told */
} karst_saved_about;

const karst_saved_about *karst_saved_get_about(const karst_saved *saved);
/* A sum of a text, to notice that it changed (FNV-1a, 64 bits). */
uint64_t karst_saved_sum(const char *text, size_t text_bytes);

/* Sets the camera (as karst_camera_parse takes it; NULL: the world's own), and bookmark 0 to 8 (NULL: none), with the
 * next commit. Errors: KARST_USAGE (no camera), KARST_BAD_DATA (the file is damaged), KARST_FAILED (not writable). */
bool karst_saved_set_camera(karst_saved *saved, const char *camera, karst_error *error);
bool karst_saved_set_bookmark(karst_saved *saved, int number, const char *camera, karst_error *error);

/* ---- edits ---- */

/* How many edits are in force, and how many could be redone; what is not committed counts. */
size_t karst_saved_num_edits(const karst_saved *saved, size_t *num_redoable);

/* Appends edits, whose positions are in voxels of 2^voxel_log2_m metres, after those in force; edits that were undone
 * are gone. All are taken or none. Errors: KARST_USAGE (a value out of range: which edit, counted from 1; more than
 * KARST_MAX_EDITS), KARST_BAD_DATA (the file is damaged), KARST_FAILED (not writable). */
bool karst_saved_append(karst_saved *saved, const karst_edit *edits, size_t num_edits, int voxel_log2_m,
                        karst_error *error);
/* Takes the last edits out of force, at most as many as there are, and back into force; *num becomes how many. Errors:
 * KARST_BAD_DATA (the file is damaged), KARST_FAILED (not writable). */
bool karst_saved_undo(karst_saved *saved, size_t *num, karst_error *error);
bool karst_saved_redo(karst_saved *saved, size_t *num, karst_error *error);

/* When it returns true, all that was appended, undone, redone and set is on the disk. When it fails, or any of those
 * does, all since the last commit is undone, and the file is as that left it. Errors: KARST_BAD_DATA (the file is
 * damaged). */
bool karst_saved_commit(karst_saved *saved, karst_error *error);

/* Calls `visit` for each edit of the log from number `first` (from 1) to `last`, in order, with positions in voxels of
 * 2^voxel_log2_m metres (where the file's are of another width: rounded to 2^-32 of these, and a `to_m` stays as it
 * is). Where edits are lost, because their rows are damaged or hold what is no edit, it is called once for all of them,
 * from `number` to `last_number`, with edit NULL. It returns false to end the visit, which is no error. */
typedef bool (*karst_saved_visit_edit)(void *user, size_t number, size_t last_number, const karst_edit *edit);
bool karst_saved_visit(karst_saved *saved, size_t first, size_t last, int voxel_log2_m, karst_saved_visit_edit visit,
                       void *user, karst_error *error);
/* The edits in force, malloc'ed, *num of them, and *num_lost (may be NULL) more that are damaged, of which the log
 * (may be NULL) gets a warning for each row of them. */
karst_edit *karst_saved_read_edits(karst_saved *saved, int voxel_log2_m, size_t *num, size_t *num_lost,
                                   const karst_log *log, karst_error *error);
/* The same of a file that is opened for it and closed: for karst_engine_config.edits and the like. Thread-safe. Errors:
 * as karst_saved_open. */
karst_edit *karst_saved_load_edits(const char *path, int voxel_log2_m, size_t *num, const karst_log *log,
                                   karst_error *error);

/* ---- care ---- */

/* Looks at every page and row, and hands a line for each that is wrong to `print`; *num_wrong: how many. */
bool karst_saved_check(karst_saved *saved, void (*print)(void *user, const char *line), void *user, size_t *num_wrong,
                       karst_error *error);
/* Drops edits that were undone, and gives back all room that nothing uses. Commits first. Errors: KARST_BAD_DATA (the
 * file is damaged), KARST_FAILED (not writable). */
bool karst_saved_compact(karst_saved *saved, karst_error *error);
/* Copies what is committed to a new file, which appears whole or not at all, also while another process writes.
 * Errors: KARST_FAILED (a file of that name is there already). */
bool karst_saved_backup(karst_saved *saved, const char *path, karst_error *error);
/* Makes a new file of all that can be read of a damaged one, whatever part of that is damaged; `world` (NULL: what the
 * file says) is for where the world is lost. The lines that `log` gets name what is lost. Errors: KARST_USAGE
 * (the world is lost, and `world` is NULL), KARST_BAD_DATA (it is no saved world at all), KARST_FAILED (there is a file
 * of the new name already). Thread-safe. */
bool karst_saved_recover(const char *path, const char *new_path, const char *world, const karst_log *log,
                         karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
