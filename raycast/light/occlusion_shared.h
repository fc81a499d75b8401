/* Occlusion as kernels and host see it. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_OCCLUSION_SHARED_H
#define KARST_RAYCAST_OCCLUSION_SHARED_H

#include "core/device/dialect.h"

/* Probes are pixels that cast a cone: in the whole picture those of every so many columns and rows, and of its last. */
#define KARST_OCCLUSION_STEP_X 8
#define KARST_OCCLUSION_STEP_Y 4
#define KARST_OCCLUSION_BLOCK (KARST_OCCLUSION_STEP_X * KARST_OCCLUSION_STEP_Y) /* pixels between four probes */

/* Directions all around, each of as much of the sphere as any other: any 8x8 probes look in one each, or away from it,
 * if it would lead into their surface. */
#define KARST_OCCLUSION_CONES 64

/* Rays of directions in one octant, from near one another, are neighbours: of a square of so many probes. */
#define KARST_OCCLUSION_SQUARE 64
#define KARST_OCCLUSION_CELLS 8 /* of 8x8 probes, on a side of that */
#define KARST_OCCLUSION_SQUARE_RAYS (KARST_OCCLUSION_SQUARE * KARST_OCCLUSION_SQUARE)

/* Fits are made at probes of every so many columns and rows. */
#define KARST_OCCLUSION_FIT_STEP 2
#define KARST_OCCLUSION_REACH 7 /* probes that count for a fit: of those around it, each way */

/* What is known of probes, one plane after another. In each row those of even columns come first, so that fits find
 * neighbours beside one another. */
#define KARST_OCCLUSION_T 0     /* how far from the eye, level-0 voxels */
#define KARST_OCCLUSION_WAY 1   /* and the two that follow: a cone's direction, unit, world axes; 0 if there is none */
#define KARST_OCCLUSION_PLACE 4 /* and the two that follow: where its surface lies, from the eye */
#define KARST_OCCLUSION_NEAR 7  /* one over how far away is what it met; 0: nothing */
/* And what is said of all directions where there are fits: level + slope . n, of a surface whose normal is n. */
#define KARST_OCCLUSION_LEVEL 8
#define KARST_OCCLUSION_SLOPE 9  /* and the two that follow */
#define KARST_OCCLUSION_FLOOR 12 /* and so much at least */
#define KARST_OCCLUSION_PLANES 13

typedef struct {
    uint plane;              /* numbers of one plane */
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
