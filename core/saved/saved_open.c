/* Opening a file that nobody trusts. What is done for that follows "Defense Against The Dark Arts" of SQLite's
 * documentation, but for its advice to refuse a file that is damaged anywhere: what can be read of it is somebody's. */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/base/text.h"
#include "core/saved/saved_parts.h"

/* ---- settings ---- */

bool saved_defend(sqlite3 *db)
{
    static const struct {
        int what, value;
    } settings[] = {{SQLITE_DBCONFIG_DEFENSIVE, 1},
                    {SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0},
                    {SQLITE_DBCONFIG_ENABLE_TRIGGER, 0},
                    {SQLITE_DBCONFIG_ENABLE_VIEW, 0},
                    {SQLITE_DBCONFIG_ENABLE_LOAD_EXTENSION, 0},
                    {SQLITE_DBCONFIG_DQS_DML, 0},
                    {SQLITE_DBCONFIG_DQS_DDL, 0},
                    {SQLITE_DBCONFIG_WRITABLE_SCHEMA, 0}};
    static const struct {
        int what, most;
    } limits[] = {{SQLITE_LIMIT_LENGTH, SAVED_MAX_TEXT_BYTES + 4096},
                  {SQLITE_LIMIT_SQL_LENGTH, 4096},
                  {SQLITE_LIMIT_COLUMN, 16},
                  {SQLITE_LIMIT_EXPR_DEPTH, 16},
                  {SQLITE_LIMIT_COMPOUND_SELECT, 3},
                  {SQLITE_LIMIT_VDBE_OP, 25000},
                  {SQLITE_LIMIT_FUNCTION_ARG, 8},
                  {SQLITE_LIMIT_ATTACHED, 0},
                  {SQLITE_LIMIT_LIKE_PATTERN_LENGTH, 50},
                  {SQLITE_LIMIT_VARIABLE_NUMBER, 10},
                  {SQLITE_LIMIT_TRIGGER_DEPTH, 1}};
    for (size_t i = 0; i < sizeof settings / sizeof *settings; i++)
        sqlite3_db_config(db, settings[i].what, settings[i].value, (int *)NULL);
    for (size_t i = 0; i < sizeof limits / sizeof *limits; i++)
        sqlite3_limit(db, limits[i].what, limits[i].most);
    sqlite3_extended_result_codes(db, 1);
    sqlite3_busy_timeout(db, SAVED_PATIENCE_MS);
    /* None of these reads the file. */
    return sqlite3_exec(db,
                        "PRAGMA mmap_size=0; PRAGMA cell_size_check=ON; PRAGMA secure_delete=ON; "
                        "PRAGMA temp_store=MEMORY; PRAGMA synchronous=FULL",
                        NULL, NULL, NULL) == SQLITE_OK;
}

/* ---- identity ---- */

static bool check_identity(karst_saved *saved, karst_error *error)
{
    int64_t id, version;
    if (!saved_get_integer(saved, "PRAGMA application_id", &id, error) ||
        !saved_get_integer(saved, "PRAGMA user_version", &version, error))
        return false;
    if (id != SAVED_APPLICATION_ID || version < 1)
        return karst_fail(error, KARST_BAD_DATA,
                          "%s is no saved world: it is a database of something else, or its first page is damaged; "
                          "karst new makes one, and karst edit --recover reads damaged ones",
                          saved->path);
    if (version > KARST_SAVED_VERSION)
        return karst_fail(
            error, KARST_BAD_DATA,
            "%s was made by a newer Karst (its format is %lld, this one knows up to %d): use that one, or "
            "have it write edits as text",
            saved->path, (long long)version, KARST_SAVED_VERSION);
    saved->about.version = saved->committed_version = (int)version;
    return true;
}

static bool is_expected(const char *type, const char *name, const char *table, const char *sql)
{
    static const char *const expected[][2] = {{"facts", SAVED_SQL_FACTS}, {"edits", SAVED_SQL_EDITS}};
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
        if (strcmp(type, "table") == 0 && strcmp(name, expected[i][0]) == 0 && strcmp(table, name) == 0 &&
            strcmp(sql, expected[i][1]) == 0)
            return true;
    return false;
}

static const char *text_of(sqlite3_stmt *statement, int column)
{
    const unsigned char *text = sqlite3_column_text(statement, column);
    return text ? (const char *)text : "";
}

/* Tables and their texts are this format's, and there is nothing else: no trigger, view, index, virtual table. */
static bool check_schema(karst_saved *saved, karst_error *error)
{
    sqlite3_stmt *statement = NULL;
    int num = 0, code = sqlite3_prepare_v2(saved->db, "SELECT type, name, tbl_name, sql FROM sqlite_schema", -1,
                                           &statement, NULL);
    if (code == SQLITE_OK)
        while ((code = sqlite3_step(statement)) == SQLITE_ROW) {
            char quoted[KARST_TEXT_QUOTE_BYTES], quoted_type[KARST_TEXT_QUOTE_BYTES];
            if (is_expected(text_of(statement, 0), text_of(statement, 1), text_of(statement, 2),
                            text_of(statement, 3))) {
                num++;
                continue;
            }
            karst_fail(error, KARST_BAD_DATA,
                       "%s is not as Karst makes it: the %s '%s' in it is none of a saved world's; karst edit %s "
                       "--recover NEW.karstdb makes a new file of its edits",
                       saved->path, karst_text_quote(text_of(statement, 0), quoted_type),
                       karst_text_quote(text_of(statement, 1), quoted), saved->path);
            sqlite3_finalize(statement);
            return false;
        }
    bool done = code == SQLITE_DONE;
    if (!done && (sqlite3_errcode(saved->db) & 0xff) == SQLITE_ERROR)
        karst_fail(error, KARST_BAD_DATA, "%s is not as Karst makes it: %s", saved->path, sqlite3_errmsg(saved->db));
    else if (!done)
        saved_fail(saved, "read", error);
    sqlite3_finalize(statement);
    if (!done)
        return false;
    return num == 2 || karst_fail(error, KARST_BAD_DATA,
                                  "%s is not as Karst makes it: a table is missing; karst edit "
                                  "%s --recover NEW.karstdb makes a new file of what is there",
                                  saved->path, saved->path);
}

bool saved_take_stock(karst_saved *saved, karst_error *error)
{
    bool has_num;
    return saved_read_facts(saved, &saved->num_in_force, &has_num, error) && saved_count(saved, has_num, error);
}

bool saved_identify(karst_saved *saved, karst_error *error)
{
    return check_identity(saved, error) && check_schema(saved, error);
}

/* ---- opening ---- */

bool karst_saved_is_name(const char *path)
{
    size_t length = strlen(path);
    return length > strlen(".karstdb") && strcmp(path + length - strlen(".karstdb"), ".karstdb") == 0;
}

/* A file's name as a URI, in which SQLite takes options. NULL: out of memory. */
static char *make_uri(const char *path, const char *options)
{
    size_t length = strlen(path), at = 0;
    char *uri = malloc(3 * length + strlen(options) + 16);
    if (!uri)
        return NULL;
    /* With an authority, which is empty, a name that begins with two slashes is a name. */
    at = (size_t)sprintf(uri, path[0] == '/' ? "file://" : "file:");
    for (const char *c = path; *c; c++)
        at += (size_t)sprintf(uri + at, strchr("%?#", *c) ? "%%%02X" : "%c", *c);
    strcpy(uri + at, options);
    return uri;
}

/* A file in a folder that cannot be written has no room for what readers share; where no log stands beside it, none is
 * needed. */
static sqlite3 *open_alone(const char *path)
{
    char *beside = sqlite3_mprintf("%s-wal", path), *uri = make_uri(path, "?immutable=1");
    struct stat info;
    sqlite3 *db = NULL;
    bool has_log = beside && stat(beside, &info) == 0 && info.st_size > 0;
    if (beside && uri && !has_log &&
        sqlite3_open_v2(uri, &db, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX, NULL) != SQLITE_OK) {
        sqlite3_close(db);
        db = NULL;
    }
    sqlite3_free(beside);
    free(uri);
    return db;
}

karst_saved *saved_wrap(sqlite3 *db, const char *path, karst_error *error)
{
    karst_saved *saved = calloc(1, sizeof *saved);
    char *copy = strdup(path);
    if (!saved || !copy) {
        free(saved);
        free(copy);
        sqlite3_close(db);
        karst_fail(error, KARST_FAILED, "out of memory for a saved world");
        return NULL;
    }
    saved->db = db;
    saved->path = copy;
    return saved;
}

/* Reads the first page, which is where files and locks fail. */
static int touch(sqlite3 *db) { return sqlite3_exec(db, "SELECT 1 FROM sqlite_schema LIMIT 1", NULL, NULL, NULL); }

sqlite3 *saved_open_file(const char *path, karst_error *error)
{
    sqlite3 *db = NULL;
    struct stat info;
    if (stat(path, &info) == 0 && !S_ISREG(info.st_mode)) {
        karst_fail(error, KARST_BAD_DATA, "%s is no file", path);
        return NULL;
    }
    /* SQLite opens for reading what cannot be written. A reader writes too: what a killed writer left in the log
     * beside goes into the file, and the log goes away. */
    int code = sqlite3_open_v2(path, &db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX, NULL);
    if (code == SQLITE_OK && saved_defend(db)) {
        code = touch(db);
        if ((code & 0xff) == SQLITE_CANTOPEN || (code & 0xff) == SQLITE_READONLY) {
            sqlite3 *alone = open_alone(path);
            if (alone && saved_defend(alone)) {
                sqlite3_close(db);
                return alone;
            }
            sqlite3_close(alone);
        }
    }
    /* Damage is told with more words, and an error of the schema's text too. */
    if (code == SQLITE_OK || (code & 0xff) == SQLITE_ERROR || saved_is_damage(code))
        return db;
    if (stat(path, &info) != 0)
        karst_fail(error, KARST_BAD_DATA, "%s cannot be read: %s", path, strerror(errno));
    else
        saved_fail_code(path, code, sqlite3_system_errno(db), "read", sqlite3_errmsg(db), error);
    sqlite3_close(db);
    return NULL;
}

static void say_why_not(karst_saved *saved, const char *why)
{
    snprintf(saved->why_not, sizeof saved->why_not, "%s", why);
}

/* The right to write is held as long as the handle is open. */
static bool take_writing(karst_saved *saved, karst_error *error)
{
    karst_error reason = {0};
    if (sqlite3_db_readonly(saved->db, "main")) {
        say_why_not(saved, "its permissions do not allow it to be written");
    } else if (sqlite3_exec(saved->db, "PRAGMA journal_mode=WAL", NULL, NULL, NULL) != SQLITE_OK ||
               !saved_begin(saved, &reason)) {
        int code = sqlite3_errcode(saved->db) & 0xff;
        if (saved_is_damage(code))
            return reason.status ? karst_fail(error, reason.status, "%s", reason.message)
                                 : saved_fail(saved, "written", error);
        say_why_not(saved, code == SQLITE_BUSY ? "another process writes it" : sqlite3_errmsg(saved->db));
    } else {
        return true;
    }
    karst_log_print(saved->log, KARST_LOG_WARNING, "%s is open for reading only: %s", saved->path, saved->why_not);
    return true;
}

karst_saved *karst_saved_open(const char *path, bool for_writing, const karst_log *log, karst_error *error)
{
    sqlite3 *db = saved_open_file(path, error);
    karst_saved *saved = db ? saved_wrap(db, path, error) : NULL;
    if (!saved)
        return NULL;
    saved->log = log;
    bool good = saved_identify(saved, error);
    if (for_writing)
        good = good && take_writing(saved, error);
    else
        say_why_not(saved, "it was opened for reading");
    if (good && !saved->in_transaction) /* what is read is of one moment */
        good = saved->in_transaction = saved_run(saved, "BEGIN", "read", error);
    good = good && saved_take_stock(saved, error);
    saved->log = NULL;
    if (good)
        return saved;
    karst_saved_close(saved);
    return NULL;
}

void karst_saved_close(karst_saved *saved)
{
    if (!saved)
        return;
    sqlite3_finalize(saved->insert);
    if (saved->in_transaction)
        sqlite3_exec(saved->db, "ROLLBACK", NULL, NULL, NULL);
    sqlite3_close(saved->db);
    saved_free_facts(saved);
    free(saved->path);
    free(saved);
}

bool karst_saved_is_writable(const karst_saved *saved, const char **why_not)
{
    if (why_not)
        *why_not = saved->why_not;
    return !saved->why_not[0];
}

const karst_saved_about *karst_saved_get_about(const karst_saved *saved) { return &saved->about; }
