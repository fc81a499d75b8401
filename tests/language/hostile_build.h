/* How a hostile text is made from its line in hostile_texts.h. */
#ifndef KARST_TESTS_LANGUAGE_HOSTILE_BUILD_H
#define KARST_TESTS_LANGUAGE_HOSTILE_BUILD_H

#include <stdio.h>
#include <string.h>

#include "tests/language/hostile_texts.h"

#define HOSTILE_MAX_BYTES ((size_t)8 << 20)

typedef struct {
    char *text;
    size_t length;
} built;

static void add(built *b, const char *text, size_t length)
{
    memcpy(b->text + b->length, text, length);
    b->length += length;
}

static void add_units(built *b, const char *unit, int count)
{
    for (int i = 0; i < count; i++)
        for (const char *c = unit; *c; c++) {
            char number[16];
            if (*c == '#' && strncmp(c, "#define", 7) && strncmp(c, "#if", 3) && strncmp(c, "#include", 8))
                add(b, number, (size_t)sprintf(number, "%d", i + 1));
            else if (*c == '~')
                add(b, number, (size_t)sprintf(number, "%d", i));
            else
                add(b, c, 1);
        }
}

/* Fills `b`, which has room, with a text. */
static void build(built *b, const hostile_text *t)
{
    b->length = 0;
    add(b, t->head, strlen(t->head));
    add_units(b, t->unit, t->count);
    add(b, t->middle, strlen(t->middle));
    add_units(b, t->unit2, t->count2);
    add(b, t->tail, strlen(t->tail));
}

#endif
