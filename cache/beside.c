/* Stores beside one another: launchers of beside.cl. */
#include "cache/beside.h"

#define STAGE KARST_STAGE_COLLECT

bool karst_beside_init(karst_beside *beside, karst_context *context, karst_program *program,
                       const karst_cache_buffers *pools, karst_error *error)
{
    *beside = (karst_beside){.context = context, .shape = karst_pass_shape_of(context), .pools = pools};
    return (beside->link = karst_program_kernel(program, "karst_beside_link", error)) &&
           (beside->unlink = karst_program_kernel(program, "karst_beside_unlink", error));
}

void karst_beside_finish(karst_beside *beside)
{
    if (beside->link)
        clReleaseKernel(beside->link);
    if (beside->unlink)
        clReleaseKernel(beside->unlink);
    *beside = (karst_beside){0};
}

bool karst_beside_link(const karst_beside *beside, const karst_work *work, uint32_t num_subdivides,
                       const karst_buffer *used, karst_error *error)
{
    return KARST_ARGUMENTS(beside->link, error, KARST_BUFFER_ARG(work->subdivide_nodes),
                           KARST_BUFFER_ARG(work->subdivide_tiles), KARST_BUFFER_ARG(used),
                           KARST_VALUE_ARG(num_subdivides), KARST_BUFFER_ARG(beside->pools->nodes)) &&
           karst_launch(beside->context, beside->link, STAGE, num_subdivides, beside->shape.item_local, error);
}

bool karst_beside_unlink(const karst_beside *beside, const karst_buffer *victims, const karst_buffer *result,
                         uint32_t num, const karst_buffer *evicted, karst_error *error)
{
    const karst_cache_buffers *pools = beside->pools;
    return KARST_ARGUMENTS(beside->unlink, error, KARST_BUFFER_ARG(victims), KARST_BUFFER_ARG(result),
                           KARST_BUFFER_ARG(pools->nodes), KARST_BUFFER_ARG(pools->tile_info),
                           KARST_BUFFER_ARG(pools->brick_owner), KARST_BUFFER_ARG(evicted)) &&
           karst_launch(beside->context, beside->unlink, STAGE, num, beside->shape.item_local, error);
}
