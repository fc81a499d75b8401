/* The layout of the two pools: what the cache keeps, the producers fill and rays read.
 *
 * Compiled by the host and by every device: see core/device/dialect.h. All indices are 32-bit; index 0 is "none" for
 * tiles and bricks (slot 0 of each pool is never handed out), tile 1 is the root tile for ever.
 *
 * Levels: level 0 has the finest voxel of the world; a voxel of level l is 2^l of them wide. A *node* of level l is a
 * cube of KARST_BRICK_CELLS voxels of level l on a side; its integer coordinate n means that it spans level-0 voxels
 * [n * KARST_BRICK_CELLS << l, (n + 1) * KARST_BRICK_CELLS << l). The children of node n (level l) are the nodes
 * 2n + {0,1}^3 (level l - 1); child i has x bit i & 1, y bit i >> 1 & 1, z bit i >> 2 & 1. They form one *tile*.
 */
#ifndef KARST_CACHE_LAYOUT_SHARED_H
#define KARST_CACHE_LAYOUT_SHARED_H

#include "cache/sample_shared.h"
#include "core/device/dialect.h"

#define KARST_BRICK_CELLS 16 /* cells on a side of a brick */
#define KARST_BRICK_CELLS_LOG2 4
#define KARST_BRICK_SIDE (KARST_BRICK_CELLS + 1) /* samples on a side */
#define KARST_BRICK_SAMPLES \
    (KARST_BRICK_SIDE * KARST_BRICK_SIDE * KARST_BRICK_SIDE) /* 4913, x fastest, then y, then z */
#define KARST_BLOCK_CELLS 4 /* cells on a side of a block of the block mask: 4^3 blocks, 64 bits */

/* A slot: the samples, padded to whole cache lines, then the fine mask, a line of its own. Its bit b = x/2 + 8*(y/2) +
 * 64*(z/2), cells, of word b / 32: set if the 2^3 cells there have one with both signs at its corners. */
#define KARST_BRICK_PADDED 4928
#define KARST_FINE_CELLS 2
#define KARST_FINE_WORDS 16
#define KARST_FINE_BYTES 64
#define KARST_BRICK_BYTES(bits) (KARST_BRICK_PADDED * (bits) / 8 + KARST_FINE_BYTES)
/* Samples from one slot to the next. */
#define KARST_BRICK_STRIDE (KARST_BRICK_PADDED + KARST_FINE_BYTES * 8 / KARST_BRICK_BITS)

#define KARST_TILE_NODES 8
#define KARST_ROOT_TILE 1u
#define KARST_NONE 0u
#define KARST_NO_NODE 0xffffffffu

/* Node states. A constant node (air or solid) is proven for every footprint from 0 to its parent's voxel. */
#define KARST_STATE_UNKNOWN 0u /* never looked at: only root nodes, and nodes that wait for their bounds */
#define KARST_STATE_AIR 1u
#define KARST_STATE_SOLID 2u
#define KARST_STATE_BRICK 3u /* not constant, its brick is in memory */
#define KARST_STATE_LOST 4u  /* not constant, without a brick: not loaded yet, or recycled; it may have children */
/* Not constant, but evaluated: at this level all samples are on one side, so the interpolant has no zero and needs no
 * brick. Finer levels may have a surface: such a node may have children. It may get a brick all the same, if rays want
 * one: where levels blend into one another, how far from zero it is matters. */
#define KARST_STATE_CLEAR_AIR 5u
#define KARST_STATE_CLEAR_SOLID 6u

/* What a ray reads for each node: 8 bytes, so that a tile is one cache line. */
typedef struct {
    uint link;  /* state << 29 | tile of its children (0: none) */
    uint brick; /* brick slot (0: none) */
} karst_node;
K_ASSERT_SIZE(karst_node, 8);

/* Added to a clear state in what a load came to: its brick was written, too. */
#define KARST_LOAD_KEPT 8u

#define KARST_NODE_STATE(link) ((link) >> 29)
#define KARST_NODE_CHILDREN(link) ((link)&0x0fffffffu)
#define KARST_NODE_LINK(state, tile) ((state) << 29 | (tile))
#define KARST_MAX_TILES 0x0fffffffu

/* What the cache and the producers know of a tile (rays do not read it). */
typedef struct {
    long corner[3]; /* node coordinate of child 0, at `level`: even, except in the root tile */
    int level;      /* of the eight nodes */
    uint parent; /* attachment: the node whose link names this tile; KARST_NO_NODE: the root tile, or orphaned */
    uint parent_generation; /* generation of the parent's tile when it was attached */
    uint generation;        /* counts how often this slot was handed out; wraps */
    uint in_use;            /* 1 while the slot holds a tile; else only the generation means anything */
    uint pad[5];
} karst_tile_info;
K_ASSERT_SIZE(karst_tile_info, 64);
#define KARST_TILE_PARENT_WORD 7 /* where `parent` stands among its 32-bit words */

/* What a ray reads for each brick: 32 bytes, so that none lies in two lines of memory. Value of a sample = scale *
 * (float)q, q a karst_brick_sample (sample_shared.h) that has the sign of the density (0 counts as air; of 16 bits a
 * positive density is at least 1, a negative one at most -1).
 * safe_cells * |q interpolated| is a distance in cells within which the interpolant has no zero. */
typedef struct {
    float scale;
    float safe_cells;
    uint blocks[2]; /* bit b = x/4 + 4*(y/4) + 16*(z/4), cells: set if the 4^3 block has a cell with both signs at its
                       corners */
    uint solid[2];  /* likewise: set if the block's first sample is solid. Of a block that has no such cell all are as
                       this one */
    uint slopes[2]; /* how steep it is along each axis: raycast/cast/slopes_shared.h. 0: not known */
} karst_brick_info;
K_ASSERT_SIZE(karst_brick_info, 32);

/* What the cache knows of a brick: attachment to its node. */
typedef struct {
    uint owner;            /* node index whose brick this is; KARST_NO_NODE: free */
    uint owner_generation; /* generation of the owner's tile when it was attached */
} karst_brick_owner;
K_ASSERT_SIZE(karst_brick_owner, 8);

/* Rays only store the frame's serial number (never 0; compared for equality or by signed difference, so that it may
 * wrap):
 *   tile_stamp[tile]        the tile was walked through
 *   brick_stamp[slot]       the brick was marched at the level that the footprint asked for
 *   brick_fallback[slot]    the brick was marched in place of a finer one that is missing
 *   want_brick[node]        a ray wants this node's brick
 *   want_children[node]     a ray wants this node's children
 *   want_chunk[node / KARST_REQUEST_CHUNK]   one of the two was stored in this chunk: lets collect skip the rest
 *   want_rays[node]         how many of the picture's rays ended in this node on a brick that stands in for what it
 *                           lacks: the upper half is the serial's lower one, the lower half the number
 */
#define KARST_REQUEST_CHUNK 64

/* How many a word of want_rays counts for this serial. */
K_INLINE uint karst_rays_counted(uint word, uint serial)
{
    return word >> 16 == (serial & 0xffffu) ? word & 0xffffu : 0u;
}
/* The word once `num` more are counted; so many at most that the order in which they come does not matter. */
K_INLINE uint karst_rays_add(uint word, uint num, uint serial)
{
    uint sum = karst_rays_counted(word, serial) + num;
    return serial << 16 | (sum < 0xffffu ? sum : 0xffffu);
}

/* A brick pool larger than one allocation is cut in segments of `bricks_per_segment` slots; kernels take this many
 * pointers (unused ones repeat the first). */
#define KARST_MAX_BRICK_SEGMENTS 8

#endif
