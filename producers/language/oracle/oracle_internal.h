/* What the two halves of the oracle share. */
#ifndef KARST_LANGUAGE_ORACLE_INTERNAL_H
#define KARST_LANGUAGE_ORACLE_INTERNAL_H

#include "producers/language/ops/affine.clh"
#include "producers/language/ops/octave.clh"
#include "producers/language/oracle/oracle.h"
#include "producers/language/ops/wide.clh"

/* A node's value in both worlds. Of a BOOL, i is the mask (-1 or 0) and d 1 or 0; of INT and UINT d is the number. */
typedef struct {
    vfloat f;
    vfloat high,
        low; /* as a pair: AFFINE and SHIFTED have a float besides, which may differ from `high`; others high = f */
    vint i;
    double d;
} karst_oracle_slot;

/* What some roots need of a graph, in order; PRECISE and DEVICE say which halves of a node's value: with doubles alone,
 * floats are computed only where they decide what is piecewise constant. */
enum { KARST_ORACLE_DEVICE = 1, KARST_ORACLE_PRECISE = 2 };
typedef struct {
    karst_expr *nodes;
    uint8_t *halves;
    uint32_t num_nodes;
} karst_oracle_plan;

struct karst_oracle {
    karst_world_layout layout;
    const karst_graph *graph;
    karst_number *values; /* of uniform nodes */
    uint8_t *known;
    uint8_t *rounds; /* per node: whether it is a FRACT or MOD that jumps where a float does (oracle_ties.c) */
    uint64_t *words; /* the world's data, as devices read it */
    karst_oracle_plan density, precise_density, shading, gradient;
    const karst_oracle *original; /* whose all of the above is, if this is a clone */
    karst_oracle_slot *slots;
    affine_position at;
    float facing[KARST_FACING_FLOATS];
    int level;
};

static inline void *karst_oracle_record(const karst_oracle *oracle, karst_expr e)
{
    return oracle->words + oracle->layout.word[e];
}

/* oracle_float.c: fills f, low, i of a node that is not known. */
void karst_oracle_step_float(karst_oracle *oracle, karst_expr e);
/* oracle_double.c: fills d; the node's floats are there. */
void karst_oracle_step_double(karst_oracle *oracle, karst_expr e);
/* oracle_ties.c: fills `rounds`, of what is not known. False: out of memory. */
bool karst_oracle_find_ties(karst_oracle *oracle);
/* oracle_float.c: the whole cells that the device takes off in such a node. Its arguments have floats. */
vfloat karst_oracle_float_cells(const karst_oracle *oracle, karst_expr e);
/* Those that its double takes off an argument of so many: near a tie, the same. A float that is farther off than
 * KARST_NEAR_TIE cells is none to go by. What is left is to be held to the cell: a float may have jumped before. */
#define KARST_NEAR_TIE 0.0625
double karst_oracle_cells_off(const karst_oracle *oracle, karst_expr e, double cells);
/* A coordinate in a noise's lattice. */
typedef struct {
    uint cell;
    double fraction; /* [0, 1) */
} karst_oracle_cell;
/* One octave of a karst_noise_base, or (along 0 to 2) its derivative along that axis, per cell. */
double karst_oracle_noise(uint8_t base, const karst_oracle_cell at[3], uint seed, int along);
/* An image at that place, as a footprint of `level` shows it; or its derivative along axis 0 to 2, per cell. */
double karst_oracle_image(const karst_octave *octave, const karst_oracle_cell at[3], int level, int along);
/* A fixed-point form as a double: error 2^-52 of its value. */
double karst_oracle_affine(const karst_oracle *oracle, const karst_linear *form);

#endif
