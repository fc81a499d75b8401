/* Samples of a picture: each frame draws one, and those that lack nothing are summed. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/engine/engine_parts.h"

static const char *const tone_names[KARST_NUM_TONES] = {"plain", "filmic"};

_Static_assert((unsigned)KARST_TONE_OF_PLAIN == KARST_TONE_PLAIN && (unsigned)KARST_TONE_OF_FILM == KARST_TONE_FILMIC,
               "tones have their own numbers in kernels");

bool karst_tone_parse(const char *name, karst_tone *tone, karst_error *error)
{
    for (int i = 0; i < KARST_NUM_TONES; i++)
        if (strcmp(name, tone_names[i]) == 0) {
            *tone = (karst_tone)i;
            return true;
        }
    return karst_fail(error, KARST_USAGE, "no tone is called '%.40s'; there are: plain, filmic", name);
}

/* Once there are enough, the pixels' centres are looked at: depth and normals are theirs. */
uint32_t karst_engine_choose_sample(const karst_engine *engine, bool moves)
{
    if (engine->samples == 1 || (moves && engine->budget_ns > 0))
        return 0;
    return engine->num_summed < engine->samples ? engine->num_summed + 1 : 0;
}

/* As configured, or as the world says; 0: by what the picture shows. */
static float exposure_factor(const karst_engine *engine)
{
    if (engine->exposure == KARST_EXPOSURE_GIVEN)
        return (float)exp2(engine->exposure_stops);
    if (engine->exposure == KARST_EXPOSURE_OF_PICTURE)
        return 0;
    if (engine->tone == KARST_TONE_OF_PLAIN)
        return 1;
    return engine->world->has_exposure ? (float)exp2(engine->world->exposure_stops) : 0;
}

bool karst_engine_check_exposure(karst_exposure exposure, double stops, karst_error *error)
{
    if ((unsigned)exposure >= KARST_NUM_EXPOSURES)
        return karst_fail(error, KARST_USAGE, "there is no exposure number %d", (int)exposure);
    return exposure != KARST_EXPOSURE_GIVEN || fabs(stops) <= KARST_ENGINE_MAX_EXPOSURE ||
           karst_fail(error, KARST_USAGE, "an exposure of %g stops: it may be -%d to %d", stops,
                      KARST_ENGINE_MAX_EXPOSURE, KARST_ENGINE_MAX_EXPOSURE);
}

karst_exposure karst_engine_get_exposure(const karst_engine *engine, double *stops)
{
    if (stops)
        *stops = engine->exposure_stops;
    return engine->exposure;
}

bool karst_engine_set_exposure(karst_engine *engine, karst_exposure exposure, double stops, karst_error *error)
{
    if (!engine->radiance)
        return karst_fail(error, KARST_USAGE, "an engine of one sample and plain tone keeps bytes, not light");
    if (!karst_engine_check_exposure(exposure, stops, error))
        return false;
    engine->exposure = exposure;
    engine->exposure_stops = exposure == KARST_EXPOSURE_GIVEN ? stops : 0;
    return true;
}

/* ---- rows of light, apart from frames ---- */

static bool check_rows(const karst_engine *engine, int width_px, int height_px, karst_error *error)
{
    if (!karst_engine_check_size(width_px, height_px, error))
        return false;
    if (!engine->radiance)
        return karst_fail(error, KARST_USAGE, "an engine of one sample and plain tone keeps bytes, not light");
    return (size_t)width_px * (size_t)height_px <= engine->room_px ||
           karst_fail(error, KARST_USAGE, "%dx%d pixels of light: there is room for %zu", width_px, height_px,
                      engine->room_px);
}

/* They take the place of what was summed: frames begin anew. */
static bool load_rows(karst_engine *engine, const float *rgb, int width_px, int height_px, karst_error *error)
{
    engine->view_changed = true;
    return check_rows(engine, width_px, height_px, error) &&
           karst_radiance_load(engine->radiance, width_px, height_px, rgb, error);
}

bool karst_engine_meter(karst_engine *engine, const float *rgb, int width_px, int height_px, karst_error *error)
{
    const uint64_t num = engine->num_metered_px + (uint64_t)width_px * (uint64_t)height_px;
    if (!check_rows(engine, width_px, height_px, error))
        return false;
    if (num > UINT32_MAX)
        return karst_fail(error, KARST_USAGE, "a picture of more than %u pixels is not metered", UINT32_MAX);
    if (!load_rows(engine, rgb, width_px, height_px, error) ||
        !karst_radiance_count(engine->radiance, width_px, height_px, error))
        return false;
    engine->num_metered_px = num;
    return true;
}

/* As given, or as metered. */
static bool find_exposure(karst_engine *engine, float *exposure, karst_error *error)
{
    *exposure = exposure_factor(engine);
    if (*exposure > 0)
        return true;
    if (engine->num_metered_px) {
        if (!karst_radiance_expose(engine->radiance, (uint32_t)engine->num_metered_px, error) ||
            !karst_radiance_read_exposure(engine->radiance, &engine->metered_exposure, error))
            return false;
        engine->num_metered_px = 0;
    }
    *exposure = engine->metered_exposure;
    return *exposure > 0 ||
           karst_fail(error, KARST_USAGE, "the exposure follows the picture, and nothing of it was metered");
}

bool karst_engine_tone(karst_engine *engine, const float *rgb, int x0_px, int y0_px, int width_px, int height_px,
                       uint8_t *rgba, karst_error *error)
{
    karst_radiance_look look = {.tone = (uint32_t)engine->tone, .x0_px = x0_px, .y0_px = y0_px};
    const size_t size_bytes = 4 * (size_t)width_px * (size_t)height_px;
    if (!check_rows(engine, width_px, height_px, error) || !find_exposure(engine, &look.exposure, error) ||
        !load_rows(engine, rgb, width_px, height_px, error))
        return false;
    karst_buffer *pixels = karst_buffer_create_blank(engine->context, "pixels", size_bytes, error);
    const bool done = pixels &&
                      karst_radiance_show(engine->radiance, width_px, height_px, 1, false, &look, pixels->mem, error) &&
                      karst_buffer_read(pixels, 0, rgba, size_bytes, error);
    karst_buffer_destroy(pixels);
    return done;
}

/* ---- samples ---- */

bool karst_engine_show_radiance(karst_engine *engine, cl_mem pixels, karst_error *error)
{
    const karst_radiance_look look = {.tone = (uint32_t)engine->tone,
                                      .exposure = exposure_factor(engine),
                                      .x0_px = engine->window.x0_px,
                                      .y0_px = engine->window.y0_px};
    return karst_radiance_show(engine->radiance, engine->width_px, engine->height_px, engine->num_summed,
                               engine->num_summed < engine->samples, &look, pixels, error);
}

bool karst_engine_restart_samples(karst_engine *engine, bool view_changed, karst_error *error)
{
    /* Sums that were given are of the view that followed. */
    if (view_changed && !engine->sums_are_new) {
        free(engine->given_sums);
        engine->given_sums = NULL;
    }
    if (view_changed)
        engine->sums_are_new = false;
    engine->num_summed = engine->held_sample = 0;
    if (!engine->given_sums)
        return true;
    if (!karst_radiance_load(engine->radiance, engine->width_px, engine->height_px, engine->given_sums, error))
        return false;
    engine->num_summed = engine->num_given;
    return true;
}

bool karst_engine_set_sums(karst_engine *engine, const float *rgb, size_t num_values, uint32_t num_samples,
                           karst_error *error)
{
    const size_t num = 3 * (size_t)engine->width_px * (size_t)engine->height_px;
    if (num_values != num)
        return karst_fail(error, KARST_USAGE, "sums of %dx%d are %zu values, not %zu", engine->width_px,
                          engine->height_px, num, num_values);
    if (!engine->radiance)
        return karst_fail(error, KARST_USAGE, "an engine of one sample and plain tone keeps bytes, not light");
    if (num_samples < 1 || num_samples >= engine->samples)
        return karst_fail(error, KARST_USAGE, "sums of %u samples: 1 to %u may be given, as the picture has %u",
                          num_samples, engine->samples - 1, engine->samples);
    float *copy = malloc(num * sizeof *copy);
    if (!copy)
        return karst_fail(error, KARST_FAILED, "out of memory for the sums of %dx%d", engine->width_px,
                          engine->height_px);
    memcpy(copy, rgb, num * sizeof *copy);
    free(engine->given_sums);
    engine->given_sums = copy;
    engine->num_given = num_samples;
    engine->sums_are_new = engine->view_changed = true;
    return true;
}

bool karst_engine_end_sample(karst_engine *engine, bool complete, bool detail_changed, karst_error *error)
{
    if (detail_changed && !karst_engine_restart_samples(engine, false, error))
        return false;
    /* What was drawn while something moved is none of the samples. */
    if (!complete || engine->num_summed == engine->samples || (engine->samples > 1 && !engine->sample))
        return true;
    if (engine->radiance && !karst_radiance_add(engine->radiance, engine->width_px, engine->height_px,
                                                engine->num_summed, error))
        return false;
    engine->num_summed++;
    return true;
}

/* Where none is complete, the one at hand is what there is to read. */
bool karst_engine_keep_sample(karst_engine *engine, karst_error *error)
{
    if (engine->num_summed || engine->kept)
        return true;
    engine->kept = true;
    return karst_radiance_add(engine->radiance, engine->width_px, engine->height_px, 0, error);
}

bool karst_engine_keeps_radiance(const karst_engine *engine) { return engine->radiance != NULL; }

bool karst_engine_read_radiance(karst_engine *engine, float *rgb, size_t num_values, karst_error *error)
{
    const size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    if (num_values != 3 * num_pixels)
        return karst_fail(error, KARST_USAGE, "the light of %dx%d is %zu values, not %zu", engine->width_px,
                          engine->height_px, 3 * num_pixels, num_values);
    if (!engine->radiance)
        return karst_fail(error, KARST_USAGE,
                          "an engine of one sample and plain tone keeps bytes, not light");
    if (!engine->hits || engine->frame == 0)
        return karst_fail(error, KARST_USAGE, "no frame has been drawn yet");
    if (!karst_engine_keep_sample(engine, error))
        return false;
    return karst_radiance_read(engine->radiance, engine->width_px, engine->height_px,
                               engine->num_summed ? engine->num_summed : 1, rgb, error);
}

bool karst_engine_read_sums(karst_engine *engine, float *rgb, karst_error *error)
{
    if (!engine->radiance)
        return karst_fail(error, KARST_USAGE, "an engine of one sample and plain tone keeps bytes, not light");
    return karst_engine_keep_sample(engine, error) &&
           karst_radiance_read(engine->radiance, engine->width_px, engine->height_px, 1, rgb, error);
}
