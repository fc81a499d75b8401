#include "producers/language/graph/kinds.h"
#include "producers/language/graph/whole.h"
#include "producers/language/graph/soften.h"

#include <math.h>
#include <stdlib.h>

/* What a node of the canonical graph is, before anything is built. */
typedef enum { FORM_UNIFORM, FORM_AFFINE, FORM_SHIFTED, FORM_FLOAT } form_class;

/* What its users want of it. */
enum { WANT_VALUE = 1, WANT_FORM = 2, WANT_PART = 4 /* what an atom of whole numbers rounds down */ };

/* offset + sum of coefficient[i] * p[i] + shift, in nodes of the resolved graph; KARST_NO_EXPR where there is none. */
typedef struct {
    karst_expr coefficient[3], offset, shift;
} form;

typedef struct {
    const karst_graph *from;
    karst_graph *to;
    uint8_t *class, *wants, *formed; /* formed: has_form */
    karst_expr *value;               /* of each node of `from` that is wanted */
    form *forms;                     /* of each that is wanted so; of atoms what they round down */
    const karst_whole **wholes;
} resolver;

static bool has_form(const resolver *r, karst_expr e)
{
    return r->class[e] == FORM_AFFINE || r->class[e] == FORM_SHIFTED;
}

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

static void want_parts(resolver *r, const karst_whole *w)
{
    for (uint32_t i = 0; i < w->num_terms; i++)
        r->wants[w->atom[i]] |= WANT_PART;
}

/* What a node asks of whole numbers: how it is answered by `build_of_wholes`. */
typedef enum { ASKS_NOTHING, ASKS_REST, ASKS_INT, ASKS_FLOAT, ASKS_ORDER, ASKS_QUOTIENT } question;

/* What a factor is by a modulus, the nearest to 0. */
static int64_t small_factor(int64_t factor, int64_t modulus)
{
    int64_t rest = factor % modulus;
    return 2 * rest > modulus ? rest - modulus : 2 * rest < -modulus ? rest + modulus : rest;
}

/* The modulus of a MOD, FRACT or INT_MODULO of a whole number, times its divisor. */
static int64_t modulus_of(const resolver *r, const karst_expr_node *n, int64_t *divisor)
{
    const karst_whole *w = r->wholes[n->arg[0]];
    const karst_number *b = n->op == KARST_OP_FRACT ? NULL : karst_graph_constant(r->from, n->arg[1]);
    const karst_number one = karst_number_int(1);
    if (n->op == KARST_OP_FRACT)
        b = &one;
    if (!w || !b || b->denominator <= 0 || b->numerator <= 0 || b->numerator >= INT32_MAX ||
        b->denominator >= INT32_MAX)
        return 0;
    *divisor = w->divisor * b->denominator;
    int64_t modulus = b->numerator * w->divisor, most = 2 * modulus; /* below 2^62 */
    for (uint32_t i = 0; i < w->num_terms && modulus < (1 << 24); i++)
        most += modulus * llabs(small_factor(w->factor[i], modulus));
    return modulus < (1 << 24) && *divisor < (1 << 24) && most < INT32_MAX ? modulus : 0;
}

static question asked_by(const resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    const karst_whole *a = r->wholes[n->arg[0]];
    int64_t divisor;
    karst_whole difference;
    const karst_number *by = karst_graph_constant(r->from, n->arg[1]);
    switch (n->op) {
    case KARST_OP_MOD:
    case KARST_OP_FRACT:
    case KARST_OP_INT_MODULO:
        return (n->type != KARST_TYPE_UINT) && a && modulus_of(r, n, &divisor) ? ASKS_REST : ASKS_NOTHING;
    case KARST_OP_CONVERT:
        if (n->type == KARST_TYPE_FLOAT)
            return a && r->wholes[e] ? ASKS_FLOAT : ASKS_NOTHING;
        if (n->type == KARST_TYPE_BOOL || r->from->nodes[n->arg[0]].type != KARST_TYPE_FLOAT)
            return ASKS_NOTHING;
        return has_form(r, n->arg[0]) || (a && a->divisor == 1) ? ASKS_INT : ASKS_NOTHING;
    case KARST_OP_SHIFT_RIGHT:
        return r->wholes[e] ? ASKS_INT : ASKS_NOTHING;
    case KARST_OP_INT_DIVIDE:
        return n->type == KARST_TYPE_INT && a && a->num_terms == 1 && a->factor[0] == 1 && by && by->numerator > 0 &&
                       by->numerator < (1 << 24) && a->divisor == 1 &&
                       (a->constant == 0 || r->from->nodes[a->atom[0]].op != KARST_OP_CONVERT)
                   ? ASKS_QUOTIENT
                   : ASKS_NOTHING;
    default:
        return n->op >= KARST_OP_LESS && n->op <= KARST_OP_NOT_EQUAL &&
                       r->from->nodes[n->arg[0]].type == KARST_TYPE_INT &&
                       karst_whole_difference(r->from, r->wholes, n->arg[0], n->arg[1], &difference)
                   ? ASKS_ORDER
                   : ASKS_NOTHING;
    }
}

/* False: the node is none of these. */
static bool want_wholes(resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    karst_whole difference;
    switch (asked_by(r, e)) {
    case ASKS_NOTHING:
        return false;
    case ASKS_INT:
        if (r->wholes[e])
            want_parts(r, r->wholes[e]);
        else if (r->wholes[n->arg[0]]) /* uint(floor(a)) */
            want_parts(r, r->wholes[n->arg[0]]);
        else /* uint(a) */
            r->wants[n->arg[0]] |= WANT_FORM;
        return true;
    case ASKS_ORDER:
        karst_whole_difference(r->from, r->wholes, n->arg[0], n->arg[1], &difference);
        want_parts(r, &difference);
        return true;
    default:
        want_parts(r, r->wholes[n->arg[0]]);
        return true;
    }
}

static void want_arguments(resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    if (r->wants[e] & WANT_PART) {
        karst_expr of = karst_whole_part_of(r->from, r->wholes, r->formed, e).of;
        r->wants[of] |= karst_whole_is_atom(r->wholes, of) ? WANT_PART : WANT_FORM;
    }
    if ((r->wants[e] & WANT_VALUE) && want_wholes(r, e))
        return;
    bool differs = compares_forms(r, n);
    if (r->class[e] == FORM_AFFINE)
        r->wants[e] |= WANT_FORM; /* its float comes from the form, too */
    if (r->wants[e] & WANT_FORM)
        for (int k = 0; k < 4; k++)
            r->wants[n->arg[k]] |= has_form(r, n->arg[k]) ? WANT_FORM : WANT_VALUE;
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

static karst_expr sum(resolver *r, karst_op op, karst_expr a, karst_expr b)
{
    if (!b)
        return a;
    if (!a)
        return op == KARST_OP_SUBTRACT ? karst_expr_1(r->to, KARST_OP_NEGATE, b) : b;
    return karst_expr_2(r->to, op, a, b);
}

static form form_sum(resolver *r, karst_op op, form a, form b)
{
    form s;
    for (int i = 0; i < 3; i++)
        s.coefficient[i] = sum(r, op, a.coefficient[i], b.coefficient[i]);
    s.offset = sum(r, op, a.offset, b.offset);
    s.shift = sum(r, op, a.shift, b.shift);
    return s;
}

static karst_expr scaled(resolver *r, karst_op op, karst_expr a, karst_expr by)
{
    return a ? karst_expr_2(r->to, op, a, by) : a;
}

/* op: MULTIPLY or DIVIDE */
static form form_scaled(resolver *r, karst_op op, form a, karst_expr by)
{
    form s;
    for (int i = 0; i < 3; i++)
        s.coefficient[i] = scaled(r, op, a.coefficient[i], by);
    s.offset = scaled(r, op, a.offset, by);
    s.shift = scaled(r, op, a.shift, by);
    return s;
}

/* The form of an argument, whatever it is. */
static form form_of(resolver *r, karst_expr e)
{
    if (has_form(r, e))
        return r->forms[e];
    if (r->class[e] == FORM_UNIFORM)
        return (form){.offset = r->value[e]};
    return (form){.shift = r->value[e]};
}

static form form_product(resolver *r, karst_expr a, karst_expr b)
{
    bool first = class_of_factor(r, a, false) == FORM_UNIFORM;
    if (!first && class_of_factor(r, b, false) != FORM_UNIFORM)
        return (form){.shift = karst_expr_2(r->to, KARST_OP_MULTIPLY, r->value[a], r->value[b])};
    return form_scaled(r, KARST_OP_MULTIPLY, form_of(r, first ? b : a), r->value[first ? a : b]);
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
        return form_sum(r, n->op, form_of(r, n->arg[0]), form_of(r, n->arg[1]));
    case KARST_OP_MULTIPLY:
        return form_product(r, n->arg[0], n->arg[1]);
    case KARST_OP_DIVIDE:
        return form_scaled(r, KARST_OP_DIVIDE, form_of(r, n->arg[0]), r->value[n->arg[1]]);
    case KARST_OP_FMA:
        return form_sum(r, KARST_OP_ADD, form_product(r, n->arg[0], n->arg[1]), form_of(r, n->arg[2]));
    default: /* NEGATE */
        return form_sum(r, KARST_OP_SUBTRACT, f, form_of(r, n->arg[0]));
    }
}

static bool is_zero(const karst_graph *graph, karst_expr e)
{
    const karst_number *n = karst_graph_constant(graph, e);
    return n && karst_number_is(*n, 0);
}

/* The form without its shift, as a leaf; or as a uniform value, if the position has cancelled. */
static karst_expr affine_leaf(resolver *r, form f)
{
    karst_affine a = {.offset = is_zero(r->to, f.offset) ? KARST_NO_EXPR : f.offset};
    bool any = false;
    for (int i = 0; i < 3; i++) {
        a.coefficient[i] = is_zero(r->to, f.coefficient[i]) ? KARST_NO_EXPR : f.coefficient[i];
        any |= a.coefficient[i] != KARST_NO_EXPR;
    }
    if (!any)
        return a.offset ? a.offset : karst_graph_float(r->to, 0);
    return karst_graph_affine(r->to, a);
}

/* What a node that works on exact places is given. */
static karst_expr place_of(resolver *r, form f)
{
    karst_expr leaf = affine_leaf(r, f);
    if (!f.shift || is_zero(r->to, f.shift))
        return leaf;
    if (r->to->nodes[leaf].op != KARST_OP_AFFINE)
        return karst_expr_2(r->to, KARST_OP_ADD, leaf, f.shift);
    return karst_graph_raw(r->to, KARST_OP_SHIFTED, KARST_TYPE_FLOAT, 0, leaf, f.shift, 0, 0);
}

static karst_expr apply_to_place(resolver *r, karst_op op, karst_expr place, karst_expr b)
{
    if (karst_graph_is_uniform(r->to, place)) /* folds */
        return b ? karst_expr_2(r->to, op, place, b) : karst_expr_1(r->to, op, place);
    return karst_graph_raw(r->to, op, KARST_TYPE_FLOAT, 0, place, b, 0, 0);
}

/* sin and cos of 2 pi times the place. */
static karst_expr turn(resolver *r, karst_op op, form f)
{
    karst_expr turns = karst_graph_number(r->to, KARST_TYPE_FLOAT, karst_number_double(0.15915494309189533577));
    karst_expr place = place_of(r, form_scaled(r, KARST_OP_MULTIPLY, f, turns));
    karst_op code = r->to->nodes[place].op;
    if (code == KARST_OP_AFFINE || code == KARST_OP_SHIFTED)
        return karst_graph_raw(r->to, op == KARST_OP_SIN ? KARST_OP_SIN_TURNS : KARST_OP_COS_TURNS, KARST_TYPE_FLOAT, 0,
                               place, 0, 0, 0);
    return karst_expr_1(r->to, op, place_of(r, f)); /* the position has cancelled */
}

static karst_expr on_place(resolver *r, const karst_expr_node *n)
{
    form f = form_of(r, n->arg[0]);
    switch (n->op) {
    case KARST_OP_SIN:
    case KARST_OP_COS:
        return turn(r, n->op, f);
    case KARST_OP_CEIL: /* -floor(-a) */
        return karst_expr_1(
            r->to, KARST_OP_NEGATE,
            apply_to_place(r, KARST_OP_FLOOR, place_of(r, form_sum(r, KARST_OP_SUBTRACT, (form){0}, f)), 0));
    case KARST_OP_RINT: /* floor(a + 1/2): an exact tie goes up */
        f.offset = sum(r, KARST_OP_ADD, f.offset, karst_graph_float(r->to, 0.5));
        return apply_to_place(r, KARST_OP_FLOOR, place_of(r, f), 0);
    case KARST_OP_MOD:
        return apply_to_place(r, KARST_OP_MOD, place_of(r, f), r->value[n->arg[1]]);
    default:
        return apply_to_place(r, n->op, place_of(r, f), 0);
    }
}

static karst_expr build_noise(resolver *r, const karst_expr_node *n)
{
    karst_noise noise = r->from->noises[n->extra];
    noise.gain = r->value[noise.gain];
    noise.lacunarity = r->value[noise.lacunarity];
    karst_expr a[3];
    for (int k = 0; k < 3; k++)
        a[k] = uses_place(r, n, k) ? place_of(r, r->forms[n->arg[k]]) : r->value[n->arg[k]];
    return karst_graph_noise(r->to, noise, a[0], a[1], a[2]);
}

/* ---- whole numbers ---- */

/* What an atom rounds down. */
static form build_part(resolver *r, karst_expr e)
{
    karst_whole_part part = karst_whole_part_of(r->from, r->wholes, r->formed, e);
    form f = karst_whole_is_atom(r->wholes, part.of) ? r->forms[part.of] : form_of(r, part.of);
    if (part.constant)
        f.offset = sum(r, KARST_OP_ADD, f.offset, karst_graph_float(r->to, (double)part.constant));
    if (part.divisor > 1)
        f = form_scaled(r, KARST_OP_DIVIDE, f, karst_graph_float(r->to, (double)part.divisor));
    if (r->from->nodes[e].op == KARST_OP_RINT)
        f.offset = sum(r, KARST_OP_ADD, f.offset, karst_graph_float(r->to, 0.5));
    return r->from->nodes[e].op == KARST_OP_CEIL ? form_sum(r, KARST_OP_SUBTRACT, (form){0}, f) : f;
}

static bool rounds_to_zero(const resolver *r, karst_expr atom) { return r->from->nodes[atom].op == KARST_OP_CONVERT; }

static karst_expr whole_int(resolver *r, int64_t value) { return karst_graph_int(r->to, (int32_t)value); }

/* The cell of a form by a modulus, or (0) its low 32 bits. */
static karst_expr cell_of(resolver *r, form f, bool towards_zero, int64_t modulus)
{
    karst_expr place = place_of(r, f);
    uint8_t op = r->to->nodes[place].op;
    if (op == KARST_OP_AFFINE || op == KARST_OP_SHIFTED)
        return karst_graph_raw(r->to, KARST_OP_CELL, KARST_TYPE_INT, towards_zero, place,
                               modulus ? whole_int(r, modulus) : 0, 0, 0);
    /* the position has cancelled */
    if (!towards_zero)
        place = karst_expr_1(r->to, KARST_OP_FLOOR, place);
    karst_expr whole = karst_expr_convert(r->to, KARST_TYPE_INT, place), by = whole_int(r, modulus);
    if (!modulus)
        return whole;
    whole = karst_expr_2(r->to, KARST_OP_INT_MODULO, whole, by);
    return karst_expr_2(r->to, KARST_OP_INT_MODULO, karst_expr_2(r->to, KARST_OP_INT_ADD, whole, by), by);
}

static karst_expr add_times(resolver *r, karst_expr to, karst_expr a, int64_t factor)
{
    if (factor != 1)
        a = karst_expr_2(r->to, KARST_OP_INT_MULTIPLY, a, whole_int(r, factor));
    return to ? karst_expr_2(r->to, KARST_OP_INT_ADD, to, a) : a;
}

/* Its low 32 bits. */
static karst_expr whole_low(resolver *r, const karst_whole *w)
{
    karst_expr low = KARST_NO_EXPR;
    for (uint32_t i = 0; i < w->num_terms; i++)
        low = add_times(r, low, cell_of(r, r->forms[w->atom[i]], rounds_to_zero(r, w->atom[i]), 0), w->factor[i]);
    return w->constant ? karst_expr_2(r->to, KARST_OP_INT_ADD, low, whole_int(r, w->constant)) : low;
}

/* The rest of what is before the division, from 0 on. */
static karst_expr whole_rest(resolver *r, const karst_whole *w, int64_t modulus)
{
    karst_expr rest = KARST_NO_EXPR;
    int64_t constant = w->constant % modulus;
    bool is_rest = w->num_terms == 1;
    for (uint32_t i = 0; i < w->num_terms; i++) {
        int64_t factor = small_factor(w->factor[i], modulus);
        if (factor)
            rest = add_times(r, rest, cell_of(r, r->forms[w->atom[i]], rounds_to_zero(r, w->atom[i]), modulus), factor);
        constant += factor < 0 ? -factor * modulus : 0; /* nothing below 0 */
        is_rest &= factor == 1;
    }
    constant += constant < 0 ? modulus : 0;
    if (!rest || (is_rest && constant == 0))
        return rest ? rest : whole_int(r, constant % modulus);
    if (constant)
        rest = karst_expr_2(r->to, KARST_OP_INT_ADD, rest, whole_int(r, constant));
    return karst_expr_2(r->to, KARST_OP_INT_MODULO, rest, whole_int(r, modulus));
}

/* What an atom gives, as a float. */
static karst_expr atom_float(resolver *r, karst_expr atom)
{
    form f = r->forms[atom];
    karst_expr down = apply_to_place(r, KARST_OP_FLOOR, place_of(r, f), 0);
    if (!rounds_to_zero(r, atom))
        return down;
    form back = form_sum(r, KARST_OP_SUBTRACT, (form){0}, f);
    karst_expr up = karst_expr_1(r->to, KARST_OP_NEGATE, apply_to_place(r, KARST_OP_FLOOR, place_of(r, back), 0));
    karst_expr below = karst_expr_2(r->to, KARST_OP_LESS, place_of(r, f), karst_graph_float(r->to, 0));
    return karst_expr_3(r->to, KARST_OP_SELECT, below, up, down);
}

/* Its terms, and its constant if that is wanted, as a float. */
static karst_expr whole_float(resolver *r, const karst_whole *w, bool with_constant)
{
    karst_expr all = KARST_NO_EXPR;
    for (uint32_t i = 0; i < w->num_terms; i++) {
        karst_expr term = atom_float(r, w->atom[i]);
        if (w->factor[i] != 1)
            term = karst_expr_2(r->to, KARST_OP_MULTIPLY, term, karst_graph_float(r->to, (double)w->factor[i]));
        all = sum(r, KARST_OP_ADD, all, term);
    }
    if (with_constant && w->constant)
        all = sum(r, KARST_OP_ADD, all, karst_graph_float(r->to, (double)w->constant));
    return all;
}

/* Of an int, whose rest has its own sign. */
static karst_expr signed_rest(resolver *r, const karst_whole *w, karst_expr rest, int64_t modulus)
{
    const karst_expr zero = whole_int(r, 0),
                     below = karst_expr_2(r->to, KARST_OP_LESS, whole_float(r, w, true), karst_graph_float(r->to, 0));
    karst_expr some = karst_expr_2(r->to, KARST_OP_NOT_EQUAL, rest, zero);
    karst_expr other = karst_expr_2(r->to, KARST_OP_INT_SUBTRACT, rest, whole_int(r, modulus));
    return karst_expr_3(r->to, KARST_OP_SELECT, karst_expr_2(r->to, KARST_OP_AND, below, some), other, rest);
}

/* a / b for ints, b above 0: towards 0. */
static karst_expr whole_quotient(resolver *r, const karst_whole *w, int64_t by)
{
    const karst_expr divisor = karst_graph_float(r->to, (double)by);
    bool towards_zero = rounds_to_zero(r, w->atom[0]);
    form f = r->forms[w->atom[0]], down = f, up = f;
    down.offset = sum(r, KARST_OP_ADD, f.offset, karst_graph_float(r->to, (double)w->constant));
    up.offset = sum(r, KARST_OP_ADD, f.offset, karst_graph_float(r->to, (double)(w->constant + by - 1)));
    karst_expr low = cell_of(r, form_scaled(r, KARST_OP_DIVIDE, down, divisor), towards_zero, 0);
    if (towards_zero)
        return low;
    karst_expr high = cell_of(r, form_scaled(r, KARST_OP_DIVIDE, up, divisor), false, 0);
    karst_expr below =
        karst_expr_2(r->to, KARST_OP_LESS, atom_float(r, w->atom[0]), karst_graph_float(r->to, (double)-w->constant));
    return karst_expr_3(r->to, KARST_OP_SELECT, below, high, low);
}

static karst_expr build_order(resolver *r, const karst_expr_node *n)
{
    karst_whole difference = {0};
    karst_whole_difference(r->from, r->wholes, n->arg[0], n->arg[1], &difference);
    bool is_far = llabs(difference.constant) > 1 << 24;
    return karst_expr_2(r->to, n->op, whole_float(r, &difference, is_far),
                        karst_graph_float(r->to, is_far ? 0 : (double)-difference.constant));
}

static karst_expr build_of_wholes(resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    const karst_whole *a = r->wholes[n->arg[0]];
    switch (asked_by(r, e)) {
    case ASKS_REST: {
        int64_t divisor, modulus = modulus_of(r, n, &divisor);
        karst_expr rest = whole_rest(r, a, modulus);
        if (n->type == KARST_TYPE_INT)
            return signed_rest(r, a, rest, modulus);
        rest = karst_expr_convert(r->to, KARST_TYPE_FLOAT, rest);
        return karst_expr_2(r->to, KARST_OP_DIVIDE, rest, karst_graph_float(r->to, (double)divisor));
    }
    case ASKS_INT: {
        const karst_whole *w = r->wholes[e] ? r->wholes[e] : a;
        karst_expr low = w ? whole_low(r, w) : cell_of(r, form_of(r, n->arg[0]), true, 0);
        return karst_expr_convert(r->to, n->type, low);
    }
    case ASKS_FLOAT:
        return whole_float(r, r->wholes[e], true);
    case ASKS_QUOTIENT:
        return whole_quotient(r, a, karst_graph_constant(r->from, n->arg[1])->numerator);
    case ASKS_ORDER:
        return build_order(r, n);
    default:
        return KARST_NO_EXPR;
    }
}

static karst_expr build_value(resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    if (n->op == KARST_OP_CONSTANT)
        return karst_graph_number(r->to, n->type, r->from->constants[n->extra]);
    if (r->class[e] == FORM_AFFINE)
        return affine_leaf(r, r->forms[e]);
    if (n->op == KARST_OP_NOISE)
        return build_noise(r, n);
    karst_expr of_wholes = build_of_wholes(r, e);
    if (of_wholes)
        return of_wholes;
    if (compares_forms(r, n)) {
        karst_expr difference =
            affine_leaf(r, form_sum(r, KARST_OP_SUBTRACT, form_of(r, n->arg[0]), form_of(r, n->arg[1])));
        return karst_expr_2(r->to, n->op, difference, karst_graph_float(r->to, 0));
    }
    if (uses_place(r, n, 0))
        return on_place(r, n);
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
            r.forms[e] = build_part(&r, e);
        if ((r.wants[e] & WANT_FORM) && has_form(&r, e))
            r.forms[e] = build_form(&r, e);
        if (r.wants[e] & WANT_VALUE)
            r.value[e] = build_value(&r, e);
    }
    for (size_t i = 0; i < num_roots; i++)
        roots[i] = r.value[roots[i]];
    if (num_roots > 1) /* colours */
        karst_soften(&built, settings->voxel_log2_m, roots + 1, num_roots - 1);
    karst_graph_extract(&built, resolved, roots, num_roots);
    karst_kinds_set(resolved, 1);
    karst_range *ranges = karst_arena_alloc(arena, resolved->num_nodes * sizeof *ranges);
    karst_graph_ranges(resolved, settings, ranges);
    karst_kinds_widen(resolved, settings, ranges);
}
