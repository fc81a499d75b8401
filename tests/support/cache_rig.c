#include "tests/support/cache_rig.h"
#include "cache/identity_shared.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void rig_expect(bool good, const char *what, const karst_error *error)
{
    if (good)
        return;
    fprintf(stderr, "%s: %s\n", what, error ? error->message : "failed");
    abort();
}

karst_context *rig_open_context(void)
{
    karst_error error = {0};
    const char *lanes = getenv("KARST_TEST_LANES");
    karst_context *context = karst_context_create("", lanes ? atoi(lanes) : 0, NULL, &error);
    rig_expect(context, "karst_context_create", &error);
    return context;
}

uint32_t rig_all_bricks(int level, const int64_t node[3], bool load)
{
    (void)level, (void)node;
    return load ? KARST_STATE_BRICK : KARST_STATE_LOST;
}

static void write_all(karst_buffer *buffer, const void *values)
{
    karst_error error = {0};
    rig_expect(karst_buffer_write(buffer, 0, values, buffer->size_bytes, &error), "write", &error);
}

static void read_some(karst_buffer *buffer, size_t offset_bytes, void *values, size_t size_bytes)
{
    karst_error error = {0};
    rig_expect(karst_buffer_read(buffer, offset_bytes, values, size_bytes, &error), "read", &error);
}

static void *copy_for(karst_buffer *buffer)
{
    void *copy = calloc(1, buffer->size_bytes);
    rig_expect(copy, "out of memory", NULL);
    return copy;
}

static void open_copies(cache_rig *rig)
{
    rig->pools = karst_store_get_buffers(rig->store);
    rig->num_nodes = rig->pools->num_tiles * KARST_TILE_NODES;
    rig->nodes = copy_for(rig->pools->nodes);
    rig->tiles = copy_for(rig->pools->tile_info);
    rig->owners = copy_for(rig->pools->brick_owner);
    rig->tile_stamp = copy_for(rig->pools->tile_stamp);
    rig->brick_stamp = copy_for(rig->pools->brick_stamp);
    rig->brick_fallback = copy_for(rig->pools->brick_fallback);
    rig->want_brick = copy_for(rig->pools->want_brick);
    rig->want_children = copy_for(rig->pools->want_children);
    rig->want_chunk = copy_for(rig->pools->want_chunk);
    rig->want_rays = copy_for(rig->pools->want_rays);
}

void rig_open_store(cache_rig *rig, const cache_rig *land, const char *name, uint32_t num_bricks)
{
    karst_error error = {0};
    const karst_store_config config = {.name = name, .num_bricks = num_bricks};
    *rig = (cache_rig){.context = land->context, .cache = land->cache, .content = rig_all_bricks};
    rig->store = karst_cache_add_store(land->cache, &config, &error);
    rig_expect(rig->store, "karst_cache_add_store", &error);
    open_copies(rig);
    rig_read(rig);
}

void rig_open(cache_rig *rig, karst_context *context, uint32_t num_tiles, uint32_t num_bricks, size_t max_segment_bytes,
              int level)
{
    karst_error error = {0};
    *rig = (cache_rig){.context = context, .content = rig_all_bricks};
    rig->cache = karst_cache_create(context, num_tiles, num_bricks, max_segment_bytes, &error);
    rig_expect(rig->cache, "karst_cache_create", &error);
    rig->store = karst_cache_find_store(rig->cache, KARST_STORE_LAND);
    open_copies(rig);
    rig_place_root(rig, (const int64_t[3]){-1, -1, -1}, level);
}

void rig_close(cache_rig *rig)
{
    if (rig->store == karst_cache_find_store(rig->cache, KARST_STORE_LAND))
        karst_cache_destroy(rig->cache);
    void *copies[] = {rig->nodes,       rig->tiles,          rig->owners,     rig->tile_stamp,
                      rig->brick_stamp, rig->brick_fallback, rig->want_brick, rig->want_children,
                      rig->want_chunk,  rig->want_rays};
    for (size_t i = 0; i < sizeof(copies) / sizeof(copies[0]); i++)
        free(copies[i]);
}

void rig_check(cache_rig *rig)
{
    karst_error error = {0};
    if (!rig->skip_check)
        rig_expect(karst_cache_check(rig->cache, &error), "check", &error);
}

void rig_place_root(cache_rig *rig, const int64_t corner[3], int level)
{
    karst_error error = {0};
    rig_expect(karst_cache_place_root(rig->cache, corner, level, &error), "karst_cache_place_root", &error);
    rig_check(rig);
    rig_read(rig);
}

void rig_cast(cache_rig *rig)
{
    rig->serial += rig->serial == UINT32_MAX ? 2 : 1;
    rig->frame++;
}

void rig_walk(cache_rig *rig, uint32_t node)
{
    for (; node != KARST_NO_NODE; node = rig->tiles[node / KARST_TILE_NODES].parent)
        rig->tile_stamp[node / KARST_TILE_NODES] = rig->serial;
}

void rig_use_brick(cache_rig *rig, uint32_t brick)
{
    rig->brick_stamp[brick] = rig->serial;
    rig_walk(rig, rig->owners[brick].owner);
}

void rig_use_stand_in(cache_rig *rig, uint32_t brick)
{
    rig->brick_fallback[brick] = rig->serial;
    rig_walk(rig, rig->owners[brick].owner);
}

void rig_want_brick(cache_rig *rig, uint32_t node)
{
    rig->want_brick[node] = rig->want_chunk[node / KARST_REQUEST_CHUNK] = rig->serial;
    rig_walk(rig, node);
}

void rig_want_children(cache_rig *rig, uint32_t node)
{
    rig->want_children[node] = rig->want_chunk[node / KARST_REQUEST_CHUNK] = rig->serial;
    rig_walk(rig, node);
}

void rig_end_rays(cache_rig *rig, uint32_t node, uint32_t num)
{
    rig->want_rays[node] = (rig->serial & 0xffff) << 16 | num;
}

uint32_t rig_want_class(const cache_rig *rig, uint32_t node)
{
    const karst_tile_info *tile = &rig->tiles[node / KARST_TILE_NODES];
    uint64_t gap[3];
    for (int axis = 0; axis < 3; axis++) { /* in 128 bits */
        __int128 width = (__int128)1 << (tile->level + KARST_BRICK_CELLS_LOG2);
        __int128 low = (tile->corner[axis] + (int64_t)(node >> axis & 1)) * width, c = rig->camera.voxel[axis];
        gap[axis] = (uint64_t)(c < low ? low - c : c > low + width ? c - low - width : 0);
    }
    return karst_want_class(tile->level, gap[0], gap[1], gap[2]) + rig_want_delay(rig, node);
}

uint32_t rig_want_delay(const cache_rig *rig, uint32_t node)
{
    uint32_t rays = rig->want_rays[node] >> 16 == (rig->serial & 0xffff) ? rig->want_rays[node] & 0xffff : 0;
    uint32_t delay = 64;
    for (uint32_t least = 1; least <= 128 && rays >= least; least *= 2)
        delay -= 8;
    return (node + rig->serial) % 256 == 0 ? 0 : delay;
}

void rig_write_stamps(cache_rig *rig)
{
    write_all(rig->pools->tile_stamp, rig->tile_stamp);
    write_all(rig->pools->brick_stamp, rig->brick_stamp);
    write_all(rig->pools->brick_fallback, rig->brick_fallback);
    write_all(rig->pools->want_brick, rig->want_brick);
    write_all(rig->pools->want_children, rig->want_children);
    write_all(rig->pools->want_chunk, rig->want_chunk);
    write_all(rig->pools->want_rays, rig->want_rays);
}

void rig_read(cache_rig *rig)
{
    const karst_cache_buffers *b = rig->pools;
    read_some(b->nodes, 0, rig->nodes, b->nodes->size_bytes);
    read_some(b->tile_info, 0, rig->tiles, b->tile_info->size_bytes);
    read_some(b->brick_owner, 0, rig->owners, b->brick_owner->size_bytes);
    read_some(b->tile_stamp, 0, rig->tile_stamp, b->tile_stamp->size_bytes);
    read_some(b->brick_stamp, 0, rig->brick_stamp, b->brick_stamp->size_bytes);
    read_some(b->brick_fallback, 0, rig->brick_fallback, b->brick_fallback->size_bytes);
    read_some(b->want_brick, 0, rig->want_brick, b->want_brick->size_bytes);
    read_some(b->want_children, 0, rig->want_children, b->want_children->size_bytes);
    read_some(b->want_chunk, 0, rig->want_chunk, b->want_chunk->size_bytes);
    read_some(b->want_rays, 0, rig->want_rays, b->want_rays->size_bytes);
}

void rig_collect(cache_rig *rig, uint32_t max_tiles, uint32_t max_bricks, bool may_drop_fallback)
{
    karst_error error = {0};
    karst_collect_params params = {.serial = rig->serial,
                                   .frame = rig->frame,
                                   .turn = rig->serial,
                                   .camera = rig->camera,
                                   .max_tiles = max_tiles,
                                   .max_bricks = max_bricks,
                                   .may_drop_fallback = may_drop_fallback};
    rig_write_stamps(rig);
    rig_expect(karst_finish(rig->context, &error), "karst_finish", &error);
    uint64_t start_ns = karst_clock_ns();
    rig_expect(karst_store_collect(rig->store, &params, &rig->work, &error) && karst_finish(rig->context, &error),
               "karst_store_collect", &error);
    rig->collect_ns = karst_clock_ns() - start_ns;
    read_some(rig->work.load_nodes, 0, rig->load_nodes, rig->work.num_loads * sizeof(uint32_t));
    read_some(rig->work.load_slots, 0, rig->load_slots, rig->work.num_loads * sizeof(uint32_t));
    read_some(rig->work.subdivide_nodes, 0, rig->subdivide_nodes, rig->work.num_subdivides * sizeof(uint32_t));
    read_some(rig->work.subdivide_tiles, 0, rig->subdivide_tiles, rig->work.num_subdivides * sizeof(uint32_t));
    rig_read(rig);
    rig_check(rig);
}

void rig_node_at(const cache_rig *rig, uint32_t node, int64_t at[3])
{
    for (int axis = 0; axis < 3; axis++)
        at[axis] = rig->tiles[node / KARST_TILE_NODES].corner[axis] + (node >> axis & 1);
}

uint64_t rig_node_identity(const cache_rig *rig, uint32_t node)
{
    int64_t at[3];
    rig_node_at(rig, node, at);
    return karst_identity(KARST_IDENTITY_BRICK, rig->tiles[node / KARST_TILE_NODES].level, at[0], at[1], at[2]);
}

static size_t brick_offset_bytes(const cache_rig *rig, uint32_t brick)
{
    return (size_t)(brick % rig->pools->bricks_per_segment) * KARST_BRICK_STRIDE * sizeof(int16_t);
}

uint64_t rig_brick_identity(cache_rig *rig, uint32_t brick)
{
    uint64_t identity;
    read_some(rig->pools->bricks[brick / rig->pools->bricks_per_segment], brick_offset_bytes(rig, brick), &identity,
              sizeof(identity));
    return identity;
}

static void write_some(karst_buffer *buffer, size_t offset_bytes, const void *values, size_t size_bytes)
{
    karst_error error = {0};
    rig_expect(karst_buffer_write(buffer, offset_bytes, values, size_bytes, &error), "write", &error);
}

/* Writes a load's brick, to its last byte, or says that it has none; of a node known to be clear it is kept. */
static void produce_load(cache_rig *rig, uint32_t i)
{
    uint32_t node = rig->load_nodes[i], brick = rig->load_slots[i], tile = node / KARST_TILE_NODES;
    int64_t at[3];
    rig_node_at(rig, node, at);
    uint32_t result = rig->content(rig->tiles[tile].level, at, true), known = rig_state(rig, node);
    if (known == KARST_STATE_CLEAR_AIR || known == KARST_STATE_CLEAR_SOLID)
        result |= KARST_LOAD_KEPT;
    write_some(rig->work.load_results, i * sizeof(result), &result, sizeof(result));
    if (result != KARST_STATE_BRICK && !(result & KARST_LOAD_KEPT))
        return;
    uint64_t samples[KARST_BRICK_STRIDE * sizeof(int16_t) / sizeof(uint64_t)];
    for (size_t j = 0; j < sizeof(samples) / sizeof(samples[0]); j++)
        samples[j] = rig_node_identity(rig, node);
    write_some(rig->pools->bricks[brick / rig->pools->bricks_per_segment], brick_offset_bytes(rig, brick), samples,
               sizeof(samples));
}

static void produce_tile(cache_rig *rig, uint32_t i)
{
    uint32_t node = rig->subdivide_nodes[i], tile = rig->subdivide_tiles[i];
    karst_tile_info *info = &rig->tiles[tile];
    karst_node nodes[KARST_TILE_NODES];
    int64_t at[3];
    rig_node_at(rig, node, at);
    info->level = rig->tiles[node / KARST_TILE_NODES].level - 1;
    for (int axis = 0; axis < 3; axis++)
        info->corner[axis] = 2 * at[axis];
    for (uint32_t j = 0; j < KARST_TILE_NODES; j++) {
        rig_node_at(rig, tile * KARST_TILE_NODES + j, at);
        nodes[j] = (karst_node){KARST_NODE_LINK(rig->content(info->level, at, false), KARST_NONE), KARST_NONE};
    }
    write_some(rig->pools->tile_info, tile * sizeof(*info), info, sizeof(*info));
    write_some(rig->pools->nodes, tile * sizeof(nodes), nodes, sizeof(nodes));
}

void rig_produce(cache_rig *rig)
{
    for (uint32_t i = 0; i < rig->work.num_loads; i++)
        produce_load(rig, i);
    for (uint32_t i = 0; i < rig->work.num_subdivides; i++)
        produce_tile(rig, i);
}

void rig_publish(cache_rig *rig)
{
    karst_error error = {0};
    rig_expect(karst_finish(rig->context, &error), "karst_finish", &error);
    uint64_t start_ns = karst_clock_ns();
    rig_expect(karst_cache_publish(rig->cache, &rig->work, &rig->num_linked, &rig->num_constant, &error),
               "karst_cache_publish", &error);
    rig->publish_ns = karst_clock_ns() - start_ns;
    rig_check(rig);
    rig_read(rig);
}

void rig_round(cache_rig *rig)
{
    rig_collect(rig, KARST_CACHE_MAX_WORK, KARST_CACHE_MAX_WORK, false);
    rig_produce(rig);
    rig_publish(rig);
}

uint32_t rig_state(const cache_rig *rig, uint32_t node) { return KARST_NODE_STATE(rig->nodes[node].link); }
uint32_t rig_children(const cache_rig *rig, uint32_t node) { return KARST_NODE_CHILDREN(rig->nodes[node].link); }

uint32_t rig_grow(cache_rig *rig, uint32_t node)
{
    rig_cast(rig);
    rig_want_children(rig, node);
    rig_round(rig);
    return rig_children(rig, node);
}

uint32_t rig_load(cache_rig *rig, uint32_t node)
{
    rig_cast(rig);
    rig_want_brick(rig, node);
    rig_round(rig);
    return rig->nodes[node].brick;
}

uint32_t rig_grow_chain(cache_rig *rig, uint32_t node, int num_levels)
{
    for (int i = 0; i < num_levels; i++)
        node = rig_grow(rig, node) * KARST_TILE_NODES;
    return node;
}

int rig_compare_aged(const void *a, const void *b)
{
    const rig_aged *x = a, *y = b;
    return x->age != y->age ? (x->age < y->age) - (x->age > y->age) : (x->slot > y->slot) - (x->slot < y->slot);
}
