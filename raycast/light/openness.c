/* Launching the kernel of bounds of openness. */
#include "raycast/light/openness.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define LOCAL_SIZE 16
#define AT_ONCE (1u << 14) /* pixels a launch: none takes a device for long */

struct karst_openness {
    karst_context *context;
    karst_cache_buffers cache;
    karst_program *program;
    cl_kernel kernel;
    karst_buffer *view, *asked, *turns;
};

karst_openness *karst_openness_create(karst_context *context, const karst_cache_buffers *cache, karst_error *error)
{
    float turns[2 * KARST_OPENNESS_TURNS];
    char options[128];
    karst_openness *openness = calloc(1, sizeof *openness);
    if (!openness) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    for (int i = 0; i < KARST_OPENNESS_TURNS; i++) {
        turns[2 * i] = (float)cos(2 * M_PI * i / KARST_OPENNESS_TURNS);
        turns[2 * i + 1] = (float)sin(2 * M_PI * i / KARST_OPENNESS_TURNS);
    }
    snprintf(options, sizeof options, "-DSEGMENTS=%u %s", cache->num_segments, karst_cache_brick_option(cache));
    openness->context = context;
    openness->cache = *cache;
    openness->program = karst_program_build(context, "raycast/light/openness.cl", options, NULL, 0, error);
    openness->kernel =
        openness->program ? karst_program_kernel(openness->program, "openness_bounds", error) : NULL;
    if (openness->kernel &&
        (openness->view = karst_buffer_create(context, "occlusion", sizeof(karst_cast_view), NULL, error)) &&
        (openness->asked = karst_buffer_create(context, "occlusion", sizeof(uint32_t), NULL, error)) &&
        (openness->turns = karst_buffer_create(context, "occlusion", sizeof turns, turns, error)))
        return openness;
    karst_openness_destroy(openness);
    return NULL;
}

void karst_openness_destroy(karst_openness *openness)
{
    if (!openness)
        return;
    if (openness->kernel)
        clReleaseKernel(openness->kernel);
    karst_program_destroy(openness->program);
    karst_buffer_destroy(openness->view);
    karst_buffer_destroy(openness->asked);
    karst_buffer_destroy(openness->turns);
    free(openness);
}

bool karst_openness_bound(karst_openness *openness, const karst_cast_view *view, const karst_pinhole *pinhole,
                          const karst_buffer *hits, float cone, int depth, karst_buffer *bounds, karst_buffer *cells,
                          karst_error *error)
{
    const karst_cache_buffers *c = &openness->cache;
    const size_t num = (size_t)pinhole->width_px * (size_t)pinhole->height_px;
    if (hits->size_bytes / sizeof(karst_hit) < num || bounds->size_bytes / (2 * sizeof(float)) < num ||
        (cells && cells->size_bytes / KARST_OPENNESS_CELLS < num))
        return karst_fail(error, KARST_FAILED, "there is no room for the openness of a picture of %dx%d",
                          pinhole->width_px, pinhole->height_px);
    if (depth < 0 || depth > KARST_OPENNESS_DEPTH || !(cone > 0))
        return karst_fail(error, KARST_FAILED, "openness has no cells of depth %d, or a cone of %g", depth, cone);
    if (!karst_buffer_write(openness->view, 0, view, sizeof *view, error))
        return false;
    karst_openness_task task = {.depth = depth, .cone = cone, .tells_cells = cells != NULL};
    for (size_t first = 0; first < num; first += AT_ONCE) {
        const size_t left = num - first, here = left < AT_ONCE ? left : AT_ONCE;
        task.first_pixel = (uint32_t)first;
        task.end_pixel = (uint32_t)(first + here);
        if (!KARST_ARGUMENTS(
                openness->kernel, error, KARST_BUFFER_ARG(c->nodes), KARST_BUFFER_ARG(c->brick_info),
                KARST_BUFFER_ARG(c->bricks[0]), KARST_BUFFER_ARG(c->bricks[1]), KARST_BUFFER_ARG(c->bricks[2]),
                KARST_BUFFER_ARG(c->bricks[3]), KARST_BUFFER_ARG(c->bricks[4]), KARST_BUFFER_ARG(c->bricks[5]),
                KARST_BUFFER_ARG(c->bricks[6]), KARST_BUFFER_ARG(c->bricks[7]), KARST_VALUE_ARG(c->bricks_per_segment),
                KARST_BUFFER_ARG(c->tile_stamp), KARST_BUFFER_ARG(c->brick_stamp), KARST_BUFFER_ARG(c->brick_fallback),
                KARST_BUFFER_ARG(c->want_brick), KARST_BUFFER_ARG(c->want_children), KARST_BUFFER_ARG(c->want_chunk),
                KARST_BUFFER_ARG(c->want_rays), KARST_BUFFER_ARG(c->tile_info), KARST_BUFFER_ARG(openness->asked),
                KARST_BUFFER_ARG(openness->view), KARST_VALUE_ARG(*pinhole), KARST_VALUE_ARG(task),
                KARST_BUFFER_ARG(openness->turns), KARST_BUFFER_ARG(hits), KARST_BUFFER_ARG(bounds),
                KARST_BUFFER_ARG(cells ? cells : bounds)) ||
            !karst_launch(openness->context, openness->kernel, KARST_STAGE_SHADE, here, LOCAL_SIZE, error))
            return false;
    }
    return true;
}
