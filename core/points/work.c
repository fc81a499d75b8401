/* What an import keeps its work in: a folder beside the output, with a checkpoint of how far it is; or files without
 * names, where nobody wants to go on later.
 *
 * A checkpoint is a file of its own that replaces the one before in one step. It says what it is of: the input (by
 * size, time and inode), the options, and this start of the machine, as what the page cache held does not survive a
 * loss of power. */
#define _FILE_OFFSET_BITS 64
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/points/import_internal.h"

#define CHECKPOINT_MAGIC "KarstIm2" /* another one where the files of steps are others */

static const char *const file_names[POINTS_NUM_FILES] = {
    "raw",    "spread",      "ranges",     "sorted", "kept", "near", "bends", "turns",
    "queues", "covers-even", "covers-odd", "model"};

/* What a checkpoint is of. */
typedef struct {
    uint64_t size, inode, device, seconds, nanoseconds;
    uint32_t axes, turn, keep_outliers, version;
    char boot[40];
} origin;

typedef struct {
    char magic[8];
    origin of;
    points_progress now;
    uint64_t sum; /* of all before */
} checkpoint;

static char *name_in(const points_import *import, const char *name)
{
    char *path = NULL;
    return asprintf(&path, "%s/%s", import->folder, name) < 0 ? NULL : path;
}

static void remove_name(const points_import *import, const char *name)
{
    char *path = name_in(import, name);
    if (path)
        unlink(path);
    free(path);
}

static origin origin_of(const points_import *import)
{
    const karst_points_import_config *config = import->config;
    struct stat about;
    origin of;
    memset(&of, 0, sizeof of);
    if (stat(config->input, &about) == 0) {
        of.size = (uint64_t)about.st_size;
        of.inode = (uint64_t)about.st_ino;
        of.device = (uint64_t)about.st_dev;
        of.seconds = (uint64_t)about.st_mtim.tv_sec;
        of.nanoseconds = (uint64_t)about.st_mtim.tv_nsec;
    }
    of.axes = (uint32_t)config->axes;
    of.turn = (uint32_t)config->turn;
    of.keep_outliers = config->keep_outliers;
    of.version = KARST_POINTS_VERSION;
    FILE *file = fopen("/proc/sys/kernel/random/boot_id", "re");
    if (file) {
        if (fread(of.boot, 1, sizeof of.boot - 1, file) == 0)
            of.boot[0] = '\0';
        fclose(file);
    }
    return of;
}

static bool is_good(const checkpoint *noted, const origin *of)
{
    return memcmp(noted->magic, CHECKPOINT_MAGIC, sizeof noted->magic) == 0 &&
           noted->sum == karst_points_sum(0, noted, offsetof(checkpoint, sum)) &&
           memcmp(&noted->of, of, sizeof *of) == 0 && noted->now.step < POINTS_DONE;
}

static void read_checkpoint(points_import *import)
{
    const origin of = origin_of(import);
    checkpoint noted;
    char *path = name_in(import, "checkpoint");
    int fd = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    if (fd >= 0 && read(fd, &noted, sizeof noted) == (ssize_t)sizeof noted && is_good(&noted, &of)) {
        import->now = noted.now;
        import->is_resumed = true;
    }
    if (fd >= 0)
        close(fd);
    free(path);
}

static bool lock(points_import *import, karst_error *error)
{
    char *path = name_in(import, "lock");
    if (!path)
        return karst_fail(error, KARST_FAILED, "out of memory");
    import->lock = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    free(path);
    if (import->lock < 0)
        return karst_points_fail_disk(import, "make a file", error);
    return flock(import->lock, LOCK_EX | LOCK_NB) == 0 ||
           karst_fail(error, KARST_FAILED, "%s is being imported by another process: %s is its work",
                      import->config->output, import->folder);
}

bool karst_points_begin_work(points_import *import, karst_error *error)
{
    import->head = &import->now.head;
    import->lock = -1;
    for (int i = 0; i < POINTS_NUM_FILES; i++)
        import->fds[i] = -1;
    if (!import->config->resumable)
        return true;
    if (asprintf(&import->folder, "%s.import", import->config->output) < 0) {
        import->folder = NULL;
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    if (mkdir(import->folder, 0700) != 0 && errno != EEXIST)
        return karst_points_fail_disk(import, "make a folder", error);
    if (!lock(import, error))
        return false;
    read_checkpoint(import);
    for (int i = 0; i < POINTS_NUM_FILES && !import->is_resumed; i++)
        remove_name(import, file_names[i]);
    if (!import->is_resumed)
        remove_name(import, "whole"); /* which earlier versions of Karst had */
    return true;
}

static void close_file(points_import *import, points_work_file file)
{
    if (import->fds[file] >= 0)
        close(import->fds[file]);
    import->fds[file] = -1;
}

void karst_points_remove_work(points_import *import)
{
    for (points_work_file i = 0; i < POINTS_NUM_FILES; i++)
        karst_points_drop_file(import, i);
    if (!import->folder || import->lock < 0)
        return;
    remove_name(import, "checkpoint");
    remove_name(import, "checkpoint.new");
    remove_name(import, "lock");
    rmdir(import->folder);
}

void karst_points_end_work(points_import *import)
{
    for (points_work_file i = 0; i < POINTS_NUM_FILES; i++)
        close_file(import, i);
    if (import->lock >= 0)
        close(import->lock);
    free(import->folder);
    import->folder = NULL;
}

bool karst_points_checkpoint(points_import *import, karst_error *error)
{
    checkpoint noted;
    if (!import->folder)
        return true;
    memset(&noted, 0, sizeof noted);
    memcpy(noted.magic, CHECKPOINT_MAGIC, sizeof noted.magic);
    noted.of = origin_of(import);
    noted.now = import->now;
    noted.sum = karst_points_sum(0, &noted, offsetof(checkpoint, sum));
    char *fresh = name_in(import, "checkpoint.new"), *path = name_in(import, "checkpoint");
    int fd = fresh && path ? open(fresh, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600) : -1;
    bool done = fd >= 0 && karst_points_write(import, fd, &noted, sizeof noted, 0, error);
    if (fd >= 0)
        close(fd);
    done = done && rename(fresh, path) == 0;
    free(fresh);
    free(path);
    return done || karst_points_fail_disk(import, "note what is done", error);
}

int karst_points_file(points_import *import, points_work_file file, karst_error *error)
{
    if (import->fds[file] >= 0)
        return import->fds[file];
    if (!import->folder)
        return import->fds[file] = file == POINTS_MODEL
                                       ? karst_points_scratch_with_name(import, &import->model_name, error)
                                       : karst_points_scratch(import, error);
    char *path = name_in(import, file_names[file]);
    if (path)
        import->fds[file] = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    free(path);
    if (import->fds[file] < 0)
        karst_points_fail_disk(import, "make a file", error);
    return import->fds[file];
}

void karst_points_drop_file(points_import *import, points_work_file file)
{
    close_file(import, file);
    if (import->folder && import->lock >= 0)
        remove_name(import, file_names[file]);
    if (file == POINTS_MODEL && import->model_name) {
        unlink(import->model_name);
        free(import->model_name);
        import->model_name = NULL;
    }
}

bool karst_points_publish(points_import *import)
{
    char *name = import->folder ? name_in(import, file_names[POINTS_MODEL]) : import->model_name;
    bool done = name && rename(name, import->config->output) == 0;
    if (import->folder || done)
        free(name);
    if (done)
        import->model_name = NULL;
    return done;
}

/* ---- files as memory ---- */

void *karst_points_map_file(points_import *import, points_work_file file, size_t num_bytes, bool anew,
                            karst_error *error)
{
    int fd = karst_points_file(import, file, error), slot = 0;
    const int num_slots = (int)(sizeof import->maps / sizeof *import->maps);
    while (slot < num_slots && import->maps[slot].at)
        slot++;
    if (fd < 0 || slot == num_slots)
        return NULL;
    int code = anew && ftruncate(fd, 0) != 0 ? errno : 0;
    if (!code)
        code = posix_fallocate(fd, 0, (off_t)num_bytes);
    if (code) {
        errno = code;
        karst_points_fail_disk(import, "find room for temporary files", error);
        return NULL;
    }
    void *map = mmap(NULL, num_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (map == MAP_FAILED) {
        karst_fail(error, KARST_FAILED, "cannot map %zu bytes of a file: %s", num_bytes, strerror(errno));
        return NULL;
    }
    import->maps[slot].at = map;
    import->maps[slot].num_bytes = num_bytes;
    return map;
}

void karst_points_unmap(points_import *import, void *map)
{
    for (size_t i = 0; map && i < sizeof import->maps / sizeof *import->maps; i++)
        if (import->maps[i].at == map) {
            munmap(map, import->maps[i].num_bytes);
            import->maps[i].at = NULL;
        }
}

/* 0 where the system does not say. Read without a FILE, since steps that go anywhere ask often. */
static uint64_t resident_bytes(void)
{
    char text[128] = "";
    unsigned long long all, resident = 0;
    int fd = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return 0;
    ssize_t num = read(fd, text, sizeof text - 1);
    close(fd);
    if (num <= 0 || sscanf(text, "%llu %llu", &all, &resident) != 2)
        return 0;
    return resident * (uint64_t)sysconf(_SC_PAGESIZE);
}

void karst_points_stay_small(const points_import *import)
{
    if (resident_bytes() <= import->limits.most_resident_bytes)
        return;
    /* Of files that are shared nothing is lost by this: what was written stays in the file. */
    for (size_t i = 0; i < sizeof import->maps / sizeof *import->maps; i++)
        if (import->maps[i].at)
            madvise(import->maps[i].at, import->maps[i].num_bytes, MADV_DONTNEED);
}

points_work_file karst_points_in_order(const points_import *import)
{
    return import->now.has_dropped ? POINTS_KEPT : POINTS_SORTED;
}
