/* A text that grows. Not for user text: what is added comes from Karst itself. */
#ifndef KARST_LANGUAGE_EMIT_TEXT_H
#define KARST_LANGUAGE_EMIT_TEXT_H

#include <stdbool.h>
#include <stddef.h>

typedef struct {
    char *bytes; /* malloc'ed, NUL-terminated; NULL until something is added */
    size_t length, room;
    bool failed; /* memory ran out: what is added from then on is dropped */
} karst_text;

void karst_text_add(karst_text *text, const char *format, ...) __attribute__((format(printf, 2, 3)));
void karst_text_finish(karst_text *text);

#endif
