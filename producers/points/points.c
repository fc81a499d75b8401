/* The layer of models made of points. */
#include "producers/points/points.h"
#include "producers/steps/layer_kernels.h"

#include <stdlib.h>

typedef struct {
    karst_buffer_layer on;
    karst_model_list list;
    uint64_t num_loads; /* since mapped pages were let go */
} points_layer;

/* So many bricks later what is mapped may be elsewhere, and pages that nobody looks at any more are let go. */
#define LOADS_BETWEEN 4096u

const karst_model_list *karst_points_layer_list(const karst_layer *layer)
{
    return &((const points_layer *)layer)->list;
}

const karst_buffer *karst_points_layer_data(const karst_layer *layer) { return ((const points_layer *)layer)->on.data; }

static bool evaluate(karst_layer *self, karst_buffer *loads, uint32_t count, karst_buffer *staging,
                     uint32_t stride_floats, const karst_layer_colours *colours, karst_error *error)
{
    points_layer *points = (points_layer *)self;
    points->num_loads += count;
    if (points->num_loads >= LOADS_BETWEEN) {
        karst_model_list_let_go(&points->list);
        points->num_loads = 0;
    }
    return karst_buffer_layer_evaluate(self, loads, count, staging, stride_floats, colours, error);
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
                                           .evaluate = evaluate,
                                           .take_dirty = take_dirty,
                                           .check = check,
                                           .destroy = destroy};

/* Models may take a quarter of a device's memory, in one piece. Where that is the host's, large files are not in memory
 * but for the pages that are looked at. */
static uint64_t most_bytes(const karst_context *context)
{
    cl_ulong piece = 0, all = 0;
    clGetDeviceInfo(context->device, CL_DEVICE_MAX_MEM_ALLOC_SIZE, sizeof piece, &piece, NULL);
    clGetDeviceInfo(context->device, CL_DEVICE_GLOBAL_MEM_SIZE, sizeof all, &all, NULL);
    return context->is_cpu || piece < all / 4 ? piece : all / 4;
}

static karst_buffer *make_buffer(karst_context *context, const karst_model_list *list, karst_error *error)
{
    return context->is_cpu && list->num_maps
               ? karst_buffer_create_over(context, "models", list->data, list->size_bytes, error)
               : karst_buffer_create(context, "models", list->size_bytes, list->data, error);
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
        (points->on.data = make_buffer(context, &points->list, error)) &&
        karst_layer_kernels_build(&points->on.kernels, context, shape, "producers/points/points_layer.clh", error) &&
        (!karst_model_list_has_colours(&points->list) ||
         karst_layer_kernels_build_coloured(&points->on.kernels, error)))
        return &points->on.base;
    destroy(&points->on.base);
    return NULL;
}
