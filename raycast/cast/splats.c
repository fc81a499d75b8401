/* Launching the kernels of discs, and localising a stream's anchor in models. */
#include "raycast/cast/splats.h"

#include <stdlib.h>
#include <string.h>

#define NOWHERE ((int64_t)1 << 60) /* as SPLATS_NOWHERE */
#define GROUP 64

struct karst_splats {
    karst_context *context;
    karst_program *program;
    cl_kernel pinhole, rays, shadows;
    karst_buffer *data, *anchors;
    karst_splat_place *places;
    int64_t *units; /* of the anchor, three for each model: as `anchors` has them */
    uint32_t num_models;
    bool is_aimed; /* they are of this anchor */
    int64_t voxel[3];
    uint32_t fraction[3];
};

karst_splats *karst_splats_create(karst_context *context, const uint64_t *data, size_t size_bytes,
                                  const karst_splat_place *places, uint32_t num_models, karst_error *error)
{
    karst_splats *splats = calloc(1, sizeof *splats);
    const size_t places_bytes = num_models * sizeof *places;
    if (!splats || !(splats->places = malloc(places_bytes)) ||
        !(splats->units = calloc(num_models, 3 * sizeof *splats->units))) {
        karst_splats_destroy(splats);
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    memcpy(splats->places, places, places_bytes);
    splats->context = context;
    splats->num_models = num_models;
    splats->data = karst_buffer_create(context, "discs", size_bytes, data, error);
    if (splats->data)
        splats->anchors =
            karst_buffer_create(context, "disc_places", num_models * 3 * sizeof(int64_t), NULL, error);
    if (splats->anchors)
        splats->program = karst_program_build(context, "raycast/cast/splats.cl", "", NULL, 0, error);
    if (!splats->program || !(splats->pinhole = karst_program_kernel(splats->program, "splats_pinhole", error)) ||
        !(splats->rays = karst_program_kernel(splats->program, "splats_rays", error)) ||
        !(splats->shadows = karst_program_kernel(splats->program, "splats_shadows", error))) {
        karst_splats_destroy(splats);
        return NULL;
    }
    return splats;
}

void karst_splats_destroy(karst_splats *splats)
{
    if (!splats)
        return;
    if (splats->pinhole)
        clReleaseKernel(splats->pinhole);
    if (splats->rays)
        clReleaseKernel(splats->rays);
    if (splats->shadows)
        clReleaseKernel(splats->shadows);
    karst_program_destroy(splats->program);
    karst_buffer_destroy(splats->data);
    karst_buffer_destroy(splats->anchors);
    free(splats->places);
    free(splats->units);
    free(splats);
}

/* The anchor in units of a model, exactly, rounded down. */
static void place_anchor(const karst_splat_place *place, const karst_cast_view *view, int64_t units[3])
{
    for (int row = 0; row < 3; row++) {
        __int128 sum = place->offset[row], part = 0;
        for (int a = 0; a < 3; a++) {
            sum += (__int128)place->matrix[3 * row + a] * (view->anchor_voxel[a] - place->at[a]);
            part += (__int128)place->matrix[3 * row + a] * view->anchor_fraction[a];
        }
        sum = (sum + (part >> 32)) >> place->shift;
        if (sum >= NOWHERE || sum <= -NOWHERE) {
            units[0] = NOWHERE;
            return;
        }
        units[row] = (int64_t)sum;
    }
}

/* Views of a picture have one anchor, so this waits for the device once for each. */
static bool aim(karst_splats *splats, const karst_cast_view *view, karst_error *error)
{
    if (splats->is_aimed && memcmp(splats->voxel, view->anchor_voxel, sizeof splats->voxel) == 0 &&
        memcmp(splats->fraction, view->anchor_fraction, sizeof splats->fraction) == 0)
        return true;
    memcpy(splats->voxel, view->anchor_voxel, sizeof splats->voxel);
    memcpy(splats->fraction, view->anchor_fraction, sizeof splats->fraction);
    for (uint32_t i = 0; i < splats->num_models; i++)
        place_anchor(&splats->places[i], view, splats->units + 3 * i);
    splats->is_aimed = karst_buffer_write(splats->anchors, 0, splats->units,
                                          splats->num_models * 3 * sizeof *splats->units, error);
    return splats->is_aimed;
}

/* All packets of a picture. */
static bool launch_picture(karst_splats *splats, cl_kernel kernel, int width_px, int height_px, karst_error *error)
{
    const size_t lanes = (size_t)splats->context->lanes;
    const size_t across = ((size_t)width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                 down = ((size_t)height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    return karst_launch(splats->context, kernel, KARST_STAGE_CAST,
                        across * down * KARST_GROUP_SIDE * KARST_GROUP_SIDE / lanes, lanes == 1 ? GROUP : 1, error);
}

bool karst_splats_pinhole(karst_splats *splats, const karst_cast_view *view, const karst_pinhole *pinhole,
                          const karst_buffer *hits, karst_error *error)
{
    return aim(splats, view, error) &&
           KARST_ARGUMENTS(splats->pinhole, error, KARST_BUFFER_ARG(splats->data), KARST_BUFFER_ARG(splats->anchors),
                           KARST_VALUE_ARG(*pinhole), KARST_VALUE_ARG(view->detail), KARST_BUFFER_ARG(hits)) &&
           launch_picture(splats, splats->pinhole, pinhole->width_px, pinhole->height_px, error);
}

bool karst_splats_rays(karst_splats *splats, const karst_cast_view *view, const karst_buffer *rays, uint32_t num_rays,
                       cl_mem count, uint32_t wanted, const karst_buffer *hits, karst_error *error)
{
    const cl_uint num = num_rays, what = wanted;
    return aim(splats, view, error) &&
           KARST_ARGUMENTS(splats->rays, error, KARST_BUFFER_ARG(splats->data), KARST_BUFFER_ARG(splats->anchors),
                           KARST_BUFFER_ARG(rays), KARST_VALUE_ARG(num), KARST_VALUE_ARG(count), KARST_VALUE_ARG(what),
                           KARST_VALUE_ARG(view->detail), KARST_BUFFER_ARG(hits)) &&
           karst_launch(splats->context, splats->rays, KARST_STAGE_CAST, num_rays,
                        splats->context->lanes == 1 ? GROUP : 1, error);
}

bool karst_splats_shadows(karst_splats *splats, const karst_cast_view *view, const karst_shadow_sun *sun,
                          const karst_buffer *rays, cl_mem pixels, karst_error *error)
{
    return aim(splats, view, error) &&
           KARST_ARGUMENTS(splats->shadows, error, KARST_BUFFER_ARG(splats->data), KARST_BUFFER_ARG(splats->anchors),
                           KARST_VALUE_ARG(*sun), KARST_BUFFER_ARG(rays), KARST_VALUE_ARG(view->detail),
                           KARST_VALUE_ARG(pixels)) &&
           launch_picture(splats, splats->shadows, sun->width_px, sun->height_px, error);
}
