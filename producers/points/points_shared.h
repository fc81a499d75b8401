/* Models of points as devices read them: imported files as they are (core/points/record_shared.h), and where they
 * stand. Compiled twice: see core/device/dialect.h.
 *
 * A model's places are whole units from its centre (core/points/record_shared.h), at most 2^27 of them along each axis.
 * A world's place becomes a model's by integers: the voxels from where the model stands, times a matrix in fixed point.
 * So far out there is nothing to lose, and each instance of a model looks at the same points. */
#ifndef KARST_PRODUCERS_POINTS_SHARED_H
#define KARST_PRODUCERS_POINTS_SHARED_H

#include "core/points/record_shared.h"

/* A level of a model; offsets in 64-bit words from the buffer's begin. */
typedef struct {
    uint num_points, num_levels; /* levels of nodes; level 0 has the leaves' */
    uint counts[KARST_POINTS_MAX_TREE];
    float spacing;            /* units: it serves samples up to POINTS_SPACINGS of them apart */
    int reach, cover, spread; /* the largest */
    int pad;
    ulong points, nodes[KARST_POINTS_MAX_TREE];
} karst_model_level;
K_ASSERT_SIZE(karst_model_level, 168);

/* What is inside a model: cells of its places, a bit each (producers/points/model_solid.h). */
typedef struct {
    int at[3];    /* the corner of the first, units */
    int shift;    /* a cell is 2^shift units wide */
    uint size[3]; /* cells along each axis */
    uint levels;  /* of cells, and of larger ones of eight each; 0: it is a crust */
    ulong words;  /* where they begin, as offsets above */
} karst_model_solid;
K_ASSERT_SIZE(karst_model_solid, 40);

/* A model that stands somewhere. Lengths are level-0 voxels but where it says units. */
typedef struct {
    long at[3];     /* the voxel that its centre lies in */
    long extent[3]; /* around it, the box of its points */
    long matrix[9]; /* from voxels to units, times 2^shift: row by row */
    long offset[3]; /* the centre's fraction, in the same */
    int shift;
    uint first_level, num_levels; /* of karst_model_level */
    float units_per_voxel, m_per_unit;
    uint has_colours;
    karst_model_solid solid;
} karst_model_record;
K_ASSERT_SIZE(karst_model_record, 208);

typedef struct {
    uint num_models, pad;
    float voxel_m;
    uint pad2;
    ulong models, levels;
    float linear[256]; /* of bytes of sRGB (IEC 61966-2-1) */
} karst_models_head;
K_ASSERT_SIZE(karst_models_head, 1056);

/* Both samples of an edge that a surface crosses must have points in reach, so that it is not lost: a support is this
 * many voxels wide at least (its radius), which is an edge and what points may be apart. */
#define POINTS_LEAST_REACH 2.2f
/* A level's supports reach three spacings, so this is how far apart its samples may be for the same. */
#define POINTS_SPACINGS 1.36f
/* With samples farther apart than this at its coarsest level, a model is not shown: it is some three voxels wide. */
#define POINTS_MOST_SPACINGS 2.0f

#endif
