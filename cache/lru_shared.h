/* Usage lists: what host and kernels share. Compiled twice, must agree bit for bit: see core/dialect.h. */
#ifndef KARST_CACHE_LRU_SHARED_H
#define KARST_CACHE_LRU_SHARED_H

#include "cache/layout_shared.h"

#define KARST_LRU_TILES 0u
#define KARST_LRU_BRICKS 1u

#define KARST_LRU_RADIX_BITS 4
#define KARST_LRU_RADIX_SIZE (1 << KARST_LRU_RADIX_BITS)

/* A piece of a list, and what is asked of it. */
typedef struct {
    uint kind;          /* KARST_LRU_TILES or _BRICKS */
    uint first, num;    /* positions in the list */
    uint need;          /* take at most this many */
    uint victims_first; /* where in the list of victims the first one goes */
    uint serial;        /* what carries this stamp is in use */
    uint sorted_serial; /* the list is in order of use up to this serial */
    uint drop_fallback; /* 1: bricks that are in use only as a stand-in may be taken */
} karst_lru_window;
K_ASSERT_SIZE(karst_lru_window, 32);

/* Stamped after `serial`? Never (0) is before everything. Serials wrap; a stamp that is more than 2^31 casts old passes
 * for a new one, which only delays its recycling. */
K_INLINE int karst_stamp_is_after(uint stamp, uint serial) { return stamp != 0u && (int)(stamp - serial) > 0; }

/* The later of two stamps. */
K_INLINE uint karst_stamp_later(uint a, uint b)
{
    if (a == 0u || b == 0u)
        return a | b;
    return (int)(a - b) > 0 ? a : b;
}

#endif
