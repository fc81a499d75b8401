/* The range of every value over all space: plain intervals, outward by far more than doubles round. Used to tell where
 * floats do not do, and for reports; what is proved about a world is proved elsewhere. */
#include "producers/language/graph/kinds.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "noise/bounds.clh"
#include "noise/worley.clh"
#include "producers/language/image/image.h"
#include "core/base/facing_shared.h"

static const karst_range everything = {-(double)INFINITY, (double)INFINITY};

static karst_range range_of(double lo, double hi)
{
    if (isnan(lo) || isnan(hi))
        return everything;
    /* float rounding of whoever computes it is within this */
    double slack = 1e-6;
    return (karst_range){lo - slack * fabs(lo), hi + slack * fabs(hi)};
}

static double times(double a, double b) { return a == 0 || b == 0 ? 0 : a * b; } /* 0 * unbounded: the factor is 0 */

static karst_range product(karst_range a, karst_range b)
{
    double p[4] = {times(a.lo, b.lo), times(a.lo, b.hi), times(a.hi, b.lo), times(a.hi, b.hi)}, lo = p[0], hi = p[0];
    for (int i = 1; i < 4; i++) {
        lo = p[i] < lo ? p[i] : lo;
        hi = p[i] > hi ? p[i] : hi;
    }
    return range_of(lo, hi);
}

static karst_range hull(karst_range a, karst_range b)
{
    return (karst_range){a.lo < b.lo ? a.lo : b.lo, a.hi > b.hi ? a.hi : b.hi};
}
static karst_range negative(karst_range a) { return (karst_range){-a.hi, -a.lo}; }
static karst_range sum(karst_range a, karst_range b) { return range_of(a.lo + b.lo, a.hi + b.hi); }
static double magnitude(karst_range a) { return fmax(fabs(a.lo), fabs(a.hi)); }

static karst_range absolute(karst_range a)
{
    double low = a.lo > 0 ? a.lo : a.hi < 0 ? -a.hi : 0;
    return (karst_range){low, magnitude(a)};
}

static karst_range quotient(karst_range a, karst_range b)
{
    if (b.lo <= 0 && b.hi >= 0)
        return everything;
    return product(a, range_of(1 / b.hi, 1 / b.lo));
}

/* What a noise gives at most: octave by octave. */
static karst_range noise_range(const karst_noise *noise, const karst_range *ranges)
{
    if (noise->image) {
        const double steepest = karst_samples_image_steepness(noise->image);
        return noise->derivative ? range_of(-steepest, steepest)
                                 : range_of((double)noise->image->low, (double)noise->image->high);
    }
    bool doubled = noise->shape == KARST_NOISE_RIDGED || noise->shape == KARST_NOISE_BILLOW;
    double ratio = magnitude(ranges[noise->gain]), amplitude = 1, all = 0;
    if (noise->derivative)
        ratio *= magnitude(ranges[noise->lacunarity]);
    for (int k = 0; k < noise->num_octaves; k++, amplitude *= ratio)
        all += amplitude;
    if (!isfinite(all))
        return everything;
    /* of n and of dn/dx */
    static const float most[KARST_NUM_NOISE_BASES][2] = {{NOISE_SUP, NOISE_SUP_SLOPE},
                                                         {1, NOISE_VALUE_SUP_SLOPE},
                                                         {NOISE_SIMPLEX_SUP, NOISE_SIMPLEX_SUP_SLOPE},
                                                         {NOISE_WORLEY_SUP, 1},
                                                         {NOISE_WORLEY_SUP, 1}};
    double one = (double)most[noise->base][noise->derivative != 0];
    if (noise->derivative)
        return range_of(-one * all * (doubled ? 2 : 1), one * all * (doubled ? 2 : 1));
    bool positive = noise->shape == KARST_NOISE_TURBULENCE ||
                    (noise->shape == KARST_NOISE_SUM && noise->base >= KARST_NOISE_WORLEY_F1);
    double high = doubled ? fmax(2 * one - 1, 1) : one;
    return range_of(positive && ranges[noise->gain].lo >= 0 ? 0 : -high * all, high * all);
}

static karst_range affine_range(const karst_graph *graph, const karst_affine *a, const karst_range *ranges)
{
    (void)graph;
    for (int i = 0; i < 3; i++)
        if (a->coefficient[i])
            return everything;
    return ranges[a->offset];
}

static karst_range convert(const karst_graph *graph, const karst_expr_node *n, karst_range a)
{
    if (n->type == KARST_TYPE_FLOAT)
        return a;
    if (n->type == KARST_TYPE_BOOL || graph->nodes[n->arg[0]].type == KARST_TYPE_BOOL)
        return (karst_range){0, 1};
    double low = n->type == KARST_TYPE_INT ? INT32_MIN : 0, high = n->type == KARST_TYPE_INT ? INT32_MAX : UINT32_MAX;
    if (graph->nodes[n->arg[0]].type != KARST_TYPE_FLOAT) /* int to uint keeps the bits */
        return a.lo >= low && a.hi <= high ? a : (karst_range){low, high};
    /* rounding towards 0 and saturation; NaN gives 0 */
    karst_range r = {a.lo < low ? low : a.lo > 0 ? 0 : ceil(a.lo), a.hi > high ? high : a.hi < 0 ? 0 : floor(a.hi)};
    return r;
}

static karst_range integers(const karst_expr_node *n)
{
    return n->type == KARST_TYPE_INT ? (karst_range){INT32_MIN, INT32_MAX} : (karst_range){0, UINT32_MAX};
}

static karst_range length(const karst_expr_node *n, const karst_range *ranges)
{
    double lo = 0, hi = 0;
    for (int k = 0; k < 4 && n->arg[k]; k++) {
        karst_range a = absolute(ranges[n->arg[k]]);
        lo += a.lo * a.lo;
        hi += a.hi * a.hi;
    }
    return range_of(sqrt(lo), sqrt(hi));
}

karst_range karst_graph_range_of(const karst_graph *graph, karst_expr e, const karst_kinds_settings *settings,
                                 const karst_range *ranges)
{
    const karst_expr_node *n = &graph->nodes[e];
    karst_range a = ranges[n->arg[0]], b = ranges[n->arg[1]], c = ranges[n->arg[2]];
    switch (n->op) {
    case KARST_OP_CONSTANT:
        return isnan(graph->constants[n->extra].value)
                   ? everything
                   : (karst_range){graph->constants[n->extra].value, graph->constants[n->extra].value};
    case KARST_OP_PARAMETER:
        return (karst_range){settings->parameter_min[n->extra], settings->parameter_max[n->extra]};
    case KARST_OP_FOOTPRINT:
        return (karst_range){0, (double)INFINITY};
    case KARST_OP_NORMAL:
        if (n->extra > 2)
            return (karst_range){-1.000001 * KARST_MOST_STRETCH, 1.000001 * KARST_MOST_STRETCH};
        return (karst_range){-1.000001, 1.000001};
    case KARST_OP_SIN:
    case KARST_OP_COS:
    case KARST_OP_SIN_TURNS:
    case KARST_OP_COS_TURNS:
        return (karst_range){-1.000001, 1.000001};
    case KARST_OP_AFFINE:
        return affine_range(graph, &graph->affines[n->extra], ranges);
    case KARST_OP_ADD:
    case KARST_OP_SHIFTED:
        return sum(a, b);
    case KARST_OP_SUBTRACT:
        return sum(a, negative(b));
    case KARST_OP_MULTIPLY:
        return n->arg[0] == n->arg[1] ? range_of(absolute(a).lo * absolute(a).lo, absolute(a).hi * absolute(a).hi)
                                      : product(a, b);
    case KARST_OP_DIVIDE:
        return quotient(a, b);
    case KARST_OP_FMA:
        return sum(n->arg[0] == n->arg[1] ? range_of(absolute(a).lo * absolute(a).lo, absolute(a).hi * absolute(a).hi)
                                          : product(a, b),
                   c);
    case KARST_OP_NEGATE:
        return negative(a);
    case KARST_OP_MIN:
        return (karst_range){fmin(a.lo, b.lo), fmin(a.hi, b.hi)};
    case KARST_OP_MAX:
        return (karst_range){fmax(a.lo, b.lo), fmax(a.hi, b.hi)};
    case KARST_OP_ABS:
        return absolute(a);
    case KARST_OP_FLOOR:
        return (karst_range){floor(a.lo), floor(a.hi)};
    case KARST_OP_CEIL:
        return (karst_range){ceil(a.lo), ceil(a.hi)};
    case KARST_OP_RINT:
        return (karst_range){floor(a.lo), ceil(a.hi)};
    case KARST_OP_FRACT:
        return (karst_range){0, 1};
    case KARST_OP_MOD: {
        double m = magnitude(b);
        return range_of(b.lo >= 0 ? -1e-6 * m : -m, b.hi <= 0 ? 1e-6 * m : m);
    }
    case KARST_OP_MIX:
        if (c.lo >= 0 && c.hi <= 1)
            return range_of(hull(a, b).lo, hull(a, b).hi);
        return sum(a, product(c, sum(b, negative(a))));
    case KARST_OP_SQRT:
        return range_of(sqrt(fmax(a.lo, 0)), sqrt(fmax(a.hi, 0)));
    case KARST_OP_LENGTH:
        return length(n, ranges);
    case KARST_OP_EXP2:
        return range_of(karst_double_exp2(fmax(a.lo, -126)), karst_double_exp2(fmin(a.hi, 126)));
    case KARST_OP_LOG:
        return range_of(karst_double_log(a.lo), karst_double_log(fmin(a.hi, FLT_MAX)));
    case KARST_OP_ATAN:
        return (karst_range){-3.1416, 3.1416};
    case KARST_OP_NOISE:
        return noise_range(&graph->noises[n->extra], ranges);
    case KARST_OP_SELECT:
        return hull(b, c);
    case KARST_OP_CONVERT:
        return convert(graph, n, a);
    case KARST_OP_CELL:
        return n->arg[1] ? (karst_range){0, b.hi - 1} : integers(n);
    default:
        if (n->type == KARST_TYPE_BOOL)
            return (karst_range){0, 1};
        return n->type == KARST_TYPE_FLOAT ? everything : integers(n);
    }
}

void karst_graph_ranges(const karst_graph *graph, const karst_kinds_settings *settings, karst_range *ranges)
{
    ranges[0] = (karst_range){0, 0};
    for (uint32_t e = 1; e < graph->num_nodes; e++)
        ranges[e] = karst_graph_range_of(graph, e, settings, ranges);
}
