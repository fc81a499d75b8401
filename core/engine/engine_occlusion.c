/* How open a picture's surfaces are to the light from all around. */
#include <stdlib.h>

#include "core/engine/engine_parts.h"

bool karst_engine_wants_occlusion(const karst_engine_config *config, const karst_world_info *world)
{
    return config->integrator == KARST_INTEGRATOR_DIRECT && !world->has_light_map && /* which knows better */
           (config->occlusion == KARST_OCCLUSION_ON ||
            (config->occlusion == KARST_OCCLUSION_OF_WORLD && world->has_occlusion));
}

static bool has_window(const karst_engine *engine) { return engine->window.whole_width_px != 0; }

/* What a window looks at on an axis: what counts for the fits before and behind it, from where one is made to the last
 * probe, or the whole's last pixel. */
static void look_around(int first_px, int num_px, int whole_px, int step, int *begin_px, int *end_px)
{
    const int apart = KARST_OCCLUSION_FIT_STEP * step,
              reach = (KARST_OCCLUSION_REACH * step + apart - 1) / apart * apart;
    const int begin = first_px / apart * apart - reach,
              last = (first_px + num_px - 1 + apart - 1) / apart * apart + reach;
    *begin_px = begin > 0 ? begin : 0;
    *end_px = (last < whole_px - 1 ? last : whole_px - 1) + 1;
}

/* What is looked at: the picture, or a window with what is around it; and where the picture begins in that. */
static karst_pinhole what_is_seen(const karst_engine *engine, const karst_pinhole *picture, int *left_px, int *top_px)
{
    const karst_engine_window *w = &engine->window;
    karst_pinhole seen = *picture;
    int left, right, top, below;
    *left_px = *top_px = 0;
    if (!has_window(engine))
        return seen;
    look_around(w->x0_px, engine->width_px, w->whole_width_px, KARST_OCCLUSION_STEP_X, &left, &right);
    look_around(w->y0_px, engine->height_px, w->whole_height_px, KARST_OCCLUSION_STEP_Y, &top, &below);
    *left_px = w->x0_px - left;
    *top_px = w->y0_px - top;
    karst_pinhole_init(&seen, &engine->drawn, w->whole_width_px, w->whole_height_px, engine->view_distance_voxels);
    karst_pinhole_cut(&seen, left, top, right - left, below - top);
    seen.sample = picture->sample;
    return seen;
}

bool karst_engine_allocate_occlusion(karst_engine *engine, karst_error *error)
{
    return !engine->occlusion || karst_occlusion_set_room(engine->occlusion, engine->width_px, engine->height_px,
                                                          has_window(engine), error);
}

double karst_engine_occlusion_bytes(const karst_engine *engine)
{
    return engine->occlusion ? karst_occlusion_bytes(engine->width_px, engine->height_px, has_window(engine)) : 0;
}

bool karst_engine_draw_occlusion(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                 karst_error *error)
{
    karst_occlusion *occlusion = engine->occlusion;
    int left_px, top_px;
    if (!occlusion)
        return true;
    const karst_pinhole seen = what_is_seen(engine, pinhole, &left_px, &top_px);
    karst_buffer *hits = has_window(engine) ? karst_occlusion_hits(occlusion) : engine->hits;
    if (has_window(engine) && !(karst_cast_pinhole(engine->caster, view, &seen, hits, error) &&
                                karst_engine_refine_hits(engine, view, &seen, hits, error)))
        return false;
    if (!karst_occlusion_aim(occlusion, view, &seen, hits, error))
        return false;
    karst_profile_set_stream(engine->context, KARST_STREAM_OCCLUSION);
    const bool cast = karst_occlusion_cast(occlusion, engine->caster, view, false, error);
    karst_profile_set_stream(engine->context, KARST_NUM_STREAMS);
    return cast && karst_occlusion_gather(occlusion, pinhole, hits, left_px, top_px, error);
}

bool karst_engine_look_at_occlusion(karst_engine *engine, const karst_cast_view *view, karst_error *error)
{
    return !engine->occlusion || karst_occlusion_cast(engine->occlusion, engine->caster, view, true, error);
}

bool karst_engine_read_occlusion(karst_engine *engine, float *open, size_t num_values, karst_error *error)
{
    const uint32_t width = (uint32_t)engine->width_px, height = (uint32_t)engine->height_px;
    karst_cast_view view;
    karst_pinhole pinhole;
    if (!engine->occlusion)
        return karst_fail(error, KARST_USAGE,
                          "an engine without occlusion does not know it: make it with karst_engine_config.occlusion "
                          "(--occlusion)");
    float *ordered = malloc(num_values * sizeof *ordered);
    if (!ordered)
        return karst_fail(error, KARST_FAILED, "out of memory for reading occlusion");
    const karst_camera camera = engine->camera;
    engine->camera = engine->drawn;
    karst_engine_picture_view(engine, &view, &pinhole);
    engine->camera = camera;
    const bool done = karst_engine_draw_occlusion(engine, &view, &pinhole, error) &&
                      karst_buffer_read(karst_occlusion_open(engine->occlusion), 0, ordered,
                                        num_values * sizeof *ordered, error);
    for (uint32_t y = 0; done && y < height; y++)
        for (uint32_t x = 0; x < width; x++)
            *open++ = ordered[karst_packet_order(x, y, width, height)];
    free(ordered);
    return done;
}
