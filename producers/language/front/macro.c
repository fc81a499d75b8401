/* Expansion in the C standard's manner: a stack of token lists is read as one stream; a macro is off while its own list
 * is on the stack, and its name, met there, stays as it is for ever. */
#include "producers/language/front/macro.h"

#include <string.h>

#define MAX_STEPS 2000000u /* tokens read, also those that come to nothing */
#define MAX_PARAMETERS 64u

typedef struct {
    uint32_t name;
    bool defined, is_function, busy;
    uint32_t num_parameters, parameters[MAX_PARAMETERS];
    karst_tokens body;
} macro;

typedef struct frame {
    struct frame *below;
    const karst_token *items;
    size_t count, at;
    macro *of;    /* turned on again when the frame ends; NULL: a plain list */
    bool is_file; /* directives are obeyed here */
} frame;

typedef struct {
    karst_source *source;
    karst_names *names;
    macro **macros;
    size_t count, capacity;
    uint32_t steps, depth;
    struct {
        uint32_t where;
        bool taken, had_else;
    } ifs[KARST_MAX_NESTING];
    uint32_t num_ifs;
} preprocessor;

static void expand(preprocessor *p, frame *top, karst_tokens *out);

static macro *macro_named(preprocessor *p, const karst_token *token)
{
    int32_t at = token->kind == KARST_TOKEN_NAME ? p->names->items[token->what].macro : -1;
    return at >= 0 && p->macros[at]->defined ? p->macros[at] : NULL;
}

static macro *macro_make(preprocessor *p, uint32_t name)
{
    karst_name *entry = &p->names->items[name];
    if (entry->macro < 0 || (size_t)entry->macro >= p->count) {
        p->macros =
            karst_arena_grow(p->source->arena, p->macros, p->count, &p->capacity, p->count + 1, sizeof *p->macros);
        entry->macro = (int32_t)p->count;
        p->macros[p->count++] = karst_arena_alloc(p->source->arena, sizeof(macro));
    }
    macro *m = karst_arena_alloc(p->source->arena, sizeof *m); /* a fresh one: the old may be in use */
    m->name = name;
    m->defined = true;
    return p->macros[entry->macro] = m;
}

static bool is_name(preprocessor *p, const karst_token *token, const char *text)
{
    return token->kind == KARST_TOKEN_NAME && !strcmp(karst_name_text(p->names, token->what), text);
}

static bool is_paste(const karst_token *t) { return karst_token_is(t, KARST_P2('#', '#')); }

static void define(preprocessor *p, const karst_token *t, const karst_token *end)
{
    karst_source *source = p->source;
    if (t == end || t->kind != KARST_TOKEN_NAME)
        karst_source_error(source, t->where, "write #define NAME value", "#define needs a name");
    if (is_name(p, t, "defined"))
        karst_source_error(source, t->where, NULL, "'defined' cannot be a macro");
    macro *m = macro_make(p, t->what);
    t++;
    if (t < end && karst_token_is(t, '(') && !t->space_before) {
        m->is_function = true;
        for (t++; t < end && !karst_token_is(t, ')');) {
            if (t->kind != KARST_TOKEN_NAME)
                karst_source_error(source, t->where, NULL, "a macro's parameters are names");
            for (uint32_t i = 0; i < m->num_parameters; i++)
                if (m->parameters[i] == t->what)
                    karst_source_error(source, t->where, NULL, "this macro has two parameters called '%s'",
                                       karst_name_text(p->names, t->what));
            if (m->num_parameters == MAX_PARAMETERS)
                karst_source_error(source, t->where, NULL, "a macro may have %u parameters", MAX_PARAMETERS);
            m->parameters[m->num_parameters++] = t++->what;
            if (t < end && karst_token_is(t, ','))
                t++;
            else if (t < end && !karst_token_is(t, ')'))
                karst_source_error(source, t->where, NULL, "expected ',' or ')' in this macro's parameters");
        }
        if (t >= end)
            karst_source_error(source, end[-1].where, NULL, "the parameters of this macro never end");
        t++;
    }
    for (const karst_token *first = t; t < end; t++) {
        if (karst_token_is(t, '#'))
            karst_source_error(source, t->where, "there are no texts in a world", "macros cannot quote words");
        if (is_paste(t) && (t == first || t + 1 == end || is_paste(t + 1)))
            karst_source_error(source, t->where, "write a ## b", "'##' stands between two words");
        karst_tokens_push(source->arena, &m->body, *t);
    }
}

/* ---- #if ---- */

typedef struct {
    preprocessor *p;
    const karst_token *at; /* up to an END */
    uint32_t depth;
} condition;

static int64_t condition_binary(condition *c, int level);

static int64_t condition_unary(condition *c)
{
    const karst_token *t = c->at;
    if (++c->depth > KARST_MAX_NESTING)
        karst_source_error(c->p->source, t->where, NULL, "this condition is nested deeper than %u", KARST_MAX_NESTING);
    int64_t value = 0;
    if (t->kind != KARST_TOKEN_END)
        c->at++;
    if (karst_token_is(t, '!'))
        value = !condition_unary(c);
    else if (karst_token_is(t, '-'))
        value = -condition_unary(c);
    else if (karst_token_is(t, '+'))
        value = condition_unary(c);
    else if (karst_token_is(t, '~'))
        value = ~condition_unary(c);
    else if (karst_token_is(t, '(')) {
        value = condition_binary(c, 0);
        if (!karst_token_is(c->at, ')'))
            karst_source_error(c->p->source, c->at->where, NULL, "expected ')' in this condition");
        c->at++;
    } else if (t->kind == KARST_TOKEN_INT || t->kind == KARST_TOKEN_UINT)
        value = t->what;
    else if (t->kind == KARST_TOKEN_NAME)
        value = is_name(c->p, t, "true");
    else if (t->kind == KARST_TOKEN_FLOAT)
        karst_source_error(c->p->source, t->where, "use an integer", "#if compares integers only");
    else
        karst_source_error(c->p->source, t->where, NULL, "expected a number in this condition");
    c->depth--;
    return value;
}

static int64_t condition_apply(condition *c, const karst_token *op, int64_t a, int64_t b)
{
    uint64_t ua = (uint64_t)a, ub = (uint64_t)b;
    switch (op->what) {
    case KARST_P2('|', '|'):
        return a || b;
    case KARST_P2('&', '&'):
        return a && b;
    case '|':
        return a | b;
    case '^':
        return a ^ b;
    case '&':
        return a & b;
    case KARST_P2('=', '='):
        return a == b;
    case KARST_P2('!', '='):
        return a != b;
    case '<':
        return a < b;
    case '>':
        return a > b;
    case KARST_P2('<', '='):
        return a <= b;
    case KARST_P2('>', '='):
        return a >= b;
    case KARST_P2('<', '<'):
        return (int64_t)(ua << (b & 63));
    case KARST_P2('>', '>'):
        return a >> (b & 63);
    case '+':
        return (int64_t)(ua + ub);
    case '-':
        return (int64_t)(ua - ub);
    case '*':
        return (int64_t)(ua * ub);
    default:
        if (!b)
            karst_source_error(c->p->source, op->where, NULL, "this condition divides by zero");
        if (b == -1)
            return op->what == '/' ? (int64_t)(0 - ua) : 0;
        return op->what == '/' ? a / b : a % b;
    }
}

/* Precedence levels, loosest first; each row ends with 0. */
static const uint32_t condition_levels[][5] = {{KARST_P2('|', '|')},
                                               {KARST_P2('&', '&')},
                                               {'|'},
                                               {'^'},
                                               {'&'},
                                               {KARST_P2('=', '='), KARST_P2('!', '=')},
                                               {'<', '>', KARST_P2('<', '='), KARST_P2('>', '=')},
                                               {KARST_P2('<', '<'), KARST_P2('>', '>')},
                                               {'+', '-'},
                                               {'*', '/', '%'}};
#define NUM_CONDITION_LEVELS ((int)(sizeof condition_levels / sizeof *condition_levels))

static int64_t condition_binary(condition *c, int level)
{
    if (level == NUM_CONDITION_LEVELS)
        return condition_unary(c);
    int64_t value = condition_binary(c, level + 1);
    for (;;) {
        const karst_token *op = c->at;
        bool found = false;
        for (const uint32_t *o = condition_levels[level]; *o && !found; o++)
            found = karst_token_is(op, *o);
        if (!found)
            return value;
        c->at++;
        value = condition_apply(c, op, value, condition_binary(c, level + 1));
    }
}

/* Replaces defined(X), expands macros, evaluates. */
static bool condition_holds(preprocessor *p, const karst_token *t, const karst_token *end)
{
    uint32_t where = t[-1].where;
    karst_tokens plain = {0}, expanded = {0};
    for (; t < end; t++) {
        if (!is_name(p, t, "defined")) {
            karst_tokens_push(p->source->arena, &plain, *t);
            continue;
        }
        bool bracket = t + 1 < end && karst_token_is(t + 1, '(');
        const karst_token *name = t + 1 + bracket;
        if (name >= end || name->kind != KARST_TOKEN_NAME ||
            (bracket && (name + 1 >= end || !karst_token_is(name + 1, ')'))))
            karst_source_error(p->source, t->where, "write defined(NAME)", "'defined' needs a name");
        karst_tokens_push(
            p->source->arena, &plain,
            (karst_token){
                .kind = KARST_TOKEN_INT, .what = macro_named(p, name) != NULL, .where = t->where, .text = t->text});
        t = name + bracket;
    }
    frame list = {.items = plain.items, .count = plain.count};
    expand(p, &list, &expanded);
    karst_tokens_push(p->source->arena, &expanded, (karst_token){.kind = KARST_TOKEN_END, .where = where});
    condition c = {.p = p, .at = expanded.items};
    int64_t value = condition_binary(&c, 0);
    if (c.at->kind != KARST_TOKEN_END)
        karst_source_error(p->source, c.at->where, NULL, "this condition goes on where it should end");
    return value != 0;
}

/* ---- directives ---- */

static const karst_token *line_end(const karst_token *t)
{
    while (t->kind != KARST_TOKEN_END && !t->line_start)
        t++;
    return t;
}

/* `t` stands on the '#' of an #if whose branch is not taken, or of a later #elif or #else. Returns the '#' of the
 * #elif, #else or #endif that belongs to it. */
static const karst_token *skip_branch(preprocessor *p, const karst_token *t)
{
    uint32_t depth = 0, where = t->where;
    for (t = line_end(t + 1); t->kind != KARST_TOKEN_END; t = line_end(t + 1)) {
        if (!karst_token_is(t, '#') || t[1].line_start)
            continue;
        if (is_name(p, t + 1, "if") || is_name(p, t + 1, "ifdef") || is_name(p, t + 1, "ifndef"))
            depth++;
        else if (is_name(p, t + 1, "endif") && depth)
            depth--;
        else if (!depth && (is_name(p, t + 1, "elif") || is_name(p, t + 1, "else") || is_name(p, t + 1, "endif")))
            return t;
    }
    karst_source_error(p->source, where, "close it with #endif", "this condition never ends");
}

/* Walks from an #if, #elif or #else that was not taken to the first token of the branch that is, or behind the #endif.
 */
static const karst_token *find_branch(preprocessor *p, const karst_token *t)
{
    for (;;) {
        t = skip_branch(p, t);
        const karst_token *end = line_end(t + 1);
        bool is_else = is_name(p, t + 1, "else");
        if (is_name(p, t + 1, "endif")) {
            p->num_ifs--;
            return end;
        }
        if (p->ifs[p->num_ifs - 1].had_else)
            karst_source_error(p->source, t->where, NULL, "this stands behind the #else");
        p->ifs[p->num_ifs - 1].had_else = is_else;
        if (!p->ifs[p->num_ifs - 1].taken && (is_else || condition_holds(p, t + 2, end))) {
            p->ifs[p->num_ifs - 1].taken = true;
            return end;
        }
    }
}

/* `t` is a '#' at the start of a line. Returns where to read on. */
static const karst_token *directive(preprocessor *p, const karst_token *t)
{
    static const char *const known[] = {"define", "undef", "if", "ifdef", "ifndef", "elif", "else", "endif"};
    karst_source *source = p->source;
    const karst_token *name = t + 1, *end = line_end(name);
    if (name == end)
        return end; /* a lone # */
    if (is_name(p, name, "define")) {
        define(p, name + 1, end);
    } else if (is_name(p, name, "undef")) {
        macro *m = name + 1 < end ? macro_named(p, name + 1) : NULL;
        if (m)
            m->defined = false;
    } else if (is_name(p, name, "if") || is_name(p, name, "ifdef") || is_name(p, name, "ifndef")) {
        if (p->num_ifs == KARST_MAX_NESTING)
            karst_source_error(source, name->where, NULL, "conditions are nested deeper than %u", KARST_MAX_NESTING);
        bool plain = is_name(p, name, "if");
        if (name + 1 == end || (!plain && name[1].kind != KARST_TOKEN_NAME))
            karst_source_error(source, name->where, NULL, "#%s needs a %s", karst_name_text(p->names, name->what),
                               plain ? "condition" : "name");
        bool holds =
            plain ? condition_holds(p, name + 1, end) : (macro_named(p, name + 1) != NULL) == is_name(p, name, "ifdef");
        p->ifs[p->num_ifs].where = t->where;
        p->ifs[p->num_ifs].taken = holds;
        p->ifs[p->num_ifs++].had_else = false;
        return holds ? end : find_branch(p, t);
    } else if (is_name(p, name, "elif") || is_name(p, name, "else") || is_name(p, name, "endif")) {
        if (!p->num_ifs)
            karst_source_error(source, name->where, NULL, "there is no #if before this #%s",
                               karst_name_text(p->names, name->what));
        if (is_name(p, name, "endif")) {
            p->num_ifs--;
            return end;
        }
        if (p->ifs[p->num_ifs - 1].had_else)
            karst_source_error(source, t->where, NULL, "this stands behind the #else");
        p->ifs[p->num_ifs - 1].had_else = is_name(p, name, "else");
        return find_branch(p, t);
    } else if (is_name(p, name, "include") || is_name(p, name, "import")) {
        karst_source_warn(source, t->where, "paste the text of that file here",
                          "a world is one file: #include is passed over");
    } else if (is_name(p, name, "error")) {
        karst_source_error(source, t->where, NULL, "the world stops here with #error");
    } else if (!is_name(p, name, "version") && !is_name(p, name, "extension") && !is_name(p, name, "pragma") &&
               !is_name(p, name, "line")) {
        karst_nearest nearest = karst_nearest_begin(source->text + name->text, name->length);
        for (size_t i = 0; i < sizeof known / sizeof *known; i++)
            karst_nearest_offer(&nearest, known[i]);
        const char *hint = karst_nearest_hint(&nearest, source->arena);
        if (hint)
            karst_source_error(source, name->where, hint, "there is no directive #%.*s", (int)name->length,
                               source->text + name->text);
        karst_source_warn(source, name->where, NULL, "there is no directive #%.*s: its line is passed over",
                          (int)name->length, source->text + name->text);
    }
    return end;
}

/* ---- the stream ---- */

/* The next token without taking it; lists that have ended are popped. NULL at the end of all. */
static const karst_token *peek(preprocessor *p, frame **top)
{
    for (frame *f; (f = *top);) {
        if (f->is_file)
            while (karst_token_is(&f->items[f->at], '#') && f->items[f->at].line_start)
                f->at = (size_t)(directive(p, &f->items[f->at]) - f->items);
        if (f->at < f->count)
            return &f->items[f->at];
        if (f->of)
            f->of->busy = false;
        *top = f->below;
    }
    return NULL;
}

static void count_step(preprocessor *p, uint32_t where)
{
    if (++p->steps > MAX_STEPS)
        karst_source_error(p->source, where, NULL, "macros expand to more than %u words", KARST_MAX_EXPANDED_TOKENS);
}

/* An argument of a macro as it was written, and expanded on its own. */
typedef struct {
    karst_tokens raw, expanded;
} argument;

/* Reads "(a, b, ...)" behind a macro's name. */
static void read_arguments(preprocessor *p, frame **top, const macro *m, uint32_t where, argument *arguments)
{
    karst_source *source = p->source;
    const char *name = karst_name_text(p->names, m->name);
    uint32_t n = 0, depth = 0;
    (*top)->at++; /* the bracket */
    for (;;) {
        const karst_token *t = peek(p, top);
        if (!t || t->kind == KARST_TOKEN_END)
            karst_source_error(source, where, NULL, "the arguments of macro '%s' never end", name);
        (*top)->at++;
        count_step(p, where);
        if (!depth && karst_token_is(t, ')'))
            break;
        if (!depth && karst_token_is(t, ',')) {
            if (++n >= m->num_parameters)
                karst_source_error(source, where, NULL, "macro '%s' takes %u argument%s, not more", name,
                                   m->num_parameters, m->num_parameters == 1 ? "" : "s");
            continue;
        }
        depth += karst_token_is(t, '(');
        depth -= karst_token_is(t, ')');
        if (!m->num_parameters)
            karst_source_error(source, where, NULL, "macro '%s' takes no arguments", name);
        karst_tokens_push(source->arena, &arguments[n].raw, *t);
    }
    if (m->num_parameters && n + 1 != m->num_parameters)
        karst_source_error(source, where, NULL, "macro '%s' takes %u arguments, not %u", name, m->num_parameters,
                           n + 1);
    for (uint32_t i = 0; i < m->num_parameters; i++) {
        frame list = {.items = arguments[i].raw.items, .count = arguments[i].raw.count};
        expand(p, &list, &arguments[i].expanded);
    }
}

static karst_token paste(preprocessor *p, const karst_token *a, const karst_token *b, uint32_t where)
{
    const karst_token *part[2] = {a, b};
    char text[512];
    size_t length = 0;
    for (int i = 0; i < 2; i++) {
        bool is_name = part[i]->kind == KARST_TOKEN_NAME;
        bool is_digits = part[i]->kind == KARST_TOKEN_INT && part[i]->length && i > 0;
        if (!is_name && !is_digits)
            karst_source_error(p->source, where, "paste names, and digits behind them", "'##' can make names only");
        const char *from = is_name ? karst_name_text(p->names, part[i]->what) : p->source->text + part[i]->text;
        size_t n = is_name ? p->names->items[part[i]->what].length : part[i]->length;
        if (n > 256 - (length < 256 ? length : 256))
            karst_source_error(p->source, where, NULL, "this name has more than 256 characters");
        memcpy(text + length, from, n);
        length += n;
    }
    karst_token t = *a;
    t.what = karst_names_id(p->names, text, length);
    t.no_expand = 0;
    t.where = where;
    return t;
}

/* Puts the expansion of a macro on the stream. What the macro's own text says points to the call, what the user wrote
 * as an argument to itself. */
static void enter_macro(preprocessor *p, frame **top, macro *m, uint32_t where)
{
    karst_arena *arena = p->source->arena;
    karst_tokens list = {0};
    argument *arguments = NULL;
    if (m->is_function) {
        arguments = karst_arena_alloc(arena, sizeof *arguments * (m->num_parameters + 1));
        read_arguments(p, top, m, where, arguments);
    }
    bool has_left = false; /* there is something for the next ## to paste to */
    for (size_t i = 0; i < m->body.count; i++) {
        karst_token t = m->body.items[i];
        if (is_paste(&t))
            continue;
        bool pastes = i > 0 && is_paste(&m->body.items[i - 1]);
        bool is_operand = pastes || (i + 1 < m->body.count && is_paste(&m->body.items[i + 1]));
        uint32_t k = m->num_parameters;
        for (uint32_t j = 0; j < m->num_parameters && t.kind == KARST_TOKEN_NAME; j++)
            if (m->parameters[j] == t.what)
                k = j;
        t.where = where;
        karst_tokens one = {.items = &t, .count = 1};
        const karst_tokens *put = &one;
        if (k < m->num_parameters)
            put = is_operand ? &arguments[k].raw : &arguments[k].expanded;
        for (size_t j = 0; j < put->count; j++) {
            count_step(p, where);
            if (j == 0 && pastes && has_left)
                list.items[list.count - 1] = paste(p, &list.items[list.count - 1], &put->items[0], where);
            else
                karst_tokens_push(arena, &list, put->items[j]);
        }
        has_left = put->count > 0 || (pastes && has_left);
    }
    frame *f = karst_arena_alloc(arena, sizeof *f);
    *f = (frame){.below = *top, .items = list.items, .count = list.count, .of = m};
    m->busy = true;
    *top = f;
}

static _Noreturn void odd_character(karst_source *source, const karst_token *token)
{
    char c = source->text[token->text];
    if ((unsigned char)c < 0x80)
        karst_source_error(source, token->where, NULL, "the character '%c' has no meaning here", c);
    karst_source_error(source, token->where, "names are made of a-z, A-Z, 0-9 and _",
                       "letters beyond ASCII may stand in comments only");
}

/* Expands the stream `top` to its end. */
static void expand(preprocessor *p, frame *top, karst_tokens *out)
{
    karst_source *source = p->source;
    p->depth++;
    for (const karst_token *t; (t = peek(p, &top)) && t->kind != KARST_TOKEN_END;) {
        top->at++;
        karst_token token = *t;
        count_step(p, token.where);
        if (p->depth > KARST_MAX_NESTING)
            karst_source_error(source, token.where, NULL, "macro calls are nested deeper than %u", KARST_MAX_NESTING);
        if (token.kind == KARST_TOKEN_ODD && token.what)
            karst_lex_refuse_number(source, &token);
        if (token.kind == KARST_TOKEN_ODD && token.length < 2 + (source->text[token.text] != '"'))
            odd_character(source, &token);
        macro *m = token.no_expand ? NULL : macro_named(p, &token);
        if (m && m->busy) {
            token.no_expand = 1;
            m = NULL;
        }
        if (m && m->is_function) {
            const karst_token *next = peek(p, &top);
            if (!next || !karst_token_is(next, '('))
                m = NULL;
        }
        if (m) {
            enter_macro(p, &top, m, token.where);
            continue;
        }
        if (out->count >= KARST_MAX_EXPANDED_TOKENS)
            karst_source_error(source, token.where, NULL, "macros expand to more than %u words",
                               KARST_MAX_EXPANDED_TOKENS);
        karst_tokens_push(source->arena, out, token);
    }
    p->depth--;
}

static void predefine(preprocessor *p, const char *name, uint32_t value)
{
    macro *m = macro_make(p, karst_names_id(p->names, name, strlen(name)));
    karst_tokens_push(p->source->arena, &m->body, (karst_token){.kind = KARST_TOKEN_INT, .what = value});
}

void karst_preprocess(karst_source *source, karst_names *names, const karst_tokens *in, karst_tokens *out)
{
    preprocessor *p = karst_arena_alloc(source->arena, sizeof *p);
    p->source = source;
    p->names = names;
    for (size_t i = 0; i < names->count; i++)
        names->items[i].macro = -1; /* of an earlier run */
    predefine(p, "KARST", 1);
    predefine(p, "__VERSION__", 300);
    frame file = {.items = in->items, .count = in->count, .is_file = true};
    expand(p, &file, out);
    if (p->num_ifs)
        karst_source_error(source, p->ifs[p->num_ifs - 1].where, "close it with #endif", "this condition never ends");
    karst_tokens_push(source->arena, out, in->items[in->count - 1]);
}
