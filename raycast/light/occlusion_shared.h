/* Occlusion as kernels and host see it. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_OCCLUSION_SHARED_H
#define KARST_RAYCAST_OCCLUSION_SHARED_H

#include "core/device/dialect.h"

/* Directions all around, each of as much of the sphere as any other: any 8x8 pixels look in one each. */
#define KARST_OCCLUSION_CONES 64

/* Rays of one direction are neighbours: those of a square of so many pixels. */
#define KARST_OCCLUSION_SQUARE 64
#define KARST_OCCLUSION_CELLS 8 /* of 8x8 pixels, on a side of that */
#define KARST_OCCLUSION_SQUARE_RAYS (KARST_OCCLUSION_SQUARE * KARST_OCCLUSION_SQUARE)

/* What a pixel's neighbours look at, row by row: `pitch` floats in a row, the first pixel at KARST_OCCLUSION_AROUND in
 * row KARST_OCCLUSION_REACH; so that whole vectors can be read about any pixel. */
#define KARST_OCCLUSION_REACH 4 /* pixels of the neighbourhood, each way */
#define KARST_OCCLUSION_AROUND 16
#define KARST_OCCLUSION_PLACE 0  /* three planes: where the pixel's surface lies, from the anchor, level-0 voxels */
#define KARST_OCCLUSION_NORMAL 3 /* ten bits a component, and bit 30; as bits: 0 of a pixel without a surface */
#define KARST_OCCLUSION_WIDTH 4  /* of the pixel, there */
#define KARST_OCCLUSION_WEIGHT 5 /* of its cone: the cosine to the normal; 0: it has none */
#define KARST_OCCLUSION_SEEN 6   /* the same where the cone met nothing, else 0 */
#define KARST_OCCLUSION_ROW 7    /* two planes: sums of both over a row's neighbours */
#define KARST_OCCLUSION_PLANES 9

typedef struct {
    int pitch;
    uint plane;           /* floats from a plane to the next */
    uint turn;            /* added to which direction is a pixel's */
    float detail;         /* as karst_cast_view.detail */
    int left_px, top_px;  /* where the picture begins in the window that is looked at */
    int width_px, height_px; /* of the picture */
    float cones[KARST_OCCLUSION_CONES][4]; /* unit, world axes; [3] unused */
} karst_occlusion_task;
K_ASSERT_SIZE(karst_occlusion_task, 1056);

#endif
