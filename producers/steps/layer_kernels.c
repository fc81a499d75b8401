/* Launches of layer_kernels.cl. */
#include "producers/steps/layer_kernels.h"

#include <stdio.h>

static karst_program *build(const karst_layer_kernels *kernels, const char *more_options, karst_error *error)
{
    char options[64], include[96];
    snprintf(options, sizeof options, "-DKARST_GROUP=%zu%s", kernels->group_size, more_options);
    snprintf(include, sizeof include, "#include \"%s\"\n", kernels->header);
    const karst_virtual_file layer = {"layer.clh", include};
    return karst_program_build(kernels->context, "producers/steps/layer_kernels.cl", options, &layer, 1, error);
}

bool karst_layer_kernels_build(karst_layer_kernels *kernels, karst_context *context, karst_shape shape,
                               const char *header, karst_error *error)
{
    *kernels = (karst_layer_kernels){
        .context = context, .header = header, .group_size = karst_shape_group_size(shape, context->is_cpu)};
    return (kernels->program = build(kernels, "", error)) &&
           (kernels->tiles = karst_program_kernel(kernels->program, "karst_layer_tiles", error)) &&
           (kernels->loads = karst_program_kernel(kernels->program, "karst_layer_loads", error)) &&
           (kernels->bricks = karst_program_kernel(kernels->program, "karst_layer_bricks", error));
}

bool karst_layer_kernels_build_coloured(karst_layer_kernels *kernels, karst_error *error)
{
    if (!kernels->coloured_program)
        kernels->coloured_program = build(kernels, " -DLAYER_COLOURED", error);
    if (kernels->coloured_program && !kernels->coloured_bricks)
        kernels->coloured_bricks =
            karst_program_kernel(kernels->coloured_program, "karst_layer_coloured_bricks", error);
    return kernels->coloured_bricks != NULL;
}

void karst_layer_kernels_destroy(karst_layer_kernels *kernels)
{
    cl_kernel all[] = {kernels->tiles, kernels->loads, kernels->bricks, kernels->coloured_bricks};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (all[i])
            clReleaseKernel(all[i]);
    karst_program_destroy(kernels->program);
    karst_program_destroy(kernels->coloured_program);
    *kernels = (karst_layer_kernels){0};
}

bool karst_buffer_layer_bound_tiles(karst_layer *self, const karst_cache_buffers *cache, const karst_work *work,
                                    karst_error *error)
{
    const karst_buffer_layer *layer = (const karst_buffer_layer *)self;
    const karst_layer_kernels *kernels = &layer->kernels;
    return KARST_ARGUMENTS(kernels->tiles, error, KARST_BUFFER_ARG(work->subdivide_tiles),
                           KARST_VALUE_ARG(work->num_subdivides), KARST_BUFFER_ARG(cache->nodes),
                           KARST_BUFFER_ARG(cache->tile_info), KARST_BUFFER_ARG(layer->data)) &&
           karst_launch(kernels->context, kernels->tiles, KARST_STAGE_SUBDIVIDE,
                        (size_t)work->num_subdivides * KARST_TILE_NODES, 1, error);
}

bool karst_buffer_layer_bound_loads(karst_layer *self, karst_buffer *loads, uint32_t count, karst_error *error)
{
    const karst_buffer_layer *layer = (const karst_buffer_layer *)self;
    const karst_layer_kernels *kernels = &layer->kernels;
    return KARST_ARGUMENTS(kernels->loads, error, KARST_BUFFER_ARG(loads), KARST_VALUE_ARG(count),
                           KARST_BUFFER_ARG(layer->data)) &&
           karst_launch(kernels->context, kernels->loads, KARST_STAGE_EVALUATE, count, 1, error);
}

bool karst_buffer_layer_evaluate(karst_layer *self, karst_buffer *loads, uint32_t count, karst_buffer *staging,
                                 uint32_t stride_floats, const karst_layer_colours *colours, karst_error *error)
{
    const karst_buffer_layer *layer = (const karst_buffer_layer *)self;
    const karst_layer_kernels *kernels = &layer->kernels;
    const bool coloured = colours && kernels->coloured_bricks;
    if (coloured ? !KARST_ARGUMENTS(kernels->coloured_bricks, error, KARST_BUFFER_ARG(loads), KARST_VALUE_ARG(count),
                                    KARST_BUFFER_ARG(staging), KARST_VALUE_ARG(stride_floats),
                                    KARST_BUFFER_ARG(colours->planes), KARST_BUFFER_ARG(colours->coloured),
                                    KARST_BUFFER_ARG(layer->data))
                 : !KARST_ARGUMENTS(kernels->bricks, error, KARST_BUFFER_ARG(loads), KARST_VALUE_ARG(count),
                                    KARST_BUFFER_ARG(staging), KARST_VALUE_ARG(stride_floats),
                                    KARST_BUFFER_ARG(layer->data)))
        return false;
    return karst_launch(kernels->context, coloured ? kernels->coloured_bricks : kernels->bricks, KARST_STAGE_EVALUATE,
                        (size_t)count * kernels->group_size, kernels->group_size, error);
}

void karst_buffer_layer_finish(karst_buffer_layer *layer)
{
    karst_layer_kernels_destroy(&layer->kernels);
    karst_buffer_destroy(layer->data);
    layer->data = NULL;
}
