/* What is asked of whole numbers of places (whole.h), built from the places themselves. */
#include "producers/language/graph/resolver.h"

#include <stdlib.h>

/* ---- what is asked ---- */

static void want_parts(resolver *r, const karst_whole *w)
{
    for (uint32_t i = 0; i < w->num_terms; i++)
        r->wants[w->atom[i]] |= WANT_PART;
}

/* What a node asks of whole numbers: how it is answered by `build_of_wholes`. */
typedef enum { ASKS_NOTHING, ASKS_REST, ASKS_INT, ASKS_FLOAT, ASKS_ORDER, ASKS_QUOTIENT } question;

/* What a factor times a scale is by a modulus, the nearest to 0. */
static int64_t small_factor(int64_t factor, int64_t scale, int64_t modulus)
{
    int64_t rest = factor % modulus * (scale % modulus) % modulus;
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
        most += modulus * llabs(small_factor(w->factor[i], b->denominator, modulus));
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
bool karst_want_wholes(resolver *r, karst_expr e)
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

/* ---- what is built ---- */

/* What an atom rounds down. */
form karst_build_part(resolver *r, karst_expr e)
{
    karst_whole_part part = karst_whole_part_of(r->from, r->wholes, r->formed, e);
    form f = karst_whole_is_atom(r->wholes, part.of) ? r->forms[part.of] : karst_form_of(r, part.of);
    if (part.constant)
        f.offset = karst_form_part_sum(r, KARST_OP_ADD, f.offset, karst_graph_float(r->to, (double)part.constant));
    if (part.divisor > 1)
        f = karst_form_scaled(r, KARST_OP_DIVIDE, f, karst_graph_float(r->to, (double)part.divisor));
    if (r->from->nodes[e].op == KARST_OP_RINT)
        f.offset = karst_form_part_sum(r, KARST_OP_ADD, f.offset, karst_graph_float(r->to, 0.5));
    return r->from->nodes[e].op == KARST_OP_CEIL ? karst_form_sum(r, KARST_OP_SUBTRACT, (form){0}, f) : f;
}

static bool rounds_to_zero(const resolver *r, karst_expr atom) { return r->from->nodes[atom].op == KARST_OP_CONVERT; }

static karst_expr whole_int(resolver *r, int64_t value) { return karst_graph_int(r->to, (int32_t)value); }

/* The cell of a form by a modulus, or (0) its low 32 bits. */
static karst_expr cell_of(resolver *r, form f, bool towards_zero, int64_t modulus)
{
    karst_expr place = karst_place_of(r, f);
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

/* The rest of what is before the division, times a scale, from 0 on. */
static karst_expr whole_rest(resolver *r, const karst_whole *w, int64_t scale, int64_t modulus)
{
    karst_expr rest = KARST_NO_EXPR;
    int64_t constant = w->constant % modulus * (scale % modulus) % modulus;
    constant += constant < 0 ? modulus : 0;
    bool is_rest = w->num_terms == 1;
    for (uint32_t i = 0; i < w->num_terms; i++) {
        int64_t factor = small_factor(w->factor[i], scale, modulus);
        if (factor)
            rest = add_times(r, rest, cell_of(r, r->forms[w->atom[i]], rounds_to_zero(r, w->atom[i]), modulus), factor);
        constant += factor < 0 ? -factor * modulus : 0; /* nothing below 0 */
        is_rest &= factor == 1;
    }
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
    karst_expr down = karst_apply_to_place(r, KARST_OP_FLOOR, karst_place_of(r, f), 0);
    if (!rounds_to_zero(r, atom))
        return down;
    form back = karst_form_sum(r, KARST_OP_SUBTRACT, (form){0}, f);
    karst_expr up =
        karst_expr_1(r->to, KARST_OP_NEGATE, karst_apply_to_place(r, KARST_OP_FLOOR, karst_place_of(r, back), 0));
    karst_expr below = karst_expr_2(r->to, KARST_OP_LESS, karst_place_of(r, f), karst_graph_float(r->to, 0));
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
        all = karst_form_part_sum(r, KARST_OP_ADD, all, term);
    }
    if (with_constant && w->constant)
        all = karst_form_part_sum(r, KARST_OP_ADD, all, karst_graph_float(r->to, (double)w->constant));
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
    down.offset = karst_form_part_sum(r, KARST_OP_ADD, f.offset, karst_graph_float(r->to, (double)w->constant));
    up.offset =
        karst_form_part_sum(r, KARST_OP_ADD, f.offset, karst_graph_float(r->to, (double)(w->constant + by - 1)));
    karst_expr low = cell_of(r, karst_form_scaled(r, KARST_OP_DIVIDE, down, divisor), towards_zero, 0);
    if (towards_zero)
        return low;
    karst_expr high = cell_of(r, karst_form_scaled(r, KARST_OP_DIVIDE, up, divisor), false, 0);
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

karst_expr karst_build_of_wholes(resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    const karst_whole *a = r->wholes[n->arg[0]];
    switch (asked_by(r, e)) {
    case ASKS_REST: {
        int64_t divisor, modulus = modulus_of(r, n, &divisor);
        karst_expr rest = whole_rest(r, a, divisor / a->divisor, modulus);
        if (n->type == KARST_TYPE_INT)
            return signed_rest(r, a, rest, modulus);
        rest = karst_expr_convert(r->to, KARST_TYPE_FLOAT, rest);
        return karst_expr_2(r->to, KARST_OP_DIVIDE, rest, karst_graph_float(r->to, (double)divisor));
    }
    case ASKS_INT: {
        const karst_whole *w = r->wholes[e] ? r->wholes[e] : a;
        karst_expr low = w ? whole_low(r, w) : cell_of(r, karst_form_of(r, n->arg[0]), true, 0);
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
