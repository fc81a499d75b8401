/* A mesh in chunks with levels: tiles are gathered until the chunks of a slab are complete, then each is simplified, by
 * several threads. */
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "core/export/index_map.h"
#include "core/export/mesh_tiles.h"
#include "core/export/piece.h"
#include "core/export/simplify.h"

enum { CHUNK_TILES = KARST_MESH_CHUNK_CELLS / KARST_TILE_CELLS, MAX_THREADS = 256, CHUNKS_OF_THREAD = 4 };

/* A chunk that is being gathered; indices count all vertices of the mesh. */
typedef struct {
    int64_t at[3];
    uint32_t (*triangles)[3];
    size_t num_triangles, max_triangles;
} gathered;

typedef struct {
    const karst_mesh_config *config;
    const karst_mesh_chunk_sink *sink;
    karst_mesh_level_stats *levels;
    int num_levels, num_threads;
    karst_mesh_vertex *vertices; /* those that triangles may still ask for, from number first_vertex on */
    size_t num_vertices, max_vertices;
    uint64_t first_vertex, slab_start; /* slab_start: the number of the first vertex of the last slab */
    int64_t slab, layer;               /* of tiles, of chunks; -1: none yet */
    karst_index_map chunk_of;
    gathered *chunks, *open; /* of the layer; the one whose tile is being told of */
    size_t num_chunks, max_chunks;
} gatherer;

/* Room for `more` elements behind `num`; false: there is none. */
static bool make_room(void **array, size_t num, size_t more, size_t *max, size_t element_bytes)
{
    size_t wanted = *max ? *max : 64;
    if (num + more <= *max)
        return true;
    while (wanted < num + more)
        wanted *= 2;
    void *larger = realloc(*array, wanted * element_bytes);
    if (!larger)
        return false;
    *array = larger;
    *max = wanted;
    return true;
}

static bool no_memory(karst_error *error) { return karst_fail(error, KARST_FAILED, "out of memory"); }

/* ---- from gathered triangles to a chunk ---- */

static int compare_indices(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

/* Vertices get numbers of the chunk's own, in the order of the mesh's. */
static bool make_chunk(const gatherer *g, const gathered *from, karst_mesh_chunk *chunk, karst_error *error)
{
    const size_t num_indices = 3 * from->num_triangles;
    uint32_t *used = malloc(num_indices * sizeof *used), *own = malloc(num_indices * sizeof *own);
    karst_mesh_vertex *vertices = NULL;
    size_t num = 0;
    if (used && own) {
        memcpy(used, from->triangles, num_indices * sizeof *used);
        qsort(used, num_indices, sizeof *used, compare_indices);
        for (size_t i = 0; i < num_indices; i++)
            if (num == 0 || used[i] != used[num - 1])
                used[num++] = used[i];
        vertices = malloc(num * sizeof *vertices);
    }
    bool done = vertices || no_memory(error);
    for (size_t i = 0; done && i < num; i++)
        vertices[i] = g->vertices[used[i] - g->first_vertex];
    for (size_t i = 0; done && i < num_indices; i++) {
        const uint32_t *index = bsearch(&from->triangles[i / 3][i % 3], used, num, sizeof *used, compare_indices);
        own[i] = (uint32_t)(index - used);
    }
    const karst_mesh_part part = {.vertices = vertices,
                                  .triangles = (const uint32_t(*)[3])own,
                                  .num_vertices = num,
                                  .num_triangles = from->num_triangles,
                                  .cell_m = g->config->cell_m,
                                  .num_levels = g->num_levels};
    memcpy(chunk->at, from->at, sizeof chunk->at);
    done = done && karst_mesh_simplify(&part, chunk, error);
    free(used);
    free(own);
    free(vertices);
    return done;
}

typedef struct {
    const gatherer *g;
    const gathered *from;
    karst_mesh_chunk *chunks;
    atomic_size_t *next;
    size_t num;
    karst_error error;
    bool is_done;
} task;

static void *run_task(void *argument)
{
    task *t = argument;
    t->is_done = true;
    for (size_t i; t->is_done && (i = atomic_fetch_add(t->next, 1)) < t->num;)
        t->is_done = make_chunk(t->g, &t->from[i], &t->chunks[i], &t->error);
    return NULL;
}

/* Where a thread cannot be started, the others do its work. */
static bool make_chunks(const gatherer *g, const gathered *from, size_t num, karst_mesh_chunk *chunks,
                        karst_error *error)
{
    task *tasks = calloc((size_t)g->num_threads, sizeof *tasks);
    pthread_t threads[MAX_THREADS];
    bool is_running[MAX_THREADS] = {false}, done = true;
    atomic_size_t next = 0;
    if (!tasks)
        return no_memory(error);
    for (int i = 0; i < g->num_threads; i++) {
        tasks[i] = (task){.g = g, .from = from, .chunks = chunks, .next = &next, .num = num, .is_done = true};
        is_running[i] = i > 0 && (size_t)i < num && pthread_create(&threads[i], NULL, run_task, &tasks[i]) == 0;
    }
    run_task(&tasks[0]);
    for (int i = 0; i < g->num_threads; i++) {
        if (is_running[i])
            pthread_join(threads[i], NULL);
        if (done && !tasks[i].is_done)
            done = karst_fail(error, tasks[i].error.status, "%s", tasks[i].error.message);
    }
    free(tasks);
    return done;
}

static bool give_chunk(gatherer *g, const karst_mesh_chunk *chunk, karst_error *error)
{
    g->levels->num_chunks++;
    g->levels->num_vertices += chunk->num_vertices[0];
    for (int level = 0; level < g->num_levels; level++)
        g->levels->num_triangles[level] += chunk->num_triangles[level];
    return g->sink->chunk(g->sink->user, chunk, error);
}

/* All chunks of the layer. */
static bool give_layer(gatherer *g, karst_error *error)
{
    const size_t at_once = (size_t)g->num_threads * CHUNKS_OF_THREAD;
    karst_mesh_chunk *chunks = calloc(at_once, sizeof *chunks);
    bool done = chunks || no_memory(error);
    size_t num_kept = 0;
    for (size_t i = 0; i < g->num_chunks; i++) /* of some the triangles are all of their neighbours */
        if (g->chunks[i].num_triangles)
            g->chunks[num_kept++] = g->chunks[i];
    g->num_chunks = num_kept;
    for (size_t first = 0; done && first < g->num_chunks; first += at_once) {
        const size_t num = g->num_chunks - first < at_once ? g->num_chunks - first : at_once;
        done = make_chunks(g, &g->chunks[first], num, chunks, error);
        for (size_t i = 0; i < num; i++) {
            done = done && give_chunk(g, &chunks[i], error);
            karst_mesh_chunk_finish(&chunks[i]);
        }
    }
    free(chunks);
    for (size_t i = 0; i < g->num_chunks; i++)
        free(g->chunks[i].triangles);
    g->num_chunks = 0;
    g->open = NULL;
    karst_index_map_clear(&g->chunk_of);
    return done;
}

/* ---- gathering ---- */

/* What triangles of later slabs cannot ask for. */
static void drop_vertices(gatherer *g, uint64_t before)
{
    const size_t num = (size_t)(before - g->first_vertex);
    if (num == 0)
        return;
    memmove(g->vertices, g->vertices + num, (g->num_vertices - num) * sizeof *g->vertices);
    g->num_vertices -= num;
    g->first_vertex = before;
}

static bool open_chunk(gatherer *g, const int64_t at[3], karst_error *error)
{
    const uint64_t key = (uint64_t)at[0] | (uint64_t)at[1] << 32;
    const uint32_t *known = karst_index_map_find(&g->chunk_of, key);
    if (!known) {
        if (!make_room((void **)&g->chunks, g->num_chunks, 1, &g->max_chunks, sizeof *g->chunks) ||
            !karst_index_map_add(&g->chunk_of, key, (uint32_t)g->num_chunks))
            return no_memory(error);
        g->chunks[g->num_chunks++] = (gathered){.at = {at[0], at[1], at[2]}};
    }
    g->open = &g->chunks[known ? *known : g->num_chunks - 1];
    return true;
}

static bool begin_tile(void *user, const int64_t first[3], karst_error *error)
{
    gatherer *g = user;
    const int64_t slab = first[2] / KARST_TILE_CELLS;
    int64_t at[3];
    for (int axis = 0; axis < 3; axis++)
        at[axis] = first[axis] / KARST_MESH_CHUNK_CELLS;
    if (slab != g->slab) {
        const uint64_t end = g->first_vertex + g->num_vertices;
        const uint64_t last_start = slab == g->slab + 1 ? g->slab_start : end;
        if (at[2] != g->layer) {
            if (!give_layer(g, error))
                return false;
            drop_vertices(g, last_start);
        }
        g->slab = slab;
        g->layer = at[2];
        g->slab_start = end;
    }
    return open_chunk(g, at, error);
}

static bool take_vertices(void *user, const karst_mesh_vertex *vertices, size_t num, karst_error *error)
{
    gatherer *g = user;
    if (!make_room((void **)&g->vertices, g->num_vertices, num, &g->max_vertices, sizeof *g->vertices))
        return no_memory(error);
    memcpy(g->vertices + g->num_vertices, vertices, num * sizeof *vertices);
    g->num_vertices += num;
    return true;
}

static bool take_triangles(void *user, const uint32_t (*indices)[3], size_t num, karst_error *error)
{
    gatherer *g = user;
    gathered *c = g->open;
    if (!make_room((void **)&c->triangles, c->num_triangles, num, &c->max_triangles, sizeof *c->triangles))
        return no_memory(error);
    memcpy(c->triangles + c->num_triangles, indices, num * sizeof *indices);
    c->num_triangles += num;
    return true;
}

static bool pass_progress(void *user, double share)
{
    const gatherer *g = user;
    return !g->sink->progress || g->sink->progress(g->sink->user, share);
}

bool karst_mesh_find_levels(const karst_world *world, const karst_mesh_config *config, int num_levels,
                            const karst_mesh_chunk_sink *sink, karst_mesh_stats *stats, karst_mesh_level_stats *levels,
                            karst_error *error)
{
    karst_mesh_level_stats own = {0};
    gatherer g = {.config = config, .sink = sink, .levels = &own, .num_levels = num_levels, .slab = -1, .layer = -1};
    const karst_mesh_sink tiles = {take_vertices, take_triangles, pass_progress, &g};
    if (num_levels < 1 || num_levels > KARST_MESH_MAX_LEVELS)
        return karst_fail(error, KARST_USAGE, "a mesh of %d levels: 1 to %d", num_levels, KARST_MESH_MAX_LEVELS);
    g.num_threads = karst_mesh_num_threads(config);
    const bool done = karst_mesh_find_tiles(world, config, &tiles, begin_tile, stats, error) && give_layer(&g, error);
    for (size_t i = 0; i < g.num_chunks; i++)
        free(g.chunks[i].triangles);
    karst_index_map_finish(&g.chunk_of);
    free(g.chunks);
    free(g.vertices);
    if (done && levels)
        *levels = own;
    return done;
}
