/* Samples of a picture: each frame draws one, and those that lack nothing are summed. */
#include <math.h>
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

bool karst_engine_show_radiance(karst_engine *engine, cl_mem pixels, karst_error *error)
{
    const karst_radiance_look look = {.tone = (uint32_t)engine->tone,
                                      .exposure = exposure_factor(engine),
                                      .x0_px = engine->window.x0_px,
                                      .y0_px = engine->window.y0_px};
    return karst_radiance_show(engine->radiance, engine->width_px, engine->height_px, engine->num_summed,
                               engine->num_summed < engine->samples, &look, pixels, error);
}

bool karst_engine_end_sample(karst_engine *engine, bool complete, bool detail_changed, karst_error *error)
{
    if (detail_changed)
        engine->num_summed = 0;
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
