/* Random programs in the world language: functions that change what they are given, overloads, globals, loops that are
 * left in many ways, nested choices, places of every kind. All are valid, and their numbers stay moderate. */
#ifndef KARST_TESTS_LANGUAGE_RANDOM_PROGRAM_H
#define KARST_TESTS_LANGUAGE_RANDOM_PROGRAM_H

#include "tests/language/random_expression.h"

static void p_statements(random_text *g, int count, int depth);

/* ---- statements ---- */

static void p_condition(random_text *g, int depth)
{
    put(g, "(");
    p_expression(g, P_BOOL, depth);
    put(g, ")");
}

static void p_block(random_text *g, int count, int depth)
{
    int outer = g->num_variables, first = g->first_in_block;
    g->first_in_block = outer;
    put(g, "{\n");
    p_statements(g, count, depth);
    put(g, "}\n");
    g->num_variables = outer;
    g->first_in_block = first;
}

static void p_declare(random_text *g, int depth)
{
    p_type type = p_random(g, NUM_P_TYPES);
    char name[12];
    const p_variable *like = p_pick(g, type, false);
    bool shadows = like && p_chance(g, 25) && like < g->variables + g->first_in_block && strcmp(like->name, "at") != 0;
    if (shadows)
        snprintf(name, sizeof name, "%s", like->name);
    else
        p_new_name(g, name, 'v');
    bool list = p_counts[type] && p_chance(g, 40);
    if (type == P_GRID && p_chance(g, 50)) {
        put(g, "float %s[%s][2] = { ", name, p_chance(g, 50) ? "2" : "");
        for (int i = 0; i < 4; i++) {
            put(g, "%s", i == 0 ? "{ " : i == 2 ? " }, { " : ", ");
            p_expression(g, P_FLOAT, depth);
        }
        put(g, " } };\n");
    } else if (list) {
        put(g, "%s %s[] = { ", type == P_FLOATS ? "float" : type == P_INTS ? "int" : "vec2", name);
        for (int i = 0; i < p_counts[type]; i++) {
            put(g, "%s", i ? ", " : "");
            p_expression(g, type == P_FLOATS ? P_FLOAT : type == P_INTS ? P_INT : P_VEC2, depth);
        }
        put(g, " };\n");
    } else {
        bool is_const = p_chance(g, 10);
        put(g, "%s%s %s = ", is_const ? "const " : "", p_names[type], name);
        p_expression(g, type, depth);
        put(g, ";\n");
        p_declared(g, name, type, is_const);
        return;
    }
    p_declared(g, name, type, false);
}

static void p_assign(random_text *g, int depth)
{
    p_type type = p_chance(g, 50) ? P_FLOAT : p_random(g, NUM_P_TYPES);
    if (!p_can_write(g, type))
        return;
    p_place(g, type);
    const char *op = "=";
    if (type == P_FLOAT || type == P_VEC2 || type == P_VEC3 || type == P_INT || type == P_UINT)
        op = p_chance(g, 40) ? "+=" : p_chance(g, 30) ? "-=" : "=";
    if ((type == P_FLOAT || type == P_VEC3 || type == P_MAT2) && p_chance(g, 15)) {
        put(g, " *= 0.%s;\n", p_digits(g));
        return;
    }
    put(g, " %s ", op);
    p_expression(g, type, depth);
    put(g, ";\n");
}

static void p_return(random_text *g, int depth)
{
    put(g, "return");
    if (g->result != P_VOID) {
        put(g, " ");
        p_expression(g, g->result, depth);
    }
    put(g, ";\n");
}

/* What leaves a loop or a function, under a condition. */
static void p_leave(random_text *g, const char *counter)
{
    uint32_t what = p_random(g, 10);
    put(g, "if (");
    if (counter && p_chance(g, 30))
        put(g, "%s == %d", counter, (int)p_random(g, 3));
    else
        p_expression(g, P_BOOL, 2);
    put(g, ") ");
    if (!counter || what < 2)
        p_return(g, 1);
    else
        put(g, what < 6 ? "break;\n" : "continue;\n");
}

static void p_loop(random_text *g, int depth)
{
    char name[12];
    int outer = g->num_variables, most = 2 + (int)p_random(g, 3);
    long times = g->times;
    const p_variable *x = p_pick(g, P_FLOAT, true);
    bool stays = false, is_do = false; /* stays: the counter is declared before the loop */
    p_new_name(g, name, 'i');
    g->num_loops++;
    switch (p_random(g, 9)) {
    case 8: /* a bound that is a choice of numbers */
        put(g, "for (int %s = 0; %s < (", name, name);
        p_expression(g, P_BOOL, 1);
        put(g, " ? %d : %d); %s++) {\n", most, most - 1, name);
        break;
    case 5: /* a condition that varies before one that counts */
        if (x) {
            put(g, "int %s = 0;\nwhile (%s < %d.5 && %s++ < %d) {\n%s += 0.75;\n", name, x->name, (int)p_random(g, 4),
                name, most, x->name);
            stays = true;
            break;
        }   /* fall through */
    case 6: /* a counter that ends what only varies */
        put(g, "int %s = 0;\nwhile (", name);
        p_expression(g, P_BOOL, 2);
        put(g, ") {\nif (++%s > %d) break;\n", name, most);
        stays = true;
        break;
    case 7:
        put(g, "int %s = 0;\ndo {\n", name);
        stays = is_do = true;
        break;
    case 0:
        put(g, "for (int %s = %d; %s > 0; %s--) {\n", name, most, name, name);
        break;
    case 1:
        put(g, "for (int %s = 0; %s < %d && ", name, name, most);
        p_declared(g, name, P_INT, true);
        p_expression(g, P_BOOL, 2);
        put(g, "; ++%s) {\n", name);
        break;
    case 2:
        if (x) {
            put(g, "int %s = 0;\nfor (; %s < %d.5 && %s++ < %d;) {\n%s += 0.75;\n", name, x->name, (int)p_random(g, 4),
                name, most, x->name);
            stays = true;
            break;
        } /* fall through */
    case 3:
        if (x) {
            put(g, "for (int %s = 0; %s < %d; %s += 1, %s += 0.5) {\n", name, name, most, name, x->name);
            break;
        } /* fall through */
    default:
        put(g, "for (int %s = 0; %s < %d; %s++) {\n", name, name, most, name);
    }
    g->num_variables = outer;
    p_declared(g, name, P_INT, true);
    g->times *= most;
    int inner = g->num_variables;
    p_statements(g, 1 + (int)p_random(g, 2), depth - 1);
    if (p_chance(g, 75))
        p_leave(g, name);
    p_statements(g, 1 + (int)p_random(g, 2), depth - 1);
    g->num_variables = inner;
    if (is_do)
        put(g, "} while (++%s < %d);\n", name, most);
    else
        put(g, "}\n");
    g->num_variables = outer;
    if (stays)
        p_declared(g, name, P_INT, false);
    g->times = times;
    g->num_loops--;
}

/* Labels in any order, some of which fall through; a default anywhere, or none. */
static void p_switch(random_text *g, int depth)
{
    int count = 2 + (int)p_random(g, 3), otherwise = p_chance(g, 70) ? (int)p_random(g, (uint32_t)count) : -1;
    int first = (int)p_random(g, 3);
    put(g, "switch (");
    p_expression(g, P_INT, 1);
    put(g, " & 3) {\n");
    for (int i = 0; i < count; i++) {
        if (i == otherwise)
            put(g, "default:\n");
        else
            put(g, "case %d:\n", (first + i) % 4);
        int outer = g->num_variables;
        p_statements(g, 1 + (int)p_random(g, 2), depth - 1);
        if (g->num_loops && p_chance(g, 80)) {
            put(g, "if (");
            p_expression(g, P_BOOL, 1);
            put(g, ") continue;\n");
        }
        if (p_chance(g, 30)) {
            put(g, "if (");
            p_expression(g, P_BOOL, 1);
            put(g, ") break;\n");
            p_statements(g, 1, depth - 1);
        }
        g->num_variables = outer;
        if (p_chance(g, 60))
            put(g, "break;\n");
    }
    put(g, "}\n");
}

static void p_statement(random_text *g, int depth)
{
    g->cost += g->times;
    uint32_t what = p_random(g, 100);
    if (depth <= 0 || g->cost > g->most_cost)
        what = what % 45;
    if (what < 18) {
        p_declare(g, 2);
    } else if (what < 45) {
        p_assign(g, 2);
    } else if (what < 62) {
        put(g, "if ");
        p_condition(g, 2);
        put(g, " ");
        p_block(g, 1 + (int)p_random(g, 3), depth - 1);
        if (p_chance(g, 50)) {
            put(g, "else ");
            p_block(g, 1 + (int)p_random(g, 2), depth - 1);
        }
    } else if (what < 76 && g->num_loops < 2) {
        p_loop(g, depth);
    } else if (what < 82) {
        p_switch(g, depth);
    } else if (what < 86) {
        if (p_call(g, P_VOID, 2))
            put(g, ";\n");
    } else if (what < 90) {
        p_leave(g, NULL);
    } else if (what < 94) {
        p_block(g, 2, depth - 1);
    } else {
        p_assign(g, 3);
    }
}

static void p_statements(random_text *g, int count, int depth)
{
    for (int i = 0; i < count; i++)
        p_statement(g, depth);
}

/* ---- functions and globals ---- */

static void p_write_function(random_text *g, const char *name, p_type result, p_type first)
{
    p_function f = {.result = result, .count = 1 + (int)p_random(g, 3)};
    snprintf(f.name, sizeof f.name, "%s", name);
    long outer_cost = g->cost;
    bool overload = first != P_VOID;
    g->cost = 0;
    put(g, "%s %s(", p_names[result], name);
    for (int k = 0; k < f.count; k++) {
        p_type type = k == 0 && overload ? first : p_chance(g, 40) ? P_FLOAT : p_random(g, NUM_P_TYPES);
        char parameter[12];
        f.parameter[k] = type;
        f.mode[k] = overload || p_chance(g, 60) ? 'i' : p_chance(g, 60) ? 'b' : 'o';
        p_new_name(g, parameter, 'q');
        put(g, "%s%s%s %s", k ? ", " : "",
            f.mode[k] == 'i'   ? ""
            : f.mode[k] == 'b' ? "inout "
                               : "out ",
            p_names[type], parameter);
        if (k > 0 && k + 1 == f.count && f.mode[k] == 'i' && type != P_BOOL && p_chance(g, 60)) {
            put(g, " = ");
            if (type == P_FLOAT)
                put(g, "%s + 0.5", g->variables[0].name); /* what it is when the call is made */
            else
                p_literal(g, type);
            f.num_defaults = 1;
        }
        p_declared(g, parameter, type, false);
    }
    put(g, ") {\n");
    g->result = result;
    g->first_in_block = g->num_globals;
    for (int k = 0; k < f.count; k++) { /* out parameters have a value, and others change */
        const p_variable *v = &g->variables[g->num_globals + k];
        if (f.mode[k] == 'o' || p_chance(g, 50)) {
            put(g, "%s = ", v->name);
            p_expression(g, v->type, 2);
            put(g, ";\n");
        }
    }
    p_statements(g, 1 + (int)p_random(g, 4), 2);
    if (result != P_VOID)
        p_return(g, 2);
    put(g, "}\n");
    f.cost = g->cost + 4;
    f.writes = true; /* of globals at least it may be that */
    g->num_variables = g->num_globals;
    g->cost = outer_cost;
    if (g->num_functions < P_MOST_FUNCTIONS && f.cost < g->most_cost / 2)
        g->functions[g->num_functions++] = f;
}

static void p_write_globals(random_text *g)
{
    int count = 2 + (int)p_random(g, 4);
    g->pure = true;
    for (int i = 0; i < count; i++) {
        p_type type = i == 0 ? P_FLOAT : i == 1 ? P_INT : p_random(g, NUM_P_TYPES);
        char name[12];
        bool is_const = i > 1 && p_chance(g, 25);
        p_new_name(g, name, 'g');
        put(g, "%s%s %s = ", is_const ? "const " : "", p_names[type], name);
        p_expression(g, type, 1);
        put(g, ";\n");
        p_declared(g, name, type, is_const);
    }
    g->pure = false;
    g->num_globals = g->num_variables;
}

/* What every variable in sight is worth goes into the density. */
static void p_sum_up(random_text *g)
{
    static const char *const share[NUM_P_TYPES] = {
        [P_FLOAT] = "0.5 * @",
        [P_INT] = "0.125 * float(@ & 127)",
        [P_UINT] = "0.125 * float(@ & 63u)",
        [P_BOOL] = "(@ ? 0.75 : 0.0)",
        [P_VEC2] = "dot(@, vec2(0.5, 0.25))",
        [P_VEC3] = "dot(@, vec3(0.5, 0.25, -0.75))",
        [P_VEC4] = "dot(@, vec4(0.5, 0.25, -0.75, 1.0))",
        [P_IVEC2] = "0.125 * float(@.x & 127)",
        [P_MAT2] = "dot(@ * vec2(0.5, 0.25), vec2(1.0, -0.5))",
        [P_MAT3] = "dot(@ * vec3(0.5, 0.25, 1.0), vec3(1.0, -0.5, 0.25))",
        [P_STRUCT] = "(@.a + @.b.x - @.b.y + @.c[1] + 0.25 * float(@.n & 31))",
        [P_FLOATS] = "(@[0] - @[1] + 0.5 * @[2])",
        [P_VECTORS] = "dot(@[0], @[1].yx)",
        [P_INTS] = "0.25 * float(@[0] + @[1] - @[2] & 63)",
        [P_GRID] = "(@[0][1] - @[1][0] + 0.5 * @[1][1])",
    };
    for (int i = 0; i < g->num_variables; i++) {
        const p_variable *v = &g->variables[i];
        put(g, " + ");
        for (const char *c = share[v->type]; *c; c++)
            if (*c == '@')
                put(g, "%s", v->name);
            else
                put(g, "%c", *c);
    }
}

/* A call of each function, most of them in an arm of a choice, or under an if. */
static void p_use_functions(random_text *g)
{
    for (int i = 0; i < g->num_functions; i++) {
        p_type type = g->functions[i].result;
        char name[12];
        if (type == P_VOID) {
            bool choice = p_chance(g, 40);
            put(g, choice ? "if (" : "");
            if (choice)
                p_expression(g, P_BOOL, 1);
            put(g, choice ? ") " : "");
            p_call(g, type, 2);
            put(g, ";\n");
            continue;
        }
        p_new_name(g, name, 'v');
        put(g, "%s %s = ", p_names[type], name);
        if (p_chance(g, 70)) {
            put(g, "(");
            p_expression(g, P_BOOL, 1);
            put(g, " ? ");
            bool first = p_chance(g, 50);
            if (!first) {
                p_leaf(g, type);
                put(g, " : ");
            }
            if (!p_call(g, type, 2))
                p_leaf(g, type);
            if (first) {
                put(g, " : ");
                p_expression(g, type, 2);
            }
            put(g, ")");
        } else if (!p_call(g, type, 2)) {
            p_leaf(g, type);
        }
        put(g, ";\n");
        p_declared(g, name, type, false);
    }
}

static void p_write_density(random_text *g)
{
    static const p_type wanted[] = {P_FLOAT, P_STRUCT, P_FLOATS, P_VEC4, P_MAT2, P_INT, P_INTS, P_BOOL};
    put(g, "float density(vec3 p) {\n");
    g->most_cost = 1500;
    g->result = P_FLOAT;
    g->first_in_block = g->num_globals;
    p_declared(g, "p", P_VEC3, false);
    put(g, "const vec3 at = p;\n%s = p.y;\n", g->variables[0].name); /* the first global varies */
    p_declared(g, "at", P_VEC3, true);
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++) {
        char name[12];
        if (i && p_chance(g, 50))
            continue;
        p_new_name(g, name, 'w');
        put(g, "%s %s = ", p_names[wanted[i]], name);
        p_expression(g, wanted[i], i ? 2 : 0);
        put(g, ";\n");
        p_declared(g, name, wanted[i], false);
    }
    p_statements(g, 2 + (int)p_random(g, 4), 3);
    p_use_functions(g);
    p_statements(g, 2 + (int)p_random(g, 3), 3);
    put(g, "return p.x");
    p_sum_up(g);
    put(g, ";\n}\n");
}

/* The same seed gives the same program. */
static void random_program(random_text *g, uint64_t seed)
{
    memset(g, 0, sizeof *g);
    g->state = seed * 0x9e3779b97f4a7c15u + 12345;
    g->times = 1;
    g->most_cost = 300;
    p_random(g, 2);
    if (p_chance(g, 40))
        put(g, "#define HALF(x) (0.5 * (x))\n#define TWICE 2.0\nfloat h(float a) { a += TWICE; return HALF(a); }\n");
    put(g, "struct S { float a; vec2 b; int n; float c[2]; };\n");
    p_write_globals(g);
    int count = 2 + (int)p_random(g, 4);
    for (int i = 0; i < count; i++) {
        char name[12];
        p_new_name(g, name, 'f');
        p_write_function(g, name, i == 0 ? P_FLOAT : i == 1 ? P_VOID : p_random(g, NUM_P_TYPES + 1), P_VOID);
    }
    if (p_chance(g, 50)) { /* overloads: they differ in their first parameter */
        p_write_function(g, "over", P_FLOAT, P_FLOAT);
        p_write_function(g, "over", P_VEC2, P_VEC2);
        p_write_function(g, "over", P_FLOAT, P_INT);
    }
    p_write_density(g);
}

#endif
