/* Hints: which lines of memory the beams of a picture have read, for when it is cast again. Compiled twice: see
 * core/device/dialect.h. */
#ifndef KARST_RAYCAST_HINTS_SHARED_H
#define KARST_RAYCAST_HINTS_SHARED_H

#include "cache/layout_shared.h"

#define KARST_HINT_LINES 16 /* of one brick, in one hint */
/* In a list: at 800x600 a beam of `hills` makes 85, the one with most of them some 450. */
#define KARST_BEAM_HINTS 384
#define KARST_HINT_FILTER_WORDS 16

/* What a beam read of bricks, in the order in which it came to them. Whatever stands here, only which memory is
 * prefetched follows from it: so it may be old, half written by another work-item, or nonsense. */
typedef struct {
    uint num;        /* of hints */
    uint fetched;    /* the serial with which they were last fetched */
    uint is_old;     /* 1: what the beam marches is no longer what is listed: the list is to be made anew */
    uint num_casts;  /* since it was made */
    uint num_bricks; /* that were marched then */
    uint last[2];    /* in the last cast: bricks that were marched, and of them those that are not in the filter */
    uint pad[9];
    uint filter[KARST_HINT_FILTER_WORDS];            /* bit karst_hint_bit: of bricks that hints are of */
    uint bricks[KARST_BEAM_HINTS];                   /* slots */
    uchar lines[KARST_BEAM_HINTS][KARST_HINT_LINES]; /* of 64 bytes, in the slot; the last one again to fill up */
} karst_beam_hints;
K_ASSERT_SIZE(karst_beam_hints, 7808);

/* Where a brick stands in the filter. */
K_INLINE uint karst_hint_bit(uint slot) { return slot * 0x9e3779b1u >> 23; }

#endif
