/* Values that are known now, conversions, and what types are called in messages. */
#include "producers/language/front/lower_internal.h"

#include "producers/language/graph/uniform.h"

/* ---- constants ---- */

/* `reads` notes the parameters that decide it. */
static bool known_value(karst_lower_state *s, karst_expr e, bool *reads, karst_number *number)
{
    karst_number values[KARST_MAX_PARAMETERS + 16];
    for (uint32_t i = 0; i < s->io->num_parameters; i++)
        values[i] = s->io->parameters[i].value;
    return karst_graph_is_uniform(s->graph, e) && karst_uniform_value(s->graph, e, values, reads, number);
}

bool karst_lower_is_known(karst_lower_state *s, karst_expr e)
{
    bool reads[KARST_MAX_PARAMETERS + 16] = {false};
    karst_number number;
    return known_value(s, e, reads, &number);
}

bool karst_lower_try_constant(karst_lower_state *s, karst_expr e, karst_number *number)
{
    const karst_number *known = karst_graph_constant(s->graph, e);
    if (known) {
        *number = *known;
        return true;
    }
    bool reads[KARST_MAX_PARAMETERS + 16] = {false};
    if (!known_value(s, e, reads, number))
        return false;
    for (uint32_t i = 0; i < s->io->num_parameters; i++)
        s->io->parameters[i].is_structural |= reads[i];
    return true;
}

karst_number karst_lower_constant(karst_lower_state *s, karst_expr e, const char *what, uint32_t where)
{
    karst_number n;
    if (!karst_lower_try_constant(s, e, &n))
        karst_source_error(s->source, where, "use a number, a const or a parameter",
                           "%s must not depend on the position", what);
    return n;
}

/* ---- conversions ---- */

karst_value karst_lower_convert(karst_lower_state *s, karst_value value, const karst_type *to, const char *context,
                                uint32_t where)
{
    int cost = karst_type_conversion(value.type, to);
    if (cost < 0 && to->shape == KARST_SHAPE_VECTOR && value.type->shape == KARST_SHAPE_SCALAR &&
        karst_type_conversion(value.type, karst_type_vector(to->scalar, 1)) >= 0) { /* HLSL's float3 v = 1 */
        karst_value all = karst_value_new(s, to, where);
        for (uint32_t i = 0; i < to->num_scalars; i++)
            all.e[i] = karst_expr_convert(s->graph, to->scalar, value.e[0]);
        return all;
    }
    if (cost < 0 && value.type == karst_type_vector(KARST_TYPE_BOOL, 1) && to->shape == KARST_SHAPE_SCALAR &&
        (to->scalar == KARST_TYPE_INT || to->scalar == KARST_TYPE_UINT))
        cost = 1; /* C's int is_near = p.x < 1.0 */
    if (cost < 0) {
        const char *hint = NULL;
        if (value.type->shape == KARST_SHAPE_VOID)
            karst_source_error(s->source, where, NULL, "%s needs %s, but this gives no value", context,
                               karst_a_type(s, to));
        if (karst_type_is_plain(value.type) && karst_type_is_plain(to) && value.type->size == to->size)
            hint = karst_format(s->arena, "write %s(...)", to->name);
        else if (karst_type_is_plain(value.type) && karst_type_is_plain(to) && value.type->size > to->size)
            hint = karst_format(s->arena, "take a part of it, such as .%.*s", (int)to->size, "xyz");
        else if (karst_type_is_plain(to) && value.type->shape == KARST_SHAPE_SCALAR)
            hint = karst_format(s->arena, "write %s(...)", to->name);
        karst_source_error(s->source, where, hint, "%s needs %s, not %s", context, karst_a_type(s, to),
                           karst_a_type(s, value.type));
    }
    if (cost == 0)
        return value;
    karst_value r = karst_value_new(s, to, where);
    for (uint32_t i = 0; i < to->num_scalars; i++)
        r.e[i] = karst_expr_convert(s->graph, to->scalar, value.e[i]);
    return r;
}

/* ---- messages ---- */

const char *karst_type_list(karst_lower_state *s, const karst_value *arguments, uint32_t count)
{
    char *text = karst_format(s->arena, "(");
    for (uint32_t i = 0; i < count && i < 8; i++)
        text = karst_format(s->arena, "%s%s%s", text, i ? ", " : "", arguments[i].type->name);
    return karst_format(s->arena, "%s%s)", text, count > 8 ? ", ..." : "");
}

const char *karst_a_type(karst_lower_state *s, const karst_type *type)
{
    return karst_format(s->arena, "%s%s", karst_type_article(type), type->name);
}
