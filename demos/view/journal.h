/* What is done to a world goes into its file: a thread of its own takes edits, undos and redos in order, and commits
 * them at least once a second. Knows nothing of window or engine. */
#ifndef KARST_DEMOS_VIEW_JOURNAL_H
#define KARST_DEMOS_VIEW_JOURNAL_H

#include <karst/saved.h>

typedef struct view_journal view_journal;

/* Opens a saved world to be written, of which `num_in_force` edits are on show. Starts no thread. Errors: as
 * karst_saved_open; KARST_FAILED (it cannot be written, another number of edits is in force by now). */
view_journal *view_journal_open(const char *path, size_t num_in_force, int voxel_log2_m, karst_error *error);
/* Edits of the file that were undone before it was opened, in order: the journal's, until it is closed. */
const karst_edit *view_journal_redoable(const view_journal *journal, size_t *num);
/* From now on a thread does what view_journal_turn does, a second after the last time or as soon as there is something
 * to do. Errors: KARST_FAILED. */
bool view_journal_start(view_journal *journal, karst_error *error);

/* Asks for what was just done to what is on show. They never wait for a disk. */
void view_journal_append(view_journal *journal, const karst_edit *edits, size_t num);
void view_journal_undo(view_journal *journal, size_t num);
void view_journal_redo(view_journal *journal, size_t num);

/* Writes and commits all that was asked for. false: it could not; all of it is still to be done. Not while a thread
 * does so. */
bool view_journal_turn(view_journal *journal);

typedef struct {
    bool is_saved;      /* all that was asked for is on the disk */
    size_t num_waiting; /* edits, undos and redos that are not */
    char why[256];      /* the last turn failed; "": it did not */
} view_journal_state;
view_journal_state view_journal_look(view_journal *journal);

/* Ends the thread and takes a last turn. The file's handle, for what else there is to be written; it stays the
 * journal's. */
karst_saved *view_journal_finish(view_journal *journal);
void view_journal_close(view_journal *journal); /* NULL is fine */

#endif
