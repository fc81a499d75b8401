/* What stands at the outermost level: functions, globals, structs. */
#include "producers/language/front/parser.h"

#include <string.h>

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
    if (karst_token_is(karst_parser_peek(p), '*') || karst_token_is(karst_parser_peek(p), '&'))
        karst_source_error(p->source, v->where, "write inout before the type", "there are no pointers");
    if (!karst_token_is(karst_parser_peek(p), ',') && !karst_token_is(karst_parser_peek(p), ')')) {
        v->name = karst_parser_name(p, "the name of a parameter");
        karst_parse_array_size(p, &v->type);
        karst_parser_skip_semantic(p);
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

static void parse_global(karst_parser *p, karst_ast_type type, bool is_const)
{
    karst_ast_variable *v = karst_parse_variables(p, type, is_const);
    karst_parser_expect(p, ';', "behind the declaration");
    for (; v; v = v->next) {
        karst_parser_count(p, &p->num_globals, KARST_MAX_DECLARATIONS, "globals", v->where);
        for (karst_ast_variable *other = p->globals; other && other != v; other = other->next)
            if (other->name == v->name && other->is_prelude == v->is_prelude)
                karst_source_error(p->source, v->where, "rename one of them", "there are two globals called '%s'",
                                   karst_name_text(p->names, v->name));
        if (p->last_global)
            p->last_global->next = v;
        else
            p->globals = v;
        p->last_global = v;
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

static void parse_item(karst_parser *p)
{
    bool is_const = false;
    karst_parser_skip_attributes(p);
    if (karst_parser_accept(p, ';'))
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
    if (karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_STRUCT) {
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

void karst_parse_file(karst_parser *parser, const karst_tokens *tokens, bool is_prelude)
{
    /* The new tokens go behind those of an earlier text, so that a body is one index. */
    parser->at = parser->tokens.count;
    parser->is_prelude = is_prelude;
    for (size_t i = 0; i < tokens->count; i++)
        karst_tokens_push(parser->arena, &parser->tokens, tokens->items[i]);
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
