/* The shipped worlds, opened for tests: compiled, with their data and a host oracle. One test for each. */
#ifndef KARST_TESTS_WORLDS_SHIPPED_H
#define KARST_TESTS_WORLDS_SHIPPED_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/camera.h"
#include "karst/data.h"
#include "producers/density/density_producer.h"
#include "producers/language/oracle/oracle.h"
#include "producers/density/world_file.h"
#include "tests/support/pool.h"

#define SHIPPED_MAX 64

typedef struct {
    const char *name;
    karst_world_file *whole;
    karst_world_file *file; /* of what is looked at: the whole, or its clear matter */
    karst_oracle *oracle;
    karst_camera camera;
    int64_t surface[3]; /* a voxel at the surface that the camera looks at */
    uint64_t random;    /* state: each world has its own sequence, so that one test alone gives what all give */
} shipped_world;

static inline uint32_t shipped_random(shipped_world *world)
{
    world->random = world->random * 6364136223846793005u + 1442695040888963407u;
    uint64_t mixed = world->random ^ world->random >> 29;
    return (uint32_t)(mixed * 0xbf58476d1ce4e5b9u >> 32);
}

/* Along the camera's line of sight, or a little below it. */
static void shipped_find_surface(shipped_world *world)
{
    enum { STEPS = 4096 };
    const karst_world_info *info = &world->file->info;
    for (int tilt = 0; tilt < 8; tilt++) {
        karst_camera camera = world->camera;
        double right[3], up[3], forward[3], offset_m[3], last_m = 0;
        camera.pitch_deg -= 4 * tilt;
        karst_camera_axes(&camera, right, up, forward);
        for (int step = 1; step <= STEPS; step++) {
            double distance_m = 2 * info->view_distance_m * step / STEPS;
            for (int axis = 0; axis < 3; axis++)
                offset_m[axis] = forward[axis] * distance_m;
            karst_position at = karst_position_add_m(camera.position, offset_m, info->voxel_log2_m);
            if (!(karst_oracle_density(world->oracle, &at, 0).precise > 0)) {
                last_m = distance_m;
                continue;
            }
            for (int i = 0; i < 60; i++) {
                double middle_m = (last_m + distance_m) / 2;
                for (int axis = 0; axis < 3; axis++)
                    offset_m[axis] = forward[axis] * middle_m;
                at = karst_position_add_m(camera.position, offset_m, info->voxel_log2_m);
                *(karst_oracle_density(world->oracle, &at, 0).precise > 0 ? &distance_m : &last_m) = middle_m;
            }
            memcpy(world->surface, at.voxel, sizeof at.voxel);
            return;
        }
    }
    fail_msg("%s: the camera sees nothing", world->name);
}

/* The land of a world, or its clear matter. */
static void shipped_open_part(shipped_world *world, const char *name, bool clear)
{
    karst_error error = {0};
    char path[4096];
    *world = (shipped_world){.name = name, .random = pool_hash(POOL_HASH_START, name, strlen(name))};
    pool_expect(karst_data_find("worlds", name, ".karst", path, sizeof path, &error), name, &error);
    world->whole = karst_world_file_open(path, NULL, 0, NULL, &error);
    pool_expect(world->whole, name, &error);
    world->file = clear ? world->whole->content[KARST_CONTENT_CLEAR] : world->whole;
    assert_non_null(world->file);
    const karst_program_graph *program = world->file->program;
    karst_number *values = calloc(program->num_parameters + 1, sizeof *values);
    assert_non_null(values);
    for (uint32_t i = 0; i < program->num_parameters; i++)
        values[i] = program->parameters[i].value;
    world->oracle =
        karst_oracle_create(&program->world, values, program->header.seed, program->header.voxel_log2_m, &error);
    free(values);
    pool_expect(world->oracle, name, &error);
    world->camera.fov_deg = 60;
    pool_expect(karst_camera_parse(world->file->info.camera, world->file->info.voxel_log2_m, &world->camera, &error),
                name, &error);
    shipped_find_surface(world);
}

static inline void shipped_open(shipped_world *world, const char *name) { shipped_open_part(world, name, false); }

static void shipped_close(shipped_world *world)
{
    karst_oracle_destroy(world->oracle);
    karst_world_file_destroy(world->whole);
}

static inline karst_context *shipped_context(int lanes)
{
    karst_error error = {0};
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), lanes, NULL, &error);
    pool_expect(context, "context", &error);
    return context;
}

static inline float shipped_density(shipped_world *world, const int64_t voxel[3], const uint32_t fraction[3], int level)
{
    karst_position at;
    memcpy(at.voxel, voxel, sizeof at.voxel);
    memcpy(at.fraction, fraction, sizeof at.fraction);
    return karst_oracle_density(world->oracle, &at, level).device;
}

/* The samples of a brick as the host has them. */
static inline void shipped_samples(shipped_world *world, const int64_t origin[3], int level,
                                   float samples[KARST_BRICK_SAMPLES])
{
    static const uint32_t none[3];
    for (int i = 0; i < KARST_BRICK_SAMPLES; i++) {
        const int steps[3] = {i % KARST_BRICK_SIDE, i / KARST_BRICK_SIDE % KARST_BRICK_SIDE,
                              i / KARST_BRICK_SIDE / KARST_BRICK_SIDE};
        int64_t voxel[3];
        for (int axis = 0; axis < 3; axis++)
            voxel[axis] = origin[axis] + ((int64_t)steps[axis] << level);
        samples[i] = shipped_density(world, voxel, none, level);
    }
}

/* Moves a place up or down (towards the origin of a globe, where that is down) to where the density changes sign, as
 * far as halving finds it within +- reach voxels; else it stays where it is, and that is false. */
static inline bool shipped_to_surface(shipped_world *world, int64_t voxel[3], int64_t reach)
{
    static const uint32_t none[3];
    int64_t low[3], high[3];
    memcpy(low, voxel, sizeof low);
    memcpy(high, voxel, sizeof high);
    low[1] -= reach;
    high[1] += reach;
    float below = shipped_density(world, low, none, 0), above = shipped_density(world, high, none, 0);
    if (!((below > 0) != (above > 0)))
        return false;
    while (high[1] - low[1] > 1) {
        voxel[1] = low[1] + (high[1] - low[1]) / 2;
        if ((shipped_density(world, voxel, none, 0) > 0) == (below > 0))
            low[1] = voxel[1];
        else
            high[1] = voxel[1];
    }
    return true;
}

/* Runs `test` once for each shipped world, or for $KARST_TEST_WORLD alone; the state is the world's name. Under
 * KARST_TEST_QUICK three that have little in common must do; else every `step`th, or all with KARST_TEST_FULL. */
static inline int shipped_run(const char *what, CMUnitTestFunction test, size_t step)
{
    static char names[SHIPPED_MAX][KARST_DATA_NAME_BYTES];
    struct CMUnitTest tests[SHIPPED_MAX];
    const char *only = getenv("KARST_TEST_WORLD");
    size_t num_names = karst_data_list("worlds", ".karst", names, SHIPPED_MAX), num_tests = 0;
    for (size_t i = 0; i < num_names; i++)
        if (only                         ? !strcmp(only, names[i])
            : getenv("KARST_TEST_QUICK") ? strstr(" hills lattice planet ", names[i]) != NULL
                                         : i % step == 0 || getenv("KARST_TEST_FULL") != NULL)
            tests[num_tests++] = (struct CMUnitTest){.name = names[i], .test_func = test, .initial_state = names[i]};
    if (num_tests == 0) {
        fprintf(stderr, "%s: no world to test\n", what);
        return 1;
    }
    return _cmocka_run_group_tests(what, tests, num_tests, NULL, NULL);
}

#endif
