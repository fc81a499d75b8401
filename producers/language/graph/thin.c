#include "producers/language/graph/thin.h"

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
    free(of);
    return facts;
}
