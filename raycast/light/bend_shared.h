/* Rays inside clear matter whose index of refraction varies, as their kernels take them. Compiled twice: see
 * core/device/dialect.h. */
#ifndef KARST_RAYCAST_BEND_SHARED_H
#define KARST_RAYCAST_BEND_SHARED_H

#include "core/device/dialect.h"

/* What is known of a ray's way. The path is cut into chords, which are cast as straight rays. */
#define KARST_BEND_STRAIGHT 0u /* outside: the ray is its own chord */
#define KARST_BEND_ON 1u       /* the path goes on from the chord's end */
#define KARST_BEND_LEAVES 2u   /* it ends at a surface of clear matter */
#define KARST_BEND_CUT 3u      /* it is followed no further */
#define KARST_BEND_DONE 4u     /* its last chord was cast */

typedef struct {
    float end[3];  /* of the chord, from the anchor, level-0 voxels */
    float arc;     /* the path's length along the chord, level-0 voxels */
    float way[3];  /* its direction there; unit length */
    float speed;   /* the length of its velocity there: the index, but for the error of steps */
    float normal[3]; /* KARST_BEND_LEAVES: of the surface there, out of clear matter */
    float length;    /* of the chord */
    float sigma;     /* the next step of the path; 0: none is known yet */
    float t_max;     /* the ray's own */
    uint state;      /* KARST_BEND_* */
    uint met;        /* surfaces that the ray has met, jumps of the index included */
    uint steps;      /* since the ray last met a surface of clear matter */
    float radius;    /* of the next box that is bounded, level-0 voxels; 0: none was yet */
    uint pad[2];
} karst_bend;
K_ASSERT_SIZE(karst_bend, 80);

typedef struct {
    float detail, voxel_m;
    float tolerance; /* of a step: see bend.clh */
    uint sample;     /* as in karst_clear_task, as are branch and most_met, after which rays are cut off */
    int x0_px, y0_px;
    uint branch, most_met;
    uint is_first, is_last; /* chords of the rays */
    uint pad[2];
} karst_bend_task;
K_ASSERT_SIZE(karst_bend_task, 48);

/* Steps err by so much of their length, at most: of pictures; and where hits are refined. */
#define KARST_BEND_TOLERANCE 3.0e-5f
#define KARST_BEND_FINE_TOLERANCE 4.0e-6f

/* Steps of a path between two surfaces of clear matter. */
#define KARST_BEND_MOST_STEPS 16384u

/* Words of what is counted: rays that go on; evaluations in which the index was taken as another; where the first of
 * those was, from the anchor: three floats. */
#define KARST_BEND_COUNT_ON 0
#define KARST_BEND_COUNT_FAULTS 1
#define KARST_BEND_FAULT_PLACE 2
#define KARST_BEND_NUM_COUNTS 8

#endif
