/* Noise calls: a loop over octaves. */
#include "producers/language/emit/emit_internal.h"

#include "producers/language/ops/octave.clh"

static const char *const shape_names[] = {"sum", "ridged", "billow", "turbulence"};
static const char *const way_names[] = {"gradient", "value", "simplex", "f1", "f2", "level"};
_Static_assert(sizeof way_names / sizeof *way_names == OCTAVE_LEVEL + 1, "karst_noise_way's names");

const char *karst_emit_shape_name(uint8_t shape) { return shape_names[shape]; }

const char *karst_emit_way_name(const karst_emit *emit, karst_expr e)
{
    return way_names[karst_noise_way(emit->graph, e)];
}

static const karst_noise *noise_of(const karst_emit *emit, karst_expr e)
{
    return &emit->graph->noises[emit->graph->nodes[e].extra];
}

/* The axes along which an argument's place in its lattice changes by itself. */
static int steps_along(const karst_emit *emit, karst_expr argument)
{
    const karst_expr_node *behind = &emit->graph->nodes[karst_affine_behind(emit->graph, argument)];
    return behind->op == KARST_OP_AFFINE ? behind->depends & KARST_AXES : 0;
}

bool karst_emit_is_gradient(const karst_emit *emit, karst_expr e)
{
    return noise_of(emit, e)->base == KARST_NOISE_GRADIENT && !noise_of(emit, e)->derivative;
}

bool karst_emit_may_be_tensor(const karst_emit *emit, karst_expr e)
{
    return karst_emit_is_gradient(emit, e) && karst_emit_has_bricks_axes(emit, e);
}

bool karst_emit_has_bricks_axes(const karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = &emit->graph->nodes[e];
    for (int i = 0; i < 3; i++) {
        uint8_t axes = emit->graph->nodes[n->arg[i]].depends & KARST_AXES;
        if (karst_noise_moved_by(emit->graph, n->arg[i]) || (axes & ~(KARST_DEPENDS_X << i)))
            return false;
    }
    return emit->nodes[e].axes == KARST_AXES;
}

bool karst_emit_has_level_rows(const karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = &emit->graph->nodes[e];
    if (karst_noise_way(emit->graph, e) != OCTAVE_LEVEL)
        return false;
    for (int i = 0; i < 3; i++) {
        karst_expr by = karst_noise_moved_by(emit->graph, n->arg[i]);
        if ((steps_along(emit, n->arg[i]) & ~(KARST_DEPENDS_X << i)) ||
            (by && emit->graph->nodes[by].kind == KARST_KIND_WIDE))
            return false;
    }
    return true;
}

/* The axis that an argument changes along by itself, or any, `otherwise`, if it does along none; -1: along several. */
static int axis_of(const karst_emit *emit, karst_expr argument, int otherwise)
{
    switch (steps_along(emit, argument)) {
    case 0:
        return otherwise;
    case KARST_DEPENDS_X:
        return 0;
    case KARST_DEPENDS_Y:
        return 1;
    case KARST_DEPENDS_Z:
        return 2;
    default:
        return -1;
    }
}

/* Gradient noise over the position's own axes, unmoved. */
static bool is_near_gradient(const karst_emit *emit, karst_expr e)
{
    for (int i = 0; i < 3; i++)
        if (axis_of(emit, emit->graph->nodes[e].arg[i], i) != i ||
            karst_noise_moved_by(emit->graph, emit->graph->nodes[e].arg[i]))
            return false;
    return emit->block.is_near && emit->nodes[e].near && karst_emit_is_gradient(emit, e);
}

/* Where one argument lies in the octave's lattice, as the brick form steps there or the point form computes it. */
static void coordinate(karst_emit *emit, karst_expr noise, int i)
{
    karst_text *text = &emit->text;
    uint8_t axes = emit->block.axes;
    karst_expr by = karst_noise_moved_by(emit->graph, emit->graph->nodes[noise].arg[i]);
    bool by_pair = by && emit->graph->nodes[by].kind == KARST_KIND_WIDE;
    int steps = steps_along(emit, emit->graph->nodes[noise].arg[i]);
    const char *at = by && !by_pair ? "noise_coordinate_from" : "noise_coordinate_split";
    karst_text_add(text, "        q.axis[%d] = ", i);
    if (emit->block.is_near && emit->nodes[noise].near)
        karst_text_add(text, "near_coordinate(near, &at, near_octave, %d, %d, &octave->lattice[%d])", i,
                       axis_of(emit, emit->graph->nodes[noise].arg[i], i), i);
    else if (emit->block.is_point)
        karst_text_add(text, "affine_coordinate(&at, &octave->lattice[%d])", i);
    else if (emit->block.is_sample)
        karst_text_add(text, "%s(emit_steps_any(&octave->arg[%d], ix, iy, iz)", at, i);
    else if (axes & KARST_DEPENDS_X)
        karst_text_add(text, "%s(emit_steps_x(&octave->arg[%d], lane, %s, %s, %d)", at, i,
                       axes & KARST_DEPENDS_Y ? "iy" : "0", axes & KARST_DEPENDS_Z ? "iz" : "0", steps);
    else if (axes & KARST_DEPENDS_Y)
        karst_text_add(text, "%s(emit_steps_y(&octave->arg[%d], 0, lane, %s, %d)", at, i,
                       axes & KARST_DEPENDS_Z ? "iz" : "0", steps);
    else
        karst_text_add(text, "%s(emit_steps_z(&octave->arg[%d], 0, 0, lane, %d)", at, i, steps);
    if (by && !by_pair && !emit->block.is_point)
        karst_text_add(text, ", %s * (vfloat)(weight.scale)", karst_emit_operand(emit, by).text);
    karst_text_add(text, emit->block.is_point ? ";\n" : ");\n");
    if (by_pair)
        karst_text_add(text, "        q.axis[%d] = wide_move(q.axis[%d], %s, weight.scale);\n", i, i,
                       karst_emit_wide_operand(emit, by).text);
    else if (by && emit->block.is_point)
        karst_text_add(text, "        q.axis[%d] = noise_coordinate_move(q.axis[%d], %s * (vfloat)(weight.scale));\n",
                       i, i, karst_emit_operand(emit, by).text);
}

void karst_emit_place(karst_emit *emit, karst_expr e)
{
    karst_text_add(&emit->text, "        noise_position q;\n");
    for (int i = 0; i < 3; i++)
        coordinate(emit, e, i);
}

/* Adds an octave at places of its own in each lane. */
static void octave_line(karst_emit *emit, karst_expr e)
{
    const karst_noise *noise = noise_of(emit, e);
    const char *way = karst_emit_way_name(emit, e), *shape = shape_names[noise->shape];
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
                       e, shape_names[noise->shape], way, e, noise->base, noise->shape, e);
}

void karst_emit_begin_octaves(karst_emit *emit, karst_expr e)
{
    karst_text *text = &emit->text;
    karst_text_add(text, "    for (int k = 0; k < %u; k++) {\n", noise_of(emit, e)->num_octaves);
    if (emit->block.is_point)
        karst_text_add(text, "        K_GLOBAL const karst_octave *octave = EMIT_OCTAVE(data, %u) + k;\n",
                       emit->layout->word[e]);
    if (emit->block.is_near && emit->nodes[e].near)
        karst_text_add(text,
                       "        __local const near_octave *near_octave = octaves + %u + k;\n"
                       "        const octave_weight weight = near_octave_weight(near_octave, level);\n",
                       emit->nodes[e].near - 1);
    else if (emit->block.is_point)
        karst_text_add(text, "        const octave_weight weight = octave_weight_at(octave, level);\n");
    else
        karst_text_add(text,
                       "        const K_PRIVATE emit_octave *octave = &axes->n%u[k];\n"
                       "        const octave_weight weight = octave->weight;\n",
                       e);
}

void karst_emit_noise_lines(karst_emit *emit, karst_expr e)
{
    const karst_noise *noise = noise_of(emit, e);
    karst_text *text = &emit->text;
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
                       shape_names[noise->shape], noise->base, noise->shape, e);
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
        bool is_near = num_octaves + octaves <= KARST_EMIT_MAX_NEAR_OCTAVES;
        for (int i = 0; i < 3; i++) {
            axis[i] = axis_of(emit, arg[i], i);
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
