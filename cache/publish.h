/* Publish: links what the producers wrote. */
#ifndef KARST_CACHE_PUBLISH_H
#define KARST_CACHE_PUBLISH_H

#include "cache/buffers.h"
#include "cache/shape.h"

typedef struct {
    karst_context *context;
    karst_pass_shape shape;
    const karst_cache_buffers *pools; /* borrowed */
    cl_kernel loads, subdivides;
    karst_buffer *used;   /* uint[KARST_CACHE_MAX_WORK]: the tile was linked */
    uint32_t *host_flags; /* results or `used` */
} karst_publish;

/* Errors: KARST_FAILED. karst_publish_finish takes what a failed init left, or zeros. */
bool karst_publish_init(karst_publish *publish, karst_context *context, const karst_cache_buffers *pools,
                        karst_error *error);
/* Of cache/publish.cl; in place of those that there were. Errors: KARST_FAILED. */
bool karst_publish_take_kernels(karst_publish *publish, karst_program *program, karst_error *error);
void karst_publish_finish(karst_publish *publish);

/* Links the first num_loads and num_subdivides of the work; publish->used says of each subdivide whether its tile was
 * linked. Returns at once. Errors: KARST_FAILED. */
bool karst_publish_launch(karst_publish *publish, const karst_work *work, uint32_t num_loads, uint32_t num_subdivides,
                          uint32_t serial, karst_error *error);

#endif
