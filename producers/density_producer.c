/* The density producer: subdivide, evaluate and finalise around one density program. */
#include "producers/density_producer.h"

#include <stdio.h>
#include <stdlib.h>

#include "producers/channels.h"
#include "producers/evaluate.h"
#include "producers/finalise.h"
#include "producers/subdivide.h"

/* Loads whose samples are in staging memory at a time. CPUs: 2.4 MiB, which stays in the last-level cache between
 * evaluate and finalise (32 to 512 were measured to be equally fast). Else 10 MiB: enough independent work-groups for a
 * large GPU. */
#define MAX_CHUNK_CPU 128
#define MAX_CHUNK 512

typedef struct {
    karst_producer base;
    karst_context *context;
    karst_channel channels[1];
    karst_channel_layout layout;
    karst_subdivider *subdivider;
    karst_evaluator *evaluator;
    karst_finaliser *finaliser;
    karst_buffer *data;        /* of the program; NULL: it has none */
    karst_buffer *all_data[2]; /* what base.data points at */
    karst_buffer *loads, *staging, *scrubs, *total;
    karst_scrub_total known; /* *total as last read */
    bool total_may_have_changed;
} density_producer;

static bool subdivide(karst_producer *self, const karst_cache_buffers *cache, const karst_work *work,
                      karst_error *error)
{
    density_producer *producer = (density_producer *)self;
    return karst_subdivide_tiles(producer->subdivider, cache, work, error);
}

static bool evaluate(karst_producer *self, const karst_cache_buffers *cache, const karst_work *work, uint32_t first,
                     uint32_t count, karst_error *error)
{
    density_producer *producer = (density_producer *)self;
    return karst_bound_loads(producer->subdivider, cache, work, first, count, producer->loads, error) &&
           karst_evaluate_bricks(producer->evaluator, producer->loads, count, producer->staging, error);
}

static bool finalise(karst_producer *self, const karst_cache_buffers *cache, const karst_work *work, uint32_t first,
                     uint32_t count, karst_error *error)
{
    density_producer *producer = (density_producer *)self;
    producer->total_may_have_changed = true;
    return karst_finalise_bricks(producer->finaliser, cache, work, first, count, producer->loads, producer->staging,
                                 producer->scrubs, producer->total, error);
}

/* A density program does not change during its life. */
static karst_voxel_box take_dirty(karst_producer *self)
{
    (void)self;
    return (karst_voxel_box){{0, 0, 0}, {-1, -1, -1}};
}

static void destroy(karst_producer *self)
{
    density_producer *producer = (density_producer *)self;
    karst_subdivider_destroy(producer->subdivider);
    karst_evaluator_destroy(producer->evaluator);
    karst_finaliser_destroy(producer->finaliser);
    karst_buffer *buffers[] = {producer->data, producer->loads, producer->staging, producer->scrubs, producer->total};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        karst_buffer_destroy(buffers[i]);
    free(producer);
}

static const karst_producer_ops density_ops = {.kind = "density",
                                               .subdivide = subdivide,
                                               .evaluate = evaluate,
                                               .finalise = finalise,
                                               .take_dirty = take_dirty,
                                               .destroy = destroy};

static bool lay_out(density_producer *producer, karst_error *error)
{
    producer->channels[0] = (karst_channel){.name = "density", .format = KARST_FORMAT_SCALED_I16, .components = 1};
    return karst_channels_lay_out(producer->channels, 1, &producer->layout, error) &&
           (producer->layout.slot_stride == KARST_BRICK_STRIDE ||
            karst_fail(error, KARST_FAILED, "a brick of %u words does not fit the pool's slots of %u",
                       producer->layout.slot_stride, KARST_BRICK_STRIDE));
}

static bool create_evaluator(density_producer *producer, const karst_density_program *program, karst_error *error)
{
    const karst_virtual_file world = {"world.clh", program->source};
    return (producer->evaluator = karst_evaluator_create(producer->context, program->shape, &producer->layout, &world,
                                                         program->options, error));
}

static bool create_finaliser(density_producer *producer, const karst_density_program *program, karst_error *error)
{
    const char *options = program->finalise_options ? program->finalise_options : "";
    return (producer->finaliser =
                karst_finaliser_create(producer->context, program->shape, &producer->layout, options, error));
}

static bool create_kernels(density_producer *producer, const karst_density_program *program, karst_error *error)
{
    const karst_virtual_file bounds = {"world.clh", program->bounds_source ? program->bounds_source : program->source};
    return (producer->subdivider =
                karst_subdivider_create(producer->context, &bounds, program->options, error)) &&
           create_evaluator(producer, program, error) && create_finaliser(producer, program, error);
}

static bool make_data(density_producer *producer, const void *data, size_t data_bytes, karst_error *error)
{
    karst_buffer *buffer = karst_buffer_create(producer->context, "world", data_bytes, data, error);
    if (!buffer)
        return false;
    karst_buffer_destroy(producer->data);
    producer->data = producer->all_data[0] = buffer;
    producer->base.data = producer->all_data;
    if (producer->subdivider)
        karst_subdivider_set_data(producer->subdivider, buffer);
    karst_evaluator_set_data(producer->evaluator, buffer);
    return true;
}

static bool create_data(density_producer *producer, const karst_density_program *program, karst_error *error)
{
    return !program->data || make_data(producer, program->data, program->data_bytes, error);
}

bool karst_density_producer_replace(karst_producer *producer, const char *name, const void *data, size_t data_bytes,
                                    karst_error *error)
{
    if (!make_data((density_producer *)producer, data, data_bytes, error))
        return false;
    producer->name = name;
    return true;
}

bool karst_density_producer_set_data(karst_producer *producer, const void *data, karst_error *error)
{
    density_producer *density = (density_producer *)producer;
    return karst_buffer_write(density->data, 0, data, density->data->size_bytes, error);
}

static bool create_buffers(density_producer *producer, uint32_t max_chunk, karst_error *error)
{
    karst_context *context = producer->context;
    size_t staging_bytes = (size_t)max_chunk * producer->layout.staging_stride * sizeof(float);
    return (producer->loads = karst_buffer_create(context, "staging", max_chunk * sizeof(karst_load), NULL, error)) &&
           (producer->staging = karst_buffer_create(context, "staging", staging_bytes, NULL, error)) &&
           (producer->scrubs = karst_buffer_create(context, "staging", max_chunk * sizeof(karst_scrub), NULL, error)) &&
           (producer->total = karst_buffer_create(context, "staging", sizeof(karst_scrub_total), NULL, error));
}

karst_producer *karst_density_producer_create_program(karst_context *context, const karst_density_program *program,
                                                      karst_error *error)
{
    density_producer *producer = calloc(1, sizeof *producer);
    if (!producer) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    uint32_t most = context->is_cpu ? MAX_CHUNK_CPU : MAX_CHUNK,
             max_chunk = program->max_loads < most ? program->max_loads : most;
    producer->base = (karst_producer){
        .ops = &density_ops, .name = program->name, .version = 1, .max_chunk = max_chunk ? max_chunk : 1};
    producer->context = context;
    if (!lay_out(producer, error) || !create_kernels(producer, program, error) ||
        !create_data(producer, program, error) || !create_buffers(producer, producer->base.max_chunk, error)) {
        destroy(&producer->base);
        return NULL;
    }
    return &producer->base;
}

bool karst_density_program_rehearse(karst_context *context, const karst_density_program *program,
                                    const karst_cache_buffers *cache, const karst_work *work, karst_error *error)
{
    const karst_load load = {.state = KARST_STATE_AIR};
    density_producer *producer = calloc(1, sizeof *producer);
    if (!producer)
        return karst_fail(error, KARST_FAILED, "out of memory");
    producer->context = context;
    bool done = lay_out(producer, error) && create_buffers(producer, 1, error) &&
                karst_buffer_write(producer->loads, 0, &load, sizeof load, error) &&
                create_evaluator(producer, program, error) && create_data(producer, program, error) &&
                karst_evaluate_bricks(producer->evaluator, producer->loads, 1, producer->staging, error) &&
                karst_finish(context, error) && create_finaliser(producer, program, error) &&
                finalise(&producer->base, cache, work, 0, 1, error) && karst_finish(context, error);
    destroy(&producer->base);
    return done;
}

karst_buffer *karst_density_producer_staging(karst_producer *producer, uint32_t *stride_floats)
{
    density_producer *density = (density_producer *)producer;
    *stride_floats = density->layout.staging_stride;
    return density->staging;
}

static const karst_scrub_total *scrub_total(karst_producer *self)
{
    density_producer *producer = (density_producer *)self;
    if (producer->total_may_have_changed &&
        karst_buffer_read(producer->total, 0, &producer->known, sizeof producer->known, NULL))
        producer->total_may_have_changed = false;
    return &producer->known;
}

uint64_t karst_density_producer_non_finite(karst_producer *producer) { return scrub_total(producer)->count; }

bool karst_density_producer_first_non_finite(karst_producer *producer, int64_t voxel[3], int *level)
{
    const karst_scrub_total *total = scrub_total(producer);
    for (int axis = 0; axis < 3; axis++)
        voxel[axis] = total->voxel[axis];
    *level = total->level;
    return total->count != 0;
}
