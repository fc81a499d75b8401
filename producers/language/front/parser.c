/* What stands at the outermost level: functions, globals, structs. */
#include "producers/language/front/parser.h"

#include <string.h>

static bool is_word(const karst_parser *p, const karst_token *t, const char *word)
{
    return t->kind == KARST_TOKEN_NAME && !strcmp(karst_name_text(p->names, t->what), word);
}

/* Passes over "{ ... }" without looking inside. */
static void skip_braces(karst_parser *p)
{
    uint32_t depth = 0, open = karst_parser_peek(p)->where;
    do {
        const karst_token *t = karst_parser_peek(p);
        if (t->kind == KARST_TOKEN_END)
            karst_source_error(p->source, open, "close it with }", "this '{' is never closed");
        depth += karst_token_is(t, '{');
        depth -= karst_token_is(t, '}');
        p->at++;
    } while (depth);
}

static karst_ast_variable *parse_parameter(karst_parser *p)
{
    karst_ast_variable *v = karst_arena_alloc(p->arena, sizeof *v);
    v->is_in = true;
    for (;; p->at++) {
        karst_keyword k = karst_parser_keyword(p, karst_parser_peek(p));
        if (k == KARST_KEYWORD_OUT || k == KARST_KEYWORD_INOUT) {
            v->is_out = true;
            v->is_in = k == KARST_KEYWORD_INOUT;
        } else if (k == KARST_KEYWORD_CONST) {
            v->is_const = true;
        } else if (k != KARST_KEYWORD_IN && k != KARST_KEYWORD_QUALIFIER) {
            break;
        }
    }
    v->type = karst_parse_type(p);
    v->where = karst_parser_peek(p)->where;
    if (karst_parser_accept(p, '&') && !v->is_const) /* C++'s and Metal's references */
        v->is_out = true;
    if (karst_token_is(karst_parser_peek(p), '*')) { /* an error of who calls the function */
        v->type = (karst_ast_type){.unsupported = KARST_POINTER};
        while (!karst_token_is(karst_parser_peek(p), ',') && !karst_token_is(karst_parser_peek(p), ')') &&
               karst_parser_peek(p)->kind != KARST_TOKEN_END)
            p->at++;
    }
    if (!karst_token_is(karst_parser_peek(p), ',') && !karst_token_is(karst_parser_peek(p), ')')) {
        v->name = karst_parser_name(p, "the name of a parameter");
        karst_parser_skip_marks(p);
        karst_parse_array_size(p, &v->type);
        karst_parser_skip_semantic(p);
        if (karst_parser_accept(p, '='))
            v->value = karst_parse_assignment(p);
    }
    return v;
}

/* "(...) { ... }" or "(...);". */
static void parse_function(karst_parser *p, karst_ast_type result, uint32_t name, uint32_t where)
{
    karst_ast_function *f = karst_arena_alloc(p->arena, sizeof *f);
    *f = (karst_ast_function){.name = name, .where = where, .result = result, .is_prelude = p->is_prelude};
    karst_ast_variable **link = &f->parameters;
    karst_parser_count(p, &p->num_functions, KARST_MAX_DECLARATIONS, "functions", where);
    const karst_token *t = karst_parser_peek(p);
    if (karst_parser_keyword(p, t) == KARST_KEYWORD_TYPE &&
        karst_type_named(karst_name_text(p->names, t->what)) == &karst_type_void &&
        karst_token_is(karst_parser_ahead(p, 1), ')'))
        p->at++;
    if (!karst_parser_accept(p, ')')) {
        do {
            *link = parse_parameter(p);
            for (karst_ast_variable *other = f->parameters; other != *link; other = other->next)
                if (other->name && other->name == (*link)->name)
                    karst_source_error(p->source, (*link)->where, "rename one of them",
                                       "there are two parameters called '%s'", karst_name_text(p->names, other->name));
            karst_parser_count(p, &f->num_parameters, KARST_MAX_ARGUMENTS, "parameters", (*link)->where);
            if ((*link)->value)
                f->num_defaults++;
            else if (f->num_defaults)
                karst_source_error(p->source, (*link)->where, "give it a value, too",
                                   "parameters behind one with a value need one");
            link = &(*link)->next;
        } while (karst_parser_accept(p, ','));
        karst_parser_expect(p, ')', "behind the parameters");
    }
    karst_parser_skip_semantic(p);
    if (!karst_parser_accept(p, ';')) {
        f->body = p->at;
        if (!karst_token_is(karst_parser_peek(p), '{'))
            karst_parser_expect(p, '{', "to open the function");
        skip_braces(p);
    }
    if (p->last_function)
        p->last_function->next = f;
    else
        p->functions = f;
    p->last_function = f;
    const uint32_t list = name & (KARST_FUNCTION_LISTS - 1);
    *(p->last_named[list] ? &p->last_named[list]->named_next : &p->named[list]) = f;
    p->last_named[list] = f;
}

static void add_global(karst_parser *p, karst_ast_variable *v)
{
    karst_parser_count(p, &p->num_globals, KARST_MAX_DECLARATIONS, "globals", v->where);
    for (karst_ast_variable *other = p->globals; other && other != v; other = other->next)
        if (other->name == v->name && other->is_prelude == v->is_prelude)
            karst_source_error(p->source, v->where, "rename one of them", "there are two globals called '%s'",
                               karst_name_text(p->names, v->name));
    *(p->last_global ? &p->last_global->next : &p->globals) = v;
    p->last_global = v;
}

static void parse_global(karst_parser *p, karst_ast_type type, bool is_const)
{
    karst_ast_variable *v = karst_parse_variables(p, type, is_const), *next;
    karst_parser_expect(p, ';', "behind the declaration");
    for (; v; v = next) {
        next = v->next;
        v->next = NULL;
        add_global(p, v);
    }
}

static void skip_to_semicolon(karst_parser *p)
{
    while (!karst_token_is(karst_parser_peek(p), ';') && karst_parser_peek(p)->kind != KARST_TOKEN_END) {
        if (karst_token_is(karst_parser_peek(p), '{'))
            skip_braces(p);
        else
            p->at++;
    }
    karst_parser_accept(p, ';');
}

/* "uniform NAME { ... } name;", "buffer NAME { ... };", "cbuffer NAME : register(b0) { ... };": what a program hands
 * over, which no density should need. True: there was one, and it is passed over. */
static bool skip_block(karst_parser *p)
{
    const uint32_t from = p->at;
    const karst_token *t = karst_parser_peek(p);
    const char *word = t->kind == KARST_TOKEN_NAME ? karst_name_text(p->names, t->what) : "";
    bool has_word = !strcmp(word, "buffer") || !strcmp(word, "cbuffer") || !strcmp(word, "tbuffer");
    if (has_word && karst_parser_ahead(p, 1)->kind == KARST_TOKEN_NAME)
        p->at++;
    if (karst_parser_peek(p)->kind == KARST_TOKEN_NAME &&
        karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_NONE) {
        p->at++;
        karst_parser_skip_semantic(p);
        if (karst_token_is(karst_parser_peek(p), '{')) {
            skip_braces(p);
            skip_to_semicolon(p);
            return true;
        }
    }
    p->at = from;
    return false;
}

static karst_ast_expr *int_node(karst_parser *p, int32_t value, uint32_t where)
{
    karst_ast_expr *e = karst_arena_alloc(p->arena, sizeof *e);
    *e = (karst_ast_expr){.kind = KARST_AST_NUMBER,
                          .scalar = KARST_TYPE_INT,
                          .where = where,
                          .height = 1,
                          .number = karst_number_int(value)};
    return e;
}

/* "enum Kind { A, B = 4, C };": ints by name, and a name for int. */
static void parse_enum(karst_parser *p)
{
    const karst_ast_type type = {.base = karst_type_vector(KARST_TYPE_INT, 1)};
    p->at++;
    if (is_word(p, karst_parser_peek(p), "class"))
        p->at++;
    if (karst_parser_peek(p)->kind == KARST_TOKEN_NAME) {
        karst_ast_struct *s = karst_arena_alloc(p->arena, sizeof *s);
        karst_ast_type *same_as = karst_arena_alloc(p->arena, sizeof *same_as);
        *same_as = type;
        karst_parser_count(p, &p->num_structs, KARST_MAX_STRUCTS, "structs", karst_parser_peek(p)->where);
        *s = (karst_ast_struct){.name = karst_parser_name(p, "the name of the enum"),
                                .where = karst_parser_peek(p)->where,
                                .same_as = same_as,
                                .next = p->structs};
        p->structs = s;
    }
    karst_parser_skip_semantic(p); /* what C++ keeps it in */
    karst_parser_expect(p, '{', "behind 'enum'");
    karst_ast_expr *base = NULL;
    for (int32_t above = 0; !karst_parser_accept(p, '}'); above++) {
        karst_ast_variable *v = karst_arena_alloc(p->arena, sizeof *v);
        *v = (karst_ast_variable){.where = karst_parser_peek(p)->where, .type = type, .is_const = true};
        v->name = karst_parser_name(p, "a name in the enum");
        if (karst_parser_accept(p, '=')) {
            base = karst_parse_assignment(p);
            above = 0;
        }
        v->value = base ? base : int_node(p, above, v->where);
        if (base && above) {
            karst_ast_expr *sum = karst_arena_alloc(p->arena, sizeof *sum);
            *sum = (karst_ast_expr){.kind = KARST_AST_BINARY,
                                    .op = '+',
                                    .where = v->where,
                                    .height = (uint16_t)(base->height + 1),
                                    .a = base,
                                    .b = int_node(p, above, v->where)};
            v->value = sum;
        }
        add_global(p, v);
        if (!karst_parser_accept(p, ',')) {
            karst_parser_expect(p, '}', "behind the names of the enum");
            break;
        }
    }
    karst_parser_expect(p, ';', "behind the enum");
}

/* What C++ and Metal have around functions: namespaces, whose names are left out everywhere, and templates, which
 * nothing here can call. */
static bool parse_foreign(karst_parser *p)
{
    const karst_token *t = karst_parser_peek(p), *next = karst_parser_ahead(p, 1);
    if (p->open_namespaces && karst_parser_accept(p, '}')) {
        p->open_namespaces--;
        return true;
    }
    if (t->kind != KARST_TOKEN_NAME)
        return false;
    const char *word = karst_name_text(p->names, t->what);
    if (!strcmp(word, "namespace") && next->kind == KARST_TOKEN_NAME && karst_token_is(karst_parser_ahead(p, 2), '{')) {
        p->at += 3;
        p->open_namespaces++;
    } else if (karst_parser_keyword(p, t) == KARST_KEYWORD_ENUM && !karst_parser_at_type(p)) {
        parse_enum(p);
    } else if (!strcmp(word, "using") && next->kind == KARST_TOKEN_NAME) {
        skip_to_semicolon(p);
    } else if (!strcmp(word, "template") && karst_token_is(next, '<')) {
        while (!karst_token_is(karst_parser_peek(p), '{') && !karst_token_is(karst_parser_peek(p), ';') &&
               karst_parser_peek(p)->kind != KARST_TOKEN_END)
            p->at++;
        if (karst_token_is(karst_parser_peek(p), '{'))
            skip_braces(p);
    } else if (karst_parser_keyword(p, t) == KARST_KEYWORD_TYPEDEF) {
        karst_parse_typedef(p);
        karst_parser_expect(p, ';', "behind the type");
    } else if (karst_token_is(next, '<')) { /* HLSL's StructuredBuffer<float4> points */
        skip_to_semicolon(p);
    } else {
        return false;
    }
    return true;
}

static void parse_item(karst_parser *p)
{
    bool is_const = false;
    karst_parser_skip_attributes(p);
    if (karst_parser_accept(p, ';') || parse_foreign(p))
        return;
    if (karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_PRECISION) {
        skip_to_semicolon(p);
        return;
    }
    for (;; p->at++) {
        karst_keyword k = karst_parser_keyword(p, karst_parser_peek(p));
        is_const |= k == KARST_KEYWORD_CONST;
        if (k == KARST_KEYWORD_LAYOUT) {
            while (!karst_token_is(karst_parser_peek(p), ')') && karst_parser_peek(p)->kind != KARST_TOKEN_END)
                p->at++;
        } else if (k != KARST_KEYWORD_CONST && k != KARST_KEYWORD_QUALIFIER && k != KARST_KEYWORD_IN &&
                   k != KARST_KEYWORD_OUT) {
            break;
        }
        if (karst_parser_peek(p)->kind == KARST_TOKEN_END)
            return;
    }
    if (skip_block(p))
        return;
    karst_ast_type type;
    if (karst_parser_at_new_struct(p)) {
        karst_parse_struct(p);
        if (karst_parser_accept(p, ';'))
            return;
        type = (karst_ast_type){.structure = p->structs};
    } else {
        const karst_token *t = karst_parser_peek(p);
        if (t->kind != KARST_TOKEN_NAME ||
            (karst_parser_keyword(p, t) != KARST_KEYWORD_NONE && !karst_parser_at_type(p)))
            karst_source_error(p->source, t->where, "put statements into a function",
                               "expected a function or a variable, not %s", karst_parser_spell(p, t));
        type = karst_parse_type(p);
    }
    const karst_token *name = karst_parser_peek(p);
    if (name->kind == KARST_TOKEN_NAME && karst_token_is(karst_parser_ahead(p, 1), '(')) {
        karst_parser_name(p, "the name of a function");
        p->at++;
        parse_function(p, type, name->what, name->where);
    } else if (type.unsupported) {
        skip_to_semicolon(p); /* a texture that, one hopes, no entry reaches */
    } else {
        parse_global(p, type, is_const);
    }
}

/* Without names of namespaces ("std::sqrt"), and with "unsigned" for "unsigned int". */
static void push_token(karst_parser *p, karst_token token)
{
    karst_tokens *made = &p->tokens;
    const size_t here = made->count - p->at;
    const karst_token *last = here ? made->items + made->count - 1 : NULL;
    if (here >= 3 && token.kind == KARST_TOKEN_NAME && karst_token_is(last, ':') && karst_token_is(last - 1, ':') &&
        last->text == last[-1].text + 1 && last[-2].kind == KARST_TOKEN_NAME) {
        token.line_start = last[-2].line_start;
        made->count -= 3;
    } else if (here >= 1 && is_word(p, &token, "int") && is_word(p, last, "unsigned")) {
        return;
    }
    karst_tokens_push(p->arena, made, token);
}

void karst_parse_file(karst_parser *parser, const karst_tokens *tokens, bool is_prelude)
{
    /* The new tokens go behind those of an earlier text, so that a body is one index. */
    parser->at = parser->tokens.count;
    parser->is_prelude = is_prelude;
    for (size_t i = 0; i < tokens->count; i++)
        push_token(parser, tokens->items[i]);
    while (karst_parser_peek(parser)->kind != KARST_TOKEN_END)
        parse_item(parser);
}

void karst_parse_body(karst_parser *parser, karst_ast_function *function)
{
    parser->at = function->body;
    parser->depth = 0;
    parser->is_prelude = function->is_prelude;
    function->statement = karst_parse_block(parser);
}
