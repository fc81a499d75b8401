/* Statements.
 *
 * A return, break or continue under a condition that varies sets a bool, which merges like any variable: the rest of
 * the block is then executed as a branch on its not being set. Nothing else knows about masks. */
#include "producers/language/front/lower_internal.h"

#include <string.h>

static void lower_statement(karst_lower_state *s, const karst_ast_statement *st);

static karst_expr or_of(karst_lower_state *s, karst_expr a, karst_expr b)
{
    return karst_expr_2(s->graph, KARST_OP_OR, a, b);
}
static karst_expr not_of(karst_lower_state *s, karst_expr a) { return karst_expr_1(s->graph, KARST_OP_NOT, a); }

/* Whether a lane has left the present block. */
static karst_expr left_block(karst_lower_state *s)
{
    const karst_frame *f = &s->frame;
    karst_expr left = s->slots[f->returned];
    left = f->may_continue ? or_of(s, left, s->slots[f->continued]) : left;
    return f->may_break ? or_of(s, left, s->slots[f->broken]) : left;
}

static bool is_known(const karst_lower_state *s, karst_expr e, bool value)
{
    const karst_number *n = karst_graph_constant(s->graph, e);
    return n && (n->numerator != 0) == value;
}

/* At the begin of a branch of those who have not: what follows sees plain bools again. */
static void nobody_has_left(karst_lower_state *s)
{
    karst_slot_set(s, s->frame.returned, s->no);
    if (s->frame.may_break)
        karst_slot_set(s, s->frame.broken, s->no);
    if (s->frame.may_continue)
        karst_slot_set(s, s->frame.continued, s->no);
}

/* The body of a loop, while it is lowered. What it counts behind a break or return goes on for all lanes too, as those
 * that have left do not count any more; what they had is noted, innermost first. */
typedef struct {
    uint32_t slot;
    karst_expr left, value;
} left_behind;
struct karst_loop {
    uint32_t branches; /* that are open where the body's own statements stand */
    uint32_t top;      /* slots below are older than the body */
    left_behind *items;
    size_t count, room;
};

/* Whether lanes that have left the present block have left the loop, and that block is the loop's own. */
static bool ends_loop_alone(const karst_lower_state *s)
{
    const karst_frame *f = &s->frame;
    return f->loop && s->open_branches == f->loop->branches && is_known(s, s->slots[f->continued], false);
}

/* Among the changes behind a break: what was known and is known goes on for all. */
static void leave_behind(karst_lower_state *s, karst_expr left, size_t first)
{
    struct karst_loop *loop = s->frame.loop;
    size_t rest = first;
    for (size_t i = first; i < s->num_changes; i++) {
        const karst_change c = s->changes[i];
        const bool is_flag = c.slot == s->frame.returned || c.slot == s->frame.broken || c.slot == s->frame.continued;
        const bool is_older = c.slot < loop->top || c.slot >= s->global_top;
        if (is_flag || !is_older || !karst_graph_constant(s->graph, c.value) ||
            !karst_graph_constant(s->graph, s->slots[c.slot])) {
            s->changes[rest++] = c;
            continue;
        }
        loop->items =
            karst_arena_grow(s->arena, loop->items, loop->count, &loop->room, loop->count + 1, sizeof *loop->items);
        loop->items[loop->count++] = (left_behind){.slot = c.slot, .left = left, .value = s->slots[c.slot]};
        karst_slot_set(s, c.slot, c.value);
    }
    s->num_changes = rest;
}

void karst_lower_statements(karst_lower_state *s, const karst_ast_statement *first)
{
    for (const karst_ast_statement *st = first; st; st = st->next) {
        lower_statement(s, st);
        karst_expr left = left_block(s);
        if (is_known(s, left, true))
            return;
        if (is_known(s, left, false) || !st->next)
            continue;
        karst_lower_enter(s, st->next->where);
        const bool is_end = ends_loop_alone(s);
        karst_branch rest = karst_branch_open(s);
        nobody_has_left(s);
        if (is_end)
            s->frame.loop->branches++;
        karst_lower_statements(s, st->next);
        karst_branch_close(s, rest);
        if (is_end) {
            s->frame.loop->branches--;
            leave_behind(s, left, rest.changes);
        }
        karst_branch_merge(s, not_of(s, left), rest.changes, s->num_changes);
        karst_lower_leave(s);
        return;
    }
}

static void lower_block(karst_lower_state *s, const karst_ast_statement *first)
{
    size_t num_variables = s->num_variables, outer = s->frame.first_in_block;
    uint32_t top = s->top;
    s->frame.first_in_block = num_variables;
    karst_lower_statements(s, first);
    s->frame.first_in_block = outer;
    s->num_variables = num_variables;
    s->top = top;
}

static void check_name_is_free(karst_lower_state *s, const karst_ast_variable *v)
{
    for (size_t i = s->frame.first_in_block; i < s->num_variables; i++)
        if (s->variables[i].name == v->name)
            karst_source_error(s->source, v->where, "rename one of them, or assign without a type",
                               "there is a variable '%s' here already", karst_lower_name(s, v->name));
}

static void lower_declaration(karst_lower_state *s, const karst_ast_statement *st)
{
    for (const karst_ast_variable *v = st->variables; v; v = v->next) {
        karst_lower_enter(s, v->where);
        check_name_is_free(s, v);
        uint32_t top = s->top;
        const karst_type *type = karst_lower_declared(s, v);
        if (type->shape == KARST_SHAPE_VOID)
            karst_source_error(s->source, v->where, NULL, "a variable cannot be void");
        s->top = top;
        /* The slots first, so that they outlive what the initialiser needs; the name last, so that "float x = x" means
         * the outer one. */
        karst_variable *declared = karst_variable_declare(s, 0, type, v->is_const, v->where);
        uint32_t slot = declared->slot;
        size_t at = s->num_variables - 1;
        top = s->top;
        karst_value value = v->value ? karst_lower_initialiser(s, v->value, type) : karst_value_zero(s, type, v->where);
        memcpy(s->slots + slot, value.e, type->num_scalars * sizeof *value.e);
        s->top = top;
        s->variables[at].name = v->name;
        karst_lower_leave(s);
    }
}

static void lower_if(karst_lower_state *s, const karst_ast_statement *st)
{
    karst_expr condition = karst_lower_condition(s, st->value, "the condition of 'if'");
    if (karst_graph_constant(s->graph, condition)) {
        lower_block(s, is_known(s, condition, true) ? st->body : st->otherwise);
        return;
    }
    karst_branch yes = karst_branch_open(s);
    lower_block(s, st->body);
    karst_branch_close(s, yes);
    size_t middle = s->num_changes;
    karst_branch no = karst_branch_open(s);
    lower_block(s, st->otherwise);
    karst_branch_close(s, no);
    karst_branch_merge(s, condition, yes.changes, middle);
}

/* ---- loops ---- */

/* Collects the terms of a && b && c, the last first. */
static uint32_t conjuncts(const karst_ast_expr *e, const karst_ast_expr *terms[16])
{
    uint32_t n = 0;
    while (e->kind == KARST_AST_BINARY && e->op == KARST_P2('&', '&') && n < 15) {
        terms[n++] = e->b;
        e = e->a;
    }
    terms[n++] = e;
    return n;
}

/* The value of variables that a loop's condition and step count: while the loop is executed they go on for all lanes,
 * so that a counter stays a constant; what lanes that have left had is kept here and put back behind the loop. */
typedef struct {
    karst_change *items; /* slot, value for lanes that have left */
    size_t count, room;
} kept;

/* Which item has the slot: a new one keeps its present value. */
static size_t remember(karst_lower_state *s, kept *k, uint32_t slot)
{
    for (size_t j = 0; j < k->count; j++)
        if (k->items[j].slot == slot)
            return j;
    k->items = karst_arena_grow(s->arena, k->items, k->count, &k->room, k->count + 1, sizeof *k->items);
    k->items[k->count] = (karst_change){.slot = slot, .value = s->slots[slot]};
    return k->count++;
}

static void keep(karst_lower_state *s, kept *k, karst_expr live, size_t first)
{
    for (size_t i = first; i < s->num_changes; i++) {
        karst_change c = s->changes[i];
        size_t j = remember(s, k, c.slot);
        k->items[j].value = karst_expr_3(s->graph, KARST_OP_SELECT, live, c.value, k->items[j].value);
        karst_slot_set(s, c.slot, c.value);
    }
    s->num_changes = first;
}

/* Where a body wrote to a counted variable under a condition, what lanes that have left had moves along. */
static void refresh(karst_lower_state *s, kept *k, karst_expr live)
{
    for (size_t j = 0; j < k->count; j++)
        k->items[j].value =
            karst_expr_3(s->graph, KARST_OP_SELECT, live, s->slots[k->items[j].slot], k->items[j].value);
}

/* Among the changes of a body that only some lanes executed: what was known before and is known after goes on for all
 * lanes too, so that what a body counts ends a loop. */
static void keep_known(karst_lower_state *s, kept *k, size_t first)
{
    size_t rest = first;
    for (size_t i = first; i < s->num_changes; i++) {
        karst_change c = s->changes[i];
        bool flag = c.slot == s->frame.returned || c.slot == s->frame.broken || c.slot == s->frame.continued;
        if (flag || !karst_graph_constant(s->graph, c.value) || !karst_graph_constant(s->graph, s->slots[c.slot])) {
            s->changes[rest++] = c;
            continue;
        }
        remember(s, k, c.slot);
        karst_slot_set(s, c.slot, c.value);
    }
    s->num_changes = rest;
}

/* What lanes had that left a body before it counted. `live`: those that came into it. */
static void restore_left(karst_lower_state *s, kept *k, const struct karst_loop *loop, karst_expr live)
{
    for (size_t i = 0; i < loop->count; i++) {
        const left_behind *l = &loop->items[i];
        size_t j = remember(s, k, l->slot);
        k->items[j].value = karst_expr_3(s->graph, KARST_OP_SELECT,
                                         karst_expr_2(s->graph, KARST_OP_AND, live, l->left), l->value,
                                         k->items[j].value);
    }
}

static karst_expr live_lanes(karst_lower_state *s)
{
    return not_of(s, or_of(s, s->slots[s->frame.returned], s->slots[s->frame.broken]));
}

/* Evaluates the condition for all lanes. false: the loop ends. */
static bool loop_goes_on(karst_lower_state *s, const karst_ast_statement *st, kept *k, bool *bounded)
{
    const karst_ast_expr *terms[16];
    if (!st->value)
        return true;
    uint32_t n = conjuncts(st->value, terms);
    uint32_t top = s->top;
    karst_expr live = live_lanes(s), varying = s->yes;
    bool ends = false;
    for (uint32_t i = n; i-- > 0 && !ends;) {
        karst_number known;
        karst_branch branch = karst_branch_open(s);
        karst_expr value = karst_lower_condition(s, terms[i], "the condition of a loop");
        karst_branch_close(s, branch);
        keep(s, k, live, branch.changes);
        if (!karst_lower_try_constant(s, value, &known)) {
            ends |= karst_lower_never_holds(s, value);
            *bounded |= karst_lower_has_bound(s, value);
            varying = karst_expr_2(s->graph, KARST_OP_AND, varying, value);
            live = karst_expr_2(s->graph, KARST_OP_AND, live, value); /* the others do not come to the next term */
        } else if (known.numerator) {
            *bounded = true;
        } else {
            ends = true;
        }
    }
    s->top = top;
    if (!ends && varying != s->yes)
        karst_slot_set(s, s->frame.broken, or_of(s, s->slots[s->frame.broken], not_of(s, varying)));
    return !ends && !is_known(s, live_lanes(s), false);
}

static void loop_step(karst_lower_state *s, const karst_ast_statement *st, kept *k)
{
    if (!st->step)
        return;
    uint32_t top = s->top;
    karst_expr live = live_lanes(s);
    karst_branch branch = karst_branch_open(s);
    karst_lower_expression(s, st->step);
    karst_branch_close(s, branch);
    keep(s, k, live, branch.changes);
    s->top = top;
}

static _Noreturn void endless(karst_lower_state *s, const karst_ast_statement *st, bool bounded)
{
    if (bounded)
        karst_source_error(s->source, st->where, "make it shorter", "this loop runs more than %u times",
                           KARST_MAX_ITERATIONS);
    karst_source_error(s->source, st->where, "add a counter: for (int i = 0; i < 100 && CONDITION; i++)",
                       "nothing bounds this loop");
}

static bool is_literal_step(const karst_ast_expr *e)
{
    return e && (e->kind == KARST_AST_STEP || (e->kind == KARST_AST_ASSIGN && e->op && e->b->kind == KARST_AST_NUMBER));
}

/* What may end a loop whose condition varies: something in it counts by a literal, and a break or return. */
typedef struct {
    bool counts, leaves;
} ending;

static void look_for_count(const karst_ast_expr *e, ending *found)
{
    for (; e && !found->counts; e = e->next) {
        found->counts = is_literal_step(e);
        look_for_count(e->a, found);
        look_for_count(e->b, found);
        look_for_count(e->c, found);
    }
}

/* in_switch: a break leaves that, and no loop. */
static void look_for_end(const karst_ast_statement *st, bool in_switch, ending *found)
{
    for (; st; st = st->next) {
        found->leaves |= st->kind == KARST_AST_RETURN || (st->kind == KARST_AST_BREAK && !in_switch);
        look_for_count(st->value, found);
        look_for_count(st->step, found);
        look_for_end(st->first, in_switch || st->kind == KARST_AST_SWITCH, found);
        look_for_end(st->body, in_switch, found);
        look_for_end(st->otherwise, in_switch, found);
    }
}

/* How often a loop may run while only what varies would end it. */
static uint32_t most_unbounded(const karst_ast_statement *st)
{
    ending found = {0};
    if (!st->value)
        return 1024;
    look_for_end(st->body, false, &found);
    look_for_count(st->step, &found);
    return found.counts && found.leaves ? 1024 : 4;
}

static void lower_for(karst_lower_state *s, const karst_ast_statement *st)
{
    size_t num_variables = s->num_variables;
    uint32_t top = s->top;
    karst_frame outer = s->frame;
    s->frame.first_in_block = num_variables;
    if (st->first)
        lower_statement(s, st->first);
    s->frame.broken = karst_slot_index(s, karst_slots_push(s, 2, st->where));
    s->frame.continued = s->frame.broken + 1;
    s->frame.may_break = s->frame.may_continue = true;
    s->slots[s->frame.broken] = s->slots[s->frame.continued] = s->no;
    kept k = {0};
    bool bounded = false;
    uint32_t most = most_unbounded(st);
    for (uint32_t i = 0; (st->runs_first && i == 0) || loop_goes_on(s, st, &k, &bounded); i++) {
        /* Only what varies has ended it so far: give up before the graph is full. */
        bool unbounded = !bounded && i == most && !is_known(s, s->slots[s->frame.broken], false);
        if (i == KARST_MAX_ITERATIONS || unbounded)
            endless(s, st, bounded);
        karst_lower_enter(s, st->where);
        karst_expr live = live_lanes(s);
        bool all_left = false; /* who were still in it */
        struct karst_loop loop = {.branches = s->open_branches, .top = s->top};
        s->frame.loop = &loop;
        if (i + 1 > s->io->max_iterations_seen)
            s->io->max_iterations_seen = i + 1;
        if (is_known(s, live, true)) {
            lower_block(s, st->body);
            karst_slot_set(s, s->frame.continued, s->no);
        } else {
            karst_branch branch = karst_branch_open(s);
            loop.branches++;
            karst_slot_set(s, s->frame.returned, s->no);
            karst_slot_set(s, s->frame.broken, s->no);
            lower_block(s, st->body);
            karst_slot_set(s, s->frame.continued, s->no);
            all_left = is_known(s, live_lanes(s), false);
            karst_branch_close(s, branch);
            keep_known(s, &k, branch.changes);
            karst_branch_merge(s, live, branch.changes, s->num_changes);
        }
        karst_lower_leave(s);
        s->frame.loop = NULL;
        refresh(s, &k, live);
        restore_left(s, &k, &loop, live);
        if (all_left || is_known(s, live_lanes(s), false))
            break;
        loop_step(s, st, &k);
    }
    for (size_t j = 0; j < k.count; j++)
        karst_slot_set(s, k.items[j].slot, k.items[j].value);
    s->frame.broken = outer.broken;
    s->frame.continued = outer.continued;
    s->frame.loop = outer.loop;
    s->frame.may_break = outer.may_break;
    s->frame.may_continue = outer.may_continue;
    s->frame.first_in_block = outer.first_in_block;
    s->num_variables = num_variables;
    s->top = top;
}

/* ---- switch ---- */

/* Where what the switch looks at is the label of `st`. */
static karst_expr is_label(karst_lower_state *s, const karst_ast_statement *st, karst_value selector)
{
    karst_value label = karst_lower_expression(s, st->value);
    if (label.type->shape != KARST_SHAPE_SCALAR ||
        (label.type->scalar != KARST_TYPE_INT && label.type->scalar != KARST_TYPE_UINT))
        karst_source_error(s->source, st->value->where, "write a whole number",
                           "a label of 'switch' is an int, not %s", karst_a_type(s, label.type));
    karst_number n = karst_lower_constant(s, label.e[0], "a label of 'switch'", st->value->where);
    return karst_expr_2(s->graph, KARST_OP_EQUAL, selector.e[0],
                        karst_graph_number(s->graph, selector.type->scalar, n));
}

/* Each CASE runs for those whose label it is, and those who come from the one before it without a break. */
static void lower_switch(karst_lower_state *s, const karst_ast_statement *st)
{
    size_t num_variables = s->num_variables;
    karst_frame outer = s->frame;
    karst_value selector = karst_lower_expression(s, st->value);
    if (selector.type->shape != KARST_SHAPE_SCALAR ||
        (selector.type->scalar != KARST_TYPE_INT && selector.type->scalar != KARST_TYPE_UINT))
        karst_source_error(s->source, st->value->where, "write switch (int(...))", "'switch' looks at an int, not %s",
                           karst_a_type(s, selector.type));
    uint32_t count = 0, k = 0;
    for (const karst_ast_statement *c = st->first; c; c = c->next)
        count++;
    karst_expr *matches = karst_arena_alloc(s->arena, (count + 1) * sizeof *matches), any = s->no;
    for (const karst_ast_statement *c = st->first; c; c = c->next, k++) {
        matches[k] = c->value ? is_label(s, c, selector) : KARST_NO_EXPR;
        for (uint32_t j = 0; j < k; j++)
            if (c->value && matches[j] == matches[k] && !is_known(s, matches[k], false))
                karst_source_error(s->source, c->where, "leave one of them", "this 'switch' has that label twice");
        any = c->value ? or_of(s, any, matches[k]) : any;
    }
    s->frame.broken = karst_slot_index(s, karst_slots_push(s, 1, st->where));
    s->frame.may_break = true;
    s->frame.loop = NULL; /* a break leaves the switch alone */
    s->slots[s->frame.broken] = s->no;
    karst_expr entered = s->no;
    k = 0;
    for (const karst_ast_statement *c = st->first; c; c = c->next, k++) {
        entered = or_of(s, entered, c->value ? matches[k] : not_of(s, any));
        karst_expr runs = karst_expr_2(s->graph, KARST_OP_AND, entered, not_of(s, left_block(s)));
        if (is_known(s, runs, false))
            continue;
        karst_lower_enter(s, c->where);
        if (is_known(s, runs, true)) {
            lower_block(s, c->first);
        } else {
            karst_branch branch = karst_branch_open(s);
            nobody_has_left(s);
            lower_block(s, c->first);
            karst_branch_close(s, branch);
            karst_branch_merge(s, runs, branch.changes, s->num_changes);
        }
        karst_lower_leave(s);
    }
    s->frame.broken = outer.broken;
    s->frame.may_break = outer.may_break;
    s->frame.loop = outer.loop;
    s->num_variables = num_variables;
}

/* ---- leaving ---- */

static void lower_return(karst_lower_state *s, const karst_ast_statement *st)
{
    const karst_type *type = s->frame.result_type;
    const char *name = karst_lower_name(s, s->frame.function->name);
    if (!st->value && type->shape != KARST_SHAPE_VOID)
        karst_source_error(s->source, st->where, karst_format(s->arena, "write return and %s", karst_a_type(s, type)),
                           "'%s' must give %s", name, karst_a_type(s, type));
    if (st->value) {
        karst_value value = karst_lower_expression(s, st->value);
        if (type->shape == KARST_SHAPE_VOID && value.type->shape != KARST_SHAPE_VOID)
            karst_source_error(s->source, st->value->where, NULL, "'%s' is void and gives no value", name);
        value = karst_lower_convert(s, value, type, "the result", st->value->where);
        for (uint32_t i = 0; i < type->num_scalars; i++)
            karst_slot_set(s, s->frame.result + i, value.e[i]);
    }
    karst_slot_set(s, s->frame.returned, s->yes);
}

static void lower_statement(karst_lower_state *s, const karst_ast_statement *st)
{
    if (!st)
        return;
    karst_lower_enter(s, st->where);
    uint32_t top = s->top;
    switch ((karst_ast_statement_kind)st->kind) {
    case KARST_AST_DECLARE:
        lower_declaration(s, st);
        top = s->top;
        break;
    case KARST_AST_EVALUATE:
        karst_lower_expression(s, st->value);
        break;
    case KARST_AST_BLOCK:
        lower_block(s, st->first);
        break;
    case KARST_AST_IF:
        lower_if(s, st);
        break;
    case KARST_AST_FOR:
        lower_for(s, st);
        break;
    case KARST_AST_SWITCH:
        lower_switch(s, st);
        break;
    case KARST_AST_CASE: /* lower_switch does these */
        break;
    case KARST_AST_RETURN:
        lower_return(s, st);
        break;
    case KARST_AST_BREAK:
    case KARST_AST_CONTINUE:
        if (!(st->kind == KARST_AST_BREAK ? s->frame.may_break : s->frame.may_continue))
            karst_source_error(s->source, st->where, NULL, "there is no loop around this '%s'",
                               st->kind == KARST_AST_BREAK ? "break" : "continue");
        karst_slot_set(s, st->kind == KARST_AST_BREAK ? s->frame.broken : s->frame.continued, s->yes);
        break;
    }
    s->top = top;
    karst_lower_leave(s);
}

void karst_rule_body(karst_lower_state *s, const karst_ast_statement *body)
{
    s->frame.returned = karst_slot_index(s, karst_slots_push(s, 1, body->where));
    s->slots[s->frame.returned] = s->no;
    lower_block(s, body->first);
    if (s->frame.result_type->shape != KARST_SHAPE_VOID && is_known(s, s->slots[s->frame.returned], false))
        karst_source_error(s->source, body->where, "end it with return", "'%s' never returns a value",
                           karst_lower_name(s, s->frame.function->name));
}
