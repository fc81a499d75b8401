/* Clear matter in pictures: which rays are cast into it, and when. */
#include <math.h>

#include "core/engine/engine_parts.h"

/* passing: of the picture, as long. */
static karst_clear_picture picture_of(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                      const karst_light *light, karst_pass_picture *passing)
{
    const bool has_clear = karst_engine_has_content(engine, KARST_CONTENT_CLEAR);
    karst_clear_picture picture = {
        .view = view,
        .pinhole = pinhole,
        .light = light,
        .land = engine->caster,
        .clear = has_clear ? engine->stores[KARST_CONTENT_CLEAR].caster : NULL,
        .shader = engine->shader,
        .clear_shader = engine->shown.clear_shader,
        .voxel_m = exp2(engine->world->voxel_log2_m),
        .bounces = engine->bounces,
        .refiner = engine->shown.content[KARST_CONTENT_CLEAR].refining.refiner,
        .bender = has_clear ? engine->shown.bending.bender : NULL,
        .hits = engine->hits,
        .parts = karst_radiance_parts(engine->radiance),
        .shadow_rays = engine->shadow_rays,
        .counters = engine->counters,
        .pass = karst_engine_pass_picture(engine, view, pinhole, light, passing),
        .has_caustics = karst_engine_has_caustics(engine),
    };
    picture.is_inside =
        has_clear && karst_engine_is_in_clear(engine, &engine->camera.position, picture.absorption_per_m);
    karst_clear_shader_set_anchor(engine->shown.clear_shader, &engine->camera.position);
    return picture;
}

bool karst_engine_world_build_clear(karst_engine_world *world, karst_context *context,
                                    const karst_engine_wishes *wishes, karst_error *error)
{
    const karst_world_file *file = world->file->content[KARST_CONTENT_CLEAR];
    const karst_producer *producer = world->content[KARST_CONTENT_CLEAR].producer;
    char options[KARST_WORLD_FILE_OPTIONS_BYTES];
    karst_shade_colour surface = {.options = options};
    /* Land that lets light pass has streams of the same kind. */
    const bool has_clear = wishes->contents >> KARST_CONTENT_CLEAR & 1u,
               passes = wishes->shade & KARST_SHADE_PASS && wishes->shade & KARST_SHADE_MIRROR;
    const unsigned ways = (world->file->info.has_atmosphere ? KARST_CLEAR_ATMOSPHERE : 0u) |
                          (has_clear && karst_engine_world_bends(world) ? KARST_CLEAR_BENDS : 0u) |
                          (passes ? KARST_CLEAR_PASSES : 0u);
    if (!has_clear && !passes)
        return true;
    const bool has_surface = file && producer && file->code.colour_source;
    if (has_surface) {
        karst_world_file_colour_options(file, options);
        surface.source = file->code.colour_source;
        surface.data = producer->data[0];
    }
    world->clear_shader = karst_clear_shader_create(context, ways, has_surface ? &surface : NULL, error);
    if (!has_clear)
        return world->clear_shader != NULL;
    return world->clear_shader && karst_engine_world_build_clear_refiner(world, context, error) &&
           karst_engine_world_build_bending(world, context, wishes->refine, error);
}

bool karst_engine_cast_into_clear(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                  bool keeps, karst_error *error)
{
    if (!engine->clear || !karst_engine_has_content(engine, KARST_CONTENT_CLEAR))
        return true;
    const karst_light light = {.pad = {0}}; /* none is looked at */
    karst_pass_picture passing;
    const karst_clear_picture picture = picture_of(engine, view, pinhole, &light, &passing);
    return karst_clear_cast_camera(engine->clear, &picture, keeps, error);
}

bool karst_engine_cover_by_clear(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                 const karst_light *light, karst_error *error)
{
    if (!engine->clear)
        return true;
    karst_pass_picture passing;
    const karst_clear_picture picture = picture_of(engine, view, pinhole, light, &passing);
    return karst_clear_cover(engine->clear, &picture, error);
}

typedef struct {
    karst_engine *engine;
    const karst_cast_view *view;
    const karst_pinhole *pinhole;
    const karst_light *light;
} lit_stream;

/* To what is seen through clear matter, or in it. */
static bool add_lights(void *user, const karst_bounce *bounce, bool again, karst_error *error)
{
    const lit_stream *lit = user;
    const karst_bounce_stream stream = karst_bounce_get_stream(bounce);
    karst_path_picture picture = karst_engine_path_picture(lit->engine, lit->view, lit->pinhole, lit->light, again);
    picture.mirrors = false;
    return karst_engine_draw_lights_of(lit->engine, &picture, stream.rays, stream.total, stream.hits, error);
}

/* Media before what a stream sees. */
static bool veil(void *user, const karst_clear_stream *of, bool again, karst_error *error)
{
    const lit_stream *lit = user;
    const karst_media_stream stream = {.rays = of->stream->rays,
                                       .count = of->stream->total,
                                       .hits = of->stream->hits,
                                       .over_hits = of->over_hits,
                                       .ways = of->ways,
                                       .max_rays = of->stream->room,
                                       .adds = !again};
    return (again || karst_engine_count_bounces(lit->engine, lit->pinhole, of->stream, error)) &&
           karst_engine_veil_stream(lit->engine, lit->view, lit->pinhole, lit->light, &stream, error);
}

bool karst_engine_trace_clear(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                              karst_follow follow, karst_error *error)
{
    if (!engine->clear)
        return true;
    const karst_light light = karst_engine_light(engine);
    karst_pass_picture passing;
    karst_clear_picture picture = picture_of(engine, view, pinhole, &light, &passing);
    lit_stream lit = {engine, view, pinhole, &light};
    picture.only_lacking = follow == KARST_FOLLOW_LACKING;
    picture.user = &lit;
    picture.veil = veil;
    if (karst_engine_has_caustics(engine) || (engine->pass && engine->paths))
        picture.more = add_lights;
    return karst_clear_trace(engine->clear, &picture, follow != KARST_FOLLOW_TO_DRAW, error);
}
