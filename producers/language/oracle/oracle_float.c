/* The float half: the device's operations, on one lane. */
#include "producers/language/oracle/oracle_internal.h"

static const karst_expr_node *node_of(const karst_oracle *o, karst_expr e) { return &o->graph->nodes[e]; }
static vfloat float_of(const karst_oracle *o, karst_expr e) { return o->slots[e].f; }

static wide pair_of(const karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = node_of(o, e);
    const karst_oracle_slot *s = &o->slots[e];
    if (n->op == KARST_OP_AFFINE || n->op == KARST_OP_SHIFTED)
        return wide_of(s->high, s->low);
    return wide_of(s->f, o->known[e] || n->kind == KARST_KIND_WIDE ? s->low : 0.0f);
}

/* ---- places ---- */

/* Argument i of octave k, where a SHIFTED or a plain float moves the affine lattice. */
static noise_coordinate octave_coordinate(const karst_oracle *o, const karst_expr_node *n, const karst_octave *octave,
                                          int i)
{
    noise_coordinate c = affine_coordinate(&o->at, &octave->lattice[i]);
    karst_expr by = n->arg[i];
    if (node_of(o, by)->op == KARST_OP_AFFINE)
        return c;
    if (node_of(o, by)->op == KARST_OP_SHIFTED)
        by = node_of(o, by)->arg[1];
    if (node_of(o, by)->kind == KARST_KIND_WIDE)
        return wide_move(c, pair_of(o, by), octave->scale);
    return noise_coordinate_move(c, float_of(o, by) * octave->scale);
}

static vfloat noise_float(const karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = node_of(o, e);
    const karst_noise *noise = &o->graph->noises[n->extra];
    const karst_octave *octave = karst_oracle_record(o, e);
    const int way = karst_noise_way(o->graph, e);
    vfloat sum = 0.0f;
    for (int k = 0; k < noise->num_octaves; k++, octave++) {
        octave_weight w = octave_weight_at(octave, o->level);
        noise_position p;
        for (int i = 0; i < 3; i++)
            p.axis[i] = octave_coordinate(o, n, octave, i);
        sum = octave_add(way, noise->shape, noise->derivative, &p, &w, sum);
    }
    return sum;
}

static vfloat place_float(const karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = node_of(o, e), *a = node_of(o, n->arg[0]);
    bool shifted = a->op == KARST_OP_SHIFTED;
    vfloat offset = shifted ? float_of(o, a->arg[1]) : 0.0f, b = float_of(o, n->arg[1]);
    const void *record = karst_oracle_record(o, e);
    if (n->op == KARST_OP_SIN_TURNS || n->op == KARST_OP_COS_TURNS) {
        noise_coordinate c = affine_coordinate(&o->at, record);
        if (shifted)
            c = noise_coordinate_move(c, offset);
        return n->op == KARST_OP_SIN_TURNS ? affine_sin_turns(c) : affine_cos_turns(c);
    }
    affine_place place = affine_cells(&o->at, record);
    switch (n->op) {
    case KARST_OP_FLOOR:
        return shifted ? affine_floor_shifted(place, offset) : affine_floor(place);
    case KARST_OP_FRACT:
        return shifted ? affine_fract_shifted(place, offset) : affine_fract(place);
    default:
        return shifted ? affine_mod_shifted(place, offset, b) : affine_fract(place) * b;
    }
}

/* ---- whole numbers ---- */

__extension__ typedef __int128 int128;

/* A place by the definition of its period, in 128 bits, as none of the devices does it. */
static affine_place cells_exactly(const affine_position *at, const karst_cells *cells)
{
    const karst_period *p = &cells->period;
    if (!p->period)
        return affine_lattice(at, &cells->lattice);
    const int128 one = (int128)1 << 32;
    int128 far = at->voxel[p->axis] * one + at->fraction[p->axis] - (p->offset_voxel * one + p->offset_fraction);
    int128 whole = (p->negative ? -far : far) * p->repeats, by = p->period * one, cell = whole / by - (whole % by < 0);
    return (affine_place){(vlong)cell, (vuint)((whole - cell * by) / p->period)};
}

static vint cell_exactly(const karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = node_of(o, e), *a = node_of(o, n->arg[0]);
    affine_place place = cells_exactly(&o->at, karst_oracle_record(o, e));
    int128 cell = place.cell;
    bool above = place.fraction != 0;
    if (a->op == KARST_OP_SHIFTED) {
        vfloat part = affine_fract(place) + float_of(o, a->arg[1]), whole = floorf(part);
        above = part != whole;
        cell += affine_steps(whole);
    }
    cell += n->extra && cell < 0 && above;
    if (!n->arg[1])
        return (vint)(uint)cell;
    int128 modulus = o->slots[n->arg[1]].i, rest = cell % modulus;
    return (vint)(rest < 0 ? rest + modulus : rest);
}

/* ---- pairs ---- */

static bool computes_wide(const karst_oracle *o, const karst_expr_node *n)
{
    if (n->kind == KARST_KIND_WIDE)
        return true;
    switch (n->op) {
    case KARST_OP_LESS:
    case KARST_OP_LESS_EQUAL:
    case KARST_OP_EQUAL:
    case KARST_OP_NOT_EQUAL:
    case KARST_OP_FRACT:
    case KARST_OP_FLOOR:
    case KARST_OP_MOD:
    case KARST_OP_SIN:
    case KARST_OP_COS:
        for (int k = 0; k < 2; k++)
            if (n->arg[k] && node_of(o, n->arg[k])->kind == KARST_KIND_WIDE)
                return true;
        return false;
    default:
        return false;
    }
}

static void step_wide(karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = node_of(o, e);
    karst_oracle_slot *s = &o->slots[e];
    wide a = pair_of(o, n->arg[0]), b = pair_of(o, n->arg[1]), c = pair_of(o, n->arg[2]), d = pair_of(o, n->arg[3]),
         r = wide_from(0.0f);
    switch (n->op) {
    case KARST_OP_ADD:
        r = wide_add(a, b);
        break;
    case KARST_OP_SUBTRACT:
        r = wide_subtract(a, b);
        break;
    case KARST_OP_MULTIPLY:
        r = wide_multiply(a, b);
        break;
    case KARST_OP_DIVIDE:
        r = wide_divide(a, b);
        break;
    case KARST_OP_FMA:
        r = wide_fma(a, b, c);
        break;
    case KARST_OP_NEGATE:
        r = wide_negate(a);
        break;
    case KARST_OP_MIN:
        r = wide_min(a, b);
        break;
    case KARST_OP_MAX:
        r = wide_max(a, b);
        break;
    case KARST_OP_ABS:
        r = wide_abs(a);
        break;
    case KARST_OP_MIX:
        r = wide_mix(a, b, c);
        break;
    case KARST_OP_SQRT:
        r = wide_sqrt(a);
        break;
    case KARST_OP_SELECT:
        r = wide_select(o->slots[n->arg[0]].i, b, c);
        break;
    case KARST_OP_LENGTH:
        r = n->arg[3] ? wide_length4(a, b, c, d) : n->arg[2] ? wide_length3(a, b, c) : wide_length2(a, b);
        break;
    case KARST_OP_LESS:
        s->i = wide_less(a, b);
        return;
    case KARST_OP_LESS_EQUAL:
        s->i = wide_less_equal(a, b);
        return;
    case KARST_OP_EQUAL:
        s->i = wide_equal(a, b);
        return;
    case KARST_OP_NOT_EQUAL:
        s->i = wide_not_equal(a, b);
        return;
    case KARST_OP_FRACT:
        s->f = wide_fract(a);
        return;
    case KARST_OP_FLOOR:
        s->f = wide_floor(a);
        return;
    case KARST_OP_MOD:
        s->f = wide_mod(a, b);
        return;
    case KARST_OP_SIN:
        s->f = wide_sin(a);
        return;
    case KARST_OP_COS:
        s->f = wide_cos(a);
        return;
    default:
        break;
    }
    s->f = r.hi;
    s->low = r.lo;
}

/* ---- floats ---- */

static vfloat plain_float(const karst_oracle *o, const karst_expr_node *n)
{
    vfloat a = float_of(o, n->arg[0]), b = float_of(o, n->arg[1]), c = float_of(o, n->arg[2]),
           d = float_of(o, n->arg[3]);
    vint i = o->slots[n->arg[0]].i;
    uint8_t from = node_of(o, n->arg[0])->type;
    switch ((karst_op)n->op) {
    case KARST_OP_FOOTPRINT:
        return op_footprint(o->level, (int)n->extra - KARST_FOOTPRINT_BIAS);
    case KARST_OP_NORMAL:
        return o->facing[n->extra];
    case KARST_OP_ADD:
    case KARST_OP_SHIFTED:
        return op_add(a, b);
    case KARST_OP_SUBTRACT:
        return op_subtract(a, b);
    case KARST_OP_MULTIPLY:
        return op_multiply(a, b);
    case KARST_OP_DIVIDE:
        return op_divide(a, b);
    case KARST_OP_FMA:
        return op_fma(a, b, c);
    case KARST_OP_NEGATE:
        return op_negate(a);
    case KARST_OP_MIN:
        return op_min(a, b);
    case KARST_OP_MAX:
        return op_max(a, b);
    case KARST_OP_ABS:
        return op_abs(a);
    case KARST_OP_FLOOR:
        return op_floor(a);
    case KARST_OP_CEIL:
        return op_ceil(a);
    case KARST_OP_RINT:
        return op_rint(a);
    case KARST_OP_FRACT:
        return op_fract(a);
    case KARST_OP_MOD:
        return op_mod(a, b);
    case KARST_OP_MIX:
        return op_mix(a, b, c);
    case KARST_OP_SQRT:
        return op_sqrt(a);
    case KARST_OP_LENGTH:
        return n->arg[3] ? op_length4(a, b, c, d) : n->arg[2] ? op_length3(a, b, c) : op_length2(a, b);
    case KARST_OP_SIN:
        return op_sin(a);
    case KARST_OP_COS:
        return op_cos(a);
    case KARST_OP_EXP2:
        return op_exp2(a);
    case KARST_OP_LOG:
        return op_log(a);
    case KARST_OP_ATAN:
        return op_atan(a, b);
    case KARST_OP_SELECT:
        return op_select_float(i, b, c);
    case KARST_OP_CONVERT:
        return from == KARST_TYPE_BOOL   ? op_bool_to_float(i)
               : from == KARST_TYPE_UINT ? op_uint_to_float(i)
                                         : op_int_to_float(i);
    case KARST_OP_BITS:
        return op_bits_to_float(i);
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
    KARST_OP_CASES_OF_COMPARISONS
    KARST_OP_CASES_OF_INTS
        break;
    }
    return NAN;
}

/* ---- where floats jump ---- */

vfloat karst_oracle_float_cells(const karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = node_of(o, e);
    const vfloat a = float_of(o, n->arg[0]), b = n->op == KARST_OP_MOD ? float_of(o, n->arg[1]) : 1.0f;
    if (karst_takes_place(&o->layout, e, 0)) {
        const vfloat part = affine_fract(affine_cells(&o->at, karst_oracle_record(o, e)));
        return k_floor(k_fma(part, b, float_of(o, node_of(o, n->arg[0])->arg[1])) / b);
    }
    if (!computes_wide(o, n))
        return k_floor(a / b);
    const wide pair = pair_of(o, n->arg[0]);
    return wide_floor(n->op == KARST_OP_MOD ? wide_divide(pair, pair_of(o, n->arg[1])) : pair);
}

/* ---- ints and bools ---- */

static vint compared(const karst_oracle *o, const karst_expr_node *n)
{
    vfloat a = float_of(o, n->arg[0]), b = float_of(o, n->arg[1]);
    vint i = o->slots[n->arg[0]].i, j = o->slots[n->arg[1]].i;
    uint8_t from = node_of(o, n->arg[0])->type;
    bool is_float = from == KARST_TYPE_FLOAT, is_uint = from == KARST_TYPE_UINT;
    if (from == KARST_TYPE_BOOL && (n->op == KARST_OP_LESS || n->op == KARST_OP_LESS_EQUAL)) { /* true is -1 */
        vint swap = i;
        i = j;
        j = swap;
    }
    switch (n->op) {
    case KARST_OP_LESS:
        return is_float ? op_less_float(a, b) : is_uint ? op_less_uint(i, j) : op_less_int(i, j);
    case KARST_OP_LESS_EQUAL:
        return is_float ? op_less_equal_float(a, b) : is_uint ? op_less_equal_uint(i, j) : op_less_equal_int(i, j);
    case KARST_OP_EQUAL:
        return is_float ? op_equal_float(a, b) : op_equal_int(i, j);
    default:
        return is_float ? op_not_equal_float(a, b) : op_not_equal_int(i, j);
    }
}

static vint converted(const karst_oracle *o, const karst_expr_node *n)
{
    vfloat a = float_of(o, n->arg[0]);
    vint i = o->slots[n->arg[0]].i;
    uint8_t from = node_of(o, n->arg[0])->type;
    if (n->type == KARST_TYPE_BOOL)
        return from == KARST_TYPE_FLOAT ? op_float_to_bool(a) : op_int_to_bool(i);
    if (from == KARST_TYPE_BOOL)
        return op_bool_to_int(i);
    return from != KARST_TYPE_FLOAT ? i : n->type == KARST_TYPE_UINT ? op_float_to_uint(a) : op_float_to_int(a);
}

static vint plain_int(const karst_oracle *o, const karst_expr_node *n)
{
    vint a = o->slots[n->arg[0]].i, b = o->slots[n->arg[1]].i, c = o->slots[n->arg[2]].i;
    bool is_uint = n->type == KARST_TYPE_UINT;
    switch ((karst_op)n->op) {
    case KARST_OP_LESS:
    case KARST_OP_LESS_EQUAL:
    case KARST_OP_EQUAL:
    case KARST_OP_NOT_EQUAL:
        return compared(o, n);
    case KARST_OP_NOT:
        return op_not(a);
    case KARST_OP_AND:
        return op_and(a, b);
    case KARST_OP_OR:
        return op_or(a, b);
    case KARST_OP_SELECT:
        return op_select_int(a, b, c);
    case KARST_OP_INT_ADD:
        return op_int_add(a, b);
    case KARST_OP_INT_SUBTRACT:
        return op_int_subtract(a, b);
    case KARST_OP_INT_MULTIPLY:
        return op_int_multiply(a, b);
    case KARST_OP_INT_DIVIDE:
        return is_uint ? op_uint_divide(a, b) : op_int_divide(a, b);
    case KARST_OP_INT_MODULO:
        return is_uint ? op_uint_modulo(a, b) : op_int_modulo(a, b);
    case KARST_OP_BIT_AND:
        return op_bit_and(a, b);
    case KARST_OP_BIT_OR:
        return op_bit_or(a, b);
    case KARST_OP_BIT_XOR:
        return op_bit_xor(a, b);
    case KARST_OP_BIT_NOT:
        return op_bit_not(a);
    case KARST_OP_SHIFT_LEFT:
        return op_shift_left(a, b);
    case KARST_OP_SHIFT_RIGHT:
        return is_uint ? op_uint_shift_right(a, b) : op_int_shift_right(a, b);
    case KARST_OP_CONVERT:
        return converted(o, n);
    case KARST_OP_BITS:
        return node_of(o, n->arg[0])->type == KARST_TYPE_FLOAT ? op_float_to_bits(float_of(o, n->arg[0])) : a;
    case KARST_OP_NONE: /* known before, or found elsewhere */
    case KARST_OP_CONSTANT:
    case KARST_OP_CELL:
    case KARST_NUM_OPS:
    KARST_OP_CASES_OF_FLOATS
        break;
    }
    return 0;
}

void karst_oracle_step_float(karst_oracle *o, karst_expr e)
{
    const karst_expr_node *n = node_of(o, e);
    karst_oracle_slot *s = &o->slots[e];
    if (n->op == KARST_OP_NOISE) {
        s->f = noise_float(o, e);
    } else if (n->op == KARST_OP_AFFINE) {
        const karst_linear *form = karst_oracle_record(o, e);
        s->f = affine_float(&o->at, form);
        wide pair = wide_affine(&o->at, form);
        s->high = pair.hi;
        s->low = pair.lo;
    } else if (n->op == KARST_OP_CELL) {
        s->i = cell_exactly(o, e);
    } else if (karst_takes_place(&o->layout, e, 0)) {
        s->f = place_float(o, e);
    } else if (n->op == KARST_OP_SHIFTED) {
        s->f = plain_float(o, n);
        wide pair = wide_add(pair_of(o, n->arg[0]), pair_of(o, n->arg[1]));
        s->high = pair.hi;
        s->low = pair.lo;
    } else if (computes_wide(o, n)) {
        step_wide(o, e);
    } else if (n->type == KARST_TYPE_FLOAT) {
        s->f = plain_float(o, n);
    } else {
        s->i = plain_int(o, n);
    }
}
