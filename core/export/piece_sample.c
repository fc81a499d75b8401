/* Which corners of a tile are sampled: those of cells that neither bounds exclude nor a sample near by. */
#include <math.h>
#include <string.h>

#include "core/export/piece_internal.h"
#include "producers/density/sampler_slopes.h"

/* Cells along a side of what is not bounded in parts: a bound costs as much as fifty samples, and a sample with the
 * slopes of the whole proves as much. */
enum { LEAF_CELLS = 8 };
/* Places are rounded to 2^-32 voxel: so much wider are boxes that are bounded, in voxels. */
#define ROUNDING 0x1p-30

/* 1: all solid, -1: all air, 0: not known; then `slopes` (may be NULL) says how densities differ. */
static int bound_cells(karst_mesh_worker *worker, const int64_t first[3], const int64_t num[3],
                       karst_sampler_slopes *slopes)
{
    const karst_grid *grid = &worker->grid;
    double middle[3], half_m[3], range[2];
    for (int axis = 0; axis < 3; axis++) {
        middle[axis] = (double)first[axis] + (double)num[axis] / 2;
        half_m[axis] = (double)num[axis] / 2 * grid->cell_m * (1 + 0x1p-40) + ldexp(ROUNDING, grid->voxel_log2_m);
    }
    const karst_position centre = karst_grid_at(grid, middle);
    if (!karst_sampler_prove(worker->sampler, &centre, half_m, grid->footprint_m, range, slopes))
        return 0;
    return range[0] > 0 ? 1 : range[1] <= 0 ? -1 : 0;
}

bool karst_mesh_is_clear(karst_mesh_worker *worker, const int64_t first[3], const int64_t num_cells[3])
{
    return bound_cells(worker, first, num_cells, NULL) != 0;
}

/* The part of a cube of `size` cells that lies in the tile; false: there is none. */
static bool clip(const karst_mesh_tile *tile, const int first[3], int size, int num[3])
{
    for (int axis = 0; axis < 3; axis++) {
        num[axis] = tile->num_cells[axis] - first[axis];
        if (num[axis] <= 0)
            return false;
        num[axis] = num[axis] < size ? num[axis] : size;
    }
    return true;
}

/* Corners of a box of cells become wanted, or are all solid or all air. What was sampled says the same. */
static void mark(karst_mesh_worker *worker, const int first[3], const int num[3], int sign)
{
    const uint64_t corners = karst_tile_bits(first[0], num[0]);
    uint64_t *rows = sign == 0 ? worker->wanted : worker->solid;
    if (sign == 0)
        worker->tile->num_open_cells += (uint64_t)num[0] * (uint64_t)num[1] * (uint64_t)num[2];
    for (int z = first[2]; z <= first[2] + num[2] && sign >= 0; z++)
        for (int y = first[1]; y <= first[1] + num[1]; y++)
            rows[y + KARST_TILE_CORNERS * z] |= corners;
}

static void add_block(karst_mesh_blocks *blocks, const int first[3], double slope, double slack)
{
    for (int axis = 0; axis < 3; axis++)
        blocks->cube[blocks->num].first[axis] = (uint8_t)first[axis];
    blocks->cube[blocks->num].slope = slope;
    blocks->cube[blocks->num++].slack = slack;
}

/* A cube of `size` cells, as far as it lies in the tile. */
static void look(karst_mesh_worker *worker, const int first[3], int size)
{
    karst_mesh_tile *tile = worker->tile;
    karst_sampler_slopes slopes;
    int num[3];
    int64_t at[3], num_bounded[3];
    if (!clip(tile, first, size, num))
        return;
    for (int axis = 0; axis < 3; axis++) {
        at[axis] = tile->first[axis] + first[axis];
        num_bounded[axis] = num[axis];
    }
    const int sign = bound_cells(worker, at, num_bounded, &slopes);
    if (sign == 0 && size > LEAF_CELLS) {
        for (int i = 0; i < 8; i++) {
            const int half = size / 2;
            const int part[3] = {first[0] + (i & 1) * half, first[1] + (i >> 1 & 1) * half, first[2] + (i >> 2) * half};
            look(worker, part, half);
        }
        return;
    }
    if (sign == 0 && slopes.is_known) {
        const double cell_m = worker->grid.cell_m + ldexp(ROUNDING, worker->grid.voxel_log2_m);
        add_block(&worker->blocks[0], first, (slopes.in_m[0] + slopes.in_m[1] + slopes.in_m[2]) * cell_m, slopes.slack);
    } else {
        mark(worker, first, num, sign);
    }
}

enum { AT_ONCE = 2048 };

/* At most AT_ONCE corners. */
static void sample_some(karst_mesh_worker *worker, const int *corners, size_t num)
{
    karst_position positions[AT_ONCE];
    float densities[AT_ONCE];
    if (!num)
        return;
    for (size_t i = 0; i < num; i++) {
        int at[3];
        karst_tile_corner_at(corners[i], at);
        for (int axis = 0; axis < 3; axis++) {
            positions[i].voxel[axis] = worker->place_of[at[axis]].voxel[axis];
            positions[i].fraction[axis] = worker->place_of[at[axis]].fraction[axis];
        }
    }
    karst_sampler_densities(worker->sampler, positions, num, worker->grid.footprint_m, densities);
    for (size_t i = 0; i < num; i++) {
        const int row = corners[i] / KARST_TILE_CORNERS, x = corners[i] % KARST_TILE_CORNERS;
        const uint64_t bit = (uint64_t)1 << x;
        worker->density[corners[i]] = densities[i];
        worker->sampled[row] |= bit;
        worker->solid[row] = densities[i] > 0 ? worker->solid[row] | bit : worker->solid[row] & ~bit;
    }
}

static void sample_corners(karst_mesh_worker *worker, const int *corners, size_t num)
{
    for (size_t first = 0, some; first < num; first += some) {
        some = num - first < AT_ONCE ? num - first : AT_ONCE;
        sample_some(worker, corners + first, some);
    }
    worker->tile->num_samples += num;
}

/* Calls for the parts of `size` cells of all blocks that lie in the tile; `middle` is the corner in a part's middle, -1
 * where that is not the tile's. */
static void each_part(karst_mesh_worker *worker, const karst_mesh_blocks *blocks, int size, void *user,
                      void (*take)(karst_mesh_worker *worker, size_t block, const int first[3], const int num[3],
                                   int middle, void *user))
{
    for (size_t block = 0; block < blocks->num; block++)
        for (int i = 0; i < 8; i++) {
            int first[3], num[3], middle[3];
            bool has_middle = true;
            for (int axis = 0; axis < 3; axis++) {
                first[axis] = blocks->cube[block].first[axis] + (i >> axis & 1) * size;
                middle[axis] = first[axis] + size / 2;
                has_middle = has_middle && middle[axis] <= worker->tile->num_cells[axis];
            }
            if (clip(worker->tile, first, size, num))
                take(worker, block, first, num, has_middle ? karst_tile_corner(middle[0], middle[1], middle[2]) : -1,
                     user);
        }
}

typedef struct {
    int corner[KARST_TILE_NUM_CELLS / 8];
    size_t num;
} middles;

static void take_middle(karst_mesh_worker *worker, size_t block, const int first[3], const int num[3], int middle,
                        void *user)
{
    (void)worker, (void)block, (void)first, (void)num;
    middles *m = user;
    if (middle >= 0)
        m->corner[m->num++] = middle;
}

typedef struct {
    const karst_mesh_blocks *from;
    karst_mesh_blocks *to; /* NULL: what is open is wanted */
    int size;
} cutting;

/* All of a part is as its middle is, if that is farther from 0 than densities differ in it. */
static void decide(karst_mesh_worker *worker, size_t block, const int first[3], const int num[3], int middle,
                   void *user)
{
    const cutting *cut = user;
    const double slope = cut->from->cube[block].slope, slack = cut->from->cube[block].slack;
    const double density = middle >= 0 ? (double)worker->density[middle] : 0;
    const bool is_proved = fabs(density) > (slope * (cut->size / 2) + slack) * (1 + 0x1p-20);
    if (is_proved)
        mark(worker, first, num, density > 0 ? 1 : -1);
    else if (cut->to)
        add_block(cut->to, first, slope, slack);
    else
        mark(worker, first, num, 0);
}

/* Parts of `size` cells of open blocks: by their middles and the slopes of the whole. */
static void cut_blocks(karst_mesh_worker *worker, const karst_mesh_blocks *from, karst_mesh_blocks *to, int size)
{
    middles m = {.num = 0};
    cutting cut = {from, to, size};
    each_part(worker, from, size, &m, take_middle);
    sample_corners(worker, m.corner, m.num);
    each_part(worker, from, size, &cut, decide);
}

static void sample_wanted(karst_mesh_worker *worker)
{
    int corners[AT_ONCE + KARST_TILE_CORNERS];
    size_t num = 0;
    for (int row = 0; row < KARST_TILE_ROWS; row++) {
        for (uint64_t left = worker->wanted[row] & ~worker->sampled[row]; left;)
            corners[num++] = karst_tile_next(&left) + KARST_TILE_CORNERS * row;
        if (num >= AT_ONCE || row == KARST_TILE_ROWS - 1) {
            sample_corners(worker, corners, num);
            num = 0;
        }
    }
}

void karst_mesh_sample(karst_mesh_worker *worker)
{
    const int64_t *first = worker->tile->first;
    for (int i = 0; i < KARST_TILE_CORNERS; i++) {
        const double at[3] = {(double)(first[0] + i), (double)(first[1] + i), (double)(first[2] + i)};
        worker->place_of[i] = karst_grid_at(&worker->grid, at);
    }
    memset(worker->wanted, 0, sizeof worker->wanted);
    memset(worker->sampled, 0, sizeof worker->sampled);
    memset(worker->solid, 0, sizeof worker->solid);
    worker->blocks[0].num = worker->blocks[1].num = 0;
    look(worker, (const int[3]){0, 0, 0}, KARST_TILE_CELLS);
    cut_blocks(worker, &worker->blocks[0], &worker->blocks[1], LEAF_CELLS / 2);
    cut_blocks(worker, &worker->blocks[1], NULL, LEAF_CELLS / 4);
    sample_wanted(worker);
}
