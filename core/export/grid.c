#include "core/export/grid.h"

/* Corners that are farther out than so many voxels along an axis leave no room for what is added. */
static const int64_t FAR_VOXEL = (int64_t)1 << 61;

karst_grid karst_grid_of(const karst_position *corner, double cell_m, double footprint_m, int voxel_log2_m)
{
    karst_grid grid = {.corner = *corner,
                       .cell_m = cell_m,
                       .footprint_m = footprint_m,
                       .voxel_log2_m = voxel_log2_m,
                       .units_in_m = ldexp(1, 32 - voxel_log2_m)};
    for (int axis = 0; axis < 3; axis++)
        if (corner->voxel[axis] >= FAR_VOXEL || corner->voxel[axis] <= -FAR_VOXEL)
            grid.units_in_m = (double)INFINITY;
    return grid;
}
