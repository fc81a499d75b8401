/* What all that is written of noise shares: names, axes, the loop over octaves and the places in it. */
#include "producers/language/emit/emit_internal.h"

#include "producers/language/ops/octave.clh"

static const char *const shape_names[] = {"sum", "ridged", "billow", "turbulence"};
static const char *const way_names[] = {"gradient", "value", "simplex", "f1", "f2", "level", "image"};
_Static_assert(sizeof way_names / sizeof *way_names == OCTAVE_IMAGE + 1, "karst_noise_way's names");

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
int karst_emit_axis_of(const karst_emit *emit, karst_expr argument, int otherwise)
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

/* Where one argument lies in the octave's lattice, as the brick form steps there or the point form computes it. */
static void coordinate(karst_emit *emit, karst_expr noise, int i)
{
    karst_text *text = &emit->text;
    uint8_t axes = emit->block.axes;
    bool is_point = emit->block.is_point || noise_of(emit, noise)->image;
    karst_expr by = karst_noise_moved_by(emit->graph, emit->graph->nodes[noise].arg[i]);
    bool by_pair = by && emit->graph->nodes[by].kind == KARST_KIND_WIDE;
    int steps = steps_along(emit, emit->graph->nodes[noise].arg[i]);
    const char *at = by && !by_pair ? "noise_coordinate_from" : "noise_coordinate_split";
    karst_text_add(text, "        q.axis[%d] = ", i);
    if (emit->block.is_near && emit->nodes[noise].near)
        karst_text_add(text, "near_%scoordinate(near, &at, near_octave, %d, %d, &octave->lattice[%d])",
                       noise_of(emit, noise)->image ? "image_" : "", i,
                       karst_emit_axis_of(emit, emit->graph->nodes[noise].arg[i], i), i);
    else if (is_point)
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
    if (by && !by_pair && !is_point)
        karst_text_add(text, ", %s * (vfloat)(weight.scale)", karst_emit_operand(emit, by).text);
    karst_text_add(text, is_point ? ";\n" : ");\n");
    if (by_pair)
        karst_text_add(text, "        q.axis[%d] = wide_move(q.axis[%d], %s, weight.scale);\n", i, i,
                       karst_emit_wide_operand(emit, by).text);
    else if (by && is_point)
        karst_text_add(text, "        q.axis[%d] = noise_coordinate_move(q.axis[%d], %s * (vfloat)(weight.scale));\n",
                       i, i, karst_emit_operand(emit, by).text);
}

void karst_emit_near_image(karst_emit *emit, karst_expr e)
{
    if (emit->block.is_near && emit->nodes[e].near)
        karst_text_add(&emit->text, "        __local const near_octave *near_octave = octaves + %u;\n",
                       emit->nodes[e].near - 1);
}

void karst_emit_place(karst_emit *emit, karst_expr e)
{
    const bool is_flat = karst_graph_image_axes(emit->graph, e) == 2;
    karst_text_add(&emit->text, "        noise_position q;\n");
    for (int i = 0; i < (is_flat ? 2 : 3); i++)
        coordinate(emit, e, i);
    if (is_flat && !emit->nodes[e].texture) /* which nobody asks for */
        karst_text_add(&emit->text, "        q.axis[2] = q.axis[1];\n");
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
