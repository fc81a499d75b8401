/* Publish: launchers of publish.cl. */
#include "cache/publish.h"

#include <stdlib.h>

#define STAGE KARST_STAGE_COLLECT

bool karst_publish_init(karst_publish *publish, karst_context *context, const karst_cache_buffers *pools,
                        karst_error *error)
{
    *publish = (karst_publish){.context = context, .shape = karst_pass_shape_of(context), .pools = pools};
    publish->used = karst_buffer_create(context, "work_lists", KARST_CACHE_MAX_WORK * sizeof(uint32_t), NULL, error);
    if (!publish->used)
        return false;
    publish->host_flags = malloc(KARST_CACHE_MAX_WORK * sizeof(*publish->host_flags));
    if (!publish->host_flags)
        return karst_fail(error, KARST_FAILED, "out of memory for lists of work");
    return true;
}

static void release_kernels(karst_publish *publish)
{
    if (publish->loads)
        clReleaseKernel(publish->loads);
    if (publish->subdivides)
        clReleaseKernel(publish->subdivides);
    publish->loads = publish->subdivides = NULL;
}

bool karst_publish_take_kernels(karst_publish *publish, karst_program *program, karst_error *error)
{
    release_kernels(publish);
    return (publish->loads = karst_program_kernel(program, "karst_publish_loads", error)) &&
           (publish->subdivides = karst_program_kernel(program, "karst_publish_subdivides", error));
}

void karst_publish_finish(karst_publish *publish)
{
    release_kernels(publish);
    karst_buffer_destroy(publish->used);
    free(publish->host_flags);
    *publish = (karst_publish){0};
}

static bool launch_loads(karst_publish *publish, const karst_work *work, uint32_t num, uint32_t serial,
                         karst_error *error)
{
    const karst_cache_buffers *pools = publish->pools;
    return KARST_ARGUMENTS(publish->loads, error, KARST_BUFFER_ARG(work->load_nodes),
                           KARST_BUFFER_ARG(work->load_slots), KARST_BUFFER_ARG(work->load_results),
                           KARST_VALUE_ARG(num), KARST_VALUE_ARG(serial), KARST_BUFFER_ARG(pools->nodes),
                           KARST_BUFFER_ARG(pools->tile_info), KARST_BUFFER_ARG(pools->brick_owner),
                           KARST_BUFFER_ARG(pools->brick_stamp), KARST_BUFFER_ARG(pools->want_brick)) &&
           karst_launch(publish->context, publish->loads, STAGE, num, publish->shape.item_local, error);
}

static bool launch_subdivides(karst_publish *publish, const karst_work *work, uint32_t num, uint32_t serial,
                              karst_error *error)
{
    const karst_cache_buffers *pools = publish->pools;
    return KARST_ARGUMENTS(publish->subdivides, error, KARST_BUFFER_ARG(work->subdivide_nodes),
                           KARST_BUFFER_ARG(work->subdivide_tiles), KARST_VALUE_ARG(num), KARST_VALUE_ARG(serial),
                           KARST_BUFFER_ARG(pools->nodes), KARST_BUFFER_ARG(pools->tile_info),
                           KARST_BUFFER_ARG(pools->tile_stamp), KARST_BUFFER_ARG(publish->used)) &&
           karst_launch(publish->context, publish->subdivides, STAGE, num, publish->shape.item_local, error);
}

bool karst_publish_launch(karst_publish *publish, const karst_work *work, uint32_t num_loads, uint32_t num_subdivides,
                          uint32_t serial, karst_error *error)
{
    return launch_loads(publish, work, num_loads, serial, error) &&
           launch_subdivides(publish, work, num_subdivides, serial, error);
}
