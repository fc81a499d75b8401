/* What land mirrors: the second stream of a picture's rays, and its shadows. */
#include "core/engine/engine_parts.h"

/* For what surfaces mirror: of bumpy ones next to each other the rays part. */
static karst_cast_view mirrored_view(const karst_cast_view *view)
{
    karst_cast_view wide = *view;
    wide.blend_below = KARST_WIDE_RAYS;
    return wide;
}

/* Media before what the mirrored rays see. */
static bool veil(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                 const karst_light *light, bool adds, karst_error *error)
{
    const karst_bounce_stream rays = karst_bounce_get_stream(engine->bounce);
    const karst_media_stream stream = {.rays = rays.rays,
                                       .count = rays.total,
                                       .hits = rays.hits,
                                       .max_rays = karst_bounce_room(pinhole->width_px, pinhole->height_px),
                                       .adds = adds};
    return (!adds || karst_engine_count_bounces(engine, pinhole, &rays, error)) &&
           karst_engine_veil_stream(engine, view, pinhole, light, &stream, error);
}

bool karst_engine_draw_mirrored(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                const karst_light *light, karst_error *error)
{
    karst_bounce *bounce = engine->bounce;
    karst_buffer *parts = karst_radiance_parts(engine->radiance);
    if (!karst_bounce_mirror(bounce, view, pinhole, engine->hits, parts, engine->counters, error))
        return false;
    karst_profile_set_stream(engine->context, KARST_STREAM_MIRROR);
    const karst_cast_view wide = mirrored_view(view);
    bool done = karst_bounce_cast(bounce, engine->caster, &wide, false, error);
    karst_profile_set_stream(engine->context, KARST_NUM_STREAMS);
    done = done && veil(engine, view, pinhole, light, true, error) &&
           karst_bounce_shade(bounce, engine->shader, view, pinhole, light, parts, engine->counters, error);
    if (!done || !engine->shadows)
        return done;
    karst_profile_set_stream(engine->context, KARST_STREAM_SHADOW);
    done = karst_bounce_cast_shadows(bounce, engine->caster, view, pinhole, light, false, error);
    karst_profile_set_stream(engine->context, KARST_NUM_STREAMS);
    return done && karst_bounce_add_sun(bounce, pinhole, parts, error);
}

bool karst_engine_look_at_mirrored(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                   karst_error *error)
{
    const karst_cast_view wide = mirrored_view(view);
    const karst_light light = karst_engine_light(engine);
    return karst_bounce_cast(engine->bounce, engine->caster, &wide, true, error) &&
           veil(engine, view, pinhole, &light, false, error);
}

bool karst_engine_look_at_mirrored_shadows(karst_engine *engine, const karst_cast_view *view,
                                           const karst_pinhole *pinhole, karst_error *error)
{
    const karst_light light = karst_engine_light(engine);
    return !engine->shadows ||
           (karst_bounce_cast_shadows(engine->bounce, engine->caster, view, pinhole, &light, true, error) &&
            karst_engine_look_at_mirrored_lights(engine, view, pinhole, error));
}
