/* Files beside the output, and threads: what the steps of an import stand on. */
#define _FILE_OFFSET_BITS 64
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/points/import_internal.h"

#define MAX_THREADS 64u

bool karst_points_go_on(points_import *import, const char *what, double share, karst_error *error)
{
    const karst_points_import_config *config = import->config;
    import->stopped = import->stopped || (config->progress && !config->progress(config->user, what, share));
    return !import->stopped || karst_fail(error, KARST_FAILED, "stopped: %s was not written", config->output);
}

static bool fail_disk(const points_import *import, const char *what, karst_error *error)
{
    return karst_fail(error, KARST_FAILED, "cannot %s beside %s: %s", what, import->config->output, strerror(errno));
}

int karst_points_scratch(const points_import *import, karst_error *error)
{
    char *name = NULL;
    if (asprintf(&name, "%s.XXXXXX", import->config->output) < 0) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return -1;
    }
    int fd = mkostemp(name, O_CLOEXEC);
    if (fd < 0)
        fail_disk(import, "make a temporary file", error);
    else
        unlink(name);
    free(name);
    return fd;
}

void *karst_points_map(int fd, size_t num_bytes, karst_error *error)
{
    void *map = mmap(NULL, num_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (map != MAP_FAILED)
        return map;
    karst_fail(error, KARST_FAILED, "cannot map %zu bytes of a file: %s", num_bytes, strerror(errno));
    return NULL;
}

void *karst_points_scratch_map(const points_import *import, size_t num_bytes, karst_error *error)
{
    int fd = karst_points_scratch(import, error);
    if (fd < 0)
        return NULL;
    /* Room is taken now: a full disk would kill whoever writes to the map later. */
    int code = posix_fallocate(fd, 0, (off_t)num_bytes);
    errno = code;
    void *map = code ? NULL : karst_points_map(fd, num_bytes, error);
    if (code)
        fail_disk(import, "find room for temporary files", error);
    close(fd);
    return map;
}

void karst_points_unmap(void *map, size_t num_bytes)
{
    if (map)
        munmap(map, num_bytes);
}

bool karst_points_write(const points_import *import, int fd, const void *data, size_t num_bytes, uint64_t offset,
                        karst_error *error)
{
    for (size_t done = 0; done < num_bytes;) {
        ssize_t put = pwrite(fd, (const char *)data + done, num_bytes - done, (off_t)(offset + done));
        if (put < 0 && errno == EINTR)
            continue;
        if (put <= 0)
            return fail_disk(import, "write", error);
        done += (size_t)put;
    }
    return true;
}

bool karst_points_read(const points_import *import, int fd, void *data, size_t num_bytes, uint64_t offset,
                       karst_error *error)
{
    for (size_t done = 0; done < num_bytes;) {
        ssize_t got = pread(fd, (char *)data + done, num_bytes - done, (off_t)(offset + done));
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return fail_disk(import, "read", error);
        done += (size_t)got;
    }
    return true;
}

/* ---- threads ---- */

typedef struct {
    atomic_uint_fast64_t next;
    atomic_bool stopped;
    uint64_t num, block;
    karst_points_work work;
    void *user;
} crew;

static bool do_a_block(crew *c)
{
    uint64_t begin = atomic_fetch_add(&c->next, c->block), end = begin + c->block < c->num ? begin + c->block : c->num;
    if (begin >= c->num || atomic_load(&c->stopped))
        return false;
    c->work(c->user, begin, end);
    return true;
}

static void *help(void *user)
{
    while (do_a_block(user))
        ;
    return NULL;
}

bool karst_points_in_parallel(points_import *import, const char *what, uint64_t num, uint64_t block,
                              karst_points_work work, void *user, karst_error *error)
{
    crew c = {.num = num, .block = block, .work = work, .user = user};
    pthread_t threads[MAX_THREADS];
    unsigned num_threads = import->config->num_threads, num_started = 0;
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    if (num_threads == 0)
        num_threads = cores > 0 ? (unsigned)cores : 1;
    while (num_started + 1 < num_threads && num_started < MAX_THREADS &&
           pthread_create(&threads[num_started], NULL, help, &c) == 0)
        num_started++;
    bool goes_on = karst_points_go_on(import, what, 0, error);
    while (goes_on && do_a_block(&c))
        goes_on = karst_points_go_on(import, what, (double)atomic_load(&c.next) / (double)(num ? num : 1), error);
    if (!goes_on)
        atomic_store(&c.stopped, true);
    for (unsigned i = 0; i < num_started; i++)
        pthread_join(threads[i], NULL);
    return goes_on;
}
