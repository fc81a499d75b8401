/* The density producer: subdivide, evaluate and finalise around one density program. */
#include "producers/density/density_producer.h"

#include <stdlib.h>
#include <time.h>

#include "producers/density/host_steps.h"
#include "producers/density/kernels.h"
#include "producers/steps/colours.h"

/* Loads at a time. In one step: a launch has its price, and nothing speaks against large ones. In two, those whose
 * samples are in staging memory. CPUs: 2.4 MiB, which stays in the last-level cache between evaluate and finalise (32
 * to 512 were measured to be equally fast). Else 10 MiB: enough independent work-groups for a large GPU. */
#define MAX_CHUNK_IN_ONE 1024
#define MAX_CHUNK_CPU 128
#define MAX_CHUNK 512
/* Of the host's; those that it has not done when it makes way for kernels are evaluated in vain. */
#define HOST_CHUNK 8
/* So many bricks later a view may be elsewhere, and pages of mapped images go that nobody looks at any more. */
#define LOADS_BETWEEN 1024u

typedef struct {
    karst_producer base;
    karst_context *context;
    karst_channel channels[1];
    karst_channel_layout layout;
    karst_kernels kernels; /* NULL: the host does that */
    bool is_in_one;        /* a loader makes loads */
    /* While some are: */
    karst_density_program program;  /* its own, without data */
    karst_compilation *compilation; /* NULL: not begun */
    karst_buffer *data;             /* of the program; NULL: it has none */
    karst_words_copy mapped;        /* what data lies over, if images are mapped */
    uint64_t num_loads;             /* since pages of those were let go */
    karst_buffer *all_data[2];      /* what base.data points at */
    karst_load_books books;         /* least: only if loads are made in one */
    karst_buffer *staging;          /* of a chunk in two steps, or of the host's; NULL: there is neither */
    karst_layer *layers[KARST_MAX_LAYERS];
    size_t num_layers;
    const karst_colours *colours; /* of what layers have of them; NULL: none has any */
    karst_colour_step *colour_step;
    karst_scrub_total known; /* *books.total as last read */
    bool total_may_have_changed;
} density_producer;

/* ---- the host, until kernels are compiled (producers/density/host_steps.h) ---- */

/* Bounds of a node take it up to 30 us for an instruction: for longer tapes that is longer than to compile the kernels.
 * Samples take 0.1 to 1 ns for one, less than kernels whatever the length until these are compiled. */
#define HOST_MOST_INSTRUCTIONS 2000u
/* If that thread works for longer than that, kernels are wanted soon. */
#define HOST_PATIENCE_NS 500000000u

static bool has_all(const karst_kernels *k) { return (k->loader || k->evaluator) && k->subdivider; }

/* Takes what has been compiled since. */
static bool look_for_kernels(density_producer *producer, karst_error *error)
{
    if (!producer->compilation)
        return true;
    bool is_complete = karst_compilation_num_ready(producer->compilation) == KARST_NUM_KERNELS;
    if (!karst_compilation_take(producer->compilation, &producer->kernels, error))
        return false;
    karst_kernels_set_data(&producer->kernels, producer->data);
    if (is_complete) {
        karst_compilation_destroy(producer->compilation);
        producer->compilation = NULL;
    }
    return true;
}

static bool start_compiling(density_producer *producer, karst_error *error)
{
    karst_density_program program = producer->program;
    if (producer->compilation || has_all(&producer->kernels))
        return true;
    void *data = karst_buffer_map(producer->data, error);
    if (!data)
        return false;
    program.data = data;
    program.data_bytes = producer->data->size_bytes;
    producer->compilation = karst_compilation_start(producer->context, &program, &producer->layout, error);
    return karst_buffer_unmap(producer->data, data, error) && producer->compilation;
}

bool karst_density_producer_is_on_host(karst_producer *producer)
{
    const density_producer *density = (density_producer *)producer;
    return !has_all(&density->kernels) &&
           !(density->compilation && karst_compilation_num_ready(density->compilation) == KARST_NUM_KERNELS);
}

bool karst_density_producer_compile(karst_producer *producer, uint64_t most_ns, karst_error *error)
{
    density_producer *density = (density_producer *)producer;
    if (!start_compiling(density, error))
        return false;
    if (density->compilation)
        karst_compilation_go_on(density->compilation);
    if (density->compilation && most_ns == KARST_UNTIL_COMPILED)
        karst_compilation_wait(density->compilation, KARST_NUM_KERNELS);
    else if (density->compilation && most_ns > 0)
        karst_compilation_wait_for(density->compilation, KARST_NUM_KERNELS, most_ns);
    return look_for_kernels(density, error);
}

/* ---- the steps ---- */

/* Starts to compile, and waits until so much is done. */
static bool wait_for_kernels(density_producer *producer, uint32_t num, karst_error *error)
{
    if (!start_compiling(producer, error))
        return false;
    if (num > 1)
        karst_compilation_go_on(producer->compilation);
    karst_compilation_wait(producer->compilation, num);
    return look_for_kernels(producer, error);
}

static bool subdivide(karst_producer *self, const karst_cache_buffers *cache, const karst_work *work,
                      karst_error *error)
{
    density_producer *producer = (density_producer *)self;
    if (!look_for_kernels(producer, error))
        return false;
    if (!producer->kernels.subdivider && producer->program.tape_instructions > HOST_MOST_INSTRUCTIONS &&
        !wait_for_kernels(producer, 2, error))
        return false;
    if (!(producer->kernels.subdivider ? karst_subdivide_tiles(producer->kernels.subdivider, cache, work, error)
                                       : karst_host_subdivide_tiles(cache, work, producer->data, error)))
        return false;
    for (size_t i = 0; i < producer->num_layers; i++)
        if (!producer->layers[i]->ops->bound_tiles(producer->layers[i], cache, work, error))
            return false;
    return true;
}

/* Whether the host goes on with the bricks of a chunk. */
typedef struct {
    density_producer *producer;
    uint64_t start_ns;
    karst_error *error;
    bool failed;
} host_turn;

static uint64_t thread_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

static bool stays_on_host(void *user)
{
    host_turn *turn = user;
    density_producer *producer = turn->producer;
    if (!producer->compilation && thread_ns() - turn->start_ns > HOST_PATIENCE_NS)
        turn->failed = !start_compiling(producer, turn->error);
    return !turn->failed && !(producer->compilation && karst_compilation_num_ready(producer->compilation) > 0);
}

/* Makes the first of the loads, *done of them. If that is not all, there is a kernel for the rest then. */
static bool load_on_host(density_producer *producer, const karst_cache_buffers *cache, const karst_work *work,
                         uint32_t first, uint32_t count, uint32_t *done, karst_error *error)
{
    host_turn turn = {.producer = producer, .start_ns = thread_ns(), .error = error};
    const karst_load_books *books = &producer->books;
    bool finished = true;
    for (*done = 0; finished && *done < count;) {
        uint32_t at = first + *done, num = count - *done < HOST_CHUNK ? count - *done : HOST_CHUNK;
        if (!karst_host_bound_loads(cache, work, at, num, books->loads, producer->data, error) ||
            !karst_host_evaluate_bricks(books->loads, num, producer->staging, books->scrubs, producer->data,
                                        stays_on_host, &turn, &finished, error) ||
            turn.failed)
            return false;
        if (finished && !karst_host_finalise_bricks(cache, work, at, num, books->loads, producer->staging,
                                                    books->scrubs, books->total, error))
            return false;
        *done += finished ? num : 0;
    }
    return *done == count || wait_for_kernels(producer, 1, error);
}

static bool load_in_one(density_producer *producer, const karst_cache_buffers *cache, const karst_work *work,
                        uint32_t first, uint32_t count, karst_error *error)
{
    const karst_kernels *kernels = &producer->kernels;
    const karst_load_books *books = &producer->books;
    uint32_t done = 0;
    if (!kernels->loader && !load_on_host(producer, cache, work, first, count, &done, error))
        return false;
    first += done;
    count -= done;
    return count == 0 ||
           (karst_load_bricks(kernels->loader, cache, work, first, count, books, error) &&
            (kernels->subdivider
                 ? karst_bound_clear_loads(kernels->subdivider, cache, work, first, count, books->least, error)
                 : karst_host_bound_clear_loads(cache, work, first, count, books->least, producer->data, error)));
}

static bool load_in_two_steps(density_producer *producer, const karst_cache_buffers *cache, const karst_work *work,
                              uint32_t first, uint32_t count, karst_error *error)
{
    const karst_kernels *kernels = &producer->kernels;
    const karst_load_books *books = &producer->books;
    const karst_layer_colours *colours = NULL;
    bool done = karst_bound_loads(kernels->subdivider, cache, work, first, count, books->loads, error);
    for (size_t i = 0; done && i < producer->num_layers; i++)
        done = producer->layers[i]->ops->bound_loads(producer->layers[i], books->loads, count, error);
    done =
        done && karst_evaluate_bricks(kernels->evaluator, books->loads, count, producer->staging, books->scrubs, error);
    if (done && producer->colour_step)
        done = (colours = karst_colour_step_begin(producer->colour_step, count, error)) != NULL;
    for (size_t i = 0; done && i < producer->num_layers; i++)
        done = producer->layers[i]->ops->evaluate(producer->layers[i], books->loads, count, producer->staging,
                                                  producer->layout.staging_stride, colours, error);
    return done &&
           karst_finalise_bricks(kernels->finaliser, cache, work, first, count, books->loads, producer->staging,
                                 books->scrubs, books->total, error) &&
           (!colours || karst_colour_step_end(producer->colour_step, work, first, count, error));
}

static bool load(karst_producer *self, const karst_cache_buffers *cache, const karst_work *work, uint32_t first,
                 uint32_t count, karst_error *error)
{
    density_producer *producer = (density_producer *)self;
    producer->total_may_have_changed = true;
    producer->num_loads += count;
    if (producer->num_loads >= LOADS_BETWEEN) {
        karst_words_copy_let_go(&producer->mapped);
        producer->num_loads = 0;
    }
    return look_for_kernels(producer, error) &&
           (producer->is_in_one ? load_in_one(producer, cache, work, first, count, error)
                                : load_in_two_steps(producer, cache, work, first, count, error));
}

static void destroy(karst_producer *self)
{
    density_producer *producer = (density_producer *)self;
    karst_compilation_destroy(producer->compilation);
    karst_kernels_destroy(&producer->kernels);
    karst_colour_step_destroy(producer->colour_step);
    karst_density_program_free(&producer->program);
    const karst_load_books *books = &producer->books;
    karst_buffer *buffers[] = {producer->data, producer->staging, books->loads,
                               books->least,   books->scrubs,     books->total};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        karst_buffer_destroy(buffers[i]);
    karst_words_copy_destroy(&producer->mapped);
    free(producer);
}

static const karst_producer_ops density_ops = {
    .kind = "density", .subdivide = subdivide, .load = load, .destroy = destroy};

static bool lay_out(density_producer *producer, karst_error *error)
{
    producer->channels[0] = (karst_channel){.name = "density", .format = KARST_FORMAT_SCALED_I16, .components = 1};
    return karst_channels_lay_out(producer->channels, 1, &producer->layout, error) &&
           (producer->layout.slot_stride == KARST_BRICK_PADDED ||
            karst_fail(error, KARST_FAILED, "a brick of %u words does not fit the pool's slots of %u",
                       producer->layout.slot_stride, KARST_BRICK_PADDED));
}

/* Whether the host may answer at first: only a driver that compiles for seconds is worth it. */
static bool may_start_on_host(const density_producer *producer, const karst_density_program *program)
{
    const char *options = program->finalise_options;
    return program->start_on_host && program->data && !(program->layout && program->layout->has_mapped) &&
           producer->is_in_one && producer->context->is_cpu && karst_context_is_pocl(producer->context) &&
           producer->layout.staging_stride == KARST_BRICK_PADDED && (!options || !*options);
}

/* Kernels, or the host in their stead. Programs that are kept on disk take no time. */
static bool create_kernels(density_producer *producer, const karst_density_program *program, karst_error *error)
{
    karst_context *context = producer->context;
    if (!may_start_on_host(producer, program))
        return karst_kernels_create(&producer->kernels, context, program, &producer->layout, error);
    context->only_kept = true;
    karst_kernels_create(&producer->kernels, context, program, &producer->layout, NULL);
    context->only_kept = false;
    producer->program = *program;
    return karst_density_program_copy(&producer->program, false) || karst_fail(error, KARST_FAILED, "out of memory");
}

/* Where the device's memory is the host's, images that are mapped stay so. */
static bool make_data(density_producer *producer, const void *data, size_t data_bytes, const karst_world_layout *layout,
                      karst_error *error)
{
    karst_context *context = producer->context;
    karst_words_copy mapped = {.memory = NULL};
    const bool is_mapped = layout && layout->has_mapped && context->is_cpu;
    if (is_mapped && !karst_words_copy_create(&mapped, layout, data, data_bytes, error))
        return false;
    karst_buffer *buffer = is_mapped ? karst_buffer_create_over(context, "world", mapped.memory, data_bytes, error)
                                     : karst_buffer_create(context, "world", data_bytes, data, error);
    if (!buffer) {
        karst_words_copy_destroy(&mapped);
        return false;
    }
    karst_buffer_destroy(producer->data);
    karst_words_copy_destroy(&producer->mapped);
    producer->mapped = mapped;
    producer->data = producer->all_data[0] = buffer;
    producer->base.data = producer->all_data;
    karst_kernels_set_data(&producer->kernels, buffer);
    return true;
}

static bool create_data(density_producer *producer, const karst_density_program *program, karst_error *error)
{
    return !program->data || make_data(producer, program->data, program->data_bytes, program->layout, error);
}

bool karst_density_producer_replace(karst_producer *producer, const char *name, const void *data, size_t data_bytes,
                                    const karst_world_layout *layout, karst_error *error)
{
    if (!make_data((density_producer *)producer, data, data_bytes, layout, error))
        return false;
    producer->name = name;
    return true;
}

bool karst_density_producer_set_data(karst_producer *producer, const void *data, karst_error *error)
{
    density_producer *density = (density_producer *)producer;
    if (density->mapped.memory) { /* the buffer is that memory, and nothing runs */
        karst_words_copy_update(&density->mapped, data);
        return true;
    }
    return karst_buffer_write(density->data, 0, data, density->data->size_bytes, error);
}

static bool create_books(density_producer *producer, uint32_t max_chunk, karst_error *error)
{
    karst_context *context = producer->context;
    karst_load_books *books = &producer->books;
    return (books->loads = karst_buffer_create(context, "staging", max_chunk * sizeof(karst_load), NULL, error)) &&
           (books->scrubs = karst_buffer_create(context, "staging", max_chunk * sizeof(karst_scrub), NULL, error)) &&
           (books->total = karst_buffer_create(context, "staging", sizeof(karst_scrub_total), NULL, error)) &&
           (!producer->is_in_one ||
            (books->least = karst_buffer_create(context, "staging", max_chunk * sizeof(float), NULL, error)));
}

/* For so many bricks. */
static bool create_staging(density_producer *producer, uint32_t num, karst_error *error)
{
    size_t bytes = (size_t)num * producer->layout.staging_stride * sizeof(float);
    return num == 0 || (producer->staging = karst_buffer_create(producer->context, "staging", bytes, NULL, error));
}

karst_producer *karst_density_producer_create_program(karst_context *context, const karst_density_program *program,
                                                      karst_error *error)
{
    density_producer *producer = calloc(1, sizeof *producer);
    if (!producer) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    producer->is_in_one = karst_density_program_is_in_one(program, context);
    uint32_t most = producer->is_in_one ? MAX_CHUNK_IN_ONE
                    : context->is_cpu   ? MAX_CHUNK_CPU
                                        : MAX_CHUNK,
             max_chunk = program->max_loads < most ? program->max_loads : most;
    producer->base =
        (karst_producer){.ops = &density_ops, .name = program->name, .max_chunk = max_chunk ? max_chunk : 1};
    producer->context = context;
    max_chunk = producer->base.max_chunk;
    if (!lay_out(producer, error) || !create_kernels(producer, program, error) ||
        !create_data(producer, program, error) || !create_books(producer, max_chunk, error) ||
        !create_staging(producer,
                        !producer->is_in_one          ? max_chunk
                        : has_all(&producer->kernels) ? 0
                                                      : HOST_CHUNK,
                        error)) {
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
    karst_kernels *kernels = &producer->kernels;
    const karst_load_books *books = &producer->books;
    producer->context = context;
    producer->is_in_one = karst_density_program_is_in_one(program, context);
    bool done = lay_out(producer, error) && create_books(producer, 1, error) &&
                create_staging(producer, producer->is_in_one ? 0 : 1, error) &&
                karst_buffer_write(books->loads, 0, &load, sizeof load, error) &&
                karst_kernels_create_for_loads(kernels, context, program, &producer->layout, error) &&
                create_data(producer, program, error);
    if (done && producer->is_in_one)
        done = karst_load_bricks(kernels->loader, cache, work, 0, 0, books, error);
    else if (done)
        done = karst_evaluate_bricks(kernels->evaluator, books->loads, 1, producer->staging, books->scrubs, error) &&
               karst_finalise_bricks(kernels->finaliser, cache, work, 0, 1, books->loads, producer->staging,
                                     books->scrubs, books->total, error);
    done = done && karst_finish(context, error);
    destroy(&producer->base);
    return done;
}

/* ---- layers ---- */

/* Loads in two steps from now on: kernels, staging memory and chunks of that. */
static bool go_in_two_steps(density_producer *producer, const karst_density_program *program, karst_error *error)
{
    karst_density_program in_two = *program;
    karst_kernels made = {0};
    uint32_t most = producer->context->is_cpu ? MAX_CHUNK_CPU : MAX_CHUNK, chunk = producer->base.max_chunk;
    in_two.in_two_steps = true;
    chunk = chunk < most ? chunk : most;
    if (!karst_density_producer_compile(&producer->base, KARST_UNTIL_COMPILED, error))
        return false;
    karst_buffer *host_staging = producer->staging;
    producer->staging = NULL;
    if (!karst_kernels_create_for_loads(&made, producer->context, &in_two, &producer->layout, error) ||
        !create_staging(producer, chunk, error)) {
        karst_kernels_destroy(&made);
        producer->staging = host_staging;
        return false;
    }
    karst_buffer_destroy(host_staging);
    karst_loader_destroy(producer->kernels.loader);
    producer->kernels.loader = NULL;
    producer->kernels.evaluator = made.evaluator;
    producer->kernels.finaliser = made.finaliser;
    karst_kernels_set_data(&producer->kernels, producer->data);
    producer->is_in_one = false;
    producer->base.max_chunk = chunk;
    return true;
}

bool karst_density_producer_set_layers(karst_producer *producer, const karst_density_program *program,
                                       karst_layer *const *layers, size_t num_layers, const karst_colours *colours,
                                       karst_error *error)
{
    density_producer *density = (density_producer *)producer;
    if (num_layers > KARST_MAX_LAYERS)
        return karst_fail(error, KARST_FAILED, "%zu layers: %u are the most", num_layers, KARST_MAX_LAYERS);
    if (num_layers && density->is_in_one && !go_in_two_steps(density, program, error))
        return false;
    if (colours != density->colours) {
        karst_colour_step *step = NULL;
        if (colours && !(step = karst_colour_step_create(density->context, program->shape, colours,
                                                         density->base.max_chunk, error)))
            return false;
        karst_colour_step_destroy(density->colour_step);
        density->colour_step = step;
        density->colours = colours;
    }
    for (size_t i = 0; i < num_layers; i++)
        density->layers[i] = layers[i];
    density->num_layers = num_layers;
    return true;
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
        karst_buffer_read(producer->books.total, 0, &producer->known, sizeof producer->known, NULL))
        producer->total_may_have_changed = false;
    return &producer->known;
}

uint64_t karst_density_producer_non_finite(karst_producer *producer) { return scrub_total(producer)->count; }

void karst_density_producer_thin(karst_producer *producer, uint64_t *num_raised, uint64_t *num_given_up)
{
    const karst_scrub_total *total = scrub_total(producer);
    *num_raised = total->raised;
    *num_given_up = total->given_up;
}

bool karst_density_producer_first_non_finite(karst_producer *producer, int64_t voxel[3], int *level)
{
    const karst_scrub_total *total = scrub_total(producer);
    for (int axis = 0; axis < 3; axis++)
        voxel[axis] = total->voxel[axis];
    *level = total->level;
    return total->count != 0;
}
