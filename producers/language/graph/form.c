/* Forms: what is affine in the position, plus a float, in nodes of the resolved graph. */
#include "producers/language/graph/resolver.h"

karst_expr karst_form_part_sum(resolver *r, karst_op op, karst_expr a, karst_expr b)
{
    if (!b)
        return a;
    if (!a)
        return op == KARST_OP_SUBTRACT ? karst_expr_1(r->to, KARST_OP_NEGATE, b) : b;
    return karst_expr_2(r->to, op, a, b);
}

form karst_form_sum(resolver *r, karst_op op, form a, form b)
{
    form s;
    for (int i = 0; i < 3; i++)
        s.coefficient[i] = karst_form_part_sum(r, op, a.coefficient[i], b.coefficient[i]);
    s.offset = karst_form_part_sum(r, op, a.offset, b.offset);
    s.shift = karst_form_part_sum(r, op, a.shift, b.shift);
    return s;
}

static karst_expr scaled(resolver *r, karst_op op, karst_expr a, karst_expr by)
{
    return a ? karst_expr_2(r->to, op, a, by) : a;
}

/* op: MULTIPLY or DIVIDE */
form karst_form_scaled(resolver *r, karst_op op, form a, karst_expr by)
{
    form s;
    for (int i = 0; i < 3; i++)
        s.coefficient[i] = scaled(r, op, a.coefficient[i], by);
    s.offset = scaled(r, op, a.offset, by);
    s.shift = scaled(r, op, a.shift, by);
    return s;
}

/* The form of an argument, whatever it is. */
form karst_form_of(resolver *r, karst_expr e)
{
    if (has_form(r, e))
        return r->forms[e];
    if (r->class[e] == FORM_UNIFORM)
        return (form){.offset = r->value[e]};
    return (form){.shift = r->value[e]};
}

static bool is_zero(const karst_graph *graph, karst_expr e)
{
    const karst_number *n = karst_graph_constant(graph, e);
    return n && karst_number_is(*n, 0);
}

/* The form without its shift, as a leaf; or as a uniform value, if the position has cancelled. */
karst_expr karst_affine_leaf(resolver *r, form f)
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
karst_expr karst_place_of(resolver *r, form f)
{
    karst_expr leaf = karst_affine_leaf(r, f);
    if (!f.shift || is_zero(r->to, f.shift))
        return leaf;
    if (r->to->nodes[leaf].op != KARST_OP_AFFINE)
        return karst_expr_2(r->to, KARST_OP_ADD, leaf, f.shift);
    return karst_graph_raw(r->to, KARST_OP_SHIFTED, KARST_TYPE_FLOAT, 0, leaf, f.shift, 0, 0);
}

karst_expr karst_apply_to_place(resolver *r, karst_op op, karst_expr place, karst_expr b)
{
    if (karst_graph_is_uniform(r->to, place)) /* folds */
        return b ? karst_expr_2(r->to, op, place, b) : karst_expr_1(r->to, op, place);
    return karst_graph_raw(r->to, op, KARST_TYPE_FLOAT, 0, place, b, 0, 0);
}
