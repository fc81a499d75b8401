/* The syntax tree. Bodies of functions are parsed when they are first called: what no entry reaches is only matched for
 * brackets. */
#ifndef KARST_LANGUAGE_AST_H
#define KARST_LANGUAGE_AST_H

#include "producers/language/front/lexer.h"
#include "producers/language/front/types.h"

typedef struct karst_ast_expr karst_ast_expr;
typedef struct karst_ast_statement karst_ast_statement;
typedef struct karst_ast_variable karst_ast_variable;
typedef struct karst_ast_function karst_ast_function;
typedef struct karst_ast_struct karst_ast_struct;

typedef enum {
    KARST_AST_NUMBER,    /* number, scalar */
    KARST_AST_NAME,      /* name */
    KARST_AST_UNARY,     /* op a: + - ! ~ */
    KARST_AST_STEP,      /* ++ and --: op '+' or '-', a; postfix says which value */
    KARST_AST_BINARY,    /* a op b; long chains lean to the left */
    KARST_AST_ASSIGN,    /* a op= b; op 0: plain */
    KARST_AST_CHOOSE,    /* a ? b : c */
    KARST_AST_COMMA,     /* a, b */
    KARST_AST_CALL,      /* name(a, a->next, ...) */
    KARST_AST_CONSTRUCT, /* of->type(a, a->next, ...) */
    KARST_AST_MEMBER,    /* a.name: a field or a swizzle */
    KARST_AST_INDEX,     /* a[b] */
    KARST_AST_COUNT,     /* a.length() */
    KARST_AST_LIST,      /* {a, a->next, ...}, only as an initialiser */
    KARST_AST_FIELD      /* .name = a, only in a LIST */
} karst_ast_kind;

/* How a type is written: a base, and the sizes of an array of it. */
typedef struct {
    const karst_type *base; /* NULL: a struct, or deduced */
    karst_ast_struct *structure;
    karst_ast_expr *size;    /* NULL: no array; else, from the outermost, each size's `next` the one within; an empty
                              * LIST is "[]": the initialiser says */
    bool is_deduced;         /* "auto": the initialiser says */
    const char *unsupported; /* set instead of all others: "sampler2D" */
} karst_ast_type;

struct karst_ast_expr {
    uint8_t kind;   /* karst_ast_kind */
    uint8_t scalar; /* karst_scalar_type of a NUMBER */
    bool postfix;
    uint16_t height; /* of the tree without left-leaning chains: at most KARST_MAX_NESTING */
    uint32_t op, name, where;
    karst_number number;
    karst_ast_type *of;
    karst_ast_expr *a, *b, *c, *next;
};

typedef enum {
    KARST_AST_DECLARE,
    KARST_AST_EVALUATE,
    KARST_AST_BLOCK,
    KARST_AST_IF,
    KARST_AST_FOR, /* while and do too */
    KARST_AST_SWITCH, /* its statements are CASEs, each with those up to the next */
    KARST_AST_CASE,
    KARST_AST_RETURN,
    KARST_AST_BREAK,
    KARST_AST_CONTINUE
} karst_ast_statement_kind;

struct karst_ast_statement {
    uint8_t kind;
    bool runs_first; /* FOR: the body comes before the condition once */
    uint32_t where;
    karst_ast_variable *variables;         /* DECLARE */
    karst_ast_expr *value; /* EVALUATE, RETURN (may be NULL); condition of IF and FOR (may be NULL); what SWITCH looks
                              at; a label of CASE (NULL: default) */
    karst_ast_expr *step;                  /* FOR; may be NULL */
    karst_ast_statement *first;            /* of a BLOCK, SWITCH or CASE; the initialiser of FOR */
    karst_ast_statement *body, *otherwise; /* IF, FOR */
    karst_ast_statement *next;
};

struct karst_ast_variable { /* also parameters, fields and globals */
    uint32_t name, where;
    karst_ast_type type;
    bool is_const, is_in, is_out; /* parameters: in, out, inout */
    bool is_prelude;
    karst_ast_expr *value; /* initialiser, or what a parameter is by default; may be NULL */
    karst_ast_variable *next;
};

struct karst_ast_struct {
    uint32_t name, where;
    const karst_ast_type *same_as; /* a typedef: it is that type, and the rest is empty */
    karst_ast_variable *fields;
    const double *usual; /* what each of its floats is at first; NULL: 0 */
    karst_type *type;    /* made by lower_state.c when first needed */
    karst_ast_struct *next;
};

struct karst_ast_function {
    uint32_t name, where;
    karst_ast_type result;
    karst_ast_variable *parameters;
    uint32_t num_parameters, num_defaults; /* the last of them have a value */
    bool is_prelude;
    size_t body;                    /* token of its '{'; 0: declared only */
    karst_ast_statement *statement; /* parsed body */
    bool busy;                      /* being inlined: finds recursion */
    karst_ast_function *next;
    karst_ast_function *named_next; /* karst_parser_named */
};

#endif
