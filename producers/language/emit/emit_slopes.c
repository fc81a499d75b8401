/* Gradient noise with its derivatives: corners are hashed once for the value and all three. */
#include <string.h>

#include "producers/language/emit/emit_internal.h"

static const char *const shape_names[] = {"sum", "ridged", "billow", "turbulence"};

/* The noise itself and its derivatives along the three axes of the lattice; KARST_NO_EXPR: not wanted. */
typedef struct {
    karst_expr part[4];
} slope_group;

static bool is_of_group(const karst_emit *emit, karst_expr a, karst_expr b)
{
    const karst_expr_node *m = &emit->graph->nodes[a], *n = &emit->graph->nodes[b];
    if (n->op != KARST_OP_NOISE || memcmp(m->arg, n->arg, sizeof m->arg) != 0)
        return false;
    const karst_noise *x = &emit->graph->noises[m->extra], *y = &emit->graph->noises[n->extra];
    return x->base == y->base && x->shape == y->shape && x->num_octaves == y->num_octaves &&
           x->seed_offset == y->seed_offset && x->gain == y->gain && x->lacunarity == y->lacunarity;
}

/* False: no derivative is wanted. */
static bool find_group(const karst_emit *emit, karst_expr e, slope_group *group)
{
    bool has_slope = false;
    *group = (slope_group){{KARST_NO_EXPR}};
    for (karst_expr f = 1; f < emit->graph->num_nodes; f++)
        if (emit->nodes[f].needs && is_of_group(emit, e, f)) {
            uint8_t derivative = emit->graph->noises[emit->graph->nodes[f].extra].derivative;
            group->part[derivative] = f;
            has_slope |= derivative > 0;
        }
    return has_slope;
}

bool karst_emit_slope_lines(karst_emit *emit, karst_expr e)
{
    const karst_noise *noise = &emit->graph->noises[emit->graph->nodes[e].extra];
    slope_group group;
    if (!emit->block.is_point || noise->base != KARST_NOISE_GRADIENT || !find_group(emit, e, &group))
        return false;
    karst_text *text = &emit->text;
    for (int i = 0; i < 4; i++)
        if (group.part[i] && group.part[i] < e)
            return true; /* done with that one */
    for (int i = 0; i < 4; i++)
        if (group.part[i])
            karst_text_add(text, "    vfloat v%u = (vfloat)(0.0f);\n", group.part[i]);
    const char *shape = shape_names[noise->shape], *way = karst_emit_way_name(emit, e);
    karst_expr value = group.part[0];
    karst_emit_begin_octaves(emit, e);
    karst_text_add(text, "        if (weight.weight == 0.0f) {\n");
    if (value)
        karst_text_add(text, "            v%u = octave_faded_%s(octave_mean(%u, %u), &weight, v%u);\n", value, shape,
                       noise->base, noise->shape, value);
    karst_text_add(text, "            continue;\n        }\n");
    karst_emit_place(emit, e);
    karst_text_add(text, "        vfloat slope[3];\n");
    bool is_sum = noise->shape == KARST_NOISE_SUM;
    if (is_sum && value)
        karst_text_add(text,
                       "        v%u = octave_slopes_%s(&q, weight.seed, weight.amplitude * weight.weight, v%u, "
                       "slope);\n",
                       value, way, value);
    else
        karst_text_add(text,
                       "        const vfloat n = octave_slopes_%s(&q, weight.seed, 1.0f, (vfloat)(0.0f), "
                       "slope);\n",
                       way);
    if (!is_sum && value)
        karst_text_add(text, "        v%u = octave_%s(n, octave_mean(%u, %u), &weight, v%u);\n", value, shape,
                       noise->base, noise->shape, value);
    for (int i = 1; i < 4; i++)
        if (group.part[i] && is_sum)
            karst_text_add(text, "        v%u = octave_slope_sum(slope[%d], &weight, v%u);\n", group.part[i], i - 1,
                           group.part[i]);
        else if (group.part[i])
            karst_text_add(text, "        v%u = octave_slope_folded(slope[%d], n, octave_fold(%u), &weight, v%u);\n",
                           group.part[i], i - 1, noise->shape, group.part[i]);
    karst_text_add(text, "    }\n");
    return true;
}
