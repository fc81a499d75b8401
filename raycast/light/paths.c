/* Following paths: launching their kernels, generation by generation. */
#include "raycast/light/paths.h"

#include <stdlib.h>

#include "raycast/light/radiance_shared.h"
#include "raycast/light/scan.h"

#define GPU_LOCAL_SIZE 64
#define PADDING_RAYS (KARST_PACKET_RAYS * KARST_BEAM_PACKETS)
/* Generations that are enqueued before it is looked whether any rays are left. */
#define BLIND_BOUNCES 4u

struct karst_paths {
    karst_context *context;
    karst_program *program;
    cl_kernel begin, add, hide, count, scan, pack, count_lit, pack_lit, add_lit;
    uint32_t room, block_rays, num_blocks; /* room: rays */
    uint32_t num_lamps, num_shadows;       /* num_shadows: lamps that cast some */
    karst_buffer *rays, *next, *to_lamps, *hits, *counts, *lamps;
    karst_buffer *lacking; /* a word for each pixel: its path lacked something */
    karst_buffer *shining; /* of rays to each lamp: the lanes of packets that have one */
    karst_buffer *total[2]; /* rays in the stream, and in the next one, by turns */
    karst_clear_paths *clear; /* NULL: paths go through no clear matter */
    bool has_media;
    karst_buffer *collisions; /* NULL without media */
};

karst_paths *karst_paths_create(karst_context *context, bool clear, bool media, karst_error *error)
{
    karst_paths *paths = calloc(1, sizeof *paths);
    if (!paths) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    paths->context = context;
    paths->has_media = media;
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
        paths->count_lit = karst_program_kernel(paths->program, "paths_count_lit", error);
        paths->pack_lit = karst_program_kernel(paths->program, "paths_pack_lit", error);
        paths->add_lit = karst_program_kernel(paths->program, "paths_add_lit", error);
    }
    if (paths->program && clear)
        paths->clear = karst_clear_paths_create(context, error);
    if ((clear && !paths->clear) || !paths->begin || !paths->add || !paths->hide || !paths->count || !paths->scan ||
        !paths->pack ||
        !paths->count_lit || !paths->pack_lit || !paths->add_lit) {
        karst_paths_destroy(paths);
        return NULL;
    }
    return paths;
}

static void free_room(karst_paths *paths)
{
    karst_buffer **buffers[] = {&paths->rays,   &paths->next,    &paths->to_lamps,   &paths->hits,
                                &paths->counts, &paths->shining, &paths->collisions, &paths->lacking};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        karst_buffer_destroy(*buffers[i]);
        *buffers[i] = NULL;
    }
}

void karst_paths_destroy(karst_paths *paths)
{
    if (!paths)
        return;
    cl_kernel kernels[] = {paths->begin, paths->add,       paths->count,    paths->scan,
                           paths->pack,  paths->count_lit, paths->pack_lit, paths->add_lit, paths->hide};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(paths->program);
    free_room(paths);
    karst_clear_paths_destroy(paths->clear);
    karst_buffer_destroy(paths->lamps);
    karst_buffer_destroy(paths->total[0]);
    karst_buffer_destroy(paths->total[1]);
    free(paths);
}

/* Enough for a block of a beam's rays to each of the lamps, too. */
static size_t padded(size_t num_pixels)
{
    const size_t num = (num_pixels + PADDING_RAYS - 1) / PADDING_RAYS;
    return (num < KARST_MOST_LAMPS ? KARST_MOST_LAMPS : num) * PADDING_RAYS;
}

uint32_t karst_paths_room(size_t num_pixels) { return (uint32_t)padded(num_pixels); }

double karst_paths_bytes(size_t num_pixels, bool clear, bool media)
{
    return (double)padded(num_pixels) * (double)(3 * sizeof(karst_ray) + sizeof(karst_hit) + 2 * sizeof(uint32_t) +
                                                 (clear ? karst_clear_paths_ray_bytes() : 0) +
                                                 (media ? sizeof(karst_path_collision) : 0));
}

bool karst_paths_set_room(karst_paths *paths, size_t num_pixels, karst_error *error)
{
    free_room(paths);
    paths->room = (uint32_t)padded(num_pixels);
    paths->block_rays = karst_scan_block(paths->context, KARST_PATH_BLOCK);
    paths->num_blocks = paths->room / paths->block_rays;
    karst_context *context = paths->context;
    paths->rays = karst_buffer_create_blank(context, "stream", paths->room * sizeof(karst_ray), error);
    paths->next = karst_buffer_create_blank(context, "stream", paths->room * sizeof(karst_ray), error);
    paths->to_lamps = karst_buffer_create_blank(context, "stream", paths->room * sizeof(karst_ray), error);
    paths->hits = karst_buffer_create_blank(context, "stream", paths->room * sizeof(karst_hit), error);
    paths->lacking = karst_buffer_create_blank(context, "stream", paths->room * sizeof(uint32_t), error);
    paths->counts = karst_buffer_create_blank(context, "stream", paths->num_blocks * sizeof(uint32_t), error);
    paths->shining = karst_buffer_create_blank(context, "stream",
                                               paths->room / (uint32_t)context->lanes * sizeof(uint32_t), error);
    if (paths->has_media &&
        !(paths->collisions =
              karst_buffer_create_blank(context, "stream", paths->room * sizeof(karst_path_collision), error)))
        return false;
    return paths->rays && paths->next && paths->to_lamps && paths->hits && paths->counts && paths->shining &&
           paths->lacking &&
           (!paths->clear || karst_clear_paths_set_room(paths->clear, paths->room, error));
}

bool karst_paths_set_lamps(karst_paths *paths, const karst_lamp *lamps, uint32_t num, karst_error *error)
{
    if (num > KARST_MOST_LAMPS)
        return karst_fail(error, KARST_FAILED, "%u lamps: %d is the limit", num, KARST_MOST_LAMPS);
    paths->num_lamps = num;
    paths->num_shadows = 0;
    for (uint32_t i = 0; i < num; i++)
        paths->num_shadows += lamps[i].shadow != 0;
    return !num || karst_buffer_write(paths->lamps, 0, lamps, num * sizeof *lamps, error);
}

static bool picks_lacking(const karst_path_picture *picture) { return picture->only_lacking && !picture->media; }

static bool begin(karst_paths *paths, const karst_path_picture *picture, bool keeps_parts, karst_error *error)
{
    const cl_uint keep = keeps_parts, only_lacking = picks_lacking(picture);
    karst_pinhole pinhole = *picture->pinhole;
    const size_t across = ((size_t)pinhole.width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                 down = ((size_t)pinhole.height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                 local_size = KARST_PACKET_RAYS * KARST_GROUP_PACKETS / (size_t)paths->context->lanes;
    if (picture->starts)
        pinhole.sample = 0;
    return KARST_ARGUMENTS(paths->begin, error, KARST_VALUE_ARG(pinhole), KARST_BUFFER_ARG(paths->rays),
                           KARST_BUFFER_ARG(picture->parts), KARST_VALUE_ARG(keep),
                           KARST_BUFFER_ARG(paths->total[0]), KARST_BUFFER_ARG(paths->lacking),
                           KARST_VALUE_ARG(only_lacking)) &&
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

/* Rays to lamps that clear matter hides bring no light from now on. */
static bool hide_lamps(karst_paths *paths, const karst_path_picture *picture, karst_buffer *rays,
                       const karst_buffer *count, uint32_t num, karst_error *error)
{
    karst_buffer *marks = picture->again ? NULL : paths->hits;
    return karst_cast_stream_marks(picture->over, picture->view, rays, num, count, marks, error) &&
           (!marks || (KARST_ARGUMENTS(paths->hide, error, KARST_BUFFER_ARG(rays), KARST_BUFFER_ARG(count),
                                       KARST_BUFFER_ARG(marks)) &&
                       karst_launch(paths->context, paths->hide, KARST_STAGE_SHADE, num, GPU_LOCAL_SIZE, error)));
}

/* Marks those of the rays to lamps that bring no light; what passes land on the way is what is left of others'. */
static bool cast_to_lamps(karst_paths *paths, const karst_path_picture *picture, karst_buffer *rays,
                          const karst_buffer *count, uint32_t num, karst_error *error)
{
    karst_buffer *marks = picture->again ? NULL : paths->hits;
    karst_profile_set_stream(paths->context, KARST_STREAM_SHADOW);
    const bool cast = picture->pass.pass ? karst_pass_to_lamps(&picture->pass, rays, count, num, error) &&
                                          (!marks || karst_buffer_fill(marks, 0, 0, num * sizeof(uint32_t), error))
                                    : karst_cast_stream_marks(picture->caster, picture->view, rays, num, count, marks,
                                                              error);
    karst_profile_set_stream(paths->context, KARST_NUM_STREAMS);
    return cast;
}

/* The light of lamps that the generation's rays to them reach. */
static bool add_lamps(karst_paths *paths, const karst_path_picture *picture, const karst_buffer *count, uint32_t num,
                      karst_error *error)
{
    const int width_px = picture->pinhole->width_px, height_px = picture->pinhole->height_px;
    const bool cast = cast_to_lamps(paths, picture, paths->to_lamps, count, num, error);
    if (!cast || picture->again)
        return cast;
    return KARST_ARGUMENTS(paths->add, error, KARST_VALUE_ARG(width_px), KARST_VALUE_ARG(height_px),
                           KARST_BUFFER_ARG(paths->to_lamps), KARST_BUFFER_ARG(count), KARST_BUFFER_ARG(paths->hits),
                           KARST_BUFFER_ARG(picture->parts)) &&
           launch_rays(paths, paths->add, num, error);
}

static bool launch_blocks(const karst_paths *paths, cl_kernel kernel, size_t num, karst_error *error)
{
    const size_t local_size = paths->context->lanes == 1 ? GPU_LOCAL_SIZE : 1;
    return karst_launch(paths->context, kernel, KARST_STAGE_SHADE, (num + local_size - 1) / local_size * local_size,
                        local_size, error);
}

/* Rays to lamps, of each `blocks` blocks, become one stream without gaps, which is cast; what it reaches is added. */
static bool add_lit(karst_paths *paths, const karst_path_picture *picture, cl_uint blocks, karst_error *error)
{
    const cl_uint lamps = paths->num_shadows, all = lamps * blocks, again = 1; /* they count as rays to lamps alone */
    const uint32_t num_rays = all * paths->block_rays;
    const int width_px = picture->pinhole->width_px, height_px = picture->pinhole->height_px;
    karst_buffer *total = paths->total[1];
    if (!KARST_ARGUMENTS(paths->count_lit, error, KARST_BUFFER_ARG(paths->shining), KARST_BUFFER_ARG(paths->counts),
                         KARST_VALUE_ARG(all)) ||
        !launch_blocks(paths, paths->count_lit, all, error) ||
        !KARST_ARGUMENTS(paths->scan, error, KARST_BUFFER_ARG(paths->counts), KARST_VALUE_ARG(all),
                         KARST_BUFFER_ARG(total), KARST_BUFFER_ARG(picture->counters), KARST_VALUE_ARG(again)) ||
        !karst_launch_scan(paths->context, paths->scan, error) ||
        !KARST_ARGUMENTS(paths->pack_lit, error, KARST_BUFFER_ARG(paths->to_lamps), KARST_BUFFER_ARG(paths->shining),
                         KARST_BUFFER_ARG(paths->counts), KARST_VALUE_ARG(all), KARST_BUFFER_ARG(paths->next)) ||
        !launch_blocks(paths, paths->pack_lit, all, error))
        return false;
    const karst_path_media *media = picture->media;
    if (media && !media->dim(media->user, paths->next, total, num_rays, error))
        return false;
    karst_profile_set_stream(paths->context, KARST_STREAM_SHADOW);
    const bool is_seen = !picture->over || hide_lamps(paths, picture, paths->next, total, num_rays, error);
    karst_profile_set_stream(paths->context, KARST_NUM_STREAMS);
    const bool cast = is_seen && cast_to_lamps(paths, picture, paths->next, total, num_rays, error);
    if (!cast || picture->again)
        return cast;
    return KARST_ARGUMENTS(paths->add_lit, error, KARST_VALUE_ARG(width_px), KARST_VALUE_ARG(height_px),
                           KARST_BUFFER_ARG(paths->next), KARST_BUFFER_ARG(paths->counts), KARST_BUFFER_ARG(total),
                           KARST_VALUE_ARG(blocks), KARST_VALUE_ARG(lamps), KARST_BUFFER_ARG(paths->hits),
                           KARST_BUFFER_ARG(picture->parts)) &&
           launch_blocks(paths, paths->add_lit, blocks, error);
}

/* From the rays that leave surfaces to the next stream. through: NULL without clear matter. */
static bool pack(karst_paths *paths, const karst_path_picture *picture, const karst_clear_path_stream *through,
                 const karst_buffer *count, const karst_buffer *next_count, uint32_t num, karst_error *error)
{
    const cl_uint again = picture->again;
    const cl_uint blocks = (num + paths->block_rays - 1) / paths->block_rays;
    return KARST_ARGUMENTS(paths->count, error, KARST_BUFFER_ARG(paths->next), KARST_BUFFER_ARG(count),
                           KARST_BUFFER_ARG(paths->counts), KARST_VALUE_ARG(blocks)) &&
           launch_blocks(paths, paths->count, blocks, error) &&
           KARST_ARGUMENTS(paths->scan, error, KARST_BUFFER_ARG(paths->counts), KARST_VALUE_ARG(blocks),
                           KARST_BUFFER_ARG(next_count), KARST_BUFFER_ARG(picture->counters), KARST_VALUE_ARG(again)) &&
           karst_launch_scan(paths->context, paths->scan, error) &&
           (through ? karst_clear_paths_pack(paths->clear, through, paths->next, paths->counts, blocks, error)
                    : KARST_ARGUMENTS(paths->pack, error, KARST_BUFFER_ARG(paths->next), KARST_BUFFER_ARG(count),
                                      KARST_BUFFER_ARG(paths->counts), KARST_VALUE_ARG(blocks),
                                      KARST_BUFFER_ARG(paths->rays)) &&
                          launch_blocks(paths, paths->pack, blocks, error));
}

/* Where the rays of a generation end: those of the first ended where the picture's hits say. media: what they may
 * collide with before, and what of them that takes. */
static bool cast(karst_paths *paths, const karst_path_picture *picture, const karst_clear_path_stream *through,
                 const karst_path_media *media, const karst_path_media_stream *to_media, bool is_first,
                 karst_error *error)
{
    if (picture->pass.pass && !is_first &&
        !karst_pass_leave(&picture->pass, paths->rays, to_media->count, to_media->max_rays, error))
        return false;
    if (through)
        return (!is_first || karst_clear_paths_begin(paths->clear, through, error)) &&
               karst_clear_paths_cast(paths->clear, through, is_first ? picture->hits : NULL, error);
    if (!is_first) {
        karst_profile_set_stream(paths->context, KARST_STREAM_MIRROR);
        const bool done = karst_cast_stream(picture->caster, picture->view, paths->rays, to_media->max_rays,
                                            to_media->count, paths->hits, error);
        karst_profile_set_stream(paths->context, KARST_NUM_STREAMS);
        if (!done)
            return false;
    }
    return !media || media->meet(media->user, to_media, error);
}

static bool follow(karst_paths *paths, const karst_path_picture *picture, uint32_t max_bounces, karst_error *error)
{
    const uint32_t num_pixels = (uint32_t)picture->pinhole->width_px * (uint32_t)picture->pinhole->height_px;
    karst_path_task task = {.sample = picture->pinhole->sample ? picture->pinhole->sample : 1,
                            .num_lamps = paths->num_lamps,
                            .mirrors = picture->mirrors,
                            .passes = picture->pass.pass != NULL,
                            .again = picture->again};
    const bool picks = picks_lacking(picture) && !picture->again;
    const bool has_clear = picture->clear && paths->clear;
    karst_clear_path_stream clear = {.clear = picture->clear,
                                     .land = picture->caster,
                                     .view = picture->view,
                                     .pinhole = picture->pinhole,
                                     .rays = paths->rays,
                                     .hits = paths->hits,
                                     .lamps = paths->lamps,
                                     .parts = picture->parts,
                                     .counters = picture->counters,
                                     .max_bounces = max_bounces};
    const karst_clear_path_stream *through = has_clear ? &clear : NULL;
    const karst_path_media *media = paths->has_media ? picture->media : NULL;
    karst_path_media_stream to_media = {.rays = paths->rays,
                                        .collisions = paths->collisions,
                                        .next = paths->next,
                                        .to_lamps = paths->to_lamps,
                                        .lamps = paths->lamps,
                                        .parts = picture->parts};
    clear.to_media = &to_media;
    uint32_t left = num_pixels;
    if (num_pixels > paths->room)
        return karst_fail(error, KARST_FAILED, "there is no room for the paths of %u pixels", num_pixels);
    if (!begin(paths, picture, picture->again, error))
        return false;
    if (through)
        clear.task = karst_clear_paths_task(picture->clear, picture->view, picture->pinhole);
    clear.task.again = picture->again;
    for (uint32_t bounce = 0; bounce <= max_bounces && left; bounce++) {
        karst_buffer *count = paths->total[bounce % 2], *next_count = paths->total[(bounce + 1) % 2];
        const bool starts = picture->starts && bounce == 0; /* no light falls yet: the eye's rays only find surfaces */
        const karst_path_streams streams = {.rays = paths->rays,
                                            .count = count,
                                            .hits = bounce || through ? paths->hits : picture->hits,
                                            .lamps = paths->lamps,
                                            .max_rays = left,
                                            .next = paths->next,
                                            .to_lamps = paths->to_lamps};
        clear.count = count;
        clear.max_rays = left;
        task.bounce = clear.task.bounce = bounce;
        task.only_lacking = picks && bounce == 0;
        clear.task.is_last = bounce == max_bounces;
        clear.task.from_starts = starts;
        task.is_last = starts || clear.task.is_last;
        task.num_lamps = clear.task.num_lamps = starts ? 0 : paths->num_lamps;
        to_media.count = count;
        to_media.max_rays = left;
        to_media.hits = streams.hits;
        to_media.task = task;
        clear.media = starts ? NULL : media; /* nor is what lies before surfaces in the way */
        if (!cast(paths, picture, through, clear.media, &to_media, bounce == 0, error) ||
            !karst_shade_paths(picture->shader, picture->view, picture->pinhole, picture->light, &task, &streams,
                               picture->parts, picture->counters, error) ||
            (starts && !karst_path_starts_leave(picture->starts, picture->pinhole, picture->view->detail, streams.hits,
                                                paths->next, picture->again ? NULL : picture->parts, error)) ||
            (clear.media && !media->turn(media->user, &to_media, error)) ||
            (through && !karst_clear_paths_go_on(paths->clear, through, paths->next, paths->to_lamps, error)) ||
            (task.num_lamps && !add_lamps(paths, picture, count, left, error)) ||
            (bounce < max_bounces && !pack(paths, picture, through, count, next_count, left, error)) ||
            (bounce % BLIND_BOUNCES == BLIND_BOUNCES - 1 &&
             !karst_buffer_read(next_count, 0, &left, sizeof left, error)))
            return false;
    }
    return true;
}

/* lacking NULL: no more. */
static void note_lacking(const karst_path_picture *picture, const karst_buffer *lacking)
{
    karst_caster *casters[] = {picture->caster, picture->over, picture->clear ? picture->clear->caster : NULL};
    for (size_t i = 0; i < sizeof casters / sizeof *casters; i++)
        if (casters[i])
            karst_caster_note_lacking(casters[i], lacking, picture->pinhole->width_px, picture->pinhole->height_px);
}

bool karst_paths_follow(karst_paths *paths, const karst_path_picture *picture, uint32_t max_bounces, karst_error *error)
{
    /* Rays that media cast are not of a path's pixel. */
    note_lacking(picture, picture->media ? NULL : paths->lacking);
    const bool done = follow(paths, picture, max_bounces, error);
    note_lacking(picture, NULL);
    return done;
}

/* Part by part of the stream, so that there is room for rays to all lamps of each. strip_packets: as in
 * karst_path_task. */
static bool add_each_lamp(karst_paths *paths, const karst_path_picture *picture, const karst_buffer *rays,
                          const karst_buffer *count, const karst_buffer *hits, uint32_t strip_packets,
                          karst_error *error)
{
    const uint32_t num_pixels = (uint32_t)picture->pinhole->width_px * (uint32_t)picture->pinhole->height_px;
    const uint32_t lanes = (uint32_t)paths->context->lanes, shadows = paths->num_shadows;
    const uint32_t part_rays = paths->room / (shadows ? shadows : 1) / PADDING_RAYS * PADDING_RAYS;
    const karst_path_streams streams = {.rays = rays,
                                        .count = count,
                                        .hits = hits,
                                        .lamps = paths->lamps,
                                        .max_rays = num_pixels,
                                        .next = paths->next,
                                        .to_lamps = paths->to_lamps,
                                        .shining = paths->shining};
    karst_path_task task = {.is_last = 1,
                            .sample = picture->pinhole->sample,
                            .num_lamps = paths->num_lamps,
                            .mirrors = picture->mirrors,
                            .passes = picture->pass.pass != NULL,
                            .again = picture->again,
                            .each_lamp = 1,
                            .strip_packets = strip_packets,
                            .num_packets = part_rays / lanes};
    if (num_pixels > paths->room)
        return karst_fail(error, KARST_FAILED, "there is no room for the light of %u pixels", num_pixels);
    if (!paths->num_lamps || (picture->again && !shadows))
        return true;
    for (uint32_t first = 0; first < num_pixels; first += part_rays) {
        task.first_packet = first / lanes;
        if (!karst_shade_paths(picture->shader, picture->view, picture->pinhole, picture->light, &task, &streams,
                               picture->parts, picture->counters, error) ||
            (shadows && !add_lit(paths, picture, part_rays / paths->block_rays, error)))
            return false;
    }
    return true;
}

bool karst_paths_add_lamps_of(karst_paths *paths, const karst_path_picture *picture, const karst_buffer *rays,
                              const karst_buffer *count, const karst_buffer *hits, karst_error *error)
{
    return add_each_lamp(paths, picture, rays, count, hits, 0, error);
}

bool karst_paths_add_lamps(karst_paths *paths, const karst_path_picture *picture, karst_error *error)
{
    const uint32_t width_px = (uint32_t)picture->pinhole->width_px, height_px = (uint32_t)picture->pinhole->height_px;
    const bool whole = width_px % KARST_PACKET_SIDE == 0 && height_px % KARST_PACKET_SIDE == 0;
    return begin(paths, picture, true, error) &&
           add_each_lamp(paths, picture, paths->rays, paths->total[0], picture->hits,
                         whole ? width_px / KARST_PACKET_SIDE : 0, error);
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
    /* As if it were followed no further; no light is added. */
    const karst_path_task task = {.is_last = 1,
                                  .sample = picture->pinhole->sample,
                                  .num_lamps = 1,
                                  .passes = picture->pass.pass != NULL,
                                  .again = 1};
    *stream = (karst_path_stream){paths->to_lamps, streams.count, num_pixels};
    return karst_shade_paths(picture->shader, picture->view, picture->pinhole, picture->light, &task, &streams,
                             picture->parts, picture->counters, error);
}
