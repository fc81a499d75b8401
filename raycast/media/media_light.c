/* Launching the kernel that lays media before a picture. */
#include <stdio.h>

#include "raycast/media/media_internal.h"

bool karst_media_build_light(karst_media *media, uint32_t segments, karst_error *error)
{
    const karst_shade_colour *look = &media->config.look;
    char options[1024];
    const char *scattering = media->config.scattering == KARST_SCATTERING_ONCE    ? " -DMEDIA_ONCE"
                             : media->config.scattering == KARST_SCATTERING_PATHS ? " -DMEDIA_PATHS"
                                                                                  : "";
    if (!look->source)
        return true;
    const karst_virtual_file world = {"world.clh", look->source};
    snprintf(options, sizeof options, "-DSEGMENTS=%u -DCAST_NO_BEAM %s -DMEDIA_MODE=%u %s%s%s %s", segments,
             karst_cache_brick_option(&media->air), media->config.mode,
             media->config.has_atmosphere ? "-DSHADE_ATMOSPHERE" : "",
             media->config.groups > 1 ? " -DMEDIA_GROUPS" : "", scattering, look->options);
    media->lighting = karst_program_build(media->context, "raycast/media/media_light.cl", options, &world, 1, error);
    return media->lighting && (media->pixels = karst_program_kernel(media->lighting, "media_pixels", error));
}

bool karst_media_pixels(karst_media *media, const karst_media_picture *picture, karst_error *error)
{
    if (!media->pixels)
        return karst_fail(error, KARST_FAILED, "these media were made for depths alone");
    karst_media_aim(media, picture->light->sun_direction);
    const karst_media_task task = karst_media_task_of(media, picture->metres, picture->view->detail * picture->detail,
                                                      KARST_MEDIA_MOST_DEPTH);
    const karst_shade_anchor at = karst_media_anchor(picture->anchor);
    const cl_uint sun = picture->has_sun, mirror = picture->has_mirror;
    static const karst_sky night;
    const karst_sky *sky = picture->skies ? karst_skies_sky(picture->skies) : &night;
    const cl_mem table = picture->skies ? karst_skies_buffer(picture->skies)->mem : NULL;
    const karst_argument arguments[] = {POOL_ARGUMENTS(media->air, media->asked),
                                        KARST_BUFFER_ARG(media->view),
                                        KARST_VALUE_ARG(task),
                                        KARST_VALUE_ARG(*picture->pinhole),
                                        KARST_VALUE_ARG(*picture->light),
                                        KARST_BUFFER_ARG(picture->hits),
                                        KARST_BUFFER_ARG(picture->parts),
                                        KARST_VALUE_ARG(sun),
                                        KARST_VALUE_ARG(mirror),
                                        KARST_VALUE_ARG(at),
                                        KARST_BUFFER_ARG(media->grids),
                                        KARST_BUFFER_ARG(media->states),
                                        KARST_BUFFER_ARG(media->air.brick_owner),
                                        KARST_BUFFER_ARG(media->used),
                                        KARST_BUFFER_ARG(media->looks),
                                        KARST_BUFFER_ARG(media->counters),
                                        KARST_VALUE_ARG(media->data),
                                        /* of an atmosphere alone */
                                        KARST_VALUE_ARG(*sky),
                                        KARST_VALUE_ARG(table)};
    const size_t num_arguments = sizeof arguments / sizeof *arguments - (media->config.has_atmosphere ? 0 : 2);
    return karst_media_send_view(media, picture->view, error) &&
           karst_arguments(media->pixels, arguments, num_arguments, error) &&
           karst_media_launch_picture(media, media->pixels, picture->pinhole, KARST_STAGE_MEDIA, error);
}

