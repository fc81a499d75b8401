/* The double half. */
#include "producers/language/ops/ops.clh"
#include "producers/language/oracle/oracle_internal.h"

#include <math.h>

static const karst_expr_node *node_of(const karst_oracle *o, karst_expr e) { return &o->graph->nodes[e]; }
static double double_of(const karst_oracle *o, karst_expr e) { return o->slots[e].d; }

/* ---- from fixed point ---- */

double karst_oracle_affine(const karst_oracle *o, const karst_linear *form)
{
    affine_sum sum = {.low = form->offset_low, .high = (vulong)form->offset_high};
    for (int i = 0; i < 3; i++)
        if (form->factor[i])
            affine_sum_product(&sum, form->factor[i], o->at.voxel[i], o->at.fraction[i]);
    double value = (double)(vlong)sum.high * 0x1p64 + (double)sum.low;
    if ((vlong)sum.high < 0) /* the halves have opposite signs: add what is small first */
        value = -((double)(~sum.high) * 0x1p64 + (double)(0 - sum.low)) - (sum.low ? 0 : 0x1p64);
    return value * (double)form->scale[0] * (double)form->scale[1];
}

/* ---- gradient noise, the same lattice in double ---- */

typedef karst_oracle_cell place;

/* To all the digits that fixed point has: 2^-56 cells. */
static place place_in(const affine_position *at, const karst_lattice *form)
{
    affine_sum sum = {.low = (ulong)form->cell << 56 | (ulong)form->fraction, .high = (ulong)(form->cell >> 8)};
    for (int axis = 0; axis < 3; axis++)
        affine_sum_product(&sum, form->frequency[axis], at->voxel[axis], at->fraction[axis]);
    return (place){(uint)(sum.high << 8 | sum.low >> 56), (double)(sum.low & 0xffffffffffffffUL) * 0x1p-56};
}

static place moved(place p, double by)
{
    if (isnan(by))
        by = 0x1p30;
    double t = p.fraction + (by > 0x1p30 ? 0x1p30 : by < -0x1p30 ? -0x1p30 : by), whole = floor(t);
    return (place){p.cell + (uint)(int)whole, t - whole};
}

static double fade(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }

static double fade_slope(double t) { return 30 * t * t * (t - 1) * (t - 1); }

/* The noise, or (along 0 to 2) its derivative along that axis, per cell. */
static double gradient_noise(const place p[3], uint seed, int along)
{
    static const uint primes[3] = {NOISE_PRIME_X, NOISE_PRIME_Y, NOISE_PRIME_Z};
    double sum = 0;
    for (int corner = 0; corner < 8; corner++) {
        uint at[3];
        double offset[3], weight = 1, slope = 1;
        for (int i = 0; i < 3; i++) {
            uint up = (uint)corner >> i & 1;
            double w = fade(p[i].fraction), dw = fade_slope(p[i].fraction);
            at[i] = (p[i].cell + up) * primes[i];
            offset[i] = p[i].fraction - up;
            weight *= up ? w : 1 - w;
            slope *= i == along ? (up ? dw : -dw) : up ? w : 1 - w;
        }
        uint hash = noise_corner_hash(NOISE_LINE_YZ(NOISE_LINE_Y(at[1]), at[2], seed), at[0]);
        const double gradient[3] = {(double)noise_times_x(hash, 1.0f), (double)noise_times_y(hash, 1.0f),
                                    (double)noise_times_z(hash, 1.0f)};
        double rise = gradient[0] * offset[0] + gradient[1] * offset[1] + gradient[2] * offset[2];
        sum += along < 0 ? weight * rise : slope * rise + weight * gradient[along];
    }
    return sum;
}

/* ---- the others, straight from their definitions ---- */

static uint node_hash(const place p[3], const int step[3], uint seed)
{
    uint x = (p[0].cell + (uint)step[0]) * NOISE_PRIME_X, y = (p[1].cell + (uint)step[1]) * NOISE_PRIME_Y,
         z = (p[2].cell + (uint)step[2]) * NOISE_PRIME_Z;
    return noise_corner_hash(NOISE_LINE_YZ(NOISE_LINE_Y(y), z, seed), x);
}

static double value_noise(const place p[3], uint seed, int along)
{
    double sum = 0;
    for (int corner = 0; corner < 8; corner++) {
        const int step[3] = {corner & 1, corner >> 1 & 1, corner >> 2};
        double weight = 1;
        for (int i = 0; i < 3; i++) {
            double w = i == along ? fade_slope(p[i].fraction) : fade(p[i].fraction);
            weight *= step[i] ? w : i == along ? -w : 1 - w;
        }
        sum += weight * (double)noise_node_value(node_hash(p, step, seed));
    }
    return sum;
}

/* Every node of both cubic lattices that is near enough. */
static double simplex_noise(const place p[3], uint seed, int along)
{
    double sum = 0;
    for (int n = 0; n < 2 * 27; n++) {
        const int step[3] = {n % 3 - 1 + (n < 27), n / 3 % 3 - 1 + (n < 27), n / 9 % 3 - 1 + (n < 27)};
        double offset[3], square = 0;
        for (int i = 0; i < 3; i++) {
            offset[i] = p[i].fraction - step[i] - (n < 27 ? 0 : 0.5);
            square += offset[i] * offset[i];
        }
        if (square >= 0.5)
            continue;
        uint hash = node_hash(p, step, n < 27 ? seed : seed ^ NOISE_SIMPLEX_OTHER);
        const double gradient[3] = {(double)noise_times_x(hash, 1.0f), (double)noise_times_y(hash, 1.0f),
                                    (double)noise_times_z(hash, 1.0f)};
        double h = 0.5 - square, rise = gradient[0] * offset[0] + gradient[1] * offset[1] + gradient[2] * offset[2];
        sum += along < 0 ? h * h * h * h * rise : h * h * h * (h * gradient[along] - 8 * rise * offset[along]);
    }
    return (double)NOISE_SIMPLEX_SCALE * sum;
}

static double worley_noise(const place p[3], uint seed, int which, int along)
{
    enum { REACH = NOISE_WORLEY_REACH, SIDE = 2 * REACH + 1 };
    double nearest[2] = {INFINITY, INFINITY}, away[2] = {0, 0};
    for (int n = 0; n < SIDE * SIDE * SIDE; n++) {
        const int step[3] = {n % SIDE - REACH, n / SIDE % SIDE - REACH, n / (SIDE * SIDE) - REACH};
        uint hash = node_hash(p, step, seed);
        double offset[3], square = 0;
        for (int i = 0; i < 3; i++) {
            offset[i] = step[i] + (double)noise_worley_place(hash, i) - p[i].fraction;
            square += offset[i] * offset[i];
        }
        for (int k = 0; k < 2; k++) /* the second is what the first was */
            if (square < nearest[k]) {
                double pushed = nearest[k], direction = away[k];
                nearest[k] = square;
                away[k] = along < 0 ? 0 : -offset[along];
                if (k == 0) {
                    nearest[1] = pushed;
                    away[1] = direction;
                }
                break;
            }
    }
    double distance = sqrt(nearest[which]);
    return along < 0 ? distance : distance > 0 ? away[which] / distance : 0;
}

double karst_oracle_noise(uint8_t base, const place p[3], uint seed, int along)
{
    switch (base) {
    case KARST_NOISE_VALUE:
        return value_noise(p, seed, along);
    case KARST_NOISE_SIMPLEX:
        return simplex_noise(p, seed, along);
    case KARST_NOISE_WORLEY_F1:
    case KARST_NOISE_WORLEY_F2:
        return worley_noise(p, seed, base == KARST_NOISE_WORLEY_F2, along);
    default:
        return gradient_noise(p, seed, along);
    }
}

static double shaped(uint8_t base, uint8_t shape, double n, double weight)
{
    const double mean = (double)octave_mean(base, shape);
    double size = mean + weight * ((shape == KARST_NOISE_SUM ? n : fabs(n)) - mean);
    return shape == KARST_NOISE_RIDGED ? 1 - 2 * size : shape == KARST_NOISE_BILLOW ? 2 * size - 1 : size;
}

/* Of an octave, at a place in its lattice. */
static double octave_double(const karst_noise *noise, const place p[3], uint seed, double weight, double scale)
{
    if (!noise->derivative)
        return shaped(noise->base, noise->shape, karst_oracle_noise(noise->base, p, seed, -1), weight);
    double slope = karst_oracle_noise(noise->base, p, seed, noise->derivative - 1) * weight * scale;
    if (noise->shape != KARST_NOISE_SUM)
        slope *= (double)octave_fold(noise->shape) * (karst_oracle_noise(noise->base, p, seed, -1) < 0 ? -1 : 1);
    return slope;
}

static double noise_double(const karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = node_of(o, e);
    const karst_noise *noise = &o->graph->noises[n->extra];
    const karst_octave *octave = karst_oracle_record(o, e);
    double sum = 0, amplitude = 1, scale = 1;
    for (int k = 0; k < noise->num_octaves; k++, octave++) {
        place p[3];
        for (int i = 0; i < 3; i++) {
            karst_expr by = n->arg[i];
            uint8_t op = node_of(o, by)->op;
            double offset =
                op == KARST_OP_AFFINE ? 0 : double_of(o, op == KARST_OP_SHIFTED ? node_of(o, by)->arg[1] : by);
            p[i] = moved(place_in(&o->at, &octave->lattice[i]), offset * scale);
        }
        if (noise->image)
            return karst_oracle_image(octave, p, o->level, noise->derivative - 1);
        sum +=
            amplitude * octave_double(noise, p, octave->seed, (double)octave_weight_at(octave, o->level).weight, scale);
        amplitude *= double_of(o, noise->gain);
        scale *= double_of(o, noise->lacunarity);
    }
    return sum;
}

/* ---- places ---- */

/* The rest of so many cells, in [0, 1]. */
static double rest_of(const karst_oracle *o, karst_expr e, double cells)
{
    if (!o->rounds[e])
        return cells - floor(cells);
    const double rest = cells - karst_oracle_cells_off(o, e, cells);
    return rest < 0 ? 0 : rest > 1 ? 1 : rest;
}

static double place_double(const karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = node_of(o, e), *a = node_of(o, n->arg[0]);
    double offset = a->op == KARST_OP_SHIFTED ? double_of(o, a->arg[1]) : 0;
    const void *record = karst_oracle_record(o, e);
    if (n->op == KARST_OP_SIN_TURNS || n->op == KARST_OP_COS_TURNS) {
        double t = (double)affine_coordinate(&o->at, record).fraction * 0x1p-32 + offset;
        double angle = 6.283185307179586477 * (t - rint(t));
        return n->op == KARST_OP_SIN_TURNS ? karst_double_sin(angle) : karst_double_cos(angle);
    }
    affine_place at = affine_cells(&o->at, record);
    double fraction = (double)at.fraction * 0x1p-32, b = double_of(o, n->arg[1]), t;
    switch (n->op) {
    case KARST_OP_FRACT:
        t = fraction + offset;
        return rest_of(o, e, t);
    case KARST_OP_FLOOR:
        return (double)at.cell + floor(fraction + offset);
    default:
        t = b == 0 ? 0 : fraction + offset / b;
        return b == 0 ? 0 : b * rest_of(o, e, t);
    }
}

/* ---- operations ---- */

static double length(const karst_oracle *o, const karst_expr_node *n)
{
    double sum = 0;
    for (int k = 0; k < 4 && n->arg[k]; k++)
        sum += double_of(o, n->arg[k]) * double_of(o, n->arg[k]);
    return sqrt(sum);
}

/* Less whole cells, not their rest times b: what is left keeps its bits. */
static double mod_double(const karst_oracle *o, karst_expr e, double a, double b)
{
    if (b == 0)
        return 0;
    if (!o->rounds[e])
        return a - b * floor(a / b);
    const double rest = a - b * karst_oracle_cells_off(o, e, a / b);
    return rest / b < 0 ? 0 : rest / b > 1 ? b : rest;
}

static double plain_double(const karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = node_of(o, e);
    double a = double_of(o, n->arg[0]), b = double_of(o, n->arg[1]), c = double_of(o, n->arg[2]);
    switch ((karst_op)n->op) {
    case KARST_OP_FOOTPRINT:
        return (double)op_footprint(o->level, (int)n->extra - KARST_FOOTPRINT_BIAS);
    case KARST_OP_NORMAL:
        return (double)o->facing[n->extra];
    case KARST_OP_ADD:
    case KARST_OP_SHIFTED:
        return a + b;
    case KARST_OP_SUBTRACT:
        return a - b;
    case KARST_OP_MULTIPLY:
        return a * b;
    case KARST_OP_DIVIDE:
        return a / b;
    case KARST_OP_FMA:
        return fma(a, b, c);
    case KARST_OP_NEGATE:
        return -a;
    case KARST_OP_MIN:
        return b < a ? b : a;
    case KARST_OP_MAX:
        return b > a ? b : a;
    case KARST_OP_ABS:
        return fabs(a);
    case KARST_OP_FRACT:
        return rest_of(o, e, a);
    case KARST_OP_MOD:
        return mod_double(o, e, a, b);
    case KARST_OP_MIX:
        return fma(c, b, fma(-c, a, a));
    case KARST_OP_SQRT:
        return a < 0 ? 0 : sqrt(a);
    case KARST_OP_LENGTH:
        return length(o, n);
    case KARST_OP_SIN:
        return karst_double_sin(a);
    case KARST_OP_COS:
        return karst_double_cos(a);
    case KARST_OP_EXP2:
        return karst_double_exp2(a);
    case KARST_OP_LOG:
        return karst_double_log(a);
    case KARST_OP_ATAN:
        return karst_double_atan(a, b);
    case KARST_OP_SELECT:
        return o->slots[n->arg[0]].i ? b : c;
    case KARST_OP_FLOOR: /* piecewise constant: the float's value is taken */
    case KARST_OP_CEIL:
    case KARST_OP_RINT:
    case KARST_OP_CONVERT:
    case KARST_OP_BITS:
    KARST_OP_CASES_OF_COMPARISONS
    KARST_OP_CASES_OF_INTS
    case KARST_OP_NONE: /* known before, or found elsewhere */
    case KARST_OP_CONSTANT:
    case KARST_OP_PARAMETER:
    case KARST_OP_POSITION:
    case KARST_OP_AFFINE:
    case KARST_OP_NOISE:
    case KARST_OP_SIN_TURNS:
    case KARST_OP_COS_TURNS:
    case KARST_OP_CELL:
    case KARST_NUM_OPS:
        break;
    }
    return (double)NAN;
}

void karst_oracle_step_double(karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = node_of(o, e);
    karst_oracle_slot *s = &o->slots[e];
    if (n->kind == KARST_KIND_STEPS)
        s->d = n->type == KARST_TYPE_FLOAT  ? (double)s->f
               : n->type == KARST_TYPE_UINT ? (double)(uint)s->i
               : n->type == KARST_TYPE_BOOL ? (double)(s->i != 0)
                                            : (double)s->i;
    else if (n->op == KARST_OP_NOISE)
        s->d = noise_double(o, e);
    else if (n->op == KARST_OP_AFFINE)
        s->d = karst_oracle_affine(o, karst_oracle_record(o, e));
    else if (karst_takes_place(&o->layout, e, 0))
        s->d = place_double(o, e);
    else
        s->d = plain_double(o, e);
}
