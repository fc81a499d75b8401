/* Noise calls: a loop over octaves. */
#include "producers/language/emit/emit_internal.h"

#include "producers/language/ops/octave.clh"

static const karst_noise *noise_of(const karst_emit *emit, karst_expr e)
{
    return &emit->graph->noises[emit->graph->nodes[e].extra];
}

/* Gradient noise over the position's own axes, unmoved. */
static bool is_near_gradient(const karst_emit *emit, karst_expr e)
{
    for (int i = 0; i < 3; i++)
        if (karst_emit_axis_of(emit, emit->graph->nodes[e].arg[i], i) != i ||
            karst_noise_moved_by(emit->graph, emit->graph->nodes[e].arg[i]))
            return false;
    return emit->block.is_near && emit->nodes[e].near && karst_emit_is_gradient(emit, e);
}

/* Adds an octave at places of its own in each lane. */
static void octave_line(karst_emit *emit, karst_expr e)
{
    const karst_noise *noise = noise_of(emit, e);
    const char *way = karst_emit_way_name(emit, e), *shape = karst_emit_shape_name(noise->shape);
    karst_text *text = &emit->text;
    if (is_near_gradient(emit, e) && noise->shape == KARST_NOISE_SUM) {
        karst_text_add(
            text,
            "        v%u = near_add_gradient(near, &at, near_octave, octave, weight.amplitude * weight.weight, "
            "v%u);\n",
            e, e);
        return;
    }
    if (is_near_gradient(emit, e)) {
        karst_text_add(
            text,
            "        v%u = octave_%s(near_add_gradient(near, &at, near_octave, octave, 1.0f, (vfloat)(0.0f)), "
            "octave_mean(%u, %u), &weight, v%u);\n",
            e, shape, noise->base, noise->shape, e);
        return;
    }
    karst_emit_place(emit, e);
    if (noise->derivative)
        karst_text_add(text, "        const vfloat slope = octave_slope_%s(&q, weight.seed, %d);\n", way,
                       noise->derivative - 1);
    if (noise->derivative && noise->shape == KARST_NOISE_SUM)
        karst_text_add(text, "        v%u = octave_slope_sum(slope, &weight, v%u);\n", e, e);
    else if (noise->derivative)
        karst_text_add(text,
                       "        v%u = octave_slope_folded(slope, octave_noise_%s(&q, weight.seed), octave_fold(%u), "
                       "&weight, v%u);\n",
                       e, way, noise->shape, e);
    else if (noise->base == KARST_NOISE_GRADIENT && noise->shape == KARST_NOISE_SUM)
        karst_text_add(text, "        v%u = octave_add_%s(&q, &weight, v%u);\n", e, way, e);
    else
        karst_text_add(
            text, "        v%u = octave_%s(octave_noise_%s(&q, weight.seed), octave_mean(%u, %u), &weight, v%u);\n", e,
            shape, way, noise->base, noise->shape, e);
}

/* The same from gradients in a table. */
static void table_line(karst_emit *emit, karst_expr e)
{
    const karst_noise *noise = noise_of(emit, e);
    const char *way = karst_emit_way_name(emit, e);
    karst_text *text = &emit->text;
    karst_emit_place(emit, e);
    if (noise->shape == KARST_NOISE_SUM)
        karst_text_add(text,
                       "        v%u = emit_table_%s(&axes->g%u[k], &q, weight.seed, "
                       "weight.amplitude * weight.weight, v%u);\n",
                       e, way, e, e);
    else
        karst_text_add(text,
                       "        v%u = octave_%s(emit_table_%s(&axes->g%u[k], &q, weight.seed, 1.0f, "
                       "(vfloat)(0.0f)), octave_mean(%u, %u), &weight, v%u);\n",
                       e, karst_emit_shape_name(noise->shape), way, e, noise->base, noise->shape, e);
}

/* At places that are computed one by one: a level's steps along a brick may be any number of cells. */
static void image_lines(karst_emit *emit, karst_expr e)
{
    karst_text *text = &emit->text;
    karst_text_add(text,
                   "    vfloat v%u;\n    {\n"
                   "        K_GLOBAL const karst_octave *octave = EMIT_OCTAVE(data, %u);\n"
                   "        const octave_weight weight = octave_weight_at(octave, %s);\n",
                   e, emit->layout->word[e], emit->block.is_point ? "level" : "axes->level");
    karst_emit_near_image(emit, e);
    karst_emit_place(emit, e);
    karst_text_add(text, "        v%u = octave_image(&q, &weight, %u);\n    }\n", e, noise_of(emit, e)->derivative);
}

void karst_emit_noise_lines(karst_emit *emit, karst_expr e)
{
    const karst_noise *noise = noise_of(emit, e);
    karst_text *text = &emit->text;
    if (karst_graph_is_texture(emit->graph, e) && emit->block.is_point) {
        karst_emit_texture_lines(emit, e);
        return;
    }
    if (noise->image) {
        image_lines(emit, e);
        return;
    }
    if (karst_emit_is_worley(emit, e)) {
        karst_emit_worley_lines(emit, e);
        return;
    }
    if (karst_emit_slope_lines(emit, e))
        return;
    bool is_tensor = emit->nodes[e].is_tensor && !emit->block.is_point;
    bool has_rows = emit->nodes[e].has_rows && !emit->block.is_point && !emit->block.is_sample;
    bool has_gradients = emit->nodes[e].has_gradients && !emit->block.is_point && !has_rows;
    if (is_tensor && emit->block.is_sample)
        karst_text_add(
            text,
            "#ifdef EMIT_HOISTED\n"
            "    vfloat v%u = EMIT_%s(axes->s%u + EMIT_TENSOR_ROWS, iz * (vint)(NOISE_TENSOR_SIDE) + iy);\n#else\n",
            e, karst_emit_face_in_rows(emit) ? "ROW_FLOATS" : "FLOATS", e);
    else if (is_tensor)
        karst_text_add(text, "#ifdef EMIT_HOISTED\n    vfloat v%u = axes->s%u[iz * KARST_BRICK_SIDE + iy];\n#else\n", e,
                       e);
    if (has_rows)
        karst_text_add(text, "#ifdef EMIT_HAS_TABLES\n    vfloat v%u = axes->r%u[iy];\n#else\n", e, e);
    karst_text_add(text, "    vfloat v%u = (vfloat)(0.0f);\n", e);
    karst_emit_begin_octaves(emit, e);
    karst_text_add(text, "        if (weight.weight == 0.0f) {\n");
    if (!noise->derivative)
        karst_text_add(text, "            v%u = octave_faded_%s(octave_mean(%u, %u), &weight, v%u);\n", e,
                       karst_emit_shape_name(noise->shape), noise->base, noise->shape, e);
    karst_text_add(text, "            continue;\n"
                         "        }\n");
    if (has_gradients) {
        karst_text_add(text, "#ifdef EMIT_HAS_TABLES\n");
        table_line(emit, e);
        karst_text_add(text, "#else\n");
    }
    octave_line(emit, e);
    karst_text_add(text, "%s    }\n%s", has_gradients ? "#endif\n" : "", is_tensor || has_rows ? "#endif\n" : "");
}

void karst_emit_near_octaves(karst_emit *emit)
{
    karst_text *text = &emit->text;
    uint32_t num_octaves = 0;
    karst_text_add(text,
                   "K_INLINE void world_colour_prepare(world_data data, const long anchor[3], const uint fraction[3],\n"
                   "                                   __local near_octave *octaves, uint item, uint num_items)\n"
                   "{\n");
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        if (!emit->nodes[e].needs || emit->graph->nodes[e].op != KARST_OP_NOISE)
            continue;
        const karst_expr *arg = emit->graph->nodes[e].arg;
        const uint32_t octaves = noise_of(emit, e)->num_octaves;
        int axis[3];
        const uint32_t num_axes = noise_of(emit, e)->image ? karst_graph_image_axes(emit->graph, e) : 3;
        bool is_near = num_octaves + octaves <= KARST_EMIT_MAX_NEAR_OCTAVES &&
                       (!emit->nodes[e].texture || emit->nodes[e].texture == e);
        axis[2] = 2;
        for (int i = 0; i < (int)num_axes; i++) {
            axis[i] = karst_emit_axis_of(emit, arg[i], i);
            is_near = is_near && axis[i] >= 0;
        }
        emit->nodes[e].near = is_near ? num_octaves + 1 : 0;
        if (!is_near)
            continue;
        /* Each item counts all octaves: with PoCL 3.1 a loop in steps of num_items ran on (a crash in `alps`). */
        karst_text_add(
            text,
            "    const int axis%u[3] = {%d, %d, %d};\n    for (uint k = 0; k < %uu; k++)\n"
            "        if ((%uu + k) %% num_items == item)\n"
            "            near_octave_at(octaves + %u + k, EMIT_OCTAVE(data, %u) + k, anchor, fraction, axis%u);\n",
            e, axis[0], axis[1], axis[2], octaves, num_octaves, num_octaves, emit->layout->word[e], e);
        num_octaves += octaves;
    }
    karst_text_add(text, "}\n#define WORLD_NEAR_OCTAVES %u\n\n", num_octaves);
}
