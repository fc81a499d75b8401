/* Launching the kernels of media. */
#include "raycast/media/media.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Depths that nobody ends early. */
#define NO_END INFINITY

struct karst_media {
    karst_context *context;
    karst_media_config config;
    karst_cache_buffers air, land;
    karst_program *marching, *lighting;
    cl_kernel rays, sun, pixels;
    cl_mem data;
    karst_buffer *view, *asked, *counters, *grids, *states;
    karst_cast_view sent; /* what the queued write reads */
    float direction[3];
    uint32_t sun_number; /* counts places of the sun, from 1 */
};

static bool build(karst_media *media, karst_error *error)
{
    karst_context *context = media->context;
    const karst_shade_colour *look = &media->config.look;
    const uint32_t segments =
        media->land.num_segments > media->air.num_segments ? media->land.num_segments : media->air.num_segments;
    char options[1024];
    snprintf(options, sizeof options, "-DSEGMENTS=%u -DCAST_NO_BEAM %s", segments,
             karst_cache_brick_option(&media->air));
    media->marching = karst_program_build(context, "raycast/media/media.cl", options, NULL, 0, error);
    if (!media->marching || !(media->rays = karst_program_kernel(media->marching, "media_rays", error)) ||
        !(media->sun = karst_program_kernel(media->marching, "media_sun", error)))
        return false;
    if (!look->source)
        return true;
    const karst_virtual_file world = {"world.clh", look->source};
    snprintf(options, sizeof options, "-DSEGMENTS=%u -DCAST_NO_BEAM %s -DMEDIA_MODE=%u %s %s", segments,
             karst_cache_brick_option(&media->air), media->config.mode,
             media->config.has_atmosphere ? "-DSHADE_ATMOSPHERE" : "", look->options);
    media->lighting = karst_program_build(context, "raycast/media/media_light.cl", options, &world, 1, error);
    return media->lighting && (media->pixels = karst_program_kernel(media->lighting, "media_pixels", error));
}

karst_media *karst_media_create(karst_context *context, const karst_media_config *config, karst_error *error)
{
    karst_media *media = calloc(1, sizeof *media);
    if (!media) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    media->context = context;
    media->config = *config;
    media->air = *config->air;
    media->land = config->land ? *config->land : *config->air;
    media->data = config->look.data ? config->look.data->mem : NULL;
    const size_t num_slots = (size_t)media->air.num_bricks + KARST_CACHE_ROOT_BRICKS;
    const bool keeps = config->look.source != NULL;
    media->view = karst_buffer_create(context, "view", sizeof(karst_cast_view), NULL, error);
    media->asked = karst_buffer_create(context, "view", sizeof(uint32_t), NULL, error);
    media->counters =
        karst_buffer_create(context, "counters", KARST_MEDIA_COUNTERS * sizeof(uint32_t), NULL, error);
    media->grids = karst_buffer_create_blank(
        context, "sun depth", keeps ? num_slots * KARST_SUN_DEPTH_PLACES * sizeof(uint32_t) : sizeof(uint32_t), error);
    media->states =
        karst_buffer_create(context, "sun depth", (keeps ? num_slots : 1) * sizeof(karst_sun_depth), NULL, error);
    if (media->land.brick_bits != media->air.brick_bits)
        karst_fail(error, KARST_USAGE, "land and air have samples of different width");
    else if (media->view && media->asked && media->counters && media->grids && media->states && build(media, error))
        return media;
    karst_media_destroy(media);
    return NULL;
}

void karst_media_destroy(karst_media *media)
{
    if (!media)
        return;
    cl_kernel kernels[] = {media->rays, media->sun, media->pixels};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(media->marching);
    karst_program_destroy(media->lighting);
    karst_buffer *buffers[] = {media->view, media->asked, media->counters, media->grids, media->states};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        karst_buffer_destroy(buffers[i]);
    free(media);
}

/* The view stays as it is until the queue has read it: a picture's casts have one. */
static bool send_view(karst_media *media, const karst_cast_view *view, karst_error *error)
{
    if (!memcmp(&media->sent, view, sizeof *view))
        return true;
    if (!karst_finish(media->context, error))
        return false;
    media->sent = *view;
    return karst_buffer_write(media->view, 0, &media->sent, sizeof media->sent, error);
}

/* The pools, in the order of POOL_PARAMETERS (raycast/cast/walk.clh). */
#define POOL_ARGUMENTS(c, asked)                                                                                    \
    KARST_BUFFER_ARG((c).nodes), KARST_BUFFER_ARG((c).brick_info), KARST_BUFFER_ARG((c).bricks[0]),                 \
        KARST_BUFFER_ARG((c).bricks[1]), KARST_BUFFER_ARG((c).bricks[2]), KARST_BUFFER_ARG((c).bricks[3]),          \
        KARST_BUFFER_ARG((c).bricks[4]), KARST_BUFFER_ARG((c).bricks[5]), KARST_BUFFER_ARG((c).bricks[6]),          \
        KARST_BUFFER_ARG((c).bricks[7]), KARST_VALUE_ARG((c).bricks_per_segment), KARST_BUFFER_ARG((c).tile_stamp), \
        KARST_BUFFER_ARG((c).brick_stamp), KARST_BUFFER_ARG((c).brick_fallback), KARST_BUFFER_ARG((c).want_brick),  \
        KARST_BUFFER_ARG((c).want_children), KARST_BUFFER_ARG((c).want_chunk), KARST_BUFFER_ARG((c).want_rays),     \
        KARST_BUFFER_ARG((c).tile_info), KARST_BUFFER_ARG(asked)

static karst_media_task task_of(const karst_media *media, float metres, float detail, float most_depth)
{
    return (karst_media_task){
        .metres = metres, .detail = detail, .most_depth = most_depth, .sun = media->sun_number};
}

static karst_shade_anchor anchor_of(const karst_position *position)
{
    karst_shade_anchor anchor = {.pad = 0};
    memcpy(anchor.voxel, position->voxel, sizeof anchor.voxel);
    memcpy(anchor.fraction, position->fraction, sizeof anchor.fraction);
    return anchor;
}

bool karst_media_depths(karst_media *media, const karst_cast_view *view, const karst_buffer *rays, uint32_t num_rays,
                        float metres, karst_buffer *depths, uint32_t *num_missing, karst_error *error)
{
    const karst_media_task task = task_of(media, metres, view->detail, NO_END);
    const size_t lanes = (size_t)media->context->lanes;
    uint32_t made;
    *num_missing = 0;
    if (num_rays == 0)
        return true;
    if (rays->size_bytes / sizeof(karst_ray) < num_rays || depths->size_bytes / sizeof(float) < num_rays)
        return karst_fail(error, KARST_FAILED, "there is no room for %u rays", num_rays);
    return send_view(media, view, error) &&
           KARST_ARGUMENTS(media->rays, error, POOL_ARGUMENTS(media->air, media->asked), KARST_BUFFER_ARG(media->view),
                           KARST_VALUE_ARG(task), KARST_BUFFER_ARG(rays), KARST_VALUE_ARG(num_rays),
                           KARST_BUFFER_ARG(depths), KARST_BUFFER_ARG(media->counters)) &&
           karst_launch(media->context, media->rays, KARST_STAGE_CAST, (num_rays + lanes - 1) / lanes, 1, error) &&
           karst_media_take_counts(media, num_missing, &made, error);
}

void karst_media_aim(karst_media *media, const float direction[3])
{
    if (media->sun_number && !memcmp(media->direction, direction, sizeof media->direction))
        return;
    memcpy(media->direction, direction, sizeof media->direction);
    if (++media->sun_number == 0)
        media->sun_number = 1;
}

bool karst_media_pixels(karst_media *media, const karst_cast_view *view, const karst_pinhole *pinhole,
                        const karst_light *light, const karst_position *anchor, karst_skies *skies, float metres,
                        float detail, const karst_buffer *hits, karst_buffer *parts, bool has_sun, bool has_mirror,
                        karst_error *error)
{
    if (!media->pixels)
        return karst_fail(error, KARST_FAILED, "these media were made for depths alone");
    karst_media_aim(media, light->sun_direction);
    const karst_media_task task = task_of(media, metres, view->detail * detail, KARST_MEDIA_MOST_DEPTH);
    const karst_shade_anchor at = anchor_of(anchor);
    const cl_uint sun = has_sun, mirror = has_mirror;
    static const karst_sky night;
    const karst_sky *sky = skies ? karst_skies_sky(skies) : &night;
    const cl_mem table = skies ? karst_skies_buffer(skies)->mem : NULL;
    const size_t across = ((size_t)pinhole->width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                 down = ((size_t)pinhole->height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                 num_items = across * down * KARST_GROUP_PACKETS * KARST_PACKET_RAYS / (size_t)media->context->lanes,
                 local_size = media->context->lanes == 1 ? KARST_PACKET_RAYS * KARST_GROUP_PACKETS : 1;
    const karst_argument arguments[] = {POOL_ARGUMENTS(media->air, media->asked),
                                        KARST_BUFFER_ARG(media->view),
                                        KARST_VALUE_ARG(task),
                                        KARST_VALUE_ARG(*pinhole),
                                        KARST_VALUE_ARG(*light),
                                        KARST_BUFFER_ARG(hits),
                                        KARST_BUFFER_ARG(parts),
                                        KARST_VALUE_ARG(sun),
                                        KARST_VALUE_ARG(mirror),
                                        KARST_VALUE_ARG(at),
                                        KARST_BUFFER_ARG(media->grids),
                                        KARST_BUFFER_ARG(media->states),
                                        KARST_BUFFER_ARG(media->air.brick_owner),
                                        KARST_BUFFER_ARG(media->counters),
                                        KARST_VALUE_ARG(media->data),
                                        /* of an atmosphere alone */
                                        KARST_VALUE_ARG(*sky),
                                        KARST_VALUE_ARG(table)};
    const size_t num_arguments = sizeof arguments / sizeof *arguments - (media->config.has_atmosphere ? 0 : 2);
    return send_view(media, view, error) && karst_arguments(media->pixels, arguments, num_arguments, error) &&
           karst_launch(media->context, media->pixels, KARST_STAGE_SHADE, num_items, local_size, error);
}

bool karst_media_survey_sun(karst_media *media, const karst_cast_view *view, const karst_light *light,
                            const karst_position *anchor, float metres, karst_error *error)
{
    if (media->config.mode == KARST_MEDIA_BASIC)
        return true;
    karst_media_aim(media, light->sun_direction);
    const karst_media_task task = task_of(media, metres, 1, NO_END);
    const karst_shade_anchor at = anchor_of(anchor);
    const uint32_t num_slots = media->air.num_bricks + KARST_CACHE_ROOT_BRICKS,
                   with_land = media->config.land && media->config.mode == KARST_MEDIA_FULL;
    const cl_float4 to_sun = {{light->sun_direction[0], light->sun_direction[1], light->sun_direction[2], 0}};
    return send_view(media, view, error) &&
           KARST_ARGUMENTS(media->sun, error, POOL_ARGUMENTS(media->air, media->asked),
                           POOL_ARGUMENTS(media->land, media->asked), KARST_BUFFER_ARG(media->view),
                           KARST_VALUE_ARG(task), KARST_VALUE_ARG(at), KARST_VALUE_ARG(to_sun),
                           KARST_VALUE_ARG(light->shadow_distance), KARST_VALUE_ARG(num_slots),
                           KARST_VALUE_ARG(with_land), KARST_BUFFER_ARG(media->air.brick_owner),
                           KARST_BUFFER_ARG(media->grids), KARST_BUFFER_ARG(media->states),
                           KARST_BUFFER_ARG(media->counters)) &&
           karst_launch(media->context, media->sun, KARST_STAGE_CAST, num_slots, 1, error);
}

bool karst_media_take_counts(karst_media *media, uint32_t *num_lacking, uint32_t *num_made, karst_error *error)
{
    uint32_t counts[KARST_MEDIA_COUNTERS];
    if (!karst_buffer_read(media->counters, 0, counts, sizeof counts, error))
        return false;
    *num_lacking = counts[KARST_MEDIA_LACKING];
    *num_made = counts[KARST_MEDIA_MADE];
    return karst_buffer_fill(media->counters, 0, 0, sizeof counts, error);
}

bool karst_media_forget(karst_media *media, karst_error *error)
{
    return karst_buffer_fill(media->states, 0, 0, media->states->size_bytes, error);
}
