/* What the launches of media have in common. */
#include <string.h>

#include "raycast/media/media_internal.h"

bool karst_media_has_fluence(const karst_media *media)
{
    const karst_media_config *c = &media->config;
    return c->scattering == KARST_SCATTERING_FLUENCE && c->mode != KARST_MEDIA_BASIC && c->look.source && !c->has_paths;
}

bool karst_media_scatters_once(const karst_media *media)
{
    return media->config.scattering == KARST_SCATTERING_ONCE || media->config.scattering == KARST_SCATTERING_FLUENCE;
}

/* The view stays as it is until the queue has read it: a picture's casts have one. */
bool karst_media_send_view(karst_media *media, const karst_cast_view *view, karst_error *error)
{
    if (!memcmp(&media->sent, view, sizeof *view))
        return true;
    if (!karst_finish(media->context, error))
        return false;
    media->sent = *view;
    return karst_buffer_write(media->view, 0, &media->sent, sizeof media->sent, error);
}

karst_media_task karst_media_task_of(const karst_media *media, float metres, float detail, float most_depth)
{
    return (karst_media_task){
        .metres = metres, .detail = detail, .most_depth = most_depth, .sun = media->sun_number};
}

karst_shade_anchor karst_media_anchor(const karst_position *position)
{
    karst_shade_anchor anchor = {.pad = 0};
    memcpy(anchor.voxel, position->voxel, sizeof anchor.voxel);
    memcpy(anchor.fraction, position->fraction, sizeof anchor.fraction);
    return anchor;
}

void karst_media_aim(karst_media *media, const float direction[3])
{
    if (media->sun_number && !memcmp(media->direction, direction, sizeof media->direction))
        return;
    memcpy(media->direction, direction, sizeof media->direction);
    if (++media->sun_number == 0)
        media->sun_number = 1;
}

bool karst_media_launch_picture(karst_media *media, cl_kernel kernel, const karst_pinhole *pinhole, uint32_t beam,
                                karst_error *error)
{
    const size_t across = ((size_t)pinhole->width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                 down = ((size_t)pinhole->height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                 num_rays = across * down * KARST_GROUP_PACKETS * KARST_PACKET_RAYS,
                 num_items = media->context->lanes == 1 ? num_rays : num_rays / KARST_PACKET_RAYS / beam,
                 local_size = media->context->lanes == 1 ? KARST_PACKET_RAYS * KARST_GROUP_PACKETS : 1;
    return karst_launch(media->context, kernel, KARST_STAGE_MEDIA, num_items, local_size, error);
}
