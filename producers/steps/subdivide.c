/* Launches of subdivide.cl. */
#include "producers/steps/subdivide.h"

#include <stdio.h>
#include <stdlib.h>

struct karst_subdivider {
    karst_context *context;
    karst_program *program;
    cl_kernel nodes;
    cl_mem data; /* of the world; NULL: none */
    size_t group_size;
};

karst_subdivider *karst_subdivider_create(karst_context *context, const karst_virtual_file *world, const char *options,
                                          karst_error *error)
{
    karst_subdivider *subdivider = calloc(1, sizeof *subdivider);
    char all_options[512];
    if (!subdivider) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    subdivider->context = context;
    /* A work-item of 16 boxes is a group's worth of work by itself; single boxes come in groups. */
    subdivider->group_size = context->lanes == 16 ? 1 : KARST_SHAPE_GROUP_SIZE;
    snprintf(all_options, sizeof all_options, "%s -DKARST_BOUNDS_GROUP=%zu", options, subdivider->group_size);
    subdivider->program = karst_program_build(context, "producers/steps/subdivide.cl", all_options, world, 1, error);
    if (!subdivider->program ||
        !(subdivider->nodes = karst_program_kernel(subdivider->program, "karst_bound_nodes", error))) {
        karst_subdivider_destroy(subdivider);
        return NULL;
    }
    return subdivider;
}

void karst_subdivider_destroy(karst_subdivider *subdivider)
{
    if (!subdivider)
        return;
    if (subdivider->nodes)
        clReleaseKernel(subdivider->nodes);
    karst_program_destroy(subdivider->program);
    free(subdivider);
}

void karst_subdivider_move(karst_subdivider *subdivider, karst_context *context)
{
    subdivider->context = context;
    karst_program_move(subdivider->program, context);
}

void karst_subdivider_set_data(karst_subdivider *subdivider, const karst_buffer *data)
{
    subdivider->data = data ? data->mem : NULL;
}

/* Boxes that a work-item bounds. On CPUs many: lanes that have no box of their own help others with theirs
 * (refine_list.clh), but what they do may turn out not to be needed. Fewer only where that would leave cores idle. */
#define MOST_BATCH 128u
#define ITEMS_A_CORE 2u
static uint32_t batch_for(const karst_subdivider *subdivider, uint32_t num_boxes)
{
    const karst_context *context = subdivider->context;
    uint32_t lanes = (uint32_t)context->lanes;
    if (lanes == 1)
        return 1;
    uint32_t items = ITEMS_A_CORE * (uint32_t)context->compute_units;
    uint32_t batch = (num_boxes / items + lanes - 1) / lanes * lanes;
    return batch < lanes ? lanes : batch > MOST_BATCH ? MOST_BATCH : batch;
}

/* What a launch has no use for is NULL. */
static const cl_mem nothing = NULL;

/* What boxes are, see subdivide.cl. */
enum { BOXES_OF_TILES, BOXES_OF_LOADS, BOXES_OF_LOADED };

bool karst_subdivide_tiles(karst_subdivider *subdivider, const karst_cache_buffers *cache, const karst_work *work,
                           karst_error *error)
{
    uint32_t first = 0, count = work->num_subdivides * KARST_TILE_NODES, kind = BOXES_OF_TILES,
             batch = batch_for(subdivider, count);
    return count == 0 || (KARST_ARGUMENTS(subdivider->nodes, error, KARST_BUFFER_ARG(work->subdivide_nodes),
                                          KARST_BUFFER_ARG(work->subdivide_tiles), KARST_VALUE_ARG(first),
                                          KARST_VALUE_ARG(count), KARST_VALUE_ARG(batch), KARST_VALUE_ARG(kind),
                                          KARST_BUFFER_ARG(cache->nodes), KARST_BUFFER_ARG(cache->tile_info),
                                          KARST_VALUE_ARG(nothing), KARST_VALUE_ARG(nothing), KARST_VALUE_ARG(nothing),
                                          KARST_VALUE_ARG(subdivider->data)) &&
                          karst_launch(subdivider->context, subdivider->nodes, KARST_STAGE_SUBDIVIDE,
                                       (count + batch - 1) / batch, subdivider->group_size, error));
}

bool karst_bound_loads(karst_subdivider *subdivider, const karst_cache_buffers *cache, const karst_work *work,
                       uint32_t first, uint32_t count, karst_buffer *loads, karst_error *error)
{
    uint32_t kind = BOXES_OF_LOADS, batch = (uint32_t)subdivider->context->lanes; /* all take the same time */
    return KARST_ARGUMENTS(subdivider->nodes, error, KARST_BUFFER_ARG(work->load_nodes), KARST_VALUE_ARG(nothing),
                           KARST_VALUE_ARG(first), KARST_VALUE_ARG(count), KARST_VALUE_ARG(batch),
                           KARST_VALUE_ARG(kind), KARST_BUFFER_ARG(cache->nodes), KARST_BUFFER_ARG(cache->tile_info),
                           KARST_BUFFER_ARG(loads), KARST_VALUE_ARG(nothing), KARST_VALUE_ARG(nothing),
                           KARST_VALUE_ARG(subdivider->data)) &&
           karst_launch(subdivider->context, subdivider->nodes, KARST_STAGE_EVALUATE, (count + batch - 1) / batch,
                        subdivider->group_size, error);
}

/* Half of a view's loads have no surface, so that a work-item finds about this many vectors' worth. */
#define LOADED_VECTORS 2u

bool karst_bound_clear_loads(karst_subdivider *subdivider, const karst_cache_buffers *cache, const karst_work *work,
                             uint32_t first, uint32_t count, const karst_buffer *least, karst_error *error)
{
    uint32_t kind = BOXES_OF_LOADED, batch = LOADED_VECTORS * 2 * (uint32_t)subdivider->context->lanes;
    return KARST_ARGUMENTS(subdivider->nodes, error, KARST_BUFFER_ARG(work->load_nodes), KARST_VALUE_ARG(nothing),
                           KARST_VALUE_ARG(first), KARST_VALUE_ARG(count), KARST_VALUE_ARG(batch),
                           KARST_VALUE_ARG(kind), KARST_BUFFER_ARG(cache->nodes), KARST_BUFFER_ARG(cache->tile_info),
                           KARST_VALUE_ARG(nothing), KARST_BUFFER_ARG(least), KARST_BUFFER_ARG(work->load_results),
                           KARST_VALUE_ARG(subdivider->data)) &&
           karst_launch(subdivider->context, subdivider->nodes, KARST_STAGE_EVALUATE, (count + batch - 1) / batch,
                        subdivider->group_size, error);
}
