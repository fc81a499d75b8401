#include "reference/range.h"

#include <stdlib.h>

#include "noise/bounds.clh"
#include "noise/worley.clh"
#include "producers/language/oracle/oracle_internal.h"
#include "reference/jet.h"
#include "reference/range_ops.h"

#define TURN 6.28318530717958647692
#define PLACE_ERROR 0x1p-51 /* of a cell's fraction as a double */

struct karst_ranger {
    karst_oracle *oracle;
    const karst_graph *graph;
    karst_expr density;
    karst_expr *order; /* the nodes that the density needs and that a position decides */
    uint32_t num_nodes;
    uint8_t *is_float;       /* per node: a float decides what is piecewise constant further on */
    double *before;          /* per node: its value where a jump was not yet passed */
    karst_node_range *nodes; /* per node of the graph */
    double direction[3], half;
    int level;
};

static bool is_needed(const karst_ranger *r, karst_expr e)
{
    const karst_oracle *o = r->oracle;
    return !o->known[e] && !(r->graph->nodes[e].op == KARST_OP_AFFINE && o->layout.word[e] == KARST_NO_WORD);
}

/* What the density reaches, and which floats what is piecewise constant reaches. */
static bool find_order(karst_ranger *r)
{
    uint32_t count = r->graph->num_nodes;
    uint8_t *reached = calloc(count, 1);
    if (!reached)
        return false;
    reached[r->density] = 1;
    for (karst_expr e = count - 1; e > 0; e--) {
        const karst_expr_node *n = &r->graph->nodes[e];
        if (!reached[e])
            continue;
        r->is_float[e] |= n->kind == KARST_KIND_STEPS || r->oracle->rounds[e];
        for (int k = 0; k < 4; k++) {
            reached[n->arg[k]] = 1;
            r->is_float[n->arg[k]] |= r->is_float[e];
        }
    }
    for (karst_expr e = 1; e < count; e++)
        if (reached[e] && is_needed(r, e))
            r->order[r->num_nodes++] = e;
    free(reached);
    return true;
}

karst_ranger *karst_ranger_create(const karst_program_graph *program, const karst_number *parameters, uint32_t seed,
                                  karst_error *error)
{
    karst_ranger *r = calloc(1, sizeof *r);
    if (!r) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    r->graph = program->world.graph;
    r->density = program->world.root[KARST_ROOT_DENSITY];
    r->oracle = karst_oracle_create(&program->world, parameters, seed, program->header.voxel_log2_m, error);
    r->order = calloc(r->graph->num_nodes, sizeof *r->order);
    r->is_float = calloc(r->graph->num_nodes, 1);
    r->nodes = calloc(r->graph->num_nodes, sizeof *r->nodes);
    r->before = calloc(r->graph->num_nodes, sizeof *r->before);
    if (!r->oracle || !r->order || !r->is_float || !r->nodes || !r->before || !find_order(r)) {
        karst_fail(error, KARST_FAILED, "out of memory");
        karst_ranger_destroy(r);
        return NULL;
    }
    for (karst_expr e = 1; e < r->graph->num_nodes; e++)
        if (r->oracle->known[e])
            r->nodes[e].middle = r->nodes[e].value = interval_thin(r->oracle->slots[e].d);
    return r;
}

void karst_ranger_destroy(karst_ranger *ranger)
{
    if (!ranger)
        return;
    karst_oracle_destroy(ranger->oracle);
    free(ranger->order);
    free(ranger->is_float);
    free(ranger->before);
    free(ranger->nodes);
    free(ranger);
}

karst_position karst_reference_place(const karst_position *anchor, const double direction[3], double t)
{
    karst_position at;
    for (int i = 0; i < 3; i++) {
        double offset = direction[i] * t, whole = floor(offset);
        uint64_t fraction = (uint64_t)((offset - whole) * 0x1p32) + anchor->fraction[i];
        at.voxel[i] = anchor->voxel[i] + (int64_t)whole + (int64_t)(fraction >> 32);
        at.fraction[i] = (uint32_t)fraction;
    }
    return at;
}

static void stand_at(karst_ranger *r, const karst_position *anchor, const double direction[3], double t, int level)
{
    karst_position at = karst_reference_place(anchor, direction, t);
    for (int i = 0; i < 3; i++) {
        r->oracle->at.voxel[i] = at.voxel[i];
        r->oracle->at.fraction[i] = at.fraction[i];
        r->direction[i] = direction[i];
    }
    r->oracle->level = r->level = level;
}

/* ---- places ---- */

/* Cells, and how far into the cell. */
typedef struct {
    int64_t cell;
    double fraction;
} exact_place;

/* affine_lattice with all of its 56 bits. */
static exact_place exact_lattice(const karst_ranger *r, const karst_lattice *form)
{
    const affine_position *at = &r->oracle->at;
    affine_sum sum = {.low = (uint64_t)form->cell << 56 | (uint64_t)form->fraction,
                      .high = (uint64_t)(form->cell >> 8)};
    for (int axis = 0; axis < 3; axis++)
        if (form->frequency[axis])
            affine_sum_product(&sum, form->frequency[axis], at->voxel[axis], at->fraction[axis]);
    return (exact_place){(int64_t)(sum.high << 8 | sum.low >> 56), (double)(sum.low << 8 >> 8) * 0x1p-56};
}

/* affine_period without rounding the cell's fraction to 32 bits. */
static exact_place exact_period(const karst_ranger *r, const karst_period *form)
{
    const affine_position *at = &r->oracle->at;
    __extension__ typedef __int128 wide_int;
    const wide_int one = (wide_int)1 << 32;
    wide_int place = (wide_int)at->voxel[form->axis] * one + at->fraction[form->axis];
    place -= (wide_int)form->offset_voxel * one + form->offset_fraction;
    if (form->negative)
        place = -place;
    wide_int period = (wide_int)form->period * one, rest = place % period, whole = place / period;
    if (rest < 0) {
        rest += period;
        whole--;
    }
    rest *= form->repeats;
    return (exact_place){(int64_t)(whole * form->repeats + rest / period), (double)(rest % period) / (double)period};
}

static exact_place exact_cells(const karst_ranger *r, const karst_cells *cells)
{
    return cells->period.period ? exact_period(r, &cells->period) : exact_lattice(r, &cells->lattice);
}

/* Cells of a lattice that a ray passes per voxel. */
static double lattice_rate(const karst_ranger *r, const karst_lattice *lattice)
{
    double rate = 0;
    for (int i = 0; i < 3; i++)
        rate += (double)lattice->frequency[i] * 0x1p-56 * r->direction[i];
    return rate;
}

static double cells_rate(const karst_ranger *r, const karst_cells *cells)
{
    const karst_period *period = &cells->period;
    if (!period->period)
        return lattice_rate(r, &cells->lattice);
    double rate = (double)period->repeats / period->period * r->direction[period->axis];
    return period->negative ? -rate : rate;
}

/* Adds what a constant rate makes of the piece. */
static karst_node_range moving(const karst_ranger *r, interval middle, interval slope)
{
    karst_node_range n = {.middle = middle, .slope = slope};
    n.value = interval_add(middle, interval_multiply(slope, interval_of(-r->half, r->half)));
    return n;
}

/* What decides a step is a float: near where it steps, it may be on the other side. */
#define FLOAT_ERROR 0x1p-21

static interval hold(interval a, interval all)
{
    return interval_of(fmin(fmax(a.lo, all.lo), all.hi), fmin(fmax(a.hi, all.lo), all.hi));
}

/* a, less the whole cells of size b that FRACT or MOD takes off where its floats round; `cells`: a / b, of which
 * floats may be off by `error`. */
static karst_node_range rest_range(const karst_ranger *r, karst_expr e, const karst_node_range *a,
                                   const karst_node_range *b, const karst_node_range *cells, double error)
{
    const double off = karst_oracle_cells_off(r->oracle, e, 0.5 * (cells->middle.lo + cells->middle.hi));
    const interval all = interval_multiply(interval_of(0, 1), b->value);
    if (!isfinite(off))
        return (karst_node_range){.middle = all, .value = all, .slope = interval_whole()};
    const bool in_one = off == floor(cells->value.lo - error) && off == floor(cells->value.hi + error);
    karst_node_range rest = {.middle = hold(interval_subtract(a->middle, interval_scale(b->middle, off)), all),
                             .value = hold(interval_subtract(a->value, interval_scale(b->value, off)), all),
                             .slope = interval_subtract(a->slope, interval_scale(b->slope, off))};
    if (!in_one && r->half > 0) { /* both sides of the tie are possible */
        rest.value = all;
        rest.slope = interval_whole();
    }
    return rest;
}

/* What works on the exact place of its argument. */
static karst_node_range place_range(const karst_ranger *r, karst_expr e)
{
    const karst_expr_node *n = &r->graph->nodes[e], *a = &r->graph->nodes[n->arg[0]];
    const void *record = karst_oracle_record(r->oracle, e);
    karst_node_range offset = {{0, 0}, {0, 0}, {0, 0}}, in_cell, result;
    if (a->op == KARST_OP_SHIFTED)
        offset = r->nodes[a->arg[1]];
    bool turns = n->op == KARST_OP_SIN_TURNS || n->op == KARST_OP_COS_TURNS;
    interval b = n->op == KARST_OP_MOD ? r->nodes[n->arg[1]].value : interval_thin(1);
    exact_place at = turns ? exact_lattice(r, record) : exact_cells(r, record);
    double rate = turns ? lattice_rate(r, record) : cells_rate(r, record);
    in_cell = moving(r, interval_widen(interval_thin(at.fraction), PLACE_ERROR), interval_out(rate, rate));
    if (n->op == KARST_OP_MOD && interval_is_zero(b)) {
        karst_node_range none = {{0, 0}, {0, 0}, {0, 0}};
        return none;
    }
    in_cell.middle = interval_add(in_cell.middle, interval_divide(offset.middle, b));
    in_cell.value = interval_add(in_cell.value, interval_divide(offset.value, b));
    in_cell.slope = interval_add(in_cell.slope, interval_divide(offset.slope, b));
    in_cell.value = interval_meet(in_cell.value, moving(r, in_cell.middle, in_cell.slope).value);
    if (turns) {
        bool cosine = n->op == KARST_OP_COS_TURNS;
        interval angle = interval_scale(in_cell.value, TURN);
        result.middle = karst_range_of_sine(interval_scale(in_cell.middle, TURN), cosine);
        result.value = karst_range_of_sine(angle, cosine);
        interval slope = karst_range_of_sine(angle, !cosine);
        result.slope = interval_multiply(interval_scale(cosine ? interval_negate(slope) : slope, TURN), in_cell.slope);
        return result;
    }
    double cell = floor(in_cell.value.lo);
    bool in_one = cell == floor(in_cell.value.hi);
    if (n->op == KARST_OP_FLOOR) {
        result.value = interval_of((double)at.cell + cell, (double)at.cell + floor(in_cell.value.hi));
        result.middle = result.value;
        result.slope = in_one ? interval_thin(0) : interval_whole();
        return result;
    }
    if (n->op == KARST_OP_CELL) {
        double here = r->oracle->slots[e].i, modulus = n->arg[1] ? r->nodes[n->arg[1]].value.lo : 0;
        bool one = in_one && !(n->extra && cell == in_cell.value.lo);
        result.value = one       ? interval_thin(here)
                       : modulus ? interval_of(0, modulus - 1)
                                 : interval_of(INT32_MIN, INT32_MAX);
        result.middle = interval_thin(here);
        result.slope = interval_whole(); /* whoever calls narrows it */
        return result;
    }
    if (r->oracle->rounds[e]) {
        const karst_node_range one = {.middle = {1, 1}, .value = {1, 1}};
        const double error = FLOAT_ERROR * (1 + interval_most(interval_divide(offset.value, b)));
        result = rest_range(r, e, &in_cell, &one, &in_cell, error);
        return (karst_node_range){interval_multiply(result.middle, b), interval_multiply(result.value, b),
                                  interval_multiply(result.slope, b)};
    }
    result.middle = interval_multiply(
        karst_range_of_op(KARST_OP_FRACT, in_cell.middle, interval_thin(0), interval_thin(0), interval_thin(0)), b);
    result.value = interval_multiply(
        karst_range_of_op(KARST_OP_FRACT, in_cell.value, interval_thin(0), interval_thin(0), interval_thin(0)), b);
    result.slope = in_one ? interval_multiply(in_cell.slope, b) : interval_whole();
    return result;
}

/* ---- noise ---- */

/* Where the middle lies in an octave's lattice, how unsure that is, and how fast the ray passes its cells. */
typedef struct {
    karst_jet_place place[3];
    interval rate[3];
    double unsure;
} octave_pass;

static bool pass_octave(const karst_ranger *r, const karst_expr_node *n, const karst_octave *octave, double scale,
                        octave_pass *pass)
{
    pass->unsure = PLACE_ERROR;
    for (int i = 0; i < 3; i++) {
        exact_place at = exact_lattice(r, &octave->lattice[i]);
        double rate = lattice_rate(r, &octave->lattice[i]), by = 0;
        pass->rate[i] = interval_out(rate, rate);
        const karst_expr_node *argument = &r->graph->nodes[n->arg[i]];
        if (argument->op != KARST_OP_AFFINE) {
            const karst_node_range *offset = &r->nodes[argument->op == KARST_OP_SHIFTED ? argument->arg[1] : n->arg[i]];
            by = 0.5 * (offset->middle.lo + offset->middle.hi) * scale;
            pass->unsure += fabs(scale) * (offset->middle.hi - offset->middle.lo);
            pass->rate[i] = interval_add(pass->rate[i], interval_scale(offset->slope, scale));
        }
        if (!(fabs(by) < 0x1p29))
            return false;
        double t = at.fraction + by, whole = floor(t);
        pass->place[i] = (karst_jet_place){(uint32_t)(uint64_t)at.cell + (uint32_t)(int32_t)whole, t - whole};
        pass->unsure += fabs(t) * 0x1p-50;
    }
    return isfinite(pass->unsure);
}

/* Gradient noise over the piece. */
static karst_node_range gradient_range(const karst_ranger *r, const octave_pass *pass, uint32_t seed)
{
    const interval all = interval_of(-(double)NOISE_SUP, (double)NOISE_SUP);
    double reach = 0, rates = 0, most_rate = 0, middle[3], off[3];
    for (int i = 0; i < 3; i++) {
        middle[i] = 0.5 * (pass->rate[i].lo + pass->rate[i].hi);
        off[i] = 0.5 * (pass->rate[i].hi - pass->rate[i].lo) * (1 + 0x1p-50) + 0x1p-52 * fabs(middle[i]);
        reach = fmax(reach, interval_most(pass->rate[i]) * r->half + pass->unsure);
        rates += interval_most(pass->rate[i]);
        most_rate = fmax(most_rate, interval_most(pass->rate[i]));
    }
    /* |grad n . rate| by the suprema of one component, and of all together */
    double slope = fmin((double)NOISE_SUP_SLOPE * rates, (double)NOISE_SUP_SLOPES * most_rate);
    karst_node_range n = {all, all, interval_of(-slope, slope)};
    if (!(reach < 0.5))
        return n;
    karst_noise_jet jet;
    karst_noise_jet_at(pass->place, seed, &jet);
    interval value = interval_thin(jet.value), exact;
    n.middle = interval_meet(interval_widen(value, (double)NOISE_SUP_SLOPES * pass->unsure + 0x1p-48), all);
    /* The slope at s from the middle, by Taylor: with r the rate at s and q its mean on the way there, both within
     * `middle` + [-off, off], it is gradient . r + s q . hessian . r, and a rest of third order. */
    double first = 0, second = 0, first_off = 0, second_off = 0, rest = 0;
    for (int i = 0; i < 3; i++) {
        double turn = 0, turn_off = 0;
        for (int j = 0; j < 3; j++) {
            turn += jet.hessian[i][j] * middle[j];
            turn_off += fabs(jet.hessian[i][j]) * off[j];
        }
        first += jet.gradient[i] * middle[i];
        first_off += fabs(jet.gradient[i]) * off[i];
        second += turn * middle[i];
        second_off += fabs(turn) * 2 * off[i] + turn_off * off[i];
        rest += 0.5 * (double)NOISE_SUP_THIRD_ROW * reach * reach * (fabs(middle[i]) + off[i]);
        /* the middle's place is not known better */
        rest += (fabs(turn) + turn_off) * pass->unsure + 0x1p-44 * (fabs(middle[i]) + off[i]);
    }
    double spread = first_off + r->half * (fabs(second) + second_off) + rest;
    exact = interval_out(first - spread, first + spread);
    n.slope = interval_meet(exact, n.slope);
    n.value = interval_add(n.middle, interval_multiply(n.slope, interval_of(-r->half, r->half)));
    n.value = interval_meet(n.value, interval_widen(value, (double)NOISE_SUP_SLOPES * reach + 0x1p-48));
    n.value = interval_meet(n.value, all);
    return n;
}

/* amplitude * shape(mean + weight * (n - mean)), n the noise or its magnitude. */
static karst_node_range shaped(const karst_noise *noise, karst_node_range n, double weight, double amplitude)
{
    const uint8_t shape = noise->shape;
    double mean = (double)octave_mean(noise->base, shape), factor = 1, offset = 0;
    if (shape != KARST_NOISE_SUM) {
        karst_node_range magnitude = {interval_abs(n.middle), interval_abs(n.value), n.slope};
        interval down = interval_negate(n.slope);
        magnitude.slope = n.value.lo > 0 ? n.slope : n.value.hi < 0 ? down : interval_hull(n.slope, down);
        n = magnitude;
        factor = shape == KARST_NOISE_RIDGED ? -2 : shape == KARST_NOISE_BILLOW ? 2 : 1;
        offset = shape == KARST_NOISE_RIDGED ? 1 : shape == KARST_NOISE_BILLOW ? -1 : 0;
    }
    interval base = interval_thin(0);
    if (shape != KARST_NOISE_SUM || mean != 0)
        base = interval_widen(interval_thin((offset + factor * mean) * amplitude), 0x1p-48 * fabs(amplitude));
    double by = factor * weight * amplitude;
    if (by == 0) {
        n.middle = n.value = base;
        n.slope = interval_thin(0);
        return n;
    }
    n.middle = interval_add(base, interval_scale(n.middle, by));
    n.value = interval_add(base, interval_scale(n.value, by));
    n.slope = interval_scale(n.slope, by);
    if (mean != 0) {
        interval shift = interval_out(-mean * by, -mean * by);
        n.middle = interval_add(n.middle, shift);
        n.value = interval_add(n.value, shift);
    }
    return n;
}

/* Other noises over the piece: by the value at the middle and how steep they are at most, |dn/dx_i| of value noise and
 * simplex noise, |grad n| = 1 of distances to points. At a place (a piece of no length) the slope is known. */
static karst_node_range steep_range(const karst_ranger *r, const octave_pass *pass, uint8_t base, uint32_t seed)
{
    bool is_distance = base == KARST_NOISE_WORLEY_F1 || base == KARST_NOISE_WORLEY_F2;
    double most = is_distance                   ? 1
                  : base == KARST_NOISE_SIMPLEX ? (double)NOISE_SIMPLEX_SUP_SLOPE
                                                : (double)NOISE_VALUE_SUP_SLOPE;
    interval all = is_distance                   ? interval_of(0, (double)NOISE_WORLEY_SUP)
                   : base == KARST_NOISE_SIMPLEX ? interval_of(-(double)NOISE_SIMPLEX_SUP, (double)NOISE_SIMPLEX_SUP)
                                                 : interval_of(-1, 1);
    karst_oracle_cell at[3];
    double slope = 0;
    for (int i = 0; i < 3; i++) {
        at[i] = (karst_oracle_cell){pass->place[i].cell, pass->place[i].fraction};
        slope += most * interval_most(pass->rate[i]);
    }
    interval value = interval_thin(karst_oracle_noise(base, at, seed, -1));
    value = interval_meet(interval_widen(value, 3 * most * pass->unsure + 0x1p-44), all);
    karst_node_range n = moving(r, value, interval_of(-slope, slope));
    n.value = interval_meet(n.value, all);
    if (r->half > 0)
        return n;
    n.slope = interval_thin(0);
    for (int i = 0; i < 3; i++)
        n.slope = interval_add(n.slope, interval_scale(pass->rate[i], karst_oracle_noise(base, at, seed, i)));
    return n;
}

/* An image or a field over the piece: by the value at the middle and how steep it is at most along each axis. */
static karst_node_range image_range(const karst_ranger *r, const octave_pass *pass, const karst_octave *octave)
{
    const karst_image_header *image = image_of(octave);
    const interval all = interval_of((double)image->low, (double)image->high);
    karst_oracle_cell at[3] = {{0}};
    const int num_axes = (int)image->num_axes;
    double slope = 0, steepest = 0;
    for (int i = 0; i < num_axes; i++) {
        const double most = fmax(-(double)image->slope[2 * i], (double)image->slope[2 * i + 1]);
        at[i] = (karst_oracle_cell){pass->place[i].cell, pass->place[i].fraction};
        slope += most * interval_most(pass->rate[i]);
        steepest += most;
    }
    const double error = steepest * pass->unsure + 0x1p-40 * fmax(fabs(all.lo), fabs(all.hi));
    interval value = interval_widen(interval_thin(karst_oracle_image(octave, at, r->level, -1)), error);
    karst_node_range n = moving(r, value, interval_of(-slope, slope));
    n.value = interval_meet(n.value, interval_widen(all, error));
    if (r->half > 0)
        return n;
    n.slope = interval_thin(0);
    for (int i = 0; i < num_axes; i++)
        n.slope =
            interval_add(n.slope, interval_scale(pass->rate[i], karst_oracle_image(octave, at, r->level, i)));
    return n;
}

static karst_node_range noise_range(const karst_ranger *r, karst_expr e)
{
    const karst_expr_node *n = &r->graph->nodes[e];
    const karst_noise *noise = &r->graph->noises[n->extra];
    const karst_octave *octave = karst_oracle_record(r->oracle, e);
    const karst_node_range unknown = {interval_whole(), interval_whole(), interval_whole()};
    karst_node_range sum = {{0, 0}, {0, 0}, {0, 0}};
    double amplitude = 1, scale = 1;
    if (noise->derivative)
        return unknown;
    for (int k = 0; k < noise->num_octaves; k++, octave++) {
        double weight = (double)octave_weight_at(octave, r->level).weight;
        octave_pass pass;
        karst_node_range one = {{0, 0}, {0, 0}, {0, 0}};
        if ((weight != 0 || noise->image) && !pass_octave(r, n, octave, scale, &pass))
            return unknown;
        if (noise->image)
            return image_range(r, &pass, octave);
        if (weight != 0)
            one = noise->base == KARST_NOISE_GRADIENT ? gradient_range(r, &pass, octave->seed)
                                                      : steep_range(r, &pass, noise->base, octave->seed);
        one = shaped(noise, one, weight, amplitude);
        sum.middle = interval_add(sum.middle, one.middle);
        sum.value = interval_add(sum.value, one.value);
        sum.slope = interval_add(sum.slope, one.slope);
        amplitude *= r->oracle->slots[noise->gain].d;
        scale *= r->oracle->slots[noise->lacunarity].d;
    }
    return sum;
}

/* ---- nodes ---- */

/* A node whose value is the device's float or int: one number where all that decides it is, or where its range is. */
static karst_node_range steps_range(const karst_ranger *r, karst_expr e, interval natural)
{
    const karst_expr_node *n = &r->graph->nodes[e];
    const karst_oracle_slot *s = &r->oracle->slots[e];
    bool fixed = n->op != KARST_OP_NOISE && n->arg[0] != KARST_NO_EXPR && !karst_takes_place(&r->oracle->layout, e, 0);
    for (int k = 0; k < 4 && fixed; k++)
        fixed = n->arg[k] == KARST_NO_EXPR || interval_is_thin(r->nodes[n->arg[k]].value);
    double here = n->type == KARST_TYPE_FLOAT  ? (double)s->f
                  : n->type == KARST_TYPE_BOOL ? (double)(s->i != 0)
                  : n->type == KARST_TYPE_UINT ? (double)(uint)s->i
                                               : (double)s->i;
    if (isnan(here))
        return (karst_node_range){interval_whole(), interval_whole(), interval_whole()};
    /* A float may have rounded across a step: then both sides are possible. */
    interval value = fixed ? interval_thin(here) : interval_hull(natural, interval_thin(here));
    return (karst_node_range){interval_thin(here), value,
                              interval_is_thin(value) ? interval_thin(0) : interval_whole()};
}

static interval as_float(const karst_ranger *r, karst_expr e, interval value)
{
    const uint8_t kind = r->graph->nodes[e].kind;
    bool rounds = r->graph->nodes[e].type == KARST_TYPE_FLOAT && kind != KARST_KIND_UNIFORM && kind != KARST_KIND_STEPS;
    return rounds ? interval_widen(value, FLOAT_ERROR * interval_most(value)) : value;
}

/* FRACT or MOD of a float. */
static karst_node_range fold_range(const karst_ranger *r, karst_expr e, const karst_node_range *a,
                                   const karst_node_range *b)
{
    const karst_node_range one = {.middle = {1, 1}, .value = {1, 1}};
    karst_node_range cells = *a;
    if (r->graph->nodes[e].op == KARST_OP_MOD) {
        cells.middle = interval_divide(a->middle, b->middle);
        cells.value = interval_divide(a->value, b->value);
    } else {
        b = &one;
    }
    return rest_range(r, e, a, b, &cells, FLOAT_ERROR * interval_most(cells.value));
}

static karst_node_range node_range(const karst_ranger *r, karst_expr e)
{
    const karst_expr_node *n = &r->graph->nodes[e];
    const karst_node_range *a = &r->nodes[n->arg[0]], *b = &r->nodes[n->arg[1]], *c = &r->nodes[n->arg[2]],
                           *d = &r->nodes[n->arg[3]];
    karst_node_range result;
    if (n->op == KARST_OP_AFFINE) {
        const karst_linear *form = karst_oracle_record(r->oracle, e);
        double value = karst_oracle_affine(r->oracle, form), rate = 0;
        for (int i = 0; i < 3; i++)
            rate += (double)form->factor[i] * r->direction[i];
        rate *= (double)form->scale[0] * (double)form->scale[1];
        return moving(r, interval_out(value, value), interval_out(rate, rate));
    }
    if (n->op == KARST_OP_NOISE)
        return noise_range(r, e);
    if (karst_takes_place(&r->oracle->layout, e, 0)) {
        result = place_range(r, e);
        return n->kind == KARST_KIND_STEPS ? steps_range(r, e, result.value) : result;
    }
    const interval first = as_float(r, n->arg[0], a->value), second = as_float(r, n->arg[1], b->value);
    if (n->type == KARST_TYPE_BOOL) {
        bool known = n->op != KARST_OP_SELECT && n->op != KARST_OP_CONVERT;
        return steps_range(r, e, known ? karst_truth_of_op((karst_op)n->op, first, second) : interval_of(0, 1));
    }
    if (n->type != KARST_TYPE_FLOAT)
        return steps_range(r, e, karst_range_of_whole((karst_op)n->op, n->type == KARST_TYPE_UINT, first, second,
                                                      c->value));
    if (n->op == KARST_OP_FLOOR || n->op == KARST_OP_CEIL || n->op == KARST_OP_RINT)
        return steps_range(r, e, karst_range_of_op((karst_op)n->op, first, second, c->value, d->value));
    if (n->op == KARST_OP_MULTIPLY && n->arg[0] == n->arg[1]) {
        result.middle = interval_square(a->middle);
        result.value = interval_square(a->value);
        result.slope = interval_multiply(interval_scale(a->value, 2), a->slope);
        return result;
    }
    if (r->oracle->rounds[e] && (n->op == KARST_OP_FRACT || !interval_holds(b->value, 0)))
        return fold_range(r, e, a, b);
    result.value = karst_range_of_op((karst_op)n->op, a->value, b->value, c->value, d->value);
    if (n->kind == KARST_KIND_STEPS)
        return steps_range(r, e, result.value);
    result.middle = karst_range_of_op((karst_op)n->op, a->middle, b->middle, c->middle, d->middle);
    result.slope = karst_slope_of_op((karst_op)n->op, a, b, c, d, result.value);
    return result;
}

static karst_piece range_here(karst_ranger *r)
{
    for (uint32_t i = 0; i < r->num_nodes; i++) {
        karst_expr e = r->order[i];
        /* What is piecewise constant is a float in doubles, too. */
        if (r->is_float[e])
            karst_oracle_step_float(r->oracle, e);
        karst_node_range n = node_range(r, e);
        /* The whole line has no mean value form. */
        if (isfinite(n.slope.lo) && isfinite(n.slope.hi) && isfinite(n.middle.lo) && isfinite(n.middle.hi))
            n.value = interval_meet(n.value, moving(r, n.middle, n.slope).value);
        r->nodes[e] = n;
    }
    const karst_node_range *n = &r->nodes[r->density];
    return (karst_piece){n->value, n->slope, n->middle};
}

karst_piece karst_ranger_piece(karst_ranger *r, const karst_position *anchor, const double direction[3], double from,
                               double to, int level)
{
    double middle = from + 0.5 * (to - from);
    stand_at(r, anchor, direction, middle, level);
    /* Places are rounded. */
    r->half = fmax(to - middle, middle - from) * (1 + 0x1p-50) + 0x1p-32 + fabs(to) * 0x1p-51;
    return range_here(r);
}

double karst_ranger_density(karst_ranger *r, const karst_position *anchor, const double direction[3], double t,
                            int level)
{
    stand_at(r, anchor, direction, t, level);
    r->half = 0;
    range_here(r);
    interval middle = r->nodes[r->density].middle;
    return 0.5 * (middle.lo + middle.hi);
}

bool karst_ranger_gradient(karst_ranger *r, const karst_position *anchor, const double direction[3], double t,
                           int level, double gradient[3])
{
    for (int i = 0; i < 3; i++) {
        stand_at(r, anchor, direction, t, level);
        for (int k = 0; k < 3; k++)
            r->direction[k] = k == i;
        r->half = 0;
        interval slope = range_here(r).slope;
        gradient[i] = 0.5 * (slope.lo + slope.hi);
        if (!isfinite(gradient[i]))
            return false;
    }
    return true;
}

/* ---- jumps ---- */

/* Whether a node is the first to jump between two places next to one another; `was`: its value at the first. */
static bool is_first_to_jump(const karst_ranger *r, karst_expr e)
{
    const karst_expr_node *n = &r->graph->nodes[e];
    const double by = r->nodes[e].middle.lo - r->before[e];
    bool of_float = r->graph->nodes[n->arg[0]].type == KARST_TYPE_FLOAT;
    switch (n->op) {
    case KARST_OP_FLOOR:
    case KARST_OP_CEIL:
    case KARST_OP_RINT:
    case KARST_OP_CELL:
        return by != 0;
    case KARST_OP_LESS:
    case KARST_OP_LESS_EQUAL:
    case KARST_OP_EQUAL:
    case KARST_OP_NOT_EQUAL:
    case KARST_OP_CONVERT:
        return by != 0 && of_float && n->type != KARST_TYPE_FLOAT;
    case KARST_OP_FRACT:
        return fabs(by) > 0.5;
    case KARST_OP_MOD:
        return fabs(by) > 0.5 * interval_most(r->nodes[n->arg[1]].middle);
    case KARST_OP_ATAN:
        return fabs(by) > 0.5 * TURN;
    default:
        return false;
    }
}

/* Along the direction, the slope of what jumps where it passes a number: the argument, or how two of them differ. */
static double slope_of_argument(const karst_ranger *r, karst_expr e)
{
    const karst_expr_node *n = &r->graph->nodes[e];
    const karst_node_range *a = &r->nodes[n->arg[0]], *b = &r->nodes[n->arg[1]];
    interval slope = a->slope;
    if (karst_takes_place(&r->oracle->layout, e, 0)) {
        const karst_expr_node *from = &r->graph->nodes[n->arg[0]];
        const double rate = cells_rate(r, karst_oracle_record(r->oracle, e));
        interval offset = from->op == KARST_OP_SHIFTED ? r->nodes[from->arg[1]].slope : interval_thin(0);
        if (n->op == KARST_OP_MOD)
            offset = interval_divide(offset, b->value);
        slope = interval_add(interval_thin(rate), offset);
    } else if (n->op == KARST_OP_MOD) {
        slope = interval_subtract(slope, interval_multiply(interval_divide(a->middle, b->middle), b->slope));
    } else if (n->type == KARST_TYPE_BOOL && n->op != KARST_OP_CONVERT) {
        slope = interval_subtract(slope, b->slope);
    }
    return 0.5 * (slope.lo + slope.hi);
}

bool karst_ranger_jump(karst_ranger *r, const karst_position *anchor, const double direction[3], double before,
                       double behind, int level, double gradient[3])
{
    karst_expr first = KARST_NO_EXPR;
    double toward = 0;
    karst_ranger_density(r, anchor, direction, before, level);
    for (uint32_t i = 0; i < r->num_nodes; i++)
        r->before[r->order[i]] = r->nodes[r->order[i]].middle.lo;
    karst_ranger_density(r, anchor, direction, behind, level);
    for (uint32_t i = 0; i < r->num_nodes && !first; i++)
        first = is_first_to_jump(r, r->order[i]) ? r->order[i] : KARST_NO_EXPR;
    for (int i = 0; i < 3 && first; i++) {
        stand_at(r, anchor, direction, behind, level);
        for (int k = 0; k < 3; k++)
            r->direction[k] = k == i;
        r->half = 0;
        range_here(r);
        gradient[i] = slope_of_argument(r, first);
        toward += gradient[i] * direction[i];
    }
    if (!first || !isfinite(toward) || toward == 0)
        return false;
    for (int i = 0; i < 3; i++)
        gradient[i] = toward > 0 ? gradient[i] : -gradient[i];
    return true;
}
