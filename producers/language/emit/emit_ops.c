/* One node, one line. */
#include "producers/language/emit/emit_internal.h"

#include <stdio.h>

#include "core/device/dialect.h"

static const karst_expr_node *node_of(const karst_emit *emit, karst_expr e) { return &emit->graph->nodes[e]; }

/* ---- functions ---- */

/* How ops.clh ends a function's name by the type of its argument. */
static const char *type_suffix(uint8_t type)
{
    return type == KARST_TYPE_FLOAT ? "float" : type == KARST_TYPE_UINT ? "uint" : "int";
}

/* The function of ops.clh for a node. *swapped: its two arguments trade places. */
static void function_name(const karst_emit *emit, karst_expr e, char *name, size_t size_bytes, bool *swapped)
{
    const karst_expr_node *n = node_of(emit, e);
    uint8_t from = node_of(emit, n->arg[0])->type;
    const char *op = karst_op_name(n->op);
    *swapped = false;
    switch ((karst_op)n->op) {
    case KARST_OP_LENGTH:
        snprintf(name, size_bytes, "op_length%d", n->arg[3] ? 4 : n->arg[2] ? 3 : 2);
        break;
    case KARST_OP_LESS:
    case KARST_OP_LESS_EQUAL:
        *swapped = from == KARST_TYPE_BOOL; /* true is -1 */
        snprintf(name, size_bytes, "op_%s_%s", op, type_suffix(from));
        break;
    case KARST_OP_EQUAL:
    case KARST_OP_NOT_EQUAL:
        snprintf(name, size_bytes, "op_%s_%s", op, from == KARST_TYPE_FLOAT ? "float" : "int");
        break;
    case KARST_OP_SELECT:
        snprintf(name, size_bytes, "op_select_%s", n->type == KARST_TYPE_FLOAT ? "float" : "int");
        break;
    case KARST_OP_INT_DIVIDE:
    case KARST_OP_INT_MODULO:
        snprintf(name, size_bytes, "op_%s_%s", type_suffix(n->type),
                 n->op == KARST_OP_INT_DIVIDE ? "divide" : "modulo");
        break;
    case KARST_OP_SHIFT_RIGHT:
        snprintf(name, size_bytes, "op_%s_shift_right", type_suffix(n->type));
        break;
    case KARST_OP_CONVERT:
        if (n->type == KARST_TYPE_BOOL)
            snprintf(name, size_bytes, "op_%s_to_bool", from == KARST_TYPE_FLOAT ? "float" : "int");
        else if (from == KARST_TYPE_BOOL)
            snprintf(name, size_bytes, "op_bool_to_%s", n->type == KARST_TYPE_FLOAT ? "float" : "int");
        else if (from != KARST_TYPE_FLOAT && n->type != KARST_TYPE_FLOAT)
            snprintf(name, size_bytes, " "); /* int and uint have the same bits */
        else
            snprintf(name, size_bytes, "op_%s_to_%s", type_suffix(from), type_suffix(n->type));
        break;
    case KARST_OP_BITS:
        snprintf(name, size_bytes, "%s",
                 from == KARST_TYPE_FLOAT      ? "op_float_to_bits"
                 : n->type == KARST_TYPE_FLOAT ? "op_bits_to_float"
                                               : " ");
        break;
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
    case KARST_OP_MULTIPLY:
    case KARST_OP_DIVIDE:
    case KARST_OP_FMA:
    case KARST_OP_NEGATE:
    case KARST_OP_MIN:
    case KARST_OP_MAX:
    case KARST_OP_ABS:
    case KARST_OP_FLOOR:
    case KARST_OP_CEIL:
    case KARST_OP_RINT:
    case KARST_OP_FRACT:
    case KARST_OP_MOD:
    case KARST_OP_MIX:
    case KARST_OP_SQRT:
    case KARST_OP_SIN:
    case KARST_OP_COS:
    case KARST_OP_EXP2:
    case KARST_OP_LOG:
    case KARST_OP_ATAN:
    case KARST_OP_NOT:
    case KARST_OP_AND:
    case KARST_OP_OR:
    case KARST_OP_INT_ADD:
    case KARST_OP_INT_SUBTRACT:
    case KARST_OP_INT_MULTIPLY:
    case KARST_OP_BIT_AND:
    case KARST_OP_BIT_OR:
    case KARST_OP_BIT_XOR:
    case KARST_OP_BIT_NOT:
    case KARST_OP_SHIFT_LEFT:
        snprintf(name, size_bytes, "op_%s", op);
        break;
    case KARST_OP_NONE: /* operands, or lines of their own */
    case KARST_OP_CONSTANT:
    case KARST_OP_PARAMETER:
    case KARST_OP_POSITION:
    case KARST_OP_NORMAL:
    case KARST_OP_FOOTPRINT:
    case KARST_OP_AFFINE:
    case KARST_OP_SHIFTED:
    case KARST_OP_SIN_TURNS:
    case KARST_OP_COS_TURNS:
    case KARST_OP_NOISE:
    case KARST_OP_CELL:
    case KARST_NUM_OPS:
        snprintf(name, size_bytes, "op_%s", op);
        break;
    }
}

/* ---- places: affine arguments whose exact coordinate counts ---- */

static void cell_line(karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = node_of(emit, e), *a = node_of(emit, n->arg[0]);
    uint32_t word = emit->layout->word[e];
    int modulus = n->arg[1] ? (int)karst_graph_constant(emit->graph, n->arg[1])->numerator : 0;
    if (a->op == KARST_OP_SHIFTED)
        karst_text_add(&emit->text, "    const vint v%u = affine_cell_rest(affine_cell_shifted(c%u, %s, %u), %d);\n", e,
                       word, karst_emit_operand(emit, a->arg[1]).text, n->extra, modulus);
    else
        karst_text_add(&emit->text, "    const vint v%u = affine_cell_rest(affine_cell(c%u, %u), %d);\n", e, word,
                       n->extra, modulus);
}

static void place_lines(karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = node_of(emit, e);
    uint32_t word = emit->layout->word[e];
    bool shifted = node_of(emit, n->arg[0])->op == KARST_OP_SHIFTED;
    karst_text *text = &emit->text;
    karst_emit_declare_place(emit, e);
    if (n->op == KARST_OP_CELL) {
        cell_line(emit, e);
        return;
    }
    karst_operand offset = {""}, period = {""};
    if (shifted)
        offset = karst_emit_operand(emit, node_of(emit, n->arg[0])->arg[1]);
    if (n->op == KARST_OP_MOD)
        period = karst_emit_operand(emit, n->arg[1]);
    karst_text_add(text, "    const vfloat v%u = ", e);
    if (n->op == KARST_OP_SIN_TURNS || n->op == KARST_OP_COS_TURNS) {
        const char *function = n->op == KARST_OP_SIN_TURNS ? "affine_sin_turns" : "affine_cos_turns";
        if (shifted)
            karst_text_add(text, "%s(noise_coordinate_move(c%u, %s));\n", function, word, offset.text);
        else
            karst_text_add(text, "%s(c%u);\n", function, word);
    } else if (n->op == KARST_OP_MOD) {
        if (shifted)
            karst_text_add(text, "affine_mod_shifted(c%u, %s, %s);\n", word, offset.text, period.text);
        else
            karst_text_add(text, "affine_fract(c%u) * %s;\n", word, period.text);
    } else {
        const char *function = n->op == KARST_OP_FLOOR ? "affine_floor" : "affine_fract";
        if (shifted)
            karst_text_add(text, "%s_shifted(c%u, %s);\n", function, word, offset.text);
        else
            karst_text_add(text, "%s(c%u);\n", function, word);
    }
}

/* ---- lines ---- */

/* Without a second half: what wide_add_float and its kin take. */
static bool is_plain(const karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = node_of(emit, e);
    if (n->op == KARST_OP_CONSTANT)
        return karst_number_rest(*karst_graph_constant(emit->graph, e)) == 0.0f;
    return !emit->layout->is_known[e] && n->kind != KARST_KIND_WIDE && n->op != KARST_OP_AFFINE &&
           n->op != KARST_OP_SHIFTED;
}

/* A sum or difference of pairs, of which one may be a float: up to the semicolon. */
static void wide_sum(karst_emit *emit, karst_expr e, const char *op)
{
    const karst_expr *arg = node_of(emit, e)->arg;
    const bool first = is_plain(emit, arg[0]), second = is_plain(emit, arg[1]) && !first;
    karst_text_add(&emit->text, "wide_%s%s%s(%s, %s);\n", first ? "float_" : "", op, second ? "_float" : "",
                   (first ? karst_emit_operand : karst_emit_wide_operand)(emit, arg[0]).text,
                   (second ? karst_emit_operand : karst_emit_wide_operand)(emit, arg[1]).text);
}

/* A function and its arguments, up to the semicolon. */
static void call(karst_emit *emit, karst_expr e, const char *name, bool swapped, bool wide)
{
    const karst_expr_node *n = node_of(emit, e);
    karst_text_add(&emit->text, "%s(", name);
    for (int k = 0; k < 4 && n->arg[k]; k++) {
        karst_expr argument = n->arg[swapped ? 1 - k : k];
        bool is_float = node_of(emit, argument)->type == KARST_TYPE_FLOAT;
        karst_operand operand =
            wide && is_float ? karst_emit_wide_operand(emit, argument) : karst_emit_operand(emit, argument);
        karst_text_add(&emit->text, "%s%s", k ? ", " : "", operand.text);
    }
    karst_text_add(&emit->text, ");\n");
}

/* Declares h and l as the halves of w, which the text just defined. */
static void halves(karst_emit *emit, karst_expr e)
{
    karst_text_add(&emit->text, "    const vfloat h%u = w%u.hi, l%u = w%u.lo;\n", e, e, e, e);
}

static void wide_lines(karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = node_of(emit, e);
    char name[48];
    if (n->op == KARST_OP_LENGTH)
        snprintf(name, sizeof name, "wide_length%d", n->arg[3] ? 4 : n->arg[2] ? 3 : 2);
    else
        snprintf(name, sizeof name, "wide_%s", karst_op_name(n->op));
    bool is_pair = n->kind == KARST_KIND_WIDE;
    karst_text_add(&emit->text, "    const %s %c%u = ", is_pair ? "wide" : karst_emit_type(emit, e),
                   is_pair ? 'w' : 'v', e);
    if (n->op == KARST_OP_ADD || n->op == KARST_OP_SUBTRACT)
        wide_sum(emit, e, karst_op_name(n->op));
    else
        call(emit, e, name, false, true);
    if (is_pair)
        halves(emit, e);
}

/* An AFFINE or SHIFTED as float, as pair, or both. */
static void affine_lines(karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = node_of(emit, e);
    karst_text *text = &emit->text;
    uint8_t needs = emit->nodes[e].needs;
    if (needs & KARST_PART_VALUE) {
        karst_text_add(text, "    const vfloat v%u = ", e);
        if (n->op == KARST_OP_AFFINE)
            karst_text_add(text, "affine_float(&at, EMIT_LINEAR(data, %u));\n", emit->layout->word[e]);
        else
            call(emit, e, "op_add", false, false);
    }
    if (needs & KARST_PART_PAIR) {
        karst_text_add(text, "    const wide w%u = ", e);
        if (n->op == KARST_OP_AFFINE)
            karst_text_add(text, "wide_affine(&at, EMIT_LINEAR(data, %u));\n", emit->layout->word[e]);
        else
            wide_sum(emit, e, "add");
        halves(emit, e);
    }
}

void karst_emit_lines(karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = node_of(emit, e);
    if (n->op == KARST_OP_NOISE) {
        karst_emit_noise_lines(emit, e);
    } else if (karst_takes_place(emit->layout, e, 0)) {
        place_lines(emit, e);
    } else if (n->op == KARST_OP_AFFINE || n->op == KARST_OP_SHIFTED) {
        affine_lines(emit, e);
    } else if (karst_emit_is_wide(emit, e)) {
        wide_lines(emit, e);
    } else if (n->op == KARST_OP_FOOTPRINT) {
        karst_text_add(&emit->text, "    const vfloat v%u = (vfloat)(op_footprint(level, %d));\n", e,
                       (int)n->extra - KARST_FOOTPRINT_BIAS);
    } else if (n->op == KARST_OP_NORMAL) {
        karst_text_add(&emit->text, "    const vfloat v%u = facing[%u];\n", e, (unsigned)n->extra);
    } else {
        char name[48];
        bool swapped;
        function_name(emit, e, name, sizeof name, &swapped);
        karst_text_add(&emit->text, "    const %s v%u = ", karst_emit_type(emit, e), e);
        call(emit, e, name, swapped, false);
    }
}
