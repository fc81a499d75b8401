/* Tapes in real numbers: in long double, with exact places, to be held against bounds. */
#ifndef KARST_TESTS_LANGUAGE_REAL_TAPE_H
#define KARST_TESTS_LANGUAGE_REAL_TAPE_H

#include <math.h>

#include "producers/language/tape/tape.clh"
#include "tests/language/random_graph.h"

__extension__ typedef __int128 int128;
typedef long double real;

/* A tape in long double; and twice more with every result off by a little, to see what rounding does to it. What is
 * piecewise constant is the float op of what it is given. */
enum { NUM_PASSES = 3 };
typedef struct {
    real value[NUM_PASSES];
    int bits[NUM_PASSES]; /* of ints and bools; of floats, of the nearest */
} real_slot;

/* x in the first pass, else off by up to one part in `parts`. */
static inline real shaken(real x, int pass, real parts)
{
    return pass ? x * (1 + (random_chance(2) ? 1 : -1) * (real)(0.5 + 0.5 * random_unit()) / parts) : x;
}

static inline real affine_real(const affine_position *at, const karst_linear *form)
{
    int128 sum = (int128)((unsigned __int128)(uint64_t)form->offset_high << 64 | form->offset_low);
    for (int i = 0; i < 3; i++)
        sum += (int128)form->factor[i] * at->voxel[i] + (((int128)form->factor[i] * (int128)at->fraction[i]) >> 32);
    return (real)sum * (real)form->scale[0] * (real)form->scale[1];
}

/* The part of a cell, to all its bits. */
static inline real lattice_part(const affine_position *at, const karst_lattice *form, int pass)
{
    int128 sum = form->fraction;
    for (int i = 0; i < 3; i++)
        sum +=
            (int128)form->frequency[i] * at->voxel[i] + (((int128)form->frequency[i] * (int128)at->fraction[i]) >> 32);
    return ((real)(int64_t)((uint64_t)sum & 0xffffffffffffffULL) + pass) * 0x1p-56L; /* rounded down thrice */
}
static inline real cells_part(const affine_position *at, const karst_cells *cells, int pass)
{
    const karst_period *p = &cells->period;
    if (!p->period)
        return lattice_part(at, &cells->lattice, pass);
    int128 units = ((int128)at->voxel[p->axis] * ((int128)1 << 32) + at->fraction[p->axis]) -
                   ((int128)p->offset_voxel * ((int128)1 << 32) + p->offset_fraction);
    int128 whole = (int128)p->period << 32;
    units = (p->negative ? -units : units) % whole;
    units = (units < 0 ? units + whole : units) * p->repeats % whole;
    return (real)units / (real)whole;
}

/* Of a place with an offset, whose cells are exact: where a device's sum lies on the other side of a whole number, this
 * one is a step away. */
static inline real floor_of_place(const affine_position *at, const karst_cells *cells, real offset)
{
    real steps = floorl(cells_part(at, cells, 0) + offset);
    steps = steps < -0x1p54L ? -0x1p54L : steps > 0x1p54L ? 0x1p54L : steps;
    return (real)(float)((real)affine_cells(at, cells).cell + steps);
}

/* CELL of a place that a real number moves. */
static inline int cell_of_place(const tape_program *tape, const karst_instruction *i, const affine_position *at,
                                real offset)
{
    const karst_cells *cells = (const karst_cells *)(tape->data + i->word);
    affine_place place = affine_cells(at, cells);
    real part = (real)place.fraction * 0x1p-32L + offset, steps = floorl(part);
    bool above = part != steps;
    steps = steps < -0x1p54L ? -0x1p54L : steps > 0x1p54L ? 0x1p54L : steps;
    int64_t cell = (int64_t)((uint64_t)place.cell + (uint64_t)(int64_t)steps), modulus;
    cell += i->count && cell < 0 && above;
    modulus = i->arg[1] == TAPE_NOTHING ? (int64_t)1 << 32 : tape_known(tape, i->arg[1]);
    int64_t rest = cell % modulus;
    return (int)(uint32_t)(rest < 0 ? rest + modulus : rest);
}

static inline real mod_real(real a, real b)
{
    if (b == 0)
        return 0;
    real rest = fmodl(a, b); /* exact */
    return rest != 0 && (rest < 0) != (b < 0) ? rest + b : rest;
}
static inline real clamp_real(real a, real lo, real hi) { return a < lo ? lo : a > hi ? hi : a; }

static inline real real_op(const tape_program *tape, const karst_instruction *i, const affine_position *at, int level,
                           const real x[4], int condition, float as_float, int pass)
{
    real a = x[0], b = x[1], c = x[2], d = x[3];
    bool is_whole = i->op == TAPE_PLACE_FLOOR || (i->op >= TAPE_FLOOR && i->op <= TAPE_RINT);
    if (i->op == TAPE_PLACE_FLOOR && i->arg[0] != TAPE_NOTHING)
        return floor_of_place(at, (const karst_cells *)(tape->data + i->word), a);
    if ((i->flags & TAPE_IS_STEPS) && (is_whole || pass == 0))
        return (real)as_float;
    switch (i->op) {
    case TAPE_AFFINE:
        return affine_real(at, (const karst_linear *)(tape->data + i->word));
    case TAPE_ADD:
        return a + b;
    case TAPE_SUBTRACT:
        return a - b;
    case TAPE_MULTIPLY:
        return a * b;
    case TAPE_DIVIDE:
        return a / b;
    case TAPE_FMA:
        return a * b + c;
    case TAPE_NEGATE:
        return -a;
    case TAPE_MIN:
        return b < a ? b : a;
    case TAPE_MAX:
        return b > a ? b : a;
    case TAPE_ABS:
        return fabsl(a);
    case TAPE_FRACT:
        return a - floorl(a);
    case TAPE_MOD:
        return mod_real(a, b);
    case TAPE_MIX:
        /* as devices have it: exactly one of both at either end, however much larger the other is */
        return pass ? a + c * shaken(b - a, pass, 0x1p45L) : fmal(c, b, fmal(-c, a, a));
    case TAPE_SQRT:
        return a < 0 ? 0 : sqrtl(a);
    case TAPE_LENGTH:
        return sqrtl(a * a + b * b + (i->count > 2 ? c * c : 0) + (i->count > 3 ? d * d : 0));
    case TAPE_SIN:
        return sinl(a);
    case TAPE_COS:
        return cosl(a);
    case TAPE_EXP2:
        return exp2l(clamp_real(a, -126, 126));
    case TAPE_LOG:
        return logl(clamp_real(a, 0x1p-126L, 0x1.fffffep127L));
    case TAPE_ATAN:
        return a == 0 && b == 0 ? 0 : atan2l(a == 0 ? 0 : a, b);
    case TAPE_PLACE_FRACT:
        a += cells_part(at, (const karst_cells *)(tape->data + i->word), pass);
        return a - floorl(a);
    case TAPE_PLACE_MOD:
        return mod_real(cells_part(at, (const karst_cells *)(tape->data + i->word), pass) * b + a, b);
    case TAPE_SIN_TURNS:
        return sinl(2 * 3.14159265358979323846264L *
                    (lattice_part(at, (const karst_lattice *)(tape->data + i->word), pass) + a));
    case TAPE_COS_TURNS:
        return cosl(2 * 3.14159265358979323846264L *
                    (lattice_part(at, (const karst_lattice *)(tape->data + i->word), pass) + a));
    case TAPE_SELECT:
        return condition ? b : c;
    case TAPE_NOISE: { /* floats know it to NOISE_VALUE_ERROR, which bounds allow for */
        wide offset[3];
        for (int k = 0; k < 3; k++) {
            offset[k].hi = (float)x[k];
            offset[k].lo =
                i->arg[k] != TAPE_NOTHING && (i->arg[k] & TAPE_PAIR) ? (float)(x[k] - (real)offset[k].hi) : 0.0f;
        }
        return (real)tape_noise(tape, i, at, level, offset);
    }
    default:
        return (real)as_float;
    }
}

static inline bool compare_reals(uint8_t op, real a, real b)
{
    return op == TAPE_LESS ? a < b : op == TAPE_LESS_EQUAL ? a <= b : op == TAPE_EQUAL ? a == b : a != b;
}

static inline void run_real(const tape_program *tape, const karst_instruction *i, const affine_position *at, int level,
                            real_slot *slots)
{
    real_slot result;
    float as_float = k_as_float((uint)tape_load(tape, i->slot)); /* floats have run before */
    bool is_float = i->op == TAPE_NOISE || i->type == TAPE_FLOAT_TYPE;
    bool is_stepped = !is_float || ((i->flags & TAPE_IS_STEPS) && i->op != TAPE_PLACE_FLOOR);
    bool compares = i->op >= TAPE_LESS && i->op <= TAPE_NOT_EQUAL && i->argument_type == TAPE_FLOAT_TYPE;
    for (int pass = 0; pass < NUM_PASSES; pass++) {
        real x[4];
        int bits[4];
        for (int k = 0; k < 4; k++) {
            uint operand = i->arg[k];
            real_slot nothing = {{0}, {0}};
            const real_slot *slot =
                operand == TAPE_NOTHING || tape_is_known(operand) ? &nothing : &slots[operand & TAPE_INDEX];
            x[k] = slot->value[pass];
            bits[k] = slot->bits[pass];
            if (operand == TAPE_NOTHING || !tape_is_known(operand))
                continue;
            bits[k] = tape_known(tape, operand);
            x[k] = (real)k_as_float((uint)bits[k]) + (real)tape_known_rest(tape, operand);
        }
        int exact = compares     ? -(int)compare_reals(i->op, x[0], x[1])
                    : is_stepped ? tape_plain_op(i, bits[0], bits[1], bits[2], bits[3])
                                 : 0;
        if (i->op == TAPE_FLOOR || i->op == TAPE_CEIL || i->op == TAPE_RINT)
            as_float = (float)(i->op == TAPE_FLOOR ? floorl(x[0]) : i->op == TAPE_CEIL ? ceill(x[0]) : rintl(x[0]));
        else if (is_stepped && is_float)
            as_float = k_as_float((uint)exact);
        if (i->op == TAPE_PLACE_CELL)
            exact = cell_of_place(tape, i, at, x[0]);
        real value = real_op(tape, i, at, level, x, bits[0], as_float, pass);
        result.value[pass] = !is_float ? 0 : shaken(value, pass, (i->flags & TAPE_IS_STEPS) ? 0x1p23L : 0x1p45L);
        result.bits[pass] = is_float ? (int)k_as_uint((float)result.value[pass]) : exact;
    }
    slots[i->slot] = result;
}

#endif
