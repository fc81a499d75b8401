/* What sliders say goes to the engine, and is saved back into the header of the world's file. */
#include "demos/view/view.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MAX_FILE_BYTES ((long)16 << 20)

bool view_sliders_apply(viewer *v, karst_error *error)
{
    view_sliders *all = &v->sliders;
    karst_parameter parameters[VIEW_MAX_SLIDERS];
    size_t num_parameters = 0;
    bool structural = false;
    if (v->reload.running) /* what is being compiled brings its own values; these follow */
        return true;
    all->changed = false;
    for (int i = 0; i < all->num_sliders; i++)
        if (all->sliders[i].changed) {
            all->sliders[i].changed = false;
            structural = structural || all->sliders[i].is_structural;
            parameters[num_parameters++] = (karst_parameter){all->sliders[i].name, all->sliders[i].value};
        }
    if (!num_parameters)
        return true;
    /* What decides the program's shape is compiled beside the picture. */
    if (structural) {
        bool changed;
        return view_reload_step(v, true, &changed, error);
    }
    karst_error reason = {0};
    if (!karst_engine_set_parameters(v->engine, parameters, num_parameters, &reason)) {
        if (reason.status == KARST_FAILED)
            return karst_fail(error, reason.status, "%s", reason.message);
        view_complain(v, "%s", reason.message);
    }
    v->settled = false;
    view_world_stale(v);
    return true;
}

/* ---- saving into the file ---- */

/* Reading JSON only as far as needed to find places in its text: what a person wrote stays as it is. All of these
 * return the place behind what they read, or NULL. */
static const char *skip_blanks(const char *p)
{
    while (p && isspace((unsigned char)*p))
        p++;
    return p;
}

static const char *skip_string(const char *p)
{
    if (!p || *p++ != '"')
        return NULL;
    for (; *p && *p != '"'; p++)
        if (*p == '\\' && !*++p)
            return NULL;
    return *p ? p + 1 : NULL;
}

static const char *skip_value(const char *p)
{
    p = skip_blanks(p);
    if (!p)
        return NULL;
    if (*p == '"')
        return skip_string(p);
    if (*p == '{' || *p == '[') {
        for (int depth = 0; *p;) {
            if (*p == '"') {
                if (!(p = skip_string(p)))
                    return NULL;
                continue;
            }
            depth += (*p == '{' || *p == '[') - (*p == '}' || *p == ']');
            p++;
            if (depth == 0)
                return p;
        }
        return NULL;
    }
    const char *start = p;
    while (*p && !strchr(",]} \t\r\n", *p))
        p++;
    return p > start ? p : NULL;
}

/* The value of a key of the object that begins at p. */
static const char *find_key(const char *p, const char *key)
{
    p = skip_blanks(p);
    if (!p || *p++ != '{')
        return NULL;
    while ((p = skip_blanks(p)) && *p == '"') {
        const char *name = p + 1, *end = skip_string(p);
        p = skip_blanks(end);
        if (!p || *p++ != ':')
            return NULL;
        if ((size_t)(end - 1 - name) == strlen(key) && strncmp(name, key, strlen(key)) == 0)
            return skip_blanks(p);
        p = skip_blanks(skip_value(p));
        if (!p || *p++ != ',')
            return NULL;
    }
    return NULL;
}

/* The number that a parameter begins with, in the header of a world file's text. */
static bool find_number(const char *text, const char *name, const char **start, const char **end)
{
    const char *comment = strstr(text, "/*"), *header = comment ? skip_blanks(comment + 2) : NULL;
    const char *value = find_key(find_key(header, "params"), name);
    if (value && *value == '{')
        value = find_key(value, "value");
    *start = value;
    *end = skip_value(value);
    return *end != NULL;
}

static char *read_file(const char *path, karst_error *error)
{
    FILE *file = fopen(path, "rb");
    char *text = NULL;
    long size = -1;
    if (file && fseek(file, 0, SEEK_END) == 0 && (size = ftell(file)) >= 0 && size <= MAX_FILE_BYTES &&
        fseek(file, 0, SEEK_SET) == 0 && (text = malloc((size_t)size + 1)) != NULL) {
        size_t length = fread(text, 1, (size_t)size, file);
        text[length] = 0;
        if (ferror(file) || length != (size_t)size) {
            free(text);
            text = NULL;
        }
    }
    if (!text)
        karst_fail(error, KARST_FAILED, "cannot read %s: %s", path, errno ? strerror(errno) : "too large");
    if (file)
        fclose(file);
    return text;
}

/* The shortest text that is this number again. */
static void format_number(double value, char text[40])
{
    for (int digits = 6; digits <= 17; digits++) {
        snprintf(text, 40, "%.*g", digits, value);
        if (strtod(text, NULL) == value)
            return;
    }
}

void view_sliders_save(viewer *v)
{
    karst_error error = {0};
    int num_saved = 0;
    if (!v->is_file || !v->sliders.num_sliders) {
        view_complain(v, "the world %s has no parameters in a file", v->world);
        return;
    }
    errno = 0;
    char *text = read_file(v->world_file, &error);
    for (int i = 0; text && i < v->sliders.num_sliders; i++) {
        const view_slider *s = &v->sliders.sliders[i];
        const char *start, *end;
        char number[40];
        if (s->value == s->original)
            continue;
        if (!find_number(text, s->name, &start, &end)) {
            karst_fail(&error, KARST_BAD_DATA, "the header of %s says nothing of %s that could be changed",
                       v->world_file, s->name);
            break;
        }
        format_number(s->value, number);
        size_t before = (size_t)(start - text), after = strlen(end);
        char *changed = malloc(before + strlen(number) + after + 1);
        if (!changed) {
            karst_fail(&error, KARST_FAILED, "out of memory");
            break;
        }
        memcpy(changed, text, before);
        strcpy(changed + before, number);
        strcpy(changed + before + strlen(number), end);
        free(text);
        text = changed;
        num_saved++;
    }
    bool saved = text && error.status == KARST_OK && (!num_saved || command_write_text(v->world_file, text, &error));
    free(text);
    if (!saved) {
        view_complain(v, "%s", error.message);
        return;
    }
    for (int i = 0; i < v->sliders.num_sliders; i++)
        v->sliders.sliders[i].original = v->sliders.sliders[i].value;
    if (num_saved)
        view_toast(v, "saved into %s: %d parameter%s", v->world_file, num_saved, num_saved == 1 ? "" : "s");
    else
        view_toast(v, "all parameters are as %s has them", v->world_file);
}
