/* Smooth minima and maxima of a tape (interval_smooth.clh), however they are written: a blend of two numbers by how far
 * they are apart, less the bulge that rounds it off; or the smaller of them less that bulge. */
#include "producers/language/tape/tape_internal.h"

#include <math.h>

#define MOST_TERMS 8
#define MOST_DEPTH 8 /* of sums of sums */
#define SAME 1e-9 /* of numbers that are the same but for what doubles round */

/* offset + the sum of factors times nodes, at most `most` of them. */
typedef struct {
    double offset, factor[MOST_TERMS];
    karst_expr node[MOST_TERMS];
    int count, most;
} form;

static const karst_expr_node *node(const karst_tape_builder *b, karst_expr e) { return &b->graph->nodes[e]; }

static bool number_of(const karst_tape_builder *b, karst_expr e, double *value)
{
    const karst_number *n = node(b, e)->type == KARST_TYPE_FLOAT ? karst_graph_constant(b->graph, e) : NULL;
    *value = n ? n->value : 0;
    return n && isfinite(n->value);
}

static bool same(double x, double y) { return fabs(x - y) <= SAME * (fabs(x) + fabs(y)); }

static bool add_term(form *f, karst_expr e, double factor)
{
    int i = 0;
    while (i < f->count && f->node[i] != e)
        i++;
    if (i == f->most)
        return false;
    f->factor[i] = (i < f->count ? f->factor[i] : 0) + factor;
    f->node[i] = e;
    f->count += i == f->count;
    return true;
}

/* Adds factor * e. false: there is too much of it. */
static bool add_form(const karst_tape_builder *b, form *f, karst_expr e, double factor, int depth)
{
    const karst_expr_node *n = node(b, e);
    double value;
    if (depth > MOST_DEPTH)
        return add_term(f, e, factor);
    if (number_of(b, e, &value)) {
        f->offset += factor * value;
        return true;
    }
    switch (n->op) {
    case KARST_OP_NEGATE:
        return add_form(b, f, n->arg[0], -factor, depth + 1);
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
        return add_form(b, f, n->arg[0], factor, depth + 1) &&
               add_form(b, f, n->arg[1], n->op == KARST_OP_ADD ? factor : -factor, depth + 1);
    case KARST_OP_DIVIDE:
        if (number_of(b, n->arg[1], &value) && value != 0)
            return add_form(b, f, n->arg[0], factor / value, depth + 1);
        break;
    case KARST_OP_MULTIPLY:
    case KARST_OP_FMA:
        for (int k = 0; k < 2; k++)
            if (number_of(b, n->arg[k], &value))
                return add_form(b, f, n->arg[1 - k], factor * value, depth + 1) &&
                       (n->op == KARST_OP_MULTIPLY || add_form(b, f, n->arg[2], factor, depth + 1));
        break;
    default:
        break;
    }
    return add_term(f, e, factor);
}

/* Terms that cancelled go. */
static bool finish_form(form *f)
{
    int kept = 0;
    for (int i = 0; i < f->count; i++) {
        f->node[kept] = f->node[i];
        f->factor[kept] = f->factor[i];
        kept += f->factor[i] < 0 || f->factor[i] > 0;
    }
    f->count = kept;
    return true;
}

static bool form_of(const karst_tape_builder *b, karst_expr e, int most, form *f)
{
    *f = (form){.most = most};
    return add_form(b, f, e, 1, 0) && finish_form(f);
}

/* f = offset + times * (first - second): `times`, and 0 where it is not. */
static double times_difference(const karst_tape_builder *b, const form *f, double offset, karst_expr first,
                               karst_expr second)
{
    form d = {.most = MOST_TERMS};
    double times = 0;
    if (!add_form(b, &d, first, 1, 0) || !add_form(b, &d, second, -1, 0) || !finish_form(&d) ||
        d.count != f->count)
        return 0;
    for (int i = 0; i < d.count; i++) {
        int k = 0;
        while (k < f->count && f->node[k] != d.node[i])
            k++;
        double ratio = k < f->count ? f->factor[k] / d.factor[i] : 0;
        if (i > 0 && !same(ratio, times))
            return 0;
        times = ratio;
    }
    return fabs(f->offset - times * d.offset - offset) <= SAME * (fabs(f->offset) + fabs(times * d.offset)) ? times : 0;
}

/* The inner x of min(max(x, 0), 1), or of max(min(x, 1), 0). */
static karst_expr clamped_by(const karst_tape_builder *b, karst_expr e)
{
    const karst_expr_node *outer = node(b, e);
    double limit, inner_limit;
    if (outer->op != KARST_OP_MIN && outer->op != KARST_OP_MAX)
        return KARST_NO_EXPR;
    for (int k = 0; k < 2; k++) {
        const karst_expr_node *inner = node(b, outer->arg[1 - k]);
        bool is_min = outer->op == KARST_OP_MIN;
        if (!number_of(b, outer->arg[k], &limit) || inner->op != (is_min ? KARST_OP_MAX : KARST_OP_MIN))
            continue;
        for (int j = 0; j < 2; j++)
            if (number_of(b, inner->arg[j], &inner_limit) && same(is_min ? limit : inner_limit, 1) &&
                fabs(is_min ? inner_limit : limit) <= 0)
                return inner->arg[1 - j];
    }
    return KARST_NO_EXPR;
}

/* first + (second - first) * h, h = clamp(1/2 + times (second - first), 0, 1): the smaller with times < 0, the larger
 * with times > 0. 0: it is none. */
static double times_of_blend(const karst_tape_builder *b, const karst_expr_node *mix)
{
    form f;
    karst_expr x = clamped_by(b, mix->arg[2]);
    return x && form_of(b, x, MOST_TERMS, &f) ? times_difference(b, &f, 0.5, mix->arg[1], mix->arg[0]) : 0;
}

/* The factor of factor * h * (1 - h); 0: it is none. */
static double bulge_of_blend(const karst_tape_builder *b, karst_expr product, karst_expr h)
{
    const karst_expr_node *n = node(b, product);
    for (int k = 0; k < 2 && n->op == KARST_OP_MULTIPLY; k++) {
        form x, y;
        if (form_of(b, n->arg[k], 1, &x) && form_of(b, n->arg[1 - k], 1, &y) && x.count == 1 && y.count == 1 &&
            x.node[0] == h && y.node[0] == h && !(fabs(x.offset) > 0) && same(y.offset, -y.factor[0]))
            return x.factor[0] * y.offset;
    }
    return 0;
}

/* factor * base^order: what is multiplied, all of it the same but for numbers. */
typedef struct {
    karst_expr base;
    double factor;
    int order;
} power;

static bool power_of(const karst_tape_builder *b, karst_expr e, power *p)
{
    form f;
    const karst_expr_node *n = node(b, e);
    if (!form_of(b, e, 1, &f) || f.count != 1 || fabs(f.offset) > 0 || p->order > 3)
        return false;
    p->factor *= f.factor[0];
    if (f.node[0] != e)
        return power_of(b, f.node[0], p);
    if (n->op == KARST_OP_MULTIPLY)
        return power_of(b, n->arg[0], p) && power_of(b, n->arg[1], p);
    p->order++;
    bool is_other = p->base && p->base != e;
    p->base = e;
    return !is_other;
}

/* The factor of factor * max(1 - |a - b| / k, 0)^order; 0: it is none. */
static double bulge_of_choice(const karst_tape_builder *b, karst_expr product, const karst_expr_node *choice,
                              karst_tape_smooth *s)
{
    power p = {.factor = 1};
    if (!power_of(b, product, &p) || !p.base || p.order < 2 || p.order > 3 || node(b, p.base)->op != KARST_OP_MAX)
        return 0;
    for (int k = 0; k < 2; k++) {
        form x, d;
        double zero, times;
        const karst_expr *arg = node(b, p.base)->arg;
        if (!number_of(b, arg[k], &zero) || fabs(zero) > 0 || !form_of(b, arg[1 - k], 1, &x) || x.count != 1 ||
            !(x.offset > 0) || !(x.factor[0] < 0) || node(b, x.node[0])->op != KARST_OP_ABS ||
            !form_of(b, node(b, x.node[0])->arg[0], MOST_TERMS, &d))
            continue;
        times = fabs(times_difference(b, &d, 0, choice->arg[0], choice->arg[1]));
        s->k = times > 0 ? x.offset / (-x.factor[0] * times) : 0;
        s->order = p.order;
        return s->k > 0 ? p.factor * pow(x.offset, p.order) : 0;
    }
    return 0;
}

bool karst_tape_find_smooth(const karst_tape_builder *b, karst_expr e, karst_tape_smooth *s)
{
    form f;
    const karst_expr_node *n = node(b, e);
    bool may_be = n->op == KARST_OP_ADD || n->op == KARST_OP_SUBTRACT || n->op == KARST_OP_FMA;
    *s = (karst_tape_smooth){0};
    if (!may_be || b->layout->is_known[e] || !form_of(b, e, 2, &f) || f.count != 2 || fabs(f.offset) > 0)
        return false;
    for (int k = 0; k < 2; k++) {
        const karst_expr_node *choice = node(b, f.node[k]);
        double bulge = f.factor[1 - k];
        bool takes_larger = choice->op == KARST_OP_MAX, is_negative = f.factor[k] < 0;
        /* a blend in pairs is not exact at its ends */
        if (!same(fabs(f.factor[k]), 1) || (choice->op == KARST_OP_MIX && karst_tape_is_wide(b, f.node[k])))
            continue;
        if (choice->op == KARST_OP_MIX) {
            double times = times_of_blend(b, choice);
            takes_larger = times > 0;
            s->k = fabs(times) > 0 ? 0.5 / fabs(times) : 0;
            s->order = 2;
            /* k h (1 - h) is k / 4 where both are the same */
            bulge *= bulge_of_blend(b, f.node[1 - k], choice->arg[2]) / 4;
        } else if (choice->op == KARST_OP_MIN || choice->op == KARST_OP_MAX) {
            bulge *= bulge_of_choice(b, f.node[1 - k], choice, s);
        } else {
            continue;
        }
        /* the smaller gets less, the larger more; the other way about where it is taken away */
        double wanted = (takes_larger != is_negative ? 1 : -1) * s->k / (2 * fmax(s->order, 1));
        if (!(s->k > 0x1p-60 && s->k < 0x1p60) || !same(bulge, wanted))
            continue;
        s->a = choice->arg[0];
        s->b = choice->arg[1];
        s->negates_arguments = takes_larger;
        s->negates_result = takes_larger != is_negative;
        return true;
    }
    return false;
}
