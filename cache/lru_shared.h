/* Usage lists: what host and kernels share. Compiled twice, must agree bit for bit: see core/device/dialect.h. */
#ifndef KARST_CACHE_LRU_SHARED_H
#define KARST_CACHE_LRU_SHARED_H

#include "cache/layout_shared.h"

/* A look at slots in the order in which they are to be recycled. */
typedef struct {
    uint num;         /* slots in the list */
    uint need;        /* take this many */
    uint all_or_none; /* 1: take nothing if there are fewer than `need` */
    uint serial;      /* what carries this stamp is in use */
    uint stand_ins;   /* 1: bricks that are in use only as a stand-in may be taken */
    uint need_before; /* not 0: if so many tiles were taken, need as many less as bricks were freed with them; if
                         not, take none */
    uint pad[2];
} karst_lru_ask;
K_ASSERT_SIZE(karst_lru_ask, 32);

typedef struct {
    uint num_fit;   /* slots in the list that may be recycled */
    uint num_taken; /* of them */
    uint num_kept;  /* tiles that may not only because they have children */
    uint num_seen;  /* slots in the list up to the last one taken */
} karst_lru_result;
K_ASSERT_SIZE(karst_lru_result, 16);

/* What a look writes into the list, into the bits that no slot has. */
#define KARST_LRU_FITS 0x80000000u
#define KARST_LRU_KEPT 0x40000000u
#define KARST_LRU_SLOT 0x3fffffffu

/* May a tile be recycled (KARST_LRU_FITS), or not only because it has children (KARST_LRU_KEPT)? */
K_INLINE uint karst_lru_look_at_tile(uint tile, uint stamp, uint serial, K_GLOBAL const karst_node *nodes,
                                     K_GLOBAL const karst_tile_info *tile_info)
{
    /* All is read before anything is decided: what is waited for is memory. */
    uint children = 0, in_use = tile_info[tile].in_use;
    for (uint i = 0; i < KARST_TILE_NODES; i++)
        children |= KARST_NODE_CHILDREN(nodes[tile * KARST_TILE_NODES + i].link);
    if (tile <= KARST_ROOT_TILE || stamp == serial || !in_use)
        return 0u;
    return children ? KARST_LRU_KEPT : KARST_LRU_FITS;
}

#endif
