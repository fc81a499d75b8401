/* The cache: node pool and brick pool in fixed memory; what rays asked for, what may be recycled, what is linked.
 *
 * One round: rays are cast (they store stamps) -> karst_cache_collect (turns wants into work, frees what is recycled)
 * -> the producers fill the work's slots, which no ray can reach -> karst_cache_publish links them. Everything is
 * deterministic: the same stamps give the same work in the same order. Not thread-safe.
 *
 * What is said here of a cache is said of its land. Further stores are added below.
 */
#ifndef KARST_CACHE_CACHE_H
#define KARST_CACHE_CACHE_H

#include "cache/buffers.h"
#include "karst/position.h"

/* num_tiles and num_bricks count usable slots and slot 0; at least 2 tiles and 9 bricks. max_segment_bytes 0: the
 * device's largest allocation. Errors: KARST_FAILED, KARST_USAGE (more than KARST_MAX_BRICK_SEGMENTS segments or
 * KARST_MAX_TILES). */
karst_cache *karst_cache_create(karst_context *context, uint32_t num_tiles, uint32_t num_bricks,
                                size_t max_segment_bytes, karst_error *error);
/* With bricks of 8, 16 or 32 bits a sample (0: 16). */
karst_cache *karst_cache_create_of(karst_context *context, uint32_t num_tiles, uint32_t num_bricks,
                                   size_t max_segment_bytes, int brick_bits, karst_error *error);
void karst_cache_destroy(karst_cache *cache);
/* The land's. */
const karst_cache_buffers *karst_cache_get_buffers(const karst_cache *cache);

/* Places the root tile: its child 0 is node `corner` of `level`. Nodes that the old and the new window share (same
 * level) keep their subtree; subtrees that left are orphaned and recycled in time. New root nodes are
 * KARST_STATE_UNKNOWN. A first call, or one with another level, starts from an empty root. */
bool karst_cache_place_root(karst_cache *cache, const int64_t corner[3], int level, karst_error *error);
/* Forgets all content (the world changed). */
bool karst_cache_clear(karst_cache *cache, karst_error *error);

typedef struct {
    uint32_t serial;       /* of the cast whose stamps count as "in use" */
    uint32_t frame;        /* for age and churn.reproduced */
    karst_position camera; /* priority: projected error (2^level over the distance to the node's box), coarse first;
                              later where few of the picture's rays end, or none (karst_want_delay); ties by
                              node index */
    uint32_t turn;         /* counts rounds; modulo 256 says which nodes' wants do not wait for others */
    uint32_t max_tiles, max_bricks; /* budget of this round; each at most KARST_CACHE_MAX_WORK counts */
    /* With a budget_ns, loads and subdivides stand in one queue, at these prices, and as many are chosen as fit; of
     * each kind at least one. 0: the maxima alone. */
    double load_ns, subdivide_ns, budget_ns;
    bool may_drop_fallback;         /* bricks that are only in use as a stand-in may be recycled too, by slot */
} karst_collect_params;

/* The work of loading the root nodes that have neither brick nor proof, such as when the root was placed anew: answer
 * and publish it before the next cast, and no ray ever meets a region without data. work->num_loads is 0 when there is
 * nothing to do, which is told at once. Ends an open round. */
bool karst_cache_root_work(karst_cache *cache, uint32_t serial, karst_work *work, karst_error *error);

/* A box of level-0 voxels, corners included, and how far beyond it content of level l changed: margin_voxels << l. */
typedef struct {
    int64_t min[3], max[3];
    uint32_t margin_voxels;
} karst_drop_box;

typedef struct {
    uint64_t num_nodes, num_bricks; /* nodes that forgot what they were, and bricks of theirs */
} karst_dropped;

/* Forgets, in every store, what is known of every node that one of the boxes meets: verdicts, and bricks, whose slots
 * are free again; children stay. Only between publish and the next cast. Their bricks that the cast of `serial` used
 * are worked on anew by karst_cache_drop_work, and karst_store_drop_work. Adds to *dropped. Waits for the device.
 * Errors: KARST_FAILED. */
bool karst_cache_drop(karst_cache *cache, const karst_drop_box *boxes, size_t num_boxes, uint32_t serial,
                      karst_dropped *dropped, karst_error *error);
/* The same in one store alone. */
bool karst_store_drop(karst_store *store, const karst_drop_box *boxes, size_t num_boxes, uint32_t serial,
                      karst_dropped *dropped, karst_error *error);
/* The work of loading those bricks, coarse ones first, as karst_cache_root_work: to be asked until num_loads is 0. What
 * was dropped is on the next picture at the level that it had. */
bool karst_cache_drop_work(karst_cache *cache, uint32_t serial, karst_work *work, karst_error *error);

/* ---- further stores ----
 *
 * A store is one kind of content of the world (land; clear matter; air) on the cache's tree: bricks, their info and
 * owners, stamps, wants, slots and usage lists of its own. Tiles are shared, and so is what is known of their places.
 *
 * Each store has an array of nodes beside the tree, by the same numbers: nodes[n].link is its verdict of node n with
 * the tree's link, nodes[n].brick its brick. So "this store holds nothing here" (its verdict is air or solid) and
 * "there is nothing to subdivide" (no link) are two facts: where the land is air, clear matter may own bricks, many
 * levels down. A ray of a store walks its nodes exactly as a ray of the land walks the land's: a caster that is made
 * with a store's buffers (raycast/cast/cast.h) casts into that store, and its stamps and wants are that store's.
 *
 * A store's rounds are like the land's, one after another, with any serial: karst_store_collect, producers,
 * karst_cache_publish. Its loads are answered by its own producer with its own buffers. The work's subdivides make
 * tiles of the tree, so every store's producer bounds them in that store's buffers (producers/stores.h sees to that): a
 * store that does not knows nothing of its nodes there, and shows what is above until they are loaded.
 *
 * A cache without further stores has no memory and no kernels for them. */
#define KARST_CACHE_MAX_STORES 4u /* the land included */

/* Adds an empty store, which lives as long as the cache. Between publish and the next cast; an open round is
 * abandoned. Waits for the device. Errors (NULL): KARST_FAILED; KARST_USAGE (its configuration, a name that there is,
 * too many). */
karst_store *karst_cache_add_store(karst_cache *cache, const karst_store_config *config, karst_error *error);
karst_store *karst_cache_find_store(karst_cache *cache, const char *name); /* KARST_STORE_LAND, too. NULL: none */
const char *karst_store_name(const karst_store *store);
/* Forgets all content of a further store: what it is of has changed. The tree and the others stay. Only between publish
 * and the next cast. Errors: KARST_FAILED. */
bool karst_store_forget(karst_store *store, karst_error *error);
/* As long as the store. */
const karst_cache_buffers *karst_store_get_buffers(const karst_store *store);
/* Device memory that a further store takes at most: for each tile of the tree, and once, for lists of work. Its bricks
 * take KARST_CACHE_BRICK_BYTES_OF(bits) each, as the land's. */
#define KARST_STORE_TILE_BYTES 168
#define KARST_STORE_FIXED_BYTES 2200000
/* As karst_cache_collect, karst_cache_root_work and karst_cache_drop_work, which are the land's. Of what is recycled,
 * tiles are the tree's, with the bricks that any store has there. num_used_tiles counts in the land's rounds alone. */
bool karst_store_collect(karst_store *store, const karst_collect_params *params, karst_work *work, karst_error *error);
bool karst_store_root_work(karst_store *store, uint32_t serial, karst_work *work, karst_error *error);
bool karst_store_drop_work(karst_store *store, uint32_t serial, karst_work *work, karst_error *error);
/* Brick slots that hold something, the root bricks' own left out. */
uint32_t karst_store_count_resident(const karst_store *store);

/* Turns the stamps of params->serial into work: compaction of wants, order by priority, choice of slots (never-used
 * ones first, then the least recently used that are unstamped and, for tiles, childless), eviction of what held them
 * (unlinked from its parent or owner, checked by generation both ways). Waits for the device once;
 * where its memory is not the host's (karst_buffer_memory), once more if something is evicted. Time goes to
 * KARST_STAGE_COLLECT. */
bool karst_cache_collect(karst_cache *cache, const karst_collect_params *params, karst_work *work, karst_error *error);

/* Links what the producers wrote for the store whose round it is: a load that came out KARST_STATE_BRICK gets its
 * node's brick, a constant one makes the node constant (its slot stays free; children it had are orphaned, but stay if
 * there are further stores), a clear one leaves the children and needs no slot either, unless it was kept, and is
 * wanted no longer; a subdivided node gets its tile. Slots that were not used are the next to be handed out.
 * *num_bricks_constant counts air and solid only; either count may be NULL. Only call it between casts. */
bool karst_cache_publish(karst_cache *cache, const karst_work *work, uint32_t *num_bricks_linked,
                         uint32_t *num_bricks_constant, karst_error *error);

/* Sees to it that memory will lie behind the next num_bricks bricks that get slots (karst_buffer_commit), and behind
 * all that there is of slots beside bricks, by a thread beside: pages are found when they are first touched, which is
 * no time to be spent while a budget runs. */
void karst_cache_commit_ahead(karst_cache *cache, uint32_t num_bricks);

/* Runs the kernels of a round once each, the last first, and waits for them: for drivers that compile a kernel when it
 * first runs. Those that recycle are left out: a first picture does not need them; where the host collects, all that it
 * does. Only for a new cache that is destroyed then. */
bool karst_cache_rehearse(karst_cache *cache, karst_error *error);
/* Those that a collect begins with, the first first, before rays of that serial are cast: they read the pools, and
 * nothing of what they find is kept. Not while a round is open. */
bool karst_cache_rehearse_look(karst_cache *cache, uint32_t serial, karst_error *error);

/* Slots that hold something, the root bricks' own left out. */
bool karst_cache_count_resident(karst_cache *cache, uint32_t *num_tiles, uint32_t *num_bricks, karst_error *error);

/* Debug pass on the host: every link, attachment and generation valid and mutual; no slot
 * is both free and referenced; no cycle; levels and corners of children agree with their parents'. false: error names
 * the first fault. */
bool karst_cache_check(karst_cache *cache, karst_error *error);

#endif
