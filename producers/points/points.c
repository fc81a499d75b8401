/* The layer of models made of points. */
#include "producers/points/points.h"
#include "producers/steps/layer_kernels.h"

#include <stdlib.h>

typedef struct {
    karst_layer base;
    karst_layer_kernels kernels;
    karst_model_list list;
    karst_buffer *data;
    uint64_t num_loads; /* since mapped pages were let go */
} points_layer;

/* So many bricks later what is mapped may be elsewhere, and pages that nobody looks at any more are let go. */
#define LOADS_BETWEEN 4096u

const karst_model_list *karst_points_layer_list(const karst_layer *layer)
{
    return &((const points_layer *)layer)->list;
}

const karst_buffer *karst_points_layer_data(const karst_layer *layer) { return ((const points_layer *)layer)->data; }

static bool bound_tiles(karst_layer *self, const karst_cache_buffers *cache, const karst_work *work, karst_error *error)
{
    const points_layer *points = (const points_layer *)self;
    return karst_layer_kernels_bound_tiles(&points->kernels, points->data, cache, work, error);
}

static bool bound_loads(karst_layer *self, karst_buffer *loads, uint32_t count, karst_error *error)
{
    const points_layer *points = (const points_layer *)self;
    return karst_layer_kernels_bound_loads(&points->kernels, points->data, loads, count, error);
}

static bool evaluate(karst_layer *self, karst_buffer *loads, uint32_t count, karst_buffer *staging,
                     uint32_t stride_floats, const karst_layer_colours *colours, karst_error *error)
{
    points_layer *points = (points_layer *)self;
    points->num_loads += count;
    if (points->num_loads >= LOADS_BETWEEN) {
        karst_model_list_let_go(&points->list);
        points->num_loads = 0;
    }
    return karst_layer_kernels_evaluate(&points->kernels, points->data, loads, count, staging, stride_floats, colours,
                                        error);
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
    karst_layer_kernels_destroy(&points->kernels);
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
    points->base.ops = &points_ops;
    if (karst_model_list_init(&points->list, models, num, voxel_log2_m, most_bytes(context), log, error) &&
        (points->data = make_buffer(context, &points->list, error)) &&
        karst_layer_kernels_build(&points->kernels, context, shape, "producers/points/points_layer.clh", error) &&
        (!karst_model_list_has_colours(&points->list) || karst_layer_kernels_build_coloured(&points->kernels, error)))
        return &points->base;
    destroy(&points->base);
    return NULL;
}
