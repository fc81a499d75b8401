/* A point's place in Morton order: 84 bits, x, y and z, 28 bits each, interleaved. */
#ifndef KARST_CORE_POINTS_KEY_H
#define KARST_CORE_POINTS_KEY_H

#include <stdint.h>

#include "core/points/record_shared.h"

#define POINTS_HIGH_BITS 63
#define POINTS_LOW_BITS 21

/* 21 bits, two zeros between any two. */
static inline uint64_t points_part_bits(uint64_t v)
{
    v = (v | v << 32) & 0x1f00000000ffffu;
    v = (v | v << 16) & 0x1f0000ff0000ffu;
    v = (v | v << 8) & 0x100f00f00f00f00fu;
    v = (v | v << 4) & 0x10c30c30c30c30c3u;
    return (v | v << 2) & 0x1249249249249249u;
}

/* The leading 63 bits, and the 21 others. */
static inline uint64_t points_high_key(const karst_point *point)
{
    uint64_t key = 0;
    for (int a = 0; a < 3; a++)
        key |= points_part_bits((uint32_t)(point->at[a] + KARST_POINTS_MAX_AT) >> 7) << a;
    return key;
}

static inline uint32_t points_low_key(const karst_point *point)
{
    uint64_t key = 0;
    for (int a = 0; a < 3; a++)
        key |= points_part_bits((uint32_t)(point->at[a] + KARST_POINTS_MAX_AT) & 127) << a;
    return (uint32_t)key;
}

#endif
