/* A new file of what can be read of a damaged one: by SQLite, without the first page if that is damaged, and for edits
 * that SQLite no longer comes to, because a page is damaged that leads to them, row by row from the pages. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/saved/saved_parts.h"

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

/* ---- edits from pages ---- */

typedef struct {
    uint64_t number;
    karst_edit edit;
} found_edit;

typedef struct {
    found_edit *edits;
    size_t num, capacity;
    uint64_t most; /* numbers above it are not in force */
    int voxel_log2_m;
    bool is_out_of_memory;
} finding;

static bool add_found(finding *f, uint64_t number, const karst_edit *edit)
{
    if (f->num == f->capacity) {
        size_t capacity = 2 * f->capacity + 256;
        found_edit *edits = realloc(f->edits, capacity * sizeof *edits);
        f->is_out_of_memory = !edits;
        if (!edits)
            return false;
        f->edits = edits;
        f->capacity = capacity;
    }
    f->edits[f->num++] = (found_edit){number, *edit};
    return true;
}

static bool find_by_visit(void *user, size_t number, size_t last, const karst_edit *edit)
{
    (void)last;
    return !edit || add_found(user, number, edit);
}

/* SQLite's numbers of one to nine bytes; false beyond `end`. */
static bool read_varint(const uint8_t **at, const uint8_t *end, uint64_t *number)
{
    *number = 0;
    for (int i = 0; i < 9 && *at < end; i++) {
        uint8_t byte = *(*at)++;
        if (i == 8) {
            *number = *number << 8 | byte;
            return true;
        }
        *number = *number << 7 | (byte & 0x7f);
        if (!(byte & 0x80))
            return true;
    }
    return false;
}

/* A cell of a leaf of the table of edits: the sizes of row and head, two types (that of the number is 0, that of a row
 * of n bytes is 12 + 2 n), and the row, which says itself whether it is one. */
static void find_in_cell(finding *f, const uint8_t *at, const uint8_t *end)
{
    uint64_t payload_bytes, number, head_bytes, type_of_number, type_of_row;
    karst_edit edit;
    if (!read_varint(&at, end, &payload_bytes) || !read_varint(&at, end, &number))
        return;
    const uint8_t *head = at;
    if (!read_varint(&at, end, &head_bytes) || !read_varint(&at, end, &type_of_number) ||
        !read_varint(&at, end, &type_of_row) || (uint64_t)(at - head) != head_bytes || type_of_number != 0 ||
        type_of_row < 12 || type_of_row > 12 + 2 * SAVED_MAX_ROW_BYTES || type_of_row % 2)
        return;
    size_t size_bytes = (size_t)(type_of_row - 12) / 2;
    if (payload_bytes == head_bytes + size_bytes && size_bytes <= (size_t)(end - at) && number > 0 &&
        number <= f->most && saved_row_unpack(at, size_bytes, number, f->voxel_log2_m, &edit))
        add_found(f, number, &edit);
}

static void find_in_pages(finding *f, const uint8_t *pages, size_t num_pages)
{
    enum { LEAF = 13, NUM_CELLS_AT = 3, CELLS_AT = 8 };
    for (size_t i = 1; i < num_pages && !f->is_out_of_memory; i++) {
        const uint8_t *page = pages + i * SAVED_PAGE_BYTES, *end = page + SAVED_PAGE_BYTES;
        size_t num_cells = (size_t)page[NUM_CELLS_AT] << 8 | page[NUM_CELLS_AT + 1];
        for (size_t cell = 0; page[0] == LEAF && cell < num_cells; cell++) {
            const uint8_t *pointer = page + CELLS_AT + 2 * cell;
            if (pointer + 2 > end)
                break;
            size_t at = (size_t)pointer[0] << 8 | pointer[1];
            if (at < SAVED_PAGE_BYTES)
                find_in_cell(f, page + at, end);
        }
    }
}

static int compare(const void *a, const void *b)
{
    const found_edit *x = a, *y = b;
    return x->number < y->number ? -1 : x->number > y->number;
}

static void say_lost(const karst_log *log, const char *path, uint64_t first, uint64_t last)
{
    if (first == last)
        karst_log_print(log, KARST_LOG_WARNING, "%s: edit %llu is lost: it is damaged", path,
                        (unsigned long long)first);
    else if (first < last)
        karst_log_print(log, KARST_LOG_WARNING, "%s: edits %llu to %llu are lost: they are damaged", path,
                        (unsigned long long)first, (unsigned long long)last);
}

/* In the order of their numbers, each once; says which are missing. */
static bool append_found(karst_saved *old, finding *f, karst_saved *new_file, const karst_log *log, karst_error *error)
{
    uint64_t next = 1;
    bool done = true;
    qsort(f->edits, f->num, sizeof *f->edits, compare);
    for (size_t i = 0; done && i < f->num; i++) {
        const found_edit *one = &f->edits[i];
        if (one->number < next)
            continue;
        say_lost(log, old->path, next, one->number - 1);
        next = one->number + 1;
        done = karst_saved_append(new_file, &one->edit, 1, f->voxel_log2_m, error);
    }
    if (done && old->has_num)
        say_lost(log, old->path, next, old->num_in_force);
    return done;
}

static bool find_edits(karst_saved *old, finding *f, karst_error *error)
{
    sqlite3_int64 size_bytes = 0;
    if (!karst_saved_visit(old, 1, (size_t)old->num_in_force, f->voxel_log2_m, find_by_visit, f, error))
        return false;
    if (!f->is_out_of_memory && (f->num < old->num_in_force || !old->has_num)) {
        unsigned char *pages = read_pages(old->path, &size_bytes, error);
        if (!pages)
            return false;
        find_in_pages(f, pages, (size_t)size_bytes / SAVED_PAGE_BYTES);
        sqlite3_free(pages);
    }
    return !f->is_out_of_memory || karst_fail(error, KARST_FAILED, "out of memory for %zu edits", f->num + 1);
}

static bool fill(karst_saved *old, karst_saved *new_file, const karst_log *log, karst_error *error)
{
    finding f = {.most = old->has_num ? old->num_in_force : KARST_MAX_EDITS, .voxel_log2_m = old->about.voxel_log2_m};
    bool done = find_edits(old, &f, error) && append_found(old, &f, new_file, log, error);
    free(f.edits);
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
