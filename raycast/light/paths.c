/* Following paths: launching their kernels, generation by generation. */
#include "raycast/light/paths.h"

#include <stdlib.h>

#include "raycast/light/radiance_shared.h"

#define BLOCK_RAYS 256u /* as in paths.cl */
#define GPU_LOCAL_SIZE 64
#define PADDING_RAYS (KARST_PACKET_RAYS * KARST_BEAM_PACKETS)
/* Generations that are enqueued before it is looked whether any rays are left. */
#define BLIND_BOUNCES 4u

struct karst_paths {
    karst_context *context;
    karst_program *program;
    cl_kernel begin, add, hide, count, scan, pack;
    uint32_t room, num_blocks, num_lamps; /* room: rays */
    bool has_shadow[KARST_MOST_LAMPS];
    karst_buffer *rays, *next, *to_lamps, *hits, *counts, *lamps;
    karst_buffer *total[2]; /* rays in the stream, and in the next one, by turns */
};

karst_paths *karst_paths_create(karst_context *context, karst_error *error)
{
    karst_paths *paths = calloc(1, sizeof *paths);
    if (!paths) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    paths->context = context;
    paths->lamps = karst_buffer_create(context, "stream", KARST_MOST_LAMPS * sizeof(karst_lamp), NULL, error);
    for (int i = 0; i < 2 && paths->lamps; i++)
        paths->total[i] = karst_buffer_create(context, "stream", sizeof(uint32_t), NULL, error);
    if (paths->total[0] && paths->total[1])
        paths->program = karst_program_build(context, "raycast/light/paths.cl", "", NULL, 0, error);
    if (paths->program) {
        paths->begin = karst_program_kernel(paths->program, "paths_begin", error);
        paths->add = karst_program_kernel(paths->program, "paths_add", error);
        paths->hide = karst_program_kernel(paths->program, "paths_hide", error);
        paths->count = karst_program_kernel(paths->program, "paths_count", error);
        paths->scan = karst_program_kernel(paths->program, "paths_scan", error);
        paths->pack = karst_program_kernel(paths->program, "paths_pack", error);
    }
    if (!paths->begin || !paths->add || !paths->hide || !paths->count || !paths->scan || !paths->pack) {
        karst_paths_destroy(paths);
        return NULL;
    }
    return paths;
}

static void free_room(karst_paths *paths)
{
    karst_buffer **buffers[] = {&paths->rays, &paths->next, &paths->to_lamps, &paths->hits, &paths->counts};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        karst_buffer_destroy(*buffers[i]);
        *buffers[i] = NULL;
    }
}

void karst_paths_destroy(karst_paths *paths)
{
    if (!paths)
        return;
    cl_kernel kernels[] = {paths->begin, paths->add, paths->hide, paths->count, paths->scan, paths->pack};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(paths->program);
    free_room(paths);
    karst_buffer_destroy(paths->lamps);
    karst_buffer_destroy(paths->total[0]);
    karst_buffer_destroy(paths->total[1]);
    free(paths);
}

static size_t padded(size_t num_pixels) { return (num_pixels + PADDING_RAYS - 1) / PADDING_RAYS * PADDING_RAYS; }

double karst_paths_bytes(size_t num_pixels)
{
    return (double)padded(num_pixels) * (3 * sizeof(karst_ray) + sizeof(karst_hit));
}

bool karst_paths_set_room(karst_paths *paths, size_t num_pixels, karst_error *error)
{
    free_room(paths);
    paths->room = (uint32_t)padded(num_pixels);
    paths->num_blocks = paths->room / BLOCK_RAYS;
    karst_context *context = paths->context;
    paths->rays = karst_buffer_create_blank(context, "stream", paths->room * sizeof(karst_ray), error);
    paths->next = karst_buffer_create_blank(context, "stream", paths->room * sizeof(karst_ray), error);
    paths->to_lamps = karst_buffer_create_blank(context, "stream", paths->room * sizeof(karst_ray), error);
    paths->hits = karst_buffer_create_blank(context, "stream", paths->room * sizeof(karst_hit), error);
    paths->counts = karst_buffer_create_blank(context, "stream", paths->num_blocks * sizeof(uint32_t), error);
    return paths->rays && paths->next && paths->to_lamps && paths->hits && paths->counts;
}

bool karst_paths_set_lamps(karst_paths *paths, const karst_lamp *lamps, uint32_t num, karst_error *error)
{
    if (num > KARST_MOST_LAMPS)
        return karst_fail(error, KARST_FAILED, "%u lamps: %d is the limit", num, KARST_MOST_LAMPS);
    paths->num_lamps = num;
    for (uint32_t i = 0; i < num; i++)
        paths->has_shadow[i] = lamps[i].shadow;
    return !num || karst_buffer_write(paths->lamps, 0, lamps, num * sizeof *lamps, error);
}

static bool begin(karst_paths *paths, const karst_path_picture *picture, bool keeps_parts, karst_error *error)
{
    const cl_uint keep = keeps_parts;
    const karst_pinhole *pinhole = picture->pinhole;
    const size_t across = ((size_t)pinhole->width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                 down = ((size_t)pinhole->height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                 local_size = KARST_PACKET_RAYS * KARST_GROUP_PACKETS / (size_t)paths->context->lanes;
    return KARST_ARGUMENTS(paths->begin, error, KARST_VALUE_ARG(*pinhole), KARST_BUFFER_ARG(paths->rays),
                           KARST_BUFFER_ARG(picture->parts), KARST_VALUE_ARG(keep),
                           KARST_BUFFER_ARG(paths->total[0])) &&
           karst_launch(paths->context, paths->begin, KARST_STAGE_SHADE, across * down * local_size, local_size, error);
}

/* Rays of `num` at most, as many as the word says: LANES for each work-item. */
static bool launch_rays(const karst_paths *paths, cl_kernel kernel, size_t num, karst_error *error)
{
    const size_t lanes = (size_t)paths->context->lanes, local_size = lanes == 1 ? GPU_LOCAL_SIZE : 16;
    const size_t items = (num + lanes - 1) / lanes;
    return karst_launch(paths->context, kernel, KARST_STAGE_SHADE, (items + local_size - 1) / local_size * local_size,
                        local_size, error);
}

/* Rays to lamps that clear matter hides are idle from now on. */
static bool hide_lamps(karst_paths *paths, const karst_path_picture *picture, const karst_buffer *count, uint32_t num,
                       karst_error *error)
{
    karst_buffer *hits = picture->again ? NULL : paths->hits;
    return karst_cast_stream(picture->over, picture->view, paths->to_lamps, num, count, hits, error) &&
           (!hits || (KARST_ARGUMENTS(paths->hide, error, KARST_BUFFER_ARG(paths->to_lamps), KARST_BUFFER_ARG(count),
                                      KARST_BUFFER_ARG(hits)) &&
                      karst_launch(paths->context, paths->hide, KARST_STAGE_SHADE, num, GPU_LOCAL_SIZE, error)));
}

/* The light of lamps that the generation's rays to them reach; without `shadows` all do. */
static bool add_lamps(karst_paths *paths, const karst_path_picture *picture, const karst_buffer *count, uint32_t num,
                      bool shadows, karst_error *error)
{
    const cl_mem hits = shadows ? paths->hits->mem : NULL;
    const int width_px = picture->pinhole->width_px, height_px = picture->pinhole->height_px;
    karst_profile_set_stream(paths->context, KARST_STREAM_SHADOW);
    const bool cast = !shadows || ((!picture->over || hide_lamps(paths, picture, count, num, error)) &&
                                   karst_cast_stream(picture->caster, picture->view, paths->to_lamps, num, count,
                                                     picture->again ? NULL : paths->hits, error));
    karst_profile_set_stream(paths->context, KARST_NUM_STREAMS);
    if (!cast || picture->again)
        return cast;
    return KARST_ARGUMENTS(paths->add, error, KARST_VALUE_ARG(width_px), KARST_VALUE_ARG(height_px),
                           KARST_BUFFER_ARG(paths->to_lamps), KARST_BUFFER_ARG(count), KARST_VALUE_ARG(hits),
                           KARST_BUFFER_ARG(picture->parts)) &&
           launch_rays(paths, paths->add, num, error);
}

/* From the rays that leave surfaces to the next stream. */
static bool pack(karst_paths *paths, const karst_path_picture *picture, const karst_buffer *count,
                 const karst_buffer *next_count, uint32_t num, karst_error *error)
{
    const cl_uint again = picture->again;
    karst_context *context = paths->context;
    const cl_uint blocks = (num + BLOCK_RAYS - 1) / BLOCK_RAYS;
    const size_t local_size = context->lanes == 1 ? GPU_LOCAL_SIZE : 1;
    const size_t items = (blocks + local_size - 1) / local_size * local_size;
    return KARST_ARGUMENTS(paths->count, error, KARST_BUFFER_ARG(paths->next), KARST_BUFFER_ARG(count),
                           KARST_BUFFER_ARG(paths->counts), KARST_VALUE_ARG(blocks)) &&
           karst_launch(context, paths->count, KARST_STAGE_SHADE, items, local_size, error) &&
           KARST_ARGUMENTS(paths->scan, error, KARST_BUFFER_ARG(paths->counts), KARST_VALUE_ARG(blocks),
                           KARST_BUFFER_ARG(next_count), KARST_BUFFER_ARG(picture->counters), KARST_VALUE_ARG(again)) &&
           karst_launch(context, paths->scan, KARST_STAGE_SHADE, 1, 1, error) &&
           KARST_ARGUMENTS(paths->pack, error, KARST_BUFFER_ARG(paths->next), KARST_BUFFER_ARG(count),
                           KARST_BUFFER_ARG(paths->counts), KARST_VALUE_ARG(blocks), KARST_BUFFER_ARG(paths->rays)) &&
           karst_launch(context, paths->pack, KARST_STAGE_SHADE, items, local_size, error);
}

bool karst_paths_follow(karst_paths *paths, const karst_path_picture *picture, uint32_t max_bounces, karst_error *error)
{
    const uint32_t num_pixels = (uint32_t)picture->pinhole->width_px * (uint32_t)picture->pinhole->height_px;
    karst_path_task task = {.sample = picture->pinhole->sample ? picture->pinhole->sample : 1,
                            .num_lamps = paths->num_lamps,
                            .mirrors = picture->mirrors,
                            .again = picture->again,
                            .lamp = KARST_PATH_ALL_LIGHT};
    uint32_t left = num_pixels;
    if (num_pixels > paths->room)
        return karst_fail(error, KARST_FAILED, "there is no room for the paths of %u pixels", num_pixels);
    if (!begin(paths, picture, picture->again, error))
        return false;
    for (uint32_t bounce = 0; bounce <= max_bounces && left; bounce++) {
        const karst_buffer *count = paths->total[bounce % 2];
        karst_buffer *next_count = paths->total[(bounce + 1) % 2];
        const karst_path_streams streams = {.rays = paths->rays,
                                            .count = count,
                                            .hits = bounce ? paths->hits : picture->hits,
                                            .lamps = paths->lamps,
                                            .max_rays = left,
                                            .next = paths->next,
                                            .to_lamps = paths->to_lamps};
        task.bounce = bounce;
        task.is_last = bounce == max_bounces;
        if (bounce) {
            karst_profile_set_stream(paths->context, KARST_STREAM_MIRROR);
            const bool cast = karst_cast_stream(picture->caster, picture->view, paths->rays, left, count, paths->hits,
                                                error);
            karst_profile_set_stream(paths->context, KARST_NUM_STREAMS);
            if (!cast)
                return false;
        }
        if (!karst_shade_paths(picture->shader, picture->view, picture->pinhole, picture->light, &task, &streams,
                               picture->parts, picture->counters, error) ||
            (paths->num_lamps && !add_lamps(paths, picture, count, left, true, error)) ||
            (!task.is_last && !pack(paths, picture, count, next_count, left, error)) ||
            (bounce % BLIND_BOUNCES == BLIND_BOUNCES - 1 &&
             !karst_buffer_read(next_count, 0, &left, sizeof left, error)))
            return false;
    }
    return true;
}

bool karst_paths_add_lamps_of(karst_paths *paths, const karst_path_picture *picture, const karst_buffer *rays,
                              const karst_buffer *count, const karst_buffer *hits, karst_error *error)
{
    const uint32_t num_pixels = (uint32_t)picture->pinhole->width_px * (uint32_t)picture->pinhole->height_px;
    const karst_path_streams streams = {.rays = rays,
                                        .count = count,
                                        .hits = hits,
                                        .lamps = paths->lamps,
                                        .max_rays = num_pixels,
                                        .next = paths->next,
                                        .to_lamps = paths->to_lamps};
    karst_path_task task = {.is_last = 1,
                            .sample = picture->pinhole->sample,
                            .num_lamps = paths->num_lamps,
                            .mirrors = picture->mirrors,
                            .again = picture->again};
    if (num_pixels > paths->room)
        return karst_fail(error, KARST_FAILED, "there is no room for the light of %u pixels", num_pixels);
    for (task.lamp = 0; task.lamp < paths->num_lamps; task.lamp++)
        if (!karst_shade_paths(picture->shader, picture->view, picture->pinhole, picture->light, &task, &streams,
                               picture->parts, picture->counters, error) ||
            !add_lamps(paths, picture, count, num_pixels, paths->has_shadow[task.lamp], error))
            return false;
    return true;
}

bool karst_paths_add_lamps(karst_paths *paths, const karst_path_picture *picture, karst_error *error)
{
    return begin(paths, picture, true, error) &&
           karst_paths_add_lamps_of(paths, picture, paths->rays, paths->total[0], picture->hits, error);
}

bool karst_paths_look_along_normals(karst_paths *paths, const karst_path_picture *picture, const karst_buffer *rays,
                                    const karst_buffer *count, const karst_buffer *hits, karst_path_stream *stream,
                                    karst_error *error)
{
    const karst_lamp white = {.colour = {1, 1, 1}, .kind = KARST_LAMP_NORMAL};
    const uint32_t num_pixels = (uint32_t)picture->pinhole->width_px * (uint32_t)picture->pinhole->height_px;
    if (num_pixels > paths->room)
        return karst_fail(error, KARST_FAILED, "there is no room for the light of %u pixels", num_pixels);
    if (!karst_paths_set_lamps(paths, &white, 1, error) || (!rays && !begin(paths, picture, true, error)))
        return false;
    const karst_path_streams streams = {.rays = rays ? rays : paths->rays,
                                        .count = rays ? count : paths->total[0],
                                        .hits = hits,
                                        .lamps = paths->lamps,
                                        .max_rays = num_pixels,
                                        .next = paths->next,
                                        .to_lamps = paths->to_lamps};
    const karst_path_task task = {
        .is_last = 1, .sample = picture->pinhole->sample, .num_lamps = 1, .again = picture->again};
    *stream = (karst_path_stream){paths->to_lamps, streams.count, num_pixels};
    return karst_shade_paths(picture->shader, picture->view, picture->pinhole, picture->light, &task, &streams,
                             picture->parts, picture->counters, error);
}
