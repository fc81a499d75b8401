/* Eviction: what host and kernels share. Compiled twice, must agree bit for bit: see core/dialect.h. */
#ifndef KARST_CACHE_EVICT_SHARED_H
#define KARST_CACHE_EVICT_SHARED_H

#include "cache/layout_shared.h"

/* What was let go of; names as in identity_shared.h. */
typedef struct {
    ulong name;
    ulong brick_names[KARST_TILE_NODES]; /* valid where bricks[i] is not KARST_NONE */
    uint bricks[KARST_TILE_NODES];       /* the bricks that its nodes had */
    uint slot;
    uint pad;
} karst_evicted_tile;
K_ASSERT_SIZE(karst_evicted_tile, 112);

typedef struct {
    ulong name;
    uint slot;
    uint pad;
} karst_evicted_brick;
K_ASSERT_SIZE(karst_evicted_brick, 16);

#endif
