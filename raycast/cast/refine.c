/* Launching the refining kernel. */
#include "raycast/cast/refine.h"

#include <stdlib.h>

struct karst_refiner {
    karst_context *context;
    karst_program *program;
    cl_kernel hits;
    cl_mem data;
    float voxels_per_m;
};

karst_refiner *karst_refiner_create(karst_context *context, const karst_refine_world *world, karst_error *error)
{
    karst_refiner *refiner = calloc(1, sizeof *refiner);
    if (!refiner) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    const karst_virtual_file file = {"world.clh", world->source};
    refiner->context = context;
    refiner->data = world->data->mem;
    refiner->voxels_per_m = (float)(1 / world->voxel_m);
    refiner->program = karst_program_build(context, "raycast/cast/refine.cl", world->options, &file, 1, error);
    refiner->hits = refiner->program ? karst_program_kernel(refiner->program, "refine_hits", error) : NULL;
    if (!refiner->hits) {
        karst_refiner_destroy(refiner);
        return NULL;
    }
    return refiner;
}

void karst_refiner_destroy(karst_refiner *refiner)
{
    if (!refiner)
        return;
    if (refiner->hits)
        clReleaseKernel(refiner->hits);
    karst_program_destroy(refiner->program);
    free(refiner);
}

bool karst_refine_hits(karst_refiner *refiner, const karst_cast_view *view, const karst_pinhole *pinhole,
                       const karst_shade_anchor *anchor, karst_buffer *hits, karst_error *error)
{
    float footprint = pinhole->cone * view->detail;
    if (hits->size_bytes / sizeof(karst_hit) < (size_t)pinhole->width_px * (size_t)pinhole->height_px)
        return karst_fail(error, KARST_FAILED, "a buffer of %zu bytes does not hold the hits of a picture of %dx%d",
                          hits->size_bytes, pinhole->width_px, pinhole->height_px);
    size_t across = ((size_t)pinhole->width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t down = ((size_t)pinhole->height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t local_size = KARST_PACKET_RAYS * KARST_GROUP_PACKETS / (size_t)refiner->context->lanes;
    return KARST_ARGUMENTS(refiner->hits, error, KARST_VALUE_ARG(*pinhole), KARST_VALUE_ARG(*anchor),
                           KARST_VALUE_ARG(refiner->data), KARST_VALUE_ARG(refiner->voxels_per_m),
                           KARST_VALUE_ARG(footprint), KARST_VALUE_ARG(view->blend), KARST_BUFFER_ARG(hits)) &&
           karst_launch(refiner->context, refiner->hits, KARST_STAGE_REFINE, across * down * local_size, local_size,
                        error);
}
