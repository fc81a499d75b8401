/* Words and marks: what all parts of the parser share. */
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
    {"typedef", KARST_KEYWORD_TYPEDEF},
    {"enum", KARST_KEYWORD_ENUM},
    {"auto", KARST_KEYWORD_AUTO},
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
    {"constexpr", KARST_KEYWORD_CONST},
    {"__private", KARST_KEYWORD_QUALIFIER},
    {"__kernel", KARST_KEYWORD_QUALIFIER},
    {"fragment", KARST_KEYWORD_QUALIFIER},
    {"vertex", KARST_KEYWORD_QUALIFIER},
    {"subroutine", KARST_KEYWORD_QUALIFIER},
    {"__local", KARST_KEYWORD_QUALIFIER},
    {"__global", KARST_KEYWORD_QUALIFIER},
    {"global", KARST_KEYWORD_QUALIFIER},
    {"shared", KARST_KEYWORD_QUALIFIER},
    {"groupshared", KARST_KEYWORD_QUALIFIER},
    {"thread", KARST_KEYWORD_QUALIFIER},
    {"device", KARST_KEYWORD_QUALIFIER},
    {"extern", KARST_KEYWORD_QUALIFIER},
    {"register", KARST_KEYWORD_QUALIFIER},
    {"volatile", KARST_KEYWORD_QUALIFIER},
    {"restrict", KARST_KEYWORD_QUALIFIER},
    {"coherent", KARST_KEYWORD_QUALIFIER},
    {"readonly", KARST_KEYWORD_QUALIFIER},
    {"writeonly", KARST_KEYWORD_QUALIFIER},
    {"centroid", KARST_KEYWORD_QUALIFIER},
    {"noperspective", KARST_KEYWORD_QUALIFIER},
    {"nointerpolation", KARST_KEYWORD_QUALIFIER},
    {"row_major", KARST_KEYWORD_QUALIFIER},
    {"column_major", KARST_KEYWORD_QUALIFIER},
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
    "half2",  "half3",  "half4", "fixed", "fixed2", "fixed3", "fixed4", "min16float", "min16float2", "min16float3",
    "min16float4", "unsigned", "uint32_t", "int32_t", "dword", "dvec2", "dvec3", "dvec4", "bool2", "bool3", "bool4",
    "mat2x3", "mat2x4", "mat3x2", "mat3x4", "mat4x2", "mat4x3", "float2x2", "float2x3", "float2x4", "float3x2",
    "float3x3", "float3x4", "float4x2", "float4x3", "float4x4"};

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
    if (token->kind != KARST_TOKEN_NAME)
        return KARST_KEYWORD_NONE;
    const karst_name *name = &p->names->items[token->what];
    karst_keyword keyword = (karst_keyword)name->keyword;
    /* One language's qualifiers are names in another: they qualify the word, or the bracket, behind them. */
    bool may_be_name = keyword == KARST_KEYWORD_QUALIFIER || keyword == KARST_KEYWORD_AUTO ||
                       (keyword == KARST_KEYWORD_CONST && !strcmp(name->text, "constant"));
    return may_be_name && token[1].kind != KARST_TOKEN_NAME ? KARST_KEYWORD_NONE : keyword;
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
    if (keyword != KARST_KEYWORD_NONE && keyword != KARST_KEYWORD_QUALIFIER && !karst_parser_is_spelling(p, t))
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

karst_ast_struct *karst_parser_find_struct(const karst_parser *p, uint32_t name)
{
    for (karst_ast_struct *s = p->structs; s; s = s->next)
        if (s->name == name)
            return s;
    return NULL;
}

static void skip_brackets(karst_parser *p)
{
    if (!karst_parser_accept(p, '('))
        return;
    while (!karst_token_is(karst_parser_peek(p), ')') && karst_parser_peek(p)->kind != KARST_TOKEN_END)
        p->at++;
    karst_parser_expect(p, ')', "to close the bracket");
}

void karst_parser_skip_attributes(karst_parser *p)
{
    karst_parser_skip_marks(p);
    while (karst_token_is(karst_parser_peek(p), '[') && karst_parser_ahead(p, 1)->kind == KARST_TOKEN_NAME) {
        p->at += 2;
        skip_brackets(p);
        karst_parser_expect(p, ']', "behind the attribute");
    }
}

void karst_parser_skip_marks(karst_parser *p)
{
    while (karst_token_is(karst_parser_peek(p), '[') && karst_token_is(karst_parser_ahead(p, 1), '['))
        p->at += karst_parser_behind_sizes(p, 0);
}

void karst_parser_skip_semantic(karst_parser *p)
{
    while (karst_token_is(karst_parser_peek(p), ':') && karst_parser_ahead(p, 1)->kind == KARST_TOKEN_NAME) {
        p->at += 2;
        skip_brackets(p);
    }
}

bool karst_parser_is_spelling(const karst_parser *p, const karst_token *token)
{
    static const char *const begins[] = {"float", "int", "uint", "bool", "half", "fixed", "min16float", NULL};
    if (karst_parser_keyword(p, token) != KARST_KEYWORD_TYPE)
        return false;
    const char *name = karst_name_text(p->names, token->what);
    for (int i = 0; begins[i]; i++) {
        size_t length = strlen(begins[i]);
        if (!strncmp(name, begins[i], length) && (name[length] || i >= 4))
            return true;
    }
    return false;
}

/* Such a word is a type before a name, a bracket that holds what it is made of, or as a cast. */
static bool spells_type(const karst_parser *p)
{
    const karst_token *next = karst_parser_ahead(p, 1), *second = karst_parser_ahead(p, 2);
    bool is_cast = karst_token_is(next, ')') &&
                   (karst_token_is(second, '{') || second->kind == KARST_TOKEN_NAME || karst_token_is(second, '(') ||
                                                 second->kind == KARST_TOKEN_FLOAT || second->kind == KARST_TOKEN_INT);
    const karst_token *last = karst_parser_ahead(p, karst_parser_behind_sizes(p, 1));
    return last->kind == KARST_TOKEN_NAME || karst_token_is(last, '(') || karst_token_is(last, '{') || is_cast;
}

size_t karst_parser_behind_sizes(const karst_parser *p, size_t n)
{
    for (uint32_t depth = 0;; n++) {
        const karst_token *t = karst_parser_ahead(p, n);
        if (karst_token_is(t, '['))
            depth++;
        else if (!depth || t->kind == KARST_TOKEN_END)
            return n;
        else if (karst_token_is(t, ']'))
            depth--;
    }
}

bool karst_parser_at_new_struct(const karst_parser *p)
{
    return karst_parser_keyword(p, karst_parser_peek(p)) == KARST_KEYWORD_STRUCT &&
           (karst_parser_ahead(p, 1)->kind != KARST_TOKEN_NAME || karst_token_is(karst_parser_ahead(p, 2), '{') ||
            !karst_parser_find_struct(p, karst_parser_ahead(p, 1)->what));
}

bool karst_parser_at_type(const karst_parser *p)
{
    const karst_token *t = karst_parser_peek(p);
    karst_keyword keyword = karst_parser_keyword(p, t);
    if (karst_parser_is_spelling(p, t))
        return spells_type(p);
    if (keyword == KARST_KEYWORD_STRUCT)
        return !karst_parser_at_new_struct(p);
    if (keyword == KARST_KEYWORD_ENUM)
        return karst_parser_ahead(p, 1)->kind == KARST_TOKEN_NAME &&
               karst_parser_find_struct(p, karst_parser_ahead(p, 1)->what);
    return keyword == KARST_KEYWORD_TYPE || keyword == KARST_KEYWORD_UNSUPPORTED_TYPE ||
           keyword == KARST_KEYWORD_AUTO ||
           (keyword == KARST_KEYWORD_NONE && t->kind == KARST_TOKEN_NAME && karst_parser_find_struct(p, t->what));
}

void karst_parser_offer_types(const karst_parser *p, karst_nearest *nearest)
{
    for (size_t i = 0; i < sizeof type_names / sizeof *type_names; i++)
        karst_nearest_offer(nearest, type_names[i]);
    for (karst_ast_struct *s = p->structs; s; s = s->next)
        karst_nearest_offer(nearest, karst_name_text(p->names, s->name));
}

void karst_parser_count(karst_parser *p, uint32_t *count, uint32_t most, const char *what, uint32_t where)
{
    if (++*count > most)
        karst_source_error(p->source, where, NULL, "there are more than %u %s", most, what);
}
