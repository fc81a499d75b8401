/* Wants: launchers of wants.cl, and the choice of the best. */
#include "cache/wants.h"

#include <stdlib.h>
#include <string.h>

#define STAGE KARST_STAGE_COLLECT

bool karst_wants_init(karst_wants *wants, karst_context *context, karst_program *program,
                      const karst_cache_buffers *pools, karst_error *error)
{
    *wants = (karst_wants){.context = context, .shape = karst_shape_of(context), .pools = pools};
    wants->num_chunks = (uint32_t)(pools->want_chunk->size_bytes / sizeof(uint32_t));
    wants->num_counts[0] = karst_shape_chunks(&wants->shape, pools->num_tiles);
    wants->num_counts[1] = karst_shape_chunks(&wants->shape, pools->num_bricks);
    wants->num_counts[2] = karst_shape_chunks(&wants->shape, wants->num_chunks);
    size_t num_counts = (size_t)wants->num_counts[0] + wants->num_counts[1] + wants->num_counts[2];
    size_t num_chunks = wants->num_chunks, most = num_counts > num_chunks ? num_counts : num_chunks;
    wants->survey_counts = karst_buffer_create(context, "requests", num_counts * sizeof(uint32_t), NULL, error);
    wants->active = karst_buffer_create(context, "requests", num_chunks * sizeof(uint32_t), NULL, error);
    wants->marks = karst_buffer_create(context, "requests", num_chunks * (KARST_REQUEST_CHUNK / 32) * sizeof(cl_uint2),
                                       NULL, error);
    wants->counts = karst_buffer_create(context, "requests", num_chunks * sizeof(uint32_t), NULL, error);
    wants->wants = karst_buffer_create(context, "requests", KARST_WANTS_LIST * sizeof(karst_want), NULL, error);
    wants->identities =
        karst_buffer_create(context, "requests", 2 * KARST_CACHE_MAX_WORK * sizeof(uint64_t), NULL, error);
    if (!wants->survey_counts || !wants->active || !wants->marks || !wants->counts || !wants->wants ||
        !wants->identities)
        return false;
    wants->host_counts = malloc(most * sizeof(*wants->host_counts));
    wants->host_active = malloc(num_chunks * sizeof(*wants->host_active));
    wants->host_wants = malloc(KARST_WANTS_LIST * sizeof(*wants->host_wants));
    wants->loads = calloc(1, sizeof(*wants->loads));
    wants->subdivides = calloc(1, sizeof(*wants->subdivides));
    wants->spare = calloc(1, sizeof(*wants->spare));
    if (!wants->host_counts || !wants->host_active || !wants->host_wants || !wants->loads || !wants->subdivides ||
        !wants->spare)
        return karst_fail(error, KARST_FAILED, "out of memory for lists of requests");
    return (wants->survey = karst_program_kernel(program, "karst_wants_survey", error)) &&
           (wants->mark = karst_program_kernel(program, "karst_wants_mark", error)) &&
           (wants->list = karst_program_kernel(program, "karst_wants_list", error)) &&
           (wants->accept = karst_program_kernel(program, "karst_wants_accept", error));
}

void karst_wants_finish(karst_wants *wants)
{
    cl_kernel kernels[] = {wants->survey, wants->mark, wants->list, wants->accept};
    for (size_t i = 0; i < sizeof(kernels) / sizeof(kernels[0]); i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_buffer_destroy(wants->survey_counts);
    karst_buffer_destroy(wants->active);
    karst_buffer_destroy(wants->marks);
    karst_buffer_destroy(wants->counts);
    karst_buffer_destroy(wants->wants);
    karst_buffer_destroy(wants->identities);
    free(wants->host_counts);
    free(wants->host_active);
    free(wants->host_wants);
    free(wants->loads);
    free(wants->subdivides);
    free(wants->spare);
    *wants = (karst_wants){0};
}

static uint32_t sum_of(const uint32_t *counts, uint32_t num)
{
    uint32_t sum = 0;
    for (uint32_t i = 0; i < num; i++)
        sum += counts[i];
    return sum;
}

bool karst_wants_survey(karst_wants *wants, uint32_t serial, uint32_t *num_tiles, uint32_t *num_bricks, bool *any_wants,
                        karst_error *error)
{
    const karst_cache_buffers *pools = wants->pools;
    const uint32_t *num_counts = wants->num_counts;
    uint32_t num = num_counts[0] + num_counts[1] + num_counts[2];
    if (!KARST_ARGUMENTS(wants->survey, error, KARST_BUFFER_ARG(pools->tile_stamp),
                         KARST_BUFFER_ARG(pools->brick_stamp), KARST_BUFFER_ARG(pools->brick_fallback),
                         KARST_BUFFER_ARG(pools->want_chunk), KARST_VALUE_ARG(pools->num_tiles),
                         KARST_VALUE_ARG(pools->num_bricks), KARST_VALUE_ARG(wants->num_chunks),
                         KARST_VALUE_ARG(serial), KARST_BUFFER_ARG(wants->survey_counts)) ||
        !karst_launch(wants->context, wants->survey, STAGE, num, wants->shape.chunk_local, error) ||
        !karst_buffer_read(wants->survey_counts, 0, wants->host_counts, num * sizeof(uint32_t), error))
        return false;
    *num_tiles = sum_of(wants->host_counts, num_counts[0]);
    *num_bricks = sum_of(wants->host_counts + num_counts[0], num_counts[1]);
    *any_wants = sum_of(wants->host_counts + num_counts[0] + num_counts[1], num_counts[2]) != 0;
    return true;
}

void karst_wants_merge(karst_wants_choice **choice, karst_wants_choice **spare, const karst_want *more,
                       uint32_t num_more, uint32_t flag, uint32_t limit)
{
    /* A counting sort, which keeps the order of nodes within a class. */
    uint32_t at[KARST_WANT_CLASSES] = {0};
    const karst_wants_choice *old = *choice;
    karst_wants_choice *new = *spare;
    uint32_t num = old->num, sum = 0;
    for (uint32_t i = 0; i < old->num; i++)
        at[old->classes[i]]++;
    for (uint32_t i = 0; i < num_more; i++)
        if (more[i].what & flag) {
            at[more[i].what & KARST_WANT_CLASS_MASK]++;
            num++;
        }
    for (uint32_t c = 0; c < KARST_WANT_CLASSES; c++) {
        uint32_t own = at[c];
        at[c] = sum;
        sum += own;
    }
    for (uint32_t i = 0; i < old->num + num_more; i++) {
        bool kept = i < old->num;
        const karst_want *want = kept ? NULL : &more[i - old->num];
        if (want && !(want->what & flag))
            continue;
        uint16_t c = kept ? old->classes[i] : (uint16_t)(want->what & KARST_WANT_CLASS_MASK);
        uint32_t place = at[c]++;
        if (place < limit) {
            new->nodes[place] = kept ? old->nodes[i] : want->node;
            new->classes[place] = c;
        }
    }
    new->num_all = old->num_all + num - old->num;
    new->num = num < limit ? num : limit;
    *spare = *choice;
    *choice = new;
}

static bool launch_mark(karst_wants *wants, uint32_t num_active, karst_wants_view view, karst_error *error)
{
    const karst_cache_buffers *pools = wants->pools;
    return KARST_ARGUMENTS(wants->mark, error, KARST_BUFFER_ARG(wants->active), KARST_VALUE_ARG(num_active),
                           KARST_BUFFER_ARG(pools->want_brick), KARST_BUFFER_ARG(pools->want_children),
                           KARST_BUFFER_ARG(pools->nodes), KARST_BUFFER_ARG(pools->tile_info), KARST_VALUE_ARG(view),
                           KARST_BUFFER_ARG(wants->marks), KARST_BUFFER_ARG(wants->counts)) &&
           karst_launch(wants->context, wants->mark, STAGE, num_active, wants->shape.chunk_local, error);
}

static bool launch_list(karst_wants *wants, uint32_t first, uint32_t num, karst_wants_view view, karst_error *error)
{
    return KARST_ARGUMENTS(wants->list, error, KARST_BUFFER_ARG(wants->active), KARST_VALUE_ARG(first),
                           KARST_VALUE_ARG(num), KARST_BUFFER_ARG(wants->marks), KARST_BUFFER_ARG(wants->counts),
                           KARST_BUFFER_ARG(wants->pools->tile_info), KARST_BUFFER_ARG(wants->pools->want_rays),
                           KARST_VALUE_ARG(view), KARST_BUFFER_ARG(wants->wants)) &&
           karst_launch(wants->context, wants->list, STAGE, num, wants->shape.chunk_local, error);
}

/* The request chunks that carry the serial, on host and device. */
static bool find_active(karst_wants *wants, uint32_t serial, uint32_t *num_active, karst_error *error)
{
    uint32_t *chunks = wants->host_counts, num = 0;
    if (!karst_buffer_read(wants->pools->want_chunk, 0, chunks, wants->num_chunks * sizeof(*chunks), error))
        return false;
    for (uint32_t i = 0; i < wants->num_chunks; i++)
        if (chunks[i] == serial)
            wants->host_active[num++] = i;
    *num_active = num;
    return karst_cache_send(wants->active, 0, wants->host_active, num * sizeof(*wants->host_active), error);
}

bool karst_wants_choose(karst_wants *wants, uint32_t serial, uint32_t turn, const int64_t camera[3], uint32_t max_loads,
                        uint32_t max_subdivides, karst_error *error)
{
    karst_wants_view view = {
        {camera[0], camera[1], camera[2]}, serial, wants->pools->num_tiles * KARST_TILE_NODES, turn, 0};
    max_loads = max_loads < KARST_CACHE_MAX_WORK ? max_loads : KARST_CACHE_MAX_WORK;
    max_subdivides = max_subdivides < KARST_CACHE_MAX_WORK ? max_subdivides : KARST_CACHE_MAX_WORK;
    wants->loads->num = wants->loads->num_all = 0;
    wants->subdivides->num = wants->subdivides->num_all = 0;

    uint32_t num_active, *counts = wants->host_counts;
    if (!find_active(wants, serial, &num_active, error) || !launch_mark(wants, num_active, view, error) ||
        !karst_buffer_read(wants->counts, 0, counts, num_active * sizeof(*counts), error))
        return false;

    _Static_assert(KARST_REQUEST_CHUNK <= KARST_WANTS_LIST, "a chunk's wants fit the list");
    for (uint32_t first = 0, end; first < num_active; first = end) {
        /* A piece of as many chunks as fit the list; counts become places in it. */
        uint32_t num = 0;
        for (end = first; end < num_active && num + counts[end] <= KARST_WANTS_LIST; end++) {
            uint32_t own = counts[end];
            counts[end] = num;
            num += own;
        }
        if (num == 0)
            continue;
        if (!karst_cache_send(wants->counts, first * sizeof(*counts), counts + first, (end - first) * sizeof(*counts),
                              error) ||
            !launch_list(wants, first, end - first, view, error) ||
            !karst_buffer_read(wants->wants, 0, wants->host_wants, num * sizeof(*wants->host_wants), error))
            return false;
        uint64_t start_ns = karst_clock_ns();
        karst_wants_merge(&wants->loads, &wants->spare, wants->host_wants, num, KARST_WANT_BRICK, max_loads);
        karst_wants_merge(&wants->subdivides, &wants->spare, wants->host_wants, num, KARST_WANT_CHILDREN,
                          max_subdivides);
        karst_profile_add_host(wants->context, STAGE, karst_clock_ns() - start_ns);
    }
    return true;
}

bool karst_wants_accept(karst_wants *wants, karst_buffer *load_nodes, uint32_t num_loads, karst_buffer *subdivide_nodes,
                        uint32_t num_subdivides, uint32_t serial, karst_error *error)
{
    return KARST_ARGUMENTS(wants->accept, error, KARST_BUFFER_ARG(load_nodes), KARST_VALUE_ARG(num_loads),
                           KARST_BUFFER_ARG(subdivide_nodes), KARST_VALUE_ARG(num_subdivides),
                           KARST_BUFFER_ARG(wants->pools->tile_info), KARST_VALUE_ARG(serial),
                           KARST_BUFFER_ARG(wants->pools->tile_stamp), KARST_BUFFER_ARG(wants->identities)) &&
           karst_launch(wants->context, wants->accept, STAGE, num_loads + num_subdivides, wants->shape.item_local,
                        error);
}
