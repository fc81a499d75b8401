/* The pools in the host's own memory, for as long as a round collects. Where the device's memory is the host's anyway
 * (karst_buffer_memory), looking through the stamps, listing what is wanted and unlinking what is recycled takes the
 * host less than the commands that have the device do it, and the waits for them. The code that decides is the kernels'
 * own (wants_shared.h, lru_shared.h, evict_shared.h). */
#ifndef KARST_CACHE_MAPPED_H
#define KARST_CACHE_MAPPED_H

#include "cache/buffers.h"

/* NULL: not mapped. See cache.h for what they hold. */
typedef struct {
    const karst_cache_buffers *pools; /* borrowed */
    karst_node *nodes;
    karst_tile_info *tile_info;
    karst_brick_owner *brick_owner;
    uint32_t *tile_stamp, *brick_stamp, *brick_fallback;
    const uint32_t *want_brick, *want_children, *want_chunk, *want_rays;
} karst_mapped;

/* Can these be mapped? */
bool karst_mapped_is_possible(const karst_cache_buffers *pools);
/* Waits for the device; until karst_mapped_end nothing may be enqueued. Errors: KARST_FAILED. */
bool karst_mapped_begin(karst_mapped *mapped, karst_error *error);
/* What is enqueued from now on sees what was written. Does nothing if nothing is mapped. */
void karst_mapped_end(karst_mapped *mapped);

/* How many entries ahead of the one in work memory is asked for: a look at one waits for two or three lines of it. */
#define KARST_MAPPED_AHEAD 12u

#endif
