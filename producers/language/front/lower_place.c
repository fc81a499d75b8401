/* Parts: fields, swizzles, elements; read from values, and as places that can be assigned to. */
#include "producers/language/front/lower_internal.h"

#include <string.h>

/* HLSL's elements of matrices, "_m01_m11" and "_12_22": rows, which are columns here, then columns. 0: it is none. */
static uint32_t elements_of_matrix(const char *name, const karst_type *type, uint8_t part[4])
{
    uint32_t n = 0;
    for (; *name == '_'; n++) {
        const char first = name[1] == 'm' ? '0' : '1';
        name += first == '0' ? 2 : 1;
        if (n == 4 || name[0] < first || name[0] >= first + (char)type->count || name[1] < first ||
            name[1] >= first + (char)type->size)
            return 0;
        part[n] = (uint8_t)((name[0] - first) * type->size + name[1] - first);
        name += 2;
    }
    return *name ? 0 : n;
}

/* OpenCL C's components: "s0", "s3210", "lo", "even". */
static uint32_t numbered(const char *name, const karst_type *type, uint8_t part[4])
{
    static const struct {
        const char *name;
        uint8_t first, step;
    } halves[] = {{"lo", 0, 1}, {"hi", 1, 1}, {"even", 0, 2}, {"odd", 1, 2}};
    uint32_t n = 0;
    if (name[0] == 's' || name[0] == 'S') {
        for (; n < 4 && name[n + 1] >= '0' && name[n + 1] < '0' + (char)type->size; n++)
            part[n] = (uint8_t)(name[n + 1] - '0');
        return name[n + 1] ? 0 : n;
    }
    for (size_t i = 0; i < sizeof halves / sizeof *halves; i++)
        if (!strcmp(name, halves[i].name)) {
            const uint32_t half = (type->size + 1u) / 2, by = halves[i].step;
            for (uint32_t k = by == 1 ? halves[i].first * half : halves[i].first; n < half && k < type->size; k += by)
                part[n++] = (uint8_t)k;
        }
    return n;
}

/* Component numbers of a swizzle such as "xzy", "rgb", "st", or OpenCL's "s0", "lo"; 0: it is none. Errors: beyond the
 * vector's size. */
static uint32_t swizzle(karst_lower_state *s, const char *name, const karst_type *type, uint32_t where, uint8_t part[4])
{
    static const char *const sets[] = {"xyzw", "rgba", "stpq"};
    size_t n = strlen(name);
    if (type->shape == KARST_SHAPE_MATRIX)
        return elements_of_matrix(name, type, part);
    if (type->size > 1 && (n = numbered(name, type, part)) != 0)
        return (uint32_t)n;
    n = strlen(name);
    if (n < 1 || n > 4)
        return 0;
    for (size_t set = 0; set < 3; set++) {
        size_t i = 0;
        for (; i < n; i++) {
            const char *at = strchr(sets[set], name[i]);
            if (!at)
                break;
            part[i] = (uint8_t)(at - sets[set]);
        }
        if (i < n)
            continue;
        for (i = 0; i < n; i++)
            if (part[i] >= type->size)
                karst_source_error(s->source, where, karst_format(s->arena, "it has %.*s", (int)type->size, sets[set]),
                                   "%s has no component '%c'", karst_a_type(s, type), name[i]);
        return (uint32_t)n;
    }
    return 0;
}

static const karst_field *find_field(karst_lower_state *s, const karst_type *type, uint32_t name, uint32_t where)
{
    const char *text = karst_lower_name(s, name);
    karst_nearest nearest = karst_nearest_begin(text, strlen(text));
    for (uint32_t i = 0; i < type->num_fields; i++) {
        if (type->fields[i].name == name)
            return &type->fields[i];
        karst_nearest_offer(&nearest, karst_lower_name(s, type->fields[i].name));
    }
    karst_source_error(s->source, where, karst_nearest_hint(&nearest, s->arena), "%s has no field '%s'", type->name,
                       text);
}

static _Noreturn void no_member(karst_lower_state *s, const karst_type *type, uint32_t name, uint32_t where)
{
    karst_source_error(s->source, where,
                       type->shape == KARST_SHAPE_VECTOR ? "components are x y z w, r g b a or s t p q, not mixed"
                                                         : NULL,
                       "%s has no '.%s'", karst_a_type(s, type), karst_lower_name(s, name));
}

static karst_value copy_part(karst_lower_state *s, const karst_type *type, const karst_expr *e, uint32_t where)
{
    karst_value r = karst_value_new(s, type, where);
    memcpy(r.e, e, type->num_scalars * sizeof *e);
    return r;
}

/* A scalar may be swizzled like a vector of one: x.xxx. */
karst_value karst_lower_member(karst_lower_state *s, const karst_ast_expr *e)
{
    karst_value whole = karst_lower_whole(s, e->a);
    if (whole.type->shape == KARST_SHAPE_STRUCT) {
        const karst_field *field = find_field(s, whole.type, e->name, e->where);
        return copy_part(s, field->type, whole.e + field->offset, e->where);
    }
    uint8_t part[4];
    uint32_t n = karst_type_is_plain(whole.type) || whole.type->shape == KARST_SHAPE_MATRIX
                     ? swizzle(s, karst_lower_name(s, e->name), whole.type, e->where, part)
                     : 0;
    if (!n)
        no_member(s, whole.type, e->name, e->where);
    karst_value r = karst_value_new(s, karst_type_vector(whole.type->scalar, n), e->where);
    for (uint32_t i = 0; i < n; i++)
        r.e[i] = whole.e[part[i]];
    return r;
}

static void check_indexable(karst_lower_state *s, const karst_type *type, uint32_t where)
{
    if (type->shape != KARST_SHAPE_ARRAY && type->shape != KARST_SHAPE_VECTOR && type->shape != KARST_SHAPE_MATRIX)
        karst_source_error(s->source, where, NULL, "%s has no elements to index", karst_a_type(s, type));
}

/* The index as a number known now (true), or as an expression clamped to [0, count). */
static bool lower_index(karst_lower_state *s, const karst_ast_expr *text, const karst_type *type, uint32_t *known,
                        karst_expr *index)
{
    karst_value i = karst_lower_expression(s, text);
    uint32_t count = type->count;
    if (i.type->shape != KARST_SHAPE_SCALAR || (i.type->scalar != KARST_TYPE_INT && i.type->scalar != KARST_TYPE_UINT))
        karst_source_error(s->source, text->where, i.type->shape == KARST_SHAPE_SCALAR ? "write int(...)" : NULL,
                           "an index is an int, not %s", karst_a_type(s, i.type));
    const karst_number *number = karst_graph_constant(s->graph, i.e[0]);
    if (number) {
        if (number->numerator < 0 || number->numerator >= count)
            karst_source_error(s->source, text->where, NULL,
                               "the index %lld is outside this %s, which has elements 0 to %u",
                               (long long)number->numerator, type->name, count - 1);
        *known = (uint32_t)number->numerator;
        return true;
    }
    if (count > KARST_MAX_SELECT_ENTRIES)
        karst_source_error(s->source, text->where, "make the array smaller, or compute its values",
                           "a varying index picks from at most %u elements, not %u", KARST_MAX_SELECT_ENTRIES, count);
    karst_expr e = i.e[0];
    if (i.type->scalar == KARST_TYPE_INT) {
        karst_expr low = karst_graph_int(s->graph, 0), high = karst_graph_int(s->graph, (int32_t)count - 1);
        e = karst_expr_3(s->graph, KARST_OP_SELECT, karst_expr_2(s->graph, KARST_OP_LESS, e, low), low, e);
        e = karst_expr_3(s->graph, KARST_OP_SELECT, karst_expr_2(s->graph, KARST_OP_LESS, high, e), high, e);
    } else {
        karst_expr high = karst_graph_number(s->graph, KARST_TYPE_UINT, karst_number_int(count - 1));
        e = karst_expr_3(s->graph, KARST_OP_SELECT, karst_expr_2(s->graph, KARST_OP_LESS, high, e), high, e);
        e = karst_expr_convert(s->graph, KARST_TYPE_INT, e);
    }
    *index = e;
    return false;
}

/* choices[index]: a chain of selects. */
static karst_expr pick(karst_lower_state *s, karst_expr index, const karst_expr *choices, uint32_t stride,
                       uint32_t count)
{
    karst_expr r = choices[(size_t)(count - 1) * stride];
    for (uint32_t k = count - 1; k-- > 0;)
        r = karst_expr_3(s->graph, KARST_OP_SELECT,
                         karst_expr_2(s->graph, KARST_OP_EQUAL, index, karst_graph_int(s->graph, (int32_t)k)),
                         choices[(size_t)k * stride], r);
    return r;
}

karst_value karst_lower_index(karst_lower_state *s, const karst_ast_expr *e)
{
    karst_value whole = karst_lower_whole(s, e->a);
    check_indexable(s, whole.type, e->where);
    const karst_type *element = whole.type->element;
    uint32_t known, n = element->num_scalars;
    karst_expr index;
    if (lower_index(s, e->b, whole.type, &known, &index))
        return copy_part(s, element, whole.e + known * n, e->where);
    karst_value r = karst_value_new(s, element, e->where);
    for (uint32_t i = 0; i < n; i++)
        r.e[i] = pick(s, index, whole.e + i, n, whole.type->count);
    return r;
}

/* ---- places ---- */

static uint32_t *new_slots(karst_lower_state *s, uint64_t count, uint32_t where)
{
    if (count > KARST_MAX_SLOTS / 4)
        karst_source_error(s->source, where, NULL, "this assignment touches more than %u numbers", KARST_MAX_SLOTS / 4);
    return karst_slots_push(s, (uint32_t)count, where); /* expressions and slot numbers are both uint32_t */
}

static karst_place name_place(karst_lower_state *s, const karst_ast_expr *e, const char *why)
{
    const karst_variable *v = karst_variable_find(s, e->name);
    karst_global *g = v ? NULL : karst_global_find(s, e->name);
    if (!v && !g) {
        const char *name = karst_lower_name(s, e->name);
        for (uint32_t i = 0; i < s->io->num_parameters; i++)
            if (!strcmp(name, s->io->parameters[i].name))
                karst_source_error(s->source, e->where, "copy it to a variable first",
                                   "'%s' is a parameter and cannot be %s", name, why);
        karst_lower_expression(s, e); /* says what is wrong with the name */
        karst_source_error(s->source, e->where, "copy it to a variable first", "'%s' cannot be %s", name, why);
    }
    if (v ? v->is_const : g->ast->is_const)
        karst_source_error(s->source, e->where, "leave out 'const' where it is declared",
                           "'%s' is const and cannot be %s", karst_lower_name(s, e->name), why);
    const karst_type *type = v ? v->type : g->type;
    if (g)
        g->written = true;
    karst_place place = {.type = type, .num_choices = 1, .slots = new_slots(s, type->num_scalars, e->where)};
    for (uint32_t i = 0; i < type->num_scalars; i++)
        place.slots[i] = (v ? v->slot : g->slot) + i;
    return place;
}

/* The parts of each choice given by `offset`, `n` of them. */
static karst_place sub_place(karst_lower_state *s, const karst_place *whole, const karst_type *type,
                             const uint32_t *offset, uint32_t where)
{
    uint32_t n = type->num_scalars, all = whole->type->num_scalars;
    karst_place place = {.type = type, .num_choices = whole->num_choices, .index = whole->index};
    place.slots = new_slots(s, (uint64_t)n * whole->num_choices, where);
    for (uint32_t k = 0; k < whole->num_choices; k++)
        for (uint32_t i = 0; i < n; i++)
            place.slots[k * n + i] = whole->slots[k * all + offset[i]];
    return place;
}

static karst_place member_place(karst_lower_state *s, const karst_ast_expr *e, const char *why)
{
    karst_place whole = karst_lower_place(s, e->a, why);
    const karst_type *type;
    uint32_t *offset;
    if (whole.type->shape == KARST_SHAPE_STRUCT) {
        const karst_field *field = find_field(s, whole.type, e->name, e->where);
        type = field->type;
        offset = new_slots(s, type->num_scalars, e->where);
        for (uint32_t i = 0; i < type->num_scalars; i++)
            offset[i] = field->offset + i;
    } else {
        uint8_t part[4];
        uint32_t n = whole.type->shape == KARST_SHAPE_VECTOR || whole.type->shape == KARST_SHAPE_MATRIX
                         ? swizzle(s, karst_lower_name(s, e->name), whole.type, e->where, part)
                         : 0;
        if (!n)
            no_member(s, whole.type, e->name, e->where);
        offset = new_slots(s, n, e->where);
        for (uint32_t i = 0; i < n; i++) {
            offset[i] = part[i];
            for (uint32_t j = 0; j < i; j++)
                if (part[j] == part[i])
                    karst_source_error(s->source, e->where, NULL, "'.%s' names a component twice and cannot be %s",
                                       karst_lower_name(s, e->name), why);
        }
        type = karst_type_vector(whole.type->scalar, n);
    }
    return sub_place(s, &whole, type, offset, e->where);
}

static karst_place index_place(karst_lower_state *s, const karst_ast_expr *e, const char *why)
{
    karst_place whole = karst_lower_place(s, e->a, why);
    check_indexable(s, whole.type, e->where);
    const karst_type *element = whole.type->element;
    uint32_t known, n = element->num_scalars, count = whole.type->count;
    karst_expr index;
    if (lower_index(s, e->b, whole.type, &known, &index)) {
        uint32_t *offset = new_slots(s, n, e->where);
        for (uint32_t i = 0; i < n; i++)
            offset[i] = known * n + i;
        return sub_place(s, &whole, element, offset, e->where);
    }
    /* The elements of one choice lie one behind the other, and so do those of the next: the slots are the same, the
     * choices more. */
    karst_place place = {
        .type = element, .num_choices = whole.num_choices * count, .slots = whole.slots, .index = index};
    if (whole.num_choices > 1) {
        if (place.num_choices > KARST_MAX_SELECT_ENTRIES)
            karst_source_error(s->source, e->where, NULL, "varying indices pick from at most %u elements together",
                               KARST_MAX_SELECT_ENTRIES);
        karst_expr outer =
            karst_expr_2(s->graph, KARST_OP_INT_MULTIPLY, whole.index, karst_graph_int(s->graph, (int32_t)count));
        place.index = karst_expr_2(s->graph, KARST_OP_INT_ADD, outer, index);
    }
    return place;
}

karst_place karst_lower_place(karst_lower_state *s, const karst_ast_expr *e, const char *why)
{
    karst_lower_enter(s, e->where);
    karst_place place;
    switch (e->kind) {
    case KARST_AST_NAME:
        place = name_place(s, e, why);
        break;
    case KARST_AST_MEMBER:
        place = member_place(s, e, why);
        break;
    case KARST_AST_INDEX:
        place = index_place(s, e, why);
        break;
    default:
        karst_source_error(s->source, e->where, "name a variable", "this cannot be %s", why);
    }
    karst_lower_leave(s);
    return place;
}

karst_value karst_place_read(karst_lower_state *s, const karst_place *place, uint32_t where)
{
    uint32_t n = place->type->num_scalars;
    karst_value r = karst_value_new(s, place->type, where);
    karst_expr choices[KARST_MAX_SELECT_ENTRIES];
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t k = 0; k < place->num_choices; k++)
            choices[k] = s->slots[place->slots[k * n + i]];
        r.e[i] = place->num_choices == 1 ? choices[0] : pick(s, place->index, choices, 1, place->num_choices);
    }
    return r;
}

void karst_place_write(karst_lower_state *s, const karst_place *place, karst_value value)
{
    uint32_t n = place->type->num_scalars;
    s->steps += n * place->num_choices / 4; /* long arrays take their time */
    for (uint32_t k = 0; k < place->num_choices; k++) {
        karst_expr here = place->num_choices == 1 ? s->yes
                                                  : karst_expr_2(s->graph, KARST_OP_EQUAL, place->index,
                                                                 karst_graph_int(s->graph, (int32_t)k));
        for (uint32_t i = 0; i < n; i++) {
            uint32_t slot = place->slots[k * n + i];
            karst_slot_set(s, slot, karst_expr_3(s->graph, KARST_OP_SELECT, here, value.e[i], s->slots[slot]));
        }
    }
}
