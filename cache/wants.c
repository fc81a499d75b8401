/* Wants: launchers of wants.cl, and the choice of the best. */
#include "cache/wants.h"
#include "cache/identity_shared.h"

#include <stdlib.h>
#include <string.h>

#define STAGE KARST_STAGE_COLLECT

bool karst_wants_init(karst_wants *wants, karst_context *context, const karst_cache_buffers *pools,
                      karst_survey *survey, karst_mapped *mapped, karst_error *error)
{
    *wants = (karst_wants){
        .context = context, .shape = karst_pass_shape_of(context), .pools = pools, .survey = survey, .mapped = mapped};
    size_t num_chunks = survey->num_request_chunks;
    wants->marks = karst_buffer_create(context, "requests", num_chunks * (KARST_REQUEST_CHUNK / 32) * sizeof(cl_uint2),
                                       NULL, error);
    wants->counts = karst_buffer_create(context, "requests", wants->shape.sharers * sizeof(uint32_t), NULL, error);
    wants->wants = karst_buffer_create(context, "requests", KARST_WANTS_LIST * sizeof(karst_want), NULL, error);
    wants->identities =
        karst_buffer_create(context, "requests", 2 * KARST_CACHE_MAX_WORK * sizeof(uint64_t), NULL, error);
    if (!wants->marks || !wants->counts || !wants->wants || !wants->identities)
        return false;
    wants->host_wants = malloc(KARST_WANTS_LIST * sizeof(*wants->host_wants));
    wants->loads = calloc(1, sizeof(*wants->loads));
    wants->subdivides = calloc(1, sizeof(*wants->subdivides));
    wants->spare = calloc(1, sizeof(*wants->spare));
    if (!wants->host_wants || !wants->loads || !wants->subdivides || !wants->spare)
        return karst_fail(error, KARST_FAILED, "out of memory for lists of requests");
    return true;
}

bool karst_wants_take_kernels(karst_wants *wants, karst_program *program, karst_error *error)
{
    return (wants->mark = karst_program_kernel(program, "karst_wants_mark", error)) &&
           (wants->list = karst_program_kernel(program, "karst_wants_list", error)) &&
           (wants->accept = karst_program_kernel(program, "karst_wants_accept", error));
}

void karst_wants_finish(karst_wants *wants)
{
    cl_kernel kernels[] = {wants->mark, wants->list, wants->accept};
    for (size_t i = 0; i < sizeof(kernels) / sizeof(kernels[0]); i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_buffer_destroy(wants->marks);
    karst_buffer_destroy(wants->counts);
    karst_buffer_destroy(wants->wants);
    karst_buffer_destroy(wants->identities);
    free(wants->host_wants);
    free(wants->loads);
    free(wants->subdivides);
    free(wants->spare);
    *wants = (karst_wants){0};
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

static bool launch_mark(karst_wants *wants, karst_error *error)
{
    const karst_cache_buffers *pools = wants->pools;
    const karst_pass_shape *shape = &wants->shape;
    return KARST_ARGUMENTS(wants->mark, error, KARST_BUFFER_ARG(wants->survey->active),
                           KARST_BUFFER_ARG(wants->survey->result), KARST_BUFFER_ARG(pools->want_brick),
                           KARST_BUFFER_ARG(pools->want_children), KARST_BUFFER_ARG(pools->nodes),
                           KARST_BUFFER_ARG(pools->tile_info), KARST_VALUE_ARG(wants->view),
                           KARST_BUFFER_ARG(wants->marks), KARST_BUFFER_ARG(wants->counts)) &&
           karst_launch(wants->context, wants->mark, STAGE, shape->sharers, shape->chunk_local, error);
}

static bool launch_list(karst_wants *wants, uint32_t first, karst_error *error)
{
    return KARST_ARGUMENTS(wants->list, error, KARST_BUFFER_ARG(wants->survey->active),
                           KARST_BUFFER_ARG(wants->survey->result), KARST_VALUE_ARG(first),
                           KARST_BUFFER_ARG(wants->marks), KARST_BUFFER_ARG(wants->counts),
                           KARST_BUFFER_ARG(wants->pools->tile_info), KARST_BUFFER_ARG(wants->pools->want_rays),
                           KARST_VALUE_ARG(wants->view), KARST_BUFFER_ARG(wants->wants)) &&
           karst_launch(wants->context, wants->list, STAGE, wants->shape.sharers, wants->shape.chunk_local, error);
}

static void set_view(karst_wants *wants, uint32_t serial, uint32_t turn, const int64_t camera[3])
{
    wants->view = (karst_wants_view){
        {camera[0], camera[1], camera[2]}, serial, wants->pools->num_tiles * KARST_TILE_NODES, turn, 0};
}

bool karst_wants_begin(karst_wants *wants, uint32_t serial, uint32_t turn, const int64_t camera[3], karst_error *error)
{
    set_view(wants, serial, turn, camera);
    /* Some more than last time: mostly these are all. */
    uint32_t ahead = wants->num_last + wants->num_last / 4 + 64;
    wants->num_read = ahead < KARST_WANTS_LIST ? ahead : KARST_WANTS_LIST;
    return launch_mark(wants, error) && launch_list(wants, 0, error) &&
           karst_buffer_fetch(wants->wants, 0, wants->host_wants, wants->num_read * sizeof(*wants->host_wants), error);
}

static void choose_none(karst_wants *wants)
{
    wants->loads->num = wants->loads->num_all = 0;
    wants->subdivides->num = wants->subdivides->num_all = 0;
}

/* Chooses among what was chosen and the next `num` of the list. */
static void choose_of(karst_wants *wants, uint32_t num, uint32_t max_loads, uint32_t max_subdivides)
{
    max_loads = max_loads < KARST_CACHE_MAX_WORK ? max_loads : KARST_CACHE_MAX_WORK;
    max_subdivides = max_subdivides < KARST_CACHE_MAX_WORK ? max_subdivides : KARST_CACHE_MAX_WORK;
    karst_wants_merge(&wants->loads, &wants->spare, wants->host_wants, num, KARST_WANT_BRICK, max_loads);
    karst_wants_merge(&wants->subdivides, &wants->spare, wants->host_wants, num, KARST_WANT_CHILDREN, max_subdivides);
}

bool karst_wants_choose(karst_wants *wants, uint32_t max_loads, uint32_t max_subdivides, karst_error *error)
{
    const karst_survey_result *result = &wants->survey->host_result;
    uint32_t num_all = result->num_active ? result->num_wants : 0, have = wants->num_read;
    choose_none(wants);
    wants->num_last = num_all;
    for (uint32_t first = 0; first < num_all; first += KARST_WANTS_LIST, have = 0) {
        uint32_t num = num_all - first < KARST_WANTS_LIST ? num_all - first : KARST_WANTS_LIST;
        karst_want *list = wants->host_wants;
        if ((first > 0 && !launch_list(wants, first, error)) ||
            (have < num &&
             !karst_buffer_read(wants->wants, have * sizeof(*list), list + have, (num - have) * sizeof(*list), error)))
            return false;
        uint64_t start_ns = karst_clock_ns();
        choose_of(wants, num, max_loads, max_subdivides);
        karst_profile_add_host(wants->context, STAGE, karst_clock_ns() - start_ns);
    }
    return true;
}

/* So many request chunks ahead of the one in work its stamps are asked for, and half as many ahead what is known of
 * the nodes that were asked for: where wants lie all over, each would wait for its own memory. */
#define CHUNKS_AHEAD 8u

static uint64_t asked_in(const karst_wants *wants, uint32_t chunk)
{
    const karst_mapped *m = wants->mapped;
    size_t first = (size_t)chunk * KARST_REQUEST_CHUNK;
    const karst_scan *scan = wants->survey->scan;
    uint64_t bricks, children;
    _Static_assert(KARST_REQUEST_CHUNK == KARST_SCAN_WORD, "one word for each");
    scan->equal(m->want_brick + first, 1, wants->view.serial, &bricks);
    scan->equal(m->want_children + first, 1, wants->view.serial, &children);
    return bricks | children;
}

static void expect_stamps(const karst_mapped *m, uint32_t chunk)
{
    for (size_t i = 0, first = (size_t)chunk * KARST_REQUEST_CHUNK; i < KARST_REQUEST_CHUNK; i += 16) {
        __builtin_prefetch(&m->want_brick[first + i]);
        __builtin_prefetch(&m->want_children[first + i]);
    }
}

/* Returns what was asked for. Nodes of a tile share a line of memory, and so do words of 16 nodes. */
static uint64_t expect_nodes(const karst_wants *wants, uint32_t chunk)
{
    const karst_mapped *m = wants->mapped;
    uint64_t asked = asked_in(wants, chunk);
    for (uint64_t left = asked; left;) {
        uint32_t tile_in_chunk = (uint32_t)__builtin_ctzll(left) / KARST_TILE_NODES;
        uint32_t tile = chunk * (KARST_REQUEST_CHUNK / KARST_TILE_NODES) + tile_in_chunk;
        if (tile * KARST_TILE_NODES < wants->view.num_nodes) {
            __builtin_prefetch(&m->tile_info[tile]);
            __builtin_prefetch(&m->nodes[tile * KARST_TILE_NODES]);
            __builtin_prefetch(&m->want_rays[tile * KARST_TILE_NODES]);
        }
        left &= ~((uint64_t)0xff << tile_in_chunk * KARST_TILE_NODES);
    }
    return asked;
}

void karst_wants_choose_by_host(karst_wants *wants, uint32_t serial, uint32_t turn, const int64_t camera[3],
                                uint32_t max_loads, uint32_t max_subdivides)
{
    const karst_mapped *m = wants->mapped;
    const uint32_t *active = wants->survey->host_active, num_active = wants->survey->host_result.num_active;
    uint64_t start_ns = karst_clock_ns(), asked[CHUNKS_AHEAD];
    uint32_t num = 0, num_all = 0;
    set_view(wants, serial, turn, camera);
    choose_none(wants);
    /* The item in work is the last of three. */
    for (uint32_t item = 0; item < num_active + CHUNKS_AHEAD; item++) {
        const uint32_t half = CHUNKS_AHEAD / 2;
        if (item < num_active)
            expect_stamps(m, active[item]);
        if (item >= half && item - half < num_active)
            asked[(item - half) % CHUNKS_AHEAD] = expect_nodes(wants, active[item - half]);
        if (item < CHUNKS_AHEAD)
            continue;
        uint32_t first = active[item - CHUNKS_AHEAD] * KARST_REQUEST_CHUNK;
        if (num + KARST_REQUEST_CHUNK > KARST_WANTS_LIST) {
            choose_of(wants, num, max_loads, max_subdivides);
            num_all += num;
            num = 0;
        }
        for (uint64_t left = asked[item % CHUNKS_AHEAD]; left; left &= left - 1) {
            uint32_t node = first + (uint32_t)__builtin_ctzll(left);
            uint32_t what = (m->want_brick[node] == serial ? KARST_WANT_BRICK : 0) |
                            (m->want_children[node] == serial ? KARST_WANT_CHILDREN : 0);
            what = karst_wants_of(node, what, wants->view.num_nodes, m->nodes, m->tile_info);
            if (what)
                wants->host_wants[num++] = (karst_want){
                    node, what | karst_want_place(node, &wants->view, m->want_rays[node], m->tile_info)};
        }
    }
    if (num)
        choose_of(wants, num, max_loads, max_subdivides);
    wants->survey->host_result.num_wants = num_all + num;
    karst_profile_add_host(wants->context, STAGE, karst_clock_ns() - start_ns);
}

void karst_wants_fit(karst_wants *wants, double load_ns, double subdivide_ns, double budget_ns)
{
    karst_wants_choice *loads = wants->loads, *subdivides = wants->subdivides;
    uint32_t l = loads->num > 0, s = subdivides->num > 0;
    for (double left_ns = budget_ns - l * load_ns - s * subdivide_ns;;) {
        bool has_load = l < loads->num, has_subdivide = s < subdivides->num;
        bool is_load = has_load && (!has_subdivide || loads->classes[l] < subdivides->classes[s]);
        left_ns -= is_load ? load_ns : subdivide_ns;
        if ((!has_load && !has_subdivide) || left_ns < 0)
            break;
        l += is_load;
        s += !is_load;
    }
    loads->num = l;
    subdivides->num = s;
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

void karst_wants_accept_mapped(const karst_wants *wants, uint32_t serial, uint64_t *identities)
{
    const karst_mapped *mapped = wants->mapped;
    uint64_t start_ns = karst_clock_ns();
    for (int of_children = 0; of_children < 2; of_children++) {
        const karst_wants_choice *choice = of_children ? wants->subdivides : wants->loads;
        for (uint32_t i = 0; i < choice->num; i++) {
            uint32_t ahead = choice->nodes[i + KARST_MAPPED_AHEAD < choice->num ? i + KARST_MAPPED_AHEAD : i];
            uint32_t node = choice->nodes[i], tile = node / KARST_TILE_NODES;
            __builtin_prefetch(&mapped->tile_info[ahead / KARST_TILE_NODES]);
            __builtin_prefetch(&mapped->tile_stamp[ahead / KARST_TILE_NODES], 1);
            mapped->tile_stamp[tile] = serial;
            *identities++ = karst_node_identity(of_children, node, &mapped->tile_info[tile]);
        }
    }
    karst_profile_add_host(wants->context, STAGE, karst_clock_ns() - start_ns);
}
