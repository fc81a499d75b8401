#include "producers/density/host_tape_places.h"

/* ---- noise ---- */

#define ADD_OCTAVE(base, shape, derivative)                                                         \
    FOR_EACH                                                                                        \
    {                                                                                               \
        noise_position p = {{coordinate_at(b, 0, i), coordinate_at(b, 1, i), coordinate_at(b, 2, i)}}; \
        sum[i] = octave_add(base, shape, derivative, &p, weight, sum[i]);                           \
    }                                                                                               \
    break
#define ADD_SHAPES(base)                        \
    switch (shape) {                            \
    case OCTAVE_RIDGED:                         \
        ADD_OCTAVE(base, OCTAVE_RIDGED, 0);     \
    case OCTAVE_BILLOW:                         \
        ADD_OCTAVE(base, OCTAVE_BILLOW, 0);     \
    case OCTAVE_TURBULENCE:                     \
        ADD_OCTAVE(base, OCTAVE_TURBULENCE, 0); \
    default:                                    \
        ADD_OCTAVE(base, OCTAVE_SUM, 0);        \
    }                                           \
    break

/* Octaves at coordinates; the bases that are straight lines of code become vectors. */
K_INLINE void add_octave(const block *b, uint n, int base, int shape, int derivative, const octave_weight *weight,
                         float *sum)
{
    switch (derivative ? -1 : base) {
    case OCTAVE_GRADIENT:
        ADD_SHAPES(OCTAVE_GRADIENT);
    case OCTAVE_LEVEL:
        ADD_SHAPES(OCTAVE_LEVEL);
    case OCTAVE_VALUE:
        ADD_SHAPES(OCTAVE_VALUE);
    default:
        ADD_OCTAVE(base, shape, derivative);
    }
}

K_INLINE void add_noise(block *b, uint n, const karst_instruction *in, int *to)
{
    const karst_octave *octaves = (const karst_octave *)(b->tape->data + in->word);
    float sum[MOST_SAMPLES];
    FOR_EACH sum[i] = 0.0f;
    for (uint k = 0; k < in->count; k++) {
        octave_weight weight = octave_weight_at(octaves + k, b->level);
        for (int j = 0; j < 3 && (weight.weight != 0.0f || weight.image); j++) {
            place_coordinates(b, n, &octaves[k].lattice[j], j);
            if (in->arg[j] == TAPE_NOTHING)
                continue;
            operand offset = find_pair(b, n, in->arg[j], j);
            const float scale = octaves[k].scale;
            if (in->arg[j] & TAPE_PAIR)
                FOR_EACH set_coordinate(b, j, i, wide_move(coordinate_at(b, j, i), pair_at(offset, i), scale));
            else
                FOR_EACH set_coordinate(
                    b, j, i, noise_coordinate_move(coordinate_at(b, j, i), v_as_float(offset.hi[i]) * scale));
        }
        add_octave(b, n, in->argument_type, in->type, in->flags >> TAPE_DERIVATIVE, &weight, sum);
    }
    FOR_EACH to[i] = v_as_int(sum[i]);
}

/* ---- instructions ---- */

/* An op known to the compiler, so that nothing of the interpreter's choice is left in its loop. */
#define RUN(op, type, from, count) FOR_EACH to[i] = tape_op(op, type, from, count, x[i], y[i], z[i], w[i])
#define OF_FLOATS(op)                                    \
    case op:                                             \
        RUN(op, TAPE_FLOAT_TYPE, TAPE_FLOAT_TYPE, 1u);   \
        return
#define OF_INTS(op)                                    \
    case op:                                           \
        if (in->type == TAPE_UINT_TYPE)                \
            RUN(op, TAPE_UINT_TYPE, TAPE_UINT_TYPE, 1u); \
        else                                           \
            RUN(op, TAPE_INT_TYPE, TAPE_INT_TYPE, 1u);   \
        return
#define OF_ANY(op)                                            \
    case op:                                                  \
        if (in->argument_type == TAPE_FLOAT_TYPE)             \
            RUN(op, TAPE_BOOL_TYPE, TAPE_FLOAT_TYPE, 1u);     \
        else if (in->argument_type == TAPE_UINT_TYPE)         \
            RUN(op, TAPE_BOOL_TYPE, TAPE_UINT_TYPE, 1u);      \
        else if (in->argument_type == TAPE_BOOL_TYPE)         \
            RUN(op, TAPE_BOOL_TYPE, TAPE_BOOL_TYPE, 1u);      \
        else                                                  \
            RUN(op, TAPE_BOOL_TYPE, TAPE_INT_TYPE, 1u);       \
        return
#define CONVERT(to_type, from_type)                     \
    case (to_type)*4 + (from_type):                     \
        RUN(TAPE_CONVERT, to_type, from_type, 1u);      \
        return
#define CONVERT_TO(to_type)                   \
    CONVERT(to_type, TAPE_FLOAT_TYPE);        \
    CONVERT(to_type, TAPE_INT_TYPE);          \
    CONVERT(to_type, TAPE_UINT_TYPE);         \
    CONVERT(to_type, TAPE_BOOL_TYPE)

K_INLINE void convert(uint n, const karst_instruction *in, const int *x, int *to)
{
    const int *y = x, *z = x, *w = x;
    switch (in->type * 4 + in->argument_type) {
        CONVERT_TO(TAPE_FLOAT_TYPE);
        CONVERT_TO(TAPE_INT_TYPE);
        CONVERT_TO(TAPE_UINT_TYPE);
        CONVERT_TO(TAPE_BOOL_TYPE);
    default:
        return;
    }
}

K_INLINE void run_plain(uint n, const karst_instruction *in, const int *x, const int *y, const int *z, const int *w,
                        int *to)
{
    switch (in->op) {
        OF_FLOATS(TAPE_ADD);
        OF_FLOATS(TAPE_SUBTRACT);
        OF_FLOATS(TAPE_MULTIPLY);
        OF_FLOATS(TAPE_DIVIDE);
        OF_FLOATS(TAPE_FMA);
        OF_FLOATS(TAPE_NEGATE);
        OF_FLOATS(TAPE_MIN);
        OF_FLOATS(TAPE_MAX);
        OF_FLOATS(TAPE_ABS);
        OF_FLOATS(TAPE_FLOOR);
        OF_FLOATS(TAPE_CEIL);
        OF_FLOATS(TAPE_RINT);
        OF_FLOATS(TAPE_FRACT);
        OF_FLOATS(TAPE_MOD);
        OF_FLOATS(TAPE_MIX);
        OF_FLOATS(TAPE_SQRT);
        OF_FLOATS(TAPE_SIN);
        OF_FLOATS(TAPE_COS);
        OF_FLOATS(TAPE_EXP2);
        OF_FLOATS(TAPE_LOG);
        OF_FLOATS(TAPE_ATAN);
        OF_FLOATS(TAPE_SELECT);
        OF_ANY(TAPE_LESS);
        OF_ANY(TAPE_LESS_EQUAL);
        OF_ANY(TAPE_EQUAL);
        OF_ANY(TAPE_NOT_EQUAL);
        OF_ANY(TAPE_BITS);
        OF_INTS(TAPE_NOT);
        OF_INTS(TAPE_AND);
        OF_INTS(TAPE_OR);
        OF_INTS(TAPE_INT_ADD);
        OF_INTS(TAPE_INT_SUBTRACT);
        OF_INTS(TAPE_INT_MULTIPLY);
        OF_INTS(TAPE_INT_DIVIDE);
        OF_INTS(TAPE_INT_MODULO);
        OF_INTS(TAPE_BIT_AND);
        OF_INTS(TAPE_BIT_OR);
        OF_INTS(TAPE_BIT_XOR);
        OF_INTS(TAPE_BIT_NOT);
        OF_INTS(TAPE_SHIFT_LEFT);
        OF_INTS(TAPE_SHIFT_RIGHT);
    case TAPE_LENGTH:
        if (in->count == 2)
            RUN(TAPE_LENGTH, TAPE_FLOAT_TYPE, TAPE_FLOAT_TYPE, 2u);
        else if (in->count == 3)
            RUN(TAPE_LENGTH, TAPE_FLOAT_TYPE, TAPE_FLOAT_TYPE, 3u);
        else
            RUN(TAPE_LENGTH, TAPE_FLOAT_TYPE, TAPE_FLOAT_TYPE, 4u);
        return;
    case TAPE_CONVERT:
        convert(n, in, x, to);
        return;
    default: /* as there */
        FOR_EACH to[i] = tape_op(in->op, in->type, in->argument_type, in->count, x[i], y[i], z[i], w[i]);
        return;
    }
}

#define STORE_PAIR(value)              \
    do {                               \
        FOR_EACH                       \
        {                              \
            wide r_ = value;           \
            to[i] = v_as_int(r_.hi);   \
            rest[i] = v_as_int(r_.lo); \
        }                              \
        return;                        \
    } while (0)
#define OF_PAIRS(name)   \
    case name:           \
        known.op = name; \
        STORE_PAIR(tape_wide_op(b->tape, &known, 0, pair_at(x, i), pair_at(y, i), pair_at(z, i)))
#define NARROWING(name)  \
    case name:           \
        known.op = name; \
        FOR_EACH to[i] = tape_narrowing_op(&known, pair_at(x, i), pair_at(y, i)); \
        return

K_INLINE void run_wide(block *b, uint n, const karst_instruction *in, int *to)
{
    int *rest = slot_of(b, in->slot, 1);
    operand x = find_pair(b, n, in->arg[0], 0), y = find_pair(b, n, in->arg[1], 1), z = find_pair(b, n, in->arg[2], 2);
    karst_instruction known = *in;
    switch (in->op) {
        OF_PAIRS(TAPE_ADD);
        OF_PAIRS(TAPE_SUBTRACT);
        OF_PAIRS(TAPE_MULTIPLY);
        OF_PAIRS(TAPE_DIVIDE);
        OF_PAIRS(TAPE_FMA);
        OF_PAIRS(TAPE_NEGATE);
        OF_PAIRS(TAPE_MIN);
        OF_PAIRS(TAPE_MAX);
        OF_PAIRS(TAPE_ABS);
        OF_PAIRS(TAPE_MIX);
        OF_PAIRS(TAPE_SQRT);
        OF_PAIRS(TAPE_SELECT);
        NARROWING(TAPE_FLOOR);
        NARROWING(TAPE_FRACT);
        NARROWING(TAPE_MOD);
        NARROWING(TAPE_SIN);
        NARROWING(TAPE_COS);
        NARROWING(TAPE_LESS);
        NARROWING(TAPE_LESS_EQUAL);
        NARROWING(TAPE_EQUAL);
        NARROWING(TAPE_NOT_EQUAL);
    case TAPE_LENGTH:
        if (in->count == 2)
            STORE_PAIR(wide_length2(pair_at(x, i), pair_at(y, i)));
        if (in->count == 3)
            STORE_PAIR(wide_length3(pair_at(x, i), pair_at(y, i), pair_at(z, i)));
        operand w = find_pair(b, n, in->arg[3], 3);
        STORE_PAIR(wide_length4(pair_at(x, i), pair_at(y, i), pair_at(z, i), pair_at(w, i)));
    case TAPE_AFFINE:
        place_pairs(b, n, (const karst_linear *)(b->tape->data + in->word), to, rest);
        return;
    default:
        STORE_PAIR(pair_at(x, i));
    }
}

K_INLINE void run_turns(block *b, uint n, const karst_instruction *in, const int *offset, int *to)
{
    place_coordinates(b, n, (const karst_lattice *)(b->tape->data + in->word), 0);
    if (in->arg[0] != TAPE_NOTHING)
        FOR_EACH set_coordinate(b, 0, i, noise_coordinate_move(coordinate_at(b, 0, i), v_as_float(offset[i])));
    if (in->op == TAPE_SIN_TURNS)
        FOR_EACH to[i] = v_as_int(affine_sin_turns(coordinate_at(b, 0, i)));
    else
        FOR_EACH to[i] = v_as_int(affine_cos_turns(coordinate_at(b, 0, i)));
}

K_INLINE void run_instruction(block *b, uint n, const karst_instruction *in)
{
    int *to = slot_of(b, in->slot, 0);
    if (in->op == TAPE_NOISE) {
        add_noise(b, n, in, to);
        return;
    }
    if (in->flags & TAPE_IS_WIDE) {
        run_wide(b, n, in, to);
        return;
    }
    const int *x = find(b, n, in->arg[0], 0), *y = find(b, n, in->arg[1], 1);
    switch (in->op) {
    case TAPE_AFFINE:
        place_floats(b, n, (const karst_linear *)(b->tape->data + in->word), to);
        return;
    case TAPE_FOOTPRINT:
        fill(to, n, v_as_int(op_footprint(b->level, (int)in->count)));
        return;
    case TAPE_PLACE_FLOOR:
    case TAPE_PLACE_FRACT:
    case TAPE_PLACE_MOD:
        for (uint i = 0; i < n; i++) {
            affine_position at = POSITION;
            to[i] = v_as_int(tape_place_op(b->tape, in, &at, v_as_float(x[i]), v_as_float(y[i])));
        }
        return;
    case TAPE_PLACE_CELL:
        for (uint i = 0; i < n; i++) {
            affine_position at = POSITION;
            to[i] = tape_cell_op(b->tape, in, &at, v_as_float(x[i]));
        }
        return;
    case TAPE_SIN_TURNS:
    case TAPE_COS_TURNS:
        run_turns(b, n, in, x, to);
        return;
    default:
        run_plain(n, in, x, y, find(b, n, in->arg[2], 2), find(b, n, in->arg[3], 3), to);
        return;
    }
}

/* A choice that is decided. */
K_INLINE void run_side(block *b, uint n, const karst_instruction *in, uint side)
{
    const int *from = find(b, n, side == 5u ? in->word : in->arg[side - 1u], 0);
    int *to = slot_of(b, in->slot, 0);
    FOR_EACH to[i] = from[i];
}

/* `n` samples from number `first` on; those beyond the last are the last again. */
K_INLINE void place_block(block *b, uint n, uint first)
{
    for (uint i = 0; i < n; i++) {
        uint sample = first + i < KARST_BRICK_SAMPLES ? first + i : KARST_BRICK_SAMPLES - 1u;
        uint row = sample / KARST_BRICK_SIDE;
        b->index[0][i] = sample % KARST_BRICK_SIDE;
        b->index[1][i] = row % KARST_BRICK_SIDE;
        b->index[2][i] = row / KARST_BRICK_SIDE;
    }
}

K_INLINE void run_block(block *b, const uint *steps, uint count)
{
    const uint n = b->num & ~(LANE_GROUP - 1u);
    for (uint k = 0; k < count; k++) {
        uint step = steps ? steps[k] : k, side = steps ? step >> TAPE_STEP_SIDE : 0u;
        const karst_instruction *in = b->tape->code + (step & TAPE_STEP_INDEX);
        if (!steps && in->flags & TAPE_IN_CURVE)
            continue;
        if (side)
            run_side(b, n, in, side);
        else
            run_instruction(b, n, in);
    }
}

/* ---- widths ---- */

#if defined(__x86_64__) && defined(__GNUC__)
#define HAS_WIDTHS
#define AVX2_HAS "avx2,fma,bmi,bmi2"
#ifdef __clang__
#define AVX512_HAS AVX2_HAS ",avx512f,avx512dq,avx512vl,avx512bw"
#else
#define AVX512_HAS AVX2_HAS ",avx512f,avx512dq,avx512vl,avx512bw,prefer-vector-width=512"
#endif
#endif

/* All that it calls becomes part of it, and so is compiled for its width. With a sanitizer's checks in it compilers
 * take minutes for that; then what it calls stays as it is. */
#ifdef __has_feature
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define IS_SANITIZED
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || defined(IS_SANITIZED)
#define AS_ONE noinline
#else
#define AS_ONE noinline, flatten
#endif
#define RUN_BLOCK(name, attributes)                                                                             \
    static __attribute__((AS_ONE)) attributes void name(block *b, const uint *steps, uint count)                \
    {                                                                                                           \
        run_block(b, steps, count);                                                                             \
    }
RUN_BLOCK(run_block_plain, )
#ifdef HAS_WIDTHS
RUN_BLOCK(run_block_avx2, __attribute__((target(AVX2_HAS))))
RUN_BLOCK(run_block_avx512, __attribute__((target(AVX512_HAS))))
#endif

static void run_block_of(karst_host_width width, block *b, const uint *steps, uint count)
{
#ifdef HAS_WIDTHS
    if (width == KARST_HOST_AVX512)
        run_block_avx512(b, steps, count);
    else if (width == KARST_HOST_AVX2)
        run_block_avx2(b, steps, count);
    else
#endif
        run_block_plain(b, steps, count);
    (void)width;
}

bool karst_host_width_is_there(karst_host_width width)
{
#ifdef HAS_WIDTHS
    __builtin_cpu_init();
    bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                    __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
    if (width == KARST_HOST_AVX512)
        return has_avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
               __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw");
    return width == KARST_HOST_AVX2 ? has_avx2 : width == KARST_HOST_PLAIN;
#else
    return width == KARST_HOST_PLAIN;
#endif
}

karst_host_width karst_host_width_best(void)
{
    karst_host_width width = KARST_NUM_HOST_WIDTHS - 1;
    while (!karst_host_width_is_there(width))
        width--;
    return width;
}

/* `most`: samples that are wanted. */
static void init_block(block *b, const tape_program *tape, int level, uint most)
{
    uint num_slots = 1;
    b->tape = tape;
    b->level = level;
    for (uint k = 0; k < tape->num_instructions; k++)
        num_slots = tape->code[k].slot >= num_slots ? tape->code[k].slot + 1u : num_slots;
    b->num = CACHED_INTS / (num_slots * TAPE_VALUE_ELEMENTS) & ~(LANE_GROUP - 1u);
    b->num = b->num > MOST_SAMPLES ? MOST_SAMPLES : b->num < LEAST_SAMPLES ? LEAST_SAMPLES : b->num;
    most = (most + LANE_GROUP - 1u) & ~(LANE_GROUP - 1u);
    b->num = b->num > most ? most : b->num;
    memset(b->zeros, 0, sizeof b->zeros);
}

void karst_host_tape_samples(karst_host_width width, const tape_program *tape, const uint *steps, uint count,
                             uint output, const long origin[3], int level, float samples[KARST_BRICK_SAMPLES])
{
    block b;
    init_block(&b, tape, level, KARST_BRICK_SAMPLES);
    b.is_of_points = false;
    for (int axis = 0; axis < 3; axis++)
        b.origin[axis] = origin[axis];
    const uint n = b.num & ~(LANE_GROUP - 1u);
    for (uint first = 0; first < KARST_BRICK_SAMPLES; first += n) {
        place_block(&b, n, first);
        run_block_of(width, &b, steps, count);
        uint rest = KARST_BRICK_SAMPLES - first;
        memcpy(samples + first, find(&b, n, output, 0), (rest < n ? rest : n) * sizeof *samples);
    }
}

/* Those beyond the last of `num` are the last again. */
static void place_points(block *b, uint n, const karst_position *at, size_t num)
{
    long far = 0;
    for (uint i = 0; i < n; i++) {
        const karst_position *point = at + (i < num ? i : num - 1);
        for (int axis = 0; axis < 3; axis++) {
            const long voxel = point->voxel[axis];
            b->voxel[axis][i] = voxel;
            b->point_fraction[axis][i] = point->fraction[axis];
            far |= voxel ^ voxel >> 63;
        }
    }
    b->is_near = far >> 31 == 0;
}

void karst_host_tape_points(karst_host_width width, const tape_program *tape, const uint *outputs, uint num_outputs,
                            const karst_position *at, size_t num, int level, float *const *values)
{
    block b;
    if (num == 0)
        return;
    init_block(&b, tape, level, num < MOST_SAMPLES ? (uint)num : MOST_SAMPLES);
    b.is_of_points = true;
    const uint n = b.num & ~(LANE_GROUP - 1u);
    for (size_t first = 0; first < num; first += n) {
        const size_t rest = num - first < n ? num - first : n;
        place_points(&b, n, at + first, rest);
        run_block_of(width, &b, NULL, tape->num_instructions);
        for (uint k = 0; k < num_outputs; k++)
            memcpy(values[k] + first, find(&b, n, outputs[k], 0), rest * sizeof *values[k]);
    }
}
