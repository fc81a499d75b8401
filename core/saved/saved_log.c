/* The log of edits: rows numbered from 1, of which the first num_in_force are in force. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/saved/saved_parts.h"
#include "producers/edits/edit_list.h"

/* ---- changing ---- */

/* Edits that were undone go when others are appended. */
static bool drop_undone(karst_saved *saved, karst_error *error)
{
    sqlite3_stmt *statement = NULL;
    bool done = sqlite3_prepare_v2(saved->db, "DELETE FROM edits WHERE id > ?1", -1, &statement, NULL) == SQLITE_OK &&
                sqlite3_bind_int64(statement, 1, (int64_t)saved->num_in_force) == SQLITE_OK &&
                sqlite3_step(statement) == SQLITE_DONE;
    if (!done)
        saved_fail(saved, "written", error);
    sqlite3_finalize(statement);
    saved->num_made = saved->num_in_force;
    return done;
}

static bool insert(karst_saved *saved, const karst_edit *edit, int voxel_log2_m, karst_error *error)
{
    uint8_t row[SAVED_MAX_ROW_BYTES];
    uint64_t id = saved->num_in_force + 1;
    size_t size_bytes = saved_row_pack(edit, id, voxel_log2_m, row);
    bool done = sqlite3_bind_int64(saved->insert, 1, (int64_t)id) == SQLITE_OK &&
                sqlite3_bind_blob64(saved->insert, 2, row, size_bytes, SQLITE_STATIC) == SQLITE_OK &&
                sqlite3_step(saved->insert) == SQLITE_DONE;
    if (!done)
        saved_fail(saved, "written", error);
    sqlite3_reset(saved->insert);
    saved->num_in_force += done;
    saved->num_made = saved->num_in_force;
    return done;
}

bool karst_saved_append(karst_saved *saved, const karst_edit *edits, size_t num_edits, int voxel_log2_m,
                        karst_error *error)
{
    karst_edit_record record;
    if (num_edits > KARST_MAX_EDITS || saved->num_in_force + num_edits > KARST_MAX_EDITS)
        return karst_fail(error, KARST_USAGE, "%zu edits more than %llu: %u are the most", num_edits,
                          (unsigned long long)saved->num_in_force, KARST_MAX_EDITS);
    for (size_t i = 0; i < num_edits; i++)
        if (!karst_edit_record_make(&edits[i], i + 1, voxel_log2_m, &record, error))
            return false;
    if (num_edits == 0)
        return true;
    if (!saved_begin(saved, error))
        return false;
    if (!saved->insert &&
        sqlite3_prepare_v2(saved->db, "INSERT INTO edits VALUES (?1, ?2)", -1, &saved->insert, NULL) != SQLITE_OK) {
        saved_fail(saved, "written", error);
        saved_roll_back(saved);
        return false;
    }
    saved->is_changed = true;
    bool done = saved->num_made == saved->num_in_force || drop_undone(saved, error);
    for (size_t i = 0; done && i < num_edits; i++)
        done = saved_raise_version(saved, saved_row_version(&edits[i]), error) &&
               insert(saved, &edits[i], voxel_log2_m, error);
    if (!done)
        saved_roll_back(saved);
    return done;
}

static bool go_to(karst_saved *saved, uint64_t num_in_force, karst_error *error)
{
    if (num_in_force == saved->num_in_force)
        return true;
    if (!saved_begin(saved, error))
        return false;
    saved->num_in_force = num_in_force;
    saved->is_changed = true;
    return true;
}

bool karst_saved_undo(karst_saved *saved, size_t *num, karst_error *error)
{
    *num = *num < saved->num_in_force ? *num : (size_t)saved->num_in_force;
    bool done = go_to(saved, saved->num_in_force - *num, error);
    *num = done ? *num : 0;
    return done;
}

bool karst_saved_redo(karst_saved *saved, size_t *num, karst_error *error)
{
    uint64_t most = saved->num_made - saved->num_in_force;
    *num = *num < most ? *num : (size_t)most;
    bool done = go_to(saved, saved->num_in_force + *num, error);
    *num = done ? *num : 0;
    return done;
}

/* ---- reading ---- */

typedef struct {
    karst_saved *saved;
    sqlite3_stmt *statement;
    uint64_t next, last; /* numbers still to be told of */
    uint64_t seen;       /* the highest number that was come by */
    uint64_t num_bad, max_bad;
    int voxel_log2_m;
    karst_saved_visit_edit visit;
    void *user;
    bool ended; /* visit wants no more */
} reader;

static void tell(reader *r, uint64_t number, const karst_edit *edit)
{
    if (!r->ended && number > r->next)
        r->ended = !r->visit(r->user, (size_t)r->next, (size_t)(number - 1), NULL);
    if (!r->ended && edit)
        r->ended = !r->visit(r->user, (size_t)number, (size_t)number, edit);
    r->next = edit ? number + 1 : number;
}

/* From the first row whose number is `from` or more to the last that can be read; returns SQLite's code. Rows that are
 * out of order or damaged are passed over: that their numbers are missing shows in the end. */
static int read_rows(reader *r, uint64_t from)
{
    int code = SQLITE_OK;
    sqlite3_reset(r->statement);
    sqlite3_bind_int64(r->statement, 1, (int64_t)from);
    r->seen = from > r->seen ? from : r->seen;
    while (!r->ended && (code = sqlite3_step(r->statement)) == SQLITE_ROW) {
        karst_edit edit;
        int64_t id = sqlite3_column_int64(r->statement, 0);
        const void *row = sqlite3_column_blob(r->statement, 1);
        size_t size_bytes = (size_t)sqlite3_column_bytes(r->statement, 1);
        if (id > (int64_t)r->seen && id <= (int64_t)r->last)
            r->seen = (uint64_t)id;
        if (id >= (int64_t)r->next && id <= (int64_t)r->last && row &&
            saved_row_unpack(row, size_bytes, (uint64_t)id, r->voxel_log2_m, &edit))
            tell(r, (uint64_t)id, &edit);
        else if (++r->num_bad > r->max_bad)
            return SQLITE_DONE; /* pages may be used many times over by who means harm */
        if (r->next > r->last)
            return SQLITE_DONE;
    }
    return code;
}

/* Whether a search for this number comes to a row. */
static bool can_read(reader *r, uint64_t from)
{
    sqlite3_reset(r->statement);
    sqlite3_bind_int64(r->statement, 1, (int64_t)from);
    return sqlite3_step(r->statement) == SQLITE_ROW;
}

/* The first number behind a damaged page; last + 1 if there is none. */
static uint64_t find_next(reader *r)
{
    uint64_t low = r->seen + 1 > r->next ? r->seen + 1 : r->next, high = 0; /* low cannot be read, high can */
    for (uint64_t step = 1; !high && low + step <= r->last; step *= 2) {
        if (can_read(r, low + step))
            high = low + step;
        else
            low += step;
    }
    if (!high && low < r->last && can_read(r, r->last))
        high = r->last;
    while (high && high - low > 1) {
        uint64_t middle = low + (high - low) / 2;
        if (can_read(r, middle))
            high = middle;
        else
            low = middle;
    }
    return high ? high : r->last + 1;
}

bool karst_saved_visit(karst_saved *saved, size_t first, size_t last, int voxel_log2_m, karst_saved_visit_edit visit,
                       void *user, karst_error *error)
{
    reader r = {.saved = saved, .next = first ? first : 1, .visit = visit, .user = user, .voxel_log2_m = voxel_log2_m};
    r.last = last < saved->num_made ? last : saved->num_made;
    r.max_bad = saved->num_made + SAVED_MOST_BAD_AT_END;
    if (r.next > r.last)
        return true;
    int code =
        sqlite3_prepare_v2(saved->db, "SELECT id, edit FROM edits WHERE id >= ?1 ORDER BY id", -1, &r.statement, NULL);
    uint64_t from = r.next;
    while (code == SQLITE_OK) {
        code = read_rows(&r, from);
        if (!saved_is_damage(code))
            break;
        from = find_next(&r);
        code = from > r.last || ++r.num_bad > r.max_bad ? SQLITE_DONE : SQLITE_OK;
    }
    bool done = code == SQLITE_DONE || code == SQLITE_OK || code == SQLITE_ROW || saved_is_damage(code) ||
                saved_fail(saved, "read", error);
    sqlite3_finalize(r.statement);
    if (done && !r.ended && r.next <= r.last)
        tell(&r, r.last + 1, NULL);
    return done;
}

#define MOST_WARNINGS 20

typedef struct {
    karst_edit *edits;
    size_t num, capacity, num_lost, num_warnings;
    const karst_saved *saved;
    const karst_log *log;
    bool is_out_of_memory;
} gathering;

static bool gather(void *user, size_t number, size_t last, const karst_edit *edit)
{
    gathering *g = user;
    if (!edit) {
        g->num_lost += last - number + 1;
        if (g->num_warnings++ < MOST_WARNINGS && last == number)
            karst_log_print(g->log, KARST_LOG_WARNING, "%s: edit %zu is lost: it is damaged", g->saved->path, number);
        else if (g->num_warnings <= MOST_WARNINGS)
            karst_log_print(g->log, KARST_LOG_WARNING, "%s: edits %zu to %zu are lost: they are damaged",
                            g->saved->path, number, last);
        return true;
    }
    if (g->num == g->capacity) {
        size_t capacity = g->capacity ? 2 * g->capacity : 256;
        karst_edit *edits = realloc(g->edits, capacity * sizeof *edits);
        g->is_out_of_memory = !edits;
        if (!edits)
            return false;
        g->edits = edits;
        g->capacity = capacity;
    }
    g->edits[g->num++] = *edit;
    return true;
}

karst_edit *karst_saved_read_edits(karst_saved *saved, int voxel_log2_m, size_t *num, size_t *num_lost,
                                   const karst_log *log, karst_error *error)
{
    gathering g = {.saved = saved, .log = log, .capacity = 1, .edits = malloc(sizeof *g.edits)};
    *num = 0;
    bool done = g.edits && karst_saved_visit(saved, 1, (size_t)saved->num_in_force, voxel_log2_m, gather, &g, error);
    if (!g.edits || g.is_out_of_memory)
        done = karst_fail(error, KARST_FAILED, "out of memory for %zu edits", g.num + 1);
    if (g.num_warnings > MOST_WARNINGS)
        karst_log_print(log, KARST_LOG_WARNING, "%s: %zu edits are lost, in %zu places", saved->path, g.num_lost,
                        g.num_warnings);
    if (!done) {
        free(g.edits);
        return NULL;
    }
    *num = g.num;
    if (num_lost)
        *num_lost = g.num_lost;
    return g.edits;
}

karst_edit *karst_saved_load_edits(const char *path, int voxel_log2_m, size_t *num, const karst_log *log,
                                   karst_error *error)
{
    karst_saved *saved = karst_saved_open(path, false, NULL, error);
    karst_edit *edits = saved ? karst_saved_read_edits(saved, voxel_log2_m, num, NULL, log, error) : NULL;
    karst_saved_close(saved);
    return edits;
}

/* ---- cameras ---- */

static bool set_camera(karst_saved *saved, const char *key, const char *camera, karst_error *error)
{
    karst_camera parsed = {.fov_deg = 60};
    if (camera && strlen(camera) >= SAVED_MAX_CAMERA_BYTES)
        return karst_fail(error, KARST_USAGE, "a camera has %d characters at most", SAVED_MAX_CAMERA_BYTES - 1);
    if (camera && !karst_camera_parse(camera, saved->about.voxel_log2_m, &parsed, error))
        return false;
    if (!saved_begin(saved, error))
        return false;
    saved->is_changed = saved->are_facts_changed = true;
    if (saved_set_camera(saved, key, camera, error))
        return true;
    saved_roll_back(saved);
    return false;
}

bool karst_saved_set_camera(karst_saved *saved, const char *camera, karst_error *error)
{
    return set_camera(saved, "camera", camera, error);
}

bool karst_saved_set_bookmark(karst_saved *saved, int number, const char *camera, karst_error *error)
{
    char key[SAVED_MAX_KEY_BYTES];
    if (number < 0 || number >= KARST_SAVED_NUM_BOOKMARKS)
        return karst_fail(error, KARST_USAGE, "there are bookmarks 0 to %d", KARST_SAVED_NUM_BOOKMARKS - 1);
    snprintf(key, sizeof key, SAVED_BOOKMARK_PREFIX "%d", number + 1);
    return set_camera(saved, key, camera, error);
}
