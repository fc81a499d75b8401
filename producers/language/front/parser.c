/* What stands at the outermost level: functions, globals, structs; and what all parts of the parser share. */
#include "producers/language/front/parser.h"

#include <string.h>

static const struct {
    const char *name;
    karst_keyword keyword;
} keywords[] = {
    {"const", KARST_KEYWORD_CONST},
    {"in", KARST_KEYWORD_IN},
    {"out", KARST_KEYWORD_OUT},
    {"inout", KARST_KEYWORD_INOUT},
    {"struct", KARST_KEYWORD_STRUCT},
    {"if", KARST_KEYWORD_IF},
    {"else", KARST_KEYWORD_ELSE},
    {"for", KARST_KEYWORD_FOR},
    {"return", KARST_KEYWORD_RETURN},
    {"break", KARST_KEYWORD_BREAK},
    {"continue", KARST_KEYWORD_CONTINUE},
    {"true", KARST_KEYWORD_TRUE},
    {"false", KARST_KEYWORD_FALSE},
    {"precision", KARST_KEYWORD_PRECISION},
    {"layout", KARST_KEYWORD_LAYOUT},
    {"while", KARST_KEYWORD_WHILE},
    {"do", KARST_KEYWORD_DO},
    {"switch", KARST_KEYWORD_SWITCH},
    {"case", KARST_KEYWORD_CASE},
    {"default", KARST_KEYWORD_DEFAULT},
    {"goto", KARST_KEYWORD_GOTO},
    {"discard", KARST_KEYWORD_DISCARD},
    {"highp", KARST_KEYWORD_QUALIFIER},
    {"mediump", KARST_KEYWORD_QUALIFIER},
    {"lowp", KARST_KEYWORD_QUALIFIER},
    {"uniform", KARST_KEYWORD_QUALIFIER},
    {"varying", KARST_KEYWORD_QUALIFIER},
    {"attribute", KARST_KEYWORD_QUALIFIER},
    {"flat", KARST_KEYWORD_QUALIFIER},
    {"smooth", KARST_KEYWORD_QUALIFIER},
    {"static", KARST_KEYWORD_QUALIFIER},
    {"inline", KARST_KEYWORD_QUALIFIER},
    {"invariant", KARST_KEYWORD_QUALIFIER},
    {"precise", KARST_KEYWORD_QUALIFIER},
    {"__constant", KARST_KEYWORD_CONST},
    {"constant", KARST_KEYWORD_CONST},
    {"__private", KARST_KEYWORD_QUALIFIER},
};
/* GLSL's also with i and u in front. */
static const char *const textures[] = {
    "sampler1D",
    "sampler2D",
    "sampler3D",
    "samplerCube",
    "sampler2DArray",
    "sampler1DArray",
    "sampler2DRect",
    "samplerBuffer",
    "samplerCubeArray",
    "sampler2DMS",
    "sampler2DMSArray",
    "sampler1DShadow",
    "sampler2DShadow",
    "samplerCubeShadow",
    "sampler2DArrayShadow",
    "sampler1DArrayShadow",
    "sampler2DRectShadow",
    "samplerCubeArrayShadow",
    "image1D",
    "image2D",
    "image3D",
    "imageCube",
    "image2DArray",
    "imageBuffer",
    "image2d_t",
    "image3d_t",
    "sampler_t",
    "samplerExternalOES",
    "Texture1D",
    "Texture2D",
    "Texture3D",
    "TextureCube",
    "SamplerState",
};
static const char *const type_names[] = {
    "void",   "float",  "int",   "uint",  "bool",  "vec2",  "vec3",  "vec4",  "ivec2",  "ivec3",  "ivec4",  "uvec2",
    "uvec3",  "uvec4",  "bvec2", "bvec3", "bvec4", "mat2",  "mat3",  "mat4",  "mat2x2", "mat3x3", "mat4x4", "float2",
    "float3", "float4", "int2",  "int3",  "int4",  "uint2", "uint3", "uint4", "double", "half",
    "float2x2", "float3x3", "float4x4"};

void karst_parser_init(karst_parser *parser, karst_source *source, karst_names *names)
{
    *parser = (karst_parser){.source = source, .names = names, .arena = source->arena};
    for (size_t i = 0; i < sizeof keywords / sizeof *keywords; i++) {
        uint32_t id = karst_names_id(names, keywords[i].name, strlen(keywords[i].name));
        names->items[id].keyword = (uint16_t)keywords[i].keyword;
    }
    for (size_t i = 0; i < sizeof textures / sizeof *textures; i++)
        for (const char *front = "iu"; front; front = *front ? front + 1 : NULL) {
            char name[32];
            size_t n = 0;
            if (*front)
                name[n++] = *front;
            for (const char *c = textures[i]; *c; c++)
                name[n++] = *c;
            names->items[karst_names_id(names, name, n)].keyword = KARST_KEYWORD_UNSUPPORTED_TYPE;
        }
    for (size_t i = 0; i < sizeof type_names / sizeof *type_names; i++) {
        uint32_t id = karst_names_id(names, type_names[i], strlen(type_names[i]));
        names->items[id].keyword = KARST_KEYWORD_TYPE;
    }
}

const karst_token *karst_parser_ahead(const karst_parser *p, size_t n)
{
    size_t at = p->at + n;
    return &p->tokens.items[at < p->tokens.count ? at : p->tokens.count - 1];
}

karst_keyword karst_parser_keyword(const karst_parser *p, const karst_token *token)
{
    return token->kind == KARST_TOKEN_NAME ? (karst_keyword)p->names->items[token->what].keyword : KARST_KEYWORD_NONE;
}

bool karst_parser_accept(karst_parser *p, uint32_t punctuation)
{
    if (!karst_token_is(karst_parser_peek(p), punctuation))
        return false;
    p->at++;
    return true;
}

const char *karst_parser_spell(const karst_parser *p, const karst_token *token)
{
    if (token->kind == KARST_TOKEN_END)
        return "the end of the file";
    return karst_format(p->arena, "'%.*s'", (int)(token->length < 40 ? token->length : 40),
                        p->source->text + token->text);
}

/* A missing ';' is pointed out behind the word before it, where it belongs. */
void karst_parser_expect(karst_parser *p, uint32_t punctuation, const char *context)
{
    const karst_token *t = karst_parser_peek(p);
    if (karst_parser_accept(p, punctuation))
        return;
    uint32_t where = t->where;
    if (punctuation == ';' && p->at && t->line_start && t[-1].where == t[-1].text)
        where = t[-1].text + t[-1].length;
    karst_source_error(p->source, where, NULL, "expected '%c' %s, not %s", (int)punctuation, context,
                       karst_parser_spell(p, t));
}

uint32_t karst_parser_name(karst_parser *p, const char *what)
{
    const karst_token *t = karst_parser_peek(p);
    if (t->kind != KARST_TOKEN_NAME)
        karst_source_error(p->source, t->where, NULL, "expected %s, not %s", what, karst_parser_spell(p, t));
    karst_keyword keyword = karst_parser_keyword(p, t);
    if (keyword != KARST_KEYWORD_NONE && keyword != KARST_KEYWORD_QUALIFIER)
        karst_source_error(p->source, t->where, "choose another name", "'%s' is a word of the language, not a name",
                           karst_name_text(p->names, t->what));
    p->at++;
    return t->what;
}

void karst_parser_enter(karst_parser *p)
{
    if (++p->depth > KARST_MAX_NESTING)
        karst_source_error(p->source, karst_parser_peek(p)->where, "split it with variables or functions",
                           "this is nested deeper than %u", KARST_MAX_NESTING);
}

static karst_ast_struct *find_struct(const karst_parser *p, uint32_t name)
{
    for (karst_ast_struct *s = p->structs; s; s = s->next)
        if (s->name == name)
            return s;
    return NULL;
}

bool karst_parser_at_type(const karst_parser *p)
{
    const karst_token *t = karst_parser_peek(p);
    karst_keyword keyword = karst_parser_keyword(p, t);
    return keyword == KARST_KEYWORD_TYPE || keyword == KARST_KEYWORD_UNSUPPORTED_TYPE ||
           (keyword == KARST_KEYWORD_NONE && t->kind == KARST_TOKEN_NAME && find_struct(p, t->what));
}

void karst_parse_array_size(karst_parser *p, karst_ast_type *type)
{
    uint32_t where = karst_parser_peek(p)->where;
    if (!karst_parser_accept(p, '['))
        return;
    if (type->size || type->unsized)
        karst_source_error(p->source, where, "use one array and compute the index", "there are no arrays of arrays");
    if (karst_parser_accept(p, ']')) {
        type->unsized = true;
    } else {
        type->size = karst_parse_expression(p);
        karst_parser_expect(p, ']', "behind the array's size");
    }
    if (karst_token_is(karst_parser_peek(p), '['))
        karst_source_error(p->source, where, "use one array and compute the index", "there are no arrays of arrays");
}

karst_ast_type karst_parse_type(karst_parser *p)
{
    karst_ast_type type = {0};
    const karst_token *t = karst_parser_peek(p);
    if (t->kind != KARST_TOKEN_NAME)
        karst_source_error(p->source, t->where, NULL, "expected a type, not %s", karst_parser_spell(p, t));
    const char *name = karst_name_text(p->names, t->what);
    karst_keyword keyword = karst_parser_keyword(p, t);
    if (keyword == KARST_KEYWORD_TYPE) {
        type.base = karst_type_named(name);
    } else if (keyword == KARST_KEYWORD_UNSUPPORTED_TYPE) {
        type.unsupported = name;
    } else if (!(type.structure = find_struct(p, t->what))) {
        karst_nearest nearest = karst_nearest_begin(name, strlen(name));
        for (size_t i = 0; i < sizeof type_names / sizeof *type_names; i++)
            karst_nearest_offer(&nearest, type_names[i]);
        for (karst_ast_struct *s = p->structs; s; s = s->next)
            karst_nearest_offer(&nearest, karst_name_text(p->names, s->name));
        karst_source_error(p->source, t->where, karst_nearest_hint(&nearest, p->arena), "there is no type '%s'", name);
    }
    p->at++;
    karst_parse_array_size(p, &type);
    return type;
}

/* Counts one more of something that there may be `most` of. */
static void count_declaration(karst_parser *p, uint32_t *count, uint32_t most, const char *what, uint32_t where)
{
    if (++*count > most)
        karst_source_error(p->source, where, NULL, "there are more than %u %s", most, what);
}

void karst_parse_struct(karst_parser *p)
{
    karst_ast_struct *s = karst_arena_alloc(p->arena, sizeof *s);
    p->at++;
    s->where = karst_parser_peek(p)->where;
    s->name = karst_parser_name(p, "the name of the struct");
    const karst_ast_struct *same = p->structs;
    while (same != p->outer_structs && same->name != s->name)
        same = same->next;
    if (same != p->outer_structs)
        karst_source_error(p->source, s->where, "rename one of them", "there are two structs called '%s'",
                           karst_name_text(p->names, s->name));
    karst_parser_expect(p, '{', "behind the struct's name");
    karst_ast_variable **link = &s->fields;
    uint32_t num_fields = 0;
    count_declaration(p, &p->num_structs, KARST_MAX_STRUCTS, "structs", s->where);
    while (!karst_parser_accept(p, '}')) {
        while (karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_QUALIFIER)
            p->at++;
        *link = karst_parse_variables(p, karst_parse_type(p), false);
        while (*link) {
            count_declaration(p, &num_fields, KARST_MAX_FIELDS, "fields in this struct", (*link)->where);
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
    s->next = p->structs;
    p->structs = s;
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
    if (karst_token_is(karst_parser_peek(p), '*') || karst_token_is(karst_parser_peek(p), '&'))
        karst_source_error(p->source, v->where, "write inout before the type", "there are no pointers");
    if (!karst_token_is(karst_parser_peek(p), ',') && !karst_token_is(karst_parser_peek(p), ')')) {
        v->name = karst_parser_name(p, "the name of a parameter");
        karst_parse_array_size(p, &v->type);
    }
    return v;
}

/* "(...) { ... }" or "(...);". */
static void parse_function(karst_parser *p, karst_ast_type result, uint32_t name, uint32_t where)
{
    karst_ast_function *f = karst_arena_alloc(p->arena, sizeof *f);
    *f = (karst_ast_function){.name = name, .where = where, .result = result, .is_prelude = p->is_prelude};
    karst_ast_variable **link = &f->parameters;
    count_declaration(p, &p->num_functions, KARST_MAX_DECLARATIONS, "functions", where);
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
            count_declaration(p, &f->num_parameters, KARST_MAX_ARGUMENTS, "parameters", (*link)->where);
            link = &(*link)->next;
        } while (karst_parser_accept(p, ','));
        karst_parser_expect(p, ')', "behind the parameters");
    }
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
}

static void parse_global(karst_parser *p, karst_ast_type type, bool is_const)
{
    karst_ast_variable *v = karst_parse_variables(p, type, is_const);
    karst_parser_expect(p, ';', "behind the declaration");
    for (; v; v = v->next) {
        count_declaration(p, &p->num_globals, KARST_MAX_DECLARATIONS, "globals", v->where);
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

static void parse_item(karst_parser *p)
{
    bool is_const = false;
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
