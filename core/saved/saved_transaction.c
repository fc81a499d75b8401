/* Transactions on a saved world: what is committed, and how much that is. */
#include <stdio.h>
#include <string.h>

#include "core/saved/saved_parts.h"

bool saved_begin(karst_saved *saved, karst_error *error)
{
    int64_t version;
    if (saved->why_not[0])
        return karst_fail(error, KARST_FAILED, "%s is open for reading only: %s", saved->path, saved->why_not);
    if (saved->in_transaction)
        return true;
    if (!saved_run(saved, "BEGIN IMMEDIATE", "written", error))
        return false;
    saved->in_transaction = true;
    if (!saved_get_integer(saved, "PRAGMA data_version", &version, error)) {
        saved_roll_back(saved);
        return false;
    }
    /* Between a commit and the next transaction another process may come first. */
    if (saved->data_version && saved->data_version != version) {
        saved_roll_back(saved);
        snprintf(saved->why_not, sizeof saved->why_not, "another process has changed it meanwhile; open it again");
        return karst_fail(error, KARST_FAILED, "%s cannot be written: %s", saved->path, saved->why_not);
    }
    saved->data_version = version;
    return true;
}

bool saved_raise_version(karst_saved *saved, int version, karst_error *error)
{
    char sql[64];
    if (version <= saved->about.version)
        return true;
    snprintf(sql, sizeof sql, "PRAGMA user_version=%d", version);
    if (!saved_run(saved, sql, "written", error))
        return false;
    saved->about.version = version;
    return true;
}

void saved_roll_back(karst_saved *saved)
{
    sqlite3_reset(saved->insert);
    if (saved->in_transaction)
        sqlite3_exec(saved->db, "ROLLBACK", NULL, NULL, NULL);
    saved->num_in_force = saved->num_committed_in_force;
    saved->num_made = saved->num_committed_made;
    saved->about.version = saved->committed_version;
    if (saved->are_facts_changed) {
        bool has_num;
        uint64_t num_in_force;
        size_t num_damaged = saved->about.num_damaged;
        saved_read_facts(saved, &num_in_force, &has_num, NULL);
        saved->about.num_damaged = num_damaged;
    }
    saved->in_transaction = saved->is_changed = saved->are_facts_changed = false;
}

bool karst_saved_commit(karst_saved *saved, karst_error *error)
{
    char number[24];
    if (!saved->is_changed)
        return true;
    snprintf(number, sizeof number, "%llu", (unsigned long long)saved->num_in_force);
    if (!saved_write_fact(saved, "num_in_force", number, strlen(number), error) ||
        !saved_run(saved, "COMMIT", "written", error)) {
        saved_roll_back(saved);
        return false;
    }
    saved->in_transaction = saved->is_changed = saved->are_facts_changed = false;
    saved->num_committed_in_force = saved->num_in_force;
    saved->num_committed_made = saved->num_made;
    saved->committed_version = saved->about.version;
    saved_begin(saved, NULL); /* so that nobody else writes; if it fails, the next change says why */
    return true;
}

/* ---- counting ---- */

size_t karst_saved_num_edits(const karst_saved *saved, size_t *num_redoable)
{
    if (num_redoable)
        *num_redoable = (size_t)(saved->num_made - saved->num_in_force);
    return (size_t)saved->num_in_force;
}

/* The last row that is whole: a damaged number must not look like a long log. */
static bool find_last(karst_saved *saved, uint64_t *last, karst_error *error)
{
    sqlite3_stmt *statement = NULL;
    int code = sqlite3_prepare_v2(saved->db, "SELECT id, edit FROM edits ORDER BY id DESC", -1, &statement, NULL);
    *last = 0;
    for (int i = 0; code == SQLITE_OK && i < SAVED_MOST_BAD_AT_END; i++) {
        karst_edit edit;
        if ((code = sqlite3_step(statement)) != SQLITE_ROW)
            break;
        code = SQLITE_OK;
        int64_t id = sqlite3_column_int64(statement, 0);
        const void *row = sqlite3_column_blob(statement, 1);
        size_t size_bytes = (size_t)sqlite3_column_bytes(statement, 1);
        if (id > 0 && id <= (int64_t)KARST_MAX_EDITS && row &&
            saved_row_unpack(row, size_bytes, (uint64_t)id, SAVED_OWN_VOXEL, &edit)) {
            *last = (uint64_t)id;
            if (!saved->has_voxel)
                saved->about.voxel_log2_m = saved_row_voxel_log2_m(row);
            break;
        }
    }
    bool done = code == SQLITE_OK || code == SQLITE_DONE || saved_is_damage(code) || saved_fail(saved, "read", error);
    sqlite3_finalize(statement);
    return done;
}

bool saved_count(karst_saved *saved, bool has_num, karst_error *error)
{
    uint64_t last;
    if (!find_last(saved, &last, error))
        return false;
    saved->has_num = has_num;
    if (!has_num) {
        saved_note_damage(saved, "how many of its edits are in force is lost: all %llu are taken",
                          (unsigned long long)last);
        saved->num_in_force = last;
    }
    saved->num_made = last > saved->num_in_force ? last : saved->num_in_force;
    saved->num_committed_in_force = saved->num_in_force;
    saved->num_committed_made = saved->num_made;
    return true;
}
