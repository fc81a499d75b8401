/* Underfoot on a globe as large as the Earth, with voxels of centimetres, floats alone are wrong by half a metre. What
 * Karst computes there is right to a hundredth of a voxel. */
#include <math.h>

#include "tests/worlds/shipped.h"

#define NUM_POINTS 20000

static double uniform(shipped_world *world) { return (shipped_random(world) + 0.5) * 0x1p-32; }

/* A direction, all equally likely. */
static void random_direction(shipped_world *world, double direction[3])
{
    double z = 2 * uniform(world) - 1, angle = 6.283185307179586 * uniform(world), r = sqrt(1 - z * z);
    direction[0] = r * cos(angle);
    direction[1] = z;
    direction[2] = r * sin(angle);
}

static karst_position at_radius(const shipped_world *world, const double direction[3], double radius_m)
{
    double offset_m[3];
    for (int axis = 0; axis < 3; axis++)
        offset_m[axis] = direction[axis] * radius_m;
    return karst_position_add_m((karst_position){{0}, {0}}, offset_m, world->file->info.voxel_log2_m);
}

/* The way out from the solid to where the density is 0. */
static karst_position find_surface(shipped_world *world, const double direction[3])
{
    double low_m = 6.35e6, high_m = 6.40e6;
    for (int i = 0; i < 60; i++) {
        double middle_m = (low_m + high_m) / 2;
        karst_position at = at_radius(world, direction, middle_m);
        *(karst_oracle_precise_density(world->oracle, &at, -1) > 0 ? &low_m : &high_m) = middle_m;
    }
    return at_radius(world, direction, low_m);
}

static void test_surface_of_the_planet(void **state)
{
    (void)state;
    shipped_world world;
    double worst_voxels = 0;
    shipped_open(&world, "planet");
    double voxel_m = exp2(world.file->info.voxel_log2_m);
    for (int n = 0; n < NUM_POINTS; n++) {
        double direction[3];
        random_direction(&world, direction);
        karst_position at = find_surface(&world, direction);
        karst_oracle_value d = karst_oracle_density(world.oracle, &at, -1);
        assert_true(fabs(d.precise) < 1); /* it is the surface */
        worst_voxels = fmax(worst_voxels, fabs((double)d.device - d.precise) / voxel_m);
    }
    print_message("planet: wrong by %.5f voxels at most, at %d places\n", worst_voxels, NUM_POINTS);
    assert_true(worst_voxels <= 0.01);
    shipped_close(&world);
}

/* The part that needs it against 113 bits of precision, at exact places: a bare globe. */
static void check_bare_globe(const char *text)
{
    karst_error error = {0};
    shipped_world world = {.name = "globe", .random = 5};
    double worst_device = 0, worst_precise = 0, worst_float = 0;
    const karst_number none = {0};
    world.file = karst_world_file_compile("globe.karst", text, strlen(text), NULL, 0, NULL, &error);
    pool_expect(world.file, "globe", &error);
    world.oracle = karst_oracle_create(&world.file->program->world, &none, 0, world.file->info.voxel_log2_m, &error);
    pool_expect(world.oracle, "globe", &error);
    double voxel_m = exp2(world.file->info.voxel_log2_m);
    for (int n = 0; n < NUM_POINTS; n++) {
        double direction[3];
        random_direction(&world, direction);
        karst_position at = at_radius(&world, direction, 6371000.0 + 100 * (uniform(&world) - 0.5));
        __float128 sum = 0;
        float float_sum = 0;
        for (int axis = 0; axis < 3; axis++) {
            __float128 p = ((__float128)at.voxel[axis] + (__float128)at.fraction[axis] * 0x1p-32) * voxel_m;
            sum += p * p;
            float_sum += (float)p * (float)p;
        }
        __float128 root = sqrtl((long double)sum); /* then a step of Newton's for the other half of the digits */
        root = (root + sum / root) / 2;
        double right = (double)(6371000 - root);
        karst_oracle_value d = karst_oracle_density(world.oracle, &at, -1);
        worst_device = fmax(worst_device, fabs((double)d.device - right) / voxel_m);
        worst_precise = fmax(worst_precise, fabs(d.precise - right) / voxel_m);
        worst_float = fmax(worst_float, fabs((double)(6371000.0f - sqrtf(float_sum)) - right) / voxel_m);
    }
    print_message("globe, voxels of %.1f cm: wrong by %.6f voxels at most; the double oracle by %.1e; floats by %.1f\n",
                  100 * voxel_m, worst_device, worst_precise, worst_float);
    assert_true(worst_device <= 0.01 && worst_precise <= 1e-6);
    assert_true(worst_float > 1); /* or it would be no feat */
    karst_oracle_destroy(world.oracle);
    karst_world_file_destroy(world.file);
}

static void test_bare_globe(void **state)
{
    (void)state;
    check_bare_globe("/*{ \"voxel\": 0.0625, \"extent\": 13000000 }*/\n"
                     "float density(vec3 p) { return 6371000.0 - length(p); }\n");
    check_bare_globe("/*{ \"voxel\": 0.0078125, \"extent\": 13000000 }*/\n"
                     "float density(vec3 p) { return 6371000.0 - length(p); }\n");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_surface_of_the_planet), cmocka_unit_test(test_bare_globe)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
