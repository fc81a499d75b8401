/* The sky of an eye as kernels look it up. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_ATMOSPHERE_SHARED_H
#define KARST_RAYCAST_ATMOSPHERE_SHARED_H

#include "core/device/dialect.h"

/* Rows go from the horizon up to where the air ends, then from the horizon down to the nadir, closer together near the
 * horizon; columns over the cosine of the azimuth from the sun, from 1 to -1. A cell has what is scattered towards the
 * eye on the whole way but for the phase functions: by air (RGB; with what was scattered before, divided by air's phase
 * function), the air on the way (km as thick as at the ground); by dust, and the dust on the way. */
#define KARST_SKY_ROWS 56
#define KARST_SKY_COLUMNS 40
#define KARST_SKY_CELL 12
/* After the cells: what there is to scatter at heights, closer together at the ground, and at places where the sun's
 * cosine is that at the eye, less or more: sunlight (RGB), and the mean of the light from everywhere (RGB). */
#define KARST_SKY_HEIGHTS 64
#define KARST_SKY_SUNS 13 /* the middle one is that at the eye */
#define KARST_SKY_TOP_KM 100.0f
#define KARST_SKY_LIGHTS (2 * KARST_SKY_ROWS * KARST_SKY_COLUMNS * KARST_SKY_CELL)
#define KARST_SKY_FLOATS (KARST_SKY_LIGHTS + 6 * KARST_SKY_SUNS * KARST_SKY_HEIGHTS)

/* Lengths are in km, coefficients 1/km at the ground. */
typedef struct {
    float up[4];        /* away from the ground, at the eye; [3]: the sun's cosine to it */
    float air[4];       /* scattering; [3]: 1 over the height in which it thins */
    float dust[4];      /* extinction, of which 9/10 are scattering; [3]: likewise */
    float ozone[4];     /* absorption where it is thickest; [3]: 1 over the eye's distance to the globe's centre */
    float height_km;    /* of the eye */
    float voxel_km;     /* a level-0 voxel's width */
    float horizon;      /* its cosine to up */
    float above, below; /* 1 over the cosines that rows above and below the horizon are for */
    float globe_km;     /* radius of the ground */
    float from_sun;     /* 1 over the sun's sine */
    float per_sun;      /* 1 over the sun's cosine between two places of the table */
    float to_sun[4];    /* a direction; [3] unused */
} karst_sky;
K_ASSERT_SIZE(karst_sky, 112);

#endif
