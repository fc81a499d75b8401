/* The memory that follows a picture's size, and reading the picture. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/engine/engine_parts.h"

#define MAX_SIDE_PX 16384

bool karst_engine_check_size(int width_px, int height_px, karst_error *error)
{
    if (width_px < 1 || height_px < 1 || width_px > MAX_SIDE_PX || height_px > MAX_SIDE_PX)
        return karst_fail(error, KARST_USAGE, "picture size %dx%d: each side must be 1 to %d pixels", width_px,
                          height_px, MAX_SIDE_PX);
    return true;
}

bool karst_engine_check_window(const karst_engine_window *window, int width_px, int height_px, karst_error *error)
{
    if (!window->whole_width_px && !window->whole_height_px && !window->x0_px && !window->y0_px)
        return true;
    if (!karst_engine_check_size(window->whole_width_px, window->whole_height_px, error))
        return false;
    if (window->x0_px < 0 || window->y0_px < 0 || width_px > window->whole_width_px - window->x0_px ||
        height_px > window->whole_height_px - window->y0_px)
        return karst_fail(error, KARST_USAGE, "a window of %dx%d pixels from (%d, %d) is not within %dx%d", width_px,
                          height_px, window->x0_px, window->y0_px, window->whole_width_px, window->whole_height_px);
    return true;
}

bool karst_engine_check_whole(const karst_engine *engine, karst_error *error)
{
    return !engine->window.whole_width_px ||
           karst_fail(error, KARST_USAGE, "the engine draws a window of %dx%d, whose size is fixed",
                      engine->window.whole_width_px, engine->window.whole_height_px);
}

static double gib(double bytes) { return bytes / (1024.0 * 1024.0 * 1024.0); }

/* Before any of it is allocated: what a picture takes beside what is there, against what the device has. */
static bool check_room(const karst_engine *engine, karst_error *error)
{
    const karst_context *context = engine->context;
    const double num_pixels = (double)engine->width_px * engine->height_px;
    double hits = num_pixels * sizeof(karst_hit), held = 0,
           shadows = engine->shadows ? (double)karst_cast_shadow_bytes(engine->width_px, engine->height_px) : 0;
    const double mirrored =
        (engine->bounce  ? karst_bounce_bytes(engine->width_px, engine->height_px, engine->shadows)
         : engine->clear ? karst_clear_bytes(engine->width_px, engine->height_px, engine->shadows,
                                             karst_engine_world_bends(&engine->shown))
                         : 0) +
        (engine->paths ? karst_paths_bytes((size_t)num_pixels, engine->shade & KARST_SHADE_THROUGH_CLEAR,
                                           karst_engine_has_path_media(engine))
                       : 0) +
        karst_engine_occlusion_bytes(engine) + karst_engine_pass_bytes(engine);
    double largest = fmax(engine->bounce || engine->clear || engine->paths || engine->occlusion
                                   ? num_pixels * sizeof(karst_ray)
                                   : hits,
                          shadows),
           sum = hits + shadows + mirrored + 4 * num_pixels +
                 (engine->radiance ? karst_radiance_bytes(engine->radiance, num_pixels) : 0);
    for (const karst_buffer *b = context->buffers; b; b = b->next)
        held += (double)b->size_bytes;
    double has_largest = (double)context->max_allocation_bytes, has = (double)context->global_memory_bytes - held;
    if (largest <= has_largest && sum <= has)
        return true;
    /* A little less than fits, in whole packets. */
    double side = sqrt(fmin(has_largest / largest, fmax(has, 0) / sum)) * 0.99;
    int width_px = (int)(engine->width_px * side) / 16 * 16, height_px = (int)(engine->height_px * side) / 16 * 16;
    char what[160];
    if (largest > has_largest)
        snprintf(what, sizeof what, "%.1f GiB of it in one buffer, of which the device's largest has %.1f",
                 gib(largest), gib(has_largest));
    else
        snprintf(what, sizeof what, "beside the %.1f that the pool and the rest take, of the device's %.1f", gib(held),
                 gib((double)context->global_memory_bytes));
    if (width_px < 16 || height_px < 16)
        return karst_fail(error, KARST_FAILED,
                          "a picture of %dx%d takes %.1f GiB for its rays and what they hit, %s: use a smaller --pool",
                          engine->width_px, engine->height_px, gib(sum), what);
    return karst_fail(error, KARST_FAILED,
                      "a picture of %dx%d takes %.1f GiB for its rays and what they hit, %s: make it smaller, such as "
                      "--size %dx%d%s",
                      engine->width_px, engine->height_px, gib(sum), what, width_px, height_px,
                      engine->shadows ? ", or leave shadows out (--no-shadows)" : "");
}

/* What follows the picture's size. */
bool karst_engine_allocate_picture(karst_engine *engine, karst_error *error)
{
    size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    if (!check_room(engine, error))
        return false;
    engine->room_px = num_pixels;
    engine->whole_width_px = engine->width_px;
    engine->whole_height_px = engine->height_px;
    engine->surface =
        karst_surface_create(engine->context, engine->display, engine->width_px, engine->height_px, error);
    engine->hits = karst_buffer_create_blank(engine->context, "hits", num_pixels * sizeof(karst_hit), error);
    engine->asked =
        karst_buffer_create(engine->context, "asked",
                            karst_cast_asked_bytes(engine->context, engine->width_px, engine->height_px), NULL, error);
    if (!engine->surface || !engine->hits || !engine->asked ||
        (engine->radiance && !karst_radiance_set_room(engine->radiance, num_pixels, error)) ||
        (engine->bounce && !karst_bounce_set_room(engine->bounce, engine->width_px, engine->height_px, error)) ||
        (engine->paths && !karst_paths_set_room(engine->paths, num_pixels, error)) ||
        (engine->clear && !karst_clear_set_room(engine->clear, engine->width_px, engine->height_px, error)) ||
        !karst_engine_allocate_occlusion(engine, error) || !karst_engine_allocate_pass(engine, error))
        return false;
    size_t hint_bytes = karst_cast_hint_bytes(engine->context, karst_cache_get_buffers(engine->cache),
                                              engine->width_px, engine->height_px);
    engine->hints = hint_bytes ? karst_buffer_create(engine->context, "hints", hint_bytes, NULL, error) : NULL;
    if (hint_bytes && !engine->hints)
        return false;
    if (engine->shadows) {
        engine->shadow_rays = karst_buffer_create_blank(
            engine->context, "shadow_rays", karst_cast_shadow_bytes(engine->width_px, engine->height_px), error);
        engine->shadows_asked = karst_buffer_create(engine->context, "asked", engine->asked->size_bytes, NULL, error);
        engine->shadow_hints =
            hint_bytes ? karst_buffer_create(engine->context, "hints", hint_bytes, NULL, error) : NULL;
        if (!engine->shadow_rays || !engine->shadows_asked || (hint_bytes && !engine->shadow_hints))
            return false;
    }
    if (engine->count_changed_pixels) {
        engine->pixels = malloc(num_pixels * 4);
        engine->previous_pixels = malloc(num_pixels * 4);
        engine->have_previous = false;
        if (!engine->pixels || !engine->previous_pixels)
            return karst_fail(error, KARST_FAILED, "out of memory for comparing pictures of %dx%d", engine->width_px,
                              engine->height_px);
    }
    return true;
}

void karst_engine_free_picture(karst_engine *engine)
{
    karst_engine_uncover(engine);
    karst_surface_destroy(engine->surface);
    karst_buffer_destroy(engine->hits);
    karst_buffer_destroy(engine->shadow_rays);
    karst_buffer_destroy(engine->asked);
    karst_buffer_destroy(engine->hints);
    karst_buffer_destroy(engine->shadow_hints);
    karst_buffer_destroy(engine->shadows_asked);
    free(engine->pixels);
    free(engine->previous_pixels);
    engine->surface = NULL;
    engine->hits = engine->shadow_rays = NULL;
    engine->asked = engine->shadows_asked = engine->hints = engine->shadow_hints = NULL;
    engine->pixels = engine->previous_pixels = NULL;
}

bool karst_engine_set_size(karst_engine *engine, int width_px, int height_px, karst_error *error)
{
    if (!karst_engine_check_size(width_px, height_px, error) || !karst_engine_check_whole(engine, error))
        return false;
    if (width_px == engine->width_px && height_px == engine->height_px && engine->surface &&
        engine->room_px == (size_t)width_px * (size_t)height_px)
        return true;
    karst_engine_free_picture(engine);
    engine->width_px = width_px;
    engine->height_px = height_px;
    engine->view_changed = true;
    return karst_engine_allocate_picture(engine, error);
}

bool karst_engine_set_window(karst_engine *engine, const karst_engine_window *window, int width_px, int height_px,
                             karst_error *error)
{
    if (!karst_engine_check_size(width_px, height_px, error) ||
        !karst_engine_check_window(window, width_px, height_px, error))
        return false;
    const bool fits = width_px == engine->width_px && height_px == engine->height_px && engine->surface;
    engine->window = *window;
    engine->view_changed = true;
    engine->have_previous = false;
    if (fits)
        return true;
    karst_engine_free_picture(engine);
    engine->width_px = width_px;
    engine->height_px = height_px;
    return karst_engine_allocate_picture(engine, error);
}

bool karst_engine_count_changed_pixels(karst_engine *engine, karst_error *error)
{
    size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    if (!karst_surface_read(engine->surface, engine->pixels, num_pixels * 4, error))
        return false;
    uint64_t num_changed = 0;
    for (size_t i = 0; engine->have_previous && i < num_pixels; i++)
        num_changed += memcmp(engine->pixels + 4 * i, engine->previous_pixels + 4 * i, 4) != 0;
    engine->stats.num_changed_pixels = engine->have_previous ? num_changed : num_pixels;
    engine->have_previous = true;
    uint8_t *swap = engine->pixels;
    engine->pixels = engine->previous_pixels;
    engine->previous_pixels = swap;
    return true;
}

bool karst_engine_read_pixels(karst_engine *engine, uint8_t *rgba, size_t size_bytes, karst_error *error)
{
    if (!engine->surface || engine->frame == 0)
        return karst_fail(error, KARST_USAGE, "no frame has been drawn yet");
    return karst_surface_read(engine->surface, rgba, size_bytes, error);
}

/* Depth is made of hits where it is asked for: pictures do not wait for its being stored. */
#define DEPTH_ROWS 64 /* a multiple of the rows that packets are high */
static void depth_of_hits(const karst_engine *engine, const karst_hit *hits, int row, int num_rows, float *depth_m)
{
    const uint32_t width = (uint32_t)engine->width_px, height = (uint32_t)engine->height_px;
    const float voxel_m = exp2f((float)engine->world->voxel_log2_m);
    for (uint32_t y = (uint32_t)row; y < (uint32_t)(row + num_rows); y++)
        for (uint32_t x = 0; x < width; x++) {
            const karst_hit *hit = &hits[karst_packet_order(x, y, width, height) - (uint32_t)row * width];
            *depth_m++ = KARST_HIT_KIND(hit->kind) == KARST_HIT_MISS ? INFINITY : hit->t * voxel_m;
        }
}

bool karst_engine_read_depth(karst_engine *engine, float *depth_m, size_t num_values, karst_error *error)
{
    size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    if (num_values < num_pixels)
        return karst_fail(error, KARST_USAGE, "depth of %dx%d needs %zu values, not %zu", engine->width_px,
                          engine->height_px, num_pixels, num_values);
    if (!engine->hits || engine->frame == 0)
        return karst_fail(error, KARST_USAGE, "no frame has been drawn yet");
    karst_hit *hits = malloc(DEPTH_ROWS * (size_t)engine->width_px * sizeof *hits);
    bool ok = hits || karst_fail(error, KARST_FAILED, "out of memory for reading depth");
    for (int row = 0; row < engine->height_px && ok; row += DEPTH_ROWS) {
        int num_rows = engine->height_px - row < DEPTH_ROWS ? engine->height_px - row : DEPTH_ROWS;
        size_t before = (size_t)row * (size_t)engine->width_px;
        ok = karst_buffer_read(engine->hits, before * sizeof *hits, hits,
                               (size_t)num_rows * (size_t)engine->width_px * sizeof *hits, error);
        if (ok)
            depth_of_hits(engine, hits, row, num_rows, depth_m + before);
    }
    free(hits);
    return ok;
}
