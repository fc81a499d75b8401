/* Launches of colours.cl. */
#include "producers/steps/colours.h"

#include <stdio.h>
#include <stdlib.h>

struct karst_colour_step {
    karst_context *context;
    const karst_colours *to;
    karst_program *program;
    cl_kernel begin, end;
    size_t group_size; /* work-items a brick */
    karst_layer_colours chunk;
};

karst_colour_step *karst_colour_step_create(karst_context *context, karst_shape shape, const karst_colours *to,
                                            uint32_t max_chunk, karst_error *error)
{
    karst_colour_step *step = calloc(1, sizeof *step);
    char options[64];
    if (!step) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    step->context = context;
    step->to = to;
    step->group_size = karst_shape_group_size(shape, context->is_cpu);
    snprintf(options, sizeof options, "-DKARST_GROUP=%zu", step->group_size);
    const size_t plane_bytes = (size_t)max_chunk * KARST_BRICK_PADDED * sizeof(float);
    if ((step->program = karst_program_build(context, "producers/steps/colours.cl", options, NULL, 0, error)) &&
        (step->begin = karst_program_kernel(step->program, "karst_begin_colours", error)) &&
        (step->end = karst_program_kernel(step->program, "karst_end_colours", error)) &&
        (step->chunk.planes = karst_buffer_create(context, "staging", 4 * plane_bytes, NULL, error)) &&
        (step->chunk.coloured = karst_buffer_create(context, "staging", max_chunk * sizeof(uint32_t), NULL, error)))
        return step;
    karst_colour_step_destroy(step);
    return NULL;
}

void karst_colour_step_destroy(karst_colour_step *step)
{
    if (!step)
        return;
    if (step->begin)
        clReleaseKernel(step->begin);
    if (step->end)
        clReleaseKernel(step->end);
    karst_program_destroy(step->program);
    karst_buffer_destroy(step->chunk.planes);
    karst_buffer_destroy(step->chunk.coloured);
    free(step);
}

const karst_layer_colours *karst_colour_step_begin(karst_colour_step *step, uint32_t count, karst_error *error)
{
    return KARST_ARGUMENTS(step->begin, error, KARST_BUFFER_ARG(step->chunk.coloured), KARST_VALUE_ARG(count)) &&
                   karst_launch(step->context, step->begin, KARST_STAGE_EVALUATE, count, 1, error)
               ? &step->chunk
               : NULL;
}

bool karst_colour_step_end(karst_colour_step *step, const karst_work *work, uint32_t first, uint32_t count,
                           karst_error *error)
{
    karst_buffer *const *c = step->to->samples;
    return KARST_ARGUMENTS(step->end, error, KARST_BUFFER_ARG(step->chunk.planes),
                           KARST_BUFFER_ARG(step->chunk.coloured), KARST_VALUE_ARG(first), KARST_VALUE_ARG(count),
                           KARST_BUFFER_ARG(work->load_slots), KARST_BUFFER_ARG(work->load_results),
                           KARST_BUFFER_ARG(step->to->coloured), KARST_VALUE_ARG(step->to->bricks_per_segment),
                           KARST_BUFFER_ARG(c[0]), KARST_BUFFER_ARG(c[1]), KARST_BUFFER_ARG(c[2]),
                           KARST_BUFFER_ARG(c[3]), KARST_BUFFER_ARG(c[4]), KARST_BUFFER_ARG(c[5]),
                           KARST_BUFFER_ARG(c[6]), KARST_BUFFER_ARG(c[7])) &&
           karst_launch(step->context, step->end, KARST_STAGE_FINALISE, (size_t)count * step->group_size,
                        step->group_size, error);
}
