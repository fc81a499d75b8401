/* Worley's noise: F1 and F2 of the same places in one search, and bricks that hash each cell once. */
#include <string.h>

#include "producers/language/emit/emit_internal.h"

static const char *const shape_names[] = {"sum", "ridged", "billow", "turbulence"};

bool karst_emit_is_worley(const karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = &emit->graph->nodes[e];
    if (n->op != KARST_OP_NOISE)
        return false;
    const karst_noise *noise = &emit->graph->noises[n->extra];
    return (noise->base == KARST_NOISE_WORLEY_F1 || noise->base == KARST_NOISE_WORLEY_F2) && !noise->derivative;
}

/* True if one is F1 and the other F2 of the same call. */
static bool are_pair(const karst_emit *emit, karst_expr a, karst_expr b)
{
    const karst_expr_node *m = &emit->graph->nodes[a], *n = &emit->graph->nodes[b];
    const karst_noise *x = &emit->graph->noises[m->extra], *y = &emit->graph->noises[n->extra];
    return !memcmp(m->arg, n->arg, sizeof m->arg) && x->base != y->base && x->shape == y->shape &&
           x->num_octaves == y->num_octaves && x->seed_offset == y->seed_offset && x->gain == y->gain &&
           x->lacunarity == y->lacunarity;
}

void karst_emit_mark_pairs(karst_emit *emit)
{
    uint32_t num_nodes = emit->graph->num_nodes;
    for (karst_expr e = 1; e < num_nodes; e++) {
        if (!emit->nodes[e].needs || !karst_emit_is_worley(emit, e) || emit->nodes[e].partner)
            continue;
        /* a call makes both at once, so they are not far apart */
        for (karst_expr f = e + 1; f < num_nodes && f < e + 64 && !emit->nodes[e].partner; f++)
            if (emit->nodes[f].needs && karst_emit_is_worley(emit, f) && !emit->nodes[f].partner &&
                are_pair(emit, e, f)) {
                emit->nodes[e].partner = f;
                emit->nodes[f].partner = e;
            }
    }
}

void karst_emit_worley_lines(karst_emit *emit, karst_expr e)
{
    karst_expr partner = emit->nodes[e].partner;
    const karst_noise *noise = &emit->graph->noises[emit->graph->nodes[e].extra];
    bool is_f2 = noise->base == KARST_NOISE_WORLEY_F2;
    const char *shape = shape_names[noise->shape];
    karst_text *text = &emit->text;
    if (partner && partner < e)
        return; /* done with it */
    const struct {
        karst_expr e;
        bool is_f2;
    } wanted[2] = {{e, is_f2}, {partner, !is_f2}};
    int num_wanted = partner ? 2 : 1;
    for (int i = 0; i < num_wanted; i++)
        karst_text_add(text, "    vfloat v%u = (vfloat)(0.0f);\n", wanted[i].e);
    karst_emit_begin_octaves(emit, e);
    karst_text_add(text, "        if (weight.weight == 0.0f) {\n");
    for (int i = 0; i < num_wanted; i++)
        karst_text_add(text, "            v%u = octave_faded_%s(octave_mean(%d, %u), &weight, v%u);\n", wanted[i].e,
                       shape, KARST_NOISE_WORLEY_F1 + wanted[i].is_f2, noise->shape, wanted[i].e);
    karst_text_add(text, "            continue;\n        }\n        vfloat distance[2];\n");
    bool is_table = emit->nodes[e].is_table && !emit->block.is_point && !emit->block.is_sample;
    int both = partner != 0;
    if (is_table)
        karst_text_add(text,
                       "#ifdef EMIT_HOISTED\n"
                       "        emit_worley_row(&axes->w%u[k], iy, iz, %d, distance);\n"
                       "#else\n",
                       e, both ? 2 : is_f2);
    karst_emit_place(emit, e);
    if (both)
        karst_text_add(text, "        octave_noise_f1_f2(&q, weight.seed, distance);\n");
    else
        karst_text_add(text, "        distance[%d] = octave_noise_f%d(&q, weight.seed);\n", is_f2, 1 + is_f2);
    karst_text_add(text, "%s", is_table ? "#endif\n" : "");
    for (int i = 0; i < num_wanted; i++)
        karst_text_add(text, "        v%u = octave_%s(distance[%d], octave_mean(%d, %u), &weight, v%u);\n", wanted[i].e,
                       shape, wanted[i].is_f2, KARST_NOISE_WORLEY_F1 + wanted[i].is_f2, noise->shape, wanted[i].e);
    karst_text_add(text, "    }\n");
}
