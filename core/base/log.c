/* Logging: see karst/log.h. */
#include "karst/log.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A sink gets single lines; empty ones tell nothing. */
static void write_lines(const karst_log *log, karst_log_level level, char *text)
{
    for (char *line = text; line;) {
        char *end = strchr(line, '\n');
        if (end)
            *end = 0;
        size_t length = strlen(line);
        if (length > 0 && line[length - 1] == '\r')
            line[length - 1] = 0;
        if (*line)
            log->write(log->user, level, line);
        line = end ? end + 1 : NULL;
    }
}

void karst_log_print(const karst_log *log, karst_log_level level, const char *format, ...)
{
    if (!log || !log->write || level > log->max_level)
        return;
    char small[512];
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    int length = vsnprintf(small, sizeof(small), format, arguments);
    char *large = NULL;
    if (length >= (int)sizeof(small)) {
        large = malloc((size_t)length + 1);
        if (large)
            vsnprintf(large, (size_t)length + 1, format, again);
    }
    va_end(again);
    va_end(arguments);
    if (length >= 0)
        write_lines(log, level, large ? large : small); /* out of memory: the part that fits */
    free(large);
}
