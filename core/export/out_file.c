#include "core/export/out_file.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { COPY_BYTES = 1 << 20 };

/* A new file beside `path`, open for both; its name goes to `name`. */
static int create_beside(const char *path, char name[PATH_MAX])
{
    static atomic_uint counter;
    const char *slash = strrchr(path, '/');
    const int folder_length = slash ? (int)(slash - path + 1) : 0;
    for (int attempt = 0; attempt < 100; attempt++) {
        const int length = snprintf(name, PATH_MAX, "%.*s.karst-%ld-out-%u.tmp", folder_length, path, (long)getpid(),
                                    atomic_fetch_add(&counter, 1));
        if (length < 0 || length >= PATH_MAX) {
            errno = ENAMETOOLONG;
            return -1;
        }
        const int fd = open(name, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (fd >= 0 || errno != EEXIST)
            return fd;
    }
    return -1;
}

static bool is_special(const char *path)
{
    struct stat status;
    return stat(path, &status) == 0 && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode);
}

FILE *karst_out_part(const char *path)
{
    char name[PATH_MAX];
    if (is_special(path)) /* beside a device there may be no room */
        return tmpfile();
    const int fd = create_beside(path, name);
    if (fd < 0)
        return NULL;
    unlink(name);
    FILE *file = fdopen(fd, "w+b");
    if (!file) {
        const int reason = errno;
        close(fd);
        errno = reason;
    }
    return file;
}

/* false with errno, which is ECANCELED if it was stopped. */
static bool copy_parts(FILE *to, FILE *const *parts, int num_parts, bool (*progress)(void *user), void *user)
{
    char *buffer = malloc(COPY_BYTES);
    bool done = buffer;
    for (int i = 0; i < num_parts && done; i++) {
        done = fflush(parts[i]) == 0 && fseeko(parts[i], 0, SEEK_SET) == 0;
        for (size_t num; done && (num = fread(buffer, 1, COPY_BYTES, parts[i])) > 0;) {
            done = fwrite(buffer, 1, num, to) == num;
            if (done && progress && !progress(user)) {
                errno = ECANCELED;
                done = false;
            }
        }
        done = done && !ferror(parts[i]);
    }
    const int reason = errno;
    free(buffer);
    errno = reason;
    return done;
}

bool karst_out_assemble(const char *path, const void *header, size_t header_bytes, FILE *const *parts, int num_parts,
                        bool (*progress)(void *user), void *user, karst_error *error)
{
    char name[PATH_MAX] = "";
    const bool special = is_special(path);
    errno = 0;
    const int fd = special ? open(path, O_WRONLY | O_CLOEXEC) : create_beside(path, name);
    FILE *file = fd >= 0 ? fdopen(fd, "wb") : NULL;
    bool done = file && fwrite(header, 1, header_bytes, file) == header_bytes &&
                copy_parts(file, parts, num_parts, progress, user);
    int reason = errno;
    if (file && fclose(file) != 0 && done) {
        reason = errno;
        done = false;
    } else if (!file && fd >= 0) {
        close(fd);
    }
    if (done && !special && rename(name, path) != 0) {
        reason = errno;
        done = false;
    }
    if (!done && *name)
        unlink(name);
    if (!done && reason == ECANCELED)
        return karst_fail(error, KARST_FAILED, "%s was not written: it was stopped", path);
    return done || karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, strerror(reason ? reason : EIO));
}
