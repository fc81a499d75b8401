/* Launching the kernels of rays through clear matter. */
#include "raycast/light/clear.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "raycast/light/radiance_shared.h"
#include "raycast/light/scan.h"

#define GPU_LOCAL_SIZE 64
#define PACKETS_PER_ITEM 64u /* with 16 lanes: as PACKETS in clear.cl */

enum {
    MATTER_OF_PICTURE,
    MATTER_OF_STREAM,
    CAMERA,
    COVER,
    COUNT_FIRST,
    SCAN,
    FIRST,
    TURN,
    COUNT_NEXT,
    NEXT,
    NUM_KERNELS
};
static const char *const kernel_names[NUM_KERNELS] = {
    "clear_matter_of_picture", "clear_matter_of_stream", "clear_camera", "clear_cover",      "clear_count_first",
    "clear_scan",              "clear_first",            "clear_turn",   "clear_count_next", "clear_next"};

enum { REFLECTED, REFRACTED, PASSING, NUM_BRANCHES }; /* karst_clear_task.branch */

struct karst_clear_shader {
    karst_context *context;
    karst_program *program;
    cl_kernel kernels[NUM_KERNELS];
    bool atmosphere, passes;
    cl_mem data;
    karst_shade_anchor anchor;
    karst_skies *skies;
    karst_buffer *black; /* a sky, for an atmosphere */
};

struct karst_clear {
    karst_context *context;
    karst_bounce *bounce; /* the stream at hand */
    bool sun;
    int width_px, height_px; /* that there is room for */
    karst_buffer *next_rays, *total; /* and the next one's */
    karst_buffer *ways, *next_ways, *first_hits, *over_hits, *matter, *counts;
    /* Of each pixel, in packet order: 0 where the rays that were followed last lacked nothing; and where that is noted
     * of those at hand. */
    karst_buffer *lacked, *lacking;
};

/* ---- shaders ---- */

karst_clear_shader *karst_clear_shader_create(karst_context *context, unsigned ways, const karst_shade_colour *surface,
                                              karst_error *error)
{
    karst_clear_shader *shader = calloc(1, sizeof *shader);
    if (!shader) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    char options[512];
    const bool atmosphere = ways & KARST_CLEAR_ATMOSPHERE;
    snprintf(options, sizeof options, "%s%s%s%s%s", atmosphere ? "-DSHADE_ATMOSPHERE" : "",
             ways & KARST_CLEAR_BENDS ? " -DCLEAR_BENDS" : "", ways & KARST_CLEAR_PASSES ? " -DCLEAR_PASSES" : "",
             surface ? " -DSHADE_WORLD_COLOUR " : "", surface ? surface->options : "");
    const karst_virtual_file world = {"world.clh", surface ? surface->source : ""};
    shader->context = context;
    shader->atmosphere = atmosphere;
    shader->passes = ways & KARST_CLEAR_PASSES;
    shader->data = surface && surface->data ? surface->data->mem : NULL;
    bool done = !atmosphere || (shader->black = karst_buffer_create(context, "sky", KARST_SKY_FLOATS * sizeof(float),
                                                                    NULL, error));
    done = done &&
           (shader->program = karst_program_build(context, "raycast/light/clear.cl", options, &world, 1, error));
    for (int i = 0; done && i < NUM_KERNELS; i++)
        done = (shader->kernels[i] = karst_program_kernel(shader->program, kernel_names[i], error)) != NULL;
    if (done)
        return shader;
    karst_clear_shader_destroy(shader);
    return NULL;
}

void karst_clear_shader_destroy(karst_clear_shader *shader)
{
    if (!shader)
        return;
    for (int i = 0; i < NUM_KERNELS; i++)
        if (shader->kernels[i])
            clReleaseKernel(shader->kernels[i]);
    karst_program_destroy(shader->program);
    karst_buffer_destroy(shader->black);
    free(shader);
}

void karst_clear_shader_set_anchor(karst_clear_shader *shader, const karst_position *anchor)
{
    memcpy(shader->anchor.voxel, anchor->voxel, sizeof shader->anchor.voxel);
    memcpy(shader->anchor.fraction, anchor->fraction, sizeof shader->anchor.fraction);
}

void karst_clear_shader_set_skies(karst_clear_shader *shader, karst_skies *skies) { shader->skies = skies; }

/* ---- streams ---- */

karst_clear *karst_clear_create(karst_context *context, bool sun, karst_error *error)
{
    karst_clear *clear = calloc(1, sizeof *clear);
    if (!clear) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    clear->context = context;
    clear->sun = sun;
    clear->bounce = karst_bounce_create(context, sun, error);
    clear->total = karst_buffer_create(context, "stream", sizeof(uint32_t), NULL, error);
    if (clear->bounce && clear->total)
        return clear;
    karst_clear_destroy(clear);
    return NULL;
}

static void free_room(karst_clear *clear)
{
    karst_buffer **const buffers[] = {&clear->next_rays,  &clear->ways,   &clear->next_ways, &clear->first_hits,
                                      &clear->over_hits, &clear->matter, &clear->counts,    &clear->lacked,
                                      &clear->lacking};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        karst_buffer_destroy(*buffers[i]);
        *buffers[i] = NULL;
    }
    clear->width_px = clear->height_px = 0;
}

void karst_clear_destroy(karst_clear *clear)
{
    if (!clear)
        return;
    free_room(clear);
    karst_buffer_destroy(clear->total);
    karst_bounce_destroy(clear->bounce);
    free(clear);
}

#define BEAM_RAYS (KARST_PACKET_RAYS * KARST_BEAM_PACKETS)
#define RAY_BYTES \
    (sizeof(karst_ray) + 2 * sizeof(karst_clear_way) + 2 * sizeof(karst_hit) + \
     (KARST_CLEAR_MATTER_PLANES + 2) * sizeof(float))

double karst_clear_bytes(int width_px, int height_px, bool sun, bool bends)
{
    const double ray_bytes = (double)RAY_BYTES + (bends ? (double)KARST_BEND_RAY_BYTES : 0);
    return karst_bounce_bytes(width_px, height_px, sun) + karst_bounce_room(width_px, height_px) * ray_bytes;
}

/* Rays that a work-item makes: raycast/light/blocks.clh. */
static uint32_t block_rays(const karst_clear *clear) { return karst_scan_block(clear->context, BEAM_RAYS); }

static karst_buffer *make(karst_clear *clear, size_t num, size_t each_bytes, karst_error *error)
{
    return karst_buffer_create_blank(clear->context, "stream", num * each_bytes, error);
}

bool karst_clear_set_room(karst_clear *clear, int width_px, int height_px, karst_error *error)
{
    if (clear->counts && clear->width_px >= width_px && clear->height_px >= height_px)
        return karst_bounce_set_room(clear->bounce, width_px, height_px, error);
    free_room(clear);
    if (!karst_bounce_set_room(clear->bounce, width_px, height_px, error))
        return false;
    const size_t room = karst_bounce_get_stream(clear->bounce).room;
    if (!(clear->next_rays = make(clear, room, sizeof(karst_ray), error)) ||
        !(clear->ways = make(clear, room, sizeof(karst_clear_way), error)) ||
        !(clear->next_ways = make(clear, room, sizeof(karst_clear_way), error)) ||
        !(clear->first_hits = make(clear, room, sizeof(karst_hit), error)) ||
        !(clear->over_hits = make(clear, room, sizeof(karst_hit), error)) ||
        !(clear->matter = make(clear, room, KARST_CLEAR_MATTER_PLANES * sizeof(float), error)) ||
        !(clear->lacked = make(clear, room, sizeof(uint32_t), error)) ||
        !(clear->lacking = make(clear, room, sizeof(uint32_t), error)) ||
        !(clear->counts = make(clear, room / block_rays(clear), sizeof(uint32_t), error)))
        return false;
    clear->width_px = width_px;
    clear->height_px = height_px;
    return true;
}

/* ---- a picture ---- */

static uint32_t num_packets(const karst_pinhole *pinhole)
{
    const uint32_t across = ((uint32_t)pinhole->width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE,
                   down = ((uint32_t)pinhole->height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    return across * down * KARST_GROUP_PACKETS;
}

static size_t local_size(const karst_clear *clear) { return clear->context->lanes == 1 ? GPU_LOCAL_SIZE : 1; }

static karst_clear_task task_of(const karst_clear_picture *picture)
{
    const karst_pinhole *p = picture->pinhole;
    karst_clear_task task = {.is_inside = picture->is_inside,
                             .detail = picture->view->detail,
                             .voxel_m = (float)picture->voxel_m,
                             .t_max = p->t_max,
                             .cone = p->cone,
                             .sample = p->sample,
                             .width_px = p->width_px,
                             .height_px = p->height_px,
                             .x0_px = p->x0_px,
                             .y0_px = p->y0_px,
                             .is_sure = picture->view->ends_at_missing,
                             .only_lacking = picture->only_lacking,
                             .has_clear = picture->clear != NULL};
    for (int c = 0; c < 3; c++)
        task.absorption[c] = (float)(picture->absorption_per_m[c] * picture->voxel_m);
    return task;
}

/* With room for the picture's rays alone, or for `num_rays`, which planes of the stream are as long as. */
static karst_bounce_stream stream_of(karst_clear *clear, const karst_clear_picture *picture, uint32_t num_rays)
{
    karst_bounce_stream stream = karst_bounce_get_stream(clear->bounce);
    karst_bounce_limit(clear->bounce, num_rays);
    stream.room = num_rays ? (num_rays + BEAM_RAYS - 1) / BEAM_RAYS * BEAM_RAYS
                           : karst_bounce_room(picture->pinhole->width_px, picture->pinhole->height_px);
    return stream;
}

/* Of the stream at hand. Waits for it: most streams are small, and launches for a whole picture take longer. */
static bool count_rays(const karst_clear *clear, uint32_t *num_rays, karst_error *error)
{
    return karst_buffer_read(karst_bounce_get_stream(clear->bounce).total, 0, num_rays, sizeof *num_rays, error);
}

/* One work-item for each packet. */
static bool launch_packets(karst_clear *clear, cl_kernel kernel, uint32_t packets, karst_error *error)
{
    const size_t items = (size_t)packets * KARST_PACKET_RAYS / (size_t)clear->context->lanes;
    return karst_launch(clear->context, kernel, KARST_STAGE_SHADE, items, local_size(clear), error);
}

static bool check_room(const karst_clear *clear, const karst_pinhole *pinhole, karst_error *error)
{
    return (clear->counts && karst_bounce_room(pinhole->width_px, pinhole->height_px) <=
                                 karst_bounce_get_stream(clear->bounce).room) ||
           karst_fail(error, KARST_FAILED, "there is no room for the rays through clear matter of a picture of %dx%d",
                      pinhole->width_px, pinhole->height_px);
}

static bool refine_camera(karst_clear *clear, const karst_clear_picture *picture, karst_error *error)
{
    return !picture->refiner ||
           karst_refine_camera(picture->refiner, picture->pinhole, picture->is_inside, &picture->clear_shader->anchor,
                               clear->first_hits, error);
}

static bool refine_stream(karst_clear *clear, const karst_clear_picture *picture, const karst_bounce_stream *stream,
                          karst_error *error)
{
    return !picture->refiner ||
           karst_refine_rays(picture->refiner, stream->rays, stream->total, stream->room,
                             &picture->clear_shader->anchor, clear->over_hits, error);
}

bool karst_clear_cast_camera(karst_clear *clear, const karst_clear_picture *picture, bool keeps, karst_error *error)
{
    const karst_pinhole *pinhole = picture->pinhole;
    karst_buffer *hits = keeps ? clear->first_hits : NULL;
    if (!check_room(clear, pinhole, error))
        return false;
    if (!picture->is_inside)
        return karst_cast_pinhole(picture->clear, picture->view, pinhole, hits, error) &&
               (!keeps || refine_camera(clear, picture, error));
    const cl_kernel kernel = picture->clear_shader->kernels[CAMERA];
    const uint32_t packets = num_packets(pinhole);
    const uint32_t num_rays = (uint32_t)pinhole->width_px * (uint32_t)pinhole->height_px;
    karst_buffer *rays = clear->next_rays;
    return KARST_ARGUMENTS(kernel, error, KARST_VALUE_ARG(*pinhole), KARST_BUFFER_ARG(rays),
                           KARST_VALUE_ARG(packets)) &&
           launch_packets(clear, kernel, packets, error) &&
           karst_cast_rays(picture->clear, picture->view, rays, num_rays, false, hits, error) &&
           (!keeps || refine_camera(clear, picture, error));
}

static const karst_sky *sky_of(const karst_clear_shader *shader)
{
    static const karst_sky night;
    return shader->skies ? karst_skies_sky(shader->skies) : &night;
}

bool karst_clear_cover(karst_clear *clear, const karst_clear_picture *picture, karst_error *error)
{
    const karst_clear_shader *shader = picture->clear_shader;
    const cl_kernel kernel = shader->kernels[COVER];
    const karst_clear_task task = task_of(picture);
    const uint32_t packets = num_packets(picture->pinhole);
    const cl_mem shadows = picture->shadow_rays ? picture->shadow_rays->mem : NULL;
    const karst_buffer *table = shader->skies ? karst_skies_buffer(shader->skies) : shader->black;
    const cl_mem table_mem = table ? table->mem : NULL;
    const karst_argument arguments[] = {
        KARST_VALUE_ARG(task), KARST_VALUE_ARG(*picture->pinhole), KARST_VALUE_ARG(*picture->light),
        KARST_BUFFER_ARG(picture->hits), KARST_BUFFER_ARG(clear->first_hits), KARST_BUFFER_ARG(picture->parts),
        KARST_VALUE_ARG(shadows), KARST_VALUE_ARG(packets),
        /* of an atmosphere alone */
        KARST_VALUE_ARG(*sky_of(shader)), KARST_VALUE_ARG(table_mem)};
    const size_t num = sizeof arguments / sizeof *arguments - (shader->atmosphere ? 0 : 2);
    return !picture->clear || (karst_arguments(kernel, arguments, num, error) &&
                               launch_packets(clear, kernel, packets, error));
}

static bool find_matter_of_picture(karst_clear *clear, const karst_clear_picture *picture, karst_error *error)
{
    const karst_clear_shader *shader = picture->clear_shader;
    const cl_kernel kernel = shader->kernels[MATTER_OF_PICTURE];
    const uint32_t lanes = (uint32_t)clear->context->lanes,
                   packets = num_packets(picture->pinhole) * (KARST_PACKET_RAYS / lanes),
                   per_item = lanes == 1 ? 1 : PACKETS_PER_ITEM;
    return KARST_ARGUMENTS(kernel, error, KARST_VALUE_ARG(*picture->pinhole), KARST_VALUE_ARG(picture->view->detail),
                           KARST_VALUE_ARG(picture->view->blend), KARST_BUFFER_ARG(clear->first_hits),
                           KARST_BUFFER_ARG(clear->matter), KARST_VALUE_ARG(shader->anchor),
                           KARST_VALUE_ARG(shader->data), KARST_VALUE_ARG(packets)) &&
           karst_launch(clear->context, kernel, KARST_STAGE_SHADE, (packets + per_item - 1) / per_item,
                        local_size(clear), error);
}

bool karst_clear_find_matter(karst_clear_shader *shader, const karst_cast_view *view, const karst_buffer *rays,
                             const karst_buffer *count, const karst_buffer *ways, uint32_t max_rays,
                             const karst_buffer *hits, karst_buffer *matter, uint32_t room, karst_error *error)
{
    const cl_kernel kernel = shader->kernels[MATTER_OF_STREAM];
    const bool one_lane = shader->context->lanes == 1;
    const uint32_t per_item = one_lane ? 1 : KARST_PACKET_RAYS * PACKETS_PER_ITEM;
    return KARST_ARGUMENTS(kernel, error, KARST_BUFFER_ARG(rays), KARST_BUFFER_ARG(count), KARST_BUFFER_ARG(ways),
                           KARST_VALUE_ARG(view->detail), KARST_VALUE_ARG(view->blend), KARST_BUFFER_ARG(hits),
                           KARST_BUFFER_ARG(matter), KARST_VALUE_ARG(room), KARST_VALUE_ARG(shader->anchor),
                           KARST_VALUE_ARG(shader->data)) &&
           karst_launch(shader->context, kernel, KARST_STAGE_SHADE, (max_rays + per_item - 1) / per_item,
                        one_lane ? GPU_LOCAL_SIZE : 1, error);
}

static bool find_matter_of_stream(karst_clear *clear, const karst_clear_picture *picture,
                                  const karst_bounce_stream *stream, karst_error *error)
{
    return karst_clear_find_matter(picture->clear_shader, picture->view, stream->rays, stream->total, clear->ways,
                                   stream->room, clear->over_hits, clear->matter, stream->room, error);
}

static bool scan(karst_clear *clear, const karst_clear_picture *picture, karst_buffer *total, uint32_t blocks,
                 karst_error *error)
{
    const cl_kernel kernel = picture->clear_shader->kernels[SCAN];
    return KARST_ARGUMENTS(kernel, error, KARST_BUFFER_ARG(clear->counts), KARST_VALUE_ARG(blocks),
                           KARST_BUFFER_ARG(total), KARST_BUFFER_ARG(picture->counters)) &&
           karst_launch_scan(clear->context, kernel, error);
}

/* What kernels take in the end with a bender alone. */
typedef struct {
    cl_mem now, next;
    uint32_t most;
} met_arguments;

static met_arguments met_of(const karst_clear_picture *picture)
{
    const karst_bender *bender = picture->bender;
    return (met_arguments){bender ? karst_bender_met(bender)->mem : NULL,
                           bender ? karst_bender_next_met(bender)->mem : NULL, picture->bounces};
}

/* The rays of a branch, into the stream at hand. */
static bool begin_branch(karst_clear *clear, const karst_clear_picture *picture, const karst_clear_task *task,
                         karst_error *error)
{
    const cl_kernel *kernels = picture->clear_shader->kernels;
    const karst_bounce_stream stream = stream_of(clear, picture, 0);
    const uint32_t blocks = stream.room / block_rays(clear);
    const met_arguments met = met_of(picture);
    const karst_argument first[] = {
        KARST_VALUE_ARG(*task), KARST_VALUE_ARG(*picture->pinhole), KARST_BUFFER_ARG(picture->hits),
        KARST_BUFFER_ARG(clear->first_hits), KARST_BUFFER_ARG(clear->matter), KARST_BUFFER_ARG(picture->parts),
        KARST_BUFFER_ARG(clear->counts), KARST_VALUE_ARG(blocks), KARST_BUFFER_ARG(stream.rays),
        KARST_BUFFER_ARG(clear->ways), KARST_BUFFER_ARG(clear->lacked), KARST_VALUE_ARG(met.now)};
    const size_t num_first = sizeof first / sizeof *first - (picture->bender ? 0 : 1);
    return (!picture->clear || find_matter_of_picture(clear, picture, error)) &&
           KARST_ARGUMENTS(kernels[COUNT_FIRST], error, KARST_VALUE_ARG(*task), KARST_VALUE_ARG(*picture->pinhole),
                           KARST_BUFFER_ARG(picture->parts), KARST_BUFFER_ARG(picture->hits),
                           KARST_BUFFER_ARG(clear->first_hits), KARST_BUFFER_ARG(clear->counts),
                           KARST_VALUE_ARG(blocks), KARST_BUFFER_ARG(clear->lacked)) &&
           karst_launch(clear->context, kernels[COUNT_FIRST], KARST_STAGE_SHADE, blocks, local_size(clear), error) &&
           scan(clear, picture, stream.total, blocks, error) &&
           karst_arguments(kernels[FIRST], first, num_first, error) &&
           karst_launch(clear->context, kernels[FIRST], KARST_STAGE_SHADE, blocks, local_size(clear), error);
}

/* hits: where the rays end that are to be turned; NULL: on the way back. */
static bool turn(karst_clear *clear, const karst_clear_picture *picture, const karst_bounce_stream *stream,
                 const karst_buffer *hits, karst_error *error)
{
    const cl_kernel kernel = picture->clear_shader->kernels[TURN];
    const cl_mem ends = hits ? hits->mem : NULL;
    return KARST_ARGUMENTS(kernel, error, KARST_BUFFER_ARG(stream->rays), KARST_BUFFER_ARG(clear->ways),
                           KARST_BUFFER_ARG(stream->total), KARST_VALUE_ARG(ends)) &&
           karst_launch(clear->context, kernel, KARST_STAGE_SHADE, stream->room, GPU_LOCAL_SIZE, error);
}

/* A stream to be cast, for those who cast it more than once. */
typedef struct {
    karst_clear *clear;
    const karst_clear_picture *picture;
    const karst_bounce_stream *stream;
} cast_task;

/* Into both kinds of matter, straight. */
static bool cast_straight(void *user, karst_error *error)
{
    const cast_task *task = user;
    karst_clear *clear = task->clear;
    const karst_clear_picture *picture = task->picture;
    const karst_bounce_stream *stream = task->stream;
    karst_profile_set_stream(clear->context, KARST_STREAM_CLEAR);
    const bool done = karst_bounce_cast(clear->bounce, picture->land, picture->view, false, error) &&
                      (!picture->clear ||
                       (turn(clear, picture, stream, stream->hits, error) &&
                        karst_cast_stream(picture->clear, picture->view, stream->rays, stream->room, stream->total,
                                          clear->over_hits, error) &&
                        refine_stream(clear, picture, stream, error) && turn(clear, picture, stream, NULL, error)));
    karst_profile_set_stream(clear->context, KARST_NUM_STREAMS);
    return done;
}

static bool cast(karst_clear *clear, const karst_clear_picture *picture, const karst_clear_task *task,
                 const karst_bounce_stream *stream, karst_error *error)
{
    cast_task with = {clear, picture, stream};
    const karst_bend_stream bent = {.view = picture->view,
                                    .stream = stream,
                                    .ways = clear->ways,
                                    .over_hits = clear->over_hits,
                                    .counters = picture->counters,
                                    .anchor = &picture->clear_shader->anchor,
                                    .sample = task->sample,
                                    .branch = task->branch,
                                    .most_met = picture->bounces,
                                    .x0_px = task->x0_px,
                                    .y0_px = task->y0_px,
                                    .cast = cast_straight,
                                    .user = &with};
    /* Of what surfaces reflect and refract first nothing is inside land. */
    const bool leaves = picture->pass && (task->branch == PASSING || task->bounce > 1);
    return (!leaves || karst_pass_leave(picture->pass, stream->rays, stream->total, stream->room, error)) &&
           (picture->bender ? karst_bend_cast(picture->bender, &bent, error) : cast_straight(&with, error));
}

/* Of arguments whose last are the shares that pass, and num_met of a bender, those that the kernel has; how many. */
static size_t keep_arguments(const karst_clear_picture *picture, karst_argument *arguments, size_t num, size_t num_met)
{
    const size_t num_bent = picture->bender ? num_met : 0, first = num - num_met - 1;
    if (!picture->clear_shader->passes)
        memmove(arguments + first, arguments + first + 1, num_bent * sizeof *arguments);
    return first + (picture->clear_shader->passes ? 1 : 0) + num_bent;
}

/* The next stream, of the rays that go on; the one at hand keeps those that do not. */
static bool go_on(karst_clear *clear, const karst_clear_picture *picture, const karst_clear_task *task,
                  const karst_bounce_stream *stream, karst_error *error)
{
    const cl_kernel *kernels = picture->clear_shader->kernels;
    const uint32_t blocks = stream->room / block_rays(clear);
    const cl_mem shadows = stream->shadow_rays ? stream->shadow_rays->mem : NULL;
    const met_arguments met = met_of(picture);
    const karst_buffer *shares =
        picture->pass ? karst_pass_find_shares(picture->pass, stream->rays, stream->total, stream->hits, stream->room,
                                               true, error)
                      : NULL;
    if (picture->pass && !shares)
        return false;
    const cl_mem passing = shares ? shares->mem : NULL;
    karst_argument count[] = {
        KARST_VALUE_ARG(*task), KARST_BUFFER_ARG(stream->rays), KARST_BUFFER_ARG(clear->ways),
        KARST_BUFFER_ARG(stream->total), KARST_BUFFER_ARG(stream->hits), KARST_BUFFER_ARG(clear->over_hits),
        KARST_BUFFER_ARG(clear->counts), KARST_VALUE_ARG(blocks), KARST_VALUE_ARG(passing), KARST_VALUE_ARG(met.now),
        KARST_VALUE_ARG(met.most)};
    karst_argument next[] = {
        KARST_VALUE_ARG(*task), KARST_BUFFER_ARG(stream->rays), KARST_BUFFER_ARG(clear->ways),
        KARST_BUFFER_ARG(stream->total), KARST_BUFFER_ARG(stream->hits), KARST_BUFFER_ARG(clear->over_hits),
        KARST_BUFFER_ARG(clear->matter), KARST_BUFFER_ARG(clear->counts), KARST_VALUE_ARG(blocks),
        KARST_BUFFER_ARG(clear->next_rays), KARST_BUFFER_ARG(clear->next_ways), KARST_VALUE_ARG(shadows),
        KARST_VALUE_ARG(stream->room), KARST_BUFFER_ARG(picture->counters), KARST_BUFFER_ARG(clear->lacking),
        KARST_VALUE_ARG(passing),
        KARST_VALUE_ARG(met.now), KARST_VALUE_ARG(met.most), KARST_VALUE_ARG(met.next)};
    const size_t num_count = keep_arguments(picture, count, sizeof count / sizeof *count, 2),
                 num_next = keep_arguments(picture, next, sizeof next / sizeof *next, 3);
    return (!picture->clear || find_matter_of_stream(clear, picture, stream, error)) &&
           karst_arguments(kernels[COUNT_NEXT], count, num_count, error) &&
           karst_launch(clear->context, kernels[COUNT_NEXT], KARST_STAGE_SHADE, blocks, local_size(clear), error) &&
           scan(clear, picture, clear->total, blocks, error) &&
           karst_arguments(kernels[NEXT], next, num_next, error) &&
           karst_launch(clear->context, kernels[NEXT], KARST_STAGE_SHADE, blocks, local_size(clear), error);
}

/* What of the sun comes through land that hides it. */
static bool add_passing_sun(karst_clear *clear, const karst_clear_picture *picture, karst_error *error)
{
    const karst_bounce_stream stream = karst_bounce_get_stream(clear->bounce);
    const karst_pinhole of_stream = karst_bounce_pinhole(clear->bounce, picture->pinhole);
    const karst_pass_dark dark = {.shadow_rays = stream.shadow_rays,
                                  .marks = stream.marks,
                                  .suns = stream.suns,
                                  .stride = (size_t)of_stream.width_px * (size_t)of_stream.height_px,
                                  .pinhole = &of_stream,
                                  .of_stream = true};
    return !picture->pass || karst_pass_sun(picture->pass, &dark, picture->parts, error);
}

/* What the rays that ended see. */
static bool shade(karst_clear *clear, const karst_clear_picture *picture, bool again, karst_error *error)
{
    const karst_pinhole *pinhole = picture->pinhole;
    if (!karst_bounce_shade(clear->bounce, picture->shader, picture->view, pinhole, picture->light, picture->parts,
                            picture->counters, error) ||
        (picture->more && !picture->more(picture->user, clear->bounce, again, error)))
        return false;
    if (!clear->sun)
        return true;
    karst_profile_set_stream(clear->context, KARST_STREAM_SHADOW);
    const bool cast = karst_bounce_cast_shadows(clear->bounce, picture->land, picture->view, pinhole, picture->light,
                                                again, error) &&
                      (!picture->has_caustics || !picture->clear ||
                       karst_bounce_cast_more_shadows(clear->bounce, picture->clear, picture->view, pinhole,
                                                      picture->light, again, error));
    karst_profile_set_stream(clear->context, KARST_NUM_STREAMS);
    return cast && (again || (karst_bounce_add_sun(clear->bounce, pinhole, picture->parts, error) &&
                              add_passing_sun(clear, picture, error)));
}

static void exchange(karst_clear *clear, const karst_clear_picture *picture)
{
    if (picture->bender)
        karst_bender_exchange(picture->bender);
    karst_buffer *ways = clear->ways;
    clear->ways = clear->next_ways;
    clear->next_ways = ways;
    karst_bounce_exchange(clear->bounce, &clear->next_rays, &clear->total);
}

const karst_buffer *karst_clear_first_hits(const karst_clear *clear) { return clear->first_hits; }

static bool veil(karst_clear *clear, const karst_clear_picture *picture, const karst_bounce_stream *stream, bool again,
                 karst_error *error)
{
    const karst_clear_stream of = {stream, picture->clear ? clear->over_hits : NULL, clear->ways};
    return !picture->veil || picture->bender || picture->veil(picture->user, &of, again, error);
}

bool karst_clear_trace(karst_clear *clear, const karst_clear_picture *picture, bool again, karst_error *error)
{
    karst_clear_task task = task_of(picture);
    const uint32_t room = karst_bounce_room(picture->pinhole->width_px, picture->pinhole->height_px);
    if (!check_room(clear, picture->pinhole, error) ||
        (picture->bender && !karst_bender_set_room(picture->bender, room, error)))
        return false;
    task.adds_nothing = again;
    if (!karst_buffer_fill(clear->lacking, 0, 0,
                           (size_t)task.width_px * (size_t)task.height_px * sizeof(uint32_t), error))
        return false;
    for (task.branch = 0; task.branch < NUM_BRANCHES; task.branch++) {
        const uint32_t bounces = picture->clear || picture->pass ? picture->bounces : 1;
        if ((task.branch == REFRACTED && !picture->clear) || (task.branch == PASSING && !picture->pass))
            continue;
        uint32_t num_rays = 0;
        if (!begin_branch(clear, picture, &task, error) || !count_rays(clear, &num_rays, error))
            return false;
        for (task.bounce = 1; task.bounce <= bounces && num_rays; task.bounce++) {
            const karst_bounce_stream stream = stream_of(clear, picture, num_rays);
            task.is_last = task.bounce == bounces;
            if (!cast(clear, picture, &task, &stream, error) || !veil(clear, picture, &stream, again, error) ||
                !go_on(clear, picture, &task, &stream, error) ||
                !shade(clear, picture, again, error))
                return false;
            exchange(clear, picture);
            if (!task.is_last && !count_rays(clear, &num_rays, error))
                return false;
        }
    }
    karst_buffer *lacked = clear->lacked;
    clear->lacked = clear->lacking;
    clear->lacking = lacked;
    return true;
}
