#include "producers/language/graph/lipschitz.h"

#include <math.h>

#include "noise/bounds.clh"
#include "producers/language/image/image.h"

/* Of one octave, per cell: suprema of |gradient| (noise/bounds.clh; 3.75 for gradient and value noise). */
static const double noise_steepness_per_cell[KARST_NUM_NOISE_BASES] = {3.76, 3.76, NOISE_SIMPLEX_STEEPNESS, 1, 1};

typedef struct {
    const karst_graph *graph;
    const karst_range *ranges;
    karst_lipschitz *steepness;
} analysis;

static double magnitude(karst_range r) { return fmax(fabs(r.lo), fabs(r.hi)); }
static double steepness_of(const analysis *a, karst_expr e) { return a->steepness[e].constant; }
/* A factor of 0 wins over a steepness without bound: the product is constant. */
static double times(double factor, double steepness) { return factor == 0 || steepness == 0 ? 0 : factor * steepness; }

static double affine_steepness(const analysis *a, const karst_affine *form)
{
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        double m = form->coefficient[i] ? magnitude(a->ranges[form->coefficient[i]]) : 0;
        sum += m * m;
    }
    return sqrt(sum);
}

/* The largest singular value of a matrix is at most its Frobenius norm, and at most the root of its largest row sum
 * times its largest column sum. */
static double jacobian_norm(const analysis *a, const karst_expr *row, int rows)
{
    double frobenius = 0, columns[3] = {0}, largest_row = 0;
    bool affine = true;
    for (int i = 0; i < rows; i++) {
        const karst_expr_node *n = &a->graph->nodes[row[i]];
        double sum = 0;
        frobenius += steepness_of(a, row[i]) * steepness_of(a, row[i]);
        affine &= n->op == KARST_OP_AFFINE;
        for (int k = 0; k < 3 && affine; k++) {
            karst_expr c = a->graph->affines[n->extra].coefficient[k];
            double m = c ? magnitude(a->ranges[c]) : 0;
            columns[k] += m;
            sum += m;
        }
        largest_row = fmax(largest_row, sum);
    }
    double largest_column = fmax(columns[0], fmax(columns[1], columns[2]));
    return affine ? fmin(sqrt(frobenius), sqrt(largest_row * largest_column)) : sqrt(frobenius);
}

static double noise_steepness(const analysis *a, const karst_expr_node *n)
{
    const karst_noise *noise = &a->graph->noises[n->extra];
    if (noise->derivative)
        return (double)INFINITY;
    karst_expr row[3] = {n->arg[0], n->arg[1], n->arg[2]};
    if (noise->image)
        return times(karst_samples_image_steepness(noise->image), jacobian_norm(a, row, (int)noise->image->num_axes));
    double gain = magnitude(a->ranges[noise->gain]), lacunarity = magnitude(a->ranges[noise->lacunarity]), factor = 1,
           sum = 0;
    for (int k = 0; k < noise->num_octaves; k++, factor *= gain * lacunarity)
        sum += factor;
    /* a SHIFTED moves by its shift on top of its form */
    bool doubled = noise->shape == KARST_NOISE_RIDGED || noise->shape == KARST_NOISE_BILLOW;
    return times(noise_steepness_per_cell[noise->base] * sum * (doubled ? 2 : 1), jacobian_norm(a, row, 3));
}

static double product_steepness(const analysis *a, karst_expr x, karst_expr y)
{
    return times(magnitude(a->ranges[x]), steepness_of(a, y)) + times(magnitude(a->ranges[y]), steepness_of(a, x));
}

/* d(x/y) = (dx - (x/y) dy) / y */
static double quotient_steepness(const analysis *a, karst_expr q, karst_expr x, karst_expr y)
{
    karst_range by = a->ranges[y];
    if (by.lo <= 0 && by.hi >= 0)
        return (double)INFINITY;
    double least = fmin(fabs(by.lo), fabs(by.hi));
    return (steepness_of(a, x) + times(magnitude(a->ranges[q]), steepness_of(a, y))) / least;
}

static double smooth_steepness(const analysis *a, karst_expr e)
{
    const karst_expr_node *n = &a->graph->nodes[e];
    karst_expr x = n->arg[0], y = n->arg[1], z = n->arg[2];
    double sx = steepness_of(a, x), sy = steepness_of(a, y), sz = steepness_of(a, z);
    switch (n->op) {
    case KARST_OP_NORMAL:
    case KARST_OP_FOOTPRINT:
        return 0; /* of the position: the surface's affair */
    case KARST_OP_AFFINE:
        return affine_steepness(a, &a->graph->affines[n->extra]);
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
    case KARST_OP_SHIFTED:
        return sx + sy;
    case KARST_OP_MULTIPLY:
        return product_steepness(a, x, y);
    case KARST_OP_FMA:
        return product_steepness(a, x, y) + sz;
    case KARST_OP_DIVIDE:
        return quotient_steepness(a, e, x, y);
    case KARST_OP_NEGATE:
    case KARST_OP_ABS:
    case KARST_OP_COS:
    case KARST_OP_SIN:
        return sx;
    case KARST_OP_SIN_TURNS:
    case KARST_OP_COS_TURNS:
        return 6.2831854 * sx;
    case KARST_OP_MIN:
    case KARST_OP_MAX:
        return fmax(sx, sy);
    case KARST_OP_MIX: {
        karst_range t = a->ranges[z];
        double away = fmax(fabs(a->ranges[y].hi - a->ranges[x].lo), fabs(a->ranges[x].hi - a->ranges[y].lo));
        double blend = t.lo >= 0 && t.hi <= 1
                           ? fmax(sx, sy)
                           : times(magnitude(t), sy) + times(fmax(fabs(1 - t.lo), fabs(1 - t.hi)), sx);
        return blend + times(away, sz);
    }
    case KARST_OP_SQRT:
        return a->ranges[x].lo > 0 ? sx / (2 * sqrt(a->ranges[x].lo)) : sx == 0 ? 0 : (double)INFINITY;
    case KARST_OP_LENGTH:
        return jacobian_norm(a, n->arg, n->arg[3] ? 4 : n->arg[2] ? 3 : 2);
    case KARST_OP_EXP2:
        return times(0.69314719 * magnitude(a->ranges[e]), sx);
    case KARST_OP_LOG:
        return sx / fmax(a->ranges[x].lo, 0x1p-126);
    case KARST_OP_NOISE:
        return noise_steepness(a, n);
    default:
        return (double)INFINITY;
    }
}

void karst_graph_lipschitz(const karst_graph *resolved, const karst_range *ranges, karst_lipschitz *steepness)
{
    analysis a = {.graph = resolved, .ranges = ranges, .steepness = steepness};
    steepness[0] = (karst_lipschitz){0};
    for (karst_expr e = 1; e < resolved->num_nodes; e++) {
        const karst_expr_node *n = &resolved->nodes[e];
        karst_lipschitz s = {0};
        bool varies = n->depends & (KARST_DEPENDS_X | KARST_DEPENDS_Y | KARST_DEPENDS_Z);
        if (varies) {
            s.jumps = n->kind == KARST_KIND_STEPS || n->op == KARST_OP_SELECT || n->op == KARST_OP_FRACT ||
                      n->op == KARST_OP_MOD || n->op == KARST_OP_ATAN || n->op == KARST_OP_BITS;
            s.constant = s.jumps ? (double)INFINITY : smooth_steepness(&a, e);
            if (isnan(s.constant))
                s.constant = (double)INFINITY;
        }
        if (s.constant == (double)INFINITY) {
            s.cause = e;
            for (int k = 3; k >= 0; k--) /* the deepest that is at fault */
                if (n->arg[k] && steepness[n->arg[k]].cause) {
                    s.cause = steepness[n->arg[k]].cause;
                    s.jumps = steepness[n->arg[k]].jumps;
                }
        }
        steepness[e] = s;
    }
}
