/* Launching the refining kernel. */
#include "raycast/cast/refine.h"

#include <stdio.h>
#include <stdlib.h>

struct karst_refiner {
    karst_context *context;
    karst_program *program;
    cl_kernel hits;         /* NULL: for rays */
    cl_kernel rays, camera; /* NULL: not for those */
    cl_mem data;
    cl_mem layer, beneath; /* their data; NULL: none were set */
    bool has_layer;
    float voxels_per_m;
};

static karst_refiner *create(karst_context *context, const karst_refine_world *world, bool for_rays,
                             karst_error *error)
{
    char options[256];
    karst_refiner *refiner = calloc(1, sizeof *refiner);
    if (!refiner) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    const karst_virtual_file file = {"world.clh", world->source};
    refiner->context = context;
    refiner->data = world->data->mem;
    refiner->voxels_per_m = (float)(1 / world->voxel_m);
    refiner->has_layer = world->has_layer;
    snprintf(options, sizeof options, "%s%s%s%s", world->options, for_rays ? " -DREFINE_STREAM" : "",
             world->has_layer ? " -DREFINE_LAYER" : "", world->may_be_thin ? " -DREFINE_THIN" : "");
    refiner->program = karst_program_build(context, "raycast/cast/refine.cl", options, &file, 1, error);
    if (refiner->program && for_rays) {
        refiner->rays = karst_program_kernel(refiner->program, "refine_rays", error);
        refiner->camera = karst_program_kernel(refiner->program, "refine_camera", error);
    } else if (refiner->program) {
        refiner->hits = karst_program_kernel(refiner->program, "refine_hits", error);
    }
    if (for_rays ? !refiner->rays || !refiner->camera : !refiner->hits) {
        karst_refiner_destroy(refiner);
        return NULL;
    }
    return refiner;
}

karst_refiner *karst_refiner_create(karst_context *context, const karst_refine_world *world, karst_error *error)
{
    return create(context, world, false, error);
}

karst_refiner *karst_refiner_create_for_rays(karst_context *context, const karst_refine_world *world,
                                             karst_error *error)
{
    return create(context, world, true, error);
}

void karst_refiner_destroy(karst_refiner *refiner)
{
    if (!refiner)
        return;
    cl_kernel kernels[] = {refiner->hits, refiner->rays, refiner->camera};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(refiner->program);
    free(refiner);
}

void karst_refiner_set_layer(karst_refiner *refiner, const karst_buffer *layer, const karst_buffer *beneath)
{
    refiner->layer = layer->mem;
    refiner->beneath = beneath ? beneath->mem : layer->mem;
}

/* The last two are those of a layer, which other refiners' kernels do not take. */
static bool set(const karst_refiner *refiner, cl_kernel kernel, const karst_argument *arguments, size_t num,
                karst_error *error)
{
    if (refiner->has_layer && !refiner->layer)
        return karst_fail(error, KARST_FAILED, "a refiner with a layer was given no data of it");
    return karst_arguments(kernel, arguments, num - (refiner->has_layer ? 0 : 2), error);
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
    const karst_argument arguments[] = {KARST_VALUE_ARG(*pinhole), KARST_VALUE_ARG(*anchor),
                                        KARST_VALUE_ARG(refiner->data), KARST_VALUE_ARG(refiner->voxels_per_m),
                                        KARST_VALUE_ARG(footprint), KARST_VALUE_ARG(view->blend),
                                        KARST_BUFFER_ARG(hits), KARST_VALUE_ARG(refiner->layer),
                                        KARST_VALUE_ARG(refiner->beneath)};
    return set(refiner, refiner->hits, arguments, sizeof arguments / sizeof *arguments, error) &&
           karst_launch(refiner->context, refiner->hits, KARST_STAGE_REFINE, across * down * local_size, local_size,
                        error);
}

bool karst_refine_rays(karst_refiner *refiner, const karst_buffer *rays, const karst_buffer *count, uint32_t max_rays,
                       const karst_shade_anchor *anchor, karst_buffer *hits, karst_error *error)
{
    const size_t lanes = (size_t)refiner->context->lanes;
    if (!refiner->rays || hits->size_bytes / sizeof(karst_hit) < max_rays)
        return karst_fail(error, KARST_FAILED, "this refiner is not for %u rays", max_rays);
    const karst_argument arguments[] = {KARST_BUFFER_ARG(rays),
                                        KARST_BUFFER_ARG(count),
                                        KARST_VALUE_ARG(*anchor),
                                        KARST_VALUE_ARG(refiner->data),
                                        KARST_VALUE_ARG(refiner->voxels_per_m),
                                        KARST_BUFFER_ARG(hits),
                                        KARST_VALUE_ARG(refiner->layer),
                                        KARST_VALUE_ARG(refiner->beneath)};
    return set(refiner, refiner->rays, arguments, sizeof arguments / sizeof *arguments, error) &&
           karst_launch(refiner->context, refiner->rays, KARST_STAGE_REFINE, (max_rays + lanes - 1) / lanes, 16,
                        error);
}

bool karst_refine_camera(karst_refiner *refiner, const karst_pinhole *pinhole, bool is_inside,
                         const karst_shade_anchor *anchor, karst_buffer *hits, karst_error *error)
{
    const cl_int inside = is_inside;
    if (!refiner->camera ||
        hits->size_bytes / sizeof(karst_hit) < (size_t)pinhole->width_px * (size_t)pinhole->height_px)
        return karst_fail(error, KARST_FAILED, "this refiner is not for the rays of a picture of %dx%d",
                          pinhole->width_px, pinhole->height_px);
    size_t across = ((size_t)pinhole->width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t down = ((size_t)pinhole->height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t local_size = KARST_PACKET_RAYS * KARST_GROUP_PACKETS / (size_t)refiner->context->lanes;
    const karst_argument arguments[] = {KARST_VALUE_ARG(*pinhole),
                                        KARST_VALUE_ARG(inside),
                                        KARST_VALUE_ARG(*anchor),
                                        KARST_VALUE_ARG(refiner->data),
                                        KARST_VALUE_ARG(refiner->voxels_per_m),
                                        KARST_BUFFER_ARG(hits),
                                        KARST_VALUE_ARG(refiner->layer),
                                        KARST_VALUE_ARG(refiner->beneath)};
    return set(refiner, refiner->camera, arguments, sizeof arguments / sizeof *arguments, error) &&
           karst_launch(refiner->context, refiner->camera, KARST_STAGE_REFINE, across * down * local_size, local_size,
                        error);
}
