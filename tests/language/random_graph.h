/* Random resolved graphs over every op, for property tests: the generator of LANGUAGE's section on tests.
 *
 * 5 to 200 nodes, recent operands preferred; constants with zeros, denormals, ties, 10^20 and 10^-20; affine leaves
 * that pass near 0 at the place where the graph is looked at. Everything follows from a seed. Built by the graph's own
 * constructors. */
#ifndef KARST_TESTS_LANGUAGE_RANDOM_GRAPH_H
#define KARST_TESTS_LANGUAGE_RANDOM_GRAPH_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#include "producers/language/graph/data.h"
#include "producers/language/tape/tape.h"

static uint64_t random_state;
static inline uint32_t random_bits(void)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    uint32_t x = (uint32_t)(random_state >> 32);
    x ^= x >> 16;
    x *= 0x7feb352du;
    return x ^ (x >> 15);
}
static inline uint32_t random_below(uint32_t n) { return random_bits() % n; }
static inline bool random_chance(uint32_t one_in) { return random_below(one_in) == 0; }
static inline double random_unit(void) { return random_bits() * 0x1p-32; }
static inline double random_magnitude(double least, double most) { return least * pow(most / least, random_unit()); }

/* More than half of the nodes are bools, ints and uints. */
static bool random_prefers_whole;

enum { GRAPH_PARAMETERS = 2, GRAPH_MAX_POOL = 256 };

#define RANDOM_ROOTS 4

/* Where a graph is looked at: a box of level-0 voxels. */
typedef struct {
    int64_t voxel[3];
    uint32_t fraction[3];
    float radius[3];
    int voxel_log2_m;
} random_place;

typedef struct {
    karst_graph graph;
    karst_arena arena;
    karst_expr pool[4][GRAPH_MAX_POOL]; /* by type */
    uint32_t count[4];
    karst_expr root[RANDOM_ROOTS]; /* the latest floats that are not uniform, then places */
    karst_number parameters[GRAPH_PARAMETERS];
    const random_place *place;
    bool with_noise;
} random_graph;

static inline void graph_is_full(void *user, uint32_t where)
{
    (void)user;
    (void)where;
    abort();
}

static inline random_place random_place_make(void)
{
    static const double far[] = {0, 0, 1e9, 1e15};
    random_place place;
    double base = far[random_below(4)], size = random_magnitude(1e-6, random_chance(4) ? 1e9 : 1e3);
    place.voxel_log2_m = random_chance(2) ? 0 : -4;
    bool aligned = random_chance(3);
    if (aligned)
        size = exp2(round(log2(size)));
    for (int i = 0; i < 3; i++) {
        double sign = random_chance(2) ? 1 : -1, away = random_chance(4) ? 0 : random_magnitude(1, 1e4);
        place.voxel[i] = (int64_t)(sign * (base + rint(away)));
        place.fraction[i] = aligned ? 0 : random_chance(2) ? random_bits() : random_below(4) << 30;
        place.radius[i] = (float)(size * (random_chance(3) && !aligned ? random_unit() + 1e-3 : 1));
    }
    return place;
}

/* ---- parts ---- */

static inline karst_number random_number(void)
{
    static const double special[] = {0,    0.5,   1,     -1,    2,    1.5,       2.5, -0.5, 3,
                                     1e20, 1e-20, -1e20, 1e-40, 0.25, 6.2831853, 10,  100,  1 / 3.0};
    if (random_chance(400)) /* NaN, and what is infinite as a float */
        return random_chance(2) ? karst_number_divide(karst_number_int(0), karst_number_int(0))
                                : karst_number_double(1e39);
    switch (random_below(4)) {
    case 0:
        return karst_number_shortest(special[random_below(sizeof special / sizeof *special)]);
    case 1:
        return karst_number_ratio((int64_t)random_below(2000) - 1000, 1 + random_below(16));
    default:
        return karst_number_double((random_chance(2) ? 1 : -1) * (double)(float)random_magnitude(1e-3, 1e3));
    }
}

static inline void pool_add(random_graph *r, karst_expr e)
{
    int type = r->graph.nodes[e].type;
    if (r->count[type] < GRAPH_MAX_POOL)
        r->pool[type][r->count[type]++] = e;
}

static inline karst_expr pool_pick(random_graph *r, int type)
{
    uint32_t count = r->count[type];
    uint32_t back = random_chance(3) ? random_below(count) : random_below(count < 6 ? count : 6);
    return r->pool[type][count - 1 - back];
}

static inline karst_affine random_affine(random_graph *r)
{
    const random_place *place = r->place;
    karst_graph *g = &r->graph;
    karst_affine affine = {{0}, 0};
    double metres = ldexp(1, place->voxel_log2_m), size = (double)place->radius[0] * metres;
    int axes = random_chance(2) ? 1 << random_below(3) : 1 + (int)random_below(7);
    double scale = random_chance(2) ? random_magnitude(0.01, 20) / size : random_magnitude(0.01, 100);
    scale = fmin(fmax(scale, 1e-12), 100 / metres);
    karst_number at = karst_number_int(0);
    for (int i = 0; i < 3; i++) {
        if (!(axes >> i & 1))
            continue;
        double c = scale * (random_chance(2) ? 1 : random_unit() + 0.1) * (random_chance(2) ? 1 : -1);
        karst_number n = random_chance(3)               ? karst_number_double(exp2(rint(log2(fabs(c)))))
                         : c > 1e-4 && random_chance(2) ? karst_number_ratio((int64_t)(c * 1e5), 100000)
                                                        : karst_number_double((double)(float)c);
        affine.coefficient[i] = karst_graph_number(g, KARST_TYPE_FLOAT, n);
        karst_number p = karst_number_multiply(karst_number_int(place->voxel[i]), karst_number_double(metres));
        at = karst_number_add(at, karst_number_multiply(n, p));
    }
    karst_number offset = random_chance(3) ? random_number() : karst_number_negate(at);
    if (random_chance(2))
        offset = karst_number_add(offset, karst_number_double((random_unit() - 0.5) * size * scale * 3));
    affine.offset = karst_graph_number(g, KARST_TYPE_FLOAT, offset);
    return affine;
}

static inline karst_expr random_affine_leaf(random_graph *r) { return karst_graph_affine(&r->graph, random_affine(r)); }

/* AFFINE, or SHIFTED by an earlier float. */
static inline karst_expr random_argument_with_place(random_graph *r)
{
    karst_expr affine = random_affine_leaf(r);
    if (random_chance(2))
        return affine;
    karst_expr offset = pool_pick(r, KARST_TYPE_FLOAT);
    if (karst_graph_is_uniform(&r->graph, offset))
        return affine;
    return karst_graph_raw(&r->graph, KARST_OP_SHIFTED, KARST_TYPE_FLOAT, 0, affine, offset, 0, 0);
}

static inline karst_expr random_noise(random_graph *r)
{
    static const double gains[] = {0.5, 0.25, 0.7, 1}, lacunarities[] = {2, 2, 1.9, 3};
    karst_graph *g = &r->graph;
    karst_noise noise = {.base =
                             (uint8_t)(random_chance(2) ? KARST_NOISE_GRADIENT : random_below(KARST_NUM_NOISE_BASES)),
                         .shape = (uint8_t)random_below(4),
                         .derivative = (uint8_t)(random_chance(4) ? 1 + random_below(3) : 0),
                         .num_octaves = (uint16_t)(1 + random_below(4)),
                         .seed_offset = random_below(100)};
    noise.gain = karst_graph_float(g, gains[random_below(4)]);
    noise.lacunarity = karst_graph_float(g, lacunarities[random_below(4)]);
    karst_expr arg[3];
    for (int i = 0; i < 3; i++)
        arg[i] = random_chance(4) ? pool_pick(r, KARST_TYPE_FLOAT) : random_argument_with_place(r);
    return karst_graph_noise(g, noise, arg[0], arg[1], arg[2]);
}

/* Division, often by what is not 0. */
static inline karst_expr random_quotient(random_graph *r, karst_op op, karst_expr a, karst_expr b)
{
    karst_graph *g = &r->graph;
    if (random_chance(2))
        b = karst_graph_number(g, KARST_TYPE_FLOAT, random_number());
    else if (!random_chance(8))
        b = karst_expr_2(g, KARST_OP_ADD, karst_expr_1(g, KARST_OP_ABS, b),
                         karst_graph_float(g, random_magnitude(0.01, 10)));
    return karst_expr_2(g, op, a, b);
}

/* Bits as float, often of a number from 1 to 2. */
static inline karst_expr random_bits_as_float(random_graph *r)
{
    karst_graph *g = &r->graph;
    int type = random_chance(2) ? KARST_TYPE_INT : KARST_TYPE_UINT;
    karst_expr a = pool_pick(r, type);
    if (!random_chance(8)) {
        a = karst_expr_2(g, KARST_OP_BIT_AND, a,
                         karst_graph_number(g, (karst_scalar_type)type, karst_number_int(0x7fffff)));
        a = karst_expr_2(g, KARST_OP_BIT_OR, a,
                         karst_graph_number(g, (karst_scalar_type)type, karst_number_int(0x3f800000)));
    }
    return karst_expr_bits(g, KARST_TYPE_FLOAT, a);
}

/* t * t * (3 - 2 * t), mostly of a t from 0 to 1. */
static inline karst_expr random_fade(random_graph *r, karst_expr a)
{
    karst_graph *g = &r->graph;
    karst_expr t = random_chance(4) ? a
                   : random_chance(2)
                       ? karst_expr_1(g, KARST_OP_FRACT, a)
                       : karst_expr_2(g, KARST_OP_MIN, karst_expr_2(g, KARST_OP_MAX, a, karst_graph_float(g, 0)),
                                      karst_graph_float(g, 1));
    karst_expr line = karst_expr_3(g, KARST_OP_FMA, t, karst_graph_float(g, -2), karst_graph_float(g, 3));
    return karst_expr_2(g, KARST_OP_MULTIPLY, karst_expr_2(g, KARST_OP_MULTIPLY, t, t), line);
}

static inline karst_expr random_float_node(random_graph *r)
{
    static const karst_op one[] = {KARST_OP_NEGATE, KARST_OP_ABS,  KARST_OP_FLOOR, KARST_OP_CEIL, KARST_OP_RINT,
                                   KARST_OP_FRACT,  KARST_OP_SQRT, KARST_OP_SIN,   KARST_OP_COS,  KARST_OP_EXP2,
                                   KARST_OP_LOG,    KARST_OP_ABS,  KARST_OP_FRACT};
    static const karst_op two[] = {KARST_OP_ADD, KARST_OP_SUBTRACT, KARST_OP_MULTIPLY,
                                   KARST_OP_MIN, KARST_OP_MAX,      KARST_OP_ATAN};
    karst_graph *g = &r->graph;
    karst_expr a = pool_pick(r, KARST_TYPE_FLOAT), b = pool_pick(r, KARST_TYPE_FLOAT),
               c = pool_pick(r, KARST_TYPE_FLOAT);
    switch (random_below(r->with_noise ? 15 : 14)) {
    case 0:
    case 1:
    case 2:
        return karst_expr_1(g, one[random_below(sizeof one / sizeof *one)], a);
    case 3:
        return random_quotient(r, random_chance(2) ? KARST_OP_DIVIDE : KARST_OP_MOD, a, b);
    case 4:
    case 5:
    case 6:
        return karst_expr_2(g, two[random_below(sizeof two / sizeof *two)], a, b);
    case 7:
        if (random_chance(2))
            c = random_fade(r, c);
        if (random_chance(4))
            return c;
        return random_chance(2) ? karst_expr_3(g, KARST_OP_FMA, a, b, c) : karst_expr_3(g, KARST_OP_MIX, a, b, c);
    case 8: {
        karst_expr v[4] = {a, b, c, pool_pick(r, KARST_TYPE_FLOAT)};
        return karst_expr_length(g, v, 2 + (int)random_below(3));
    }
    case 9:
        return karst_expr_3(g, KARST_OP_SELECT, pool_pick(r, KARST_TYPE_BOOL), a, b);
    case 10:
        return random_chance(3) ? random_bits_as_float(r)
                                : karst_expr_convert(g, KARST_TYPE_FLOAT, pool_pick(r, 1 + (int)random_below(3)));
    case 11: /* of an exact place */
        a = random_argument_with_place(r);
        switch (random_below(5)) {
        case 0:
            return karst_expr_1(g, KARST_OP_FLOOR, a);
        case 1:
            return karst_expr_1(g, KARST_OP_FRACT, a);
        case 2:
            return karst_expr_1(g, KARST_OP_SIN_TURNS, a);
        case 3:
            return karst_expr_1(g, KARST_OP_COS_TURNS, a);
        default:
            return karst_expr_2(g, KARST_OP_MOD, a, karst_graph_number(g, KARST_TYPE_FLOAT, random_number()));
        }
    case 12:
        return random_affine_leaf(r);
    case 13:
        return karst_graph_number(g, KARST_TYPE_FLOAT, random_number());
    default:
        return random_noise(r);
    }
}

static inline karst_expr random_bool_node(random_graph *r)
{
    static const karst_op compare[] = {KARST_OP_LESS, KARST_OP_LESS_EQUAL, KARST_OP_EQUAL, KARST_OP_NOT_EQUAL};
    karst_graph *g = &r->graph;
    karst_expr a = pool_pick(r, KARST_TYPE_BOOL), b = pool_pick(r, KARST_TYPE_BOOL);
    int type = random_chance(2) ? KARST_TYPE_FLOAT : (int)random_below(4);
    switch (random_below(6)) {
    case 0:
        return karst_expr_1(g, KARST_OP_NOT, a);
    case 1:
        return karst_expr_2(g, random_chance(2) ? KARST_OP_AND : KARST_OP_OR, a, b);
    case 2:
        return karst_expr_3(g, KARST_OP_SELECT, a, b, pool_pick(r, KARST_TYPE_BOOL));
    default:
        return karst_expr_2(g, compare[random_below(4)], pool_pick(r, type), pool_pick(r, type));
    }
}

/* A whole number of an exact place: its low bits, or its rest. */
static inline karst_expr random_cell(random_graph *r)
{
    static const int32_t moduli[] = {0, 2, 3, 7, 16, 24, 1000, 0x7fffff};
    karst_expr place = random_argument_with_place(r);
    int32_t modulus = moduli[random_below(8)];
    return karst_graph_raw(&r->graph, KARST_OP_CELL, KARST_TYPE_INT, random_below(2), place,
                           modulus ? karst_graph_int(&r->graph, modulus) : 0, 0, 0);
}

static inline karst_expr random_int_node(random_graph *r, int type)
{
    static const karst_op two[] = {
        KARST_OP_INT_ADD, KARST_OP_INT_SUBTRACT, KARST_OP_INT_MULTIPLY, KARST_OP_INT_DIVIDE, KARST_OP_INT_MODULO,
        KARST_OP_BIT_AND, KARST_OP_BIT_OR,       KARST_OP_BIT_XOR,      KARST_OP_SHIFT_LEFT, KARST_OP_SHIFT_RIGHT};
    static const int64_t special[] = {0, 1, 2, 3, 7, 255, 0x7fffff, 0x7fffffff, 0x3f800000, 13, 16};
    karst_graph *g = &r->graph;
    karst_expr a = pool_pick(r, type), b = pool_pick(r, type);
    switch (random_below(8)) {
    case 0:
        if (type == KARST_TYPE_INT && random_chance(2))
            return random_cell(r);
        return karst_expr_convert(g, (karst_scalar_type)type, pool_pick(r, KARST_TYPE_FLOAT));
    case 1:
        return karst_expr_convert(g, (karst_scalar_type)type, pool_pick(r, (int)random_below(4)));
    case 2:
        return karst_expr_bits(g, (karst_scalar_type)type, pool_pick(r, KARST_TYPE_FLOAT));
    case 3:
        return karst_expr_3(g, KARST_OP_SELECT, pool_pick(r, KARST_TYPE_BOOL), a, b);
    case 4:
        return karst_expr_1(g, KARST_OP_BIT_NOT, a);
    default:
        if (random_chance(2))
            b = karst_graph_number(g, (karst_scalar_type)type, karst_number_int(special[random_below(11)]));
        return karst_expr_2(g, two[random_below(10)], a, b);
    }
}

/* As kinds.c tells them apart, as far as bounds care: what is piecewise constant. */
static inline void set_kinds(karst_graph *g)
{
    for (uint32_t e = 1; e < g->num_nodes; e++) {
        karst_expr_node *n = &g->nodes[e];
        bool steps =
            n->op == KARST_OP_FLOOR || n->op == KARST_OP_CEIL || n->op == KARST_OP_RINT || n->type != KARST_TYPE_FLOAT;
        if (!steps && n->arg[0] && n->op != KARST_OP_NOISE) {
            steps = true;
            for (int k = 0; k < 4; k++)
                steps = steps && (!n->arg[k] || karst_graph_is_uniform(g, n->arg[k]) ||
                                  g->nodes[n->arg[k]].kind == KARST_KIND_STEPS);
        }
        n->kind = karst_graph_is_uniform(g, e) ? KARST_KIND_UNIFORM
                  : n->op == KARST_OP_AFFINE   ? KARST_KIND_AFFINE
                  : n->op == KARST_OP_SHIFTED  ? KARST_KIND_SHIFTED
                  : steps                      ? KARST_KIND_STEPS
                                               : KARST_KIND_FLOAT;
    }
}

/* A graph of at most about `num_nodes` nodes around a place: what the first `num_roots` roots reach. Free with
 * random_graph_finish. */
static inline void random_graph_make(random_graph *r, const random_place *place, uint32_t num_nodes, bool with_noise,
                                     size_t num_roots)
{
    *r = (random_graph){.place = place, .with_noise = with_noise};
    karst_arena_init(&r->arena, (size_t)1 << 28, NULL, NULL);
    karst_graph_init(&r->graph, &r->arena, 1u << 16, graph_is_full, NULL);
    karst_graph *g = &r->graph;
    for (int i = 0; i < GRAPH_PARAMETERS; i++) {
        r->parameters[i] = random_number();
        pool_add(r, karst_graph_leaf(g, KARST_OP_PARAMETER, (uint32_t)i));
    }
    pool_add(r, karst_graph_number(g, KARST_TYPE_FLOAT, random_number()));
    for (int i = 0; i < 3; i++)
        pool_add(r, random_affine_leaf(r));
    pool_add(r, karst_expr_2(g, KARST_OP_LESS, r->pool[0][3], r->pool[0][4]));
    pool_add(r, karst_expr_convert(g, KARST_TYPE_INT, r->pool[0][3]));
    pool_add(r, karst_expr_convert(g, KARST_TYPE_UINT, karst_expr_1(g, KARST_OP_FLOOR, r->pool[0][4])));
    while (g->num_nodes < num_nodes) {
        uint32_t what = random_below(random_prefers_whole ? 4 : 10);
        karst_expr e = what == 0 ? random_bool_node(r)
                       : what == 1 || (what == 2 && random_prefers_whole)
                           ? random_int_node(r, random_chance(2) ? KARST_TYPE_INT : KARST_TYPE_UINT)
                           : random_float_node(r);
        pool_add(r, e);
    }
    uint32_t found = 0;
    for (uint32_t i = r->count[0]; i > 0 && found < RANDOM_ROOTS; i--)
        if (!karst_graph_is_uniform(g, r->pool[0][i - 1]))
            r->root[found++] = r->pool[0][i - 1];
    while (found < num_roots)
        r->root[found++] = random_affine_leaf(r);
    karst_graph live;
    karst_graph_init(&live, &r->arena, 1u << 16, graph_is_full, NULL);
    karst_graph_extract(g, &live, r->root, num_roots);
    *g = live;
    set_kinds(g);
}

/* Nodes that may be computed in pairs become so at random. */
static inline void random_graph_widen(random_graph *r)
{
    for (uint32_t e = 1; e < r->graph.num_nodes; e++) {
        karst_expr_node *n = &r->graph.nodes[e];
        bool can = (n->op >= KARST_OP_ADD && n->op <= KARST_OP_ABS) || n->op == KARST_OP_MIX ||
                   n->op == KARST_OP_SQRT || n->op == KARST_OP_LENGTH ||
                   (n->op == KARST_OP_SELECT && n->type == KARST_TYPE_FLOAT);
        if (can && n->kind == KARST_KIND_FLOAT && random_chance(3))
            n->kind = KARST_KIND_WIDE;
    }
}

static inline void random_graph_finish(random_graph *r) { karst_arena_finish(&r->arena); }

#endif
