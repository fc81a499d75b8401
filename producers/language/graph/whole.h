/* Whole numbers of places: which nodes of the canonical graph are sums of rounded places, and so of 64 bits.
 *
 * A float holds whole numbers up to 2^24, an int up to 2^31, and cells of a place that is far out have larger numbers.
 * What asks for such a number modulo another, or for its low 32 bits, is answered from the places themselves
 * (KARST_OP_CELL). */
#ifndef KARST_LANGUAGE_WHOLE_H
#define KARST_LANGUAGE_WHOLE_H

#include "producers/language/graph/graph.h"

#define KARST_WHOLE_MAX_TERMS 4u

/* (constant + the sum of factor[i] * (what atom[i] rounds down)) / divisor. An atom is a FLOOR, CEIL, RINT, CONVERT to
 * INT or SHIFT_RIGHT; CEIL(a) counts as -FLOOR(-a), what a CONVERT rounds it rounds towards 0. Numbers lie within
 * 2^31. */
typedef struct {
    karst_expr atom[KARST_WHOLE_MAX_TERMS];
    int64_t factor[KARST_WHOLE_MAX_TERMS];
    uint32_t num_terms; /* at least 1 */
    int64_t constant, divisor;
} karst_whole;

/* What an atom rounds: (constant + what atom `of` rounds) / divisor, if `of` is an atom, else its argument. */
typedef struct {
    karst_expr of;
    int64_t constant, divisor;
} karst_whole_part;

/* For each node NULL, or what it is as a whole number. `has_form`: nodes that are affine in the position, or that and a
 * float. Lives in `arena`. */
const karst_whole **karst_wholes_find(const karst_graph *graph, const uint8_t *has_form, karst_arena *arena);
/* Of an atom. */
karst_whole_part karst_whole_part_of(const karst_graph *graph, const karst_whole *const *wholes,
                                     const uint8_t *has_form, karst_expr atom);
/* True if the node rounds a place: it is its own atom. */
bool karst_whole_is_atom(const karst_whole *const *wholes, karst_expr e);
/* a - b, which are whole or constants. False: that is no whole number of a place. */
bool karst_whole_difference(const karst_graph *graph, const karst_whole *const *wholes, karst_expr a, karst_expr b,
                            karst_whole *difference);

#endif
