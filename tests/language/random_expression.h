/* Random expressions in the world language, of variables, places and built-ins: the half of random_program.h that has
 * no statements. */
#ifndef KARST_TESTS_LANGUAGE_RANDOM_EXPRESSION_H
#define KARST_TESTS_LANGUAGE_RANDOM_EXPRESSION_H

#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

typedef enum {
    P_FLOAT,
    P_INT,
    P_UINT,
    P_BOOL,
    P_VEC2,
    P_VEC3,
    P_VEC4,
    P_IVEC2,
    P_MAT2,
    P_MAT3,
    P_STRUCT,
    P_FLOATS,
    P_VECTORS,
    P_INTS,
    P_GRID,
    NUM_P_TYPES,
    P_VOID = NUM_P_TYPES
} p_type;

static const char *const p_names[] = {"float", "int",  "uint", "bool",     "vec2",    "vec3",   "vec4", "ivec2",
                                      "mat2",  "mat3", "S",    "float[3]", "vec2[2]", "int[3]", "float[2][2]", "void"};
/* Arrays are counted by this; the rest have 0. */
static const int p_counts[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3, 2, 3, 0, 0};

enum { P_MOST_TEXT = 1 << 16, P_MOST_VARIABLES = 96, P_MOST_FUNCTIONS = 16, P_MOST_PARAMETERS = 4 };

typedef struct {
    char name[12];
    p_type type;
    bool fixed; /* a loop's counter, or const: may not be assigned */
} p_variable;

typedef struct {
    char name[12];
    p_type result, parameter[P_MOST_PARAMETERS];
    char mode[P_MOST_PARAMETERS]; /* i: in, o: out, b: inout */
    int count, num_defaults;
    long cost;
    bool writes; /* globals, or what it is given */
} p_function;

typedef struct {
    uint64_t state;
    char text[P_MOST_TEXT];
    size_t length;
    p_variable variables[P_MOST_VARIABLES];
    int num_variables, num_globals, num_names, first_in_block;
    p_function functions[P_MOST_FUNCTIONS];
    int num_functions, num_loops;
    p_type result; /* of the function that is being written */
    long cost, times, most_cost;
    bool pure; /* nothing may change in the expression that is being written */
} random_text;

static uint32_t p_random(random_text *g, uint32_t below)
{
    g->state = g->state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)((g->state >> 33) % below);
}
static bool p_chance(random_text *g, uint32_t percent) { return p_random(g, 100) < percent; }

static void put(random_text *g, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void put(random_text *g, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    int n = vsnprintf(g->text + g->length, P_MOST_TEXT - g->length, format, list);
    va_end(list);
    if (n > 0 && g->length + (size_t)n < P_MOST_TEXT)
        g->length += (size_t)n;
}

static void p_expression(random_text *g, p_type type, int depth);

/* Behind the point: what a float holds exactly, so that few decisions are in doubt. */
static const char *p_digits(random_text *g)
{
    static const char *const digits[] = {"125", "25", "5", "75"};
    return digits[p_random(g, 4)];
}

/* ---- variables ---- */

static void p_declared(random_text *g, const char *name, p_type type, bool fixed)
{
    if (g->num_variables == P_MOST_VARIABLES)
        return;
    p_variable *v = &g->variables[g->num_variables++];
    snprintf(v->name, sizeof v->name, "%s", name);
    v->type = type;
    v->fixed = fixed;
}

/* One that is in sight, or NULL. */
static const p_variable *p_pick(random_text *g, p_type type, bool to_write)
{
    const p_variable *found = NULL;
    uint32_t n = 0;
    for (int i = 0; i < g->num_variables; i++) {
        const p_variable *v = &g->variables[i];
        bool hidden = false;
        for (int k = i + 1; k < g->num_variables; k++)
            hidden |= !strcmp(g->variables[k].name, v->name);
        if (!hidden && v->type == type && !(to_write && v->fixed) && p_random(g, ++n) == 0)
            found = v;
    }
    return found;
}

static bool p_sees(const random_text *g, const char *name)
{
    for (int i = 0; i < g->num_variables; i++)
        if (!strcmp(g->variables[i].name, name))
            return true;
    return false;
}

static void p_new_name(random_text *g, char name[12], char first) { snprintf(name, 12, "%c%d", first, g->num_names++); }

/* ---- expressions ---- */

static void p_literal(random_text *g, p_type type)
{
    switch (type) {
    case P_FLOAT:
        put(g, "%d.%s", (int)p_random(g, 4), p_chance(g, 50) ? "25" : p_chance(g, 50) ? "5" : "75");
        break;
    case P_INT:
        put(g, "%d", (int)p_random(g, 9));
        break;
    case P_UINT:
        put(g, "%du", (int)p_random(g, 9));
        break;
    case P_BOOL: {
        const p_variable *v = p_pick(g, P_FLOAT, false);
        if (v && p_chance(g, 85))
            put(g, "(%s > %d.25)", v->name, (int)p_random(g, 3) - 1);
        else
            put(g, "%s", p_chance(g, 50) ? "true" : "false");
        break;
    }
    case P_VEC2:
    case P_VEC3:
    case P_VEC4:
    case P_IVEC2:
        put(g, "%s(%d)", p_names[type], (int)p_random(g, 3));
        break;
    case P_MAT2:
        put(g, "mat2(1.0, 0.%s, -0.5, 1.%s)", p_digits(g), p_digits(g));
        break;
    case P_MAT3:
        put(g, "mat3(1.%s)", p_digits(g));
        break;
    case P_STRUCT:
        put(g, "S(0.%s, vec2(1.%s, 2.0), %d, float[2](0.5, %d.0))", p_digits(g), p_digits(g), (int)p_random(g, 5),
            (int)p_random(g, 3));
        break;
    case P_FLOATS:
        put(g, "float[3](%d.0, 0.5, 1.%s)", (int)p_random(g, 4), p_digits(g));
        break;
    case P_VECTORS:
        put(g, "vec2[2](vec2(0.5, %d.0), vec2(1.%s))", (int)p_random(g, 4), p_digits(g));
        break;
    case P_GRID:
        put(g, "float[2][2](float[2](0.%s, %d.0), float[2](2.%s, -1.0))", p_digits(g), (int)p_random(g, 4),
            p_digits(g));
        break;
    default:
        put(g, "int[3](%d, %d, 5)", (int)p_random(g, 4), (int)p_random(g, 9));
    }
}

/* An index that is in the array, one that may not be, or one that counts up what it reads. */
static void p_index(random_text *g, int count)
{
    const p_variable *i = p_pick(g, P_INT, false), *counted = p_pick(g, P_INT, true);
    bool pure = g->pure;
    if (!i || p_chance(g, 35)) {
        put(g, "%d", (int)p_random(g, (uint32_t)count));
    } else if (!pure && counted && p_chance(g, 15)) {
        put(g, "(%s++) & 1", counted->name);
    } else if (p_chance(g, 30)) {
        g->pure = true;
        bool varies = p_sees(g, "at"); /* such an index may lie outside: it is held */
        put(g, varies ? "int(at.%c * 1.5)" : "clamp(int(", 'x' + (int)p_random(g, 3));
        if (!varies) {
            p_expression(g, P_FLOAT, 1);
            put(g, "), 0, %d)", count - 1);
        }
        g->pure = pure;
    } else { /* a constant one must be in the array, whatever loop it is in */
        put(g, "%s & 1", i->name);
    }
}

/* "v.x" and its like, of one type: a component of a vector, field, element, or column. false: there is none. */
static bool p_part(random_text *g, p_type type, bool to_write)
{
    static const struct {
        p_type whole, part;
        const char *form; /* @: an index */
        int count;
    } parts[] = {
        {P_VEC3, P_FLOAT, ".x", 0},    {P_VEC3, P_FLOAT, ".z", 0},       {P_VEC2, P_FLOAT, ".y", 0},
        {P_VEC4, P_FLOAT, ".w", 0},    {P_VEC3, P_FLOAT, "[@]", 3},      {P_VEC3, P_VEC2, ".xz", 0},
        {P_VEC3, P_VEC2, ".yx", 0},    {P_VEC4, P_VEC3, ".wyx", 0},      {P_VEC4, P_VEC2, ".gb", 0},
        {P_VEC2, P_VEC2, ".yx", 0},    {P_VEC3, P_VEC3, ".zxy", 0},      {P_MAT2, P_VEC2, "[@]", 2},
        {P_MAT3, P_VEC3, "[@]", 3},    {P_MAT3, P_FLOAT, "[1].z", 0},    {P_MAT2, P_FLOAT, "[1][0]", 0},
        {P_STRUCT, P_FLOAT, ".a", 0},  {P_STRUCT, P_VEC2, ".b", 0},      {P_STRUCT, P_FLOAT, ".b.y", 0},
        {P_STRUCT, P_INT, ".n", 0},    {P_STRUCT, P_FLOAT, ".c[@]", 2},  {P_FLOATS, P_FLOAT, "[@]", 3},
        {P_VECTORS, P_VEC2, "[@]", 2}, {P_VECTORS, P_FLOAT, "[@].x", 2}, {P_IVEC2, P_INT, ".y", 0},
        {P_INTS, P_INT, "[@]", 3},     {P_VEC4, P_VEC4, ".wzyx", 0},    {P_FLOATS, P_INT, ".length()", 0},
        {P_VEC3, P_INT, ".length()", 0}, {P_STRUCT, P_INT, ".c.length()", 0}, {P_MAT2, P_INT, ".length()", 0},
        {P_GRID, P_FLOAT, "[@][@]", 2},  {P_GRID, P_FLOAT, "[1][@]", 2}, {P_GRID, P_INT, "[1].length()", 2},
        {P_GRID, P_FLOAT, "[@][0]", 2},
    };
    enum { COUNT = sizeof parts / sizeof *parts };
    uint32_t begin = p_random(g, COUNT);
    for (uint32_t k = 0; k < COUNT; k++) {
        uint32_t i = (begin + k) % COUNT;
        bool fits = parts[i].part == type && !(to_write && strchr(parts[i].form, '('));
        const p_variable *v = fits ? p_pick(g, parts[i].whole, to_write) : NULL;
        if (!v)
            continue;
        put(g, "%s", v->name);
        for (const char *c = parts[i].form; *c; c++)
            if (*c == '@')
                p_index(g, parts[i].count);
            else
                put(g, "%c", *c);
        return true;
    }
    return false;
}

/* What can be assigned to. false: nothing. */
static bool p_place(random_text *g, p_type type)
{
    const p_variable *v = p_pick(g, type, true);
    if ((!v || p_chance(g, 45)) && p_part(g, type, true))
        return true;
    if (v)
        put(g, "%s", v->name);
    return v != NULL;
}

static bool p_can_write(random_text *g, p_type type) { return p_pick(g, type, true) != NULL; }

static void p_leaf(random_text *g, p_type type)
{
    const p_variable *v = p_pick(g, type, false);
    if (p_chance(g, 40) && p_part(g, type, false))
        return;
    if (v && p_chance(g, 92))
        put(g, "%s", v->name);
    else
        p_literal(g, type);
}

/* A call of a function that gives `type`. false: there is none that may be called here. */
static bool p_call(random_text *g, p_type type, int depth)
{
    const p_function *f = NULL;
    uint32_t n = 0;
    for (int i = 0; i < g->num_functions; i++) {
        const p_function *c = &g->functions[i];
        bool fits = c->result == type && !(g->pure && c->writes) && g->cost + c->cost * g->times < g->most_cost;
        for (int k = 0; k < c->count && fits; k++)
            fits = c->mode[k] == 'i' || p_can_write(g, c->parameter[k]);
        if (fits && p_random(g, ++n) == 0)
            f = c;
    }
    if (!f)
        return false;
    g->cost += f->cost * g->times;
    put(g, "%s(", f->name);
    const int given = f->count - (f->num_defaults && p_chance(g, 60) ? f->num_defaults : 0);
    for (int k = 0; k < given; k++) {
        put(g, "%s", k ? ", " : "");
        if (f->mode[k] == 'i')
            p_expression(g, f->parameter[k], depth - 1);
        else if (!p_place(g, f->parameter[k]))
            p_literal(g, f->parameter[k]); /* not reached */
    }
    put(g, ")");
    return true;
}

/* $0 to $9: an expression of that p_type's letter: f float, i int, u uint, b bool, 2 3 4 vectors, j ivec2, m mat2,
 * n mat3, s struct. */
static void p_form(random_text *g, const char *form, int depth)
{
    static const char letters[] = "fiub234jmns";
    for (const char *c = form; *c; c++) {
        const char *at = *c == '$' ? strchr(letters, c[1]) : NULL;
        if (!at) {
            put(g, "%c", *c);
            continue;
        }
        p_expression(g, (p_type)(at - letters), depth - 1);
        c++;
    }
}

static const char *const p_forms[][26] = {
    [P_FLOAT] = {"($f + $f)",
                 "($f - $f)",
                 "($f * $f)",
                 "($f / (abs($f) + 0.5))",
                 "sin($f)",
                 "max($f, $f)",
                 "min($f, $f)",
                 "clamp($f, -1.5, $f)",
                 "mix($f, $f, 0.25)",
                 "dot($3, $3)",
                 "length($2)",
                 "float($i)",
                 "abs($f)",
                 "fract($f)",
                 "mod($f, 1.75)",
                 "smoothstep(-1.0, 2.0, $f)",
                 "pow(abs($f) + 0.25, 1.5)",
                 "sqrt(abs($f))",
                 "($f, $f)",
                 "-($f)",
                 "atan($f, 2.5)",
                 "floor($f)",
                 "((true ? $i : 1.5) / 4)",
                 "determinant($m)",
                 "step(0.5, $f)"},
    [P_INT] = {"($i + $i)", "($i - $i)", "($i * 3)", "($i % 5)", "($i / 2)", "int($f)", "($i & 7)", "($i | 2)",
               "($i ^ $i)", "($i << 1)", "($i >> 1)", "min($i, $i)", "-($i)", "~($i)", "abs($i)", "int($u & 15u)",
               "clamp($i, 0, 5)", "($i, $i)"},
    [P_UINT] = {"($u + $u)", "($u * 2654435761u)", "($u ^ ($u >> 3))", "uint($i)", "($u % 7u)", "($u & 255u)",
                "($u << 2)", "max($u, $u)"},
    [P_BOOL] = {"($f < $f)", "($f > $f)", "($i <= $i)", "($i == $i)", "($b && $b)", "($b || $b)", "!($b)",
                "(($i & 1) != 0)", "any(lessThan($3, $3))", "all(greaterThan($2, $2))", "($b ^^ $b)", "($u < $u)",
                "($b && ($f < $f || $b))", "bool($i)"},
    [P_VEC2] = {"($2 + $2)", "($2 * $f)", "vec2($f, $f)", "($m * $2)", "($2 * $m)", "abs($2)", "-($2)", "max($2, 0.25)",
                "mix($2, $2, $f)", "vec2($j)", "fract($2)", "sin($2)", "vec2($3)"},
    [P_VEC3] = {"($3 + $3)", "($3 - $3)", "($f * $3)", "vec3($2, $f)", "vec3($f, $2)", "cross($3, $3)", "abs($3)",
                "($n * $3)", "normalize($3 + 0.5)", "min($3, $3)", "floor($3)", "reflect($3, vec3(0.0, 1.0, 0.0))",
                "clamp($3, 0.0, 1.0)", "vec3($f)", "$4.xyz"},
    [P_VEC4] = {"vec4($3, $f)", "vec4($2, $2)", "($4 + $4)", "($4 * $f)", "cos($4)", "vec4($f)"},
    [P_IVEC2] = {"($j + $j)", "ivec2($i, $i)", "ivec2($2)", "($j * 2)", "-($j)"},
    [P_MAT2] = {"mat2($f, $f, $f, $f)", "($m * $m)", "($m + $m)", "transpose($m)", "($m * 0.5)", "mat2($2, $2)",
                "outerProduct($2, $2)"},
    [P_MAT3] = {"mat3($3, $3, $3)", "($n * $n)", "transpose($n)", "($n - $n)", "mat3($m)", "(0.5 * $n)"},
    [P_STRUCT] = {"S($f, $2, $i, float[2]($f, $f))"},
    [P_FLOATS] = {"float[3]($f, $f, $f)"},
    [P_VECTORS] = {"vec2[2]($2, $2)"},
    [P_INTS] = {"int[3]($i, $i, $i)"},
    [P_GRID] = {"float[2][2](float[2]($f, $f), float[2]($f, $f))"},
};

/* Assignments and counting inside of expressions. false: nothing to write to. */
static bool p_effect(random_text *g, p_type type, int depth)
{
    if (g->pure || !p_can_write(g, type))
        return false;
    bool counts = type == P_FLOAT || type == P_INT || type == P_UINT || type == P_VEC2;
    if (counts && p_chance(g, 50)) {
        static const char *const before[] = {"(++", "(--", "(", "("}, *const behind[] = {")", ")", "++)", "--)"};
        uint32_t k = p_random(g, 4);
        put(g, "%s", before[k]);
        p_place(g, type);
        put(g, "%s", behind[k]);
        return true;
    }
    put(g, "(");
    p_place(g, type);
    put(g, counts && p_chance(g, 50) ? " += " : " = ");
    p_expression(g, type, depth - 1);
    put(g, ")");
    return true;
}

static void p_expression(random_text *g, p_type type, int depth)
{
    g->cost += g->times;
    if (depth <= 0 || g->cost > g->most_cost) {
        p_leaf(g, type);
        return;
    }
    uint32_t what = p_random(g, 100);
    if (what < 22 && p_call(g, type, depth))
        return;
    if (what >= 22 && what < 32 && p_effect(g, type, depth))
        return;
    if (what >= 32 && what < 47) {
        put(g, "(");
        p_expression(g, P_BOOL, depth - 1);
        put(g, " ? ");
        p_expression(g, type, depth - 1);
        put(g, " : ");
        p_expression(g, type, depth - 1);
        put(g, ")");
        return;
    }
    uint32_t n = 0;
    while (n < 24 && p_forms[type][n])
        n++;
    if (what < 90 && n)
        p_form(g, p_forms[type][p_random(g, n)], depth);
    else
        p_leaf(g, type);
}

#endif
