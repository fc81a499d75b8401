/* A log that keeps its lines: see core/base/log_later.h. */
#include "core/base/log_later.h"

#include <stdlib.h>
#include <string.h>

typedef struct karst_log_line {
    struct karst_log_line *next;
    karst_log_level level;
    char text[];
} karst_log_line;

static void keep(void *user, karst_log_level level, const char *text)
{
    karst_log_later *later = user;
    size_t size_bytes = strlen(text) + 1;
    karst_log_line *line = malloc(sizeof *line + size_bytes);
    if (!line)
        return;
    line->next = NULL;
    line->level = level;
    memcpy(line->text, text, size_bytes);
    *later->end = line;
    later->end = &line->next;
}

void karst_log_later_init(karst_log_later *later, const karst_log *log)
{
    *later = (karst_log_later){.end = &later->first};
    if (log && log->write)
        later->log = (karst_log){.write = keep, .user = later, .max_level = log->max_level};
}

void karst_log_later_say(karst_log_later *later, const karst_log *log)
{
    for (karst_log_line *line = later->first, *next; line; line = next) {
        next = line->next;
        karst_log_print(log, line->level, "%s", line->text);
        free(line);
    }
    later->first = NULL;
    later->end = &later->first;
}
