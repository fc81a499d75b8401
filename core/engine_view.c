/* What a viewer asks of an engine: see karst/view.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/engine_parts.h"
#include "karst/view.h"

bool karst_engine_set_drawn_size(karst_engine *engine, int width_px, int height_px, karst_error *error)
{
    if (!karst_engine_check_size(width_px, height_px, error))
        return false;
    if ((size_t)width_px * (size_t)height_px > engine->room_px)
        return karst_fail(error, KARST_USAGE, "pictures of %dx%d: there is room for %zu pixels only", width_px,
                          height_px, engine->room_px);
    if (width_px == engine->width_px && height_px == engine->height_px && engine->surface)
        return true;
    karst_surface *surface = karst_surface_create(engine->context, engine->display, width_px, height_px, error);
    if (!surface)
        return false;
    karst_surface_destroy(engine->surface);
    engine->surface = surface;
    engine->width_px = width_px;
    engine->height_px = height_px;
    engine->view_changed = true;
    engine->have_previous = false;
    return true;
}

bool karst_engine_set_budget_ms(karst_engine *engine, double budget_ms, karst_error *error)
{
    if (!karst_engine_check_budget_ms(budget_ms, error))
        return false;
    engine->budget_ns = budget_ms * 1e6;
    return true;
}

bool karst_engine_show(karst_engine *engine, karst_error *error)
{
    if (!engine->surface || engine->frame == 0)
        return karst_fail(error, KARST_USAGE, "no frame has been drawn yet");
    return karst_surface_show(engine->surface, error);
}

bool karst_engine_probe(karst_engine *engine, int x_px, int y_px, karst_probe *probe, karst_error *error)
{
    if (!engine->hits || engine->frame == 0)
        return karst_fail(error, KARST_USAGE, "no frame has been drawn yet");
    if (x_px < 0 || y_px < 0 || x_px >= engine->width_px || y_px >= engine->height_px)
        return karst_fail(error, KARST_USAGE, "pixel %d,%d lies outside the picture of %dx%d", x_px, y_px,
                          engine->width_px, engine->height_px);
    karst_hit hit;
    size_t place =
        karst_packet_order((uint32_t)x_px, (uint32_t)y_px, (uint32_t)engine->width_px, (uint32_t)engine->height_px);
    if (!karst_buffer_read(engine->hits, place * sizeof hit, &hit, sizeof hit, error))
        return false;
    *probe = (karst_probe){.hit = KARST_HIT_KIND(hit.kind) != KARST_HIT_MISS,
                           .provisional = KARST_HIT_KIND(hit.kind) == KARST_HIT_PROVISIONAL,
                           .depth_m = INFINITY};
    if (probe->hit) {
        probe->level = (int)KARST_HIT_LEVEL(hit.kind);
        probe->depth_m = ldexp(hit.t, engine->world->voxel_log2_m);
    }
    return true;
}
