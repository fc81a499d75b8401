/* Globals and types of a text, which hold expressions. */
#include "producers/language/front/lower_internal.h"

#include <string.h>

/* The value of a global's initialiser. It is evaluated when the global is first met, but as if before all functions:
 * outside all branches, and with the values that other globals began with. */
static karst_value initial_value(karst_lower_state *s, const karst_global *g)
{
    size_t count = 0, room = 0;
    karst_change *now = NULL; /* what functions have done to globals */
    for (const karst_global *other = s->globals; other < s->globals + s->num_globals; other++)
        for (uint32_t i = 0; other->ready && other->written && i < other->type->num_scalars; i++) {
            uint32_t slot = other->slot + i;
            now = karst_arena_grow(s->arena, now, count, &room, count + 1, sizeof *now);
            now[count++] = (karst_change){.slot = slot, .value = s->slots[slot]};
            s->slots[slot] = other->initial[i];
        }
    karst_value value = karst_lower_initialiser(s, g->ast->value, g->type);
    for (size_t i = 0; i < count; i++)
        s->slots[now[i].slot] = now[i].value;
    return value;
}

static void prepare_global(karst_lower_state *s, karst_global *g)
{
    const karst_ast_variable *v = g->ast;
    if (g->busy)
        karst_source_error(s->source, v->where, NULL, "the value of '%s' depends on itself",
                           karst_lower_name(s, v->name));
    g->busy = true;
    karst_frame frame = s->frame;
    uint32_t open = s->open_branches, top = s->top;
    karst_ast_function here = {.is_prelude = v->is_prelude};
    s->frame = (karst_frame){.function = &here, .first_variable = s->num_variables};
    s->open_branches = 0;
    g->type = karst_lower_declared(s, v);
    karst_value value = v->value ? initial_value(s, g) : karst_value_zero(s, g->type, v->where);
    /* Globals live in a region of their own, as long as the state does. */
    g->initial = karst_arena_alloc(s->arena, value.type->num_scalars * sizeof *g->initial);
    memcpy(g->initial, value.e, value.type->num_scalars * sizeof *g->initial);
    s->frame = frame;
    s->open_branches = open;
    s->top = top;
    if (g->type->num_scalars > s->global_top - s->top)
        karst_source_error(s->source, v->where, NULL, "the globals need too many numbers");
    s->global_top -= g->type->num_scalars;
    g->slot = s->global_top;
    memcpy(s->slots + g->slot, g->initial, g->type->num_scalars * sizeof *g->initial);
    g->busy = false;
    g->ready = true;
}

karst_global *karst_global_find(karst_lower_state *s, uint32_t name)
{
    karst_global *found = NULL;
    for (uint32_t i = 0; i < s->num_globals; i++)
        if (s->globals[i].ast->name == name && (s->globals[i].ast->is_prelude || !karst_in_prelude(s)))
            found = &s->globals[i]; /* the user's come last, and hide the prelude's */
    if (found && !found->ready)
        prepare_global(s, found);
    return found;
}

/* ---- types ---- */

static const karst_type *struct_type(karst_lower_state *s, karst_ast_struct *structure)
{
    if (structure->type)
        return structure->type;
    karst_type *type = karst_arena_alloc(s->arena, sizeof *type);
    uint32_t count = 0;
    for (const karst_ast_variable *f = structure->fields; f; f = f->next)
        count++;
    *type = (karst_type){.shape = KARST_SHAPE_STRUCT,
                         .name = karst_lower_name(s, structure->name),
                         .num_fields = count,
                         .usual = structure->usual};
    type->fields = karst_arena_alloc(s->arena, count * sizeof *type->fields);
    karst_field *field = type->fields;
    for (const karst_ast_variable *f = structure->fields; f; f = f->next, field++) {
        karst_lower_enter(s, f->where); /* structs of structs of structs */
        field->name = f->name;
        field->type = karst_lower_type(s, &f->type, NULL, f->where);
        if (field->type->shape == KARST_SHAPE_VOID)
            karst_source_error(s->source, f->where, NULL, "a field cannot be void");
        field->offset = type->num_scalars;
        type->num_scalars += field->type->num_scalars;
        if (type->num_scalars > KARST_MAX_SLOTS / 4)
            karst_source_error(s->source, f->where, NULL, "struct '%s' is too large", type->name);
        karst_lower_leave(s);
    }
    return structure->type = type;
}

/* One size of an array; 0: it is left open. */
static uint32_t array_size(karst_lower_state *s, const karst_ast_expr *text)
{
    if (text->kind == KARST_AST_LIST)
        return 0;
    karst_value size = karst_lower_expression(s, text);
    if (size.type->shape != KARST_SHAPE_SCALAR ||
        (size.type->scalar != KARST_TYPE_INT && size.type->scalar != KARST_TYPE_UINT))
        karst_source_error(s->source, text->where, NULL, "the size of an array is an int, not %s", size.type->name);
    karst_number n = karst_lower_constant(s, size.e[0], "the size of an array", text->where);
    if (n.value < 1 || n.value > KARST_MAX_ARRAY)
        karst_source_error(s->source, text->where, NULL, "an array may have 1 to %u elements, not %.0f",
                           KARST_MAX_ARRAY, n.value);
    return (uint32_t)n.value;
}

static uint32_t num_listed(const karst_ast_expr *a)
{
    uint32_t count = 0;
    for (; a; a = a->next)
        count++;
    return count;
}

const karst_type *karst_lower_declared(karst_lower_state *s, const karst_ast_variable *v)
{
    if (!v->type.is_deduced)
        return karst_lower_type(s, &v->type, v->value ? v->value->a : NULL, v->where);
    if (!v->value || v->value->kind == KARST_AST_LIST)
        karst_source_error(s->source, v->where, "write its type", "nothing says what type '%s' has",
                           karst_lower_name(s, v->name));
    karst_branch branch = karst_branch_open(s); /* for its type alone */
    const karst_type *type = karst_lower_expression(s, v->value).type;
    karst_branch_close(s, branch);
    s->num_changes = branch.changes;
    return type;
}

const karst_type *karst_lower_type(karst_lower_state *s, const karst_ast_type *type, const karst_ast_expr *elements,
                                   uint32_t where)
{
    if (type->unsupported && !strcmp(type->unsupported, KARST_POINTER))
        karst_source_error(s->source, where, "write inout before the type", "there are no pointers");
    if (type->is_deduced)
        karst_source_error(s->source, where, "write its type", "only variables with a value can be 'auto'");
    if (type->unsupported)
        karst_source_error(s->source, where, "use noise(p) or write a function",
                           "a world has no textures, so there is no '%s'", type->unsupported);
    const karst_type *made = type->base ? type->base : struct_type(s, type->structure);
    uint32_t counts[KARST_MAX_DIMENSIONS], num = 0;
    for (const karst_ast_expr *size = type->size; size; size = size->next) {
        if (num == KARST_MAX_DIMENSIONS)
            karst_source_error(s->source, where, NULL, "arrays of arrays have at most %u sizes", KARST_MAX_DIMENSIONS);
        counts[num] = array_size(s, size);
        if (!counts[num])
            counts[num] = num_listed(elements);
        if (!counts[num] || counts[num] > KARST_MAX_ARRAY)
            karst_source_error(s->source, where, "write the number of elements into the brackets",
                               "the size of this array is not known");
        num++;
        elements = elements && (elements->kind == KARST_AST_LIST || elements->kind == KARST_AST_CONSTRUCT) ? elements->a
                                                                                                         : NULL;
    }
    if (num && made->shape == KARST_SHAPE_VOID)
        karst_source_error(s->source, where, NULL, "there are no arrays of void");
    while (num--) {
        if ((uint64_t)made->num_scalars * counts[num] > KARST_MAX_SLOTS / 4)
            karst_source_error(s->source, where, NULL, "this array is too large");
        made = karst_type_array(&s->array_types, made, counts[num]);
    }
    return made;
}
