/* Gradients at kinks: on ties, folds and cell faces of random graphs each component is one of the two one-sided
 * slopes of the density along its axis. The truth is differences of the oracle's doubles.
 *
 * Numbers are short binary fractions and places lie on a coarse lattice, so that ties are exact, and many meet. */
#include "tests/language/world_text.h"

#include "producers/language/graph/derive.h"
#include "producers/language/graph/kinds.h"
#include "tests/language/random_graph.h"

enum { MAX_POOL = 64, PLACES_A_GRAPH = 40 };
#define VOXEL_LOG2_M 0

static double short_number(void)
{
    static const double numbers[] = {0.5, 1, 2, -1, -0.5, 3, 1.5, -2, 0.25, -3};
    return numbers[random_below(10)];
}

typedef struct {
    karst_graph *graph;
    karst_expr pool[MAX_POOL];
    uint32_t count;
} maker;

static karst_expr number_of(maker *m, double value) { return karst_graph_float(m->graph, value); }

static karst_expr leaf(maker *m)
{
    karst_affine a = {.offset = number_of(m, (double)random_below(9) * 0.5 - 2)};
    uint32_t axes = random_chance(2) ? 1u << random_below(3) : 1 + random_below(7);
    for (uint32_t i = 0; i < 3; i++)
        if (axes >> i & 1)
            a.coefficient[i] = number_of(m, short_number());
    return karst_graph_affine(m->graph, a);
}

static karst_expr pick(maker *m)
{
    if (random_chance(5))
        return leaf(m);
    uint32_t back = random_below(m->count < 6 ? m->count : 6);
    return m->pool[m->count - 1 - back];
}

static karst_expr triangle(maker *m, karst_expr a, uint32_t way)
{
    karst_graph *g = m->graph;
    karst_expr half = number_of(m, 0.5);
    switch (way) {
    case 0: /* |fract(a) - 1/2| */
        return karst_expr_1(g, KARST_OP_ABS,
                            karst_expr_2(g, KARST_OP_SUBTRACT, karst_expr_1(g, KARST_OP_FRACT, a), half));
    case 1: /* |mod(a, 2) - 1| */
        return karst_expr_1(
            g, KARST_OP_ABS,
            karst_expr_2(g, KARST_OP_SUBTRACT, karst_expr_2(g, KARST_OP_MOD, a, number_of(m, 2)), number_of(m, 1)));
    case 2: /* |a - floor(a + 1/2)|, by hand */
        return karst_expr_1(g, KARST_OP_ABS,
                            karst_expr_2(g, KARST_OP_SUBTRACT, a,
                                         karst_expr_1(g, KARST_OP_FLOOR, karst_expr_2(g, KARST_OP_ADD, a, half))));
    case 3:
        return karst_expr_1(g, KARST_OP_ABS, karst_expr_2(g, KARST_OP_SUBTRACT, a, karst_expr_1(g, KARST_OP_RINT, a)));
    case 4: /* through an int */
        return karst_expr_2(g, KARST_OP_SUBTRACT, a,
                            karst_expr_convert(g, KARST_TYPE_FLOAT, karst_expr_convert(g, KARST_TYPE_INT, a)));
    default: /* a step in what is 0 there */
        return karst_expr_2(
            g, KARST_OP_MULTIPLY, a,
            karst_expr_convert(g, KARST_TYPE_FLOAT, karst_expr_2(g, KARST_OP_LESS, number_of(m, 0), a)));
    }
}

/* Conditions, also such as several make. */
static karst_expr condition(maker *m, karst_expr a, karst_expr b)
{
    karst_graph *g = m->graph;
    karst_expr c = karst_expr_2(g, random_chance(2) ? KARST_OP_LESS : KARST_OP_LESS_EQUAL, a, b);
    switch (random_below(5)) {
    case 0:
        return karst_expr_1(g, KARST_OP_NOT, c);
    case 1:
        return karst_expr_2(g, random_chance(2) ? KARST_OP_AND : KARST_OP_OR, c,
                            karst_expr_2(g, KARST_OP_LESS, pick(m), pick(m)));
    default:
        return c;
    }
}

static karst_expr grow(maker *m, bool bends)
{
    karst_graph *g = m->graph;
    karst_expr a = pick(m), b = pick(m);
    switch (random_below(bends ? 13 : 11)) {
    case 0:
    case 1:
        return karst_expr_2(g, KARST_OP_MIN, a, b);
    case 2:
    case 3:
        return karst_expr_2(g, KARST_OP_MAX, a, b);
    case 4:
        return karst_expr_1(g, KARST_OP_ABS, a);
    case 5: /* clamp */
        return karst_expr_2(g, KARST_OP_MIN, karst_expr_2(g, KARST_OP_MAX, a, number_of(m, -1)), number_of(m, 1));
    case 6:
        return karst_expr_2(g, random_chance(2) ? KARST_OP_ADD : KARST_OP_SUBTRACT, a, b);
    case 7:
        return karst_expr_2(g, KARST_OP_MULTIPLY, a, number_of(m, short_number()));
    case 8:
        return triangle(m, a, random_below(6));
    case 9: /* sides that agree where the condition changes: a where they tie */
        return karst_expr_3(
            g, KARST_OP_SELECT, condition(m, a, b), a,
            karst_expr_2(g, KARST_OP_ADD, b,
                         random_chance(2) ? number_of(m, 0)
                                          : karst_expr_1(g, KARST_OP_ABS, karst_expr_2(g, KARST_OP_SUBTRACT, a, b))));
    case 10:
        return karst_expr_3(g, KARST_OP_FMA, a, number_of(m, short_number()), b);
    case 11:
        return karst_expr_2(g, KARST_OP_MULTIPLY, a, b);
    default: {
        karst_noise noise = {.base = random_chance(2) ? KARST_NOISE_GRADIENT : KARST_NOISE_VALUE, .num_octaves = 1};
        noise.gain = number_of(m, 0.5);
        noise.lacunarity = number_of(m, 2);
        return karst_expr_2(g, KARST_OP_ADD, a, karst_graph_noise(g, noise, leaf(m), leaf(m), leaf(m)));
    }
    }
}

static _Noreturn void graph_full(void *user, uint32_t where)
{
    (void)user;
    (void)where;
    abort();
}

/* ---- one-sided slopes ---- */

typedef struct {
    uint64_t checked, kinks, skipped, wrong;
} tally;

/* Of the density along an axis, to one side; false: it jumps there, or no step is short enough. */
static bool one_sided(karst_oracle *oracle, const karst_position *at, int axis, int sign, double *slope)
{
    double d0 = karst_oracle_precise_density(oracle, at, -1), last = 0;
    for (int log2 = 20; log2 >= 14; log2 -= 2) { /* of 2^-32 voxels */
        karst_position there = *at;
        int64_t moved = (int64_t)there.fraction[axis] + sign * ((int64_t)1 << log2);
        there.voxel[axis] += moved >> 32;
        there.fraction[axis] = (uint32_t)moved;
        *slope = sign * (karst_oracle_precise_density(oracle, &there, -1) - d0) / ldexp(1, log2 - 32);
        if (log2 < 20 && fabs(*slope - last) <= 1e-3 * fmax(1, fabs(*slope)))
            return fabs(*slope) < 1e5;
        last = *slope;
    }
    return false;
}

static bool near_to(double a, double b) { return fabs(a - b) <= 4e-3 * fmax(1, fabs(b)); }

static void check_place(karst_oracle *oracle, const karst_position *at, uint64_t number, bool is_told, tally *t)
{
    karst_oracle_value g[3];
    karst_oracle_gradient(oracle, at, -1, g);
    for (int axis = 0; axis < 3; axis++) {
        double behind = 0, ahead = 0;
        bool has_behind = one_sided(oracle, at, axis, -1, &behind), has_ahead = one_sided(oracle, at, axis, 1, &ahead);
        if (!has_behind && !has_ahead) {
            t->skipped++;
            continue;
        }
        t->checked++;
        t->kinks += has_behind && has_ahead && !near_to(behind, ahead);
        bool good = (has_behind && near_to(g[axis].precise, behind) && near_to((double)g[axis].device, behind)) ||
                    (has_ahead && near_to(g[axis].precise, ahead) && near_to((double)g[axis].device, ahead));
        if (!good && t->wrong++ < 10 && is_told)
            print_message("graph %lu at %ld+%g, %ld+%g, %ld+%g along %c: %g (%g); behind %g%s, ahead %g%s\n",
                          (unsigned long)number, at->voxel[0], at->fraction[0] * 0x1p-32, at->voxel[1],
                          at->fraction[1] * 0x1p-32, at->voxel[2], at->fraction[2] * 0x1p-32, "xyz"[axis],
                          g[axis].precise, (double)g[axis].device, behind, has_behind ? "" : " (jumps)", ahead,
                          has_ahead ? "" : " (jumps)");
    }
}

static void check_graph(uint64_t number, tally *t)
{
    karst_arena arena;
    karst_graph built, graph;
    karst_error error = {0};
    maker m = {.graph = &built};
    random_state = number * 0x9e3779b97f4a7c15ULL + 99;
    random_bits();
    karst_arena_init(&arena, (size_t)64 << 20, NULL, NULL);
    karst_graph_init(&built, &arena, 1u << 16, graph_full, NULL);
    karst_graph_init(&graph, &arena, 1u << 16, graph_full, NULL);
    bool bends = number % 4 == 0;
    for (uint32_t size = 7 + random_below(20); m.count < size; m.count++)
        m.pool[m.count] = m.count < 4 ? leaf(&m) : grow(&m, bends);
    karst_expr root = m.pool[m.count - 1];
    karst_graph_extract(&built, &graph, &root, 1);
    karst_kinds_set(&graph, 1);
    if (!karst_graph_is_uniform(&graph, root)) {
        karst_resolved_world world = {.graph = &graph, .root = {root}};
        karst_gradient_world *derived = karst_derive(&world, &error);
        assert_non_null(derived);
        karst_oracle *oracle = karst_oracle_create(&derived->world, NULL, 7, VOXEL_LOG2_M, &error);
        assert_non_null(oracle);
        for (int i = 0; i < PLACES_A_GRAPH; i++) {
            karst_position at;
            for (int axis = 0; axis < 3; axis++) {
                at.voxel[axis] = (int64_t)random_below(7) - 3;
                at.fraction[axis] = random_below(4) << 30;
            }
            check_place(oracle, &at, number, true, t);
        }
        karst_oracle_destroy(oracle);
        karst_gradient_world_destroy(derived);
    }
    karst_arena_finish(&arena);
}

static void test_kinks(void **state)
{
    (void)state;
    tally t = {0};
    uint64_t graphs = getenv("KARST_TEST_QUICK") ? 1000 : getenv("KARST_TEST_FULL") ? 200000 : 30000;
    for (uint64_t number = 1; number <= graphs; number++)
        check_graph(number, &t);
    print_message("%lu slopes, %lu at kinks, %lu wrong; %lu skipped, where both sides jump\n", (unsigned long)t.checked,
                  (unsigned long)t.kinks, (unsigned long)t.wrong, (unsigned long)t.skipped);
    assert_true(t.kinks > t.checked / 40 && t.kinks > 3 * graphs);
    /* Where two terms jump, one to each side, and the density does not, neither side is looked at. */
    assert_true(t.wrong <= t.kinks / 200);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_kinks),
    };
    return cmocka_run_group_tests_name("one-sided slopes", tests, NULL, NULL);
}
