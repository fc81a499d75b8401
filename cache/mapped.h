/* The pools in the host's own memory, for as long as a round recycles. Where device memory is the host's anyway (CPUs),
 * looking at some hundred slots and unlinking them there costs less than the commands that have the device do it, and
 * the wait for them. The code that does it is the kernels' own (lru_shared.h, evict_shared.h). */
#ifndef KARST_CACHE_MAPPED_H
#define KARST_CACHE_MAPPED_H

#include "cache/cache.h"

/* The four are NULL: not mapped. */
typedef struct {
    const karst_cache_buffers *pools; /* borrowed */
    karst_node *nodes;
    karst_tile_info *tile_info;
    karst_brick_owner *brick_owner;
    uint32_t *tile_stamp;
} karst_mapped;

/* Maps them behind what was enqueued, and returns at once: they may be touched after the next wait. No kernel may touch
 * these four until karst_mapped_end. Mapped twice is mapped once. Errors: KARST_FAILED. */
bool karst_mapped_begin(karst_mapped *mapped, karst_error *error);
/* What is enqueued from now on sees what was written. Does nothing if nothing is mapped. */
bool karst_mapped_end(karst_mapped *mapped, karst_error *error);
/* The same, but the device does nothing of it, nor of what is enqueued behind, before `gate` is set (NULL: at once). */
bool karst_mapped_end_behind(karst_mapped *mapped, cl_event gate, karst_error *error);

/* How many entries ahead of the one in work memory is asked for: a look at one waits for two or three lines of it. */
#define KARST_MAPPED_AHEAD 12u

#endif
