/* The ops of a graph, each in one line. A new one goes here, to the functions that do it (lanes in ops/, bounds in
 * bounds/, the host's double in oracle/, text in emit/), and, if no op of the tape does it, to tape_shared.h. */
#ifndef KARST_LANGUAGE_OP_TABLE_H
#define KARST_LANGUAGE_OP_TABLE_H

/* Enumerator, name, how many arguments it takes at least and at most, what goes in and comes out (below), the op of the
 * tape that does it (NO_OP: none). a, b, c, d are the arguments. "float" means: rounded to nearest, as the device does
 * it. Comments, before the line, give the value. */
#define KARST_OPS(X)                                                                                               \
    X(NONE, "none", 0, 0, OTHER, NO_OP)                                                                            \
    /* leaves */                                                                                                   \
    /* constants[extra]; any type */                                                                               \
    X(CONSTANT, "constant", 0, 0, OTHER, NO_OP)                                                                    \
    /* header parameter number `extra`, float, uniform */                                                          \
    X(PARAMETER, "parameter", 0, 0, FLOAT, NO_OP)                                                                  \
    /* p along axis `extra`, metres; only before kinds.c */                                                        \
    X(POSITION, "position", 0, 0, FLOAT, NO_OP)                                                                    \
    /* n along axis `extra`: an input of colour */                                                                 \
    X(NORMAL, "normal", 0, 0, FLOAT, NORMAL)                                                                       \
    /* metres: the voxel of the level asked for, 0 for all detail; an input of colour. A voxel of level 0 is       \
     * 2^(extra - KARST_FOOTPRINT_BIAS) metres wide */                                                             \
    X(FOOTPRINT, "footprint", 0, 0, FLOAT, FOOTPRINT)                                                              \
    /* affines[extra]; only after kinds.c */                                                                       \
    X(AFFINE, "affine", 0, 0, FLOAT, AFFINE)                                                                       \
    /* float arithmetic */                                                                                         \
    X(ADD, "add", 2, 2, FLOAT, ADD)                                                                                \
    X(SUBTRACT, "subtract", 2, 2, FLOAT, SUBTRACT)                                                                 \
    X(MULTIPLY, "multiply", 2, 2, FLOAT, MULTIPLY)                                                                 \
    X(DIVIDE, "divide", 2, 2, FLOAT, DIVIDE)                                                                       \
    /* a * b + c, rounded once; at least one of a, b is uniform unless the text says fma, dot, or mix */           \
    X(FMA, "fma", 3, 3, FLOAT, FMA)                                                                                \
    X(NEGATE, "negate", 1, 1, FLOAT, NEGATE)                                                                       \
    /* b < a ? b : a */                                                                                            \
    X(MIN, "min", 2, 2, FLOAT, MIN)                                                                                \
    /* b > a ? b : a */                                                                                            \
    X(MAX, "max", 2, 2, FLOAT, MAX)                                                                                \
    X(ABS, "abs", 1, 1, FLOAT, ABS)                                                                                \
    X(FLOOR, "floor", 1, 1, FLOAT, FLOOR)                                                                          \
    X(CEIL, "ceil", 1, 1, FLOAT, CEIL)                                                                             \
    /* round half to even */                                                                                       \
    X(RINT, "rint", 1, 1, FLOAT, RINT)                                                                             \
    /* min(a - floor(a), 1 - 2^-24) */                                                                             \
    X(FRACT, "fract", 1, 1, FLOAT, FRACT)                                                                          \
    /* fma(-b, floor(a / b), a); 0 if b == 0 */                                                                    \
    X(MOD, "mod", 2, 2, FLOAT, MOD)                                                                                \
    /* fma(c, b, fma(-c, a, a)); of pairs a + c (b - a) */                                                         \
    X(MIX, "mix", 3, 3, FLOAT, MIX)                                                                                \
    /* 0 if a < 0 */                                                                                               \
    X(SQRT, "sqrt", 1, 1, FLOAT, SQRT)                                                                             \
    /* sqrt(a*a, then fma(b,b,.), fma(c,c,.), fma(d,d,.)); 2 to 4 arguments */                                     \
    X(LENGTH, "length", 2, 4, FLOAT, LENGTH)                                                                       \
    /* and cos: of radians, any float */                                                                           \
    X(SIN, "sin", 1, 1, FLOAT, SIN)                                                                                \
    X(COS, "cos", 1, 1, FLOAT, COS)                                                                                \
    /* sin(2 pi a), and cos; a is AFFINE or SHIFTED; only after kinds.c */                                         \
    X(SIN_TURNS, "sin_turns", 1, 1, FLOAT, SIN_TURNS)                                                              \
    X(COS_TURNS, "cos_turns", 1, 1, FLOAT, COS_TURNS)                                                              \
    /* clamped to [2^-126, 2^126] */                                                                               \
    X(EXP2, "exp2", 1, 1, FLOAT, EXP2)                                                                             \
    /* natural; log(2^-126) below 2^-126 */                                                                        \
    X(LOG, "log", 1, 1, FLOAT, LOG)                                                                                \
    /* angle of (b, a), that is atan2(a, b); 0 for (0, 0) */                                                       \
    X(ATAN, "atan", 2, 2, FLOAT, ATAN)                                                                             \
    /* noises[extra] at (a, b, c) */                                                                               \
    X(NOISE, "noise", 3, 3, FLOAT, NOISE)                                                                          \
    /* a is AFFINE, b any float: a + b, with the lattice coordinate of a kept; only after kinds.c */               \
    X(SHIFTED, "shifted", 2, 2, FLOAT, ADD)                                                                        \
    /* comparisons: bool; the arguments are both float, int, uint or bool */                                       \
    X(LESS, "less", 2, 2, COMPARISON, LESS)                                                                        \
    X(LESS_EQUAL, "less_equal", 2, 2, COMPARISON, LESS_EQUAL)                                                      \
    X(EQUAL, "equal", 2, 2, COMPARISON, EQUAL)                                                                     \
    X(NOT_EQUAL, "not_equal", 2, 2, COMPARISON, NOT_EQUAL)                                                         \
    /* bools */                                                                                                    \
    X(NOT, "not", 1, 1, BOOL, NOT)                                                                                 \
    X(AND, "and", 2, 2, BOOL, AND)                                                                                 \
    X(OR, "or", 2, 2, BOOL, OR)                                                                                    \
    /* a (bool) ? b : c; any type */                                                                               \
    X(SELECT, "select", 3, 3, OTHER, SELECT)                                                                       \
    /* integers: wrap; type INT or UINT says which division, shift and comparison */                               \
    X(INT_ADD, "int_add", 2, 2, INT, INT_ADD)                                                                      \
    X(INT_SUBTRACT, "int_subtract", 2, 2, INT, INT_SUBTRACT)                                                       \
    X(INT_MULTIPLY, "int_multiply", 2, 2, INT, INT_MULTIPLY)                                                       \
    X(INT_DIVIDE, "int_divide", 2, 2, INT, INT_DIVIDE)                                                             \
    /* 0 if b == 0; INT_MIN / -1 = INT_MIN, INT_MIN % -1 = 0 */                                                    \
    X(INT_MODULO, "int_modulo", 2, 2, INT, INT_MODULO)                                                             \
    X(BIT_AND, "bit_and", 2, 2, INT, BIT_AND)                                                                      \
    X(BIT_OR, "bit_or", 2, 2, INT, BIT_OR)                                                                         \
    X(BIT_XOR, "bit_xor", 2, 2, INT, BIT_XOR)                                                                      \
    X(BIT_NOT, "bit_not", 1, 1, INT, BIT_NOT)                                                                      \
    X(SHIFT_LEFT, "shift_left", 2, 2, INT, SHIFT_LEFT)                                                             \
    /* count & 31; right: arithmetic for INT */                                                                    \
    X(SHIFT_RIGHT, "shift_right", 2, 2, INT, SHIFT_RIGHT)                                                          \
    /* to `type`: float to int saturates, NaN is 0; int to uint and back keeps the bits; bool gives 0 or 1 */      \
    X(CONVERT, "convert", 1, 1, OTHER, CONVERT)                                                                    \
    /* reinterprets float as int or uint, or back */                                                               \
    X(BITS, "bits", 1, 1, OTHER, BITS)                                                                             \
    /* int: the whole number below a, which is AFFINE or SHIFTED, or (extra 1) the next towards 0, of 64 bits; its \
     * rest by b, a constant above 0, or its low 32 bits where there is none; only after kinds.c */                \
    X(CELL, "cell", 1, 2, OTHER, NO_OP)

/* What types an op has. */
typedef enum {
    KARST_OP_CLASS_FLOAT,      /* floats give a float */
    KARST_OP_CLASS_COMPARISON, /* two of one type give a bool */
    KARST_OP_CLASS_BOOL,       /* bools give a bool */
    KARST_OP_CLASS_INT,        /* ints give an int, uints a uint */
    KARST_OP_CLASS_OTHER       /* as karst_graph_check has it */
} karst_op_class;

/* In a switch over karst_op without a default: cases for all ops of a class. What has no case, its own or one of these,
 * fails to compile (-Werror=switch), so that no room is left without a rule for a new op. Those of class OTHER are each
 * named. */
#define KARST_OP_CASES_OF_FLOATS KARST_OPS(KARST_OP_FLOAT_CASE_)
#define KARST_OP_CASES_OF_COMPARISONS KARST_OPS(KARST_OP_COMPARISON_CASE_)
#define KARST_OP_CASES_OF_INTS KARST_OPS(KARST_OP_INT_CASE_) /* and bools */
#define KARST_OP_FLOAT_CASE_(id, name, least, most, class, tape) KARST_OP_##class##_FLOAT_(id)
#define KARST_OP_COMPARISON_CASE_(id, name, least, most, class, tape) KARST_OP_##class##_COMPARISON_(id)
#define KARST_OP_INT_CASE_(id, name, least, most, class, tape) KARST_OP_##class##_INT_(id)
#define KARST_OP_FLOAT_FLOAT_(id) case KARST_OP_##id:
#define KARST_OP_COMPARISON_FLOAT_(id)
#define KARST_OP_BOOL_FLOAT_(id)
#define KARST_OP_INT_FLOAT_(id)
#define KARST_OP_OTHER_FLOAT_(id)
#define KARST_OP_FLOAT_COMPARISON_(id)
#define KARST_OP_COMPARISON_COMPARISON_(id) case KARST_OP_##id:
#define KARST_OP_BOOL_COMPARISON_(id)
#define KARST_OP_INT_COMPARISON_(id)
#define KARST_OP_OTHER_COMPARISON_(id)
#define KARST_OP_FLOAT_INT_(id)
#define KARST_OP_COMPARISON_INT_(id)
#define KARST_OP_BOOL_INT_(id) case KARST_OP_##id:
#define KARST_OP_INT_INT_(id) case KARST_OP_##id:
#define KARST_OP_OTHER_INT_(id)

#define KARST_OP_ENUMERATOR_(id, ...) KARST_OP_##id,
typedef enum { KARST_OPS(KARST_OP_ENUMERATOR_) KARST_NUM_OPS } karst_op;

#endif
