/* Curves of a tape: where one number decides another by a chain of ops, and bounding the chain as one is worth it. See
 * tape_curve.clh. */
#include <string.h>

#include "producers/language/tape/tape_internal.h"

#define BORDER_MODULO 2u /* words of a curve beyond its chain: a place's FRACT, and what MOD scales it by */

static bool is_known(const karst_tape_builder *b, karst_expr e) { return b->layout->is_known[e] != 0; }

/* FRACT or MOD of an exact place: as a source, the place in cells is meant. */
static bool is_place(const karst_tape_builder *b, karst_expr e)
{
    uint8_t op = b->graph->nodes[e].op;
    return (op == KARST_OP_FRACT || op == KARST_OP_MOD) && karst_takes_place(b->layout, e, 0);
}

static bool may_be_in_chain(const karst_tape_builder *b, karst_expr e)
{
    switch (b->graph->nodes[e].op) {
    case KARST_OP_AFFINE:
    case KARST_OP_NORMAL:
    case KARST_OP_FOOTPRINT:
    case KARST_OP_SHIFTED:
    case KARST_OP_NOISE:
    case KARST_OP_SIN_TURNS:
    case KARST_OP_COS_TURNS:
        return false;
    default:
        return !karst_takes_place(b->layout, e, 0) && !karst_tape_is_wide(b, e);
    }
}

static karst_expr source_of(const karst_tape_builder *b, karst_expr e)
{
    const karst_expr_node *nodes = b->graph->nodes;
    karst_expr source = KARST_NO_EXPR;
    if (!may_be_in_chain(b, e))
        return e;
    for (int k = 0; k < 4; k++) {
        karst_expr argument = nodes[e].arg[k];
        if (!argument || is_known(b, argument))
            continue;
        if (source && b->source[argument] != source)
            return e;
        source = b->source[argument];
    }
    bool fits = source && nodes[source].type == KARST_TYPE_FLOAT && karst_tape_part(b, source, false) == PART_VALUE;
    return fits ? source : e;
}

static bool is_whole(uint8_t op) { return op == KARST_OP_FLOOR || op == KARST_OP_FRACT || op == KARST_OP_MOD; }

/* The nodes from the source, without it, to `e`, in order. 0: too many. */
static uint32_t chain_of(const karst_tape_builder *b, karst_expr e, karst_expr chain[TAPE_CURVE_MOST])
{
    uint32_t count = 1;
    chain[0] = e;
    for (uint32_t i = 0; i < count; i++) { /* each is added once, so this ends */
        for (int k = 0; k < 4; k++) {
            karst_expr argument = b->graph->nodes[chain[i]].arg[k];
            uint32_t n = 0;
            if (!argument || is_known(b, argument) || argument == b->source[e])
                continue;
            while (n < count && chain[n] != argument)
                n++;
            if (n < count)
                continue;
            if (count == TAPE_CURVE_MOST)
                return 0;
            chain[count++] = argument;
        }
    }
    for (uint32_t i = 1; i < count; i++) {
        karst_expr one = chain[i];
        uint32_t n = i;
        for (; n > 0 && chain[n - 1] > one; n--)
            chain[n] = chain[n - 1];
        chain[n] = one;
    }
    return count;
}

/* Ops of the chain that read `argument`; one that reads it twice, or as the t of a fade, has a rule for that. */
static uint32_t readers_in(const karst_tape_builder *b, const karst_expr *chain, uint32_t count, karst_expr argument)
{
    uint32_t readers = 0, of_fades = 0;
    for (uint32_t i = 0; i < count; i++) {
        const karst_expr_node *n = &b->graph->nodes[chain[i]];
        readers += n->arg[0] == argument || n->arg[1] == argument || n->arg[2] == argument || n->arg[3] == argument;
        of_fades += karst_tape_fades(b, chain[i]) == argument;
    }
    return readers - of_fades; /* a fade's square and line, but not the fade itself */
}

/* Worth it where a step may be split, or what is read twice may cancel. */
static bool is_worth_it(const karst_tape_builder *b, karst_expr e, const karst_expr *chain, uint32_t count)
{
    bool is_stepped = is_place(b, b->source[e]);
    uint32_t most = readers_in(b, chain, count, b->source[e]);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t readers = readers_in(b, chain, count, chain[i]);
        most = readers > most ? readers : most;
        is_stepped = is_stepped || is_whole(b->graph->nodes[chain[i]].op);
    }
    return count > 1 && (most > 1 || is_stepped);
}

karst_expr karst_tape_curve_reads(const karst_tape_builder *b, karst_expr e)
{
    if (b->is_curve[e] != 1)
        return KARST_NO_EXPR;
    karst_expr source = b->source[e];
    return is_place(b, source) ? karst_tape_reads(b, source, 0) : source;
}

static void see(karst_tape_builder *b, karst_expr argument)
{
    if (argument)
        b->is_seen[argument] = 1;
}

void karst_tape_find_curves(karst_tape_builder *b, const karst_expr *roots, uint32_t num_roots)
{
    const karst_graph *graph = b->graph;
    karst_expr chain[TAPE_CURVE_MOST];
    for (karst_expr e = 1; e < graph->num_nodes; e++) {
        b->source[e] = is_known(b, e) ? KARST_NO_EXPR : source_of(b, e);
        for (int k = 0; k < 4 && b->source[e] == e; k++)
            b->is_curve[graph->nodes[e].arg[k]] = 2;
    }
    for (uint32_t i = 0; i < num_roots; i++) {
        b->is_curve[roots[i]] = 2;
        b->is_seen[roots[i]] = 1;
    }
    for (karst_expr e = graph->num_nodes - 1; e > 0; e--) {
        bool may_be = b->is_curve[e] == 2 && b->is_seen[e] && !is_known(b, e) && b->source[e] != e &&
                      graph->nodes[e].type == KARST_TYPE_FLOAT;
        uint32_t count = may_be ? chain_of(b, e, chain) : 0;
        if (count > 0 && is_worth_it(b, e, chain, count) && b->num_curve_code + count < graph->num_nodes) {
            b->is_curve[e] = 1;
            b->num_curve_code += count + BORDER_MODULO + 1;
            karst_expr read = karst_tape_curve_reads(b, e);
            int part = karst_tape_part(b, read, false);
            see(b, read);
            b->needed[read][part] = 1;
            if (b->last_use[read][part] < e)
                b->last_use[read][part] = e;
            continue;
        }
        b->is_curve[e] = 0;
        bool is_smooth = b->smooth[e].a != KARST_NO_EXPR;
        if (is_smooth && b->is_seen[e]) {
            see(b, b->smooth[e].a);
            see(b, b->smooth[e].b);
        }
        for (int k = 0; k < 4 && b->is_seen[e] && !is_smooth; k++)
            see(b, karst_tape_reads(b, e, k));
        if (b->is_seen[e])
            see(b, karst_tape_fades(b, e));
    }
}

/* ---- code ---- */

static uint32_t curve_slot(karst_tape_builder *b, uint32_t n)
{
    if (n >= b->num_curve_slots)
        b->curve_slot[b->num_curve_slots++] = b->tape->num_slots++;
    return b->curve_slot[n];
}

static karst_instruction two_arguments(uint8_t op, uint32_t slot, uint32_t x, uint32_t y)
{
    return (karst_instruction){.op = op,
                               .type = TAPE_FLOAT_TYPE,
                               .argument_type = TAPE_FLOAT_TYPE,
                               .flags = TAPE_IN_CURVE,
                               .slot = slot,
                               .arg = {x, y, TAPE_NOTHING, TAPE_NOTHING},
                               .word = KARST_NO_WORD};
}

void karst_tape_add_curve(karst_tape_builder *b, karst_expr e)
{
    const karst_expr_node *nodes = b->graph->nodes;
    karst_expr source = b->source[e], chain[TAPE_CURVE_MOST], divisor = KARST_NO_EXPR;
    uint32_t count = chain_of(b, e, chain), num_slots = 0, num_code = 0, line = curve_slot(b, num_slots++), at = line,
             slots[TAPE_CURVE_MOST];
    if (is_place(b, source)) {
        at = curve_slot(b, num_slots++);
        karst_tape_append(b, two_arguments(TAPE_FRACT, at, line, TAPE_NOTHING));
        num_code++;
        if (nodes[source].op == KARST_OP_MOD) {
            divisor = nodes[source].arg[1];
            uint32_t part = at;
            at = curve_slot(b, num_slots++);
            karst_tape_append(b, two_arguments(TAPE_MULTIPLY, at, part, karst_tape_operand(b, divisor, false)));
            num_code++;
        }
    }
    for (uint32_t i = 0; i < count; i++) {
        const karst_expr_node *n = &nodes[chain[i]];
        karst_expr t = karst_tape_fades(b, chain[i]), reads[4] = {n->arg[0], n->arg[1], t ? t : n->arg[2], n->arg[3]};
        slots[i] = curve_slot(b, num_slots++);
        karst_instruction op = two_arguments(karst_tape_plain_op(b, chain[i]), slots[i], TAPE_NOTHING, TAPE_NOTHING);
        op.type = n->type;
        op.argument_type = nodes[n->arg[0]].type;
        op.flags |= (uint8_t)((n->kind == KARST_KIND_STEPS ? TAPE_IS_STEPS : 0) | (t ? TAPE_IS_FADE : 0));
        for (int k = 0; k < 4; k++) {
            uint32_t k_in_chain = 0;
            op.count += n->arg[k] != 0;
            if (!reads[k] || is_known(b, reads[k])) {
                op.arg[k] = karst_tape_operand(b, reads[k], false);
                continue;
            }
            while (k_in_chain < i && chain[k_in_chain] != reads[k])
                k_in_chain++;
            op.arg[k] = reads[k] == source ? at : slots[k_in_chain];
        }
        karst_tape_append(b, op);
        num_code++;
    }
    karst_expr read = karst_tape_curve_reads(b, e);
    karst_instruction head =
        two_arguments(TAPE_CURVE, line, read ? karst_tape_operand(b, read, false) : TAPE_NOTHING, slots[count - 1]);
    head.arg[2] = divisor ? karst_tape_operand(b, divisor, false) : TAPE_NOTHING;
    head.word = is_place(b, source) ? b->layout->word[source] : TAPE_NOTHING;
    head.count = num_code;
    karst_tape_append(b, head);
    b->tape->has_curves = true;
}
