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

karst_thin_facts karst_graph_thin_facts(const karst_graph *graph, karst_expr density)
{
    bool *is_used = calloc(graph->num_nodes, sizeof *is_used);
    karst_thin_facts facts = {.may_be_thin = !is_used};
    if (is_used)
        is_used[density] = true;
    for (karst_expr e = density; is_used && e > 0; e--) {
        const karst_expr_node *n = &graph->nodes[e];
        if (!is_used[e] || is_uniform(graph, e))
            continue;
        facts.may_be_thin = facts.may_be_thin || !is_plain(graph, n);
        facts.has_noise = facts.has_noise || n->op == KARST_OP_NOISE;
        facts.may_jump = facts.may_jump || n->op == KARST_OP_FLOOR || n->op == KARST_OP_CEIL ||
                         n->op == KARST_OP_RINT || n->op == KARST_OP_SELECT || n->op == KARST_OP_CONVERT;
        for (int k = 0; k < 4; k++)
            is_used[n->arg[k]] |= n->arg[k] != KARST_NO_EXPR;
    }
    free(is_used);
    return facts;
}
