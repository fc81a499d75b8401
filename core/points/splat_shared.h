/* Discs that stand for a surface, in an octree, as casting reads them and karst_splat_tree_build makes them. Compiled
 * twice: see core/device/dialect.h.
 *
 * A node holds the discs that touch its cube: those of points in it first, then copies of others. A node of some depth
 * may have the discs of a coarser level of the model, and below it children with finer ones; a ray stops at the first
 * whose points are no farther apart than it asks for. Places are units of the model (core/points/record_shared.h). */
#ifndef KARST_CORE_POINTS_SPLAT_SHARED_H
#define KARST_CORE_POINTS_SPLAT_SHARED_H

#include "core/points/record_shared.h"

/* The root has depth 0; no node is deeper than this. */
#define KARST_SPLAT_MAX_DEPTH 27

#define KARST_SPLAT_FILLED 0x100u /* the node's discs are all of a level that touch it; else only children have some */

typedef struct {
    uint children; /* number of the first of its children, which follow one another by octant */
    uint octants;  /* bits 0 to 7: which there are (x is bit 0 of an octant, y bit 1, z bit 2); KARST_SPLAT_FILLED */
    uint first, num; /* its discs */
} karst_splat_node;
K_ASSERT_SIZE(karst_splat_node, 16);

/* A model that stands somewhere. Offsets in 64-bit words from the buffer's begin. */
typedef struct {
    ulong nodes, discs;
    float to_units[9];      /* from level-0 voxels to units: row by row */
    float units_per_voxel;
    float spacings[KARST_SPLAT_MAX_DEPTH + 1]; /* by depth: how far apart its points are, units; 0: none end there */
    float finest, coarsest;                    /* the least and the largest of them */
    uint has_colours, is_deep; /* deep: discs of all nodes along the ray are blended, not of one */
    uint has_backs;            /* rays that look for either side meet backs, too */
    int root_log2;             /* the root's lower corner is -2^root_log2 on each axis, and it is twice as wide */
} karst_splat_model;
K_ASSERT_SIZE(karst_splat_model, 192);

typedef struct {
    uint num_models, pad;
    ulong models;
    float linear[256]; /* of bytes of sRGB (IEC 61966-2-1) */
} karst_splats_head;
K_ASSERT_SIZE(karst_splats_head, 1040);

/* What a disc's radius is: its point's, but a unit at least. */
K_INLINE float karst_splat_radius(float radius) { return radius > 1.0f ? radius : 1.0f; }

#endif
