/* What a kind of layer (producers/layer.h) runs on the device, where its content is one buffer: bounds of nodes and
 * loads, samples and colours of bricks. Each kind has its own program, for which layer.clh is a header of its own that
 * defines
 *
 *   layer_data             the buffer's type
 *   layer_node_state       (data, state, origin, level): what is proved of a node, AIR, SOLID or UNKNOWN, with it
 *   layer_is_doubtful      (data, origin, level): whether samples of a node prove nothing, as the layer changes them
 *   layer_has_colours      (data, origin, level): whether it lays colours there
 *   layer_change_samples   (data, origin, level, samples, planes, first, step): changes them, and where planes are not
 *                          NULL the colours there (karst_layer_colours); work-item `first` of `step`
 */
#ifndef KARST_STEPS_LAYER_KERNELS_H
#define KARST_STEPS_LAYER_KERNELS_H

#include "producers/layer.h"
#include "producers/steps/shape.h"

/* Zeros: nothing is built. */
typedef struct {
    karst_context *context;
    const char *header; /* the kind's layer.clh: "producers/KIND/KIND_layer.clh" */
    karst_program *program, *coloured_program;
    cl_kernel tiles, loads, bricks;
    cl_kernel coloured_bricks; /* NULL: the layer has no colours */
    size_t group_size;         /* work-items a brick */
} karst_layer_kernels;

/* Builds those without colours, or, later or never, that with colours (again: nothing is done). `header` is borrowed as
 * long as the kernels. Errors: KARST_FAILED; karst_layer_kernels_destroy then takes what is there. */
bool karst_layer_kernels_build(karst_layer_kernels *kernels, karst_context *context, karst_shape shape,
                               const char *header, karst_error *error);
bool karst_layer_kernels_build_coloured(karst_layer_kernels *kernels, karst_error *error);
void karst_layer_kernels_destroy(karst_layer_kernels *kernels);

/* What the struct of such a kind begins with. The three functions are for its karst_layer_ops. */
typedef struct {
    karst_layer base;
    karst_layer_kernels kernels;
    karst_buffer *data; /* its content as the device reads it */
} karst_buffer_layer;

bool karst_buffer_layer_bound_tiles(karst_layer *self, const karst_cache_buffers *cache, const karst_work *work,
                                    karst_error *error);
bool karst_buffer_layer_bound_loads(karst_layer *self, karst_buffer *loads, uint32_t count, karst_error *error);
bool karst_buffer_layer_evaluate(karst_layer *self, karst_buffer *loads, uint32_t count, karst_buffer *staging,
                                 uint32_t stride_floats, const karst_layer_colours *colours, karst_error *error);

/* Releases kernels and data, whichever are there, and not the struct. */
void karst_buffer_layer_finish(karst_buffer_layer *layer);

#endif
