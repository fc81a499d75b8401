/* Care for saved worlds: check, compact, backup. */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/base/text.h"
#include "core/saved/saved_parts.h"

/* ---- check ---- */

typedef struct {
    void (*print)(void *user, const char *line);
    void *user;
    size_t num_wrong;
} report;

static void say(report *r, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void say(report *r, const char *format, ...)
{
    char line[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    r->num_wrong++;
    if (r->print)
        r->print(r->user, line);
}

static bool note_lost(void *user, size_t number, size_t last, const karst_edit *edit)
{
    if (!edit && number == last)
        say(user, "edit %zu is lost: it is damaged", number);
    else if (!edit)
        say(user, "edits %zu to %zu are lost: they are damaged", number, last);
    return true;
}

/* What SQLite finds to be wrong with its pages, the first of it. */
static bool check_pages(karst_saved *saved, report *r, karst_error *error)
{
    sqlite3_stmt *statement = NULL;
    int code = sqlite3_prepare_v2(saved->db, "PRAGMA integrity_check(20)", -1, &statement, NULL);
    while (code == SQLITE_OK && (code = sqlite3_step(statement)) == SQLITE_ROW) {
        const char *line = (const char *)sqlite3_column_text(statement, 0);
        code = SQLITE_OK;
        if (line && strcmp(line, "ok") != 0)
            for (const char *end; *line; line = *end ? end + 1 : end) {
                end = line + strcspn(line, "\n");
                say(r, "in its pages: %.*s", (int)(end - line), line);
            }
    }
    if (saved_is_damage(code))
        say(r, "in its pages: %s", sqlite3_errmsg(saved->db));
    bool done = code == SQLITE_DONE || saved_is_damage(code) || saved_fail(saved, "read", error);
    sqlite3_finalize(statement);
    return done;
}

bool karst_saved_check(karst_saved *saved, void (*print)(void *user, const char *line), void *user, size_t *num_wrong,
                       karst_error *error)
{
    report r = {.print = print, .user = user};
    const size_t room = sizeof saved->damage / sizeof *saved->damage;
    for (size_t i = 0; i < saved->about.num_damaged && i < room; i++)
        say(&r, "%s", saved->damage[i]);
    bool done = karst_saved_visit(saved, 1, (size_t)saved->num_made, saved->about.voxel_log2_m, note_lost, &r, error) &&
                check_pages(saved, &r, error);
    *num_wrong = r.num_wrong;
    return done;
}

/* ---- compact, backup ---- */

bool karst_saved_compact(karst_saved *saved, karst_error *error)
{
    char sql[80];
    if (!saved_begin(saved, error) || !karst_saved_commit(saved, error) || !saved_begin(saved, error))
        return false;
    snprintf(sql, sizeof sql, "DELETE FROM edits WHERE id > %llu", (unsigned long long)saved->num_in_force);
    saved->is_changed = true;
    if (!saved_run(saved, sql, "written", error)) {
        saved_roll_back(saved);
        return false;
    }
    saved->num_made = saved->num_in_force;
    if (!karst_saved_commit(saved, error))
        return false;
    saved_roll_back(saved);                             /* there is nothing in it; the following wants none open */
    sqlite3_limit(saved->db, SQLITE_LIMIT_ATTACHED, 1); /* what it is copied through */
    bool done = saved_run(saved, "VACUUM; PRAGMA wal_checkpoint(TRUNCATE)", "written", error);
    sqlite3_limit(saved->db, SQLITE_LIMIT_ATTACHED, 0);
    return saved_begin(saved, error) && done;
}

/* SQLite copies from no connection that is writing: a second one reads what is committed. */
bool karst_saved_backup(karst_saved *saved, const char *path, karst_error *error)
{
    char *temporary;
    sqlite3 *from = saved->why_not[0] ? saved->db : saved_open_file(saved->path, error);
    sqlite3 *to = from ? saved_open_new(path, &temporary, error) : NULL;
    bool done = false;
    if (to) {
        sqlite3_backup *backup = sqlite3_backup_init(to, "main", from, "main");
        int code = backup ? sqlite3_backup_step(backup, -1) : sqlite3_errcode(to);
        sqlite3_backup_finish(backup);
        done = code == SQLITE_DONE || karst_fail(error, KARST_FAILED, "%s cannot be copied to %s: %s", saved->path,
                                                 path, sqlite3_errstr(code));
        done = saved_finish_new(to, temporary, path, done, error);
    }
    if (from != saved->db)
        sqlite3_close(from);
    return done;
}
