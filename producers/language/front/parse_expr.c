/* Types, and expressions by precedence climbing: each may stand in the other. */
#include "producers/language/front/parser.h"

#include <string.h>

static karst_ast_expr *parse_unary(karst_parser *p);
static karst_ast_expr *make(karst_parser *p, karst_ast_kind kind, uint32_t where, karst_ast_expr *a, karst_ast_expr *b,
                            karst_ast_expr *c);

void karst_parse_array_size(karst_parser *p, karst_ast_type *type)
{
    karst_ast_expr *within = type->size, **link = &type->size;
    for (uint32_t where; where = karst_parser_peek(p)->where, karst_parser_accept(p, '['); link = &(*link)->next) {
        if (karst_parser_accept(p, ']')) {
            *link = make(p, KARST_AST_LIST, where, NULL, NULL, NULL);
        } else {
            *link = karst_parse_expression(p);
            karst_parser_expect(p, ']', "behind the array's size");
        }
    }
    *link = within;
}

karst_ast_type karst_parse_type(karst_parser *p)
{
    karst_ast_type type = {0};
    if (karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_STRUCT ||
        karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_ENUM)
        p->at++; /* C's "struct Ray", of one that is there */
    const karst_token *t = karst_parser_peek(p);
    if (t->kind != KARST_TOKEN_NAME)
        karst_source_error(p->source, t->where, NULL, "expected a type, not %s", karst_parser_spell(p, t));
    const char *name = karst_name_text(p->names, t->what);
    karst_keyword keyword = karst_parser_keyword(p, t);
    if (keyword == KARST_KEYWORD_TYPE) {
        type.base = karst_type_named(name);
    } else if (keyword == KARST_KEYWORD_UNSUPPORTED_TYPE) {
        type.unsupported = name;
    } else if (keyword == KARST_KEYWORD_AUTO) {
        type.is_deduced = true;
    } else if (!(type.structure = karst_parser_find_struct(p, t->what))) {
        karst_nearest nearest = karst_nearest_begin(name, strlen(name));
        karst_parser_offer_types(p, &nearest);
        karst_source_error(p->source, t->where, karst_nearest_hint(&nearest, p->arena), "there is no type '%s'", name);
    }
    p->at++;
    if (type.structure && type.structure->same_as)
        type = *type.structure->same_as;
    karst_parse_array_size(p, &type);
    return type;
}

static karst_ast_expr *make(karst_parser *p, karst_ast_kind kind, uint32_t where, karst_ast_expr *a, karst_ast_expr *b,
                            karst_ast_expr *c)
{
    karst_ast_expr *e = karst_arena_alloc(p->arena, sizeof *e);
    e->kind = (uint8_t)kind;
    e->where = where;
    e->a = a;
    e->b = b;
    e->c = c;
    unsigned height = 0;
    bool chain =
        kind == KARST_AST_BINARY || kind == KARST_AST_COMMA; /* what leans to the left is walked, not descended */
    if (a && a->height > height)
        height = a->height - (chain ? 1u : 0u);
    if (b && b->height > height)
        height = b->height;
    if (c && c->height > height)
        height = c->height;
    if (++height > KARST_MAX_NESTING)
        karst_source_error(p->source, where, "split it with variables", "this expression is nested deeper than %u",
                           KARST_MAX_NESTING);
    e->height = (uint16_t)height;
    return e;
}

static karst_ast_expr *parse_element(karst_parser *p)
{
    return karst_token_is(karst_parser_peek(p), '{') ? parse_unary(p) : karst_parse_assignment(p);
}

/* Arguments up to the closing bracket; the opening one has been read. */
static karst_ast_expr *parse_arguments(karst_parser *p, uint32_t close, unsigned *height)
{
    karst_ast_expr *first = NULL, **link = &first;
    *height = 0;
    if (karst_parser_accept(p, close))
        return NULL;
    if (karst_parser_peek(p)->kind == KARST_TOKEN_NAME &&
        karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_TYPE &&
        karst_token_is(karst_parser_ahead(p, 1), close) && close == ')' && karst_parser_peek(p)->length == 4 &&
        !karst_type_named(karst_name_text(p->names, karst_parser_peek(p)->what))->num_scalars) {
        p->at += 2; /* f(void) */
        return NULL;
    }
    do {
        if (close == '}' && karst_token_is(karst_parser_peek(p), close))
            break; /* a trailing comma */
        const karst_token *t = karst_parser_peek(p);
        if (close == '}' && karst_parser_accept(p, '.')) { /* C's designators */
            uint32_t name = karst_parser_name(p, "the name of a field");
            karst_parser_expect(p, '=', "behind the field");
            *link = make(p, KARST_AST_FIELD, t->where, parse_element(p), NULL, NULL);
            (*link)->name = name;
        } else {
            *link = parse_element(p);
        }
        if ((*link)->height > *height)
            *height = (*link)->height;
        link = &(*link)->next;
    } while (karst_parser_accept(p, ','));
    karst_parser_expect(p, close, "behind the arguments");
    return first;
}

static karst_ast_expr *with_arguments(karst_parser *p, karst_ast_kind kind, uint32_t where, uint32_t close)
{
    unsigned height;
    karst_ast_expr *arguments = parse_arguments(p, close, &height);
    karst_ast_expr *e = make(p, kind, where, NULL, NULL, NULL);
    e->a = arguments;
    e->height = (uint16_t)(height + 1);
    if (height + 1 > KARST_MAX_NESTING)
        karst_source_error(p->source, where, "split it with variables", "this expression is nested deeper than %u",
                           KARST_MAX_NESTING);
    return e;
}

static karst_ast_expr *parse_number(karst_parser *p, const karst_token *t)
{
    karst_ast_expr *e = make(p, KARST_AST_NUMBER, t->where, NULL, NULL, NULL);
    e->scalar = t->kind == KARST_TOKEN_FLOAT ? KARST_TYPE_FLOAT
                : t->kind == KARST_TOKEN_INT ? KARST_TYPE_INT
                                             : KARST_TYPE_UINT;
    if (t->kind == KARST_TOKEN_FLOAT)
        e->number = karst_number_decimal(p->source->text + t->text, t->length);
    else
        e->number = karst_number_int(t->kind == KARST_TOKEN_INT ? (int32_t)t->what : (int64_t)t->what);
    p->at++;
    return e;
}

/* vec3(...), float[3](...), Ray(...), and C++'s Ray{...}. */
static karst_ast_expr *parse_construct(karst_parser *p)
{
    uint32_t where = karst_parser_peek(p)->where;
    karst_ast_type *type = karst_arena_alloc(p->arena, sizeof *type);
    *type = karst_parse_type(p);
    const bool is_brace = karst_token_is(karst_parser_peek(p), '{');
    karst_parser_expect(p, is_brace ? '{' : '(', "behind the type");
    karst_ast_expr *e = with_arguments(p, KARST_AST_CONSTRUCT, where, is_brace ? '}' : ')');
    e->of = type;
    return e;
}

/* OpenCL C's (float3)(x, y, z), C's (float)x and (Ray){...}. The bracket is next. */
static karst_ast_expr *parse_cast(karst_parser *p)
{
    uint32_t where = karst_parser_peek(p)->where;
    karst_ast_type *type = karst_arena_alloc(p->arena, sizeof *type);
    p->at++;
    *type = karst_parse_type(p);
    karst_parser_expect(p, ')', "behind the type");
    karst_ast_expr *e;
    /* (float)(int)x: a cast of a cast, not what the first is made of */
    const bool is_cast_again = karst_parser_keyword(p, karst_parser_ahead(p, 1)) == KARST_KEYWORD_TYPE &&
                               karst_token_is(karst_parser_ahead(p, 2), ')');
    const bool is_brace = karst_token_is(karst_parser_peek(p), '{'); /* C's (Ray){...} */
    if (is_brace || (!is_cast_again && karst_token_is(karst_parser_peek(p), '('))) {
        p->at++;
        e = with_arguments(p, KARST_AST_CONSTRUCT, where, is_brace ? '}' : ')');
    } else {
        karst_ast_expr *a = parse_unary(p);
        e = make(p, KARST_AST_CONSTRUCT, where, a, NULL, NULL);
    }
    e->of = type;
    return e;
}

static karst_ast_expr *parse_primary(karst_parser *p)
{
    const karst_token *t = karst_parser_peek(p);
    if (t->kind == KARST_TOKEN_FLOAT || t->kind == KARST_TOKEN_INT || t->kind == KARST_TOKEN_UINT)
        return parse_number(p, t);
    if (karst_token_is(t, '{')) {
        p->at++;
        return with_arguments(p, KARST_AST_LIST, t->where, '}');
    }
    if (karst_token_is(t, '(')) {
        p->at++;
        const size_t words = karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_STRUCT ? 2 : 1;
        bool is_type = karst_parser_at_type(p) && karst_token_is(karst_parser_ahead(p, words), ')');
        if (is_type) {
            p->at--;
            return parse_cast(p);
        }
        karst_ast_expr *e = karst_parse_expression(p);
        karst_parser_expect(p, ')', "to close the bracket");
        return e;
    }
    if (t->kind == KARST_TOKEN_ODD)
        karst_source_error(p->source, t->where, NULL, "the character '\"' has no meaning here");
    if (t->kind != KARST_TOKEN_NAME)
        karst_source_error(p->source, t->where, NULL, "expected a value, not %s", karst_parser_spell(p, t));
    if (karst_parser_at_type(p))
        return parse_construct(p);
    karst_keyword keyword = karst_parser_keyword(p, t);
    if (keyword == KARST_KEYWORD_TRUE || keyword == KARST_KEYWORD_FALSE) {
        karst_ast_expr *e = make(p, KARST_AST_NUMBER, t->where, NULL, NULL, NULL);
        e->scalar = KARST_TYPE_BOOL;
        e->number = karst_number_int(keyword == KARST_KEYWORD_TRUE);
        p->at++;
        return e;
    }
    if (keyword != KARST_KEYWORD_NONE && !karst_parser_is_spelling(p, t))
        karst_source_error(p->source, t->where, NULL, "expected a value, not '%s'", karst_name_text(p->names, t->what));
    p->at++;
    karst_ast_expr *e;
    if (karst_parser_accept(p, '('))
        e = with_arguments(p, KARST_AST_CALL, t->where, ')');
    else
        e = make(p, KARST_AST_NAME, t->where, NULL, NULL, NULL);
    e->name = t->what;
    return e;
}

static karst_ast_expr *parse_postfix(karst_parser *p)
{
    karst_ast_expr *e = parse_primary(p);
    for (;;) {
        const karst_token *t = karst_parser_peek(p);
        if (karst_parser_accept(p, '.')) {
            uint32_t where = karst_parser_peek(p)->where;
            uint32_t name = karst_parser_name(p, "a field or components such as xy behind the point");
            bool is_method = karst_parser_accept(p, '(');
            if (is_method && strcmp(karst_name_text(p->names, name), "length"))
                karst_source_error(p->source, where, "write it as a function of the value",
                                   "there are no methods such as .%s(), only .length()",
                                   karst_name_text(p->names, name));
            if (is_method)
                karst_parser_expect(p, ')', "behind '.length('");
            e = make(p, is_method ? KARST_AST_COUNT : KARST_AST_MEMBER, where, e, NULL, NULL);
            e->name = name;
        } else if (karst_parser_accept(p, '[')) {
            karst_ast_expr *index = karst_parse_expression(p);
            karst_parser_expect(p, ']', "behind the index");
            e = make(p, KARST_AST_INDEX, t->where, e, index, NULL);
        } else if (karst_parser_accept(p, KARST_P2('+', '+')) || karst_parser_accept(p, KARST_P2('-', '-'))) {
            e = make(p, KARST_AST_STEP, t->where, e, NULL, NULL);
            e->op = t->what & 0xff;
            e->postfix = true;
        } else {
            return e;
        }
    }
}

static karst_ast_expr *parse_unary(karst_parser *p)
{
    const karst_token *t = karst_parser_peek(p);
    karst_parser_enter(p);
    karst_ast_expr *e;
    if (karst_parser_accept(p, '-') || karst_parser_accept(p, '+') || karst_parser_accept(p, '!') ||
        karst_parser_accept(p, '~')) {
        karst_ast_expr *a = parse_unary(p);
        e = make(p, KARST_AST_UNARY, t->where, a, NULL, NULL);
        e->op = t->what;
    } else if (karst_parser_accept(p, KARST_P2('+', '+')) || karst_parser_accept(p, KARST_P2('-', '-'))) {
        karst_ast_expr *a = parse_unary(p);
        e = make(p, KARST_AST_STEP, t->where, a, NULL, NULL);
        e->op = t->what & 0xff;
    } else {
        e = parse_postfix(p);
    }
    karst_parser_leave(p);
    return e;
}

/* 0: no binary operator. */
static int precedence(const karst_token *t)
{
    if (t->kind != KARST_TOKEN_PUNCTUATION)
        return 0;
    switch (t->what) {
    case KARST_P2('|', '|'):
        return 1;
    case KARST_P2('^', '^'):
        return 2;
    case KARST_P2('&', '&'):
        return 3;
    case '|':
        return 4;
    case '^':
        return 5;
    case '&':
        return 6;
    case KARST_P2('=', '='):
    case KARST_P2('!', '='):
        return 7;
    case '<':
    case '>':
    case KARST_P2('<', '='):
    case KARST_P2('>', '='):
        return 8;
    case KARST_P2('<', '<'):
    case KARST_P2('>', '>'):
        return 9;
    case '+':
    case '-':
        return 10;
    case '*':
    case '/':
    case '%':
        return 11;
    default:
        return 0;
    }
}

static karst_ast_expr *parse_binary(karst_parser *p, int lowest)
{
    karst_ast_expr *left = parse_unary(p);
    for (;;) {
        const karst_token *op = karst_parser_peek(p);
        int level = precedence(op);
        if (!level || level < lowest)
            return left;
        p->at++;
        karst_ast_expr *right = parse_binary(p, level + 1);
        left = make(p, KARST_AST_BINARY, op->where, left, right, NULL);
        left->op = op->what;
    }
}

/* The operator of "+=" and its like, or 0. */
static uint32_t assignment_operator(uint32_t what)
{
    switch (what) {
    case KARST_P2('+', '='):
    case KARST_P2('-', '='):
    case KARST_P2('*', '='):
    case KARST_P2('/', '='):
    case KARST_P2('%', '='):
    case KARST_P2('&', '='):
    case KARST_P2('|', '='):
    case KARST_P2('^', '='):
        return what & 0xff;
    case KARST_P3('<', '<', '='):
    case KARST_P3('>', '>', '='):
        return what & 0xffff;
    default:
        return 0;
    }
}

karst_ast_expr *karst_parse_assignment(karst_parser *p)
{
    karst_parser_enter(p);
    karst_ast_expr *e = parse_binary(p, 1);
    const karst_token *t = karst_parser_peek(p);
    if (karst_parser_accept(p, '?')) {
        karst_ast_expr *yes = karst_parse_expression(p);
        karst_parser_expect(p, ':', "between the two choices");
        karst_ast_expr *no = karst_parse_assignment(p);
        e = make(p, KARST_AST_CHOOSE, t->where, e, yes, no);
    } else if (t->kind == KARST_TOKEN_PUNCTUATION && (t->what == '=' || assignment_operator(t->what))) {
        p->at++;
        karst_ast_expr *value = karst_parse_assignment(p);
        e = make(p, KARST_AST_ASSIGN, t->where, e, value, NULL);
        e->op = assignment_operator(t->what);
    }
    karst_parser_leave(p);
    return e;
}

karst_ast_expr *karst_parse_expression(karst_parser *p)
{
    karst_ast_expr *e = karst_parse_assignment(p);
    for (const karst_token *t = karst_parser_peek(p); karst_parser_accept(p, ','); t = karst_parser_peek(p))
        e = make(p, KARST_AST_COMMA, t->where, e, karst_parse_assignment(p), NULL);
    return e;
}
