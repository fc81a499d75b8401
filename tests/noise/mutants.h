/* Breaking one rule of the bounds at a time: include before noise/ and a world. A test must hold with no mutant and
 * fail with each. */
#ifndef KARST_TESTS_NOISE_MUTANTS_H
#define KARST_TESTS_NOISE_MUTANTS_H

enum mutant {
    MUTANT_NONE,
    MUTANT_ROUNDING,   /* intervals are not rounded outward */
    MUTANT_ERROR,      /* noise in floats counts as exact */
    MUTANT_THIRD,      /* no remainder of third order */
    MUTANT_SQUARE,     /* no second order */
    MUTANT_FADES,      /* octaves that fade are bounded as if they did not */
    MUTANT_SLOPE_REST, /* slopes without the remainder */
    MUTANT_WARP_WIDTH, /* a warp moves the box but does not widen it */
    MUTANT_CHAIN_RULE, /* slopes ignore the warp */
    MUTANT_STRATA,     /* strata are as straight as at the centre */
    MUTANT_BULGE,      /* a sphere is flat */
    MUTANT_PARTS,      /* one part of a node stands for all */
};
static enum mutant mutant;
#define NOISE_MUTANT(rule) (mutant == MUTANT_##rule)

#endif
