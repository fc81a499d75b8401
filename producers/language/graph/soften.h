/* Colours without aliasing: what changes faster than a footprint shows is faded to its mean, edges become as wide as
 * the footprint (LANGUAGE, "band limit"). Octaves of noise fade by themselves; this is for what the text does with
 * sines, fract, mod, comparisons, and rests of numbers of cells (checkers). Densities keep their edges: their features
 * are the surface. Textures of files are what is fast to look up (ops/texture.clh), while densities have splines, which
 * are smooth and have bounds. */
#ifndef KARST_LANGUAGE_SOFTEN_H
#define KARST_LANGUAGE_SOFTEN_H

#include "producers/language/graph/graph.h"

/* Appends to the graph (with AFFINE leaves, kinds not set yet) what the roots, floats, are to become, and updates them.
 * How fast an argument changes along the surface is an estimate by the chain rule, from uniform numbers and the normal:
 * exact for what is affine, typical for noise; what has none (a normal, say) stays sharp. So what changes only across
 * the surface, as height does on level ground, keeps its edges. Footprints are as wide along the surface as across the
 * view: what is seen edge on is left to samples. With a footprint of 0 nothing changes but exact ties.
 * A voxel of level 0 is 2^voxel_log2_m metres wide. */
void karst_soften(karst_graph *graph, int voxel_log2_m, karst_expr *roots, size_t num_roots);

#endif
