/* How bulk passes over the pools are cut into work-items. The results do not depend on it. */
#ifndef KARST_CACHE_SHAPE_H
#define KARST_CACHE_SHAPE_H

#include "core/device/context.h"

/* On CPUs a work-item goes through a long chunk by itself: that beats a work-group scan several times over. Elsewhere
 * chunks are short, so that there are work-items enough. */
typedef struct {
    uint32_t chunk;       /* entries of a list that one work-item goes through; a multiple of 32 */
    uint32_t chunk_local; /* work-group size of passes over chunks */
    uint32_t item_local;  /* work-group size of passes over single items */
    uint32_t scan_width;  /* work-items that scan the chunks' counts together, in one work-group */
    uint32_t sharers;     /* work-items that share a list of unknown length, in groups of chunk_local */
} karst_pass_shape;

static inline karst_pass_shape karst_pass_shape_of(const karst_context *context)
{
    if (context->is_cpu)
        return (karst_pass_shape){2048, 1, 64, 1, 8 * (uint32_t)context->compute_units};
    return (karst_pass_shape){64, 64, 64, 256, 2048};
}

static inline uint32_t karst_pass_chunks(const karst_pass_shape *shape, uint32_t num_entries)
{
    return (uint32_t)(((uint64_t)num_entries + shape->chunk - 1) / shape->chunk);
}

#endif
