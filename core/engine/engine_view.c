/* What a viewer asks of an engine: see karst/view.h. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/engine/engine_parts.h"
#include "karst/view.h"
#include "raycast/cast/pinhole.h"

bool karst_engine_set_drawn_size(karst_engine *engine, int width_px, int height_px, karst_error *error)
{
    if (!karst_engine_check_size(width_px, height_px, error) || !karst_engine_check_whole(engine, error))
        return false;
    if ((size_t)width_px * (size_t)height_px > engine->room_px)
        return karst_fail(error, KARST_USAGE, "pictures of %dx%d: there is room for %zu pixels only", width_px,
                          height_px, engine->room_px);
    if (width_px == engine->width_px && height_px == engine->height_px && engine->surface)
        return true;
    if (engine->bounce && !karst_bounce_set_room(engine->bounce, width_px, height_px, error))
        return false;
    karst_surface *surface = karst_surface_create(engine->context, engine->display, width_px, height_px, error);
    if (!surface)
        return false;
    karst_engine_uncover(engine);
    karst_surface_destroy(engine->surface);
    engine->surface = surface;
    engine->width_px = width_px;
    engine->height_px = height_px;
    engine->view_changed = engine->size_changed = true;
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

void karst_engine_set_patience(karst_engine *engine, bool (*goes_on)(void *user), void *user)
{
    engine->goes_on = goes_on;
    engine->patience = user;
}

void karst_engine_find_memory(karst_engine *engine, uint64_t size_bytes)
{
    const karst_cache_buffers *buffers = karst_cache_get_buffers(engine->cache);
    uint64_t num_bricks = size_bytes / KARST_BRICK_BYTES((uint64_t)buffers->brick_bits);
    if (engine->context->is_cpu)
        karst_cache_commit_ahead(engine->cache, num_bricks < UINT32_MAX ? (uint32_t)num_bricks : UINT32_MAX);
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

/* ---- pictures that show what the engine does ---- */

static const char *const view_names[KARST_NUM_VIEWS] = {
    "picture", "level", "bricks", "steps", "age", "produced", "provisional", "depth", "normal",
    "albedo",  "occlusion", "bounces",
};
_Static_assert((int)KARST_VIEW_LEVEL == KARST_PAINT_LEVEL && (int)KARST_VIEW_STEPS == KARST_PAINT_STEPS &&
                   (int)KARST_VIEW_NORMAL == KARST_PAINT_NORMAL && (int)KARST_VIEW_BOUNCES == KARST_PAINT_BOUNCES,
               "views are painted by their own numbers");

const char *karst_view_name(karst_view view) { return (unsigned)view < KARST_NUM_VIEWS ? view_names[view] : "unknown"; }

bool karst_view_parse(const char *name, karst_view *view, karst_error *error)
{
    char names[160] = "";
    for (int i = 0; i < KARST_NUM_VIEWS; i++) {
        if (strcmp(name, view_names[i]) == 0) {
            *view = (karst_view)i;
            return true;
        }
        size_t length = strlen(names);
        snprintf(names + length, sizeof names - length, "%s%s", i ? ", " : "", view_names[i]);
    }
    return karst_fail(error, KARST_USAGE, "no view is called '%.40s'; there are: %s", name, names);
}

/* What paints and counts is made when it is first needed. */
static bool need_views(karst_engine *engine, karst_error *error)
{
    if (!engine->views)
        engine->views = karst_views_create(engine->context, karst_cache_get_buffers(engine->cache), error);
    return engine->views != NULL;
}

bool karst_engine_set_view(karst_engine *engine, karst_view view, karst_error *error)
{
    if ((unsigned)view >= KARST_NUM_VIEWS)
        return karst_fail(error, KARST_USAGE, "there is no view number %d", (int)view);
    if (view == KARST_VIEW_ALBEDO && !engine->radiance)
        return karst_fail(error, KARST_USAGE, "an engine of one sample and plain tone keeps bytes, not colours");
    if (view == KARST_VIEW_OCCLUSION && !engine->occlusion)
        return karst_fail(error, KARST_USAGE, "there is no occlusion to show: ask for it with --occlusion");
    if (view != KARST_VIEW_PICTURE && !need_views(engine, error))
        return false;
    if (view == KARST_VIEW_STEPS && !engine->counting)
        engine->counting =
            karst_caster_create_with(engine->context, karst_cache_get_buffers(engine->cache),
                                     "-DCAST_COUNT_STEPS " KARST_CAST_NO_STREAMS " " KARST_CAST_NO_SHADOWS, error);
    if (view == KARST_VIEW_STEPS && !engine->counting)
        return false;
    if (view == KARST_VIEW_STEPS)
        karst_caster_set_splats(engine->counting, engine->shown.splats);
    engine->view = (int)view;
    return true;
}

bool karst_engine_read_normals(karst_engine *engine, float *normals, size_t num_values, karst_error *error)
{
    size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    if (!engine->hits || engine->frame == 0)
        return karst_fail(error, KARST_USAGE, "no frame has been drawn yet");
    if (num_values != 3 * num_pixels)
        return karst_fail(error, KARST_USAGE, "normals of %dx%d are %zu values, not %zu", engine->width_px,
                          engine->height_px, 3 * num_pixels, num_values);
    karst_buffer *buffer = karst_buffer_create_blank(engine->context, "normals", num_values * sizeof *normals, error);
    karst_pinhole pinhole;
    karst_engine_pinhole(engine, &engine->drawn, &pinhole);
    bool done = buffer && need_views(engine, error) &&
                karst_views_normals(engine->views, &pinhole, engine->hits, buffer, error) &&
                karst_buffer_read(buffer, 0, normals, num_values * sizeof *normals, error);
    karst_buffer_destroy(buffer);
    return done;
}
