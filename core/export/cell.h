/* Pieces of surface in a cell, from the signs of its corners.
 *
 * Corner c lies at (c & 1, c >> 1 & 1, c >> 2). Edge 4 a + (u | v << 1) runs along axis a, u along axis a + 1 and v
 * along axis a + 2. Face 2 a + s lies across axis a. Corners of a face go round: (0, 0), (1, 0), (1, 1), (0, 1) along
 * axes a + 1 and a + 2; its edge i joins corners i and i + 1. */
#ifndef KARST_EXPORT_CELL_H
#define KARST_EXPORT_CELL_H

#include <stdbool.h>

enum { KARST_CELL_CORNERS = 8, KARST_CELL_EDGES = 12, KARST_CELL_FACES = 6, KARST_CELL_MAX_PIECES = 4 };

int karst_face_corner(int face, int i);
int karst_face_edge(int face, int i);
/* The lower corner of an edge; both corners, the lower one first. */
static inline int karst_edge_lower(int edge)
{
    static const signed char lower[KARST_CELL_EDGES] = {0, 2, 4, 6, 0, 4, 1, 5, 0, 1, 2, 3};
    return lower[edge];
}
static inline void karst_edge_corners(int edge, int corners[2])
{
    corners[0] = karst_edge_lower(edge);
    corners[1] = corners[0] | 1 << (edge >> 2);
}

/* Whether solid corners of a face lie across, and air ones too. `solid` has a bit for each corner. */
bool karst_face_is_crossed(unsigned solid, int face);

/* Fills which piece each edge belongs to (-1: it does not cross the surface) and returns how many there are. A bit of
 * `solid_centres` says whether the centre of a face is solid, of those that are crossed. */
int karst_cell_pieces(unsigned solid, unsigned solid_centres, signed char piece_of[KARST_CELL_EDGES]);

/* The same of all cells whose pieces the signs of their corners decide. */
typedef struct {
    struct {
        bool is_crossed; /* a face is: the rest is as if all centres were air */
        signed char num_pieces, piece_of[KARST_CELL_EDGES];
    } of[1 << KARST_CELL_CORNERS];
} karst_cell_table;
void karst_cell_table_fill(karst_cell_table *table);

#endif
