#include "core/export/out_file.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { COPY_BYTES = 1 << 18 };

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

/* ---- in memory while they are short ---- */

enum { SHORT_BYTES = 32 << 20, FIRST_BYTES = 1 << 20 };

typedef struct {
    char *path;
    char *bytes; /* until there is a file */
    size_t num, room, at; /* where it is read */
    FILE *file;
} short_part;

/* What is in memory goes to a file. */
static bool to_file(short_part *part)
{
    part->file = karst_out_part(part->path);
    if (!part->file || fwrite(part->bytes, 1, part->num, part->file) != part->num)
        return false;
    free(part->bytes);
    part->bytes = NULL;
    return true;
}

static ssize_t write_short(void *cookie, const char *bytes, size_t num)
{
    short_part *part = cookie;
    size_t room = part->room ? part->room : FIRST_BYTES;
    if (!part->file && num > SHORT_BYTES - part->num && !to_file(part))
        return 0;
    if (part->file)
        return (ssize_t)fwrite(bytes, 1, num, part->file);
    while (room < part->num + num)
        room *= 2;
    if (room > part->room) {
        char *larger = realloc(part->bytes, room);
        if (!larger)
            return 0;
        part->bytes = larger;
        part->room = room;
    }
    memcpy(part->bytes + part->num, bytes, num);
    part->num += num;
    return (ssize_t)num;
}

static ssize_t read_short(void *cookie, char *bytes, size_t num)
{
    short_part *part = cookie;
    if (part->file) {
        const size_t some = fread(bytes, 1, num, part->file);
        return some == 0 && ferror(part->file) ? -1 : (ssize_t)some;
    }
    num = num < part->num - part->at ? num : part->num - part->at;
    if (num)
        memcpy(bytes, part->bytes + part->at, num);
    part->at += num;
    return (ssize_t)num;
}

/* To the beginning alone. */
static int seek_short(void *cookie, off64_t *offset, int whence)
{
    short_part *part = cookie;
    if (whence != SEEK_SET || *offset != 0 || (part->file && fseeko(part->file, 0, SEEK_SET) != 0))
        return -1;
    part->at = 0;
    return 0;
}

static int close_short(void *cookie)
{
    short_part *part = cookie;
    const int failed = part->file ? fclose(part->file) : 0;
    free(part->bytes);
    free(part->path);
    free(part);
    return failed;
}

FILE *karst_out_short_part(const char *path)
{
    const cookie_io_functions_t functions = {read_short, write_short, seek_short, close_short};
    short_part *part = calloc(1, sizeof *part);
    FILE *file = part && (part->path = strdup(path)) ? fopencookie(part, "w+b", functions) : NULL;
    if (!file && part) {
        free(part->path);
        free(part);
    }
    return file;
}

/* ---- the whole ---- */

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
