#include "karst/query.h"

#include <math.h>

#include "core/export/crew.h"
#include "core/export/march.h"

/* ---- what all questions have ---- */

typedef struct {
    double within_m, footprint_m;
    int voxel_log2_m;
} terms;

static bool read_terms(const karst_world *world, const karst_query_config *config, terms *t, karst_error *error)
{
    t->voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    t->footprint_m = config->footprint_m;
    t->within_m = config->within_m != 0 ? config->within_m : ldexp(1, t->voxel_log2_m - 7);
    if (!(t->footprint_m >= 0) || !isfinite(t->footprint_m))
        return karst_fail(error, KARST_USAGE, "a footprint of %g m: it must not be below 0", t->footprint_m);
    if (!(t->within_m >= ldexp(1, t->voxel_log2_m - 24)) || !isfinite(t->within_m))
        return karst_fail(error, KARST_USAGE, "surfaces within %g m: at least 2^-24 of the world's voxel of %g m",
                          t->within_m, ldexp(1, t->voxel_log2_m));
    return true;
}

static bool is_length(double length_m, int voxel_log2_m)
{
    return length_m > 0 && ldexp(length_m, -voxel_log2_m) <= 0x1p60;
}

/* ---- densities ---- */

typedef struct {
    const karst_position *at;
    float *density;
    double footprint_m;
} density_task;

static void find_densities(void *user, karst_sampler *sampler, size_t first, size_t end)
{
    const density_task *task = user;
    karst_sampler_densities(sampler, task->at + first, end - first, task->footprint_m, task->density + first);
}

bool karst_query_densities(const karst_world *world, const karst_query_config *config, const karst_position *at,
                           size_t num, float *density, karst_error *error)
{
    terms t;
    if (!read_terms(world, config, &t, error))
        return false;
    density_task task = {at, density, t.footprint_m};
    return karst_crew_run(world, config, num, find_densities, &task, error);
}

/* ---- rays ---- */

typedef struct {
    const karst_query_ray *rays;
    karst_query_hit *hits;
    terms t;
} ray_task;

static void find_normal(karst_sampler *sampler, const karst_march *march, karst_query_hit *hit)
{
    const karst_position at = karst_march_at(march, march->t_m);
    karst_sample gradient[3];
    double square = 0;
    if (!karst_sampler_gradient(sampler, &at, march->footprint_m, gradient, NULL))
        return;
    for (int axis = 0; axis < 3; axis++)
        square += (double)gradient[axis].device * (double)gradient[axis].device;
    for (int axis = 0; axis < 3 && square > 0 && isfinite(square); axis++)
        hit->normal[axis] = -(double)gradient[axis].device / sqrt(square);
}

static void find_hit(const ray_task *task, karst_sampler *sampler, size_t index)
{
    const karst_query_ray *ray = &task->rays[index];
    karst_query_hit *hit = &task->hits[index];
    const double length = hypot(hypot(ray->direction[0], ray->direction[1]), ray->direction[2]);
    karst_march march = {.from = ray->from,
                         .direction = {ray->direction[0] / length, ray->direction[1] / length,
                                       ray->direction[2] / length},
                         .length_m = ray->length_m,
                         .within_m = task->t.within_m,
                         .footprint_m = task->t.footprint_m,
                         .voxel_log2_m = task->t.voxel_log2_m};
    *hit = (karst_query_hit){.t_m = INFINITY, .kind = KARST_QUERY_MISS};
    karst_march_begin(&march, sampler);
    if (march.is_solid) {
        hit->kind = KARST_QUERY_INSIDE;
        hit->t_m = 0;
    } else if (karst_march_next(&march, sampler, KARST_QUERY_MAX_STEPS)) {
        hit->kind = KARST_QUERY_SURFACE;
        hit->t_m = march.t_m;
        find_normal(sampler, &march, hit);
    } else if (march.t_m < march.length_m) {
        hit->kind = KARST_QUERY_UNRESOLVED;
        hit->t_m = march.t_m;
    }
}

static void find_hits(void *user, karst_sampler *sampler, size_t first, size_t end)
{
    for (size_t i = first; i < end; i++)
        find_hit(user, sampler, i);
}

bool karst_query_rays(const karst_world *world, const karst_query_config *config, const karst_query_ray *rays,
                      size_t num, karst_query_hit *hits, karst_error *error)
{
    ray_task task = {.rays = rays, .hits = hits};
    if (!read_terms(world, config, &task.t, error))
        return false;
    for (size_t i = 0; i < num; i++) {
        const double *d = rays[i].direction, length = hypot(hypot(d[0], d[1]), d[2]);
        if (!(length > 0) || !isfinite(length))
            return karst_fail(error, KARST_USAGE, "ray %zu has no direction", i + 1);
        if (!is_length(rays[i].length_m, task.t.voxel_log2_m))
            return karst_fail(error, KARST_USAGE, "ray %zu is %g m long: above 0, to 2^60 voxels", i + 1,
                              rays[i].length_m);
    }
    return karst_crew_run(world, config, num, find_hits, &task, error);
}

/* ---- maps of heights ---- */

enum { BLOCK_PX = 16, MAX_MAP_PX = 16384 };

typedef struct {
    const karst_height_map *map;
    double *down_m;
    terms t;
    size_t blocks_across;
} map_task;

/* A vertical, `at_px` from the map's corner of lowest x and greatest z. */
static karst_march vertical(const map_task *task, double x_px, double z_px)
{
    const karst_height_map *map = task->map;
    const double offset_m[3] = {x_px * map->size_m[0] / map->size_px[0], 0,
                                map->size_m[1] - z_px * map->size_m[1] / map->size_px[1]};
    return (karst_march){.from = karst_position_add_m(map->corner, offset_m, task->t.voxel_log2_m),
                         .direction = {0, -1, 0},
                         .length_m = map->depth_m,
                         .within_m = task->t.within_m,
                         .footprint_m = task->t.footprint_m,
                         .voxel_log2_m = task->t.voxel_log2_m};
}

static void map_block(const map_task *task, karst_sampler *sampler, int x0, int z0)
{
    const karst_height_map *map = task->map;
    const int x1 = x0 + BLOCK_PX < map->size_px[0] ? x0 + BLOCK_PX : map->size_px[0];
    const int z1 = z0 + BLOCK_PX < map->size_px[1] ? z0 + BLOCK_PX : map->size_px[1];
    karst_march beam = vertical(task, (x0 + x1) / 2.0, (z0 + z1) / 2.0);
    beam.spread_m[0] = (x1 - x0) / 2.0 * map->size_m[0] / map->size_px[0];
    beam.spread_m[2] = (z1 - z0) / 2.0 * map->size_m[1] / map->size_px[1];
    const double widest_m = fmax(fmax(beam.spread_m[0], beam.spread_m[2]) / 2, task->t.within_m);
    karst_march_through_air(&beam, sampler, widest_m);
    for (int z = z0; z < z1; z++)
        for (int x = x0; x < x1; x++) {
            double *down_m = &task->down_m[(size_t)z * (size_t)map->size_px[0] + (size_t)x];
            karst_march march = vertical(task, x + 0.5, z + 0.5);
            *down_m = INFINITY;
            if (beam.t_m >= map->depth_m)
                continue;
            const double skipped_m[3] = {0, -beam.t_m, 0};
            march.from = karst_position_add_m(march.from, skipped_m, task->t.voxel_log2_m);
            march.length_m -= beam.t_m;
            karst_march_begin(&march, sampler);
            march.step_m = widest_m;
            if (march.is_solid)
                *down_m = beam.t_m;
            else if (karst_march_next(&march, sampler, KARST_QUERY_MAX_STEPS))
                *down_m = beam.t_m + march.t_m;
        }
}

static void map_blocks(void *user, karst_sampler *sampler, size_t first, size_t end)
{
    const map_task *task = user;
    for (size_t i = first; i < end; i++)
        map_block(task, sampler, (int)(i % task->blocks_across) * BLOCK_PX, (int)(i / task->blocks_across) * BLOCK_PX);
}

bool karst_query_height_map(const karst_world *world, const karst_query_config *config, const karst_height_map *map,
                            double *down_m, karst_error *error)
{
    map_task task = {.map = map, .down_m = down_m};
    if (!read_terms(world, config, &task.t, error))
        return false;
    for (int i = 0; i < 2; i++) {
        if (map->size_px[i] < 1 || map->size_px[i] > MAX_MAP_PX)
            return karst_fail(error, KARST_USAGE, "a map of %d x %d pixels: 1 to %d each", map->size_px[0],
                              map->size_px[1], MAX_MAP_PX);
        if (!is_length(map->size_m[i], task.t.voxel_log2_m))
            return karst_fail(error, KARST_USAGE, "a map of %g x %g m: each above 0, to 2^60 voxels", map->size_m[0],
                              map->size_m[1]);
    }
    if (!is_length(map->depth_m, task.t.voxel_log2_m))
        return karst_fail(error, KARST_USAGE, "a depth of %g m: above 0, to 2^60 voxels", map->depth_m);
    task.blocks_across = ((size_t)map->size_px[0] + BLOCK_PX - 1) / BLOCK_PX;
    const size_t blocks_down = ((size_t)map->size_px[1] + BLOCK_PX - 1) / BLOCK_PX;
    return karst_crew_run(world, config, task.blocks_across * blocks_down, map_blocks, &task, error);
}

/* ---- heights ---- */

typedef struct {
    const karst_position *at;
    double depth_m, *down_m;
    uint32_t max_surfaces, *counts;
    bool *starts_inside;
    terms t;
} height_task;

static void find_surfaces(void *user, karst_sampler *sampler, size_t first, size_t end)
{
    const height_task *task = user;
    for (size_t i = first; i < end; i++) {
        karst_march march = {.from = task->at[i],
                             .direction = {0, -1, 0},
                             .length_m = task->depth_m,
                             .within_m = task->t.within_m,
                             .footprint_m = task->t.footprint_m,
                             .voxel_log2_m = task->t.voxel_log2_m};
        uint32_t num = 0;
        karst_march_begin(&march, sampler);
        task->starts_inside[i] = march.is_solid;
        while (num < task->max_surfaces && karst_march_next(&march, sampler, KARST_QUERY_MAX_STEPS))
            task->down_m[i * task->max_surfaces + num++] = march.t_m;
        task->counts[i] = num;
    }
}

bool karst_query_heights(const karst_world *world, const karst_query_config *config, const karst_position *at,
                         size_t num, double depth_m, uint32_t max_surfaces, double *down_m, uint32_t *counts,
                         bool *starts_inside, karst_error *error)
{
    height_task task = {.at = at,
                        .depth_m = depth_m,
                        .down_m = down_m,
                        .max_surfaces = max_surfaces,
                        .counts = counts,
                        .starts_inside = starts_inside};
    if (!read_terms(world, config, &task.t, error))
        return false;
    if (!is_length(depth_m, task.t.voxel_log2_m))
        return karst_fail(error, KARST_USAGE, "a depth of %g m: above 0, to 2^60 voxels", depth_m);
    return karst_crew_run(world, config, num, find_surfaces, &task, error);
}
