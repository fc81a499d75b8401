/* Places less their own whole numbers, as people write repetition, mod, fract and round by hand. */
#include "producers/language/graph/resolver.h"

/* place_sign * place + step_sign * by * step, where `step` is a whole number of one place, or chooses between two. */
typedef struct {
    karst_expr place, by, step; /* by: KARST_NO_EXPR for 1 */
    int place_sign, step_sign;
} split;

static bool is_one_step(const resolver *r, karst_expr e) { return r->wholes[e] && r->wholes[e]->num_terms == 1; }

static bool is_step(const resolver *r, karst_expr e)
{
    const karst_expr_node *n = &r->from->nodes[e];
    return is_one_step(r, e) || (n->op == KARST_OP_SELECT && n->type == KARST_TYPE_FLOAT && is_one_step(r, n->arg[1]) &&
                                 is_one_step(r, n->arg[2]));
}

static bool find_product(const resolver *r, karst_expr a, karst_expr b, split *s)
{
    for (int k = 0; k < 2; k++) {
        s->by = k ? b : a;
        s->step = k ? a : b;
        if (r->class[s->by] == FORM_UNIFORM && is_step(r, s->step))
            return true;
    }
    return false;
}

static bool find_step(const resolver *r, karst_expr e, split *s)
{
    const karst_expr_node *n = &r->from->nodes[e];
    s->by = KARST_NO_EXPR;
    s->step = e;
    return is_step(r, e) || (n->op == KARST_OP_MULTIPLY && find_product(r, n->arg[0], n->arg[1], s));
}

static bool find_split(const resolver *r, karst_expr e, split *s)
{
    const karst_expr_node *n = &r->from->nodes[e];
    s->place_sign = s->step_sign = 1;
    if (n->op == KARST_OP_FMA) {
        s->place = n->arg[2];
        return has_form(r, s->place) && find_product(r, n->arg[0], n->arg[1], s);
    }
    if (n->op != KARST_OP_ADD && n->op != KARST_OP_SUBTRACT)
        return false;
    const int second = n->op == KARST_OP_ADD ? 1 : -1;
    for (int k = 0; k < 2; k++) {
        s->place = n->arg[k];
        s->place_sign = k ? second : 1;
        s->step_sign = k ? 1 : second;
        if (has_form(r, s->place) && find_step(r, n->arg[1 - k], s))
            return true;
    }
    return false;
}

static void want_step(resolver *r, karst_expr step) { r->wants[r->wholes[step]->atom[0]] |= WANT_PART; }

void karst_want_whole_away(resolver *r, karst_expr e)
{
    split s;
    if (!find_split(r, e, &s))
        return;
    r->wants[s.place] |= WANT_FORM;
    if (is_one_step(r, s.step)) {
        want_step(r, s.step);
    } else {
        want_step(r, r->from->nodes[s.step].arg[1]);
        want_step(r, r->from->nodes[s.step].arg[2]);
    }
}

static karst_expr number(resolver *r, karst_number n) { return karst_graph_number(r->to, KARST_TYPE_FLOAT, n); }

static bool is_same(const resolver *r, karst_expr a, karst_expr b)
{
    const karst_number *x = karst_graph_constant(r->to, a), *y = karst_graph_constant(r->to, b);
    return a == b || (x && y && karst_number_compare(*x, *y) == 0);
}

/* Whether a part of the place is `by` times that of what is rounded down. */
static bool is_times(resolver *r, karst_expr place, karst_expr by, karst_expr rounded)
{
    if (!place || !rounded)
        return place == rounded;
    const karst_number *n = karst_graph_constant(r->to, by);
    bool same = is_same(r, place, karst_expr_2(r->to, KARST_OP_MULTIPLY, by, rounded)) ||
                is_same(r, karst_expr_2(r->to, KARST_OP_DIVIDE, place, by), rounded);
    if (!same && n && n->value != 0)
        same = is_same(
            r, karst_expr_2(r->to, KARST_OP_MULTIPLY, place, number(r, karst_number_divide(karst_number_int(1), *n))),
            rounded);
    return same;
}

/* Is 0, or nothing at all. */
static bool is_none(const resolver *r, karst_expr e)
{
    const karst_number *n = karst_graph_constant(r->to, e);
    return !e || (n && karst_number_is(*n, 0));
}

/* f = sign * place, less `by` times what `w` rounds down: f - by floor(g) = by fract(g) + (f - by g), if f and by g
 * differ by no more than a number. */
static karst_expr take_away(resolver *r, const split *s, const karst_whole *w)
{
    form f = karst_form_of(r, s->place), g = r->forms[w->atom[0]];
    if (r->from->nodes[w->atom[0]].op == KARST_OP_CONVERT)
        return KARST_NO_EXPR; /* rounds towards 0 */
    if (s->place_sign < 0)
        f = karst_form_sum(r, KARST_OP_SUBTRACT, (form){0}, f);
    karst_number scale = karst_number_ratio(w->factor[0], w->divisor),
                 constant = karst_number_ratio(w->constant, w->divisor);
    karst_expr plus = number(r, scale), rest = number(r, constant); /* plus * floor(g) + rest */
    if (s->by) {
        plus =
            karst_number_is(scale, 1) ? r->value[s->by] : karst_expr_2(r->to, KARST_OP_MULTIPLY, r->value[s->by], plus);
        rest = karst_expr_2(r->to, KARST_OP_MULTIPLY, r->value[s->by], rest);
    }
    if (s->step_sign < 0)
        rest = karst_expr_1(r->to, KARST_OP_NEGATE, rest);
    karst_expr by = s->step_sign < 0 ? plus : karst_expr_1(r->to, KARST_OP_NEGATE, plus);
    const karst_number *known = karst_graph_constant(r->to, by);
    if (known && (known->value == 0 || known->value - known->value != 0))
        return KARST_NO_EXPR;
    for (int i = 0; i < 3; i++) {
        bool none = is_none(r, f.coefficient[i]) && is_none(r, g.coefficient[i]);
        if (!none && !is_times(r, f.coefficient[i], by, g.coefficient[i]))
            return KARST_NO_EXPR;
    }
    if (!is_times(r, f.shift, by, g.shift))
        return KARST_NO_EXPR;
    karst_expr place = karst_place_of(r, g);
    if (r->to->nodes[place].op != KARST_OP_AFFINE && r->to->nodes[place].op != KARST_OP_SHIFTED)
        return KARST_NO_EXPR;
    karst_expr value = karst_expr_2(r->to, KARST_OP_MULTIPLY, karst_apply_to_place(r, KARST_OP_FRACT, place, 0), by);
    if (g.offset)
        rest = karst_expr_2(r->to, KARST_OP_SUBTRACT, rest, karst_expr_2(r->to, KARST_OP_MULTIPLY, by, g.offset));
    return karst_form_part_sum(r, KARST_OP_ADD, value, karst_form_part_sum(r, KARST_OP_ADD, rest, f.offset));
}

karst_expr karst_build_whole_away(resolver *r, karst_expr e)
{
    split s;
    if (!find_split(r, e, &s))
        return KARST_NO_EXPR;
    if (is_one_step(r, s.step))
        return take_away(r, &s, r->wholes[s.step]);
    const karst_expr_node *choice = &r->from->nodes[s.step];
    karst_expr a = take_away(r, &s, r->wholes[choice->arg[1]]), b = take_away(r, &s, r->wholes[choice->arg[2]]);
    return a && b ? karst_expr_3(r->to, KARST_OP_SELECT, r->value[choice->arg[0]], a, b) : KARST_NO_EXPR;
}
