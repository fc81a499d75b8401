/* A box of a world as a grid: coordinates are cells from a cell below its lower corner along each axis, so that the
 * cells that touch the box's lower faces from outside have numbers, too. */
#ifndef KARST_EXPORT_GRID_H
#define KARST_EXPORT_GRID_H

#include "karst/position.h"

typedef struct {
    karst_position corner;
    double cell_m, footprint_m;
    int voxel_log2_m;
} karst_grid;

/* Metres from the box's corner. */
static inline double karst_grid_metres(const karst_grid *grid, double cells) { return (cells - 1) * grid->cell_m; }

/* The same coordinates give the same position, whoever asks. */
static inline karst_position karst_grid_at(const karst_grid *grid, const double at[3])
{
    const double offset_m[3] = {karst_grid_metres(grid, at[0]), karst_grid_metres(grid, at[1]),
                                karst_grid_metres(grid, at[2])};
    return karst_position_add_m(grid->corner, offset_m, grid->voxel_log2_m);
}

#endif
