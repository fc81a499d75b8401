#include "producers/language/graph/whole.h"

#include <string.h>

typedef struct {
    const karst_graph *graph;
    const karst_whole **wholes;
    const uint8_t *has_form;
} finder;

#define LIMIT ((int64_t)1 << 31)

static bool is_small(int64_t a) { return a < LIMIT && a > -LIMIT; }

static bool reduce(karst_whole *w)
{
    uint32_t kept = 0;
    bool fits = w->divisor > 0 && w->divisor < LIMIT && is_small(w->constant);
    for (uint32_t i = 0; i < w->num_terms; i++) {
        fits &= is_small(w->factor[i]);
        w->atom[kept] = w->atom[i];
        w->factor[kept] = w->factor[i];
        kept += w->factor[i] != 0;
    }
    w->num_terms = kept;
    return fits;
}

/* w * numerator / denominator, in lowest terms. */
static bool scale(karst_whole *w, int64_t numerator, int64_t denominator)
{
    if (!is_small(numerator) || !is_small(denominator) || numerator == 0)
        return false;
    for (uint32_t i = 0; i < w->num_terms; i++)
        w->factor[i] *= numerator;
    w->constant *= numerator;
    w->divisor *= denominator;
    int64_t common = w->divisor, all[KARST_WHOLE_MAX_TERMS + 1];
    memcpy(all, w->factor, sizeof w->factor);
    all[KARST_WHOLE_MAX_TERMS] = w->constant;
    for (uint32_t i = 0; i <= KARST_WHOLE_MAX_TERMS; i++) {
        int64_t a = i < w->num_terms || i == KARST_WHOLE_MAX_TERMS ? all[i] : 0;
        for (a = a < 0 ? -a : a; a;) {
            int64_t rest = common % a;
            common = a;
            a = rest;
        }
    }
    for (uint32_t i = 0; i < w->num_terms; i++)
        w->factor[i] /= common;
    w->constant /= common;
    w->divisor /= common;
    return reduce(w);
}

/* a + sign * b; either may be a constant, with no terms. */
static bool add(karst_whole *a, const karst_whole *b, int sign)
{
    int64_t da = a->divisor, db = b->divisor;
    if (da != db) {
        for (uint32_t i = 0; i < a->num_terms; i++)
            a->factor[i] *= db;
        a->constant *= db;
        if (da * db >= LIMIT || !is_small(a->constant))
            return false;
        a->divisor = da * db;
    }
    int64_t by = da != db ? da * sign : sign;
    a->constant += b->constant * by;
    for (uint32_t k = 0; k < b->num_terms; k++) {
        uint32_t i = 0;
        while (i < a->num_terms && a->atom[i] != b->atom[k])
            i++;
        if (i == KARST_WHOLE_MAX_TERMS)
            return false;
        if (i == a->num_terms) {
            a->atom[i] = b->atom[k];
            a->factor[i] = 0;
            a->num_terms++;
        }
        a->factor[i] += b->factor[k] * by;
    }
    return reduce(a);
}

/* A whole number, or a constant, with no terms. */
static bool get(const karst_graph *graph, const karst_whole *const *wholes, karst_expr e, karst_whole *w)
{
    const karst_number *n = karst_graph_constant(graph, e);
    if (wholes[e])
        *w = *wholes[e];
    else if (n && n->denominator > 0 && n->denominator < LIMIT && is_small(n->numerator) &&
             graph->nodes[e].type != KARST_TYPE_BOOL)
        *w = (karst_whole){.constant = n->numerator, .divisor = n->denominator};
    else
        return false;
    return true;
}

/* An int is multiplied by small numbers only: what hashes do to it wraps. */
#define SMALL_FACTOR ((int64_t)1 << 16)
static bool product(const finder *f, const karst_expr_node *n, karst_whole *w)
{
    karst_whole x, y;
    if (!get(f->graph, f->wholes, n->arg[0], &x) || !get(f->graph, f->wholes, n->arg[1], &y) ||
        (x.num_terms && y.num_terms))
        return false;
    const karst_whole *by = x.num_terms ? &y : &x;
    *w = x.num_terms ? x : y;
    bool is_small_factor = by->constant <= SMALL_FACTOR && by->constant >= -SMALL_FACTOR;
    return (n->type == KARST_TYPE_FLOAT || is_small_factor) && scale(w, by->constant, by->divisor);
}

static bool atom(karst_expr e, int64_t factor, karst_whole *w)
{
    *w = (karst_whole){.atom = {e}, .factor = {factor}, .num_terms = 1, .divisor = 1};
    return true;
}

static bool rounds_towards_zero(const karst_graph *graph, karst_expr e)
{
    return graph->nodes[e].op == KARST_OP_CONVERT;
}

/* FLOOR, CEIL, RINT and CONVERT to INT of a place, or of what is whole already; `by`: of a part of it. */
static bool rounded(const finder *f, karst_expr e, int64_t by, karst_whole *w)
{
    const karst_expr_node *n = &f->graph->nodes[e];
    karst_expr a = n->arg[0];
    if (f->has_form[a] && n->op != KARST_OP_SHIFT_RIGHT)
        return atom(e, n->op == KARST_OP_CEIL ? -1 : 1, w);
    if (!f->wholes[a])
        return false;
    *w = *f->wholes[a];
    if (w->divisor == 1 && by == 1)
        return true;
    bool nests = w->num_terms == 1 && w->factor[0] == 1 && !rounds_towards_zero(f->graph, w->atom[0]) &&
                 (n->op == KARST_OP_FLOOR || n->op == KARST_OP_SHIFT_RIGHT) && w->divisor * by < LIMIT;
    return nests && atom(e, 1, w);
}

static bool shift_of(const karst_graph *graph, karst_expr e, int64_t *by)
{
    const karst_number *n = karst_graph_constant(graph, e);
    if (!n || n->numerator < 0 || n->numerator > 30)
        return false;
    *by = (int64_t)1 << n->numerator;
    return true;
}

static bool find_int(const finder *f, karst_expr e, karst_whole *w)
{
    const karst_expr_node *n = &f->graph->nodes[e];
    karst_whole b;
    int64_t by;
    switch (n->op) {
    case KARST_OP_CONVERT:
        return f->graph->nodes[n->arg[0]].type == KARST_TYPE_FLOAT && rounded(f, e, 1, w);
    case KARST_OP_INT_ADD:
    case KARST_OP_INT_SUBTRACT:
        return get(f->graph, f->wholes, n->arg[0], w) && get(f->graph, f->wholes, n->arg[1], &b) &&
               add(w, &b, n->op == KARST_OP_INT_ADD ? 1 : -1);
    case KARST_OP_INT_MULTIPLY:
        return product(f, n, w);
    case KARST_OP_SHIFT_RIGHT:
        return shift_of(f->graph, n->arg[1], &by) && rounded(f, e, by, w);
    default:
        return false;
    }
}

static bool find_float(const finder *f, karst_expr e, karst_whole *w)
{
    const karst_expr_node *n = &f->graph->nodes[e];
    karst_whole b;
    switch (n->op) {
    case KARST_OP_FLOOR:
    case KARST_OP_CEIL:
    case KARST_OP_RINT:
        return rounded(f, e, 1, w);
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
        return get(f->graph, f->wholes, n->arg[0], w) && get(f->graph, f->wholes, n->arg[1], &b) &&
               add(w, &b, n->op == KARST_OP_ADD ? 1 : -1);
    case KARST_OP_NEGATE:
        return get(f->graph, f->wholes, n->arg[0], w) && scale(w, -1, 1);
    case KARST_OP_MULTIPLY:
        return product(f, n, w);
    case KARST_OP_DIVIDE:
        return get(f->graph, f->wholes, n->arg[0], w) && get(f->graph, f->wholes, n->arg[1], &b) && !b.num_terms &&
               b.constant > 0 && scale(w, b.divisor, b.constant);
    case KARST_OP_FMA:
        return product(f, n, w) && get(f->graph, f->wholes, n->arg[2], &b) && add(w, &b, 1);
    case KARST_OP_CONVERT:
        return f->graph->nodes[n->arg[0]].type == KARST_TYPE_INT && get(f->graph, f->wholes, n->arg[0], w);
    default:
        return false;
    }
}

const karst_whole **karst_wholes_find(const karst_graph *graph, const uint8_t *has_form, karst_arena *arena)
{
    finder f = {.graph = graph, .has_form = has_form};
    f.wholes = karst_arena_alloc(arena, graph->num_nodes * sizeof *f.wholes);
    for (karst_expr e = 1; e < graph->num_nodes; e++) {
        karst_whole w = {0};
        uint8_t type = graph->nodes[e].type;
        bool found = !has_form[e] && graph->nodes[e].op != KARST_OP_CONSTANT &&
                     (type == KARST_TYPE_FLOAT ? find_float(&f, e, &w) : type == KARST_TYPE_INT && find_int(&f, e, &w));
        if (!found || !w.num_terms)
            continue;
        karst_whole *kept = karst_arena_alloc(arena, sizeof *kept);
        *kept = w;
        f.wholes[e] = kept;
    }
    return f.wholes;
}

bool karst_whole_is_atom(const karst_whole *const *wholes, karst_expr e)
{
    return wholes[e] && wholes[e]->num_terms == 1 && wholes[e]->atom[0] == e;
}

karst_whole_part karst_whole_part_of(const karst_graph *graph, const karst_whole *const *wholes,
                                     const uint8_t *has_form, karst_expr e)
{
    karst_expr a = graph->nodes[e].arg[0];
    if (has_form[a])
        return (karst_whole_part){a, 0, 1};
    const karst_whole *w = wholes[a];
    int64_t by = 1;
    if (graph->nodes[e].op == KARST_OP_SHIFT_RIGHT)
        shift_of(graph, graph->nodes[e].arg[1], &by);
    return (karst_whole_part){w->atom[0], w->constant, w->divisor * by};
}

bool karst_whole_difference(const karst_graph *graph, const karst_whole *const *wholes, karst_expr a, karst_expr b,
                            karst_whole *difference)
{
    karst_whole other;
    return get(graph, wholes, a, difference) && get(graph, wholes, b, &other) && add(difference, &other, -1) &&
           difference->num_terms > 0;
}
