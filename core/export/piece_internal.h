/* What the steps of a tile share. */
#ifndef KARST_EXPORT_PIECE_INTERNAL_H
#define KARST_EXPORT_PIECE_INTERNAL_H

#include "core/export/crossing.h"
#include "core/export/piece.h"

/* What is known of a corner: nothing, its sign, or its density. Those of cells that may hold surface are wanted. */
enum { CORNER_UNKNOWN, CORNER_PROVED, CORNER_LOOKED_AT, CORNER_WANTED, CORNER_SAMPLED };

/* A crossing of an edge, and of what. */
typedef struct {
    double at[3], normal[3]; /* in the grid; of length 1, or 0: none is known */
    double slope;            /* along it, of the density in a cell's width; 0: not known */
} karst_mesh_crossing;

/* Cubes of 8 or 4 cells along a side that may hold surface. */
typedef struct {
    struct {
        uint8_t first[3];    /* their lowest corner in the tile */
        double slope, slack; /* how much densities in them differ at most: for each cell along all axes, and besides */
    } cube[KARST_TILE_NUM_CELLS / 64];
    size_t num;
} karst_mesh_blocks;

struct karst_mesh_worker {
    const karst_world_metadata *about;
    karst_sampler *sampler;
    karst_grid grid;
    karst_mesh_tile *tile; /* that is being filled */
    float density[KARST_TILE_NUM_CORNERS];
    uint8_t state[KARST_TILE_NUM_CORNERS];
    karst_mesh_blocks blocks[2];                  /* of 8 cells, and of 4 */
    karst_position place_of[KARST_TILE_CORNERS];  /* of corner (i, i, i): each axis is one's own */
    uint16_t corners[KARST_TILE_NUM_CORNERS];     /* those that were sampled, in their order */
    uint32_t crossed[3 * KARST_TILE_NUM_CORNERS]; /* edges that cross the surface: 3 times the lower corner, + axis */
    size_t num_corners;
    int32_t crossing_of[3][KARST_TILE_NUM_CORNERS]; /* of the edge up from a corner; -1: none */
    /* Room that grows. */
    karst_segment *segments;
    karst_position *positions;
    float *densities, (*gradients)[3];
    karst_mesh_crossing *crossings;
    size_t num_crossings, max_segments, max_crossings;
};

static inline int karst_tile_corner(int x, int y, int z)
{
    return x + KARST_TILE_CORNERS * (y + KARST_TILE_CORNERS * z);
}
static inline void karst_tile_corner_at(int corner, int at[3])
{
    at[0] = corner % KARST_TILE_CORNERS;
    at[1] = corner / KARST_TILE_CORNERS % KARST_TILE_CORNERS;
    at[2] = corner / KARST_TILE_CORNERS / KARST_TILE_CORNERS;
}

/* piece_segments.c. Room for `num` items in place of what `room` has, which is lost; false: there is none. */
bool karst_mesh_renew(void **room, size_t num, size_t item_bytes);
/* Room for so many segments, with positions, densities and gradients. */
bool karst_mesh_make_room(karst_mesh_worker *worker, size_t num_segments, karst_error *error);
/* Finds the segments, and the normals there (towards the air; 0 where there is none). Counts samples. */
void karst_mesh_find_segments(karst_mesh_worker *worker, size_t num, double (*normals)[3]);

/* piece_sample.c: corners of cells that no bounds exclude. */
void karst_mesh_sample(karst_mesh_worker *worker);
/* piece_place.c: vertices of the tile's cells, which are known, and of its crossed faces. */
bool karst_mesh_place_vertices(karst_mesh_worker *worker, karst_error *error);

#endif
