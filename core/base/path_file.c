/* Reading camera paths: JSON, with errors that name the file, the keyframe and the field. */
#include "karst/path.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "core/base/path_internal.h"
#include "core/base/text.h"

#define MAX_KEYS 100000
#define MAX_TIME_S 1e9
#define MIN_SPAN_S 1e-6 /* shorter ones are jumps that somebody forgot to write as such */
#define MAX_YAW_DEG 1e6
#define MAX_TURNS 1000
#define FOV_MIN_DEG 0.0001
#define FOV_MAX_DEG 179

/* Where in the file we are, for messages. */
typedef struct {
    const char *file;
    size_t key; /* from 1; 0: outside of the keyframes */
    int voxel_log2_m;
    bool world_is_known; /* else positions are only checked for being decimals */
    karst_error *error;
} reader;

__attribute__((format(printf, 3, 4))) static bool complain(const reader *r, const char *field, const char *format, ...)
{
    char what[640];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    if (r->key)
        return karst_fail(r->error, KARST_BAD_DATA, "%s: keyframe %zu, %s: %s", r->file, r->key, field, what);
    return karst_fail(r->error, KARST_BAD_DATA, "%s: %s: %s", r->file, field, what);
}

static bool check_fields(const reader *r, json_t *object, const char *const *known)
{
    const char *field;
    json_t *value;
    json_object_foreach(object, field, value)
    {
        bool found = false;
        for (size_t i = 0; known[i] && !found; i++)
            found = strcmp(field, known[i]) == 0;
        if (found)
            continue;
        char list[256] = "", quoted[KARST_TEXT_QUOTE_BYTES];
        for (size_t i = 0, length = 0; known[i]; length = strlen(list), i++)
            snprintf(list + length, sizeof list - length, "%s%s", i ? ", " : "", known[i]);
        return complain(r, karst_text_quote(field, quoted), "there is no such field; there are: %s", list);
    }
    return true;
}

/* A number in [min, max]; left out: *number stays as it is, unless it is required. */
static bool read_number(const reader *r, json_t *object, const char *field, bool required, double min, double max,
                        double *number)
{
    json_t *value = json_object_get(object, field);
    if (!value)
        return !required || complain(r, field, "is missing");
    if (!json_is_number(value))
        return complain(r, field, "must be a number");
    double read = json_number_value(value);
    if (!(read >= min && read <= max))
        return complain(r, field, "%g is not within %g to %g", read, min, max);
    *number = read;
    return true;
}

static bool read_position(const reader *r, json_t *object, const char *field, karst_position *position)
{
    json_t *value = json_object_get(object, field);
    if (!value)
        return complain(r, field, "is missing");
    if (!json_is_array(value) || json_array_size(value) != 3)
        return complain(r, field, "must be three decimals in quotes, such as [\"0\", \"320.5\", \"1e15\"]");
    for (size_t axis = 0; axis < 3; axis++) {
        json_t *text = json_array_get(value, axis);
        if (!json_is_string(text))
            return complain(r, field, "%c must stand in quotes, such as \"320.5\": a JSON number would lose digits",
                            "xyz"[axis]);
        karst_error reason = {0};
        if (!karst_coordinate_parse(json_string_value(text), r->world_is_known ? r->voxel_log2_m : KARST_VOXEL_LOG2_MAX,
                                    &position->voxel[axis], &position->fraction[axis], &reason))
            return complain(r, field, "%c: %s", "xyz"[axis], reason.message);
    }
    return true;
}

static bool read_text(const reader *r, json_t *object, const char *field, char **text)
{
    json_t *value = json_object_get(object, field);
    if (!value)
        return true;
    if (!json_is_string(value))
        return complain(r, field, "must be text");
    *text = strdup(json_string_value(value));
    return *text || karst_fail(r->error, KARST_FAILED, "out of memory");
}

/* The yaw that continues `from` to `to` the shorter way, with full turns added. */
static double unwind(double from, double to, int turns)
{
    double way = fmod(to - from, 360);
    if (way > 180)
        way -= 360;
    if (way <= -180)
        way += 360;
    return from + way + 360.0 * turns;
}

static bool read_turns(const reader *r, json_t *object, bool has_before, int *turns)
{
    *turns = 0;
    json_t *value = json_object_get(object, "turns");
    if (!value)
        return true;
    if (!json_is_integer(value) || json_integer_value(value) < -MAX_TURNS || json_integer_value(value) > MAX_TURNS)
        return complain(r, "turns", "must be a whole number from -%d to %d", MAX_TURNS, MAX_TURNS);
    if (!has_before)
        return complain(r, "turns",
                        "nothing leads here, so there is nothing to turn: it stands at the keyframe that is turned to");
    *turns = (int)json_integer_value(value);
    return true;
}

/* Either all keyframes of a zoom leave yaw and pitch out, or none. */
static bool read_angles(const reader *r, json_t *object, karst_path *path, karst_path_key *key,
                        const karst_path_key *before)
{
    bool aimed = !json_object_get(object, "yaw") && !json_object_get(object, "pitch");
    if (r->key == 1)
        path->looks_at_target = aimed && path->kind == KARST_PATH_ZOOM;
    if (path->looks_at_target) {
        if (!aimed)
            return complain(r, json_object_get(object, "yaw") ? "yaw" : "pitch",
                            "the first keyframe looks at the target, for want of yaw and pitch: all must, or none");
        return !json_object_get(object, "turns") ||
               complain(r, "turns", "a camera that looks at the target does not turn");
    }
    double yaw = 0;
    int turns;
    bool curve = before && before->time_s < key->time_s;
    if (!read_number(r, object, "yaw", true, -MAX_YAW_DEG, MAX_YAW_DEG, &yaw) ||
        !read_number(r, object, "pitch", true, -90, 90, &key->pitch_deg) || !read_turns(r, object, curve, &turns))
        return false;
    key->yaw_deg = curve ? unwind(before->yaw_deg, yaw, turns) : yaw;
    return true;
}

static bool read_key(const reader *r, json_t *object, karst_path *path, karst_path_key *key)
{
    static const char *const known[] = {"time", "position", "yaw", "pitch", "fov", "turns", NULL};
    const karst_path_key *before = r->key > 1 ? key - 1 : NULL;
    if (!json_is_object(object))
        return complain(r, "all of it",
                        "must be an object, such as {\"time\": 0, \"position\": [\"0\", \"320\", \"0\"], ...}");
    key->fov_deg = before ? before->fov_deg : 60;
    if (!check_fields(r, object, known) ||
        !read_number(r, object, "time", true, -MAX_TIME_S, MAX_TIME_S, &key->time_s) ||
        !read_position(r, object, "position", &key->position) ||
        !read_number(r, object, "fov", false, FOV_MIN_DEG, FOV_MAX_DEG, &key->fov_deg))
        return false;
    if (before && key->time_s < before->time_s)
        return complain(r, "time", "%g comes before %g of the keyframe before", key->time_s, before->time_s);
    if (before && key->time_s > before->time_s && key->time_s - before->time_s < MIN_SPAN_S)
        return complain(r, "time", "less than %g s after the keyframe before; the same time makes a jump", MIN_SPAN_S);
    if (r->key > 2 && key->time_s == (key - 2)->time_s)
        return complain(r, "time", "a third keyframe at %g s: two make a jump, the middle one would never be seen",
                        key->time_s);
    return read_angles(r, object, path, key, before);
}

static bool read_keys(reader *r, json_t *root, karst_path *path)
{
    json_t *keys = json_object_get(root, "keyframes");
    if (!json_is_array(keys) || json_array_size(keys) == 0 || json_array_size(keys) > MAX_KEYS)
        return complain(r, "keyframes", "must be a list of 1 to %d keyframes", MAX_KEYS);
    path->num_keys = json_array_size(keys);
    path->keys = calloc(path->num_keys, sizeof *path->keys);
    if (!path->keys)
        return karst_fail(r->error, KARST_FAILED, "out of memory for %zu keyframes", path->num_keys);
    for (size_t i = 0; i < path->num_keys; i++) {
        r->key = i + 1;
        if (!read_key(r, json_array_get(keys, i), path, &path->keys[i]))
            return false;
    }
    r->key = 0;
    return true;
}

static bool read_kind(const reader *r, json_t *root, karst_path *path)
{
    static const char *const names[] = {"linear", "smooth", "zoom"};
    json_t *value = json_object_get(root, "interpolation");
    path->kind = KARST_PATH_SMOOTH;
    if (value) {
        int kind = 0;
        while (kind < 3 && !(json_is_string(value) && strcmp(json_string_value(value), names[kind]) == 0))
            kind++;
        if (kind == 3)
            return complain(r, "interpolation", "must be \"linear\", \"smooth\" or \"zoom\"");
        path->kind = (karst_path_kind)kind;
    }
    if (path->kind == KARST_PATH_ZOOM)
        return read_position(r, root, "target", &path->target);
    return !json_object_get(root, "target") || complain(r, "target", "only a \"zoom\" has one");
}

static bool check_zoom(reader *r, karst_path *path)
{
    karst_path_measure(path);
    for (size_t i = 0; i < path->num_keys; i++) {
        const karst_path_key *key = &path->keys[i];
        r->key = i + 1;
        if (!(key->distance_m > 0))
            return complain(r, "position", "lies at the target; a zoom only ever comes near");
        if (i == 0 || key->time_s == key[-1].time_s)
            continue;
        double cosine = 0;
        for (int axis = 0; axis < 3; axis++)
            cosine += key->direction[axis] * key[-1].direction[axis];
        /* Less would leave room for a direction of length 0 between the two. */
        if (!(cosine > 1e-6))
            return complain(
                r, "position",
                "90 degrees or more from the keyframe before, as seen from the target: put one between them");
    }
    r->key = 0;
    return true;
}

static bool read_path(reader *r, json_t *root, karst_path *path)
{
    static const char *const known[] = {"description", "world", "interpolation", "target", "keyframes", NULL};
    if (!json_is_object(root))
        return complain(r, "all of it", "must be an object with \"keyframes\"");
    return check_fields(r, root, known) && read_text(r, root, "description", &path->description) &&
           read_text(r, root, "world", &path->world) && read_kind(r, root, path) && read_keys(r, root, path) &&
           (path->kind != KARST_PATH_ZOOM || !r->world_is_known || check_zoom(r, path));
}

static karst_path *load(reader *r)
{
    json_error_t fault;
    json_t *root = json_load_file(r->file, JSON_REJECT_DUPLICATES, &fault);
    if (!root) {
        if (fault.line < 1)
            karst_fail(r->error, KARST_BAD_DATA, "%s: %s", r->file, fault.text);
        else
            karst_fail(r->error, KARST_BAD_DATA, "%s:%d:%d: %s", r->file, fault.line, fault.column, fault.text);
        return NULL;
    }
    karst_path *path = calloc(1, sizeof *path);
    if (!path) {
        karst_fail(r->error, KARST_FAILED, "out of memory");
    } else {
        path->voxel_log2_m = r->voxel_log2_m;
        if (!read_path(r, root, path)) {
            karst_path_destroy(path);
            path = NULL;
        }
    }
    json_decref(root);
    return path;
}

karst_path *karst_path_load(const char *file, int voxel_log2_m, karst_error *error)
{
    if (voxel_log2_m < KARST_VOXEL_LOG2_MIN || voxel_log2_m > KARST_VOXEL_LOG2_MAX) {
        karst_fail(error, KARST_USAGE, "a voxel of 2^%d m is outside 2^%d to 2^%d m", voxel_log2_m,
                   KARST_VOXEL_LOG2_MIN, KARST_VOXEL_LOG2_MAX);
        return NULL;
    }
    reader r = {.file = file, .voxel_log2_m = voxel_log2_m, .world_is_known = true, .error = error};
    karst_path *path = load(&r);
    if (path)
        karst_path_prepare(path);
    return path;
}

bool karst_path_check(const char *file, karst_error *error)
{
    reader r = {.file = file, .error = error};
    karst_path *path = load(&r);
    karst_path_destroy(path);
    return path != NULL;
}
