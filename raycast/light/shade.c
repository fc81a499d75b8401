/* Launching the shading kernel. */
#include "raycast/light/shade.h"

#include "raycast/light/radiance_shared.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* By measuring: docs/performance/shading.md. */
#define ITEMS_PER_UNIT 4u /* drivers may hand several to one core */
#define MOST_PART_PACKETS 512u
#define LEAST_PART_PACKETS 64u
#define PARTS_PER_UNIT 16u

struct karst_shader {
    karst_context *context;
    karst_program *program;
    cl_kernel pixels;
    cl_kernel rays; /* NULL: surfaces do not mirror */
    cl_kernel paths; /* NULL: no paths are followed */
    cl_kernel shares; /* NULL: nothing passes land */
    bool shadows, radiance, mirror, atmosphere, paint, occlusion, passes;
    const karst_buffer *open; /* of occlusion */
    cl_mem data;         /* of the world's colours; NULL: it has none */
    karst_buffer *taken; /* the parts of a picture that work-items have taken; 0 between launches */
    karst_shade_anchor anchor;
    karst_skies *skies;
    karst_buffer *black; /* a sky, for an atmosphere */
    /* Of paint: the kernel's PAINT_PARAMETERS (raycast/light/paint.clh). */
    cl_mem colours[KARST_MAX_BRICK_SEGMENTS], coloured, nodes, tile_info;
    uint32_t num_colour_segments, bricks_per_segment;
};

karst_shader *karst_shader_create(karst_context *context, unsigned ways, karst_error *error)
{
    return karst_shader_create_coloured(context, ways, NULL, error);
}

void karst_shader_set_anchor(karst_shader *shader, const karst_position *anchor)
{
    for (int axis = 0; axis < 3; axis++) {
        shader->anchor.voxel[axis] = anchor->voxel[axis];
        shader->anchor.fraction[axis] = anchor->fraction[axis];
    }
}

void karst_shader_set_skies(karst_shader *shader, karst_skies *skies) { shader->skies = skies; }

void karst_shader_set_occlusion(karst_shader *shader, const karst_buffer *open) { shader->open = open; }

void karst_shader_set_colours(karst_shader *shader, const karst_colours *colours, const karst_cache_buffers *bricks)
{
    for (uint32_t i = 0; i < KARST_MAX_BRICK_SEGMENTS; i++)
        shader->colours[i] = colours->samples[i]->mem;
    shader->coloured = colours->coloured->mem;
    shader->nodes = bricks->nodes->mem;
    shader->tile_info = bricks->tile_info->mem;
    shader->num_colour_segments = colours->num_segments;
    shader->bricks_per_segment = colours->bricks_per_segment;
}

karst_shader *karst_shader_create_coloured(karst_context *context, unsigned ways, const karst_shade_colour *colour,
                                           karst_error *error)
{
    karst_shader *shader = calloc(1, sizeof(*shader));
    if (!shader) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    char options[512];
    shader->shadows = ways & KARST_SHADE_SHADOWS;
    shader->radiance = ways & KARST_SHADE_RADIANCE;
    shader->mirror = ways & KARST_SHADE_MIRROR;
    shader->atmosphere = ways & KARST_SHADE_ATMOSPHERE;
    shader->paint = ways & KARST_SHADE_PAINT;
    shader->occlusion = ways & KARST_SHADE_OCCLUSION;
    shader->passes = ways & KARST_SHADE_PASS;
    snprintf(options, sizeof(options), "%s%s%s%s%s%s%s%s%s%s%s%s", shader->shadows ? "-DSHADE_SHADOWS" : "",
             shader->radiance ? " -DSHADE_RADIANCE" : "", shader->mirror ? " -DSHADE_MIRROR" : "",
             shader->atmosphere ? " -DSHADE_ATMOSPHERE" : "", shader->paint ? " -DSHADE_PAINT" : "",
             ways & KARST_SHADE_PATHS ? " -DSHADE_PATHS" : "", shader->occlusion ? " -DSHADE_OCCLUSION" : "",
             ways & KARST_SHADE_THROUGH_CLEAR ? " -DSHADE_THROUGH_CLEAR" : "", shader->passes ? " -DSHADE_PASS" : "",
             ways & KARST_SHADE_SPLATS ? " -DSHADE_SPLATS" : "",
             colour ? " -DSHADE_WORLD_COLOUR " : "", colour ? colour->options : "");
    const karst_virtual_file world = {"world.clh", colour ? colour->source : ""};
    shader->context = context;
    shader->data = colour && colour->data ? colour->data->mem : NULL;
    shader->taken = karst_buffer_create(context, "shading", sizeof(uint32_t), NULL, error);
    if (shader->atmosphere)
        shader->black = karst_buffer_create(context, "sky", KARST_SKY_FLOATS * sizeof(float), NULL, error);
    if (shader->taken && (shader->black || !shader->atmosphere))
        shader->program = karst_program_build(context, "raycast/light/shade.cl", options, &world, 1, error);
    if (shader->program)
        shader->pixels = karst_program_kernel(shader->program, "shade_pixels", error);
    if (shader->pixels && shader->mirror)
        shader->rays = karst_program_kernel(shader->program, "shade_rays", error);
    if (shader->pixels && (ways & KARST_SHADE_PATHS))
        shader->paths = karst_program_kernel(shader->program, "shade_paths", error);
    if (shader->pixels && shader->passes)
        shader->shares = karst_program_kernel(shader->program, "shade_shares", error);
    if (!shader->pixels || (shader->mirror && !shader->rays) || ((ways & KARST_SHADE_PATHS) && !shader->paths) ||
        (shader->passes && !shader->shares)) {
        karst_shader_destroy(shader);
        return NULL;
    }
    return shader;
}

void karst_shader_destroy(karst_shader *shader)
{
    if (!shader)
        return;
    if (shader->pixels)
        clReleaseKernel(shader->pixels);
    if (shader->rays)
        clReleaseKernel(shader->rays);
    if (shader->paths)
        clReleaseKernel(shader->paths);
    if (shader->shares)
        clReleaseKernel(shader->shares);
    karst_program_destroy(shader->program);
    karst_buffer_destroy(shader->taken);
    karst_buffer_destroy(shader->black);
    free(shader);
}

static bool check_size(const karst_buffer *buffer, size_t bytes_per_pixel, const karst_pinhole *pinhole,
                       karst_error *error)
{
    if (buffer->size_bytes / bytes_per_pixel >= (size_t)pinhole->width_px * (size_t)pinhole->height_px)
        return true;
    return karst_fail(error, KARST_FAILED, "the buffer %s of %zu bytes is too small for a picture of %dx%d",
                      buffer->name, buffer->size_bytes, pinhole->width_px, pinhole->height_px);
}

/* Packets that a work-item takes at a time: many, as cores that shade neighbours wait for each other's rows, but such
 * that no core is left with much when the others have nothing to do. */
static uint32_t part_size(const karst_context *context, uint32_t num_packets)
{
    uint32_t size = MOST_PART_PACKETS;
    while (size > LEAST_PART_PACKETS && num_packets / size < PARTS_PER_UNIT * (uint32_t)context->compute_units)
        size /= 2;
    return size;
}

static const karst_sky *sky_of(const karst_shader *shader)
{
    static const karst_sky night;
    return shader->skies ? karst_skies_sky(shader->skies) : &night;
}

static cl_mem sky_table(const karst_shader *shader)
{
    const karst_buffer *table = shader->skies ? karst_skies_buffer(shader->skies) : shader->black;
    return table ? table->mem : NULL;
}

/* The kernels' last arguments, of what the shader was made for; how many. */
#define MAX_LAST_ARGUMENTS 15
static size_t add_last(const karst_shader *shader, const cl_mem *sky_mem, karst_argument last[MAX_LAST_ARGUMENTS])
{
    size_t num = 0;
    if (shader->atmosphere) {
        last[num++] = (karst_argument)KARST_VALUE_ARG(*sky_of(shader));
        last[num++] = (karst_argument)KARST_VALUE_ARG(*sky_mem);
    }
    for (size_t i = 0; shader->paint && i < KARST_MAX_BRICK_SEGMENTS; i++)
        last[num++] = (karst_argument)KARST_VALUE_ARG(shader->colours[i]);
    if (shader->paint) {
        last[num++] = (karst_argument)KARST_VALUE_ARG(shader->num_colour_segments);
        last[num++] = (karst_argument)KARST_VALUE_ARG(shader->bricks_per_segment);
        last[num++] = (karst_argument)KARST_VALUE_ARG(shader->coloured);
        last[num++] = (karst_argument)KARST_VALUE_ARG(shader->nodes);
        last[num++] = (karst_argument)KARST_VALUE_ARG(shader->tile_info);
    }
    return num;
}

/* The light that surfaces are shaded in: none faces a sun that sends none, so no rays are cast to it. An atmosphere
 * looks at where it stands. */
static karst_light light_on_surfaces(const karst_shader *shader, const karst_light *light)
{
    karst_light on = *light;
    const float *sun = light->sun_colour;
    if (!shader->atmosphere && sun[0] == 0 && sun[1] == 0 && sun[2] == 0)
        memset(on.sun_direction, 0, 3 * sizeof *on.sun_direction);
    return on;
}

bool karst_shade_pixels(karst_shader *shader, const karst_cast_view *view, const karst_pinhole *pinhole,
                        const karst_light *light, karst_buffer *hits, karst_buffer *shadow_rays, cl_mem pixels,
                        karst_buffer *depth, karst_buffer *counters, karst_error *error)
{
    if (shader->shadows != (shadow_rays != NULL))
        return karst_fail(error, KARST_FAILED, "the shader was made with%s shadows", shader->shadows ? "" : "out");
    const size_t depth_floats = !shader->radiance ? 1
                                : shader->mirror  ? KARST_RADIANCE_MIRROR_PLANE + (shader->passes ? 2 : 1)
                                                  : KARST_RADIANCE_PLANES * (shader->shadows ? 2 : 1);
    if (shader->radiance && !depth)
        return karst_fail(error, KARST_FAILED, "the shader was made for radiance, which needs room");
    if (shadow_rays && !karst_cast_check_shadow_rays(shadow_rays, pinhole, error))
        return false;
    size_t across = ((size_t)pinhole->width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t down = ((size_t)pinhole->height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    const uint32_t num_packets = (uint32_t)(across * down * KARST_GROUP_PACKETS);
    const uint32_t part_packets = part_size(shader->context, num_packets);
    /* Packets as lanes: a few work-items take them from a counter. Rays as work-items: a work-group has a group. */
    const bool counted = shader->context->lanes == KARST_PACKET_RAYS;
    const size_t local_size = counted ? 1 : KARST_PACKET_RAYS * KARST_GROUP_PACKETS;
    const size_t global_size =
        counted ? ITEMS_PER_UNIT * (size_t)shader->context->compute_units : across * down * local_size;
    const cl_mem rays_mem = shadow_rays ? shadow_rays->mem : NULL, depth_mem = depth ? depth->mem : NULL;
    const cl_mem sky_mem = sky_table(shader);
    const karst_light on = light_on_surfaces(shader, light);
    const cl_mem open_mem = shader->open ? shader->open->mem : NULL;
    karst_argument arguments[15 + MAX_LAST_ARGUMENTS + 1] = {
        KARST_VALUE_ARG(view->detail), KARST_VALUE_ARG(view->blend), KARST_VALUE_ARG(*pinhole), KARST_VALUE_ARG(on),
        KARST_BUFFER_ARG(hits), KARST_VALUE_ARG(rays_mem), KARST_VALUE_ARG(pixels), KARST_VALUE_ARG(depth_mem),
        KARST_BUFFER_ARG(counters), KARST_VALUE_ARG(shader->anchor), KARST_VALUE_ARG(shader->data),
        KARST_VALUE_ARG(view->own_detail), KARST_BUFFER_ARG(shader->taken), KARST_VALUE_ARG(num_packets),
        KARST_VALUE_ARG(part_packets)};
    size_t num_arguments = 15 + add_last(shader, &sky_mem, arguments + 15);
    if (shader->occlusion)
        arguments[num_arguments++] = (karst_argument)KARST_VALUE_ARG(open_mem);
    return check_size(hits, sizeof(karst_hit), pinhole, error) &&
           (!shader->occlusion ||
            (shader->open ? check_size(shader->open, sizeof(float), pinhole, error)
                          : karst_fail(error, KARST_FAILED, "nothing says how open pixels are"))) &&
           (!depth || check_size(depth, depth_floats * sizeof(float), pinhole, error)) &&
           karst_arguments(shader->pixels, arguments, num_arguments, error) &&
           karst_launch(shader->context, shader->pixels, KARST_STAGE_SHADE, global_size, local_size, error);
}

bool karst_shade_rays(karst_shader *shader, const karst_cast_view *view, const karst_pinhole *pinhole,
                      const karst_light *light, const karst_shade_stream *stream, karst_buffer *parts,
                      karst_buffer *counters, karst_error *error)
{
    const karst_buffer *shadow_rays = stream->shadow_rays, *suns = stream->suns;
    const uint32_t max_rays = stream->max_rays, room = stream->room;
    if (!shader->rays)
        return karst_fail(error, KARST_FAILED, "the shader was made without mirrors");
    if (shader->shadows && (!shadow_rays || !suns || room < max_rays ||
                            shadow_rays->size_bytes / (KARST_SHADOW_FIELDS * sizeof(float)) < room ||
                            suns->size_bytes / (KARST_RADIANCE_PLANES * sizeof(float)) < room))
        return karst_fail(error, KARST_FAILED, "there is no room for the shadow rays of %u rays", max_rays);
    if (stream->rays->size_bytes / sizeof(karst_ray) < max_rays ||
        stream->hits->size_bytes / sizeof(karst_hit) < max_rays)
        return karst_fail(error, KARST_FAILED, "there is no room for %u rays", max_rays);
    const uint32_t num_packets = (max_rays + KARST_PACKET_RAYS - 1) / KARST_PACKET_RAYS;
    const uint32_t part_packets = part_size(shader->context, num_packets);
    const bool counted = shader->context->lanes == KARST_PACKET_RAYS;
    const size_t local_size = counted ? 1 : KARST_PACKET_RAYS * KARST_GROUP_PACKETS;
    const size_t global_size = counted ? ITEMS_PER_UNIT * (size_t)shader->context->compute_units : max_rays;
    const cl_mem shadow_mem = shadow_rays ? shadow_rays->mem : NULL, suns_mem = suns ? suns->mem : NULL;
    const cl_mem sky_mem = sky_table(shader);
    const karst_light on = light_on_surfaces(shader, light);
    karst_argument arguments[17 + MAX_LAST_ARGUMENTS] = {
        KARST_VALUE_ARG(view->detail), KARST_VALUE_ARG(view->blend), KARST_VALUE_ARG(*pinhole), KARST_VALUE_ARG(on),
        KARST_BUFFER_ARG(stream->rays), KARST_BUFFER_ARG(stream->count), KARST_BUFFER_ARG(stream->hits),
        KARST_VALUE_ARG(shadow_mem), KARST_VALUE_ARG(suns_mem), KARST_VALUE_ARG(room), KARST_BUFFER_ARG(parts),
        KARST_BUFFER_ARG(counters), KARST_VALUE_ARG(shader->anchor), KARST_VALUE_ARG(shader->data),
        KARST_VALUE_ARG(view->own_detail), KARST_BUFFER_ARG(shader->taken), KARST_VALUE_ARG(part_packets)};
    const size_t num_arguments = 17 + add_last(shader, &sky_mem, arguments + 17);
    return check_size(parts, (KARST_RADIANCE_MIRROR_PLANE + 1) * sizeof(float), pinhole, error) &&
           karst_arguments(shader->rays, arguments, num_arguments, error) &&
           karst_launch(shader->context, shader->rays, KARST_STAGE_SHADE, global_size, local_size, error);
}

#define SHARE_PACKETS 64u /* as in passing.clh */

bool karst_shade_shares(karst_shader *shader, const karst_cast_view *view, const karst_light *light,
                        const karst_share_stream *stream, karst_buffer *shares, karst_error *error)
{
    const uint32_t max_rays = stream->max_rays;
    if (!shader->shares)
        return karst_fail(error, KARST_FAILED, "the shader was made for land that lets nothing pass");
    if (stream->rays->size_bytes / sizeof(karst_ray) < max_rays ||
        stream->hits->size_bytes / sizeof(karst_hit) < max_rays || shares->size_bytes / sizeof(float) < max_rays)
        return karst_fail(error, KARST_FAILED, "there is no room for the shares of %u rays", max_rays);
    const bool one_lane = shader->context->lanes == 1;
    const uint32_t per_item = one_lane ? 1 : KARST_PACKET_RAYS * SHARE_PACKETS;
    const size_t local_size = one_lane ? KARST_PACKET_RAYS * KARST_GROUP_PACKETS : 1;
    const size_t items = (max_rays + per_item - 1) / per_item;
    const cl_uint by_haze = stream->by_haze;
    const cl_mem sky_mem = sky_table(shader);
    karst_argument arguments[10 + MAX_LAST_ARGUMENTS] = {
        KARST_VALUE_ARG(view->detail), KARST_VALUE_ARG(view->blend), KARST_VALUE_ARG(*light),
        KARST_BUFFER_ARG(stream->rays), KARST_BUFFER_ARG(stream->count), KARST_BUFFER_ARG(stream->hits),
        KARST_VALUE_ARG(by_haze), KARST_BUFFER_ARG(shares), KARST_VALUE_ARG(shader->anchor),
        KARST_VALUE_ARG(shader->data)};
    const size_t num_arguments = 10 + add_last(shader, &sky_mem, arguments + 10);
    return karst_arguments(shader->shares, arguments, num_arguments, error) &&
           karst_launch(shader->context, shader->shares, KARST_STAGE_SHADE,
                        (items + local_size - 1) / local_size * local_size, local_size, error);
}

bool karst_shade_paths(karst_shader *shader, const karst_cast_view *view, const karst_pinhole *pinhole,
                       const karst_light *light, const karst_path_task *task, const karst_path_streams *streams,
                       karst_buffer *parts, karst_buffer *counters, karst_error *error)
{
    const uint32_t max_rays = streams->max_rays;
    if (!shader->paths)
        return karst_fail(error, KARST_FAILED, "the shader was made without paths");
    if (streams->rays->size_bytes / sizeof(karst_ray) < max_rays ||
        streams->hits->size_bytes / sizeof(karst_hit) < max_rays ||
        streams->next->size_bytes / sizeof(karst_ray) < max_rays ||
        streams->to_lamps->size_bytes / sizeof(karst_ray) < max_rays ||
        streams->lamps->size_bytes / sizeof(karst_lamp) < task->num_lamps || (task->each_lamp && !streams->shining))
        return karst_fail(error, KARST_FAILED, "there is no room for %u paths", max_rays);
    const uint32_t num_packets =
        task->each_lamp ? task->num_packets : (max_rays + KARST_PACKET_RAYS - 1) / KARST_PACKET_RAYS;
    const uint32_t part_packets = part_size(shader->context, num_packets);
    const bool counted = shader->context->lanes == KARST_PACKET_RAYS;
    const size_t local_size = counted ? 1 : KARST_PACKET_RAYS * KARST_GROUP_PACKETS;
    const size_t num_items = task->each_lamp ? task->num_packets : max_rays;
    const size_t global_size = counted ? ITEMS_PER_UNIT * (size_t)shader->context->compute_units
                                       : (num_items + local_size - 1) / local_size * local_size;
    const cl_mem sky_mem = sky_table(shader), shining_mem = streams->shining ? streams->shining->mem : NULL;
    karst_argument arguments[19 + MAX_LAST_ARGUMENTS] = {
        KARST_VALUE_ARG(view->detail), KARST_VALUE_ARG(view->blend), KARST_VALUE_ARG(*pinhole), KARST_VALUE_ARG(*light),
        KARST_VALUE_ARG(*task), KARST_BUFFER_ARG(streams->lamps), KARST_BUFFER_ARG(streams->rays),
        KARST_BUFFER_ARG(streams->count), KARST_BUFFER_ARG(streams->hits), KARST_BUFFER_ARG(streams->next),
        KARST_BUFFER_ARG(streams->to_lamps), KARST_VALUE_ARG(shining_mem), KARST_BUFFER_ARG(parts),
        KARST_BUFFER_ARG(counters), KARST_VALUE_ARG(shader->anchor), KARST_VALUE_ARG(shader->data),
        KARST_VALUE_ARG(view->own_detail), KARST_BUFFER_ARG(shader->taken), KARST_VALUE_ARG(part_packets)};
    const size_t num_arguments = 19 + add_last(shader, &sky_mem, arguments + 19);
    return check_size(parts, KARST_RADIANCE_PLANES * sizeof(float), pinhole, error) &&
           karst_arguments(shader->paths, arguments, num_arguments, error) &&
           karst_launch(shader->context, shader->paths, KARST_STAGE_SHADE, global_size, local_size, error);
}
