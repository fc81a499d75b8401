/* The pools: memory, the root tile, and starting over. */
#include "cache/pools.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Kernels address samples inside a segment by int32 byte offsets. */
#define MAX_SEGMENT_BYTES ((size_t)1 << 31)
#define MAX_LEVEL 59 /* a node's width, 2^(level + 4) voxels, is at most 2^63 */

static size_t smaller(size_t a, size_t b) { return a < b ? a : b; }

size_t karst_cache_num_segments(const karst_context *context, uint32_t num_bricks, size_t max_segment_bytes,
                                int brick_bits)
{
    size_t brick_bytes = KARST_BRICK_BYTES((size_t)(brick_bits ? brick_bits : 16));
    size_t limit = smaller(context->max_allocation_bytes, MAX_SEGMENT_BYTES);
    if (max_segment_bytes)
        limit = smaller(limit, max_segment_bytes);
    size_t most = limit / brick_bytes, num_slots = (size_t)num_bricks + KARST_CACHE_ROOT_BRICKS;
    return most ? (num_slots + most - 1) / most : 0;
}

/* Cuts the brick pool into equal segments. */
static bool create_bricks(karst_cache *cache, size_t max_segment_bytes, karst_error *error)
{
    karst_cache_buffers *b = &cache->buffers;
    size_t brick_bytes = KARST_BRICK_BYTES((size_t)b->brick_bits);
    size_t limit = smaller(cache->context->max_allocation_bytes, MAX_SEGMENT_BYTES);
    if (max_segment_bytes)
        limit = smaller(limit, max_segment_bytes);
    size_t num_slots = (size_t)b->num_bricks + KARST_CACHE_ROOT_BRICKS,
           num_segments = karst_cache_num_segments(cache->context, b->num_bricks, max_segment_bytes, b->brick_bits);
    if (num_segments == 0)
        return karst_fail(error, KARST_USAGE, "segments of %zu bytes for bricks of %zu: use larger ones", limit,
                          brick_bytes);
    if (num_segments > KARST_MAX_BRICK_SEGMENTS)
        return karst_fail(error, KARST_USAGE,
                          "%u bricks take %zu segments of %zu bytes, but %d is the limit: use a smaller pool%s",
                          b->num_bricks, num_segments, limit / brick_bytes * brick_bytes, KARST_MAX_BRICK_SEGMENTS,
                          max_segment_bytes ? " or larger segments" : "");
    b->num_segments = (uint32_t)num_segments;
    b->bricks_per_segment = (uint32_t)((num_slots + num_segments - 1) / num_segments);
    for (uint32_t i = 0; i < KARST_MAX_BRICK_SEGMENTS; i++) {
        if (i >= b->num_segments)
            b->bricks[i] = b->bricks[0];
        else if (!(b->bricks[i] =
                       karst_buffer_create_blank(cache->context, "bricks", b->bricks_per_segment * brick_bytes, error)))
            return false;
    }
    return true;
}

static karst_buffer *create_uints(karst_cache *cache, const char *name, size_t num, karst_error *error)
{
    return karst_buffer_create(cache->context, name, num * sizeof(uint32_t), NULL, error);
}

static bool create_buffers(karst_cache *cache, size_t max_segment_bytes, karst_error *error)
{
    karst_cache_buffers *b = &cache->buffers;
    size_t num_tiles = b->num_tiles, num_nodes = num_tiles * KARST_TILE_NODES;
    size_t num_bricks = (size_t)b->num_bricks + KARST_CACHE_ROOT_BRICKS;
    /* Whole request chunks, so that passes over them need no bounds. */
    size_t num_chunks = (num_nodes + KARST_REQUEST_CHUNK - 1) / KARST_REQUEST_CHUNK,
           padded = num_chunks * KARST_REQUEST_CHUNK;
    return create_bricks(cache, max_segment_bytes, error) &&
           (b->nodes = karst_buffer_create(cache->context, "nodes", num_nodes * sizeof(karst_node), NULL, error)) &&
           (b->tile_info =
                karst_buffer_create(cache->context, "tile_info", num_tiles * sizeof(karst_tile_info), NULL, error)) &&
           (b->brick_info = karst_buffer_create(cache->context, "brick_info", num_bricks * sizeof(karst_brick_info),
                                                NULL, error)) &&
           (b->brick_owner = karst_buffer_create(cache->context, "brick_owner", num_bricks * sizeof(karst_brick_owner),
                                                 NULL, error)) &&
           (b->tile_stamp = create_uints(cache, "stamps", num_tiles, error)) &&
           (b->brick_stamp = create_uints(cache, "stamps", num_bricks, error)) &&
           (b->brick_fallback = create_uints(cache, "stamps", num_bricks, error)) &&
           (b->want_brick = create_uints(cache, "wants", padded, error)) &&
           (b->want_children = create_uints(cache, "wants", padded, error)) &&
           (b->want_chunk = create_uints(cache, "wants", num_chunks, error)) &&
           (b->want_rays = create_uints(cache, "wants", padded, error)) &&
           (cache->load_nodes = create_uints(cache, "work_lists", KARST_CACHE_MAX_WORK, error)) &&
           (cache->load_slots = create_uints(cache, "work_lists", KARST_CACHE_MAX_WORK, error)) &&
           (cache->load_results = create_uints(cache, "work_lists", KARST_CACHE_MAX_WORK, error)) &&
           (cache->subdivide_nodes = create_uints(cache, "work_lists", KARST_CACHE_MAX_WORK, error)) &&
           (cache->subdivide_tiles = create_uints(cache, "work_lists", KARST_CACHE_MAX_WORK, error));
}

static bool create_rooms(karst_cache *cache, karst_error *error)
{
    const karst_cache_buffers *b = &cache->buffers;
    karst_context *context = cache->context;
    cache->granted_bricks = malloc(KARST_CACHE_MAX_WORK * sizeof(uint32_t));
    cache->granted_tiles = malloc(KARST_CACHE_MAX_WORK * sizeof(uint32_t));
    cache->identities = malloc(2 * KARST_CACHE_MAX_WORK * sizeof(uint64_t));
    if (!cache->granted_bricks || !cache->granted_tiles || !cache->identities)
        return karst_fail(error, KARST_FAILED, "out of memory for lists of work");
    return (cache->program = karst_program_build(context, "cache/publish.cl", "", NULL, 0, error)) &&
           karst_slots_init(&cache->tile_slots, KARST_ROOT_TILE + 1, b->num_tiles, error) &&
           karst_slots_init(&cache->brick_slots, 1, b->num_bricks, error) &&
           karst_slots_init(&cache->root_slots, b->num_bricks, b->num_bricks + KARST_CACHE_ROOT_BRICKS, error) &&
           karst_survey_init(&cache->survey, context, b, error) &&
           karst_lru_init(&cache->tiles, context, KARST_SURVEY_TILES, b, &cache->survey, &cache->mapped, error) &&
           karst_lru_init(&cache->bricks, context, KARST_SURVEY_BRICKS, b, &cache->survey, &cache->mapped, error) &&
           karst_wants_init(&cache->wants, context, b, &cache->survey, &cache->mapped, error) &&
           karst_evict_init(&cache->evict, context, b, &cache->tiles, &cache->bricks, &cache->mapped, error) &&
           karst_publish_init(&cache->publish, context, cache->program, b, error) &&
           karst_churn_init(&cache->churn, error);
}

bool karst_cache_take_kernels(karst_cache *cache, karst_error *error)
{
    karst_context *context = cache->context;
    const karst_pass_shape shape = karst_pass_shape_of(context);
    char options[96];
    if (cache->collect_program)
        return true;
    snprintf(options, sizeof(options), "-DKARST_CHUNK=%u -DKARST_SCAN_WIDTH=%u", shape.chunk, shape.scan_width);
    karst_program *program = karst_program_build(context, "cache/collect.cl", options, NULL, 0, error);
    return (cache->collect_program = program) && karst_survey_take_kernels(&cache->survey, program, error) &&
           karst_lru_take_kernels(&cache->tiles, program, error) &&
           karst_lru_take_kernels(&cache->bricks, program, error) &&
           karst_wants_take_kernels(&cache->wants, program, error) &&
           karst_evict_take_kernels(&cache->evict, program, error);
}

const char *karst_cache_brick_option(const karst_cache_buffers *buffers)
{
    return buffers->brick_bits == 8    ? " -DKARST_BRICK_BITS=8"
           : buffers->brick_bits == 32 ? " -DKARST_BRICK_BITS=32"
                                       : "";
}

karst_cache *karst_cache_create(karst_context *context, uint32_t num_tiles, uint32_t num_bricks,
                                size_t max_segment_bytes, karst_error *error)
{
    return karst_cache_create_of(context, num_tiles, num_bricks, max_segment_bytes, 16, error);
}

static bool fill_all(karst_buffer *buffer, uint32_t value, karst_error *error)
{
    return karst_buffer_fill(buffer, value, 0, buffer->size_bytes, error);
}

/* What of empty pools is not zero. */
static bool disown_bricks(karst_cache *cache, karst_error *error)
{
    return fill_all(cache->buffers.brick_owner, KARST_NO_NODE, error);
}

karst_cache *karst_cache_create_of(karst_context *context, uint32_t num_tiles, uint32_t num_bricks,
                                   size_t max_segment_bytes, int brick_bits, karst_error *error)
{
    if (brick_bits != 0 && brick_bits != 8 && brick_bits != 16 && brick_bits != 32) {
        karst_fail(error, KARST_USAGE, "bricks of %d bits a sample: it may be 8, 16 or 32", brick_bits);
        return NULL;
    }
    if (num_tiles < 2 || num_bricks < 9 || num_tiles > KARST_MAX_TILES) {
        karst_fail(error, KARST_USAGE, "a cache of %u tiles and %u bricks: at least 2 and 9, and at most %u tiles",
                   num_tiles, num_bricks, KARST_MAX_TILES);
        return NULL;
    }
    karst_cache *cache = calloc(1, sizeof(*cache));
    if (!cache) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    cache->context = context;
    cache->mapped.pools = &cache->buffers;
    cache->buffers.num_tiles = num_tiles;
    cache->buffers.num_bricks = num_bricks;
    cache->buffers.brick_bits = brick_bits ? brick_bits : 16;
    if (create_buffers(cache, max_segment_bytes, error) && create_rooms(cache, error) && disown_bricks(cache, error)) {
        cache->on_host = context->is_cpu && karst_mapped_is_possible(&cache->buffers);
        if (cache->on_host || karst_cache_take_kernels(cache, error))
            return cache;
    }
    karst_cache_destroy(cache);
    return NULL;
}

void karst_cache_destroy(karst_cache *cache)
{
    if (!cache)
        return;
    clFinish(cache->context->queue); /* lists that were sent but not read yet */
    karst_commit_destroy(cache->commit);
    karst_cache_buffers *b = &cache->buffers;
    karst_slots_finish(&cache->tile_slots);
    karst_slots_finish(&cache->brick_slots);
    karst_slots_finish(&cache->root_slots);
    karst_lru_finish(&cache->tiles);
    karst_lru_finish(&cache->bricks);
    karst_survey_finish(&cache->survey);
    karst_wants_finish(&cache->wants);
    karst_evict_finish(&cache->evict);
    karst_publish_finish(&cache->publish);
    karst_churn_finish(&cache->churn);
    karst_program_destroy(cache->program);
    karst_program_destroy(cache->collect_program);
    karst_buffer *buffers[] = {b->nodes,          b->tile_info,        b->brick_info,          b->brick_owner,
                               b->tile_stamp,     b->brick_stamp,      b->brick_fallback,      b->want_brick,
                               b->want_children,  b->want_chunk,       b->want_rays,           cache->load_nodes,
                               cache->load_slots, cache->load_results, cache->subdivide_nodes, cache->subdivide_tiles};
    for (size_t i = 0; i < sizeof(buffers) / sizeof(buffers[0]); i++)
        karst_buffer_destroy(buffers[i]);
    for (uint32_t i = 0; i < b->num_segments; i++)
        karst_buffer_destroy(b->bricks[i]);
    free(cache->granted_bricks);
    free(cache->granted_tiles);
    free(cache->identities);
    free(cache->dropped_nodes);
    free(cache);
}

const karst_cache_buffers *karst_cache_get_buffers(const karst_cache *cache) { return &cache->buffers; }

bool karst_cache_clear(karst_cache *cache, karst_error *error)
{
    karst_cache_buffers *b = &cache->buffers;
    if (!disown_bricks(cache, error) || !fill_all(b->tile_info, 0, error) || !fill_all(b->nodes, 0, error) ||
        !fill_all(b->tile_stamp, 0, error) || !fill_all(b->brick_stamp, 0, error) ||
        !fill_all(b->brick_fallback, 0, error) || !fill_all(b->want_brick, 0, error) ||
        !fill_all(b->want_children, 0, error) || !fill_all(b->want_chunk, 0, error) ||
        !fill_all(b->want_rays, 0, error))
        return false;
    karst_slots_reset(&cache->tile_slots);
    karst_slots_reset(&cache->brick_slots);
    karst_slots_reset(&cache->root_slots);
    karst_churn_forget(&cache->churn);
    cache->num_granted_tiles = cache->num_granted_bricks = 0;
    cache->num_dropped = cache->next_dropped = 0;
    if (!cache->has_root)
        return true;
    cache->has_root = false;
    return karst_cache_place_root(cache, cache->root_corner, cache->root_level, error);
}

/* Where node `i` of a window at `from` lies in one at `to`: 0 to 7, or -1. */
static int shifted_node(int i, const int64_t from[3], const int64_t to[3])
{
    int shifted = 0;
    for (int axis = 0; axis < 3; axis++) {
        uint64_t at = (uint64_t)from[axis] + (uint64_t)(i >> axis & 1) - (uint64_t)to[axis];
        if (at > 1)
            return -1;
        shifted |= (int)at << axis;
    }
    return shifted;
}

/* Tells what hangs on an old root node that it hangs on `node` now (KARST_NO_NODE: on nothing). */
static bool reattach(karst_cache *cache, karst_node old, uint32_t node, karst_error *error)
{
    karst_cache_buffers *b = &cache->buffers;
    uint32_t tile = KARST_NODE_CHILDREN(old.link);
    if (tile != KARST_NONE &&
        !karst_buffer_write(b->tile_info, tile * sizeof(karst_tile_info) + offsetof(karst_tile_info, parent), &node,
                            sizeof(node), error))
        return false;
    if (old.brick == KARST_NONE)
        return true;
    if (node == KARST_NO_NODE)
        karst_cache_give_bricks(cache, &old.brick, 1);
    return karst_buffer_write(b->brick_owner,
                              old.brick * sizeof(karst_brick_owner) + offsetof(karst_brick_owner, owner), &node,
                              sizeof(node), error);
}

bool karst_cache_place_root(karst_cache *cache, const int64_t corner[3], int level, karst_error *error)
{
    karst_cache_buffers *b = &cache->buffers;
    const uint32_t first_node = KARST_ROOT_TILE * KARST_TILE_NODES;
    if (level < 0 || level > MAX_LEVEL)
        return karst_fail(error, KARST_USAGE, "a root of level %d: levels go from 0 to %d", level, MAX_LEVEL);
    int64_t half =
        (int64_t)1 << (63 - KARST_BRICK_CELLS_LOG2 - level); /* nodes of this level on one side of the origin */
    for (int axis = 0; axis < 3; axis++)
        if (corner[axis] < -half || corner[axis] > half - 2)
            return karst_fail(error, KARST_USAGE, "a root at node %lld of level %d: its voxels are beyond 64 bits",
                              (long long)corner[axis], level);
    bool same_level = cache->has_root && level == cache->root_level;
    if (same_level && memcmp(corner, cache->root_corner, sizeof(cache->root_corner)) == 0)
        return true;
    karst_cache_abandon(cache);

    karst_node old_nodes[KARST_TILE_NODES] = {{0}}, new_nodes[KARST_TILE_NODES] = {{0}}; /* unknown, empty */
    karst_tile_info info = {.generation = 1};
    if (cache->has_root &&
        (!karst_buffer_read(b->nodes, first_node * sizeof(karst_node), old_nodes, sizeof(old_nodes), error) ||
         !karst_buffer_read(b->tile_info, KARST_ROOT_TILE * sizeof(info), &info, sizeof(info), error)))
        return false;
    for (int i = 0; i < KARST_TILE_NODES; i++) {
        int shifted = same_level ? shifted_node(i, cache->root_corner, corner) : -1;
        if (!reattach(cache, old_nodes[i], shifted < 0 ? KARST_NO_NODE : first_node + (uint32_t)shifted, error))
            return false;
        if (shifted >= 0)
            new_nodes[shifted] = old_nodes[i];
    }
    for (int axis = 0; axis < 3; axis++)
        cache->root_corner[axis] = info.corner[axis] = corner[axis];
    cache->root_level = info.level = level;
    info.parent = KARST_NO_NODE;
    info.in_use = 1;
    cache->has_root = true;
    cache->roots_loaded = false;
    /* Wants on root nodes mean those that stood there before. */
    size_t at = first_node * sizeof(uint32_t), size = KARST_TILE_NODES * sizeof(uint32_t);
    return karst_buffer_write(b->nodes, first_node * sizeof(karst_node), new_nodes, sizeof(new_nodes), error) &&
           karst_buffer_write(b->tile_info, KARST_ROOT_TILE * sizeof(info), &info, sizeof(info), error) &&
           karst_buffer_fill(b->want_brick, 0, at, size, error) &&
           karst_buffer_fill(b->want_children, 0, at, size, error);
}

void karst_cache_commit_ahead(karst_cache *cache, uint32_t num_bricks)
{
    const karst_cache_buffers *b = &cache->buffers;
    uint32_t end = cache->num_committed, num = cache->brick_slots.num;
    for (uint32_t i = 0; i < (num < num_bricks ? num : num_bricks); i++) {
        uint32_t slot = karst_slots_at(&cache->brick_slots, i);
        end = slot >= end ? slot + 1 : end;
    }
    if (end == cache->num_committed)
        return;
    if (!cache->commit)
        cache->commit = karst_commit_create(b);
    if (cache->commit)
        karst_commit_until(cache->commit, end);
    cache->num_committed = end;
}

bool karst_cache_count_resident(karst_cache *cache, uint32_t *num_tiles, uint32_t *num_bricks, karst_error *error)
{
    (void)error;
    *num_tiles = cache->tile_slots.capacity - cache->tile_slots.num - cache->num_granted_tiles + cache->has_root;
    *num_bricks = cache->brick_slots.capacity - cache->brick_slots.num - cache->num_granted_bricks;
    return true;
}
