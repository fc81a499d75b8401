/* What only one side of a mix needs, left out where the whole packet has none of it.
 *
 * MIX(a, b, t) is fma(t, b, fma(-t, a, a)): where t is 0 it is a, whatever finite number b is, and where t is 1 it is
 * b. Of nodes that nothing else needs than the b of mixes by the same t, or than their a, the code is put under a test
 * of t, if noise is among them: that is what colours spend their time on, and ground that is all steep or all low is
 * common. A lane whose t is 0 takes 0 for b whether its neighbours needed b or not, and one whose t is 1 for a; so a
 * colour does not depend on neighbours.
 */
#include "producers/language/emit/emit_internal.h"

#include <stdlib.h>
#include <string.h>

#define ALWAYS KARST_NO_EXPR /* as t: needed whatever it is */

/* A side of the mixes by one t. */
typedef struct {
    karst_expr t;
    uint32_t side; /* 0: their a, left out where t is 1; 1: their b, left out where it is 0 */
} guard;

typedef struct {
    karst_emit *emit;
    guard *guard;  /* of each node: what it waits for */
    uint8_t *seen; /* 0: no user yet; of a node, and of the sides of a t, in bits: */
    uint8_t *has_noise, *begun, *done;
    uint8_t *apart; /* channels of a texture that do not wait for the same */
    bool failed;
    bool writes; /* else it is only tried whether there is an order */
} choices;

#define SIDE_BIT(side) ((uint8_t)(2u << (side)))

/* The t of a mix one side of which may be left out; ALWAYS: it is none. */
static karst_expr chooses_by(const karst_emit *emit, karst_expr e, uint32_t side)
{
    const karst_expr_node *n = &emit->graph->nodes[e];
    if (n->op != KARST_OP_MIX || n->type != KARST_TYPE_FLOAT || karst_emit_is_wide(emit, e))
        return ALWAYS;
    karst_expr what = n->arg[side], t = n->arg[2];
    if (n->arg[0] == n->arg[1] || what == t || emit->layout->is_known[what] || emit->layout->is_known[t] ||
        emit->graph->nodes[t].op == KARST_OP_CONSTANT || emit->graph->nodes[what].op == KARST_OP_CONSTANT ||
        emit->nodes[what].needs != KARST_PART_VALUE || emit->nodes[what].texture)
        return ALWAYS; /* textures see to it themselves (emit_texture.c) */
    return t;
}

static bool waits_for(const choices *c, karst_expr e, karst_expr t, uint32_t side)
{
    return t != ALWAYS && c->guard[e].t == t && c->guard[e].side == side;
}

/* Nodes that declare something for others, or share their code with others, stay where all can see them. */
static bool is_shared(const choices *c, karst_expr e)
{
    const karst_emit *emit = c->emit;
    bool is_noise = emit->graph->nodes[e].op == KARST_OP_NOISE;
    return emit->nodes[e].partner || c->apart[e] || (!is_noise && karst_takes_place(emit->layout, e, 0));
}

static void add_user(choices *c, karst_expr e, guard by)
{
    if (is_shared(c, e) || (c->seen[e] && !waits_for(c, e, by.t, by.side)))
        by.t = ALWAYS;
    c->guard[e] = by;
    c->seen[e] = 1;
}

/* Channels of a texture share their code. True: some do not wait for the same side, which is noted. */
static bool part_channels(choices *c)
{
    const karst_emit *emit = c->emit;
    bool found = false;
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        const karst_expr first = emit->nodes[e].texture;
        if (first && !c->apart[first] && !waits_for(c, e, c->guard[first].t, c->guard[first].side) &&
            (c->guard[e].t != ALWAYS || c->guard[first].t != ALWAYS))
            c->apart[first] = found = true;
    }
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].texture)
            c->apart[e] = c->apart[emit->nodes[e].texture];
    return found;
}

/* Users come after what they use, so one pass from the end tells. False: there is nothing to leave out. */
static bool find_guards_once(choices *c, const karst_expr *roots, size_t num_roots)
{
    const karst_emit *emit = c->emit;
    const uint32_t num_nodes = emit->graph->num_nodes;
    bool found = false;
    for (size_t i = 0; i < num_roots; i++)
        add_user(c, roots[i], (guard){ALWAYS, 0});
    for (karst_expr e = num_nodes - 1; e > 0; e--) {
        if (!emit->nodes[e].needs)
            continue;
        const karst_expr_node *n = &emit->graph->nodes[e];
        if (n->op == KARST_OP_NOISE && emit->graph->noises[n->extra].derivative)
            return false;
        const guard own = c->guard[e];
        karst_emit_input inputs[KARST_MAX_INPUTS];
        size_t num_inputs = karst_emit_inputs(emit, e, inputs);
        for (size_t i = 0; i < num_inputs; i++) {
            guard by = own;
            for (uint32_t side = 0; side < 2 && own.t == ALWAYS; side++)
                if (inputs[i].e == n->arg[side] && chooses_by(emit, e, side) != ALWAYS)
                    by = (guard){n->arg[2], side};
            add_user(c, inputs[i].e, by);
        }
        if (own.t != ALWAYS && n->op == KARST_OP_NOISE) {
            c->has_noise[own.t] |= SIDE_BIT(own.side);
            found = true;
        }
    }
    return found;
}

static bool find_guards(choices *c, const karst_expr *roots, size_t num_roots)
{
    const uint32_t num_nodes = c->emit->graph->num_nodes;
    bool found;
    do {
        memset(c->guard, 0, num_nodes * sizeof *c->guard);
        memset(c->seen, 0, num_nodes);
        memset(c->has_noise, 0, num_nodes);
        found = find_guards_once(c, roots, num_roots);
    } while (found && part_channels(c));
    for (karst_expr e = 1; e < num_nodes && found; e++)
        if (c->guard[e].t != ALWAYS && !(c->has_noise[c->guard[e].t] & SIDE_BIT(c->guard[e].side)))
            c->guard[e].t = ALWAYS;
    return found;
}

static void visit(choices *c, karst_expr e);

static void visit_inputs(choices *c, karst_expr e)
{
    karst_emit_input inputs[KARST_MAX_INPUTS];
    size_t num_inputs = karst_emit_inputs(c->emit, e, inputs);
    for (size_t i = 0; i < num_inputs; i++)
        if (c->guard[inputs[i].e].t == ALWAYS)
            visit(c, inputs[i].e);
}

/* All that waits for a side of t, under its test. */
static void visit_side(choices *c, karst_expr t, uint32_t side)
{
    const uint8_t bit = SIDE_BIT(side);
    const char letter = "ab"[side];
    karst_emit *emit = c->emit;
    const uint32_t num_nodes = emit->graph->num_nodes;
    karst_text *text = &emit->text;
    if (c->done[t] & bit)
        return;
    if (c->begun[t] & bit) { /* what waits for t needs a mix by t */
        c->failed = true;
        return;
    }
    c->begun[t] |= bit;
    visit(c, t);
    for (karst_expr e = 1; e < num_nodes && !c->failed; e++)
        if (emit->nodes[e].needs && waits_for(c, e, t, side))
            visit_inputs(c, e);
    c->done[t] |= bit;
    if (c->failed || !c->writes)
        return;
    uint8_t *is_side = calloc(num_nodes, 1);
    c->failed = !is_side;
    for (karst_expr e = 1; e < num_nodes && !c->failed; e++)
        if (emit->nodes[e].needs && c->guard[e].t == ALWAYS && chooses_by(emit, e, side) == t &&
            waits_for(c, emit->graph->nodes[e].arg[side], t, side))
            is_side[emit->graph->nodes[e].arg[side]] = 1;
    for (karst_expr e = 1; e < num_nodes && !c->failed; e++)
        if (is_side[e])
            karst_text_add(text, "    vfloat %c%u = (vfloat)(0.0f);\n", letter, e);
    karst_text_add(text, "    const vint m%c%u = v_ne(%s, (vfloat)(%u.0f));\n    if (v_any(m%c%u)) {\n", letter, t,
                   karst_emit_operand(emit, t).text, 1 - side, letter, t);
    for (karst_expr e = 1; e < num_nodes && !c->failed; e++)
        if (emit->nodes[e].needs && waits_for(c, e, t, side)) {
            karst_emit_lines(emit, e);
            if (is_side[e])
                karst_text_add(text, "    %c%u = v%u;\n", letter, e, e);
        }
    karst_text_add(text, "    }\n");
    for (karst_expr e = 1; e < num_nodes && !c->failed; e++)
        if (is_side[e])
            karst_text_add(text, "    const vfloat v%u = v_select(m%c%u, %c%u, (vfloat)(0.0f));\n", e, letter, t,
                           letter, e);
    free(is_side);
}

/* What e needs, and e. */
static void visit(choices *c, karst_expr e)
{
    if ((c->done[e] & 1) || c->failed)
        return;
    if (c->begun[e] & 1) {
        c->failed = true;
        return;
    }
    c->begun[e] |= 1;
    visit_inputs(c, e);
    karst_expr partner = c->emit->nodes[e].texture ? c->emit->nodes[e].texture : c->emit->nodes[e].partner;
    if (partner && partner < e)
        visit(c, partner); /* which has the code of all */
    for (uint32_t side = 0; side < 2; side++) {
        karst_expr t = chooses_by(c->emit, e, side);
        if (t != ALWAYS && waits_for(c, c->emit->graph->nodes[e].arg[side], t, side))
            visit_side(c, t, side);
    }
    c->done[e] |= 1;
    if (c->writes && !c->failed)
        karst_emit_lines(c->emit, e);
}

static void visit_all(choices *c, bool writes)
{
    const uint32_t num_nodes = c->emit->graph->num_nodes;
    memset(c->begun, 0, num_nodes);
    memset(c->done, 0, num_nodes);
    c->writes = writes;
    for (karst_expr e = 1; e < num_nodes && !c->failed; e++)
        if (c->emit->nodes[e].needs && c->guard[e].t == ALWAYS)
            visit(c, e);
}

bool karst_emit_choice_lines(karst_emit *emit, const karst_expr *roots, size_t num_roots)
{
    const uint32_t num_nodes = emit->graph->num_nodes;
    choices c = {.emit = emit, .guard = calloc(num_nodes, sizeof *c.guard)};
    uint8_t *bytes = calloc(num_nodes, 5);
    bool written = false;
    if (c.guard && bytes) {
        c.seen = bytes;
        c.has_noise = bytes + num_nodes;
        c.begun = bytes + 2 * (size_t)num_nodes;
        c.done = bytes + 3 * (size_t)num_nodes;
        c.apart = bytes + 4 * (size_t)num_nodes;
        if (find_guards(&c, roots, num_roots)) {
            visit_all(&c, false);
            written = !c.failed;
            if (written)
                visit_all(&c, true);
            emit->text.failed |= c.failed && written;
        }
    }
    free(c.guard);
    free(bytes);
    return written;
}
