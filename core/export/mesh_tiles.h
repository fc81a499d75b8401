/* The mesh of a box, for who wants to know where its parts come from. */
#ifndef KARST_EXPORT_MESH_TILES_H
#define KARST_EXPORT_MESH_TILES_H

#include "karst/mesh.h"

/* As karst_mesh_find. Before what a tile adds, begin_tile (may be NULL) gets the sink's user and the tile's lowest cell
 * (in the grid: core/export/grid.h; KARST_TILE_CELLS cells wide). Tiles come in slabs across z, from the lowest on, and
 * their triangles have vertices of the same slab and of the one before. */
bool karst_mesh_find_tiles(const karst_world *world, const karst_mesh_config *config, const karst_mesh_sink *sink,
                           bool (*begin_tile)(void *user, const int64_t first[3], karst_error *error),
                           karst_mesh_stats *stats, karst_error *error);

/* How many are to work. */
int karst_mesh_num_threads(const karst_mesh_config *config);

#endif
