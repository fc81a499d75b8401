/* What the steps of a tile share. */
#ifndef KARST_EXPORT_PIECE_INTERNAL_H
#define KARST_EXPORT_PIECE_INTERNAL_H

#include "core/export/crossing.h"
#include "core/export/piece.h"

/* What is known of a corner. */
enum { CORNER_UNKNOWN, CORNER_PROVED, CORNER_WANTED };

/* A crossing of an edge, and of what. */
typedef struct {
    double at[3], normal[3]; /* in the grid; of length 1, or 0: none is known */
} karst_mesh_crossing;

struct karst_mesh_worker {
    const karst_world_metadata *about;
    karst_sampler *sampler;
    karst_grid grid;
    karst_mesh_tile *tile; /* that is being filled */
    float density[KARST_TILE_NUM_CORNERS];
    uint8_t state[KARST_TILE_NUM_CORNERS];
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
