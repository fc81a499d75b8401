#include "producers/language/front/header.h"

#include <float.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "karst/position.h"
#include "producers/language/front/header_comment.h"

/* As far as a camera may be (karst_engine_set_camera). */
#define MAX_CAMERA_VOXEL ((int64_t)1 << 61)
#define COORDINATE_BYTES 160

/* Errors leave by longjmp, so the tree is released before: what is wrong is noted here first. */
typedef struct {
    karst_source *source;
    karst_world_header *header;
    uint32_t begin, end; /* the object's text */
    uint32_t part;       /* where of it what is read just now begins */
    json_t *root;
} reader;

/* Where a key is written, for messages: the first "key" in quotes behind `from`. */
static uint32_t place_of(const reader *r, const char *key, uint32_t from)
{
    size_t n = strlen(key);
    for (uint32_t i = from; i + n + 2 <= r->end; i++)
        if (r->source->text[i] == '"' && !memcmp(r->source->text + i + 1, key, n) && r->source->text[i + 1 + n] == '"')
            return i;
    return r->begin;
}

static _Noreturn void fail(reader *r, const char *key, const char *hint, const char *message)
{
    uint32_t where = place_of(r, key, r->part > r->begin ? r->part : r->begin);
    json_decref(r->root);
    karst_source_error(r->source, where, hint, "%s", message);
}

static const char *text_of(reader *r, json_t *value, const char *key)
{
    if (!json_is_string(value))
        fail(r, key, NULL, karst_format(r->source->arena, "\"%s\" is a text in quotes", key));
    char *text = karst_format(r->source->arena, "%s", json_string_value(value));
    karst_source_plain(text);
    return text;
}

static double number_of(reader *r, json_t *value, const char *key, double low, double high)
{
    double d = json_is_number(value) ? json_number_value(value) : (double)NAN;
    if (!(d >= low && d <= high)) {
        if (low == -DBL_MAX && high == DBL_MAX)
            fail(r, key, NULL, karst_format(r->source->arena, "\"%s\" is a number", key));
        fail(r, key, NULL, karst_format(r->source->arena, "\"%s\" is a number from %g to %g", key, low, high));
    }
    return d;
}

static json_t *object_of(reader *r, json_t *value, const char *key)
{
    if (!json_is_object(value))
        fail(r, key, NULL, karst_format(r->source->arena, "\"%s\" is an object in braces", key));
    return value;
}

/* Whether a key has the second of two words; the first is what it has where it is left out. */
static bool is_second(reader *r, json_t *object, const char *key, const char *first, const char *second)
{
    json_t *v = json_object_get(object, key);
    const char *word = v ? text_of(r, v, key) : first;
    if (strcmp(word, first) != 0 && strcmp(word, second) != 0)
        fail(r, key, karst_format(r->source->arena, "write \"%s\" or \"%s\"", first, second),
             karst_format(r->source->arena, "\"%s\" cannot be \"%.60s\"", key, word));
    return strcmp(word, second) == 0;
}

/* Warns of keys that are not among `known` (space-separated). */
static void warn_unknown(reader *r, json_t *object, const char *of, const char *known)
{
    const char *key;
    json_t *value;
    json_object_foreach(object, key, value)
    {
        if (r->source->num_warnings >= KARST_MAX_WARNINGS)
            return; /* each look costs a walk through the text */
        karst_nearest nearest = karst_nearest_begin(key, strlen(key));
        bool found = false;
        for (const char *k = known; *k;) {
            size_t n = strcspn(k, " ");
            const char *name = karst_format(r->source->arena, "%.*s", (int)n, k);
            found |= !strcmp(name, key);
            karst_nearest_offer(&nearest, name);
            k += n + (k[n] == ' ');
        }
        if (!found)
            karst_source_warn(r->source, place_of(r, key, r->begin), karst_nearest_hint(&nearest, r->source->arena),
                              "%s has no key \"%.60s\"", of, key);
    }
}

static void read_colour(reader *r, json_t *value, const char *key, double rgb[3])
{
    if (!json_is_array(value) || json_array_size(value) != 3)
        fail(r, key, "write [0.2, 0.4, 0.8]", karst_format(r->source->arena, "\"%s\" is three numbers", key));
    for (size_t i = 0; i < 3; i++)
        rgb[i] = number_of(r, json_array_get(value, i), key, 0, 1000);
}

/* Exact decimals of any length, in a form whose length is bounded. `key`: what they are of. */
static const char *coordinate_of(reader *r, json_t *value, const char *key)
{
    const char *text = json_is_string(value) ? text_of(r, value, key)
                       : json_is_integer(value)
                           ? karst_format(r->source->arena, "%lld", (long long)json_integer_value(value))
                       : json_is_real(value) ? karst_format(r->source->arena, "%.17g", json_real_value(value))
                                             : "";
    int voxel_log2_m = r->header->voxel_log2_m;
    int64_t voxel;
    uint32_t fraction;
    karst_error why = {0};
    if (!karst_coordinate_parse(text, voxel_log2_m, &voxel, &fraction, &why))
        fail(r, key, "write [\"0\", \"320\", \"0\"]",
             karst_format(r->source->arena, "\"%s\" is three decimals, in metres: %s", key, why.message));
    if (voxel > MAX_CAMERA_VOXEL || voxel < -MAX_CAMERA_VOXEL)
        fail(r, key, "come nearer, or make the voxel larger",
             karst_format(r->source->arena, "this \"%s\" lies beyond 2^61 voxels from the origin", key));
    char *exact = karst_arena_alloc(r->source->arena, COORDINATE_BYTES);
    karst_coordinate_format(voxel, fraction, voxel_log2_m, exact, COORDINATE_BYTES);
    return exact;
}

static void read_camera(reader *r, json_t *camera)
{
    karst_world_header *h = r->header;
    json_t *position = json_object_get(object_of(r, camera, "camera"), "position"), *v;
    h->has_camera = true;
    warn_unknown(r, camera, "the camera", "position yaw pitch fov");
    if (position && (!json_is_array(position) || json_array_size(position) != 3))
        fail(r, "position", "write [\"0\", \"320\", \"0\"]", "\"position\" is three decimals, in metres");
    for (size_t i = 0; position && i < 3; i++)
        h->camera_position[i] = coordinate_of(r, json_array_get(position, i), "position");
    if ((v = json_object_get(camera, "yaw")))
        h->camera_yaw_deg = number_of(r, v, "yaw", -36000, 36000);
    if ((v = json_object_get(camera, "pitch")))
        h->camera_pitch_deg = number_of(r, v, "pitch", -90, 90);
    if ((v = json_object_get(camera, "fov")))
        h->camera_fov_deg = number_of(r, v, "fov", 0.0001, 179);
}

/* Only a globe is of use to both kinds of sky. */
static void read_model(reader *r, json_t *sky)
{
    static const char *const colours[] = {"zenith", "horizon", "haze", "haze_height"};
    karst_world_header *h = r->header;
    json_t *dust = json_object_get(sky, "dust");
    h->has_atmosphere = is_second(r, sky, "model", "plain", "atmosphere");
    h->dust = dust ? number_of(r, dust, "dust", 0, 100) : 1;
    if (!h->has_atmosphere && dust)
        karst_source_warn(r->source, place_of(r, "dust", r->begin), "write \"model\": \"atmosphere\" beside it",
                          "\"dust\" has no effect without an atmosphere");
    for (size_t i = 0; h->has_atmosphere && i < sizeof colours / sizeof *colours; i++)
        if (json_object_get(sky, colours[i]))
            karst_source_warn(r->source, place_of(r, colours[i], r->begin), NULL,
                              "\"%s\" has no effect on an atmosphere, which has its own", colours[i]);
    if (h->has_atmosphere && h->haze_globe_m > 0 && !(h->haze_globe_m >= 1e5 && h->haze_globe_m <= 1e9))
        fail(r, "haze_globe", NULL, "an atmosphere's globe has a radius of 10^5 to 10^9 m");
}

static void read_light(reader *r)
{
    karst_world_header *h = r->header;
    json_t *sun = json_object_get(r->root, "sun"), *sky = json_object_get(r->root, "sky"), *v;
    if (sun) {
        h->has_sun = true;
        warn_unknown(r, object_of(r, sun, "sun"), "the sun", "azimuth elevation colour");
        if ((v = json_object_get(sun, "azimuth")))
            h->sun_azimuth_deg = number_of(r, v, "azimuth", -36000, 36000);
        if ((v = json_object_get(sun, "elevation")))
            h->sun_elevation_deg = number_of(r, v, "elevation", -90, 90);
        if ((h->has_sun_colour = (v = json_object_get(sun, "colour")) != NULL))
            read_colour(r, v, "colour", h->sun_colour);
    }
    if (sky) {
        h->has_sky = true;
        warn_unknown(r, object_of(r, sky, "sky"), "the sky", "model dust zenith horizon haze haze_height haze_globe");
        if ((v = json_object_get(sky, "zenith")))
            read_colour(r, v, "zenith", h->sky_zenith);
        if ((v = json_object_get(sky, "horizon")))
            read_colour(r, v, "horizon", h->sky_horizon);
        if ((v = json_object_get(sky, "haze")))
            h->haze_distance_m = number_of(r, v, "haze", 0, DBL_MAX);
        if ((v = json_object_get(sky, "haze_height")))
            h->haze_height_m = number_of(r, v, "haze_height", 0, DBL_MAX);
        if ((v = json_object_get(sky, "haze_globe")))
            h->haze_globe_m = number_of(r, v, "haze_globe", 0, DBL_MAX);
        read_model(r, sky);
    }
}

/* Where element i of a list of objects begins, from a place before the list. */
static uint32_t place_of_element(const reader *r, uint32_t from, size_t i)
{
    const char *text = r->source->text;
    int depth = 0;
    uint32_t at = from;
    while (at < r->end && text[at] != '[')
        at++;
    for (; at < r->end; at++) {
        if (text[at] == '"')
            for (at++; at < r->end && text[at] != '"'; at++)
                at += text[at] == '\\';
        else if (text[at] == '{' && depth++ == 0 && i-- == 0)
            return at;
        else if (text[at] == '}')
            depth--;
    }
    return from;
}

static void read_light_of(reader *r, json_t *light, karst_header_light *l)
{
    static const char *const kinds[KARST_NUM_HEADER_LIGHTS] = {"sun", "point", "spot"};
    static const char *const keys[KARST_NUM_HEADER_LIGHTS] = {
        "kind colour shadow azimuth elevation size", "kind colour shadow position radius",
        "kind colour shadow position radius azimuth elevation angle soft"};
    json_t *v = json_object_get(object_of(r, light, "lights"), "kind");
    const char *kind = v ? text_of(r, v, "kind") : "point";
    *l = (karst_header_light){.colour = {1, 1, 1}, .position = {"0", "0", "0"}, .elevation_deg = 40, .size_deg = 0.53,
                              .radius_m = 0.05, .angle_deg = 40, .soft = 0.25, .shadow = true};
    while (l->kind < KARST_NUM_HEADER_LIGHTS && strcmp(kinds[l->kind], kind) != 0)
        l->kind++;
    if (l->kind == KARST_NUM_HEADER_LIGHTS)
        fail(r, "kind", "write \"sun\", \"point\" or \"spot\"",
             karst_format(r->source->arena, "no light is a \"%s\"", kind));
    if (l->kind == KARST_HEADER_SPOT)
        l->elevation_deg = -90;
    warn_unknown(r, light, "this light", keys[l->kind]);
    if ((v = json_object_get(light, "colour")))
        read_colour(r, v, "colour", l->colour);
    if ((v = json_object_get(light, "shadow"))) {
        if (!json_is_boolean(v))
            fail(r, "shadow", NULL, "\"shadow\" is true or false");
        l->shadow = json_is_true(v);
    }
    if ((v = json_object_get(light, "azimuth")))
        l->azimuth_deg = number_of(r, v, "azimuth", -36000, 36000);
    if ((v = json_object_get(light, "elevation")))
        l->elevation_deg = number_of(r, v, "elevation", -90, 90);
    if ((v = json_object_get(light, "size")))
        l->size_deg = number_of(r, v, "size", 0, 90);
    if ((v = json_object_get(light, "radius")))
        l->radius_m = number_of(r, v, "radius", 0, 1e12);
    if ((v = json_object_get(light, "angle")))
        l->angle_deg = number_of(r, v, "angle", 0.1, 180);
    if ((v = json_object_get(light, "soft")))
        l->soft = number_of(r, v, "soft", 0, 1);
    if ((v = json_object_get(light, "position"))) {
        if (!json_is_array(v) || json_array_size(v) != 3)
            fail(r, "position", "write [\"0\", \"320\", \"0\"]", "\"position\" is three decimals, in metres");
        for (size_t i = 0; i < 3; i++)
            l->position[i] = coordinate_of(r, json_array_get(v, i), "position");
    } else if (l->kind != KARST_HEADER_SUN) {
        fail(r, "kind", "write \"position\": [\"0\", \"320\", \"0\"]", "this light has no \"position\"");
    }
}

static void read_lights(reader *r, json_t *lights)
{
    karst_world_header *h = r->header;
    const uint32_t place = place_of(r, "lights", r->begin);
    uint32_t num_shadows = 0;
    if (!json_is_array(lights))
        fail(r, "lights", "write [{ \"kind\": \"point\", \"position\": [0, 3, 0] }]", "\"lights\" is a list");
    if (json_array_size(lights) > KARST_HEADER_MAX_LIGHTS)
        fail(r, "lights", NULL,
             karst_format(r->source->arena, "%zu lights: a world may have %u beside its sun", json_array_size(lights),
                          KARST_HEADER_MAX_LIGHTS));
    for (size_t i = 0; i < json_array_size(lights); i++) {
        r->part = place_of_element(r, place, i);
        read_light_of(r, json_array_get(lights, i), &h->lights[i]);
        num_shadows += h->lights[i].shadow;
        r->part = 0;
        if (num_shadows > KARST_HEADER_MAX_SHADOWS)
            fail(r, "lights", "write \"shadow\": false in the weaker ones",
                 karst_format(r->source->arena, "more than %u lights cast shadows", KARST_HEADER_MAX_SHADOWS));
        h->num_lights++;
    }
}

static bool is_identifier(const char *name)
{
    static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_0123456789";
    return *name && !(*name >= '0' && *name <= '9') && strspn(name, letters) == strlen(name) && strlen(name) <= 64;
}

static void read_parameter(reader *r, const char *name, json_t *value)
{
    karst_world_header *h = r->header;
    if (!is_identifier(name))
        fail(r, name, "use letters, digits and _", "a parameter's name is a word that the functions can use");
    if (h->num_parameters == KARST_HEADER_MAX_PARAMETERS)
        fail(r, name, NULL,
             karst_format(r->source->arena, "a world may have %u parameters", KARST_HEADER_MAX_PARAMETERS));
    karst_header_parameter p = {
        .min = -DBL_MAX, .max = DBL_MAX, .unit = "", .where = place_of(r, name, place_of(r, "params", r->begin))};
    p.name = p.label = karst_format(r->source->arena, "%s", name);
    double number = 0;
    if (json_is_number(value)) {
        number = number_of(r, value, name, -DBL_MAX, DBL_MAX);
    } else {
        json_t *v;
        warn_unknown(r, object_of(r, value, name), "a parameter", "value min max step unit label");
        if ((v = json_object_get(value, "min")))
            p.min = number_of(r, v, "min", -DBL_MAX, DBL_MAX);
        if ((v = json_object_get(value, "max")))
            p.max = number_of(r, v, "max", -DBL_MAX, DBL_MAX);
        if ((v = json_object_get(value, "step")))
            p.step = number_of(r, v, "step", 0, DBL_MAX);
        if ((v = json_object_get(value, "unit")))
            p.unit = text_of(r, v, "unit");
        if ((v = json_object_get(value, "label")))
            p.label = text_of(r, v, "label");
        if (!(v = json_object_get(value, "value")))
            fail(r, name, "write { \"value\": 1 }",
                 karst_format(r->source->arena, "parameter \"%s\" has no value", name));
        number = number_of(r, v, name, -DBL_MAX, DBL_MAX);
    }
    if (!(p.min <= number && number <= p.max))
        fail(r, name, NULL,
             karst_format(r->source->arena, "the value of \"%s\" is not between its min and its max", name));
    p.value = karst_number_shortest(number);
    h->parameters[h->num_parameters++] = p;
}

static void read_pair(reader *r, json_t *value, const char *key, double low, double high, double pair[2])
{
    if (!json_is_array(value) || json_array_size(value) != 2)
        fail(r, key, "write [1000, 1000]", karst_format(r->source->arena, "\"%s\" is two numbers", key));
    for (size_t i = 0; i < 2; i++)
        pair[i] = number_of(r, json_array_get(value, i), key, low, high);
}

static karst_wrap wrap_of(reader *r, json_t *value)
{
    static const char *const names[] = {"clamp", "repeat", "mirror"};
    const char *name = text_of(r, value, "wrap");
    for (int i = 0; i < 3; i++)
        if (!strcmp(name, names[i]))
            return (karst_wrap)i;
    fail(r, "wrap", "write \"clamp\", \"repeat\" or \"mirror\"",
         karst_format(r->source->arena, "no way of going on beyond edges is called \"%.60s\"", name));
}

static void read_data(reader *r, const char *name, json_t *value)
{
    karst_world_header *h = r->header;
    json_t *v;
    double pair[2];
    if (!is_identifier(name))
        fail(r, name, "use letters, digits and _", "the name of data is a word that the functions can use");
    if (h->num_data == KARST_HEADER_MAX_DATA)
        fail(r, name, NULL,
             karst_format(r->source->arena, "a world may use %u files of data", KARST_HEADER_MAX_DATA));
    karst_header_data *d = &h->data[h->num_data];
    *d = (karst_header_data){.name = karst_format(r->source->arena, "%s", name),
                             .where = place_of(r, name, place_of(r, "data", r->begin))};
    warn_unknown(r, object_of(r, value, name), "a file of data", "file grid size range wrap format shape");
    if (!(v = json_object_get(value, "file")))
        fail(r, name, "write { \"file\": \"heights.png\", \"size\": [1000, 1000] }",
             karst_format(r->source->arena, "data \"%s\" has no file", name));
    d->file = text_of(r, v, "file");
    if ((v = json_object_get(value, "grid")))
        d->grid = text_of(r, v, "grid");
    if ((v = json_object_get(value, "size")))
        read_pair(r, v, "size", 1e-6, 1e15, d->size_m);
    if ((v = json_object_get(value, "range"))) {
        read_pair(r, v, "range", -1e15, 1e15, pair);
        d->form.has_range = true;
        d->form.low = pair[0];
        d->form.high = pair[1];
    }
    if ((v = json_object_get(value, "wrap")))
        d->wrap = wrap_of(r, v);
    if ((v = json_object_get(value, "format"))) {
        d->form.format = text_of(r, v, "format");
        if (!(v = json_object_get(value, "shape")))
            fail(r, name, "write \"shape\": [512, 512]: how many in a row, and how many rows",
                 "raw numbers have a \"shape\"");
        read_pair(r, v, "shape", 1, KARST_SAMPLES_MOST_SIDE, pair);
        d->form.shape[0] = (uint32_t)pair[0];
        d->form.shape[1] = (uint32_t)pair[1];
    }
    h->num_data++;
}

static void read_voxel(reader *r, json_t *value)
{
    double voxel = json_is_number(value) ? json_number_value(value) : 0;
    if (!(voxel >= 0x1p-40 && voxel <= 0x1p40))
        fail(r, "voxel", "write 0.0625", "\"voxel\" is the width of the finest voxel in metres, from 2^-40 to 2^40");
    int k = ilogb(voxel);
    double power = ldexp(1.0, k);
    if (voxel > power * 1.4142135623730951) /* the nearer one, by ratio */
        power = ldexp(1.0, ++k);
    if (voxel != power)
        karst_source_warn(r->source, place_of(r, "voxel", r->begin), NULL,
                          "\"voxel\" is rounded to a power of two: %.12g m", power);
    r->header->voxel_log2_m = k > 40 ? 40 : k;
}

/* Three numbers; one stands for all of them. */
static void read_three(reader *r, json_t *object, const char *key, double low, double high, double to[3])
{
    json_t *v = json_object_get(object, key);
    if (v && json_is_array(v) && json_array_size(v) != 3)
        fail(r, key, "write [1, 2, 3]", karst_format(r->source->arena, "\"%s\" is three numbers", key));
    for (size_t i = 0; v && i < 3; i++)
        to[i] = number_of(r, json_is_array(v) ? json_array_get(v, i) : v, key, low, high);
}

static void read_one(reader *r, json_t *object, const char *key, double low, double high, double *to)
{
    json_t *v = json_object_get(object, key);
    if (v)
        *to = number_of(r, v, key, low, high);
}

static void read_material(reader *r, json_t *object, bool is_clear, karst_header_material *m)
{
    warn_unknown(r, object, is_clear ? "the material of clear matter" : "the material of a solid model",
                 is_clear ? "ior absorption" : "colour mirror gloss emission");
    m->has_colour = json_object_get(object, "colour") != NULL;
    m->has_mirror = json_object_get(object, "mirror") != NULL;
    m->has_gloss = json_object_get(object, "gloss") != NULL;
    m->has_emission = json_object_get(object, "emission") != NULL;
    m->has_ior = json_object_get(object, "ior") != NULL;
    m->has_absorption = json_object_get(object, "absorption") != NULL;
    read_three(r, object, "colour", 0, 1000, m->colour);
    read_one(r, object, "mirror", 0, 1, &m->mirror);
    read_one(r, object, "gloss", 0, 1, &m->gloss);
    read_three(r, object, "emission", 0, 1e6, m->emission);
    read_one(r, object, "ior", 1, 10, &m->ior);
    read_three(r, object, "absorption", 0, 1e15, m->absorption);
}

static karst_header_model read_point_model(reader *r, json_t *object)
{
    karst_header_model model = {.at = {"0", "0", "0"}, .scale = 1};
    json_t *v = json_object_get(object_of(r, object, "models"), "points");
    warn_unknown(r, object, "a model", "points at turn scale mode material as blend copies sides");
    if (!v)
        fail(r, "models", "write { \"points\": \"rabbit.karstpoints\", \"at\": [\"0\", \"1\", \"0\"] }",
             "a model has \"points\": the name of an imported file");
    model.points = text_of(r, v, "points");
    if ((v = json_object_get(object, "at")) && (!json_is_array(v) || json_array_size(v) != 3))
        fail(r, "at", "write [\"0\", \"320\", \"0\"]", "\"at\" is three decimals, in metres");
    for (size_t i = 0; v && i < 3; i++)
        model.at[i] = coordinate_of(r, json_array_get(v, i), "at");
    if ((v = json_object_get(object, "turn")) && (!json_is_array(v) || json_array_size(v) != 3))
        fail(r, "turn", "write [0, 90, 0]", "\"turn\" is three angles about x, y and z, in degrees");
    for (size_t i = 0; v && i < 3; i++)
        model.turn_deg[i] = number_of(r, json_array_get(v, i), "turn", -36000, 36000);
    if ((v = json_object_get(object, "scale")))
        model.scale = number_of(r, v, "scale", 1e-30, 1e30);
    model.is_splats = is_second(r, object, "as", "surface", "splats");
    model.is_clear = is_second(r, object, "mode", "solid", "clear");
    if (model.is_clear && model.is_splats)
        fail(r, "as", "leave \"as\" out", "clear matter has an inside, which \"splats\" have not");
    if ((v = json_object_get(object, "material")))
        read_material(r, object_of(r, v, "material"), model.is_clear, &model.material);
    model.is_shallow = is_second(r, object, "blend", "deep", "leaf");
    model.has_backs = is_second(r, object, "sides", "front", "both");
    model.culls = is_second(r, object, "copies", "all", "culled");
    return model;
}

static void read_point_models(reader *r, json_t *list)
{
    size_t num = json_array_size(list);
    if (!json_is_array(list) || num > KARST_HEADER_MAX_MODELS)
        fail(r, "models", "write [{ \"points\": \"rabbit.karstpoints\" }]",
             karst_format(r->source->arena, "\"models\" is a list in brackets of %u models at most",
                          KARST_HEADER_MAX_MODELS));
    karst_header_model *models = karst_arena_alloc(r->source->arena, (num + 1) * sizeof *models);
    for (size_t i = 0; i < num; i++)
        models[i] = read_point_model(r, json_array_get(list, i));
    r->header->models = models;
    r->header->num_models = (uint32_t)num;
}

/* A number from `low` on, or the name of a parameter. */
static karst_header_number number_or_parameter(reader *r, json_t *value, const char *key, double low, double high)
{
    if (!json_is_string(value))
        return (karst_header_number){.value = number_of(r, value, key, low, high)};
    const char *name = text_of(r, value, key);
    for (uint32_t i = 0; i < r->header->num_parameters; i++)
        if (strcmp(r->header->parameters[i].name, name) == 0) {
            r->header->parameters[i].is_named = true;
            return (karst_header_number){.parameter = name};
        }
    fail(r, key, "name one of \"params\", or write a number",
         karst_format(r->source->arena, "\"%s\" is of a parameter \"%.60s\", which there is not", key, name));
}

static void read_emitter(reader *r, json_t *object, karst_header_particles *p)
{
    static const char *const shapes[KARST_NUM_HEADER_EMITTERS] = {"ball", "box", "disc"};
    const char *shape = text_of(r, json_object_get(object, "emitter"), "emitter");
    json_t *v;
    int i = 0;
    while (i < KARST_NUM_HEADER_EMITTERS && strcmp(shape, shapes[i]) != 0)
        i++;
    if (i == KARST_NUM_HEADER_EMITTERS)
        fail(r, "emitter", "write \"ball\", \"box\" or \"disc\"",
             karst_format(r->source->arena, "an emitter has no shape \"%.60s\"", shape));
    p->emitter = (karst_header_emitter)i;
    read_three(r, object, "size", 0, 1e15, p->size);
    read_three(r, object, "velocity", -1e15, 1e15, p->velocity);
    read_one(r, object, "spread", 0, 1e15, &p->spread);
    read_one(r, object, "stray", 0, 1e15, &p->stray);
    read_one(r, object, "life", 1e-6, 1e9, &p->life);
    read_one(r, object, "fade", 0, 0.5, &p->fade);
    if ((v = json_object_get(object, "count")))
        p->count = number_or_parameter(r, v, "count", 0, 1e9);
    v = json_object_get(object, "radius");
    if (v && json_is_array(v) && json_array_size(v) != 2)
        fail(r, "radius", "write [0.5, 2]", "\"radius\" is a number, or two: at birth, and at the end");
    for (size_t k = 0; v && k < 2; k++)
        p->radius[k] = number_or_parameter(r, json_is_array(v) ? json_array_get(v, k) : v, "radius", 0, 1e15);
    if ((v = json_object_get(object, "extinction")))
        p->extinction = number_or_parameter(r, v, "extinction", 0, 1e15);
    if ((v = json_object_get(object, "seed"))) {
        if (!json_is_integer(v) || json_integer_value(v) < 0 || json_integer_value(v) > UINT32_MAX)
            fail(r, "seed", NULL, "\"seed\" is an integer from 0 to 4294967295");
        p->seed = (uint32_t)json_integer_value(v);
    }
}

static karst_header_particles read_group(reader *r, json_t *object)
{
    karst_header_particles p = {.at = {"0", "0", "0"}, .size = {1, 1, 1}, .life = 1, .count = {.value = 100},
                                .radius = {{.value = 0.5}, {.value = 0.5}}, .extinction = {.value = 1}};
    const bool has_file = json_object_get(object_of(r, object, "particles"), "file") != NULL;
    json_t *v;
    if (has_file == (json_object_get(object, "emitter") != NULL))
        fail(r, "particles", "write { \"file\": \"smoke.csv\" } or { \"emitter\": \"ball\", \"count\": 500 }",
             "a group of particles has either a \"file\" or an \"emitter\"");
    warn_unknown(r, object, "a group of particles",
                 has_file ? "file at combine"
                          : "emitter at combine size velocity spread stray life fade count radius extinction seed");
    p.is_sum = is_second(r, object, "combine", "union", "sum");
    if ((v = json_object_get(object, "at")) && (!json_is_array(v) || json_array_size(v) != 3))
        fail(r, "at", "write [\"0\", \"320\", \"0\"]", "\"at\" is three decimals, in metres");
    for (size_t i = 0; v && i < 3; i++)
        p.at[i] = coordinate_of(r, json_array_get(v, i), "at");
    if (has_file)
        p.file = text_of(r, json_object_get(object, "file"), "file");
    else
        read_emitter(r, object, &p);
    return p;
}

/* After the parameters, which it may name. */
static void read_particles(reader *r, json_t *list)
{
    size_t num = json_array_size(list);
    if (!json_is_array(list) || num > KARST_HEADER_MAX_PARTICLES)
        fail(r, "particles", "write [{ \"emitter\": \"ball\", \"count\": 500 }]",
             karst_format(r->source->arena, "\"particles\" is a list in brackets of %u groups at most",
                          KARST_HEADER_MAX_PARTICLES));
    karst_header_particles *particles = karst_arena_alloc(r->source->arena, (num + 1) * sizeof *particles);
    for (size_t i = 0; i < num; i++)
        particles[i] = read_group(r, json_array_get(list, i));
    r->header->particles = particles;
    r->header->num_particles = (uint32_t)num;
}

/* A header without "voxel" leaves it to the views how fine levels become: what is finer than anyone looks costs
 * nothing. Numbers stay as exact as the usual voxel asks for, and places that the header names fit 64 bits. */
#define FINEST_LOG2_M (-10)
#define USUAL_LOG2_M (-4)

static double largest_of(json_t *value)
{
    double largest = json_is_number(value)   ? fabs(json_number_value(value))
                     : json_is_string(value) ? fabs(strtod(json_string_value(value), NULL))
                                             : 0;
    size_t i;
    json_t *item;
    json_array_foreach(value, i, item) if (!json_is_array(item)) largest = fmax(largest, largest_of(item));
    return largest;
}

static void leave_voxel_open(reader *r)
{
    double out_m = fmax(largest_of(json_object_get(r->root, "extent")),
                        largest_of(json_object_get(json_object_get(r->root, "camera"), "position")));
    double view_m = largest_of(json_object_get(r->root, "view"));
    int k = FINEST_LOG2_M;
    while (k < USUAL_LOG2_M && (out_m > ldexp(1, 60 + k) || view_m > ldexp(1, 55 + k)))
        k++;
    r->header->voxel_log2_m = k;
    r->header->exact_above_log2 = USUAL_LOG2_M - k;
}

static void read_root(reader *r)
{
    karst_world_header *h = r->header;
    const char *name;
    json_t *v, *value;
    warn_unknown(r, r->root, "the header",
                 KARST_HEADER_KEYS);
    if ((v = json_object_get(r->root, "name")))
        h->name = text_of(r, v, "name");
    if ((v = json_object_get(r->root, "author")))
        h->author = text_of(r, v, "author");
    if ((v = json_object_get(r->root, "description")))
        h->description = text_of(r, v, "description");
    if ((v = json_object_get(r->root, "seed"))) {
        if (!json_is_integer(v) || json_integer_value(v) < 0 || json_integer_value(v) > UINT32_MAX)
            fail(r, "seed", NULL, "\"seed\" is an integer from 0 to 4294967295");
        h->seed = (uint32_t)json_integer_value(v);
    }
    if ((v = json_object_get(r->root, "voxel")))
        read_voxel(r, v);
    else
        leave_voxel_open(r);
    if ((v = json_object_get(r->root, "extent"))) {
        h->has_extent = true;
        h->extent_m = number_of(r, v, "extent", 0, DBL_MAX);
    }
    if ((v = json_object_get(r->root, "lipschitz"))) {
        h->has_lipschitz = true;
        h->lipschitz = number_of(r, v, "lipschitz", 0, DBL_MAX);
    }
    if ((v = json_object_get(r->root, "exposure"))) {
        h->has_exposure = true;
        h->exposure_stops = number_of(r, v, "exposure", -20, 20);
    }
    if ((v = json_object_get(r->root, "mirror")))
        h->mirror = number_of(r, v, "mirror", 0, 1);
    if ((v = json_object_get(r->root, "occlusion"))) {
        if (!json_is_boolean(v))
            fail(r, "occlusion", "write \"occlusion\": true",
                 "\"occlusion\" is true or false: whether what stands around hides light from all around");
        h->has_occlusion = json_is_true(v);
    }
    if ((v = json_object_get(r->root, "light_map"))) {
        if ((value = json_object_get(v, "reach")))
            h->light_reach_m = number_of(r, value, "reach", 1e-12, 1e18);
        h->light_map = text_of(r, json_is_object(v) ? json_object_get(v, "file") : v, "light_map");
    }
    if ((v = json_object_get(r->root, "view")))
        h->view_distance_m = number_of(r, v, "view", ldexp(16, h->voxel_log2_m), ldexp(0x1p56, h->voxel_log2_m));
    if ((v = json_object_get(r->root, "camera")))
        read_camera(r, v);
    read_light(r);
    if ((v = json_object_get(r->root, "lights")))
        read_lights(r, v);
    if ((v = json_object_get(r->root, "models")))
        read_point_models(r, v);
    if ((v = json_object_get(r->root, "params")))
        json_object_foreach(object_of(r, v, "params"), name, value) read_parameter(r, name, value);
    if ((v = json_object_get(r->root, "data")))
        json_object_foreach(object_of(r, v, "data"), name, value) read_data(r, name, value);
    if ((v = json_object_get(r->root, "particles")))
        read_particles(r, v);
}

void karst_header_read(karst_source *source, karst_world_header *header)
{
    *header = (karst_world_header){.name = "",
                                   .author = "",
                                   .description = "",
                                   .voxel_log2_m = -4,
                                   .camera_position = {"0", "0", "0"},
                                   .camera_fov_deg = 60,
                                   .sun_azimuth_deg = 135,
                                   .sun_elevation_deg = 40};
    const karst_header_object object = karst_header_find(source);
    reader r = {.source = source, .header = header, .begin = object.begin, .end = object.end, .root = object.inputs};
    const char *name;
    json_t *value;
    json_object_foreach(object.inputs, name, value) read_parameter(&r, name, value);
    json_decref(object.inputs);
    r.root = object.root;
    if (!r.root)
        return;
    header->is_given = true;
    header->leaves_view = karst_header_leaves_view(r.root);
    read_root(&r);
    json_decref(r.root);
}
