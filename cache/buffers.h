/* The pools as buffers, and a round's work: what the cache's parts, producers and rays have in common. */
#ifndef KARST_CACHE_BUFFERS_H
#define KARST_CACHE_BUFFERS_H

#include "cache/layout_shared.h"
#include "core/device/context.h"

typedef struct karst_cache karst_cache;
typedef struct karst_store karst_store;

#define KARST_STORE_LAND "land" /* the store that every cache has */
#define KARST_STORE_NAME_BYTES 16u

/* What a store is made of. Every sample of its bricks is one number, of brick_bits bits as in sample_shared.h; who has
 * more to say of a sample keeps that by slot in buffers of its own. */
typedef struct {
    const char *name;    /* 1 to 15 of a to z, 0 to 9 and _: its memory is accounted for as "NAME bricks" and so on */
    uint32_t num_bricks; /* usable slots and slot 0; at least 9 */
    size_t max_segment_bytes; /* 0: the device's largest allocation */
    int brick_bits;           /* 8, 16 or 32; 0: 16 */
} karst_store_config;

/* A store's buffers, and the tree's, as kernels of other modules take them; owned by the cache. See layout_shared.h for
 * what they hold. */
typedef struct {
    karst_buffer *nodes;     /* karst_node[num_tiles * 8]: the store's verdicts and bricks, and the tree's links */
    karst_buffer *tile_info; /* karst_tile_info[num_tiles], of the tree, which all stores share, as tile_stamp is */
    karst_buffer *bricks[KARST_MAX_BRICK_SEGMENTS]; /* karst_brick_sample[bricks_per_segment * KARST_BRICK_STRIDE] each;
                                                     * unused repeat [0] */
    uint32_t num_segments, bricks_per_segment;
    int brick_bits; /* of a sample: 8, 32, or 16, for which 0 stands, too */
    karst_buffer *brick_info;                                /* karst_brick_info[num_bricks] */
    karst_buffer *brick_owner;                               /* karst_brick_owner[num_bricks] */
    karst_buffer *tile_stamp, *brick_stamp, *brick_fallback; /* uint each */
    karst_buffer *want_brick, *want_children, *want_chunk, *want_rays; /* uint each */
    uint32_t num_tiles, num_bricks;                          /* slots, slot 0 (never used) included */
    /* Behind the num_bricks slots lie KARST_CACHE_ROOT_BRICKS more, for the root nodes' bricks alone. */
} karst_cache_buffers;

/* Bytes of device memory that a tile and a brick take in all (pool, info, stamps, lists), for sizing pools; on GPUs up
 * to a byte a brick more. */
#define KARST_CACHE_TILE_BYTES 248
#define KARST_CACHE_BRICK_BYTES_OF(bits) ((uint32_t)(KARST_BRICK_BYTES(bits) + 64))
#define KARST_CACHE_BRICK_BYTES KARST_CACHE_BRICK_BYTES_OF(16)

/* What kernels that read or write bricks are built with: "" for 16 bits. */
const char *karst_cache_brick_option(const karst_cache_buffers *buffers);

/* Allocations that a brick pool is cut into: kernels are compiled for that number. 0: one would not hold a brick. */
size_t karst_cache_num_segments(const karst_context *context, uint32_t num_bricks, size_t max_segment_bytes,
                                int brick_bits);

/* The most loads, and the most subdivides, in one round: its lists have fixed memory. */
#define KARST_CACHE_MAX_WORK 8192u

/* Root nodes' bricks have slots of their own: they are never recycled, so that there is always something to show. */
#define KARST_CACHE_ROOT_BRICKS 8u

/* The work of a round. The lists lie on the device, num_loads and num_subdivides long, and stay valid until the next
 * collect. A node may be in both. The i-th load goes to slot load_slots[i], the i-th subdivide to tile
 * subdivide_tiles[i]. */
typedef struct {
    uint32_t num_loads, num_subdivides;
    karst_buffer *load_nodes, *load_slots; /* uint: node index, brick slot */
    karst_buffer
        *load_results; /* uint: the producer writes KARST_STATE_AIR, _SOLID, _CLEAR_AIR, _CLEAR_SOLID or _BRICK; of a
                          node that was known to be clear it keeps the brick, and adds KARST_LOAD_KEPT */
    karst_buffer *subdivide_nodes, *subdivide_tiles; /* uint: node index, tile slot */
    uint32_t num_requests;                           /* all wants of this serial */
    uint32_t num_deferred_budget;                    /* left out: over the budget */
    uint32_t num_starved_bricks, num_starved_tiles;  /* left out: no slot may be recycled */
    uint32_t num_evicted_tiles, num_evicted_bricks;
    uint32_t num_reproduced;                  /* of this work, evicted within the last 100 frames */
    uint32_t num_used_tiles, num_used_bricks; /* stamped with serial */
} karst_work;

#endif
