/* Rays through clear matter as its kernels take them. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_CLEAR_SHARED_H
#define KARST_RAYCAST_CLEAR_SHARED_H

#include "raycast/rays_shared.h"

/* What a ray of a stream has beside karst_ray, whose side is what it looks for in the land. */
typedef struct {
    float absorption[3]; /* per level-0 voxel, of what it is in; zeros outside clear matter */
    uint side;           /* what it looks for in clear matter: KARST_SIDE_BACK is a ray inside */
    float t_min;         /* from where on it does: raycast/light/raised.clh */
} karst_clear_way;
K_ASSERT_SIZE(karst_clear_way, 20);

/* A surface of clear matter at a hit: planes of ior, and absorption per metre. */
#define KARST_CLEAR_MATTER_PLANES 4

/* What a picture's rays through clear matter have in common. */
typedef struct {
    float absorption[3]; /* per level-0 voxel, where the eye is in clear matter */
    uint is_inside;      /* it is */
    float detail, voxel_m;
    float t_max;  /* how far from the eye rays end */
    float cone;   /* of the camera's rays */
    uint sample;  /* of the pixels; 0: their centres, whose rays take the larger share of what a surface parts */
    int width_px, height_px;
    int x0_px, y0_px;
    uint branch; /* 0: what the first surface reflects (or land mirrors); 1: what it refracts; 2: what land lets pass */
    uint bounce; /* surfaces that the stream's rays have met */
    uint is_last; /* those that meet one more are cut off */
    uint is_sure; /* rays go on only from what lacks nothing */
    uint adds_nothing; /* cast for what they ask for: no light of theirs is wanted */
    uint has_clear;    /* there is clear matter; else only what land mirrors is followed */
    uint only_lacking; /* rays begin only where those that were followed last lacked something */
} karst_clear_task;
K_ASSERT_SIZE(karst_clear_task, 80);

/* Where counters of rays followed, of rays cut off, and of hits on stand-ins stand. */
#define KARST_CLEAR_COUNT_RAYS 9
#define KARST_CLEAR_COUNT_CUT 10
#define KARST_CLEAR_COUNT_PROVISIONAL 6 /* with those of mirrored rays */

#endif
