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

/* Points in the box of the corner; with their normals, or normals are found. */
static karst_model_list load(size_t num, double noise_m, bool has_normals)
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
        random_on_surface(&corner, p, normal);
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

/* Rays to places up to three spacings from where the faces meet. Those that graze the other face first are left out. */
static corner_errors cast(const karst_model_list *list, double spacing, double most)
{
    corner_errors found = {0};
    for (int i = 0; i < 250; i++) {
        double p[3], q[3], way[3], gradient[3], depth = 0;
        const double off = 3 * spacing * random_unit(), step = 0.05 * spacing;
        const int side = random_below(2) ? 1 : -1;
        const double normal[3] = {-side * cos(half_rad), sin(half_rad), 0};
        bool is_clear = true, hits = false;
        p[0] = side * off * sin(half_rad);
        p[1] = off * cos(half_rad);
        p[2] = 0.4 * (random_unit() - 0.5);
        random_way(normal, way);
        for (double t = -4 * spacing; t < 4 * spacing && is_clear && !hits; t += step) {
            for (int a = 0; a < 3; a++)
                q[a] = p[a] + t * way[a];
            depth = corner_value(q, gradient) / spacing;
            is_clear = t > -0.3 * spacing || depth < 0;
            const karst_position at = karst_position_add_m((karst_position){.voxel = {0}}, q, VOXEL_LOG2_M);
            hits = karst_model_list_at(list, &at, 0, -1, NULL) > 0;
        }
        if (!is_clear)
            continue;
        found.num++;
        found.num_far += !hits || fabs(depth) > most;
        found.late = hits ? fmax(found.late, depth) : found.late;
        found.early = hits ? fmax(found.early, -depth) : found.early;
    }
    return found;
}

/* num: of points in a square metre of faces. */
static corner_errors errors_of(double angle_deg, double num, double noise, bool has_normals, double most)
{
    const double spacing = 1 / sqrt(num);
    half_rad = angle_deg / 2 * PI / 180;
    const double area = fmin(1 / fabs(cos(half_rad)), 1 / sin(half_rad));
    random_state = 21 + (uint64_t)angle_deg;
    karst_model_list list = load((size_t)(num * area), noise * spacing, has_normals);
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
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
