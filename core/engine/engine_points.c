/* The density at points, by a device: karst/rays.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/device/context.h"
#include "core/engine/engine_points_shared.h"
#include "karst/rays.h"
#include "producers/density/world_internal.h"
#include "producers/language/emit/emit.h"

enum { BATCH_POINTS = 1 << 18, GPU_ITEMS = 64 };

struct karst_device_points {
    const karst_world *world;
    karst_context *context;
    karst_program *program;
    cl_kernel kernel;
    karst_buffer *data, *places, *density, *gradient;
};

_Static_assert(sizeof(karst_position) == sizeof(karst_point_place) &&
                   offsetof(karst_position, fraction) == offsetof(karst_point_place, fraction),
               "positions go to the device as they are");

static bool check(const karst_world *world, karst_error *error)
{
    const char *name = world->metadata.name;
    if (!world->gradient_oracle)
        return karst_fail(error, KARST_USAGE, "%.200s is too large to have a gradient: ask karst_query_densities",
                          name);
    if (world->models.data)
        return karst_fail(error, KARST_USAGE, "%.200s shows models: ask karst_query_densities", name);
    return !world->file->program->world.text ||
           karst_fail(error, KARST_USAGE,
                      "%.200s has a density that is not computed as it is written: ask karst_query_densities", name);
}

static bool build(karst_device_points *p, const karst_world *world, karst_error *error)
{
    const karst_world_layout *layout = karst_oracle_layout(world->gradient_oracle);
    const uint64_t *words = karst_oracle_words(world->gradient_oracle);
    char *source = NULL;
    if (!karst_emit_surface(layout, &source, error))
        return false;
    const karst_virtual_file file = {"world.clh", source};
    p->program = karst_program_build(p->context, "core/engine/engine_points.cl", "-DWORLD_HAS_DATA", &file, 1, error);
    free(source);
    p->kernel = p->program ? karst_program_kernel(p->program, "find_points", error) : NULL;
    if (!p->kernel)
        return false;
    p->data = karst_buffer_create(p->context, "points", layout->num_words * sizeof *words, words, error);
    p->places = p->data
                    ? karst_buffer_create(p->context, "points", BATCH_POINTS * sizeof(karst_point_place), NULL, error)
                    : NULL;
    p->density =
        p->places ? karst_buffer_create(p->context, "points", BATCH_POINTS * sizeof(float), NULL, error) : NULL;
    p->gradient =
        p->density ? karst_buffer_create(p->context, "points", 3 * BATCH_POINTS * sizeof(float), NULL, error) : NULL;
    return p->gradient;
}

karst_device_points *karst_device_points_create(const karst_world *world, const char *device, const karst_log *log,
                                                karst_error *error)
{
    if (!check(world, error))
        return NULL;
    karst_device_points *p = calloc(1, sizeof *p);
    if (!p) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    p->world = world;
    p->context = karst_context_create(device, 0, log, error);
    if (p->context && build(p, world, error))
        return p;
    karst_device_points_destroy(p);
    return NULL;
}

void karst_device_points_destroy(karst_device_points *points)
{
    if (!points)
        return;
    if (points->kernel)
        clReleaseKernel(points->kernel);
    karst_program_destroy(points->program);
    karst_buffer_destroy(points->data);
    karst_buffer_destroy(points->places);
    karst_buffer_destroy(points->density);
    karst_buffer_destroy(points->gradient);
    karst_context_destroy(points->context);
    free(points);
}

static bool find_batch(karst_device_points *p, const karst_position *at, cl_uint num, cl_int level, float *density,
                       float (*gradient)[3], karst_error *error)
{
    const cl_int wants_gradient = gradient != NULL;
    const size_t lanes = (size_t)p->context->lanes;
    uint64_t ns[KARST_NUM_STAGES] = {0};
    return karst_buffer_write(p->places, 0, at, num * sizeof *at, error) &&
           KARST_ARGUMENTS(p->kernel, error, KARST_BUFFER_ARG(p->places), KARST_VALUE_ARG(num),
                           KARST_BUFFER_ARG(p->data), KARST_VALUE_ARG(level), KARST_VALUE_ARG(wants_gradient),
                           KARST_BUFFER_ARG(p->density), KARST_BUFFER_ARG(p->gradient)) &&
           karst_launch(p->context, p->kernel, KARST_STAGE_EVALUATE, (num + lanes - 1) / lanes,
                        p->context->is_cpu ? 1 : GPU_ITEMS, error) &&
           karst_buffer_read(p->density, 0, density, num * sizeof *density, error) &&
           (!gradient || karst_buffer_read(p->gradient, 0, gradient, num * sizeof *gradient, error)) &&
           karst_profile_collect(p->context, ns, error);
}

bool karst_device_points_find(karst_device_points *points, const karst_position *at, size_t num, double footprint_m,
                              float *density, float (*gradient)[3], karst_error *error)
{
    if (!(footprint_m >= 0) || !isfinite(footprint_m))
        return karst_fail(error, KARST_USAGE, "a footprint of %g m: it must not be below 0", footprint_m);
    const cl_int level = karst_world_level(points->world, footprint_m);
    bool done = true;
    for (size_t i = 0; done && i < num; i += BATCH_POINTS)
        done = find_batch(points, at + i, (cl_uint)(num - i < BATCH_POINTS ? num - i : BATCH_POINTS), level,
                          density + i, gradient ? gradient + i : NULL, error);
    return done;
}
