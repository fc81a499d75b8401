/* Paths of light through media by delta tracking: furnaces, slabs against adding and doubling, single scattering along
 * a ray, what majorants save, threads, and what is refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "karst/reference.h"

static bool is_full(void) { return getenv("KARST_TEST_FULL") != NULL; }
static bool is_quick(void) { return getenv("KARST_TEST_QUICK") != NULL; }

static bool try_text(const char *text, const karst_reference_config *like, const karst_reference_light *light,
                     double *rgb, double *deviation, karst_reference_light_stats *stats, karst_error *error)
{
    char path[64] = "/tmp/karst-scatter-XXXXXX.karst";
    karst_reference_config config = *like;
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    config.world = path;
    const bool done = karst_reference_scatter(&config, light, rgb, deviation, NULL, NULL, stats, error);
    unlink(path);
    return done;
}

static void scatter_text(const char *text, const karst_reference_config *like, const karst_reference_light *light,
                         double *rgb, double *deviation, karst_reference_light_stats *stats)
{
    karst_error error = {0};
    if (!try_text(text, like, light, rgb, deviation, stats, &error))
        fail_msg("%s", error.message);
}

/* ---- furnaces ---- */

/* A ball with holes, from outside. */
#define BALL(albedo, g, emission)                                                                          \
    "/*{ \"voxel\": 0.25, \"view\": 60, \"sun\": { \"azimuth\": 90, \"elevation\": 0 },\n"                 \
    "\"camera\": { \"position\": [\"0\", \"0\", \"-30\"], \"fov\": 30 } }*/\n"                             \
    "float density(vec3 p) { return -1.0; }\n"                                                             \
    "medium air(vec3 p) { medium m; m.albedo = vec3(" albedo "); m.g = " g ";\n"                           \
    "m.extinction = 2.0 * clamp(1.5 - length(p) / 5.0 + 0.6 * fbm(p / 3.0, 3), 0.0, 1.0);\n"               \
    "m.emission = vec3(" emission "); return m; }\n"

/* Where light of 1 comes from everywhere, and what is swallowed is given off, 1 is seen everywhere. */
static void furnaces_show_nothing(void **state)
{
    (void)state;
    static const char white[] = BALL("1.0", "0.6", "0.0");
    static const char grey[] = BALL("0.9, 0.5, 0.0", "0.3", "0.1, 0.5, 1.0) * (m.extinction");
    const karst_reference_config config = {.width_px = 8, .height_px = 6};
    karst_reference_light light = {
        .paths_px = is_full() ? 4000 : 100, .no_sun = true, .above = {1, 1, 1}, .below = {1, 1, 1}, .max_nodes = 4096};
    double rgb[8 * 6 * 3], deviation[8 * 6 * 3], mean[3] = {0, 0, 0}, off[3] = {0, 0, 0};
    scatter_text(white, &config, &light, rgb, NULL, NULL);
    for (int i = 0; i < 8 * 6 * 3; i++)
        assert_true(fabs(rgb[i] - 1) < 0.005);
    light.paths_px *= 4;
    scatter_text(grey, &config, &light, rgb, deviation, NULL);
    for (int i = 0; i < 8 * 6 * 3; i++) {
        mean[i % 3] += rgb[i] / 48;
        off[i % 3] += deviation[i] * deviation[i] / (48 * 48);
    }
    for (int c = 0; c < 3; c++) {
        print_message("# grey furnace, channel %d: %.4f +- %.4f\n", c, mean[c], sqrt(off[c]));
        assert_true(sqrt(off[c]) < 0.005 && fabs(mean[c] - 1) < 4 * sqrt(off[c]) + 1e-6);
    }
}

/* ---- slabs ---- */

#define NUM_GAUSS 32
#define NUM_MU (NUM_GAUSS + 1) /* and one direction of no weight: the one that is asked for */

typedef double matrix[NUM_MU][NUM_MU];

static void gauss_points(double x[NUM_GAUSS], double weight[NUM_GAUSS])
{
    for (int i = 0; i < NUM_GAUSS; i++) {
        double z = cos(M_PI * (i + 0.75) / (NUM_GAUSS + 0.5)), slope = 1;
        for (int step = 0; step < 60; step++) {
            double p = 1, before = 0;
            for (int l = 1; l <= NUM_GAUSS; l++) {
                const double next = ((2 * l - 1) * z * p - (l - 1) * before) / l;
                before = p;
                p = next;
            }
            slope = NUM_GAUSS * (z * p - before) / (z * z - 1);
            z -= p / slope;
        }
        x[i] = 0.5 * (1 - z);
        weight[i] = 1 / ((1 - z * z) * slope * slope);
    }
}

/* Henyey and Greenstein's phase function around the slab's normal, as far as the points can tell: its mean is 1. */
static double redistribution(double g, double a, double b)
{
    double sum = 0, pa = 1, pb = 1, before_a = 0, before_b = 0, share = 1;
    for (int l = 0; l < 2 * NUM_GAUSS; l++) {
        sum += (2 * l + 1) * share * pa * pb;
        const double next_a = ((2 * l + 1) * a * pa - l * before_a) / (l + 1),
                     next_b = ((2 * l + 1) * b * pb - l * before_b) / (l + 1);
        before_a = pa, before_b = pb, pa = next_a, pb = next_b;
        share *= g;
    }
    return sum;
}

static void multiply(const matrix a, const matrix b, matrix product)
{
    for (int i = 0; i < NUM_MU; i++)
        for (int j = 0; j < NUM_MU; j++) {
            product[i][j] = 0;
            for (int k = 0; k < NUM_MU; k++)
                product[i][j] += a[i][k] * b[k][j];
        }
}

/* b becomes (1 - a)^-1 b. */
static void solve(const matrix a, matrix b)
{
    matrix m;
    for (int i = 0; i < NUM_MU; i++)
        for (int j = 0; j < NUM_MU; j++)
            m[i][j] = (i == j) - a[i][j];
    for (int k = 0; k < NUM_MU; k++) /* what a layer reflects is less than all: no pivot is 0 */
        for (int i = 0; i < NUM_MU; i++) {
            const double factor = i == k ? 0 : m[i][k] / m[k][k];
            for (int j = 0; j < NUM_MU; j++) {
                m[i][j] -= factor * m[k][j];
                b[i][j] -= factor * b[k][j];
            }
        }
    for (int i = 0; i < NUM_MU; i++)
        for (int j = 0; j < NUM_MU; j++)
            b[i][j] /= m[i][i];
}

/* What a slab shows in a direction of even light from the eye's side, and from behind: by H. C. van de Hulst's doubling
 * ("A new look at multiple scattering", 1963), from a layer so thin that it scatters once. */
static void double_slab(double depth, double albedo, double g, double mu, double *reflected, double *transmitted)
{
    double x[NUM_MU], weight[NUM_MU], thin = depth;
    matrix r, t, a, b;
    gauss_points(x, weight);
    x[NUM_GAUSS] = mu;
    weight[NUM_GAUSS] = 0;
    int num_doublings = 0;
    for (; thin > 1e-8; num_doublings++)
        thin /= 2;
    for (int i = 0; i < NUM_MU; i++)
        for (int j = 0; j < NUM_MU; j++) {
            const double scattered = 0.5 * albedo * weight[j] * thin / x[i];
            t[i][j] = scattered * redistribution(g, x[i], x[j]) + (i == j ? exp(-thin / x[i]) : 0);
            r[i][j] = scattered * redistribution(g, x[i], -x[j]);
        }
    for (int step = 0; step < num_doublings; step++) {
        matrix through;
        memcpy(through, t, sizeof t);
        multiply(r, r, a);
        solve(a, through); /* light between the halves that goes on downwards */
        multiply(r, through, b);
        multiply(t, b, a);
        for (int i = 0; i < NUM_MU; i++)
            for (int j = 0; j < NUM_MU; j++)
                r[i][j] += a[i][j];
        multiply(t, through, b);
        memcpy(t, b, sizeof t);
    }
    *reflected = *transmitted = 0;
    for (int j = 0; j < NUM_MU; j++) {
        *reflected += r[NUM_GAUSS][j];
        *transmitted += t[NUM_GAUSS][j];
    }
}

static void slab_by_paths(double depth, double albedo, double g, double mu, uint32_t num_paths, double rgb[3],
                          double deviation[3])
{
    char text[1024];
    snprintf(text, sizeof text,
             "/*{ \"voxel\": 0.0625, \"view\": 30 }*/\n"
             "float density(vec3 p) { return -1.0; }\n"
             "medium air(vec3 p) { medium m; m.albedo = vec3(%.17g); m.g = %.17g;\n"
             "m.extinction = p.y > 0.0 && p.y < 1.0 ? %.17g : 0.0; return m; }\n",
             albedo, g, depth);
    const karst_camera camera = {
        .position.voxel = {3, 18, 5}, .yaw_deg = 30, .pitch_deg = -asin(mu) * (180 / M_PI), .fov_deg = 60};
    const karst_reference_config config = {.width_px = 1, .height_px = 1, .camera = &camera, .num_threads = 1};
    const karst_reference_light light = {
        .paths_px = num_paths, .no_sun = true, .above = {1, 0, 0}, .below = {0, 1, 0}, .max_nodes = 12000};
    scatter_text(text, &config, &light, rgb, deviation, NULL);
}

static void slab_is_right(double depth, double albedo, double g, double mu, uint32_t num_paths)
{
    double r, t, rgb[3], deviation[3];
    double_slab(depth, albedo, g, mu, &r, &t);
    slab_by_paths(depth, albedo, g, mu, num_paths, rgb, deviation);
    print_message("# depth %g, albedo %g, g %g, mu %g: reflects %.5f +- %.5f (doubling %.5f), transmits %.5f +- %.5f "
                  "(%.5f)\n",
                  depth, albedo, g, mu, rgb[0], deviation[0], r, rgb[1], deviation[1], t);
    assert_true(fabs(rgb[0] - r) < 4 * deviation[0] + 5e-4);
    assert_true(fabs(rgb[1] - t) < 4 * deviation[1] + 5e-4);
}

/* Straight down on a slab of depth 2, albedo 0.9 and g 0.75: H. C. van de Hulst, "Multiple light scattering", 1980,
 * table 35, as codes of photons in tissue are checked by it. */
static void doubling_is_as_published(void **state)
{
    (void)state;
    double r, t;
    double_slab(2, 0.9, 0.75, 1, &r, &t);
    print_message("# doubling: %.5f and %.5f, published 0.09739 and 0.66096\n", r, t);
    assert_true(fabs(r - 0.09739) < 1e-5 && fabs(t - 0.66096) < 1e-5);
    double_slab(30, 1, 0.85, 0.3, &r, &t);
    assert_true(fabs(r + t - 1) < 1e-5);
}

static void slabs_are_as_doubling_has_them(void **state)
{
    (void)state;
    const uint32_t num = is_quick() ? 1000 : 5000;
    slab_is_right(0.1, 1, 0.85, 0.5, num);
    slab_is_right(2, 0.9, 0.75, 1, num);
    slab_is_right(1, 0.99, 0, 0.3, num);
    slab_is_right(30, 0.99, 0.85, 0.8, num / 4);
    static const double depths[] = {0.1, 0.3, 1, 3, 10, 30}, albedos[] = {0.8, 0.99, 1}, mus[] = {0.2, 0.5, 1};
    for (int i = 0; is_full() && i < 6 * 2 * 3; i++)
        slab_is_right(depths[i % 6], albedos[i / 12], i / 6 % 2 ? 0.85 : 0, mus[i / 12], 100000);
}

/* ---- the sun ---- */

/* Along the axis of a ball of extinction k and radius r, with the sun across it: its light that is scattered once, by
 * Gauss's points on pieces of the ray. */
static double once_scattered(double k, double r, double g)
{
    const double at[3] = {-0.7745966692414834, 0, 0.7745966692414834}, weight[3] = {5 / 18.0, 8 / 18.0, 5 / 18.0};
    double sum = 0;
    for (int piece = 0; piece < 2000; piece++)
        for (int i = 0; i < 3; i++) {
            const double s = (piece + 0.5 + 0.5 * at[i]) * (2 * r / 2000), up = sqrt(r * r - (s - r) * (s - r));
            sum += weight[i] * (2 * r / 2000) * k * exp(-k * (s + up));
        }
    const double d = 1 + g * g;
    return 0.25 * (1 - g * g) / (d * sqrt(d)) * sum;
}

static void once_scattered_light_is_right(void **state)
{
    (void)state;
    static const char text[] =
        "/*{ \"voxel\": 0.25, \"view\": 60, \"sun\": { \"azimuth\": 90, \"elevation\": 0 } }*/\n"
        "float density(vec3 p) { return -1.0; }\n"
        "medium air(vec3 p) { medium m; m.albedo = vec3(0.9, 0.5, 1.0); m.g = 0.4;\n"
        "m.extinction = length(p) < 5.0 ? 0.3 : 0.0; return m; }\n";
    const karst_camera camera = {.position.voxel = {0, 0, -80}, .fov_deg = 60};
    const karst_reference_config config = {.width_px = 1, .height_px = 1, .camera = &camera, .num_threads = 1};
    const karst_reference_light light = {.paths_px = is_quick() ? 2000 : 20000, .max_bounces = 1, .max_nodes = 4096};
    const double albedo[3] = {0.9, 0.5, 1}, sun[3] = {2.4, 1.5, 0.85};
    double rgb[3], deviation[3];
    scatter_text(text, &config, &light, rgb, deviation, NULL);
    for (int c = 0; c < 3; c++) {
        const double expected = albedo[c] * sun[c] * once_scattered(0.3, 5, 0.4);
        print_message("# scattered once: %.5f +- %.5f, by quadrature %.5f\n", rgb[c], deviation[c], expected);
        assert_true(fabs(rgb[c] - expected) < 4 * deviation[c]);
    }
}

/* ---- majorants ---- */

/* Puffs in a layer, as clouds are. */
static const char puffs[] =
    "/*{ \"voxel\": 1, \"view\": 1500, \"sun\": { \"azimuth\": 200, \"elevation\": 32 },\n"
    "\"camera\": { \"position\": [\"0\", \"0\", \"0\"], \"yaw\": 60, \"pitch\": 20, \"fov\": 60 } }*/\n"
    "float density(vec3 p) { return -1.0; }\n"
    "medium air(vec3 p) { float up = (p.y - 150.0) / 300.0; medium m; m.g = 0.75; m.albedo = vec3(0.99);\n"
    "m.extinction = 0.2 * clamp(3.0 * (fbm(p / 200.0, 3) - 0.1 - up * up), 0.0, 1.0) * step(0.0, up); return m; }\n";

static double variance_of(const double *deviation, size_t num)
{
    double sum = 0;
    for (size_t i = 0; i < num; i++)
        sum += deviation[i] * deviation[i];
    return sum;
}

static void proved_majorants_save_look_ups(void **state)
{
    (void)state;
    enum { WIDTH = 8, HEIGHT = 6, NUM = WIDTH * HEIGHT * 3 };
    const karst_reference_config config = {.width_px = WIDTH, .height_px = HEIGHT};
    double look_ups[2], variance[2], mean[2] = {0, 0}, rgb[NUM], deviation[NUM];
    for (int one = 0; one < 2; one++) {
        const karst_reference_light light = {.paths_px = is_full() ? 2000 : 24, .one_majorant = one == 1};
        karst_reference_light_stats stats;
        scatter_text(puffs, &config, &light, rgb, deviation, &stats);
        assert_int_equal(stats.num_paths, (uint64_t)WIDTH * HEIGHT * light.paths_px);
        look_ups[one] = (double)stats.num_lookups / (double)stats.num_paths;
        variance[one] = variance_of(deviation, NUM);
        for (int i = 0; i < NUM; i++)
            mean[one] += rgb[i] / NUM;
        print_message("# %s: %.1f look-ups a path, %.2f of them collisions of paths, mean %.4f, variance %.3g; %llu "
                      "nodes\n",
                      one ? "one majorant" : "proved majorants", look_ups[one],
                      (double)stats.num_collisions / (double)stats.num_paths, mean[one], variance[one],
                      (unsigned long long)stats.num_nodes);
    }
    const double share = look_ups[0] * variance[0] / (look_ups[1] * variance[1]);
    print_message("# at equal variance: %.3f of one majorant's\n", share);
    assert_true(share <= 0.2);
    assert_true(fabs(mean[0] - mean[1]) < 4 * sqrt(variance[0] + variance[1]) / NUM);
}

/* ---- threads, and what is refused ---- */

static void threads_leave_no_trace(void **state)
{
    (void)state;
    karst_reference_config config = {.width_px = 8, .height_px = 6, .num_threads = 1};
    const karst_reference_light light = {.paths_px = 8, .max_nodes = 2000};
    double one[8 * 6 * 3], many[8 * 6 * 3];
    scatter_text(puffs, &config, &light, one, NULL, NULL);
    config.num_threads = 5;
    scatter_text(puffs, &config, &light, many, NULL, NULL);
    assert_memory_equal(one, many, sizeof one);
}

static void refuse(const char *text, const karst_reference_light *light, const char *word)
{
    const karst_reference_config config = {.width_px = 1, .height_px = 1};
    double rgb[3];
    karst_error error = {0};
    assert_false(try_text(text, &config, light, rgb, NULL, NULL, &error));
    if (error.status != KARST_USAGE || !strstr(error.message, word))
        fail_msg("'%s' does not say '%s'", error.message, word);
}

static void bad_input_is_refused(void **state)
{
    (void)state;
    const karst_reference_light plain = {.paths_px = 1}, many = {.paths_px = UINT32_MAX}, few = {.max_nodes = 8},
                                dark = {.above = {-1, 0, 0}}, bright = {.below = {0, 0, (double)INFINITY}};
    refuse(puffs, &many, "paths");
    refuse(puffs, &few, "nodes");
    refuse(puffs, &dark, "light");
    refuse(puffs, &bright, "light");
    refuse("float density(vec3 p) { return -p.y; }\n", &plain, "no medium");
    refuse("/*{ \"voxel\": 1, \"view\": 100,\n"
           "\"particles\": [{ \"emitter\": \"ball\", \"at\": [\"0\", \"9\", \"0\"], \"size\": 1.5 }] }*/\n"
           "float density(vec3 p) { return -p.y; }\n"
           "medium air(vec3 p) { medium m; m.extinction = 0.0; m.albedo = vec3(0.9); return m; }\n",
           &plain, "particles");
    refuse("/*{ \"voxel\": 1, \"view\": 100 }*/\nfloat density(vec3 p) { return -1.0; }\n"
           "medium air(vec3 p) { medium m; m.extinction = 1.0 / (p.x * p.x); return m; }\n",
           &plain, "clamp");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(furnaces_show_nothing),          cmocka_unit_test(doubling_is_as_published),
        cmocka_unit_test(slabs_are_as_doubling_has_them), cmocka_unit_test(once_scattered_light_is_right),
        cmocka_unit_test(proved_majorants_save_look_ups), cmocka_unit_test(threads_leave_no_trace),
        cmocka_unit_test(bad_input_is_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
