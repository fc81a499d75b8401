/* Launches of finalise.cl. */
#include "producers/steps/finalise.h"

#include <stdio.h>
#include <stdlib.h>

struct karst_finaliser {
    karst_context *context;
    karst_program *program;
    cl_kernel bricks;
    size_t group_size; /* work-items a brick */
};

karst_finaliser *karst_finaliser_create(karst_context *context, karst_shape shape, const karst_channel_layout *layout,
                                        const char *options, karst_error *error)
{
    karst_finaliser *finaliser = calloc(1, sizeof *finaliser);
    char all_options[1024], channels[512];
    if (!finaliser) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    finaliser->context = context;
    finaliser->group_size = karst_shape_group_size(shape, context->is_cpu);
    karst_channels_options(layout, channels, sizeof channels);
    snprintf(all_options, sizeof all_options, "%s %s -DKARST_GROUP=%zu", options, channels, finaliser->group_size);
    finaliser->program = karst_program_build(context, "producers/steps/finalise.cl", all_options, NULL, 0, error);
    if (!finaliser->program ||
        !(finaliser->bricks = karst_program_kernel(finaliser->program, "karst_finalise_bricks", error))) {
        karst_finaliser_destroy(finaliser);
        return NULL;
    }
    return finaliser;
}

void karst_finaliser_destroy(karst_finaliser *finaliser)
{
    if (!finaliser)
        return;
    if (finaliser->bricks)
        clReleaseKernel(finaliser->bricks);
    karst_program_destroy(finaliser->program);
    free(finaliser);
}

void karst_finaliser_move(karst_finaliser *finaliser, karst_context *context)
{
    finaliser->context = context;
    karst_program_move(finaliser->program, context);
}

/* A chunk of loads on its way into bricks. */
typedef struct {
    const karst_cache_buffers *cache;
    const karst_work *work;
    uint32_t first, count;
    karst_buffer *loads, *staging, *scrubs;
} chunk;

static bool launch(karst_finaliser *finaliser, const chunk *c, cl_mem total, uint32_t num_groups, karst_error *error)
{
    const karst_cache_buffers *cache = c->cache;
    karst_buffer *const *b = cache->bricks;
    return KARST_ARGUMENTS(finaliser->bricks, error, KARST_BUFFER_ARG(c->loads), KARST_BUFFER_ARG(c->staging),
                           KARST_VALUE_ARG(c->first), KARST_VALUE_ARG(c->count), KARST_BUFFER_ARG(c->work->load_slots),
                           KARST_BUFFER_ARG(c->work->load_results), KARST_BUFFER_ARG(cache->brick_info),
                           KARST_BUFFER_ARG(c->scrubs), KARST_VALUE_ARG(total),
                           KARST_VALUE_ARG(cache->bricks_per_segment),
                           KARST_BUFFER_ARG(b[0]), KARST_BUFFER_ARG(b[1]), KARST_BUFFER_ARG(b[2]),
                           KARST_BUFFER_ARG(b[3]), KARST_BUFFER_ARG(b[4]), KARST_BUFFER_ARG(b[5]),
                           KARST_BUFFER_ARG(b[6]), KARST_BUFFER_ARG(b[7])) &&
           karst_launch(finaliser->context, finaliser->bricks, KARST_STAGE_FINALISE,
                        (size_t)num_groups * finaliser->group_size, finaliser->group_size, error);
}

bool karst_finalise_bricks(karst_finaliser *finaliser, const karst_cache_buffers *cache, const karst_work *work,
                           uint32_t first, uint32_t count, karst_buffer *loads, karst_buffer *staging,
                           karst_buffer *scrubs, karst_buffer *total, karst_error *error)
{
    const chunk c = {cache, work, first, count, loads, staging, scrubs};
    return launch(finaliser, &c, NULL, count, error) && launch(finaliser, &c, total->mem, 1, error);
}
