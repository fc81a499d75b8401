/* Shading: hit records into pixels and depth. */
#ifndef KARST_RAYCAST_SHADE_H
#define KARST_RAYCAST_SHADE_H

#include "raycast/cast.h"

typedef struct karst_shader karst_shader;

/* What a picture's light and colours are. Linear RGB; directions are unit vectors in world axes; lengths in level-0 voxels. */
typedef struct {
    float sun_direction[4];  /* towards the sun */
    float sun_colour[4], sky_zenith[4], sky_horizon[4], ground_flat[4], ground_steep[4];
    float haze_distance;
    float shadow_distance;   /* how far shadow rays go */
    uint pad[2];
} karst_light;

karst_shader *karst_shader_create(karst_context *context, const karst_cache_buffers *cache, bool shadows, karst_error *error);
void karst_shader_destroy(karst_shader *shader);

/* Writes a shadow ray for each hit (idle ones for misses) towards the sun: the second stream. */
bool karst_shade_make_shadow_rays(karst_shader *shader, const karst_cast_view *view, const karst_pinhole *pinhole, const karst_light *light,
                                  karst_buffer *hits, karst_buffer *rays, karst_error *error);
/* Pixels: RGBA8, top row first, width * height, into `pixels` (any cl_mem: a mapped pixel buffer or plain memory); depth in level-0 voxels
 * along the ray, INFINITY for none. shadow_hits NULL: no shadows. counters (4 uints, zeroed by the caller's engine beforehand):
 * hits, provisional, incomplete, unused. */
bool karst_shade_pixels(karst_shader *shader, const karst_cast_view *view, const karst_pinhole *pinhole, const karst_light *light,
                        karst_buffer *hits, karst_buffer *shadow_hits, cl_mem pixels, karst_buffer *depth, karst_buffer *counters,
                        karst_error *error);

#endif
