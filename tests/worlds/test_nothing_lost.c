/* Nothing is lost in a shipped world: what its bounds or samples call constant has no surface in it, for any footprint
 * from 0 to the parent's voxel. Trees are built by the real kernels around a place that the camera sees; constant nodes
 * are searched with the host's oracle. And the search is good enough: where nodes are called constant by samples alone,
 * it finds the surface that was lost. KARST_TEST_FULL=1 searches twenty times as many nodes. */
#include <math.h>

#include "producers/load_shared.h"
#include "tests/worlds/shipped.h"

#define TOP_LEVEL 9
#define CAPACITY (64 * KARST_TILE_NODES)
#define MAX_KEPT 64 /* nodes that go on to the next level */
#define GRID_FULL 8
#define GRID_FOOTPRINTS 4

static bool is_full(void) { return getenv("KARST_TEST_FULL") != NULL; }

typedef struct {
    pool_node node;
    uint32_t state;
    bool by_samples; /* proven by finalise rather than by bounds */
} constant_node;

typedef struct {
    constant_node *nodes;
    uint32_t count, num_by_samples;
} constant_list;

static void add(constant_list *list, pool_node node, uint32_t state, bool by_samples)
{
    if ((list->count & (list->count - 1)) == 0)
        list->nodes = realloc(list->nodes, (list->count ? 2 * (size_t)list->count : 1) * sizeof *list->nodes);
    assert_non_null(list->nodes);
    list->nodes[list->count++] = (constant_node){node, state, by_samples};
    list->num_by_samples += by_samples;
}

static karst_producer *make_producer(karst_context *context, const shipped_world *world, const char *finalise_options)
{
    karst_error error = {0};
    char options[KARST_WORLD_FILE_OPTIONS_BYTES];
    karst_density_program program;
    void *data = karst_world_file_data(world->file, world->file->info.seed, &error);
    pool_expect(data, world->name, &error);
    karst_world_file_program(world->file, data, options, &program);
    program.max_loads = CAPACITY;
    program.finalise_options = finalise_options;
    karst_producer *producer = karst_density_producer_create_program(context, &program, &error);
    pool_expect(producer, world->name, &error);
    free(data);
    return producer;
}

/* Loads the open nodes: those that come out constant go to the list, the others stay. */
static uint32_t load(karst_producer *producer, pool *p, pool_node *open, uint32_t num_open, constant_list *constants)
{
    static uint32_t states[CAPACITY];
    karst_error error = {0};
    uint32_t num_left = 0;
    pool_ask(p, open, num_open);
    p->work.num_subdivides = 0;
    pool_expect(karst_producer_answer(producer, &p->cache, &p->work, &error), "load", &error);
    pool_read_results(p, states);
    for (uint32_t i = 0; i < num_open; i++)
        if (states[i] == KARST_STATE_AIR || states[i] == KARST_STATE_SOLID)
            add(constants, open[i], states[i], true);
        else
            open[num_left++] = open[i];
    return num_left;
}

/* A spread of the open nodes is replaced by their children, as far as those are not constant. */
static uint32_t subdivide(karst_producer *producer, pool *p, pool_node *open, uint32_t num_open,
                          constant_list *constants)
{
    static karst_node nodes[CAPACITY];
    static karst_tile_info infos[CAPACITY];
    pool_node parents[MAX_KEPT] = {{.level = 0}};
    karst_error error = {0};
    uint32_t num_parents = num_open < MAX_KEPT ? num_open : MAX_KEPT, num_children = 0;
    for (uint32_t i = 0; i < num_parents; i++)
        parents[i] = open[(uint64_t)i * num_open / num_parents];
    pool_ask(p, parents, num_parents);
    p->work.num_loads = 0;
    pool_expect(karst_producer_answer(producer, &p->cache, &p->work, &error), "subdivide", &error);
    pool_read_tiles(p, nodes, infos);
    for (uint32_t i = 0; i < num_parents * KARST_TILE_NODES; i++) {
        pool_node child = pool_child(parents[i / KARST_TILE_NODES], (int)(i % KARST_TILE_NODES));
        uint32_t state = KARST_NODE_STATE(nodes[i].link);
        if (state == KARST_STATE_LOST)
            open[num_children++] = child;
        else
            add(constants, child, state, false);
    }
    return num_children;
}

/* From the 2x2x2 nodes around a place that the camera sees down to level 0. */
static void build_tree(const shipped_world *world, const char *finalise_options, constant_list *constants)
{
    static pool_node open[CAPACITY];
    karst_context *context = shipped_context(0);
    karst_producer *producer = make_producer(context, world, finalise_options);
    uint32_t num_open = 0;
    pool p;
    pool_open(&p, context, CAPACITY, 1);
    for (int i = 0; i < 8; i++) {
        pool_node node = {.level = TOP_LEVEL};
        for (int axis = 0; axis < 3; axis++)
            node.at[axis] =
                ((world->surface[axis] >> (TOP_LEVEL + KARST_BRICK_CELLS_LOG2 - 1)) + 1) / 2 - 1 + (i >> axis & 1);
        open[num_open++] = node;
    }
    for (int level = TOP_LEVEL; num_open && level >= 0; level--) {
        num_open = load(producer, &p, open, num_open, constants);
        if (num_open && level > 0)
            num_open = subdivide(producer, &p, open, num_open, constants);
    }
    pool_close(&p);
    karst_producer_destroy(producer);
    karst_context_destroy(context);
}

/* How far the density at a point of a node is on the wrong side for its state: above 0 it is. `at`: 2^32 from corner to
 * corner. */
static float wrongness(shipped_world *world, const constant_node *constant, const uint64_t at[3], int footprint)
{
    int64_t voxel[3];
    uint32_t fraction[3];
    int level = constant->node.level, shift = level + KARST_BRICK_CELLS_LOG2;
    for (int axis = 0; axis < 3; axis++) {
        voxel[axis] = karst_node_origin(constant->node.at[axis], level) + (int64_t)((at[axis] << shift) >> 32);
        fraction[axis] = (uint32_t)(at[axis] << shift);
    }
    float d = shipped_density(world, voxel, fraction, footprint);
    return constant->state == KARST_STATE_AIR ? d : d == 0.0f ? 0x1p-126f : -d;
}

/* At one footprint: jittered points with the corners among them, then a search around the worst. */
static bool find_surface(shipped_world *world, const constant_node *constant, int footprint, int grid)
{
    const uint64_t one = (uint64_t)1 << 32;
    uint64_t worst_at[3] = {0}, at[3], reach = one / (uint64_t)grid;
    float worst = -INFINITY;
    for (int i = 0; i < grid * grid * grid + 4 * grid && worst <= 0.0f; i++) {
        bool is_grid = i < grid * grid * grid;
        const int cell[3] = {i % grid, i / grid % grid, i / grid / grid};
        for (int axis = 0; axis < 3; axis++) {
            uint64_t low = one * (uint64_t)cell[axis] / (uint64_t)grid;
            int64_t moved = is_grid ? (int64_t)(low + shipped_random(world) % reach)
                                    : (int64_t)(worst_at[axis] + shipped_random(world) % (2 * reach)) - (int64_t)reach;
            if (is_grid && (cell[axis] == 0 || cell[axis] == grid - 1))
                moved = cell[axis] == 0 ? 0 : (int64_t)one;
            at[axis] = moved < 0 ? 0 : moved > (int64_t)one ? one : (uint64_t)moved;
        }
        float wrong = wrongness(world, constant, at, footprint);
        if (wrong > worst) {
            worst = wrong;
            memcpy(worst_at, at, sizeof at);
        } else if (!is_grid && i % 3 == 2 && reach > 64)
            reach -= reach / 4;
    }
    return worst > 0.0f;
}

static bool is_lost(shipped_world *world, const constant_node *constant)
{
    for (int footprint = -1; footprint <= constant->node.level + 1; footprint++)
        if (find_surface(world, constant, footprint, footprint < 0 ? GRID_FULL : GRID_FOOTPRINTS))
            return true;
    return false;
}

/* Of a spread of at most `most` constant nodes, half of them proven by samples if there are so many. */
static uint32_t count_lost(shipped_world *world, const constant_list *list, uint32_t most, const constant_node **first)
{
    uint32_t num_lost = 0, num[2] = {list->count - list->num_by_samples, list->num_by_samples}, seen[2] = {0};
    for (uint32_t i = 0; i < list->count; i++) {
        int kind = list->nodes[i].by_samples;
        uint32_t n = seen[kind]++;
        /* Evenly: whenever the share of those taken falls behind. */
        if (num[kind] > most / 2 && (uint64_t)(n + 1) * (most / 2) / num[kind] == (uint64_t)n * (most / 2) / num[kind])
            continue;
        if (is_lost(world, &list->nodes[i]) && num_lost++ == 0)
            *first = &list->nodes[i];
    }
    return num_lost;
}

static void test_nothing_lost(void **state)
{
    shipped_world world;
    constant_list list = {0};
    const constant_node *first = NULL;
    shipped_open(&world, *state);
    build_tree(&world, NULL, &list);
    uint32_t num_lost = count_lost(&world, &list, is_full() ? 3000 : 150, &first);
    print_message("%s: %u constant nodes, %u of them by samples\n", world.name, list.count, list.num_by_samples);
    assert_true(list.count > 300);
    if (num_lost)
        fail_msg("%s: %u nodes hold surface; first: level %d, node (%ld, %ld, %ld), called %s by its %s", world.name,
                 num_lost, first->node.level, first->node.at[0], first->node.at[1], first->node.at[2],
                 first->state == KARST_STATE_AIR ? "air" : "solid", first->by_samples ? "samples" : "bounds");
    free(list.nodes);
    shipped_close(&world);
}

/* Where finalise calls constant whatever has samples of one sign, surface is lost, and the search finds it. */
static void test_sampling_alone_is_caught(void **state)
{
    shipped_world world;
    constant_list list = {0};
    const constant_node *first = NULL;
    (void)state;
    shipped_open(&world, "alps");
    build_tree(&world, "-DKARST_MUTANT_SAMPLING", &list);
    uint32_t num_lost = count_lost(&world, &list, 600, &first);
    print_message("alps, by samples alone: %u of %u nodes that were looked at lost surface\n", num_lost, 600u);
    assert_true(num_lost > 0);
    assert_true(first->by_samples);
    free(list.nodes);
    shipped_close(&world);
}

int main(void)
{
    const struct CMUnitTest mutant[] = {cmocka_unit_test(test_sampling_alone_is_caught)};
    int failed = cmocka_run_group_tests(mutant, NULL, NULL);
    return failed + shipped_run("nothing is lost", test_nothing_lost);
}
