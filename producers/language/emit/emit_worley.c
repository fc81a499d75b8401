/* Worley's noise: F1 and F2 of the same places in one search, and bricks that hash each cell once. */
#include <string.h>

#include "producers/language/emit/emit_internal.h"

static const char *const shape_names[] = {"sum", "ridged", "billow", "turbulence"};

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
