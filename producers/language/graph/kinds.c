#include "producers/language/graph/resolver.h"
#include "producers/language/graph/soften.h"

#include <math.h>

/* ---- first pass, upwards: what is affine ---- */

static form_class class_of_sum(form_class a, form_class b)
{
    if (a == FORM_UNIFORM && b == FORM_UNIFORM)
        return FORM_UNIFORM;
    bool affine = (a == FORM_UNIFORM || a == FORM_AFFINE) && (b == FORM_UNIFORM || b == FORM_AFFINE);
    bool some = a == FORM_AFFINE || a == FORM_SHIFTED || b == FORM_AFFINE || b == FORM_SHIFTED;
    return affine ? FORM_AFFINE : some ? FORM_SHIFTED : FORM_FLOAT;
}

static form_class class_of_product(form_class a, form_class b)
{
    return a == FORM_UNIFORM ? b : b == FORM_UNIFORM ? a : FORM_FLOAT;
}

/* A uniform factor that keeps a form exact: constants that are not finite, and divisions by zero, are left to floats.
 */
static form_class class_of_factor(const resolver *r, karst_expr e, bool divides)
{
    const karst_number *n = karst_graph_constant(r->from, e);
    if (n && (!isfinite(n->value) || (divides && n->value == 0)))
        return FORM_FLOAT;
    return r->class[e];
}

static form_class classify(const resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    form_class a = class_of_factor(r, n->arg[0], false), b = class_of_factor(r, n->arg[1], n->op == KARST_OP_DIVIDE);
    form_class c = class_of_factor(r, n->arg[2], false);
    if (n->op == KARST_OP_NOISE)
        return FORM_FLOAT; /* even of a constant: the host has no value for it */
    if (karst_graph_is_uniform(r->from, e)) {
        for (int k = 0; k < 4; k++)
            if (r->class[n->arg[k]] != FORM_UNIFORM)
                return FORM_FLOAT;
        return FORM_UNIFORM;
    }
    switch (n->op) {
    case KARST_OP_POSITION:
        return FORM_AFFINE;
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
        return class_of_sum(a, b);
    case KARST_OP_MULTIPLY:
        return class_of_product(a, b);
    case KARST_OP_DIVIDE:
        return b == FORM_UNIFORM ? a : FORM_FLOAT;
    case KARST_OP_FMA:
        return class_of_sum(class_of_product(a, b), c);
    case KARST_OP_NEGATE:
        return a;
    case KARST_OP_MIX: /* a (1 - c) + b c */
        return c == FORM_UNIFORM && class_of_sum(a, b) == FORM_AFFINE ? FORM_AFFINE : FORM_FLOAT;
    default:
        return FORM_FLOAT;
    }
}

/* ---- second pass, downwards: what is wanted ---- */

static bool is_comparison(karst_op op) { return op >= KARST_OP_LESS && op <= KARST_OP_NOT_EQUAL; }

/* A comparison of two affine forms is one of their difference with 0, which is exact. */
static bool compares_forms(const resolver *r, const karst_expr_node *n)
{
    form_class a = r->class[n->arg[0]], b = r->class[n->arg[1]];
    return is_comparison(n->op) && (a == FORM_AFFINE || b == FORM_AFFINE) && (a == FORM_AFFINE || a == FORM_UNIFORM) &&
           (b == FORM_AFFINE || b == FORM_UNIFORM);
}

/* True if the node works on the exact place of argument k. */
static bool uses_place(const resolver *r, const karst_expr_node *n, int k)
{
    if (!has_form(r, n->arg[k]))
        return false;
    switch (n->op) {
    case KARST_OP_NOISE:
        return true;
    case KARST_OP_FLOOR:
    case KARST_OP_CEIL:
    case KARST_OP_RINT:
    case KARST_OP_FRACT:
    case KARST_OP_SIN:
    case KARST_OP_COS:
        return k == 0;
    case KARST_OP_MOD:
        return k == 0 && r->class[n->arg[1]] == FORM_UNIFORM;
    default:
        return false;
    }
}

/* Of fma(a, b, c) with neither a nor b uniform: the product is a float that shifts c. */
static bool is_float_factor(const resolver *r, const karst_expr_node *n, int k)
{
    return n->op == KARST_OP_FMA && k < 2 && class_of_factor(r, n->arg[0], false) != FORM_UNIFORM &&
           class_of_factor(r, n->arg[1], false) != FORM_UNIFORM;
}

static void want_part(resolver *r, karst_expr e)
{
    if (r->wants[e] & WANT_PART) {
        karst_expr of = karst_whole_part_of(r->from, r->wholes, r->formed, e).of;
        r->wants[of] |= karst_whole_is_atom(r->wholes, of) ? WANT_PART : WANT_FORM;
    }
}

static void want_arguments(resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    if ((r->wants[e] & WANT_VALUE) && r->class[e] != FORM_AFFINE)
        karst_want_whole_away(r, e);
    bool of_wholes = (r->wants[e] & WANT_VALUE) && karst_want_wholes(r, e);
    want_part(r, e); /* which the latter may want of the node itself: int(p.x) */
    if (of_wholes)
        return;
    bool differs = compares_forms(r, n);
    if (r->class[e] == FORM_AFFINE)
        r->wants[e] |= WANT_FORM; /* its float comes from the form, too */
    if (r->wants[e] & WANT_FORM)
        for (int k = 0; k < 4; k++)
            r->wants[n->arg[k]] |= has_form(r, n->arg[k]) && !is_float_factor(r, n, k) ? WANT_FORM : WANT_VALUE;
    if (!(r->wants[e] & WANT_VALUE) || r->class[e] == FORM_AFFINE)
        return;
    for (int k = 0; k < 4; k++)
        r->wants[n->arg[k]] |= has_form(r, n->arg[k]) && (differs || uses_place(r, n, k)) ? WANT_FORM : WANT_VALUE;
}

static void want_attributes(resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    if (n->op != KARST_OP_NOISE)
        return;
    r->wants[r->from->noises[n->extra].gain] |= WANT_VALUE;
    r->wants[r->from->noises[n->extra].lacunarity] |= WANT_VALUE;
}

/* ---- third pass, upwards: building ---- */

static form form_product(resolver *r, karst_expr a, karst_expr b)
{
    bool first = class_of_factor(r, a, false) == FORM_UNIFORM;
    if (!first && class_of_factor(r, b, false) != FORM_UNIFORM)
        return (form){.shift = karst_expr_2(r->to, KARST_OP_MULTIPLY, r->value[a], r->value[b])};
    return karst_form_scaled(r, KARST_OP_MULTIPLY, karst_form_of(r, first ? b : a), r->value[first ? a : b]);
}

static form build_form(resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    form f = {0};
    switch (n->op) {
    case KARST_OP_POSITION:
        f.coefficient[n->extra] = karst_graph_float(r->to, 1);
        return f;
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
        return karst_form_sum(r, n->op, karst_form_of(r, n->arg[0]), karst_form_of(r, n->arg[1]));
    case KARST_OP_MULTIPLY:
        return form_product(r, n->arg[0], n->arg[1]);
    case KARST_OP_DIVIDE:
        return karst_form_scaled(r, KARST_OP_DIVIDE, karst_form_of(r, n->arg[0]), r->value[n->arg[1]]);
    case KARST_OP_FMA:
        return karst_form_sum(r, KARST_OP_ADD, form_product(r, n->arg[0], n->arg[1]), karst_form_of(r, n->arg[2]));
    case KARST_OP_MIX: {
        karst_expr by = r->value[n->arg[2]],
                   rest = karst_expr_2(r->to, KARST_OP_SUBTRACT, karst_graph_float(r->to, 1), by);
        return karst_form_sum(r, KARST_OP_ADD,
                              karst_form_scaled(r, KARST_OP_MULTIPLY, karst_form_of(r, n->arg[0]), rest),
                              karst_form_scaled(r, KARST_OP_MULTIPLY, karst_form_of(r, n->arg[1]), by));
    }
    default: /* NEGATE */
        return karst_form_sum(r, KARST_OP_SUBTRACT, f, karst_form_of(r, n->arg[0]));
    }
}

/* sin and cos of 2 pi times the place. */
static karst_expr turn(resolver *r, karst_op op, form f)
{
    karst_expr turns = karst_graph_number(r->to, KARST_TYPE_FLOAT, karst_number_double(0.15915494309189533577));
    karst_expr place = karst_place_of(r, karst_form_scaled(r, KARST_OP_MULTIPLY, f, turns));
    karst_op code = r->to->nodes[place].op;
    if (code == KARST_OP_AFFINE || code == KARST_OP_SHIFTED)
        return karst_graph_raw(r->to, op == KARST_OP_SIN ? KARST_OP_SIN_TURNS : KARST_OP_COS_TURNS, KARST_TYPE_FLOAT, 0,
                               place, 0, 0, 0);
    return karst_expr_1(r->to, op, karst_place_of(r, f)); /* the position has cancelled */
}

static karst_expr on_place(resolver *r, const karst_expr_node *n)
{
    form f = karst_form_of(r, n->arg[0]);
    switch (n->op) {
    case KARST_OP_SIN:
    case KARST_OP_COS:
        return turn(r, n->op, f);
    case KARST_OP_CEIL: /* -floor(-a) */
        return karst_expr_1(r->to, KARST_OP_NEGATE,
                            karst_apply_to_place(r, KARST_OP_FLOOR,
                                                 karst_place_of(r, karst_form_sum(r, KARST_OP_SUBTRACT, (form){0}, f)),
                                                 0));
    case KARST_OP_RINT: /* floor(a + 1/2): an exact tie goes up */
        f.offset = karst_form_part_sum(r, KARST_OP_ADD, f.offset, karst_graph_float(r->to, 0.5));
        return karst_apply_to_place(r, KARST_OP_FLOOR, karst_place_of(r, f), 0);
    case KARST_OP_MOD:
        return karst_apply_to_place(r, KARST_OP_MOD, karst_place_of(r, f), r->value[n->arg[1]]);
    default:
        return karst_apply_to_place(r, n->op, karst_place_of(r, f), 0);
    }
}

static karst_expr build_noise(resolver *r, const karst_expr_node *n)
{
    karst_noise noise = r->from->noises[n->extra];
    noise.gain = r->value[noise.gain];
    noise.lacunarity = r->value[noise.lacunarity];
    karst_expr a[3];
    for (int k = 0; k < 3; k++)
        a[k] = uses_place(r, n, k) ? karst_place_of(r, r->forms[n->arg[k]]) : r->value[n->arg[k]];
    return karst_graph_noise(r->to, noise, a[0], a[1], a[2]);
}

static karst_expr build_value(resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    if (n->op == KARST_OP_CONSTANT)
        return karst_graph_number(r->to, n->type, r->from->constants[n->extra]);
    if (r->class[e] == FORM_AFFINE)
        return karst_affine_leaf(r, r->forms[e]);
    if (n->op == KARST_OP_NOISE)
        return build_noise(r, n);
    karst_expr of_wholes = karst_build_of_wholes(r, e);
    if (of_wholes)
        return of_wholes;
    if (compares_forms(r, n)) {
        karst_expr difference = karst_affine_leaf(
            r, karst_form_sum(r, KARST_OP_SUBTRACT, karst_form_of(r, n->arg[0]), karst_form_of(r, n->arg[1])));
        return karst_expr_2(r->to, n->op, difference, karst_graph_float(r->to, 0));
    }
    if (uses_place(r, n, 0))
        return on_place(r, n);
    karst_expr away = karst_build_whole_away(r, e);
    if (away)
        return away;
    return karst_graph_raw(r->to, n->op, n->type, n->extra, r->value[n->arg[0]], r->value[n->arg[1]],
                           r->value[n->arg[2]], r->value[n->arg[3]]);
}

/* ---- kinds ---- */

/* Uniform nodes are known to the host, but for noise and what comes of it. */
void karst_kinds_set(karst_graph *graph, uint32_t first)
{
    for (uint32_t e = first; e < graph->num_nodes; e++) {
        karst_expr_node *n = &graph->nodes[e];
        bool known = karst_graph_is_uniform(graph, e) && n->op != KARST_OP_NOISE;
        bool steps = n->arg[0] != KARST_NO_EXPR;
        for (int k = 0; k < 4 && n->arg[k]; k++) {
            uint8_t kind = graph->nodes[n->arg[k]].kind;
            known &= kind == KARST_KIND_UNIFORM;
            steps &= kind == KARST_KIND_STEPS || kind == KARST_KIND_UNIFORM;
        }
        steps |=
            n->op == KARST_OP_FLOOR || n->op == KARST_OP_CEIL || n->op == KARST_OP_RINT || n->type != KARST_TYPE_FLOAT;
        n->kind = known                       ? KARST_KIND_UNIFORM
                  : n->op == KARST_OP_AFFINE  ? KARST_KIND_AFFINE
                  : n->op == KARST_OP_SHIFTED ? KARST_KIND_SHIFTED
                  : steps                     ? KARST_KIND_STEPS
                                              : KARST_KIND_FLOAT;
    }
}

void karst_kinds_resolve(const karst_graph *graph, const karst_kinds_settings *settings, karst_graph *resolved,
                         karst_expr *roots, size_t num_roots)
{
    karst_arena *arena = resolved->arena;
    uint32_t count = graph->num_nodes;
    karst_graph built;
    karst_graph_init(&built, arena, 4 * resolved->max_nodes, resolved->full, resolved->user);
    resolver r = {.from = graph, .to = &built};
    r.class = karst_arena_alloc(arena, count);
    r.wants = karst_arena_alloc(arena, count);
    r.formed = karst_arena_alloc(arena, count);
    r.value = karst_arena_alloc(arena, count * sizeof *r.value);
    r.forms = karst_arena_alloc(arena, count * sizeof *r.forms);
    for (uint32_t e = 1; e < count; e++)
        r.class[e] = (uint8_t)classify(&r, e);
    for (uint32_t e = 1; e < count; e++)
        r.formed[e] = has_form(&r, e);
    r.wholes = karst_wholes_find(graph, r.formed, arena);
    for (size_t i = 0; i < num_roots; i++)
        r.wants[roots[i]] |= WANT_VALUE;
    for (uint32_t e = count - 1; e > 0; e--)
        if (r.wants[e]) {
            want_arguments(&r, e);
            want_attributes(&r, e);
        }
    for (uint32_t e = 1; e < count; e++) {
        built.where = graph->nodes[e].where;
        if (r.wants[e] & WANT_PART)
            r.forms[e] = karst_build_part(&r, e);
        if ((r.wants[e] & WANT_FORM) && has_form(&r, e))
            r.forms[e] = build_form(&r, e);
        if (r.wants[e] & WANT_VALUE)
            r.value[e] = build_value(&r, e);
    }
    for (size_t i = 0; i < num_roots; i++)
        roots[i] = r.value[roots[i]];
    size_t num_sharp = settings->num_sharp_roots ? settings->num_sharp_roots : 1;
    if (num_roots > num_sharp)
        karst_soften(&built, settings->voxel_log2_m, roots + num_sharp, num_roots - num_sharp);
    karst_graph_extract(&built, resolved, roots, num_roots);
    karst_kinds_set(resolved, 1);
    karst_range *ranges = karst_arena_alloc(arena, resolved->num_nodes * sizeof *ranges);
    karst_graph_ranges(resolved, settings, ranges);
    karst_kinds_widen(resolved, settings, ranges, roots[0]);
}
