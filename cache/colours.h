/* Colours of a store's bricks: a second channel, kept by slot beside the pool of samples. A scene in which nothing has
 * a colour of its own has none. Not thread-safe. */
#ifndef KARST_CACHE_COLOURS_H
#define KARST_CACHE_COLOURS_H

#include "cache/buffers.h"

/* Twice the memory of a pool of 16 bits; where memory is the system's own, what no brick wrote takes none. */
#define KARST_COLOUR_BRICK_BYTES ((size_t)KARST_BRICK_PADDED * 4)

typedef struct {
    /* uint[bricks_per_segment * KARST_BRICK_PADDED] each, one for each sample of a brick, in its order
     * (cache/colour.clh); unused repeat [0] */
    karst_buffer *samples[KARST_MAX_BRICK_SEGMENTS];
    uint32_t num_segments, bricks_per_segment;
    karst_buffer *coloured; /* uint for each slot, those of root bricks included: 1: it has colours; 0: it has none, and
                             * what `samples` hold means nothing */
} karst_colours;

/* For all slots of a store: none has colours. Errors (NULL): KARST_FAILED (no memory), KARST_USAGE (more than
 * KARST_MAX_BRICK_SEGMENTS allocations). */
karst_colours *karst_colours_create(karst_context *context, const karst_cache_buffers *bricks, karst_error *error);
/* The queue must be done. NULL is fine. */
void karst_colours_destroy(karst_colours *colours);

#endif
