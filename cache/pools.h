/* The cache from inside: the pools and the rooms that work on them. Private to cache/ and its tests. */
#ifndef KARST_CACHE_POOLS_H
#define KARST_CACHE_POOLS_H

#include "cache/cache.h"
#include "cache/commit.h"
#include "cache/lru.h"
#include "cache/slots.h"
#include "cache/store.h"

struct karst_cache {
    karst_context *context;
    karst_program *program;         /* publish.cl */
    karst_program *collect_program; /* collect.cl; NULL: no kernel of it was ever needed */
    karst_program *beside_program;  /* beside.cl; NULL: there is no store beside the land */
    karst_slots tile_slots;
    karst_lru tiles;
    karst_store land; /* its survey and eviction see to the tree's tiles, too */
    karst_store *others[KARST_CACHE_MAX_STORES - 1];
    uint32_t num_others;
    bool on_host; /* the host collects, in the pools' own memory, and the device does nothing of it */
    karst_buffer *load_nodes, *load_slots, *load_results, *subdivide_nodes, *subdivide_tiles;
    /* The open round: between collect and publish. */
    karst_store *asking; /* whose it is, or the last one was */
    uint32_t serial;
    uint32_t num_granted_bricks, num_granted_tiles;
    uint32_t *granted_bricks, *granted_tiles;
    uint32_t num_committed; /* land's brick slots below have memory, or will have soon */
    karst_commit *commit;   /* finds it; NULL until it is wanted */
    uint64_t *identities;
    bool has_names; /* these are here */
    bool has_root;
    int root_level;
    int64_t root_corner[3];
};

/* The land is store 0. */
static inline uint32_t karst_cache_num_stores(const karst_cache *cache) { return 1 + cache->num_others; }
static inline karst_store *karst_cache_store(karst_cache *cache, uint32_t i)
{
    return i ? cache->others[i - 1] : &cache->land;
}

/* round.c. A round's work without any. */
karst_work karst_cache_empty_work(const karst_cache *cache);
/* Gives slots that were granted but never published back: there is no open round afterwards. */
void karst_cache_abandon(karst_cache *cache);
/* Opens a store's round for what a cast of this serial left; one that is open is abandoned. */
void karst_cache_open_round(karst_cache *cache, karst_store *store, uint32_t serial);

/* pools.c. Builds the kernels with which the device collects, where there are none yet: a cache whose host collects is
 * made without, so that no start waits for their compiler. Errors: KARST_FAILED. */
bool karst_cache_take_kernels(karst_cache *cache, karst_error *error);

#endif
