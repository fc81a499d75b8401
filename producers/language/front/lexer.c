#include "producers/language/front/lexer.h"

#include <string.h>

void karst_names_init(karst_names *names, karst_arena *arena)
{
    *names = (karst_names){.arena = arena};
    karst_names_id(names, "", 0); /* id 0: no name */
}

static uint32_t hash_text(const char *text, size_t length)
{
    uint32_t h = 2166136261u;
    for (size_t i = 0; i < length; i++)
        h = (h ^ (unsigned char)text[i]) * 16777619u;
    return h ^ h >> 15;
}

static void rebuild_table(karst_names *names)
{
    names->table_size = names->table_size ? names->table_size * 2 : 1024;
    names->table = karst_arena_alloc(names->arena, names->table_size * sizeof *names->table);
    for (uint32_t id = 0; id < names->count; id++) {
        size_t at = names->items[id].hash & (names->table_size - 1);
        while (names->table[at])
            at = (at + 1) & (names->table_size - 1);
        names->table[at] = id + 1;
    }
}

uint32_t karst_names_id(karst_names *names, const char *text, size_t length)
{
    if ((names->count + 1) * 2 > names->table_size)
        rebuild_table(names);
    uint32_t hash = hash_text(text, length);
    size_t at = hash & (names->table_size - 1);
    for (; names->table[at]; at = (at + 1) & (names->table_size - 1)) {
        const karst_name *name = &names->items[names->table[at] - 1];
        if (name->hash == hash && name->length == length && !memcmp(name->text, text, length))
            return names->table[at] - 1;
    }
    char *copy = karst_arena_alloc(names->arena, length + 1);
    memcpy(copy, text, length);
    names->items = karst_arena_grow(names->arena, names->items, names->count, &names->capacity, names->count + 1,
                                    sizeof *names->items);
    names->items[names->count] = (karst_name){.text = copy, .length = (uint32_t)length, .hash = hash, .macro = -1};
    names->table[at] = (uint32_t)++names->count;
    return (uint32_t)names->count - 1;
}

void karst_tokens_push(karst_arena *arena, karst_tokens *tokens, karst_token token)
{
    tokens->items =
        karst_arena_grow(arena, tokens->items, tokens->count, &tokens->capacity, tokens->count + 1, sizeof token);
    tokens->items[tokens->count++] = token;
}

static bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
static bool is_digit(char c) { return c >= '0' && c <= '9'; }
static int hex_digit(char c)
{
    return is_digit(c) ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* White space, comments and spliced lines. Returns where the next token begins; notes in *token what came before it. */
static uint32_t skip_space(karst_source *source, uint32_t at, uint32_t end, karst_token *token)
{
    const char *s = source->text;
    for (uint32_t before = at;; before = at) {
        while (at < end && (s[at] == ' ' || (s[at] >= '\t' && s[at] <= '\r')))
            token->line_start |= s[at++] == '\n';
        if (at + 1 < end && s[at] == '/' && s[at + 1] == '/') {
            while (at < end && s[at] != '\n')
                at += 1 + (s[at] == '\\' && at + 1 < end); /* a spliced line goes on */
            at = at < end ? at : end;
        } else if (at + 1 < end && s[at] == '/' && s[at + 1] == '*') {
            uint32_t open = at;
            for (at += 2; at + 1 < end && !(s[at] == '*' && s[at + 1] == '/'); at++)
                ;
            if (at + 1 >= end)
                karst_source_error(source, open, "close it with */", "this comment never ends");
            at += 2;
        } else if (at + 1 < end && s[at] == '\\' && s[at + 1] == '\n') {
            at += 2;
        } else if (at + 2 < end && s[at] == '\\' && s[at + 1] == '\r' && s[at + 2] == '\n') {
            at += 3;
        }
        if (at == before)
            return at;
        token->space_before = 1;
    }
}

/* What may be wrong with a number. It is told where the number counts: what conditions leave out may say 3D. */
enum {
    NUMBER_IS_GOOD,
    NUMBER_LACKS_EXPONENT,
    NUMBER_LACKS_HEXADECIMALS,
    NUMBER_GOES_ON,
    NUMBER_IS_NOT_OCTAL,
    NUMBER_IS_TOO_LARGE,
    NUMBER_IS_TOO_LARGE_FOR_UINT
};
/* A fault and the character that it is about, as a token has them. */
static uint32_t fault_at(uint32_t fault, char c) { return fault | (uint32_t)(unsigned char)c << 8; }

void karst_lex_refuse_number(karst_source *source, const karst_token *token)
{
    const char c = (char)(token->what >> 8);
    switch (token->what & 0xff) {
    case NUMBER_LACKS_EXPONENT:
        karst_source_error(source, token->where, "write 1e6 or 1.5e-3", "this exponent has no digits");
    case NUMBER_LACKS_HEXADECIMALS:
        karst_source_error(source, token->where, "write 0xff", "there are no digits behind 0x");
    case NUMBER_GOES_ON:
        karst_source_error(source, token->where, NULL, "this number goes on with '%c', which is none of its digits", c);
    case NUMBER_IS_NOT_OCTAL:
        karst_source_error(source, token->where, "leave out the leading 0",
                           "a number that begins with 0 is octal, and '%c' is no octal digit", c);
    case NUMBER_IS_TOO_LARGE:
        karst_source_error(source, token->where, "write a point behind it to make it a float",
                           "this integer does not fit 32 bits");
    default:
        karst_source_error(source, token->where, NULL, "this integer does not fit 32 bits");
    }
}

static uint32_t lex_hexadecimal(const karst_source *source, uint32_t *at, uint32_t end, karst_token *token)
{
    const char *s = source->text;
    uint64_t value = 0;
    uint32_t digits = *at += 2, fault = NUMBER_IS_GOOD;
    for (; *at < end && hex_digit(s[*at]) >= 0; ++*at) {
        value = (value & UINT32_MAX) * 16 + (uint64_t)hex_digit(s[*at]);
        fault = value > UINT32_MAX ? (uint32_t)NUMBER_IS_TOO_LARGE_FOR_UINT : fault;
    }
    token->kind = KARST_TOKEN_INT;
    token->what = (uint32_t)value;
    return *at == digits ? (uint32_t)NUMBER_LACKS_HEXADECIMALS : fault;
}

/* Digits from `begin` to the suffix, as a whole number. */
static uint32_t find_whole_number(const char *s, uint32_t begin, karst_token *token)
{
    uint64_t value = 0;
    const uint32_t base = s[begin] == '0' && token->length > 1 ? 8 : 10;
    for (uint32_t i = 0; i < token->length; i++) {
        const uint32_t digit = (uint32_t)(s[begin + i] - '0');
        if (digit >= base)
            return fault_at(NUMBER_IS_NOT_OCTAL, s[begin + i]);
        value = value * base + digit;
        if (value > UINT32_MAX)
            return NUMBER_IS_TOO_LARGE;
    }
    token->what = (uint32_t)value;
    return NUMBER_IS_GOOD;
}

static void lex_number(const karst_source *source, uint32_t *at, uint32_t end, karst_token *token)
{
    const char *s = source->text;
    uint32_t begin = *at, fault = NUMBER_IS_GOOD;
    const bool is_hexadecimal = s[begin] == '0' && begin + 1 < end && (s[begin + 1] == 'x' || s[begin + 1] == 'X');
    token->kind = KARST_TOKEN_INT;
    if (is_hexadecimal) {
        fault = lex_hexadecimal(source, at, end, token);
    } else {
        while (*at < end && is_digit(s[*at]))
            ++*at;
        if (*at < end && s[*at] == '.') {
            token->kind = KARST_TOKEN_FLOAT;
            for (++*at; *at < end && is_digit(s[*at]);)
                ++*at;
        }
        if (*at < end && (s[*at] == 'e' || s[*at] == 'E')) {
            token->kind = KARST_TOKEN_FLOAT;
            ++*at;
            if (*at < end && (s[*at] == '+' || s[*at] == '-'))
                ++*at;
            if (*at >= end || !is_digit(s[*at]))
                fault = NUMBER_LACKS_EXPONENT;
            while (*at < end && is_digit(s[*at]))
                ++*at;
        }
    }
    token->length = *at - begin; /* without the suffix */
    if (*at < end && (s[*at] == 'f' || s[*at] == 'F')) {
        token->kind = KARST_TOKEN_FLOAT;
        ++*at;
    } else if (*at + 1 < end && ((s[*at] == 'l' && s[*at + 1] == 'f') || (s[*at] == 'L' && s[*at + 1] == 'F'))) {
        token->kind = KARST_TOKEN_FLOAT;
        *at += 2;
    } else if (*at < end && (s[*at] == 'u' || s[*at] == 'U') && token->kind == KARST_TOKEN_INT) {
        token->kind = KARST_TOKEN_UINT;
        ++*at;
    }
    if (!fault && *at < end && (is_letter(s[*at]) || is_digit(s[*at]) || s[*at] == '.'))
        fault = fault_at(NUMBER_GOES_ON, s[*at]);
    if (!fault && token->kind != KARST_TOKEN_FLOAT && !is_hexadecimal)
        fault = find_whole_number(s, begin, token);
    if (!fault)
        return;
    while (*at < end && (is_letter(s[*at]) || is_digit(s[*at]) || s[*at] == '.'))
        ++*at;
    token->kind = KARST_TOKEN_ODD;
    token->what = fault;
    token->length = *at - begin;
}

/* The longest punctuation at s. 0: none. */
static uint32_t lex_punctuation(const char *s, uint32_t left)
{
    static const char *const three[] = {"<<=", ">>="};
    static const char *const two[] = {"<<", ">>", "++", "--", "<=", ">=", "==", "!=", "&&", "||",
                                      "^^", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "##"};
    for (size_t i = 0; i < sizeof three / sizeof *three && left >= 3; i++)
        if (!memcmp(s, three[i], 3))
            return KARST_P3((uint32_t)s[0], (uint32_t)s[1], (uint32_t)s[2]);
    for (size_t i = 0; i < sizeof two / sizeof *two && left >= 2; i++)
        if (!memcmp(s, two[i], 2))
            return KARST_P2((uint32_t)s[0], (uint32_t)s[1]);
    return *s && strchr("+-*/%<>=!&|^~?:;,.()[]{}#", *s) ? (uint32_t)*s : 0;
}

/* A text in quotes, which may stand in what no entry reaches; 1: it does not end on its line. */
static uint32_t length_of_string(const char *s, uint32_t left)
{
    for (uint32_t i = 1; i < left && s[i] != '\n'; i += s[i] == '\\' ? 2 : 1)
        if (s[i] == '"')
            return i + 1;
    return 1;
}

/* Behind the name of a directive whose line means nothing here, so that it may hold anything: its end. */
static uint32_t pass_over_line(const karst_source *source, const karst_token *name, uint32_t at, uint32_t end)
{
    static const char *const words[] = {"include", "import", "pragma", "version", "extension", "line", "error"};
    const char *s = source->text;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        if (name->length != strlen(words[i]) || memcmp(s + name->text, words[i], name->length))
            continue;
        while (at < end && s[at] != '\n' && !(s[at] == '/' && (s[at + 1] == '*' || s[at + 1] == '/')))
            at += s[at] == '\\' && at + 1 < end ? 2 : 1; /* a spliced line goes on */
    }
    return at;
}

void karst_lex(karst_source *source, karst_names *names, uint32_t begin, uint32_t end, karst_tokens *tokens)
{
    const char *s = source->text;
    size_t first = tokens->count;
    karst_token token = {.line_start = 1};
    for (uint32_t at = skip_space(source, begin, end, &token); at < end; at = skip_space(source, at, end, &token)) {
        token.where = token.text = at;
        char c = s[at];
        if (is_letter(c)) {
            while (at < end && (is_letter(s[at]) || is_digit(s[at])))
                at++;
            token.kind = KARST_TOKEN_NAME;
            token.length = at - token.text;
            if (token.length > 256)
                karst_source_error(source, token.where, NULL, "this name has %u characters; 256 are allowed",
                                   token.length);
            token.what = karst_names_id(names, s + token.text, token.length);
            const karst_token *before = tokens->count > first ? &tokens->items[tokens->count - 1] : NULL;
            if (before && before->line_start && karst_token_is(before, '#'))
                at = pass_over_line(source, &token, at, end);
        } else if (is_digit(c) || (c == '.' && at + 1 < end && is_digit(s[at + 1]))) {
            lex_number(source, &at, end, &token);
        } else {
            token.what = lex_punctuation(s + at, end - at);
            token.kind = token.what ? KARST_TOKEN_PUNCTUATION : KARST_TOKEN_ODD;
            token.length = token.what > 0xffff ? 3 : token.what > 0xff ? 2 : 1;
            while (!token.what && at + token.length < end && ((unsigned char)s[at + token.length] & 0xc0) == 0x80)
                token.length++; /* the rest of a UTF-8 sequence */
            if (c == '"')
                token.length = length_of_string(s + at, end - at);
            at += token.length;
        }
        if (tokens->count - first >= KARST_MAX_TOKENS)
            karst_source_error(source, token.where, NULL, "the file has more than %u words", KARST_MAX_TOKENS);
        karst_tokens_push(source->arena, tokens, token);
        token = (karst_token){0};
    }
    karst_tokens_push(source->arena, tokens,
                      (karst_token){.kind = KARST_TOKEN_END, .line_start = 1, .text = end, .where = end});
}
