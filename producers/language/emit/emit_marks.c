/* What is known of nodes before a line is written: which are wanted, as what, and what blocks are called. */
#include "producers/language/emit/emit_internal.h"

#include <string.h>

const char *karst_emit_axes_name(uint8_t axes)
{
    static const char *const names[8] = {"b", "x", "y", "xy", "z", "xz", "yz", "xyz"};
    return names[axes & KARST_AXES];
}

void karst_emit_begin_block(karst_emit *emit, karst_block block)
{
    emit->block = block;
    emit->serial++;
}

static bool is_pair(const karst_emit *emit, karst_expr e) { return emit->graph->nodes[e].kind == KARST_KIND_WIDE; }

bool karst_emit_is_wide(const karst_emit *emit, karst_expr e) { return karst_is_computed_wide(emit->graph, e); }

/* As which part a wide node reads an argument: AFFINE and SHIFTED have both, others what they have. */
static uint8_t part_of(const karst_emit *emit, karst_expr e, bool wide)
{
    uint8_t op = emit->graph->nodes[e].op;
    return is_pair(emit, e) || (wide && (op == KARST_OP_AFFINE || op == KARST_OP_SHIFTED)) ? KARST_PART_PAIR
                                                                                           : KARST_PART_VALUE;
}

size_t karst_emit_inputs(const karst_emit *emit, karst_expr e, karst_emit_input inputs[KARST_MAX_INPUTS])
{
    const karst_expr_node *n = &emit->graph->nodes[e];
    bool wide = karst_emit_is_wide(emit, e);
    size_t count = 0;
    for (int k = 0; k < 4; k++) {
        karst_expr input = n->arg[k];
        if (karst_takes_place(emit->layout, e, k)) {
            const karst_expr_node *a = &emit->graph->nodes[input];
            input = a->op == KARST_OP_SHIFTED ? a->arg[1] : KARST_NO_EXPR;
        }
        if (!input || emit->layout->is_known[input])
            continue;
        uint8_t part = 0;
        if (n->op != KARST_OP_SHIFTED || (emit->nodes[e].needs & KARST_PART_VALUE))
            part |= part_of(emit, input, wide);
        if (n->op == KARST_OP_SHIFTED && (emit->nodes[e].needs & KARST_PART_PAIR))
            part |= part_of(emit, input, true);
        inputs[count++] = (karst_emit_input){input, part};
    }
    return count;
}

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

/* Sets the partners of F1 and F2. */
static void mark_pairs(karst_emit *emit)
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

/* Sets the first of each texture's channels. */
static void mark_textures(karst_emit *emit)
{
    const karst_graph *graph = emit->graph;
    for (karst_expr e = 1; e < graph->num_nodes; e++) {
        if (!emit->nodes[e].needs || emit->nodes[e].texture || !karst_graph_is_texture(graph, e))
            continue;
        for (karst_expr f = e; f < graph->num_nodes; f++)
            if (emit->nodes[f].needs && graph->nodes[f].op == KARST_OP_NOISE &&
                graph->noises[graph->nodes[f].extra].image == graph->noises[graph->nodes[e].extra].image &&
                !memcmp(graph->nodes[f].arg, graph->nodes[e].arg, sizeof graph->nodes[e].arg))
                emit->nodes[f].texture = e;
    }
}

uint32_t karst_emit_mark(karst_emit *emit, const karst_expr *roots, size_t num_roots)
{
    uint32_t count = 0, num_nodes = emit->graph->num_nodes;
    for (karst_expr e = 0; e < num_nodes; e++)
        emit->nodes[e] = (karst_emit_node){.axes = emit->graph->nodes[e].depends & KARST_AXES};
    for (size_t i = 0; i < num_roots; i++)
        if (!emit->layout->is_known[roots[i]])
            emit->nodes[roots[i]].needs = part_of(emit, roots[i], false);
    for (karst_expr e = num_nodes - 1; e > 0; e--) {
        if (!emit->nodes[e].needs)
            continue;
        karst_emit_input inputs[KARST_MAX_INPUTS];
        size_t num_inputs = karst_emit_inputs(emit, e, inputs);
        for (size_t i = 0; i < num_inputs; i++)
            emit->nodes[inputs[i].e].needs |= inputs[i].part;
        count++;
    }
    mark_pairs(emit);
    mark_textures(emit);
    return count;
}

bool karst_emit_face_in_rows(const karst_emit *emit)
{
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].needs && emit->graph->nodes[e].op == KARST_OP_NOISE && !emit->nodes[e].is_tensor)
            return false;
    return true;
}
