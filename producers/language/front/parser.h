/* Tokens to a syntax tree. */
#ifndef KARST_LANGUAGE_PARSER_H
#define KARST_LANGUAGE_PARSER_H

#include "producers/language/front/ast.h"
#include "producers/language/front/macro.h"

typedef enum {
    KARST_KEYWORD_NONE,
    KARST_KEYWORD_TYPE,      /* a built-in type */
    KARST_KEYWORD_QUALIFIER, /* passed over: const is kept apart */
    KARST_KEYWORD_CONST,
    KARST_KEYWORD_IN,
    KARST_KEYWORD_OUT,
    KARST_KEYWORD_INOUT,
    KARST_KEYWORD_STRUCT,
    KARST_KEYWORD_TYPEDEF,
    KARST_KEYWORD_ENUM,
    KARST_KEYWORD_AUTO,
    KARST_KEYWORD_IF,
    KARST_KEYWORD_ELSE,
    KARST_KEYWORD_FOR,
    KARST_KEYWORD_RETURN,
    KARST_KEYWORD_BREAK,
    KARST_KEYWORD_CONTINUE,
    KARST_KEYWORD_TRUE,
    KARST_KEYWORD_FALSE,
    KARST_KEYWORD_PRECISION,
    KARST_KEYWORD_LAYOUT,
    KARST_KEYWORD_WHILE,
    KARST_KEYWORD_DO,
    KARST_KEYWORD_SWITCH,
    KARST_KEYWORD_CASE,
    KARST_KEYWORD_DEFAULT,
    KARST_KEYWORD_GOTO,
    KARST_KEYWORD_DISCARD,
    KARST_KEYWORD_UNSUPPORTED_TYPE /* samplers and images */
} karst_keyword;

/* Declarations are looked for one by one, so their number has to have an end. */
#define KARST_MAX_DECLARATIONS 4096u /* functions; globals */
#define KARST_MAX_STRUCTS 256u
#define KARST_MAX_FIELDS 256u
#define KARST_MAX_ARGUMENTS 64u

#define KARST_POINTER "a pointer" /* what is not there, of a karst_ast_type */

#define KARST_FUNCTION_LISTS 1024u /* a power of two */

typedef struct {
    karst_source *source;
    karst_names *names;
    karst_arena *arena;
    karst_tokens tokens;
    size_t at;
    uint32_t depth;
    bool is_prelude;
    karst_ast_function *functions, *last_function;
    karst_ast_function *named[KARST_FUNCTION_LISTS], *last_named[KARST_FUNCTION_LISTS]; /* the same, by their names */
    karst_ast_variable *globals, *last_global;
    karst_ast_struct *structs;             /* the latest first, those of open blocks among them */
    const karst_ast_struct *outer_structs; /* the first that was there before the innermost open block */
    uint32_t num_functions, num_globals, num_structs, open_namespaces;
} karst_parser;

/* The first of the functions among which all of that name are, in order, each the former's `named_next`. */
static inline karst_ast_function *karst_parser_named(const karst_parser *p, uint32_t name)
{
    return p->named[name & (KARST_FUNCTION_LISTS - 1)];
}

void karst_parser_init(karst_parser *parser, karst_source *source, karst_names *names);
/* Adds the declarations of a whole text; a body is matched for brackets only. */
void karst_parse_file(karst_parser *parser, const karst_tokens *tokens, bool is_prelude);
/* Parses the body of a function that has one. */
void karst_parse_body(karst_parser *parser, karst_ast_function *function);

/* ---- parse_tokens.c ---- */
static inline const karst_token *karst_parser_peek(const karst_parser *p) { return &p->tokens.items[p->at]; }
/* The token n further on, or the END. */
const karst_token *karst_parser_ahead(const karst_parser *p, size_t n);
karst_keyword karst_parser_keyword(const karst_parser *p, const karst_token *token);
bool karst_parser_accept(karst_parser *p, uint32_t punctuation);
/* Errors name what was found instead; `context` continues the sentence: "behind the condition". */
void karst_parser_expect(karst_parser *p, uint32_t punctuation, const char *context);
uint32_t karst_parser_name(karst_parser *p, const char *what);
const char *karst_parser_spell(const karst_parser *p, const karst_token *token);
void karst_parser_enter(karst_parser *p); /* one level deeper, bounded */
static inline void karst_parser_leave(karst_parser *p) { p->depth--; }
/* Passes over what HLSL says of a statement or a function, such as [unroll(4)], and of a name, such as ": SV_Target" or
 * ": register(b0)". */
void karst_parser_skip_attributes(karst_parser *p);
void karst_parser_skip_semantic(karst_parser *p);
/* A type's name that GLSL does not have (float2, half): where none can stand it is a name like any other. */
bool karst_parser_is_spelling(const karst_parser *p, const karst_token *token);
bool karst_parser_at_type(const karst_parser *p);
/* "struct {" or "struct Ray {": not the name of one that is there. */
bool karst_parser_at_new_struct(const karst_parser *p);
/* The token behind "[3][]", which begin n further on. */
size_t karst_parser_behind_sizes(const karst_parser *p, size_t n);
/* Passes over what Metal says of a name: [[position]]. */
void karst_parser_skip_marks(karst_parser *p);
karst_ast_struct *karst_parser_find_struct(const karst_parser *p, uint32_t name); /* NULL: there is none */
void karst_parser_offer_types(const karst_parser *p, karst_nearest *nearest);
/* Counts one more of something that there may be `most` of. */
void karst_parser_count(karst_parser *p, uint32_t *count, uint32_t most, const char *what, uint32_t where);

/* ---- parse_expr.c ---- */
karst_ast_type karst_parse_type(karst_parser *p);
void karst_parse_array_size(karst_parser *p, karst_ast_type *type);
karst_ast_expr *karst_parse_expression(karst_parser *p); /* with commas */
karst_ast_expr *karst_parse_assignment(karst_parser *p); /* without */

/* ---- parse_stmt.c ---- */
void karst_parse_struct(karst_parser *p); /* becomes p->structs */
void karst_parse_typedef(karst_parser *p); /* up to the ';' */
karst_ast_statement *karst_parse_block(karst_parser *p);
/* "float a = 1., b[3]" up to, not including, the ';'. */
karst_ast_variable *karst_parse_variables(karst_parser *p, karst_ast_type type, bool is_const);

#endif
