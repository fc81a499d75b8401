/* Edits as text: a line of the command's, and an object of JSON. */
#include "producers/edits/edits_text.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/text.h"
#include "karst/edit.h"
#include "producers/edits/edit_list.h"

const char *const karst_edit_shape_words[EDITS_NUM_SHAPES] = {"sphere", "box", "capsule", "plane", "noise"};
const char *const karst_edit_mode_words[EDITS_NUM_MODES] = {"add", "remove", "flatten", "paint", "smooth"};

/* ---- reading ---- */

#define MAX_PARTS 24
/* What follows a shape's name, for messages; and how many that are. */
static const struct {
    const char *names;
    size_t num;
} forms[EDITS_NUM_SHAPES] = {{"X,Y,Z,RADIUS", 4},
                             {"X,Y,Z,HALF_X,HALF_Y,HALF_Z", 6},
                             {"X,Y,Z,TO_X,TO_Y,TO_Z,RADIUS", 7},
                             {"X,Y,Z", 3},
                             {"X,Y,Z,RADIUS,AMPLITUDE,SCALE", 6}};

static bool read_number(const char *what, const char *text, double *number, karst_error *error)
{
    char quoted[KARST_TEXT_QUOTE_BYTES];
    return karst_text_to_double(text, number) ||
           karst_fail(error, KARST_USAGE, "%s: '%s' is no number", what, karst_text_quote(text, quoted));
}

static bool read_numbers(const char *what, char *const *texts, size_t num, double *numbers, karst_error *error)
{
    for (size_t i = 0; i < num; i++)
        if (!read_number(what, texts[i], &numbers[i], error))
            return false;
    return true;
}

static bool read_shape(char *const *p, int voxel_log2_m, karst_edit *edit, karst_error *error)
{
    karst_position to;
    if (!karst_position_parse(p[0], p[1], p[2], voxel_log2_m, &edit->at, error))
        return false;
    switch (edit->shape) {
    case KARST_EDIT_SPHERE:
        return read_number("the radius", p[3], &edit->radius_m, error);
    case KARST_EDIT_BOX:
        return read_numbers("half the sides", p + 3, 3, edit->half_m, error);
    case KARST_EDIT_CAPSULE:
        if (!karst_position_parse(p[3], p[4], p[5], voxel_log2_m, &to, error) ||
            !read_number("the radius", p[6], &edit->radius_m, error))
            return false;
        karst_position_difference_m(edit->at, to, voxel_log2_m, edit->to_m);
        return true;
    case KARST_EDIT_PLANE:
        return true;
    case KARST_EDIT_NOISE:
        return read_number("the radius", p[3], &edit->radius_m, error) &&
               read_number("the amplitude", p[4], &edit->amplitude_m, error) &&
               read_number("the scale", p[5], &edit->scale_m, error);
    }
    return false;
}

/* Three numbers with colons between them. `text` is written to. */
static bool read_three(const char *name, char *text, const char *example, double numbers[3], karst_error *error)
{
    char *parts[3];
    for (int i = 0; i < 3; i++) {
        parts[i] = text;
        text += strcspn(text, ":");
        if ((i < 2) != (*text == ':'))
            return karst_fail(error, KARST_USAGE, "%s: must be %s", name, example);
        if (i < 2)
            *text++ = '\0';
    }
    return read_numbers(name, parts, 3, numbers, error);
}

static bool may_have_colour(const karst_edit *edit)
{
    return edit->mode == KARST_EDIT_PAINT || edit->mode == KARST_EDIT_ADD;
}

static bool has_normal(const karst_edit *edit)
{
    return edit->shape == KARST_EDIT_PLANE || edit->mode == KARST_EDIT_FLATTEN || edit->mode == KARST_EDIT_SMOOTH;
}

/* NAME=VALUE. `text` is written to. */
static bool read_named(char *text, karst_edit *edit, karst_error *error)
{
    char quoted[KARST_TEXT_QUOTE_BYTES], *value = strchr(text, '=') + 1;
    double seed;
    value[-1] = '\0';
    if (strcmp(text, "blend") == 0 && edit->mode != KARST_EDIT_SMOOTH)
        return read_number("blend", value, &edit->blend_m, error);
    if (strcmp(text, "seed") == 0 && edit->shape == KARST_EDIT_NOISE) {
        if (!karst_text_to_double(value, &seed) || !(seed >= 0 && seed <= UINT32_MAX) || seed != floor(seed))
            return karst_fail(error, KARST_USAGE, "seed: must be a whole number from 0 to %u", UINT32_MAX);
        edit->seed = (uint32_t)seed;
        return true;
    }
    if (strcmp(text, "normal") == 0 && has_normal(edit))
        return read_three("normal", value, "X:Y:Z, such as 0:1:0.2", edit->normal, error);
    if (strcmp(text, "colour") == 0 && may_have_colour(edit)) {
        edit->has_colour = true;
        return read_three("colour", value, "R:G:B, such as 0.6:0.1:0", edit->colour, error);
    }
    if (strcmp(text, "strength") == 0 && (may_have_colour(edit) || edit->mode == KARST_EDIT_SMOOTH))
        return read_number("strength", value, &edit->strength, error);
    return karst_fail(error, KARST_USAGE, "a %s of mode %s has no '%s'; there are: %s%s%s%s",
                      karst_edit_shape_words[edit->shape], karst_edit_mode_words[edit->mode],
                      karst_text_quote(text, quoted), edit->mode == KARST_EDIT_SMOOTH ? "strength=S" : "blend=M",
                      edit->shape == KARST_EDIT_NOISE ? ", seed=N" : "", has_normal(edit) ? ", normal=X:Y:Z" : "",
                      may_have_colour(edit) ? ", colour=R:G:B, strength=S" : "");
}

static bool find_word(const char *text, const char *const *words, int num, int *which)
{
    for (*which = 0; *which < num; (*which)++)
        if (strcmp(text, words[*which]) == 0)
            return true;
    return false;
}

/* The parts of a line, of which the first is the shape's name. They are written to. */
static bool read_parts(char **parts, size_t num_parts, int voxel_log2_m, karst_edit *edit, karst_error *error)
{
    char quoted[KARST_TEXT_QUOTE_BYTES];
    int shape, mode = KARST_EDIT_ADD;
    if (!find_word(parts[0], karst_edit_shape_words, EDITS_NUM_SHAPES, &shape))
        return karst_fail(error, KARST_USAGE, "there is no shape '%s'; there are: sphere, box, capsule, plane, noise",
                          karst_text_quote(parts[0], quoted));
    size_t at = 1 + forms[shape].num, num_values = 0;
    while (num_values + 1 < num_parts && !strchr(parts[num_values + 1], '=') &&
           !find_word(parts[num_values + 1], karst_edit_mode_words, EDITS_NUM_MODES, &mode))
        num_values++;
    if (num_values != forms[shape].num)
        return karst_fail(error, KARST_USAGE, "%zu values, and a %s has %zu: %s,%s[,MODE][,NAME=VALUE]", num_values,
                          parts[0], forms[shape].num, parts[0], forms[shape].names);
    mode = KARST_EDIT_ADD;
    if (at < num_parts && find_word(parts[at], karst_edit_mode_words, EDITS_NUM_MODES, &mode))
        at++;
    *edit = (karst_edit){.shape = (karst_edit_shape)shape,
                         .mode = mode < EDITS_NUM_MODES ? (karst_edit_mode)mode : KARST_EDIT_ADD,
                         .scale_m = 1,
                         .strength = 1};
    if (!read_shape(parts + 1, voxel_log2_m, edit, error))
        return false;
    for (; at < num_parts; at++)
        if (!strchr(parts[at], '='))
            return karst_fail(error, KARST_USAGE,
                              "'%s' is neither a mode (add, remove, flatten, paint, smooth) nor NAME=VALUE",
                              karst_text_quote(parts[at], quoted));
        else if (!read_named(parts[at], edit, error))
            return false;
    return true;
}

bool karst_edit_parse(const char *text, int voxel_log2_m, karst_edit *edit, karst_error *error)
{
    char *copy = strdup(text), *parts[MAX_PARTS], *rest = copy;
    size_t num_parts = 0;
    karst_edit parsed;
    karst_edit_record record;
    karst_error reason = {0};
    if (!copy)
        return karst_fail(error, KARST_FAILED, "out of memory");
    while (num_parts < MAX_PARTS) {
        parts[num_parts++] = rest;
        rest += strcspn(rest, ",");
        if (!*rest)
            break;
        *rest++ = '\0';
    }
    bool done = read_parts(parts, num_parts, voxel_log2_m, &parsed, error);
    free(copy);
    if (!done)
        return false;
    if (!karst_edit_record_make(&parsed, 1, voxel_log2_m, &record, &reason)) {
        const char *colon = strstr(reason.message, ": ");
        return karst_fail(error, KARST_USAGE, "%s", colon ? colon + 2 : reason.message);
    }
    *edit = parsed;
    return true;
}

/* ---- writing ---- */

typedef struct {
    char *text;
    size_t size_bytes, length;
} writer;

__attribute__((format(printf, 2, 3))) static void put(writer *w, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    bool fits = w->length < w->size_bytes;
    int length = vsnprintf(fits ? w->text + w->length : NULL, fits ? w->size_bytes - w->length : 0, format, arguments);
    va_end(arguments);
    w->length += length > 0 ? (size_t)length : 0;
}

static void put_position(writer *w, const char *name, const karst_position *position, int voxel_log2_m)
{
    put(w, ", \"%s\": [", name);
    for (int axis = 0; axis < 3; axis++) {
        char text[160];
        karst_coordinate_format(position->voxel[axis], position->fraction[axis], voxel_log2_m, text, sizeof text);
        put(w, "%s\"%s\"", axis ? ", " : "", text);
    }
    put(w, "]");
}

static void put_number(writer *w, const char *name, double number)
{
    char text[32];
    karst_text_from_double(number, text, sizeof text);
    put(w, ", \"%s\": %s", name, text);
}

static void put_numbers(writer *w, const char *name, const double numbers[3])
{
    put(w, ", \"%s\": [", name);
    for (int i = 0; i < 3; i++) {
        char text[32];
        karst_text_from_double(numbers[i], text, sizeof text);
        put(w, "%s%s", i ? ", " : "", text);
    }
    put(w, "]");
}

int karst_edit_format(const karst_edit *edit, int voxel_log2_m, char *text, size_t size_bytes)
{
    writer w = {.text = text, .size_bytes = size_bytes};
    bool is_flat = has_normal(edit);
    if (size_bytes)
        *text = '\0';
    if (voxel_log2_m < KARST_VOXEL_LOG2_MIN || voxel_log2_m > KARST_VOXEL_LOG2_MAX ||
        (unsigned)edit->shape >= EDITS_NUM_SHAPES || (unsigned)edit->mode >= EDITS_NUM_MODES)
        return -1;
    put(&w, "{ \"shape\": \"%s\", \"mode\": \"%s\"", karst_edit_shape_words[edit->shape],
        karst_edit_mode_words[edit->mode]);
    put_position(&w, "at", &edit->at, voxel_log2_m);
    if (edit->shape == KARST_EDIT_CAPSULE) {
        karst_position to = karst_position_add_m(edit->at, edit->to_m, voxel_log2_m);
        put_position(&w, "to", &to, voxel_log2_m);
    }
    if (edit->shape == KARST_EDIT_SPHERE || edit->shape == KARST_EDIT_CAPSULE || edit->shape == KARST_EDIT_NOISE)
        put_number(&w, "radius", edit->radius_m);
    if (edit->shape == KARST_EDIT_BOX)
        put_numbers(&w, "half", edit->half_m);
    if (is_flat && (edit->normal[0] != 0 || edit->normal[1] != 0 || edit->normal[2] != 0))
        put_numbers(&w, "normal", edit->normal);
    if (edit->shape == KARST_EDIT_NOISE) {
        put_number(&w, "amplitude", edit->amplitude_m);
        put_number(&w, "scale", edit->scale_m);
        put(&w, ", \"seed\": %u", edit->seed);
    }
    if (edit->blend_m != 0)
        put_number(&w, "blend", edit->blend_m);
    if (edit->has_colour) {
        put_numbers(&w, "colour", edit->colour);
    }
    if (edit->has_colour || edit->mode == KARST_EDIT_SMOOTH)
        put_number(&w, "strength", edit->strength);
    put(&w, " }");
    return (int)w.length;
}
