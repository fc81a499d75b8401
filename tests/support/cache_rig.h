/* A cache driven by hand: stamps are written by the test instead of rays, content comes from a function instead of a
 * producer. Whatever fails ends the program; the cache's own check runs after each step. */
#ifndef KARST_TESTS_SUPPORT_CACHE_RIG_H
#define KARST_TESTS_SUPPORT_CACHE_RIG_H

#include "cache/pools.h"

/* What is in a node: `load` false: what bounds prove (KARST_STATE_AIR, _SOLID, or _LOST for "nothing"), true: what
 * comes of loading it
 * (_AIR, _SOLID, _BRICK, or _UNKNOWN for "the producer did not answer"). */
typedef uint32_t (*rig_content)(int level, const int64_t node[3], bool load);

typedef struct {
    karst_context *context;
    karst_cache *cache;
    karst_store *store; /* the land, or one that rig_open_store added to another rig's cache */
    const karst_cache_buffers *pools;
    rig_content content; /* rig_all_bricks at first */
    karst_position camera;
    uint32_t serial, frame;
    uint32_t num_nodes;
    /* Copies of the pools. The test writes stamps and wants here; rig_collect takes them to the device and brings all
     * back. */
    karst_node *nodes;
    karst_tile_info *tiles;
    karst_brick_owner *owners;
    uint32_t *tile_stamp, *brick_stamp, *brick_fallback, *want_brick, *want_children, *want_chunk, *want_rays;
    karst_work work; /* of the last rig_collect, and copies of its lists */
    uint32_t load_nodes[KARST_CACHE_MAX_WORK], load_slots[KARST_CACHE_MAX_WORK];
    uint32_t subdivide_nodes[KARST_CACHE_MAX_WORK], subdivide_tiles[KARST_CACHE_MAX_WORK];
    uint32_t num_linked, num_constant; /* of the last rig_publish */
    bool skip_check;                   /* for timing */
    uint64_t collect_ns, publish_ns;   /* wall clock of the last ones */
} cache_rig;

/* The first device; KARST_TEST_LANES=1 for tools whose device takes no more. */
karst_context *rig_open_context(void);

uint32_t rig_all_bricks(int level, const int64_t node[3], bool load);

/* A rig on a root tile at (-1, -1, -1) of `level`, camera at the origin. */
void rig_open(cache_rig *rig, karst_context *context, uint32_t num_tiles, uint32_t num_bricks, size_t max_segment_bytes,
              int level);
/* A rig on a further store of a rig's cache, which is closed after it. Casts of both may have one serial; what they
 * have in common of the tree is brought up to date by rig_read. */
void rig_open_store(cache_rig *rig, const cache_rig *land, const char *name, uint32_t num_bricks);
void rig_close(cache_rig *rig);
void rig_place_root(cache_rig *rig, const int64_t corner[3], int level);

/* The next cast: a new serial (never 0) and frame. */
void rig_cast(cache_rig *rig);
/* Stamps of that cast. rig_walk stamps the tile of a node and all above it. */
void rig_walk(cache_rig *rig, uint32_t node);
void rig_use_brick(cache_rig *rig, uint32_t brick);    /* walks to its owner too */
void rig_use_stand_in(cache_rig *rig, uint32_t brick); /* likewise */
void rig_want_brick(cache_rig *rig, uint32_t node);    /* likewise */
void rig_want_children(cache_rig *rig, uint32_t node);
void rig_end_rays(cache_rig *rig, uint32_t node, uint32_t num); /* so many end in it, on a stand-in */
/* The class that a node's wants have, the plain way: by their error, and how long they wait by their rays. */
uint32_t rig_want_class(const cache_rig *rig, uint32_t node);
uint32_t rig_want_delay(const cache_rig *rig, uint32_t node);

void rig_collect(cache_rig *rig, uint32_t max_tiles, uint32_t max_bricks, bool may_drop_fallback);
void rig_produce(cache_rig *rig);
void rig_publish(cache_rig *rig);
/* All three, with room for all work. */
void rig_round(cache_rig *rig);
/* Subdivides or loads one node in a cast and a round of their own; returns the tile or brick. */
uint32_t rig_grow(cache_rig *rig, uint32_t node);
uint32_t rig_load(cache_rig *rig, uint32_t node);
/* A chain of tiles from a node downwards; returns the last one's node 0. */
uint32_t rig_grow_chain(cache_rig *rig, uint32_t node, int num_levels);
uint32_t rig_state(const cache_rig *rig, uint32_t node);
uint32_t rig_children(const cache_rig *rig, uint32_t node);
/* Brings the copies up to date. */
void rig_read(cache_rig *rig);
/* Takes stamps and wants to the device. */
void rig_write_stamps(cache_rig *rig);
void rig_check(cache_rig *rig);

/* The name that the producer wrote into a brick's samples; see identity_shared.h. */
uint64_t rig_brick_identity(cache_rig *rig, uint32_t brick);
uint64_t rig_node_identity(const cache_rig *rig, uint32_t node);
void rig_node_at(const cache_rig *rig, uint32_t node, int64_t at[3]);

/* Ends the program if `good` is false. */
void rig_expect(bool good, const char *what, const karst_error *error);

/* A slot in the order of recycling, oldest first, for qsort: what lists are compared with. */
typedef struct {
    uint32_t age, slot;
} rig_aged;
int rig_compare_aged(const void *a, const void *b);

#endif
