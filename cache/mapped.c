/* Mapping the pools, and back. */
#include "cache/mapped.h"

static bool map(karst_buffer *buffer, void **mapped, karst_error *error)
{
    cl_int code = CL_SUCCESS;
    if (!*mapped)
        *mapped = clEnqueueMapBuffer(buffer->context->queue, buffer->mem, CL_FALSE, CL_MAP_READ | CL_MAP_WRITE, 0,
                                     buffer->size_bytes, 0, NULL, NULL, &code);
    if (code == CL_SUCCESS)
        return true;
    *mapped = NULL;
    return karst_fail(error, KARST_FAILED, "cannot map buffer %s: %s", buffer->name, karst_cl_error_name(code));
}

static bool unmap(karst_buffer *buffer, void **mapped, cl_event gate, karst_error *error)
{
    cl_int code = CL_SUCCESS;
    if (*mapped)
        code = clEnqueueUnmapMemObject(buffer->context->queue, buffer->mem, *mapped, gate ? 1 : 0, gate ? &gate : NULL,
                                       NULL);
    *mapped = NULL;
    return code == CL_SUCCESS ||
           karst_fail(error, KARST_FAILED, "cannot unmap buffer %s: %s", buffer->name, karst_cl_error_name(code));
}

bool karst_mapped_begin(karst_mapped *mapped, karst_error *error)
{
    const karst_cache_buffers *pools = mapped->pools;
    return map(pools->nodes, (void **)&mapped->nodes, error) &&
           map(pools->tile_info, (void **)&mapped->tile_info, error) &&
           map(pools->brick_owner, (void **)&mapped->brick_owner, error) &&
           map(pools->tile_stamp, (void **)&mapped->tile_stamp, error);
}

bool karst_mapped_end_behind(karst_mapped *mapped, cl_event gate, karst_error *error)
{
    /* The queue is in order: what waits for the gate is the first command. */
    const karst_cache_buffers *pools = mapped->pools;
    bool ok = unmap(pools->nodes, (void **)&mapped->nodes, gate, error);
    ok &= unmap(pools->tile_info, (void **)&mapped->tile_info, NULL, error);
    ok &= unmap(pools->brick_owner, (void **)&mapped->brick_owner, NULL, error);
    ok &= unmap(pools->tile_stamp, (void **)&mapped->tile_stamp, NULL, error);
    return ok;
}

bool karst_mapped_end(karst_mapped *mapped, karst_error *error) { return karst_mapped_end_behind(mapped, NULL, error); }
