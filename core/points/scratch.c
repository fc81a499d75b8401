/* Files beside the output, and progress: what the steps of an import stand on. */
#define _FILE_OFFSET_BITS 64
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/points/import_internal.h"

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

/* Never has a name, so that not even a kill at once leaves one; -1 where the file system knows no such files. */
static int open_nameless(const char *output)
{
    char *path = strdup(output);
    int fd = path ? open(dirname(path), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600) : -1;
    free(path);
    return fd;
}

int karst_points_scratch(const points_import *import, karst_error *error)
{
    char *name = NULL;
    int fd = open_nameless(import->config->output);
    if (fd >= 0)
        return fd;
    fd = karst_points_scratch_with_name(import, &name, error);
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
