/* Eviction: makes room by recycling what was least recently used. */
#ifndef KARST_CACHE_EVICT_H
#define KARST_CACHE_EVICT_H

#include "cache/beside.h"
#include "cache/buffers.h"
#include "cache/churn.h"
#include "cache/evict_shared.h"
#include "cache/lru.h"
#include "cache/slots.h"

typedef struct karst_evict {
    karst_context *context;
    karst_pass_shape shape;
    const karst_cache_buffers *pools; /* borrowed */
    karst_lru *tiles, *bricks;        /* borrowed */
    karst_churn *churn;               /* borrowed: is told what went... */
    karst_slots *brick_slots;         /* ...and bricks that went with a tile go back here */
    const karst_mapped *mapped;       /* borrowed: where pools are mapped, the host recycles */
    cl_kernel unlink_tiles, unlink_bricks;
    karst_buffer *evicted_tiles;  /* karst_evicted_tile[KARST_CACHE_MAX_WORK] */
    karst_buffer *evicted_bricks; /* karst_evicted_brick[KARST_CACHE_MAX_WORK] */
    karst_evicted_tile *host_tiles;
    karst_evicted_brick *host_bricks;
    /* Of the land's: the next store's, whose bricks go with the tiles, too; and of that: its nodes, on the device. */
    struct karst_evict *next;
    const karst_beside *beside;
} karst_evict;

/* Errors: KARST_FAILED. karst_evict_finish takes what a failed init left, or zeros. */
bool karst_evict_init(karst_evict *evict, karst_context *context, const karst_cache_buffers *pools, karst_lru *tiles,
                      karst_lru *bricks, const karst_mapped *mapped, karst_churn *churn, karst_slots *brick_slots,
                      karst_error *error);
/* Of cache/collect.cl, where pools are not mapped. Errors: KARST_FAILED. */
bool karst_evict_take_kernels(karst_evict *evict, karst_program *program, karst_error *error);
void karst_evict_finish(karst_evict *evict);

/* Starts what the next two are expected to do, without a wait: nothing needs to be known of tiles to go on to bricks.
 * need_bricks: as if no brick went with the tiles. Either may be 0. */
bool karst_evict_start(karst_evict *evict, uint32_t serial, uint32_t need_tiles, uint32_t need_bricks,
                       karst_error *error);
/* Recycles at most `need` (up to KARST_CACHE_MAX_WORK) tiles by order of use, writes them to `slots`, and *num_evicted.
 * When those whose last child went in this way come to be childless they are next, so that fewer than `need` means: all
 * others are in use. Bricks of recycled tiles go back to brick_slots, of each store; *num_bricks_freed counts them. */
bool karst_evict_tiles(karst_evict *evict, uint32_t serial, uint32_t frame, uint32_t need, uint32_t *slots,
                       uint32_t *num_evicted, uint32_t *num_bricks_freed, karst_error *error);
/* The same for bricks. Their nodes become KARST_STATE_LOST and keep their children. may_drop_fallback: in the end also
 * those that are used only as a stand-in, by slot. */
bool karst_evict_bricks(karst_evict *evict, uint32_t serial, uint32_t frame, uint32_t need, bool may_drop_fallback,
                        uint32_t *slots, uint32_t *num_evicted, karst_error *error);

#endif
