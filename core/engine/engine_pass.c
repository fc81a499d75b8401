/* Land that lets light pass: what of pictures concerns that. */
#include <math.h>

#include "core/engine/engine_parts.h"

bool karst_engine_wants_pass(const karst_engine_config *config, const karst_world_info *world)
{
    return world->has_transparency && config->mirror >= 0;
}

/* Rays of a picture's streams: to lamps there may be as many as paths have room for. */
static uint32_t most_rays(const karst_engine *engine)
{
    const uint32_t room = karst_bounce_room(engine->width_px, engine->height_px),
                   paths = karst_paths_room((size_t)engine->width_px * (size_t)engine->height_px);
    return room > paths ? room : paths;
}

bool karst_engine_allocate_pass(karst_engine *engine, karst_error *error)
{
    return !engine->pass || karst_pass_set_room(engine->pass, most_rays(engine), error);
}

double karst_engine_pass_bytes(const karst_engine *engine)
{
    return engine->pass ? karst_pass_bytes(most_rays(engine)) : 0;
}

const karst_pass_picture *karst_engine_pass_picture(const karst_engine *engine, const karst_cast_view *view,
                                                    const karst_pinhole *pinhole, const karst_light *light,
                                                    karst_pass_picture *picture)
{
    *picture = (karst_pass_picture){.pass = engine->pass,
                                    .land = engine->caster,
                                    .shader = engine->shader,
                                    .view = view,
                                    .pinhole = pinhole,
                                    .light = light,
                                    .counters = engine->counters};
    return engine->pass ? picture : NULL;
}

bool karst_engine_pass_sun(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                           const karst_light *light, karst_error *error)
{
    karst_pass_picture picture;
    if (!engine->shadows || !karst_engine_pass_picture(engine, view, pinhole, light, &picture))
        return true;
    karst_buffer *parts = karst_radiance_parts(engine->radiance);
    const size_t plane = (size_t)pinhole->width_px * (size_t)pinhole->height_px;
    const karst_pass_dark dark = {.shadow_rays = engine->shadow_rays,
                                  .marks = karst_radiance_marks(engine->radiance),
                                  .suns = parts,
                                  .first = KARST_RADIANCE_PLANES * plane,
                                  .stride = plane,
                                  .pinhole = pinhole};
    return karst_pass_sun(&picture, &dark, parts, error);
}
