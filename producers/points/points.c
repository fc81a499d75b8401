/* The layer of models made of points. */
#include "producers/points/points.h"
#include "producers/steps/layer_kernels.h"

#include <stdlib.h>

typedef struct {
    karst_buffer_layer on;
    karst_model_list list;
} points_layer;

const karst_model_list *karst_points_layer_list(const karst_layer *layer)
{
    return &((const points_layer *)layer)->list;
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
    karst_buffer_layer_finish(&points->on);
    karst_model_list_finish(&points->list);
    free(points);
}

static const karst_layer_ops points_ops = {.kind = "points",
                                           .bound_tiles = karst_buffer_layer_bound_tiles,
                                           .bound_loads = karst_buffer_layer_bound_loads,
                                           .evaluate = karst_buffer_layer_evaluate,
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

karst_layer *karst_points_layer_create(karst_context *context, karst_shape shape, const karst_model *models, size_t num,
                                       int voxel_log2_m, const karst_log *log, karst_error *error)
{
    points_layer *points = calloc(1, sizeof *points);
    if (!points) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    points->on.base.ops = &points_ops;
    if (karst_model_list_init(&points->list, models, num, voxel_log2_m, most_bytes(context), log, error) &&
        (points->on.data = karst_buffer_create(context, "models", points->list.size_bytes, points->list.data, error)) &&
        karst_layer_kernels_build(&points->on.kernels, context, shape, "producers/points/points_layer.clh", error) &&
        (!karst_model_list_has_colours(&points->list) ||
         karst_layer_kernels_build_coloured(&points->on.kernels, error)))
        return &points->on.base;
    destroy(&points->on.base);
    return NULL;
}
