/* What every world's bounds must pass. A test defines WORLD_SOURCE (host C, one lane) before it includes this, and sets
 * world_surface. */
#ifndef KARST_TESTS_NOISE_WORLD_BOUNDS_H
#define KARST_TESTS_NOISE_WORLD_BOUNDS_H

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "tests/noise/mutants.h"

#ifndef WORLD_SOURCE
#define WORLD_SOURCE "producers/worlds/hills.clh"
#endif
#include WORLD_SOURCE
#include "tests/noise/random.h"

/* Moves a random level-0 voxel to the surface, or near it. */
static void (*world_surface)(int64_t voxel[3]);

static inline float density_at(const int64_t voxel[3], const uint32_t fraction[3], int level)
{
    world_point_at at;
    for (int a = 0; a < 3; a++) {
        at.voxel[a] = voxel[a];
        at.fraction[a] = fraction ? fraction[a] : 0;
    }
    return world_point(&at, level);
}

/* Full detail, the parent's voxel, and all between. */
static inline int random_footprint(int level) { return (int)random_between(-1, level + 1); }

/* A point of the box from `corner`, `side` voxels wide: often on its faces, edges and corners. */
static inline void random_in_box(const int64_t corner[3], int64_t side, int64_t voxel[3], uint32_t fraction[3])
{
    for (int a = 0; a < 3; a++) {
        int64_t at = random_below(3) ? random_below(side) : random_bits() & 1 ? side : 0;
        voxel[a] = corner[a] + at;
        fraction[a] = at < side && random_below(2) ? (uint32_t)random_bits() : 0;
    }
}

/* A node of the level that touches a place near the surface. */
static inline void random_node(int level, int64_t corner[3])
{
    static const int64_t offsets[] = {0, 1000000000, 1000000000000000};
    int64_t side = INT64_C(16) << level, offset = offsets[random_below(3)];
    for (int a = 0; a < 3; a++)
        corner[a] = random_between(-200000, 200000) + (random_bits() & 1 ? offset : -offset);
    world_surface(corner);
    for (int a = 0; a < 3; a++)
        corner[a] = ((corner[a] >> (level + 4)) + random_between(-1, 1)) * side;
}

typedef struct {
    long values, slopes;
} escape_count;

/* Bounds of nodes, and of parts of nodes, against densities at points and footprints; slopes against pairs of points.
 */
static inline escape_count world_escapes(int nodes, int points, int max_level)
{
    escape_count num = {0, 0};
    for (int n = 0; n < nodes; n++) {
        int level = (int)random_between(0, max_level);
        int64_t corner[3], side = INT64_C(16) << level;
        world_bound bound;
        random_node(level, corner);
        world_bounds(corner[0], corner[1], corner[2], level, &bound);
        if (random_below(3) == 0) {
            /* a part of it, for the same footprints */
            world_box box;
            int depth = (int)random_between(0, 3);
            side >>= depth;
            for (int a = 0; a < 3; a++) {
                corner[a] += random_below(1 << depth) * side;
                box.centre[a] = corner[a] + side / 2;
            }
            box.radius = (float)(side / 2);
            box.level = level;
            world_box_bounds(&box, &bound);
        }
        for (int i = 0; i < points; i++) {
            int64_t voxel[3];
            uint32_t fraction[3];
            int footprint = random_footprint(level);
            if (i < 8) {
                for (int a = 0; a < 3; a++) {
                    voxel[a] = corner[a] + (i >> a & 1 ? side : 0);
                    fraction[a] = 0;
                }
            } else {
                random_in_box(corner, side, voxel, fraction);
            }
            float here = density_at(voxel, fraction, footprint);
            num.values += !(here >= bound.lo && here <= bound.hi);
            /* and on along an axis */
            int a = (int)random_below(3);
            int64_t other[3] = {voxel[0], voxel[1], voxel[2]};
            other[a] = corner[a] + random_below(side + 1);
            if (other[a] == corner[a] + side && fraction[a])
                continue;
            float there = density_at(other, fraction, footprint);
            double distance = fabs((double)(other[a] - voxel[a]));
            double error = (double)world_slack(0) + 0x1p-22 * (fabs((double)here) + fabs((double)there));
            num.slopes += !(fabs((double)here - (double)there) <= (double)bound.slope[a] * distance + error);
        }
    }
    return num;
}

static inline void test_bounds_hold_the_density(void **state)
{
    (void)state;
    mutant = MUTANT_NONE;
    escape_count num = world_escapes(6000, 100, 26);
    if (num.values || num.slopes)
        fail_msg("%ld values and %ld slopes escape", num.values, num.slopes);
    num = world_escapes(4000, 100, 4);
    if (num.values || num.slopes)
        fail_msg("%ld values and %ld slopes escape from small nodes", num.values, num.slopes);
}

/* Every rule that the world's bounds rest on, broken, must let something escape. */
static inline void assert_mutants_escape(const enum mutant *mutants, size_t num_mutants)
{
    for (size_t i = 0; i < num_mutants; i++) {
        escape_count num = {0, 0};
        mutant = mutants[i];
        for (int round = 0; round < 60 && num.values + num.slopes == 0; round++)
            num = world_escapes(500, 100, round % 2 ? 4 : 14);
        print_message("[          ] mutant %d: %ld values, %ld slopes escape\n", (int)mutant, num.values, num.slopes);
        if (num.values + num.slopes == 0)
            fail_msg("mutant %d is not noticed", (int)mutant);
    }
    mutant = MUTANT_NONE;
}

/* What a footprint changes is within the slack, near the surface. */
static inline void test_slack_holds_what_fades(void **state)
{
    (void)state;
    mutant = MUTANT_NONE;
    for (int i = 0; i < 200000; i++) {
        int64_t voxel[3];
        int level = (int)random_below(16);
        random_node(level, voxel);
        float here = density_at(voxel, NULL, level), there = density_at(voxel, NULL, random_footprint(level));
        if (!(fabsf(here - there) <= world_slack(level) + 0x1p-22f * fabsf(here)))
            fail_msg("level %d: %g and %g, slack %g", level, (double)here, (double)there, (double)world_slack(level));
    }
}

/* Both signs in a node, as dense samples see it at full detail and at the footprints up to the parent's. */
static inline bool has_surface(const int64_t corner[3], int level, int samples_a_side)
{
    bool solid = false, air = false;
    int64_t side = INT64_C(16) << level;
    for (int s = 0; s < samples_a_side * samples_a_side * samples_a_side && !(solid && air); s++) {
        const int at[3] = {s % samples_a_side, s / samples_a_side % samples_a_side,
                           s / samples_a_side / samples_a_side};
        int64_t voxel[3];
        for (int a = 0; a < 3; a++)
            voxel[a] = corner[a] + side * at[a] / (samples_a_side - 1);
        for (int footprint = -1; footprint <= level + 1; footprint += s % 5 ? level + 2 : 1) {
            float d = density_at(voxel, NULL, footprint);
            solid |= d > 0;
            air |= d <= 0;
        }
    }
    return solid && air;
}

/* The hard cases: the children of nodes that hold surface. How many of those without any are proven, and how many
 * bricks are made for each that holds some. */
static inline void test_bounds_are_tight(double share_at_leaves)
{
    mutant = MUTANT_NONE;
    for (int level = 0; level <= 8; level += 2) {
        int constant = 0, proven = 0, surface = 0;
        for (int n = 0; n < 40; n++) {
            int64_t parent[3];
            for (int a = 0; a < 3; a++)
                parent[a] = random_between(-200000, 200000);
            world_surface(parent);
            for (int child = 0; child < 8; child++) {
                int64_t corner[3];
                world_bound bound;
                for (int a = 0; a < 3; a++)
                    corner[a] = ((parent[a] >> (level + 5)) * 2 + (child >> a & 1)) * (INT64_C(16) << level);
                world_bounds(corner[0], corner[1], corner[2], level, &bound);
                bool decided = bound.lo > 0 || bound.hi < 0;
                if (has_surface(corner, level, level ? 13 : 17)) {
                    surface++;
                    assert_false(decided);
                } else {
                    constant++;
                    proven += decided;
                }
            }
        }
        print_message("[          ] level %d: %.1f %% of constant children proven, %.2f bricks for each with surface\n",
                      level, 100.0 * proven / constant, (double)(surface + constant - proven) / surface);
        if (level == 0)
            assert_true(proven >= share_at_leaves * constant);
    }
}

/* Far from the surface a node is decided at once, whatever its size. */
static inline void assert_decided(int64_t x, int64_t y, int64_t z, int level, bool solid)
{
    int64_t side = INT64_C(16) << level;
    world_bound bound;
    mutant = MUTANT_NONE;
    world_bounds(x & -side, y & -side, z & -side, level, &bound);
    if (!(solid ? bound.lo > 0 : bound.hi < 0))
        fail_msg("node of level %d at (%ld, %ld, %ld): %g to %g", level, x, y, z, (double)bound.lo, (double)bound.hi);
    assert_true(bound.slope[0] > 0 && bound.slope[1] > 0 && bound.slope[2] > 0);
}

#endif
