/* Wants: what host and kernels share. Compiled twice, must agree bit for bit: see core/device/dialect.h. */
#ifndef KARST_CACHE_WANTS_SHARED_H
#define KARST_CACHE_WANTS_SHARED_H

#include "cache/layout_shared.h"

#define KARST_WANT_CLASSES 3072u /* classes of priority: 0 is the most urgent */
#define KARST_WANT_CLASS_MASK 0x0fffu
#define KARST_WANT_BRICK 0x1000u
#define KARST_WANT_CHILDREN 0x2000u

#define KARST_WANTS_LIST 65536u /* wants in one piece of the list */

/* A node with at least one valid want. */
typedef struct {
    uint node;
    uint what; /* class, KARST_WANT_BRICK, KARST_WANT_CHILDREN */
} karst_want;
K_ASSERT_SIZE(karst_want, 8);

/* What of a cast the kernels need. */
typedef struct {
    long camera[3]; /* level-0 voxel */
    uint serial;
    uint num_nodes;
    uint turn; /* of karst_want_delay */
    uint pad;
} karst_wants_view;
K_ASSERT_SIZE(karst_wants_view, 40);

/* Level-0 voxels between the camera and a node's extent on one axis, exact; 0: inside. `shift` is log2 of the node's
 * width, at most 63: unsigned, since the gap may be longer than an int64 holds. */
K_INLINE ulong karst_want_gap(long node, long camera, int shift)
{
    long own = camera >> shift; /* the node that the camera is in */
    ulong inside = (ulong)camera & (((ulong)1 << shift) - 1);
    if (node > own)
        return (((ulong)node - (ulong)own) << shift) - inside;
    if (node < own)
        return (((ulong)own - (ulong)node - 1) << shift) + inside;
    return 0;
}

/* The class of a node's projected error, 2^level over the distance to its box: larger error, lower class; 16 classes
 * for a factor of 2. The distance counts as at least one level-0 voxel. It stands squared in a float whose upper bits
 * are its logarithm, near enough; so there is no square root or division in which devices might differ. */
K_INLINE uint karst_want_class(int level, ulong gap_x, ulong gap_y, ulong gap_z)
{
    float x = (float)gap_x * 0.25f, y = (float)gap_y * 0.25f,
          z = (float)gap_z * 0.25f; /* 2^64 squared would be too large */
    float squared = k_max(x * x + y * y + z * z, 0.0625f);
    return (k_as_uint(squared) >> 20) +
           16u * (uint)(59 - level); /* level at most 59: 2040 + 944, and a delay of 64, < KARST_WANT_CLASSES */
}

/* By how many classes a want waits for those of nodes in which more of the picture's rays end: half an octave for each
 * halving of their number (from 128 on), four octaves where they only pass. A pixel has the level of the brick that it
 * ends in, so these are the bricks that it is short of; nearly half of those that rays pass turn out to be clear. Lest
 * what nothing ends in yet waits for ever (a thin thing that no stand-in shows), each node has its turn in one of so
 * many rounds, in which its error alone counts. */
#define KARST_WANT_TURNS 256u
K_INLINE uint karst_want_delay(uint node, uint num_rays, uint turn)
{
    uint delay = (node + turn) % KARST_WANT_TURNS ? 64u : 0u;
    for (; num_rays && delay; num_rays >>= 1)
        delay -= 8u;
    return delay;
}

/* Which of a node's wants count: for what it does not have and could have. */
K_INLINE uint karst_want_valid(uint wants, karst_node node, int level)
{
    uint state = KARST_NODE_STATE(node.link);
    if (state == KARST_STATE_AIR || state == KARST_STATE_SOLID)
        return 0u;
    if (state == KARST_STATE_BRICK || node.brick != KARST_NONE)
        wants &= ~KARST_WANT_BRICK;
    if (KARST_NODE_CHILDREN(node.link) != KARST_NONE || level <= 0)
        wants &= ~KARST_WANT_CHILDREN;
    return wants;
}

/* The same of a node, of which a ray said `wants` in this cast. */
K_INLINE uint karst_wants_of(uint node, uint wants, uint num_nodes, K_GLOBAL const karst_node *nodes,
                             K_GLOBAL const karst_tile_info *tile_info)
{
    if (!wants || node >= num_nodes || !tile_info[node / KARST_TILE_NODES].in_use)
        return 0u;
    return karst_want_valid(wants, nodes[node], tile_info[node / KARST_TILE_NODES].level);
}

/* The class of a node's wants, and how long they wait; `rays` is its word of want_rays. */
K_INLINE uint karst_want_place(uint node, K_PRIVATE const karst_wants_view *view, uint rays,
                               K_GLOBAL const karst_tile_info *tile_info)
{
    uint tile = node / KARST_TILE_NODES;
    int level = tile_info[tile].level, shift = level + KARST_BRICK_CELLS_LOG2;
    return karst_want_class(level, karst_want_gap(tile_info[tile].corner[0] + (node & 1), view->camera[0], shift),
                            karst_want_gap(tile_info[tile].corner[1] + (node >> 1 & 1), view->camera[1], shift),
                            karst_want_gap(tile_info[tile].corner[2] + (node >> 2 & 1), view->camera[2], shift)) +
           karst_want_delay(node, karst_rays_counted(rays, view->serial), view->turn);
}

#endif
