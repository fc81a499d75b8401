/* Casting: streams of rays through the pools into hit records. */
#ifndef KARST_RAYCAST_CAST_H
#define KARST_RAYCAST_CAST_H

#include "cache/cache.h"
#include "raycast/rays_shared.h"

typedef struct karst_caster karst_caster;

/* Builds the cast kernels for the context's lanes. */
karst_caster *karst_caster_create(karst_context *context, const karst_cache_buffers *cache, karst_error *error);
void karst_caster_destroy(karst_caster *caster);

/* Localises an anchor against the root tile (child 0 = node `root_corner` of `top_level`), exactly, on the host.
 * finest_level 0; serial and detail are the caller's to fill. */
void karst_cast_view_init(karst_cast_view *view, const karst_position *anchor, const int64_t root_corner[3], int top_level);

/* A pinhole camera as a compact stream: ray (x, y) of width x height, pixel centres, unit directions. */
typedef struct {
    float right[4], up[4], forward[4]; /* orthonormal; [3] unused */
    float half_width, half_height;     /* tangent of half the field of view, horizontally and vertically */
    float t_min, t_max;                /* level-0 voxels */
    float cone;                        /* footprint per unit of t: 2 * half_height / height_px */
    int width_px, height_px;
    uint pad;
} karst_pinhole;

/* Casts all rays; writes one karst_hit for each (index y * width + x) and the stamps. Asynchronous on the context's queue. */
bool karst_cast_pinhole(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole, karst_buffer *hits, karst_error *error);
/* The same for a buffer of karst_ray. any_hit: stop at the first surface without locating it exactly is allowed (shadows). */
bool karst_cast_rays(karst_caster *caster, const karst_cast_view *view, karst_buffer *rays, uint32_t num_rays, bool any_hit, karst_buffer *hits,
                     karst_error *error);

#endif
