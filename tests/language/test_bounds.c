/* Bounds of random graphs over random boxes hold, at every node, for the device's floats and for real numbers alike;
 * and would not without any one of their rules.
 *
 * KARST_BOUNDS_GRAPHS sets how many graphs (10000), KARST_SEED where they start. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

/* Every rule that can be broken. */
#define BOUNDS_RULES(X)                                                                                                \
    X(JUMP)                                                                                                            \
    X(ADD)                                                                                                             \
    X(NEGATE)                                                                                                          \
    X(MULTIPLY)                                                                                                        \
    X(SQUARE)                                                                                                          \
    X(SCALE)                                                                                                           \
    X(DIVIDE)                                                                                                          \
    X(DIVIDE_BY_ZERO)                                                                                                  \
    X(DECIDE)                                                                                                          \
    X(MIN)                                                                                                             \
    X(MAX)                                                                                                             \
    X(ABS)                                                                                                             \
    X(SELECT)                                                                                                          \
    X(FLOOR)                                                                                                           \
    X(CEIL)                                                                                                            \
    X(RINT)                                                                                                            \
    X(MOD)                                                                                                             \
    X(FRACT)                                                                                                           \
    X(MIX) X(SQRT) X(SQRT_OF_ZERO) X(LENGTH) X(EXTREMUM) X(SIN) X(EXP2) X(LOG) X(ATAN_CUT) X(ATAN) X(COMPARE)          \
        X(CENTRE) X(PLACE_FLOOR) X(PLACE_MOD) X(TURNS) X(NOISE_SLOPE) X(FADE) X(INTEGER) X(STICKY) X(WIDE_ERROR)       \
            X(WIDE_REBASE) X(WIDE_MULTIPLY) X(WIDE_SQRT) X(STICKY_NUMBERS) X(PLACE_ROUNDING) X(MOD_BY_ZERO)            \
                X(NOISE_DERIVATIVE) X(DOUBT_JUMP) X(DOUBT_ROUNDING) X(DOUBT_SLOPES) X(DOUBT_ADD) X(DOUBT_SCALE)        \
                    X(MIX_BEYOND) X(CURVE) X(DOUBT_EITHER) X(DOUBT_LATTICE) X(DOUBT_FADE) X(WORLEY_LIPSCHITZ)          \
                        X(WORLEY_NEIGHBOURS) X(TOO_FINE) X(SPLIT_WHERE) X(SPLIT_STEP) X(CURVE_SLOPE) X(CURVE_JUMPS)    \
                            X(CURVE_DOUBT) X(SPLIT_SLACK) X(PART) X(LENGTH_OVERFLOW) X(INT_ADD) X(INT_SUBTRACT)        \
                                X(INT_MULTIPLY) X(INT_DIVIDE) X(INT_MODULO) X(INT_AND) X(INT_OR) X(INT_XOR) X(INT_NOT) \
                                    X(INT_SHIFT) X(INT_LESS) X(INT_LESS_EQUAL) X(INT_EQUAL) X(EQUAL_BOOLS)             \
                                        X(INT_CHOOSE) X(CHOOSE_BOOLS) X(FLOAT_TO_INT) X(INT_SIGN) X(INT_TO_FLOAT)      \
                                            X(FLOAT_BITS) X(BITS_FLOAT) X(EQUAL) X(LESS_EQUAL) X(NOT) X(AND) X(OR)     \
                                                X(WIDE_NARROW) X(WIDE_DIVIDE) X(WIDE_MIN) X(WIDE_MAX) X(WIDE_ABS)      \
                                                    X(WIDE_SELECT) X(WIDE_CELL) X(WIDE_FLOOR) X(WIDE_TURNS) \
                                                        X(PLACE_CELL) X(PLACE_CELL_ORDER) X(CELL_TOWARDS_ZERO)        \
                                                            X(SMOOTH_VALUE) X(SMOOTH_SHARE) X(SMOOTH_DOUBT)            \
                                                                X(SMOOTH_EDGE)
#define NOISE_RULES(X) X(ROUNDING) X(MARGIN) X(ERROR) X(THIRD)
#define NAME_BOUNDS(rule) BREAK_BOUNDS_##rule,
#define NAME_NOISE(rule) BREAK_NOISE_##rule,
enum broken { BREAK_NOTHING, BOUNDS_RULES(NAME_BOUNDS) NOISE_RULES(NAME_NOISE) NUM_BROKEN };
static enum broken broken;
#define BOUNDS_MUTANT(rule) (broken == BREAK_BOUNDS_##rule)
#define NOISE_MUTANT(rule) (broken == BREAK_NOISE_##rule)
#define NOISE_MARGIN (broken == BREAK_NOISE_MARGIN ? 0x1p-24f : 0x1p-22f)

#include "producers/language/language.h"
#include "producers/language/tape/tape.clh"
#include "tests/language/built_ins.h"
#include "tests/language/random_graph.h"
#include "tests/language/real_tape.h"

enum { NUM_SAMPLES = 14 };

/* ---- one graph ---- */

typedef struct {
    random_place place;
    random_graph graph;
    karst_world_layout layout;
    karst_tape tape;
    uint64_t *data;
    int *value_slots[NUM_SAMPLES], *home_slots[NUM_SAMPLES], *bound_slots; /* home: at the box's own footprint */
    real_slot *real_slots[NUM_SAMPLES];
    affine_position sample[NUM_SAMPLES];
    real delta[NUM_SAMPLES][3]; /* from the centre, level-0 voxels */
    int level;
    op_box box;
} subject;

static void subject_finish(subject *s)
{
    for (int i = 0; i < NUM_SAMPLES; i++) {
        free(s->value_slots[i]);
        free(s->home_slots[i]);
        free(s->real_slots[i]);
    }
    free(s->bound_slots);
    free(s->data);
    karst_tape_finish(&s->tape);
    random_graph_finish(&s->graph);
}

/* Corners first, then points inside and on faces, the centre. */
static void place_samples(subject *s)
{
    for (int axis = 0; axis < 3; axis++) {
        s->box.centre.voxel[axis] = s->place.voxel[axis];
        s->box.centre.fraction[axis] = s->place.fraction[axis];
        s->box.radius[axis] = s->place.radius[axis];
    }
    for (int n = 0; n < NUM_SAMPLES; n++) {
        for (int axis = 0; axis < 3; axis++) {
            int64_t most = (int64_t)((double)s->place.radius[axis] * 0x1p32); /* rounds down */
            int64_t offset = n < 8    ? (n >> axis & 1 ? most : -most)
                             : n == 8 ? 0
                                      : (int64_t)((random_unit() * 2 - 1) * (double)most);
            if (n > 8 && random_chance(4))
                offset = random_chance(2) ? most : -most;
            uint64_t sum = (uint64_t)s->place.fraction[axis] + (uint32_t)offset;
            s->sample[n].voxel[axis] = s->place.voxel[axis] + (offset >> 32) + (int64_t)(sum >> 32);
            s->sample[n].fraction[axis] = (uint32_t)sum;
            s->delta[n][axis] = (real)offset * 0x1p-32L;
        }
    }
}

/* Teeth of a saw and what worlds make of them, of a source whose range is often about a tooth. */
static karst_expr random_curve(random_graph *r, karst_expr source)
{
    karst_graph *g = &r->graph;
    karst_expr one = karst_graph_float(g, 1), x = source;
    if (random_chance(2))
        x = karst_expr_2(g, KARST_OP_MULTIPLY, x, karst_graph_float(g, random_magnitude(0.02, 20)));
    double period = random_chance(2) ? 1 : random_magnitude(0.3, 5);
    karst_expr f = period < 1 || period > 1 ? karst_expr_2(g, KARST_OP_MOD, x, karst_graph_float(g, period))
                                            : karst_expr_1(g, KARST_OP_FRACT, x);
    karst_expr rest = karst_expr_2(g, KARST_OP_SUBTRACT, karst_graph_float(g, period), f),
               half = karst_graph_float(g, period / 2), square = karst_expr_2(g, KARST_OP_MULTIPLY, f, f);
    switch (random_below(10)) {
    case 0: /* terraces */
        f = karst_expr_3(g, KARST_OP_MIX, f, karst_expr_2(g, KARST_OP_MULTIPLY, square, f),
                         karst_graph_float(g, random_unit()));
        return karst_expr_2(g, KARST_OP_ADD, karst_expr_1(g, KARST_OP_FLOOR, x), f);
    case 1:
        return karst_expr_2(g, KARST_OP_MULTIPLY, square, rest);
    case 2:
        return karst_expr_2(g, KARST_OP_MIN, karst_expr_2(g, KARST_OP_MULTIPLY, f, karst_graph_float(g, 1.4)),
                            karst_expr_2(g, KARST_OP_MULTIPLY, rest, karst_graph_float(g, 3)));
    case 3:
        return karst_expr_1(g, KARST_OP_ABS, karst_expr_2(g, KARST_OP_SUBTRACT, f, half));
    case 4:
        return karst_expr_3(g, KARST_OP_SELECT, karst_expr_2(g, KARST_OP_LESS, f, half), f, rest);
    case 5: /* a staircase */
        return karst_expr_2(g, KARST_OP_ADD, karst_expr_1(g, KARST_OP_FLOOR, x),
                            karst_expr_2(g, KARST_OP_MULTIPLY, f, karst_graph_float(g, random_unit() - 0.5)));
    case 6: /* two saws at once */
    case 7:
        x = karst_expr_2(g, KARST_OP_ADD, x, karst_graph_float(g, random_unit()));
        return karst_expr_2(g, KARST_OP_SUBTRACT, karst_expr_1(g, KARST_OP_FRACT, x), square);
    case 8:
        return karst_expr_2(g, KARST_OP_MULTIPLY, karst_expr_1(g, KARST_OP_SIN, f),
                            karst_expr_2(g, KARST_OP_ADD, f, one));
    default:                  /* no saw at all */
        if (random_chance(2)) /* what is left is rounding */
            return karst_expr_2(g, KARST_OP_ADD, x, karst_expr_2(g, KARST_OP_SUBTRACT, half, x));
        square = karst_expr_2(g, KARST_OP_MULTIPLY, x, x);
        return karst_expr_2(g, KARST_OP_MULTIPLY, square, karst_expr_2(g, KARST_OP_SUBTRACT, x, square));
    }
}

static void add_curves(random_graph *r)
{
    karst_graph *g = &r->graph;
    r->count[KARST_TYPE_FLOAT] = 0; /* of the graph before roots were extracted */
    for (int i = 0; i < RANDOM_ROOTS; i++)
        pool_add(r, r->root[i]);
    for (int i = 0; i < RANDOM_ROOTS; i++) {
        karst_expr source = random_chance(3) ? r->root[i] : random_affine_leaf(r);
        if (random_chance(3))
            source =
                karst_expr_2(g, random_chance(2) ? KARST_OP_MULTIPLY : KARST_OP_ADD, source, random_affine_leaf(r));
        else if (r->with_noise && random_chance(2))
            source = random_noise(r);
        if (!karst_graph_is_uniform(g, source))
            r->root[i] = random_curve(r, source);
    }
    set_kinds(g);
}

/* A smooth minimum or maximum of x and y, in one of the ways in which people write it. */
static karst_expr random_smooth(karst_graph *g, karst_expr x, karst_expr y)
{
    karst_expr none = karst_graph_float(g, 0), one = karst_graph_float(g, 1);
    bool is_max = random_chance(3);
    double k = random_magnitude(0.05, 20), sign = is_max ? -0.5 : 0.5;
    karst_op gives = is_max ? KARST_OP_ADD : KARST_OP_SUBTRACT;
    if (random_chance(2)) {
        karst_expr apart = karst_expr_2(g, KARST_OP_SUBTRACT, y, x);
        karst_expr t = karst_expr_2(g, KARST_OP_DIVIDE,
                                    karst_expr_2(g, KARST_OP_MULTIPLY, karst_graph_float(g, sign), apart),
                                    karst_graph_float(g, k));
        t = karst_expr_2(g, KARST_OP_ADD, karst_graph_float(g, 0.5), t);
        karst_expr h = karst_expr_2(g, KARST_OP_MIN, karst_expr_2(g, KARST_OP_MAX, t, none), one);
        karst_expr bulge = karst_expr_2(g, KARST_OP_MULTIPLY,
                                        karst_expr_2(g, KARST_OP_MULTIPLY, karst_graph_float(g, k), h),
                                        karst_expr_2(g, KARST_OP_SUBTRACT, one, h));
        return karst_expr_2(g, gives, karst_expr_3(g, KARST_OP_MIX, y, x, h), bulge);
    }
    bool is_cubic = random_chance(2);
    karst_expr h = karst_expr_2(g, KARST_OP_SUBTRACT, karst_graph_float(g, k),
                                karst_expr_1(g, KARST_OP_ABS, karst_expr_2(g, KARST_OP_SUBTRACT, x, y)));
    h = karst_expr_2(g, KARST_OP_DIVIDE, karst_expr_2(g, KARST_OP_MAX, h, none), karst_graph_float(g, k));
    karst_expr bulge = karst_expr_2(g, KARST_OP_MULTIPLY, h, h);
    if (is_cubic)
        bulge = karst_expr_2(g, KARST_OP_MULTIPLY, bulge, h);
    bulge = karst_expr_2(g, KARST_OP_MULTIPLY, bulge, karst_graph_float(g, k / (is_cubic ? 6 : 4)));
    return karst_expr_2(g, gives, karst_expr_2(g, is_max ? KARST_OP_MAX : KARST_OP_MIN, x, y), bulge);
}

/* Chains of them, of what is often about as far apart as they reach. */
static void add_smooth(random_graph *r)
{
    karst_graph *g = &r->graph;
    r->count[KARST_TYPE_FLOAT] = 0;
    for (int i = 0; i < RANDOM_ROOTS; i++)
        pool_add(r, r->root[i]);
    for (int i = 0; i < RANDOM_ROOTS; i++) {
        karst_expr sum = random_chance(2) ? r->root[i] : random_affine_leaf(r);
        for (uint32_t n = 0; n < 3; n++) {
            karst_expr other = random_chance(2) ? r->root[random_below(RANDOM_ROOTS)] : random_affine_leaf(r);
            if (random_chance(2))
                other = karst_expr_2(g, KARST_OP_ADD, sum,
                                     karst_expr_2(g, KARST_OP_MULTIPLY, random_affine_leaf(r),
                                                  karst_graph_float(g, random_magnitude(1e-3, 1))));
            sum = random_smooth(g, sum, other);
        }
        r->root[i] = sum;
    }
    set_kinds(g);
}

static void subject_fill(subject *s, const karst_resolved_world *world, const karst_number *parameters,
                         const karst_expr *roots, size_t num_roots, bool with_curves)
{
    karst_error error;
    const char *fault;
    if (!karst_graph_check(world->graph, &fault))
        fail_msg("no graph of a world: %s", fault);
    assert_true(karst_world_layout_init(&s->layout, world));
    s->data = calloc(s->layout.num_words, sizeof *s->data);
    assert_true(karst_world_data_fill(&s->layout, parameters, 7, s->place.voxel_log2_m, s->data));
    assert_true(with_curves ? karst_tape_build(&s->layout, roots, num_roots, &s->tape, &error)
                            : karst_tape_build_plain(&s->layout, roots, num_roots, &s->tape, &error));
    s->bound_slots = calloc((size_t)s->tape.num_slots * TAPE_BOUND_ELEMENTS, sizeof(int));
    for (int n = 0; n < NUM_SAMPLES; n++) {
        s->value_slots[n] = calloc((size_t)s->tape.num_slots * TAPE_VALUE_ELEMENTS, sizeof(int));
        s->home_slots[n] = calloc((size_t)s->tape.num_slots * TAPE_VALUE_ELEMENTS, sizeof(int));
        s->real_slots[n] = calloc(s->tape.num_slots, sizeof(real_slot));
    }
    place_samples(s);
    s->box.level = random_chance(2) ? -1 : (int)random_below(12);
    s->level = s->box.level < 0 ? -1 : (int)random_below((uint32_t)s->box.level + 3) - 1; /* up to the parent's */
}

/* Graphs from this seed on are mostly of bools and ints. */
#define SEEDS_OF_WHOLE_NUMBERS ((uint64_t)1 << 40)
/* And from here on they have smooth minima. */
#define SEEDS_OF_SMOOTH ((uint64_t)1 << 41)

static void subject_make(subject *s, uint64_t seed)
{
    *s = (subject){.level = 0};
    random_state = seed * 0x9e3779b97f4a7c15ULL + 12345;
    random_bits();
    s->place = random_place_make();
    uint32_t num_nodes = random_chance(2) ? 20 + random_below(30) : 20 + random_below(185);
    random_prefers_whole = seed >= SEEDS_OF_WHOLE_NUMBERS && seed < SEEDS_OF_SMOOTH;
    random_graph_make(&s->graph, &s->place, num_nodes, random_chance(2), RANDOM_ROOTS);
    if (seed >= SEEDS_OF_SMOOTH)
        add_smooth(&s->graph);
    else if (seed % 2)
        add_curves(&s->graph);
    if (random_chance(3))
        random_graph_widen(&s->graph);
    const karst_expr *root = s->graph.root;
    karst_resolved_world world = {
        .graph = &s->graph.graph, .root = {root[0], root[1], root[2], root[3]}};
    subject_fill(s, &world, s->graph.parameters, root, RANDOM_ROOTS, seed % 2 || seed >= SEEDS_OF_SMOOTH);
}

/* Density of a text, over a box about where built_ins.h has its expressions, or far away. */
static void subject_of_text(subject *s, const karst_program_graph *program, uint64_t seed)
{
    *s = (subject){.level = 0};
    random_state = seed * 0x9e3779b97f4a7c15ULL + 54321;
    random_bits();
    karst_arena_init(&s->graph.arena, 1 << 10, NULL, NULL);
    s->graph.with_noise = program->world.graph->num_noises > 0;
    s->place = random_place_make();
    s->place.voxel_log2_m = program->header.voxel_log2_m;
    bool is_far = random_chance(5);
    for (int axis = 0; axis < 3; axis++) {
        if (!is_far)
            s->place.voxel[axis] = (int64_t)ldexp(4 * random_unit() - 2, -s->place.voxel_log2_m);
        s->place.radius[axis] = (float)random_magnitude(1e-3, 30);
    }
    karst_number values[KARST_HEADER_MAX_PARAMETERS + 16];
    for (uint32_t i = 0; i < program->num_parameters; i++)
        values[i] = program->parameters[i].value;
    subject_fill(s, &program->world, values, &program->world.root[KARST_ROOT_DENSITY], 1, seed % 2);
}
static tape_program program_of(const subject *s, int *slots)
{
    return (tape_program){.code = s->tape.code,
                          .num_instructions = s->tape.num_instructions,
                          .constants = s->tape.constants,
                          .data = s->data,
                          .values = (const uint *)(s->data + s->layout.values_word),
                          .num_values = s->layout.num_values,
                          .slots = slots};
}

/* ---- what must hold ---- */

typedef struct {
    const char *rule; /* that is broken; NULL: none */
    uint32_t instruction;
    int sample, other;
    real value, lo, hi;
} violation;

static bool inside(iv a, real x) { return x >= (real)a.lo && x <= (real)a.hi; }

/* g . delta + r */
static void centred(const op_bound *b, const real delta[3], real *lo, real *hi)
{
    for (int i = 0; i < 3; i++) {
        real p = (real)b->g[i].lo * delta[i], q = (real)b->g[i].hi * delta[i];
        *lo += p < q ? p : q;
        *hi += p < q ? q : p;
    }
}

static bool check_value(const op_bound *b, const real delta[3], real value, violation *v)
{
    *v = (violation){.value = value, .lo = (real)b->v.lo, .hi = (real)b->v.hi, .rule = "v"};
    if (!inside(b->v, value))
        return false;
    real lo = (real)b->c.lo + (real)b->r.lo, hi = (real)b->c.hi + (real)b->r.hi;
    centred(b, delta, &lo, &hi);
    *v = (violation){.value = value, .lo = lo, .hi = hi, .rule = "centred form"};
    return value >= lo && value <= hi;
}

/* Real numbers only, and where their own rounding is seen to be small. */
static bool check_pair(const op_bound *b, const real *x, const real *s, const real_slot *fx, const real_slot *fs,
                       violation *v)
{
    real delta[3] = {x[0] - s[0], x[1] - s[1], x[2] - s[2]}, width = (real)b->r.hi - (real)b->r.lo, lo = -width,
         hi = width;
    centred(b, delta, &lo, &hi);
    real noise = 0;
    for (int pass = 1; pass < NUM_PASSES; pass++)
        noise += 4 * (fabsl(fx->value[0] - fx->value[pass]) + fabsl(fs->value[0] - fs->value[pass]));
    real change = fx->value[0] - fs->value[0];
    *v = (violation){.value = change, .lo = lo - noise, .hi = hi + noise, .rule = "two points"};
    return change >= v->lo && change <= v->hi;
}

static bool check_discrete(const karst_instruction *i, const op_bound *b, int value, violation *v)
{
    int lo = (int)k_as_uint(b->v.lo), hi = (int)k_as_uint(b->v.hi);
    *v = (violation){.rule = "range", .value = (real)value, .lo = (real)lo, .hi = (real)hi};
    if (i->type == TAPE_BOOL_TYPE)
        return (value == 0 || value == -1) && !(lo & ~value) && !(value & ~hi);
    return i->type == TAPE_UINT_TYPE ? (uint)value >= (uint)lo && (uint)value <= (uint)hi : value >= lo && value <= hi;
}

/* Floats hold noise to an error that bounds allow for, but pairs do not: so no pairs from there on. */
static bool has_noise(const subject *s) { return s->graph.with_noise; }

static bool gives_pair(const karst_instruction *i) { return (i->flags & TAPE_IS_WIDE) && !tape_narrows(i->op); }

static real pair_base(const subject *s, uint32_t slot)
{
    const tape_slot *of_pair = (const tape_slot *)s->bound_slots + slot;
    return (real)of_pair->base.hi + (real)of_pair->base.lo;
}

static real value_in(const tape_program *tape, const karst_instruction *i)
{
    real value = (real)k_as_float((uint)tape_load(tape, i->slot));
    if (gives_pair(i))
        value += (real)k_as_float((uint)tape_element(tape, i->slot * TAPE_VALUE_ELEMENTS + 1));
    return value;
}

/* How far floats may lie from real numbers, at any footprint and at the box's own; what `size` leaves to long doubles
 * is not held against them. */
static bool check_doubt(const op_bound *b, real any, real home, real size, violation *v)
{
    *v = (violation){.rule = "doubt", .value = any + home, .lo = 0, .hi = (real)b->d + size * 0x1p-60L};
    return any + home <= v->hi;
}

/* How many bounds of each op have been held against values, plain and in pairs; and of boxes by size, in tens. */
enum { NUM_SIZES = 16 };
static long seen_ops[TAPE_CURVE + 1][2], seen_sizes[NUM_SIZES], num_smooth;

static void count_seen(const subject *s, const karst_instruction *i)
{
    int size = (int)floorf(log10f(s->place.radius[0])) + 6;
    seen_ops[i->op][gives_pair(i)]++;
    num_smooth += i->op != TAPE_NOISE && (i->flags & TAPE_IS_SMOOTH) != 0;
    seen_sizes[size < 0 ? 0 : size < NUM_SIZES ? size : NUM_SIZES - 1]++;
}

/* false: something escaped. *num_checked counts nodes whose bounds said anything. */
static bool subject_holds(subject *s, violation *v, long *num_checked)
{
    int unknown = 0;
    for (uint32_t n = 0; n < s->tape.num_instructions; n++) {
        const karst_instruction *i = &s->tape.code[n];
        tape_program one = program_of(s, s->bound_slots);
        one.code += n;
        one.num_instructions = 1;
        unknown |= tape_bounds(&one, &s->box, NULL);
        op_bound b = tape_slot_at(&one, i->slot)->bound; /* of a pair: what differs from its base */
        if (unknown)
            return true;
        bool is_float = i->op == TAPE_NOISE || i->type == TAPE_FLOAT_TYPE, is_bounded = tape_is_seen(i);
        if (i->flags & TAPE_IN_CURVE)
            continue;
        (*num_checked)++;
        if (is_bounded)
            count_seen(s, i);
        real any = 0, home = 0, size = 0;
        for (int k = 0; k < NUM_SAMPLES; k++) {
            one.slots = s->value_slots[k];
            tape_values(&one, &s->sample[k], NULL, s->level);
            int bits = tape_load(&one, i->slot);
            real value = value_in(&one, i), base = gives_pair(i) ? pair_base(s, i->slot) : 0;
            one.slots = s->home_slots[k];
            tape_values(&one, &s->sample[k], NULL, s->box.level);
            run_real(&one, i, &s->sample[k], s->box.level, s->real_slots[k]);
            size = fmaxl(size, fabsl(value));
            any = fmaxl(any, fabsl(value - s->real_slots[k][i->slot].value[0]));
            home = fmaxl(home, fabsl(value_in(&one, i) - s->real_slots[k][i->slot].value[0]));
            bool good = !is_bounded ? true
                        : is_float  ? check_value(&b, s->delta[k], value - base, v) &&
                                         check_value(&b, s->delta[k], s->real_slots[k][i->slot].value[0] - base, v)
                                   : check_discrete(i, &b, bits, v);
            int other = (int)random_below(NUM_SAMPLES);
            if (good && is_bounded && is_float && !has_noise(s) && other < k)
                good = check_pair(&b, s->delta[k], s->delta[other], &s->real_slots[k][i->slot],
                                  &s->real_slots[other][i->slot], v);
            if (good && is_bounded && is_float)
                good = check_doubt(&b, any, home, size, v);
            if (!good) {
                v->instruction = n;
                v->sample = k;
                v->other = other;
                return false;
            }
        }
    }
    return true;
}

static void describe(const subject *s, uint64_t seed, const violation *v)
{
    const karst_instruction *i = &s->tape.code[v->instruction];
    print_message(
        "seed %lu: tape op %u%s (type %u, steps %u), instruction %u of %u, %s: %.12Lg is not in [%.12Lg, %.12Lg]\n",
        (unsigned long)seed, i->op, i->flags & TAPE_IS_CURVE ? " of a curve" : "", i->type, (i->flags & TAPE_IS_STEPS),
        v->instruction, s->tape.num_instructions, v->rule, v->value, v->lo, v->hi);
    print_message("  sample %d, %d; box at %ld %ld %ld, radius %g %g %g, level %d, footprint %d\n", v->sample, v->other,
                  (long)s->place.voxel[0], (long)s->place.voxel[1], (long)s->place.voxel[2], (double)s->place.radius[0],
                  (double)s->place.radius[1], (double)s->place.radius[2], s->box.level, s->level);
    for (int k = 0; k < 4; k++)
        if (i->arg[k] != TAPE_NOTHING && tape_is_known(i->arg[k])) {
            tape_program p = program_of(s, s->bound_slots);
            print_message("  argument %d is %g\n", k, (double)k_as_float((uint)tape_known(&p, i->arg[k])));
        }
}

/* Graphs from `first` on; returns how many escapes there were, at most `most`. */
static long escapes(uint64_t first, long count, long most, bool tell, long *num_checked)
{
    long num = 0;
    for (long i = 0; i < count && num < most; i++) {
        subject s;
        violation v;
        subject_make(&s, first + (uint64_t)i);
        if (!subject_holds(&s, &v, num_checked)) {
            num++;
            if (tell)
                describe(&s, first + (uint64_t)i, &v);
        }
        subject_finish(&s);
    }
    return num;
}

/* A graph that the first ones have no like of: the square of a length's argument is beyond floats. */
#define SEED_OF_OVERFLOW 5285086

static uint64_t number_from(const char *name, uint64_t otherwise)
{
    const char *text = getenv(name);
    return text && *text ? strtoull(text, NULL, 10) : otherwise;
}

/* Nothing is left out: each op, in pairs too where there are pairs, and each size of boxes. */
static void check_seen(void)
{
    for (int op = 0; op < TAPE_CURVE; op++) {
        bool can_pair = op == TAPE_AFFINE || (op >= TAPE_ADD && op <= TAPE_ABS) || op == TAPE_MIX || op == TAPE_SQRT ||
                        op == TAPE_LENGTH || op == TAPE_SELECT;
        if (op == TAPE_NORMAL || op == TAPE_FOOTPRINT) /* of colours, which have no bounds */
            continue;
        if (getenv("KARST_VERBOSE"))
            print_message("op %d: %ld, %ld in pairs\n", op, seen_ops[op][0], seen_ops[op][1]);
        if (seen_ops[op][0] < 200 || (can_pair && seen_ops[op][1] < 50))
            fail_msg("op %d: only %ld bounds, and %ld in pairs, were looked at", op, seen_ops[op][0], seen_ops[op][1]);
    }
    for (int size = 0; size < 15; size++) { /* from 10^-6 to 10^9 voxels */
        if (getenv("KARST_VERBOSE"))
            print_message("boxes of 10^%d voxels: %ld\n", size - 6, seen_sizes[size]);
        if (seen_sizes[size] < 500)
            fail_msg("only %ld bounds over boxes of 10^%d voxels were looked at", seen_sizes[size], size - 6);
    }
}

static void test_bounds_of_random_graphs_hold(void **state)
{
    (void)state;
    long num_checked = 0, count = (long)number_from("KARST_BOUNDS_GRAPHS", 10000);
    broken = BREAK_NOTHING;
    long num = escapes(number_from("KARST_SEED", 1), count, 10, true, &num_checked);
    num += escapes(SEED_OF_OVERFLOW, 1, 10, true, &num_checked);
    num += escapes(SEEDS_OF_WHOLE_NUMBERS, count / 2, 10, true, &num_checked);
    num_smooth = 0;
    num += escapes(SEEDS_OF_SMOOTH, count / 4, 10, true, &num_checked);
    if (num_smooth < count / 4)
        fail_msg("only %ld smooth minima were looked at", num_smooth);
    print_message("%ld nodes over %ld graphs\n", num_checked, count + 1 + count / 2);
    assert_int_equal(num, 0);
    assert_true(num_checked > 8 * count); /* most graphs are bounded for a good while */
    if (count >= 10000)
        check_seen();
}

/* Every function of the language, by itself. */
static void test_bounds_of_every_function_hold(void **state)
{
    (void)state;
    enum { NUM_PLACES = 16 };
    long num_checked = 0;
    broken = BREAK_NOTHING;
    for (size_t n = 0; n < NUM_BUILT_INS; n++) {
        karst_error error = {0};
        char text[512];
        bool ok;
        long before = num_checked;
        int length = snprintf(text, sizeof text, "float density(vec3 p) { return %s; }\n", built_ins[n]);
        karst_program_graph *program =
            karst_language_compile("function.karst", text, (size_t)length, NULL, 0, &ok, &error);
        assert_true(program && ok);
        for (uint64_t k = 0; k < NUM_PLACES; k++) {
            subject s;
            violation v;
            subject_of_text(&s, program, n * NUM_PLACES + k);
            if (!subject_holds(&s, &v, &num_checked)) {
                describe(&s, k, &v);
                fail_msg("%s", built_ins[n]);
            }
            subject_finish(&s);
        }
        if (num_checked - before < NUM_PLACES)
            fail_msg("%s: next to nothing is bounded", built_ins[n]);
        karst_program_graph_destroy(program);
    }
    print_message("%ld nodes of %zu expressions\n", num_checked, NUM_BUILT_INS);
}

/* A planet's surface under a node of centimetres: bounds are as wide as the surface's slope makes them, not as floats
 * of 6.4e6 are. */
static void test_pairs_are_bounded_to_a_part_of_a_voxel(void **state)
{
    (void)state;
    karst_arena arena;
    karst_graph g;
    karst_arena_init(&arena, 1 << 24, NULL, NULL);
    karst_graph_init(&g, &arena, 1000, graph_is_full, NULL);
    karst_expr p[3];
    for (int i = 0; i < 3; i++) {
        karst_affine affine = {.offset = karst_graph_float(&g, 0)};
        affine.coefficient[i] = karst_graph_float(&g, 1);
        p[i] = karst_graph_affine(&g, affine);
    }
    karst_expr length = karst_expr_length(&g, p, 3);
    karst_expr root = karst_expr_2(&g, KARST_OP_SUBTRACT, length, karst_graph_float(&g, 6371000));
    g.nodes[length].kind = g.nodes[root].kind = KARST_KIND_WIDE;
    karst_world_layout layout;
    karst_resolved_world world = {.graph = &g, .root = {root}};
    assert_true(karst_world_layout_init(&layout, &world));
    uint64_t *data = calloc(layout.num_words, sizeof *data);
    assert_true(karst_world_data_fill(&layout, NULL, 1, -6, data)); /* voxels of 1/64 m */
    karst_tape tape;
    karst_error error;
    assert_true(karst_tape_build(&layout, &root, 1, &tape, &error));
    int *slots = calloc((size_t)tape.num_slots * TAPE_BOUND_ELEMENTS, sizeof *slots);
    tape_program program = {.code = tape.code,
                            .num_instructions = tape.num_instructions,
                            .constants = tape.constants,
                            .data = data,
                            .values = (const uint *)(data + layout.values_word),
                            .num_values = layout.num_values,
                            .slots = slots};
    /* at (0.6, 0, 0.8) of the radius: 9 voxels above the surface, a node of 16 voxels */
    op_box box = {.centre = {.voxel = {244646400 + 5, 0, 326195200 + 8}}, .radius = {8, 8, 8}, .level = 0};
    assert_int_equal(tape_bounds(&program, &box, NULL), 0);
    op_bound b = tape_load_bound(&program, tape.output[0]);
    double voxel = 1 / 64.0, middle = (0.6 * 5 + 0.8 * 8) * voxel, reach = 8 * (0.6 + 0.8) * voxel;
    assert_true((double)b.v.lo <= middle - reach && (double)b.v.hi >= middle + reach);
    assert_true((double)b.v.lo > middle - reach - 0.01 * voxel && (double)b.v.hi < middle + reach + 0.01 * voxel);
    free(slots);
    free(data);
    karst_tape_finish(&tape);
    karst_arena_finish(&arena);
}

static void test_every_rule_is_needed(void **state)
{
    (void)state;
    static const char *const names[] = {"nothing",
#define TEXT_BOUNDS(rule) #rule,
#define TEXT_NOISE(rule) "noise " #rule,
                                        BOUNDS_RULES(TEXT_BOUNDS) NOISE_RULES(TEXT_NOISE)};
    long count = 4 * (long)number_from("KARST_BOUNDS_GRAPHS", 10000);
    int missed = 0;
    for (int rule = 1; rule < NUM_BROKEN; rule++) {
        long num_checked = 0;
        broken = (enum broken)rule;
        bool is_of_smooth = rule >= BREAK_BOUNDS_SMOOTH_VALUE && rule <= BREAK_BOUNDS_SMOOTH_EDGE;
        if (is_of_smooth && escapes(SEEDS_OF_SMOOTH, count, 1, false, &num_checked))
            continue;
        if (!escapes(1, count, 1, false, &num_checked) && !escapes(SEED_OF_OVERFLOW, 1, 1, false, &num_checked) &&
            !escapes(SEEDS_OF_WHOLE_NUMBERS, count, 1, false, &num_checked)) {
            print_message("nothing escapes without the rule %s\n", names[rule]);
            missed++;
        } else if (getenv("KARST_VERBOSE")) {
            print_message("%s: %ld nodes\n", names[rule], num_checked);
        }
    }
    broken = BREAK_NOTHING;
    assert_int_equal(missed, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bounds_of_random_graphs_hold),
        cmocka_unit_test(test_bounds_of_every_function_hold),
        cmocka_unit_test(test_pairs_are_bounded_to_a_part_of_a_voxel),
        cmocka_unit_test(test_every_rule_is_needed),
    };
    return cmocka_run_group_tests_name("bounds of graphs", tests, NULL, NULL);
}
