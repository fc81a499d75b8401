/* Statements. */
#include "producers/language/front/parser.h"

static karst_ast_statement *parse_statement(karst_parser *p);

static karst_ast_statement *make(karst_parser *p, karst_ast_statement_kind kind, uint32_t where)
{
    karst_ast_statement *s = karst_arena_alloc(p->arena, sizeof *s);
    s->kind = (uint8_t)kind;
    s->where = where;
    return s;
}

karst_ast_statement *karst_parse_block(karst_parser *p)
{
    karst_ast_statement *block = make(p, KARST_AST_BLOCK, karst_parser_peek(p)->where), **link = &block->first;
    karst_parser_expect(p, '{', "to open the block");
    karst_ast_struct *structs = p->structs;
    const karst_ast_struct *outer_structs = p->outer_structs;
    p->outer_structs = structs;
    while (!karst_parser_accept(p, '}')) {
        if (karst_parser_peek(p)->kind == KARST_TOKEN_END)
            karst_source_error(p->source, block->where, "close it with }", "this block never ends");
        *link = parse_statement(p);
        if (*link)
            link = &(*link)->next;
    }
    p->structs = structs;
    p->outer_structs = outer_structs;
    return block;
}

karst_ast_variable *karst_parse_variables(karst_parser *p, karst_ast_type type, bool is_const)
{
    karst_ast_variable *first = NULL, **link = &first;
    do {
        karst_ast_variable *v = karst_arena_alloc(p->arena, sizeof *v);
        v->where = karst_parser_peek(p)->where;
        v->name = karst_parser_name(p, "the name of a variable");
        v->type = type;
        v->is_const = is_const;
        v->is_prelude = p->is_prelude;
        karst_parser_skip_marks(p);
        karst_parse_array_size(p, &v->type);
        karst_parser_skip_semantic(p);
        if (karst_parser_accept(p, '=') || karst_token_is(karst_parser_peek(p), '{'))
            v->value = karst_parse_assignment(p);
        *link = v;
        link = &v->next;
    } while (karst_parser_accept(p, ','));
    return first;
}

static void check_struct_is_free(karst_parser *p, const karst_ast_struct *s)
{
    const karst_ast_struct *same = p->structs;
    while (same != p->outer_structs && same->name != s->name)
        same = same->next;
    if (same != p->outer_structs)
        karst_source_error(p->source, s->where, "rename one of them", "there are two structs called '%s'",
                           karst_name_text(p->names, s->name));
}

void karst_parse_struct(karst_parser *p)
{
    karst_ast_struct *s = karst_arena_alloc(p->arena, sizeof *s);
    s->name = karst_parser_peek(p)->what; /* "struct" itself is the name of one that has none */
    p->at++;
    s->where = karst_parser_peek(p)->where;
    if (!karst_token_is(karst_parser_peek(p), '{')) {
        s->name = karst_parser_name(p, "the name of the struct");
        check_struct_is_free(p, s);
    }
    karst_parser_expect(p, '{', "behind the struct's name");
    karst_parser_enter(p);
    karst_ast_variable **link = &s->fields;
    uint32_t num_fields = 0;
    karst_parser_count(p, &p->num_structs, KARST_MAX_STRUCTS, "structs", s->where);
    while (!karst_parser_accept(p, '}')) {
        while (karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_QUALIFIER ||
               karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_CONST)
            p->at++;
        karst_ast_type type;
        if (karst_parser_at_new_struct(p)) {
            karst_parse_struct(p);
            type = (karst_ast_type){.structure = p->structs};
        } else {
            type = karst_parse_type(p);
        }
        *link = karst_parse_variables(p, type, false);
        while (*link) {
            karst_parser_count(p, &num_fields, KARST_MAX_FIELDS, "fields in this struct", (*link)->where);
            if ((*link)->value)
                karst_source_error(p->source, (*link)->where, "set it where a variable is made",
                                   "a field has no value of its own");
            for (karst_ast_variable *other = s->fields; other != *link; other = other->next)
                if (other->name == (*link)->name)
                    karst_source_error(p->source, (*link)->where, "rename one of them",
                                       "this struct has two fields called '%s'",
                                       karst_name_text(p->names, other->name));
            link = &(*link)->next;
        }
        karst_parser_expect(p, ';', "behind the field");
    }
    if (!s->fields)
        karst_source_error(p->source, s->where, NULL, "struct '%s' has no fields", karst_name_text(p->names, s->name));
    karst_parser_leave(p);
    s->next = p->structs;
    p->structs = s;
}

void karst_parse_typedef(karst_parser *p)
{
    p->at++;
    while (karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_CONST ||
           karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_QUALIFIER)
        p->at++;
    const karst_token *name = karst_parser_ahead(p, 1), *again = karst_parser_ahead(p, 2);
    if (karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_STRUCT && again->kind == KARST_TOKEN_NAME &&
        name->what == again->what && karst_token_is(karst_parser_ahead(p, 3), ';')) {
        p->at += 3; /* "typedef struct Ray Ray;", and the struct comes later */
        return;
    }
    karst_ast_type type;
    if (karst_parser_at_new_struct(p)) {
        karst_parse_struct(p);
        type = (karst_ast_type){.structure = p->structs};
    } else {
        type = karst_parse_type(p);
    }
    do {
        karst_ast_struct *s = karst_arena_alloc(p->arena, sizeof *s);
        karst_ast_type *same_as = karst_arena_alloc(p->arena, sizeof *same_as);
        const karst_token *t = karst_parser_peek(p);
        const bool is_built_in = karst_parser_keyword(p, t) == KARST_KEYWORD_TYPE && type.base && !type.size &&
                                 karst_type_named(karst_name_text(p->names, t->what)) == type.base;
        if (is_built_in) { /* "typedef vec3 float3" */
            p->at++;
            continue;
        }
        s->where = t->where;
        s->name = karst_parser_name(p, "the name of a type");
        *same_as = type;
        karst_parse_array_size(p, same_as);
        s->same_as = same_as;
        if (type.structure && type.structure->name == s->name)
            continue; /* typedef struct Ray { ... } Ray; */
        check_struct_is_free(p, s);
        karst_parser_count(p, &p->num_structs, KARST_MAX_STRUCTS, "structs", s->where);
        s->next = p->structs;
        p->structs = s;
    } while (karst_parser_accept(p, ','));
}

/* A declaration, if the tokens look like one: [const] TYPE NAME, or TYPE[3] NAME. */
static bool at_declaration(const karst_parser *p)
{
    for (size_t n = 0;; n++) {
        const karst_token *t = karst_parser_ahead(p, n);
        karst_keyword keyword = karst_parser_keyword(p, t);
        if (keyword == KARST_KEYWORD_CONST)
            return true;
        if (keyword != KARST_KEYWORD_QUALIFIER)
            break;
    }
    if (karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_QUALIFIER)
        return true;
    if (karst_parser_at_type(p)) {
        const karst_token *behind = karst_parser_ahead(p, karst_parser_behind_sizes(p, 1));
        return !karst_token_is(behind, '(') && !karst_token_is(behind, '{');
    }
    /* Two names in a row: a type that is not known. */
    return karst_parser_peek(p)->kind == KARST_TOKEN_NAME &&
           karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_NONE &&
           karst_parser_ahead(p, 1)->kind == KARST_TOKEN_NAME &&
           karst_parser_keyword(p, karst_parser_ahead(p, 1)) == KARST_KEYWORD_NONE;
}

/* A struct for the rest of its block, and perhaps variables of it; NULL: there are none. */
static karst_ast_statement *parse_local_struct(karst_parser *p)
{
    karst_ast_statement *s = make(p, KARST_AST_DECLARE, karst_parser_peek(p)->where);
    karst_parse_struct(p);
    if (karst_token_is(karst_parser_peek(p), ';'))
        return NULL;
    s->variables = karst_parse_variables(p, (karst_ast_type){.structure = p->structs}, false);
    return s;
}

static karst_ast_statement *parse_declaration(karst_parser *p)
{
    karst_ast_statement *s = make(p, KARST_AST_DECLARE, karst_parser_peek(p)->where);
    bool is_const = false;
    for (karst_keyword k;
         (k = karst_parser_keyword(p, karst_parser_peek(p))) == KARST_KEYWORD_CONST || k == KARST_KEYWORD_QUALIFIER;
         p->at++)
        is_const |= k == KARST_KEYWORD_CONST;
    s->variables = karst_parse_variables(p, karst_parse_type(p), is_const);
    return s;
}

static karst_ast_statement *parse_simple(karst_parser *p)
{
    if (at_declaration(p))
        return parse_declaration(p);
    karst_ast_statement *s = make(p, KARST_AST_EVALUATE, karst_parser_peek(p)->where);
    s->value = karst_parse_expression(p);
    return s;
}

static karst_ast_statement *parse_if(karst_parser *p)
{
    karst_ast_statement *s = make(p, KARST_AST_IF, karst_parser_peek(p)->where);
    p->at++;
    karst_parser_expect(p, '(', "behind 'if'");
    s->value = karst_parse_expression(p);
    karst_parser_expect(p, ')', "behind the condition");
    s->body = parse_statement(p);
    if (karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_ELSE) {
        p->at++;
        s->otherwise = parse_statement(p);
    }
    return s;
}

static karst_ast_statement *parse_for(karst_parser *p)
{
    karst_ast_statement *s = make(p, KARST_AST_FOR, karst_parser_peek(p)->where);
    p->at++;
    karst_parser_expect(p, '(', "behind 'for'");
    if (!karst_parser_accept(p, ';')) {
        s->first = parse_simple(p);
        karst_parser_expect(p, ';', "behind the loop's first part");
    }
    if (!karst_token_is(karst_parser_peek(p), ';'))
        s->value = karst_parse_expression(p);
    karst_parser_expect(p, ';', "behind the loop's condition");
    if (!karst_token_is(karst_parser_peek(p), ')'))
        s->step = karst_parse_expression(p);
    karst_parser_expect(p, ')', "behind the loop's step");
    s->body = parse_statement(p);
    return s;
}

static karst_ast_statement *parse_while(karst_parser *p)
{
    karst_ast_statement *s = make(p, KARST_AST_FOR, karst_parser_peek(p)->where);
    p->at++;
    karst_parser_expect(p, '(', "behind 'while'");
    s->value = karst_parse_expression(p);
    karst_parser_expect(p, ')', "behind the condition");
    s->body = parse_statement(p);
    return s;
}

static karst_ast_statement *parse_do(karst_parser *p)
{
    karst_ast_statement *s = make(p, KARST_AST_FOR, karst_parser_peek(p)->where);
    s->runs_first = true;
    p->at++;
    s->body = parse_statement(p);
    if (karst_parser_keyword(p, karst_parser_peek(p)) != KARST_KEYWORD_WHILE)
        karst_source_error(p->source, karst_parser_peek(p)->where, "write do { ... } while (CONDITION);",
                           "expected 'while' behind the body of 'do', not %s",
                           karst_parser_spell(p, karst_parser_peek(p)));
    p->at++;
    karst_parser_expect(p, '(', "behind 'while'");
    s->value = karst_parse_expression(p);
    karst_parser_expect(p, ')', "behind the condition");
    return s;
}

static bool at_label(const karst_parser *p)
{
    karst_keyword keyword = karst_parser_keyword(p, karst_parser_peek(p));
    return keyword == KARST_KEYWORD_CASE || keyword == KARST_KEYWORD_DEFAULT;
}

/* "case 3:" or "default:", and the statements up to the next label or the end. */
static karst_ast_statement *parse_case(karst_parser *p, bool *has_default)
{
    karst_ast_statement *s = make(p, KARST_AST_CASE, karst_parser_peek(p)->where), **link = &s->first;
    bool is_default = karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_DEFAULT;
    if (is_default && *has_default)
        karst_source_error(p->source, s->where, "leave one of them", "this 'switch' has two 'default'");
    *has_default |= is_default;
    p->at++;
    if (!is_default)
        s->value = karst_parse_assignment(p);
    karst_parser_expect(p, ':', is_default ? "behind 'default'" : "behind the label");
    while (!at_label(p) && !karst_token_is(karst_parser_peek(p), '}')) {
        if (karst_parser_peek(p)->kind == KARST_TOKEN_END)
            karst_source_error(p->source, s->where, "close it with }", "this 'switch' never ends");
        *link = parse_statement(p);
        if (*link)
            link = &(*link)->next;
    }
    return s;
}

static karst_ast_statement *parse_switch(karst_parser *p)
{
    karst_ast_statement *s = make(p, KARST_AST_SWITCH, karst_parser_peek(p)->where), **link = &s->first;
    bool has_default = false;
    p->at++;
    karst_parser_expect(p, '(', "behind 'switch'");
    s->value = karst_parse_expression(p);
    karst_parser_expect(p, ')', "behind what 'switch' looks at");
    karst_parser_expect(p, '{', "to open the body of 'switch'");
    karst_ast_struct *structs = p->structs;
    const karst_ast_struct *outer_structs = p->outer_structs;
    p->outer_structs = structs;
    while (!karst_parser_accept(p, '}')) {
        if (!at_label(p))
            karst_source_error(p->source, karst_parser_peek(p)->where, "write case 0: or default: before it",
                               "expected a label in 'switch', not %s", karst_parser_spell(p, karst_parser_peek(p)));
        *link = parse_case(p, &has_default);
        link = &(*link)->next;
    }
    p->structs = structs;
    p->outer_structs = outer_structs;
    return s;
}

/* NULL: an empty statement. */
static karst_ast_statement *parse_statement_inner(karst_parser *p)
{
    karst_parser_skip_attributes(p);
    const karst_token *t = karst_parser_peek(p);
    karst_ast_statement *s;
    if (karst_token_is(t, '{'))
        return karst_parse_block(p);
    if (karst_parser_accept(p, ';'))
        return NULL;
    switch (karst_parser_keyword(p, t)) {
    case KARST_KEYWORD_IF:
        return parse_if(p);
    case KARST_KEYWORD_FOR:
        return parse_for(p);
    case KARST_KEYWORD_RETURN:
        s = make(p, KARST_AST_RETURN, t->where);
        p->at++;
        if (!karst_token_is(karst_parser_peek(p), ';'))
            s->value = karst_parse_expression(p);
        break;
    case KARST_KEYWORD_BREAK:
    case KARST_KEYWORD_CONTINUE:
        s = make(p, karst_parser_keyword(p, t) == KARST_KEYWORD_BREAK ? KARST_AST_BREAK : KARST_AST_CONTINUE, t->where);
        p->at++;
        break;
    case KARST_KEYWORD_PRECISION:
        while (!karst_token_is(karst_parser_peek(p), ';') && karst_parser_peek(p)->kind != KARST_TOKEN_END)
            p->at++;
        karst_parser_expect(p, ';', "behind 'precision'");
        return NULL;
    case KARST_KEYWORD_WHILE:
        return parse_while(p);
    case KARST_KEYWORD_DO:
        s = parse_do(p);
        break;
    case KARST_KEYWORD_SWITCH:
        return parse_switch(p);
    case KARST_KEYWORD_CASE:
    case KARST_KEYWORD_DEFAULT:
        karst_source_error(p->source, t->where, "labels stand directly in the braces of 'switch'",
                           "there is no 'switch' around this label");
    case KARST_KEYWORD_GOTO:
        karst_source_error(p->source, t->where, "use if, for, break and return", "there is no 'goto'");
    case KARST_KEYWORD_DISCARD:
        karst_source_error(p->source, t->where, "return a negative density: that is air",
                           "there is no 'discard': a density has no pixel to drop");
    case KARST_KEYWORD_STRUCT:
        s = karst_parser_at_new_struct(p) ? parse_local_struct(p) : parse_declaration(p);
        break;
    case KARST_KEYWORD_TYPEDEF:
        karst_parse_typedef(p);
        s = NULL;
        break;
    case KARST_KEYWORD_ELSE:
        karst_source_error(p->source, t->where, NULL, "there is no 'if' before this 'else'");
    default:
        s = parse_simple(p);
    }
    karst_parser_expect(p, ';', "behind the statement");
    return s;
}

static karst_ast_statement *parse_statement(karst_parser *p)
{
    karst_parser_enter(p);
    karst_ast_statement *s = parse_statement_inner(p);
    karst_parser_leave(p);
    return s;
}
