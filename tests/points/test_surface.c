/* The surface of points is that of what they were taken from: a sphere, a torus, a gyroid, clean and with noise; seen
 * through the interpolated samples that rays see, at fine and coarse levels; and there is no hole in it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "producers/points/model_list.h"
#include "tests/points/clouds.h"

#define VOXEL_LOG2_M (-8)
#define VOXEL_M 0x1p-8

#define assert_ok(call)                               \
    do {                                              \
        karst_error error = {0};                      \
        if (!(call))                                  \
            fail_msg("%s: %s", #call, error.message); \
    } while (0)

static char folder[] = "/tmp/karst-points-XXXXXX";

static const char *in_folder(const char *name)
{
    static char paths[4][128];
    static int next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

/* The interpolant of a level's samples, as rays meet it. The world is air. */
static double interpolated(const karst_model_list *list, const double p[3], int level)
{
    double at[3], sum = 0;
    int64_t cell[3];
    for (int a = 0; a < 3; a++) {
        double voxels = p[a] / (VOXEL_M * exp2(level));
        cell[a] = (int64_t)floor(voxels);
        at[a] = voxels - floor(voxels);
    }
    for (int i = 0; i < 8; i++) {
        int64_t corner[3];
        double weight = 1;
        for (int a = 0; a < 3; a++) {
            int up = i >> a & 1;
            corner[a] = (int64_t)((uint64_t)(cell[a] + up) << level);
            weight *= up ? at[a] : 1 - at[a];
        }
        sum += weight * (double)karst_model_list_density(list, corner, level, -1e6f);
    }
    return sum;
}

typedef struct {
    double rms, worst;
    int num_hits, num_holes;
} hits;

/* Rays along the normals of random places, from outside; or from behind, with a side of -1. */
static hits cast(const karst_model_list *list, const known_surface *of, int level, int num, double reach, int side)
{
    hits found = {0};
    double sum = 0;
    for (int i = 0; i < num; i++) {
        double p[3], normal[3], before = 0, t = reach;
        random_on_surface(of, p, normal);
        bool is_inner = true;
        for (int a = 0; a < 3; a++)
            is_inner = is_inner && fabs(p[a]) < of->half - of->edge;
        if (!is_inner)
            continue;
        const int steps = 40;
        int step = 0;
        for (; step <= steps; step++) {
            double place[3], value;
            t = reach - 2 * reach * step / steps;
            for (int a = 0; a < 3; a++)
                place[a] = p[a] + side * t * normal[a];
            value = interpolated(list, place, level);
            if (value > 0) {
                t += step ? 2 * reach / steps * value / (value - before) : 0;
                break;
            }
            before = value;
        }
        if (step > steps || step == 0) {
            found.num_holes++;
            continue;
        }
        found.num_hits++;
        sum += t * t;
        found.worst = fmax(found.worst, fabs(t));
    }
    found.rms = sqrt(sum / (found.num_hits ? found.num_hits : 1));
    return found;
}

/* Which side of an open surface is the outer one, its points do not tell. */
static int outer_side(const karst_model_list *list, const known_surface *of, double reach)
{
    if (of->edge < 0)
        return 1;
    return cast(list, of, 1, 100, reach, 1).num_holes < cast(list, of, 1, 100, reach, -1).num_holes ? 1 : -1;
}

static karst_model_list load(const known_surface *of, size_t num, double noise)
{
    karst_model_list list;
    karst_points_about about;
    const char *from = in_folder("cloud.ply"), *to = in_folder("cloud.karstpoints");
    const karst_points_import_config config = {
        .input = from, .output = to, .axes = KARST_POINTS_AS_THEY_ARE, .keep_outliers = false};
    write_cloud(from, of, num, noise);
    assert_ok(karst_points_import(&config, &about, &error));
    karst_model model = {.path = to, .scale = 1};
    for (int a = 0; a < 3; a++) { /* where the points were */
        double voxels = about.centre[a] / VOXEL_M;
        model.at.voxel[a] = (int64_t)floor(voxels);
        model.at.fraction[a] = (uint32_t)((voxels - floor(voxels)) * 0x1p32);
    }
    assert_ok(karst_model_list_init(&list, &model, 1, VOXEL_LOG2_M, UINT64_MAX, NULL, &error));
    assert_ok(karst_model_list_check(&list, &error));
    print_message("# %s, noise %.2f: %llu points, %u levels, %llu parts, %.4f unsure, %llu outliers, spacing %.5f "
                  "(true %.5f)\n",
                  of->name, noise, (unsigned long long)about.num_points, about.num_levels,
                  (unsigned long long)about.num_parts, about.share_unsure, (unsigned long long)about.num_outliers,
                  about.spacing, spacing_of(of, num));
    assert_int_equal(about.num_parts, 1);
    return list;
}

/* At voxels below a spacing the surface is as near as the points tell; at coarse levels, as near as the voxels do. */
static void compare(const known_surface *of, double noise, double most_rms)
{
    const size_t num = getenv("KARST_TEST_QUICK") ? 20000 : 100000;
    const int num_rays = getenv("KARST_TEST_FULL") ? 20000 : 400;
    double spacing = spacing_of(of, num);
    karst_model_list list = load(of, num, noise);
    int side = outer_side(&list, of, 3 * spacing);
    for (int level = 0; level <= 4; level++) {
        double voxel = VOXEL_M * exp2(level), unit = fmax(spacing, voxel);
        hits found = cast(&list, of, level, num_rays, 3 * unit, side);
        print_message("#   level %d, voxel %.2f spacings: %d hits, %d holes, rms %.3f, worst %.3f of the larger one\n",
                      level, voxel / spacing, found.num_hits, found.num_holes, found.rms / unit, found.worst / unit);
        assert_int_equal(found.num_holes, 0);
        if (voxel < 2 * spacing)
            assert_true(found.rms / spacing <= most_rms);
        else
            assert_true(found.rms / voxel <= 0.25);
    }
    karst_model_list_finish(&list);
}

static void clean_points_give_the_surface(void **state)
{
    (void)state;
    random_state = 1;
    for (int i = 0; i < NUM_KNOWN_SURFACES; i++)
        compare(&known_surfaces[i], 0, 0.15);
}

static void noisy_points_give_the_surface(void **state)
{
    (void)state;
    random_state = 2;
    for (int i = 0; i < NUM_KNOWN_SURFACES; i++)
        compare(&known_surfaces[i], 0.25, 0.3);
}

static int set_up(void **state)
{
    (void)state;
    return mkdtemp(folder) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    unlink(in_folder("cloud.ply"));
    unlink(in_folder("cloud.karstpoints"));
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(clean_points_give_the_surface),
        cmocka_unit_test(noisy_points_give_the_surface),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
