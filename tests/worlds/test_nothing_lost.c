/* Nothing is lost in a shipped world: what its bounds or samples call constant has no surface in it, for any footprint
 * from 0 to the parent's voxel. Trees are built by the real kernels around places that the camera sees; of their
 * constant nodes those in which the density comes near 0 are searched on the host. And the search is good enough: in
 * each world, where nodes are called constant by samples alone, it finds the surface that was lost. KARST_TEST_FULL=1
 * takes all worlds instead of every second, builds ten times as many trees and searches all nodes. */
#include <inttypes.h>
#include <math.h>

#include "producers/steps/load_shared.h"
#include "tests/worlds/shipped.h"

#include "producers/language/tape/bounds_shared.h"
#include "producers/language/tape/tape.clh"

#define TOP_LEVEL 9
#define CAPACITY (64 * KARST_TILE_NODES)
#define MAX_KEPT 64 /* nodes that go on to the next level */
#define NUM_TREES 3
#define NUM_TREES_BY_SAMPLES 8
#define NUM_SEARCHED 400
#define LEAST_LOST 5 /* of those by samples alone; 9 to 90 when this was written */

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

static karst_producer *make_producer(karst_context *context, const shipped_world *world)
{
    karst_error error = {0};
    char options[KARST_WORLD_FILE_OPTIONS_BYTES];
    karst_density_program program;
    void *data = karst_world_file_data(world->file, world->file->info.seed, &error);
    pool_expect(data, world->name, &error);
    karst_world_file_program(world->file, data, options, &program);
    program.max_loads = CAPACITY;
    karst_producer *producer = karst_density_producer_create_program(context, &program, &error);
    pool_expect(producer, world->name, &error);
    free(data);
    return producer;
}

/* Loads the open nodes: those that come out constant go to the list, the others stay. With `samples_alone` what has
 * samples of one sign counts as constant, proof or none. */
static uint32_t load(karst_producer *producer, pool *p, bool samples_alone, pool_node *open, uint32_t num_open,
                     constant_list *constants)
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
        else if (samples_alone && (states[i] == KARST_STATE_CLEAR_AIR || states[i] == KARST_STATE_CLEAR_SOLID))
            add(constants, open[i], states[i] == KARST_STATE_CLEAR_AIR ? KARST_STATE_AIR : KARST_STATE_SOLID, true);
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

typedef struct {
    karst_context *context;
    karst_producer *producer;
    pool pool;
    bool samples_alone;
} builder;

static void builder_open(builder *b, const shipped_world *world, bool samples_alone)
{
    b->samples_alone = samples_alone;
    b->context = shipped_context(0);
    b->producer = make_producer(b->context, world);
    pool_open(&b->pool, b->context, CAPACITY, 1);
}

static void builder_close(builder *b)
{
    pool_close(&b->pool);
    karst_producer_destroy(b->producer);
    karst_context_destroy(b->context);
}

/* From the 2x2x2 nodes around a place down to level 0. */
static void build_tree(builder *b, const int64_t centre[3], constant_list *constants)
{
    static pool_node open[CAPACITY];
    uint32_t num_open = 0;
    for (int i = 0; i < 8; i++) {
        pool_node node = {.level = TOP_LEVEL};
        for (int axis = 0; axis < 3; axis++)
            node.at[axis] = ((centre[axis] >> (TOP_LEVEL + KARST_BRICK_CELLS_LOG2 - 1)) + 1) / 2 - 1 + (i >> axis & 1);
        open[num_open++] = node;
    }
    for (int level = TOP_LEVEL; num_open && level >= 0; level--) {
        num_open = load(b->producer, &b->pool, b->samples_alone, open, num_open, constants);
        if (num_open && level > 0)
            num_open = subdivide(b->producer, &b->pool, open, num_open, constants);
    }
}

/* Somewhere around what the camera looks at, at the surface; the nearer the likelier. */
static void random_centre(shipped_world *world, int64_t centre[3])
{
    for (int tries = 0; tries < 64; tries++) {
        uint64_t reach = (uint64_t)1 << (6 + shipped_random(world) % 12);
        for (int axis = 0; axis < 3; axis++)
            centre[axis] = world->surface[axis] + (int64_t)(shipped_random(world) % (2 * reach)) - (int64_t)reach;
        if (shipped_to_surface(world, centre, (int64_t)(4 * reach)))
            return;
    }
    fail_msg("%s: no surface around", world->name);
}

/* ---- the search ---- */

enum { GRID = 6, NUM_STARTS = 4, STEPS = 14, FRESH = 24 };
#define ONE ((int64_t)1 << 32) /* from a node's corner to the opposite one */

/* The world's tape on the host: the oracle's bits in less time; what it finds the oracle confirms. */
typedef struct {
    shipped_world *world;
    tape_program program;
    uint output;
    void *data;
} searcher;

static void searcher_open(searcher *s, shipped_world *world)
{
    karst_error error = {0};
    *s = (searcher){.world = world, .data = karst_world_file_data(world->file, world->file->info.seed, &error)};
    pool_expect(s->data, world->name, &error);
    const karst_tape *tape = &world->file->tape;
    const karst_data_header *header = s->data;
    s->program = (tape_program){.code = tape->code,
                                .num_instructions = tape->num_instructions,
                                .constants = tape->constants,
                                .data = s->data,
                                .values = (const uint *)((const ulong *)s->data + header->values),
                                .num_values = world->file->layout.num_values,
                                .slots = calloc((size_t)tape->num_slots * TAPE_VALUE_ELEMENTS, sizeof(int))};
    s->output = tape->output[0];
    assert_non_null(s->program.slots);
}

static void searcher_close(searcher *s)
{
    free(s->program.slots);
    free(s->data);
}

typedef struct {
    int64_t at[3];
    float wrong; /* above 0: the density is on the wrong side for the node's state */
} place;

static affine_position position_in(const constant_node *constant, const int64_t at[3])
{
    affine_position p;
    int level = constant->node.level, shift = level + KARST_BRICK_CELLS_LOG2;
    for (int axis = 0; axis < 3; axis++) {
        p.voxel[axis] = karst_node_origin(constant->node.at[axis], level) + (long)(((ulong)at[axis] << shift) >> 32);
        p.fraction[axis] = (uint)((ulong)at[axis] << shift);
    }
    return p;
}

static float wrongness(const constant_node *constant, float d)
{
    return constant->state == KARST_STATE_AIR ? d : d == 0.0f ? 0x1p-126f : -d;
}

static void look(searcher *s, const constant_node *constant, int footprint, place *p)
{
    affine_position at = position_in(constant, p->at);
    tape_values(&s->program, &at, NULL, footprint);
    p->wrong = wrongness(constant, k_as_float((uint)tape_load(&s->program, s->output)));
}

static bool confirmed(searcher *s, const constant_node *constant, int footprint, const place *p)
{
    affine_position at = position_in(constant, p->at);
    int64_t voxel[3];
    uint32_t fraction[3];
    for (int axis = 0; axis < 3; axis++) {
        voxel[axis] = at.voxel[axis];
        fraction[axis] = at.fraction[axis];
    }
    float wrong = wrongness(constant, shipped_density(s->world, voxel, fraction, footprint));
    assert_true(wrong == p->wrong);
    return wrong > 0;
}

/* Within `reach` of a place, but in the node. */
static place step_from(searcher *s, const place *from, int64_t reach)
{
    place to;
    for (int axis = 0; axis < 3; axis++) {
        int64_t moved = from->at[axis] - reach + (int64_t)(shipped_random(s->world) % (uint64_t)(2 * reach + 1));
        to.at[axis] = moved < 0 ? 0 : moved > ONE ? ONE : moved;
    }
    return to;
}

/* Keeps the worst places, of which no two lie close together. */
static void keep(place best[NUM_STARTS], const place *p)
{
    int at = 0;
    for (int i = 1; i < NUM_STARTS; i++)
        at = best[i].wrong < best[at].wrong ? i : at;
    for (int i = 0; i < NUM_STARTS; i++) {
        int64_t apart = 0;
        for (int axis = 0; axis < 3; axis++)
            apart = imaxabs(best[i].at[axis] - p->at[axis]) > apart ? imaxabs(best[i].at[axis] - p->at[axis]) : apart;
        if (apart < ONE / GRID / 2)
            at = i;
    }
    if (p->wrong > best[at].wrong)
        best[at] = *p;
}

/* From coarse to fine: where the density comes nearest to the wrong side at one footprint, it is likely to do so at
 * the next finer one, nearby. So the worst places of a grid at the parent's footprint are followed down, each by steps
 * of about what that footprint adds, with new places all the way. */
static bool is_lost(searcher *s, const constant_node *constant)
{
    place best[NUM_STARTS];
    int level = constant->node.level;
    for (int i = 0; i < NUM_STARTS; i++)
        best[i] = (place){.wrong = -INFINITY};
    for (int footprint = level + 1; footprint >= -1; footprint--) {
        int64_t reach = ONE >> (level + 3 - footprint < 28 ? level + 3 - footprint : 28);
        for (int i = 0; i < NUM_STARTS; i++)
            if (best[i].wrong > -INFINITY)
                look(s, constant, footprint, &best[i]);
        int num_places = footprint > level ? GRID * GRID * GRID : FRESH;
        for (int i = 0; i < num_places; i++) {
            place p;
            const int cell[3] = {i % GRID, i / GRID % GRID, i / GRID / GRID};
            for (int axis = 0; axis < 3; axis++) {
                p.at[axis] = (int64_t)(shipped_random(s->world) % (ONE + 1));
                if (footprint > level) /* corners are among them */
                    p.at[axis] = cell[axis] == 0          ? 0
                                 : cell[axis] == GRID - 1 ? ONE
                                                          : (ONE * cell[axis] + p.at[axis]) / GRID;
            }
            look(s, constant, footprint, &p);
            keep(best, &p);
        }
        for (int i = 0; i < NUM_STARTS; i++) {
            int64_t near = reach;
            for (int k = 0; k < STEPS && best[i].wrong <= 0; k++) {
                place p = step_from(s, &best[i], near);
                look(s, constant, footprint, &p);
                if (p.wrong > best[i].wrong)
                    best[i] = p;
                else if (k % 2)
                    near -= near / 3;
            }
            if (best[i].wrong > 0)
                return confirmed(s, constant, footprint, &best[i]);
        }
    }
    return false;
}

typedef struct {
    const constant_node *node;
    float near; /* how near 0 the density comes at a few points, in voxels if its slope is 1; above 0: beyond */
} candidate;

static int nearest_first(const void *a, const void *b)
{
    float x = ((const candidate *)a)->near, y = ((const candidate *)b)->near;
    return x < y ? 1 : x > y ? -1 : 0;
}

static float nearness(searcher *s, const constant_node *constant)
{
    float near = -INFINITY;
    for (int i = 0; i < 64; i++) {
        place p = {
            .at = {(2 * (i & 3) + 1) * (ONE / 8), (2 * (i >> 2 & 3) + 1) * (ONE / 8), (2 * (i >> 4) + 1) * (ONE / 8)}};
        look(s, constant, constant->node.level, &p);
        near = fmaxf(near, p.wrong);
    }
    return ldexpf(near, -constant->node.level);
}

/* How many of at most `most` constant nodes hold surface: those by bounds as well if `all`. */
static uint32_t count_lost(shipped_world *world, const constant_list *list, bool all, uint32_t most,
                           const constant_node **first)
{
    searcher s;
    uint32_t num_lost = 0, count = 0;
    candidate *candidates = calloc(list->count, sizeof *candidates);
    assert_non_null(candidates);
    searcher_open(&s, world);
    for (uint32_t i = 0; i < list->count; i++)
        if (all || list->nodes[i].by_samples)
            candidates[count++] = (candidate){&list->nodes[i], nearness(&s, &list->nodes[i])};
    qsort(candidates, count, sizeof *candidates, nearest_first);
    for (uint32_t i = 0; i < count && i < most; i++)
        if (is_lost(&s, candidates[i].node) && num_lost++ == 0)
            *first = candidates[i].node;
    searcher_close(&s);
    free(candidates);
    return num_lost;
}

/* Trees around the surface that the camera sees and around others. */
static void build_trees(shipped_world *world, bool samples_alone, int count, constant_list *list)
{
    builder b;
    builder_open(&b, world, samples_alone);
    for (int i = 0; i < count; i++) {
        int64_t centre[3];
        memcpy(centre, world->surface, sizeof centre);
        if (i)
            random_centre(world, centre);
        build_tree(&b, centre, list);
    }
    builder_close(&b);
}

static void look_for_what_is_lost(const char *name, bool clear)
{
    shipped_world world;
    constant_list list = {0};
    const constant_node *first = NULL;
    shipped_open_part(&world, name, clear);
    build_trees(&world, false, is_full() ? 10 * NUM_TREES : NUM_TREES, &list);
    uint32_t num_lost = count_lost(&world, &list, true, is_full() ? UINT32_MAX : NUM_SEARCHED, &first);
    print_message("%s: %u constant nodes, %u of them by samples\n", world.name, list.count, list.num_by_samples);
    assert_true(list.count > 300 * NUM_TREES);
    if (num_lost)
        fail_msg("%s: %u nodes hold surface; first: level %d, node (%ld, %ld, %ld), called %s by its %s", world.name,
                 num_lost, first->node.level, first->node.at[0], first->node.at[1], first->node.at[2],
                 first->state == KARST_STATE_AIR ? "air" : "solid", first->by_samples ? "samples" : "bounds");
    free(list.nodes);
    shipped_close(&world);
}

static void test_nothing_lost(void **state) { look_for_what_is_lost(*state, false); }

/* The same of clear matter, in its own store. */
static void test_nothing_lost_of_clear_matter(void **state) { look_for_what_is_lost(*state, true); }

/* Were all constant that has samples of one sign (tests/producers/test_thin.c builds kernels that say so), surface
 * would be lost, and the search finds it. The lattice has none to lose: what is clear there only touches its planes.
 * Nor has the ground of "glass" and "lens", one plane where the camera looks; that of "caustics" has a ring. */
static void test_sampling_alone_is_caught(void **state)
{
    shipped_world world;
    constant_list list = {0};
    const constant_node *first = NULL;
    shipped_open(&world, *state);
    build_trees(&world, true, NUM_TREES_BY_SAMPLES, &list);
    uint32_t num_lost = count_lost(&world, &list, false, NUM_SEARCHED, &first);
    print_message("%s, by samples alone: %u of %u nodes that were looked at lost surface\n", world.name, num_lost,
                  list.num_by_samples < NUM_SEARCHED ? list.num_by_samples : NUM_SEARCHED);
    if (strcmp(world.name, "lattice") == 0 || strcmp(world.name, "glass") == 0 ||
        strcmp(world.name, "lens") == 0)
        assert_int_equal(num_lost, 0);
    else
        assert_true(num_lost >= (strcmp(world.name, "caustics") == 0 ? 1 : LEAST_LOST));
    free(list.nodes);
    shipped_close(&world);
}

int main(void)
{
    static char names[][16] = {"lake", "ice", "glass", "lens", "caustics"};
    enum { ALL = sizeof names / sizeof *names };
    struct CMUnitTest of_clear[ALL];
    const char *only = getenv("KARST_TEST_WORLD");
    size_t num = 0;
    for (int i = 0; i < (is_full() || only ? ALL : getenv("KARST_TEST_QUICK") ? 0 : 2); i++)
        if (!only || strcmp(only, names[i]) == 0)
            of_clear[num++] =
                (struct CMUnitTest){names[i], test_nothing_lost_of_clear_matter, NULL, NULL, names[i]};
    int failed = shipped_run("surface lost by samples alone is found", test_sampling_alone_is_caught, 2);
    failed += shipped_run("nothing is lost", test_nothing_lost, 2);
    return failed + (num ? _cmocka_run_group_tests("nothing is lost of clear matter", of_clear, num, NULL, NULL) : 0);
}
