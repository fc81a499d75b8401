/* Words: text to tokens. */
#ifndef KARST_LANGUAGE_LEXER_H
#define KARST_LANGUAGE_LEXER_H

#include "producers/language/base/source.h"

#define KARST_MAX_TOKENS 200000u

typedef enum {
    KARST_TOKEN_END,
    KARST_TOKEN_NAME,
    KARST_TOKEN_FLOAT,
    KARST_TOKEN_INT,
    KARST_TOKEN_UINT,
    KARST_TOKEN_PUNCTUATION,
    KARST_TOKEN_ODD /* a character without meaning, or a number that is none (`what` is not 0): errors unless they are
                     * passed over; or a text in quotes */
} karst_token_kind;

/* Punctuation is named by its characters packed in an int: '+', or KARST_P2('+', '='). */
#define KARST_P2(a, b) ((a) | (b) << 8)
#define KARST_P3(a, b, c) ((a) | (b) << 8 | (c) << 16)

typedef struct {
    uint8_t kind;       /* karst_token_kind */
    uint8_t line_start; /* first on its line */
    uint8_t space_before;
    uint8_t no_expand;     /* macro.c: the name of a macro inside its own expansion */
    uint32_t what;         /* NAME: id in the names; PUNCTUATION: its characters; INT and UINT: the value */
    uint32_t text, length; /* its spelling: bytes of the source */
    uint32_t where;        /* where to point: the outermost macro call that it comes from, else its spelling */
} karst_token;

typedef struct {
    karst_token *items;
    size_t count, capacity;
} karst_tokens;

/* Every identifier once. */
typedef struct {
    const char *text; /* NUL-terminated */
    uint32_t length, hash;
    int32_t macro;    /* macro.c: index, or -1 */
    uint16_t keyword; /* parser.c: a karst_keyword, or 0 */
} karst_name;
typedef struct {
    karst_arena *arena;
    karst_name *items;
    size_t count, capacity;
    uint32_t *table;
    size_t table_size; /* a power of two */
} karst_names;

void karst_names_init(karst_names *names, karst_arena *arena);
uint32_t karst_names_id(karst_names *names, const char *text, size_t length);
static inline const char *karst_name_text(const karst_names *names, uint32_t id) { return names->items[id].text; }

/* Appends the tokens of source bytes [begin, end) and an END. Comments and spliced lines are white space. Errors:
 * unterminated comments, too many tokens. */
void karst_lex(karst_source *source, karst_names *names, uint32_t begin, uint32_t end, karst_tokens *tokens);

/* Raises the error that is in an ODD token which is a number. */
_Noreturn void karst_lex_refuse_number(karst_source *source, const karst_token *token);

void karst_tokens_push(karst_arena *arena, karst_tokens *tokens, karst_token token);
static inline bool karst_token_is(const karst_token *token, uint32_t punctuation)
{
    return token->kind == KARST_TOKEN_PUNCTUATION && token->what == punctuation;
}

#endif
