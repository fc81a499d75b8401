/* Numbers of the interpreter of truth.h: a double, and how far from it a float computation of the same may be. Nothing
 * here comes from the language's own code: the functions are the C library's, made total by WORLDS.md's rules.
 *
 * Where a decision (a comparison, a floor) is closer than that, the point is in doubt and is not compared. */
#ifndef KARST_TESTS_LANGUAGE_TRUTH_NUMBER_H
#define KARST_TESTS_LANGUAGE_TRUTH_NUMBER_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

/* Of an int, uint or bool: v is the number, e is 0. */
typedef struct {
    double v, e;
} cell;

static bool truth_doubt; /* a decision was too close, or a value is none */

static const double truth_unit = 0x1p-23; /* twice what one rounding does */

static cell exactly(double v) { return (cell){v, 0}; }

/* A result with error e so far: one rounding more, unless a float holds it and nothing was rounded before. */
static cell rounded(double v, double e)
{
    if (!(fabs(v) < 1e30) || !(e < 1e30))
        truth_doubt = true;
    bool exact = e == 0 && (double)(float)v == v;
    return (cell){v, exact ? 0 : e + fabs(v) * truth_unit + 1e-37};
}

static double larger(double a, double b) { return a > b ? a : b; }

static cell add(cell a, cell b) { return rounded(a.v + b.v, a.e + b.e); }
static cell subtract(cell a, cell b) { return rounded(a.v - b.v, a.e + b.e); }
static cell multiply(cell a, cell b) { return rounded(a.v * b.v, fabs(a.v) * b.e + fabs(b.v) * a.e + a.e * b.e); }
static cell divide(cell a, cell b)
{
    double room = fabs(b.v) - b.e;
    if (!(room > 0)) {
        truth_doubt = true;
        return exactly(0);
    }
    return rounded(a.v / b.v, (a.e + fabs(a.v / b.v) * b.e) / room);
}
static cell negate(cell a) { return (cell){-a.v, a.e}; }

static bool less(cell a, cell b)
{
    double e = a.e + b.e;
    truth_doubt |= e > 0 && fabs(a.v - b.v) <= e;
    return a.v < b.v;
}
static bool same(cell a, cell b)
{
    double e = a.e + b.e;
    truth_doubt |= e > 0 && fabs(a.v - b.v) <= e;
    return a.v == b.v;
}

/* How far a decision between whole numbers may be off: a float rounds the fraction of a period. */
static double reach(cell a) { return a.e > 0 ? a.e + truth_unit : 0; }

/* floor: decided on both sides of the error. */
static cell whole_below(cell a)
{
    truth_doubt |= floor(a.v - reach(a)) != floor(a.v + reach(a));
    return exactly(floor(a.v));
}
static cell whole_above(cell a) { return negate(whole_below(negate(a))); }
static cell whole_nearest(cell a) /* halves to the even side */
{
    truth_doubt |= rint(a.v - reach(a)) != rint(a.v + reach(a));
    return exactly(rint(a.v));
}
static cell whole_towards_zero(cell a) { return a.v < 0 ? whole_above(a) : whole_below(a); }

static cell smaller_of(cell a, cell b)
{
    bool close = fabs(a.v - b.v) <= a.e + b.e;
    cell r = b.v < a.v ? b : a;
    return (cell){r.v, close ? larger(a.e, b.e) : r.e};
}
static cell larger_of(cell a, cell b) { return negate(smaller_of(negate(a), negate(b))); }
static cell size_of(cell a) { return (cell){fabs(a.v), a.e}; }

/* A function that only rises or only falls; `own`: its own error, relative and absolute. */
static cell monotone(double (*f)(double), cell a, double own)
{
    double v = f(a.v), spread = larger(fabs(f(a.v + a.e) - v), fabs(v - f(a.v - a.e)));
    return rounded(v, spread + own * larger(fabs(v), 1));
}

static double total_sqrt(double a) { return a < 0 ? 0 : sqrt(a); }
static double total_log(double a) { return log(a < 0x1p-126 ? 0x1p-126 : a); }
static double total_exp2(double a) { return exp2(a < -126 ? -126 : a > 126 ? 126 : a); }

static cell root(cell a)
{
    double v = total_sqrt(a.v);
    return rounded(v, larger(total_sqrt(a.v + a.e) - v, v - total_sqrt(a.v - a.e)));
}
static cell power_of_two(cell a) { return monotone(total_exp2, a, a.e == 0 && a.v == rint(a.v) ? 0 : 0x1p-21); }
static cell logarithm(cell a) { return monotone(total_log, a, 0x1p-21); }
static cell sine(cell a) { return rounded(sin(a.v), a.e + 0x1p-21); }
static cell cosine(cell a) { return rounded(cos(a.v), a.e + 0x1p-21); }

/* The angle of (x, y). */
static cell angle(cell y, cell x)
{
    double r = hypot(x.v, y.v), room = r - hypot(x.e, y.e);
    if (x.v == 0 && y.v == 0 && x.e == 0 && y.e == 0)
        return exactly(0);
    truth_doubt |= !(room > 0) || (x.v - x.e < 0 && fabs(y.v) <= y.e); /* the origin; the cut */
    return rounded(atan2(y.v, x.v), (fabs(x.v) * y.e + fabs(y.v) * x.e) / (r * larger(room, 1e-30)) + 0x1p-20);
}

static cell remainder_of(cell a, cell b)
{
    if (b.v == 0 && b.e == 0)
        return exactly(0);
    cell times = whole_below(divide(a, b));
    return rounded(a.v - b.v * times.v, a.e + fabs(times.v) * b.e + truth_unit * larger(fabs(a.v), fabs(b.v)));
}
static cell part_of(cell a) { return rounded(a.v - whole_below(a).v, a.e); }

static cell mixed(cell a, cell b, cell t)
{
    double v = a.v + (b.v - a.v) * t.v;
    if (t.e == 0 && (t.v == 0 || t.v == 1))
        return t.v == 0 ? a : b;
    return rounded(v, fabs(1 - t.v) * a.e + fabs(t.v) * b.e + (fabs(b.v - a.v) + a.e + b.e) * t.e +
                          truth_unit * (fabs(a.v) + fabs(b.v)) * (1 + fabs(t.v)));
}

/* ---- whole numbers: they wrap, and division is total ---- */

static double wrapped(int64_t v, bool is_unsigned)
{
    return is_unsigned ? (double)(uint32_t)v : (double)(int32_t)(uint32_t)v;
}

static double whole_operation(uint32_t op, double left, double right, bool is_unsigned)
{
    int64_t a = (int64_t)left, b = (int64_t)right;
    switch (op & 0xff) {
    case '+':
        return wrapped(a + b, is_unsigned);
    case '-':
        return wrapped(a - b, is_unsigned);
    case '*':
        return wrapped((int64_t)((uint64_t)a * (uint64_t)b), is_unsigned);
    case '/':
        return b ? wrapped(a / b, is_unsigned) : 0;
    case '%':
        return b ? wrapped(a % b, is_unsigned) : 0;
    case '&':
        return wrapped(a & b, is_unsigned);
    case '|':
        return wrapped(a | b, is_unsigned);
    case '^':
        return wrapped(a ^ b, is_unsigned);
    case '<':
        return wrapped((int64_t)((uint64_t)a << (b & 31)), is_unsigned);
    default: /* >> */
        return wrapped(a >> (b & 31), is_unsigned);
    }
}

/* A float as a whole number: cut off, and held within the type. */
static double cut_off(cell a, bool is_unsigned)
{
    double low = is_unsigned ? 0 : -2147483648.0, high = is_unsigned ? 4294967295.0 : 2147483647.0;
    double v = a.v;
    if (v > low && v < high)
        v = whole_towards_zero(a).v;
    return v < low ? low : v > high ? high : v;
}

#endif
