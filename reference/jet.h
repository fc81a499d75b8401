/* Gradient noise in double with its first and second derivatives: the lattice of noise/gradient.clh. */
#ifndef KARST_REFERENCE_JET_H
#define KARST_REFERENCE_JET_H

#include <stdint.h>

typedef struct {
    uint32_t cell;
    double fraction; /* [0, 1) */
} karst_jet_place;

typedef struct {
    double value, gradient[3], hessian[3][3]; /* per cell */
} karst_noise_jet;

void karst_noise_jet_at(const karst_jet_place place[3], uint32_t seed, karst_noise_jet *jet);

#endif
