/* Colours without aliasing: what a footprint hides is at its mean, edges are as wide as the footprint, and where
 * nothing is hidden colours are what the text says. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <math.h>

#include "producers/language/language.h"
#include "producers/language/oracle/oracle.h"

typedef struct {
    karst_program_graph *program;
    karst_oracle *oracle;
} world;

/* Voxels of 1/16 m: level 4 is 1 m. */
static void open_world(world *w, const char *colour)
{
    char text[1024];
    bool ok;
    karst_error error = {0};
    snprintf(text, sizeof text,
             "/*{ \"voxel\": 0.0625, \"params\": { \"k\": { \"value\": 2, \"min\": 1, \"max\": 64 } } }*/\n"
             "float density(vec3 p) { return sin(40.0 * p.x) - p.y; }\n"
             "vec3 colour(vec3 p, vec3 n) { return vec3(%s); }\n",
             colour);
    w->program = karst_language_compile("test.karst", text, strlen(text), NULL, 0, &ok, &error);
    if (!ok)
        fail_msg("%s", error.message);
    karst_number values[1] = {w->program->parameters[0].value};
    w->oracle = karst_oracle_create(&w->program->world, values, 0, -4, &error);
    assert_non_null(w->oracle);
}

static void close_world(world *w)
{
    karst_oracle_destroy(w->oracle);
    karst_program_graph_destroy(w->program);
}

static double red_at(world *w, double x_m, int level)
{
    static const float facing[KARST_FACING_FLOATS] = {0, 1, 0};
    const double offset_m[3] = {x_m, 0.25, 0.5};
    karst_oracle_value rgb[3];
    karst_position at = karst_position_add_m((karst_position){{0}, {0}}, offset_m, -4);
    karst_oracle_colour(w->oracle, &at, facing, level, rgb);
    assert_true(fabs((double)rgb[0].device - rgb[0].precise) < 1e-4);
    return (double)rgb[0].device;
}

/* The colour at many places, at a level: its least and greatest value. */
static void range_at(world *w, int level, double range[2])
{
    range[0] = INFINITY;
    range[1] = -INFINITY;
    for (int i = 0; i < 500; i++) {
        double red = red_at(w, 100.0 + 0.0371 * i, level);
        range[0] = fmin(range[0], red);
        range[1] = fmax(range[1], red);
    }
}

static void test_periods(void **state)
{
    (void)state;
    /* Periods of 4 m: shown by voxels up to 1 m, hidden by those of 2 m. */
    static const struct {
        const char *colour;
        double least, greatest, mean;
    } cases[] = {
        {"sin(1.5707963267948966 * p.x)", -1, 1, 0},
        {"cos(p.x * 3.141592653589793 / k)", -1, 1, 0},
        {"fract(p.x / 4.0)", 0, 1, 0.5},
        {"mod(p.x, 4.0)", 0, 4, 2},
        {"0.25 + fract(p.x / 4.0 + 0.01 * noise(p))", 0.25, 1.25, 0.75},
        {"sin(length(vec2(p.x, 0.5)) * 1.5707963267948966)", -1, 1, 0},
        /* cells, by their numbers */
        {"mod(floor(p.x / 2.0), 2.0)", 0, 1, 0.5},
        {"mod(floor(p.x / 1.3), 3.0)", 0, 2, 1},
        {"mod(floor(p.x / 2.0) + floor(p.z / 2.0), 2.0)", 0, 1, 0.5},
        {"mod(floor(p.x), 4.0) < 1.0 ? 1.0 : 0.0", 0, 1, 0.25},
        {"(int(floor(p.x / 2.0)) + int(floor(p.z / 2.0))) % 2 == 0 ? 1.0 : 0.25", 0.25, 1, 0.625},
        {"(int(floor(p.x)) & 3) != 1 ? 1.0 : 0.0", 0, 1, 0.75},
    };
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        world w;
        double range[2], hidden[2];
        open_world(&w, cases[c].colour);
        range_at(&w, 2, range);
        range_at(&w, 5, hidden);
        print_message("%s: %.3f to %.3f; hidden: %.4f to %.4f\n", cases[c].colour, range[0], range[1], hidden[0],
                      hidden[1]);
        assert_true(fabs(range[0] - cases[c].least) < 0.05 && fabs(range[1] - cases[c].greatest) < 0.05);
        assert_true(fabs(hidden[0] - cases[c].mean) < 0.02 && fabs(hidden[1] - cases[c].mean) < 0.02);
        close_world(&w);
    }
}

static void test_edges(void **state)
{
    (void)state;
    world w;
    open_world(&w, "p.x < 100.0 ? 1.0 : 0.0");
    for (int level = 0; level < 8; level++) {
        double voxel_m = ldexp(1, level - 4);
        assert_true(red_at(&w, 100 - 0.51 * voxel_m, level) == 1);
        assert_true(red_at(&w, 100 + 0.51 * voxel_m, level) == 0);
        assert_true(fabs(red_at(&w, 100 - 0.25 * voxel_m, level) - 0.75) < 1e-3);
        assert_true(fabs(red_at(&w, 100, level) - 0.5) < 1e-3);
    }
    close_world(&w);
    /* Stripes: as much of one as of the other, whatever the share. */
    open_world(&w, "step(0.75, fract(p.x / 4.0))");
    double range[2];
    range_at(&w, 0, range);
    assert_true(range[0] == 0 && range[1] == 1);
    range_at(&w, 9, range);
    assert_true(range[1] - range[0] < 0.05);
    close_world(&w);
}

/* The footprint lies along the surface: level ground a little below an edge in height is on one side of it, whatever
 * its footprint; on slopes edges are as wide as heights differ within it. */
static void test_along_the_surface(void **state)
{
    (void)state;
    static const double slopes[] = {0, 1e-4, 0.3, 1, 30};
    world w;
    open_world(&w, "p.y > 0.02 ? 1.0 : 0.0");
    for (size_t i = 0; i < sizeof slopes / sizeof *slopes; i++) {
        /* turned about both axes */
        const double sine = slopes[i] / hypot(1, slopes[i]);
        const float facing[KARST_FACING_FLOATS] = {(float)(0.6 * sine), (float)(1 / hypot(1, slopes[i])),
                                                   (float)(-0.8 * sine)};
        for (int level = 0; level < 12; level++) {
            const double width_m = ldexp(sine, level - 4);
            for (int k = -3; k <= 3; k++) {
                const double offset_m[3] = {3, 0.02 + (k ? 0.3 * k * fmax(width_m, 1e-3) : -0.02), 5};
                const double inside = (offset_m[1] - 0.02) / fmax(width_m, 1e-30) + 0.5;
                karst_oracle_value rgb[3];
                const karst_position at = karst_position_add_m((karst_position){{0}, {0}}, offset_m, -4);
                karst_oracle_colour(w.oracle, &at, facing, level, rgb);
                assert_true(fabs((double)rgb[0].device - fmax(0, fmin(1, inside))) < 2e-3);
            }
        }
    }
    close_world(&w);
}

/* What is seen edge on has a footprint that lies longer on it, along the look: by 1 / cosine. */
static void test_along_the_look(void **state)
{
    (void)state;
    static const double normal[3] = {0.36, 0.8, -0.48}, aside[3] = {0.8, 0, 0.6}, away[3] = {0.48, -0.6, -0.64},
                        gradient[3] = {0.25, -1, 0.5};
    static const double cosines[] = {1, 0.7, 0.2, 0.05, 1.0 / 60};
    world w;
    open_world(&w, "0.25 * p.x - p.y + 0.5 * p.z > 0.02 ? 1.0 : 0.0");
    double across = 0, along = 0;
    for (int i = 0; i < 3; i++) {
        across += gradient[i] * aside[i];
        along += gradient[i] * away[i];
    }
    for (size_t i = 0; i < sizeof cosines / sizeof *cosines; i++) {
        /* a ray into the surface, which goes along it by `away` */
        const double tangent = sqrt(1 - cosines[i] * cosines[i]) / cosines[i];
        float facing[KARST_FACING_FLOATS];
        for (int k = 0; k < 3; k++) {
            facing[k] = (float)normal[k];
            facing[3 + k] = (float)(tangent * away[k]);
        }
        for (int level = 4; level < 12; level++) {
            const double width = ldexp(hypot(across, along / cosines[i]), level - 4);
            for (int k = -3; k <= 3; k++) {
                const double offset_m[3] = {0, -0.02 - 0.3 * k * width, 0};
                karst_oracle_value rgb[3];
                const karst_position at = karst_position_add_m((karst_position){{0}, {0}}, offset_m, -4);
                karst_oracle_colour(w.oracle, &at, facing, level, rgb);
                assert_true(fabs((double)rgb[0].device - fmax(0, fmin(1, 0.3 * k + 0.5))) < 2e-3);
            }
        }
    }
    close_world(&w);
}

/* All detail: what the text says, to the last bit. */
static void test_full_detail_is_sharp(void **state)
{
    (void)state;
    world w;
    open_world(&w, "(p.x * 0.75 < 76.3 ? 1.0 : 0.0) + fract(p.x)");
    for (int i = 0; i < 200; i++) {
        double x_m = 100 + i / 32.0, right = (x_m * 0.75 < 76.3 ? 1 : 0) + (x_m - floor(x_m));
        assert_true(red_at(&w, x_m, -1) == right);
    }
    close_world(&w);
    open_world(&w, "(mod(floor(p.x), 3.0) < 1.0 ? 1.0 : 0.0) + mod(floor(p.x) + floor(p.z), 2.0)");
    for (int i = 0; i < 200; i++) {
        double x_m = 100 + i / 32.0, cell = floor(x_m), right = (fmod(cell, 3) < 1) + fmod(cell, 2);
        assert_true(red_at(&w, x_m, -1) == right);
    }
    close_world(&w);
}

/* A normal has no slope that anybody knows: edges in it stay as they are. And densities keep all. */
static void test_what_stays(void **state)
{
    (void)state;
    world w;
    open_world(&w, "n.y < 0.5 ? 0.25 : 0.75");
    assert_true(red_at(&w, 3, 12) == 0.75);
    const double offset_m[3] = {1.0, 0, 0};
    karst_position at = karst_position_add_m((karst_position){{0}, {0}}, offset_m, -4);
    assert_true(fabs(karst_oracle_density(w.oracle, &at, 12).precise - sin(40)) < 1e-6);
    close_world(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_periods),
        cmocka_unit_test(test_edges),
        cmocka_unit_test(test_along_the_surface),
        cmocka_unit_test(test_along_the_look),
        cmocka_unit_test(test_full_detail_is_sharp),
        cmocka_unit_test(test_what_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
