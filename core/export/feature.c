/* The least squares of dual contouring, by the eigenvectors of the planes' normals: those along which the planes say
 * next to nothing are left out, so that flat pieces keep their middle. */
#include "core/export/feature.h"

#include <math.h>

/* Of the largest eigenvalue: what curved surfaces come to, and sharp edges do not. */
#define LEAST_EIGENVALUE 0.02
/* Cosine of the angle between two planes that make an edge. */
#define EDGE_COSINE 0.6
#define SWEEPS 12
#define MOST_PLANES 12
/* Planes are as good as parallel if their mean says so much of them: what remains is left out anyway. */
#define PARALLEL (1 / (1 + LEAST_EIGENVALUE))
#define ITERATIONS 8 /* each takes as much away of what is not along the eigenvector */
/* Of the trace: what stands beside the diagonal is so small after a few sweeps, and changes nothing then. */
#define SMALL 1e-17

/* Jacobi's rotations. Columns of `vectors` become eigenvectors of the symmetric `m`, whose diagonal their values. */
static void diagonalise(double m[3][3], double vectors[3][3])
{
    const double small = SMALL * (m[0][0] + m[1][1] + m[2][2]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            vectors[i][j] = i == j;
    for (int sweep = 0; sweep < SWEEPS && fabs(m[0][1]) + fabs(m[0][2]) + fabs(m[1][2]) > small; sweep++)
        for (int p = 0; p < 2; p++)
            for (int q = p + 1; q < 3; q++) {
                if (fabs(m[p][q]) <= small)
                    continue;
                const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
                const double t = copysign(1 / (fabs(theta) + sqrt(theta * theta + 1)), theta);
                const double c = 1 / sqrt(t * t + 1), s = t * c;
                for (int k = 0; k < 3; k++) {
                    const double a = m[k][p], b = m[k][q];
                    m[k][p] = c * a - s * b;
                    m[k][q] = s * a + c * b;
                }
                for (int k = 0; k < 3; k++) {
                    const double a = m[p][k], b = m[q][k];
                    m[p][k] = c * a - s * b;
                    m[q][k] = s * a + c * b;
                }
                for (int k = 0; k < 3; k++) {
                    const double a = vectors[k][p], b = vectors[k][q];
                    vectors[k][p] = c * a - s * b;
                    vectors[k][q] = s * a + c * b;
                }
            }
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static bool is_bent(const double (*normals)[3], int num)
{
    bool is_known[MOST_PLANES];
    for (int i = 0; i < num; i++) {
        is_known[i] = dot(normals[i], normals[i]) > 0;
        for (int j = 0; j < i; j++)
            if (dot(normals[i], normals[j]) < EDGE_COSINE && is_known[i] && is_known[j])
                return true;
    }
    return false;
}

/* Of planes that are as good as parallel the only move, along the eigenvector that their sum is next to. The largest
 * eigenvalue is at least sum^2 / num, the sum of all is num. */
static bool find_only_move(const double m[3][3], const double right[3], const double sum[3], int num, double move[3])
{
    double v[3] = {sum[0], sum[1], sum[2]}, next[3];
    if (!(dot(sum, sum) >= PARALLEL * num * num))
        return false;
    for (int i = 0; i < ITERATIONS; i++) {
        for (int axis = 0; axis < 3; axis++)
            next[axis] = dot(m[axis], v);
        for (int axis = 0; axis < 3; axis++)
            v[axis] = next[axis];
    }
    for (int axis = 0; axis < 3; axis++)
        next[axis] = dot(m[axis], v);
    /* v.right / eigenvalue, along v of length 1. */
    const double scale = dot(v, right) / dot(v, next);
    for (int axis = 0; axis < 3; axis++)
        move[axis] = v[axis] * scale;
    return true;
}

static void find_moves(double m[3][3], const double right[3], karst_feature *feature)
{
    double vectors[3][3];
    diagonalise(m, vectors);
    const double largest = fmax(m[0][0], fmax(m[1][1], m[2][2]));
    bool is_taken[3] = {false};
    while (feature->num_moves < 3) {
        int next = -1;
        for (int k = 0; k < 3; k++)
            if (!is_taken[k] && m[k][k] > LEAST_EIGENVALUE * largest && (next < 0 || m[k][k] > m[next][next]))
                next = k;
        if (next < 0)
            break;
        double along = 0;
        for (int a = 0; a < 3; a++)
            along += vectors[a][next] * right[a];
        for (int a = 0; a < 3; a++)
            feature->moves[feature->num_moves][a] = vectors[a][next] * along / m[next][next];
        feature->num_moves++;
        is_taken[next] = true;
    }
}

void karst_find_feature(const double (*points)[3], const double (*normals)[3], int num, karst_feature *feature)
{
    double m[3][3] = {{0}}, right[3] = {0}, sum[3] = {0};
    *feature = (karst_feature){.is_bent = is_bent(normals, num)};
    const double share = 1.0 / num;
    const bool is_exact = (num & (num - 1)) == 0; /* then multiplying gives the same bits, and sooner */
    for (int i = 0; i < num; i++)
        for (int axis = 0; axis < 3; axis++) {
            feature->middle[axis] += is_exact ? points[i][axis] * share : points[i][axis] / num;
            sum[axis] += normals[i][axis];
        }
    for (int i = 0; i < num; i++) {
        double distance = 0;
        for (int a = 0; a < 3; a++)
            distance += normals[i][a] * (points[i][a] - feature->middle[a]);
        for (int a = 0; a < 3; a++) {
            right[a] += normals[i][a] * distance;
            for (int b = 0; b < 3; b++)
                m[a][b] += normals[i][a] * normals[i][b];
        }
    }
    if (find_only_move((const double(*)[3])m, right, sum, num, feature->moves[0]))
        feature->num_moves = 1;
    else
        find_moves(m, right, feature);
    const double length = sqrt(dot(sum, sum));
    for (int axis = 0; axis < 3; axis++)
        feature->mean_normal[axis] = length > 1e-6 ? sum[axis] / length : 0;
}

void karst_feature_place(const karst_feature *feature, int num_moves, double place[3])
{
    for (int axis = 0; axis < 3; axis++) {
        place[axis] = feature->middle[axis];
        for (int i = 0; i < num_moves && i < feature->num_moves; i++)
            place[axis] += feature->moves[i][axis];
    }
}
