/* Which corners of a tile are sampled: those of cells that no bounds exclude. */
#include <math.h>
#include <string.h>

#include "core/export/piece_internal.h"

/* Cells along a side that are sampled without asking for bounds of less: a bound costs as much as fifty samples. */
enum { LEAF_CELLS = 8 };
/* Places are rounded to 2^-32 voxel: so much wider are boxes that are bounded, in voxels. */
#define ROUNDING 0x1p-30

/* 1: all solid, -1: all air, 0: not known. */
static int bound_cells(karst_mesh_worker *worker, const int64_t first[3], const int64_t num[3])
{
    const karst_grid *grid = &worker->grid;
    double middle[3], half_m[3], range[2];
    for (int axis = 0; axis < 3; axis++) {
        middle[axis] = (double)first[axis] + (double)num[axis] / 2;
        half_m[axis] = (double)num[axis] / 2 * grid->cell_m * (1 + 0x1p-40) + ldexp(ROUNDING, grid->voxel_log2_m);
    }
    const karst_position centre = karst_grid_at(grid, middle);
    if (!karst_sampler_bounds(worker->sampler, &centre, half_m, grid->footprint_m, range))
        return 0;
    return range[0] > 0 ? 1 : range[1] <= 0 ? -1 : 0;
}

bool karst_mesh_is_clear(karst_mesh_worker *worker, const int64_t first[3], const int64_t num_cells[3])
{
    return bound_cells(worker, first, num_cells) != 0;
}

/* Corners of a box of cells become wanted, or (what is not wanted) have a sign. */
static void mark(karst_mesh_worker *worker, const int first[3], const int num[3], int sign)
{
    for (int z = first[2]; z <= first[2] + num[2]; z++)
        for (int y = first[1]; y <= first[1] + num[1]; y++)
            for (int x = first[0]; x <= first[0] + num[0]; x++) {
                const int c = karst_tile_corner(x, y, z);
                if (sign == 0) {
                    worker->state[c] = CORNER_WANTED;
                } else if (worker->state[c] == CORNER_UNKNOWN) {
                    worker->state[c] = CORNER_PROVED;
                    worker->density[c] = (float)sign;
                }
            }
}

/* A cube of `size` cells, as far as it lies in the tile. */
static void look(karst_mesh_worker *worker, const int first[3], int size)
{
    karst_mesh_tile *tile = worker->tile;
    int num[3];
    int64_t at[3], num_bounded[3];
    for (int axis = 0; axis < 3; axis++) {
        num[axis] = tile->num_cells[axis] - first[axis];
        if (num[axis] <= 0)
            return;
        num[axis] = num[axis] < size ? num[axis] : size;
        at[axis] = tile->first[axis] + first[axis];
        num_bounded[axis] = num[axis];
    }
    const int sign = bound_cells(worker, at, num_bounded);
    if (sign != 0 || size == LEAF_CELLS) {
        mark(worker, first, num, sign);
        tile->num_open_cells += sign ? 0 : (uint64_t)num[0] * (uint64_t)num[1] * (uint64_t)num[2];
        return;
    }
    for (int i = 0; i < 8; i++) {
        const int half = size / 2;
        const int part[3] = {first[0] + (i & 1) * half, first[1] + (i >> 1 & 1) * half, first[2] + (i >> 2) * half};
        look(worker, part, half);
    }
}

enum { AT_ONCE = 2048 };

static void sample_wanted(karst_mesh_worker *worker)
{
    const karst_mesh_tile *tile = worker->tile;
    karst_position positions[AT_ONCE];
    float densities[AT_ONCE];
    int corners[AT_ONCE], num = 0;
    for (int c = 0; c <= KARST_TILE_NUM_CORNERS; c++) {
        const bool is_last = c == KARST_TILE_NUM_CORNERS;
        if (!is_last && worker->state[c] == CORNER_WANTED) {
            const double at[3] = {
                (double)(tile->first[0] + c % KARST_TILE_CORNERS),
                (double)(tile->first[1] + c / KARST_TILE_CORNERS % KARST_TILE_CORNERS),
                (double)(tile->first[2] + c / KARST_TILE_CORNERS / KARST_TILE_CORNERS),
            };
            positions[num] = karst_grid_at(&worker->grid, at);
            corners[num++] = c;
        }
        if (num < AT_ONCE && !is_last)
            continue;
        karst_sampler_densities(worker->sampler, positions, (size_t)num, worker->grid.footprint_m, densities);
        for (int i = 0; i < num; i++)
            worker->density[corners[i]] = densities[i];
        worker->tile->num_samples += (uint64_t)num;
        num = 0;
    }
}

void karst_mesh_sample(karst_mesh_worker *worker)
{
    memset(worker->state, CORNER_UNKNOWN, sizeof worker->state);
    look(worker, (const int[3]){0, 0, 0}, KARST_TILE_CELLS);
    sample_wanted(worker);
}
