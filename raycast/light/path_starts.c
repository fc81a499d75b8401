/* Launching the kernel of starts of paths. */
#include "raycast/light/path_starts.h"

#include <stdlib.h>

struct karst_path_starts {
    karst_context *context;
    karst_program *program;
    cl_kernel leave;
};

karst_path_starts *karst_path_starts_create(karst_context *context, karst_error *error)
{
    karst_path_starts *starts = calloc(1, sizeof *starts);
    if (!starts) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    starts->context = context;
    starts->program = karst_program_build(context, "raycast/light/path_starts.cl", "", NULL, 0, error);
    if (starts->program)
        starts->leave = karst_program_kernel(starts->program, "path_starts_leave", error);
    if (starts->leave)
        return starts;
    karst_path_starts_destroy(starts);
    return NULL;
}

void karst_path_starts_destroy(karst_path_starts *starts)
{
    if (!starts)
        return;
    if (starts->leave)
        clReleaseKernel(starts->leave);
    karst_program_destroy(starts->program);
    free(starts);
}

bool karst_path_starts_leave(karst_path_starts *starts, const karst_pinhole *pinhole, float detail,
                             const karst_buffer *hits, karst_buffer *rays, karst_buffer *parts, karst_error *error)
{
    karst_pinhole centres = *pinhole;
    const cl_uint sample = pinhole->sample ? pinhole->sample : 1;
    const cl_mem planes = parts ? parts->mem : NULL;
    const size_t across = ((size_t)pinhole->width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                 down = ((size_t)pinhole->height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                 local_size = KARST_PACKET_RAYS * KARST_GROUP_PACKETS / (size_t)starts->context->lanes;
    centres.sample = 0;
    return KARST_ARGUMENTS(starts->leave, error, KARST_VALUE_ARG(centres), KARST_VALUE_ARG(detail),
                           KARST_VALUE_ARG(sample), KARST_BUFFER_ARG(hits), KARST_BUFFER_ARG(rays),
                           KARST_VALUE_ARG(planes)) &&
           karst_launch(starts->context, starts->leave, KARST_STAGE_SHADE, across * down * local_size, local_size,
                        error);
}
