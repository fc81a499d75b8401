/* Painting hits by what the engine knows of them, instead of by light and colour; and normals as numbers. */
#ifndef KARST_RAYCAST_VIEWS_H
#define KARST_RAYCAST_VIEWS_H

#include "raycast/cast/cast.h"
#include "raycast/views_shared.h"

typedef struct karst_views karst_views;

/* Builds the kernels, and remembers from now on when bricks were made, if told (karst_views_note). The buffers stay the
 * cache's. Errors: KARST_FAILED. */
karst_views *karst_views_create(karst_context *context, const karst_cache_buffers *cache, karst_error *error);
void karst_views_destroy(karst_views *views); /* NULL is fine */

/* The loads of a round's work will be seen from `frame` on. */
bool karst_views_note(karst_views *views, const karst_work *work, uint32_t frame, karst_error *error);
/* Paints `paint` (KARST_PAINT_*) into pixels as karst_shade_pixels lays them out; KARST_PAINT_BRICKS paints over what
 * is there. `frame` is the one that the hits are of. */
bool karst_views_paint(karst_views *views, int paint, const karst_pinhole *pinhole, uint32_t frame, karst_buffer *hits,
                       cl_mem pixels, karst_error *error);
/* The same of KARST_PAINT_ALBEDO and those that follow, by values in packet order: `values` has three planes of
 * albedos, or one of how open pixels are. Bounces are those that were counted. */
bool karst_views_paint_values(karst_views *views, int paint, const karst_pinhole *pinhole, karst_buffer *hits,
                              const karst_buffer *values, cl_mem pixels, karst_error *error);
/* Of a picture's pixels: none has bounced; and those of a stream's rays that are not idle do so once more. `count`: the
 * word that counts them, max_rays at most. */
bool karst_views_forget_bounces(karst_views *views, const karst_pinhole *pinhole, karst_error *error);
bool karst_views_count_bounces(karst_views *views, const karst_pinhole *pinhole, const karst_buffer *rays,
                               const karst_buffer *count, uint32_t max_rays, karst_error *error);
/* The hits' normals, three floats a pixel in rows from the top; zeros for misses. */
bool karst_views_normals(karst_views *views, const karst_pinhole *pinhole, karst_buffer *hits, karst_buffer *normals,
                         karst_error *error);

#endif
