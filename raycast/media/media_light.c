/* Launching the kernel that lays media before a picture. */
#include <stdio.h>
#include <string.h>

#include "raycast/media/fluence.h"

#define GPU_LOCAL_SIZE 64
#define MOST_ARGUMENTS 80

bool karst_media_build_light(karst_media *media, uint32_t segments, karst_error *error)
{
    const karst_shade_colour *look = &media->config.look;
    char options[1024];
    const char *scattering = media->config.scattering == KARST_SCATTERING_PATHS ? " -DMEDIA_PATHS"
                             : !karst_media_scatters_once(media)                  ? ""
                             : !karst_media_has_fluence(media)                    ? " -DMEDIA_ONCE"
                             : media->config.has_phase ? " -DMEDIA_ONCE -DMEDIA_FLUENCE -DMEDIA_FLUENCE_PHASE"
                                                       : " -DMEDIA_ONCE -DMEDIA_FLUENCE";
    if (!look->source)
        return true;
    const karst_virtual_file world = {"world.clh", look->source};
    snprintf(options, sizeof options, "-DSEGMENTS=%u -DCAST_NO_BEAM %s -DMEDIA_MODE=%u %s%s%s%s%s%s%s%s %s", segments,
             karst_cache_brick_option(&media->air), media->config.mode,
             media->config.has_atmosphere ? "-DSHADE_ATMOSPHERE" : "", media->config.is_alone ? " -DMEDIA_ALONE" : "",
             media->config.has_streams ? " -DMEDIA_STREAMS" : "", media->config.glows ? " -DMEDIA_GLOWS" : "",
             media->config.has_lamps ? " -DMEDIA_LAMPS" : "",
             media->config.groups > 1 ? " -DMEDIA_GROUPS" : "", media->config.passes ? " -DMEDIA_PASSES" : "",
             scattering, look->options);
    media->lighting = karst_program_build(media->context, "raycast/media/media_light.cl", options, &world, 1, error);
    return media->lighting && (media->pixels = karst_program_kernel(media->lighting, "media_pixels", error)) &&
           (!media->config.has_lamps ||
            ((media->add_lamps = karst_program_kernel(media->lighting, "media_lamps", error)) &&
             (media->lamps = karst_buffer_create(media->context, "stream", KARST_MOST_LAMPS * sizeof(karst_lamp), NULL,
                                                 error)))) &&
           (!media->config.has_streams ||
            (media->stream = karst_program_kernel(media->lighting, "media_stream", error)));
}

/* What all of a kernel's arguments end with: those of what is scattered often, of clear matter, of an atmosphere, of
 * land. */
typedef struct {
    const karst_sky *sky;
    cl_mem table, over_hits;
    cl_float4 absorption;
    karst_fluence_boxes boxes;
    cl_mem words;
    cl_uint with_land; /* of paths */
} light_arguments;

static light_arguments arguments_of(const karst_media *media, const karst_media_picture *picture)
{
    static const karst_sky night;
    const float *a = picture->absorption;
    light_arguments more = {.sky = picture->skies ? karst_skies_sky(picture->skies) : &night,
                            .table = picture->skies ? karst_skies_buffer(picture->skies)->mem : NULL,
                            .over_hits = picture->over_hits ? picture->over_hits->mem : NULL,
                            .absorption = {{a[0], a[1], a[2], 0}},
                            .with_land = media->config.land && media->config.mode == KARST_MEDIA_FULL};
    if (media->fluence) {
        more.boxes = karst_fluence_boxes_from(media->fluence, picture->anchor);
        more.words = karst_fluence_words(media->fluence)->mem;
    }
    return more;
}

/* Behind what kernels of light always take, which an empty argument ends: what these media's take besides. `more` has
 * to outlive the arguments. Returns how many there are. */
static size_t add_rest(const karst_media *media, const light_arguments *more, bool with_clear,
                       karst_argument *arguments)
{
    const struct {
        bool is_there;
        karst_argument of[2];
    } rest[] = {{media->fluence != NULL, {KARST_VALUE_ARG(more->boxes), KARST_VALUE_ARG(more->words)}},
                {with_clear, {KARST_VALUE_ARG(more->over_hits), KARST_VALUE_ARG(more->absorption)}},
                {media->config.has_atmosphere, {KARST_VALUE_ARG(*more->sky), KARST_VALUE_ARG(more->table)}}};
    size_t num = 0;
    while (arguments[num].size_bytes)
        num++;
    for (size_t i = 0; i < sizeof rest / sizeof *rest; i++)
        for (size_t k = 0; rest[i].is_there && k < 2; k++)
            arguments[num++] = rest[i].of[k];
    if (media->config.scattering == KARST_SCATTERING_PATHS) {
        const karst_argument land[] = {KARST_VALUE_ARG(more->with_land), POOL_ARGUMENTS(media->land, media->asked)};
        memcpy(arguments + num, land, sizeof land);
        num += sizeof land / sizeof *land;
    }
    return num;
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
    const light_arguments more = arguments_of(media, picture);
    karst_argument arguments[MOST_ARGUMENTS] = {POOL_ARGUMENTS(media->air, media->asked),
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
                                    KARST_VALUE_ARG(media->data)};
    const size_t num = add_rest(media, &more, media->config.has_streams, arguments);
    return karst_media_send_view(media, picture->view, error) &&
           karst_arguments(media->pixels, arguments, num, error) &&
           karst_media_launch_picture(media, media->pixels, picture->pinhole, KARST_MEDIA_BEAM, error);
}

bool karst_media_add_lamps(karst_media *media, const karst_media_picture *picture, const karst_lamp *lamps,
                           uint32_t num, karst_error *error)
{
    const karst_media_task task = karst_media_task_of(media, picture->metres, picture->view->detail * picture->detail,
                                                      KARST_MEDIA_MOST_DEPTH);
    const karst_shade_anchor at = karst_media_anchor(picture->anchor);
    const light_arguments more = arguments_of(media, picture);
    const cl_uint with_land = media->config.land != NULL;
    if (!media->add_lamps || num == 0)
        return true;
    const karst_argument arguments[] = {POOL_ARGUMENTS(media->air, media->asked),
                                        POOL_ARGUMENTS(media->land, media->asked),
                                        KARST_BUFFER_ARG(media->view),
                                        KARST_VALUE_ARG(task),
                                        KARST_VALUE_ARG(*picture->pinhole),
                                        KARST_VALUE_ARG(*picture->light),
                                        KARST_BUFFER_ARG(picture->hits),
                                        KARST_VALUE_ARG(more.over_hits),
                                        KARST_BUFFER_ARG(media->lamps),
                                        KARST_VALUE_ARG(num),
                                        KARST_VALUE_ARG(with_land),
                                        KARST_BUFFER_ARG(picture->parts),
                                        KARST_VALUE_ARG(at),
                                        KARST_BUFFER_ARG(media->counters),
                                        KARST_VALUE_ARG(media->data),
                                        /* of an atmosphere alone */
                                        KARST_VALUE_ARG(*more.sky),
                                        KARST_VALUE_ARG(more.table)};
    const size_t num_arguments = sizeof arguments / sizeof *arguments - (media->config.has_atmosphere ? 0 : 2);
    return karst_media_send_view(media, picture->view, error) &&
           karst_buffer_write(media->lamps, 0, lamps, num * sizeof *lamps, error) &&
           karst_arguments(media->add_lamps, arguments, num_arguments, error) &&
           karst_media_launch_picture(media, media->add_lamps, picture->pinhole, 1, error);
}

bool karst_media_stream_rays(karst_media *media, const karst_media_picture *picture, const karst_media_stream *stream,
                             karst_error *error)
{
    const karst_media_task task = karst_media_task_of(media, picture->metres, picture->view->detail * picture->detail,
                                                      KARST_MEDIA_MOST_DEPTH);
    const karst_shade_anchor at = karst_media_anchor(picture->anchor);
    const light_arguments more = arguments_of(media, picture);
    const cl_uint adds = stream->adds;
    const cl_mem over_hits = stream->over_hits ? stream->over_hits->mem : NULL,
                 ways = stream->ways ? stream->ways->mem : NULL;
    const size_t lanes = (size_t)media->context->lanes, local_size = lanes == 1 ? GPU_LOCAL_SIZE : 1,
                 num_items = (stream->max_rays + lanes - 1) / lanes;
    if (!media->stream || num_items == 0)
        return true;
    karst_argument arguments[MOST_ARGUMENTS] = {POOL_ARGUMENTS(media->air, media->asked),
                                    KARST_BUFFER_ARG(media->view),
                                    KARST_VALUE_ARG(task),
                                    KARST_VALUE_ARG(*picture->pinhole),
                                    KARST_VALUE_ARG(*picture->light),
                                    KARST_BUFFER_ARG(stream->rays),
                                    KARST_BUFFER_ARG(stream->count),
                                    KARST_BUFFER_ARG(stream->hits),
                                    KARST_VALUE_ARG(over_hits),
                                    KARST_VALUE_ARG(ways),
                                    KARST_BUFFER_ARG(picture->parts),
                                    KARST_VALUE_ARG(adds),
                                    KARST_VALUE_ARG(at),
                                    KARST_BUFFER_ARG(media->grids),
                                    KARST_BUFFER_ARG(media->states),
                                    KARST_BUFFER_ARG(media->air.brick_owner),
                                    KARST_BUFFER_ARG(media->used),
                                    KARST_BUFFER_ARG(media->looks),
                                    KARST_BUFFER_ARG(media->counters),
                                    KARST_VALUE_ARG(media->data)};
    const size_t num = add_rest(media, &more, false, arguments);
    return karst_media_send_view(media, picture->view, error) &&
           karst_arguments(media->stream, arguments, num, error) &&
           karst_launch(media->context, media->stream, KARST_STAGE_MEDIA,
                        (num_items + local_size - 1) / local_size * local_size, local_size, error);
}
