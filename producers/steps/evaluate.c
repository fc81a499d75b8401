/* Launches of evaluate.cl. */
#include "producers/steps/evaluate.h"

#include <stdio.h>
#include <stdlib.h>

struct karst_evaluator {
    karst_context *context;
    karst_program *program;
    cl_kernel bricks;
    cl_mem data;       /* of the world; NULL: none */
    size_t group_size; /* work-items a brick */
};

karst_evaluator *karst_evaluator_create(karst_context *context, karst_shape shape, const karst_channel_layout *layout,
                                        const karst_virtual_file *world, const char *options, karst_error *error)
{
    karst_evaluator *evaluator = calloc(1, sizeof *evaluator);
    char all_options[1024], channels[512];
    if (!evaluator) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    evaluator->context = context;
    evaluator->group_size = karst_shape_group_size(shape, context->is_cpu);
    karst_channels_options(layout, channels, sizeof channels);
    snprintf(all_options, sizeof all_options, "%s %s -DKARST_GROUP=%zu", options, channels, evaluator->group_size);
    evaluator->program = karst_program_build(context, "producers/steps/evaluate.cl", all_options, world, 1, error);
    if (!evaluator->program ||
        !(evaluator->bricks = karst_program_kernel(evaluator->program, "karst_evaluate_bricks", error))) {
        karst_evaluator_destroy(evaluator);
        return NULL;
    }
    return evaluator;
}

void karst_evaluator_destroy(karst_evaluator *evaluator)
{
    if (!evaluator)
        return;
    if (evaluator->bricks)
        clReleaseKernel(evaluator->bricks);
    karst_program_destroy(evaluator->program);
    free(evaluator);
}

void karst_evaluator_move(karst_evaluator *evaluator, karst_context *context)
{
    evaluator->context = context;
    karst_program_move(evaluator->program, context);
}

void karst_evaluator_set_data(karst_evaluator *evaluator, const karst_buffer *data)
{
    evaluator->data = data ? data->mem : NULL;
}

bool karst_evaluate_bricks(karst_evaluator *evaluator, karst_buffer *loads, uint32_t count, karst_buffer *staging,
                           karst_buffer *scrubs, karst_error *error)
{
    return KARST_ARGUMENTS(evaluator->bricks, error, KARST_BUFFER_ARG(loads), KARST_VALUE_ARG(count),
                           KARST_BUFFER_ARG(staging), KARST_BUFFER_ARG(scrubs), KARST_VALUE_ARG(evaluator->data)) &&
           karst_launch(evaluator->context, evaluator->bricks, KARST_STAGE_EVALUATE,
                        (size_t)count * evaluator->group_size, evaluator->group_size, error);
}
