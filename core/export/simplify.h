/* Coarser levels of a mesh, by taking vertices away: what is left of them stays where it is.
 *
 * A vertex goes by moving along an edge to a neighbour, where that brings the surface least away from the planes of the
 * triangles that it stands for (the quadrics of Garland and Heckbert 1997). Vertices at edges with one triangle never
 * go, nor do edges come up between two of them: so all levels end in the same edges, and parts of a mesh fit together
 * at any levels. Closed surfaces stay closed, and manifold: an edge goes only where its ends have two neighbours in
 * common (Dey, Edelsbrunner, Guha and Nekhayev 1999). */
#ifndef KARST_EXPORT_SIMPLIFY_H
#define KARST_EXPORT_SIMPLIFY_H

#include "karst/error.h"
#include "karst/mesh.h"

/* A part of a mesh, whose indices count its own vertices, all of them in use. */
typedef struct {
    const karst_mesh_vertex *vertices;
    const uint32_t (*triangles)[3];
    size_t num_vertices, num_triangles;
    double cell_m;
    int num_levels; /* 1 to KARST_MESH_MAX_LEVELS */
} karst_mesh_part;

/* Fills all but `at` of the chunk, whose arrays are malloc'ed: karst_mesh_chunk_finish. Errors: KARST_FAILED
 * (memory). */
bool karst_mesh_simplify(const karst_mesh_part *part, karst_mesh_chunk *chunk, karst_error *error);
void karst_mesh_chunk_finish(karst_mesh_chunk *chunk); /* a zeroed one is fine */

#endif
