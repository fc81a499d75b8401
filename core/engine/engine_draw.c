/* Casting and shading a frame. */
#include <math.h>
#include <string.h>

#include "core/engine/engine_parts.h"
#include "producers/edits/edits.h"
#include "raycast/light/light.h"
#include "raycast/cast/pinhole.h"

/* Where photons bring the light that clear matter lets through, it hides the sun. */
static bool hide_sun_by_clear(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                              const karst_light *light, cl_mem shaded, karst_error *error)
{
    return !karst_engine_has_caustics(engine) || !engine->clear ||
           !karst_engine_has_content(engine, KARST_CONTENT_CLEAR) ||
           karst_cast_shadows(engine->stores[KARST_CONTENT_CLEAR].caster, view, pinhole, light, engine->shadow_rays,
                              shaded, error);
}

/* What surfaces mirror, and what is seen through clear matter. */
static bool draw_next(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                      const karst_light *light, karst_error *error)
{
    return (!engine->bounce || (karst_engine_draw_mirrored(engine, view, pinhole, light, error) &&
                                karst_engine_draw_lights(engine, view, pinhole, light, true, error))) &&
           karst_engine_trace_clear(engine, view, pinhole, KARST_FOLLOW_TO_DRAW, error);
}

/* By sun, sky and mirrors. */
static bool shade(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                  const karst_light *light, cl_mem pixels, karst_error *error)
{
    karst_buffer *parts = engine->radiance ? karst_radiance_parts(engine->radiance) : NULL;
    const cl_mem shaded = engine->radiance ? karst_radiance_marks(engine->radiance)->mem : pixels;
    if (engine->occlusion)
        karst_shader_set_occlusion(engine->shader, karst_occlusion_open(engine->occlusion));
    if (!karst_engine_draw_occlusion(engine, view, pinhole, error) ||
        !karst_shade_pixels(engine->shader, view, pinhole, light, engine->hits, engine->shadow_rays, shaded, parts,
                            engine->counters, error) ||
        !karst_engine_draw_lights(engine, view, pinhole, light, false, error) ||
        !karst_engine_cover_by_clear(engine, view, pinhole, light, error))
        return false;
    karst_profile_set_stream(engine->context, KARST_STREAM_SHADOW);
    const bool shadowed =
        !engine->shadows || ((!engine->sunward || karst_sunward_aim(engine->sunward, light->sun_direction, error)) &&
                             karst_cast_picture_shadows(engine->caster, view, pinhole, light, engine->shadow_rays,
                                                        shaded, engine->shadows_asked, engine->shadow_hints, error) &&
                             hide_sun_by_clear(engine, view, pinhole, light, shaded, error) &&
                             karst_engine_pass_sun(engine, view, pinhole, light, error));
    karst_profile_set_stream(engine->context, KARST_NUM_STREAMS);
    /* Media lie before what they dim, and say how much of what is mirrored comes through. */
    return shadowed && karst_engine_draw_media(engine, view, pinhole, light, error) &&
           (engine->alone.is_on || draw_next(engine, view, pinhole, light, error)) &&
           karst_engine_survey_media(engine, view, pinhole, light, error);
}

static bool paint(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole, cl_mem pixels,
                  karst_error *error)
{
    const karst_light light = karst_engine_light(engine);
    karst_shader_set_anchor(engine->shader, &engine->camera.position);
    if (engine->view == KARST_PAINT_BOUNCES && !karst_views_forget_bounces(engine->views, pinhole, error))
        return false;
    if (!(engine->integrator == KARST_INTEGRATOR_FULL
              ? karst_engine_draw_paths(engine, view, pinhole, &light, error)
              : shade(engine, view, pinhole, &light, pixels, error)))
        return false;
    if (engine->radiance && !karst_engine_show_radiance(engine, pixels, error))
        return false;
    if (engine->view >= KARST_PAINT_ALBEDO)
        return karst_engine_paint_values(engine, pinhole, pixels, error);
    return !engine->view ||
           karst_views_paint(engine->views, engine->view, pinhole, engine->frame, engine->hits, pixels, error);
}

/* Of a picture that is drawn anew in part, those of the camera's rays stay. */
#define CAMERA_COUNTERS 4

/* Where the counters lie in the host's memory no command is enqueued for them: between two kernels each makes a core
 * wait longer. Nothing enqueued counts when a picture begins, nor when it has ended. */
static bool clear_counters(karst_engine *engine, karst_error *error)
{
    uint32_t *counters = karst_buffer_memory(engine->counters);
    const size_t first = engine->draws_lacking ? CAMERA_COUNTERS : 0, kept_bytes = first * sizeof *engine->counted;
    if (!counters)
        return karst_buffer_fill(engine->counters, 0, kept_bytes, sizeof engine->counted - kept_bytes, error);
    memset(counters + first, 0, sizeof engine->counted - kept_bytes);
    return true;
}

static bool fetch_counters(karst_engine *engine, karst_error *error)
{
    return karst_buffer_memory(engine->counters) ||
           karst_buffer_fetch(engine->counters, 0, engine->counted, sizeof engine->counted, error);
}

/* All of a picture is enqueued in one go, so that no core waits for the host before its end. */
bool karst_engine_draw(karst_engine *engine, karst_error *error)
{
    karst_cast_view view;
    karst_pinhole pinhole;
    karst_engine_picture_view(engine, &view, &pinhole);
    engine->drawn = engine->camera;
    engine->draws_lacking = engine->held_sample && engine->held_sample == engine->sample;
    engine->held_sample = 0;
    if (!karst_engine_aim_skies(engine, error))
        return false;

    bool counting = engine->view == KARST_PAINT_STEPS;
    karst_profile_set_stream(engine->context, KARST_STREAM_PRIMARY);
    const bool cast = karst_cast_picture(counting ? engine->counting : engine->caster, &view, &pinhole, engine->hits,
                                         engine->asked, engine->hints, error);
    karst_profile_set_stream(engine->context, KARST_NUM_STREAMS);
    if (!cast || !karst_engine_cast_into_clear(engine, &view, &pinhole, true, error) ||
        !karst_engine_refine(engine, &view, &pinhole, error) ||
        !karst_engine_trace_photons(engine, &view, &pinhole, error) ||
        (engine->cover && !karst_cover_hits(engine->cover, engine->hits, error)) || !clear_counters(engine, error))
        return false;
    cl_mem pixels = karst_surface_begin(engine->surface, error);
    if (!pixels)
        return false;
    engine->drawing = true;
    return paint(engine, &view, &pinhole, pixels, error) && karst_surface_hand_over(engine->surface, error) &&
           fetch_counters(engine, error);
}

static uint64_t at_most(uint64_t num, uint64_t limit) { return num < limit ? num : limit; }

bool karst_engine_end_picture(karst_engine *engine, karst_error *error)
{
    if (!engine->drawing)
        return true;
    engine->drawing = false;
    if (!karst_surface_end(engine->surface, error))
        return false;
    const uint32_t *counters = karst_buffer_memory(engine->counters);
    if (counters)
        memcpy(engine->counted, counters, sizeof engine->counted);
    karst_stats *stats = &engine->stats;
    stats->num_pixels = (uint64_t)engine->width_px * (uint64_t)engine->height_px;
    stats->num_hits = engine->counted[0];
    /* Of mirrored rays, too: shares of the hits in pixels at most. */
    stats->num_provisional = at_most(engine->counted[1] + (uint64_t)engine->counted[6], stats->num_hits);
    stats->num_incomplete = engine->counted[2] + (uint64_t)engine->counted[7];
    stats->num_coarser = at_most(engine->counted[3] + (uint64_t)engine->counted[8], stats->num_hits);
    stats->num_rays[KARST_STREAM_PRIMARY] = stats->num_pixels;
    stats->num_rays[KARST_STREAM_SHADOW] = engine->counted[4];
    stats->num_rays[KARST_STREAM_MIRROR] = engine->counted[5];
    stats->num_rays[KARST_STREAM_CLEAR] = engine->counted[KARST_CLEAR_COUNT_RAYS];
    stats->num_rays[KARST_STREAM_OCCLUSION] = engine->occlusion ? engine->counted[0] / KARST_OCCLUSION_BLOCK : 0;
    stats->num_rays_cut = engine->counted[KARST_CLEAR_COUNT_CUT];
    return true;
}
