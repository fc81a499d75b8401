/* Errors: see karst/error.h. */
#include "karst/error.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* Keeps the promise of one line: control characters become spaces, the end is trimmed. */
static void make_one_line(char *text)
{
    size_t length = 0;
    for (; text[length]; length++) {
        unsigned char c = (unsigned char)text[length];
        if (c < 0x20 || c == 0x7f)
            text[length] = ' ';
    }
    while (length > 0 && text[length - 1] == ' ')
        text[--length] = 0;
}

/* Ends a message that did not fit in "...", without cutting a UTF-8 sequence in two. */
static void mark_cut(char *text, size_t size_bytes)
{
    size_t end = size_bytes - 4;
    while (end > 0 && ((unsigned char)text[end] & 0xc0) == 0x80)
        end--;
    memcpy(text + end, "...", 4);
}

int karst_fail(karst_error *error, karst_status status, const char *format, ...)
{
    if (!error || error->status != KARST_OK)
        return 0;
    error->status = status == KARST_OK ? KARST_FAILED : status;
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(error->message, sizeof(error->message), format, arguments);
    va_end(arguments);
    if (length < 0)
        snprintf(error->message, sizeof(error->message), "%s", format);
    else if ((size_t)length >= sizeof(error->message))
        mark_cut(error->message, sizeof(error->message));
    make_one_line(error->message);
    return 0;
}
