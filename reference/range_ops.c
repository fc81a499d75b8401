#include "reference/range_ops.h"

#define PI 3.14159265358979323846
#define TINY 0x1p-126
#define HUGE_EXP2 0x1p126
/* Of the double functions, in shares of the result, and more. */
#define FUNCTION_ERROR 0x1p-49

static interval truth(bool perhaps_not, bool perhaps) { return interval_of(perhaps_not ? 0 : 1, perhaps ? 1 : 0); }

static interval inflate(interval a) { return interval_widen(a, interval_most(a) * FUNCTION_ERROR); }

interval karst_range_of_sine(interval a, bool is_cosine)
{
    if (is_cosine)
        a = interval_add(a, interval_out(PI / 2, PI / 2));
    if (!(interval_most(a) < 0x1p40) || a.hi - a.lo >= 2 * PI)
        return interval_of(-1, 1);
    double p = sin(a.lo), q = sin(a.hi), slack = 0x1p-50 * (1 + interval_most(a));
    /* a top or bottom between the ends: quarter turns 1, 5, ... and 3, 7, ... */
    double first = a.lo - slack, last = a.hi + slack;
    bool top = floor((last - PI / 2) / (2 * PI)) > floor((first - PI / 2) / (2 * PI)) ||
               fabs(remainder(last - PI / 2, 2 * PI)) <= slack;
    bool bottom = floor((last + PI / 2) / (2 * PI)) > floor((first + PI / 2) / (2 * PI)) ||
                  fabs(remainder(last + PI / 2, 2 * PI)) <= slack;
    interval s = interval_widen(interval_of(bottom ? -1 : fmin(p, q), top ? 1 : fmax(p, q)), slack);
    return interval_of(fmax(s.lo, -1), fmin(s.hi, 1));
}

static interval range_of_atan(interval y, interval x)
{
    /* On the x axis itself: 0 or half a turn. */
    if (interval_is_zero(y) && !signbit(y.lo) && !signbit(y.hi) && (x.lo > 0 || x.hi < 0))
        return x.lo > 0 ? interval_thin(0) : inflate(interval_thin(PI));
    /* Past the cut (x < 0, y = 0) or the origin: any angle. */
    if (x.lo <= 0 && interval_holds(y, 0))
        return interval_of(-PI, PI);
    double corner[4] = {atan2(y.lo, x.lo), atan2(y.lo, x.hi), atan2(y.hi, x.lo), atan2(y.hi, x.hi)};
    interval r = interval_of(corner[0], corner[0]);
    for (int i = 1; i < 4; i++)
        r = interval_hull(r, interval_thin(corner[i]));
    return inflate(r);
}

/* a - b * floor(a / b), 0 for b = 0. */
static interval range_of_mod(interval a, interval b)
{
    if (interval_is_zero(b))
        return interval_thin(0);
    if (interval_holds(b, 0))
        return interval_hull(interval_of(fmin(b.lo, 0), fmax(b.hi, 0)), interval_thin(0));
    interval q = interval_divide(a, b), all = b.lo > 0 ? interval_of(0, b.hi) : interval_of(b.lo, 0);
    double cell = floor(q.lo);
    if (cell != floor(q.hi) || !isfinite(cell))
        return all;
    return interval_meet(all, interval_subtract(a, interval_scale(b, cell)));
}

static interval range_of_fract(interval a)
{
    double cell = floor(a.lo);
    if (cell != floor(a.hi) || !isfinite(cell))
        return interval_of(0, 1);
    return interval_out(a.lo - cell, a.hi - cell);
}

static interval square_sum(interval a, interval b, interval c, interval d)
{
    return interval_add(interval_add(interval_square(a), interval_square(b)),
                        interval_add(interval_square(c), interval_square(d)));
}

static interval range_of_exp2(interval a)
{
    double lo = exp2(fmin(fmax(a.lo, -126), 126)), hi = exp2(fmin(fmax(a.hi, -126), 126));
    return inflate(interval_of(lo, hi));
}

static interval range_of_log(interval a)
{
    interval r = interval_of(log(fmax(a.lo, TINY)), log(fmax(a.hi, TINY)));
    return interval_widen(r, FUNCTION_ERROR * (1 + interval_most(r)));
}

interval karst_range_of_op(karst_op op, interval a, interval b, interval c, interval d)
{
    interval r;
    switch (op) {
    case KARST_OP_ADD:
    case KARST_OP_SHIFTED:
        r = interval_add(a, b);
        break;
    case KARST_OP_SUBTRACT:
        r = interval_subtract(a, b);
        break;
    case KARST_OP_MULTIPLY:
        r = interval_multiply(a, b);
        break;
    case KARST_OP_DIVIDE:
        r = interval_divide(a, b);
        break;
    case KARST_OP_FMA:
        r = interval_add(interval_multiply(a, b), c);
        break;
    case KARST_OP_NEGATE:
        r = interval_negate(a);
        break;
    case KARST_OP_MIN:
        r = interval_of(b.lo < a.lo ? b.lo : a.lo, b.hi < a.hi ? b.hi : a.hi);
        break;
    case KARST_OP_MAX:
        r = interval_of(b.lo > a.lo ? b.lo : a.lo, b.hi > a.hi ? b.hi : a.hi);
        break;
    case KARST_OP_ABS:
        r = interval_abs(a);
        break;
    case KARST_OP_FLOOR:
        r = interval_of(floor(a.lo), floor(a.hi));
        break;
    case KARST_OP_CEIL:
        r = interval_of(ceil(a.lo), ceil(a.hi));
        break;
    case KARST_OP_RINT:
        r = interval_of(rint(a.lo), rint(a.hi));
        break;
    case KARST_OP_FRACT:
        r = range_of_fract(a);
        break;
    case KARST_OP_MOD:
        r = range_of_mod(a, b);
        break;
    case KARST_OP_MIX:
        r = interval_add(interval_multiply(c, interval_subtract(b, a)), a);
        if (c.lo >= 0 && c.hi <= 1)
            r = interval_meet(r, interval_hull(a, b));
        break;
    case KARST_OP_SQRT:
        r = interval_sqrt(a);
        break;
    case KARST_OP_LENGTH:
        r = interval_sqrt(square_sum(a, b, c, d));
        break;
    case KARST_OP_SIN:
        r = karst_range_of_sine(a, false);
        break;
    case KARST_OP_COS:
        r = karst_range_of_sine(a, true);
        break;
    case KARST_OP_EXP2:
        r = range_of_exp2(a);
        break;
    case KARST_OP_LOG:
        r = range_of_log(a);
        break;
    case KARST_OP_ATAN:
        r = range_of_atan(a, b);
        break;
    case KARST_OP_SELECT:
        r = a.lo > 0 ? b : a.hi < 1 ? c : interval_hull(b, c);
        break;
    case KARST_OP_CONVERT: /* of a bool or an int to a float */
        r = a;
        break;
    default:
        return interval_whole();
    }
    return r.lo <= r.hi ? r : interval_whole();
}

interval karst_truth_of_op(karst_op op, interval a, interval b)
{
    switch (op) {
    case KARST_OP_LESS:
        return truth(!(a.hi < b.lo), !(a.lo >= b.hi));
    case KARST_OP_LESS_EQUAL:
        return truth(!(a.hi <= b.lo), !(a.lo > b.hi));
    case KARST_OP_EQUAL:
        return truth(!(interval_is_thin(a) && interval_is_thin(b) && a.lo == b.lo), !(a.hi < b.lo || b.hi < a.lo));
    case KARST_OP_NOT_EQUAL: {
        interval equal = karst_truth_of_op(KARST_OP_EQUAL, a, b);
        return interval_of(1 - equal.hi, 1 - equal.lo);
    }
    case KARST_OP_NOT:
        return interval_of(1 - a.hi, 1 - a.lo);
    case KARST_OP_AND:
        return interval_of(fmin(a.lo, b.lo), fmin(a.hi, b.hi));
    case KARST_OP_OR:
        return interval_of(fmax(a.lo, b.lo), fmax(a.hi, b.hi));
    default:
        return interval_of(0, 1);
    }
}

/* Whole numbers that stay in [least, most], where nothing wraps; all of these otherwise. */
static interval within(interval r, double least, double most)
{
    return r.lo >= least && r.hi <= most ? r : interval_whole();
}

interval karst_range_of_whole(karst_op op, bool is_unsigned, interval a, interval b, interval c)
{
    const double least = is_unsigned ? 0 : -2147483648.0, most = is_unsigned ? 4294967295.0 : 2147483647.0;
    switch (op) {
    case KARST_OP_CONVERT:
        return within(interval_of(trunc(a.lo), trunc(a.hi)), least, most);
    case KARST_OP_SELECT:
        return a.lo > 0 ? b : a.hi < 1 ? c : interval_hull(b, c);
    case KARST_OP_INT_ADD:
        return within(interval_of(a.lo + b.lo, a.hi + b.hi), least, most);
    case KARST_OP_INT_SUBTRACT:
        return within(interval_of(a.lo - b.hi, a.hi - b.lo), least, most);
    case KARST_OP_INT_MULTIPLY:
        if (!interval_is_thin(b) || !(fabs(b.lo) < 0x1p20) || !(interval_most(a) < 0x1p31))
            return interval_whole();
        return within(interval_of(fmin(a.lo * b.lo, a.hi * b.lo), fmax(a.lo * b.lo, a.hi * b.lo)), least, most);
    default:
        return interval_whole();
    }
}

/* Of v / length along one axis. */
static interval share_of_length(interval v, interval length)
{
    interval share = length.lo > 0 ? interval_divide(v, length) : interval_whole();
    return interval_meet(share, interval_of(-1, 1));
}

interval karst_slope_of_op(karst_op op, const karst_node_range *a, const karst_node_range *b, const karst_node_range *c,
                           const karst_node_range *d, interval value)
{
    interval s;
    switch (op) {
    case KARST_OP_ADD:
    case KARST_OP_SHIFTED:
        return interval_add(a->slope, b->slope);
    case KARST_OP_SUBTRACT:
        return interval_subtract(a->slope, b->slope);
    case KARST_OP_MULTIPLY:
        return interval_add(interval_multiply(a->value, b->slope), interval_multiply(b->value, a->slope));
    case KARST_OP_FMA:
        s = interval_add(interval_multiply(a->value, b->slope), interval_multiply(b->value, a->slope));
        return interval_add(s, c->slope);
    case KARST_OP_DIVIDE:
        if (interval_holds(b->value, 0))
            return interval_whole();
        return interval_divide(interval_subtract(a->slope, interval_multiply(value, b->slope)), b->value);
    case KARST_OP_NEGATE:
        return interval_negate(a->slope);
    case KARST_OP_MIN:
        return a->value.hi < b->value.lo   ? a->slope
               : b->value.hi < a->value.lo ? b->slope
                                           : interval_hull(a->slope, b->slope);
    case KARST_OP_MAX:
        return a->value.lo > b->value.hi   ? a->slope
               : b->value.lo > a->value.hi ? b->slope
                                           : interval_hull(a->slope, b->slope);
    case KARST_OP_ABS:
        s = interval_negate(a->slope);
        return a->value.lo > 0 ? a->slope : a->value.hi < 0 ? s : interval_hull(a->slope, s);
    case KARST_OP_FRACT:
        return floor(a->value.lo) == floor(a->value.hi) ? a->slope : interval_whole();
    case KARST_OP_MOD: {
        if (interval_is_zero(b->value))
            return interval_thin(0);
        interval q = interval_divide(a->value, b->value);
        double cell = floor(q.lo);
        if (cell != floor(q.hi) || !isfinite(cell))
            return interval_whole();
        return interval_subtract(a->slope, interval_scale(b->slope, cell));
    }
    case KARST_OP_MIX:
        s = interval_multiply(c->value, interval_subtract(b->slope, a->slope));
        s = interval_add(s, interval_multiply(interval_subtract(b->value, a->value), c->slope));
        return interval_add(s, a->slope);
    case KARST_OP_SQRT:
        if (a->value.hi < 0 || interval_is_zero(a->slope))
            return interval_thin(0);
        return a->value.lo > 0 ? interval_divide(a->slope, interval_scale(value, 2)) : interval_whole();
    case KARST_OP_LENGTH:
        s = interval_add(interval_multiply(share_of_length(a->value, value), a->slope),
                         interval_multiply(share_of_length(b->value, value), b->slope));
        s = interval_add(s, interval_multiply(share_of_length(c->value, value), c->slope));
        return interval_add(s, interval_multiply(share_of_length(d->value, value), d->slope));
    case KARST_OP_SIN:
        return interval_multiply(karst_range_of_sine(a->value, true), a->slope);
    case KARST_OP_COS:
        return interval_multiply(interval_negate(karst_range_of_sine(a->value, false)), a->slope);
    case KARST_OP_EXP2:
        s = interval_multiply(interval_scale(value, 0.69314718055994530942), a->slope);
        return a->value.lo > -126 && a->value.hi < 126 ? s : interval_hull(s, interval_thin(0));
    case KARST_OP_LOG:
        if (a->value.hi < TINY)
            return interval_thin(0);
        return a->value.lo > TINY ? interval_divide(a->slope, a->value) : interval_whole();
    case KARST_OP_ATAN:
        if (interval_is_zero(a->value) && interval_is_zero(a->slope) && b->value.hi < 0)
            return interval_thin(0);
        if (a->value.lo <= 0 && a->value.hi >= 0 && b->value.lo <= 0)
            return interval_whole();
        s = interval_subtract(interval_multiply(b->value, a->slope), interval_multiply(a->value, b->slope));
        return interval_divide(s, interval_add(interval_square(a->value), interval_square(b->value)));
    case KARST_OP_SELECT:
        return a->value.lo > 0 ? b->slope : a->value.hi < 1 ? c->slope : interval_whole();
    default: /* the rest is piecewise constant: see steps_range */
        return interval_whole();
    }
}
