/* Materials of models as expressions: see producers/language/graph/materials.h.
 *
 * Nothing here compares: comparisons in what shades are widened by how steep their sides are, which is not known of all
 * densities. Weights are clamped ramps over the footprint instead. */
#include "producers/language/graph/materials.h"

#include <string.h>

/* A surface of the text's own lies nearer to its zero than so many footprints, and half a voxel. */
#define OWN_FOOTPRINTS 0.75
#define RAMP_FOOTPRINTS 0.25
#define OWN_VOXELS 0.5
/* Bounds of the slope of plain land that is flat, as shading has it (raycast/light/light.clh). */
#define STEEP 0.55
#define FLAT 0.85

typedef struct {
    karst_graph *graph;
    karst_expr footprint;
    double voxel_m;
} maker;

static karst_expr number(const maker *m, double value) { return karst_graph_float(m->graph, value); }
static karst_expr two(const maker *m, karst_op op, karst_expr a, karst_expr b)
{
    return karst_expr_2(m->graph, op, a, b);
}

static karst_expr unit_range(const maker *m, karst_expr e)
{
    return two(m, KARST_OP_MIN, two(m, KARST_OP_MAX, e, number(m, 0)), number(m, 1));
}

/* Footprints and voxels, as metres. */
static karst_expr length_of(const maker *m, double footprints, double voxels)
{
    return two(m, KARST_OP_ADD, two(m, KARST_OP_MULTIPLY, m->footprint, number(m, footprints)),
               number(m, voxels * m->voxel_m));
}

/* 0 up to a distance, 1 from a ramp's length beyond it on. */
static karst_expr ramp(const maker *m, karst_expr distance, double voxels)
{
    return unit_range(m, two(m, KARST_OP_DIVIDE, distance, length_of(m, RAMP_FOOTPRINTS, voxels)));
}

/* 1 in a material's box, 0 outside. */
static karst_expr in_box(const maker *m, const karst_model_material *of)
{
    karst_expr nearest = KARST_NO_EXPR;
    for (int side = 0; side < 3; side++) {
        karst_expr along = KARST_NO_EXPR;
        for (uint32_t axis = 0; axis < 3; axis++) {
            if (!(of->axes[side][axis] < 0 || of->axes[side][axis] > 0))
                continue;
            const karst_expr from = two(m, KARST_OP_SUBTRACT, karst_graph_leaf(m->graph, KARST_OP_POSITION, axis),
                                        karst_graph_number(m->graph, KARST_TYPE_FLOAT, of->at[axis]));
            const karst_expr part = two(m, KARST_OP_MULTIPLY, from, number(m, of->axes[side][axis]));
            along = along ? two(m, KARST_OP_ADD, along, part) : part;
        }
        const karst_expr half = two(m, KARST_OP_ADD, number(m, of->half_m[side] + of->margin_m), m->footprint);
        const karst_expr inside = two(m, KARST_OP_SUBTRACT, half, karst_expr_1(m->graph, KARST_OP_ABS, along));
        nearest = nearest ? two(m, KARST_OP_MIN, nearest, inside) : inside;
    }
    return ramp(m, nearest, OWN_VOXELS);
}

/* 1 where the text's own matter is not, 0 at its surface. */
static karst_expr away_from(const maker *m, karst_expr density)
{
    const karst_expr apart = two(m, KARST_OP_SUBTRACT, karst_expr_1(m->graph, KARST_OP_NEGATE, density),
                                 length_of(m, OWN_FOOTPRINTS, OWN_VOXELS));
    return ramp(m, apart, OWN_VOXELS);
}

/* How much of a place is the material's. */
static karst_expr weight_of(const maker *m, const karst_model_material *of, karst_expr density)
{
    if (of->is_everywhere)
        return number(m, 1);
    const karst_expr inside = in_box(m, of);
    return karst_graph_constant(m->graph, density) ? inside : two(m, KARST_OP_MULTIPLY, inside, away_from(m, density));
}

static karst_expr plain_colour(const maker *m, const float plain[2][3], int part)
{
    const karst_expr up = karst_graph_leaf(m->graph, KARST_OP_NORMAL, 1);
    const karst_expr t = unit_range(
        m, two(m, KARST_OP_DIVIDE, two(m, KARST_OP_SUBTRACT, up, number(m, STEEP)), number(m, FLAT - STEEP)));
    const karst_expr curve = two(m, KARST_OP_SUBTRACT, number(m, 3), two(m, KARST_OP_MULTIPLY, number(m, 2), t));
    const karst_expr share = two(m, KARST_OP_MULTIPLY, two(m, KARST_OP_MULTIPLY, t, t), curve);
    return karst_expr_3(m->graph, KARST_OP_MIX, number(m, (double)plain[0][part]), number(m, (double)plain[1][part]),
                        share);
}

/* What a text that gives none of an output says of it. */
static karst_expr usual(const maker *m, const float plain[2][3], karst_output output, int part)
{
    return output == KARST_OUTPUT_COLOUR ? plain_colour(m, plain, part) : number(m, karst_outputs[output].usual);
}

void karst_add_materials(karst_graph *graph, int voxel_log2_m, karst_expr root[KARST_NUM_ROOTS],
                         const float plain[2][3], const karst_model_material *materials, size_t num)
{
    maker m = {.graph = graph, .footprint = karst_graph_footprint(graph, voxel_log2_m)};
    m.voxel_m = voxel_log2_m < 0 ? 1.0 / (double)(1ull << -voxel_log2_m) : (double)(1ull << voxel_log2_m);
    /* Of a surface there is a colour, whatever else there is. */
    bool is_needed[2][KARST_NUM_OUTPUTS] = {{false}};
    for (size_t i = 0; i < num; i++)
        for (int o = KARST_OUTPUT_COLOUR; o <= KARST_OUTPUT_TRANSPARENCY; o++)
            if (materials[i].has[o])
                is_needed[materials[i].is_clear][o] = is_needed[materials[i].is_clear][KARST_OUTPUT_COLOUR] = true;
    for (int clear = 0; clear < 2; clear++) {
        const karst_expr density = root[clear ? KARST_ROOT_CLEAR : KARST_ROOT_DENSITY];
        const uint32_t first = clear ? KARST_ROOT_CLEAR_COLOUR : KARST_ROOT_COLOUR;
        for (int o = KARST_OUTPUT_COLOUR; o <= KARST_OUTPUT_TRANSPARENCY; o++)
            for (uint32_t part = 0; is_needed[clear][o] && part < karst_outputs[o].num_floats; part++) {
                karst_expr *to = &root[first + karst_outputs[o].root + part - KARST_ROOT_COLOUR];
                *to = *to ? *to : usual(&m, plain, (karst_output)o, (int)part);
                for (size_t i = 0; i < num; i++)
                    if (materials[i].is_clear == (clear != 0) && materials[i].has[o])
                        *to = karst_expr_3(graph, KARST_OP_MIX, *to,
                                           number(&m, materials[i].value[karst_outputs[o].root + part]),
                                           weight_of(&m, &materials[i], density));
            }
    }
}
