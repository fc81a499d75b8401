#include "producers/language/reach.h"

#include <math.h>
#include <stdlib.h>

#include "producers/language/oracle/oracle.h"

#define OFF_VOXELS 0.006 /* less than a hundredth, as not all places are looked at */
#define SHARE_SAID 0.6   /* of where it was found, likewise */
#define NEAREST_M 8.0
#define GROWTH 1.3 /* of steps along a way */
#define BISECTIONS 40
/* Nodes that are evaluated in all, and of a way, at most; an octave of noise counts as so many. */
#define MOST_NODES 1.2e7
#define EVALUATIONS_A_WAY 100
#define NODES_AN_OCTAVE 12
enum { LEAST_WAYS = 3, MOST_WAYS = 128 };

typedef struct {
    const karst_program_graph *program;
    karst_oracle *oracle;
    uint64_t state;
    double voxel_m, off_m;
    karst_position off_at;
} search;

static double random_unit(search *s)
{
    s->state = s->state * 6364136223846793005u + 1442695040888963407u;
    return (double)(s->state >> 11) * 0x1p-53;
}

static karst_position away(const search *s, karst_position from, const double way[3], double t_m)
{
    const double by_m[3] = {way[0] * t_m, way[1] * t_m, way[2] * t_m};
    return karst_position_add_m(from, by_m, s->program->header.voxel_log2_m);
}

static double density(const search *s, karst_position from, const double way[3], double t_m)
{
    const karst_position at = away(s, from, way, t_m);
    return karst_oracle_precise_density(s->oracle, &at, -1);
}

static double farthest_axis_m(const search *s, const karst_position *at)
{
    double most = 0;
    for (int axis = 0; axis < 3; axis++)
        most = fmax(most, fabs((double)at->voxel[axis]));
    return ldexp(most, s->program->header.voxel_log2_m);
}

/* Looks at the first surface along a way. */
static void look_along(search *s, karst_position from, const double way[3], double longest_m)
{
    const bool was = density(s, from, way, 0) > 0;
    double near_m = 0, far_m = 0.5;
    while ((density(s, from, way, far_m) > 0) == was) {
        near_m = far_m;
        far_m *= GROWTH;
        if (far_m > longest_m)
            return;
    }
    for (int i = 0; i < BISECTIONS && far_m - near_m > 1e-4 * s->voxel_m; i++) {
        const double middle_m = 0.5 * (near_m + far_m);
        *((density(s, from, way, middle_m) > 0) == was ? &near_m : &far_m) = middle_m;
    }
    const double by_m = s->voxel_m / 16, here = density(s, from, way, near_m);
    const double before = fabs(here - density(s, from, way, near_m - by_m)) / by_m,
                 behind = fabs(density(s, from, way, near_m + by_m) - here) / by_m;
    double slope = 0.5 * (before + behind);
    double steepest = 0;
    for (int axis = 0; axis < 3; axis++) {
        const double along[3] = {axis == 0, axis == 1, axis == 2};
        steepest = fmax(steepest, fabs(density(s, away(s, from, way, near_m), along, by_m) - here) / by_m);
    }
    slope = fmax(slope, steepest); /* across the surface, if the way runs along it */
    /* a fold or a jump, about which slopes say nothing */
    if (!(before < 2 * behind && behind < 2 * before))
        return;
    const karst_position at = away(s, from, way, near_m);
    const karst_oracle_value v = karst_oracle_density(s->oracle, &at, -1);
    double error = fabs((double)v.device - v.precise);
    for (int side = -1; side <= 1; side += 2) { /* on it, what cancels may round alike */
        const karst_position beside = away(s, from, way, near_m + side * by_m);
        const karst_oracle_value b = karst_oracle_density(s->oracle, &beside, -1);
        error = fmax(error, fabs((double)b.device - b.precise));
    }
    const double axis_m = farthest_axis_m(s, &at);
    bool jumps = !(fabs(v.precise) < slope * s->voxel_m);
    if (!jumps && error > OFF_VOXELS * slope * s->voxel_m && axis_m < s->off_m) {
        s->off_m = axis_m;
        s->off_at = at;
    }
}

/* A cube's surfaces: those above and below places near the ground, and those in any direction. */
static void look_within(search *s, double half_m, int num_ways)
{
    for (int i = 0; i < num_ways; i++) {
        double at_m[3], way[3], length = 0;
        for (int axis = 0; axis < 3; axis++) {
            const double reach_m = i % 3 == 0 && axis == 1 ? fmin(100, half_m) : half_m;
            at_m[axis] = (2 * random_unit(s) - 1) * reach_m;
            way[axis] = 2 * random_unit(s) - 1;
            length += way[axis] * way[axis];
        }
        for (int axis = 0; axis < 3; axis++)
            way[axis] = i % 2 ? way[axis] / sqrt(length) : axis != 1 ? 0 : at_m[1] > 0 ? -1 : 1;
        const karst_position origin = {{0}, {0}};
        look_along(s, karst_position_add_m(origin, at_m, s->program->header.voxel_log2_m), way, 2 * half_m);
    }
}

/* ---- whose rounding it is ---- */

/* What a change of a node's argument does to it. */
static double share_of(const search *s, const karst_expr_node *n, double value, int k)
{
    double a[3];
    for (int i = 0; i < 3; i++)
        a[i] = n->arg[i] ? karst_oracle_node(s->oracle, n->arg[i]).precise : 0;
    switch (n->op) {
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
    case KARST_OP_NEGATE:
    case KARST_OP_ABS:
    case KARST_OP_FRACT:
    case KARST_OP_SIN:
    case KARST_OP_COS:
        return 1;
    case KARST_OP_SHIFTED:
    case KARST_OP_MOD:
        return k == 0;
    case KARST_OP_MULTIPLY:
        return a[1 - k];
    case KARST_OP_FMA:
        return k == 2 ? 1 : a[1 - k];
    case KARST_OP_DIVIDE:
        return k == 0 ? 1 / a[1] : value / a[1];
    case KARST_OP_MIX:
        return k == 0 ? 1 - a[2] : k == 1 ? a[2] : a[1] - a[0];
    case KARST_OP_MIN:
    case KARST_OP_MAX:
        return value == a[k];
    case KARST_OP_SELECT:
        return k > 0 && (a[0] != 0) == (k == 1);
    case KARST_OP_SQRT:
        return 0.5 / value;
    case KARST_OP_LENGTH:
        return karst_oracle_node(s->oracle, n->arg[k]).precise / value;
    case KARST_OP_EXP2:
        return value * 0.6931471805599453;
    case KARST_OP_LOG:
        return 1 / a[0];
    default:
        return 0;
    }
}

/* How far floats may round a node itself. */
static double rounding_of(const karst_expr_node *n, double value)
{
    switch (n->kind) {
    case KARST_KIND_UNIFORM:
    case KARST_KIND_STEPS:
    case KARST_KIND_WIDE:
        return 0;
    case KARST_KIND_AFFINE:
        return 0x1p-23 * fabs(value);
    default:
        return n->op == KARST_OP_NOISE ? 0x1p-22 * fmax(fabs(value), 1) : 0x1p-24 * fabs(value);
    }
}

static karst_expr find_cause(const search *s, karst_error *error)
{
    const karst_graph *g = s->program->world.graph;
    const karst_expr root = s->program->world.root[KARST_ROOT_DENSITY];
    double *weight = calloc(root + 1, sizeof *weight), most = 0;
    karst_expr cause = root;
    if (!weight) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return KARST_NO_EXPR;
    }
    karst_oracle_density(s->oracle, &s->off_at, -1);
    weight[root] = 1;
    for (karst_expr e = root; e > 0; e--) {
        const karst_expr_node *n = &g->nodes[e];
        if (!(weight[e] > 0) || n->kind == KARST_KIND_UNIFORM || n->type != KARST_TYPE_FLOAT)
            continue;
        const double value = karst_oracle_node(s->oracle, e).precise, rounds = weight[e] * rounding_of(n, value);
        if (rounds > most) {
            most = rounds;
            cause = e;
        }
        for (int k = 0; k < 4 && n->arg[k]; k++) {
            const double share = fabs(share_of(s, n, value, k));
            weight[n->arg[k]] += isfinite(share) ? weight[e] * share : 0;
        }
    }
    free(weight);
    return cause;
}

/* ---- all of it ---- */

static double cost_of(const karst_program_graph *program)
{
    const karst_graph *g = program->world.graph;
    double cost = 0;
    for (karst_expr e = 1; e <= program->world.root[KARST_ROOT_DENSITY]; e++) {
        const karst_expr_node *n = &g->nodes[e];
        if (n->kind != KARST_KIND_UNIFORM)
            cost += n->op == KARST_OP_NOISE ? NODES_AN_OCTAVE * g->noises[n->extra].num_octaves : 1;
    }
    return cost;
}

bool karst_reach_measure(const karst_program_graph *program, karst_reach *reach, karst_error *error)
{
    const karst_world_header *h = &program->header;
    const double farthest_m = h->extent_m > 0 ? h->extent_m : KARST_REACH_EXTENT_M;
    const int num_cubes = 1 + (int)ceil(log2(fmax(farthest_m / NEAREST_M, 1)));
    const double ways = MOST_NODES / (num_cubes * EVALUATIONS_A_WAY * (1 + cost_of(program)));
    if (ways < 1)
        return false;
    karst_number *values = calloc(program->num_parameters + 1, sizeof *values);
    search s = {.program = program,
                .state = 1,
                .voxel_m = ldexp(1, h->voxel_log2_m + h->exact_above_log2),
                .off_m = (double)INFINITY};
    for (uint32_t i = 0; values && i < program->num_parameters; i++)
        values[i] = program->parameters[i].value;
    s.oracle = values ? karst_oracle_create(&program->world, values, h->seed, h->voxel_log2_m, error) : NULL;
    if (!s.oracle) {
        free(values);
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    double half_m = NEAREST_M;
    for (int i = 0; i < num_cubes && half_m < 2 * s.off_m; i++, half_m *= 2)
        look_within(&s, fmin(half_m, farthest_m), (int)fmin(fmax(ways, LEAST_WAYS), MOST_WAYS));
    *reach = (karst_reach){.reach_m = SHARE_SAID * s.off_m};
    if (isfinite(s.off_m))
        reach->cause = find_cause(&s, error);
    karst_oracle_destroy(s.oracle);
    free(values);
    return !isfinite(s.off_m) || reach->cause;
}
