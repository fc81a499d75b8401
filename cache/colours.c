/* Memory for colours of bricks. */
#include "cache/colours.h"

#include <stdlib.h>

/* Kernels find a sample in a segment by an int. */
#define MOST_WORDS ((size_t)INT32_MAX)

static bool create_samples(karst_colours *colours, karst_context *context, size_t num_slots, uint32_t most,
                           karst_error *error)
{
    size_t limit = context->max_allocation_bytes / KARST_COLOUR_BRICK_BYTES;
    size_t per_segment = limit < MOST_WORDS / KARST_BRICK_PADDED ? limit : MOST_WORDS / KARST_BRICK_PADDED;
    per_segment = per_segment < most ? per_segment : most;
    size_t num = per_segment ? (num_slots + per_segment - 1) / per_segment : 0;
    if (num == 0 || num > KARST_MAX_BRICK_SEGMENTS)
        return karst_fail(error, KARST_USAGE,
                          "colours of %zu bricks take %zu allocations of this device, but %d is the limit: use a "
                          "smaller --pool",
                          num_slots, num, KARST_MAX_BRICK_SEGMENTS);
    colours->num_segments = (uint32_t)num;
    colours->bricks_per_segment = (uint32_t)per_segment;
    for (size_t i = 0; i < KARST_MAX_BRICK_SEGMENTS; i++) {
        if (i >= num)
            colours->samples[i] = colours->samples[0];
        else if (!(colours->samples[i] =
                       karst_buffer_create_blank(context, "colours", per_segment * KARST_COLOUR_BRICK_BYTES, error)))
            return false;
    }
    return true;
}

karst_colours *karst_colours_create(karst_context *context, const karst_cache_buffers *bricks, karst_error *error)
{
    size_t num_slots = (size_t)bricks->num_bricks + KARST_CACHE_ROOT_BRICKS;
    karst_colours *colours = calloc(1, sizeof *colours);
    if (!colours) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    if (create_samples(colours, context, num_slots, bricks->bricks_per_segment, error) &&
        (colours->coloured = karst_buffer_create(context, "colours", num_slots * sizeof(uint32_t), NULL, error)))
        return colours;
    karst_colours_destroy(colours);
    return NULL;
}

void karst_colours_destroy(karst_colours *colours)
{
    if (!colours)
        return;
    for (uint32_t i = 0; i < KARST_MAX_BRICK_SEGMENTS; i++)
        if (i < 1 || colours->samples[i] != colours->samples[0])
            karst_buffer_destroy(colours->samples[i]);
    karst_buffer_destroy(colours->coloured);
    free(colours);
}
