#include "reference/jet.h"

#include <string.h>

#include "noise/gradient.clh"

/* Along one axis, for the two corners: weight, and weight times offset, with two derivatives. */
typedef struct {
    double weight[2][3], moment[2][3]; /* [corner][order] */
} jet_axis;

static jet_axis axis_at(double t)
{
    const double s = t - 1;
    const double w[3] = {t * t * t * (t * (t * 6 - 15) + 10), 30 * t * t * s * s, 60 * t * s * (2 * t - 1)};
    jet_axis axis;
    for (int k = 0; k < 3; k++) {
        axis.weight[1][k] = w[k];
        axis.weight[0][k] = (k == 0) - w[k];
    }
    for (int corner = 0; corner < 2; corner++) {
        const double *u = axis.weight[corner], offset = corner ? s : t;
        axis.moment[corner][0] = u[0] * offset;
        axis.moment[corner][1] = u[1] * offset + u[0];
        axis.moment[corner][2] = u[2] * offset + 2 * u[1];
    }
    return axis;
}

static const double signs[2] = {1, -1};

/* Sums over the corners of the lattice line (y, z): of the gradient's x part times moment, of its y and z parts times
 * weight; each with derivatives along x. */
typedef struct {
    double p[3], q[3], r[3];
} jet_line;

static jet_line line_at(uint line, const uint at_x[2], const jet_axis *x)
{
    jet_line sum;
    memset(&sum, 0, sizeof sum);
    for (int corner = 0; corner < 2; corner++) {
        uint hash = noise_corner_hash(line, at_x[corner]);
        double gx = hash < NOISE_THIRD ? 0 : signs[hash & 1],
               gy = hash >= NOISE_THIRD && hash < NOISE_TWO_THIRDS ? 0 : signs[hash >> 1 & 1],
               gz = hash >= NOISE_TWO_THIRDS ? 0 : signs[hash >> 2 & 1];
        for (int k = 0; k < 3; k++) {
            sum.p[k] += gx * x->moment[corner][k];
            sum.q[k] += gy * x->weight[corner][k];
            sum.r[k] += gz * x->weight[corner][k];
        }
    }
    return sum;
}

void karst_noise_jet_at(const karst_jet_place place[3], uint32_t seed, karst_noise_jet *jet)
{
    const jet_axis x = axis_at(place[0].fraction), y = axis_at(place[1].fraction), z = axis_at(place[2].fraction);
    const uint at_x[2] = {place[0].cell * NOISE_PRIME_X, (place[0].cell + 1) * NOISE_PRIME_X};
    double sum[3][3][3]; /* [order in x][in y][in z], together at most 2 */
    memset(sum, 0, sizeof sum);
    for (uint side = 0; side < 2; side++) {
        uint line_y = NOISE_LINE_Y((place[1].cell + side) * NOISE_PRIME_Y);
        double p[3][3] = {{0}}, q[3][3] = {{0}}; /* [order in x][in z] */
        for (uint far = 0; far < 2; far++) {
            uint at_z = (place[2].cell + far) * NOISE_PRIME_Z;
            jet_line line = line_at(NOISE_LINE_YZ(line_y, at_z, seed), at_x, &x);
            for (int i = 0; i < 3; i++)
                for (int k = 0; i + k < 3; k++) {
                    p[i][k] += line.p[i] * z.weight[far][k] + line.r[i] * z.moment[far][k];
                    q[i][k] += line.q[i] * z.weight[far][k];
                }
        }
        for (int i = 0; i < 3; i++)
            for (int k = 0; i + k < 3; k++)
                for (int j = 0; i + j + k < 3; j++)
                    sum[i][j][k] += p[i][k] * y.weight[side][j] + q[i][k] * y.moment[side][j];
    }
    *jet = (karst_noise_jet){.value = sum[0][0][0],
                             .gradient = {sum[1][0][0], sum[0][1][0], sum[0][0][1]},
                             .hessian = {{sum[2][0][0], sum[1][1][0], sum[1][0][1]},
                                         {sum[1][1][0], sum[0][2][0], sum[0][1][1]},
                                         {sum[1][0][1], sum[0][1][1], sum[0][0][2]}}};
}
