#include "producers/language/graph/thin.h"
#include "producers/language/graph/uniform.h"

#include <math.h>
#include <stdlib.h>

static bool is_uniform(const karst_graph *graph, karst_expr e)
{
    return graph->nodes[e].kind == KARST_KIND_UNIFORM;
}

/* A node that adds no bend of its own: a linear form of its arguments, or noise, at any place. */
static bool is_plain(const karst_graph *graph, const karst_expr_node *n)
{
    switch (n->op) {
    case KARST_OP_AFFINE:
    case KARST_OP_SHIFTED:
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
    case KARST_OP_NEGATE:
        return true;
    case KARST_OP_NOISE:
        return graph->noises[n->extra].base == KARST_NOISE_GRADIENT && graph->noises[n->extra].shape == KARST_NOISE_SUM;
    case KARST_OP_MULTIPLY:
    case KARST_OP_FMA:
        return is_uniform(graph, n->arg[0]) || is_uniform(graph, n->arg[1]);
    case KARST_OP_DIVIDE:
        return is_uniform(graph, n->arg[1]);
    default:
        return false;
    }
}

/* ---- jumps of what folds space ---- */

/* fract, mod and angles jump; what is made of them often does not: |mod(x, 8.0) - 4.0| folds space. So the density is
 * looked at with such a node at one end of its jump and at the other, all that does not hang on it being the same, in
 * many places of no particular kind. A jump that none of them meets is not smoothed, no more. */
enum { NUM_TRIALS = 48, MOST_FOLDS = 12, MOST_NODES = 4096 };
#define SAME 1e-9

typedef struct {
    const karst_graph *graph;
    karst_expr density;
    double *values;
    bool *hangs; /* on the node that jumps */
    bool *is_used;
    uint64_t state;
} trial;

static double random_unit(trial *t)
{
    t->state = t->state * 6364136223846793005u + 1442695040888963407u;
    return (double)(t->state >> 11) * 0x1p-53;
}

/* What a node is worth that is not computed here. */
static double some_value(trial *t, const karst_expr_node *n)
{
    if (n->op == KARST_OP_PARAMETER)
        return 0.25 + 4 * random_unit(t);
    return (2 * random_unit(t) - 1) * (n->op == KARST_OP_NOISE ? 1 : exp2(12 * random_unit(t) - 4));
}

static double computed(const trial *t, const karst_expr_node *n)
{
    karst_number arg[4], result;
    if (n->op == KARST_OP_SHIFTED)
        return t->values[n->arg[0]] + t->values[n->arg[1]];
    if (n->op == KARST_OP_SIN_TURNS || n->op == KARST_OP_COS_TURNS) {
        const double turns = t->values[n->arg[0]];
        return n->op == KARST_OP_SIN_TURNS ? sin(6.283185307179586 * turns) : cos(6.283185307179586 * turns);
    }
    for (int k = 0; k < 4; k++)
        arg[k] = karst_number_double(n->arg[k] ? t->values[n->arg[k]] : 0);
    return karst_uniform_apply((karst_op)n->op, (karst_scalar_type)n->type,
                               (karst_scalar_type)t->graph->nodes[n->arg[0]].type, arg, &result)
               ? result.value
               : (double)NAN;
}

/* Fills all values; or, again, those alone that hang on node `jumps`, which is worth `at`. */
static void evaluate(trial *t, karst_expr jumps, double at, bool again)
{
    for (karst_expr e = 1; e <= t->density; e++) {
        const karst_expr_node *n = &t->graph->nodes[e];
        const karst_number *known = karst_graph_constant(t->graph, e);
        if (!t->is_used[e] || (again && !t->hangs[e]))
            continue;
        if (e == jumps)
            t->values[e] = at;
        else if (n->op == KARST_OP_NOISE || n->op == KARST_OP_AFFINE || !n->arg[0])
            t->values[e] = t->hangs[e] ? (double)NAN : known ? known->value : some_value(t, n);
        else
            t->values[e] = computed(t, n);
    }
}

static bool is_fold(const karst_expr_node *n)
{
    return n->op == KARST_OP_FRACT || n->op == KARST_OP_MOD || n->op == KARST_OP_ATAN;
}

/* Whether the density differs from one end of the node's jump to the other. */
static bool parts_at(trial *t, karst_expr jumps)
{
    const karst_expr_node *n = &t->graph->nodes[jumps];
    for (karst_expr e = 1; e <= t->density; e++) {
        t->hangs[e] = e == jumps;
        for (int k = 0; k < 4 && e > jumps; k++)
            t->hangs[e] |= t->hangs[t->graph->nodes[e].arg[k]];
    }
    for (int i = 0; i < NUM_TRIALS; i++) {
        evaluate(t, jumps, 0, false);
        const double half = n->op == KARST_OP_ATAN ? 3.141592653589793 : 0,
                     top = half > 0                ? half
                           : n->op == KARST_OP_MOD ? t->values[n->arg[1]]
                                                   : 1;
        evaluate(t, jumps, -half, true);
        const double from = t->values[t->density];
        evaluate(t, jumps, top, true);
        const double to = t->values[t->density];
        if (!(fabs(to - from) <= SAME * (1 + fabs(from) + fabs(top))))
            return true;
    }
    return false;
}

/* Whether the density may jump where fract, mod or an angle does. */
static bool folds_apart(const karst_graph *graph, karst_expr density)
{
    trial t = {.graph = graph, .density = density, .state = 1};
    int num_folds = 0;
    t.values = calloc(density + 1, sizeof *t.values);
    t.hangs = calloc(density + 1, sizeof *t.hangs);
    t.is_used = calloc(density + 1, sizeof *t.is_used);
    bool apart = !t.values || !t.hangs || !t.is_used;
    if (!apart)
        t.is_used[density] = true;
    for (karst_expr e = density; e > 0 && !apart; e--) {
        for (int k = 0; k < 4 && t.is_used[e]; k++)
            t.is_used[graph->nodes[e].arg[k]] |= graph->nodes[e].arg[k] != KARST_NO_EXPR;
        num_folds += t.is_used[e] && is_fold(&graph->nodes[e]) && !is_uniform(graph, e);
    }
    apart = apart || (num_folds && (num_folds > MOST_FOLDS || density > MOST_NODES));
    for (karst_expr e = 1; e <= density && num_folds && !apart; e++)
        apart = t.is_used[e] && is_fold(&graph->nodes[e]) && !is_uniform(graph, e) && parts_at(&t, e);
    free(t.values);
    free(t.hangs);
    free(t.is_used);
    return apart;
}

/* Of a node and all that it is made of. */
typedef struct {
    bool is_used, has_noise, may_be_thin;
    bool is_joined; /* into the density by sums, minima and choices alone */
} node_facts;

static bool joins(karst_op op) { return op == KARST_OP_MIN || op == KARST_OP_MAX || op == KARST_OP_SELECT; }

/* Whether what a node gives goes on through `op` as something that lies in the world, if moved or blended a little. */
static bool passes_on(karst_op op)
{
    return joins(op) || op == KARST_OP_ADD || op == KARST_OP_SUBTRACT || op == KARST_OP_NEGATE || op == KARST_OP_FMA ||
           op == KARST_OP_MULTIPLY || op == KARST_OP_DIVIDE || op == KARST_OP_MIX;
}

static void look_up(const karst_graph *graph, karst_expr density, node_facts *facts)
{
    for (karst_expr e = 1; e <= density; e++) {
        const karst_expr_node *n = &graph->nodes[e];
        if (is_uniform(graph, e))
            continue;
        facts[e].has_noise = n->op == KARST_OP_NOISE;
        facts[e].may_be_thin = !is_plain(graph, n);
        for (int k = 0; k < 4; k++)
            if (n->arg[k] != KARST_NO_EXPR) {
                facts[e].has_noise |= facts[n->arg[k]].has_noise;
                facts[e].may_be_thin |= facts[n->arg[k]].may_be_thin;
            }
    }
}

karst_thin_facts karst_graph_thin_facts(const karst_graph *graph, karst_expr density)
{
    node_facts *of = calloc(graph->num_nodes, sizeof *of);
    karst_thin_facts facts = {.may_be_thin = !of};
    if (!of)
        return facts;
    look_up(graph, density, of);
    of[density].is_used = of[density].is_joined = true;
    for (karst_expr e = density; e > 0; e--) {
        const karst_expr_node *n = &graph->nodes[e];
        if (!of[e].is_used || is_uniform(graph, e))
            continue;
        facts.may_be_thin = facts.may_be_thin || !is_plain(graph, n);
        facts.has_noise = facts.has_noise || n->op == KARST_OP_NOISE;
        facts.may_jump = facts.may_jump || n->op == KARST_OP_FLOOR || n->op == KARST_OP_CEIL ||
                         n->op == KARST_OP_RINT || n->op == KARST_OP_SELECT || n->op == KARST_OP_CONVERT;
        for (int k = 0; k < 4; k++) {
            if (n->arg[k] == KARST_NO_EXPR)
                continue;
            node_facts *part = of + n->arg[k];
            const bool is_condition = n->op == KARST_OP_SELECT && k == 0;
            part->is_used = true;
            part->is_joined |= of[e].is_joined && passes_on(n->op) && !is_condition;
            facts.has_thin_apart |=
                of[e].is_joined && joins(n->op) && !is_condition && part->may_be_thin && !part->has_noise;
        }
    }
    facts.may_jump = facts.may_jump || folds_apart(graph, density);
    free(of);
    return facts;
}
