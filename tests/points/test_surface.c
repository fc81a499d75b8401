/* The surface of points is that of what they were taken from: a sphere, a torus, a gyroid, the world `hills`, clean and
 * with noise; seen through the interpolated samples that rays see, at fine and coarse levels; and there is no hole in
 * it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "karst/query.h"
#include "producers/points/model_list.h"
#include "tests/points/clouds.h"
#include "tests/support/ok.h"

#define VOXEL_LOG2_M (-8)
#define VOXEL_M 0x1p-8

static char folder[] = "/tmp/karst-points-XXXXXX";

static const char *in_folder(const char *name)
{
    static char paths[4][128];
    static int next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

/* ---- hills ---- */

/* A piece of the world 128 m wide, in units of 64 m, around the middle of its surface. */
#define PIECE_M 128.0
#define UNIT_M 64.0
static double (*piece_at)[3], (*piece_normal)[3];
static size_t num_in_piece;

/* Places on its surface: along verticals, by Newton's steps from a coarse map of heights. Those where there is more
 * than one surface near, or a wall, do not settle and are left out. */
static void find_piece(size_t num)
{
    enum { SIDE = 33 };
    static double down_m[SIDE * SIDE];
    karst_world *world = karst_world_open(&(karst_world_config){.world = "demos/worlds/hills.karst"}, NULL);
    assert_non_null(world);
    const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    const karst_query_config config = {.footprint_m = 0};
    karst_height_map map = {.size_m = {PIECE_M, PIECE_M}, .size_px = {SIDE, SIDE}, .depth_m = 2000};
    assert_true(karst_position_parse("640", "700", "1600", voxel_log2_m, &map.corner, NULL));
    assert_ok(karst_query_height_map(world, &config, &map, down_m, &error));
    double mean = 0;
    for (int i = 0; i < SIDE * SIDE; i++)
        mean += down_m[i] / (SIDE * SIDE);
    karst_position *at = malloc(num * sizeof *at);
    double(*m)[3] = malloc(num * sizeof *m);
    float(*gradient)[3] = malloc(num * sizeof *gradient), *density = malloc(num * sizeof *density);
    for (size_t i = 0; i < num; i++) {
        m[i][0] = random_unit() * PIECE_M;
        m[i][2] = random_unit() * PIECE_M;
        const int column = (int)(m[i][0] / PIECE_M * SIDE), row = SIDE - 1 - (int)(m[i][2] / PIECE_M * SIDE);
        m[i][1] = -down_m[row * SIDE + column];
    }
    for (int step = 0; step < 9; step++) {
        for (size_t i = 0; i < num; i++)
            at[i] = karst_position_add_m(map.corner, m[i], voxel_log2_m);
        assert_ok(karst_query_gradients(world, &config, at, num, gradient, density, &error));
        for (size_t i = 0; i < num && step < 8; i++) {
            double by = (double)density[i] / (double)fminf(gradient[i][1], -0.3f);
            m[i][1] -= fmin(fmax(by, -3), 3);
        }
    }
    num_in_piece = 0;
    piece_at = malloc(num * sizeof *piece_at);
    piece_normal = malloc(num * sizeof *piece_normal);
    for (size_t i = 0; i < num; i++) {
        double square = 0;
        for (int a = 0; a < 3; a++)
            square += (double)gradient[i][a] * (double)gradient[i][a];
        if (!(fabs((double)density[i]) < 1e-3 * sqrt(square)) || !((double)gradient[i][1] < -0.3 * sqrt(square)))
            continue;
        for (int a = 0; a < 3; a++) {
            piece_at[num_in_piece][a] = (m[i][a] + (a == 1 ? mean : -PIECE_M / 2)) / UNIT_M;
            piece_normal[num_in_piece][a] = -(double)gradient[i][a] / sqrt(square);
        }
        num_in_piece++;
    }
    free(at);
    free(m);
    free(gradient);
    free(density);
    karst_world_close(world);
}

static double no_value(const double p[3], double gradient[3])
{
    (void)p;
    (void)gradient;
    return 0;
}
static const known_surface hills = {"hills", no_value, PIECE_M / UNIT_M / 2, PIECE_M *PIECE_M / UNIT_M / UNIT_M, 0.03};

static void random_true(const known_surface *of, double p[3], double normal[3])
{
    if (of != &hills) {
        random_on_surface(of, p, normal);
        return;
    }
    const size_t i = (size_t)random_below((int64_t)num_in_piece);
    memcpy(p, piece_at[i], sizeof piece_at[i]);
    memcpy(normal, piece_normal[i], sizeof piece_normal[i]);
}

static void write_hills(const char *path, double noise)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    fprintf(file,
            "ply\nformat binary_little_endian 1.0\nelement vertex %zu\nproperty double x\n"
            "property double y\nproperty double z\nend_header\n",
            num_in_piece);
    for (size_t i = 0; i < num_in_piece; i++) {
        double p[3];
        for (int a = 0; a < 3; a++)
            p[a] = piece_at[i][a] + noise * spacing_of(&hills, num_in_piece) * random_normal();
        fwrite(p, sizeof *p, 3, file);
    }
    fclose(file);
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

/* Rays along the normals of random places, from outside; or from behind, with a side of -1. Samples around a place lie
 * up to a voxel off, and beyond the border of an open surface nothing tells what they are: no place is nearer to it. */
static hits cast(const karst_model_list *list, const known_surface *of, int level, int num, double reach, int side)
{
    hits found = {0};
    double sum = 0;
    const double edge = of->edge < 0 ? of->edge : fmax(of->edge, VOXEL_M * exp2(level));
    for (int i = 0; i < num; i++) {
        double p[3], normal[3], before = 0, t = reach;
        random_true(of, p, normal);
        bool is_inner = true;
        for (int a = 0; a < 3; a++)
            is_inner = is_inner && fabs(p[a]) < of->half - edge;
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
    if (of == &hills)
        write_hills(from, noise);
    else
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
                  about.spacing, spacing_of(of, of == &hills ? num_in_piece : num));
    assert_true(about.num_parts == 1 || of == &hills); /* its cliffs part it */
    return list;
}

/* At voxels below a spacing the surface is as near as the points tell; at coarse levels, as near as the voxels do. */
static void compare(const known_surface *of, double noise, double most_rms)
{
    const size_t num = getenv("KARST_TEST_QUICK") ? 20000 : 100000;
    const int num_rays = getenv("KARST_TEST_FULL") ? 20000 : 400;
    if (of == &hills && !piece_at)
        find_piece(getenv("KARST_TEST_FULL") ? 1000000 : num);
    double spacing = spacing_of(of, of == &hills ? num_in_piece : num);
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
            assert_true(found.rms / voxel <= 0.1);
    }
    karst_model_list_finish(&list);
}

static void clean_points_give_the_surface(void **state)
{
    (void)state;
    random_state = 1;
    for (int i = 0; i < NUM_KNOWN_SURFACES; i++)
        compare(&known_surfaces[i], 0, 0.01);
    compare(&hills, 0, 0.06); /* quick: few points see its cliffs */
}

static void noisy_points_give_the_surface(void **state)
{
    (void)state;
    random_state = 2;
    for (int i = 0; i < NUM_KNOWN_SURFACES; i++)
        compare(&known_surfaces[i], 0.25, 0.12);
    compare(&hills, 0.25, 0.12);
}

static int set_up(void **state)
{
    (void)state;
    return mkdtemp(folder) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    free(piece_at);
    free(piece_normal);
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
