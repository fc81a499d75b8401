/* Values of the interpreter of truth.h: an array of cells with a type; operators and conversions on them. */
#ifndef KARST_TESTS_LANGUAGE_TRUTH_VALUE_H
#define KARST_TESTS_LANGUAGE_TRUTH_VALUE_H

#include "tests/language/truth_number.h"

#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "producers/language/front/parser.h"

typedef struct {
    const karst_type *type;
    cell *c;
} value;

/* What can be assigned to: the cells themselves, one by one. */
typedef struct {
    const karst_type *type;
    cell **at;
} place;

/* Memory of one evaluation: handed out in a row, freed together. */
enum { TRUTH_ROOM = 1 << 24 };
static _Alignas(16) char truth_memory[TRUTH_ROOM];
static size_t truth_used;
static jmp_buf truth_stop; /* where evaluation goes on when it cannot */
static const char *truth_reason;

static _Noreturn void give_up(const char *reason)
{
    truth_reason = reason;
    longjmp(truth_stop, 1);
}

static void *take(size_t size)
{
    size = (size + 15) & ~(size_t)15;
    if (truth_used + size > TRUTH_ROOM)
        give_up("too much memory");
    void *p = truth_memory + truth_used;
    truth_used += size;
    return memset(p, 0, size);
}

static value new_value(const karst_type *type) { return (value){type, take((type->num_scalars + 1) * sizeof(cell))}; }
static value copy_of(value v)
{
    value r = new_value(v.type);
    memcpy(r.c, v.c, v.type->num_scalars * sizeof(cell));
    return r;
}
static const karst_type *type_of(karst_scalar_type scalar, unsigned size) { return karst_type_vector(scalar, size); }
static value one(karst_scalar_type scalar, cell c)
{
    value r = new_value(type_of(scalar, 1));
    r.c[0] = c;
    return r;
}
static value truth_of(bool b) { return one(KARST_TYPE_BOOL, exactly(b)); }
static bool is_true(value v)
{
    if (v.type != type_of(KARST_TYPE_BOOL, 1))
        give_up("a condition is no bool");
    return v.c[0].v != 0;
}

static cell converted(cell c, karst_scalar_type from, karst_scalar_type to)
{
    if (from == to)
        return c;
    if (to == KARST_TYPE_BOOL)
        return exactly(!same(c, exactly(0)));
    if (to == KARST_TYPE_FLOAT)
        return rounded(c.v, 0);
    if (from == KARST_TYPE_FLOAT)
        return exactly(cut_off(c, to == KARST_TYPE_UINT));
    return exactly(wrapped((int64_t)c.v, to == KARST_TYPE_UINT));
}

/* 0: the same type; 1: whole numbers become floats; -1: impossible. */
static int conversion(const karst_type *from, const karst_type *to)
{
    if (from == to)
        return 0;
    bool plain = (from->shape == KARST_SHAPE_SCALAR || from->shape == KARST_SHAPE_VECTOR) && from->shape == to->shape;
    return plain && from->size == to->size && to->scalar == KARST_TYPE_FLOAT && from->scalar != KARST_TYPE_BOOL ? 1
                                                                                                                : -1;
}

static value convert(value v, const karst_type *to)
{
    int how = conversion(v.type, to);
    if (how < 0)
        give_up(v.type->name);
    if (how == 0)
        return v;
    value r = new_value(to);
    for (uint32_t i = 0; i < to->num_scalars; i++)
        r.c[i] = converted(v.c[i], v.type->scalar, KARST_TYPE_FLOAT);
    return r;
}

/* ---- constructors ---- */

static value construct(const karst_type *type, const value *a, uint32_t count)
{
    value r = new_value(type);
    uint32_t n = type->num_scalars, filled = 0;
    if (type->shape == KARST_SHAPE_MATRIX && count == 1 && a[0].type->shape == KARST_SHAPE_SCALAR) {
        for (uint32_t i = 0; i < type->size; i++)
            r.c[i * type->size + i] = converted(a[0].c[0], a[0].type->scalar, KARST_TYPE_FLOAT);
        return r;
    }
    if (type->shape == KARST_SHAPE_MATRIX && count == 1 && a[0].type->shape == KARST_SHAPE_MATRIX) {
        uint32_t m = a[0].type->size;
        for (uint32_t column = 0; column < type->size; column++)
            for (uint32_t row = 0; row < type->size; row++)
                r.c[column * type->size + row] =
                    column < m && row < m ? a[0].c[column * m + row] : exactly(column == row);
        return r;
    }
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < a[i].type->num_scalars && filled < n; k++)
            r.c[filled++] = converted(a[i].c[k], a[i].type->scalar, type->scalar);
    if (count == 1 && filled == 1)
        while (filled < n)
            r.c[filled++] = r.c[0];
    if (filled < n)
        give_up("a constructor has too few numbers");
    return r;
}

/* ---- operators ---- */

static cell cell_operation(uint32_t op, karst_scalar_type type, cell a, cell b)
{
    if (type != KARST_TYPE_FLOAT)
        return exactly(whole_operation(op, a.v, b.v, type == KARST_TYPE_UINT));
    switch (op) {
    case '+':
        return add(a, b);
    case '-':
        return subtract(a, b);
    case '*':
        return multiply(a, b);
    case '/':
        return divide(a, b);
    default:
        give_up("no such operator on floats");
    }
}

static cell sum_of_products(const cell *a, uint32_t step_a, const cell *b, uint32_t step_b, uint32_t n)
{
    cell sum = multiply(a[0], b[0]);
    for (uint32_t i = 1; i < n; i++)
        sum = add(sum, multiply(a[i * step_a], b[i * step_b]));
    return sum;
}

static value matrix_product(value a, value b)
{
    uint32_t n = a.type->size;
    bool row = a.type->shape == KARST_SHAPE_VECTOR, column = b.type->shape == KARST_SHAPE_VECTOR;
    value r = new_value(row ? a.type : b.type);
    if (a.type->size != b.type->size)
        give_up("matrices of two sizes");
    for (uint32_t j = 0; j < (column ? 1 : n); j++)
        for (uint32_t i = 0; i < (row ? 1 : n); i++)
            r.c[row ? j : j * n + i] = sum_of_products(row ? a.c : a.c + i, row ? 1 : n, b.c + j * n, 1, n);
    return r;
}

static value arithmetic(uint32_t op, value a, value b)
{
    bool shift = op > 0xff;
    const karst_scalar_type type = shift || a.type->scalar == b.type->scalar ? a.type->scalar : KARST_TYPE_FLOAT;
    if (a.type->shape < KARST_SHAPE_SCALAR || a.type->shape > KARST_SHAPE_MATRIX ||
        b.type->shape < KARST_SHAPE_SCALAR || b.type->shape > KARST_SHAPE_MATRIX || type == KARST_TYPE_BOOL)
        give_up("operands of such types");
    bool one_a = a.type->shape == KARST_SHAPE_SCALAR, one_b = b.type->shape == KARST_SHAPE_SCALAR;
    bool matrix = a.type->shape == KARST_SHAPE_MATRIX || b.type->shape == KARST_SHAPE_MATRIX;
    if (op == '*' && matrix && !one_a && !one_b)
        return matrix_product(a, b);
    if (!one_a && !one_b && a.type->num_scalars != b.type->num_scalars)
        give_up("operands of two sizes");
    const karst_type *shape = one_a ? b.type : a.type;
    value r = new_value(shape->shape == KARST_SHAPE_MATRIX ? shape : type_of(type, shape->size));
    for (uint32_t i = 0; i < r.type->num_scalars; i++)
        r.c[i] = cell_operation(op, type, converted(a.c[one_a ? 0 : i], a.type->scalar, type),
                                converted(b.c[one_b ? 0 : i], shift ? type : b.type->scalar, type));
    return r;
}

static bool equal_values(value a, value b)
{
    bool all = true;
    if (a.type->num_scalars != b.type->num_scalars)
        give_up("== between two types");
    for (uint32_t i = 0; i < a.type->num_scalars; i++)
        all &= same(a.c[i], b.c[i]);
    return all;
}

static bool compared(uint32_t op, value a, value b)
{
    cell x = a.c[0], y = b.c[0];
    switch (op) {
    case KARST_P2('=', '='):
        return equal_values(a, b);
    case KARST_P2('!', '='):
        return !equal_values(a, b);
    case '<':
        return less(x, y);
    case '>':
        return less(y, x);
    case KARST_P2('<', '='):
        return !less(y, x);
    default:
        return !less(x, y);
    }
}

#endif
