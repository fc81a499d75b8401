/* What the world is at many points: gradients, colours, bounds. */
#include "karst/query.h"

#include <math.h>
#include <stdatomic.h>

#include "core/export/crew.h"

/* Points that a worker has room for beside its own. */
enum { ROOM = 1024 };

static bool check_footprint(const karst_query_config *config, karst_error *error)
{
    return (config->footprint_m >= 0 && isfinite(config->footprint_m)) ||
           karst_fail(error, KARST_USAGE, "a footprint of %g m: it must not be below 0", config->footprint_m);
}

static size_t at_most(size_t num) { return num < ROOM ? num : ROOM; }

static bool fail_too_large(karst_error *error)
{
    return karst_fail(error, KARST_FAILED, "the world is too large to have a gradient");
}

/* ---- gradients ---- */

typedef struct {
    const karst_position *at;
    float (*gradient)[3];
    float *density; /* NULL: not asked for */
    double footprint_m;
    atomic_bool is_too_large;
} gradient_task;

static void find_gradients(void *user, karst_sampler *sampler, size_t first, size_t end)
{
    gradient_task *task = user;
    float room[ROOM];
    for (size_t i = first, num; i < end; i += num) {
        num = at_most(end - i);
        if (!karst_sampler_gradients(sampler, task->at + i, num, task->footprint_m, task->gradient + i,
                                     task->density ? task->density + i : room))
            atomic_store(&task->is_too_large, true);
    }
}

bool karst_query_gradients(const karst_world *world, const karst_query_config *config, const karst_position *at,
                           size_t num, float (*gradient)[3], float *density, karst_error *error)
{
    gradient_task task = {.at = at, .gradient = gradient, .density = density, .footprint_m = config->footprint_m};
    return check_footprint(config, error) && karst_crew_run(world, config, num, find_gradients, &task, error) &&
           (!atomic_load(&task.is_too_large) || fail_too_large(error));
}

/* ---- colours ---- */

typedef struct {
    const karst_position *at;
    const float (*normals)[3]; /* NULL: those of the density */
    float (*rgb)[3];
    double footprint_m;
    atomic_bool is_too_large;
} colour_task;

/* Towards the air; up where there is no slope. */
static void turn_to_normal(const float gradient[3], float normal[3])
{
    const double x = (double)gradient[0], y = (double)gradient[1], z = (double)gradient[2];
    const double length = sqrt(x * x + y * y + z * z);
    const bool is_known = length > 0 && isfinite(length);
    normal[0] = is_known ? (float)(-x / length) : 0;
    normal[1] = is_known ? (float)(-y / length) : 1;
    normal[2] = is_known ? (float)(-z / length) : 0;
}

static void find_colours(void *user, karst_sampler *sampler, size_t first, size_t end)
{
    colour_task *task = user;
    float gradient[ROOM][3], density[ROOM];
    for (size_t i = first, num; i < end; i += num) {
        num = at_most(end - i);
        if (!task->normals &&
            !karst_sampler_gradients(sampler, task->at + i, num, task->footprint_m, gradient, density)) {
            atomic_store(&task->is_too_large, true);
            return;
        }
        for (size_t j = 0; j < num; j++) {
            float normal[3];
            karst_sample rgb[3] = {{0, 0}};
            if (!task->normals)
                turn_to_normal(gradient[j], normal);
            karst_sampler_colour(sampler, &task->at[i + j], task->normals ? task->normals[i + j] : normal,
                                 task->footprint_m, rgb);
            for (int channel = 0; channel < 3; channel++)
                task->rgb[i + j][channel] = rgb[channel].device;
        }
    }
}

bool karst_query_colours(const karst_world *world, const karst_query_config *config, const karst_position *at,
                         const float (*normals)[3], size_t num, float (*rgb)[3], karst_error *error)
{
    colour_task task = {.at = at, .normals = normals, .rgb = rgb, .footprint_m = config->footprint_m};
    if (!karst_world_get_metadata(world)->has_colour)
        return karst_fail(error, KARST_USAGE, "the world has no colours: it defines neither colour() nor surface()");
    return check_footprint(config, error) && karst_crew_run(world, config, num, find_colours, &task, error) &&
           (!atomic_load(&task.is_too_large) || fail_too_large(error));
}

/* ---- bounds ---- */

typedef struct {
    const karst_position *centres;
    const double (*half_m)[3];
    double (*range)[2];
    double footprint_m;
} bound_task;

static void find_bounds(void *user, karst_sampler *sampler, size_t first, size_t end)
{
    const bound_task *task = user;
    for (size_t i = first; i < end; i++)
        karst_sampler_bounds(sampler, &task->centres[i], task->half_m[i], task->footprint_m, task->range[i]);
}

bool karst_query_bounds(const karst_world *world, const karst_query_config *config, const karst_position *centres,
                        const double (*half_m)[3], size_t num, double (*range)[2], karst_error *error)
{
    bound_task task = {centres, half_m, range, config->footprint_m};
    for (size_t i = 0; i < num; i++)
        if (!(half_m[i][0] >= 0) || !(half_m[i][1] >= 0) || !(half_m[i][2] >= 0))
            return karst_fail(error, KARST_USAGE, "box %zu: half its sides are %g, %g, %g m: none may be below 0",
                              i + 1, half_m[i][0], half_m[i][1], half_m[i][2]);
    return check_footprint(config, error) && karst_crew_run(world, config, num, find_bounds, &task, error);
}
