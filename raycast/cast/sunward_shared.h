/* What a brick is to rays towards the sun. Compiled twice: see core/device/dialect.h.
 *
 * They all have one direction, along which a brick's interpolant rises at most so much in a cell: the sum of the
 * largest shares of the differences along the cell's edges, since each component of the gradient is a weighted mean of
 * those. Where it falls in a cell, a ray that comes there through air leaves it in air, though the cell holds both
 * signs; and towards the sun a ray may go farther without a look than any way.
 */
#ifndef KARST_RAYCAST_SUNWARD_SHARED_H
#define KARST_RAYCAST_SUNWARD_SHARED_H

#include "cache/layout_shared.h"

/* What a ray in a fine block (2^3 cells; block x + 8 y + 64 z) may do: two bits each, sixteen to a word. */
#define KARST_SUNWARD_LOOK 0u /* look at its cell: solid may be met here, or all of this is solid */
#define KARST_SUNWARD_STEP 1u /* step out of the fine block */
#define KARST_SUNWARD_FREE 2u /* leave the brick: a ray in air meets nothing on its way through it */
#define KARST_SUNWARD_LEAP 3u /* step out of the block of 4^3 cells, in which there is nothing to look at */
#define KARST_SUNWARD_WORDS 32

typedef struct {
    uint ways[KARST_SUNWARD_WORDS];
    uint blocks[2];   /* as karst_brick_info's, of cells in which rays in air may meet solid */
    float safe_cells; /* times -q: so many cells towards the sun there is no zero in the brick */
    uint pad;
} karst_sunward_brick;
K_ASSERT_SIZE(karst_sunward_brick, 144);

/* A cell counts as falling where q falls at least so fast, in steps of q a cell: far more than rounding. */
#define KARST_SUNWARD_FALL 1.0f
/* More than sums of three shares of q err by. */
#define KARST_SUNWARD_ROUNDING 0.05f

/* Slots whose samples were never written are not looked at. */
typedef struct {
    float direction[4]; /* unit, towards the sun; [3] unused */
    uint from_loads;    /* 1: those that the work's loads went to; 0: all that have an owner */
    uint num;           /* loads, or slots */
} karst_sunward_task;
K_ASSERT_SIZE(karst_sunward_task, 24);

#endif
