/* What is built in: the core operations and the noise family. Everything else is in prelude.karst. */
#include "producers/language/front/lower_internal.h"

#include <string.h>

/* Operations on each component. An argument may be a scalar where the first one is a vector ("mod(v, 2.0)"). */
static const struct {
    const char *name;
    uint8_t num_arguments;
    karst_op of_float, of_int; /* NONE: not for this type */
} each[] = {
    {"sqrt", 1, KARST_OP_SQRT, 0},
    {"floor", 1, KARST_OP_FLOOR, 0},
    {"ceil", 1, KARST_OP_CEIL, 0},
    {"roundEven", 1, KARST_OP_RINT, 0},
    {"round", 1, KARST_OP_RINT, 0},
    {"rint", 1, KARST_OP_RINT, 0},
    {"fract", 1, KARST_OP_FRACT, 0},
    {"abs", 1, KARST_OP_ABS, KARST_OP_ABS},
    {"fabs", 1, KARST_OP_ABS, 0},
    {"sin", 1, KARST_OP_SIN, 0},
    {"cos", 1, KARST_OP_COS, 0},
    {"exp2", 1, KARST_OP_EXP2, 0},
    {"log", 1, KARST_OP_LOG, 0},
    {"min", 2, KARST_OP_MIN, KARST_OP_MIN},
    {"max", 2, KARST_OP_MAX, KARST_OP_MAX},
    {"fmin", 2, KARST_OP_MIN, 0},
    {"fmax", 2, KARST_OP_MAX, 0},
    {"mod", 2, KARST_OP_MOD, 0},
    {"atan2", 2, KARST_OP_ATAN, 0},
    {"fma", 3, KARST_OP_FMA, 0},
    {"mad", 3, KARST_OP_FMA, 0},
    {"mix", 3, KARST_OP_MIX, 0},
};

static const struct {
    const char *name;
    karst_op op; /* > and >= swap their arguments */
    bool swap;
} comparisons[] = {
    {"lessThan", KARST_OP_LESS, false},   {"lessThanEqual", KARST_OP_LESS_EQUAL, false},
    {"greaterThan", KARST_OP_LESS, true}, {"greaterThanEqual", KARST_OP_LESS_EQUAL, true},
    {"equal", KARST_OP_EQUAL, false},     {"notEqual", KARST_OP_NOT_EQUAL, false},
};

/* worley gives F1 and F2 */
static const struct {
    const char *name;
    uint8_t base, shape;
    bool has_octaves;
} noises[] = {
    {"noise", KARST_NOISE_GRADIENT, KARST_NOISE_SUM, false},
    {"fbm", KARST_NOISE_GRADIENT, KARST_NOISE_SUM, true},
    {"ridged", KARST_NOISE_GRADIENT, KARST_NOISE_RIDGED, true},
    {"billow", KARST_NOISE_GRADIENT, KARST_NOISE_BILLOW, true},
    {"turbulence", KARST_NOISE_GRADIENT, KARST_NOISE_TURBULENCE, true},
    {"valuenoise", KARST_NOISE_VALUE, KARST_NOISE_SUM, false},
    {"vnoise", KARST_NOISE_VALUE, KARST_NOISE_SUM, false},
    {"valuefbm", KARST_NOISE_VALUE, KARST_NOISE_SUM, true},
    {"simplex", KARST_NOISE_SIMPLEX, KARST_NOISE_SUM, false},
    {"snoise", KARST_NOISE_SIMPLEX, KARST_NOISE_SUM, false},
    {"simplexfbm", KARST_NOISE_SIMPLEX, KARST_NOISE_SUM, true},
    {"worley", KARST_NOISE_WORLEY_F1, KARST_NOISE_SUM, false},
    {"cellular", KARST_NOISE_WORLEY_F1, KARST_NOISE_SUM, false},
    {"worleyfbm", KARST_NOISE_WORLEY_F1, KARST_NOISE_SUM, true},
};

static const char *const others[] = {
    "length", "dot", "any", "all", "not", "floatBitsToInt", "floatBitsToUint", "intBitsToFloat", "uintBitsToFloat"};
#define COUNT(a) (sizeof(a) / sizeof *(a))

static _Noreturn void bad_arguments(karst_lower_state *s, const char *name, const char *wanted,
                                    const karst_value *arguments, uint32_t count, uint32_t where)
{
    karst_source_error(s->source, where, karst_format(s->arena, "write %s", wanted), "no function '%s' takes %s", name,
                       karst_type_list(s, arguments, count));
}

static bool is_scalar(karst_value v) { return v.type->shape == KARST_SHAPE_SCALAR; }

static karst_expr select_less(karst_graph *g, karst_expr l, karst_expr r, karst_expr yes, karst_expr no)
{
    return karst_expr_3(g, KARST_OP_SELECT, karst_expr_2(g, KARST_OP_LESS, l, r), yes, no);
}

static karst_expr integer_operation(karst_lower_state *s, karst_op op, karst_scalar_type type, const karst_expr *a)
{
    karst_expr zero = karst_graph_number(s->graph, type, karst_number_int(0));
    switch (op) {
    case KARST_OP_MIN:
        return select_less(s->graph, a[1], a[0], a[1], a[0]);
    case KARST_OP_MAX:
        return select_less(s->graph, a[0], a[1], a[1], a[0]);
    default:
        return select_less(s->graph, a[0], zero, karst_expr_2(s->graph, KARST_OP_INT_SUBTRACT, zero, a[0]),
                           a[0]); /* abs */
    }
}

/* mix(a, b, bvec): a choice, not a blend. */
static bool mix_by_bool(karst_lower_state *s, const karst_value *a, uint32_t where, karst_value *result)
{
    if (!karst_type_is_plain(a[2].type) || a[2].type->scalar != KARST_TYPE_BOOL || a[0].type != a[1].type ||
        a[2].type->size != a[0].type->num_scalars)
        return false;
    *result = karst_value_new(s, a[0].type, where);
    for (uint32_t i = 0; i < a[0].type->num_scalars; i++)
        result->e[i] = karst_expr_3(s->graph, KARST_OP_SELECT, a[2].e[i], a[1].e[i], a[0].e[i]);
    return true;
}

static karst_value apply_each(karst_lower_state *s, size_t which, karst_value *a, uint32_t count, uint32_t where)
{
    const char *name = each[which].name;
    uint32_t n = each[which].num_arguments, size = 1;
    karst_value result;
    bool fits = count == n;
    bool is_int = each[which].of_int != KARST_OP_NONE;
    for (uint32_t i = 0; i < count && fits; i++) {
        fits = karst_type_is_number(a[i].type) ||
               (i == 2 && each[which].of_float == KARST_OP_MIX && karst_type_is_plain(a[i].type));
        size = fits && a[i].type->size > size ? a[i].type->size : size;
        is_int = is_int && fits && a[i].type->scalar != KARST_TYPE_FLOAT && a[i].type->scalar == a[0].type->scalar;
    }
    if (fits && each[which].of_float == KARST_OP_MIX && mix_by_bool(s, a, where, &result))
        return result;
    for (uint32_t i = 0; i < count && fits; i++)
        fits = a[i].type->scalar != KARST_TYPE_BOOL && (a[i].type->size == 1 || a[i].type->size == size);
    if (!fits)
        bad_arguments(s, name,
                      karst_format(s->arena,
                                   n == 1   ? "%s(x)"
                                   : n == 2 ? "%s(x, y)"
                                            : "%s(x, y, z)",
                                   name),
                      a, count, where);
    karst_scalar_type type = is_int ? a[0].type->scalar : KARST_TYPE_FLOAT;
    result = karst_value_new(s, karst_type_vector(type, size), where);
    for (uint32_t k = 0; k < size; k++) {
        karst_expr e[3] = {0};
        for (uint32_t i = 0; i < n; i++)
            e[i] = karst_expr_convert(s->graph, type, a[i].e[is_scalar(a[i]) ? 0 : k]);
        result.e[k] = is_int   ? integer_operation(s, each[which].of_int, type, e)
                      : n == 1 ? karst_expr_1(s->graph, each[which].of_float, e[0])
                      : n == 2 ? karst_expr_2(s->graph, each[which].of_float, e[0], e[1])
                               : karst_expr_3(s->graph, each[which].of_float, e[0], e[1], e[2]);
    }
    return result;
}

static karst_value apply_comparison(karst_lower_state *s, size_t which, karst_value *a, uint32_t count, uint32_t where)
{
    if (count != 2 || !karst_type_is_plain(a[0].type) || a[0].type != a[1].type || a[0].type->size == 1)
        bad_arguments(s, comparisons[which].name,
                      karst_format(s->arena, "%s(v, w) with two vectors of a kind", comparisons[which].name), a, count,
                      where);
    bool swap = comparisons[which].swap;
    karst_value r = karst_value_new(s, karst_type_vector(KARST_TYPE_BOOL, a[0].type->size), where);
    for (uint32_t i = 0; i < a[0].type->size; i++)
        r.e[i] = karst_expr_2(s->graph, comparisons[which].op, a[swap].e[i], a[!swap].e[i]);
    return r;
}

static karst_value apply_geometry(karst_lower_state *s, const char *name, karst_value *a, uint32_t count,
                                  uint32_t where)
{
    bool dot = !strcmp(name, "dot");
    bool fits = count == (dot ? 2u : 1u);
    for (uint32_t i = 0; i < count && fits; i++) {
        fits = karst_type_is_number(a[i].type) && a[i].type->size == a[0].type->size;
        if (fits)
            a[i] = karst_lower_convert(s, a[i], karst_type_vector(KARST_TYPE_FLOAT, a[i].type->size), "this", where);
    }
    if (!fits)
        bad_arguments(s, name, dot ? "dot(v, w) with two vectors of a kind" : "length(v)", a, count, where);
    karst_value r = karst_value_new(s, karst_type_vector(KARST_TYPE_FLOAT, 1), where);
    uint32_t n = a[0].type->size;
    if (!dot) {
        r.e[0] = karst_expr_length(s->graph, a[0].e, (int)n);
        return r;
    }
    r.e[0] = karst_expr_2(s->graph, KARST_OP_MULTIPLY, a[0].e[0], a[1].e[0]);
    for (uint32_t i = 1; i < n; i++)
        r.e[0] = karst_expr_3(s->graph, KARST_OP_FMA, a[0].e[i], a[1].e[i], r.e[0]);
    return r;
}

static karst_value apply_bools(karst_lower_state *s, const char *name, karst_value *a, uint32_t count, uint32_t where)
{
    if (count != 1 || !karst_type_is_plain(a[0].type) || a[0].type->scalar != KARST_TYPE_BOOL)
        bad_arguments(s, name, karst_format(s->arena, "%s(b) with a bvec", name), a, count, where);
    bool each_one = !strcmp(name, "not");
    karst_value r = karst_value_new(s, each_one ? a[0].type : karst_type_vector(KARST_TYPE_BOOL, 1), where);
    if (!each_one)
        r.e[0] = a[0].e[0];
    for (uint32_t i = each_one ? 0 : 1; i < a[0].type->size; i++) {
        if (each_one)
            r.e[i] = karst_expr_1(s->graph, KARST_OP_NOT, a[0].e[i]);
        else
            r.e[0] = karst_expr_2(s->graph, name[1] == 'n' ? KARST_OP_OR : KARST_OP_AND, r.e[0], a[0].e[i]);
    }
    return r;
}

static karst_value apply_bits(karst_lower_state *s, const char *name, karst_value *a, uint32_t count, uint32_t where)
{
    bool from_float = name[0] == 'f';
    karst_scalar_type to = !from_float ? KARST_TYPE_FLOAT : strstr(name, "Uint") ? KARST_TYPE_UINT : KARST_TYPE_INT;
    karst_scalar_type from = from_float ? KARST_TYPE_FLOAT : name[0] == 'u' ? KARST_TYPE_UINT : KARST_TYPE_INT;
    if (count != 1 || !karst_type_is_number(a[0].type) || a[0].type->scalar != from)
        bad_arguments(s, name,
                      karst_format(s->arena, "%s(x) with %s", name, karst_a_type(s, karst_type_vector(from, 1))), a,
                      count, where);
    karst_value r = karst_value_new(s, karst_type_vector(to, a[0].type->size), where);
    for (uint32_t i = 0; i < r.type->size; i++)
        r.e[i] = karst_expr_bits(s->graph, to, a[0].e[i]);
    return r;
}

/* ---- noise ---- */

/* The float at `argument`, uniform. */
static karst_expr uniform_argument(karst_lower_state *s, karst_value v, const char *what, uint32_t where)
{
    v = karst_lower_convert(s, v, karst_type_vector(KARST_TYPE_FLOAT, 1), what, where);
    if (!karst_lower_is_known(s, v.e[0]))
        karst_source_error(s->source, where, "add up noise(...) in a loop instead",
                           "%s must not depend on the position", what);
    return v.e[0];
}

static uint32_t integer_argument(karst_lower_state *s, karst_value v, const char *what, uint32_t where, double low,
                                 double high)
{
    if (!is_scalar(v) || v.type->scalar == KARST_TYPE_BOOL)
        karst_source_error(s->source, where, NULL, "%s is an int, not %s", what, karst_a_type(s, v.type));
    karst_number n = karst_lower_constant(s, v.e[0], what, where);
    if (!(n.value >= low && n.value <= high) || !karst_number_same(karst_number_floor(n), n))
        karst_source_error(s->source, where, NULL, "%s is an int from %.0f to %.0f", what, low, high);
    return (uint32_t)(int64_t)n.value;
}

/* Into the axes of noise/simplex.clh from Perlin's, where the diagonal of the three is that of a cell: q = 2/3 (x + y +
 * z) - p, a turn by half about the diagonal. Exact wherever p is. */
static void turn_to_simplices(karst_lower_state *s, karst_expr *x, karst_expr *y, karst_expr *z)
{
    karst_graph *g = s->graph;
    karst_expr sum = karst_expr_2(g, KARST_OP_ADD, karst_expr_2(g, KARST_OP_ADD, *x, *y), *z);
    karst_expr part =
        karst_expr_2(g, KARST_OP_MULTIPLY, sum, karst_graph_number(g, KARST_TYPE_FLOAT, karst_number_ratio(2, 3)));
    karst_expr *axis[3] = {x, y, z};
    for (int i = 0; i < 3; i++)
        *axis[i] = karst_expr_2(g, KARST_OP_SUBTRACT, part, *axis[i]);
}

/* noise(p [, seed]); fbm(p, octaves [, gain [, lacunarity [, seed]]]). */
static karst_value apply_noise(karst_lower_state *s, size_t which, karst_value *a, uint32_t count, uint32_t where)
{
    const char *name = noises[which].name;
    bool octaves = noises[which].has_octaves;
    bool fits = count >= (octaves ? 2u : 1u) && count <= (octaves ? 5u : 2u) && karst_type_is_number(a[0].type) &&
                a[0].type->size <= 3;
    for (uint32_t i = 1; i < count && fits; i++)
        fits = is_scalar(a[i]) && a[i].type->scalar != KARST_TYPE_BOOL;
    if (!fits)
        bad_arguments(s, name,
                      karst_format(s->arena, "%s(p%s), p of up to three components", name,
                                   octaves ? ", octaves, gain, lacunarity, seed" : ", seed"),
                      a, count, where);
    karst_noise noise = {.base = noises[which].base, .shape = noises[which].shape, .num_octaves = 1};
    noise.gain = karst_graph_float(s->graph, 0.5);
    noise.lacunarity = karst_graph_float(s->graph, 2);
    if (octaves) {
        noise.num_octaves = (uint16_t)integer_argument(s, a[1], "the number of octaves", where, 1, KARST_MAX_OCTAVES);
        if (count > 2)
            noise.gain = uniform_argument(s, a[2], "the gain", where);
        if (count > 3)
            noise.lacunarity = uniform_argument(s, a[3], "the lacunarity", where);
    }
    if (noise.num_octaves == 1) { /* they do not matter: one noise, one node */
        noise.gain = karst_graph_float(s->graph, 0.5);
        noise.lacunarity = karst_graph_float(s->graph, 2);
    }
    uint32_t seed = octaves ? 4 : 1;
    if (count > seed)
        noise.seed_offset = integer_argument(s, a[seed], "the seed", where, INT32_MIN, UINT32_MAX);
    if (s->graph->num_noises >= 4 * KARST_MAX_OCTAVES)
        karst_source_error(s->source, where, NULL, "there are more than %u different noises", 4 * KARST_MAX_OCTAVES);
    a[0] = karst_lower_convert(s, a[0], karst_type_vector(KARST_TYPE_FLOAT, a[0].type->size), "the position", where);
    uint32_t n = a[0].type->size;
    karst_expr x = a[0].e[0], y = n == 3 ? a[0].e[1] : s->zero,
               z = n == 3   ? a[0].e[2]
                   : n == 2 ? a[0].e[1]
                            : s->zero; /* noise(q) = noise(q.x, 0, q.y) */
    if (noise.base == KARST_NOISE_SIMPLEX)
        turn_to_simplices(s, &x, &y, &z);
    bool is_worley = noise.base == KARST_NOISE_WORLEY_F1;
    karst_value r = karst_value_new(s, karst_type_vector(KARST_TYPE_FLOAT, is_worley ? 2 : 1), where);
    r.e[0] = karst_graph_noise(s->graph, noise, x, y, z);
    if (is_worley) {
        noise.base = KARST_NOISE_WORLEY_F2;
        r.e[1] = karst_graph_noise(s->graph, noise, x, y, z);
    }
    return r;
}

/* ---- look-up ---- */

bool karst_lower_builtin(karst_lower_state *s, const char *name, karst_value *arguments, uint32_t count, uint32_t where,
                         karst_value *result)
{
    for (size_t i = 0; i < COUNT(each); i++)
        if (!strcmp(name, each[i].name)) {
            *result = apply_each(s, i, arguments, count, where);
            return true;
        }
    for (size_t i = 0; i < COUNT(comparisons); i++)
        if (!strcmp(name, comparisons[i].name)) {
            *result = apply_comparison(s, i, arguments, count, where);
            return true;
        }
    for (size_t i = 0; i < COUNT(noises); i++)
        if (!strcmp(name, noises[i].name)) {
            *result = apply_noise(s, i, arguments, count, where);
            return true;
        }
    if (!strcmp(name, "length") || !strcmp(name, "dot"))
        *result = apply_geometry(s, name, arguments, count, where);
    else if (!strcmp(name, "any") || !strcmp(name, "all") || !strcmp(name, "not"))
        *result = apply_bools(s, name, arguments, count, where);
    else if (strstr(name, "BitsTo") && karst_is_builtin(name))
        *result = apply_bits(s, name, arguments, count, where);
    else
        return false;
    return true;
}

bool karst_is_builtin(const char *name)
{
    karst_nearest exact = {.wanted = name, .wanted_length = strlen(name), .distance = 1};
    karst_offer_builtins(&exact);
    return exact.distance == 0;
}

const char *karst_builtin_name(size_t number)
{
    if (number < COUNT(each))
        return each[number].name;
    number -= COUNT(each);
    if (number < COUNT(comparisons))
        return comparisons[number].name;
    number -= COUNT(comparisons);
    if (number < COUNT(noises))
        return noises[number].name;
    number -= COUNT(noises);
    return number < COUNT(others) ? others[number] : NULL;
}

void karst_offer_builtins(karst_nearest *nearest)
{
    const char *name;
    for (size_t i = 0; (name = karst_builtin_name(i)) != NULL; i++)
        karst_nearest_offer(nearest, name);
}
