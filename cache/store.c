/* A store: memory, its parts, and starting over. */
#include "cache/store.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NAME_BYTES sizeof(((karst_buffer *)0)->name)
/* Kernels address samples inside a segment by int32 byte offsets. */
#define MAX_SEGMENT_BYTES ((size_t)1 << 31)

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

/* Memory is entered in the account under the store's name; land's has none. */
static const char *account_name(const karst_store *store, const char *what, char name[NAME_BYTES])
{
    bool is_land = strcmp(store->name, KARST_STORE_LAND) == 0;
    snprintf(name, NAME_BYTES, "%s%s%s", is_land ? "" : store->name, is_land ? "" : " ", what);
    return name;
}

static karst_buffer *create(karst_store *store, const char *what, size_t size_bytes, karst_error *error)
{
    char name[NAME_BYTES];
    return karst_buffer_create(store->context, account_name(store, what, name), size_bytes, NULL, error);
}

/* Cuts the brick pool into equal segments. */
static bool create_bricks(karst_store *store, size_t max_segment_bytes, karst_error *error)
{
    karst_cache_buffers *b = &store->buffers;
    char name[NAME_BYTES];
    size_t brick_bytes = KARST_BRICK_BYTES((size_t)b->brick_bits);
    size_t limit = smaller(store->context->max_allocation_bytes, MAX_SEGMENT_BYTES);
    if (max_segment_bytes)
        limit = smaller(limit, max_segment_bytes);
    size_t num_slots = (size_t)b->num_bricks + KARST_CACHE_ROOT_BRICKS,
           num_segments = karst_cache_num_segments(store->context, b->num_bricks, max_segment_bytes, b->brick_bits);
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
        else if (!(b->bricks[i] = karst_buffer_create_blank(store->context, account_name(store, "bricks", name),
                                                            b->bricks_per_segment * brick_bytes, error)))
            return false;
    }
    return true;
}

static karst_buffer *create_uints(karst_store *store, const char *what, size_t num, karst_error *error)
{
    return create(store, what, num * sizeof(uint32_t), error);
}

static bool create_buffers(karst_store *store, size_t max_segment_bytes, karst_error *error)
{
    karst_cache_buffers *b = &store->buffers;
    size_t num_nodes = (size_t)b->num_tiles * KARST_TILE_NODES;
    size_t num_bricks = (size_t)b->num_bricks + KARST_CACHE_ROOT_BRICKS;
    /* Whole request chunks, so that passes over them need no bounds. */
    size_t num_chunks = (num_nodes + KARST_REQUEST_CHUNK - 1) / KARST_REQUEST_CHUNK,
           padded = num_chunks * KARST_REQUEST_CHUNK;
    return create_bricks(store, max_segment_bytes, error) &&
           (b->nodes = create(store, "nodes", num_nodes * sizeof(karst_node), error)) &&
           (b->brick_info = create(store, "brick_info", num_bricks * sizeof(karst_brick_info), error)) &&
           (b->brick_owner = create(store, "brick_owner", num_bricks * sizeof(karst_brick_owner), error)) &&
           (b->brick_stamp = create_uints(store, "stamps", num_bricks, error)) &&
           (b->brick_fallback = create_uints(store, "stamps", num_bricks, error)) &&
           (b->want_brick = create_uints(store, "wants", padded, error)) &&
           (b->want_children = create_uints(store, "wants", padded, error)) &&
           (b->want_chunk = create_uints(store, "wants", num_chunks, error)) &&
           (b->want_rays = create_uints(store, "wants", padded, error));
}

const char *karst_cache_brick_option(const karst_cache_buffers *buffers)
{
    return buffers->brick_bits == 8    ? " -DKARST_BRICK_BITS=8"
           : buffers->brick_bits == 32 ? " -DKARST_BRICK_BITS=32"
                                       : "";
}

static bool fill_all(karst_buffer *buffer, uint32_t value, karst_error *error)
{
    return karst_buffer_fill(buffer, value, 0, buffer->size_bytes, error);
}

/* Names go into the account of memory. */
static bool check_name(const char *name, karst_error *error)
{
    size_t length = name ? strlen(name) : 0, i = 0;
    while (i < length && (islower((unsigned char)name[i]) || isdigit((unsigned char)name[i]) || name[i] == '_'))
        i++;
    if (length > 0 && length < KARST_STORE_NAME_BYTES && i == length)
        return true;
    return karst_fail(error, KARST_USAGE, "a store named '%s': 1 to %d of a to z, 0 to 9 and _", name ? name : "",
                      KARST_STORE_NAME_BYTES - 1);
}

static bool check_config(const karst_store_config *config, karst_error *error)
{
    const int bits = config->brick_bits;
    if (!check_name(config->name, error))
        return false;
    if (bits != 0 && bits != 8 && bits != 16 && bits != 32)
        return karst_fail(error, KARST_USAGE, "bricks of %d bits a sample: it may be 8, 16 or 32", bits);
    /* A slot's number goes into 32 bits, those of the roots behind it included. */
    if (config->num_bricks < 9 || config->num_bricks > UINT32_MAX - KARST_CACHE_ROOT_BRICKS)
        return karst_fail(error, KARST_USAGE, "a store of %u bricks: at least 9, and at most %u", config->num_bricks,
                          UINT32_MAX - KARST_CACHE_ROOT_BRICKS);
    return true;
}

/* What of empty pools is not zero. */
static bool disown_bricks(karst_store *store, karst_error *error)
{
    return fill_all(store->buffers.brick_owner, KARST_NO_NODE, error);
}

bool karst_store_init(karst_store *store, karst_cache *cache, karst_context *context, const karst_cache_buffers *tree,
                      const karst_store_config *config, karst_lru *tiles, bool has_tiles, karst_program *publish,
                      karst_error *error)
{
    karst_cache_buffers *b = &store->buffers;
    if (!check_config(config, error))
        return false;
    store->context = context;
    store->cache = cache;
    snprintf(store->name, sizeof(store->name), "%s", config->name);
    b->tile_info = tree->tile_info;
    b->tile_stamp = tree->tile_stamp;
    b->num_tiles = tree->num_tiles;
    b->num_bricks = config->num_bricks;
    b->brick_bits = config->brick_bits ? config->brick_bits : 16;
    store->mapped.pools = b;
    return create_buffers(store, config->max_segment_bytes, error) &&
           karst_slots_init(&store->brick_slots, 1, b->num_bricks, error) &&
           karst_slots_init(&store->root_slots, b->num_bricks, b->num_bricks + KARST_CACHE_ROOT_BRICKS, error) &&
           karst_survey_init(&store->survey, context, b, has_tiles, error) &&
           karst_lru_init(&store->bricks, context, KARST_SURVEY_BRICKS, b, &store->survey, &store->mapped, error) &&
           karst_wants_init(&store->wants, context, b, &store->survey, &store->mapped, error) &&
           karst_evict_init(&store->evict, context, b, tiles, &store->bricks, &store->mapped, &store->churn,
                            &store->brick_slots, error) &&
           karst_publish_init(&store->publish, context, b, error) &&
           karst_publish_take_kernels(&store->publish, publish, error) && karst_churn_init(&store->churn, error) &&
           disown_bricks(store, error);
}

void karst_store_finish(karst_store *store)
{
    karst_cache_buffers *b = &store->buffers;
    karst_slots_finish(&store->brick_slots);
    karst_slots_finish(&store->root_slots);
    karst_lru_finish(&store->bricks);
    karst_survey_finish(&store->survey);
    karst_wants_finish(&store->wants);
    karst_evict_finish(&store->evict);
    karst_publish_finish(&store->publish);
    karst_churn_finish(&store->churn);
    karst_beside_finish(&store->beside);
    karst_buffer *buffers[] = {b->nodes,      b->brick_info,    b->brick_owner, b->brick_stamp, b->brick_fallback,
                               b->want_brick, b->want_children, b->want_chunk,  b->want_rays};
    for (size_t i = 0; i < sizeof(buffers) / sizeof(buffers[0]); i++)
        karst_buffer_destroy(buffers[i]);
    for (uint32_t i = 0; i < b->num_segments; i++)
        karst_buffer_destroy(b->bricks[i]);
    free(store->dropped_nodes);
    *store = (karst_store){0};
}

bool karst_store_take_kernels(karst_store *store, karst_program *program, karst_error *error)
{
    return karst_survey_take_kernels(&store->survey, program, error) &&
           karst_lru_take_kernels(&store->bricks, program, error) &&
           karst_wants_take_kernels(&store->wants, program, error) &&
           karst_evict_take_kernels(&store->evict, program, error);
}

bool karst_store_clear(karst_store *store, karst_error *error)
{
    karst_cache_buffers *b = &store->buffers;
    if (!disown_bricks(store, error) || !fill_all(b->nodes, 0, error) || !fill_all(b->brick_stamp, 0, error) ||
        !fill_all(b->brick_fallback, 0, error) || !fill_all(b->want_brick, 0, error) ||
        !fill_all(b->want_children, 0, error) || !fill_all(b->want_chunk, 0, error) ||
        !fill_all(b->want_rays, 0, error))
        return false;
    karst_slots_reset(&store->brick_slots);
    karst_slots_reset(&store->root_slots);
    karst_churn_forget(&store->churn);
    store->num_dropped = store->next_dropped = 0;
    return true;
}

void karst_store_give(karst_store *store, const uint32_t *slots, uint32_t num)
{
    while (num--) {
        bool is_root = slots[num] >= store->buffers.num_bricks;
        karst_slots_give(is_root ? &store->root_slots : &store->brick_slots, &slots[num], 1);
    }
}
