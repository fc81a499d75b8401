/* A stand-in for the cache: pools with just the nodes that a test puts there, and work on them. Whatever fails ends the
 * program. */
#ifndef KARST_TESTS_SUPPORT_POOL_H
#define KARST_TESTS_SUPPORT_POOL_H

#include "cache/cache.h"

typedef struct {
    int64_t at[3]; /* node coordinate */
    int level;
} pool_node;

typedef struct {
    karst_context *context;
    karst_cache_buffers cache;
    karst_work work;   /* all nodes of the last pool_ask, to load and to subdivide */
    uint32_t capacity; /* nodes at a time */
} pool;

/* `num_segments` cuts the brick pool, 1 to KARST_MAX_BRICK_SEGMENTS. There is room for samples of 32 bits. */
void pool_open(pool *p, karst_context *context, uint32_t capacity, uint32_t num_segments);
void pool_close(pool *p);

/* Work that loads and subdivides these nodes: the i-th in slot i + 1 and in tile capacity + i + 1. */
void pool_ask(pool *p, const pool_node *nodes, uint32_t count);

/* Results of the last work, as far as a producer has answered it; they wait for the queue. */
void pool_read_results(pool *p, uint32_t *states);
void pool_read_brick(pool *p, uint32_t index, int16_t q[KARST_BRICK_SAMPLES], karst_brick_info *info);
/* The same of 8, 16 or 32 bits a sample, as doubles. */
void pool_read_samples(pool *p, uint32_t index, int bits, double q[KARST_BRICK_SAMPLES], karst_brick_info *info);
/* Its fine mask. */
void pool_read_fine(pool *p, uint32_t index, int bits, uint32_t fine[KARST_FINE_WORDS]);
void pool_read_tiles(pool *p, karst_node *nodes /* 8 each */, karst_tile_info *infos);

/* The i-th child of a node, and 64-bit FNV-1a of bytes. */
pool_node pool_child(pool_node node, int child);
uint64_t pool_hash(uint64_t hash, const void *data, size_t size_bytes);
#define POOL_HASH_START 0xcbf29ce484222325u

/* Ends the program if `good` is false. */
void pool_expect(bool good, const char *what, const karst_error *error);

#endif
