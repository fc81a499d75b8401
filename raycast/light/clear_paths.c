/* Launching the kernels of paths through clear matter. */
#include "raycast/light/clear_paths.h"

#include <stdlib.h>

#define LOCAL_SIZE 64
#define PADDING_RAYS (KARST_PACKET_RAYS * KARST_BEAM_PACKETS)

enum { BEGIN, TURN, END, GO_ON, HIDE, PACK, NUM_KERNELS };
static const char *const kernel_names[NUM_KERNELS] = {"clear_paths_begin", "clear_paths_turn", "clear_paths_end",
                                                      "clear_paths_go_on", "clear_paths_hide", "clear_paths_pack"};

struct karst_clear_paths {
    karst_context *context;
    karst_program *program;
    cl_kernel kernels[NUM_KERNELS];
    uint32_t room;
    karst_buffer *ways, *next_ways, *trails, *next_trails; /* the latter two are not packed */
    karst_buffer *over_hits, *matter, *marks;
};

karst_clear_paths *karst_clear_paths_create(karst_context *context, karst_error *error)
{
    karst_clear_paths *paths = calloc(1, sizeof *paths);
    if (!paths) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    paths->context = context;
    paths->program = karst_program_build(context, "raycast/light/clear_paths.cl", "", NULL, 0, error);
    bool done = paths->program != NULL;
    for (int i = 0; done && i < NUM_KERNELS; i++)
        done = (paths->kernels[i] = karst_program_kernel(paths->program, kernel_names[i], error)) != NULL;
    if (done)
        return paths;
    karst_clear_paths_destroy(paths);
    return NULL;
}

static void free_room(karst_clear_paths *paths)
{
    karst_buffer **const buffers[] = {&paths->ways,      &paths->next_ways, &paths->trails, &paths->next_trails,
                                      &paths->over_hits, &paths->matter,    &paths->marks};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        karst_buffer_destroy(*buffers[i]);
        *buffers[i] = NULL;
    }
    paths->room = 0;
}

void karst_clear_paths_destroy(karst_clear_paths *paths)
{
    if (!paths)
        return;
    for (int i = 0; i < NUM_KERNELS; i++)
        if (paths->kernels[i])
            clReleaseKernel(paths->kernels[i]);
    karst_program_destroy(paths->program);
    free_room(paths);
    free(paths);
}

size_t karst_clear_paths_ray_bytes(void)
{
    return 2 * sizeof(karst_clear_way) + sizeof(karst_hit) + 3 * sizeof(uint32_t) +
           KARST_CLEAR_MATTER_PLANES * sizeof(float);
}

static bool make(karst_clear_paths *paths, karst_buffer **buffer, size_t each_bytes, karst_error *error)
{
    *buffer = karst_buffer_create_blank(paths->context, "stream", paths->room * each_bytes, error);
    return *buffer != NULL;
}

bool karst_clear_paths_set_room(karst_clear_paths *paths, uint32_t num_rays, karst_error *error)
{
    free_room(paths);
    paths->room = (num_rays + PADDING_RAYS - 1) / PADDING_RAYS * PADDING_RAYS;
    return make(paths, &paths->ways, sizeof(karst_clear_way), error) &&
           make(paths, &paths->next_ways, sizeof(karst_clear_way), error) &&
           make(paths, &paths->trails, sizeof(uint32_t), error) &&
           make(paths, &paths->next_trails, sizeof(uint32_t), error) &&
           make(paths, &paths->over_hits, sizeof(karst_hit), error) &&
           make(paths, &paths->matter, KARST_CLEAR_MATTER_PLANES * sizeof(float), error) &&
           make(paths, &paths->marks, sizeof(uint32_t), error);
}

karst_clear_path_task karst_clear_paths_task(const karst_path_clear *clear, const karst_cast_view *view,
                                             const karst_pinhole *pinhole)
{
    karst_clear_path_task task = {.is_inside = clear->is_inside,
                                  .detail = view->detail,
                                  .voxel_m = (float)clear->voxel_m,
                                  .t_max = pinhole->t_max,
                                  .sample = pinhole->sample ? pinhole->sample : 1,
                                  .width_px = pinhole->width_px,
                                  .height_px = pinhole->height_px,
                                  .x0_px = pinhole->x0_px,
                                  .y0_px = pinhole->y0_px,
                                  .is_sure = view->ends_at_missing};
    for (int c = 0; c < 3; c++)
        task.absorption[c] = (float)((double)clear->absorption_per_m[c] * clear->voxel_m);
    return task;
}

static bool launch(const karst_clear_paths *paths, int kernel, size_t items, karst_error *error)
{
    return karst_launch(paths->context, paths->kernels[kernel], KARST_STAGE_SHADE,
                        (items + LOCAL_SIZE - 1) / LOCAL_SIZE * LOCAL_SIZE, LOCAL_SIZE, error);
}

static cl_mem mem_of(const karst_buffer *buffer) { return buffer ? buffer->mem : NULL; }

bool karst_clear_paths_begin(karst_clear_paths *paths, const karst_clear_path_stream *stream, karst_error *error)
{
    karst_bender *bender = stream->clear->bender;
    if (paths->room < stream->max_rays)
        return karst_fail(error, KARST_FAILED, "there is no room for %u paths through clear matter", stream->max_rays);
    if (bender && !karst_bender_set_room(bender, paths->room, error))
        return false;
    const cl_mem met = bender ? mem_of(karst_bender_met(bender)) : NULL;
    return KARST_ARGUMENTS(paths->kernels[BEGIN], error, KARST_VALUE_ARG(stream->task), KARST_BUFFER_ARG(paths->ways),
                           KARST_BUFFER_ARG(paths->trails), KARST_VALUE_ARG(met), KARST_BUFFER_ARG(stream->count)) &&
           launch(paths, BEGIN, stream->max_rays, error);
}

/* ---- casting ---- */

/* hits: where the rays end that are to be turned; NULL: on the way back. */
static bool turn(karst_clear_paths *paths, const karst_clear_path_stream *stream, const karst_buffer *hits,
                 karst_error *error)
{
    const cl_mem ends = mem_of(hits);
    return KARST_ARGUMENTS(paths->kernels[TURN], error, KARST_BUFFER_ARG(stream->rays), KARST_BUFFER_ARG(paths->ways),
                           KARST_BUFFER_ARG(stream->count), KARST_VALUE_ARG(ends)) &&
           launch(paths, TURN, stream->max_rays, error);
}

static bool cast_into_clear(karst_clear_paths *paths, const karst_clear_path_stream *stream,
                            const karst_buffer *land_hits, karst_error *error)
{
    const karst_path_clear *clear = stream->clear;
    return turn(paths, stream, land_hits, error) &&
           karst_cast_stream(clear->caster, stream->view, stream->rays, stream->max_rays, stream->count,
                             paths->over_hits, error) &&
           (!clear->refiner || karst_refine_rays(clear->refiner, stream->rays, stream->count, stream->max_rays,
                                                 &clear->anchor, paths->over_hits, error)) &&
           turn(paths, stream, NULL, error);
}

typedef struct {
    karst_clear_paths *paths;
    const karst_clear_path_stream *stream;
} cast_task;

/* Into both kinds of matter, straight. */
static bool cast_straight(void *user, karst_error *error)
{
    const cast_task *task = user;
    const karst_clear_path_stream *stream = task->stream;
    return karst_cast_stream(stream->land, stream->view, stream->rays, stream->max_rays, stream->count, stream->hits,
                             error) &&
           cast_into_clear(task->paths, stream, stream->hits, error);
}

static bool cast_bent(karst_clear_paths *paths, const karst_clear_path_stream *stream, karst_error *error)
{
    cast_task with = {paths, stream};
    const karst_bounce_stream rays = {
        .rays = stream->rays, .hits = stream->hits, .total = stream->count, .room = stream->max_rays};
    const karst_bend_stream bent = {.view = stream->view,
                                    .stream = &rays,
                                    .ways = paths->ways,
                                    .over_hits = paths->over_hits,
                                    .counters = stream->counters,
                                    .anchor = &stream->clear->anchor,
                                    .sample = stream->task.sample,
                                    .most_met = stream->max_bounces,
                                    .x0_px = stream->task.x0_px,
                                    .y0_px = stream->task.y0_px,
                                    .cast = cast_straight,
                                    .user = &with};
    return karst_bend_cast(stream->clear->bender, &bent, error);
}

bool karst_clear_paths_cast(karst_clear_paths *paths, const karst_clear_path_stream *stream,
                            const karst_buffer *land_hits, karst_error *error)
{
    const karst_path_clear *clear = stream->clear;
    cast_task with = {paths, stream};
    /* Of rays that are not straight there is no hit before they have been followed. */
    const bool bends = clear->bender && (!land_hits || clear->is_inside);
    karst_profile_set_stream(paths->context, KARST_STREAM_CLEAR);
    const bool cast = bends       ? cast_bent(paths, stream, error)
                      : land_hits ? cast_into_clear(paths, stream, land_hits, error)
                                  : cast_straight(&with, error);
    const bool found = cast && karst_clear_find_matter(clear->shader, stream->view, stream->rays, stream->count,
                                                       paths->ways, stream->max_rays, paths->over_hits, paths->matter,
                                                       paths->room, error);
    karst_profile_set_stream(paths->context, KARST_NUM_STREAMS);
    const cl_mem land = bends || !land_hits ? stream->hits->mem : land_hits->mem;
    const cl_mem collisions = stream->media ? stream->to_media->collisions->mem : NULL;
    if (found && stream->media) {
        stream->to_media->hits = bends || !land_hits ? stream->hits : land_hits;
        stream->to_media->over_hits = paths->over_hits;
        stream->to_media->ways = paths->ways;
        if (!stream->media->meet(stream->media->user, stream->to_media, error))
            return false;
    }
    return found &&
           KARST_ARGUMENTS(paths->kernels[END], error, KARST_VALUE_ARG(stream->task), KARST_BUFFER_ARG(stream->rays),
                           KARST_BUFFER_ARG(paths->ways), KARST_BUFFER_ARG(paths->trails),
                           KARST_BUFFER_ARG(stream->count), KARST_VALUE_ARG(land), KARST_BUFFER_ARG(paths->over_hits),
                           KARST_BUFFER_ARG(stream->lamps), KARST_VALUE_ARG(collisions),
                           KARST_BUFFER_ARG(stream->hits), KARST_BUFFER_ARG(stream->parts)) &&
           launch(paths, END, stream->max_rays, error);
}

/* ---- going on ---- */

/* Rays to lamps that end in clear matter. */
static bool hide_lamps(karst_clear_paths *paths, const karst_clear_path_stream *stream, karst_buffer *to_lamps,
                       karst_error *error)
{
    karst_buffer *marks = stream->task.again ? NULL : paths->marks;
    const cl_mem marked = mem_of(marks);
    karst_profile_set_stream(paths->context, KARST_STREAM_SHADOW);
    const bool cast = karst_cast_stream_marks(stream->clear->caster, stream->view, to_lamps, stream->max_rays,
                                              stream->count, marks, error);
    karst_profile_set_stream(paths->context, KARST_NUM_STREAMS);
    return cast &&
           KARST_ARGUMENTS(paths->kernels[HIDE], error, KARST_BUFFER_ARG(to_lamps), KARST_BUFFER_ARG(stream->count),
                           KARST_VALUE_ARG(marked)) &&
           launch(paths, HIDE, stream->max_rays, error);
}

bool karst_clear_paths_go_on(karst_clear_paths *paths, const karst_clear_path_stream *stream, karst_buffer *next,
                             karst_buffer *to_lamps, karst_error *error)
{
    return KARST_ARGUMENTS(paths->kernels[GO_ON], error, KARST_VALUE_ARG(stream->task), KARST_BUFFER_ARG(stream->rays),
                           KARST_BUFFER_ARG(paths->ways), KARST_BUFFER_ARG(paths->trails),
                           KARST_BUFFER_ARG(stream->count), KARST_BUFFER_ARG(stream->hits),
                           KARST_BUFFER_ARG(paths->matter), KARST_VALUE_ARG(paths->room), KARST_BUFFER_ARG(next),
                           KARST_BUFFER_ARG(paths->next_ways), KARST_BUFFER_ARG(paths->next_trails),
                           KARST_BUFFER_ARG(to_lamps), KARST_BUFFER_ARG(stream->counters)) &&
           launch(paths, GO_ON, stream->max_rays, error) &&
           (!stream->task.num_lamps || hide_lamps(paths, stream, to_lamps, error));
}

bool karst_clear_paths_pack(karst_clear_paths *paths, const karst_clear_path_stream *stream, const karst_buffer *next,
                            const karst_buffer *begins, uint32_t num_blocks, karst_error *error)
{
    karst_bender *bender = stream->clear->bender;
    const cl_mem met = bender ? mem_of(karst_bender_met(bender)) : NULL,
                 next_met = bender ? mem_of(karst_bender_next_met(bender)) : NULL;
    const cl_uint again = stream->task.again;
    if (!KARST_ARGUMENTS(paths->kernels[PACK], error, KARST_BUFFER_ARG(next), KARST_BUFFER_ARG(paths->next_ways),
                         KARST_BUFFER_ARG(paths->next_trails), KARST_VALUE_ARG(met), KARST_BUFFER_ARG(stream->count),
                         KARST_BUFFER_ARG(begins), KARST_VALUE_ARG(num_blocks), KARST_VALUE_ARG(again),
                         KARST_BUFFER_ARG(stream->rays), KARST_BUFFER_ARG(paths->ways),
                         KARST_BUFFER_ARG(paths->trails), KARST_VALUE_ARG(next_met),
                         KARST_BUFFER_ARG(stream->counters)) ||
        !launch(paths, PACK, num_blocks, error))
        return false;
    if (bender)
        karst_bender_exchange(bender);
    return true;
}
