#include "producers/language/graph/soften.h"
#include "producers/language/image/image.h"

#include <math.h>
#include <string.h>

/* Footprints wider than a quarter of a period begin to hide it, half a period hides it. */
#define FADE_FROM_CYCLES 0.25
#define FADE_PER_CYCLE 4.0
/* Of noise, where it is not flat: typical length of the gradient of an octave of amplitude 1, per cell. */
#define TYPICAL_SLOPE 0.8
/* Octaves that count: finer ones are near what a footprint hides when the coarse ones change much across it. */
#define SLOPE_OCTAVES 4
#define NOT_KNOWN UINT32_MAX
#define LEAST_WIDTH 1e-30

typedef struct {
    karst_graph *graph;
    uint32_t count;        /* nodes that were there at first */
    karst_expr *soft;      /* of each: what it becomes; KARST_NO_EXPR: not reached */
    karst_expr *steepness; /* of each: |gradient| per metre of surface, of uniform numbers and the normal;
                            * KARST_NO_EXPR: not looked at yet; or NOT_KNOWN */
    karst_expr footprint;
} softener;

static karst_expr number(softener *s, double value) { return karst_graph_float(s->graph, value); }
static karst_expr add(softener *s, karst_expr a, karst_expr b) { return karst_expr_2(s->graph, KARST_OP_ADD, a, b); }
static karst_expr times(softener *s, karst_expr a, karst_expr b)
{
    return karst_expr_2(s->graph, KARST_OP_MULTIPLY, a, b);
}
static karst_expr magnitude(softener *s, karst_expr a) { return karst_expr_1(s->graph, KARST_OP_ABS, a); }

/* A constant's value; false: it is none. */
static bool is_constant(const softener *s, karst_expr e, double *value)
{
    const karst_number *constant = e ? karst_graph_constant(s->graph, e) : NULL;
    if (constant)
        *value = constant->value;
    return constant != NULL;
}

/* ---- how fast a value changes ---- */

static karst_expr steepness_of(const softener *s, karst_expr e)
{
    return karst_graph_is_uniform(s->graph, e) && s->graph->nodes[e].op != KARST_OP_NOISE
               ? karst_graph_float(s->graph, 0)
               : s->steepness[e];
}

static karst_expr sum(softener *s, karst_expr a, karst_expr b)
{
    return a == NOT_KNOWN || b == NOT_KNOWN ? NOT_KNOWN : add(s, a, b);
}

static karst_expr scaled(softener *s, karst_expr steepness, karst_expr factor)
{
    return steepness == NOT_KNOWN || !karst_graph_is_uniform(s->graph, factor)
               ? NOT_KNOWN
               : times(s, steepness, magnitude(s, factor));
}

static karst_expr hypotenuse(softener *s, const karst_expr *parts, int count)
{
    karst_expr known[4];
    int num_known = 0;
    for (int i = 0; i < count; i++) {
        if (parts[i] == NOT_KNOWN)
            return NOT_KNOWN;
        if (parts[i])
            known[num_known++] = parts[i];
    }
    if (num_known == 0)
        return number(s, 0);
    return num_known == 1 ? magnitude(s, known[0]) : karst_expr_length(s->graph, known, num_known);
}

/* The product of what there is of a coefficient, which may be KARST_NO_EXPR, for 0. */
static karst_expr product(softener *s, karst_expr coefficient, karst_expr normal)
{
    return coefficient ? times(s, coefficient, normal) : KARST_NO_EXPR;
}

/* The same of sums. */
static karst_expr sum_of_products(softener *s, karst_expr a, karst_expr b) { return a && b ? add(s, a, b) : a | b; }

/* How fast what is affine changes along the surface, over a footprint that lies longer on it where it is seen edge on
 * (core/base/facing_shared.h). Its gradient's length times the sine of the angle to the normal is given by their
 * cross product without loss where that is small. */
static karst_expr affine_steepness(softener *s, const karst_affine *affine)
{
    const karst_expr c[3] = {affine->coefficient[0], affine->coefficient[1], affine->coefficient[2]};
    karst_expr normal[3], parts[4], along[3];
    for (uint32_t k = 0; k < 3; k++)
        normal[k] = karst_graph_leaf(s->graph, KARST_OP_NORMAL, k);
    for (int k = 0; k < 3; k++) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        const karst_expr first = product(s, c[a], normal[b]), second = product(s, c[b], normal[a]);
        parts[k] = first && second ? karst_expr_2(s->graph, KARST_OP_SUBTRACT, first, second) : first | second;
    }
    for (uint32_t k = 0; k < 3; k++)
        along[k] = product(s, c[k], karst_graph_leaf(s->graph, KARST_OP_NORMAL, 3 + k));
    parts[3] = sum_of_products(s, sum_of_products(s, along[0], along[1]), along[2]);
    return hypotenuse(s, parts, 4);
}

static karst_expr noise_steepness(softener *s, const karst_expr_node *n)
{
    const karst_noise noise = s->graph->noises[n->extra];
    karst_expr parts[3], amplitude = number(s, 1), total = number(s, 0);
    for (int k = 0; k < 3; k++)
        parts[k] = n->arg[k] ? steepness_of(s, n->arg[k]) : KARST_NO_EXPR;
    karst_expr row = hypotenuse(s, parts, 3);
    if (row == NOT_KNOWN || noise.derivative)
        return NOT_KNOWN;
    if (noise.image)
        return times(s, row, number(s, karst_samples_image_steepness(noise.image)));
    for (int i = 0; i < noise.num_octaves && i < SLOPE_OCTAVES; i++) {
        total = add(s, total, amplitude);
        amplitude = times(s, amplitude, times(s, noise.gain, noise.lacunarity));
    }
    double shape = noise.shape == KARST_NOISE_SUM || noise.shape == KARST_NOISE_TURBULENCE ? 1 : 2;
    return times(s, times(s, row, magnitude(s, total)), number(s, shape * TYPICAL_SLOPE));
}

static karst_expr find_steepness(softener *s, karst_expr e)
{
    const karst_expr_node n = s->graph->nodes[e];
    karst_expr a = n.arg[0] ? steepness_of(s, n.arg[0]) : KARST_NO_EXPR,
               b = n.arg[1] ? steepness_of(s, n.arg[1]) : KARST_NO_EXPR;
    double factor;
    switch (n.op) {
    case KARST_OP_AFFINE:
        return affine_steepness(s, &s->graph->affines[n.extra]);
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
    case KARST_OP_SHIFTED:
        return sum(s, a, b);
    case KARST_OP_MULTIPLY:
        return karst_graph_is_uniform(s->graph, n.arg[0]) ? scaled(s, b, n.arg[0]) : scaled(s, a, n.arg[1]);
    case KARST_OP_DIVIDE:
        return a == NOT_KNOWN || !karst_graph_is_uniform(s->graph, n.arg[1])
                   ? NOT_KNOWN
                   : karst_expr_2(s->graph, KARST_OP_DIVIDE, a, magnitude(s, n.arg[1]));
    case KARST_OP_FMA: {
        karst_expr product =
            karst_graph_is_uniform(s->graph, n.arg[0]) ? scaled(s, b, n.arg[0]) : scaled(s, a, n.arg[1]);
        return sum(s, product, steepness_of(s, n.arg[2]));
    }
    case KARST_OP_NEGATE:
    case KARST_OP_ABS:
    case KARST_OP_FRACT: /* but where it jumps, which is what fading is for */
        return a;
    case KARST_OP_MOD:
        return karst_graph_is_uniform(s->graph, n.arg[1]) ? a : NOT_KNOWN;
    case KARST_OP_MIN:
    case KARST_OP_MAX:
        return a == NOT_KNOWN || b == NOT_KNOWN ? NOT_KNOWN : karst_expr_2(s->graph, KARST_OP_MAX, a, b);
    case KARST_OP_LENGTH: {
        karst_expr parts[4] = {a, b};
        int count = 2;
        for (; count < 4 && n.arg[count]; count++)
            parts[count] = steepness_of(s, n.arg[count]);
        /* At most that; and exactly 1 for the distance from a place. */
        karst_expr most = parts[0];
        for (int i = 1; i < count; i++)
            most = most == NOT_KNOWN || parts[i] == NOT_KNOWN ? NOT_KNOWN
                                                              : karst_expr_2(s->graph, KARST_OP_MAX, most, parts[i]);
        return most;
    }
    case KARST_OP_SIN_TURNS:
    case KARST_OP_COS_TURNS:
        return a == NOT_KNOWN ? a : times(s, a, number(s, 6.283185307179586));
    case KARST_OP_SIN:
    case KARST_OP_COS:
        return a;
    case KARST_OP_NOISE:
        return noise_steepness(s, &n);
    case KARST_OP_CELL:
        return a;
    case KARST_OP_INT_ADD:
    case KARST_OP_INT_SUBTRACT: { /* of cells that lie along different axes, as those of a checker */
        const karst_expr parts[2] = {a, b};
        return hypotenuse(s, parts, 2);
    }
    case KARST_OP_INT_MULTIPLY:
        return is_constant(s, n.arg[1], &factor) && a != NOT_KNOWN ? times(s, a, number(s, fabs(factor))) : NOT_KNOWN;
    case KARST_OP_INT_MODULO:
    case KARST_OP_BIT_AND:
        return is_constant(s, n.arg[1], &factor) ? a : NOT_KNOWN;
    default:
        return NOT_KNOWN;
    }
}

/* ---- fading and widening ---- */

/* 1 where a footprint shows all of what has so many cycles per metre, 0 where it hides it. */
static karst_expr visible(softener *s, karst_expr cycles_per_m)
{
    karst_graph *g = s->graph;
    karst_expr cycles = times(s, s->footprint, cycles_per_m), one = number(s, 1);
    karst_expr past = karst_expr_2(g, KARST_OP_SUBTRACT, cycles, number(s, FADE_FROM_CYCLES));
    karst_expr t = karst_expr_2(
        g, KARST_OP_MIN, karst_expr_2(g, KARST_OP_MAX, times(s, past, number(s, FADE_PER_CYCLE)), number(s, 0)), one);
    karst_expr curve = karst_expr_2(g, KARST_OP_SUBTRACT, number(s, 3), times(s, number(s, 2), t));
    return karst_expr_2(g, KARST_OP_SUBTRACT, one, times(s, times(s, t, t), curve));
}

static karst_expr fade_to(softener *s, karst_expr mean, karst_expr value, karst_expr cycles_per_m)
{
    return karst_expr_3(s->graph, KARST_OP_MIX, mean, value, visible(s, cycles_per_m));
}

/* ---- numbers of cells, of which a rest is left: checkers and stripes ---- */

/* More rests than this are told apart by no picture. */
#define MOST_RESTS 1024

/* One of `num` values, 0, 1 / divisor, 2 / divisor ..., and how often they come in turn. */
typedef struct {
    int num;
    double divisor;
    karst_expr cycles_per_m;
} rests;

static bool are_rests(softener *s, karst_expr e, rests *of)
{
    karst_expr_node n = s->graph->nodes[e];
    double modulus = 0;
    of->divisor = 1;
    if (n.op == KARST_OP_DIVIDE && is_constant(s, n.arg[1], &of->divisor))
        n = s->graph->nodes[n.arg[0]];
    if (n.op == KARST_OP_CONVERT && n.type == KARST_TYPE_FLOAT)
        n = s->graph->nodes[e = n.arg[0]];
    if (n.op == KARST_OP_SELECT && n.type == KARST_TYPE_INT) { /* of an int's rest, which has its sign */
        const karst_expr_node below = s->graph->nodes[n.arg[1]];
        if (below.op != KARST_OP_INT_SUBTRACT || below.arg[0] != n.arg[2])
            return false;
        n = s->graph->nodes[e = n.arg[2]];
    }
    if (n.type != KARST_TYPE_INT || !is_constant(s, n.arg[1], &modulus))
        return false;
    modulus += n.op == KARST_OP_BIT_AND; /* a mask */
    of->num = (int)modulus;
    if ((n.op != KARST_OP_CELL && n.op != KARST_OP_INT_MODULO && n.op != KARST_OP_BIT_AND) || modulus < 2 ||
        modulus > MOST_RESTS || (n.op == KARST_OP_BIT_AND && (of->num & (of->num - 1))) || s->steepness[e] == NOT_KNOWN)
        return false;
    of->cycles_per_m = times(s, s->steepness[e], number(s, 1 / modulus));
    return true;
}

/* Where a footprint hides them, a rest is all of them. */
static karst_expr fade_rest(softener *s, karst_expr e, karst_expr made)
{
    rests of;
    return s->graph->nodes[e].type == KARST_TYPE_FLOAT && are_rests(s, e, &of)
               ? fade_to(s, number(s, (of.num - 1) / (2 * of.divisor)), made, of.cycles_per_m)
               : made;
}

static bool holds(uint8_t op, double a, double b)
{
    return op == KARST_OP_LESS ? a < b : op == KARST_OP_LESS_EQUAL ? a <= b : op == KARST_OP_EQUAL ? a == b : a != b;
}

/* A choice by a comparison of a rest with a constant: there both mix, by how many of the rests choose which.
 * KARST_NO_EXPR: it is no such choice. */
static karst_expr fade_choice(softener *s, karst_expr old, karst_expr made)
{
    karst_graph *g = s->graph;
    const karst_expr_node was = g->nodes[old], now = g->nodes[made], condition = g->nodes[was.arg[0]];
    rests of;
    double than;
    if (now.op != KARST_OP_SELECT || now.type != KARST_TYPE_FLOAT || condition.op < KARST_OP_LESS ||
        condition.op > KARST_OP_NOT_EQUAL)
        return KARST_NO_EXPR;
    const bool first = is_constant(s, condition.arg[1], &than);
    if ((!first && !is_constant(s, condition.arg[0], &than)) || !are_rests(s, condition.arg[first ? 0 : 1], &of))
        return KARST_NO_EXPR;
    int num = 0;
    for (int i = 0; i < of.num; i++)
        num += first ? holds(condition.op, i / of.divisor, than) : holds(condition.op, than, i / of.divisor);
    const karst_expr sharp = karst_expr_3(g, KARST_OP_SELECT, was.arg[0], now.arg[1], now.arg[2]),
                     mixed = karst_expr_3(g, KARST_OP_MIX, now.arg[2], now.arg[1], number(s, num / (double)of.num));
    return fade_to(s, mixed, sharp, of.cycles_per_m);
}

/* A choice by a comparison of floats: across the edge, as far as the footprint reaches, both mix. */
static karst_expr widen_edge(softener *s, karst_expr old, karst_expr made)
{
    karst_graph *g = s->graph;
    const karst_expr_node was = g->nodes[old], now = g->nodes[made];
    if (was.op != KARST_OP_SELECT || now.op != KARST_OP_SELECT || now.type != KARST_TYPE_FLOAT)
        return made;
    const karst_expr_node condition = g->nodes[was.arg[0]], softened = g->nodes[now.arg[0]];
    if ((condition.op != KARST_OP_LESS && condition.op != KARST_OP_LESS_EQUAL) || softened.op != condition.op ||
        g->nodes[condition.arg[0]].type != KARST_TYPE_FLOAT)
        return made;
    karst_expr steepness = sum(s, steepness_of(s, condition.arg[0]), steepness_of(s, condition.arg[1]));
    if (steepness == NOT_KNOWN)
        return made;
    karst_expr width = karst_expr_2(g, KARST_OP_MAX, times(s, s->footprint, steepness), number(s, LEAST_WIDTH));
    karst_expr inside = karst_expr_2(g, KARST_OP_SUBTRACT, softened.arg[1], softened.arg[0]);
    karst_expr t = add(s, karst_expr_2(g, KARST_OP_DIVIDE, inside, width), number(s, 0.5));
    t = karst_expr_2(g, KARST_OP_MIN, karst_expr_2(g, KARST_OP_MAX, t, number(s, 0)), number(s, 1));
    return karst_expr_3(g, KARST_OP_MIX, now.arg[2], now.arg[1], t);
}

/* ---- the graph again ---- */

static karst_expr soft_of(const softener *s, karst_expr e) { return e ? s->soft[e] : KARST_NO_EXPR; }

/* ---- textures ---- */

static karst_expr texture_at(karst_graph *g, karst_expr texture, karst_expr share)
{
    const karst_expr_node n = g->nodes[texture];
    return karst_graph_noise(g, g->noises[n.extra], n.arg[0], n.arg[1], share);
}

/* A texture of three sides, mixed: each is looked up where it has a share. */
static karst_expr share_sides(karst_graph *g, karst_expr mixed)
{
    const karst_expr_node outer = g->nodes[mixed];
    if (outer.op != KARST_OP_MIX || g->nodes[outer.arg[0]].op != KARST_OP_MIX)
        return mixed;
    const karst_expr_node inner = g->nodes[outer.arg[0]];
    if (!karst_graph_is_texture(g, inner.arg[0]) || !karst_graph_is_texture(g, inner.arg[1]) ||
        !karst_graph_is_texture(g, outer.arg[1]))
        return mixed;
    const karst_expr one = karst_graph_float(g, 1), top = outer.arg[2], side = inner.arg[2];
    const karst_expr rest = karst_expr_2(g, KARST_OP_SUBTRACT, one, top);
    /* no products: those may be too small for floats */
    const karst_expr shares[2] = {karst_expr_2(g, KARST_OP_MIN, rest, karst_expr_2(g, KARST_OP_SUBTRACT, one, side)),
                                  karst_expr_2(g, KARST_OP_MIN, rest, side)};
    return karst_expr_3(g, KARST_OP_MIX,
                        karst_expr_3(g, KARST_OP_MIX, texture_at(g, inner.arg[0], shares[0]),
                                     texture_at(g, inner.arg[1], shares[1]), side),
                        texture_at(g, outer.arg[1], top), top);
}

/* The same operation on what its arguments became. Place-taking ops keep their places, which nothing changes. */
static karst_expr remake(softener *s, karst_expr e)
{
    const karst_expr_node n = s->graph->nodes[e];
    karst_expr arg[4];
    bool same = true;
    for (int k = 0; k < 4; k++) {
        arg[k] = soft_of(s, n.arg[k]);
        same = same && arg[k] == n.arg[k];
    }
    if (n.op == KARST_OP_NOISE && s->graph->noises[n.extra].texture && !s->graph->noises[n.extra].derivative) {
        karst_noise noise = s->graph->noises[n.extra];
        noise.image = noise.texture;
        noise.texture = NULL;
        return karst_graph_noise(s->graph, noise, arg[0], arg[1], karst_graph_float(s->graph, 1));
    }
    if (same)
        return e;
    if (n.op == KARST_OP_NOISE)
        return karst_graph_noise(s->graph, s->graph->noises[n.extra], arg[0], arg[1], arg[2]);
    return karst_graph_raw(s->graph, n.op, n.type, n.extra, arg[0], arg[1], arg[2], arg[3]);
}

static karst_expr soften_node(softener *s, karst_expr e)
{
    const karst_expr_node n = s->graph->nodes[e];
    karst_expr made = remake(s, e);
    if (karst_graph_is_uniform(s->graph, e))
        return made;
    karst_expr steepness = n.arg[0] ? steepness_of(s, n.arg[0]) : NOT_KNOWN;
    switch (n.op) {
    case KARST_OP_SIN_TURNS:
    case KARST_OP_COS_TURNS:
        return steepness == NOT_KNOWN ? made : times(s, visible(s, steepness), made);
    case KARST_OP_SIN:
    case KARST_OP_COS:
        return steepness == NOT_KNOWN ? made
                                      : times(s, visible(s, times(s, steepness, number(s, 0.15915494309189535))), made);
    case KARST_OP_FRACT:
        return steepness == NOT_KNOWN ? made : fade_to(s, number(s, 0.5), made, steepness);
    case KARST_OP_MOD:
        if (steepness == NOT_KNOWN || !karst_graph_is_uniform(s->graph, n.arg[1]))
            return made;
        return fade_to(s, times(s, n.arg[1], number(s, 0.5)), made,
                       karst_expr_2(s->graph, KARST_OP_DIVIDE, steepness, magnitude(s, n.arg[1])));
    case KARST_OP_CONVERT:
        return fade_rest(s, e, made);
    case KARST_OP_SELECT: {
        const karst_expr faded = fade_choice(s, e, made);
        return faded ? faded : widen_edge(s, e, made);
    }
    case KARST_OP_MIX:
        return share_sides(s->graph, made);
    default:
        return made;
    }
}

void karst_soften(karst_graph *graph, int voxel_log2_m, karst_expr *roots, size_t num_roots)
{
    uint32_t count = graph->num_nodes;
    softener s = {.graph = graph, .count = count};
    uint8_t *reached = karst_arena_alloc(graph->arena, count);
    s.soft = karst_arena_alloc(graph->arena, count * sizeof *s.soft);
    s.steepness = karst_arena_alloc(graph->arena, count * sizeof *s.steepness);
    s.footprint = karst_graph_footprint(graph, voxel_log2_m);
    for (size_t i = 0; i < num_roots; i++)
        reached[roots[i]] = 1;
    for (karst_expr e = count - 1; e > 0; e--)
        for (int k = 0; reached[e] && k < 4; k++)
            reached[graph->nodes[e].arg[k]] = 1;
    for (karst_expr e = 1; e < count; e++) {
        if (!reached[e])
            continue;
        graph->where = graph->nodes[e].where;
        s.steepness[e] = find_steepness(&s, e);
        s.soft[e] = soften_node(&s, e);
    }
    for (size_t i = 0; i < num_roots; i++)
        roots[i] = s.soft[roots[i]];
}
