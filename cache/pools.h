/* The cache from inside: the pools and the rooms that work on them. Private to cache/ and its tests. */
#ifndef KARST_CACHE_POOLS_H
#define KARST_CACHE_POOLS_H

#include "cache/cache.h"
#include "cache/churn.h"
#include "cache/commit.h"
#include "cache/evict.h"
#include "cache/lru.h"
#include "cache/publish.h"
#include "cache/slots.h"
#include "cache/survey.h"
#include "cache/wants.h"

struct karst_cache {
    karst_context *context;
    karst_program *program;         /* publish.cl */
    karst_program *collect_program; /* collect.cl; NULL: no kernel of it was ever needed */
    karst_cache_buffers buffers;
    /* A slot is free (in these), granted to the work of an open round, or holds something (and then is named by what it
     * holds). */
    karst_slots tile_slots, brick_slots, root_slots;
    karst_survey survey;
    karst_lru tiles, bricks;
    karst_wants wants;
    karst_evict evict;
    karst_publish publish;
    karst_mapped mapped;
    bool on_host; /* the host collects, in the pools' own memory, and the device does nothing of it */
    karst_churn churn;
    karst_buffer *load_nodes, *load_slots, *load_results, *subdivide_nodes, *subdivide_tiles;
    /* The open round: between collect and publish. */
    uint32_t serial;
    uint32_t num_granted_bricks, num_granted_tiles;
    uint32_t *granted_bricks, *granted_tiles;
    uint32_t num_committed; /* brick slots below have memory, or will have soon */
    karst_commit *commit;   /* finds it; NULL until it is wanted */
    uint32_t root_nodes[KARST_TILE_NODES]; /* of karst_cache_root_work, until it is sent */
    uint32_t *dropped_nodes; /* whose bricks karst_cache_drop_work is to load: from next_dropped on */
    uint32_t num_dropped, next_dropped, max_dropped;
    uint64_t *identities;
    bool has_names; /* these are here */
    bool has_root, roots_loaded; /* roots_loaded: no root node wants a brick */
    int root_level;
    int64_t root_corner[3];
};

/* round.c. Gives brick slots back to where they belong. */
void karst_cache_give_bricks(karst_cache *cache, const uint32_t *slots, uint32_t num);
/* A round's work without any. */
karst_work karst_cache_empty_work(const karst_cache *cache);
/* Gives slots that were granted but never published back: there is no open round afterwards. */
void karst_cache_abandon(karst_cache *cache);

/* pools.c. Builds the kernels with which the device collects, where there are none yet: a cache whose host collects is
 * made without, so that no start waits for their compiler. Errors: KARST_FAILED. */
bool karst_cache_take_kernels(karst_cache *cache, karst_error *error);

#endif
