#include "core/export/voxel_block.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NUM_VALUES ((size_t)VOXEL_SIDE * VOXEL_SIDE * VOXEL_SIDE)
#define NO_CROSSING UINT32_MAX

enum { ROUNDS = 5 /* of narrowing a crossing down */ };
static const int step_of[3] = {VOXEL_SIDE * VOXEL_SIDE, VOXEL_SIDE, 1};

/* Where an edge between two neighbouring voxels meets the surface. */
typedef struct voxel_crossing {
    uint32_t index; /* of the voxel with the lower coordinate */
    int axis;
    double t[2], value[2]; /* between them, 0 to 1, and the densities there */
    double try_t;
    float at[3];     /* from the block's margin, in voxels */
    float normal[3]; /* of length 1, or 0 where nothing is known */
} voxel_crossing;

static size_t index_of(int x, int y, int z) { return ((size_t)x * VOXEL_SIDE + (size_t)y) * VOXEL_SIDE + (size_t)z; }

static void coordinates_of(uint32_t index, int at[3])
{
    at[0] = (int)(index / (VOXEL_SIDE * VOXEL_SIDE));
    at[1] = (int)(index / VOXEL_SIDE % VOXEL_SIDE);
    at[2] = (int)(index % VOXEL_SIDE);
}

float karst_voxel_far(const karst_voxel_block *block, bool is_solid)
{
    const float band_m = (float)(KARST_VOXELS_BAND * block->config->voxel_m);
    return block->grid->kind != KARST_VOXELS_DISTANCE ? 0 : is_solid ? -band_m : band_m;
}

bool karst_voxel_block_begin(karst_voxel_block *block, const karst_voxels_config *config, const karst_voxels_grid *grid,
                             karst_error *error)
{
    *block = (karst_voxel_block){.config = config,
                                 .grid = grid,
                                 .query = {.footprint_m = config->footprint_m,
                                           .edits = grid->edits,
                                           .num_edits = grid->num_edits,
                                           .num_threads = config->num_threads},
                                 .at = malloc(NUM_VALUES * sizeof *block->at),
                                 .index = malloc(NUM_VALUES * sizeof *block->index),
                                 .found = malloc(NUM_VALUES * sizeof *block->found),
                                 .density = malloc(NUM_VALUES * sizeof *block->density),
                                 .nearest = malloc(NUM_VALUES * sizeof *block->nearest),
                                 .crossing_of = malloc(NUM_VALUES * sizeof *block->crossing_of)};
    if (block->at && block->index && block->found && block->density && block->nearest && block->crossing_of)
        return true;
    karst_voxel_block_finish(block);
    return karst_fail(error, KARST_FAILED, "out of memory");
}

void karst_voxel_block_finish(karst_voxel_block *block)
{
    free(block->at);
    free(block->index);
    free(block->found);
    free(block->density);
    free(block->nearest);
    free(block->crossing_of);
    free(block->crossings);
    *block = (karst_voxel_block){0};
}

karst_position karst_voxel_place(const karst_voxel_block *block, const double at[3])
{
    const double voxel_m = block->config->voxel_m,
                 offset_m[3] = {(at[0] + 0.5) * voxel_m, (at[1] + 0.5) * voxel_m, (at[2] + 0.5) * voxel_m};
    return karst_position_add_m(block->config->corner, offset_m,
                                karst_world_get_metadata(block->grid->world)->voxel_log2_m);
}

/* ---- densities ---- */

/* Marks the cells of VOXEL_MARGIN voxels that wanted leaves need: their own, and those around where distances are
 * asked for. */
static void mark_cells(const karst_voxel_block *block, const bool *wanted, bool *cells)
{
    const int per_leaf = 8 / VOXEL_MARGIN, around = block->grid->kind == KARST_VOXELS_DISTANCE;
    memset(cells, 0, VOXEL_CELLS * VOXEL_CELLS * VOXEL_CELLS);
    for (int leaf = 0; leaf < VOXEL_LEAVES * VOXEL_LEAVES * VOXEL_LEAVES; leaf++) {
        if (!wanted[leaf])
            continue;
        const int first[3] = {leaf / (VOXEL_LEAVES * VOXEL_LEAVES) * per_leaf + 1,
                              leaf / VOXEL_LEAVES % VOXEL_LEAVES * per_leaf + 1, leaf % VOXEL_LEAVES * per_leaf + 1};
        for (int x = first[0] - around; x < first[0] + per_leaf + around; x++)
            for (int y = first[1] - around; y < first[1] + per_leaf + around; y++)
                for (int z = first[2] - around; z < first[2] + per_leaf + around; z++)
                    cells[(x * VOXEL_CELLS + y) * VOXEL_CELLS + z] = true;
    }
}

static size_t list_voxels(karst_voxel_block *block, const int32_t corner[3], const bool *cells)
{
    size_t num = 0;
    for (int x = 0; x < VOXEL_SIDE; x++)
        for (int y = 0; y < VOXEL_SIDE; y++)
            for (int z = 0; z < VOXEL_SIDE; z++) {
                const int cell[3] = {x / VOXEL_MARGIN, y / VOXEL_MARGIN, z / VOXEL_MARGIN};
                if (!cells[(cell[0] * VOXEL_CELLS + cell[1]) * VOXEL_CELLS + cell[2]])
                    continue;
                const double place[3] = {corner[0] + (double)(x - VOXEL_MARGIN), corner[1] + (double)(y - VOXEL_MARGIN),
                                         corner[2] + (double)(z - VOXEL_MARGIN)};
                block->index[num] = (uint32_t)index_of(x, y, z);
                block->at[num++] = karst_voxel_place(block, place);
            }
    return num;
}

/* ---- crossings ---- */

static bool add_crossing(karst_voxel_block *block, uint32_t index, int axis, float low, float high, karst_error *error)
{
    if (block->num_crossings == block->room_for_crossings) {
        const size_t room = block->room_for_crossings * 2 + 4096;
        voxel_crossing *more = realloc(block->crossings, room * sizeof *more);
        if (!more)
            return karst_fail(error, KARST_FAILED, "out of memory");
        block->crossings = more;
        block->room_for_crossings = room;
    }
    block->crossings[block->num_crossings++] =
        (voxel_crossing){.index = index, .axis = axis, .t = {0, 1}, .value = {(double)low, (double)high}};
    return true;
}

/* What was not sampled is a NaN with these bits, and no neighbour of anything. */
static bool is_sampled(const bool *cells, int x, int y, int z)
{
    return x < VOXEL_SIDE && y < VOXEL_SIDE && z < VOXEL_SIDE &&
           cells[(x / VOXEL_MARGIN * VOXEL_CELLS + y / VOXEL_MARGIN) * VOXEL_CELLS + z / VOXEL_MARGIN];
}

static bool find_crossings(karst_voxel_block *block, const bool *cells, size_t num, karst_error *error)
{
    block->num_crossings = 0;
    for (size_t i = 0; i < num; i++) {
        const uint32_t index = block->index[i];
        int at[3];
        coordinates_of(index, at);
        for (int axis = 0; axis < 3; axis++) {
            const float low = block->density[index];
            if (!is_sampled(cells, at[0] + (axis == 0), at[1] + (axis == 1), at[2] + (axis == 2)))
                continue;
            const float high = block->density[index + (uint32_t)step_of[axis]];
            if ((low > 0) != (high > 0) && !add_crossing(block, index, axis, low, high, error))
                return false;
        }
    }
    return true;
}

/* Where to look next: where the line between both values is 0; the middle where that says nothing. */
static double next_try(const voxel_crossing *c)
{
    const double share = c->value[0] / (c->value[0] - c->value[1]), width = c->t[1] - c->t[0];
    return c->t[0] + width * (share >= 0.01 && share <= 0.99 ? share : share < 0.01 ? 0.01 : share > 0.99 ? 0.99 : 0.5);
}

/* Positions of crossings as they are known now. */
static void place_crossings(karst_voxel_block *block, const int32_t corner[3], size_t first, size_t num)
{
    for (size_t i = 0; i < num; i++) {
        voxel_crossing *c = &block->crossings[first + i];
        int at[3];
        double place[3];
        c->try_t = next_try(c);
        coordinates_of(c->index, at);
        for (int axis = 0; axis < 3; axis++) {
            const double from_margin = at[axis] + (axis == c->axis ? c->try_t : 0);
            c->at[axis] = (float)from_margin;
            place[axis] = corner[axis] + from_margin - VOXEL_MARGIN;
        }
        block->at[i] = karst_voxel_place(block, place);
    }
}

/* Regula falsi as the Illinois way has it: the end that stays is weighed less, so that both come nearer. */
static void narrow(voxel_crossing *c, double value)
{
    const int end = (value > 0) == (c->value[0] > 0) ? 0 : 1;
    c->t[end] = c->try_t;
    c->value[end] = value;
    c->value[!end] /= 2;
}

static void take_normal(voxel_crossing *c, const float gradient[3])
{
    const double x = (double)gradient[0], y = (double)gradient[1], z = (double)gradient[2];
    const double length = sqrt(x * x + y * y + z * z);
    for (int axis = 0; axis < 3; axis++)
        c->normal[axis] = length > 0 && isfinite(length) ? (float)((double)gradient[axis] / length) : 0;
}

static bool refine_crossings(karst_voxel_block *block, const int32_t corner[3], karst_error *error)
{
    const karst_world *world = block->grid->world;
    const size_t most = NUM_VALUES / 3; /* gradients have three floats */
    for (size_t first = 0, num; first < block->num_crossings; first += num) {
        num = block->num_crossings - first < most ? block->num_crossings - first : most;
        for (int round = 0; round < ROUNDS; round++) {
            place_crossings(block, corner, first, num);
            if (!karst_query_densities(world, &block->query, block->at, num, block->found, error))
                return false;
            for (size_t i = 0; i < num; i++)
                narrow(&block->crossings[first + i], (double)block->found[i]);
        }
        place_crossings(block, corner, first, num);
        karst_error no_gradient = {0};
        float(*gradient)[3] = (float(*)[3])block->found;
        const bool known = karst_query_gradients(world, &block->query, block->at, num, gradient, NULL, &no_gradient);
        for (size_t i = 0; known && i < num; i++)
            take_normal(&block->crossings[first + i], gradient[i]);
        block->num_samples += num * (ROUNDS + 1);
    }
    return true;
}

/* Each voxel near a crossing gets to know the nearest. */
static void spread_crossings(karst_voxel_block *block)
{
    for (size_t i = 0; i < NUM_VALUES; i++) {
        block->nearest[i] = INFINITY;
        block->crossing_of[i] = NO_CROSSING;
    }
    for (size_t i = 0; i < block->num_crossings; i++) {
        const float *at = block->crossings[i].at;
        int low[3], high[3];
        for (int axis = 0; axis < 3; axis++) {
            const int middle = (int)at[axis];
            low[axis] = middle - VOXEL_MARGIN + 1 > 0 ? middle - VOXEL_MARGIN + 1 : 0;
            high[axis] = middle + VOXEL_MARGIN < VOXEL_SIDE - 1 ? middle + VOXEL_MARGIN : VOXEL_SIDE - 1;
        }
        for (int x = low[0]; x <= high[0]; x++)
            for (int y = low[1]; y <= high[1]; y++)
                for (int z = low[2]; z <= high[2]; z++) {
                    const float dx = (float)x - at[0], dy = (float)y - at[1], dz = (float)z - at[2];
                    const float square = dx * dx + dy * dy + dz * dz;
                    const size_t index = index_of(x, y, z);
                    if (square < block->nearest[index]) {
                        block->nearest[index] = square;
                        block->crossing_of[index] = (uint32_t)i;
                    }
                }
    }
}

bool karst_voxel_block_sample(karst_voxel_block *block, const int32_t corner[3],
                              const bool wanted[VOXEL_LEAVES * VOXEL_LEAVES * VOXEL_LEAVES], karst_error *error)
{
    bool cells[VOXEL_CELLS * VOXEL_CELLS * VOXEL_CELLS];
    mark_cells(block, wanted, cells);
    const size_t num = list_voxels(block, corner, cells);
    if (!karst_query_densities(block->grid->world, &block->query, block->at, num, block->found, error))
        return false;
    block->num_samples += num;
    for (size_t i = 0; i < num; i++)
        block->density[block->index[i]] = block->found[i];
    if (block->grid->kind != KARST_VOXELS_DISTANCE)
        return true;
    if (!find_crossings(block, cells, num, error) || !refine_crossings(block, corner, error))
        return false;
    spread_crossings(block);
    return true;
}

/* ---- values ---- */

/* Voxels between a place and the surface: to the plane through the nearest crossing, as far as that goes. */
static float distance(const karst_voxel_block *block, size_t index, const int at[3])
{
    if (block->crossing_of[index] == NO_CROSSING)
        return INFINITY;
    const voxel_crossing *c = &block->crossings[block->crossing_of[index]];
    float across = 0;
    for (int axis = 0; axis < 3; axis++)
        across += ((float)at[axis] - c->at[axis]) * c->normal[axis];
    const float square = block->nearest[index], aside = square - across * across;
    const bool has_normal = c->normal[0] != 0 || c->normal[1] != 0 || c->normal[2] != 0;
    return has_normal && aside <= 1 ? fabsf(across) : sqrtf(square);
}

static float value_at(const karst_voxel_block *block, size_t index, const int at[3], bool *is_active)
{
    const float density = block->density[index];
    if (block->grid->kind == KARST_VOXELS_DENSITY) {
        *is_active = true;
        return density;
    }
    if (block->grid->kind == KARST_VOXELS_FOG) {
        *is_active = density > 0;
        return *is_active ? density : 0;
    }
    /* a distance of 0 would lose its side */
    const float far = karst_voxel_far(block, density > 0),
                metres = (float)block->config->voxel_m * fmaxf(distance(block, index, at), 0x1p-20f);
    *is_active = metres < fabsf(far);
    return *is_active ? copysignf(metres, far) : far;
}

void karst_voxel_block_leaf(const karst_voxel_block *block, const int32_t corner[3], const int leaf[3],
                            float values[512], uint64_t active[8])
{
    memset(active, 0, 8 * sizeof *active);
    for (int i = 0; i < 512; i++) {
        const int in_block[3] = {8 * leaf[0] + (i >> 6), 8 * leaf[1] + (i >> 3 & 7), 8 * leaf[2] + (i & 7)};
        int at[3];
        bool is_active = false, is_inside = true;
        for (int axis = 0; axis < 3; axis++) {
            at[axis] = in_block[axis] + VOXEL_MARGIN;
            is_inside = is_inside && corner[axis] + in_block[axis] < block->config->num_voxels[axis];
        }
        values[i] =
            is_inside ? value_at(block, index_of(at[0], at[1], at[2]), at, &is_active) : karst_voxel_far(block, false);
        active[i >> 6] |= (uint64_t)is_active << (i & 63);
    }
}
