/* Where a line reads its arguments: values, numbers, places. */
#include "producers/language/emit/emit_internal.h"

#include <stdio.h>

#include "core/device/dialect.h"

static const karst_expr_node *node_of(const karst_emit *emit, karst_expr e) { return &emit->graph->nodes[e]; }

const char *karst_emit_type(const karst_emit *emit, karst_expr e)
{
    return node_of(emit, e)->type == KARST_TYPE_FLOAT ? "vfloat" : "vint";
}

/* ---- operands ---- */

/* Hexadecimal by hand: a locale has no say in it. */
static void float_literal(float value, char *text, size_t size_bytes)
{
    uint32_t bits = k_as_uint(value), mantissa = bits & 0x7fffffu;
    int exponent = (int)(bits >> 23 & 255u);
    const char *sign = bits >> 31 ? "-" : "";
    if (exponent == 255)
        snprintf(text, size_bytes, "(vfloat)(k_as_float(0x%08xu))", (unsigned)bits);
    else if (exponent == 0)
        snprintf(text, size_bytes, "(vfloat)(%s0x0.%06xp-126f)", sign, (unsigned)(mantissa << 1));
    else
        snprintf(text, size_bytes, "(vfloat)(%s0x1.%06xp%+df)", sign, (unsigned)(mantissa << 1), exponent - 127);
}

static karst_operand constant(const karst_emit *emit, karst_expr e)
{
    karst_operand operand;
    const karst_number *number = karst_graph_constant(emit->graph, e);
    uint8_t type = node_of(emit, e)->type;
    if (type == KARST_TYPE_FLOAT)
        float_literal(karst_number_to_float(*number), operand.text, sizeof operand.text);
    else if (type == KARST_TYPE_BOOL)
        snprintf(operand.text, sizeof operand.text, "(vint)(%d)", number->numerator ? -1 : 0);
    else
        snprintf(operand.text, sizeof operand.text, "(vint)((int)0x%08xu)", (unsigned)(uint32_t)number->numerator);
    return operand;
}

/* A part of a value: this block's own, or one of fewer axes that another block kept. Lanes along its first axis are
 * read as they are, if they are this block's too; otherwise the block's lanes share one of them. */
static karst_operand part(const karst_emit *emit, karst_expr e, char letter)
{
    karst_operand operand;
    uint8_t axes = emit->nodes[e].axes, here = emit->block.axes;
    const char *name = karst_emit_axes_name(axes);
    bool is_float = node_of(emit, e)->type == KARST_TYPE_FLOAT;
    uint8_t first = axes & (uint8_t)-axes, lanes = here & (uint8_t)-here;
    const char *plane = axes == (KARST_DEPENDS_X | KARST_DEPENDS_Y) ? "[iy]" : "";
    if (emit->block.is_point || emit->block.is_sample || axes == here)
        snprintf(operand.text, sizeof operand.text, "%c%u", letter, e);
    else if (!axes)
        snprintf(operand.text, sizeof operand.text, "axes->%s%c%u", name, letter, e);
    else if (first == lanes)
        snprintf(operand.text, sizeof operand.text, "axes->%s%c%u%s[c]", name, letter, e, plane);
    else
        snprintf(operand.text, sizeof operand.text, "(%s)(%s(axes->%s%c%u, %s))", is_float ? "vfloat" : "vint",
                 is_float ? "EMIT_ONE_FLOAT" : "EMIT_ONE_INT", name, letter, e, first == KARST_DEPENDS_Y ? "iy" : "iz");
    return operand;
}

karst_operand karst_emit_operand(const karst_emit *emit, karst_expr e)
{
    karst_operand operand;
    const karst_world_layout *layout = emit->layout;
    if (node_of(emit, e)->op == KARST_OP_CONSTANT)
        return constant(emit, e);
    if (!layout->is_known[e])
        return part(emit, e, node_of(emit, e)->kind == KARST_KIND_WIDE ? 'h' : 'v');
    bool is_float = node_of(emit, e)->type == KARST_TYPE_FLOAT;
    snprintf(operand.text, sizeof operand.text, "(%s)(%s(data, %u, %u))", is_float ? "vfloat" : "vint",
             is_float ? "EMIT_FLOAT" : "EMIT_INT", layout->values_word, layout->word[e]);
    return operand;
}

static karst_operand pair_of(const char *hi, const char *lo)
{
    karst_operand pair;
    snprintf(pair.text, sizeof pair.text, "wide_of(%.70s, %.70s)", hi, lo);
    return pair;
}

karst_operand karst_emit_wide_operand(const karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = node_of(emit, e);
    const karst_world_layout *layout = emit->layout;
    karst_operand value = karst_emit_operand(emit, e), rest;
    if (n->op == KARST_OP_CONSTANT) {
        float_literal(karst_number_rest(*karst_graph_constant(emit->graph, e)), rest.text, sizeof rest.text);
        return pair_of(value.text, rest.text);
    }
    if (layout->is_known[e]) {
        snprintf(rest.text, sizeof rest.text, "(vfloat)(EMIT_FLOAT(data, %u, %u))", layout->values_word,
                 layout->num_values + layout->word[e]);
        return pair_of(value.text, rest.text);
    }
    if (n->kind == KARST_KIND_WIDE || n->op == KARST_OP_AFFINE || n->op == KARST_OP_SHIFTED)
        return pair_of(part(emit, e, 'h').text, part(emit, e, 'l').text);
    snprintf(rest.text, sizeof rest.text, "wide_from(%.100s)", value.text);
    return rest;
}

/* ---- places: affine arguments whose exact coordinate counts ---- */

static bool is_turns(const karst_emit *emit, karst_expr e)
{
    return node_of(emit, e)->op == KARST_OP_SIN_TURNS || node_of(emit, e)->op == KARST_OP_COS_TURNS;
}

uint8_t karst_emit_place_axis(const karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = node_of(emit, e);
    if (n->op == KARST_OP_NOISE || !karst_takes_place(emit->layout, e, 0))
        return 0;
    uint8_t axes = node_of(emit, karst_affine_behind(emit->graph, n->arg[0]))->depends & KARST_AXES;
    return axes & (axes - 1) ? 0 : axes;
}

const char *karst_emit_place_type(const karst_emit *emit, karst_expr e)
{
    return is_turns(emit, e) ? "noise_coordinate" : "affine_place";
}

bool karst_emit_is_new_place(karst_emit *emit, karst_expr e)
{
    uint32_t word = emit->layout->word[e];
    bool is_new = emit->placed[word] != emit->serial;
    emit->placed[word] = emit->serial;
    return is_new;
}

void karst_emit_declare_place(karst_emit *emit, karst_expr e)
{
    uint8_t axis = karst_emit_place_axis(emit, e), here = emit->block.axes;
    uint32_t word = emit->layout->word[e];
    const char *type = karst_emit_place_type(emit, e);
    if (!karst_emit_is_new_place(emit, e))
        return;
    karst_text_add(&emit->text, "    const %s c%u = ", type, word);
    if (axis && !emit->block.is_point && axis != here && (!emit->block.is_sample || axis != KARST_DEPENDS_X)) {
        if (emit->block.is_sample)
            karst_text_add(&emit->text, "emit_%ss(axes->%sc%u, i%s);\n", type, karst_emit_axes_name(axis), word,
                           karst_emit_axes_name(axis));
        else if (axis == (here & (uint8_t)-here))
            karst_text_add(&emit->text, "axes->%sc%u[c];\n", karst_emit_axes_name(axis), word);
        else
            karst_text_add(&emit->text, "emit_one_%s(axes->%sc%u, %s);\n", type, karst_emit_axes_name(axis), word,
                           axis == KARST_DEPENDS_Y ? "iy" : "iz");
    } else if (is_turns(emit, e)) {
        karst_text_add(&emit->text, "affine_coordinate(&at, EMIT_LATTICE(data, %u));\n", word);
    } else {
        karst_text_add(&emit->text, "affine_cells(&at, EMIT_CELLS(data, %u));\n", word);
    }
}
