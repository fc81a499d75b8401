/* Textures in colours: the channels of a file from one look at it (ops/texture.clh). */
#include "producers/language/emit/emit_internal.h"

static const karst_noise *noise_of(const karst_emit *emit, karst_expr e)
{
    return &emit->graph->noises[emit->graph->nodes[e].extra];
}

void karst_emit_texture_lines(karst_emit *emit, karst_expr e)
{
    const karst_graph *graph = emit->graph;
    const karst_expr share = graph->nodes[e].arg[2];
    karst_text *text = &emit->text;
    if (emit->nodes[e].texture != e)
        return; /* done with that one */
    for (karst_expr f = e; f < graph->num_nodes; f++)
        if (emit->nodes[f].texture == e)
            karst_text_add(text, "    vfloat v%u = (vfloat)(0.0f);\n", f);
    /* A lane without a share has 0, whatever its neighbours have. */
    const bool is_shared = graph->nodes[share].op != KARST_OP_CONSTANT;
    if (is_shared)
        karst_text_add(text, "    const vint s%u = v_ne(%s, (vfloat)(0.0f));\n    if (v_any(s%u)) {\n", e,
                       karst_emit_operand(emit, share).text, e);
    else
        karst_text_add(text, "    {\n");
    karst_text_add(text,
                   "        K_GLOBAL const karst_octave *octave = EMIT_OCTAVE(data, %u);\n"
                   "        const octave_weight weight = octave_weight_at(octave, level);\n",
                   emit->layout->word[e]);
    karst_emit_near_image(emit, e);
    karst_emit_place(emit, e);
    karst_text_add(
        text,
        "        vfloat channels[TEXTURE_MOST_CHANNELS];\n"
        "        texture_values(image_of(octave), image_level_at(octave, level), &q.axis[0], &q.axis[1], channels);\n");
    for (karst_expr f = e; f < graph->num_nodes; f++)
        if (emit->nodes[f].texture == e && is_shared)
            karst_text_add(text, "        v%u = v_select(s%u, channels[%u], (vfloat)(0.0f));\n", f, e,
                           noise_of(emit, f)->channel);
        else if (emit->nodes[f].texture == e)
            karst_text_add(text, "        v%u = channels[%u];\n", f, noise_of(emit, f)->channel);
    karst_text_add(text, "    }\n");
}
