/* Eviction: makes room by recycling what was least recently used. */
#ifndef KARST_CACHE_EVICT_H
#define KARST_CACHE_EVICT_H

#include "cache/cache.h"
#include "cache/churn.h"
#include "cache/lru.h"
#include "cache/slots.h"

typedef struct {
    karst_context *context;
    karst_shape shape;
    const karst_cache_buffers *pools; /* borrowed */
    cl_kernel tiles, bricks;
    karst_buffer *victims;     /* uint[KARST_CACHE_MAX_WORK] */
    karst_buffer *tile_bricks; /* uint[KARST_CACHE_MAX_WORK * 8] */
    karst_buffer *identities;  /* ulong[KARST_CACHE_MAX_WORK * 9] */
    uint32_t *host_tile_bricks;
    uint64_t *host_identities;
} karst_evict;

/* Errors: KARST_FAILED. karst_evict_finish takes what a failed init left, or zeros. */
bool karst_evict_init(karst_evict *evict, karst_context *context, karst_program *program,
                      const karst_cache_buffers *pools, karst_error *error);
void karst_evict_finish(karst_evict *evict);

/* Recycles at most `need` (up to KARST_CACHE_MAX_WORK) tiles by order of use, writes them to `slots`, and *num_evicted.
 * When those whose last child went in this way come to be childless they are next, so that fewer than `need` means: all
 * others are in use. Bricks of recycled tiles go back to brick_slots; *num_bricks_freed counts them. */
bool karst_evict_tiles(karst_evict *evict, karst_lru *lru, uint32_t serial, uint32_t frame, uint32_t need,
                       karst_churn *churn, karst_slots *brick_slots, uint32_t *slots, uint32_t *num_evicted,
                       uint32_t *num_bricks_freed, karst_error *error);
/* The same for bricks. Their nodes become KARST_STATE_LOST and keep their children. may_drop_fallback: in the end also
 * those that are used only as a stand-in. */
bool karst_evict_bricks(karst_evict *evict, karst_lru *lru, uint32_t serial, uint32_t frame, uint32_t need,
                        bool may_drop_fallback, karst_churn *churn, uint32_t *slots, uint32_t *num_evicted,
                        karst_error *error);

#endif
