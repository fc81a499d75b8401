/* Photons as host and kernels see them: raycast/light/photons.h. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_PHOTONS_SHARED_H
#define KARST_RAYCAST_PHOTONS_SHARED_H

#include "raycast/light/paths_shared.h"
#include "raycast/rays_shared.h"

/* What a lamp shines into is cut into cells: of a sun the disc across its light, as wide as the view and centred on the
 * eye, into rings that grow outwards; of others the directions in bands of equal cosine. Rings and bands are the rows,
 * each cut into as many columns all around. */
#define KARST_PHOTON_ROWS 256u
#define KARST_PHOTON_CELLS (KARST_PHOTON_ROWS * KARST_PHOTON_ROWS) /* of a lamp */
/* Cells that hold something are cut into up to so many parts, on either side, as a power of two. */
#define KARST_PHOTON_MOST_PARTS_LOG2 6u
/* Photons that follow one another are of one batch, so that they fly together. */
#define KARST_PHOTON_RUN 16u

/* What shines: as karst_lamp, from the eye. */
typedef struct {
    float place[4];  /* of a point or a spot, level-0 voxels; [3]: the ball's radius */
    float axis[4];   /* unit; to a sun, or along a spot; [3]: radius of a sun's disc, as seen at distance 1 */
    float across[4]; /* unit, across the axis and one another; [3] unused */
    float along[4];
    float colour[4];     /* on a surface that faces it; unless it is a sun, one voxel away. [3] unused */
    float absorption[4]; /* of clear matter that it is in, per level-0 voxel. [3] unused */
    float dark, bright;  /* of a spot */
    float least_cosine;  /* where its bands begin: the cosine to the axis */
    uint kind;           /* KARST_LAMP_* */
    uint is_inside;      /* it is in clear matter */
    uint pad[3];
} karst_photon_lamp;
K_ASSERT_SIZE(karst_photon_lamp, 128);

/* At so many of the first surfaces that a photon meets, light is parted: both parts are followed, each in a slot of its
 * own, whose bit says which part it was at which surface. From then on chance decides. */
#define KARST_PHOTON_SPLITS 2u
#define KARST_PHOTON_SLOTS (1u << KARST_PHOTON_SPLITS)
/* In karst_ray.pixel the photon's number is below, its slot above. */
#define KARST_PHOTON_SLOT_SHIFT 26u
#define KARST_PHOTON_NUMBER 0x3ffffffu

/* A part of a cell that photons are sent into: those from `first` to the next one's, in a grid, row by row. Each is in
 * the middle of its own place of the grid. */
typedef struct {
    uint first;
    uint cell;      /* row * KARST_PHOTON_ROWS + column, and from bit 16 on the lamp */
    uint part;      /* row, from bit 8 on column, and from bit 16 on the logarithm of how many there are on a side */
    uint grid;      /* rows, and from bit 16 on columns */
    float share;    /* of the cell's area (level-0 voxels squared) or solid angle, that each stands for */
    float distance; /* of what it shines on from the eye, level-0 voxels */
} karst_photon_cell;
K_ASSERT_SIZE(karst_photon_cell, 24);

/* What a slot of a photon leaves on land. They lie batch by batch, slot by slot: karst_photon_record. */
typedef struct {
    float place[3]; /* from the photons' anchor, level-0 voxels */
    uint way;       /* karst_photon_way: photons of a grid that met the same have neighbours in the same light */
    float flux[3];  /* of red, green and blue: what falls on the land, though that may mirror a share of it */
    uint normal;    /* of the land, ten bits an axis; 0: it left nothing */
} karst_photon;
K_ASSERT_SIZE(karst_photon, 32);

/* What becomes of a slot of a photon, in whole quanta of energy, of all colours together: over its slots, given is
 * lost + left. */
#define KARST_PHOTON_FLIES 0u   /* it has met nothing that mirrors or is clear */
#define KARST_PHOTON_TURNED 1u  /* it has */
#define KARST_PHOTON_LANDED 2u  /* on land, after that */
#define KARST_PHOTON_DIRECT 3u  /* on land that the lamp itself shines on */
#define KARST_PHOTON_ESCAPED 4u /* to where the view ends */
#define KARST_PHOTON_CUT 5u     /* it met more surfaces than it may */
#define KARST_PHOTON_UNSURE 6u  /* it met what is not there yet, and only asks for it */
#define KARST_PHOTON_NOTHING 7u /* no light took this slot */
typedef struct {
    uint fate;
    uint given;
    int lost; /* to clear matter on its way; and what rounding leaves where light is parted, perhaps less than 0 */
    uint left;
    uint way; /* as of karst_photon */
} karst_photon_fate;
K_ASSERT_SIZE(karst_photon_fate, 20);

/* Sums of that: quanta by where they went. */
#define KARST_PHOTON_SUM_GIVEN 0
#define KARST_PHOTON_SUM_LOST 1
#define KARST_PHOTON_SUM_LANDED 2
#define KARST_PHOTON_SUM_DIRECT 3
#define KARST_PHOTON_SUM_ESCAPED 4
#define KARST_PHOTON_SUM_CUT 5
#define KARST_PHOTON_SUM_NUM_LANDED 6 /* photons, not quanta */
#define KARST_PHOTON_SUMS 7

/* Rays of a stream that are counted together: a block of raycast/light/scan.clh. */
#define KARST_PHOTON_BLOCK 256u

/* What a launch is about. */
typedef struct {
    uint batch, num_batches; /* karst_photon_of says which photon has which place of the batch */
    uint batch_rays;         /* places of a batch */
    uint num_photons;        /* of all batches */
    uint num_listed;         /* of those that are sent once more, by a list of their places; 0: all are sent */
    uint num_cells;
    uint lamp;     /* of probes */
    uint is_probe; /* 1: of whole cells; 2: of the grids of `cells` */
    uint generation; /* surfaces that have been met */
    uint parts;      /* 2: light is parted in this generation, so each ray has room for two; else 1 */
    uint is_last;    /* photons that meet one more end there */
    uint has_land;   /* land counts: of probes, if it mirrors */
    uint has_clear;  /* there is clear matter */
    float detail, voxel_m;
    float t_max;      /* how far from the eye all ends */
    float pixel_cone; /* a pixel's width at distance 1 */
    float quantum;    /* quanta of energy in a unit of flux */
    float reach;      /* how far photons are gathered from that have no neighbours, at distance 1 from the eye */
} karst_photon_task;
K_ASSERT_SIZE(karst_photon_task, 76);

/* Runs of photons take turns among batches. Which has place i of a batch, the way back, and how many there are. */
K_INLINE uint karst_photon_of(uint batch, uint num_batches, uint i)
{
    return (i / KARST_PHOTON_RUN * num_batches + batch) * KARST_PHOTON_RUN + i % KARST_PHOTON_RUN;
}

K_INLINE uint karst_photon_place(uint num_batches, uint photon)
{
    return photon / KARST_PHOTON_RUN / num_batches * KARST_PHOTON_RUN + photon % KARST_PHOTON_RUN;
}

K_INLINE uint karst_photons_of_batch(uint num_photons, uint batch, uint num_batches)
{
    const uint runs = num_photons / KARST_PHOTON_RUN, rest = num_photons % KARST_PHOTON_RUN;
    const uint whole = runs > batch ? (runs - batch - 1) / num_batches + 1 : 0;
    return whole * KARST_PHOTON_RUN + (runs % num_batches == batch ? rest : 0);
}

/* The last cell that begins at or before a photon. */
K_INLINE uint karst_photon_find(K_GLOBAL const karst_photon_cell *cells, uint num_cells, uint photon)
{
    uint low = 0, high = num_cells;
    while (high - low > 1) {
        const uint middle = low + (high - low) / 2;
        if (cells[middle].first <= photon)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* What light met on its way, and, in the lowest bits, how far it has flown since the first surface. */
#define KARST_PHOTON_FLOWN 0xfffu
K_INLINE float karst_photon_flown(uint way) { return k_as_float((way & KARST_PHOTON_FLOWN) << 19); }

/* It met `what` (0 to 3) after so many level-0 voxels more. */
K_INLINE uint karst_photon_way(uint way, uint what, float more)
{
    const uint met = ((way >> 12) + what + 1u) * 0x9e3779b1u & ~KARST_PHOTON_FLOWN;
    return met | k_as_uint(karst_photon_flown(way) + more) >> 19;
}

/* Where what a slot of a batch's place left is kept. */
K_INLINE uint karst_photon_record(uint batch, uint batch_rays, uint slot, uint place)
{
    return (batch * KARST_PHOTON_SLOTS + slot) * batch_rays + place;
}

#endif
