/* A world from stdin: the engine, its helper process and the viewer read files. */
#include "command.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

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

bool command_read_stdin(char *world, size_t size_bytes, karst_error *error)
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
