/* Shadow rays as shading makes them and casting takes them. Compiled twice: see core/device/dialect.h.
 *
 * One for each pixel of a picture, field by field: field f of all rays, in packet order (karst_packet_order), then
 * field f + 1. So the lanes of a packet are stored and loaded whole. Fields are floats: origin x, y, z (level-0 voxels
 * from the stream's anchor); the footprint that the ray begins with (0: the pixel has no ray, and its other fields are
 * not written); as bits, what the pixel's word becomes in shadow: RGBA8, or a mark; and how fast the ray rises above
 * the surface, as karst_ray has it.
 *
 * Those of a stream are laid out as of a picture 32 pixels wide, so that as many neighbours of the stream are a beam's;
 * their marks are y << 16 | x | KARST_SHADOW_OF_PIXEL of their own pixel. They stand where their rays do in the stream,
 * until bounces have them close ranks.
 */
#ifndef KARST_RAYCAST_SHADOW_SHARED_H
#define KARST_RAYCAST_SHADOW_SHARED_H

#include "core/device/dialect.h"

#define KARST_SHADOW_ORIGIN 0
#define KARST_SHADOW_WIDTH 3
#define KARST_SHADOW_DARK 4
#define KARST_SHADOW_RISE 5
#define KARST_SHADOW_FIELDS 6
#define KARST_SHADOW_OF_PIXEL 0x80000000u
/* So many beams of a stream's shadow rays close ranks (raycast/light/bounce.cl): any number gives the same light. */
#define KARST_PACKED_BEAMS 4

/* The sun is 0.53 degrees wide: what a shadow ray meets at distance t is blurred over this share of it. */
#define KARST_SUN_CONE 0.0093f

/* What the rays of a picture have in common. */
typedef struct {
    float direction[4]; /* unit, towards the sun's centre; [3] unused */
    float t_max;        /* level-0 voxels */
    float cone;         /* growth of the footprint per unit of t */
    int width_px, height_px;
    /* The sun's disc, as seen at distance 1: two vectors across the direction; zeros: a point. [3] unused. */
    float across[4], along[4];
    uint sample; /* of the pixels: which of raycast/cast/jitter.clh; 0: all rays go to the sun's centre */
    uint of_stream;
    int x0_px, y0_px; /* where the picture begins in the whole that it is a window of */
} karst_shadow_sun;
K_ASSERT_SIZE(karst_shadow_sun, 80);

#endif
