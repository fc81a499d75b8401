/* Slabs of tiles: which are looked at, by which thread, in which order they are joined. */
#include "karst/mesh.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <unistd.h>

#include "core/export/join.h"
#include "core/export/mesh_tiles.h"
#include "core/export/piece.h"

/* Before tiles are filled, those of a slab are listed, and of more until there are enough of either. */
enum { MAX_THREADS = 256, TILES_OF_THREAD = 8, ENOUGH_TILES = 4096, ENOUGH_SLABS = 16 };
/* What evaluating takes, and more. */
#define STACK_BYTES (8u << 20)

typedef struct {
    const karst_world *world;
    const karst_mesh_config *config;
    const karst_mesh_sink *sink;
    bool (*begin_tile)(void *user, const int64_t first[3], karst_error *error); /* NULL: nobody asks */
    karst_mesh_stats *stats;
    karst_mesh_join *join;
    karst_mesh_worker *workers[MAX_THREADS];
    int num_threads;
    karst_mesh_tile *tiles; /* that may hold surface, of some slabs, in their order */
    size_t num_tiles, max_tiles;
    int64_t first_slab, slab, num_slabs; /* `slab` is the one that is listed: those before, from the first, are */
    int64_t joined_slab;                 /* the last that the join was told of; -1: none */
    int64_t grid_cells[3];               /* the box's, and one more below */
} finder;

/* ---- tiles of a slab ---- */

static bool add_tile(finder *f, const int64_t first[3], const int64_t num[3])
{
    if (f->num_tiles == f->max_tiles) {
        const size_t more = f->max_tiles ? 2 * f->max_tiles : 64;
        karst_mesh_tile *larger = realloc(f->tiles, more * sizeof *larger);
        if (!larger)
            return false;
        f->tiles = larger;
        f->max_tiles = more;
    }
    karst_mesh_tile *tile = &f->tiles[f->num_tiles++];
    *tile = (karst_mesh_tile){.num_vertices = 0};
    for (int axis = 0; axis < 3; axis++) {
        tile->first[axis] = first[axis];
        tile->num_cells[axis] = (int)num[axis];
        tile->grid_cells[axis] = f->grid_cells[axis];
    }
    return true;
}

/* A square of `size` tiles from x, y on, smaller ones in the order in which they come to lie on lower ones. */
static bool list_tiles(finder *f, int64_t x, int64_t y, int64_t size)
{
    const int64_t *cells = f->grid_cells;
    const int64_t first[3] = {x * KARST_TILE_CELLS, y * KARST_TILE_CELLS, f->slab * KARST_TILE_CELLS};
    const int64_t widest[3] = {size * KARST_TILE_CELLS, size * KARST_TILE_CELLS, KARST_TILE_CELLS};
    int64_t num[3];
    for (int axis = 0; axis < 3; axis++) {
        if (first[axis] >= cells[axis])
            return true;
        num[axis] = cells[axis] - first[axis] < widest[axis] ? cells[axis] - first[axis] : widest[axis];
    }
    if (karst_mesh_is_clear(f->workers[0], first, num))
        return true;
    if (size == 1)
        return add_tile(f, first, num);
    for (int i = 0; i < 4; i++)
        if (!list_tiles(f, x + (i & 1) * size / 2, y + (i >> 1) * size / 2, size / 2))
            return false;
    return true;
}

/* ---- threads ---- */

/* The tiles of some slabs: each is filled by whoever comes to it, and joined by the calling thread, in their order. So
 * many are filled ahead of what is joined, at most. */
typedef struct {
    finder *f;
    pthread_mutex_t lock;
    pthread_cond_t filled, joined;
    size_t next, num_joined; /* tiles to fill, and to join */
    bool *is_filled, is_stopped;
    karst_error error;
} work;

typedef struct {
    work *w;
    karst_mesh_worker *worker;
} task;

static bool has_next(const work *w)
{
    const size_t ahead = (size_t)w->f->num_threads * TILES_OF_THREAD;
    return w->next < w->f->num_tiles && w->next < w->num_joined + ahead;
}

/* With the lock held, which is given up meanwhile. */
static void fill_next(work *w, karst_mesh_worker *worker)
{
    const size_t tile = w->next++;
    karst_error error = {0};
    pthread_mutex_unlock(&w->lock);
    const bool done = karst_mesh_fill_tile(worker, &w->f->tiles[tile], &error);
    pthread_mutex_lock(&w->lock);
    w->is_filled[tile] = done;
    if (!done && !w->is_stopped) {
        w->is_stopped = true;
        w->error = error;
    }
}

static void *run_task(void *argument)
{
    const task *t = argument;
    work *w = t->w;
    pthread_mutex_lock(&w->lock);
    while (!w->is_stopped && w->next < w->f->num_tiles) {
        if (has_next(w)) {
            fill_next(w, t->worker);
            pthread_cond_signal(&w->filled);
        } else {
            pthread_cond_wait(&w->joined, &w->lock);
        }
    }
    pthread_mutex_unlock(&w->lock);
    return NULL;
}

static bool report(const finder *f, size_t num_done, karst_error *error)
{
    const double share = f->num_tiles ? (double)num_done / (double)f->num_tiles : 1;
    const double slabs = (double)f->first_slab + share * (double)(f->slab - f->first_slab);
    return !f->sink->progress || f->sink->progress(f->sink->user, slabs / (double)f->num_slabs) ||
           karst_fail(error, KARST_FAILED, "the mesh was stopped");
}

static bool join_tile(finder *f, size_t index, karst_error *error)
{
    karst_mesh_tile *tile = &f->tiles[index];
    for (; f->joined_slab < tile->first[2] / KARST_TILE_CELLS; f->joined_slab++)
        karst_mesh_join_begin_slab(f->join);
    f->stats->num_open_cells += tile->num_open_cells;
    f->stats->num_samples += tile->num_samples;
    f->stats->num_sharp += tile->num_sharp;
    const bool done = (!f->begin_tile || f->begin_tile(f->sink->user, tile->first, error)) &&
                      karst_mesh_join_add(f->join, tile, error);
    karst_mesh_tile_finish(tile);
    return done && report(f, index + 1, error);
}

/* The calling thread's part: it joins what is filled, and fills as the others do while nothing is. */
static bool lead(work *w, karst_error *error)
{
    bool done = true;
    pthread_mutex_lock(&w->lock);
    while (!w->is_stopped && w->num_joined < w->f->num_tiles) {
        if (w->is_filled[w->num_joined]) {
            pthread_mutex_unlock(&w->lock);
            done = join_tile(w->f, w->num_joined, error);
            pthread_mutex_lock(&w->lock);
            w->is_stopped = w->is_stopped || !done;
            w->num_joined++;
            pthread_cond_broadcast(&w->joined);
        } else if (has_next(w)) {
            fill_next(w, w->f->workers[0]);
        } else {
            pthread_cond_wait(&w->filled, &w->lock);
        }
    }
    if (done && w->is_stopped)
        done = karst_fail(error, w->error.status, "%s", w->error.message);
    pthread_cond_broadcast(&w->joined);
    pthread_mutex_unlock(&w->lock);
    return done;
}

/* Where a thread cannot be started, the others do its work. */
static bool fill_and_join(finder *f, karst_error *error)
{
    pthread_t threads[MAX_THREADS];
    bool is_running[MAX_THREADS] = {false};
    task tasks[MAX_THREADS];
    work w = {.f = f, .is_filled = calloc(f->num_tiles + 1, sizeof *w.is_filled)};
    pthread_attr_t attributes;
    if (!w.is_filled || pthread_attr_init(&attributes) != 0) {
        free(w.is_filled);
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    pthread_mutex_init(&w.lock, NULL);
    pthread_cond_init(&w.filled, NULL);
    pthread_cond_init(&w.joined, NULL);
    pthread_attr_setstacksize(&attributes, STACK_BYTES);
    for (int i = 1; i < f->num_threads && (size_t)i < f->num_tiles; i++) {
        tasks[i] = (task){&w, f->workers[i]};
        is_running[i] = pthread_create(&threads[i], &attributes, run_task, &tasks[i]) == 0;
    }
    const bool done = lead(&w, error);
    for (int i = 1; i < f->num_threads; i++)
        if (is_running[i])
            pthread_join(threads[i], NULL);
    for (size_t i = 0; i < f->num_tiles; i++)
        karst_mesh_tile_finish(&f->tiles[i]);
    pthread_attr_destroy(&attributes);
    pthread_cond_destroy(&w.joined);
    pthread_cond_destroy(&w.filled);
    pthread_mutex_destroy(&w.lock);
    free(w.is_filled);
    return done;
}

/* As many as have enough tiles, so that threads seldom wait for one another. */
static bool find_slabs(finder *f, karst_error *error)
{
    int64_t widest = 1;
    while (widest * KARST_TILE_CELLS < f->grid_cells[0] || widest * KARST_TILE_CELLS < f->grid_cells[1])
        widest *= 2;
    f->num_tiles = 0;
    f->first_slab = f->slab;
    for (; f->slab < f->num_slabs && f->slab < f->first_slab + ENOUGH_SLABS && f->num_tiles < ENOUGH_TILES; f->slab++)
        if (!list_tiles(f, 0, 0, widest))
            return karst_fail(error, KARST_FAILED, "out of memory");
    return fill_and_join(f, error) && report(f, f->num_tiles, error);
}

/* ---- all of it ---- */

static bool check(const karst_world *world, const karst_mesh_config *config, karst_error *error)
{
    const double voxel_m = ldexp(1, karst_world_get_metadata(world)->voxel_log2_m);
    if (!(config->cell_m > 0) || !isfinite(config->cell_m) || config->cell_m < voxel_m * 0x1p-20)
        return karst_fail(error, KARST_USAGE,
                          "a mesh of cells of %g m: they must be above 0, and not narrower than 2^-20 of the world's "
                          "voxels of %g m",
                          config->cell_m, voxel_m);
    if (!(config->footprint_m >= 0) || !isfinite(config->footprint_m))
        return karst_fail(error, KARST_USAGE, "a mesh of footprint %g m: it must not be below 0", config->footprint_m);
    if (config->num_threads < 0 || config->num_threads > MAX_THREADS)
        return karst_fail(error, KARST_USAGE, "a mesh by %d threads: 0 to %d", config->num_threads, MAX_THREADS);
    for (int axis = 0; axis < 3; axis++) {
        const int64_t num = config->num_cells[axis];
        if (num < 1 || num > KARST_MESH_MAX_CELLS)
            return karst_fail(error, KARST_USAGE,
                              "a mesh of %lld cells along %c: 1 to %d; take wider cells or a smaller box",
                              (long long)num, "xyz"[axis], KARST_MESH_MAX_CELLS);
        const double low = (double)config->corner.voxel[axis], high = low + (double)num * config->cell_m / voxel_m;
        if (!(low > -0x1p61) || !(high < 0x1p61))
            return karst_fail(error, KARST_USAGE, "a mesh's box leaves the world along %c", "xyz"[axis]);
    }
    return true;
}

int karst_mesh_num_threads(const karst_mesh_config *config)
{
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    if (config->num_threads)
        return config->num_threads;
    return cores < 1 ? 1 : cores > MAX_THREADS ? MAX_THREADS : (int)cores;
}

bool karst_mesh_find_tiles(const karst_world *world, const karst_mesh_config *config, const karst_mesh_sink *sink,
                           bool (*begin_tile)(void *user, const int64_t first[3], karst_error *error),
                           karst_mesh_stats *stats, karst_error *error)
{
    if (!check(world, config, error))
        return false;
    karst_mesh_stats own = {0};
    finder f = {.world = world,
                .config = config,
                .sink = sink,
                .begin_tile = begin_tile,
                .stats = &own,
                .joined_slab = -1,
                .num_threads = karst_mesh_num_threads(config)};
    bool done = true;
    own.num_cells = (double)config->num_cells[0] * (double)config->num_cells[1] * (double)config->num_cells[2];
    for (int axis = 0; axis < 3; axis++)
        f.grid_cells[axis] = config->num_cells[axis] + 1;
    f.num_slabs = (f.grid_cells[2] + KARST_TILE_CELLS - 1) / KARST_TILE_CELLS;
    const karst_grid grid = karst_grid_of(&config->corner, config->cell_m, config->footprint_m,
                                          karst_world_get_metadata(world)->voxel_log2_m);
    f.join = karst_mesh_join_create(&grid, sink, &own, error);
    for (int i = 0; f.join && done && i < f.num_threads; i++) {
        f.workers[i] = karst_mesh_worker_create(world, config, error);
        done = f.workers[i];
    }
    while (f.join && done && f.slab < f.num_slabs)
        done = find_slabs(&f, error);
    for (int i = 0; i < f.num_threads; i++)
        karst_mesh_worker_destroy(f.workers[i]);
    free(f.tiles);
    if (f.join && stats && done)
        *stats = own;
    done = done && f.join;
    karst_mesh_join_destroy(f.join);
    return done;
}

bool karst_mesh_find(const karst_world *world, const karst_mesh_config *config, const karst_mesh_sink *sink,
                     karst_mesh_stats *stats, karst_error *error)
{
    return karst_mesh_find_tiles(world, config, sink, NULL, stats, error);
}
