/* The layer of models made of points: launches of points.cl. */
#include "producers/points/points.h"

#include <stdio.h>
#include <stdlib.h>

typedef struct {
    karst_layer base;
    karst_context *context;
    karst_program *program, *coloured_program;
    cl_kernel tiles, loads, bricks, coloured_bricks; /* coloured_bricks: NULL: no model has colours */
    size_t group_size;                               /* work-items a brick */
    karst_model_list list;
    karst_buffer *data;
} points_layer;

const karst_model_list *karst_points_layer_list(const karst_layer *layer)
{
    return &((const points_layer *)layer)->list;
}

static bool bound_tiles(karst_layer *self, const karst_cache_buffers *cache, const karst_work *work, karst_error *error)
{
    points_layer *points = (points_layer *)self;
    return KARST_ARGUMENTS(points->tiles, error, KARST_BUFFER_ARG(work->subdivide_tiles),
                           KARST_VALUE_ARG(work->num_subdivides), KARST_BUFFER_ARG(cache->nodes),
                           KARST_BUFFER_ARG(cache->tile_info), KARST_BUFFER_ARG(points->data)) &&
           karst_launch(points->context, points->tiles, KARST_STAGE_SUBDIVIDE,
                        (size_t)work->num_subdivides * KARST_TILE_NODES, 1, error);
}

static bool bound_loads(karst_layer *self, karst_buffer *loads, uint32_t count, karst_error *error)
{
    points_layer *points = (points_layer *)self;
    return KARST_ARGUMENTS(points->loads, error, KARST_BUFFER_ARG(loads), KARST_VALUE_ARG(count),
                           KARST_BUFFER_ARG(points->data)) &&
           karst_launch(points->context, points->loads, KARST_STAGE_EVALUATE, count, 1, error);
}

static bool evaluate(karst_layer *self, karst_buffer *loads, uint32_t count, karst_buffer *staging,
                     uint32_t stride_floats, const karst_layer_colours *colours, karst_error *error)
{
    points_layer *points = (points_layer *)self;
    if (colours && points->coloured_bricks)
        return KARST_ARGUMENTS(points->coloured_bricks, error, KARST_BUFFER_ARG(loads), KARST_VALUE_ARG(count),
                               KARST_BUFFER_ARG(staging), KARST_VALUE_ARG(stride_floats),
                               KARST_BUFFER_ARG(colours->planes), KARST_BUFFER_ARG(colours->coloured),
                               KARST_BUFFER_ARG(points->data)) &&
               karst_launch(points->context, points->coloured_bricks, KARST_STAGE_EVALUATE,
                            (size_t)count * points->group_size, points->group_size, error);
    return KARST_ARGUMENTS(points->bricks, error, KARST_BUFFER_ARG(loads), KARST_VALUE_ARG(count),
                           KARST_BUFFER_ARG(staging), KARST_VALUE_ARG(stride_floats), KARST_BUFFER_ARG(points->data)) &&
           karst_launch(points->context, points->bricks, KARST_STAGE_EVALUATE, (size_t)count * points->group_size,
                        points->group_size, error);
}

/* They stay as they are. */
static size_t take_dirty(karst_layer *self, const karst_drop_box **boxes)
{
    (void)self;
    *boxes = NULL;
    return 0;
}

static bool check(karst_layer *self, karst_error *error)
{
    return karst_model_list_check(&((points_layer *)self)->list, error);
}

static void destroy(karst_layer *self)
{
    points_layer *points = (points_layer *)self;
    cl_kernel kernels[] = {points->tiles, points->loads, points->bricks, points->coloured_bricks};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(points->program);
    karst_program_destroy(points->coloured_program);
    karst_buffer_destroy(points->data);
    karst_model_list_finish(&points->list);
    free(points);
}

static const karst_layer_ops points_ops = {.kind = "points",
                                           .bound_tiles = bound_tiles,
                                           .bound_loads = bound_loads,
                                           .evaluate = evaluate,
                                           .take_dirty = take_dirty,
                                           .check = check,
                                           .destroy = destroy};

/* Models may take a quarter of a device's memory, in one piece. */
static uint64_t most_bytes(const karst_context *context)
{
    cl_ulong piece = 0, all = 0;
    clGetDeviceInfo(context->device, CL_DEVICE_MAX_MEM_ALLOC_SIZE, sizeof piece, &piece, NULL);
    clGetDeviceInfo(context->device, CL_DEVICE_GLOBAL_MEM_SIZE, sizeof all, &all, NULL);
    return piece < all / 4 ? piece : all / 4;
}

static bool build(points_layer *points, karst_error *error)
{
    char options[96];
    karst_context *context = points->context;
    snprintf(options, sizeof options, "-DKARST_GROUP=%zu", points->group_size);
    if (!(points->program = karst_program_build(context, "producers/points/points.cl", options, NULL, 0, error)) ||
        !(points->tiles = karst_program_kernel(points->program, "karst_points_tiles", error)) ||
        !(points->loads = karst_program_kernel(points->program, "karst_points_loads", error)) ||
        !(points->bricks = karst_program_kernel(points->program, "karst_points_bricks", error)))
        return false;
    snprintf(options, sizeof options, "-DKARST_GROUP=%zu -DPOINTS_COLOURED", points->group_size);
    return !karst_model_list_has_colours(&points->list) ||
           ((points->coloured_program =
                 karst_program_build(context, "producers/points/points.cl", options, NULL, 0, error)) &&
            (points->coloured_bricks =
                 karst_program_kernel(points->coloured_program, "karst_points_coloured_bricks", error)));
}

karst_layer *karst_points_layer_create(karst_context *context, karst_shape shape, const karst_model *models, size_t num,
                                       int voxel_log2_m, const karst_log *log, karst_error *error)
{
    points_layer *points = calloc(1, sizeof *points);
    if (!points) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    points->base.ops = &points_ops;
    points->context = context;
    points->group_size = karst_shape_group_size(shape, context->is_cpu);
    if (karst_model_list_init(&points->list, models, num, voxel_log2_m, most_bytes(context), log, error) &&
        (points->data = karst_buffer_create(context, "models", points->list.size_bytes, points->list.data, error)) &&
        build(points, error))
        return &points->base;
    destroy(&points->base);
    return NULL;
}
