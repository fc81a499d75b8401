/* Reading files of edits: JSON, with errors that name the file, the edit and the field. */
#include "karst/edit.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <jansson.h>

#include "core/base/text.h"
#include "producers/edits/edit_list.h"
#include "producers/edits/edits_text.h"

/* Such a file takes some ten times its size in memory while it is read. */
#define MAX_FILE_BYTES ((off_t)256 << 20)

/* Where in the file we are, for messages. */
typedef struct {
    const char *file;
    size_t edit; /* from 1; 0: outside of the edits */
    int voxel_log2_m;
    json_t *object;
    karst_error *error;
} reader;

__attribute__((format(printf, 3, 4))) static bool complain(const reader *r, const char *field, const char *format, ...)
{
    char what[640];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    if (r->edit)
        return karst_fail(r->error, KARST_BAD_DATA, "%s: edit %zu, %s: %s", r->file, r->edit, field, what);
    return karst_fail(r->error, KARST_BAD_DATA, "%s: %s: %s", r->file, field, what);
}

/* A word of a list; its number. */
static bool read_word(const reader *r, const char *field, const char *const *words, int num, int *which)
{
    json_t *value = json_object_get(r->object, field);
    char list[128] = "", quoted[KARST_TEXT_QUOTE_BYTES];
    for (*which = 0; *which < num; (*which)++)
        if (json_is_string(value) && strcmp(json_string_value(value), words[*which]) == 0)
            return true;
    for (int i = 0; i < num; i++)
        snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", i ? ", " : "", words[i]);
    if (json_is_string(value))
        return complain(r, field, "there is no %s; there are: %s", karst_text_quote(json_string_value(value), quoted),
                        list);
    return complain(r, field, "must be one of: %s", list);
}

static bool read_number(const reader *r, const char *field, bool required, double *number)
{
    json_t *value = json_object_get(r->object, field);
    if (!value)
        return !required || complain(r, field, "is missing");
    if (!json_is_number(value) || !isfinite(json_number_value(value)))
        return complain(r, field, "must be a number");
    *number = json_number_value(value);
    return true;
}

static bool read_numbers(const reader *r, const char *field, bool required, double numbers[3])
{
    json_t *value = json_object_get(r->object, field);
    if (!value)
        return !required || complain(r, field, "is missing");
    for (size_t i = 0; i < 3; i++) {
        json_t *number = json_array_get(value, i);
        if (json_array_size(value) != 3 || !json_is_number(number) || !isfinite(json_number_value(number)))
            return complain(r, field, "must be three numbers, such as [1, 2.5, 1]");
        numbers[i] = json_number_value(number);
    }
    return true;
}

/* Metres: texts are exact, numbers are what JSON makes of them. */
static bool read_position(const reader *r, const char *field, karst_position *position)
{
    json_t *value = json_object_get(r->object, field);
    if (!value)
        return complain(r, field, "is missing");
    for (size_t axis = 0; axis < 3; axis++) {
        json_t *entry = json_array_get(value, axis);
        char text[64];
        karst_error reason = {0};
        if (json_array_size(value) != 3 || !(json_is_string(entry) || json_is_number(entry)))
            return complain(r, field, "must be three decimals, such as [\"1000000000010\", \"20.5\", \"0\"]");
        if (json_is_integer(entry))
            snprintf(text, sizeof text, "%lld", (long long)json_integer_value(entry));
        else if (json_is_real(entry))
            karst_text_from_double(json_real_value(entry), text, sizeof text);
        if (!karst_coordinate_parse(json_is_string(entry) ? json_string_value(entry) : text, r->voxel_log2_m,
                                    &position->voxel[axis], &position->fraction[axis], &reason))
            return complain(r, field, "%c: %s", "xyz"[axis], reason.message);
    }
    return true;
}

/* Fields that say nothing of this shape and mode are mistakes. */
static bool check_fields(const reader *r, const karst_edit *edit)
{
    bool is_round = edit->shape == KARST_EDIT_SPHERE || edit->shape == KARST_EDIT_CAPSULE ||
                    edit->shape == KARST_EDIT_NOISE;
    bool may_have_colour = edit->mode == KARST_EDIT_PAINT || edit->mode == KARST_EDIT_ADD;
    bool is_smooth = edit->mode == KARST_EDIT_SMOOTH;
    const struct {
        const char *name;
        bool is_known;
    } fields[] = {{"shape", true},
                  {"mode", true},
                  {"at", true},
                  {"blend", !is_smooth},
                  {"radius", is_round},
                  {"half", edit->shape == KARST_EDIT_BOX},
                  {"to", edit->shape == KARST_EDIT_CAPSULE},
                  {"normal", edit->shape == KARST_EDIT_PLANE || edit->mode == KARST_EDIT_FLATTEN || is_smooth},
                  {"amplitude", edit->shape == KARST_EDIT_NOISE},
                  {"scale", edit->shape == KARST_EDIT_NOISE},
                  {"seed", edit->shape == KARST_EDIT_NOISE},
                  {"colour", may_have_colour},
                  {"strength", may_have_colour || is_smooth}};
    const char *field;
    json_t *value;
    json_object_foreach(r->object, field, value)
    {
        char list[256] = "", quoted[KARST_TEXT_QUOTE_BYTES];
        bool found = false;
        for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) {
            found = found || (fields[i].is_known && strcmp(field, fields[i].name) == 0);
            if (fields[i].is_known)
                snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", *list ? ", " : "", fields[i].name);
        }
        if (!found)
            return complain(r, karst_text_quote(field, quoted), "a %s of mode %s has no such field; there are: %s",
                            karst_edit_shape_words[edit->shape], karst_edit_mode_words[edit->mode], list);
    }
    return true;
}

static bool read_edit(const reader *r, karst_edit *edit)
{
    int shape, mode;
    double seed = 0;
    karst_position to;
    karst_error reason = {0};
    karst_edit_record record;
    if (!json_is_object(r->object))
        return complain(r, "all of it", "must be an object, such as {\"shape\": \"sphere\", \"mode\": \"add\", ...}");
    if (!read_word(r, "shape", karst_edit_shape_words, EDITS_NUM_SHAPES, &shape) ||
        !read_word(r, "mode", karst_edit_mode_words, EDITS_NUM_MODES, &mode))
        return false;
    *edit = (karst_edit){.shape = (karst_edit_shape)shape, .mode = (karst_edit_mode)mode, .scale_m = 1, .strength = 1};
    edit->has_colour = json_object_get(r->object, "colour") != NULL;
    bool is_round = shape == KARST_EDIT_SPHERE || shape == KARST_EDIT_CAPSULE || shape == KARST_EDIT_NOISE;
    if (!check_fields(r, edit) || !read_position(r, "at", &edit->at) ||
        !read_number(r, "blend", false, &edit->blend_m) || !read_number(r, "radius", is_round, &edit->radius_m) ||
        !read_numbers(r, "half", shape == KARST_EDIT_BOX, edit->half_m) ||
        !read_numbers(r, "normal", false, edit->normal) ||
        !read_number(r, "amplitude", shape == KARST_EDIT_NOISE, &edit->amplitude_m) ||
        !read_number(r, "scale", shape == KARST_EDIT_NOISE, &edit->scale_m) || !read_number(r, "seed", false, &seed) ||
        !read_numbers(r, "colour", mode == KARST_EDIT_PAINT, edit->colour) ||
        !read_number(r, "strength", false, &edit->strength))
        return false;
    if (!(seed >= 0 && seed <= UINT32_MAX && seed == floor(seed)))
        return complain(r, "seed", "must be a whole number from 0 to %u", UINT32_MAX);
    edit->seed = (uint32_t)seed;
    if (shape == KARST_EDIT_CAPSULE) {
        if (!read_position(r, "to", &to))
            return false;
        karst_position_difference_m(edit->at, to, r->voxel_log2_m, edit->to_m);
    }
    if (!karst_edit_record_make(edit, r->edit, r->voxel_log2_m, &record, &reason))
        return karst_fail(r->error, KARST_BAD_DATA, "%s: %s", r->file, reason.message);
    return true;
}

static bool check_top(const reader *r, json_t *root)
{
    const char *field;
    json_t *value;
    if (!json_is_object(root) || !json_is_array(json_object_get(root, "edits")))
        return complain(r, "all of it", "must be an object with a list \"edits\"");
    json_object_foreach(root, field, value)
    {
        char quoted[KARST_TEXT_QUOTE_BYTES];
        if (strcmp(field, "edits") != 0 && strcmp(field, "description") != 0)
            return complain(r, karst_text_quote(field, quoted),
                            "there is no such field; there are: description, edits");
    }
    if (json_array_size(json_object_get(root, "edits")) > KARST_MAX_EDITS)
        return complain(r, "edits", "%zu of them; %u are the most", json_array_size(json_object_get(root, "edits")),
                        KARST_MAX_EDITS);
    return true;
}

static json_t *open_file(const char *path, karst_error *error)
{
    json_error_t fault;
    struct stat about;
    if (stat(path, &about) == 0 && about.st_size > MAX_FILE_BYTES) {
        karst_fail(error, KARST_BAD_DATA, "%s: %lld bytes; a file of edits has %lld at most: use several", path,
                   (long long)about.st_size, (long long)MAX_FILE_BYTES);
        return NULL;
    }
    json_t *root = json_load_file(path, JSON_REJECT_DUPLICATES, &fault);
    if (!root && fault.line < 1)
        karst_fail(error, KARST_BAD_DATA, "%s: %s", path, fault.text);
    else if (!root)
        karst_fail(error, KARST_BAD_DATA, "%s:%d:%d: %s", path, fault.line, fault.column, fault.text);
    return root;
}

karst_edit *karst_edits_load(const char *path, int voxel_log2_m, size_t *num, karst_error *error)
{
    json_t *root = open_file(path, error);
    reader r = {.file = path, .voxel_log2_m = voxel_log2_m, .error = error};
    karst_edit *edits = NULL;
    *num = 0;
    if (!root)
        return NULL;
    if (check_top(&r, root)) {
        json_t *list = json_object_get(root, "edits");
        size_t count = json_array_size(list);
        edits = calloc(count ? count : 1, sizeof *edits);
        if (!edits)
            karst_fail(error, KARST_FAILED, "out of memory for %zu edits", count);
        for (size_t i = 0; edits && i < count; i++) {
            r.edit = i + 1;
            r.object = json_array_get(list, i);
            if (!read_edit(&r, &edits[i])) {
                free(edits);
                edits = NULL;
            }
        }
        *num = edits ? count : 0;
    }
    json_decref(root);
    return edits;
}
