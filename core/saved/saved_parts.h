/* What the parts of a saved world share. See karst/saved.h.
 *
 *   saved_row.c     rows: an edit as bytes, checksums
 *   saved_open.c    opening a file that nobody trusts; closing
 *   saved_facts.c   what the file says beside its edits
 *   saved_log.c     the log of edits: append, undo, redo, read; cameras
 *   saved_transaction.c  begin, commit, roll back
 *   saved_base.c    what SQLite says
 *   saved_create.c  new files
 *   saved_care.c    check, compact, backup
 *   saved_recover.c  a new file of a damaged one
 */
#ifndef KARST_SAVED_PARTS_H
#define KARST_SAVED_PARTS_H

#include <limits.h>
#include <sqlite3.h>

#include "karst/saved.h"

/* "Krst", which says what the file is, as SQLite's documentation asks for. */
#define SAVED_APPLICATION_ID 0x4b727374
#define SAVED_FIRST_VERSION 1 /* of the format: what new files are, until they hold what it does not know */

/* The whole schema: SQLite keeps these texts, and a file that has others, or more, is no saved world. */
#define SAVED_SQL_FACTS \
    "CREATE TABLE facts (key TEXT PRIMARY KEY, value BLOB NOT NULL, sum INTEGER NOT NULL) STRICT, WITHOUT ROWID"
#define SAVED_SQL_EDITS "CREATE TABLE edits (id INTEGER PRIMARY KEY, edit BLOB NOT NULL) STRICT"

#define SAVED_PAGE_BYTES 4096
#define SAVED_MAX_ROW_BYTES 200 /* one with every field has 196 */
#define SAVED_MAX_KEY_BYTES 80
#define SAVED_MAX_FACTS 1024
#define SAVED_MAX_TEXT_BYTES (1 << 20) /* as worlds have */
#define SAVED_MAX_CAMERA_BYTES 512
#define SAVED_PATIENCE_MS 2000 /* for another process that writes */

typedef struct {
    char *text; /* "": nothing, if there is no value */
    size_t size_bytes;
    char key[SAVED_MAX_KEY_BYTES];
} saved_fact;

struct karst_saved {
    sqlite3 *db;
    sqlite3_stmt *insert;
    char *path;
    const karst_log *log; /* during open only */
    char why_not[256];    /* not writable; "": it is */
    bool in_transaction, is_changed, are_facts_changed;
    bool has_voxel, has_num; /* the facts are there */
    int64_t data_version;    /* SQLite's: another one after another connection's commit */
    uint64_t num_in_force, num_made, num_committed_in_force, num_committed_made;
    int committed_version;
    karst_saved_about about;
    saved_fact *facts;
    size_t num_facts;
    karst_parameter parameters[KARST_SAVED_MAX_PARAMETERS];
    char *world_path;     /* about.world, if it is one */
    char damage[16][160]; /* about.num_damaged lines, or the first of them */
};

/* ---- saved_row.c ---- */

uint64_t saved_sum(uint64_t sum, const void *data, size_t size_bytes);
#define SAVED_SUM_BEGIN 0xcbf29ce484222325u
/* An edit as a row's bytes, which hold their own checksum and that of its number; returns how many. */
size_t saved_row_pack(const karst_edit *edit, uint64_t id, int voxel_log2_m, uint8_t row[SAVED_MAX_ROW_BYTES]);
int saved_row_voxel_log2_m(const uint8_t *row);
/* The format that a file must have which holds this edit. */
int saved_row_version(const karst_edit *edit);
/* false: damaged, or no edit. voxel_log2_m may be SAVED_OWN_VOXEL. */
#define SAVED_OWN_VOXEL INT_MIN
bool saved_row_unpack(const uint8_t *row, size_t size_bytes, uint64_t id, int voxel_log2_m, karst_edit *edit);

/* ---- saved_base.c ---- */

/* Says what SQLite failed with while the file was to be `action` ("read", "written"). Returns false. */
bool saved_fail(const karst_saved *saved, const char *action, karst_error *error);
/* The same of a file that there is no handle of. */
bool saved_fail_code(const char *path, int code, int system_errno, const char *action, const char *what,
                     karst_error *error);
bool saved_is_damage(int code); /* SQLite's: of this page or row, not of the disk */
bool saved_run(karst_saved *saved, const char *sql, const char *action, karst_error *error);
/* The one whole number that a statement gives. Errors: as saved_fail. */
bool saved_get_integer(karst_saved *saved, const char *sql, int64_t *number, karst_error *error);
void saved_note_damage(karst_saved *saved, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* ---- saved_open.c ---- */

/* Limits and settings for a file that nobody trusts, of a connection that was just opened. */
bool saved_defend(sqlite3 *db);
/* A connection with these, whose first page can be read, or is damaged. Errors: as karst_saved_open. */
sqlite3 *saved_open_file(const char *path, karst_error *error);
/* Makes handles of connections; the connection is the handle's from here on. */
karst_saved *saved_wrap(sqlite3 *db, const char *path, karst_error *error);
/* Identity, version and schema are this format's. */
bool saved_identify(karst_saved *saved, karst_error *error);
/* Reads facts and counts. */
bool saved_take_stock(karst_saved *saved, karst_error *error);

/* ---- saved_facts.c ---- */

bool saved_read_facts(karst_saved *saved, uint64_t *num_in_force, bool *has_num, karst_error *error);
/* Writes a fact, in a transaction; value NULL takes it away. */
bool saved_write_fact(karst_saved *saved, const char *key, const void *value, size_t size_bytes, karst_error *error);
/* Takes a camera for a fact, in a transaction; NULL: none. */
bool saved_set_camera(karst_saved *saved, const char *key, const char *camera, karst_error *error);
#define SAVED_BOOKMARK_PREFIX "bookmark:"
void saved_free_facts(karst_saved *saved);

/* ---- saved_transaction.c ---- */

/* Rows that are looked at for the last whole one, and passed over. */
#define SAVED_MOST_BAD_AT_END 10000

/* In a transaction: the file is of this version of the format from the commit on, if it was older. */
bool saved_raise_version(karst_saved *saved, int version, karst_error *error);
bool saved_begin(karst_saved *saved, karst_error *error);
void saved_roll_back(karst_saved *saved);
/* How many rows the log has, with num_in_force as the facts say. */
bool saved_count(karst_saved *saved, bool has_num, karst_error *error);

/* ---- saved_create.c ---- */

/* A new connection to a file beside `path` that appears under that name with saved_finish_new; *temporary is malloc'ed.
 */
sqlite3 *saved_open_new(const char *path, char **temporary, karst_error *error);
/* Closes the connection (NULL: it is closed), and gives the file its name, or removes it if `good` is false. Frees
 * `temporary`. */
bool saved_finish_new(sqlite3 *db, char *temporary, const char *path, bool good, karst_error *error);
/* How a file at `path` names its world: a shipped world's name as it is; a file's path from the folder of `path` if it
 * lies in there, else from the root; NULL with errno if there is no such file. malloc'ed; a path has a slash. */
char *saved_name_world(const char *world, const char *path);
/* Leaves a transaction open. */
bool saved_make_tables(karst_saved *saved, karst_error *error);

#endif
