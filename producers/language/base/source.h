/* The text of a world, places in it, and what is said about them.
 *
 * The prelude and the user's text lie one behind the other, so that a place is one number: a byte offset. The first
 * error ends the compilation (by longjmp to where it began); warnings pile up. */
#ifndef KARST_LANGUAGE_SOURCE_H
#define KARST_LANGUAGE_SOURCE_H

#include <setjmp.h>
#include <stdbool.h>
#include <stdint.h>

#include "producers/language/base/arena.h"

#define KARST_SOURCE_MAX_BYTES ((size_t)1 << 20)
#define KARST_MAX_WARNINGS 32u

typedef struct karst_diagnostic karst_diagnostic;
struct karst_diagnostic {
    karst_diagnostic *next;
    bool is_error;
    uint32_t line, column; /* from 1; columns count characters */
    const char *message;   /* one line, no full stop */
    const char *hint;      /* what to write instead; NULL if there is nothing to say */
    /* The whole, for people, no newline at its end:
     *   NAME:LINE:COLUMN: error: MESSAGE
     *     the source line
     *         ^
     *     HINT                                                            */
    const char *text;
};

typedef struct {
    karst_arena *arena;
    const char *name;    /* of the file, for messages */
    const char *text;    /* prelude, then the user's text, then a NUL */
    uint32_t user_begin; /* where the user's text begins */
    uint32_t length;     /* of all */
    uint32_t blame;      /* the place in the user's text that the prelude works for: pointed at in its stead */
    karst_diagnostic *first, *last;
    uint32_t num_warnings;
    bool is_data_error; /* what ended it is not the text's fault, but that of a file which it names */
    jmp_buf *escape;
} karst_source;

/* Takes out of a text, in place, what a terminal would obey and what turns writing around: control characters (blanks
 * for tabs and line ends) and marks of direction become '?'. UTF-8 stays UTF-8. */
void karst_source_plain(char *text);

/* Copies both texts. Errors (reported through the source itself): too large, not UTF-8, a NUL byte, empty. */
void karst_source_init(karst_source *source, karst_arena *arena, jmp_buf *escape, const char *name, const char *prelude,
                       const char *text, size_t length);

/* `hint` may be NULL; it is copied. */
_Noreturn void karst_source_error(karst_source *source, uint32_t where, const char *hint, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
void karst_source_warn(karst_source *source, uint32_t where, const char *hint, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
/* Line and column, from 1, of a place in the user's text. */
void karst_source_place(const karst_source *source, uint32_t where, uint32_t *line, uint32_t *column);

/* printf into the arena. */
char *karst_format(karst_arena *arena, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Finds the name nearest to a misspelt one. Start with best = NULL. */
typedef struct {
    const char *wanted, *best;
    size_t wanted_length;
    unsigned distance;
} karst_nearest;
karst_nearest karst_nearest_begin(const char *wanted, size_t length);
void karst_nearest_offer(karst_nearest *nearest, const char *name);
/* "did you mean 'noise'?", or NULL if nothing is near. */
const char *karst_nearest_hint(const karst_nearest *nearest, karst_arena *arena);

#endif
