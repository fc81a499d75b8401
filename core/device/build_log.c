/* Places in the logs of compilers that do not read #line. */
#include "core/device/build_log.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char unnamed[] = "<kernel>:";

typedef struct {
    const char *file; /* in the text; NULL before the first directive */
    int file_length;
    long line;
} place;

/* The file and line of the text's `number`th line, from 1. */
static place find_place(const char *source, long number)
{
    place at = {NULL, 0, 1};
    for (long i = 1; *source; i++) {
        long line;
        int name_at = 0;
        if (sscanf(source, "#line %ld \"%n", &line, &name_at) == 1 && name_at > 0) {
            at = (place){source + name_at, (int)strcspn(source + name_at, "\"\n"), line};
        } else if (i >= number) {
            break;
        } else {
            at.line++;
        }
        source += strcspn(source, "\n");
        source += *source == '\n';
    }
    return at;
}

char *karst_build_log_with_places(const char *log, const char *source)
{
    char *text = NULL;
    size_t size_bytes;
    FILE *to = open_memstream(&text, &size_bytes);
    if (!to)
        return NULL;
    while (*log) {
        char *end = NULL;
        long number = strncmp(log, unnamed, sizeof unnamed - 1) ? 0 : strtol(log + sizeof unnamed - 1, &end, 10);
        place at = number > 0 && *end == ':' ? find_place(source, number) : (place){0};
        if (at.file) {
            fprintf(to, "%.*s:%ld", at.file_length, at.file, at.line);
            log = end;
        }
        size_t length = strcspn(log, "\n");
        length += log[length] == '\n';
        fwrite(log, 1, length, to);
        log += length;
    }
    if (fclose(to) == 0)
        return text;
    free(text);
    return NULL;
}
