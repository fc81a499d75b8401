#include "tests/support/pool.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void pool_expect(bool good, const char *what, const karst_error *error)
{
    if (good)
        return;
    fprintf(stderr, "%s: %s\n", what, error ? error->message : "failed");
    abort();
}

static karst_buffer *make(karst_context *context, size_t size_bytes)
{
    karst_error error = {0};
    karst_buffer *buffer = karst_buffer_create(context, "test", size_bytes, NULL, &error);
    pool_expect(buffer, "buffer", &error);
    return buffer;
}

void pool_open(pool *p, karst_context *context, uint32_t capacity, uint32_t num_segments)
{
    *p = (pool){.context = context, .capacity = capacity};
    karst_cache_buffers *cache = &p->cache;
    cache->num_tiles = 2 * capacity + 1;
    cache->num_bricks = capacity + 1;
    cache->num_segments = num_segments;
    cache->bricks_per_segment = (cache->num_bricks + num_segments - 1) / num_segments;
    cache->nodes = make(context, cache->num_tiles * KARST_TILE_NODES * sizeof(karst_node));
    cache->tile_info = make(context, cache->num_tiles * sizeof(karst_tile_info));
    cache->brick_info = make(context, cache->num_bricks * sizeof(karst_brick_info));
    for (uint32_t i = 0; i < KARST_MAX_BRICK_SEGMENTS; i++)
        cache->bricks[i] = i < num_segments ? make(context, (size_t)cache->bricks_per_segment * KARST_BRICK_STRIDE * 4)
                                            : cache->bricks[0];
    p->work.load_nodes = make(context, capacity * sizeof(uint32_t));
    p->work.load_slots = make(context, capacity * sizeof(uint32_t));
    p->work.load_results = make(context, capacity * sizeof(uint32_t));
    p->work.subdivide_nodes = make(context, capacity * sizeof(uint32_t));
    p->work.subdivide_tiles = make(context, capacity * sizeof(uint32_t));
}

void pool_close(pool *p)
{
    karst_buffer *buffers[] = {p->cache.nodes,          p->cache.tile_info,     p->cache.brick_info,
                               p->work.load_nodes,      p->work.load_slots,     p->work.load_results,
                               p->work.subdivide_nodes, p->work.subdivide_tiles};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        karst_buffer_destroy(buffers[i]);
    for (uint32_t i = 0; i < p->cache.num_segments; i++)
        karst_buffer_destroy(p->cache.bricks[i]);
}

static void put(karst_buffer *buffer, const void *data, size_t size_bytes)
{
    karst_error error = {0};
    pool_expect(karst_buffer_write(buffer, 0, data, size_bytes, &error), "write", &error);
}

static void get(karst_buffer *buffer, size_t offset_bytes, void *data, size_t size_bytes)
{
    karst_error error = {0};
    pool_expect(karst_buffer_read(buffer, offset_bytes, data, size_bytes, &error), "read", &error);
}

void pool_ask(pool *p, const pool_node *nodes, uint32_t count)
{
    pool_expect(count <= p->capacity, "pool_ask: too many nodes", NULL);
    karst_tile_info *infos = calloc(count + 1, sizeof *infos);
    uint32_t *lists = calloc(3 * (size_t)count + 1, sizeof *lists);
    pool_expect(infos && lists, "out of memory", NULL);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t child = 0;
        for (int axis = 0; axis < 3; axis++) {
            infos[i + 1].corner[axis] = nodes[i].at[axis] & ~(int64_t)1;
            child |= (uint32_t)(nodes[i].at[axis] & 1) << axis;
        }
        infos[i + 1].level = nodes[i].level;
        infos[i + 1].in_use = 1;
        lists[i] = (i + 1) * KARST_TILE_NODES + child;
        lists[count + i] = i + 1;
        lists[2 * count + i] = p->capacity + i + 1;
    }
    p->work.num_loads = p->work.num_subdivides = count;
    if (count) {
        put(p->cache.tile_info, infos, (count + 1) * sizeof *infos);
        put(p->work.load_nodes, lists, count * sizeof *lists);
        put(p->work.subdivide_nodes, lists, count * sizeof *lists);
        put(p->work.load_slots, lists + count, count * sizeof *lists);
        put(p->work.subdivide_tiles, lists + 2 * (size_t)count, count * sizeof *lists);
    }
    free(infos);
    free(lists);
}

void pool_read_results(pool *p, uint32_t *states)
{
    if (p->work.num_loads)
        get(p->work.load_results, 0, states, p->work.num_loads * sizeof *states);
}

void pool_read_brick(pool *p, uint32_t index, int16_t q[KARST_BRICK_SAMPLES], karst_brick_info *info)
{
    uint32_t slot = index + 1, segment = slot / p->cache.bricks_per_segment,
             in_segment = slot % p->cache.bricks_per_segment;
    get(p->cache.bricks[segment], (size_t)in_segment * KARST_BRICK_STRIDE * 2, q, KARST_BRICK_SAMPLES * 2);
    get(p->cache.brick_info, slot * sizeof *info, info, sizeof *info);
}

void pool_read_fine(pool *p, uint32_t index, int bits, uint32_t fine[KARST_FINE_WORDS])
{
    uint32_t slot = index + 1, segment = slot / p->cache.bricks_per_segment,
             in_segment = slot % p->cache.bricks_per_segment;
    get(p->cache.bricks[segment],
        in_segment * KARST_BRICK_BYTES((size_t)bits) + (size_t)KARST_BRICK_PADDED * (size_t)bits / 8, fine,
        KARST_FINE_BYTES);
}

void pool_read_samples(pool *p, uint32_t index, int bits, double q[KARST_BRICK_SAMPLES], karst_brick_info *info)
{
    uint32_t slot = index + 1, segment = slot / p->cache.bricks_per_segment,
             in_segment = slot % p->cache.bricks_per_segment;
    size_t sample_bytes = (size_t)bits / 8;
    union {
        int8_t bytes[KARST_BRICK_SAMPLES];
        int16_t words[KARST_BRICK_SAMPLES];
        float floats[KARST_BRICK_SAMPLES];
    } raw;
    get(p->cache.bricks[segment], in_segment * KARST_BRICK_BYTES((size_t)bits), &raw,
        KARST_BRICK_SAMPLES * sample_bytes);
    get(p->cache.brick_info, slot * sizeof *info, info, sizeof *info);
    for (int i = 0; i < KARST_BRICK_SAMPLES; i++)
        q[i] = bits == 8 ? (double)raw.bytes[i] : bits == 16 ? (double)raw.words[i] : (double)raw.floats[i];
}

void pool_read_tiles(pool *p, karst_node *nodes, karst_tile_info *infos)
{
    uint32_t count = p->work.num_subdivides;
    size_t first = p->capacity + 1;
    if (!count)
        return;
    get(p->cache.nodes, first * KARST_TILE_NODES * sizeof *nodes, nodes,
        (size_t)count * KARST_TILE_NODES * sizeof *nodes);
    get(p->cache.tile_info, first * sizeof *infos, infos, (size_t)count * sizeof *infos);
}

pool_node pool_child(pool_node node, int child)
{
    return (pool_node){
        {2 * node.at[0] + (child & 1), 2 * node.at[1] + (child >> 1 & 1), 2 * node.at[2] + (child >> 2 & 1)},
        node.level - 1};
}

uint64_t pool_hash(uint64_t hash, const void *data, size_t size_bytes)
{
    const uint8_t *bytes = data;
    for (size_t i = 0; i < size_bytes; i++)
        hash = (hash ^ bytes[i]) * 0x100000001b3u;
    return hash;
}
