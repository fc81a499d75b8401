/* Resolved graphs at random, for tests of back ends: every op that they execute, recent operands preferred, numbers
 * with the awkward ones among them. */
#ifndef KARST_TESTS_LANGUAGE_WILD_GRAPH_H
#define KARST_TESTS_LANGUAGE_WILD_GRAPH_H

#include "producers/language/graph/graph.h"

typedef struct {
    uint64_t state;
} wild_source;

static uint32_t wild_bits(wild_source *random)
{
    random->state = random->state * 6364136223846793005u + 1442695040888963407u;
    uint64_t mixed = random->state ^ random->state >> 29;
    return (uint32_t)(mixed * 0xbf58476d1ce4e5b9u >> 32);
}
/* 0 to n - 1 */
static uint32_t wild_below(wild_source *random, uint32_t n)
{
    return (uint32_t)((uint64_t)wild_bits(random) * n >> 32);
}

/* PARAMETER leaves that the graphs use. */
#define WILD_PARAMETERS 3

static karst_expr wild_number(karst_graph *g, wild_source *random)
{
    static const double awkward[] = {0, 1, -1, 0.5, 2, -2.5, 1e-20, -1e20, 0x1p-130, 3.4e38, 1e9, -0.1};
    switch (wild_below(random, 8)) {
    case 0:
        return karst_graph_float(g, awkward[wild_below(random, sizeof awkward / sizeof *awkward)]);
    case 1:
        return karst_graph_leaf(g, KARST_OP_PARAMETER, wild_below(random, WILD_PARAMETERS));
    default:
        return karst_graph_float(g, ((double)wild_bits(random) - 0x1p31) * 0x1p-29);
    }
}

/* Of one axis (3: of one or several, at random). */
static karst_expr wild_affine_of(karst_graph *g, wild_source *random, uint32_t axis)
{
    karst_affine affine = {.offset = wild_number(g, random)};
    bool one_axis = axis < 3 || wild_below(random, 3) != 0;
    uint32_t only = axis < 3 ? axis : wild_below(random, 3);
    for (uint32_t i = 0; i < 3; i++) {
        if (one_axis ? i != only : wild_below(random, 3) == 0)
            continue;
        double size = 1.0 / (double)(1u << wild_below(random, 10));
        karst_number c = karst_number_ratio((int64_t)wild_below(random, 2000) - 1000, 1 + wild_below(random, 1000));
        if (wild_below(random, 2))
            c = karst_number_double(c.value * size);
        affine.coefficient[i] = karst_graph_number(g, KARST_TYPE_FLOAT, c);
    }
    return karst_graph_affine(g, affine);
}
static karst_expr wild_affine(karst_graph *g, wild_source *random) { return wild_affine_of(g, random, 3); }

/* A node of a type, latest ones preferred; KARST_NO_EXPR if there is none. */
static karst_expr wild_operand(const karst_graph *g, wild_source *random, karst_scalar_type type)
{
    for (int tries = 0; tries < 40; tries++) {
        uint32_t back = wild_below(random, wild_below(random, 2) ? 8 : g->num_nodes) + 1;
        karst_expr e = back < g->num_nodes ? g->num_nodes - back : 1;
        if (g->nodes[e].type == type && g->nodes[e].op != KARST_OP_NONE)
            return e;
    }
    for (karst_expr e = g->num_nodes - 1; e > 0; e--)
        if (g->nodes[e].type == type)
            return e;
    return KARST_NO_EXPR;
}

static karst_expr wild_noise(karst_graph *g, wild_source *random)
{
    karst_noise noise = {.shape = (uint8_t)wild_below(random, 4)};
    if (wild_below(random, 2))
        noise.base = (uint8_t)wild_below(random, KARST_NUM_NOISE_BASES);
    noise.derivative = (uint8_t)(wild_below(random, 4) ? 0 : 1 + wild_below(random, 3));
    noise.num_octaves = (uint16_t)(1 + wild_below(random, 4));
    noise.seed_offset = wild_bits(random);
    noise.gain = karst_graph_float(g, 0.5);
    noise.lacunarity = wild_below(random, 2) ? karst_graph_float(g, 2) : karst_graph_float(g, 1.9);
    karst_expr arg[3];
    if (wild_below(random, 2)) { /* a lattice along the axes, in parts of a cell a voxel */
        for (uint32_t i = 0; i < 3; i++)
            arg[i] = wild_affine_of(g, random, i);
        return karst_graph_noise(g, noise, arg[0], arg[1], arg[2]);
    }
    for (int i = 0; i < 3; i++) {
        arg[i] = wild_below(random, 3) ? wild_affine(g, random) : wild_operand(g, random, KARST_TYPE_FLOAT);
        if (wild_below(random, 3) == 0 && g->nodes[arg[i]].op == KARST_OP_AFFINE)
            arg[i] = karst_graph_raw(g, KARST_OP_SHIFTED, KARST_TYPE_FLOAT, 0, arg[i],
                                     wild_operand(g, random, KARST_TYPE_FLOAT), 0, 0);
    }
    return karst_graph_noise(g, noise, arg[0], arg[1], arg[2]);
}

/* Ops that work on exact places. */
static karst_expr wild_placed(karst_graph *g, wild_source *random)
{
    static const karst_op ops[] = {KARST_OP_FLOOR, KARST_OP_FRACT, KARST_OP_MOD, KARST_OP_SIN_TURNS,
                                   KARST_OP_COS_TURNS};
    karst_op op = ops[wild_below(random, sizeof ops / sizeof *ops)];
    karst_expr a = wild_affine(g, random);
    if (wild_below(random, 2))
        a = karst_graph_raw(g, KARST_OP_SHIFTED, KARST_TYPE_FLOAT, 0, a, wild_operand(g, random, KARST_TYPE_FLOAT), 0,
                            0);
    karst_expr b = op == KARST_OP_MOD ? wild_number(g, random) : KARST_NO_EXPR;
    return karst_graph_raw(g, op, KARST_TYPE_FLOAT, 0, a, b, 0, 0);
}

static karst_expr wild_op(karst_graph *g, wild_source *random, karst_op op)
{
    karst_expr f[4], i[2], b[2];
    for (int k = 0; k < 4; k++)
        f[k] = wild_operand(g, random, KARST_TYPE_FLOAT);
    karst_scalar_type whole = wild_below(random, 2) ? KARST_TYPE_INT : KARST_TYPE_UINT;
    for (int k = 0; k < 2; k++) {
        i[k] = wild_operand(g, random, whole);
        b[k] = wild_operand(g, random, KARST_TYPE_BOOL);
    }
    switch (op) {
    case KARST_OP_NOISE:
        return wild_noise(g, random);
    case KARST_OP_SIN_TURNS:
        return wild_placed(g, random);
    case KARST_OP_AFFINE:
        return wild_affine(g, random);
    case KARST_OP_LENGTH: {
        uint32_t n = 2 + wild_below(random, 3);
        return karst_graph_raw(g, op, KARST_TYPE_FLOAT, 0, f[0], f[1], n > 2 ? f[2] : 0, n > 3 ? f[3] : 0);
    }
    case KARST_OP_NEGATE:
    case KARST_OP_ABS:
    case KARST_OP_FLOOR:
    case KARST_OP_CEIL:
    case KARST_OP_RINT:
    case KARST_OP_FRACT:
    case KARST_OP_SQRT:
    case KARST_OP_SIN:
    case KARST_OP_COS:
    case KARST_OP_EXP2:
    case KARST_OP_LOG:
        return karst_graph_raw(g, op, KARST_TYPE_FLOAT, 0, f[0], 0, 0, 0);
    case KARST_OP_FMA:
    case KARST_OP_MIX:
        return karst_graph_raw(g, op, KARST_TYPE_FLOAT, 0, f[0], f[1], f[2], 0);
    case KARST_OP_LESS:
    case KARST_OP_LESS_EQUAL:
    case KARST_OP_EQUAL:
    case KARST_OP_NOT_EQUAL:
        return wild_below(random, 2) ? karst_graph_raw(g, op, KARST_TYPE_BOOL, 0, f[0], f[1], 0, 0)
                                     : karst_graph_raw(g, op, KARST_TYPE_BOOL, 0, i[0], i[1], 0, 0);
    case KARST_OP_NOT:
        return karst_graph_raw(g, op, KARST_TYPE_BOOL, 0, b[0], 0, 0, 0);
    case KARST_OP_AND:
    case KARST_OP_OR:
        return karst_graph_raw(g, op, KARST_TYPE_BOOL, 0, b[0], b[1], 0, 0);
    case KARST_OP_SELECT:
        return wild_below(random, 2) ? karst_graph_raw(g, op, KARST_TYPE_FLOAT, 0, b[0], f[0], f[1], 0)
                                     : karst_graph_raw(g, op, whole, 0, b[0], i[0], i[1], 0);
    case KARST_OP_BIT_NOT:
        return karst_graph_raw(g, op, whole, 0, i[0], 0, 0, 0);
    case KARST_OP_INT_ADD:
    case KARST_OP_INT_SUBTRACT:
    case KARST_OP_INT_MULTIPLY:
    case KARST_OP_INT_DIVIDE:
    case KARST_OP_INT_MODULO:
    case KARST_OP_BIT_AND:
    case KARST_OP_BIT_OR:
    case KARST_OP_BIT_XOR:
    case KARST_OP_SHIFT_LEFT:
    case KARST_OP_SHIFT_RIGHT:
        return karst_graph_raw(g, op, whole, 0, i[0], i[1], 0, 0);
    case KARST_OP_CONVERT:
    case KARST_OP_BITS: {
        static const karst_scalar_type types[] = {KARST_TYPE_FLOAT, KARST_TYPE_INT, KARST_TYPE_UINT, KARST_TYPE_BOOL};
        uint32_t num_types = op == KARST_OP_BITS ? 3 : 4;
        karst_scalar_type to = types[wild_below(random, num_types)], from = types[wild_below(random, num_types)];
        if (to == from || (op == KARST_OP_BITS && to != KARST_TYPE_FLOAT && from != KARST_TYPE_FLOAT))
            to = to == KARST_TYPE_FLOAT ? KARST_TYPE_INT : KARST_TYPE_FLOAT;
        if (to == from)
            from = KARST_TYPE_FLOAT;
        if (to == from)
            return KARST_NO_EXPR;
        return karst_graph_raw(g, op, to, 0, wild_operand(g, random, from), 0, 0, 0);
    }
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
    case KARST_OP_MULTIPLY:
    case KARST_OP_DIVIDE:
    case KARST_OP_MIN:
    case KARST_OP_MAX:
    case KARST_OP_MOD:
    case KARST_OP_ATAN:
        return karst_graph_raw(g, op, KARST_TYPE_FLOAT, 0, f[0], f[1], 0, 0);
    default:
        return KARST_NO_EXPR;
    }
}

/* Makes pairs of some of the nodes that may be. */
static void wild_kinds(karst_graph *g, wild_source *random)
{
    for (karst_expr e = 1; e < g->num_nodes; e++) {
        bool may = false;
        switch (g->nodes[e].op) {
        case KARST_OP_ADD:
        case KARST_OP_SUBTRACT:
        case KARST_OP_MULTIPLY:
        case KARST_OP_DIVIDE:
        case KARST_OP_FMA:
        case KARST_OP_NEGATE:
        case KARST_OP_MIN:
        case KARST_OP_MAX:
        case KARST_OP_ABS:
        case KARST_OP_MIX:
        case KARST_OP_SQRT:
        case KARST_OP_LENGTH:
        case KARST_OP_SELECT:
            may = g->nodes[e].type == KARST_TYPE_FLOAT && !karst_graph_is_uniform(g, e);
            break;
        default:
            break;
        }
        g->nodes[e].kind = may && wild_below(random, 3) == 0 ? KARST_KIND_WIDE : KARST_KIND_FLOAT;
    }
}

/* Fills an empty graph with about `size` nodes and returns a float to which many of them contribute. */
static karst_expr wild_graph(karst_graph *g, wild_source *random, uint32_t size)
{
    for (int k = 0; k < 2; k++) {
        wild_affine(g, random);
        wild_number(g, random);
        karst_graph_int(g, (int32_t)wild_bits(random));
        karst_graph_number(g, KARST_TYPE_UINT, karst_number_int(wild_bits(random)));
        karst_graph_bool(g, k);
    }
    wild_op(g, random, KARST_OP_AFFINE);
    while (g->num_nodes < size)
        wild_op(g, random, (karst_op)wild_below(random, KARST_NUM_OPS));
    /* a few of the latest, bounded, so that no overflow hides the rest */
    wild_kinds(g, random);
    karst_expr sum = karst_graph_float(g, 0.25);
    uint32_t last = g->num_nodes;
    for (karst_expr e = last - 1, taken = 0; e > 0 && taken < 12; e--) {
        if (g->nodes[e].type != KARST_TYPE_FLOAT || karst_graph_is_uniform(g, e))
            continue;
        karst_expr bounded = karst_graph_raw(g, KARST_OP_SIN, KARST_TYPE_FLOAT, 0, e, 0, 0, 0);
        sum = karst_graph_raw(g, KARST_OP_ADD, KARST_TYPE_FLOAT, 0, sum, bounded, 0, 0);
        taken++;
    }
    return sum;
}

#endif
