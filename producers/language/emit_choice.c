/* What only one side of a mix needs, left out where the whole packet has none of it.
 *
 * MIX(a, b, t) is fma(t, b - a, a): where t is 0 it is a, whatever finite number b is. Of nodes that nothing else needs
 * than the b of mixes by the same t, the code is put under a test of t, if noise is among them: that is what colours
 * spend their time on, and ground that is all steep or all low is common. A lane whose t is 0 takes 0 for b whether its
 * neighbours needed b or not; so a colour does not depend on neighbours.
 */
#include "producers/language/emit_internal.h"

#include <stdlib.h>
#include <string.h>

#define ALWAYS KARST_NO_EXPR /* as guard: needed whatever t is */

typedef struct {
    karst_emit *emit;
    karst_expr *guard; /* of each node: the t that it waits for, or ALWAYS */
    uint8_t *seen;     /* 0: no user yet; of a t: */
    uint8_t *has_noise, *begun, *done;
    bool failed;
    bool writes; /* else it is only tried whether there is an order */
} choices;

/* The t of a mix whose b may be left out; ALWAYS: it is none. */
static karst_expr chooses_by(const karst_emit *emit, karst_expr e)
{
    const karst_expr_node *n = &emit->graph->nodes[e], *b = &emit->graph->nodes[n->arg[1]];
    bool is_mix = n->op == KARST_OP_MIX && n->type == KARST_TYPE_FLOAT && !karst_emit_is_wide(emit, e);
    if (!is_mix || n->arg[1] == n->arg[0] || n->arg[1] == n->arg[2] || emit->layout->is_known[n->arg[1]] ||
        emit->layout->is_known[n->arg[2]] || emit->graph->nodes[n->arg[2]].op == KARST_OP_CONSTANT ||
        b->op == KARST_OP_CONSTANT || emit->nodes[n->arg[1]].needs != KARST_PART_VALUE)
        return ALWAYS;
    return n->arg[2];
}

/* Nodes that declare something for others, or share their code with others, stay where all can see them. */
static bool is_shared(const karst_emit *emit, karst_expr e)
{
    bool is_noise = emit->graph->nodes[e].op == KARST_OP_NOISE;
    return emit->nodes[e].partner || (!is_noise && karst_takes_place(emit->layout, e, 0));
}

static void add_user(choices *c, karst_expr e, karst_expr guard)
{
    if (is_shared(c->emit, e) || (c->seen[e] && c->guard[e] != guard))
        guard = ALWAYS;
    c->guard[e] = guard;
    c->seen[e] = 1;
}

/* Users come after what they use, so one pass from the end tells. False: there is nothing to leave out. */
static bool find_guards(choices *c, const karst_expr *roots, size_t num_roots)
{
    const karst_emit *emit = c->emit;
    const uint32_t num_nodes = emit->graph->num_nodes;
    bool found = false;
    for (size_t i = 0; i < num_roots; i++)
        add_user(c, roots[i], ALWAYS);
    for (karst_expr e = num_nodes - 1; e > 0; e--) {
        if (!emit->nodes[e].needs)
            continue;
        const karst_expr_node *n = &emit->graph->nodes[e];
        if (n->op == KARST_OP_NOISE && emit->graph->noises[n->extra].derivative)
            return false;
        karst_expr t = c->guard[e] == ALWAYS ? chooses_by(emit, e) : ALWAYS;
        karst_emit_input inputs[KARST_MAX_INPUTS];
        size_t num_inputs = karst_emit_inputs(emit, e, inputs);
        for (size_t i = 0; i < num_inputs; i++)
            add_user(c, inputs[i].e, t != ALWAYS && inputs[i].e == n->arg[1] ? t : c->guard[e]);
        if (c->guard[e] != ALWAYS && n->op == KARST_OP_NOISE)
            c->has_noise[c->guard[e]] = found = true;
    }
    for (karst_expr e = 1; e < num_nodes; e++)
        if (c->guard[e] != ALWAYS && !c->has_noise[c->guard[e]])
            c->guard[e] = ALWAYS;
    return found;
}

static void visit(choices *c, karst_expr e);

static void visit_inputs(choices *c, karst_expr e)
{
    karst_emit_input inputs[KARST_MAX_INPUTS];
    size_t num_inputs = karst_emit_inputs(c->emit, e, inputs);
    for (size_t i = 0; i < num_inputs; i++)
        if (c->guard[inputs[i].e] == ALWAYS)
            visit(c, inputs[i].e);
}

/* All that waits for t, under its test. */
static void visit_side(choices *c, karst_expr t)
{
    karst_emit *emit = c->emit;
    const uint32_t num_nodes = emit->graph->num_nodes;
    karst_text *text = &emit->text;
    if (c->done[t] & 2)
        return;
    if (c->begun[t] & 2) { /* what waits for t needs a mix by t */
        c->failed = true;
        return;
    }
    c->begun[t] |= 2;
    visit(c, t);
    for (karst_expr e = 1; e < num_nodes && !c->failed; e++)
        if (emit->nodes[e].needs && c->guard[e] == t)
            visit_inputs(c, e);
    c->done[t] |= 2;
    if (c->failed || !c->writes)
        return;
    uint8_t *is_side = calloc(num_nodes, 1);
    c->failed = !is_side;
    for (karst_expr e = 1; e < num_nodes && !c->failed; e++)
        if (emit->nodes[e].needs && c->guard[e] == ALWAYS && chooses_by(emit, e) == t &&
            c->guard[emit->graph->nodes[e].arg[1]] == t)
            is_side[emit->graph->nodes[e].arg[1]] = 1;
    for (karst_expr e = 1; e < num_nodes && !c->failed; e++)
        if (is_side[e])
            karst_text_add(text, "    vfloat b%u = (vfloat)(0.0f);\n", e);
    karst_text_add(text, "    const vint m%u = v_ne(%s, (vfloat)(0.0f));\n    if (v_any(m%u)) {\n", t,
                   karst_emit_operand(emit, t).text, t);
    for (karst_expr e = 1; e < num_nodes && !c->failed; e++)
        if (emit->nodes[e].needs && c->guard[e] == t) {
            karst_emit_lines(emit, e);
            if (is_side[e])
                karst_text_add(text, "    b%u = v%u;\n", e, e);
        }
    karst_text_add(text, "    }\n");
    for (karst_expr e = 1; e < num_nodes && !c->failed; e++)
        if (is_side[e])
            karst_text_add(text, "    const vfloat v%u = v_select(m%u, b%u, (vfloat)(0.0f));\n", e, t, e);
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
    karst_expr partner = c->emit->nodes[e].partner;
    if (partner && partner < e)
        visit(c, partner); /* which has the code of both */
    karst_expr t = chooses_by(c->emit, e);
    if (t != ALWAYS && c->guard[c->emit->graph->nodes[e].arg[1]] == t)
        visit_side(c, t);
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
        if (c->emit->nodes[e].needs && c->guard[e] == ALWAYS)
            visit(c, e);
}

bool karst_emit_choice_lines(karst_emit *emit, const karst_expr *roots, size_t num_roots)
{
    const uint32_t num_nodes = emit->graph->num_nodes;
    choices c = {.emit = emit, .guard = calloc(num_nodes, sizeof *c.guard)};
    uint8_t *bytes = calloc(num_nodes, 4);
    bool written = false;
    if (c.guard && bytes) {
        c.seen = bytes;
        c.has_noise = bytes + num_nodes;
        c.begun = bytes + 2 * (size_t)num_nodes;
        c.done = bytes + 3 * (size_t)num_nodes;
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
