/* A disk that fails: see tests/support/disk.h. */
#include "tests/support/disk.h"

#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_FILES 64
#define MAX_NAMES 16
#define MAX_REGIONS 64
#define SECTOR_BYTES 512

typedef struct {
    uint8_t *data;
    size_t size_bytes;
} content;

/* A write (data) or another length (no data) that no sync has made safe. */
typedef struct {
    size_t at, size_bytes;
    uint8_t *data;
} change;

typedef struct {
    content now, safe;
    change *changes;
    size_t num_changes;
    int num_open;
} file;

typedef struct {
    char name[96];
    int now, safe; /* files; -1: no such name */
} entry;

typedef struct {
    sqlite3_file base;
    int file, entry; /* entry -1: of no name */
    void *regions[MAX_REGIONS];
} handle;

static struct {
    sqlite3_vfs vfs, *before;
    file files[MAX_FILES];
    entry entries[MAX_NAMES];
    int num_entries;
    uint64_t num_operations, cut_at, fail_at, room_bytes;
    bool is_cut;
} disk;

static uint64_t mix(uint64_t x)
{
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return x ^ x >> 31;
}

static void *must(void *pointer)
{
    if (!pointer)
        abort();
    return pointer;
}

/* ---- contents ---- */

static void resize(content *c, size_t size_bytes)
{
    c->data = must(realloc(c->data, size_bytes + 1));
    if (size_bytes > c->size_bytes)
        memset(c->data + c->size_bytes, 0, size_bytes - c->size_bytes);
    c->size_bytes = size_bytes;
}

static void copy(content *to, const content *from)
{
    resize(to, from->size_bytes);
    if (from->size_bytes)
        memcpy(to->data, from->data, from->size_bytes);
}

static void apply(content *c, const change *w, uint64_t sectors)
{
    if (!w->data) {
        resize(c, w->size_bytes);
        return;
    }
    for (size_t done = 0, part; done < w->size_bytes; done += part, sectors = mix(sectors)) {
        part = SECTOR_BYTES - (w->at + done) % SECTOR_BYTES;
        part = part < w->size_bytes - done ? part : w->size_bytes - done;
        if (!(sectors & 1))
            continue;
        if (c->size_bytes < w->at + done + part)
            resize(c, w->at + done + part);
        memcpy(c->data + w->at + done, w->data + done, part);
    }
}

static void forget_changes(file *f)
{
    for (size_t i = 0; i < f->num_changes; i++)
        free(f->changes[i].data);
    free(f->changes);
    f->changes = NULL;
    f->num_changes = 0;
}

static void add_change(file *f, size_t at, const void *data, size_t size_bytes)
{
    f->changes = must(realloc(f->changes, (f->num_changes + 1) * sizeof *f->changes));
    change *w = &f->changes[f->num_changes++];
    *w = (change){.at = at, .size_bytes = size_bytes};
    if (data)
        w->data = memcpy(must(malloc(size_bytes + 1)), data, size_bytes);
}

static void empty(file *f)
{
    forget_changes(f);
    free(f->now.data);
    free(f->safe.data);
    *f = (file){.num_open = f->num_open};
}

/* ---- names ---- */

static int find_entry(const char *name)
{
    for (int i = 0; i < disk.num_entries; i++)
        if (strcmp(disk.entries[i].name, name) == 0)
            return i;
    if (disk.num_entries == MAX_NAMES || strlen(name) >= sizeof disk.entries[0].name)
        abort();
    disk.entries[disk.num_entries] = (entry){.now = -1, .safe = -1};
    strcpy(disk.entries[disk.num_entries].name, name);
    return disk.num_entries++;
}

static bool is_named(int number)
{
    for (int i = 0; i < disk.num_entries; i++)
        if (disk.entries[i].now == number || disk.entries[i].safe == number)
            return true;
    return false;
}

static int new_file(void)
{
    for (int i = 0; i < MAX_FILES; i++)
        if (!is_named(i) && !disk.files[i].num_open) {
            empty(&disk.files[i]);
            return i;
        }
    abort();
}

/* ---- failing ---- */

/* Whether the next operation works; else *code is what it gives. */
static bool works(int *code)
{
    *code = SQLITE_IOERR;
    disk.is_cut = disk.is_cut || disk.num_operations >= disk.cut_at;
    if (disk.is_cut)
        return false;
    disk.num_operations++;
    if (disk.fail_at && --disk.fail_at == 0)
        return false;
    *code = SQLITE_OK;
    return true;
}

/* ---- a file's methods ---- */

static file *of(sqlite3_file *base) { return &disk.files[((handle *)base)->file]; }

static int close_file(sqlite3_file *base)
{
    handle *h = (handle *)base;
    for (int i = 0; i < MAX_REGIONS; i++)
        free(h->regions[i]);
    disk.files[h->file].num_open--;
    return SQLITE_OK;
}

static int read_file(sqlite3_file *base, void *data, int size_bytes, sqlite3_int64 at)
{
    const content *c = &of(base)->now;
    if (disk.is_cut)
        return SQLITE_IOERR_READ;
    size_t there = (size_t)at < c->size_bytes ? c->size_bytes - (size_t)at : 0;
    there = there < (size_t)size_bytes ? there : (size_t)size_bytes;
    if (there)
        memcpy(data, c->data + at, there);
    memset((uint8_t *)data + there, 0, (size_t)size_bytes - there);
    return there == (size_t)size_bytes ? SQLITE_OK : SQLITE_IOERR_SHORT_READ;
}

static int write_file(sqlite3_file *base, const void *data, int size_bytes, sqlite3_int64 at)
{
    file *f = of(base);
    int code;
    size_t end = (size_t)at + (size_t)size_bytes, more = end > f->now.size_bytes ? end - f->now.size_bytes : 0;
    if (!works(&code))
        return code == SQLITE_IOERR ? SQLITE_IOERR_WRITE : code;
    if (more > disk.room_bytes)
        return SQLITE_FULL;
    disk.room_bytes -= disk.room_bytes == UINT64_MAX ? 0 : more;
    add_change(f, (size_t)at, data, (size_t)size_bytes);
    if (f->now.size_bytes < end)
        resize(&f->now, end);
    memcpy(f->now.data + at, data, (size_t)size_bytes);
    return SQLITE_OK;
}

static int truncate_file(sqlite3_file *base, sqlite3_int64 size_bytes)
{
    int code;
    if (!works(&code))
        return SQLITE_IOERR_TRUNCATE;
    add_change(of(base), 0, NULL, (size_t)size_bytes);
    resize(&of(base)->now, (size_t)size_bytes);
    return SQLITE_OK;
}

static int sync_file(sqlite3_file *base, int flags)
{
    handle *h = (handle *)base;
    int code;
    (void)flags;
    if (!works(&code))
        return SQLITE_IOERR_FSYNC;
    copy(&of(base)->safe, &of(base)->now);
    forget_changes(of(base));
    if (h->entry >= 0)
        disk.entries[h->entry].safe = disk.entries[h->entry].now;
    return SQLITE_OK;
}

static int get_size(sqlite3_file *base, sqlite3_int64 *size_bytes)
{
    *size_bytes = (sqlite3_int64)of(base)->now.size_bytes;
    return disk.is_cut ? SQLITE_IOERR_FSTAT : SQLITE_OK;
}

static int lock(sqlite3_file *base, int level)
{
    (void)base, (void)level;
    return SQLITE_OK;
}

static int is_reserved(sqlite3_file *base, int *reserved)
{
    (void)base;
    *reserved = 0;
    return SQLITE_OK;
}

static int control(sqlite3_file *base, int what, void *argument)
{
    (void)base, (void)what, (void)argument;
    return SQLITE_NOTFOUND;
}

static int sector_size(sqlite3_file *base)
{
    (void)base;
    return SECTOR_BYTES;
}

static int characteristics(sqlite3_file *base)
{
    (void)base;
    return 0;
}

static int map_shared(sqlite3_file *base, int region, int size_bytes, int extend, void volatile **memory)
{
    handle *h = (handle *)base;
    if (region >= MAX_REGIONS)
        return SQLITE_NOMEM;
    if (!h->regions[region] && extend)
        h->regions[region] = must(calloc(1, (size_t)size_bytes));
    *memory = h->regions[region];
    return SQLITE_OK;
}

static int lock_shared(sqlite3_file *base, int at, int num, int flags)
{
    (void)base, (void)at, (void)num, (void)flags;
    return SQLITE_OK;
}

static void shared_barrier(sqlite3_file *base) { (void)base; }

static int unmap_shared(sqlite3_file *base, int remove)
{
    handle *h = (handle *)base;
    (void)remove;
    for (int i = 0; i < MAX_REGIONS; i++) {
        free(h->regions[i]);
        h->regions[i] = NULL;
    }
    return SQLITE_OK;
}

static const sqlite3_io_methods methods = {.iVersion = 2,
                                           .xClose = close_file,
                                           .xRead = read_file,
                                           .xWrite = write_file,
                                           .xTruncate = truncate_file,
                                           .xSync = sync_file,
                                           .xFileSize = get_size,
                                           .xLock = lock,
                                           .xUnlock = lock,
                                           .xCheckReservedLock = is_reserved,
                                           .xFileControl = control,
                                           .xSectorSize = sector_size,
                                           .xDeviceCharacteristics = characteristics,
                                           .xShmMap = map_shared,
                                           .xShmLock = lock_shared,
                                           .xShmBarrier = shared_barrier,
                                           .xShmUnmap = unmap_shared};

/* ---- the disk's methods ---- */

static int open_file(sqlite3_vfs *vfs, const char *name, sqlite3_file *base, int flags, int *given)
{
    handle *h = (handle *)base;
    (void)vfs;
    *h = (handle){.entry = -1};
    if (disk.is_cut)
        return SQLITE_IOERR;
    if (name) {
        h->entry = find_entry(name);
        entry *e = &disk.entries[h->entry];
        if (e->now < 0 && !(flags & SQLITE_OPEN_CREATE))
            return SQLITE_CANTOPEN;
        if (e->now < 0) {
            e->now = new_file();
            resize(&disk.files[e->now].now, 0);
        }
        h->file = e->now;
    } else {
        h->file = new_file();
        resize(&disk.files[h->file].now, 0);
    }
    if (given)
        *given = flags;
    disk.files[h->file].num_open++;
    h->base.pMethods = &methods;
    return SQLITE_OK;
}

static int delete_file(sqlite3_vfs *vfs, const char *name, int sync)
{
    int code;
    (void)vfs;
    entry *e = &disk.entries[find_entry(name)];
    if (!works(&code))
        return SQLITE_IOERR_DELETE;
    if (e->now < 0)
        return SQLITE_IOERR_DELETE_NOENT;
    e->now = -1;
    if (sync)
        e->safe = -1;
    return SQLITE_OK;
}

static int has_file(sqlite3_vfs *vfs, const char *name, int flags, int *has)
{
    (void)vfs, (void)flags;
    *has = disk.entries[find_entry(name)].now >= 0;
    return SQLITE_OK;
}

static int full_name(sqlite3_vfs *vfs, const char *name, int size_bytes, char *full)
{
    (void)vfs;
    snprintf(full, (size_t)size_bytes, "%s", name);
    return SQLITE_OK;
}

static int randomness(sqlite3_vfs *vfs, int size_bytes, char *bytes)
{
    (void)vfs;
    return disk.before->xRandomness(disk.before, size_bytes, bytes);
}

static int wait_for(sqlite3_vfs *vfs, int microseconds)
{
    (void)vfs;
    return microseconds;
}

static int current_time(sqlite3_vfs *vfs, double *time)
{
    (void)vfs;
    return disk.before->xCurrentTime(disk.before, time);
}

static int last_error(sqlite3_vfs *vfs, int size_bytes, char *text)
{
    (void)vfs, (void)size_bytes, (void)text;
    return 0;
}

/* ---- for tests ---- */

void disk_begin(void)
{
    sqlite3_initialize();
    sqlite3_vfs *before = sqlite3_vfs_find(NULL);
    memset(&disk, 0, sizeof disk);
    disk.before = before;
    disk.cut_at = disk.room_bytes = UINT64_MAX;
    disk.vfs = (sqlite3_vfs){.iVersion = 1,
                             .szOsFile = sizeof(handle),
                             .mxPathname = 90,
                             .zName = "karst-test-disk",
                             .xOpen = open_file,
                             .xDelete = delete_file,
                             .xAccess = has_file,
                             .xFullPathname = full_name,
                             .xRandomness = randomness,
                             .xSleep = wait_for,
                             .xCurrentTime = current_time,
                             .xGetLastError = last_error};
    if (sqlite3_vfs_register(&disk.vfs, 1) != SQLITE_OK)
        abort();
}

void disk_end(void)
{
    sqlite3_vfs_unregister(&disk.vfs);
    sqlite3_vfs_register(disk.before, 1);
    for (int i = 0; i < MAX_FILES; i++)
        empty(&disk.files[i]);
}

void disk_put(const char *name, const void *data, size_t size_bytes)
{
    entry *e = &disk.entries[find_entry(name)];
    if (e->now < 0)
        e->now = new_file();
    e->safe = e->now;
    file *f = &disk.files[e->now];
    empty(f);
    resize(&f->now, size_bytes);
    memcpy(f->now.data, data, size_bytes);
    copy(&f->safe, &f->now);
}

const uint8_t *disk_get(const char *name, size_t *size_bytes)
{
    const entry *e = &disk.entries[find_entry(name)];
    if (e->now < 0)
        return NULL;
    *size_bytes = disk.files[e->now].now.size_bytes;
    return disk.files[e->now].now.data;
}

void disk_cut_after(uint64_t num_operations) { disk.cut_at = disk.num_operations + num_operations; }
uint64_t disk_num_operations(void) { return disk.num_operations; }
void disk_set_room(uint64_t size_bytes) { disk.room_bytes = size_bytes; }
void disk_fail_once(uint64_t n) { disk.fail_at = n; }

/* What survives of a file: what is safe, and of the rest what chance has it. */
static void settle(file *f, uint64_t *seed)
{
    for (size_t i = f->num_changes; i > 1; i--) {
        size_t k = (*seed = mix(*seed + 1)) % i;
        change swapped = f->changes[i - 1];
        f->changes[i - 1] = f->changes[k];
        f->changes[k] = swapped;
    }
    for (size_t i = 0; i < f->num_changes; i++) {
        *seed = mix(*seed + 1);
        if (*seed % 8 < 4) /* whole; else dropped, or some sectors of it */
            apply(&f->safe, &f->changes[i], UINT64_MAX);
        else if (*seed % 8 < 6)
            apply(&f->safe, &f->changes[i], *seed >> 3);
    }
    forget_changes(f);
    copy(&f->now, &f->safe);
}

void disk_restart(uint64_t seed)
{
    for (int i = 0; i < disk.num_entries; i++) {
        entry *e = &disk.entries[i];
        seed = mix(seed + 1);
        if (seed % 2)
            e->safe = e->now;
        e->now = e->safe;
    }
    for (int i = 0; i < MAX_FILES; i++) {
        bool used = false;
        for (int k = 0; k < disk.num_entries; k++)
            used = used || disk.entries[k].now == i;
        if (used)
            settle(&disk.files[i], &seed);
        else
            empty(&disk.files[i]);
    }
    disk.is_cut = false;
    disk.cut_at = UINT64_MAX;
    disk.fail_at = 0;
}
