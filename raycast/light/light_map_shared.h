/* Light maps as host and kernels see them: raycast/light/light_map.h. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_LIGHT_MAP_SHARED_H
#define KARST_RAYCAST_LIGHT_MAP_SHARED_H

#include "core/device/dialect.h"

/* A place whose light is known. */
typedef struct {
    float place[3]; /* from the map's anchor, level-0 voxels */
    float radius;   /* how far it counts */
    float light[3]; /* of a white surface there */
    uint normal;    /* of the surface, ten bits an axis */
} karst_light_map_record;
K_ASSERT_SIZE(karst_light_map_record, 32);

/* What a launch is about. */
typedef struct {
    float offset[3];   /* from the anchor of what is shaded to that of the map */
    int finest_level;  /* of its cells: log2 of their width in level-0 voxels */
    uint levels;       /* bit i: there are cells of finest_level + i */
    uint mask;         /* buckets - 1: a power of two */
    int width_px, height_px;
} karst_light_map_task;
K_ASSERT_SIZE(karst_light_map_task, 32);

#define KARST_LIGHT_MAP_LEVELS 32

/* The level of cells that are at least as wide as a ball of that radius, which therefore meets eight of them at most.
 */
K_INLINE int karst_light_map_level(float radius) { return (int)(k_as_uint(radius) >> 23) - 125; }

/* 2^exponent, for exponents of floats. */
K_INLINE float karst_light_map_power(int exponent) { return k_as_float((uint)(exponent + 127) << 23); }

K_INLINE uint karst_light_map_bucket(int x, int y, int z, int level, uint mask)
{
    uint h = (uint)x * 0x9e3779b1u ^ (uint)y * 0x85ebca77u ^ (uint)z * 0xc2b2ae3du ^ (uint)level * 0x27d4eb2fu;
    h ^= h >> 15;
    h *= 0x2c1b3c6du;
    h ^= h >> 12;
    return h & mask;
}

#endif
