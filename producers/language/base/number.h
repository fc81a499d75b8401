/* Numbers that the host knows: exact where they can be.
 *
 * Literals are decimals, and what a world does with them before any position comes in (0.1 / 256.0 * 3.0) is a rational
 * number. It is kept as one as long as numerator and denominator fit 63 bits; then it is a double. So a lattice
 * frequency is rounded once, into fixed point, and a period of 0.3 m is three tenths. No libm: the same bits on every
 * host.
 */
#ifndef KARST_LANGUAGE_NUMBER_H
#define KARST_LANGUAGE_NUMBER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* denominator > 0: exactly numerator / denominator, in lowest terms, and `value` is the double nearest to it.
 * denominator 0: just `value` (which may be infinite, or the one NaN). Zero has no sign. */
typedef struct {
    double value;
    int64_t numerator, denominator;
} karst_number;

karst_number karst_number_int(int64_t value);
/* A double as it is: exact if it is a ratio of 63-bit integers (every integer and most short binary fractions are). */
karst_number karst_number_double(double value);
/* A double as people write it: the shortest decimal that reads back as `value`, exactly (0.1 is one tenth). */
karst_number karst_number_shortest(double value);
/* A decimal ("12", ".5", "1.5e-3") of `length` bytes, digits only as checked by the lexer. Correctly rounded where it
 * is not exact. */
karst_number karst_number_decimal(const char *text, size_t length);
/* numerator / denominator (which is not 0), reduced. */
karst_number karst_number_ratio(int64_t numerator, int64_t denominator);

karst_number karst_number_add(karst_number a, karst_number b);
karst_number karst_number_subtract(karst_number a, karst_number b);
karst_number karst_number_multiply(karst_number a, karst_number b);
karst_number karst_number_divide(karst_number a, karst_number b); /* x/0 is IEEE's */
karst_number karst_number_negate(karst_number a);
karst_number karst_number_floor(karst_number a);
karst_number karst_number_rint(karst_number a); /* ties to even */
/* -1, 0, 1; 2 if one of them is NaN. Exact values are compared exactly. */
int karst_number_compare(karst_number a, karst_number b);
bool karst_number_is(karst_number a, int64_t value);
/* The same number: equal exact values, or equal bits. */
bool karst_number_same(karst_number a, karst_number b);
/* The float nearest to it: one rounding from the exact value. */
float karst_number_to_float(karst_number a);

/* Nearest integer (ties to even) to a * 2^shift as 128 bits; false if |result| >= 2^126 or a is not finite. */
bool karst_number_to_fixed(karst_number a, int shift, __int128 *fixed);

/* Functions in double by our own polynomials, total as LANGUAGE says: relative error below 2^-48 in the ranges that
 * worlds use. */
double karst_double_sin(double x);
double karst_double_cos(double x);
double karst_double_exp2(double x);
double karst_double_log(double x);
double karst_double_atan(double y, double x);

#endif
