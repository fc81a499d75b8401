/* Bounds of openness as kernels and host see them. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_OPENNESS_SHARED_H
#define KARST_RAYCAST_OPENNESS_SHARED_H

#include "core/device/dialect.h"

/* The hemisphere above a surface is cut into cells of directions: parts of a turn about the normal, and parts of the
 * square of the sine of the angle above the surface. So each counts as much as any other of its depth. Cells of the
 * next depth have half as many parts of both. */
#define KARST_OPENNESS_AROUND 8 /* cells of depth 0 */
#define KARST_OPENNESS_UP 2
#define KARST_OPENNESS_DEPTH 3 /* the most there is: 1,024 cells */

/* What is found of each of the finest cells, where that is asked for: those of one part of the turn follow one another,
 * from the lowest one. */
#define KARST_OPENNESS_FINEST_UP (KARST_OPENNESS_UP << KARST_OPENNESS_DEPTH)
#define KARST_OPENNESS_CELLS ((KARST_OPENNESS_AROUND << KARST_OPENNESS_DEPTH) * KARST_OPENNESS_FINEST_UP)
#define KARST_OPENNESS_UNDECIDED 0
#define KARST_OPENNESS_OPEN 1
#define KARST_OPENNESS_HIDDEN 2

/* Cosines and sines of parts of a turn: cells' middles and halves of all depths are among them. */
#define KARST_OPENNESS_TURNS (2 * KARST_OPENNESS_AROUND << KARST_OPENNESS_DEPTH)

typedef struct {
    uint first_pixel, end_pixel; /* of the picture, in packet order */
    int depth;                   /* of the finest cells */
    float cone;                  /* growth of footprints */
    uint tells_cells;            /* what is found of each is asked for */
    uint pad[3];
} karst_openness_task;
K_ASSERT_SIZE(karst_openness_task, 32);

#endif
