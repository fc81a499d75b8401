#include "producers/language/base/source.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define SHOWN_COLUMNS 100u /* of a long source line */

/* The length of the UTF-8 sequence at s, or 0 if it is none (overlong forms, surrogates and what lies beyond U+10FFFF
 * included). */
static size_t utf8_length(const unsigned char *s, size_t left)
{
    if (s[0] < 0x80)
        return 1;
    size_t n = s[0] >= 0xf0 ? 4 : s[0] >= 0xe0 ? 3 : 2;
    if (s[0] < 0xc2 || s[0] > 0xf4 || n > left)
        return 0;
    for (size_t i = 1; i < n; i++)
        if ((s[i] & 0xc0) != 0x80)
            return 0;
    bool bad = (s[0] == 0xe0 && s[1] < 0xa0) || (s[0] == 0xed && s[1] > 0x9f) || (s[0] == 0xf0 && s[1] < 0x90) ||
               (s[0] == 0xf4 && s[1] > 0x8f);
    return bad ? 0 : n;
}

void karst_source_init(karst_source *source, karst_arena *arena, jmp_buf *escape, const char *name, const char *prelude,
                       const char *text, size_t length)
{
    *source = (karst_source){.arena = arena, .escape = escape, .text = "", .name = "world"};
    source->name = karst_format(arena, "%s", name);
    if (length > KARST_SOURCE_MAX_BYTES)
        karst_source_error(source, 0, NULL, "the file has %zu bytes; a world may have %zu", length,
                           KARST_SOURCE_MAX_BYTES);
    size_t before = strlen(prelude);
    char *copy = karst_arena_alloc(arena, before + length + 1);
    memcpy(copy, prelude, before);
    if (length)
        memcpy(copy + before, text, length);
    source->text = copy;
    source->user_begin = (uint32_t)before;
    source->length = (uint32_t)(before + length);
    if (length >= 3 && !memcmp(text, "\xef\xbb\xbf", 3))
        memcpy(copy + before, "   ", 3); /* a byte order mark is white space */
    bool blank = true;
    for (size_t i = before; i < source->length;) {
        size_t n = utf8_length((const unsigned char *)copy + i, source->length - i);
        if (!copy[i])
            karst_source_error(source, (uint32_t)i, "save it as plain text",
                               "the file holds a NUL byte; a world is text");
        if (!n)
            karst_source_error(source, (uint32_t)i, "save it as UTF-8", "the file is not UTF-8 here (byte 0x%02x)",
                               (unsigned char)copy[i]);
        blank &= (unsigned char)copy[i] <= ' ';
        i += n;
    }
    if (blank)
        karst_source_error(source, (uint32_t)before, "a world needs a function `float density(vec3 p)`",
                           "the file is empty");
}

static char *format_list(karst_arena *arena, const char *format, va_list list)
{
    va_list again;
    va_copy(again, list);
    int n = vsnprintf(NULL, 0, format, again);
    va_end(again);
    char *text = karst_arena_alloc(arena, (size_t)(n > 0 ? n : 0) + 1);
    vsnprintf(text, (size_t)n + 1, format, list);
    return text;
}

char *karst_format(karst_arena *arena, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    char *text = format_list(arena, format, list);
    va_end(list);
    return text;
}

/* Bounds of the line that holds `where`, without its end. */
static void find_line(const karst_source *source, uint32_t where, uint32_t *begin, uint32_t *end)
{
    uint32_t low = where >= source->user_begin ? source->user_begin : 0;
    *begin = where;
    while (*begin > low && source->text[*begin - 1] != '\n')
        --*begin;
    *end = where;
    while (*end < source->length && source->text[*end] != '\n')
        ++*end;
    if (*end > *begin && source->text[*end - 1] == '\r')
        --*end;
}

void karst_source_place(const karst_source *source, uint32_t where, uint32_t *line, uint32_t *column)
{
    uint32_t begin, end;
    find_line(source, where, &begin, &end);
    *line = 1;
    for (uint32_t i = where >= source->user_begin ? source->user_begin : 0; i < begin; i++)
        *line += source->text[i] == '\n';
    *column = 1;
    for (uint32_t i = begin; i < where; i++)
        *column += ((unsigned char)source->text[i] & 0xc0) != 0x80;
}

/* How long the character is that must not be shown as it is; 0: it may be. */
static size_t hidden_length(const unsigned char *c)
{
    if (c[0] < ' ' || c[0] == 127)
        return 1;
    if (c[0] == 0xc2 && c[1] >= 0x80 && c[1] < 0xa0)
        return 2;
    /* U+200E, U+200F, U+202A to U+202E, U+2066 to U+2069 */
    bool is_mark =
        c[0] == 0xe2 && ((c[1] == 0x80 && (c[2] == 0x8e || c[2] == 0x8f || (c[2] >= 0xaa && c[2] <= 0xae))) ||
                         (c[1] == 0x81 && c[2] >= 0xa6 && c[2] <= 0xa9));
    return is_mark ? 3 : 0;
}

void karst_source_plain(char *text)
{
    char *to = text;
    while (*text) {
        size_t length = hidden_length((const unsigned char *)text);
        *to++ = !length ? *text : *text == '\t' || *text == '\n' || *text == '\r' ? ' ' : '?';
        text += length ? length : 1;
    }
    *to = 0;
}

/* The source line and a caret below it, two spaces in; a window of it if it is long. */
static const char *show_line(const karst_source *source, uint32_t where)
{
    uint32_t begin, end;
    find_line(source, where, &begin, &end);
    if (where - begin > SHOWN_COLUMNS * 3 / 4) {
        begin = where - SHOWN_COLUMNS / 2;
        while (((unsigned char)source->text[begin] & 0xc0) == 0x80)
            begin++;
    }
    if (end - begin > SHOWN_COLUMNS) {
        end = begin + SHOWN_COLUMNS;
        while (((unsigned char)source->text[end] & 0xc0) == 0x80)
            end--;
    }
    char line[SHOWN_COLUMNS + 1], caret[SHOWN_COLUMNS + 1];
    size_t n = 0, before = 0;
    for (uint32_t i = begin; i < end; i++) {
        unsigned char c = (unsigned char)source->text[i];
        line[n++] = c ? (char)c : '?';
        before += i < where && (c & 0xc0) != 0x80;
    }
    line[n] = 0;
    /* Bytes that are not UTF-8 (there is at most one such line) are not passed on. */
    for (size_t i = 0; i < n;) {
        size_t step = utf8_length((unsigned char *)line + i, n - i);
        if (!step) {
            line[i] = '?';
            step = 1;
        }
        i += step;
    }
    karst_source_plain(line);
    if (!line[strspn(line, " ")])
        return "";
    memset(caret, ' ', before);
    caret[before] = '^';
    caret[before + 1 <= SHOWN_COLUMNS ? before + 1 : SHOWN_COLUMNS] = 0;
    return karst_format(source->arena, "\n  %s\n  %s", line, caret);
}

static void report(karst_source *source, uint32_t where, bool is_error, const char *hint, char *message)
{
    karst_source_plain(message);
    if (where < source->user_begin && source->blame)
        where = source->blame;
    karst_diagnostic *d = karst_arena_alloc(source->arena, sizeof *d);
    d->is_error = is_error;
    d->message = message;
    d->hint = hint ? karst_format(source->arena, "%s", hint) : NULL;
    karst_source_place(source, where, &d->line, &d->column);
    d->text = karst_format(source->arena, "%s:%u:%u: %s: %s%s%s%s", source->name, d->line, d->column,
                           is_error ? "error" : "warning", message, show_line(source, where), hint ? "\n  " : "",
                           hint ? hint : "");
    if (source->last)
        source->last->next = d;
    else
        source->first = d;
    source->last = d;
}

void karst_source_error(karst_source *source, uint32_t where, const char *hint, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    char *message = format_list(source->arena, format, list);
    va_end(list);
    report(source, where, true, hint, message);
    longjmp(*source->escape, 1);
}

void karst_source_warn(karst_source *source, uint32_t where, const char *hint, const char *format, ...)
{
    if (source->num_warnings >= KARST_MAX_WARNINGS)
        return;
    source->num_warnings++;
    va_list list;
    va_start(list, format);
    char *message = format_list(source->arena, format, list);
    va_end(list);
    report(source, where, false, hint, message);
}

#define EDIT 2u /* a letter more, less or another */
#define SWAP 1u /* of neighbours: all letters are there, so it is the likelier slip */

karst_nearest karst_nearest_begin(const char *wanted, size_t length)
{
    const unsigned num_edits = length < 4 ? 1 : length < 8 ? 2 : 3; /* at most */
    return (karst_nearest){.wanted = wanted, .wanted_length = length, .distance = num_edits * EDIT + 1};
}

/* Levenshtein's distance, with swaps of neighbours; names longer than the table are far from everything. */
static unsigned edit_distance(const char *a, size_t na, const char *b, size_t nb)
{
    enum { MAX = 40 };
    if (na >= MAX || nb >= MAX)
        return MAX * EDIT;
    unsigned char row[3][MAX + 1];
    for (size_t j = 0; j <= nb; j++)
        row[0][j] = (unsigned char)(j * EDIT);
    for (size_t i = 1; i <= na; i++) {
        unsigned char *now = row[i % 3], *last = row[(i + 2) % 3], *before = row[(i + 1) % 3];
        now[0] = (unsigned char)(i * EDIT);
        for (size_t j = 1; j <= nb; j++) {
            unsigned best = last[j - 1] + (a[i - 1] != b[j - 1] ? EDIT : 0);
            if (last[j] + EDIT < best)
                best = last[j] + EDIT;
            if (now[j - 1] + EDIT < best)
                best = now[j - 1] + EDIT;
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] && before[j - 2] + SWAP < best)
                best = before[j - 2] + SWAP;
            now[j] = (unsigned char)best;
        }
    }
    return row[na % 3][nb];
}

void karst_nearest_offer(karst_nearest *nearest, const char *name)
{
    unsigned d = edit_distance(nearest->wanted, nearest->wanted_length, name, strlen(name));
    if (d < nearest->distance) {
        nearest->distance = d;
        nearest->best = name;
    }
}

const char *karst_nearest_hint(const karst_nearest *nearest, karst_arena *arena)
{
    return nearest->best ? karst_format(arena, "did you mean '%s'?", nearest->best) : NULL;
}
