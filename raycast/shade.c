/* Launching the shading kernels. */
#include "raycast/shade.h"

#include <stdio.h>
#include <stdlib.h>

struct karst_shader {
    karst_context *context;
    karst_cache_buffers cache;
    karst_program *program;
    karst_program *plain;  /* without colours, for shadow_rays; NULL if program is that, or without shadows */
    cl_kernel shadow_rays; /* NULL without shadows */
    cl_kernel pixels;
    cl_mem data; /* of the world's colours; NULL: it has none */
    karst_shade_anchor anchor;
};

karst_shader *karst_shader_create(karst_context *context, const karst_cache_buffers *cache, bool shadows,
                                  karst_error *error)
{
    return karst_shader_create_coloured(context, cache, shadows, NULL, error);
}

void karst_shader_set_anchor(karst_shader *shader, const karst_position *anchor)
{
    for (int axis = 0; axis < 3; axis++) {
        shader->anchor.voxel[axis] = anchor->voxel[axis];
        shader->anchor.fraction[axis] = anchor->fraction[axis];
    }
}

karst_shader *karst_shader_create_coloured(karst_context *context, const karst_cache_buffers *cache, bool shadows,
                                           const karst_shade_colour *colour, karst_error *error)
{
    karst_shader *shader = calloc(1, sizeof(*shader));
    if (!shader) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    char plain_options[256], options[512];
    snprintf(plain_options, sizeof(plain_options), "-DSEGMENTS=%u%s", cache->num_segments,
             karst_cache_brick_option(cache));
    snprintf(options, sizeof(options), "%s%s%s", plain_options, colour ? " -DSHADE_WORLD_COLOUR " : "",
             colour ? colour->options : "");
    const karst_virtual_file world = {"world.clh", colour ? colour->source : ""}, none = {"world.clh", ""};
    shader->context = context;
    shader->cache = *cache;
    shader->data = colour && colour->data ? colour->data->mem : NULL;
    shader->program = karst_program_build(context, "raycast/shade.cl", options, &world, 1, error);
    /* Shadow rays know no colours: a kernel that all worlds share is not compiled anew when colours are edited. */
    if (colour && shadows && shader->program)
        shader->plain = karst_program_build(context, "raycast/shade.cl", plain_options, &none, 1, error);
    karst_program *for_rays = colour ? shader->plain : shader->program;
    if (shader->program)
        shader->pixels = karst_program_kernel(shader->program, "shade_pixels", error);
    if (shadows && for_rays && shader->pixels)
        shader->shadow_rays = karst_program_kernel(for_rays, "shade_shadow_rays", error);
    if (!shader->pixels || (shadows && !shader->shadow_rays)) {
        karst_shader_destroy(shader);
        return NULL;
    }
    return shader;
}

void karst_shader_destroy(karst_shader *shader)
{
    if (!shader)
        return;
    if (shader->shadow_rays)
        clReleaseKernel(shader->shadow_rays);
    if (shader->pixels)
        clReleaseKernel(shader->pixels);
    karst_program_destroy(shader->program);
    karst_program_destroy(shader->plain);
    free(shader);
}

/* In the order of SURFACE_PARAMETERS (raycast/shade.cl). */
#define SURFACE_ARGUMENTS(c, view)                                                                                 \
    KARST_BUFFER_ARG((c).bricks[0]), KARST_BUFFER_ARG((c).bricks[1]), KARST_BUFFER_ARG((c).bricks[2]),             \
        KARST_BUFFER_ARG((c).bricks[3]), KARST_BUFFER_ARG((c).bricks[4]), KARST_BUFFER_ARG((c).bricks[5]),         \
        KARST_BUFFER_ARG((c).bricks[6]), KARST_BUFFER_ARG((c).bricks[7]), KARST_VALUE_ARG((c).bricks_per_segment), \
        KARST_BUFFER_ARG((c).nodes), KARST_BUFFER_ARG((c).brick_info), KARST_BUFFER_ARG((c).tile_info),            \
        KARST_VALUE_ARG((view)->detail), KARST_VALUE_ARG((view)->blend)

static bool launch(karst_shader *shader, cl_kernel kernel, const karst_pinhole *pinhole, karst_error *error)
{
    size_t across = ((size_t)pinhole->width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t down = ((size_t)pinhole->height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t local_size = KARST_PACKET_RAYS * KARST_GROUP_PACKETS / (size_t)shader->context->lanes;
    return karst_launch(shader->context, kernel, KARST_STAGE_SHADE, across * down * local_size, local_size, error);
}

static bool check_size(const karst_buffer *buffer, size_t bytes_per_pixel, const karst_pinhole *pinhole,
                       karst_error *error)
{
    if (buffer->size_bytes / bytes_per_pixel >= (size_t)pinhole->width_px * (size_t)pinhole->height_px)
        return true;
    return karst_fail(error, KARST_FAILED, "the buffer %s of %zu bytes is too small for a picture of %dx%d",
                      buffer->name, buffer->size_bytes, pinhole->width_px, pinhole->height_px);
}

bool karst_shade_make_shadow_rays(karst_shader *shader, const karst_cast_view *view, const karst_pinhole *pinhole,
                                  const karst_light *light, karst_buffer *hits, karst_buffer *rays, karst_error *error)
{
    if (!shader->shadow_rays)
        return karst_fail(error, KARST_FAILED, "the shader was made without shadows");
    return check_size(hits, sizeof(karst_hit), pinhole, error) && check_size(rays, sizeof(karst_ray), pinhole, error) &&
           KARST_ARGUMENTS(shader->shadow_rays, error, SURFACE_ARGUMENTS(shader->cache, view),
                           KARST_VALUE_ARG(*pinhole), KARST_VALUE_ARG(*light), KARST_BUFFER_ARG(hits),
                           KARST_BUFFER_ARG(rays)) &&
           launch(shader, shader->shadow_rays, pinhole, error);
}

bool karst_shade_pixels(karst_shader *shader, const karst_cast_view *view, const karst_pinhole *pinhole,
                        const karst_light *light, karst_buffer *hits, karst_buffer *shadow_hits, cl_mem pixels,
                        karst_buffer *depth, karst_buffer *counters, karst_error *error)
{
    cl_int has_shadows = shadow_hits != NULL;
    const karst_buffer *second = shadow_hits ? shadow_hits : hits;
    return check_size(hits, sizeof(karst_hit), pinhole, error) &&
           check_size(second, sizeof(karst_hit), pinhole, error) && check_size(depth, sizeof(float), pinhole, error) &&
           KARST_ARGUMENTS(shader->pixels, error, SURFACE_ARGUMENTS(shader->cache, view), KARST_VALUE_ARG(*pinhole),
                           KARST_VALUE_ARG(*light), KARST_BUFFER_ARG(hits), KARST_BUFFER_ARG(second),
                           KARST_VALUE_ARG(has_shadows), KARST_VALUE_ARG(pixels), KARST_BUFFER_ARG(depth),
                           KARST_BUFFER_ARG(counters), KARST_VALUE_ARG(shader->anchor),
                           KARST_VALUE_ARG(shader->data), KARST_VALUE_ARG(view->own_detail)) &&
           launch(shader, shader->pixels, pinhole, error);
}
