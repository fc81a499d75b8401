/* Built-in functions for the interpreter of truth.h, from their definitions in WORLDS.md and GLSL's. */
#ifndef KARST_TESTS_LANGUAGE_TRUTH_BUILT_INS_H
#define KARST_TESTS_LANGUAGE_TRUTH_BUILT_INS_H

#include "tests/language/truth_value.h"

/* ---- of each component ---- */

static cell t_sign(cell a) { return exactly(less(exactly(0), a) ? 1 : less(a, exactly(0)) ? -1 : 0); }
static cell t_inverse_root(cell a) { return divide(exactly(1), root(a)); }
static cell t_exp(cell a) { return power_of_two(multiply(a, rounded(1.4426950408889634074, 0))); }
static cell t_log2(cell a) { return multiply(logarithm(a), rounded(1.4426950408889634074, 0)); }
static cell t_tan(cell a) { return divide(sine(a), cosine(a)); }
static cell t_atan(cell a) { return angle(a, exactly(1)); }
static cell t_radians(cell a) { return multiply(a, rounded(0.017453292519943295769, 0)); }
static cell t_degrees(cell a) { return multiply(a, rounded(57.295779513082320877, 0)); }
static cell t_held(cell a, cell low, cell high) { return smaller_of(larger_of(a, low), high); }
static cell t_unit(cell a) { return t_held(a, exactly(0), exactly(1)); }
static cell t_arc(cell a, bool of_cosine)
{
    cell c = t_held(a, exactly(-1), exactly(1));
    cell other = root(multiply(subtract(exactly(1), c), add(exactly(1), c)));
    return of_cosine ? angle(other, c) : angle(c, other);
}
static cell t_asin(cell a) { return t_arc(a, false); }
static cell t_acos(cell a) { return t_arc(a, true); }
static cell t_sinh(cell a) { return multiply(exactly(0.5), subtract(t_exp(a), t_exp(negate(a)))); }
static cell t_cosh(cell a) { return multiply(exactly(0.5), add(t_exp(a), t_exp(negate(a)))); }
static cell t_tanh(cell a) { return rounded(tanh(a.v), a.e + 0x1p-20); }

static cell t_step(cell edge, cell a) { return exactly(less(a, edge) ? 0 : 1); }
/* Whole powers up to 8 of any number; roots; else through the logarithm, for which 0 and below are all but 0. */
static cell t_pow(cell x, cell y)
{
    if (y.e == 0 && fabs(y.v) <= 8 && y.v == floor(y.v)) {
        cell r = exactly(1);
        for (int i = 0; i < (int)fabs(y.v); i++)
            r = multiply(r, x);
        return y.v < 0 ? divide(exactly(1), r) : r;
    }
    if (y.e == 0 && y.v == 0.5)
        return root(x);
    truth_doubt |= y.e > 0 && !(x.v - x.e > 1e-30); /* it is another function for whole y */
    return power_of_two(multiply(y, t_log2(x)));
}
static cell t_smoothstep(cell low, cell high, cell a)
{
    cell t = t_unit(divide(subtract(a, low), subtract(high, low)));
    return multiply(multiply(t, t), subtract(exactly(3), multiply(exactly(2), t)));
}
static cell t_fma(cell a, cell b, cell c) { return add(multiply(a, b), c); }

static const struct {
    const char *name;
    uint8_t num_arguments;
    cell (*one)(cell);
    cell (*two)(cell, cell);
    cell (*three)(cell, cell, cell);
    bool of_whole; /* takes ints too, and gives an int then */
} each_component[] = {
    {"abs", 1, size_of, NULL, NULL, true},
    {"sign", 1, t_sign, NULL, NULL, true},
    {"floor", 1, whole_below, NULL, NULL, false},
    {"ceil", 1, whole_above, NULL, NULL, false},
    {"round", 1, whole_nearest, NULL, NULL, false},
    {"trunc", 1, whole_towards_zero, NULL, NULL, false},
    {"fract", 1, part_of, NULL, NULL, false},
    {"sqrt", 1, root, NULL, NULL, false},
    {"inversesqrt", 1, t_inverse_root, NULL, NULL, false},
    {"sin", 1, sine, NULL, NULL, false},
    {"cos", 1, cosine, NULL, NULL, false},
    {"tan", 1, t_tan, NULL, NULL, false},
    {"asin", 1, t_asin, NULL, NULL, false},
    {"acos", 1, t_acos, NULL, NULL, false},
    {"atan", 1, t_atan, NULL, NULL, false},
    {"sinh", 1, t_sinh, NULL, NULL, false},
    {"cosh", 1, t_cosh, NULL, NULL, false},
    {"tanh", 1, t_tanh, NULL, NULL, false},
    {"exp", 1, t_exp, NULL, NULL, false},
    {"exp2", 1, power_of_two, NULL, NULL, false},
    {"log", 1, logarithm, NULL, NULL, false},
    {"log2", 1, t_log2, NULL, NULL, false},
    {"radians", 1, t_radians, NULL, NULL, false},
    {"degrees", 1, t_degrees, NULL, NULL, false},
    {"saturate", 1, t_unit, NULL, NULL, false},
    {"atan", 2, NULL, angle, NULL, false},
    {"min", 2, NULL, smaller_of, NULL, true},
    {"max", 2, NULL, larger_of, NULL, true},
    {"mod", 2, NULL, remainder_of, NULL, false},
    {"step", 2, NULL, t_step, NULL, false},
    {"pow", 2, NULL, t_pow, NULL, false},
    {"clamp", 3, NULL, NULL, t_held, true},
    {"mix", 3, NULL, NULL, mixed, false},
    {"smoothstep", 3, NULL, NULL, t_smoothstep, false},
    {"fma", 3, NULL, NULL, t_fma, false},
};
#define NUM_EACH (sizeof each_component / sizeof *each_component)

static bool component_function(const char *name, const value *a, uint32_t count, value *result)
{
    size_t i = 0;
    while (i < NUM_EACH && (strcmp(name, each_component[i].name) || each_component[i].num_arguments != count))
        i++;
    if (i == NUM_EACH)
        return false;
    unsigned size = 1;
    bool whole = each_component[i].of_whole;
    for (uint32_t k = 0; k < count; k++) {
        size = a[k].type->size > size ? a[k].type->size : size;
        whole &= a[k].type->scalar == a[0].type->scalar && a[0].type->scalar != KARST_TYPE_FLOAT;
    }
    karst_scalar_type type = whole ? a[0].type->scalar : KARST_TYPE_FLOAT;
    *result = new_value(type_of(type, size));
    for (unsigned k = 0; k < size; k++) {
        cell c[3] = {{0}};
        for (uint32_t j = 0; j < count; j++)
            c[j] = converted(a[j].c[a[j].type->size == 1 ? 0 : k], a[j].type->scalar, type);
        cell r = count == 1   ? each_component[i].one(c[0])
                 : count == 2 ? each_component[i].two(c[0], c[1])
                              : each_component[i].three(c[0], c[1], c[2]);
        result->c[k] = whole ? exactly(wrapped((int64_t)r.v, type == KARST_TYPE_UINT)) : r;
    }
    return true;
}

/* ---- of vectors ---- */

static value to_floats(value v) { return convert(v, type_of(KARST_TYPE_FLOAT, v.type->size)); }
static cell t_dot(value a, value b) { return sum_of_products(a.c, 1, b.c, 1, a.type->size); }
static cell t_length(value v) { return root(t_dot(v, v)); }
static value scaled(value v, cell by)
{
    value r = new_value(v.type);
    for (uint32_t i = 0; i < v.type->num_scalars; i++)
        r.c[i] = multiply(v.c[i], by);
    return r;
}

static value t_normalize(value v)
{
    cell l = t_length(v);
    if (!less(exactly(0), l))
        return new_value(v.type);
    value r = new_value(v.type);
    for (uint32_t i = 0; i < v.type->num_scalars; i++)
        r.c[i] = divide(v.c[i], l);
    return r;
}

static value t_cross(value a, value b)
{
    value r = new_value(a.type);
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        r.c[i] = subtract(multiply(a.c[j], b.c[k]), multiply(a.c[k], b.c[j]));
    }
    return r;
}

static value t_refract(value i, value n, cell eta)
{
    cell c = t_dot(n, i);
    cell k = subtract(exactly(1), multiply(multiply(eta, eta), subtract(exactly(1), multiply(c, c))));
    if (less(k, exactly(0)))
        return new_value(i.type);
    return arithmetic('-', scaled(i, eta), scaled(n, add(multiply(eta, c), root(k))));
}

static bool vector_function(const char *name, const value *given, uint32_t count, value *result)
{
    value a[3];
    if (count < 1 || count > 3 || given[0].type->shape > KARST_SHAPE_VECTOR)
        return false;
    for (uint32_t i = 0; i < count; i++) {
        if (given[i].type->shape > KARST_SHAPE_VECTOR || given[i].type->scalar == KARST_TYPE_BOOL)
            return false;
        a[i] = to_floats(given[i]);
    }
    if (!strcmp(name, "length") && count == 1)
        *result = one(KARST_TYPE_FLOAT, t_length(a[0]));
    else if (!strcmp(name, "normalize") && count == 1)
        *result = t_normalize(a[0]);
    else if (!strcmp(name, "dot") && count == 2)
        *result = one(KARST_TYPE_FLOAT, t_dot(a[0], a[1]));
    else if (!strcmp(name, "distance") && count == 2)
        *result = one(KARST_TYPE_FLOAT, t_length(arithmetic('-', a[0], a[1])));
    else if (!strcmp(name, "cross") && count == 2)
        *result = t_cross(a[0], a[1]);
    else if (!strcmp(name, "reflect") && count == 2)
        *result = arithmetic('-', a[0], scaled(a[1], multiply(exactly(2), t_dot(a[1], a[0]))));
    else if (!strcmp(name, "refract") && count == 3)
        *result = t_refract(a[0], a[1], a[2].c[0]);
    else if (!strcmp(name, "faceforward") && count == 3)
        *result = less(t_dot(a[2], a[1]), exactly(0)) ? a[0] : scaled(a[0], exactly(-1));
    else
        return false;
    return true;
}

/* ---- comparisons of vectors; bools ---- */

static bool comparison_function(const char *name, const value *a, uint32_t count, value *result)
{
    static const struct {
        const char *name;
        uint32_t op;
    } all[] = {{"lessThan", '<'},
               {"lessThanEqual", KARST_P2('<', '=')},
               {"greaterThan", '>'},
               {"greaterThanEqual", KARST_P2('>', '=')},
               {"equal", KARST_P2('=', '=')},
               {"notEqual", KARST_P2('!', '=')}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        if (strcmp(name, all[i].name) || count != 2)
            continue;
        *result = new_value(type_of(KARST_TYPE_BOOL, a[0].type->size));
        for (uint32_t k = 0; k < a[0].type->size; k++)
            result->c[k] =
                exactly(compared(all[i].op, one(a[0].type->scalar, a[0].c[k]), one(a[1].type->scalar, a[1].c[k])));
        return true;
    }
    bool any = !strcmp(name, "any"), every = !strcmp(name, "all"), not = !strcmp(name, "not");
    if (count != 1 || a[0].type->scalar != KARST_TYPE_BOOL || a[0].type->shape > KARST_SHAPE_VECTOR ||
        !(any || every || not ))
        return false;
    uint32_t set = 0;
    value opposite = new_value(a[0].type);
    for (uint32_t k = 0; k < a[0].type->size; k++) {
        set += a[0].c[k].v != 0;
        opposite.c[k] = exactly(a[0].c[k].v == 0);
    }
    *result = not ? opposite : truth_of(any ? set > 0 : set == a[0].type->size);
    return true;
}

/* mix(a, b, bvec) chooses. */
static bool choice_function(const char *name, const value *a, uint32_t count, value *result)
{
    if (strcmp(name, "mix") || count != 3 || a[2].type->scalar != KARST_TYPE_BOOL)
        return false;
    *result = new_value(a[0].type);
    for (uint32_t k = 0; k < a[0].type->num_scalars; k++)
        result->c[k] = a[2].c[k].v != 0 ? a[1].c[k] : a[0].c[k];
    return true;
}

/* ---- matrices ---- */

/* Of rows and columns other than the given ones; columns stand one behind the other. */
static cell minor_of(const cell *m, uint32_t n, uint32_t column, uint32_t row);
static cell t_determinant(const cell *m, uint32_t n)
{
    if (n == 1)
        return m[0];
    cell sum = exactly(0);
    for (uint32_t j = 0; j < n; j++) {
        cell term = multiply(m[j * n], minor_of(m, n, j, 0));
        sum = j % 2 ? subtract(sum, term) : add(sum, term);
    }
    return sum;
}
static cell minor_of(const cell *m, uint32_t n, uint32_t column, uint32_t row)
{
    cell part[9];
    uint32_t k = 0;
    for (uint32_t j = 0; j < n; j++)
        for (uint32_t i = 0; i < n; i++)
            if (j != column && i != row)
                part[k++] = m[j * n + i];
    return t_determinant(part, n - 1);
}

static bool matrix_function(const char *name, const value *a, uint32_t count, value *result)
{
    if (!strcmp(name, "outerProduct") && count == 2 && a[0].type->size == a[1].type->size) {
        uint32_t n = a[0].type->size;
        *result = new_value(karst_type_matrix(n, n));
        for (uint32_t k = 0; k < n * n; k++)
            result->c[k] = multiply(a[0].c[k % n], a[1].c[k / n]);
        return true;
    }
    if (count < 1 || a[0].type->shape != KARST_SHAPE_MATRIX)
        return false;
    uint32_t n = a[0].type->size;
    *result = new_value(!strcmp(name, "determinant") ? type_of(KARST_TYPE_FLOAT, 1) : a[0].type);
    if (!strcmp(name, "determinant") && count == 1) {
        result->c[0] = t_determinant(a[0].c, n);
        return true;
    }
    bool inverse = !strcmp(name, "inverse");
    cell whole = inverse ? t_determinant(a[0].c, n) : exactly(1);
    for (uint32_t j = 0; j < n; j++)
        for (uint32_t i = 0; i < n; i++) {
            cell *r = &result->c[j * n + i];
            if (!strcmp(name, "transpose"))
                *r = a[0].c[i * n + j];
            else if (!strcmp(name, "matrixCompMult"))
                *r = multiply(a[0].c[j * n + i], a[1].c[j * n + i]);
            else if (inverse) /* the transposed cofactors */
                *r = divide((i + j) % 2 ? negate(minor_of(a[0].c, n, i, j)) : minor_of(a[0].c, n, i, j), whole);
            else
                return false;
        }
    return true;
}

static bool built_in(const char *name, const value *a, uint32_t count, value *result)
{
    return choice_function(name, a, count, result) || matrix_function(name, a, count, result) ||
           comparison_function(name, a, count, result) || vector_function(name, a, count, result) ||
           component_function(name, a, count, result);
}

#endif
