/* Intervals of doubles, rounded outward: a result holds what real arithmetic gives for all members of the arguments.
 *
 * A part that is not known is the whole line. 0 times the whole line is 0: a factor that is exactly nothing takes part
 * in nothing. */
#ifndef KARST_REFERENCE_INTERVAL_H
#define KARST_REFERENCE_INTERVAL_H

#include <math.h>
#include <stdbool.h>

typedef struct {
    double lo, hi;
} interval;

/* One rounding of a double, and more. */
#define INTERVAL_MARGIN 0x1p-52

static inline interval interval_of(double lo, double hi) { return (interval){lo, hi}; }
static inline interval interval_thin(double value) { return (interval){value, value}; }
static inline interval interval_whole(void) { return (interval){-INFINITY, INFINITY}; }
static inline bool interval_is_thin(interval a) { return a.lo == a.hi; }
static inline bool interval_is_zero(interval a) { return a.lo == 0 && a.hi == 0; }
static inline bool interval_holds(interval a, double value) { return a.lo <= value && value <= a.hi; }

/* Ends as they were computed, moved outward; the whole line if either is no number. */
static inline interval interval_out(double lo, double hi)
{
    if (!(lo <= hi))
        return interval_whole();
    return interval_of(lo - (fabs(lo) * INTERVAL_MARGIN + 0x1p-1070), hi + (fabs(hi) * INTERVAL_MARGIN + 0x1p-1070));
}

static inline interval interval_widen(interval a, double by) { return interval_out(a.lo - by, a.hi + by); }

static inline interval interval_hull(interval a, interval b)
{
    return interval_of(a.lo < b.lo ? a.lo : b.lo, a.hi > b.hi ? a.hi : b.hi);
}

/* Of two intervals that hold the same value. If they miss one another by roundings, the first. */
static inline interval interval_meet(interval a, interval b)
{
    interval met = interval_of(a.lo > b.lo ? a.lo : b.lo, a.hi < b.hi ? a.hi : b.hi);
    return met.lo <= met.hi ? met : a;
}

static inline interval interval_negate(interval a) { return interval_of(-a.hi, -a.lo); }

static inline interval interval_add(interval a, interval b)
{
    if (interval_is_zero(a))
        return b;
    if (interval_is_zero(b))
        return a;
    if (interval_is_thin(a) && interval_is_thin(b)) {
        /* A sum without rounding stays one number: what is exactly 0 or 1 must not leave its cell. */
        double sum = a.lo + b.lo, back = sum - a.lo;
        if ((a.lo - (sum - back)) + (b.lo - back) == 0)
            return interval_thin(sum);
    }
    return interval_out(a.lo + b.lo, a.hi + b.hi);
}

static inline interval interval_subtract(interval a, interval b) { return interval_add(a, interval_negate(b)); }

static inline double interval_product_(double a, double b) { return a == 0 || b == 0 ? 0 : a * b; }

static inline interval interval_multiply(interval a, interval b)
{
    if (interval_is_zero(a) || interval_is_zero(b))
        return interval_thin(0);
    if (interval_is_thin(a) && interval_is_thin(b) && fma(a.lo, b.lo, -(a.lo * b.lo)) == 0 &&
        fabs(a.lo * b.lo) > 1e-200)
        return interval_thin(a.lo * b.lo);
    double p = interval_product_(a.lo, b.lo), q = interval_product_(a.lo, b.hi), r = interval_product_(a.hi, b.lo),
           s = interval_product_(a.hi, b.hi);
    double least = p < q ? p : q, most = p < q ? q : p, least2 = r < s ? r : s, most2 = r < s ? s : r;
    return interval_out(least < least2 ? least : least2, most > most2 ? most : most2);
}

static inline interval interval_scale(interval a, double by) { return interval_multiply(a, interval_thin(by)); }

static inline interval interval_square(interval a)
{
    if (interval_is_thin(a))
        return interval_multiply(a, a);
    double p = a.lo * a.lo, q = a.hi * a.hi;
    interval squared = interval_out(interval_holds(a, 0) ? 0 : fmin(p, q), fmax(p, q));
    return interval_of(fmax(squared.lo, 0), squared.hi);
}

static inline interval interval_divide(interval a, interval b)
{
    if (interval_holds(b, 0))
        return interval_is_zero(a) && !interval_is_thin(b) ? a : interval_whole();
    return interval_multiply(a, interval_out(1 / b.hi, 1 / b.lo));
}

static inline interval interval_abs(interval a)
{
    return a.lo >= 0 ? a : a.hi <= 0 ? interval_negate(a) : interval_of(0, fmax(-a.lo, a.hi));
}

static inline interval interval_sqrt(interval a)
{
    double lo = a.lo > 0 ? sqrt(a.lo) : 0, hi = a.hi > 0 ? sqrt(a.hi) : 0;
    interval root = interval_out(lo, hi);
    return interval_of(fmax(root.lo, 0), root.hi);
}

/* Largest magnitude. */
static inline double interval_most(interval a)
{
    double lo = fabs(a.lo), hi = fabs(a.hi);
    return lo > hi ? lo : hi;
}

#endif
