#include "producers/language/front/lower_internal.h"

#include <string.h>

karst_expr *karst_slots_push(karst_lower_state *s, uint32_t count, uint32_t where)
{
    if (count > s->global_top - s->top)
        karst_source_error(s->source, where, NULL, "the variables here need more than %u numbers at a time",
                           KARST_MAX_SLOTS);
    karst_expr *e = s->slots + s->top;
    s->top += count;
    return e;
}

karst_value karst_value_new(karst_lower_state *s, const karst_type *type, uint32_t where)
{
    s->steps += type->num_scalars / 8; /* large values take their time */
    return (karst_value){.type = type, .e = karst_slots_push(s, type->num_scalars, where)};
}

static karst_expr zero_of(karst_lower_state *s, karst_scalar_type type)
{
    return type == KARST_TYPE_FLOAT ? s->zero : karst_graph_number(s->graph, type, karst_number_int(0));
}

static void fill_zero(karst_lower_state *s, const karst_type *type, karst_expr *e)
{
    if (type->usual)
        for (uint32_t i = 0; i < type->num_scalars; i++)
            e[i] = karst_graph_number(s->graph, KARST_TYPE_FLOAT, karst_number_shortest(type->usual[i]));
    else if (type->shape == KARST_SHAPE_STRUCT)
        for (uint32_t i = 0; i < type->num_fields; i++)
            fill_zero(s, type->fields[i].type, e + type->fields[i].offset);
    else if (type->shape == KARST_SHAPE_ARRAY)
        for (uint32_t i = 0; i < type->count; i++)
            fill_zero(s, type->element, e + i * type->element->num_scalars);
    else
        for (uint32_t i = 0; i < type->num_scalars; i++)
            e[i] = zero_of(s, type->scalar);
}

karst_value karst_value_zero(karst_lower_state *s, const karst_type *type, uint32_t where)
{
    karst_value v = karst_value_new(s, type, where);
    fill_zero(s, type, v.e);
    return v;
}

void karst_slot_set(karst_lower_state *s, uint32_t slot, karst_expr value)
{
    if (s->open_branches) {
        s->journal = karst_arena_grow(s->arena, s->journal, s->num_journal, &s->journal_room, s->num_journal + 1,
                                      sizeof *s->journal);
        s->journal[s->num_journal++] = (karst_change){.slot = slot, .value = s->slots[slot]};
    }
    s->slots[slot] = value;
}

void karst_lower_enter(karst_lower_state *s, uint32_t where)
{
    if (where >= s->source->user_begin)
        s->graph->where = s->source->blame = where; /* what the prelude does, its caller did */
    if (++s->steps > KARST_MAX_STEPS)
        karst_source_error(s->source, where, "make the loops shorter, or call fewer functions in them",
                           "this takes more than %u steps to compile", KARST_MAX_STEPS);
    if (++s->depth > KARST_MAX_DEPTH)
        karst_source_error(s->source, where, "split it with variables or functions",
                           "calls and brackets are nested deeper than %u here", KARST_MAX_DEPTH);
}

/* ---- branches ---- */

karst_branch karst_branch_open(karst_lower_state *s)
{
    s->open_branches++;
    return (karst_branch){.journal = s->num_journal, .changes = s->num_changes, .top = s->top};
}

/* Nobody outside the branch has a variable there. */
static bool is_born_in(const karst_lower_state *s, karst_branch branch, uint32_t slot)
{
    return slot >= branch.top && slot < s->global_top;
}

void karst_branch_close(karst_lower_state *s, karst_branch branch)
{
    s->open_branches--;
    s->serial++;
    for (size_t i = branch.journal; i < s->num_journal; i++) {
        uint32_t slot = s->journal[i].slot;
        if (is_born_in(s, branch, slot) || s->stamps[slot] == s->serial)
            continue;
        s->stamps[slot] = s->serial;
        s->changes = karst_arena_grow(s->arena, s->changes, s->num_changes, &s->change_room, s->num_changes + 1,
                                      sizeof *s->changes);
        s->changes[s->num_changes++] = (karst_change){.slot = slot, .value = s->slots[slot]};
    }
    while (s->num_journal > branch.journal) {
        karst_change before = s->journal[--s->num_journal];
        if (!is_born_in(s, branch, before.slot)) /* it may hold the branch's own value by now, which is wanted */
            s->slots[before.slot] = before.value;
    }
}

void karst_branch_merge(karst_lower_state *s, karst_expr condition, size_t first, size_t middle)
{
    uint32_t open = s->serial + 1, done = s->serial + 2;
    s->serial += 2;
    for (size_t i = first; i < middle; i++) {
        s->stamps[s->changes[i].slot] = open;
        s->marks[s->changes[i].slot] = s->changes[i].value;
    }
    for (size_t i = middle; i < s->num_changes; i++) {
        uint32_t slot = s->changes[i].slot;
        karst_expr yes = s->stamps[slot] == open ? s->marks[slot] : s->slots[slot];
        s->stamps[slot] = done;
        karst_slot_set(s, slot, karst_expr_3(s->graph, KARST_OP_SELECT, condition, yes, s->changes[i].value));
    }
    for (size_t i = first; i < middle; i++) {
        uint32_t slot = s->changes[i].slot;
        if (s->stamps[slot] == open)
            karst_slot_set(s, slot,
                           karst_expr_3(s->graph, KARST_OP_SELECT, condition, s->changes[i].value, s->slots[slot]));
    }
    s->num_changes = first;
}

/* ---- names ---- */

const char *karst_lower_name(const karst_lower_state *s, uint32_t name) { return karst_name_text(s->names, name); }

karst_variable *karst_variable_declare(karst_lower_state *s, uint32_t name, const karst_type *type, bool is_const,
                                       uint32_t where)
{
    karst_variable v = {.name = name, .type = type, .is_const = is_const};
    v.slot = karst_slot_index(s, karst_slots_push(s, type->num_scalars, where));
    s->variables =
        karst_arena_grow(s->arena, s->variables, s->num_variables, &s->variable_room, s->num_variables + 1, sizeof v);
    s->variables[s->num_variables] = v;
    return &s->variables[s->num_variables++];
}

karst_variable *karst_variable_find(karst_lower_state *s, uint32_t name)
{
    for (size_t i = s->num_variables; i > s->frame.first_variable; i--)
        if (s->variables[i - 1].name == name)
            return &s->variables[i - 1];
    return NULL;
}
