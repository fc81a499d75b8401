/* Usage lists: all slots of a pool, least recently used first, kept by stream compaction on the device.
 *
 * The list is in exact order of (last use, slot index) as of a serial; what was used since then counts as behind all of
 * it, in whatever order. So one sort serves many rounds: each takes from a cursor on, passing over what was used or
 * freed meanwhile, and only when the cursor reaches the end are those sorted that were used since the last sort. A
 * round's cost follows what it takes. (Stream compaction for LRU: C. Crassin, "GigaVoxels", 2011, section 7.3; the lazy
 * sort is Karst's.) */
#ifndef KARST_CACHE_LRU_H
#define KARST_CACHE_LRU_H

#include "cache/cache.h"
#include "cache/lru_shared.h"
#include "cache/shape.h"

typedef struct {
    karst_context *context;
    karst_shape shape;
    uint32_t kind;   /* KARST_LRU_TILES or _BRICKS */
    uint32_t num;    /* entries: slots 1 to num */
    uint32_t cursor; /* before it stands nothing that could be taken */
    uint32_t sorted_serial;
    bool started;                                                      /* sorted_serial is valid */
    karst_buffer *order;                                               /* uint[num]: the list */
    karst_buffer *spare;                                               /* uint[num] */
    karst_buffer *marks;                                               /* two bits for each entry */
    karst_buffer *counts;                                              /* uint2 for each chunk (and digit) */
    karst_buffer *totals;                                              /* uint2 */
    karst_buffer *stamps, *fallback, *nodes, *tile_info, *brick_owner; /* the pools', borrowed */
    cl_kernel mark, scan, part, sort_mark, sort_part, digit_count, digit_part;
} karst_lru;

/* Errors: KARST_FAILED. karst_lru_finish takes what a failed init left, or zeros. */
bool karst_lru_init(karst_lru *lru, karst_context *context, karst_program *program, uint32_t kind,
                    const karst_cache_buffers *pools, karst_error *error);
void karst_lru_finish(karst_lru *lru);
/* Ascending slots, nothing used yet. */
bool karst_lru_reset(karst_lru *lru, karst_error *error);
/* Call once at the start of a round, with its serial. */
void karst_lru_begin(karst_lru *lru, uint32_t serial);

/* Takes the first `need` slots in the list's order that may be recycled (in use, not stamped with `serial`, tiles
 * without children), stamps them with `serial` and writes them to victims[victims_first...]. The root tile is never
 * taken. drop_fallback: bricks that serve only as a stand-in may be taken too; sort first. *num_taken < need: that was
 * all that is in order; sort, and take the rest. Nothing is unlinked here. */
bool karst_lru_take(karst_lru *lru, uint32_t serial, bool drop_fallback, uint32_t need, karst_buffer *victims,
                    uint32_t victims_first, uint32_t *num_taken, karst_error *error);
/* Brings all in order that is not in use at `serial`; what is comes last, by slot. Nothing to do if called again with
 * the same serial. */
bool karst_lru_sort(karst_lru *lru, uint32_t serial, karst_error *error);

#endif
