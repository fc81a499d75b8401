/* What tile or brick something is, wherever it lies: a 64-bit name made of kind, level and exact position. */
#ifndef KARST_CACHE_IDENTITY_SHARED_H
#define KARST_CACHE_IDENTITY_SHARED_H

#include "cache/layout_shared.h"
#include "core/device/dialect.h"

#define KARST_IDENTITY_TILE 1u
#define KARST_IDENTITY_BRICK 2u

/* Finaliser of MurmurHash3 (A. Appleby, public domain), with the constants that D. Stafford found by search ("Mix13").
 */
K_INLINE ulong karst_identity_mix(ulong x)
{
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9UL;
    x = (x ^ x >> 27) * 0x94d049bb133111ebUL;
    return x ^ x >> 31;
}

/* Never 0. A tile goes by the coordinate of its child 0, at its nodes' level; a brick by its node's. */
K_INLINE ulong karst_identity(uint kind, int level, long x, long y, long z)
{
    ulong h = karst_identity_mix(0x9e3779b97f4a7c15UL + ((ulong)kind << 8 | (ulong)(uint)level));
    h = karst_identity_mix(h ^ (ulong)x);
    h = karst_identity_mix(h + (ulong)y);
    h = karst_identity_mix(h ^ (ulong)z);
    return h ? h : 1UL;
}

/* The name of a node's brick, or of the tile of its children. */
K_INLINE ulong karst_node_identity(int of_children, uint node, K_GLOBAL const karst_tile_info *tile_info)
{
    long x = tile_info->corner[0] + (node & 1), y = tile_info->corner[1] + (node >> 1 & 1);
    long z = tile_info->corner[2] + (node >> 2 & 1);
    int level = tile_info->level;
    return of_children ? karst_identity(KARST_IDENTITY_TILE, level - 1, 2 * x, 2 * y, 2 * z)
                       : karst_identity(KARST_IDENTITY_BRICK, level, x, y, z);
}

#endif
