/* Kernel sources: see core/device/source.h.
 *
 * OpenCL drivers know no files of ours, so includes are resolved here, by text. A full preprocessor is not needed: the
 * compiler evaluates every #if itself. Only two things must be known: what is comment, and which #if an include stands
 * in. */
#include "core/device/source.h"
#include "core/device/embedded.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_DEPTH 32               /* of includes in includes */
#define MAX_PATH 200               /* of one source */
#define MAX_FILE_BYTES (16u << 20) /* of a file in $KARST_KERNEL_DIR */
#define MAX_PROGRAM_BYTES (64u << 20)

typedef struct {
    char path[MAX_PATH + 1];
} source_path;

typedef struct {
    const karst_virtual_file *files;
    size_t num_files;
    char *text; /* what is put together so far */
    size_t length, capacity;
    source_path *seen; /* files that are in it for certain, or being read */
    size_t num_seen, seen_capacity;
    karst_error *error;
} expansion;

/* One open #if of a file. */
typedef struct {
    size_t num_seen; /* what was seen when its branch began; an include inside is not certain outside */
    bool is_guard;   /* the #ifndef around a whole file: as good as no condition */
    char macro[64];  /* that it tests, if it may become the guard */
} condition;

/* Where reading stands in one file. */
typedef struct {
    const char *path;
    unsigned line;
    bool in_comment;
    unsigned num_directives;
    condition *conditions;
    size_t num_conditions, capacity;
} reader;

static bool out_of_memory(expansion *e) { return karst_fail(e->error, KARST_FAILED, "out of memory"); }

static bool append(expansion *e, const char *text, size_t length)
{
    if (length > MAX_PROGRAM_BYTES - e->length)
        return karst_fail(e->error, KARST_FAILED, "a kernel program grows beyond %u MiB", MAX_PROGRAM_BYTES >> 20);
    if (e->length + length + 1 > e->capacity) {
        size_t capacity = (e->length + length + 1) * 2;
        char *grown = realloc(e->text, capacity);
        if (!grown)
            return out_of_memory(e);
        e->text = grown;
        e->capacity = capacity;
    }
    memcpy(e->text + e->length, text, length);
    e->length += length;
    e->text[e->length] = 0;
    return true;
}

static bool append_line_directive(expansion *e, unsigned line, const char *path)
{
    char text[MAX_PATH + 40];
    int length = snprintf(text, sizeof(text), "#line %u \"%s\"\n", line, path);
    return append(e, text, (size_t)length);
}

/* Paths are relative to the repository's root, plain, and never leave it. */
static bool path_is_plain(const char *path)
{
    size_t length = strlen(path);
    if (length == 0 || length > MAX_PATH || path[0] == '/' || path[length - 1] == '/')
        return false;
    for (const char *part = path; part;) {
        size_t n = strcspn(part, "/");
        if (n == 0 || (n == 1 && part[0] == '.') || (n == 2 && part[0] == '.' && part[1] == '.'))
            return false;
        part = part[n] ? part + n + 1 : NULL;
    }
    for (const char *c = path; *c; c++)
        if (*c == '"' || *c == '\\' || iscntrl((unsigned char)*c))
            return false;
    return true;
}

/* Reads a file of $KARST_KERNEL_DIR; *text stays NULL if there is none of that name. */
static bool read_kernel_dir(expansion *e, const char *path, char **text)
{
    const char *folder = getenv("KARST_KERNEL_DIR");
    if (!folder || !*folder)
        return true;
    char name[4096];
    if ((size_t)snprintf(name, sizeof(name), "%s/%s", folder, path) >= sizeof(name))
        return karst_fail(e->error, KARST_FAILED, "KARST_KERNEL_DIR is too long a path");
    FILE *file = fopen(name, "rb");
    if (!file) {
        if (errno == ENOENT || errno == ENOTDIR)
            return true;
        return karst_fail(e->error, KARST_FAILED, "cannot read %s (KARST_KERNEL_DIR is set): %s", name,
                          strerror(errno));
    }
    size_t length = 0, capacity = 1 << 14;
    char *data = malloc(capacity);
    while (data) {
        length += fread(data + length, 1, capacity - 1 - length, file);
        if (length < capacity - 1 || capacity > MAX_FILE_BYTES)
            break;
        char *grown = realloc(data, capacity *= 2);
        if (!grown)
            free(data);
        data = grown;
    }
    bool failed = ferror(file) != 0;
    int reason = errno;
    fclose(file);
    if (!data)
        return out_of_memory(e);
    data[length] = 0;
    if (failed || length > MAX_FILE_BYTES || strlen(data) != length) {
        free(data);
        return karst_fail(e->error, KARST_FAILED, "cannot read %s (KARST_KERNEL_DIR is set): %s", name,
                          failed                    ? strerror(reason)
                          : length > MAX_FILE_BYTES ? "it is too large"
                                                    : "it is not text");
    }
    *text = data;
    return true;
}

/* Finds a source. *owned is what the caller frees (NULL if the text belongs to somebody). false: an error, or there is
 * no such source. */
static bool find_source(expansion *e, const char *path, const char **text, char **owned)
{
    *text = NULL;
    *owned = NULL;
    for (size_t i = 0; i < e->num_files; i++)
        if (strcmp(e->files[i].path, path) == 0) {
            *text = e->files[i].text;
            return true;
        }
    if (!read_kernel_dir(e, path, owned))
        return false;
    if (*owned) {
        *text = *owned;
        return true;
    }
    for (const karst_embedded_file *file = karst_embedded_files; file->path; file++)
        if (strcmp(file->path, path) == 0) {
            *text = file->text;
            return true;
        }
    return true;
}

static bool was_seen(const expansion *e, const char *path)
{
    for (size_t i = 0; i < e->num_seen; i++)
        if (strcmp(e->seen[i].path, path) == 0)
            return true;
    return false;
}

static bool mark_seen(expansion *e, const char *path)
{
    if (e->num_seen == e->seen_capacity) {
        size_t capacity = e->seen_capacity ? e->seen_capacity * 2 : 32;
        source_path *grown = realloc(e->seen, capacity * sizeof(*grown));
        if (!grown)
            return out_of_memory(e);
        e->seen = grown;
        e->seen_capacity = capacity;
    }
    snprintf(e->seen[e->num_seen++].path, sizeof(e->seen->path), "%s", path);
    return true;
}

/* Follows comments and quotes over a stretch of one line. */
static void skip_over(reader *r, const char *at, const char *end)
{
    char quote = 0;
    for (; at < end; at++) {
        bool two = at + 1 < end;
        if (r->in_comment) {
            if (two && at[0] == '*' && at[1] == '/') {
                r->in_comment = false;
                at++;
            }
        } else if (quote) {
            if (*at == '\\')
                at++;
            else if (*at == quote)
                quote = 0;
        } else if (two && at[0] == '/' && at[1] == '/') {
            return;
        } else if (two && at[0] == '/' && at[1] == '*') {
            r->in_comment = true;
            at++;
        } else if (*at == '"' || *at == '\'') {
            quote = *at;
        }
    }
}

static const char *skip_blanks(const char *at, const char *end)
{
    while (at < end && (*at == ' ' || *at == '\t'))
        at++;
    return at;
}

/* Reads a word and moves *at past it and the blanks behind it. */
static size_t take_word(const char **at, const char *end, char *word, size_t size_bytes)
{
    size_t n = 0, length = 0;
    while (*at + n < end && (isalnum((unsigned char)(*at)[n]) || (*at)[n] == '_'))
        n++;
    length = n < size_bytes ? n : size_bytes - 1;
    memcpy(word, *at, length);
    word[length] = 0;
    *at = skip_blanks(*at + n, end);
    return n;
}

/* Keeps track of #if and its kin, so that an include in one branch is not taken for one in all. */
static bool follow_condition(expansion *e, reader *r, const char *word, const char *at, const char *end)
{
    condition *top = r->num_conditions ? &r->conditions[r->num_conditions - 1] : NULL;
    if (strcmp(word, "if") == 0 || strcmp(word, "ifdef") == 0 || strcmp(word, "ifndef") == 0) {
        if (r->num_conditions == r->capacity) {
            size_t capacity = r->capacity ? r->capacity * 2 : 8;
            condition *grown = realloc(r->conditions, capacity * sizeof(*grown));
            if (!grown)
                return out_of_memory(e);
            r->conditions = grown;
            r->capacity = capacity;
        }
        top = &r->conditions[r->num_conditions++];
        *top = (condition){.num_seen = e->num_seen};
        if (r->num_directives == 1 && strcmp(word, "ifndef") == 0)
            take_word(&at, end, top->macro, sizeof(top->macro));
    } else if (strcmp(word, "define") == 0) {
        char macro[64];
        take_word(&at, end, macro, sizeof(macro));
        if (top && r->num_directives == 2 && macro[0] && strcmp(macro, top->macro) == 0)
            top->is_guard = true;
    } else if (top && (strcmp(word, "else") == 0 || strcmp(word, "elif") == 0)) {
        if (!top->is_guard)
            e->num_seen = top->num_seen;
    } else if (top && strcmp(word, "endif") == 0) {
        if (!top->is_guard)
            e->num_seen = top->num_seen;
        r->num_conditions--;
    }
    return true;
}

static bool expand_file(expansion *e, const char *path, const reader *from, int depth);

/* A directive begins at `at`, behind its #. *rest is where the line goes on, NULL if it is to be kept as it is. */
static bool follow_directive(expansion *e, reader *r, const char *at, const char *end, int depth, const char **rest)
{
    char word[64], path[MAX_PATH + 2];
    *rest = NULL;
    at = skip_blanks(at, end);
    if (!take_word(&at, end, word, sizeof(word)))
        return true;
    r->num_directives++;
    if (strcmp(word, "include") != 0)
        return follow_condition(e, r, word, at, end);
    if (at == end || *at != '"')
        return true;
    const char *close = memchr(at + 1, '"', (size_t)(end - at - 1));
    size_t length = close ? (size_t)(close - at - 1) : 0;
    if (!close || length > MAX_PATH)
        return karst_fail(e->error, KARST_FAILED, "%s:%u: the path of this #include %s", r->path, r->line,
                          close ? "is too long" : "has no end");
    memcpy(path, at + 1, length);
    path[length] = 0;
    if (!expand_file(e, path, r, depth + 1))
        return false;
    *rest = close + 1;
    return true;
}

/* Appends one line (its newline included), or what it includes. */
static bool expand_line(expansion *e, reader *r, const char *line, const char *end, int depth)
{
    const char *rest = NULL;
    const char *at = skip_blanks(line, end);
    if (!r->in_comment && at < end && *at == '#') {
        size_t before = e->length;
        if (!follow_directive(e, r, at + 1, end, depth, &rest))
            return false;
        if (rest && e->length > before) { /* something came in between */
            if (!append_line_directive(e, r->line, r->path))
                return false;
        }
    }
    if (!rest)
        rest = line;
    skip_over(r, rest, end);
    return append(e, rest, (size_t)(end - rest)) && append(e, "\n", 1);
}

static bool expand_text(expansion *e, const char *path, const char *text, int depth)
{
    reader r = {.path = path};
    bool ok = append_line_directive(e, 1, path);
    while (ok && *text) {
        size_t length = strcspn(text, "\n");
        r.line++;
        ok = expand_line(e, &r, text, text + length, depth);
        text += length + (text[length] == '\n');
    }
    free(r.conditions);
    return ok;
}

/* Appends a file unless it is there already. `from` is who asks for it; NULL for the entry. */
static bool expand_file(expansion *e, const char *path, const reader *from, int depth)
{
    char where[MAX_PATH + 32] = "";
    if (from)
        snprintf(where, sizeof(where), "%s:%u: ", from->path, from->line);
    if (!path_is_plain(path))
        return karst_fail(e->error, KARST_FAILED, "%s\"%s\" is no path from the top of Karst's sources", where, path);
    if (was_seen(e, path))
        return true;
    if (depth > MAX_DEPTH)
        return karst_fail(e->error, KARST_FAILED, "%sincludes are nested more than %d deep", where, MAX_DEPTH);
    const char *text;
    char *owned;
    if (!find_source(e, path, &text, &owned))
        return false;
    if (!text)
        return karst_fail(e->error, KARST_FAILED, "%sthere is no kernel source \"%s\"", where, path);
    bool ok = mark_seen(e, path) && expand_text(e, path, text, depth);
    free(owned);
    return ok;
}

char *karst_source_expand(const char *entry, const karst_virtual_file *files, size_t num_files, karst_error *error)
{
    expansion e = {.files = files, .num_files = num_files, .error = error};
    bool ok = expand_file(&e, entry, NULL, 0);
    free(e.seen);
    if (!ok) {
        free(e.text);
        return NULL;
    }
    return e.text;
}
