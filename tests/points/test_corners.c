/* Two faces of points meet in a corner or an edge: rays meet what the true faces are, whatever the angle between them.
 * Nothing is open in an inner corner, nothing floats before an outer edge. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "producers/points/model_list.h"
#include "tests/points/clouds.h"
#include "tests/support/ok.h"

#define VOXEL_LOG2_M (-10)
#define VOXEL_M 0x1p-10

static char folder[] = "/tmp/karst-corners-XXXXXX";
static char path[64];
static double half_rad; /* half of the angle that air has between both faces */

/* They meet along z, and air lies around +y. */
static double corner_value(const double p[3], double gradient[3])
{
    const double n[2] = {cos(half_rad), sin(half_rad)};
    const double over[2] = {p[1] * n[1] + p[0] * n[0], p[1] * n[1] - p[0] * n[0]};
    const int face = (over[0] < over[1]) == (half_rad < PI / 2) ? 0 : 1;
    gradient[0] = face ? n[0] : -n[0];
    gradient[1] = -n[1];
    gradient[2] = 0;
    return -over[face];
}
static const known_surface corner = {"corner", corner_value, 0.5, 0, 0};

/* A wall along z, from the ground to y = 0. */
static double half_m, ground_m; /* half of its thickness; where the ground lies */
static double wall_value(const double p[3], double gradient[3])
{
    const double in[2] = {half_m - fabs(p[0]), -p[1]}, of_wall = fmin(in[0], in[1]), of_ground = ground_m - p[1];
    const bool is_flat = in[1] < in[0] || of_ground > of_wall;
    gradient[0] = is_flat ? 0 : p[0] < 0 ? 1 : -1;
    gradient[1] = is_flat ? -1 : 0;
    gradient[2] = 0;
    return fmax(of_wall, of_ground);
}
static const known_surface wall = {"wall", wall_value, 0.5, 0, 0};

/* A pyramid whose base is 0.4 wide and its height 0.6. */
static double pyramid_value(const double p[3], double gradient[3])
{
    const int a = fabs(p[0]) > fabs(p[2]) ? 0 : 2;
    const double of_side = (0.1 - p[1] / 3 - fabs(p[a])) * sqrt(0.9), of_base = p[1] + 0.3;
    const bool is_base = of_base < of_side;
    gradient[0] = gradient[2] = 0;
    gradient[1] = is_base ? 1 : -sqrt(0.1);
    if (!is_base)
        gradient[a] = p[a] < 0 ? sqrt(0.9) : -sqrt(0.9);
    return is_base ? of_base : of_side;
}
static const known_surface pyramid = {"pyramid", pyramid_value, 0.5, 0, 0};

/* Points of a surface in its box; with their normals, or normals are found. */
static karst_model_list load(const known_surface *of, size_t num, double noise_m, bool has_normals)
{
    char input[128];
    karst_points_about about;
    karst_model_list list;
    snprintf(input, sizeof input, "%s.ply", path);
    FILE *file = fopen(input, "wb");
    assert_non_null(file);
    fprintf(file,
            "ply\nformat binary_little_endian 1.0\nelement vertex %zu\nproperty float x\nproperty float y\n"
            "property float z\n%send_header\n",
            num, has_normals ? "property float nx\nproperty float ny\nproperty float nz\n" : "");
    for (size_t i = 0; i < num; i++) {
        double p[3], normal[3];
        float words[6];
        random_on_surface(of, p, normal);
        for (int a = 0; a < 3; a++) {
            words[a] = (float)(p[a] + noise_m * random_normal());
            words[3 + a] = (float)normal[a];
        }
        fwrite(words, sizeof *words, has_normals ? 6 : 3, file);
    }
    fclose(file);
    const karst_points_import_config config = {
        .input = input, .output = path, .axes = KARST_POINTS_AS_THEY_ARE, .keep_outliers = true};
    assert_ok(karst_points_import(&config, &about, &error));
    unlink(input);
    karst_model model = {.path = path, .scale = 1};
    model.at = karst_position_add_m(model.at, about.centre, VOXEL_LOG2_M); /* where the points were */
    assert_ok(karst_model_list_init(&list, &model, 1, VOXEL_LOG2_M, UINT64_MAX, NULL, &error));
    return list;
}

/* A way from the air onto a place of a face, at 60 degrees to its normal at most. */
static void random_way(const double normal[3], double way[3])
{
    double into, square;
    do {
        into = square = 0;
        for (int a = 0; a < 3; a++) {
            way[a] = random_normal();
            square += way[a] * way[a];
            into -= way[a] * normal[a];
        }
    } while (into < 0.5 * sqrt(square));
    for (int a = 0; a < 3; a++)
        way[a] /= sqrt(square);
}

typedef struct {
    double late, early; /* spacings that hits lie behind and before the faces, at most */
    int num, num_far;   /* rays, and those that hit nothing, or nothing within `most` spacings of the faces */
} corner_errors;

/* A ray to a place of a surface, unless it grazes another face first. */
static void cast_ray(const karst_model_list *list, const known_surface *of, const double p[3], const double way[3],
                     double spacing, double most, corner_errors *found)
{
    double q[3], gradient[3], depth = 0;
    bool is_clear = true, hits = false;
    for (double t = -4 * spacing; t < 4 * spacing && is_clear && !hits; t += 0.05 * spacing) {
        for (int a = 0; a < 3; a++)
            q[a] = p[a] + t * way[a];
        depth = of->value(q, gradient) / spacing;
        is_clear = t > -0.3 * spacing || depth < 0;
        const karst_position at = karst_position_add_m((karst_position){.voxel = {0}}, q, VOXEL_LOG2_M);
        hits = karst_model_list_at(list, &at, 0, -1, NULL) > 0;
    }
    if (!is_clear)
        return;
    found->num++;
    found->num_far += !hits || fabs(depth) > most;
    found->late = hits ? fmax(found->late, depth) : found->late;
    found->early = hits ? fmax(found->early, -depth) : found->early;
}

/* Rays to places up to three spacings from where the faces meet. */
static corner_errors cast(const karst_model_list *list, double spacing, double most)
{
    corner_errors found = {0};
    for (int i = 0; i < 250; i++) {
        double p[3], way[3];
        const double off = 3 * spacing * random_unit();
        const int side = random_below(2) ? 1 : -1;
        const double normal[3] = {-side * cos(half_rad), sin(half_rad), 0};
        p[0] = side * off * sin(half_rad);
        p[1] = off * cos(half_rad);
        p[2] = 0.4 * (random_unit() - 0.5);
        random_way(normal, way);
        cast_ray(list, &corner, p, way, spacing, most, &found);
    }
    return found;
}

/* The same of a wall's top, and of both sides up to three spacings below. */
static corner_errors cast_wall(const karst_model_list *list, double spacing, double most)
{
    corner_errors found = {0};
    for (int i = 0; i < 500; i++) {
        double way[3];
        const int side = random_below(2) ? 1 : -1;
        const bool is_top = random_below(2);
        const double normal[3] = {is_top ? 0 : side, is_top, 0};
        const double p[3] = {is_top ? half_m * (2 * random_unit() - 1) : side * half_m,
                             is_top ? 0 : -3 * spacing * random_unit(), 0.6 * (random_unit() - 0.5)};
        random_way(normal, way);
        cast_ray(list, &wall, p, way, spacing, most, &found);
    }
    return found;
}

static uint64_t cloud_number; /* another one has other points */

/* num: of points in a square metre of faces. */
static corner_errors errors_of(double angle_deg, double num, double noise, bool has_normals, double most)
{
    const double spacing = 1 / sqrt(num);
    half_rad = angle_deg / 2 * PI / 180;
    const double area = fmin(1 / fabs(cos(half_rad)), 1 / sin(half_rad));
    random_state = 21 + (uint64_t)angle_deg + 1000 * cloud_number;
    karst_model_list list = load(&corner, (size_t)(num * area), noise * spacing, has_normals);
    const corner_errors found = cast(&list, spacing, most);
    print_message("# %.0f degrees of air, spacing %.3f, noise %.2f: of %d rays %d are far off; at most %.2f spacings "
                  "late, %.2f early\n",
                  angle_deg, spacing, noise, found.num, found.num_far, found.late, found.early);
    karst_model_list_finish(&list);
    return found;
}

/* Inner corners; what graze an outer edge may pass it. */
static void corners_of_given_normals_are_right(void **state)
{
    (void)state;
    static const double angles_deg[] = {60, 75, 90, 120, 150, 210, 240, 270};
    for (size_t i = 0; i < sizeof angles_deg / sizeof *angles_deg; i++)
        for (int k = 0; k < 2; k++) {
            const corner_errors found = errors_of(angles_deg[i], k ? 400 : 1500, k ? 0.1 : 0.05, true, 0.3);
            assert_true(found.num > 50);
            assert_true(found.num_far <= (angles_deg[i] > 180 ? 2 : 0));
            assert_true(found.late < 0.22 && found.early < 0.2);
        }
}

/* Normals that were found beside an edge lie between both faces: inner corners are off by a
 * third of a spacing, but not open. */
static void corners_of_found_normals_are_closed(void **state)
{
    (void)state;
    static const double angles_deg[] = {90, 105, 120, 150};
    for (size_t i = 0; i < sizeof angles_deg / sizeof *angles_deg; i++)
        for (int k = 0; k < 2; k++) {
            const corner_errors found = errors_of(angles_deg[i], k ? 400 : 1500, k ? 0.1 : 0.05, false, 0.4);
            assert_true(found.num > 50);
            assert_int_equal(found.num_far, 0);
        }
}

/* Below a right angle the normals of both faces, as such, would turn one of them inside out. */
static void sharp_corners_of_found_normals_are_closed(void **state)
{
    (void)state;
    for (cloud_number = 0; cloud_number < 8; cloud_number++)
        for (int k = 0; k < 2; k++) {
            const corner_errors found = errors_of(k ? 60 : 75, 600, 0.05, false, 0.6);
            assert_true(found.num > 50);
            assert_int_equal(found.num_far, 0);
        }
    cloud_number = 0;
}

/* The tip's normals are level, or nearly, as they were found; which side is the outer one all around tell. */
static void tips_do_not_turn_bodies_inside_out(void **state)
{
    (void)state;
    const size_t num = 4000;
    const double spacing = sqrt((0.16 + 0.48 / sqrt(0.9)) / (double)num);
    for (uint64_t cloud = 0; cloud < 24; cloud++) {
        corner_errors found = {0};
        random_state = 50 + cloud;
        karst_model_list list = load(&pyramid, num, 0.1 * spacing, false);
        for (int i = 0; i < 40; i++) {
            const double side = random_below(2) ? 1 : -1, p[3] = {side * 0.1, 0, 0.1 * (random_unit() - 0.5)};
            cast_ray(&list, &pyramid, p, (const double[3]){-side, 0, 0}, spacing, 1, &found);
        }
        karst_model_list_finish(&list);
        print_message("# a pyramid: of %d rays %d are far off\n", found.num, found.num_far);
        assert_true(found.num > 30);
        assert_true(found.num_far <= 2);
    }
}

/* Both sides and the top are in reach, and the ground, which faces as the top does. What grazes an edge may pass it. */
static void tops_of_thin_walls_are_whole(void **state)
{
    (void)state;
    static const double spacings[] = {1.5, 2, 2.5, 3};
    const double num = 625, spacing = 1 / sqrt(num);
    for (size_t i = 0; i < sizeof spacings / sizeof *spacings; i++) {
        half_m = spacings[i] / 2 * spacing;
        ground_m = -4 * spacing;
        random_state = 22 + i;
        karst_model_list list = load(&wall, (size_t)(num * (1 - 2 * ground_m)), 0.05 * spacing, true);
        const corner_errors found = cast_wall(&list, spacing, 0.3);
        print_message("# a wall of %.1f spacings: of %d rays %d are far off; at most %.2f spacings late, %.2f early\n",
                      spacings[i], found.num, found.num_far, found.late, found.early);
        assert_true(found.num > 300);
        assert_true(found.num_far * 100 <= found.num);
        assert_true(found.late < 0.3 && found.early < 0.3);
        karst_model_list_finish(&list);
    }
}

static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    snprintf(path, sizeof path, "%s/corner.karstpoints", folder);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    unlink(path);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(corners_of_given_normals_are_right),
        cmocka_unit_test(corners_of_found_normals_are_closed),
        cmocka_unit_test(sharp_corners_of_found_normals_are_closed),
        cmocka_unit_test(tips_do_not_turn_bodies_inside_out),
        cmocka_unit_test(tops_of_thin_walls_are_whole),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
