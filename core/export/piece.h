/* A tile of a mesh: what a few cells hold, found by one thread on its own.
 *
 * Tiles know nothing of one another. Densities, crossings and vertices depend on their place alone, so what two tiles
 * say of a shared face agrees in every bit. */
#ifndef KARST_EXPORT_PIECE_H
#define KARST_EXPORT_PIECE_H

#include <stdbool.h>
#include <stdint.h>

#include "core/export/cell.h"
#include "core/export/grid.h"
#include "karst/mesh.h"

enum { KARST_TILE_CELLS = 32, KARST_TILE_CORNERS = KARST_TILE_CELLS + 1 };
#define KARST_TILE_NUM_CELLS (KARST_TILE_CELLS * KARST_TILE_CELLS * KARST_TILE_CELLS)
#define KARST_TILE_NUM_CORNERS (KARST_TILE_CORNERS * KARST_TILE_CORNERS * KARST_TILE_CORNERS)

/* A cell with surface in it. */
typedef struct {
    int64_t at[3]; /* in the grid */
    uint64_t first_vertex; /* of its pieces, which follow one another */
    signed char vertex_of[KARST_CELL_MAX_PIECES]; /* less that; -1: no polygon of the box has it */
    uint8_t solid;         /* corners */
    bool is_crossed;       /* a face is, as karst_face_is_crossed has it */
    signed char num_pieces, piece_of[KARST_CELL_EDGES];
    float position[KARST_CELL_MAX_PIECES][3]; /* of their vertices */
} karst_mesh_cell;

/* An edge of cells that crosses the surface. Those at the grid's lower sides are of other boxes. */
typedef struct {
    int64_t at[3]; /* its lower end */
    int axis;
    bool is_solid_below;
    double found; /* how far up it the surface is, 0 to 1 */
} karst_mesh_edge;

/* A face across `axis` whose solid corners lie across, as do its air ones: two vertices on it, each where the surface
 * goes round one of the corners `round` and `round + 2`. Not used unless cells meet twice in it. */
typedef struct {
    int64_t at[3];
    int axis, round; /* 0 or 1 */
    karst_mesh_vertex vertex[2];
} karst_mesh_face;

typedef struct {
    int64_t first[3], grid_cells[3]; /* the grid ends there */
    int num_cells[3];                /* 1 to KARST_TILE_CELLS */
    karst_mesh_vertex *vertices;
    karst_mesh_cell *cells;
    karst_mesh_edge *edges; /* whose lower end is one of the tile's cells' lower corner */
    karst_mesh_face *faces;
    size_t num_vertices, num_found, num_edges, num_faces; /* num_found: cells */
    uint64_t num_open_cells, num_samples, num_sharp;
} karst_mesh_tile;

/* What a thread works with: a sampler and memory. */
typedef struct karst_mesh_worker karst_mesh_worker;

/* Borrows world and configuration. Errors: KARST_FAILED, KARST_USAGE of edits. */
karst_mesh_worker *karst_mesh_worker_create(const karst_world *world, const karst_mesh_config *config,
                                            karst_error *error);
void karst_mesh_worker_destroy(karst_mesh_worker *worker); /* NULL is fine */

/* Whether bounds prove that the cells from `first` on hold no surface. */
bool karst_mesh_is_clear(karst_mesh_worker *worker, const int64_t first[3], const int64_t num_cells[3]);

/* Fills a tile from its `first` and `num_cells`. Errors: KARST_FAILED (memory). */
bool karst_mesh_fill_tile(karst_mesh_worker *worker, karst_mesh_tile *tile, karst_error *error);
void karst_mesh_tile_finish(karst_mesh_tile *tile); /* a zeroed one is fine */

#endif
