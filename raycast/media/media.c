/* Launching the kernels of media. */
#include "raycast/media/fluence.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Depths that nobody ends early. */
#define NO_END INFINITY
#define GPU_LOCAL_SIZE 64

static bool build(karst_media *media, karst_error *error)
{
    karst_context *context = media->context;
    const uint32_t segments =
        media->land.num_segments > media->air.num_segments ? media->land.num_segments : media->air.num_segments;
    char options[128];
    snprintf(options, sizeof options, "-DSEGMENTS=%u -DCAST_NO_BEAM %s%s", segments,
             karst_cache_brick_option(&media->air),
             karst_media_scatters_once(media) ? " -DMEDIA_ONCE" : "");
    media->marching = karst_program_build(context, "raycast/media/media.cl", options, NULL, 0, error);
    if (!media->marching || !(media->rays = karst_program_kernel(media->marching, "media_depths", error)) ||
        !(media->dim = karst_program_kernel(media->marching, "media_dim", error)) ||
        !(media->look = karst_program_kernel(media->marching, "media_ask", error)) ||
        !(media->sun = karst_program_kernel(media->marching, "media_sun", error)))
        return false;
    if (media->config.has_paths)
        return karst_media_build_paths(media, segments, error);
    return karst_media_build_light(media, segments, error) &&
           (!karst_media_has_fluence(media) || (media->fluence = karst_fluence_create(media, error)));
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
    const bool keeps = config->look.source != NULL, has_grids = keeps && !config->has_paths,
               has_groups = has_grids && config->groups > 1;
    media->view = karst_buffer_create(context, "view", sizeof(karst_cast_view), NULL, error);
    media->asked = karst_buffer_create(context, "view", sizeof(uint32_t), NULL, error);
    media->counters =
        karst_buffer_create(context, "counters", KARST_MEDIA_COUNTERS * sizeof(uint32_t), NULL, error);
    media->grids = karst_buffer_create_blank(
        context, "sun depth", has_grids ? num_slots * KARST_SUN_DEPTH_PLACES * sizeof(uint32_t) : sizeof(uint32_t),
        error);
    media->states =
        karst_buffer_create(context, "sun depth", (has_grids ? num_slots : 1) * sizeof(karst_sun_depth), NULL, error);
    media->used = karst_buffer_create(context, "sun depth", (keeps ? num_slots : 1) * sizeof(uint32_t), NULL, error);
    media->looks =
        karst_buffer_create(context, "sun depth", (has_groups ? num_slots : 1) * sizeof(uint32_t), NULL, error);
    media->chosen =
        karst_buffer_create(context, "sun depth", (has_groups ? num_slots : 1) * sizeof(uint32_t), NULL, error);
    if (media->land.brick_bits != media->air.brick_bits)
        karst_fail(error, KARST_USAGE, "land and air have samples of different width");
    else if (media->view && media->asked && media->counters && media->grids && media->states &&
             media->used && media->looks && media->chosen && build(media, error))
        return media;
    karst_media_destroy(media);
    return NULL;
}

void karst_media_destroy(karst_media *media)
{
    if (!media)
        return;
    cl_kernel kernels[] = {media->rays, media->look, media->sun, media->pixels, media->stream,
                           media->add_lamps, media->meet, media->turn, media->dim};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(media->marching);
    karst_program_destroy(media->lighting);
    karst_buffer *buffers[] = {media->view, media->asked, media->counters,
                               media->grids, media->states, media->used, media->looks, media->chosen,
                               media->lamps};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        karst_buffer_destroy(buffers[i]);
    karst_fluence_destroy(media->fluence);
    free(media);
}

bool karst_media_find_fluence(karst_media *media, const karst_media_picture *picture, karst_error *error)
{
    return !media->fluence || karst_fluence_advance(media->fluence, picture, error);
}

bool karst_media_depths(karst_media *media, const karst_cast_view *view, const karst_buffer *rays, uint32_t num_rays,
                        float metres, karst_buffer *depths, uint32_t *num_missing, karst_error *error)
{
    const karst_media_task task = karst_media_task_of(media, metres, view->detail, NO_END);
    const size_t lanes = (size_t)media->context->lanes;
    uint32_t made;
    *num_missing = 0;
    if (num_rays == 0)
        return true;
    if (rays->size_bytes / sizeof(karst_ray) < num_rays || depths->size_bytes / sizeof(float) < num_rays)
        return karst_fail(error, KARST_FAILED, "there is no room for %u rays", num_rays);
    return karst_media_send_view(media, view, error) &&
           KARST_ARGUMENTS(media->rays, error, POOL_ARGUMENTS(media->air, media->asked), KARST_BUFFER_ARG(media->view),
                           KARST_VALUE_ARG(task), KARST_BUFFER_ARG(rays), KARST_VALUE_ARG(num_rays),
                           KARST_BUFFER_ARG(depths), KARST_BUFFER_ARG(media->counters)) &&
           karst_launch(media->context, media->rays, KARST_STAGE_MEDIA, (num_rays + lanes - 1) / lanes, 1, error) &&
           karst_media_take_counts(media, num_missing, &made, error);
}

bool karst_media_dim(karst_media *media, const karst_media_picture *picture, karst_buffer *rays,
                     const karst_buffer *count, uint32_t max_rays, karst_error *error)
{
    const karst_media_task task = karst_media_task_of(media, picture->metres, picture->view->detail * picture->detail,
                                                      2 * KARST_MEDIA_MOST_DEPTH);
    const size_t lanes = (size_t)media->context->lanes, local_size = lanes == 1 ? GPU_LOCAL_SIZE : 1,
                 num_items = (max_rays + lanes - 1) / lanes;
    if (num_items == 0)
        return true;
    return karst_media_send_view(media, picture->view, error) &&
           KARST_ARGUMENTS(media->dim, error, POOL_ARGUMENTS(media->air, media->asked), KARST_BUFFER_ARG(media->view),
                           KARST_VALUE_ARG(task), KARST_BUFFER_ARG(rays), KARST_BUFFER_ARG(count),
                           KARST_BUFFER_ARG(media->counters)) &&
           karst_launch(media->context, media->dim, KARST_STAGE_MEDIA,
                        (num_items + local_size - 1) / local_size * local_size, local_size, error);
}

bool karst_media_look(karst_media *media, const karst_media_picture *picture, karst_error *error)
{
    const karst_media_task task = karst_media_task_of(media, picture->metres, picture->view->detail * picture->detail,
                                                      KARST_MEDIA_MOST_DEPTH);
    return karst_media_send_view(media, picture->view, error) &&
           KARST_ARGUMENTS(media->look, error, POOL_ARGUMENTS(media->air, media->asked), KARST_BUFFER_ARG(media->view),
                           KARST_VALUE_ARG(task), KARST_VALUE_ARG(*picture->pinhole),
                           KARST_BUFFER_ARG(picture->hits), KARST_BUFFER_ARG(media->used)) &&
           karst_media_launch_picture(media, media->look, picture->pinhole, KARST_MEDIA_BEAM, error);
}

bool karst_media_survey_sun(karst_media *media, const karst_media_picture *picture, karst_error *error)
{
    const karst_light *light = picture->light;
    if (media->config.mode == KARST_MEDIA_BASIC)
        return true;
    karst_media_aim(media, light->sun_direction);
    const karst_media_task task = karst_media_task_of(media, picture->metres, 1, NO_END);
    const karst_shade_anchor at = karst_media_anchor(picture->anchor);
    const uint32_t num_slots = media->air.num_bricks + KARST_CACHE_ROOT_BRICKS,
                   with_land = media->config.land && media->config.mode == KARST_MEDIA_FULL;
    const bool chooses = media->config.groups > 1 && !picture->makes_all;
    const karst_buffer *used = chooses ? media->chosen : media->used;
    const cl_float4 to_sun = {{light->sun_direction[0], light->sun_direction[1], light->sun_direction[2], 0}};
    return karst_media_send_view(media, picture->view, error) &&
           (!chooses || karst_media_choose(media, picture->view->serial, error)) &&
           KARST_ARGUMENTS(media->sun, error, POOL_ARGUMENTS(media->air, media->asked),
                           POOL_ARGUMENTS(media->land, media->asked), KARST_BUFFER_ARG(media->view),
                           KARST_VALUE_ARG(task), KARST_VALUE_ARG(at), KARST_VALUE_ARG(to_sun),
                           KARST_VALUE_ARG(light->shadow_distance), KARST_VALUE_ARG(num_slots),
                           KARST_VALUE_ARG(with_land), KARST_BUFFER_ARG(used),
                           KARST_BUFFER_ARG(media->air.brick_owner),
                           KARST_BUFFER_ARG(media->grids), KARST_BUFFER_ARG(media->states),
                           KARST_BUFFER_ARG(media->counters)) &&
           karst_launch(media->context, media->sun, KARST_STAGE_SUN_DEPTH, num_slots, 1, error);
}

bool karst_media_take_counts(karst_media *media, uint32_t *num_lacking, uint32_t *num_made, karst_error *error)
{
    uint32_t counts[KARST_MEDIA_COUNTERS];
    if (!karst_buffer_read(media->counters, 0, counts, sizeof counts, error))
        return false;
    *num_lacking = counts[KARST_MEDIA_LACKING] + (media->fluence && karst_fluence_lacks(media->fluence) ? 1u : 0u);
    *num_made = counts[KARST_MEDIA_MADE];
    return karst_buffer_fill(media->counters, 0, 0, sizeof counts, error);
}

void karst_media_age(karst_media *media)
{
    if (media->sun_number && ++media->sun_number == 0)
        media->sun_number = 1;
    if (media->fluence)
        karst_fluence_change(media->fluence, false);
}

bool karst_media_forget(karst_media *media, karst_error *error)
{
    if (media->fluence)
        karst_fluence_change(media->fluence, true);
    return karst_buffer_fill(media->states, 0, 0, media->states->size_bytes, error);
}
