/* Light and colours as the shading kernels take them. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_SHADE_SHARED_H
#define KARST_RAYCAST_SHADE_SHARED_H

#include "core/device/dialect.h"

/* The position that the view is relative to: level-0 voxel and a fraction of it, in 2^-32. */
typedef struct {
    long voxel[3];
    uint fraction[3];
    uint pad;
} karst_shade_anchor;
K_ASSERT_SIZE(karst_shade_anchor, 40);

/* What a picture's light and colours are. Linear RGB; directions are unit vectors in world axes; lengths in level-0
 * voxels. */
typedef struct {
    float sun_direction[4]; /* towards the sun; [3]: 1 where surfaces' own light is left out, to show albedos */
    float sun_colour[4], sky_zenith[4], sky_horizon[4], ground_flat[4], ground_steep[4];
    float haze_distance;   /* at which haze hides 1 - 1/e of the surface, where it is thickest */
    float shadow_distance; /* how far shadow rays go */
    float haze_thinning;   /* 1 over the height in which haze thins to 1/e; 0: it is as thick everywhere */
    float eye_height;      /* of the eye above where haze is thickest, times haze_thinning; at least 0 */
    float up[4];           /* away from the ground, at the eye; [3]: 1 over the distance to a globe's centre, 0: flat */
    float mirror;          /* the share of light that land mirrors, 0 to 1; only for shaders that make mirrored rays */
    float paint_alone; /* 1: the world's own colours are black, so that only what is painted shows; only with paint */
    float pad[2];
} karst_light;
K_ASSERT_SIZE(karst_light, 144);

#endif
