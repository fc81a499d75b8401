/* Launching the kernels that paint what the engine knows. */
#include "raycast/light/views.h"

#include <stdio.h>
#include <stdlib.h>

#define NOTE_LOCAL 64

struct karst_views {
    karst_context *context;
    karst_program *program;
    cl_kernel paint, normals, note, paint_values, count;
    karst_buffer *born; /* frame from which on each slot's brick was to be seen; 0: unknown */
    karst_buffer *bounces; /* of a picture's pixels; NULL until they are counted */
};

karst_views *karst_views_create(karst_context *context, const karst_cache_buffers *cache, karst_error *error)
{
    karst_views *views = calloc(1, sizeof(*views));
    if (!views) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    views->context = context;
    views->born = karst_buffer_create(context, "born", (cache->num_bricks + KARST_CACHE_ROOT_BRICKS) * sizeof(uint32_t),
                                      NULL, error);
    views->program = views->born ? karst_program_build(context, "raycast/light/views.cl", "", NULL, 0, error) : NULL;
    if (views->program) {
        views->paint = karst_program_kernel(views->program, "views_paint", error);
        views->normals = karst_program_kernel(views->program, "views_normals", error);
        views->note = karst_program_kernel(views->program, "views_note", error);
        views->paint_values = karst_program_kernel(views->program, "views_paint_values", error);
        views->count = karst_program_kernel(views->program, "views_count", error);
    }
    if (!views->paint || !views->normals || !views->note || !views->paint_values || !views->count) {
        karst_views_destroy(views);
        return NULL;
    }
    return views;
}

void karst_views_destroy(karst_views *views)
{
    if (!views)
        return;
    cl_kernel kernels[] = {views->paint, views->normals, views->note, views->paint_values, views->count};
    for (size_t i = 0; i < sizeof(kernels) / sizeof(*kernels); i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(views->program);
    karst_buffer_destroy(views->born);
    karst_buffer_destroy(views->bounces);
    free(views);
}

bool karst_views_note(karst_views *views, const karst_work *work, uint32_t frame, karst_error *error)
{
    if (!work->num_loads)
        return true;
    return KARST_ARGUMENTS(views->note, error, KARST_BUFFER_ARG(work->load_slots), KARST_VALUE_ARG(work->num_loads),
                           KARST_VALUE_ARG(frame), KARST_BUFFER_ARG(views->born)) &&
           karst_launch(views->context, views->note, KARST_STAGE_SHADE, work->num_loads, NOTE_LOCAL, error);
}

static bool launch(karst_views *views, cl_kernel kernel, const karst_pinhole *pinhole, karst_error *error)
{
    size_t across = ((size_t)pinhole->width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t down = ((size_t)pinhole->height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t local_size = KARST_PACKET_RAYS * KARST_GROUP_PACKETS / (size_t)views->context->lanes;
    return karst_launch(views->context, kernel, KARST_STAGE_SHADE, across * down * local_size, local_size, error);
}

bool karst_views_paint(karst_views *views, int paint, const karst_pinhole *pinhole, uint32_t frame, karst_buffer *hits,
                       cl_mem pixels, karst_error *error)
{
    cl_int what = paint;
    return KARST_ARGUMENTS(views->paint, error, KARST_VALUE_ARG(*pinhole), KARST_BUFFER_ARG(hits),
                           KARST_BUFFER_ARG(views->born), KARST_VALUE_ARG(frame), KARST_VALUE_ARG(what),
                           KARST_VALUE_ARG(pixels)) &&
           launch(views, views->paint, pinhole, error);
}

bool karst_views_normals(karst_views *views, const karst_pinhole *pinhole, karst_buffer *hits, karst_buffer *normals,
                         karst_error *error)
{
    return KARST_ARGUMENTS(views->normals, error, KARST_VALUE_ARG(*pinhole), KARST_BUFFER_ARG(hits),
                           KARST_BUFFER_ARG(normals)) &&
           launch(views, views->normals, pinhole, error);
}

bool karst_views_paint_values(karst_views *views, int paint, const karst_pinhole *pinhole, karst_buffer *hits,
                              const karst_buffer *values, cl_mem pixels, karst_error *error)
{
    const size_t plane = (size_t)pinhole->width_px * (size_t)pinhole->height_px;
    const size_t num = paint == KARST_PAINT_ALBEDO ? 3 * plane : plane;
    const karst_buffer *from = paint == KARST_PAINT_BOUNCES ? views->bounces : values;
    const cl_int what = paint;
    if (!from || from->size_bytes < num * sizeof(float))
        return karst_fail(error, KARST_FAILED, "there are no values of a picture of %dx%d to paint", pinhole->width_px,
                          pinhole->height_px);
    return KARST_ARGUMENTS(views->paint_values, error, KARST_VALUE_ARG(*pinhole), KARST_BUFFER_ARG(hits),
                           KARST_BUFFER_ARG(from), KARST_VALUE_ARG(what), KARST_VALUE_ARG(pixels)) &&
           launch(views, views->paint_values, pinhole, error);
}

bool karst_views_forget_bounces(karst_views *views, const karst_pinhole *pinhole, karst_error *error)
{
    const size_t size_bytes = (size_t)pinhole->width_px * (size_t)pinhole->height_px * sizeof(uint32_t);
    if (!views->bounces || views->bounces->size_bytes != size_bytes) {
        karst_buffer_destroy(views->bounces);
        views->bounces = karst_buffer_create_blank(views->context, "bounces", size_bytes, error);
    }
    return views->bounces && karst_buffer_fill(views->bounces, 0, 0, size_bytes, error);
}

bool karst_views_count_bounces(karst_views *views, const karst_pinhole *pinhole, const karst_buffer *rays,
                               const karst_buffer *count, uint32_t max_rays, karst_error *error)
{
    const cl_int width = pinhole->width_px, height = pinhole->height_px;
    return KARST_ARGUMENTS(views->count, error, KARST_BUFFER_ARG(rays), KARST_BUFFER_ARG(count),
                           KARST_VALUE_ARG(max_rays), KARST_VALUE_ARG(width), KARST_VALUE_ARG(height),
                           KARST_BUFFER_ARG(views->bounces)) &&
           karst_launch(views->context, views->count, KARST_STAGE_SHADE, max_rays, NOTE_LOCAL, error);
}
