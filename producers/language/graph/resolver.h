/* What the parts of the resolver share: from the canonical graph to the resolved one (kinds.h). */
#ifndef KARST_LANGUAGE_RESOLVER_H
#define KARST_LANGUAGE_RESOLVER_H

#include "producers/language/graph/kinds.h"
#include "producers/language/graph/whole.h"

/* What a node of the canonical graph is, before anything is built. */
typedef enum { FORM_UNIFORM, FORM_AFFINE, FORM_SHIFTED, FORM_FLOAT } form_class;

/* What its users want of it. */
enum { WANT_VALUE = 1, WANT_FORM = 2, WANT_PART = 4 /* what an atom of whole numbers rounds down */ };

/* offset + sum of coefficient[i] * p[i] + shift, in nodes of the resolved graph; KARST_NO_EXPR where there is none. */
typedef struct {
    karst_expr coefficient[3], offset, shift;
} form;

typedef struct {
    const karst_graph *from;
    karst_graph *to;
    uint8_t *class, *wants, *formed; /* formed: has_form */
    karst_expr *value;               /* of each node of `from` that is wanted */
    form *forms;                     /* of each that is wanted so; of atoms what they round down */
    const karst_whole **wholes;
} resolver;

static inline bool has_form(const resolver *r, karst_expr e)
{
    return r->class[e] == FORM_AFFINE || r->class[e] == FORM_SHIFTED;
}

/* ---- form.c ---- */
/* a op b, either of which may be missing; op: ADD or SUBTRACT. */
karst_expr karst_form_part_sum(resolver *r, karst_op op, karst_expr a, karst_expr b);
form karst_form_sum(resolver *r, karst_op op, form a, form b);
/* op: MULTIPLY or DIVIDE */
form karst_form_scaled(resolver *r, karst_op op, form a, karst_expr by);
/* The form of an argument, whatever it is. */
form karst_form_of(resolver *r, karst_expr e);
/* The form without its shift, as a leaf; or as a uniform value, if the position has cancelled. */
karst_expr karst_affine_leaf(resolver *r, form f);
/* What a node that works on exact places is given. */
karst_expr karst_place_of(resolver *r, form f);
karst_expr karst_apply_to_place(resolver *r, karst_op op, karst_expr place, karst_expr b);

/* ---- whole_build.c ---- */
/* Marks what a wanted node needs that asks something of whole numbers. False: it does not. */
bool karst_want_wholes(resolver *r, karst_expr e);
/* Its value; KARST_NO_EXPR if it asks nothing of them. */
karst_expr karst_build_of_wholes(resolver *r, karst_expr e);
/* What an atom (whole.h) rounds down. */
form karst_build_part(resolver *r, karst_expr e);

/* ---- whole_away.c ---- */
/* Marks what a sum or difference of a place and its own whole number needs besides its arguments. */
void karst_want_whole_away(resolver *r, karst_expr e);
/* Its value, exact however far out: p - 8 floor(p / 8) is 8 fract(p / 8). KARST_NO_EXPR if the node is none. */
karst_expr karst_build_whole_away(resolver *r, karst_expr e);

#endif
