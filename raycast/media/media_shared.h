/* What fills the space outside matter, as kernels and host see it. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_MEDIA_SHARED_H
#define KARST_RAYCAST_MEDIA_SHARED_H

#include "core/device/dialect.h"

/* Beside each brick of extinction lies how deep it is in the medium towards the sun: a grid over the brick, a place
 * every two cells. A place is a float whose last bit is 1 where land does not hide the sun, and the one before it where
 * the place lies in land: nothing is lit there, and what lies beside it takes nothing from it. */
#define KARST_SUN_DEPTH_LIT 1
#define KARST_SUN_DEPTH_WITHIN 2
#define KARST_SUN_DEPTH_BITS 3
#define KARST_SUN_DEPTH_CELLS 2
#define KARST_SUN_DEPTH_SIDE 9
#define KARST_SUN_DEPTH_PLACES (KARST_SUN_DEPTH_SIDE * KARST_SUN_DEPTH_SIDE * KARST_SUN_DEPTH_SIDE)
/* Of a slot: whose brick the grid is of, and what is known of it. */
typedef struct {
    uint owner, owner_generation; /* as karst_brick_owner */
    uint sun;                     /* number of the sun's place; 0: there is no grid */
    uint is_whole;                /* 0: something was lacking on the way to the sun */
} karst_sun_depth;
K_ASSERT_SIZE(karst_sun_depth, 16);

/* What media do (karst_media_mode), as kernels are built: -DMEDIA_MODE=N. */
#define KARST_MEDIA_BASIC 0  /* no light is lost on its way from the sun */
#define KARST_MEDIA_SHADOW 1 /* it is lost in the medium; land is lit or not */
#define KARST_MEDIA_FULL 2   /* land shadows media, and media shadow land */

/* How often light is scattered: MEDIA_ONCE, MEDIA_PATHS, or neither of them, for octaves. */

/* How many packets of 16 lanes, neighbours in a picture's group, go through the tree together. */
#define KARST_MEDIA_BEAM 8

/* What a marching kernel counts. */
#define KARST_MEDIA_LACKING 0u /* rays that met what is not there yet */
#define KARST_MEDIA_MADE 1u    /* grids that were made */
#define KARST_MEDIA_COUNTERS 2

/* How a picture's media are looked at. */
typedef struct {
    float metres;      /* in a level-0 voxel */
    float detail;      /* as karst_cast_view.detail: voxels of media may be so many footprints wide */
    float most_depth;  /* rays end where they came through so much: what is behind no longer matters */
    uint sun;          /* number of the sun's place */
} karst_media_task;
K_ASSERT_SIZE(karst_media_task, 16);

#endif
