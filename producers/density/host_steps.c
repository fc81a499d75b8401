/* Kernels as C: see producers/density/host_steps.h. A work-item is a call. */
#include "producers/density/host_steps.h"

#include <stddef.h>

#include "producers/language/tape/tape.h"

#define KARST_GROUP 1
#define KARST_BOUNDS_GROUP 1
#define WORLD_HAS_DATA
#define WORLD_MAY_BE_THIN
#define WORLD_RAISES_THIN(data) ((((const karst_data_header *)(data))->raises_thin & KARST_RAISES_THIN) != 0u)
#define WORLD_HAS_SEAMS
#define WORLD_FILLS_SEAMS(data) ((((const karst_data_header *)(data))->raises_thin & KARST_RAISES_SEAMS) != 0u)
#define WORLD_MAY_JUMP
#define WORLD_SMOOTHS_JUMPS(data) (((const karst_data_header *)(data))->smooths_jumps != 0u)
#define WORLD_VOXEL_LOG2(data) (((const karst_data_header *)(data))->voxel_log2_m)
#define TAPE_SLOTS KARST_TAPE_MOST_SLOTS
/* The one channel, as karst_channels_lay_out places it. */
#define STAGING_STRIDE KARST_BRICK_PADDED
#define SLOT_STRIDE KARST_BRICK_PADDED
#define CHANNEL_DENSITY_STAGING 0
#define CHANNEL_DENSITY_SLOT 0

static _Thread_local uint32_t work_item;
#define get_global_id(axis) work_item
#define get_group_id(axis) work_item
#define __kernel static
#define reqd_work_group_size(x, y, z) unused
#define min(a, b) k_min(a, b)
#include "producers/steps/subdivide.cl"
#include "producers/steps/evaluate.cl"
#include "producers/steps/finalise.cl"

/* ---- what the kernels read and write, in the host's memory ---- */

#define MOST_MAPPED (KARST_MAX_BRICK_SEGMENTS + 8)

typedef struct {
    struct {
        karst_buffer *buffer;
        void *memory;
    } all[MOST_MAPPED];
    uint32_t num;
    bool good;
    karst_error *error;
} mapping;

static void *map(mapping *m, karst_buffer *buffer)
{
    for (uint32_t i = 0; i < m->num; i++) /* unused segments repeat the first */
        if (m->all[i].buffer == buffer)
            return m->all[i].memory;
    void *memory = m->good ? karst_buffer_map(buffer, m->error) : NULL;
    m->good = memory != NULL;
    if (m->good) {
        m->all[m->num].buffer = buffer;
        m->all[m->num++].memory = memory;
    }
    return memory;
}

/* Returns whether all went well. */
static bool unmap_all(mapping *m)
{
    for (uint32_t i = 0; i < m->num; i++)
        m->good = karst_buffer_unmap(m->all[i].buffer, m->all[i].memory, m->good ? m->error : NULL) && m->good;
    return m->good;
}

/* ---- the steps ---- */

bool karst_host_subdivide_tiles(const karst_cache_buffers *cache, const karst_work *work, karst_buffer *data,
                                karst_error *error)
{
    uint32_t count = work->num_subdivides * KARST_TILE_NODES;
    mapping m = {.good = true, .error = error};
    const uint *list = map(&m, work->subdivide_nodes), *slots = map(&m, work->subdivide_tiles);
    karst_node *nodes = map(&m, cache->nodes);
    karst_tile_info *tile_info = map(&m, cache->tile_info);
    world_data words = map(&m, data);
    uint64_t start_ns = karst_clock_ns();
    work_item = 0;
    if (m.good)
        karst_bound_nodes(list, slots, 0, count, count, BOXES_OF_TILES, nodes, tile_info, NULL, NULL, NULL, words);
    karst_profile_add_host(data->context, KARST_STAGE_SUBDIVIDE, karst_clock_ns() - start_ns);
    return unmap_all(&m);
}

bool karst_host_bound_loads(const karst_cache_buffers *cache, const karst_work *work, uint32_t first, uint32_t count,
                            karst_buffer *loads, karst_buffer *data, karst_error *error)
{
    mapping m = {.good = true, .error = error};
    const uint *list = map(&m, work->load_nodes);
    karst_node *nodes = map(&m, cache->nodes);
    karst_tile_info *tile_info = map(&m, cache->tile_info);
    karst_load *to = map(&m, loads);
    world_data words = map(&m, data);
    uint64_t start_ns = karst_clock_ns();
    work_item = 0;
    if (m.good)
        karst_bound_nodes(list, NULL, first, count, count, BOXES_OF_LOADS, nodes, tile_info, to, NULL, NULL, words);
    karst_profile_add_host(data->context, KARST_STAGE_EVALUATE, karst_clock_ns() - start_ns);
    return unmap_all(&m);
}

bool karst_host_bound_clear_loads(const karst_cache_buffers *cache, const karst_work *work, uint32_t first,
                                  uint32_t count, karst_buffer *least, karst_buffer *data, karst_error *error)
{
    mapping m = {.good = true, .error = error};
    const uint *list = map(&m, work->load_nodes);
    karst_node *nodes = map(&m, cache->nodes);
    karst_tile_info *tile_info = map(&m, cache->tile_info);
    const float *from = map(&m, least);
    uint *results = map(&m, work->load_results);
    world_data words = map(&m, data);
    uint64_t start_ns = karst_clock_ns();
    work_item = 0;
    if (m.good)
        karst_bound_nodes(list, NULL, first, count, count, BOXES_OF_LOADED, nodes, tile_info, NULL, from, results,
                          words);
    karst_profile_add_host(data->context, KARST_STAGE_EVALUATE, karst_clock_ns() - start_ns);
    return unmap_all(&m);
}

bool karst_host_evaluate_bricks(karst_buffer *loads, uint32_t count, karst_buffer *staging, karst_buffer *scrubs,
                                karst_buffer *data, bool (*goes_on)(void *user), void *user, bool *finished,
                                karst_error *error)
{
    mapping m = {.good = true, .error = error};
    const karst_load *from = map(&m, loads);
    float *samples = map(&m, staging);
    karst_scrub *scrubbed = map(&m, scrubs);
    world_data words = map(&m, data);
    uint64_t start_ns = karst_clock_ns();
    *finished = true;
    for (uint32_t i = 0; m.good && i < count && *finished; i++) {
        work_item = i;
        *finished = goes_on(user);
        if (*finished)
            karst_evaluate_bricks(from, count, samples, scrubbed, words);
    }
    karst_profile_add_host(data->context, KARST_STAGE_EVALUATE, karst_clock_ns() - start_ns);
    return unmap_all(&m);
}

bool karst_host_finalise_bricks(const karst_cache_buffers *cache, const karst_work *work, uint32_t first,
                                uint32_t count, karst_buffer *loads, karst_buffer *staging, karst_buffer *scrubs,
                                karst_buffer *total, karst_error *error)
{
    mapping m = {.good = true, .error = error};
    const karst_load *from = map(&m, loads);
    float *samples = map(&m, staging);
    const uint *slots = map(&m, work->load_slots);
    uint *results = map(&m, work->load_results);
    karst_brick_info *info = map(&m, cache->brick_info);
    karst_scrub *scrubbed = map(&m, scrubs);
    karst_scrub_total *sum = map(&m, total);
    karst_brick_sample *b[KARST_MAX_BRICK_SEGMENTS];
    for (int i = 0; i < KARST_MAX_BRICK_SEGMENTS; i++)
        b[i] = map(&m, cache->bricks[i]);
    uint64_t start_ns = karst_clock_ns();
    for (work_item = 0; m.good && work_item < count; work_item++)
        karst_finalise_bricks(from, samples, first, count, slots, results, info, scrubbed, NULL,
                              cache->bricks_per_segment, b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]);
    if (m.good)
        tally(from, scrubbed, count, sum);
    karst_profile_add_host(loads->context, KARST_STAGE_FINALISE, karst_clock_ns() - start_ns);
    return unmap_all(&m);
}
