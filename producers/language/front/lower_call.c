/* Calls: which function is meant, constructors, inlining. */
#include "producers/language/front/lower_internal.h"

#include <string.h>

/* ---- constructors ---- */

static karst_value construct_matrix(karst_lower_state *s, const karst_type *type, const karst_value *arguments,
                                    uint32_t count, uint32_t where)
{
    karst_value r = karst_value_zero(s, type, where);
    const uint32_t rows = type->size, columns = type->count;
    if (count == 1 && arguments[0].type->shape == KARST_SHAPE_SCALAR) { /* a diagonal */
        for (uint32_t i = 0; i < rows && i < columns; i++)
            r.e[i * rows + i] = karst_expr_convert(s->graph, KARST_TYPE_FLOAT, arguments[0].e[0]);
        return r;
    }
    if (count == 1 && arguments[0].type->shape ==
                          KARST_SHAPE_MATRIX) { /* the upper left of a larger, the rest as in the unit matrix */
        const karst_type *from = arguments[0].type;
        for (uint32_t i = 0; i < columns; i++)
            for (uint32_t j = 0; j < rows; j++)
                r.e[i * rows + j] = i < from->count && j < from->size ? arguments[0].e[i * from->size + j]
                                                                      : karst_graph_float(s->graph, i == j);
        return r;
    }
    uint32_t filled = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (!karst_type_is_plain(arguments[i].type))
            karst_source_error(s->source, where, NULL, "%s is not made from %s", karst_a_type(s, type),
                               karst_a_type(s, arguments[i].type));
        for (uint32_t k = 0; k < arguments[i].type->num_scalars; k++) {
            if (filled == type->num_scalars)
                karst_source_error(s->source, where, NULL, "%s has %u numbers; %s has more", karst_a_type(s, type),
                                   type->num_scalars, karst_type_list(s, arguments, count));
            r.e[filled++] = karst_expr_convert(s->graph, KARST_TYPE_FLOAT, arguments[i].e[k]);
        }
    }
    if (filled != type->num_scalars)
        karst_source_error(s->source, where, NULL, "%s has %u numbers, not %u", karst_a_type(s, type),
                           type->num_scalars, filled);
    return r;
}

static karst_value construct_plain(karst_lower_state *s, const karst_type *type, const karst_value *arguments,
                                   uint32_t count, uint32_t where)
{
    karst_value r = karst_value_new(s, type, where);
    uint32_t filled = 0;
    for (uint32_t i = 0; i < count; i++) {
        const karst_type *from = arguments[i].type;
        if (!karst_type_is_plain(from) && from->shape != KARST_SHAPE_MATRIX)
            karst_source_error(s->source, where, NULL, "%s is not made from %s", karst_a_type(s, type),
                               karst_a_type(s, from));
        if (filled == type->num_scalars)
            karst_source_error(s->source, where, "leave out what is too much", "%s has %u component%s; %s has more",
                               karst_a_type(s, type), type->num_scalars, type->num_scalars == 1 ? "" : "s",
                               karst_type_list(s, arguments, count));
        for (uint32_t k = 0; k < from->num_scalars && filled < type->num_scalars; k++)
            r.e[filled++] = karst_expr_convert(s->graph, type->scalar, arguments[i].e[k]);
    }
    if (count == 1 && filled == 1) /* one number for all components */
        for (; filled < type->num_scalars; filled++)
            r.e[filled] = r.e[0];
    if (filled != type->num_scalars)
        karst_source_error(s->source, where, NULL, "%s has %u components, not %u", karst_a_type(s, type),
                           type->num_scalars, filled);
    return r;
}

karst_value karst_lower_construct(karst_lower_state *s, const karst_ast_expr *e)
{
    karst_value arguments[KARST_MAX_ARGUMENTS];
    uint32_t count = 0;
    const karst_type *type = karst_lower_type(s, e->of, e->a, e->where);
    if (type->shape == KARST_SHAPE_VOID)
        karst_source_error(s->source, e->where, NULL, "there is no value of type void");
    if (type->shape == KARST_SHAPE_ARRAY || type->shape == KARST_SHAPE_STRUCT) {
        karst_ast_expr list = {.kind = KARST_AST_LIST, .where = e->where, .a = e->a};
        return karst_lower_initialiser(s, &list, type);
    }
    for (const karst_ast_expr *a = e->a; a; a = a->next) {
        if (count == 16)
            karst_source_error(s->source, a->where, NULL, "%s is not made from that many values",
                               karst_a_type(s, type));
        arguments[count++] = karst_lower_expression(s, a);
    }
    if (!count)
        karst_source_error(s->source, e->where, karst_format(s->arena, "write %s(0)", type->name), "%s() needs a value",
                           type->name);
    return type->shape == KARST_SHAPE_MATRIX ? construct_matrix(s, type, arguments, count, e->where)
                                             : construct_plain(s, type, arguments, count, e->where);
}

/* ---- which function ---- */

/* The cost of calling f so: conversions needed; -1: impossible. */
static int call_cost(karst_lower_state *s, const karst_ast_function *f, const karst_value *arguments, uint32_t count)
{
    if (count > f->num_parameters || count + f->num_defaults < f->num_parameters)
        return -1;
    int cost = 0;
    const karst_ast_variable *p = f->parameters;
    for (uint32_t i = 0; i < count; i++, p = p->next) {
        if (p->type.unsupported)
            return -1;
        const karst_type *type = karst_lower_type(s, &p->type, NULL, p->where);
        int one = p->is_out ? (arguments[i].type == type ? 0 : -1) : karst_type_conversion(arguments[i].type, type);
        if (one < 0)
            return -1;
        cost += one;
    }
    return cost;
}

static const char *signature(karst_lower_state *s, const karst_ast_function *f)
{
    const char *text = karst_format(s->arena, "%s(", karst_lower_name(s, f->name));
    for (const karst_ast_variable *p = f->parameters; p; p = p->next)
        text = karst_format(
            s->arena, "%s%s%s%s", text, p == f->parameters ? "" : ", ", p->is_out ? (p->is_in ? "inout " : "out ") : "",
            p->type.unsupported ? p->type.unsupported : karst_lower_type(s, &p->type, NULL, p->where)->name);
    return karst_format(s->arena, "%s)", text);
}

/* The best of the functions of that name in one layer. *any says whether there is one at all. */
static karst_ast_function *find_function(karst_lower_state *s, uint32_t name, bool in_prelude,
                                         const karst_value *arguments, uint32_t count, uint32_t where, bool *any)
{
    karst_ast_function *best = NULL;
    int best_cost = 0;
    bool tie = false;
    for (karst_ast_function *f = karst_parser_named(s->parser, name); f; f = f->named_next) {
        if (f->name != name || f->is_prelude != in_prelude)
            continue;
        *any = true;
        int cost = call_cost(s, f, arguments, count);
        if (cost < 0 || (best && cost > best_cost) || (best && cost == best_cost && !f->body))
            continue;
        tie = best && cost == best_cost && best->body;
        best = f;
        best_cost = cost;
    }
    if (tie)
        karst_source_error(s->source, where, "convert the arguments by hand", "two functions '%s' fit %s equally well",
                           karst_lower_name(s, name), karst_type_list(s, arguments, count));
    return best;
}

static _Noreturn void no_fit(karst_lower_state *s, uint32_t name, bool in_prelude, const karst_value *arguments,
                             uint32_t count, uint32_t where)
{
    const char *hint = NULL;
    int listed = 0;
    for (const karst_ast_function *f = karst_parser_named(s->parser, name); f; f = f->named_next)
        if (f->name == name && f->is_prelude == in_prelude && listed++ < 4)
            hint = hint ? karst_format(s->arena, "%s, %s", hint, signature(s, f))
                        : karst_format(s->arena, "there is %s", signature(s, f));
    karst_source_error(s->source, where, hint, "no function '%s' takes %s", karst_lower_name(s, name),
                       karst_type_list(s, arguments, count));
}

static const struct {
    const char *name, *instead;
} refused[] = {
    {"texture", "use noise(p), or name a file in the header's \"data\""},
    {"texture2D", "use noise(p) or write a function"},
    {"textureLod", "use noise(p) or write a function"},
    {"texelFetch", "use noise(p) or write a function"},
    {"textureCube", "use noise(p) or write a function"},
    {"tex3D", "use noise(p) or write a function"},
    {"dFdx", "compute a difference of two calls"},
    {"dFdy", "compute a difference of two calls"},
    {"fwidth", "detail is faded out without it: use a constant"},
};

static _Noreturn void unknown_function(karst_lower_state *s, uint32_t name, uint32_t where)
{
    const char *text = karst_lower_name(s, name);
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++)
        if (!strcmp(text, refused[i].name))
            karst_source_error(s->source, where, refused[i].instead,
                               "a world has no screen and no textures, so there is no '%s'", text);
    if (karst_variable_find(s, name))
        karst_source_error(s->source, where, NULL, "'%s' is a variable, not a function", text);
    karst_nearest nearest = karst_nearest_begin(text, strlen(text));
    for (const karst_ast_function *f = s->parser->functions; f; f = f->next)
        karst_nearest_offer(&nearest, karst_lower_name(s, f->name));
    karst_offer_builtins(&nearest);
    karst_source_error(s->source, where, karst_nearest_hint(&nearest, s->arena), "there is no function '%s'", text);
}

/* Functions of OpenCL C, C and HLSL that are others by another name. */
static const struct {
    const char *name, *is;
} spelt[] = {{"countbits", "bitCount"},    {"popcount", "bitCount"},     {"firstbithigh", "findMSB"},
             {"firstbitlow", "findLSB"},   {"reversebits", "bitfieldReverse"}, {"asint", "floatBitsToInt"},
             {"asuint", "floatBitsToUint"}, {"as_int", "floatBitsToInt"}, {"as_uint", "floatBitsToUint"},
             {"as_float", "asfloat"}};

static bool is_function(const karst_lower_state *s, uint32_t name);

/* native_sin, half_sqrt, fast_length and sinf are sin, sqrt, length and sin. A name that is none stays. */
static uint32_t usual_spelling(const karst_lower_state *s, uint32_t name)
{
    static const char *const fronts[] = {"native_", "half_", "fast_"};
    const char *text = karst_lower_name(s, name);
    size_t length = strlen(text);
    for (size_t i = 0; i < sizeof spelt / sizeof *spelt; i++)
        if (!strcmp(text, spelt[i].name))
            return karst_names_id(s->names, spelt[i].is, strlen(spelt[i].is));
    uint32_t other = name;
    for (size_t i = 0; i < sizeof fronts / sizeof *fronts; i++)
        if (!strncmp(text, fronts[i], strlen(fronts[i])) && length > strlen(fronts[i]))
            other = karst_names_id(s->names, text + strlen(fronts[i]), length - strlen(fronts[i]));
    if (other == name && length > 3 && text[length - 1] == 'f')
        other = karst_names_id(s->names, text, length - 1);
    return is_function(s, other) ? other : name;
}

static bool is_function(const karst_lower_state *s, uint32_t name)
{
    for (const karst_ast_function *f = karst_parser_named(s->parser, name); f; f = f->named_next)
        if (f->name == name && (f->is_prelude || !karst_in_prelude(s)))
            return true;
    return karst_is_builtin(karst_lower_name(s, name));
}

/* ---- inlining ---- */

/* The variable that `e` is, or is a part of; NULL: none. *has_index: which part is worked out. */
static const karst_ast_expr *root_of(const karst_ast_expr *e, bool *has_index)
{
    while (e->kind == KARST_AST_MEMBER || e->kind == KARST_AST_INDEX) {
        *has_index |= e->kind == KARST_AST_INDEX;
        e = e->a;
    }
    return e->kind == KARST_AST_NAME ? e : NULL;
}

static bool may_change(const karst_lower_state *s, uint32_t name, uint32_t argument)
{
    for (const karst_ast_function *f = karst_parser_named(s->parser, name); f; f = f->named_next) {
        const karst_ast_variable *p = f->name == name && !f->is_prelude ? f->parameters : NULL;
        for (uint32_t i = 0; p && i < argument; i++)
            p = p->next;
        if (p && p->is_out)
            return true;
    }
    return false;
}

/* Where an argument is that the call may change, if finding it evaluates an index: that is done once, before the call.
 */
static bool find_place(karst_lower_state *s, uint32_t function, uint32_t argument, const karst_ast_expr *text,
                       karst_place *place)
{
    bool has_index = false;
    const karst_ast_expr *root = root_of(text, &has_index);
    if (!root || !has_index || karst_in_prelude(s) || !may_change(s, function, argument))
        return false;
    const karst_variable *v = karst_variable_find(s, root->name);
    const karst_global *g = v ? NULL : karst_global_find(s, root->name);
    if (v ? v->is_const : !g || g->ast->is_const)
        return false;
    *place = karst_lower_place(s, text, "changed by this call");
    return true;
}

static void copy_out(karst_lower_state *s, const karst_argument_place *to, karst_value value)
{
    karst_place place = to->is_found ? to->place : karst_lower_place(s, to->text, "changed by this call");
    karst_place_write(s, &place, value);
}

/* What a parameter is that a call leaves out: told outside of all functions, where it stands. */
static karst_value default_value(karst_lower_state *s, const karst_ast_function *f, const karst_ast_variable *p,
                                 const karst_type *type)
{
    karst_frame frame = s->frame;
    karst_ast_function here = {.is_prelude = f->is_prelude};
    s->frame = (karst_frame){.function = &here, .first_variable = s->num_variables};
    karst_value value = karst_lower_initialiser(s, p->value, type);
    s->frame = frame;
    return value;
}

karst_value karst_lower_function(karst_lower_state *s, karst_ast_function *f, const karst_value *arguments,
                                 uint32_t count, const karst_argument_place *places, uint32_t where)
{
    const char *name = karst_lower_name(s, f->name);
    if (!f->body)
        karst_source_error(s->source, where, "write its body", "function '%s' is declared, but has no body", name);
    if (f->busy)
        karst_source_error(s->source, where, "write a loop with a bound", "'%s' calls itself: there is no recursion",
                           name);
    if (s->inlined >= KARST_MAX_INLINING)
        karst_source_error(s->source, where, NULL, "calls are nested deeper than %u", KARST_MAX_INLINING);
    if (!f->statement)
        karst_parse_body(s->parser, f);
    const karst_type *result_type = karst_lower_type(s, &f->result, NULL, f->where);
    karst_value result = karst_value_zero(s, result_type, where);
    karst_frame caller = s->frame;
    size_t num_variables = s->num_variables;
    uint32_t *formal = NULL; /* slots of the parameters */
    formal = karst_arena_alloc(s->arena, (f->num_parameters + 1) * sizeof *formal);
    const karst_ast_variable *p = f->parameters;
    for (uint32_t i = 0; i < f->num_parameters; i++, p = p->next) {
        const karst_type *type = karst_lower_type(s, &p->type, NULL, p->where);
        karst_value value = i >= count ? default_value(s, f, p, type)
                            : p->is_in ? karst_lower_convert(s, arguments[i], type, "this argument", where)
                                       : karst_value_zero(s, type, where);
        karst_variable *v = karst_variable_declare(s, p->name, type, p->is_const, where);
        formal[i] = v->slot;
        memcpy(s->slots + v->slot, value.e, type->num_scalars * sizeof *value.e);
    }
    s->frame = (karst_frame){.function = f,
                             .result_type = result_type,
                             .result = karst_slot_index(s, result.e),
                             .first_variable = num_variables};
    f->busy = true;
    s->inlined++;
    karst_lower_body(s, f->statement);
    s->inlined--;
    f->busy = false;
    s->frame = caller;
    s->num_variables = num_variables;
    p = f->parameters;
    for (uint32_t i = 0; i < count; i++, p = p->next)
        if (p->is_out && places)
            copy_out(s, &places[i],
                     (karst_value){.type = karst_lower_type(s, &p->type, NULL, p->where), .e = s->slots + formal[i]});
    if (result_type->shape != KARST_SHAPE_VOID)
        s->top = karst_slot_index(s, result.e) + result_type->num_scalars; /* the callee's variables are gone */
    return result;
}

/* Functions of data: the first argument is a name of the header's, no value. */
static const struct {
    const char *name;
    uint32_t num_arguments; /* behind the data's name */
    uint8_t size[3];        /* of each */
    const char *wanted[3];
} of_data[] = {
    {"image", 1, {2}, {"the place in an image"}},
    {"field", 1, {3}, {"the place in a field"}},
    {"texture", 3, {3, 3, 1}, {"the place of a texture", "the normal of a texture", "the size of a texture"}},
};
enum { DATA_IMAGE, DATA_FIELD, DATA_TEXTURE, NUM_DATA_FUNCTIONS };

/* Which of them a call is; NUM_DATA_FUNCTIONS: none. Fields and textures are other things to texts without data. */
static size_t data_function(const karst_lower_state *s, const karst_ast_expr *e)
{
    const char *name = karst_lower_name(s, e->name);
    size_t which = 0;
    while (which < NUM_DATA_FUNCTIONS && strcmp(name, of_data[which].name) != 0)
        which++;
    if (karst_in_prelude(s) || (which >= DATA_FIELD && !s->io->header->num_data))
        return NUM_DATA_FUNCTIONS;
    const karst_ast_function *f = which < NUM_DATA_FUNCTIONS ? karst_parser_named(s->parser, e->name) : NULL;
    for (; f; f = f->named_next)
        if (f->name == e->name && !f->is_prelude)
            return NUM_DATA_FUNCTIONS; /* the user's functions hide all others of that name */
    return which;
}

static karst_value call_of_data(karst_lower_state *s, const karst_ast_expr *e, size_t which)
{
    const karst_ast_expr *data = e->a, *a = data ? data->next : NULL;
    const char *name = data && data->kind == KARST_AST_NAME ? karst_lower_name(s, data->name) : NULL;
    karst_expr arguments[3][3] = {{s->zero, s->zero, s->zero}, {s->zero, s->zero, s->zero}, {s->zero}}, value[3];
    for (uint32_t i = 0; name && i < of_data[which].num_arguments; i++, a = a->next) {
        if (!a)
            karst_source_error(s->source, e->where, NULL, "write %s(%s, %s", of_data[which].name, name,
                               which == DATA_IMAGE   ? "p), p of two components"
                               : which == DATA_FIELD ? "p), p of three components"
                                                     : "p, n, size), p and n of three");
        karst_value v = karst_lower_convert(s, karst_lower_expression(s, a),
                                            karst_type_vector(KARST_TYPE_FLOAT, of_data[which].size[i]),
                                            of_data[which].wanted[i], a->where);
        memcpy(arguments[i], v.e, of_data[which].size[i] * sizeof *v.e);
    }
    if (name && a)
        karst_source_error(s->source, a->where, NULL, "%s(%s, ...) takes no more than %u arguments behind the name",
                           of_data[which].name, name, of_data[which].num_arguments);
    s->graph->where = e->where;
    const uint32_t where = data ? data->where : e->where;
    uint32_t count = 1;
    if (which == DATA_IMAGE)
        count = karst_lower_image(s, name, where, arguments[0], value);
    else if (which == DATA_FIELD)
        value[0] = karst_lower_field(s, name, where, arguments[0]);
    else
        count = karst_lower_texture(s, name, where, arguments[0], arguments[1], arguments[2][0], value);
    karst_value result = karst_value_new(s, karst_type_vector(KARST_TYPE_FLOAT, count), e->where);
    memcpy(result.e, value, count * sizeof *value);
    return result;
}

/* OpenCL's convert_float3(v), and with how it rounds behind it: what float3(v) is. NULL: it is none. */
static const karst_type *converts_to(const karst_lower_state *s, uint32_t function)
{
    const char *name = karst_lower_name(s, function), *type = name + strlen("convert_");
    if (strncmp(name, "convert_", strlen("convert_")) != 0)
        return NULL;
    char word[16];
    const size_t length = strcspn(type, "_");
    if (length >= sizeof word)
        return NULL;
    memcpy(word, type, length);
    word[length] = 0;
    return karst_type_named(word);
}

karst_value karst_lower_call(karst_lower_state *s, const karst_ast_expr *e)
{
    const karst_type *to = is_function(s, e->name) ? NULL : converts_to(s, e->name);
    if (to) {
        karst_ast_type of = {.base = to};
        karst_ast_expr made = {.kind = KARST_AST_CONSTRUCT, .where = e->where, .a = e->a, .of = &of};
        return karst_lower_construct(s, &made);
    }
    karst_value arguments[KARST_MAX_ARGUMENTS], result;
    const size_t of_file = data_function(s, e);
    if (of_file < NUM_DATA_FUNCTIONS)
        return call_of_data(s, e, of_file);
    const uint32_t name = is_function(s, e->name) ? e->name : usual_spelling(s, e->name);
    if (!is_function(s, name))
        unknown_function(s, name, e->where);
    karst_argument_place places[KARST_MAX_ARGUMENTS];
    uint32_t count = 0;
    for (const karst_ast_expr *a = e->a; a; a = a->next) {
        if (count == KARST_MAX_ARGUMENTS)
            karst_source_error(s->source, a->where, NULL, "a call may have %u arguments", KARST_MAX_ARGUMENTS);
        karst_argument_place *at = &places[count];
        at->text = a;
        at->is_found = find_place(s, name, count, a, &at->place);
        arguments[count++] = at->is_found ? karst_place_read(s, &at->place, a->where) : karst_lower_expression(s, a);
    }
    bool any = false;
    karst_ast_function *f = NULL;
    if (!karst_in_prelude(s))
        f = find_function(s, name, false, arguments, count, e->where, &any);
    if (!f && any) /* the user's functions hide all others of that name */
        no_fit(s, name, false, arguments, count, e->where);
    if (!f)
        f = find_function(s, name, true, arguments, count, e->where, &any);
    if (f) {
        karst_value value = karst_lower_function(s, f, arguments, count, places, e->where);
        s->graph->where = e->where;
        return value;
    }
    if (karst_lower_builtin(s, karst_lower_name(s, name), arguments, count, e->where, &result))
        return result;
    no_fit(s, name, true, arguments, count, e->where);
}
