/* Segments that cross the surface: room for them, where they do, and the normals there. */
#include "core/export/piece_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* An array of at least `num` elements, one more than there may be none; what was in it may be lost. */
bool karst_mesh_renew(void **array, size_t num, size_t size_bytes)
{
    free(*array);
    *array = malloc((num + 1) * size_bytes);
    return *array;
}

bool karst_mesh_make_room(karst_mesh_worker *worker, size_t num_segments, karst_error *error)
{
    if (num_segments <= worker->max_segments)
        return true;
    worker->max_segments = 0;
    if (!karst_mesh_renew((void **)&worker->segments, num_segments, sizeof *worker->segments) ||
        !karst_mesh_renew((void **)&worker->positions, num_segments, sizeof *worker->positions) ||
        !karst_mesh_renew((void **)&worker->densities, num_segments, sizeof *worker->densities) ||
        !karst_mesh_renew((void **)&worker->gradients, num_segments, sizeof *worker->gradients) ||
        !karst_mesh_renew((void **)&worker->normals, num_segments, sizeof *worker->normals))
        return karst_fail(error, KARST_FAILED, "out of memory");
    worker->max_segments = num_segments;
    return true;
}

/* From the density's gradient, which points into the solid. */
static bool to_normal(const float gradient[3], double normal[3])
{
    double square = 0;
    for (int axis = 0; axis < 3; axis++)
        square += (double)gradient[axis] * (double)gradient[axis];
    const double length = sqrt(square);
    const bool is_known = length > 0 && isfinite(length);
    for (int axis = 0; axis < 3; axis++)
        normal[axis] = is_known ? -(double)gradient[axis] / length : 0;
    return is_known;
}

void karst_mesh_find_segments(karst_mesh_worker *worker, size_t num)
{
    const karst_grid *grid = &worker->grid;
    double(*normals)[3] = worker->normals;
    uint64_t *num_samples = &worker->tile->num_samples;
    *num_samples += karst_find_crossings(worker->sampler, grid, worker->segments, num, worker->positions,
                                         worker->densities);
    for (size_t i = 0; i < num; i++)
        karst_grid_place(grid, worker->segments[i].found, &worker->positions[i]);
    if (!karst_sampler_gradients(worker->sampler, worker->positions, num, grid->footprint_m, worker->gradients,
                                 worker->densities))
        memset(worker->gradients, 0, num * sizeof *worker->gradients);
    *num_samples += num;
    for (size_t i = 0; i < num; i++) {
        karst_sample slopes[3];
        float inside[3];
        if (to_normal(worker->gradients[i], normals[i]))
            continue;
        /* What is flat in air has slopes in the solid beside it. */
        const karst_position beside = karst_grid_at(grid, worker->segments[i].found_solid);
        if (!karst_sampler_gradient(worker->sampler, &beside, grid->footprint_m, slopes, NULL))
            continue;
        for (int axis = 0; axis < 3; axis++)
            inside[axis] = slopes[axis].device;
        to_normal(inside, normals[i]);
        (*num_samples)++;
    }
}
