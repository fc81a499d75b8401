/* Repeatable random numbers for tests. */
#ifndef KARST_TESTS_NOISE_RANDOM_H
#define KARST_TESTS_NOISE_RANDOM_H

#include <math.h>
#include <stdint.h>

static uint64_t random_state = 0x9e3779b97f4a7c15u;

static inline uint64_t random_bits(void)
{
    /* splitmix64 */
    uint64_t z = random_state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

/* 0 to n - 1. */
static inline int64_t random_below(int64_t n) { return (int64_t)(random_bits() % (uint64_t)n); }

/* From a to b, both included. */
static inline int64_t random_between(int64_t a, int64_t b) { return a + random_below(b - a + 1); }

/* In [0, 1). */
static inline double random_unit(void) { return (double)(random_bits() >> 11) * 0x1p-53; }

/* Evenly spread over the magnitudes between low and high, both > 0. */
static inline double random_magnitude(double low, double high) { return low * exp2(random_unit() * log2(high / low)); }

#endif
