#include "core/export/cell.h"

#include <stdint.h>
#include <string.h>

int karst_face_corner(int face, int i)
{
    static const int8_t corner[KARST_CELL_FACES][4] = {{0, 2, 6, 4}, {1, 3, 7, 5}, {0, 4, 5, 1},
                                                       {2, 6, 7, 3}, {0, 1, 3, 2}, {4, 5, 7, 6}};
    return corner[face][i];
}

int karst_face_edge(int face, int i)
{
    static const int8_t edge[KARST_CELL_FACES][4] = {{4, 10, 5, 8},  {6, 11, 7, 9}, {8, 2, 9, 0},
                                                     {10, 3, 11, 1}, {0, 6, 1, 4},  {2, 7, 3, 5}};
    return edge[face][i];
}

static unsigned face_signs(unsigned solid, int face)
{
    unsigned signs = 0;
    for (int i = 0; i < 4; i++)
        signs |= (solid >> karst_face_corner(face, i) & 1) << i;
    return signs;
}

bool karst_face_is_crossed(unsigned solid, int face)
{
    /* Of each face corners 0 and 2, and 1 and 3. */
    static const uint8_t across[KARST_CELL_FACES][2] = {{0x41, 0x14}, {0x82, 0x28}, {0x21, 0x12},
                                                        {0x84, 0x48}, {0x09, 0x06}, {0x90, 0x60}};
    const unsigned first = across[face][0], second = across[face][1], of_face = solid & (first | second);
    return of_face == first || of_face == second;
}

/* The edge that the surface goes on to across a face. */
static int partner(unsigned solid, unsigned solid_centres, int face, int edge)
{
    const unsigned signs = face_signs(solid, face);
    int at = 0;
    while (karst_face_edge(face, at) != edge)
        at++;
    if (signs == 5 || signs == 10) {
        /* It goes round the corner that is not as the centre is: that before the edge, or behind it. */
        const unsigned centre = solid_centres >> face & 1;
        return karst_face_edge(face, (signs >> at & 1) != centre ? (at + 3) % 4 : (at + 1) % 4);
    }
    for (int i = 0; i < 4; i++)
        if (i != at && (signs >> i & 1) != (signs >> (i + 1) % 4 & 1))
            return karst_face_edge(face, i);
    return edge;
}

/* The face of an edge other than `face`; any for -1. */
static int other_face(int edge, int face)
{
    const int axis = edge >> 2, u = edge & 1, v = edge >> 1 & 1;
    const int first = 2 * ((axis + 1) % 3) + u, second = 2 * ((axis + 2) % 3) + v;
    return face == first ? second : first;
}

int karst_cell_pieces(unsigned solid, unsigned solid_centres, signed char piece_of[KARST_CELL_EDGES])
{
    int num_pieces = 0;
    memset(piece_of, -1, KARST_CELL_EDGES);
    for (int start = 0; start < KARST_CELL_EDGES; start++) {
        int corners[2];
        karst_edge_corners(start, corners);
        if (piece_of[start] >= 0 || (solid >> corners[0] & 1) == (solid >> corners[1] & 1))
            continue;
        for (int edge = start, face = -1; piece_of[edge] < 0;) {
            piece_of[edge] = (signed char)num_pieces;
            face = other_face(edge, face);
            edge = partner(solid, solid_centres, face, edge);
        }
        num_pieces++;
    }
    return num_pieces;
}

void karst_cell_table_fill(karst_cell_table *table)
{
    for (unsigned solid = 0; solid < 1 << KARST_CELL_CORNERS; solid++) {
        table->of[solid].is_crossed = false;
        for (int face = 0; face < KARST_CELL_FACES; face++)
            table->of[solid].is_crossed = table->of[solid].is_crossed || karst_face_is_crossed(solid, face);
        table->of[solid].num_pieces = (signed char)karst_cell_pieces(solid, 0, table->of[solid].piece_of);
    }
}
