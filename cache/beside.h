/* Stores beside one another on one tree: what a round of one of them means to the nodes of the others. Only caches with
 * further stores have kernels for it. */
#ifndef KARST_CACHE_BESIDE_H
#define KARST_CACHE_BESIDE_H

#include "cache/buffers.h"
#include "cache/shape.h"

typedef struct {
    karst_context *context;
    karst_pass_shape shape;
    const karst_cache_buffers *pools; /* of the store whose nodes these are; borrowed */
    cl_kernel link, unlink;
} karst_beside;

/* Of cache/beside.cl. Errors: KARST_FAILED. karst_beside_finish takes what a failed init left, or zeros. */
bool karst_beside_init(karst_beside *beside, karst_context *context, karst_program *program,
                       const karst_cache_buffers *pools, karst_error *error);
void karst_beside_finish(karst_beside *beside);

/* Enters the tiles of the work's first num_subdivides as children of their nodes, where `used` (karst_publish.used)
 * says that they were linked in the store whose work it is. Returns at once. Errors: KARST_FAILED. */
bool karst_beside_link(const karst_beside *beside, const karst_work *work, uint32_t num_subdivides,
                       const karst_buffer *used, karst_error *error);
/* Empties the nodes of tiles that are about to be recycled (`victims`, as many as `result` takes, `num` at most), and
 * takes them off their parents; bricks that went go to `evicted` (karst_evicted_tile each). Before the tree's own are,
 * which forgets the parents. Returns at once. Errors: KARST_FAILED. */
bool karst_beside_unlink(const karst_beside *beside, const karst_buffer *victims, const karst_buffer *result,
                         uint32_t num, const karst_buffer *evicted, karst_error *error);

#endif
