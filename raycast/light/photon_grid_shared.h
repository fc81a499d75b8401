/* Photons as they are gathered: raycast/light/photon_grid.h. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_PHOTON_GRID_SHARED_H
#define KARST_RAYCAST_PHOTON_GRID_SHARED_H

#include "raycast/light/photons_shared.h"

/* A photon's light lies on an ellipse: it is brightest in the middle, and falls with the square of the distance to 0 at
 * the edge (V. Epanechnikov's kernel). With p and s across its normal, in radii: 1 - (pp p^2 + 2 ps p s + ss s^2). */
typedef struct {
    float place[3]; /* from the photons' anchor, level-0 voxels */
    uint tag;       /* which cell of the grid it lies in, among neighbours */
    float light[3]; /* in the middle: of red, green and blue, for each unit of area */
    uint normal;    /* as karst_photon has it */
    float pp, ps, ss;
    float radius; /* the larger one, level-0 voxels */
} karst_photon_spot;
K_ASSERT_SIZE(karst_photon_spot, 48);

/* Buckets of a table that are summed together. */
#define KARST_PHOTON_BUCKETS 256u

/* What a launch is about. Lengths are at distance 1 from the eye. */
typedef struct {
    uint num_batches, batch_rays;
    uint num_photons, num_cells; /* of all batches */
    uint num_records;            /* karst_photon_record: of the batches that are gathered */
    uint mask;       /* buckets - 1: a power of two */
    float least;     /* radius of the smallest spot: such as spreads light like a pixel's square */
    float most;      /* and of the largest */
    float reach;     /* of those that have no neighbours */
    float scale;     /* quanta of what is gathered in a unit of irradiance */
    float whole;     /* what is gathered counts so often: 1 once all are traced */
    float offset[3]; /* from the anchor of what is shaded to that of the photons */
} karst_photon_grid_task;
K_ASSERT_SIZE(karst_photon_grid_task, 56);

#endif
