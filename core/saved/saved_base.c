/* What SQLite says, in Karst's words, and small things that all parts of a saved world ask of it. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "core/saved/saved_parts.h"

bool saved_is_damage(int code)
{
    code &= 0xff;
    return code == SQLITE_CORRUPT || code == SQLITE_NOTADB || code == SQLITE_TOOBIG || code == SQLITE_MISMATCH;
}

bool saved_fail_code(const char *path, int code, int system_errno, const char *action, const char *what,
                     karst_error *error)
{
    switch (code & 0xff) {
    case SQLITE_NOTADB:
        return karst_fail(error, KARST_BAD_DATA,
                          "%s is no saved world, or its first page is damaged: karst edit %s --recover NEW.karstdb "
                          "makes a new file of what can be read of one",
                          path, path);
    case SQLITE_CORRUPT:
    case SQLITE_TOOBIG:
    case SQLITE_MISMATCH:
        return karst_fail(error, KARST_BAD_DATA,
                          "%s is damaged (%s): karst edit %s --check says where, and --recover NEW.karstdb makes a new "
                          "file of what can be read",
                          path, what, path);
    case SQLITE_FULL:
        return karst_fail(error, KARST_FAILED, "%s cannot be %s: the disk is full; make room and try again", path,
                          action);
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
        return karst_fail(error, KARST_FAILED, "%s cannot be %s: another process has it open for writing", path,
                          action);
    case SQLITE_READONLY:
        return karst_fail(error, KARST_FAILED, "%s cannot be %s: its permissions, or its folder's, do not allow it",
                          path, action);
    case SQLITE_NOMEM:
        return karst_fail(error, KARST_FAILED, "%s cannot be %s: out of memory", path, action);
    default:
        return karst_fail(error, KARST_FAILED, "%s cannot be %s: %s", path, action,
                          system_errno ? strerror(system_errno) : what);
    }
}

bool saved_fail(const karst_saved *saved, const char *action, karst_error *error)
{
    return saved_fail_code(saved->path, sqlite3_extended_errcode(saved->db), sqlite3_system_errno(saved->db), action,
                     sqlite3_errmsg(saved->db), error);
}

bool saved_run(karst_saved *saved, const char *sql, const char *action, karst_error *error)
{
    return sqlite3_exec(saved->db, sql, NULL, NULL, NULL) == SQLITE_OK || saved_fail(saved, action, error);
}

bool saved_get_integer(karst_saved *saved, const char *sql, int64_t *number, karst_error *error)
{
    sqlite3_stmt *statement = NULL;
    bool done =
        sqlite3_prepare_v2(saved->db, sql, -1, &statement, NULL) == SQLITE_OK && sqlite3_step(statement) == SQLITE_ROW;
    if (done)
        *number = sqlite3_column_int64(statement, 0);
    else
        saved_fail(saved, "read", error);
    sqlite3_finalize(statement);
    return done;
}

void saved_note_damage(karst_saved *saved, const char *format, ...)
{
    const size_t room = sizeof saved->damage / sizeof *saved->damage;
    char line[sizeof *saved->damage];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (saved->about.num_damaged < room)
        memcpy(saved->damage[saved->about.num_damaged], line, sizeof line);
    saved->about.num_damaged++;
    karst_log_print(saved->log, KARST_LOG_WARNING, "%s: %s", saved->path, line);
}
