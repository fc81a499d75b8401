/* Care for saved worlds: check, compact, backup, recover. */
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

/* ---- recover ---- */

#define MAX_RECOVER_BYTES ((off_t)4 << 30)

/* All of a file, padded to whole pages; NULL with an error. sqlite3_malloc'ed. */
static unsigned char *read_pages(const char *path, sqlite3_int64 *size_bytes, karst_error *error)
{
    struct stat info;
    FILE *file = fopen(path, "rb");
    unsigned char *pages = NULL;
    if (!file || fstat(fileno(file), &info) != 0) {
        karst_fail(error, KARST_BAD_DATA, "%s cannot be read: %s", path, strerror(errno));
    } else if (!S_ISREG(info.st_mode) || info.st_size > MAX_RECOVER_BYTES) {
        karst_fail(error, KARST_BAD_DATA, "%s is no file, or too large to be recovered", path);
    } else {
        *size_bytes = ((sqlite3_int64)info.st_size / SAVED_PAGE_BYTES + 1) * SAVED_PAGE_BYTES;
        pages = sqlite3_malloc64((sqlite3_uint64)*size_bytes);
        if (!pages) {
            karst_fail(error, KARST_FAILED, "out of memory for %s", path);
        } else {
            size_t read = fread(pages, 1, (size_t)*size_bytes, file);
            memset(pages + read, 0, (size_t)*size_bytes - read);
            *size_bytes = (sqlite3_int64)((read + SAVED_PAGE_BYTES - 1) / SAVED_PAGE_BYTES * SAVED_PAGE_BYTES);
        }
    }
    if (file)
        fclose(file);
    return pages;
}

static bool has_log_beside(const char *path)
{
    struct stat info;
    char *beside = sqlite3_mprintf("%s-wal", path);
    bool has = beside && stat(beside, &info) == 0 && info.st_size > 0;
    sqlite3_free(beside);
    return has;
}

static bool make_first_page(unsigned char page[SAVED_PAGE_BYTES], karst_error *error)
{
    sqlite3 *db = NULL;
    sqlite3_int64 size_bytes = 0;
    karst_saved fresh = {.path = (char[]){"(memory)"}};
    bool done = sqlite3_open_v2(":memory:", &db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX, NULL) == SQLITE_OK &&
                saved_defend(db);
    fresh.db = db;
    unsigned char *image = NULL;
    if (done && saved_make_tables(&fresh, error) && saved_run(&fresh, "COMMIT", "written", error))
        image = sqlite3_serialize(db, "main", &size_bytes, 0);
    done = image && size_bytes >= SAVED_PAGE_BYTES;
    if (done)
        memcpy(page, image, SAVED_PAGE_BYTES);
    else
        karst_fail(error, KARST_FAILED, "out of memory for a page");
    sqlite3_free(image);
    sqlite3_close(db);
    return done;
}

static void put_big_endian(unsigned char *at, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        at[i] = (unsigned char)(value >> (24 - 8 * i));
}

/* A file whose first page is damaged, in memory, with one that is as every saved world's first page is: the tables
 * always begin on the same pages. */
static karst_saved *open_without_first_page(const char *path, const karst_log *log, karst_error *error)
{
    enum { NUM_PAGES_AT = 28, CHANGES_AT = 24, VALID_FOR_AT = 92 };
    sqlite3_int64 size_bytes = 0;
    sqlite3 *db = NULL;
    unsigned char *pages = read_pages(path, &size_bytes, error);
    if (!pages)
        return NULL;
    if (size_bytes < 3 * SAVED_PAGE_BYTES) {
        sqlite3_free(pages);
        karst_fail(error, KARST_BAD_DATA, "%s has nothing that a saved world has", path);
        return NULL;
    }
    if (!make_first_page(pages, error) ||
        sqlite3_open_v2(":memory:", &db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX, NULL) != SQLITE_OK ||
        !saved_defend(db)) {
        karst_fail(error, KARST_FAILED, "out of memory for %s", path);
        sqlite3_free(pages);
        sqlite3_close(db);
        return NULL;
    }
    put_big_endian(pages + NUM_PAGES_AT, (uint32_t)(size_bytes / SAVED_PAGE_BYTES));
    memcpy(pages + VALID_FOR_AT, pages + CHANGES_AT, 4);
    /* It frees the pages, also when it fails. */
    if (sqlite3_deserialize(db, "main", pages, size_bytes, size_bytes,
                            SQLITE_DESERIALIZE_FREEONCLOSE | SQLITE_DESERIALIZE_READONLY) != SQLITE_OK) {
        karst_fail(error, KARST_FAILED, "%s cannot be read: %s", path, sqlite3_errmsg(db));
        sqlite3_close(db);
        return NULL;
    }
    karst_saved *saved = saved_wrap(db, path, error);
    if (!saved)
        return NULL;
    saved->log = log;
    snprintf(saved->why_not, sizeof saved->why_not, "it is damaged");
    karst_log_print(log, KARST_LOG_WARNING, "%s: its first page is damaged; the rest is read without it", path);
    if (has_log_beside(path))
        karst_log_print(log, KARST_LOG_WARNING, "%s-wal holds its last changes, which cannot be read without that page",
                        path);
    bool good = saved_identify(saved, error) && saved_take_stock(saved, error);
    saved->log = NULL;
    if (good)
        return saved;
    karst_saved_close(saved);
    return NULL;
}

/* Facts that can be read, but for those that are the new file's own or that `world` takes the place of. */
static bool copy_facts(const karst_saved *old, karst_saved *new_file, const char *new_path, const char *world,
                       karst_error *error)
{
    bool done = true;
    for (size_t i = 0; done && i < old->num_facts; i++) {
        const saved_fact *fact = &old->facts[i];
        if (strcmp(fact->key, "num_in_force") != 0 && strcmp(fact->key, "world") != 0 &&
            !(world && strncmp(fact->key, "text", 4) == 0))
            done = saved_write_fact(new_file, fact->key, fact->text, fact->size_bytes, error);
    }
    const char *name = world ? world : old->about.world;
    char *kept = done && name ? saved_name_world(name, new_path) : NULL;
    if (kept)
        done = saved_write_fact(new_file, "world", kept, strlen(kept), error);
    else if (name)
        done = done && karst_fail(error, KARST_FAILED, "%s cannot be found: %s", name, strerror(errno));
    free(kept);
    return done;
}

static bool fill(karst_saved *old, karst_saved *new_file, const karst_log *log, karst_error *error)
{
    size_t num = 0, num_lost = 0;
    int voxel_log2_m = old->about.voxel_log2_m;
    karst_edit *edits = karst_saved_read_edits(old, voxel_log2_m, &num, &num_lost, log, error);
    bool done = edits && karst_saved_append(new_file, edits, num, voxel_log2_m, error);
    free(edits);
    new_file->is_changed = true; /* if there are no edits, too */
    return done && karst_saved_commit(new_file, error);
}

bool karst_saved_recover(const char *path, const char *new_path, const char *world, const karst_log *log,
                         karst_error *error)
{
    karst_error reason = {0};
    char *temporary = NULL;
    karst_saved *old = karst_saved_open(path, false, log, &reason), *new_file = NULL;
    if (!old && reason.status == KARST_BAD_DATA)
        old = open_without_first_page(path, log, error);
    else if (!old)
        karst_fail(error, reason.status, "%s", reason.message);
    if (!old)
        return false;
    bool done = world || old->about.world || old->about.text ||
                karst_fail(error, KARST_USAGE, "which world %s is of is lost: name it with --world", path);
    sqlite3 *db = done ? saved_open_new(new_path, &temporary, error) : NULL;
    if (db)
        new_file = saved_wrap(db, new_path, error);
    done = new_file && saved_make_tables(new_file, error);
    if (new_file) {
        new_file->in_transaction = true;
        done = done && copy_facts(old, new_file, new_path, world, error) && fill(old, new_file, log, error);
        saved_roll_back(new_file); /* what a commit leaves open */
        done = done && saved_run(new_file, "PRAGMA journal_mode=WAL", "written", error);
        karst_saved_close(new_file);
    }
    if (temporary)
        done = saved_finish_new(NULL, temporary, new_path, done, error);
    karst_saved_close(old);
    return done;
}
