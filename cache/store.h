/* A store from inside: bricks of one kind of content, and what the cache knows of them. Private to cache/ and its
 * tests.
 *
 * The tree of tiles is the cache's, and all stores share it. A store has an array of nodes beside the tree: its own
 * verdict and brick of each node, and the tree's link. So a store that holds nothing in a node says so (air or solid)
 * without a word on whether others need the node's children. */
#ifndef KARST_CACHE_STORE_H
#define KARST_CACHE_STORE_H

#include "cache/beside.h"
#include "cache/buffers.h"
#include "cache/churn.h"
#include "cache/evict.h"
#include "cache/lru.h"
#include "cache/mapped.h"
#include "cache/publish.h"
#include "cache/slots.h"
#include "cache/survey.h"
#include "cache/wants.h"

struct karst_store {
    karst_context *context;
    karst_cache *cache;
    char name[KARST_STORE_NAME_BYTES];
    karst_cache_buffers buffers; /* its own, but for the tree's tile_info and tile_stamp */
    /* A slot is free (in these), granted to the work of an open round, or holds something (and then is named by what it
     * holds). */
    karst_slots brick_slots, root_slots;
    karst_mapped mapped;
    karst_survey survey;
    karst_lru bricks;
    karst_wants wants;
    karst_evict evict;
    karst_publish publish;
    karst_churn churn;
    karst_beside beside; /* only where there are further stores */
    bool roots_loaded;                     /* no root node wants a brick */
    uint32_t root_nodes[KARST_TILE_NODES]; /* of karst_store_root_work, until it is sent */
    uint32_t *dropped_nodes; /* whose bricks karst_store_drop_work is to load: from next_dropped on */
    uint32_t num_dropped, next_dropped, max_dropped;
};

/* Fills in a zeroed store, empty, on a tree of which tile_info, tile_stamp and num_tiles are given. `tiles` lists the
 * tree's tiles (borrowed, and may be made later); has_tiles: its survey looks for them, too. `publish` as
 * karst_publish_take_kernels. Errors: KARST_FAILED, KARST_USAGE; karst_store_finish takes what it left. */
bool karst_store_init(karst_store *store, karst_cache *cache, karst_context *context, const karst_cache_buffers *tree,
                      const karst_store_config *config, karst_lru *tiles, bool has_tiles, karst_program *publish,
                      karst_error *error);
/* What it has of its own. The queue must be done. Zeroed is fine. */
void karst_store_finish(karst_store *store);
/* Of cache/collect.cl, where its pools are not mapped. Errors: KARST_FAILED. */
bool karst_store_take_kernels(karst_store *store, karst_program *program, karst_error *error);
/* All is unknown, and all slots are free. Errors: KARST_FAILED. */
bool karst_store_clear(karst_store *store, karst_error *error);
/* Gives brick slots back to where they belong. */
void karst_store_give(karst_store *store, const uint32_t *slots, uint32_t num);

#endif
