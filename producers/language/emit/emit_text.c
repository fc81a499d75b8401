#include "producers/language/emit/emit_text.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

static bool make_room(karst_text *text, size_t more)
{
    if (text->length + more < text->room)
        return true;
    size_t room = 2 * (text->length + more) + 1024;
    char *bytes = realloc(text->bytes, room);
    if (!bytes) {
        text->failed = true;
        return false;
    }
    text->bytes = bytes;
    text->room = room;
    return true;
}

void karst_text_add(karst_text *text, const char *format, ...)
{
    if (text->failed || !make_room(text, 256))
        return;
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    size_t room = text->room - text->length;
    int length = vsnprintf(text->bytes + text->length, room, format, arguments);
    if (length >= 0 && (size_t)length >= room && make_room(text, (size_t)length + 1))
        length = vsnprintf(text->bytes + text->length, text->room - text->length, format, again);
    va_end(again);
    va_end(arguments);
    if (length < 0)
        text->failed = true;
    if (!text->failed)
        text->length += (size_t)length;
}

void karst_text_finish(karst_text *text)
{
    free(text->bytes);
    *text = (karst_text){0};
}
