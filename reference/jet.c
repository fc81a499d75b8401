#include "reference/jet.h"

#include <string.h>

#include "noise/gradient.clh"

/* The quintic weight of the upper corner, and its derivatives. */
static void fade(double t, double w[3])
{
    w[0] = t * t * t * (t * (t * 6 - 15) + 10);
    w[1] = 30 * t * t * (t - 1) * (t - 1);
    w[2] = 60 * t * (t - 1) * (2 * t - 1);
}

void karst_noise_jet_at(const karst_jet_place place[3], uint32_t seed, karst_noise_jet *jet)
{
    static const uint primes[3] = {NOISE_PRIME_X, NOISE_PRIME_Y, NOISE_PRIME_Z};
    double up[3][3];
    for (int i = 0; i < 3; i++)
        fade(place[i].fraction, up[i]);
    memset(jet, 0, sizeof *jet);
    for (int corner = 0; corner < 8; corner++) {
        uint at[3];
        double offset[3], w[3][3];
        for (int i = 0; i < 3; i++) {
            uint bit = (uint)corner >> i & 1;
            at[i] = (place[i].cell + bit) * primes[i];
            offset[i] = place[i].fraction - bit;
            w[i][0] = bit ? up[i][0] : 1 - up[i][0];
            w[i][1] = bit ? up[i][1] : -up[i][1];
            w[i][2] = bit ? up[i][2] : -up[i][2];
        }
        uint hash = noise_corner_hash(NOISE_LINE_YZ(NOISE_LINE_Y(at[1]), at[2], seed), at[0]);
        const double g[3] = {(double)noise_times_x(hash, 1.0f), (double)noise_times_y(hash, 1.0f),
                             (double)noise_times_z(hash, 1.0f)};
        double ramp = g[0] * offset[0] + g[1] * offset[1] + g[2] * offset[2];
        double weight = w[0][0] * w[1][0] * w[2][0];
        const double first[3] = {w[0][1] * w[1][0] * w[2][0], w[0][0] * w[1][1] * w[2][0], w[0][0] * w[1][0] * w[2][1]};
        jet->value += weight * ramp;
        for (int i = 0; i < 3; i++) {
            jet->gradient[i] += first[i] * ramp + weight * g[i];
            for (int j = 0; j <= i; j++) {
                int order[3] = {0, 0, 0};
                order[i]++;
                order[j]++;
                double second = w[0][order[0]] * w[1][order[1]] * w[2][order[2]];
                jet->hessian[i][j] += second * ramp + first[i] * g[j] + first[j] * g[i];
            }
        }
    }
    for (int i = 0; i < 3; i++)
        for (int j = i + 1; j < 3; j++)
            jet->hessian[i][j] = jet->hessian[j][i];
}
