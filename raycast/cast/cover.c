/* Launching the covering kernel. */
#include "raycast/cast/cover.h"

#include <stdlib.h>

#include "raycast/cast/cast_shared.h"

#define LOCAL_SIZE 64

struct karst_cover {
    karst_context *context;
    karst_program *program;
    cl_kernel hits;
    karst_buffer *ends;
    uint32_t num;
};

/* In the order in which casts keep hits. */
static float *ends_of(int width_px, int height_px, const float *depth_m, double voxel_m)
{
    const uint32_t width = (uint32_t)width_px, height = (uint32_t)height_px;
    float *ends = malloc((size_t)width * height * sizeof *ends);
    if (!ends)
        return NULL;
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++)
            ends[karst_packet_order(x, y, width, height)] = (float)(*depth_m++ / voxel_m);
    return ends;
}

karst_cover *karst_cover_create(karst_context *context, int width_px, int height_px, const float *depth_m,
                                double voxel_m, karst_error *error)
{
    karst_cover *cover = calloc(1, sizeof *cover);
    float *ends = cover ? ends_of(width_px, height_px, depth_m, voxel_m) : NULL;
    if (!ends) {
        free(cover);
        karst_fail(error, KARST_FAILED, "out of memory for the depth of %dx%d pixels", width_px, height_px);
        return NULL;
    }
    cover->context = context;
    cover->num = (uint32_t)width_px * (uint32_t)height_px;
    cover->ends = karst_buffer_create(context, "cover", cover->num * sizeof *ends, ends, error);
    free(ends);
    if (cover->ends)
        cover->program = karst_program_build(context, "raycast/cast/cover.cl", "", NULL, 0, error);
    if (cover->program)
        cover->hits = karst_program_kernel(cover->program, "cover_hits", error);
    if (!cover->hits) {
        karst_cover_destroy(cover);
        return NULL;
    }
    return cover;
}

void karst_cover_destroy(karst_cover *cover)
{
    if (!cover)
        return;
    if (cover->hits)
        clReleaseKernel(cover->hits);
    karst_program_destroy(cover->program);
    karst_buffer_destroy(cover->ends);
    free(cover);
}

bool karst_cover_hits(karst_cover *cover, karst_buffer *hits, karst_error *error)
{
    if (hits->size_bytes / sizeof(karst_hit) < cover->num)
        return karst_fail(error, KARST_FAILED, "depth of %u pixels for a picture of fewer", cover->num);
    return KARST_ARGUMENTS(cover->hits, error, KARST_BUFFER_ARG(cover->ends), KARST_VALUE_ARG(cover->num),
                           KARST_BUFFER_ARG(hits)) &&
           karst_launch(cover->context, cover->hits, KARST_STAGE_CAST, cover->num, LOCAL_SIZE, error);
}
