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
#include <unistd.h>

#include "core/points/import_internal.h"

#define MAX_THREADS 64u

bool karst_points_go_on(points_import *import, const char *what, double share, karst_error *error)
{
    const karst_points_import_config *config = import->config;
    import->stopped = import->stopped || (config->progress && !config->progress(config->user, what, share));
    return !import->stopped || karst_fail(error, KARST_FAILED, "stopped: %s was not written", config->output);
}

bool karst_points_fail_disk(const points_import *import, const char *what, karst_error *error)
{
    return karst_fail(error, KARST_FAILED, "cannot %s beside %s: %s", what, import->config->output, strerror(errno));
}

int karst_points_scratch_with_name(const points_import *import, char **name, karst_error *error)
{
    if (asprintf(name, "%s.XXXXXX", import->config->output) < 0) {
        *name = NULL;
        karst_fail(error, KARST_FAILED, "out of memory");
        return -1;
    }
    int fd = mkostemp(*name, O_CLOEXEC);
    if (fd >= 0)
        return fd;
    karst_points_fail_disk(import, "make a temporary file", error);
    free(*name);
    *name = NULL;
    return -1;
}

int karst_points_scratch(const points_import *import, karst_error *error)
{
    char *name = NULL;
    int fd = karst_points_scratch_with_name(import, &name, error);
    if (fd >= 0)
        unlink(name);
    free(name);
    return fd;
}

bool karst_points_write(const points_import *import, int fd, const void *data, size_t num_bytes, uint64_t offset,
                        karst_error *error)
{
    for (size_t done = 0; done < num_bytes;) {
        ssize_t put = pwrite(fd, (const char *)data + done, num_bytes - done, (off_t)(offset + done));
        if (put < 0 && errno == EINTR)
            continue;
        if (put <= 0)
            return karst_points_fail_disk(import, "write", error);
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
            return karst_points_fail_disk(import, "read", error);
        done += (size_t)got;
    }
    return true;
}

/* ---- threads ---- */

typedef struct {
    atomic_uint_fast64_t next;
    atomic_bool stopped;
    const points_loop *loop;
    karst_points_work work;
    void *user;
} crew;

static bool do_a_block(crew *c)
{
    const points_loop *loop = c->loop;
    uint64_t begin = atomic_fetch_add(&c->next, loop->block);
    if (begin >= loop->end || atomic_load(&c->stopped))
        return false;
    c->work(c->user, begin, loop->end - begin < loop->block ? loop->end : begin + loop->block);
    return true;
}

static void *help(void *user)
{
    while (do_a_block(user))
        ;
    return NULL;
}

bool karst_points_in_parallel(points_import *import, const points_loop *loop, karst_points_work work, void *user,
                              karst_error *error)
{
    crew c = {.next = loop->first, .loop = loop, .work = work, .user = user};
    pthread_t threads[MAX_THREADS];
    unsigned num_threads = import->config->num_threads, num_started = 0;
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    const double num = loop->num ? (double)loop->num : 1;
    if (num_threads == 0)
        num_threads = cores > 0 ? (unsigned)cores : 1;
    while (num_started + 1 < num_threads && num_started < MAX_THREADS &&
           pthread_create(&threads[num_started], NULL, help, &c) == 0)
        num_started++;
    bool goes_on = karst_points_go_on(import, loop->what, (double)loop->first / num, error);
    while (goes_on && do_a_block(&c))
        goes_on = karst_points_go_on(import, loop->what, (double)atomic_load(&c.next) / num, error);
    if (!goes_on)
        atomic_store(&c.stopped, true);
    for (unsigned i = 0; i < num_started; i++)
        pthread_join(threads[i], NULL);
    return goes_on;
}
