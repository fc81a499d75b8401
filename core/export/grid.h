/* A box of a world as a grid: coordinates are cells from a cell below its lower corner along each axis, so that the
 * cells that touch the box's lower faces from outside have numbers, too. */
#ifndef KARST_EXPORT_GRID_H
#define KARST_EXPORT_GRID_H

#include <math.h>
#include <stdint.h>

#include "karst/position.h"

typedef struct {
    karst_position corner;
    double cell_m, footprint_m;
    int voxel_log2_m;
    double units_in_m; /* 2^-32 voxel; infinite where the corner is next to the world's edge */
} karst_grid;

karst_grid karst_grid_of(const karst_position *corner, double cell_m, double footprint_m, int voxel_log2_m);

/* Metres from the box's corner. */
static inline double karst_grid_metres(const karst_grid *grid, double cells) { return (cells - 1) * grid->cell_m; }

/* The same coordinates give the same position, whoever asks. What lies near the corner, as most does, is found as
 * karst_position_add_m finds it, in the same bits. */
static inline void karst_grid_place(const karst_grid *grid, const double at[3], karst_position *position)
{
    const double whole = 0x1.8p52, near = 0x1p51; /* adding the one rounds what is less than the other, ties to even */
    const double offset_m[3] = {karst_grid_metres(grid, at[0]), karst_grid_metres(grid, at[1]),
                                karst_grid_metres(grid, at[2])};
    const double x = offset_m[0] * grid->units_in_m, y = offset_m[1] * grid->units_in_m;
    const double z = offset_m[2] * grid->units_in_m;
    if (!(fabs(x) < near && fabs(y) < near && fabs(z) < near)) {
        *position = karst_position_add_m(grid->corner, offset_m, grid->voxel_log2_m);
        return;
    }
    const int64_t sum_x = (int64_t)(x + whole - whole) + (int64_t)grid->corner.fraction[0];
    const int64_t sum_y = (int64_t)(y + whole - whole) + (int64_t)grid->corner.fraction[1];
    const int64_t sum_z = (int64_t)(z + whole - whole) + (int64_t)grid->corner.fraction[2];
    const int64_t unit = (int64_t)1 << 32;
    position->fraction[0] = (uint32_t)sum_x;
    position->fraction[1] = (uint32_t)sum_y;
    position->fraction[2] = (uint32_t)sum_z;
    position->voxel[0] = grid->corner.voxel[0] + (sum_x - (int64_t)(uint32_t)sum_x) / unit;
    position->voxel[1] = grid->corner.voxel[1] + (sum_y - (int64_t)(uint32_t)sum_y) / unit;
    position->voxel[2] = grid->corner.voxel[2] + (sum_z - (int64_t)(uint32_t)sum_z) / unit;
}
static inline karst_position karst_grid_at(const karst_grid *grid, const double at[3])
{
    karst_position position;
    karst_grid_place(grid, at, &position);
    return position;
}

#endif
