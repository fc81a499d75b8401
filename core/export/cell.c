#include "core/export/cell.h"

#include <string.h>

int karst_face_corner(int face, int i)
{
    const int axis = face >> 1, side = face & 1, b = i == 1 || i == 2, c = i >= 2;
    return side << axis | b << (axis + 1) % 3 | c << (axis + 2) % 3;
}

int karst_face_edge(int face, int i)
{
    const int axis = face >> 1, side = face & 1;
    if (i == 0 || i == 2) /* along axis + 1 */
        return 4 * ((axis + 1) % 3) + ((i == 2) | side << 1);
    return 4 * ((axis + 2) % 3) + (side | (i == 1) << 1);
}

void karst_edge_corners(int edge, int corners[2])
{
    const int axis = edge >> 2, u = edge & 1, v = edge >> 1 & 1;
    corners[0] = u << (axis + 1) % 3 | v << (axis + 2) % 3;
    corners[1] = corners[0] | 1 << axis;
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
    const unsigned signs = face_signs(solid, face);
    return signs == 5 || signs == 10;
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
