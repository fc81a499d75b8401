/* Files of points: what all readers stand on. */
#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "core/files/point_source_internal.h"

bool karst_point_source_complain(const karst_point_source *source, karst_error *error, const char *format, ...)
{
    char what[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    if (ferror(source->file))
        return karst_fail(error, KARST_BAD_DATA, "%s: cannot be read beyond byte %llu: %s", source->name,
                          (unsigned long long)source->offset, strerror(errno));
    if (source->line)
        return karst_fail(error, KARST_BAD_DATA, "%s:%llu: %s", source->name, (unsigned long long)source->line, what);
    return karst_fail(error, KARST_BAD_DATA, "%s: byte %llu: %s", source->name, (unsigned long long)source->offset,
                      what);
}

/* Moves what is left to the front and reads on. */
static void fill(karst_point_source *source)
{
    memmove(source->buffer, source->buffer + source->begin, source->end - source->begin);
    source->end -= source->begin;
    source->begin = 0;
    source->end += fread(source->buffer + source->end, 1, sizeof source->buffer - source->end, source->file);
}

const uint8_t *karst_point_source_bytes(karst_point_source *source, size_t num)
{
    if (source->end - source->begin < num)
        fill(source);
    if (source->end - source->begin < num)
        return NULL;
    const uint8_t *bytes = source->buffer + source->begin;
    source->begin += num;
    source->offset += num;
    return bytes;
}

bool karst_point_source_line(karst_point_source *source, bool *has_line, karst_error *error)
{
    if (source->end - source->begin < sizeof source->text)
        fill(source);
    const char *bytes = (const char *)source->buffer + source->begin;
    size_t left = source->end - source->begin, most = left < sizeof source->text ? left : sizeof source->text;
    source->line++;
    *has_line = left > 0;
    if (!left)
        return true;
    const char *end = memchr(bytes, '\n', most);
    size_t length = end ? (size_t)(end - bytes) : most;
    if (!end && left >= sizeof source->text)
        return karst_point_source_complain(source, error, "a line of more than %u bytes: this is no text of points",
                                           KARST_POINTS_MAX_LINE_BYTES);
    if (memchr(bytes, '\0', length))
        return karst_point_source_complain(source, error, "a byte of zero: this is no text");
    memcpy(source->text, bytes, length);
    source->text[length] = '\0';
    size_t used = length + (end != NULL);
    source->begin += used;
    source->offset += used;
    if (length && source->text[length - 1] == '\r')
        source->text[length - 1] = '\0';
    return true;
}

int karst_point_source_numbers(const char *text, double *numbers, int most)
{
    int num = 0;
    while (num < most) {
        text += strspn(text, " \t,;");
        char *end;
        double value = *text ? strtod(text, &end) : 0;
        if (!*text || end == text || (*end && !strchr(" \t,;", *end)))
            break;
        numbers[num++] = value;
        text = end;
    }
    return num;
}
