/* What the steps of a tile share. */
#ifndef KARST_EXPORT_PIECE_INTERNAL_H
#define KARST_EXPORT_PIECE_INTERNAL_H

#include "core/export/crossing.h"
#include "core/export/piece.h"

/* Corners of a tile in rows along x, a bit for each of them. */
enum { KARST_TILE_ROWS = KARST_TILE_CORNERS * KARST_TILE_CORNERS };
typedef uint64_t karst_tile_rows[KARST_TILE_ROWS];

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
    karst_cell_table pieces;
    karst_mesh_tile *tile; /* that is being filled */
    /* Corners of cells that may hold surface; those whose density is known; those that are solid, by it or by proof.
     * What is in none of them is air by proof. */
    karst_tile_rows wanted, sampled, solid;
    float density[KARST_TILE_NUM_CORNERS];
    karst_mesh_blocks blocks[2];                  /* of 8 cells, and of 4 */
    karst_position place_of[KARST_TILE_CORNERS];  /* of corner (i, i, i): each axis is one's own */
    uint32_t crossed[3 * KARST_TILE_NUM_CORNERS]; /* edges that cross the surface: 3 times the lower corner, + axis */
    int32_t crossing_of[3][KARST_TILE_NUM_CORNERS]; /* of the edge up from a corner, if it crosses the surface */
    /* Room that grows. */
    karst_segment *segments;
    karst_position *positions;
    float *densities, (*gradients)[3];
    double (*normals)[3];
    karst_mesh_crossing *crossings;
    struct karst_mesh_seeker *seekers;
    uint32_t *open_seekers;
    karst_mesh_vertex **vertices;
    size_t num_crossings, max_segments, max_crossings, max_seekers;
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
/* Finds the segments, and the worker's normals there (towards the air; 0 where there is none). Counts samples. */
void karst_mesh_find_segments(karst_mesh_worker *worker, size_t num);

/* Bits `first` to `first` + num of a row. */
static inline uint64_t karst_tile_bits(int first, int num) { return (((uint64_t)2 << num) - 1) << first; }
/* The lowest bit of a row that is not 0, which is taken away. */
static inline int karst_tile_next(uint64_t *row)
{
    const int lowest = __builtin_ctzll(*row);
    *row &= *row - 1;
    return lowest;
}

/* piece_sample.c: corners of cells that no bounds exclude. */
void karst_mesh_sample(karst_mesh_worker *worker);
/* piece_place.c: vertices of the tile's cells, which are known, and of its crossed faces. */
bool karst_mesh_place_vertices(karst_mesh_worker *worker, karst_error *error);

#endif
