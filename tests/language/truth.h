/* An interpreter of the language, for one lane, straight along the syntax tree: what a text says, done as C would do
 * it. No graph, no masks, nothing shared, mathematics of its own; only the parser is the language's. Order: from the
 * left to the right; of an assignment the place first, then the value. What was executed is noted by feature. */
#ifndef KARST_TESTS_LANGUAGE_TRUTH_H
#define KARST_TESTS_LANGUAGE_TRUTH_H

#include "tests/language/truth_built_ins.h"

#define TRUTH_FEATURES(F)                                                                                              \
    F(CALL)                                                                                                            \
    F(CALL_WITH_OWN_PARAMETER_CHANGED)                                                                                 \
    F(CALL_IN_CHOICE) F(CALL_OF_SEVERAL_ARGUMENTS) F(OVERLOAD) F(OUT) F(INOUT) F(OUT_OF_ELEMENT) F(GLOBAL_READ)        \
        F(GLOBAL_WRITTEN) F(GLOBAL_INITIALISER_OF_GLOBAL) F(EARLY_RETURN) F(RETURN_IN_LOOP) F(CHOICE) F(NESTED_CHOICE) \
            F(IF) F(ELSE) F(FOR) F(NESTED_FOR) F(BREAK) F(CONTINUE) F(LOOP_CONDITION_OF_SEVERAL)                       \
                F(ARRAY_CONSTANT_INDEX) F(ARRAY_VARYING_INDEX) F(ARRAY_WRITTEN) F(STRUCT_FIELD) F(STRUCT_WRITTEN)      \
                    F(SWIZZLE) F(SWIZZLE_WRITTEN) F(COMPOUND) F(STEP_PREFIX) F(STEP_POSTFIX) F(AND) F(OR)              \
                        F(SHORT_CIRCUIT_SKIPS) F(ASSIGNMENT_AS_VALUE) F(COMMA) F(MATRIX_PRODUCT) F(MATRIX_COLUMN)      \
                            F(INT) F(UINT) F(BITS) F(SHADOWED) F(WHILE) F(DO) F(VECTOR_COMPARISON) F(CONVERSION)       \
                                F(MACRO) F(LIST) F(SWITCH) F(SWITCH_DEFAULT) \
                                    F(SWITCH_FALLS_THROUGH) F(CONTINUE_IN_SWITCH) F(LENGTH) F(CHOICE_OF_TWO_TYPES) \
                                        F(BOUND_OF_CHOICE) F(ARRAY_OF_ARRAYS) F(DEFAULT_ARGUMENT)

#define TRUTH_NAME_OF(name) TRUTH_##name,
enum { TRUTH_FEATURES(TRUTH_NAME_OF) NUM_TRUTH_FEATURES };
#define TRUTH_TEXT_OF(name) #name,
static const char *const truth_feature_names[] = {TRUTH_FEATURES(TRUTH_TEXT_OF)};

typedef struct {
    uint32_t name;
    value v;
} variable;

typedef struct {
    karst_ast_variable *ast;
    value v;
    bool ready;
} global_variable;

enum { TRUTH_MOST_VARIABLES = 512, TRUTH_MOST_GLOBALS = 64, TRUTH_MOST_STEPS = 1000000 };

typedef struct {
    karst_arena arena;
    karst_source source;
    karst_names names;
    karst_parser parser;
    karst_array_types arrays;
    jmp_buf escape;
    variable variables[TRUTH_MOST_VARIABLES];
    uint32_t num_variables, first_variable;
    global_variable globals[TRUTH_MOST_GLOBALS];
    uint32_t num_globals, steps, depth, num_loops, num_switches, in_choice;
    value result;
    bool seen[NUM_TRUTH_FEATURES];
} truth;

typedef enum { GOES_ON, BREAKS, CONTINUES, RETURNS } way;

static value evaluate(truth *t, const karst_ast_expr *e);
static way execute(truth *t, const karst_ast_statement *first);

static void step(truth *t)
{
    if (++t->steps > TRUTH_MOST_STEPS)
        give_up("too many steps");
}

static const char *spelt(const truth *t, uint32_t name) { return karst_name_text(&t->names, name); }

static const karst_type *resolve_type(truth *t, const karst_ast_type *type, uint32_t count);

static const karst_type *struct_of(truth *t, karst_ast_struct *s)
{
    if (s->type)
        return s->type;
    karst_type *type = karst_arena_alloc(&t->arena, sizeof *type);
    *type = (karst_type){.shape = KARST_SHAPE_STRUCT, .name = spelt(t, s->name)};
    type->fields = karst_arena_alloc(&t->arena, KARST_MAX_FIELDS * sizeof *type->fields);
    for (const karst_ast_variable *f = s->fields; f; f = f->next) {
        karst_field *field = &type->fields[type->num_fields++];
        *field = (karst_field){.name = f->name, .type = resolve_type(t, &f->type, 0), .offset = type->num_scalars};
        type->num_scalars += field->type->num_scalars;
    }
    return s->type = type;
}

static const karst_type *array_of(truth *t, const karst_type *base, const karst_ast_expr *size, uint32_t count)
{
    if (!size)
        return base;
    if (size->kind != KARST_AST_LIST)
        count = (uint32_t)evaluate(t, size).c[0].v;
    return karst_type_array(&t->arrays, array_of(t, base, size->next, 0), count);
}

static const karst_type *resolve_type(truth *t, const karst_ast_type *type, uint32_t count)
{
    return array_of(t, type->base ? type->base : struct_of(t, type->structure), type->size, count);
}

/* ---- variables ---- */

static void declare(truth *t, uint32_t name, value v)
{
    if (t->num_variables == TRUTH_MOST_VARIABLES)
        give_up("too many variables");
    for (uint32_t i = t->first_variable; i < t->num_variables; i++)
        t->seen[TRUTH_SHADOWED] |= t->variables[i].name == name;
    t->variables[t->num_variables++] = (variable){name, copy_of(v)};
}

static value initial(truth *t, const karst_ast_expr *e, const karst_type *type)
{
    if (e->kind != KARST_AST_LIST)
        return copy_of(convert(evaluate(t, e), type));
    value r = new_value(type);
    uint32_t i = 0;
    t->seen[TRUTH_LIST] = true;
    for (const karst_ast_expr *a = e->a; a; a = a->next, i++) {
        bool is_struct = type->shape == KARST_SHAPE_STRUCT;
        const karst_type *part = is_struct ? type->fields[i].type : type->element;
        memcpy(r.c + (is_struct ? type->fields[i].offset : i * part->num_scalars), initial(t, a, part).c,
               part->num_scalars * sizeof(cell));
    }
    return r;
}

static uint32_t list_length(const karst_ast_variable *v)
{
    uint32_t n = 0;
    for (const karst_ast_expr *a = v->type.size && v->value ? v->value->a : NULL; a; a = a->next)
        n++;
    return n;
}

/* All of them, in the order of the text, before anything else. */
static void begin_globals(truth *t)
{
    t->num_globals = 0;
    for (karst_ast_variable *v = t->parser.globals; v; v = v->next) {
        if (t->num_globals == TRUTH_MOST_GLOBALS)
            give_up("too many globals");
        const karst_type *type = resolve_type(t, &v->type, list_length(v));
        bool before = t->seen[TRUTH_GLOBAL_READ];
        t->seen[TRUTH_GLOBAL_READ] = false;
        value begin = v->value ? initial(t, v->value, type) : new_value(type);
        t->seen[TRUTH_GLOBAL_INITIALISER_OF_GLOBAL] |= t->seen[TRUTH_GLOBAL_READ];
        t->seen[TRUTH_GLOBAL_READ] = before;
        t->globals[t->num_globals++] = (global_variable){v, begin, true};
    }
}

static value *find(truth *t, uint32_t name, bool *is_global)
{
    *is_global = false;
    for (uint32_t i = t->num_variables; i > t->first_variable; i--)
        if (t->variables[i - 1].name == name)
            return &t->variables[i - 1].v;
    *is_global = true;
    for (uint32_t i = 0; i < t->num_globals; i++)
        if (t->globals[i].ast->name == name)
            return &t->globals[i].v;
    give_up("no such variable");
}

/* ---- parts ---- */

static uint32_t swizzle_of(const char *name, uint8_t part[4])
{
    uint32_t n = 0;
    for (; name[n] && n < 4; n++) {
        const char *set = "xyzwrgbastpq", *at = strchr(set, name[n]);
        if (!at)
            give_up("no such component");
        part[n] = (uint8_t)((at - set) % 4);
    }
    return n;
}

static const karst_field *field_of(const karst_type *type, uint32_t name)
{
    for (uint32_t i = 0; i < type->num_fields; i++)
        if (type->fields[i].name == name)
            return &type->fields[i];
    give_up("no such field");
}

/* Held within the array, as WORLDS.md says. */
static uint32_t index_of(truth *t, const karst_ast_expr *e, const karst_type *type)
{
    value i = evaluate(t, e);
    double v = i.c[0].v, most = (double)type->count - 1;
    t->seen[e->kind == KARST_AST_NUMBER ? TRUTH_ARRAY_CONSTANT_INDEX : TRUTH_ARRAY_VARYING_INDEX] = true;
    t->seen[TRUTH_MATRIX_COLUMN] |= type->shape == KARST_SHAPE_MATRIX;
    t->seen[TRUTH_ARRAY_OF_ARRAYS] |= type->element->shape == KARST_SHAPE_ARRAY;
    return (uint32_t)(v < 0 ? 0 : v > most ? most : v);
}

static value part_of_value(value whole, const karst_type *type, uint32_t offset)
{
    return copy_of((value){type, whole.c + offset});
}

static value member(truth *t, const karst_ast_expr *e)
{
    value whole = evaluate(t, e->a);
    if (whole.type->shape == KARST_SHAPE_STRUCT) {
        const karst_field *f = field_of(whole.type, e->name);
        t->seen[TRUTH_STRUCT_FIELD] = true;
        return part_of_value(whole, f->type, f->offset);
    }
    uint8_t part[4];
    uint32_t n = swizzle_of(spelt(t, e->name), part);
    value r = new_value(type_of(whole.type->scalar, n));
    t->seen[TRUTH_SWIZZLE] |= n > 1;
    for (uint32_t i = 0; i < n; i++)
        r.c[i] = whole.c[part[i]];
    return r;
}

static place find_place(truth *t, const karst_ast_expr *e)
{
    step(t);
    if (e->kind == KARST_AST_NAME) {
        bool is_global;
        value *v = find(t, e->name, &is_global);
        place p = {v->type, take(v->type->num_scalars * sizeof *p.at)};
        t->seen[TRUTH_GLOBAL_WRITTEN] |= is_global;
        for (uint32_t i = 0; i < v->type->num_scalars; i++)
            p.at[i] = &v->c[i];
        return p;
    }
    place whole = find_place(t, e->a);
    if (e->kind == KARST_AST_INDEX) {
        const karst_type *element = whole.type->element;
        uint32_t i = index_of(t, e->b, whole.type);
        t->seen[TRUTH_ARRAY_WRITTEN] |= whole.type->shape == KARST_SHAPE_ARRAY;
        return (place){element, whole.at + i * element->num_scalars};
    }
    if (e->kind != KARST_AST_MEMBER)
        give_up("no place");
    if (whole.type->shape == KARST_SHAPE_STRUCT) {
        const karst_field *f = field_of(whole.type, e->name);
        t->seen[TRUTH_STRUCT_WRITTEN] = true;
        return (place){f->type, whole.at + f->offset};
    }
    uint8_t part[4];
    uint32_t n = swizzle_of(spelt(t, e->name), part);
    place p = {type_of(whole.type->scalar, n), take(n * sizeof *p.at)};
    t->seen[TRUTH_SWIZZLE_WRITTEN] |= n > 1;
    for (uint32_t i = 0; i < n; i++)
        p.at[i] = whole.at[part[i]];
    return p;
}

static value read_place(place p)
{
    value r = new_value(p.type);
    for (uint32_t i = 0; i < p.type->num_scalars; i++)
        r.c[i] = *p.at[i];
    return r;
}

static void write_place(place p, value v)
{
    for (uint32_t i = 0; i < p.type->num_scalars; i++)
        *p.at[i] = v.c[i];
}

/* ---- calls ---- */

static karst_ast_function *choose_function(truth *t, uint32_t name, const value *a, uint32_t count)
{
    karst_ast_function *best = NULL;
    int best_cost = 0, num_of_name = 0;
    for (karst_ast_function *f = t->parser.functions; f; f = f->next) {
        if (f->name != name || !f->body)
            continue;
        num_of_name++;
        int cost = 0;
        uint32_t i = 0;
        for (const karst_ast_variable *p = f->parameters; p && i < count && cost >= 0; p = p->next, i++) {
            int one_cost = conversion(a[i].type, resolve_type(t, &p->type, 0));
            cost = one_cost < 0 || (one_cost && p->is_out) ? -1 : cost + one_cost;
        }
        if (cost < 0 || f->num_parameters < count || f->num_parameters - f->num_defaults > count ||
            (best && cost >= best_cost))
            continue;
        best = f;
        best_cost = cost;
    }
    t->seen[TRUTH_OVERLOAD] |= num_of_name > 1;
    if (num_of_name && !best)
        give_up("no function takes these");
    return best;
}

static value call(truth *t, const karst_ast_expr *e)
{
    value a[KARST_MAX_ARGUMENTS] = {{0}}, result;
    place places[KARST_MAX_ARGUMENTS];
    uint32_t count = 0;
    /* Candidates differ in types, not in which parameters go out, in every text that is interpreted here. */
    const karst_ast_function *like = t->parser.functions;
    while (like && like->name != e->name)
        like = like->next;
    const karst_ast_variable *p = like ? like->parameters : NULL;
    for (const karst_ast_expr *x = e->a; x; x = x->next, count++) {
        if (p && p->is_out) {
            places[count] = find_place(t, x);
            t->seen[TRUTH_OUT_OF_ELEMENT] |= x->kind == KARST_AST_INDEX;
            a[count] = read_place(places[count]);
        } else {
            a[count] = evaluate(t, x);
        }
        p = p ? p->next : NULL;
    }
    karst_ast_function *f = choose_function(t, e->name, a, count);
    if (!f) {
        if (!built_in(spelt(t, e->name), a, count, &result))
            give_up(spelt(t, e->name));
        t->seen[TRUTH_VECTOR_COMPARISON] |= result.type->scalar == KARST_TYPE_BOOL;
        return result;
    }
    if (!f->statement)
        karst_parse_body(&t->parser, f);
    if (++t->depth > 32)
        give_up("calls nested too deep");
    t->seen[TRUTH_CALL] = true;
    t->seen[TRUTH_CALL_IN_CHOICE] |= t->in_choice > 0;
    t->seen[TRUTH_CALL_OF_SEVERAL_ARGUMENTS] |= count > 1;
    uint32_t outer_first = t->first_variable, outer_num = t->num_variables, outer_loops = t->num_loops,
             outer_switches = t->num_switches, outer_choice = t->in_choice;
    value outer_result = t->result;
    const karst_type *type = resolve_type(t, &f->result, 0);
    t->first_variable = t->num_variables;
    t->num_loops = t->num_switches = t->in_choice = 0;
    uint32_t i = 0;
    for (p = f->parameters; p; p = p->next, i++)
        if (i >= count) { /* with no variable but globals in sight */
            a[i] = initial(t, p->value, resolve_type(t, &p->type, 0));
            t->seen[TRUTH_DEFAULT_ARGUMENT] = true;
        }
    i = 0;
    for (p = f->parameters; p; p = p->next, i++) {
        const karst_type *formal = resolve_type(t, &p->type, 0);
        declare(t, p->name, p->is_in ? convert(a[i], formal) : new_value(formal));
    }
    t->result = new_value(type);
    execute(t, f->statement->first);
    result = t->result;
    i = 0;
    for (p = f->parameters; p; p = p->next, i++) {
        value now = t->variables[outer_num + i].v;
        if (p->is_out) {
            t->seen[p->is_in ? TRUTH_INOUT : TRUTH_OUT] = true;
            write_place(places[i], now);
        } else {
            t->seen[TRUTH_CALL_WITH_OWN_PARAMETER_CHANGED] |=
                memcmp(now.c, convert(a[i], now.type).c, now.type->num_scalars * sizeof(cell)) != 0;
        }
    }
    t->first_variable = outer_first;
    t->num_variables = outer_num;
    t->num_loops = outer_loops;
    t->num_switches = outer_switches;
    t->in_choice = outer_choice;
    t->result = outer_result;
    t->depth--;
    return result;
}

static value construct_call(truth *t, const karst_ast_expr *e)
{
    value a[64];
    uint32_t count = 0;
    for (const karst_ast_expr *x = e->a; x; x = x->next)
        count++;
    const karst_type *type = resolve_type(t, e->of, count);
    if (type->shape == KARST_SHAPE_ARRAY || type->shape == KARST_SHAPE_STRUCT) {
        karst_ast_expr list = {.kind = KARST_AST_LIST, .a = e->a};
        return initial(t, &list, type);
    }
    count = 0;
    for (const karst_ast_expr *x = e->a; x && count < 64; x = x->next)
        a[count++] = evaluate(t, x);
    t->seen[TRUTH_CONVERSION] |= count == 1 && a[0].type->scalar != type->scalar;
    return construct(type, a, count);
}

/* ---- expressions ---- */

static value logical(truth *t, const karst_ast_expr *e)
{
    bool is_and = e->op == KARST_P2('&', '&'), left = is_true(evaluate(t, e->a));
    t->seen[is_and ? TRUTH_AND : TRUTH_OR] = true;
    if (left != is_and) {
        t->seen[TRUTH_SHORT_CIRCUIT_SKIPS] = true;
        return truth_of(left);
    }
    return truth_of(is_true(evaluate(t, e->b)));
}

static value binary(truth *t, const karst_ast_expr *e)
{
    uint32_t op = e->op;
    if (op == KARST_P2('&', '&') || op == KARST_P2('|', '|'))
        return logical(t, e);
    value a = evaluate(t, e->a), b = evaluate(t, e->b);
    if (op == KARST_P2('^', '^'))
        return truth_of(is_true(a) != is_true(b));
    if (op == KARST_P2('=', '=') || op == KARST_P2('!', '=') || op == KARST_P2('<', '=') || op == KARST_P2('>', '=') ||
        op == '<' || op == '>') {
        if (a.type->scalar != b.type->scalar) { /* a whole number and a float */
            a = a.type->scalar == KARST_TYPE_FLOAT ? a : to_floats(a);
            b = b.type->scalar == KARST_TYPE_FLOAT ? b : to_floats(b);
        }
        return truth_of(compared(op, a, b));
    }
    t->seen[TRUTH_INT] |= a.type->scalar == KARST_TYPE_INT;
    t->seen[TRUTH_UINT] |= a.type->scalar == KARST_TYPE_UINT;
    t->seen[TRUTH_BITS] |= op > 0xff || op == '&' || op == '|' || op == '^';
    t->seen[TRUTH_MATRIX_PRODUCT] |=
        op == '*' && (a.type->shape == KARST_SHAPE_MATRIX) && b.type->shape != KARST_SHAPE_SCALAR;
    return arithmetic(op, a, b);
}

static value unary(truth *t, const karst_ast_expr *e)
{
    value a = evaluate(t, e->a), r = new_value(a.type);
    for (uint32_t i = 0; i < a.type->num_scalars; i++) {
        cell c = a.c[i];
        bool is_float = a.type->scalar == KARST_TYPE_FLOAT, is_unsigned = a.type->scalar == KARST_TYPE_UINT;
        r.c[i] = e->op == '+'   ? c
                 : e->op == '!' ? exactly(c.v == 0)
                 : e->op == '~' ? exactly(wrapped(~(int64_t)c.v, is_unsigned))
                 : is_float     ? negate(c)
                                : exactly(wrapped(-(int64_t)c.v, is_unsigned));
    }
    return r;
}

static value assign(truth *t, const karst_ast_expr *e)
{
    place p = find_place(t, e->a);
    value v = evaluate(t, e->b);
    t->seen[TRUTH_COMPOUND] |= e->op != 0;
    if (e->op)
        v = arithmetic(e->op, read_place(p), v);
    v = convert(v, p.type);
    write_place(p, v);
    return v;
}

static value count_up(truth *t, const karst_ast_expr *e)
{
    place p = find_place(t, e->a);
    value before = read_place(p), after = arithmetic(e->op, before, one(p.type->scalar, exactly(1)));
    t->seen[e->postfix ? TRUTH_STEP_POSTFIX : TRUTH_STEP_PREFIX] = true;
    write_place(p, after);
    return e->postfix ? before : after;
}

/* Both types in one pass: 1 and 2.0 as choices make floats. Of the arm that is not taken only a literal's type is
 * known here, which is all that generated texts mix. */
static value choose(truth *t, const karst_ast_expr *e)
{
    bool yes = is_true(evaluate(t, e->a));
    t->seen[TRUTH_CHOICE] = true;
    t->seen[TRUTH_NESTED_CHOICE] |= t->in_choice > 0;
    t->in_choice++;
    value v = evaluate(t, yes ? e->b : e->c);
    const karst_ast_expr *other = yes ? e->c : e->b;
    t->in_choice--;
    if (other->kind == KARST_AST_NUMBER && other->scalar == KARST_TYPE_FLOAT) {
        t->seen[TRUTH_CHOICE_OF_TWO_TYPES] |= v.type->scalar != KARST_TYPE_FLOAT;
        v = convert(v, type_of(KARST_TYPE_FLOAT, v.type->size));
    }
    return v;
}

static value evaluate_inner(truth *t, const karst_ast_expr *e)
{
    bool is_global;
    switch ((karst_ast_kind)e->kind) {
    case KARST_AST_NUMBER:
        return one(e->scalar, e->scalar == KARST_TYPE_FLOAT ? rounded(e->number.value, 0) : exactly(e->number.value));
    case KARST_AST_NAME: {
        value v = copy_of(*find(t, e->name, &is_global));
        t->seen[TRUTH_GLOBAL_READ] |= is_global;
        return v;
    }
    case KARST_AST_UNARY:
        return unary(t, e);
    case KARST_AST_STEP:
        return count_up(t, e);
    case KARST_AST_BINARY:
        return binary(t, e);
    case KARST_AST_ASSIGN:
        return assign(t, e);
    case KARST_AST_CHOOSE:
        return choose(t, e);
    case KARST_AST_COMMA:
        evaluate(t, e->a);
        t->seen[TRUTH_COMMA] = true;
        return evaluate(t, e->b);
    case KARST_AST_CALL:
        return call(t, e);
    case KARST_AST_CONSTRUCT:
        return construct_call(t, e);
    case KARST_AST_MEMBER:
        return member(t, e);
    case KARST_AST_INDEX: {
        value whole = evaluate(t, e->a);
        uint32_t i = index_of(t, e->b, whole.type);
        return part_of_value(whole, whole.type->element, i * whole.type->element->num_scalars);
    }
    case KARST_AST_COUNT: {
        const karst_type *type = evaluate(t, e->a).type;
        t->seen[TRUTH_LENGTH] = true;
        return one(KARST_TYPE_INT, exactly(type->shape == KARST_SHAPE_VECTOR ? type->num_scalars : type->count));
    }
    case KARST_AST_LIST:
    case KARST_AST_FIELD:
        break;
    }
    give_up("a list where none can be");
}

static value evaluate(truth *t, const karst_ast_expr *e)
{
    step(t);
    t->seen[TRUTH_ASSIGNMENT_AS_VALUE] |=
        e->kind == KARST_AST_BINARY && (e->a->kind == KARST_AST_ASSIGN || e->b->kind == KARST_AST_ASSIGN);
    return evaluate_inner(t, e);
}

/* ---- statements ---- */

static way block(truth *t, const karst_ast_statement *first)
{
    uint32_t outer = t->num_variables;
    way w = execute(t, first);
    t->num_variables = outer;
    return w;
}

static way loop(truth *t, const karst_ast_statement *s)
{
    uint32_t outer = t->num_variables;
    way w = GOES_ON;
    t->seen[TRUTH_FOR] = true;
    t->seen[TRUTH_NESTED_FOR] |= t->num_loops > 0;
    t->num_loops++;
    if (s->first)
        execute(t, s->first);
    bool runs = s->runs_first;
    t->seen[TRUTH_WHILE] |= s->value && !s->first && !s->step && !s->runs_first;
    t->seen[TRUTH_DO] |= s->runs_first;
    uint32_t outer_switches = t->num_switches;
    t->num_switches = 0;
    for (; w != BREAKS && w != RETURNS && (runs || !s->value || is_true(evaluate(t, s->value))); runs = false) {
        t->seen[TRUTH_BOUND_OF_CHOICE] |= s->value && s->value->b && s->value->b->kind == KARST_AST_CHOOSE;
        t->seen[TRUTH_LOOP_CONDITION_OF_SEVERAL] |= s->value && s->value->op == KARST_P2('&', '&');
        w = block(t, s->body);
        if (w != BREAKS && w != RETURNS && s->step)
            evaluate(t, s->step);
    }
    t->num_switches = outer_switches;
    t->num_loops--;
    t->num_variables = outer;
    return w == RETURNS ? w : GOES_ON;
}

/* From the label that fits, else from default, on to a break. */
static way choose_case(truth *t, const karst_ast_statement *s)
{
    double at = evaluate(t, s->value).c[0].v;
    const karst_ast_statement *begin = NULL, *otherwise = NULL;
    t->seen[TRUTH_SWITCH] = true;
    for (const karst_ast_statement *c = s->first; c; c = c->next) {
        otherwise = c->value ? otherwise : c;
        begin = !begin && c->value && evaluate(t, c->value).c[0].v == at ? c : begin;
    }
    t->seen[TRUTH_SWITCH_DEFAULT] |= !begin && otherwise;
    begin = begin ? begin : otherwise;
    way w = GOES_ON;
    t->num_switches++;
    for (const karst_ast_statement *c = begin; c && w == GOES_ON; c = c->next) {
        t->seen[TRUTH_SWITCH_FALLS_THROUGH] |= c != begin;
        w = block(t, c->first);
    }
    t->num_switches--;
    return w == BREAKS ? GOES_ON : w;
}

static way execute_one(truth *t, const karst_ast_statement *s)
{
    step(t);
    switch ((karst_ast_statement_kind)s->kind) {
    case KARST_AST_DECLARE:
        for (const karst_ast_variable *v = s->variables; v; v = v->next) {
            const karst_type *type = resolve_type(t, &v->type, list_length(v));
            declare(t, v->name, v->value ? initial(t, v->value, type) : new_value(type));
        }
        return GOES_ON;
    case KARST_AST_EVALUATE:
        evaluate(t, s->value);
        return GOES_ON;
    case KARST_AST_BLOCK:
        return block(t, s->first);
    case KARST_AST_IF: {
        bool yes = is_true(evaluate(t, s->value));
        t->seen[yes ? TRUTH_IF : TRUTH_ELSE] |= yes || s->otherwise;
        return block(t, yes ? s->body : s->otherwise);
    }
    case KARST_AST_FOR:
        return loop(t, s);
    case KARST_AST_SWITCH:
        return choose_case(t, s);
    case KARST_AST_CASE:
        break;
    case KARST_AST_RETURN:
        t->seen[TRUTH_RETURN_IN_LOOP] |= t->num_loops > 0;
        if (s->value) {
            value v = evaluate(t, s->value);
            t->result = convert(v, t->result.type);
        }
        return RETURNS;
    case KARST_AST_BREAK:
        t->seen[TRUTH_BREAK] = true;
        return BREAKS;
    case KARST_AST_CONTINUE:
        t->seen[TRUTH_CONTINUE] = true;
        t->seen[TRUTH_CONTINUE_IN_SWITCH] |= t->num_switches > 0;
        return CONTINUES;
    }
    give_up("no such statement");
}

static way execute(truth *t, const karst_ast_statement *first)
{
    way w = GOES_ON;
    for (const karst_ast_statement *s = first; s && w == GOES_ON; s = s->next) {
        w = execute_one(t, s);
        t->seen[TRUTH_EARLY_RETURN] |= w == RETURNS && (s->next || s->kind != KARST_AST_RETURN);
    }
    return w;
}

/* ---- whole programs ---- */

/* Reads a text without its prelude. false: it is none. Room for everything is in `t`, until truth_finish. */
static bool truth_read(truth *t, const char *text)
{
    memset(t, 0, sizeof *t);
    karst_arena_init(&t->arena, (size_t)64 << 20, NULL, NULL);
    t->arrays.arena = &t->arena;
    if (setjmp(t->escape))
        return false;
    karst_source_init(&t->source, &t->arena, &t->escape, "program", "", text, strlen(text));
    karst_tokens tokens = {0}, expanded = {0};
    karst_names_init(&t->names, &t->arena);
    karst_parser_init(&t->parser, &t->source, &t->names);
    karst_lex(&t->source, &t->names, t->source.user_begin, t->source.length, &tokens);
    karst_preprocess(&t->source, &t->names, &tokens, &expanded);
    karst_parse_file(&t->parser, &expanded, false);
    t->seen[TRUTH_MACRO] = strstr(text, "#define") != NULL;
    return true;
}

static void truth_finish(truth *t) { karst_arena_finish(&t->arena); }

/* What density is at p. false: it cannot be said (truth_reason), or a decision was too close. */
static bool truth_density(truth *t, const double p[3], cell *density)
{
    t->num_variables = t->first_variable = t->steps = t->depth = t->num_loops = t->num_switches = t->in_choice = 0;
    truth_used = 0;
    truth_doubt = false;
    truth_reason = "in doubt";
    if (setjmp(truth_stop) || setjmp(t->escape))
        return false;
    begin_globals(t);
    karst_ast_function *f = t->parser.functions;
    while (f && strcmp(spelt(t, f->name), "density"))
        f = f->next;
    if (!f)
        give_up("no density");
    if (!f->statement)
        karst_parse_body(&t->parser, f);
    value at = new_value(type_of(KARST_TYPE_FLOAT, 3));
    for (int i = 0; i < 3; i++)
        at.c[i] = (cell){p[i], 1e-9}; /* fixed point rounds fractions of a period: no decision about it is exact */
    declare(t, f->parameters->name, at);
    t->result = new_value(type_of(KARST_TYPE_FLOAT, 1));
    execute(t, f->statement->first);
    *density = t->result.c[0];
    return !truth_doubt;
}

#endif
