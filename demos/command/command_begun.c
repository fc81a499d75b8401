/* Going on with the samples of an .exr. Its note says what its light depends on; only the very same picture is gone on
 * with, so that samples taken in two goes are those of one. */
#include "command_begun.h"

#include <errno.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "command_farm.h"

#define FORMAT 1

struct command_begun {
    karst_image_reader *file;
    uint32_t num_samples;
};

/* ---- what it depends on ---- */

/* A file by its name and sum; null: there is none. */
static json_t *describe_file(const char *file, karst_error *error)
{
    command_checksum sum;
    char text[64];
    if (!file)
        return json_null();
    if (!command_checksum_file(file, &sum, error))
        return NULL;
    snprintf(text, sizeof text, "%llu bytes, CRC-32 %08x", (unsigned long long)sum.size_bytes, sum.crc32);
    return json_string(text);
}

static json_t *describe_parameters(const karst_engine_config *config)
{
    json_t *values = json_object();
    for (size_t i = 0; i < config->num_parameters; i++)
        json_object_set_new(values, config->parameters[i].name, json_real(config->parameters[i].value));
    return values;
}

char *command_describe_picture(const karst_engine_config *config, const char *camera, double time_s,
                               const int size_px[2], const int window_px[4], karst_error *error)
{
    json_t *world = describe_file(config->world, error), *edits = describe_file(config->edits, error);
    json_t *sun =
        config->has_sun ? json_pack("[f,f]", config->sun.azimuth_deg, config->sun.elevation_deg) : json_null();
    json_t *seed = config->has_seed ? json_integer(config->seed) : json_null();
    char *text = NULL;
    json_t *root =
        !world || !edits
            ? NULL
            : json_pack("{s:i, s:s, s:O, s:O, s:o, s:O, s:s, s:f, s:O, s:[i,i], s:[i,i,i,i], s:f, s:f, s:I, s:i, s:i, "
                        "s:b, s:b, s:b, s:f, s:i, s:i, s:i, s:I}",
                        "karst_sums", FORMAT, "version", karst_version(), "world", world, "edits", edits, "parameters",
                        describe_parameters(config), "seed", seed, "camera", camera, "time", time_s, "sun", sun, "size",
                        size_px[0], size_px[1], "window", window_px[0], window_px[1], window_px[2], window_px[3],
                        "detail", config->detail_px, "view distance", config->view_distance_m, "pool",
                        (json_int_t)config->pool_bytes, "brick bits", config->brick_bits, "thin", (int)config->thin,
                        "refine", config->refine, "shadows", !config->no_shadows, "blend", !config->no_blend, "mirror",
                        config->mirror, "light", (int)config->integrator, "bounces", (int)config->bounces, "media",
                        (int)config->media, "samples", (json_int_t)config->samples);
    if (root)
        text = json_dumps(root, JSON_REAL_PRECISION(17));
    if (!text)
        karst_fail(error, KARST_FAILED, "out of memory");
    json_decref(root);
    json_decref(world);
    json_decref(edits);
    json_decref(sun);
    json_decref(seed);
    return text;
}

/* ---- comparing ---- */

static bool refuse(const char *file, const char *why, karst_error *error)
{
    return karst_fail(error, KARST_BAD_DATA, "%s: %s: leave --resume out to begin anew, or name another file", file,
                      why);
}

static bool compare_notes(const char *file, const json_t *here, const json_t *there, karst_error *error)
{
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)(uintptr_t)here, key, value)
    {
        const json_t *other = json_object_get(there, key);
        if (strcmp(key, "samples") == 0 || json_equal(value, other))
            continue;
        char *ours = json_dumps(value, JSON_ENCODE_ANY | JSON_REAL_PRECISION(9));
        char *theirs = other ? json_dumps(other, JSON_ENCODE_ANY | JSON_REAL_PRECISION(9)) : NULL;
        char why[300];
        snprintf(why, sizeof why, "is of another picture (%s: %.90s there, %.90s here)", key,
                 theirs ? theirs : "nothing", ours ? ours : "something");
        free(ours);
        free(theirs);
        return refuse(file, why, error);
    }
    return true;
}

static bool check(const char *file, const char *note, command_begun *b, bool *is_done, karst_error *error)
{
    const char *own = karst_image_note(b->file);
    json_t *here = json_loads(note, 0, NULL), *there = own ? json_loads(own, JSON_REJECT_DUPLICATES, NULL) : NULL;
    const json_int_t has = json_integer_value(json_object_get(there, "samples"));
    const json_int_t wants = json_integer_value(json_object_get(here, "samples"));
    bool done;
    if (json_integer_value(json_object_get(there, "karst_sums")) != FORMAT || has < 1 || has > KARST_ENGINE_MAX_SAMPLES)
        done = refuse(file, "holds no sums of samples of karst render", error);
    else
        done = compare_notes(file, here, there, error);
    if (done && has > wants)
        done = karst_fail(error, KARST_BAD_DATA, "%s: has %lld samples already: ask for more than that with --samples",
                          file, (long long)has);
    b->num_samples = done ? (uint32_t)has : 0;
    *is_done = done && has == wants;
    json_decref(here);
    json_decref(there);
    return done;
}

bool command_begun_open(const char *file, const char *note, command_begun **begun, bool *is_done, karst_error *error)
{
    int width_px, height_px;
    *begun = NULL;
    *is_done = false;
    if (access(file, F_OK) != 0 && errno == ENOENT)
        return true;
    command_begun *b = calloc(1, sizeof *b);
    if (!b)
        return karst_fail(error, KARST_FAILED, "out of memory");
    b->file = karst_image_open_exr(file, &width_px, &height_px, error);
    const bool good = b->file && check(file, note, b, is_done, error);
    if (good && !*is_done)
        *begun = b;
    else
        command_begun_close(b);
    return good;
}

bool command_begun_detail(const char *file, double *detail_px, karst_error *error)
{
    int width_px, height_px;
    if (access(file, F_OK) != 0 && errno == ENOENT)
        return true;
    karst_image_reader *reader = karst_image_open_exr(file, &width_px, &height_px, error);
    const char *note = reader ? karst_image_note(reader) : NULL;
    json_t *root = note ? json_loads(note, JSON_REJECT_DUPLICATES, NULL) : NULL;
    const double found_px = json_number_value(json_object_get(root, "detail"));
    if (found_px >= 0.25 && found_px <= 64)
        *detail_px = found_px;
    json_decref(root);
    karst_image_close(reader);
    return reader != NULL;
}

uint32_t command_begun_samples(const command_begun *begun) { return begun->num_samples; }

bool command_begun_read(command_begun *begun, int y_px, int num_rows, float *sums, karst_error *error)
{
    const char *names[3];
    for (int i = 0; i < 3; i++)
        names[i] = karst_aov_channel(KARST_AOV_SUMS, i);
    return karst_image_read_rows(begun->file, names, 3, y_px, num_rows, sums, error);
}

bool command_begun_give(command_begun *begun, karst_engine *engine, const int size_px[2], karst_error *error)
{
    const size_t num = 3 * (size_t)size_px[0] * (size_t)size_px[1];
    float *sums = malloc(num * sizeof *sums);
    const bool done =
        sums ? command_begun_read(begun, 0, size_px[1], sums, error) &&
                   karst_engine_set_sums(engine, sums, num, begun->num_samples, error)
             : karst_fail(error, KARST_FAILED, "out of memory for the sums of %dx%d", size_px[0], size_px[1]);
    free(sums);
    return done;
}

void command_begun_close(command_begun *begun)
{
    if (!begun)
        return;
    karst_image_close(begun->file);
    free(begun);
}
