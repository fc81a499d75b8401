/* Occlusion as kernels and host see it. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_OCCLUSION_SHARED_H
#define KARST_RAYCAST_OCCLUSION_SHARED_H

#include "core/device/dialect.h"

/* Probes are pixels that cast a cone: in the whole picture those of every so many columns and rows, and of its last. */
#define KARST_OCCLUSION_STEP 4
#define KARST_OCCLUSION_BLOCK (KARST_OCCLUSION_STEP * KARST_OCCLUSION_STEP) /* pixels between four probes */

/* Directions all around, each of as much of the sphere as any other: any 8x8 probes look in one each. */
#define KARST_OCCLUSION_CONES 64

/* Rays of directions in one octant, from near one another, are neighbours: of a square of so many probes. */
#define KARST_OCCLUSION_SQUARE 64
#define KARST_OCCLUSION_CELLS 8 /* of 8x8 probes, on a side of that */
#define KARST_OCCLUSION_SQUARE_RAYS (KARST_OCCLUSION_SQUARE * KARST_OCCLUSION_SQUARE)

#define KARST_OCCLUSION_REACH 4 /* probes that count for a pixel: of those around it, each way */

/* What is known of a probe: a distance, in level-0 voxels, and a word. */
#define KARST_OCCLUSION_DIRECTION 63u /* which one is its cone's */
#define KARST_OCCLUSION_KNOWN 64u     /* there is a surface, and a cone says something of it */
#define KARST_OCCLUSION_OPEN 128u     /* the cone met nothing */
#define KARST_OCCLUSION_BELOW 256u    /* it would have gone into the surface, so none was cast */

typedef struct {
    uint plane;              /* probes: words follow so many distances */
    uint turn;               /* added to which direction is a probe's */
    float detail;            /* as karst_cast_view.detail */
    int across, down;        /* probes of the window that is looked at */
    int left_px, top_px;     /* where the picture begins in that window */
    int width_px, height_px; /* of the picture */
    int pad[3];
    float cones[KARST_OCCLUSION_CONES][4]; /* unit, world axes; [3] unused */
} karst_occlusion_task;
K_ASSERT_SIZE(karst_occlusion_task, 1072);

#endif
