/* The pinhole camera as the cast and shade kernels take it. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_CAST_SHARED_H
#define KARST_RAYCAST_CAST_SHARED_H

#include "core/device/dialect.h"

/* A pinhole camera as a compact stream: ray (x, y) of width x height, unit directions. They may be a window of a whole
 * picture, whose pixels (x0 + x, y0 + y) they are in every bit. */
typedef struct {
    float right[4], up[4], forward[4]; /* orthonormal; [3] unused */
    float half_width, half_height;     /* tangent of half the field of view, horizontally and vertically */
    float t_min, t_max;                /* level-0 voxels */
    float cone;                        /* footprint per unit of t: 2 * half_height / the whole's height */
    int width_px, height_px;
    uint sample; /* 0: rays through the pixels' centres; else this one of raycast/cast/jitter.clh, from 1 */
    int x0_px, y0_px;                  /* where the window begins in the whole */
    int more_width_px, more_height_px; /* by which the whole is larger than the window; 0: it is the window */
} karst_pinhole;
K_ASSERT_SIZE(karst_pinhole, 96);

/* Pictures are worked on in packets of KARST_PACKET_SIDE^2 pixels, and those in groups of as many packets, so that what
 * a group reads stays near. A work-group is one group of packets, but see raycast/light/shade.cl. */
#define KARST_PACKET_SIDE 4
#define KARST_PACKET_RAYS 16
#define KARST_GROUP_PACKETS 16
#define KARST_GROUP_SIDE 16 /* pixels */

/* Groups side by side, and one below the other, whose packets make a beam (raycast/cast/beam.clh): 64 packets at most.
 * */
#define KARST_BEAM_ACROSS 2
#define KARST_BEAM_DOWN 2
#define KARST_BEAM_PACKETS (KARST_GROUP_PACKETS * KARST_BEAM_ACROSS * KARST_BEAM_DOWN)

/* What a cast of a picture notes: nothing; which of its work-items want something; the same, and those that did not
 * last time are left out. */
#define KARST_CAST_NOTES_NOTHING 0u
#define KARST_CAST_NOTES_ASKED 1u
#define KARST_CAST_WHO_ASKED 2u

/* What is wanted of a stream's rays: their hits; these, but not where in its cell the surface lies; or only whether
 * they end, a word for each in place of its hit. */
#define KARST_CAST_HITS 0u
#define KARST_CAST_ANY_HIT 1u
#define KARST_CAST_WHETHER 2u

/* Where pixel (x, y)'s ray stands in a stream in packet order: strips four rows high, in them blocks four columns wide.
 * A permutation of 0 .. width * height - 1 for every size; where the width is a multiple of four, each packet's rays
 * are 16 neighbours. */
K_INLINE uint karst_packet_order(uint x, uint y, uint width, uint height)
{
    uint strip = y & ~3u, column = x & ~3u;
    uint rows = height - strip < 4u ? height - strip : 4u;
    uint columns = width - column < 4u ? width - column : 4u;
    return strip * width + column * rows + (y - strip) * columns + (x - column);
}

#endif
