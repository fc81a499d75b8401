/* Where fract and mod jump, if something else jumps with them: floor(r) + fract(r) goes on through every tie, on
 * devices, as both go by one float. So they do in doubles, or the sum would jump there by a whole cell, if only for as
 * far as that float is off. What nothing jumps with jumps where doubles do, at no cost. */
#include <math.h>
#include <stdlib.h>

#include "producers/language/oracle/oracle_internal.h"

#define CANDIDATES_AT_ONCE 64

/* A FRACT or MOD of a float. Those of an exact place jump where it does. */
static bool is_candidate(const karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = &o->graph->nodes[e];
    return (n->op == KARST_OP_FRACT || n->op == KARST_OP_MOD) && n->kind != KARST_KIND_STEPS && !o->known[e] &&
           !(karst_takes_place(&o->layout, e, 0) && o->graph->nodes[n->arg[0]].op == KARST_OP_AFFINE);
}

/* Of the argument what may be the same elsewhere: places are scaled along with what moves them. */
static karst_expr core_of(const karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = &o->graph->nodes[e];
    return n->op == KARST_OP_SHIFTED ? n->arg[1] : e;
}

/* Which of the candidates share what they are of with something piecewise constant. `of`, per node: the candidates, as
 * bits, whose arguments it is made of; all 0 but for arguments themselves. */
static uint64_t find_shared(const karst_oracle *o, uint64_t *of)
{
    uint64_t shared = 0;
    for (karst_expr e = 1; e < o->graph->num_nodes; e++) {
        const karst_expr_node *n = &o->graph->nodes[e];
        uint64_t mine = 0;
        for (int k = 0; k < 4; k++)
            mine |= n->arg[k] ? of[n->arg[k]] : 0;
        of[e] |= mine;
        if (n->kind == KARST_KIND_STEPS)
            shared |= mine;
    }
    return shared;
}

bool karst_oracle_find_ties(karst_oracle *o)
{
    const uint32_t count = o->graph->num_nodes;
    uint64_t *of = malloc(count * sizeof *of);
    for (karst_expr next = 1; of && next < count;) {
        karst_expr candidates[CANDIDATES_AT_ONCE];
        int num = 0;
        for (karst_expr e = 0; e < count; e++)
            of[e] = 0;
        for (; next < count && num < CANDIDATES_AT_ONCE; next++) {
            if (!is_candidate(o, next))
                continue;
            const karst_expr_node *n = &o->graph->nodes[next];
            for (int k = 0; k < 2; k++)
                if (n->arg[k] && !o->known[n->arg[k]])
                    of[core_of(o, n->arg[k])] |= (uint64_t)1 << num;
            candidates[num++] = next;
        }
        const uint64_t shared = num ? find_shared(o, of) : 0;
        for (int i = 0; i < num; i++)
            o->rounds[candidates[i]] = shared >> i & 1;
    }
    free(of);
    return of != NULL;
}

double karst_oracle_cells_off(const karst_oracle *o, karst_expr e, double cells)
{
    const double rounded = (double)karst_oracle_float_cells(o, e), part = cells - rounded;
    return part >= -KARST_NEAR_TIE && part < 1 + KARST_NEAR_TIE ? rounded : floor(cells);
}
