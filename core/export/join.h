/* Tiles become one mesh: vertices get their numbers, and edges that cross the surface their polygons. */
#ifndef KARST_EXPORT_JOIN_H
#define KARST_EXPORT_JOIN_H

#include "core/export/piece.h"

typedef struct karst_mesh_join karst_mesh_join;

/* Borrows sink and statistics. Errors: KARST_FAILED (memory). */
karst_mesh_join *karst_mesh_join_create(const karst_grid *grid, const karst_mesh_sink *sink, karst_mesh_stats *stats,
                                        karst_error *error);
void karst_mesh_join_destroy(karst_mesh_join *join); /* NULL is fine */

/* Tiles of the next slab across z follow. Keeps what its cells share with those of the slab before. */
void karst_mesh_join_begin_slab(karst_mesh_join *join);
/* After all tiles that touch it and lie at least as low along each axis; those that hold no surface may be left out.
 * Errors: those of the sink, KARST_FAILED (memory), KARST_USAGE (too many vertices). */
bool karst_mesh_join_add(karst_mesh_join *join, karst_mesh_tile *tile, karst_error *error);

#endif
