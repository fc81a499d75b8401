/* Boxes of worlds as grids of voxels: from cubes of 4096 voxels down to leaves of 8, by bounds. */
#include "karst/voxels.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "core/export/nano_file.h"
#include "core/export/out_file.h"
#include "core/export/voxel_block.h"
#include "core/files/nano_layout.h"

enum { MAX_THREADS = 256, MOST_BOUNDS = 4096 /* boxes that are bounded at once */ };

typedef struct {
    int32_t at[3];
} cube;

typedef struct {
    cube *items;
    size_t num, room;
} cubes;

/* What is known of a cube of voxels, and of what lies near it. */
typedef enum { CUBE_OPEN, CUBE_AIR, CUBE_SOLID } verdict;

typedef struct {
    const karst_voxels_config *config;
    const karst_voxels_grid *grid;
    karst_voxel_block block;
    karst_nano_writer *file;
    bool (*progress)(void *user, double share);
    void *user;
    double first_share, share; /* of all grids */
    /* of MOST_BOUNDS cubes */
    karst_position centre[MOST_BOUNDS];
    double half_m[MOST_BOUNDS][3], range[MOST_BOUNDS][2];
} writing;

static bool append(cubes *list, const int32_t at[3], karst_error *error)
{
    if (list->num == list->room) {
        cube *more = realloc(list->items, (list->room * 2 + 64) * sizeof *more);
        if (!more)
            return karst_fail(error, KARST_FAILED, "out of memory");
        list->items = more;
        list->room = list->room * 2 + 64;
    }
    memcpy(list->items[list->num++].at, at, sizeof list->items->at);
    return true;
}

static bool is_inside(const writing *w, const int32_t at[3], int32_t size)
{
    bool inside = true;
    for (int axis = 0; axis < 3; axis++)
        inside = inside && at[axis] + size <= w->config->num_voxels[axis];
    return inside;
}

static bool meets_box(const writing *w, const int32_t at[3])
{
    return at[0] < w->config->num_voxels[0] && at[1] < w->config->num_voxels[1] && at[2] < w->config->num_voxels[2];
}

/* What bounds say of at most MOST_BOUNDS cubes, with the margin that distances look at. */
static bool judge(writing *w, const cube *list, size_t num, int32_t size, verdict *verdicts, karst_error *error)
{
    const bool is_distance = w->grid->kind == KARST_VOXELS_DISTANCE;
    const double half = size / 2.0 + (is_distance ? VOXEL_MARGIN : 0);
    if (w->grid->kind == KARST_VOXELS_DENSITY) {
        memset(verdicts, 0, num * sizeof *verdicts);
        return true;
    }
    for (size_t i = 0; i < num; i++) {
        double middle[3];
        for (int axis = 0; axis < 3; axis++) {
            middle[axis] = list[i].at[axis] + (size - 1) / 2.0;
            w->half_m[i][axis] = half * w->config->voxel_m;
        }
        w->centre[i] = karst_voxel_place(&w->block, middle);
    }
    if (!karst_query_bounds(w->grid->world, &w->block.query, w->centre, (const double(*)[3])w->half_m, num, w->range,
                            error))
        return false;
    for (size_t i = 0; i < num; i++) {
        const bool is_solid = is_distance && w->range[i][0] > 0 && is_inside(w, list[i].at, size);
        verdicts[i] = w->range[i][1] <= 0 ? CUBE_AIR : is_solid ? CUBE_SOLID : CUBE_OPEN;
    }
    return true;
}

/* Parts cubes of 2^size_log2 voxels that nothing is known of into those of half the size; the others become values. */
static bool split(writing *w, const cubes *from, int size_log2, cubes *to, karst_error *error)
{
    verdict verdicts[MOST_BOUNDS];
    const int32_t half = 1 << (size_log2 - 1);
    for (size_t first = 0, num; first < from->num; first += num) {
        num = from->num - first < MOST_BOUNDS ? from->num - first : MOST_BOUNDS;
        if (!judge(w, from->items + first, num, 2 * half, verdicts, error))
            return false;
        for (size_t i = 0; i < num; i++) {
            const int32_t *at = from->items[first + i].at;
            if (verdicts[i] == CUBE_SOLID &&
                !karst_nano_tile(w->file, at, size_log2, karst_voxel_far(&w->block, true), error))
                return false;
            for (int child = 0; child < 8 && verdicts[i] == CUBE_OPEN; child++) {
                const int32_t part[3] = {at[0] + (child >> 2) * half, at[1] + (child >> 1 & 1) * half,
                                         at[2] + (child & 1) * half};
                if (meets_box(w, part) && !append(to, part, error))
                    return false;
            }
        }
    }
    return true;
}

/* All open cubes of 2^to_log2 voxels in a list of larger ones, which is given up. */
static bool descend(writing *w, cubes *list, int from_log2, int to_log2, karst_error *error)
{
    bool done = true;
    for (int log2 = from_log2; done && log2 > to_log2; log2--) {
        cubes smaller = {0};
        done = split(w, list, log2, &smaller, error);
        free(list->items);
        *list = smaller;
    }
    return done;
}

/* ---- lower nodes ---- */

static bool is_uniform(const float values[512], const uint64_t active[8])
{
    for (int i = 0; i < 512; i++)
        if (active[i >> 6] || values[i] != values[0])
            return false;
    return true;
}

static bool write_block(writing *w, const int32_t corner[3], const bool *wanted, karst_error *error)
{
    if (!karst_voxel_block_sample(&w->block, corner, wanted, error))
        return false;
    for (int i = 0; i < VOXEL_LEAVES * VOXEL_LEAVES * VOXEL_LEAVES; i++) {
        const int leaf[3] = {i / (VOXEL_LEAVES * VOXEL_LEAVES), i / VOXEL_LEAVES % VOXEL_LEAVES, i % VOXEL_LEAVES};
        const int32_t at[3] = {corner[0] + 8 * leaf[0], corner[1] + 8 * leaf[1], corner[2] + 8 * leaf[2]};
        float values[512];
        uint64_t active[8];
        if (!wanted[i])
            continue;
        karst_voxel_block_leaf(&w->block, corner, leaf, values, active);
        if (!(is_uniform(values, active) ? karst_nano_tile(w->file, at, KARST_NANO_LEAF_LOG2, values[0], error)
                                         : karst_nano_add_leaf(w->file, at, values, active, error)))
            return false;
    }
    return true;
}

static bool write_lower(writing *w, const cube *lower, karst_error *error)
{
    enum { BLOCKS = 1 << KARST_NANO_LOWER_LOG2, NUM_LEAVES = VOXEL_LEAVES * VOXEL_LEAVES * VOXEL_LEAVES };
    bool wanted[8][NUM_LEAVES] = {{false}}, has_any[8] = {false};
    cubes leaves = {0};
    verdict verdicts[MOST_BOUNDS];
    karst_nano_begin_lower(w->file, lower->at);
    bool done = append(&leaves, lower->at, error) && descend(w, &leaves, KARST_NANO_LOWER_LOG2, 3, error);
    /* of 16^3 leaves there are MOST_BOUNDS at most */
    done = done && judge(w, leaves.items, leaves.num, 8, verdicts, error);
    for (size_t i = 0; done && i < leaves.num; i++) {
        const int32_t *at = leaves.items[i].at;
        int block = 0, leaf = 0;
        for (int axis = 0; axis < 3; axis++) {
            const int32_t from_lower = at[axis] - lower->at[axis];
            block = block * 2 + from_lower / VOXEL_BLOCK;
            leaf = leaf * VOXEL_LEAVES + from_lower % VOXEL_BLOCK / 8;
        }
        if (verdicts[i] == CUBE_SOLID)
            done = karst_nano_tile(w->file, at, KARST_NANO_LEAF_LOG2, karst_voxel_far(&w->block, true), error);
        if (verdicts[i] == CUBE_OPEN)
            wanted[block][leaf] = has_any[block] = true;
    }
    free(leaves.items);
    for (int i = 0; done && i < 8; i++) {
        const int32_t corner[3] = {lower->at[0] + (i >> 2) * VOXEL_BLOCK, lower->at[1] + (i >> 1 & 1) * VOXEL_BLOCK,
                                   lower->at[2] + (i & 1) * VOXEL_BLOCK};
        done = !has_any[i] || write_block(w, corner, wanted[i], error);
    }
    return done && karst_nano_end_lower(w->file, error);
}

/* ---- grids ---- */

static int by_place(const void *a, const void *b)
{
    const int32_t *p = ((const cube *)a)->at, *q = ((const cube *)b)->at;
    for (int axis = 0; axis < 3; axis++)
        if (p[axis] != q[axis])
            return p[axis] < q[axis] ? -1 : 1;
    return 0;
}

static bool list_top(const writing *w, cubes *list, karst_error *error)
{
    const int32_t size = 1 << KARST_NANO_UPPER_LOG2;
    const int64_t *num = w->config->num_voxels;
    for (int32_t x = 0; x < num[0]; x += size)
        for (int32_t y = 0; y < num[1]; y += size)
            for (int32_t z = 0; z < num[2]; z += size)
                if (!append(list, (const int32_t[3]){x, y, z}, error))
                    return false;
    return true;
}

static bool find_grid(writing *w, karst_error *error)
{
    cubes lowers = {0};
    bool done = list_top(w, &lowers, error) && descend(w, &lowers, KARST_NANO_UPPER_LOG2, KARST_NANO_LOWER_LOG2, error);
    if (done && lowers.num > 1)
        qsort(lowers.items, lowers.num, sizeof *lowers.items, by_place);
    for (size_t i = 0; done && i < lowers.num; i++) {
        if (w->progress && !w->progress(w->user, w->first_share + w->share * (double)i / (double)lowers.num))
            done = karst_fail(error, KARST_FAILED, "it was stopped");
        done = done && write_lower(w, &lowers.items[i], error);
    }
    free(lowers.items);
    return done;
}

static const uint32_t class_of[] = {[KARST_VOXELS_DENSITY] = KARST_NANO_CLASS_UNKNOWN,
                                    [KARST_VOXELS_DISTANCE] = KARST_NANO_CLASS_LEVEL_SET,
                                    [KARST_VOXELS_FOG] = KARST_NANO_CLASS_FOG};

/* The grid's file stays open, for what follows; it is ended by the caller. */
static bool write_grid(writing *w, const char *path, karst_nano_about *about, FILE **parts, karst_voxels_stats *stats,
                       karst_error *error)
{
    if (!karst_voxel_block_begin(&w->block, w->config, w->grid, error))
        return false;
    *about = (karst_nano_about){.name = w->grid->name,
                                .grid_class = class_of[w->grid->kind],
                                .voxel_m = w->config->voxel_m,
                                .background = karst_voxel_far(&w->block, false)};
    for (int axis = 0; axis < 3; axis++)
        about->origin_m[axis] = w->config->voxel_m / 2;
    w->file = karst_nano_begin(path, about, error);
    const bool done = w->file && find_grid(w, error) && karst_nano_finish(w->file, parts, error);
    if (done) {
        stats->num_active += karst_nano_num_active(w->file);
        stats->num_leaves += karst_nano_num_leaves(w->file);
        stats->num_samples += w->block.num_samples;
    }
    karst_voxel_block_finish(&w->block);
    return done;
}

static bool check_grid(const karst_voxels_grid *grid, int voxel_log2_m, karst_error *error)
{
    const karst_world_metadata *about = karst_world_get_metadata(grid->world);
    const size_t length = strlen(grid->name);
    if (length < 1 || length >= KARST_NANO_NAME_BYTES)
        return karst_fail(error, KARST_USAGE, "a grid's name has %zu bytes: 1 to %u", length,
                          KARST_NANO_NAME_BYTES - 1);
    if ((unsigned)grid->kind > KARST_VOXELS_FOG)
        return karst_fail(error, KARST_USAGE, "grid '%s' is of no kind that there is", grid->name);
    return about->voxel_log2_m == voxel_log2_m ||
           karst_fail(error, KARST_USAGE, "%s has voxels of another width than the first world", about->name);
}

static bool check(const char *path, const karst_voxels_config *config, const karst_voxels_grid *grids, size_t num_grids,
                  karst_error *error)
{
    const char *dot = strrchr(path, '.');
    if (!dot || strcasecmp(dot, ".nvdb") != 0)
        return karst_fail(error, KARST_USAGE, "%s: voxels are written to files that end in .nvdb", path);
    if (num_grids < 1 || num_grids > KARST_VOXELS_MOST_GRIDS)
        return karst_fail(error, KARST_USAGE, "%zu grids: 1 to %d", num_grids, KARST_VOXELS_MOST_GRIDS);
    const int voxel_log2_m = karst_world_get_metadata(grids[0].world)->voxel_log2_m;
    const double width_m = ldexp(1, voxel_log2_m);
    if (!(config->voxel_m >= width_m * 0x1p-20) || !isfinite(config->voxel_m))
        return karst_fail(error, KARST_USAGE,
                          "voxels of %g m: they must not be narrower than 2^-20 of the world's own, which have %g m",
                          config->voxel_m, width_m);
    if (!(config->footprint_m >= 0) || !isfinite(config->footprint_m))
        return karst_fail(error, KARST_USAGE, "a footprint of %g m: it must not be below 0", config->footprint_m);
    if (config->num_threads < 0 || config->num_threads > MAX_THREADS)
        return karst_fail(error, KARST_USAGE, "%d threads: 0 to %d", config->num_threads, MAX_THREADS);
    for (int axis = 0; axis < 3; axis++) {
        const int64_t num = config->num_voxels[axis];
        if (num < 1 || num > KARST_VOXELS_MAX_SIDE)
            return karst_fail(error, KARST_USAGE, "%lld voxels along %c: 1 to %d; take wider voxels or a smaller box",
                              (long long)num, "xyz"[axis], KARST_VOXELS_MAX_SIDE);
        const double low = (double)config->corner.voxel[axis], high = low + (double)num * config->voxel_m / width_m;
        if (!(low > -0x1p61) || !(high < 0x1p61))
            return karst_fail(error, KARST_USAGE, "the box leaves the world along %c", "xyz"[axis]);
    }
    for (size_t i = 0; i < num_grids; i++)
        if (!check_grid(&grids[i], voxel_log2_m, error))
            return false;
    return true;
}

bool karst_voxels_write(const char *path, const karst_voxels_config *config, const karst_voxels_grid *grids,
                        size_t num_grids, bool (*progress)(void *user, double share), void *user,
                        karst_voxels_stats *stats, karst_error *error)
{
    karst_voxels_stats found = {0};
    karst_nano_about about[KARST_VOXELS_MOST_GRIDS];
    karst_nano_writer *files[KARST_VOXELS_MOST_GRIDS] = {NULL};
    FILE *parts[KARST_VOXELS_MOST_GRIDS * KARST_NANO_PARTS];
    if (!check(path, config, grids, num_grids, error))
        return false;
    writing *w = calloc(1, sizeof *w);
    bool done = w || karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; done && i < num_grids; i++) {
        w->config = config;
        w->grid = &grids[i];
        w->progress = progress;
        w->user = user;
        w->share = 1 / (double)num_grids;
        w->first_share = (double)i * w->share;
        done = write_grid(w, path, &about[i], parts + i * KARST_NANO_PARTS, &found, error);
        files[i] = w->file;
        w->file = NULL;
    }
    done = done && karst_out_assemble(path, "", 0, parts, (int)num_grids * KARST_NANO_PARTS, NULL, NULL, error);
    for (size_t i = 0; i < num_grids; i++)
        karst_nano_end(files[i]);
    free(w);
    if (done && stats)
        *stats = found;
    return done;
}
