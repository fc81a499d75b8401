/* Launching the kernels of media for paths (raycast/light/path_media.h). */
#include <stdio.h>

#include "raycast/media/media_internal.h"

#define GPU_LOCAL_SIZE 64

bool karst_media_build_paths(karst_media *media, uint32_t segments, karst_error *error)
{
    const karst_shade_colour *look = &media->config.look;
    const karst_virtual_file world = {"world.clh", look->source};
    char options[1024];
    snprintf(options, sizeof options,
             "-DSEGMENTS=%u -DCAST_NO_BEAM %s -DMEDIA_MODE=%u -DMEDIA_TRACKS -DMEDIA_STREAMS -DMEDIA_ONCE%s%s %s",
             segments, karst_cache_brick_option(&media->air), KARST_MEDIA_FULL,
             media->config.has_atmosphere ? " -DSHADE_ATMOSPHERE" : "", media->config.glows ? " -DMEDIA_GLOWS" : "",
             look->options);
    media->lighting = karst_program_build(media->context, "raycast/media/media_paths.cl", options, &world, 1, error);
    return media->lighting && (media->meet = karst_program_kernel(media->lighting, "media_meet", error)) &&
           (media->turn = karst_program_kernel(media->lighting, "media_turn", error));
}

static bool launch(karst_media *media, cl_kernel kernel, uint32_t max_rays, karst_error *error)
{
    const size_t lanes = (size_t)media->context->lanes, local_size = lanes == 1 ? GPU_LOCAL_SIZE : 1,
                 num_items = (max_rays + lanes - 1) / lanes;
    return karst_launch(media->context, kernel, KARST_STAGE_MEDIA,
                        (num_items + local_size - 1) / local_size * local_size, local_size, error);
}

bool karst_media_meet_paths(karst_media *media, const karst_media_picture *picture,
                            const karst_path_media_stream *stream, karst_error *error)
{
    static const karst_sky night;
    const karst_media_task task = karst_media_task_of(media, picture->metres, picture->view->detail * picture->detail,
                                                      KARST_MEDIA_MOST_DEPTH);
    const karst_shade_anchor at = karst_media_anchor(picture->anchor);
    const cl_mem over_hits = stream->over_hits ? stream->over_hits->mem : NULL,
                 ways = stream->ways ? stream->ways->mem : NULL,
                 table = picture->skies ? karst_skies_buffer(picture->skies)->mem : NULL;
    const karst_sky *sky = picture->skies ? karst_skies_sky(picture->skies) : &night;
    if (!media->meet || !stream->max_rays)
        return true;
    const karst_argument arguments[] = {POOL_ARGUMENTS(media->air, media->asked),
                                        KARST_BUFFER_ARG(media->view),
                                        KARST_VALUE_ARG(task),
                                        KARST_VALUE_ARG(*picture->pinhole),
                                        KARST_VALUE_ARG(*picture->light),
                                        KARST_VALUE_ARG(stream->task),
                                        KARST_BUFFER_ARG(stream->rays),
                                        KARST_BUFFER_ARG(stream->count),
                                        KARST_BUFFER_ARG(stream->hits),
                                        KARST_VALUE_ARG(over_hits),
                                        KARST_VALUE_ARG(ways),
                                        KARST_BUFFER_ARG(stream->collisions),
                                        KARST_BUFFER_ARG(stream->parts),
                                        KARST_VALUE_ARG(at),
                                        KARST_BUFFER_ARG(media->counters),
                                        KARST_VALUE_ARG(media->data),
                                        /* of an atmosphere alone */
                                        KARST_VALUE_ARG(*sky),
                                        KARST_VALUE_ARG(table)};
    const size_t num = sizeof arguments / sizeof *arguments - (media->config.has_atmosphere ? 0 : 2);
    return karst_media_send_view(media, picture->view, error) &&
           karst_arguments(media->meet, arguments, num, error) &&
           launch(media, media->meet, stream->max_rays, error);
}

bool karst_media_turn_paths(karst_media *media, const karst_media_picture *picture,
                            const karst_path_media_stream *stream, karst_error *error)
{
    const karst_media_task task = karst_media_task_of(media, picture->metres, picture->view->detail * picture->detail,
                                                      KARST_MEDIA_MOST_DEPTH);
    const karst_shade_anchor at = karst_media_anchor(picture->anchor);
    if (!media->turn || !stream->max_rays)
        return true;
    return karst_media_send_view(media, picture->view, error) &&
           KARST_ARGUMENTS(media->turn, error, POOL_ARGUMENTS(media->air, media->asked), KARST_BUFFER_ARG(media->view),
                           KARST_VALUE_ARG(task), KARST_VALUE_ARG(*picture->pinhole), KARST_VALUE_ARG(*picture->light),
                           KARST_VALUE_ARG(stream->task), KARST_BUFFER_ARG(stream->rays),
                           KARST_BUFFER_ARG(stream->count), KARST_BUFFER_ARG(stream->collisions),
                           KARST_BUFFER_ARG(stream->lamps), KARST_BUFFER_ARG(stream->next),
                           KARST_BUFFER_ARG(stream->to_lamps), KARST_VALUE_ARG(at), KARST_BUFFER_ARG(media->counters),
                           KARST_VALUE_ARG(media->data)) &&
           launch(media, media->turn, stream->max_rays, error);
}
