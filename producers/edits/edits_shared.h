/* Edits as devices read them. Compiled twice: see core/device/dialect.h. Lengths are level-0 voxels. */
#ifndef KARST_PRODUCERS_EDITS_SHARED_H
#define KARST_PRODUCERS_EDITS_SHARED_H

#include "core/device/dialect.h"

/* The numbers of karst/edit.h. */
#define EDIT_SPHERE 0u
#define EDIT_BOX 1u
#define EDIT_CAPSULE 2u
#define EDIT_PLANE 3u
#define EDIT_NOISE 4u
#define EDIT_ADD 0u
#define EDIT_REMOVE 1u
#define EDIT_FLATTEN 2u
#define EDIT_PAINT 3u
#define EDIT_SMOOTH 4u
/* Added to karst_edit_record.what: it has a colour. */
#define EDIT_COLOURED 0x10000u
#define EDIT_SHAPE(what) ((what)&255u)
#define EDIT_MODE(what) ((what) >> 8 & 255u)

/* An operation on the density. Its shape is a distance that is positive inside, steeper than 1 nowhere but for noise.
 * */
typedef struct {
    long at[3];       /* its centre: a voxel, */
    uint fraction[3]; /* and of it, in 2^-32 */
    uint what;        /* shape | mode << 8 | EDIT_COLOURED */
    float reach[3];   /* it changes the sign of no density farther away than that along an axis, blend included */
    float size[3];    /* box: half its sides. noise: [0] its amplitude. smooth: [0] its strength */
    float axis[3];    /* capsule: to its other end. plane, flatten, smooth: the normal, of length 1 */
    float radius;     /* sphere, capsule, noise */
    float blend;      /* 0: sharp */
    uint seed;        /* noise */
    long frequency;   /* noise: cells a voxel, Q8.56 */
    uint colour[2];   /* with EDIT_COLOURED: red, green << 16; blue, strength << 16; 65535 is 1 */
} karst_edit_record;
K_ASSERT_SIZE(karst_edit_record, 104);

/* A node of the index: the hull of eight edits, or of eight such nodes. */
#define EDITS_FAN 8u
#define EDITS_MAX_LEVELS 8
typedef struct {
    long min[3], max[3]; /* of edits' centres and reaches, corners included */
    float reach;         /* the largest */
    uint pad;
} karst_edit_node;
K_ASSERT_SIZE(karst_edit_node, 56);

/* The head of the buffer; offsets in 64-bit words from its begin. The first num_sorted edits are found by the index:
 * order[i] is the i-th leaf's edit; the rest are looked at one by one. Edits from num_edits on were undone. */
typedef struct {
    uint num_edits, num_sorted;
    uint num_levels; /* of nodes; level 0 has the leaves' */
    uint counts[EDITS_MAX_LEVELS];
    float voxel_m;
    ulong records, order, nodes[EDITS_MAX_LEVELS];
} karst_edits_head;
K_ASSERT_SIZE(karst_edits_head, 128);

/* An edit changes samples this many voxels of their level farther out than its reach, so that both samples of each edge
 * that its surface crosses know of it. */
#define EDITS_MARGIN 4

/* An edit that is smaller than half a voxel of a level leaves its samples as they are. */
K_INLINE int karst_edit_shows(float reach, int level) { return 4.0f * reach >= k_as_float((uint)(127 + level) << 23); }

#endif
