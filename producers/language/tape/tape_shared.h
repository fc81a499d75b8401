/* The tape: a world's graph as a list of instructions that one interpreter executes, whatever the world. Compiled
 * twice: see core/device/dialect.h.
 *
 * Operands are slots (values of earlier instructions; the builder reuses those that nobody reads again), constants of
 * the tape, or values in the world's data (data.h), which parameters decide: a change of these leaves the tape as it
 * is.
 */
#ifndef KARST_LANGUAGE_TAPE_SHARED_H
#define KARST_LANGUAGE_TAPE_SHARED_H

#include "core/device/dialect.h"

/* The ops of graph.h that a tape may hold; arguments as there. */
typedef enum {
    TAPE_AFFINE, /* its float */
    TAPE_NORMAL,    /* number `count` of how the surface faces (core/base/facing_shared.h) */
    TAPE_FOOTPRINT, /* of the level asked for, in metres; a voxel of level 0 is 2^(int)count of them wide */
    TAPE_ADD,
    TAPE_SUBTRACT,
    TAPE_MULTIPLY,
    TAPE_DIVIDE,
    TAPE_FMA,
    TAPE_NEGATE,
    TAPE_MIN,
    TAPE_MAX,
    TAPE_ABS,
    TAPE_FLOOR,
    TAPE_CEIL,
    TAPE_RINT,
    TAPE_FRACT,
    TAPE_MOD,
    TAPE_MIX,
    TAPE_SQRT,
    TAPE_LENGTH, /* of `count` arguments */
    TAPE_SIN,
    TAPE_COS,
    TAPE_EXP2,
    TAPE_LOG,
    TAPE_ATAN,
    TAPE_PLACE_FLOOR,
    TAPE_PLACE_FRACT,
    TAPE_PLACE_MOD, /* of the exact place at `word`; a: the offset, b: MOD's divisor */
    TAPE_SIN_TURNS,
    TAPE_COS_TURNS, /* of the lattice at `word`; a: the offset */
    TAPE_NOISE, /* `count` octaves at `word`; a, b, c: the arguments' float parts; base and shape in `argument_type` and
                   `type`, its derivative in `flags` */
    TAPE_LESS,
    TAPE_LESS_EQUAL,
    TAPE_EQUAL,
    TAPE_NOT_EQUAL,
    TAPE_NOT,
    TAPE_AND,
    TAPE_OR,
    TAPE_SELECT,
    TAPE_INT_ADD,
    TAPE_INT_SUBTRACT,
    TAPE_INT_MULTIPLY,
    TAPE_INT_DIVIDE,
    TAPE_INT_MODULO,
    TAPE_BIT_AND,
    TAPE_BIT_OR,
    TAPE_BIT_XOR,
    TAPE_BIT_NOT,
    TAPE_SHIFT_LEFT,
    TAPE_SHIFT_RIGHT,
    TAPE_CONVERT,
    TAPE_BITS,
    TAPE_PLACE_CELL, /* of the exact place at `word`; a: the offset, b: the modulus; `count`: towards 0 */
    TAPE_CURVE, /* head of a curve, see below */
    TAPE_NUM_OPS
} tape_code;

/* In a switch by TAPE_SWITCH each op has a case, or the host's compiler fails (-Werror=switch): TAPE_OTHERS is its
 * default, and names the ops that it is for; TAPE_NOT_HERE names those that never come. Compilers of devices see a
 * plain switch with a default. TAPE_NO_OTHER stands behind such a switch that returns. */
#ifdef __OPENCL_VERSION__
#define TAPE_SWITCH(op) switch (op)
#define TAPE_OTHERS(cases) default
#define TAPE_NOT_HERE(cases)
#define TAPE_NO_OTHER(value)
#else
#define TAPE_SWITCH(op) switch ((tape_code)(op))
#define TAPE_OTHERS(cases) cases
#define TAPE_NOT_HERE(cases) \
    cases:                   \
    break;
#define TAPE_NO_OTHER(value) return value; /* not reached */
#endif
/* clang-format off */
#define TAPE_CASES_OF_FLOATS \
    case TAPE_ADD: case TAPE_SUBTRACT: case TAPE_MULTIPLY: case TAPE_DIVIDE: case TAPE_FMA: case TAPE_NEGATE: \
    case TAPE_MIN: case TAPE_MAX: case TAPE_ABS: case TAPE_FLOOR: case TAPE_CEIL: case TAPE_RINT: case TAPE_FRACT: \
    case TAPE_MOD: case TAPE_MIX: case TAPE_SQRT: case TAPE_LENGTH: case TAPE_SIN: case TAPE_COS: case TAPE_EXP2: \
    case TAPE_LOG: case TAPE_ATAN
#define TAPE_CASES_OF_ALL_TYPES \
    case TAPE_LESS: case TAPE_LESS_EQUAL: case TAPE_EQUAL: case TAPE_NOT_EQUAL: case TAPE_SELECT: case TAPE_CONVERT: \
    case TAPE_BITS
#define TAPE_CASES_OF_INTS \
    case TAPE_NOT: case TAPE_AND: case TAPE_OR: case TAPE_INT_ADD: case TAPE_INT_SUBTRACT: case TAPE_INT_MULTIPLY: \
    case TAPE_INT_DIVIDE: case TAPE_INT_MODULO: case TAPE_BIT_AND: case TAPE_BIT_OR: case TAPE_BIT_XOR: \
    case TAPE_BIT_NOT: case TAPE_SHIFT_LEFT: case TAPE_SHIFT_RIGHT
#define TAPE_CASES_OF_INPUTS /* which read more than their arguments */ \
    case TAPE_AFFINE: case TAPE_NORMAL: case TAPE_FOOTPRINT: case TAPE_PLACE_FLOOR: case TAPE_PLACE_FRACT: \
    case TAPE_PLACE_MOD: case TAPE_SIN_TURNS: case TAPE_COS_TURNS: case TAPE_NOISE: case TAPE_PLACE_CELL: \
    case TAPE_CURVE: case TAPE_NUM_OPS
/* clang-format on */

/* The ops that a tape runs, so that interpreters are compiled for no others: a whole one takes seconds. Bit sets, as
 * options of a build; without them, all. Ops that are TAPE_IS_WIDE stand in the second pair of sets alone. */
#ifndef TAPE_OPS_LOW
#define TAPE_OPS_LOW 0xffffffffu
#define TAPE_OPS_HIGH 0xffffffffu
#define TAPE_WIDE_LOW 0xffffffffu
#define TAPE_WIDE_HIGH 0xffffffffu
#define TAPE_HAS_STEPS 1
#define TAPE_HAS_CURVES 1
#define TAPE_HAS_SMOOTH 1
#endif
#ifndef TAPE_HAS_SMOOTH
#define TAPE_HAS_SMOOTH 0
#endif
#define TAPE_IS_IN(low, high, op) ((((op) < 32 ? (low) >> ((op)&31) : (high) >> ((op)&31)) & 1u) != 0u)
#define TAPE_RUNS(op) TAPE_IS_IN(TAPE_OPS_LOW, TAPE_OPS_HIGH, op)
#define TAPE_RUNS_WIDE(op) TAPE_IS_IN(TAPE_WIDE_LOW, TAPE_WIDE_HIGH, op)
#define TAPE_HAS_WIDE ((TAPE_WIDE_LOW | TAPE_WIDE_HIGH) != 0u)
#define TAPE_HAS_DISCRETE ((TAPE_OPS_LOW >> TAPE_LESS | TAPE_OPS_HIGH) != 0u) /* ints, bools, choices by them */
#define TAPE_COMPARES_WIDE                                                                      \
    (TAPE_RUNS_WIDE(TAPE_LESS) | TAPE_RUNS_WIDE(TAPE_LESS_EQUAL) | TAPE_RUNS_WIDE(TAPE_EQUAL) | \
     TAPE_RUNS_WIDE(TAPE_NOT_EQUAL))

/* In a case of an interpreter's switch: what no tape of its runs is no code. */
#define TAPE_NEEDS(op)  \
    if (!TAPE_RUNS(op)) \
    break
#define TAPE_NEEDS_WIDE(op)  \
    if (!TAPE_RUNS_WIDE(op)) \
    break

/* karst_scalar_type */
#define TAPE_FLOAT_TYPE 0
#define TAPE_INT_TYPE 1
#define TAPE_UINT_TYPE 2
#define TAPE_BOOL_TYPE 3

/* Operands */
#define TAPE_NOTHING 0xffffffffu
#define TAPE_CONSTANT 0x80000000u /* | index of a constant of the tape */
#define TAPE_VALUE 0x40000000u    /* | index of a value in the world's data */
#define TAPE_PAIR 0x20000000u     /* | any: what the float leaves is there, too (wide.clh) */
#define TAPE_INDEX 0x1fffffffu

/* A step of a shortened tape: index of an instruction, and, if it is decided, number of the argument that it gives,
 * from 1 on. */
#define TAPE_STEP_INDEX 0x0fffffffu
#define TAPE_STEP_SIDE 28

#define TAPE_IS_STEPS 1u    /* piecewise constant: arguments that are one number make it one number */
#define TAPE_IS_WIDE 2u     /* computed in pairs */
#define TAPE_IS_FADE 4u     /* a product t * t * (3 - 2 * t); argument c is t, for bounds */
#define TAPE_IS_CURVE 8u    /* bounds come from the curve before it */
#define TAPE_IS_SMOOTH 16u  /* not of noises: bounds come from two numbers whose smooth minimum it is, see below */
#define TAPE_IN_CURVE 64u   /* of a curve: nothing else runs it */
#define TAPE_IS_PASSED 128u /* bounds pass over it: only curves that have their own copy read it */
#define TAPE_DERIVATIVE 4   /* bits from here on: of a noise, 0 or 1 to 3 as in karst_noise */

/* A curve: the ops by which one number f, the source, decides another, bounded as one function of f (tape_curve.clh).
 * `count` instructions that read the source in the slot of their head, then the head (TAPE_CURVE), then the instruction
 * that gives the same to everybody else. The head's arguments: a, the source, or what moves its place; b, the result;
 * c, the divisor of a place. Its `word`: karst_cells of that place, or TAPE_NOTHING. */

/* A smooth minimum (interval_smooth.clh) of the operands arg[3] and `word`: constants[count] is k, and the next one its
 * order and what is negated. */
#define TAPE_SMOOTH_ORDER 3u
#define TAPE_SMOOTH_OF_NEGATED 4u
#define TAPE_SMOOTH_IS_NEGATED 8u

typedef struct {
    uchar op;
    uchar type;          /* of the result */
    uchar argument_type; /* of argument a */
    uchar flags;
    uint slot; /* of the result */
    uint arg[4];
    uint word; /* of its record in the world's data */
    uint count;
} karst_instruction;
K_ASSERT_SIZE(karst_instruction, 32);

#endif
