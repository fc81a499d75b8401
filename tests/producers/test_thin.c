/* Thin things are not lost: balls 2 voxels wide, needles of 1.5 and plates of 1, at every size. A node that holds a
 * part of one is never constant, at any level; where its voxel is as wide as the thing asks for, the thing is in the
 * bricks. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <math.h>

#include "producers/density/density_producer.h"
#include "tests/support/pool.h"

/* d = radius - distance to a point, to a line, to a plane; the largest over all things. Level-0 voxels; |p| up to 2^14,
 * so that floats are good to 2^-7 and better. */
typedef enum { BALL, NEEDLE, PLATE, NUM_KINDS } thing_kind;
typedef struct {
    thing_kind kind;
    double at[3], direction[3], radius;
} thing;

#define TOP_LEVEL 9
#define NUM_SIZES 5 /* things that are 2, 1.5 or 1 voxels wide at level 0, 1, 2 ... */

static uint64_t random_state = 2463534242u;
static double random_signed(void)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (double)(uint32_t)((random_state ^ random_state >> 29) * 0xbf58476d1ce4e5b9u >> 32) * 0x1p-31 - 1;
}

static void make_things(thing_kind kind, thing things[NUM_SIZES])
{
    static const double widths[NUM_KINDS] = {2.0, 1.5, 1.0};
    for (int size = 0; size < NUM_SIZES; size++) {
        thing *t = things + size;
        double length = 0;
        t->kind = kind;
        t->radius = widths[kind] / 2 * exp2(size);
        for (int axis = 0; axis < 3; axis++) {
            t->at[axis] = (float)(random_signed() * 6000);
            t->direction[axis] = random_signed();
            length += t->direction[axis] * t->direction[axis];
        }
        for (int axis = 0; axis < 3; axis++)
            t->direction[axis] = (float)(t->direction[axis] / sqrt(length));
    }
}

/* The density program of these things. Bounds and slopes come from |d(p) - d(q)| <= |p - q| alone; 0.05 covers the
 * floats. */
static char *write_program(const thing *things, int count)
{
    static const char before[] = "#include \"producers/steps/density.clh\"\n"
                                 "typedef struct { long origin[3]; int level; } world_axes;\n"
                                 "K_INLINE vfloat thing(vfloat x, vfloat y, vfloat z, int kind, float ax, float ay, "
                                 "float az, float nx, float ny, float nz, float r)\n"
                                 "{\n"
                                 "    vfloat dx = x - (vfloat)(ax), dy = y - (vfloat)(ay), dz = z - (vfloat)(az);\n"
                                 "    vfloat along = dx * (vfloat)(nx) + dy * (vfloat)(ny) + dz * (vfloat)(nz);\n"
                                 "    if (kind == 2)\n"
                                 "        return (vfloat)(r) - k_fabs(along);\n"
                                 "    if (kind == 1) {\n"
                                 "        dx -= along * (vfloat)(nx);\n"
                                 "        dy -= along * (vfloat)(ny);\n"
                                 "        dz -= along * (vfloat)(nz);\n"
                                 "    }\n"
                                 "    return (vfloat)(r) - k_sqrt(dx * dx + dy * dy + dz * dz);\n"
                                 "}\n"
                                 "K_INLINE vfloat things(vfloat x, vfloat y, vfloat z)\n"
                                 "{\n"
                                 "    vfloat d = (vfloat)(-1e9f);\n";
    static const char after[] =
        "    return d;\n"
        "}\n"
        "K_INLINE void world_prepare(world_axes *axes, long x, long y, long z, int level)\n"
        "{\n"
        "    axes->origin[0] = x;\n"
        "    axes->origin[1] = y;\n"
        "    axes->origin[2] = z;\n"
        "    axes->level = level;\n"
        "}\n"
        "K_INLINE vfloat world_sample(const world_axes *axes, vint ix, vint iy, vint iz)\n"
        "{\n"
        "    vfloat step = (vfloat)((float)(1L << axes->level));\n"
        "    return things((vfloat)((float)axes->origin[0]) + v_to_float(ix) * step, (vfloat)((float)axes->origin[1]) "
        "+ v_to_float(iy) * step,\n"
        "                  (vfloat)((float)axes->origin[2]) + v_to_float(iz) * step);\n"
        "}\n"
        "K_INLINE vfloat world_row(world_axes *axes, int ix, int iy, int iz)\n"
        "{\n"
        "    return world_sample(axes, (vint)(ix) + V_LANE, (vint)(iy), (vint)(iz));\n"
        "}\n"
        "K_INLINE void world_bounds(vlong x, vlong y, vlong z, vint level, world_bound *bound)\n"
        "{\n"
        "    vfloat half_side = v_as_float((level + (vint)(127 + 3)) << 23), reach = half_side * (vfloat)(1.7321f) + "
        "(vfloat)(0.05f);\n"
        "    vfloat d = things(v_to_float(x) + half_side, v_to_float(y) + half_side, v_to_float(z) + half_side);\n"
        "    bound->lo = d - reach;\n"
        "    bound->hi = d + reach;\n"
        "    bound->slope[0] = bound->slope[1] = bound->slope[2] = (vfloat)(1.0f);\n"
        "    bound->slack = (vfloat)(0.0f);\n"
        "}\n"
        "K_INLINE void world_slopes(vlong x, vlong y, vlong z, vint level, world_bound *bound)\n"
        "{\n"
        "    world_bounds(x, y, z, level, bound);\n"
        "}\n"
        "K_INLINE float world_slack(int level)\n"
        "{\n"
        "    return level < 0 ? 0.0f : 0.05f;\n"
        "}\n";
    size_t size_bytes = sizeof before + sizeof after + (size_t)count * 512, length;
    char *text = malloc(size_bytes);
    assert_non_null(text);
    length = (size_t)snprintf(text, size_bytes, "%s", before);
    for (int i = 0; i < count; i++) {
        const thing *t = things + i;
        length += (size_t)snprintf(text + length, size_bytes - length,
                                   "    d = v_max(d, thing(x, y, z, %d, %af, %af, %af, %af, %af, %af, %af));\n",
                                   t->kind, t->at[0], t->at[1], t->at[2], t->direction[0], t->direction[1],
                                   t->direction[2], t->radius);
    }
    snprintf(text + length, size_bytes - length, "%s", after);
    return text;
}

/* A lower bound on how deep a thing reaches into a node's box: the density (in doubles) at the best point of a search.
 */
static double depth_in_node(const thing *t, const pool_node *node, double best[3])
{
    double side = exp2(node->level + KARST_BRICK_CELLS_LOG2), low[3], p[3];
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = (double)node->at[axis] * side;
        p[axis] = fmin(fmax(t->at[axis], low[axis]), low[axis] + side);
    }
    /* Projections to and fro between the box and the thing's core, both convex, come down on their nearest points. */
    double distance = 0;
    for (int n = 0; n < 200; n++) {
        double d[3], along = 0, core[3];
        for (int axis = 0; axis < 3; axis++) {
            d[axis] = p[axis] - t->at[axis];
            along += d[axis] * t->direction[axis];
        }
        for (int axis = 0; axis < 3; axis++)
            core[axis] = t->kind == BALL     ? t->at[axis]
                         : t->kind == NEEDLE ? t->at[axis] + along * t->direction[axis]
                                             : p[axis] - along * t->direction[axis];
        distance = 0;
        for (int axis = 0; axis < 3; axis++) {
            best[axis] = p[axis];
            distance += (p[axis] - core[axis]) * (p[axis] - core[axis]);
            p[axis] = fmin(fmax(core[axis], low[axis]), low[axis] + side);
        }
    }
    return t->radius - sqrt(distance);
}

typedef struct {
    uint32_t num_visited, num_lost, num_air;
    bool seen[NUM_SIZES]; /* a brick at the level that fits the thing holds surface of it */
} walk;

/* Walks the tree with the real kernels and looks at every node that holds a part of a thing, down to that thing's
 * level. */
static void walk_tree(karst_producer *producer, karst_context *context, const thing *things, walk *w)
{
    enum { CAPACITY = 1024, ROOM = 4 * CAPACITY };
    static pool_node open[ROOM], next[ROOM];
    static uint32_t states[CAPACITY];
    static karst_node nodes[CAPACITY * KARST_TILE_NODES];
    static karst_tile_info infos[CAPACITY];
    uint32_t num_open = 8;
    karst_error error = {0};
    double at[3];
    pool p;

    *w = (walk){0};
    pool_open(&p, context, CAPACITY, 1);
    for (int i = 0; i < 8; i++)
        open[i] = (pool_node){{(i & 1) - 1, (i >> 1 & 1) - 1, (i >> 2) - 1}, TOP_LEVEL};
    while (num_open) {
        uint32_t num_next = 0;
        int level = open[0].level;
        for (uint32_t first = 0; first < num_open; first += CAPACITY) {
            uint32_t count = num_open - first < CAPACITY ? num_open - first : CAPACITY;
            pool_ask(&p, open + first, count);
            if (level == 0)
                p.work.num_subdivides = 0;
            pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), "answer", &error);
            pool_read_results(&p, states);
            pool_read_tiles(&p, nodes, infos);
            for (uint32_t i = 0; i < count; i++) {
                const pool_node *node = open + first + i;
                bool open_state = states[i] != KARST_STATE_AIR && states[i] != KARST_STATE_SOLID;
                bool goes_on = false;
                w->num_visited++;
                w->num_air += !open_state;
                for (int s = 0; s < NUM_SIZES; s++) {
                    if (depth_in_node(things + s, node, at) <= 1e-3)
                        continue;
                    w->num_lost += !open_state;
                    goes_on = goes_on || s < level;
                    if (s == level && states[i] == KARST_STATE_BRICK)
                        w->seen[s] = true;
                }
                for (int c = 0; c < KARST_TILE_NODES && open_state && goes_on; c++) {
                    pool_node child = pool_child(*node, c);
                    bool constant =
                        KARST_NODE_STATE(nodes[i * KARST_TILE_NODES + (uint32_t)c].link) != KARST_STATE_LOST;
                    double deepest = -1;
                    for (int s = 0; s < NUM_SIZES; s++)
                        deepest = fmax(deepest, depth_in_node(things + s, &child, at));
                    w->num_lost += constant && deepest > 1e-3;
                    /* A spread of those that hold something, and some that do not. */
                    if (num_next < ROOM && !constant && (deepest > -exp2(level + 2)) &&
                        (num_next < ROOM / 2 || (i + (uint32_t)c) % 8 == 0))
                        next[num_next++] = child;
                }
            }
        }
        if (level == 0)
            break;
        num_open = num_next;
        memcpy(open, next, num_next * sizeof *next);
    }
    pool_close(&p);
}

static void walk_kind(thing_kind kind, const char *finalise_options, walk *w)
{
    thing things[NUM_SIZES];
    karst_error error = {0};
    random_state = 1000 + (uint64_t)kind;
    make_things(kind, things);
    char *source = write_program(things, NUM_SIZES);
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), 0, NULL, &error);
    pool_expect(context, "context", &error);
    karst_density_program program = {.name = "things",
                                     .source = source,
                                     .options = "",
                                     .finalise_options = finalise_options,
                                     .shape = KARST_SHAPE_ROWS,
                                     .max_loads = 1024};
    karst_producer *producer = karst_density_producer_create_program(context, &program, &error);
    pool_expect(producer, "producer", &error);
    walk_tree(producer, context, things, w);
    karst_producer_destroy(producer);
    karst_context_destroy(context);
    free(source);
}

static void check_kind(thing_kind kind)
{
    walk w;
    walk_kind(kind, NULL, &w);
    print_message("%u nodes, %u of them constant\n", w.num_visited, w.num_air);
    assert_int_equal(w.num_lost, 0);
    assert_true(w.num_visited > 50);
    assert_true(w.num_air > 20); /* proofs do succeed beside the things */
    for (int s = 0; s < NUM_SIZES; s++)
        if (!w.seen[s])
            fail_msg("the thing for level %d is in no brick", s);
    walk_kind(kind, "-DKARST_MUTANT_SAMPLING", &w);
    print_message("sampling only: %u lost\n", w.num_lost);
    assert_true(w.num_lost > 0);
}

static void test_ball(void **state)
{
    (void)state;
    check_kind(BALL);
}

static void test_needle(void **state)
{
    (void)state;
    check_kind(NEEDLE);
}

static void test_plate(void **state)
{
    (void)state;
    check_kind(PLATE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_ball), cmocka_unit_test(test_needle),
                                       cmocka_unit_test(test_plate)};
    return cmocka_run_group_tests_name("thin things", tests, NULL, NULL);
}
