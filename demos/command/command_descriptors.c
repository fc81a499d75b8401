/* Descriptors that can be relied on. */
#include "command.h"

#include <errno.h>
#include <fcntl.h>
#include <unistd.h>

void command_open_descriptors(void)
{
    /* Else the next file opened becomes stdout. Whoever then reads or writes there is told that it cannot be done. */
    static const int modes[] = {O_WRONLY, O_RDONLY, O_WRONLY};
    for (int fd = 0; fd < 3; fd++)
        if (fcntl(fd, F_GETFD) < 0 && errno == EBADF && open("/dev/null", modes[fd]) < 0)
            (void)!open("/", O_RDONLY);
}

bool command_can_write_stdout(void)
{
    int flags = fcntl(STDOUT_FILENO, F_GETFL);
    return flags >= 0 && (flags & O_ACCMODE) != O_RDONLY;
}

bool command_can_read_stdin(void)
{
    int flags = fcntl(STDIN_FILENO, F_GETFL);
    return flags >= 0 && (flags & O_ACCMODE) != O_WRONLY;
}

bool command_write_all(int fd, const void *data, size_t size_bytes)
{
    const char *rest = data;
    while (size_bytes) {
        ssize_t written = write(fd, rest, size_bytes);
        if (written < 0 && errno == EINTR)
            continue;
        if (written <= 0)
            return false;
        rest += written;
        size_bytes -= (size_t)written;
    }
    return true;
}
