/* Launching the kernels of rays inside clear matter whose index varies. */
#include "raycast/light/bend.h"

#include <stdlib.h>

#include "raycast/light/clear_shared.h"

#define GPU_LOCAL_SIZE 64
/* Chords of a path between two surfaces; and after how many it is asked whether any path is left. */
#define MOST_CHORDS 256u

enum { CHORDS, MET, END, NUM_KERNELS };
static const char *const kernel_names[NUM_KERNELS] = {"bend_chords", "bend_met", "bend_end"};

struct karst_bender {
    karst_context *context;
    karst_program *program;
    cl_kernel kernels[NUM_KERNELS];
    cl_mem data, index_data, bound_data;
    float voxel_m, tolerance;
    uint32_t room;
    karst_buffer *bends, *kept, *over_kept, *met, *next_met, *counts;
};

karst_bender *karst_bender_create(karst_context *context, const karst_bend_world *world, float tolerance,
                                  karst_error *error)
{
    karst_bender *bender = calloc(1, sizeof *bender);
    if (!bender) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    const karst_virtual_file file = {"world.clh", world->source};
    bender->context = context;
    bender->data = world->data->mem;
    bender->index_data = world->index_data->mem;
    bender->bound_data = world->bound_data->mem;
    bender->voxel_m = (float)world->voxel_m;
    bender->tolerance = tolerance;
    bender->program = karst_program_build(context, "raycast/light/bend.cl", world->options, &file, 1, error);
    bool done = bender->program != NULL;
    for (int i = 0; done && i < NUM_KERNELS; i++)
        done = (bender->kernels[i] = karst_program_kernel(bender->program, kernel_names[i], error)) != NULL;
    done = done && (bender->counts = karst_buffer_create(context, "stream", KARST_BEND_NUM_COUNTS * sizeof(uint32_t),
                                                         NULL, error)) != NULL;
    if (done)
        return bender;
    karst_bender_destroy(bender);
    return NULL;
}

static void free_room(karst_bender *bender)
{
    karst_buffer **const buffers[] = {&bender->bends, &bender->kept, &bender->over_kept, &bender->met,
                                      &bender->next_met};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        karst_buffer_destroy(*buffers[i]);
        *buffers[i] = NULL;
    }
    bender->room = 0;
}

void karst_bender_destroy(karst_bender *bender)
{
    if (!bender)
        return;
    free_room(bender);
    for (int i = 0; i < NUM_KERNELS; i++)
        if (bender->kernels[i])
            clReleaseKernel(bender->kernels[i]);
    karst_program_destroy(bender->program);
    karst_buffer_destroy(bender->counts);
    free(bender);
}

static karst_buffer *make(karst_bender *bender, uint32_t num_rays, size_t each_bytes, karst_error *error)
{
    return karst_buffer_create_blank(bender->context, "stream", (size_t)num_rays * each_bytes, error);
}

bool karst_bender_set_room(karst_bender *bender, uint32_t num_rays, karst_error *error)
{
    if (bender->room >= num_rays)
        return true;
    free_room(bender);
    if (!(bender->bends = make(bender, num_rays, sizeof(karst_bend), error)) ||
        !(bender->kept = make(bender, num_rays, sizeof(karst_hit), error)) ||
        !(bender->over_kept = make(bender, num_rays, sizeof(karst_hit), error)) ||
        !(bender->met = make(bender, num_rays, sizeof(uint32_t), error)) ||
        !(bender->next_met = make(bender, num_rays, sizeof(uint32_t), error)))
        return false;
    bender->room = num_rays;
    return true;
}

karst_buffer *karst_bender_met(const karst_bender *bender) { return bender->met; }
karst_buffer *karst_bender_next_met(const karst_bender *bender) { return bender->next_met; }

void karst_bender_exchange(karst_bender *bender)
{
    karst_buffer *met = bender->met;
    bender->met = bender->next_met;
    bender->next_met = met;
}

static karst_bend_task task_of(const karst_bender *bender, const karst_bend_stream *stream)
{
    return (karst_bend_task){.detail = stream->view->detail,
                             .voxel_m = bender->voxel_m,
                             .tolerance = bender->tolerance,
                             .sample = stream->sample,
                             .x0_px = stream->x0_px,
                             .y0_px = stream->y0_px,
                             .branch = stream->branch,
                             .most_met = stream->most_met};
}

static bool follow(karst_bender *bender, const karst_bend_stream *stream, const karst_bend_task *task,
                   karst_error *error)
{
    const cl_kernel kernel = bender->kernels[CHORDS];
    const karst_bounce_stream *rays = stream->stream;
    const size_t lanes = (size_t)bender->context->lanes;
    return KARST_ARGUMENTS(kernel, error, KARST_VALUE_ARG(*task), KARST_BUFFER_ARG(rays->rays),
                           KARST_BUFFER_ARG(rays->total), KARST_BUFFER_ARG(stream->ways),
                           KARST_BUFFER_ARG(bender->met), KARST_BUFFER_ARG(bender->bends),
                           KARST_VALUE_ARG(*stream->anchor), KARST_VALUE_ARG(bender->data),
                           KARST_VALUE_ARG(bender->index_data), KARST_VALUE_ARG(bender->bound_data),
                           KARST_BUFFER_ARG(bender->counts)) &&
           karst_launch(bender->context, kernel, KARST_STAGE_REFINE, (rays->room + lanes - 1) / lanes,
                        lanes == 1 ? GPU_LOCAL_SIZE : 16, error);
}

static bool look(karst_bender *bender, const karst_bend_stream *stream, const karst_bend_task *task,
                 karst_error *error)
{
    const cl_kernel kernel = bender->kernels[MET];
    const karst_bounce_stream *rays = stream->stream;
    return KARST_ARGUMENTS(kernel, error, KARST_VALUE_ARG(*task), KARST_BUFFER_ARG(rays->rays),
                           KARST_BUFFER_ARG(rays->total), KARST_BUFFER_ARG(stream->ways),
                           KARST_BUFFER_ARG(bender->bends), KARST_BUFFER_ARG(rays->hits),
                           KARST_BUFFER_ARG(stream->over_hits), KARST_BUFFER_ARG(bender->kept),
                           KARST_BUFFER_ARG(bender->over_kept), KARST_BUFFER_ARG(bender->counts),
                           KARST_BUFFER_ARG(stream->counters)) &&
           karst_launch(bender->context, kernel, KARST_STAGE_SHADE, rays->room, GPU_LOCAL_SIZE, error);
}

static bool end(karst_bender *bender, const karst_bend_stream *stream, karst_error *error)
{
    const cl_kernel kernel = bender->kernels[END];
    const karst_bounce_stream *rays = stream->stream;
    return KARST_ARGUMENTS(kernel, error, KARST_BUFFER_ARG(rays->rays), KARST_BUFFER_ARG(rays->total),
                           KARST_BUFFER_ARG(bender->bends), KARST_BUFFER_ARG(bender->kept),
                           KARST_BUFFER_ARG(bender->over_kept), KARST_BUFFER_ARG(bender->met),
                           KARST_BUFFER_ARG(rays->hits), KARST_BUFFER_ARG(stream->over_hits)) &&
           karst_launch(bender->context, kernel, KARST_STAGE_SHADE, rays->room, GPU_LOCAL_SIZE, error);
}

bool karst_bend_cast(karst_bender *bender, const karst_bend_stream *stream, karst_error *error)
{
    karst_bend_task task = task_of(bender, stream);
    uint32_t num_on = 1;
    for (uint32_t chord = 0; chord < MOST_CHORDS && num_on; chord++) {
        task.is_first = chord == 0;
        task.is_last = chord == MOST_CHORDS - 1;
        if (!karst_buffer_fill(bender->counts, 0, KARST_BEND_COUNT_ON * sizeof num_on, sizeof num_on, error) ||
            !follow(bender, stream, &task, error) || !stream->cast(stream->user, error) ||
            !look(bender, stream, &task, error) ||
            !karst_buffer_read(bender->counts, KARST_BEND_COUNT_ON * sizeof num_on, &num_on, sizeof num_on, error))
            return false;
    }
    return end(bender, stream, error);
}

bool karst_bender_faults(karst_bender *bender, uint32_t *num, float place[3], karst_error *error)
{
    if (!karst_buffer_read(bender->counts, KARST_BEND_COUNT_FAULTS * sizeof *num, num, sizeof *num, error))
        return false;
    return *num == 0 ||
           (karst_buffer_read(bender->counts, KARST_BEND_FAULT_PLACE * sizeof *place, place, 3 * sizeof *place,
                              error) &&
            karst_buffer_fill(bender->counts, 0, KARST_BEND_COUNT_FAULTS * sizeof *num, sizeof *num, error));
}
