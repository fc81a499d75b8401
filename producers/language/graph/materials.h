/* What models are made of, as part of what shading computes: where a model's box is, and the text's own matter is not,
 * a surface has the model's values in place of the text's. */
#ifndef KARST_LANGUAGE_MATERIALS_H
#define KARST_LANGUAGE_MATERIALS_H

#include "producers/language/graph/entries.h"

/* Values of a material; those that are not given stay the text's. */
typedef struct {
    bool is_clear;                 /* of clear matter; else of land */
    bool is_everywhere;            /* nothing else of that is in the scene: no box is looked at */
    bool has[KARST_NUM_OUTPUTS];   /* by what a surface of land gives: colour, mirror, gloss, emission, ior ... */
    double value[KARST_NUM_ROOTS]; /* by its roots */
    karst_number at[3];            /* of the middle of its box, metres */
    double axes[3][3];             /* unit vectors along the box's sides */
    double half_m[3];              /* its sides, halved */
    double margin_m;               /* farther out it is still the model's surface that is seen */
} karst_model_material;

/* Lays them over the roots of a canonical graph, later ones over earlier ones. What the text does not give of a surface
 * is what pictures show then: `plain` is the colour of steep and flat land. Where the graph is full, its `full` is
 * called. */
void karst_add_materials(karst_graph *graph, int voxel_log2_m, karst_expr root[KARST_NUM_ROOTS],
                         const float plain[2][3], const karst_model_material *materials, size_t num);

#endif
