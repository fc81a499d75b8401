/* What instructions are made of: operands, constants, parts of nodes. */
#include "producers/language/tape/tape_internal.h"

static bool is_pair(const karst_tape_builder *b, karst_expr e) { return b->graph->nodes[e].kind == KARST_KIND_WIDE; }

bool karst_tape_is_wide(const karst_tape_builder *b, karst_expr e) { return karst_is_computed_wide(b->graph, e); }

karst_expr karst_tape_reads(const karst_tape_builder *b, karst_expr e, int k)
{
    karst_expr argument = b->graph->nodes[e].arg[k];
    if (!argument || !karst_takes_place(b->layout, e, k))
        return argument;
    const karst_expr_node *n = &b->graph->nodes[argument];
    return n->op == KARST_OP_SHIFTED ? n->arg[1] : KARST_NO_EXPR;
}

int karst_tape_part(const karst_tape_builder *b, karst_expr argument, bool as_pair)
{
    uint8_t op = b->graph->nodes[argument].op;
    return is_pair(b, argument) || (as_pair && (op == KARST_OP_AFFINE || op == KARST_OP_SHIFTED)) ? PART_PAIR
                                                                                                  : PART_VALUE;
}

static bool is_number(const karst_tape_builder *b, karst_expr e, float value)
{
    const karst_expr_node *n = &b->graph->nodes[e];
    return n->op == KARST_OP_CONSTANT && n->type == KARST_TYPE_FLOAT &&
           karst_number_to_float(*karst_graph_constant(b->graph, e)) == value;
}

karst_expr karst_tape_fades(const karst_tape_builder *b, karst_expr e)
{
    const karst_expr_node *nodes = b->graph->nodes, *n = &nodes[e];
    if (n->op != KARST_OP_MULTIPLY || n->type != KARST_TYPE_FLOAT || karst_tape_is_wide(b, e))
        return KARST_NO_EXPR;
    for (int k = 0; k < 2; k++) {
        const karst_expr_node *square = &nodes[n->arg[k]], *line = &nodes[n->arg[1 - k]];
        karst_expr t = square->arg[0];
        if (square->op != KARST_OP_MULTIPLY || square->arg[1] != t || line->op != KARST_OP_FMA || is_pair(b, t) ||
            karst_tape_is_wide(b, n->arg[k]) || karst_tape_is_wide(b, n->arg[1 - k]) || b->layout->is_known[t] ||
            !is_number(b, line->arg[2], 3))
            continue;
        if ((line->arg[0] == t && is_number(b, line->arg[1], -2)) ||
            (line->arg[1] == t && is_number(b, line->arg[0], -2)))
            return t;
    }
    return KARST_NO_EXPR;
}

static uint32_t bits_of(const karst_number *number, uint8_t type)
{
    if (type == KARST_TYPE_FLOAT)
        return k_as_uint(karst_number_to_float(*number));
    if (type == KARST_TYPE_BOOL)
        return number->numerator ? 0xffffffffu : 0;
    return (uint32_t)number->numerator;
}

static uint32_t constant_operand(karst_tape_builder *b, karst_expr e, bool as_pair)
{
    const karst_expr_node *n = &b->graph->nodes[e];
    const karst_number *number = karst_graph_constant(b->graph, e);
    karst_tape *tape = b->tape;
    if (!b->constant[e][as_pair]) {
        b->constant[e][as_pair] = tape->num_constants + 1;
        tape->constants[tape->num_constants++] = bits_of(number, n->type);
        if (as_pair)
            tape->constants[tape->num_constants++] = k_as_uint(karst_number_rest(*number));
    }
    return TAPE_CONSTANT | (as_pair ? TAPE_PAIR : 0) | (b->constant[e][as_pair] - 1);
}

uint32_t karst_tape_operand(karst_tape_builder *b, karst_expr e, bool as_pair)
{
    const karst_expr_node *n = &b->graph->nodes[e];
    if (!e)
        return TAPE_NOTHING;
    bool of_floats = as_pair && n->type == KARST_TYPE_FLOAT;
    if (n->op == KARST_OP_CONSTANT)
        return constant_operand(b, e, of_floats);
    if (b->layout->is_known[e])
        return TAPE_VALUE | (of_floats ? TAPE_PAIR : 0) | b->layout->word[e];
    int part = karst_tape_part(b, e, as_pair);
    return (part == PART_PAIR ? TAPE_PAIR : 0) | b->slot[e][part];
}

/* ---- ops ---- */

enum { TAPE_NO_OP = 0 }; /* of what never stands in a tape as it is */
#define PLAIN_OP(id, name, least, most, class, tape) TAPE_##tape,
static const uint8_t plain_ops[KARST_NUM_OPS] = {KARST_OPS(PLAIN_OP)};

uint8_t karst_tape_plain_op(const karst_tape_builder *b, karst_expr e) { return plain_ops[b->graph->nodes[e].op]; }

karst_instruction *karst_tape_append(karst_tape_builder *b, karst_instruction i)
{
    karst_tape *tape = b->tape;
    if (i.op != TAPE_CURVE) {
        bool is_wide_op = (i.flags & TAPE_IS_WIDE) != 0;
        (is_wide_op ? tape->wide_ops : tape->ops)[i.op / 32] |= 1u << i.op % 32;
    }
    tape->has_steps |= i.op != TAPE_CURVE && (i.flags & TAPE_IS_STEPS) != 0;
    tape->code[tape->num_instructions] = i;
    return &tape->code[tape->num_instructions++];
}
