/* What the parts of the tape builder share. */
#ifndef KARST_LANGUAGE_TAPE_INTERNAL_H
#define KARST_LANGUAGE_TAPE_INTERNAL_H

#include "producers/language/tape/tape.h"

/* What a node gives: a float (or int, or bool), and what wide ops want of AFFINE and SHIFTED, a pair. Nodes of kind
 * WIDE are pairs and nothing else: their float is the pair's first half. */
enum { PART_VALUE, PART_PAIR, NUM_PARTS };

#define TAPE_CURVE_MOST 64 /* ops of a curve */

/* What a node is if it is a smooth minimum of a and b, within k of each other (bounds/interval_smooth.clh): of what is
 * negated, or negated itself. k is 0 where it is none. */
typedef struct {
    karst_expr a, b;
    double k;
    int order;
    bool negates_arguments, negates_result;
} karst_tape_smooth;

typedef struct {
    const karst_world_layout *layout;
    const karst_graph *graph;
    karst_tape *tape;
    bool with_curves;
    uint8_t (*needed)[NUM_PARTS];
    uint32_t (*last_use)[NUM_PARTS]; /* index of the last node that reads it; UINT32_MAX for outputs */
    uint32_t (*slot)[NUM_PARTS];
    uint32_t (*constant)[NUM_PARTS]; /* number among the tape's constants + 1 */
    uint32_t *free_slots, num_free;
    /* Curves (tape_curves.c). Of a node that one other alone decides, that one; of others, themselves. */
    karst_expr *source;
    uint8_t *is_curve;       /* 1: its bounds come from a curve; 2: read from outside of its curve, so they might */
    uint8_t *is_seen;        /* by bounds */
    karst_tape_smooth *smooth; /* of each node; with curves */
    uint32_t num_curve_code; /* instructions of curves */
    uint32_t curve_slot[TAPE_CURVE_MOST + 3], num_curve_slots; /* of their own, never another's */
} karst_tape_builder;

/* tape_parts.c */
bool karst_tape_is_wide(const karst_tape_builder *b, karst_expr e);
/* What node `e` reads as its argument number k, KARST_NO_EXPR if nothing: of an exact place, the float that moves it.
 */
karst_expr karst_tape_reads(const karst_tape_builder *b, karst_expr e, int k);
/* The t of a product t * t * (3 - 2 * t), as smoothstep has it and noises written by hand; KARST_NO_EXPR for others.
 * Its factors apart say far less than the curve: it rises from 0 to 1. */
karst_expr karst_tape_fades(const karst_tape_builder *b, karst_expr e);
int karst_tape_part(const karst_tape_builder *b, karst_expr argument, bool as_pair);
uint32_t karst_tape_operand(karst_tape_builder *b, karst_expr e, bool as_pair);
karst_instruction *karst_tape_append(karst_tape_builder *b, karst_instruction i);
uint8_t karst_tape_plain_op(const karst_tape_builder *b, karst_expr e);

/* tape_smooth.c: whether a node is one, and what of. */
bool karst_tape_find_smooth(const karst_tape_builder *b, karst_expr e, karst_tape_smooth *s);

/* tape_curves.c: finds the nodes whose bounds come from curves, and what bounds see at all. Called once it is marked
 * what is needed. */
void karst_tape_find_curves(karst_tape_builder *b, const karst_expr *roots, uint32_t num_roots);
/* What the curve of `e` reads: its source, or what moves that if it is a place; KARST_NO_EXPR if `e` has none. */
karst_expr karst_tape_curve_reads(const karst_tape_builder *b, karst_expr e);
/* The curve of `e`, which is one. */
void karst_tape_add_curve(karst_tape_builder *b, karst_expr e);

#endif
