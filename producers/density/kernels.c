#include "producers/density/kernels.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/device/program_cache.h"

static bool create_subdivider(karst_kernels *kernels, karst_context *context, const karst_density_program *program,
                              karst_error *error)
{
    const karst_virtual_file bounds = {"world.clh", program->bounds_source ? program->bounds_source : program->source};
    return (kernels->subdivider = karst_subdivider_create(context, &bounds, program->options, error));
}

bool karst_density_program_is_in_one(const karst_density_program *program, const karst_context *context)
{
    return !program->in_two_steps && karst_shape_group_size(program->shape, context->is_cpu) == 1;
}

static bool create_loader(karst_loader **loader, karst_context *context, const karst_density_program *program,
                          const karst_channel_layout *layout, const char *more_options, karst_error *error)
{
    const karst_virtual_file world = {"world.clh", program->source};
    char options[1024];
    snprintf(options, sizeof options, "%s %s %s", program->options,
             program->finalise_options ? program->finalise_options : "", more_options);
    return (*loader = karst_loader_create(context, layout, &world, options, error));
}

bool karst_kernels_create_for_loads(karst_kernels *kernels, karst_context *context,
                                    const karst_density_program *program, const karst_channel_layout *layout,
                                    karst_error *error)
{
    const karst_virtual_file world = {"world.clh", program->source};
    const char *options = program->finalise_options ? program->finalise_options : "";
    if (karst_density_program_is_in_one(program, context))
        return create_loader(&kernels->loader, context, program, layout, "", error);
    return (kernels->evaluator =
                karst_evaluator_create(context, program->shape, layout, &world, program->options, error)) &&
           (kernels->finaliser = karst_finaliser_create(context, program->shape, layout, options, error));
}

bool karst_kernels_create(karst_kernels *kernels, karst_context *context, const karst_density_program *program,
                          const karst_channel_layout *layout, karst_error *error)
{
    *kernels = (karst_kernels){0};
    if (create_subdivider(kernels, context, program, error) &&
        karst_kernels_create_for_loads(kernels, context, program, layout, error))
        return true;
    karst_kernels_destroy(kernels);
    return false;
}

void karst_kernels_destroy(karst_kernels *kernels)
{
    karst_subdivider_destroy(kernels->subdivider);
    karst_loader_destroy(kernels->loader);
    karst_evaluator_destroy(kernels->evaluator);
    karst_finaliser_destroy(kernels->finaliser);
    *kernels = (karst_kernels){0};
}

void karst_kernels_set_data(karst_kernels *kernels, const karst_buffer *data)
{
    if (kernels->subdivider)
        karst_subdivider_set_data(kernels->subdivider, data);
    if (kernels->loader)
        karst_loader_set_data(kernels->loader, data);
    if (kernels->evaluator)
        karst_evaluator_set_data(kernels->evaluator, data);
}

/* ---- beside ---- */

struct karst_compilation {
    karst_context *context, *fork; /* NULL: not there yet */
    karst_density_program program; /* with copies of its texts and data */
    karst_channel_layout layout;
    karst_channel channel;
    pthread_t thread;
    bool is_running;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    atomic_uint num_ready; /* written under the lock */
    uint32_t num_wanted;   /* under the lock; 0: none any more */
    /* the thread's until they are ready */
    bool failed;
    karst_error error;
    karst_kernels kernels;
    karst_loader *soon; /* what loads until that of `kernels` is there */
    /* the taker's */
    uint32_t num_taken;
};

/* What the kernels work on for once: a node that is subdivided, and none that is loaded. */
enum { TRIAL_TILES = 4, TRIAL_BRICKS = 2, NUM_BUFFERS = 14 };

typedef struct {
    karst_context *context;
    karst_buffer *buffers[NUM_BUFFERS];
    uint32_t num_buffers;
    karst_cache_buffers cache;
    karst_work work;
    karst_buffer *data;
    karst_load_books books;
} trial;

static bool make(trial *t, karst_buffer **buffer, size_t size_bytes, const void *initial, karst_error *error)
{
    *buffer = karst_buffer_create(t->context, "trial", size_bytes, initial, error);
    if (*buffer)
        t->buffers[t->num_buffers++] = *buffer;
    return *buffer != NULL;
}

static bool open_trial(trial *t, const karst_compilation *c, karst_error *error)
{
    const uint32_t node = KARST_TILE_NODES, slot = 1, tile = 2;
    const karst_tile_info infos[TRIAL_TILES] = {[1] = {.level = 4, .in_use = 1}};
    *t = (trial){.context = c->fork};
    t->cache.num_tiles = TRIAL_TILES;
    t->cache.num_bricks = t->cache.bricks_per_segment = TRIAL_BRICKS;
    t->cache.num_segments = 1;
    t->work.num_loads = t->work.num_subdivides = 1;
    if (!make(t, &t->cache.nodes, TRIAL_TILES * KARST_TILE_NODES * sizeof(karst_node), NULL, error) ||
        !make(t, &t->cache.tile_info, sizeof infos, infos, error) ||
        !make(t, &t->cache.bricks[0], (size_t)TRIAL_BRICKS * KARST_BRICK_STRIDE * sizeof(float), NULL, error) ||
        !make(t, &t->cache.brick_info, TRIAL_BRICKS * sizeof(karst_brick_info), NULL, error) ||
        !make(t, &t->work.load_nodes, sizeof node, &node, error) ||
        !make(t, &t->work.load_slots, sizeof slot, &slot, error) ||
        !make(t, &t->work.load_results, sizeof(uint32_t), NULL, error) ||
        !make(t, &t->work.subdivide_nodes, sizeof node, &node, error) ||
        !make(t, &t->work.subdivide_tiles, sizeof tile, &tile, error) ||
        !make(t, &t->books.loads, sizeof(karst_load), NULL, error) ||
        !make(t, &t->books.least, sizeof(float), NULL, error) ||
        !make(t, &t->books.scrubs, sizeof(karst_scrub), NULL, error) ||
        !make(t, &t->books.total, sizeof(karst_scrub_total), NULL, error) ||
        (c->program.data && !make(t, &t->data, c->program.data_bytes, c->program.data, error)))
        return false;
    for (int i = 1; i < KARST_MAX_BRICK_SEGMENTS; i++)
        t->cache.bricks[i] = t->cache.bricks[0];
    return true;
}

static void count_ready(karst_compilation *c, uint32_t num)
{
    pthread_mutex_lock(&c->lock);
    c->num_ready = num;
    pthread_cond_broadcast(&c->changed);
    pthread_mutex_unlock(&c->lock);
}

/* A kernel runs there with the trial's data, of which it keeps nothing. */
static bool try_loader(karst_compilation *c, karst_loader **loader, const char *more_options, trial *t,
                       karst_error *error)
{
    if (!create_loader(loader, c->fork, &c->program, &c->layout, more_options, error))
        return false;
    karst_loader_set_data(*loader, t->data);
    bool done =
        karst_load_bricks(*loader, &t->cache, &t->work, 0, 0, &t->books, error) && karst_finish(c->fork, error);
    karst_loader_set_data(*loader, NULL);
    return done;
}

/* Where a slower one is there already, the real one comes last. */
static bool try_first_loader(karst_compilation *c, trial *t, karst_error *error)
{
    const char *soon_options = c->program.soon_options;
    return try_loader(c, soon_options ? &c->soon : &c->kernels.loader, soon_options ? soon_options : "", t, error);
}

static bool try_last_loader(karst_compilation *c, trial *t, karst_error *error)
{
    return !c->program.soon_options || try_loader(c, &c->kernels.loader, "", t, error);
}

static bool try_subdivider(karst_compilation *c, trial *t, karst_error *error)
{
    karst_kernels *k = &c->kernels;
    if (!create_subdivider(k, c->fork, &c->program, error))
        return false;
    karst_subdivider_set_data(k->subdivider, t->data);
    bool done = karst_subdivide_tiles(k->subdivider, &t->cache, &t->work, error) && karst_finish(c->fork, error);
    karst_subdivider_set_data(k->subdivider, NULL);
    return done;
}

/* Waits until a step is wanted, or nothing is any more. */
static bool is_wanted(karst_compilation *c, uint32_t step)
{
    pthread_mutex_lock(&c->lock);
    while (c->num_wanted > 0 && c->num_wanted <= step)
        pthread_cond_wait(&c->changed, &c->lock);
    bool wanted = c->num_wanted > 0;
    pthread_mutex_unlock(&c->lock);
    return wanted;
}

static void set_wanted(karst_compilation *c, uint32_t num)
{
    pthread_mutex_lock(&c->lock);
    c->num_wanted = num;
    pthread_cond_broadcast(&c->changed);
    pthread_mutex_unlock(&c->lock);
}

static void *compile(void *user)
{
    static bool (*const steps[KARST_NUM_KERNELS])(karst_compilation *, trial *, karst_error *) = {
        try_first_loader, try_subdivider, try_last_loader};
    karst_compilation *c = user;
    trial t;
    bool good = open_trial(&t, c, &c->error);
    for (uint32_t i = 0; i < KARST_NUM_KERNELS && good && is_wanted(c, i); i++) {
        good = steps[i](c, &t, &c->error);
        if (good)
            count_ready(c, i + 1);
    }
    karst_finish(c->fork, NULL);
    for (uint32_t i = 0; i < t.num_buffers; i++)
        karst_buffer_destroy(t.buffers[i]);
    c->failed = !good;
    if (!good)
        count_ready(c, KARST_NUM_KERNELS);
    return NULL;
}

static bool copy_text(const char **text)
{
    const char *copy = *text ? strdup(*text) : NULL;
    bool good = copy || !*text;
    *text = copy;
    return good;
}

bool karst_density_program_copy(karst_density_program *program, bool with_data)
{
    void *data = program->data && with_data ? malloc(program->data_bytes) : NULL;
    bool good = data || !program->data || !with_data;
    if (data)
        memcpy(data, program->data, program->data_bytes);
    program->data = data;
    const char **texts[] = {&program->name,    &program->source,           &program->bounds_source,
                            &program->options, &program->finalise_options, &program->soon_options};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        good = copy_text(texts[i]) && good;
    return good;
}

void karst_density_program_free(karst_density_program *program)
{
    const void *all[] = {program->name,    program->source,           program->bounds_source,
                         program->options, program->finalise_options, program->soon_options,
                         program->data};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        free((void *)all[i]);
}

karst_compilation *karst_compilation_start(karst_context *context, const karst_density_program *program,
                                           const karst_channel_layout *layout, karst_error *error)
{
    karst_compilation *c = calloc(1, sizeof *c);
    if (!c) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    c->context = context;
    c->program = *program;
    c->layout = *layout;
    c->channel = layout->channels[0];
    c->layout.channels = &c->channel;
    c->num_wanted = 1;
    pthread_mutex_init(&c->lock, NULL);
    pthread_cond_init(&c->changed, NULL);
    bool copied = karst_density_program_copy(&c->program, true);
    if (!copied)
        karst_fail(error, KARST_FAILED, "out of memory");
    c->fork = copied ? karst_context_fork(context, error) : NULL;
    if (c->fork) {
        c->fork->helper = context->helper;
        c->is_running = pthread_create(&c->thread, NULL, compile, c) == 0;
        if (!c->is_running)
            karst_fail(error, KARST_FAILED, "no thread to compile with");
    }
    if (c->is_running)
        return c;
    karst_compilation_destroy(c);
    return NULL;
}

uint32_t karst_compilation_num_ready(const karst_compilation *compilation) { return compilation->num_ready; }

void karst_compilation_go_on(karst_compilation *compilation) { set_wanted(compilation, KARST_NUM_KERNELS); }

void karst_compilation_wait(karst_compilation *c, uint32_t num)
{
    pthread_mutex_lock(&c->lock);
    while (c->num_ready < num)
        pthread_cond_wait(&c->changed, &c->lock);
    pthread_mutex_unlock(&c->lock);
}

void karst_compilation_wait_for(karst_compilation *c, uint32_t num, uint64_t most_ns)
{
    struct timespec until;
    clock_gettime(CLOCK_REALTIME, &until);
    uint64_t ns = (uint64_t)until.tv_nsec + most_ns;
    until.tv_sec += (time_t)(ns / 1000000000u);
    until.tv_nsec = (long)(ns % 1000000000u);
    pthread_mutex_lock(&c->lock);
    int code = 0;
    while (c->num_ready < num && code == 0)
        code = pthread_cond_timedwait(&c->changed, &c->lock, &until);
    pthread_mutex_unlock(&c->lock);
}

void karst_compilation_destroy(karst_compilation *c)
{
    if (!c)
        return;
    if (c->is_running) {
        set_wanted(c, 0);
        pthread_join(c->thread, NULL);
    }
    pthread_cond_destroy(&c->changed);
    pthread_mutex_destroy(&c->lock);
    karst_kernels_destroy(&c->kernels);
    karst_loader_destroy(c->soon);
    if (c->fork)
        karst_program_cache_move(c->fork, c->context);
    karst_context_destroy(c->fork);
    karst_density_program_free(&c->program);
    free(c);
}

bool karst_compilation_take(karst_compilation *c, karst_kernels *kernels, karst_error *error)
{
    uint32_t num = c->num_ready;
    if (num == KARST_NUM_KERNELS && c->failed)
        return karst_fail(error, c->error.status, "%s", c->error.message);
    for (; c->num_taken < num; c->num_taken++) {
        karst_loader *loader = NULL;
        switch (c->num_taken) {
        case 0:
            loader = c->soon ? c->soon : c->kernels.loader;
            *(c->soon ? &c->soon : &c->kernels.loader) = NULL;
            break;
        case 1:
            kernels->subdivider = c->kernels.subdivider;
            c->kernels.subdivider = NULL;
            karst_subdivider_move(kernels->subdivider, c->context);
            break;
        default:
            loader = c->kernels.loader;
            c->kernels.loader = NULL;
            break;
        }
        if (loader) {
            karst_loader_move(loader, c->context);
            karst_loader_destroy(kernels->loader);
            kernels->loader = loader;
        }
    }
    return true;
}
