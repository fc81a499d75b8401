/* Which file is meant: what comes with Karst goes by its name, and everything else by a path. */
#include "command.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MAX_NAMES 64

/* `kind` as karst_data_find takes it, `one` of it as people say it. */
static bool find(const char *kind, const char *one, const char *suffix, karst_status otherwise, const char *name,
                 char *path, size_t size_bytes, karst_error *error)
{
    if (karst_data_find(kind, name, suffix, path, size_bytes, NULL))
        return true;
    char names[MAX_NAMES][KARST_DATA_NAME_BYTES], list[MAX_NAMES * (KARST_DATA_NAME_BYTES + 2)] = "none";
    const char *pointers[MAX_NAMES + 1] = {NULL};
    size_t num_names = karst_data_list(kind, suffix, names, MAX_NAMES);
    for (size_t i = 0, length = 0; i < num_names; length = strlen(list), i++) {
        snprintf(list + length, sizeof list - length, "%s%s", i ? ", " : "", names[i]);
        pointers[i] = names[i];
    }
    const char *nearest = command_nearest(name, pointers);
    char suggestion[KARST_DATA_NAME_BYTES + 32] = "there";
    if (nearest)
        snprintf(suggestion, sizeof suggestion, "did you mean '%s'? There", nearest);
    return karst_fail(error, otherwise, "no %s is called '%.60s' (a file's name has a / or ends in %s); %s are: %s",
                      one, name, suffix, suggestion, list);
}

/* ---- a world from stdin ---- */

#define MAX_TEXT_BYTES ((size_t)16 << 20) /* a world's text may be much shorter */

static char stdin_folder[PATH_MAX], stdin_file[PATH_MAX + 16];

static void remove_stdin_file(void)
{
    unlink(stdin_file);
    rmdir(stdin_folder);
}

/* All of it into a file of a folder of its own; false with errno. */
static bool copy_stdin(int fd)
{
    char buffer[65536];
    size_t sum = 0;
    for (ssize_t n; (n = read(STDIN_FILENO, buffer, sizeof buffer)) != 0;) {
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0 || !command_write_all(fd, buffer, (size_t)n))
            return false;
        sum += (size_t)n;
        if (sum > MAX_TEXT_BYTES) {
            errno = EFBIG;
            return false;
        }
    }
    return true;
}

/* The engine, its helper process and the viewer read files. */
static bool read_stdin(char *world, size_t size_bytes, karst_error *error)
{
    const char *folder = getenv("TMPDIR");
    if (!command_can_read_stdin())
        return karst_fail(error, KARST_USAGE, "-: stdin is closed; name a world or its file");
    if (isatty(STDIN_FILENO))
        return karst_fail(error, KARST_USAGE, "-: a world is read from stdin, which is a terminal; for example karst "
                                              "render - < mine.karst");
    if (!*stdin_file) {
        if (snprintf(stdin_folder, sizeof stdin_folder, "%s/karst-XXXXXX", folder && *folder ? folder : "/tmp") >=
                (int)sizeof stdin_folder ||
            !mkdtemp(stdin_folder))
            return karst_fail(error, KARST_FAILED, "-: cannot make %s: %s; set TMPDIR", stdin_folder, strerror(errno));
        snprintf(stdin_file, sizeof stdin_file, "%s/stdin.karst", stdin_folder);
        int fd = open(stdin_file, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
        command_add_temporary(stdin_file);
        command_add_temporary(stdin_folder);
        atexit(remove_stdin_file);
        bool copied = fd >= 0 && copy_stdin(fd);
        int reason = errno;
        if (fd >= 0)
            close(fd);
        if (!copied)
            return karst_fail(error, KARST_BAD_WORLD, "-: cannot read a world from stdin: %s", strerror(reason));
    }
    return snprintf(world, size_bytes, "%s", stdin_file) < (int)size_bytes ||
           karst_fail(error, KARST_FAILED, "-: the name %.60s... is too long; set TMPDIR", stdin_file);
}

const char *command_stdin_file(void) { return stdin_file; }

bool command_find_world(const char *name, char *world, size_t size_bytes, karst_error *error)
{
    if (strcmp(name, "-") == 0)
        return read_stdin(world, size_bytes, error);
    if (karst_saved_is_name(name))
        return karst_fail(error, KARST_USAGE, "%s: a saved world cannot be used for this; its world can", name);
    return find("worlds", "world", ".karst", KARST_BAD_WORLD, name, world, size_bytes, error);
}

bool command_find_path(const char *name, char *path, size_t size_bytes, karst_error *error)
{
    return find("paths", "path", ".json", KARST_BAD_DATA, name, path, size_bytes, error);
}
