/* Walls and panes of glass thinner than a voxel, wherever they lie among samples and nodes: walls turn the side to the
 * eye that it sees, and what lies behind panes is seen through them. However panes are turned and however far away,
 * they let through what A. Fresnel's equations say. Thin shells do so up to their rims, seen against rays in double. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/support/scene.h"

enum { SIDE = 48, NUM = SIDE * SIDE };

/* All land gives off light that says which way it faces, and what it is. */
static const char text[] =
    "/*{ \"voxel\": 0.015625, \"view\": 60, \"sun\": { \"azimuth\": 0, \"elevation\": -90 },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"params\": { \"front\": { \"value\": 0, \"min\": -1, \"max\": 1 },\n"
    "\"wide\": { \"value\": 0, \"min\": 0, \"max\": 1 },\n"
    "\"glass\": { \"value\": 0, \"min\": 0, \"max\": 1 } },\n"
    "\"camera\": { \"position\": [\"0\", \"0\", \"-6\"], \"fov\": 30 } }*/\n"
    "float sheet(vec3 p) { return min(1.0 - max(abs(p.x), abs(p.y)), min(p.z - front, front + wide - p.z)); }\n"
    "float density(vec3 p) { return max(p.z - 8.0, glass > 0.5 ? -1.0 : sheet(p)); }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0);\n"
    "    m.emission = vec3(p.z < 4.0 ? 1.0 : 0.0, 0.5, 0.5 - 0.25 * n.z); return m; }\n"
    "float clear(vec3 p) { return glass > 0.5 ? sheet(p) : -1.0; }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; m.absorption = vec3(0.1); return m; }\n";
static float light[3 * NUM];

/* Voxels are 0.06 m wide where the sheet is, nodes end at 0. */
static const struct {
    double front_m, wide_m;
} sheets[] = {{0, 0.02}, {-0.02, 0.02}, {0.01, 0.02}, {-0.03, 0.02}, {0.01, 0.005}, {-0.0211, 0.02}, {0, 0.005}};
enum { NUM_SHEETS = sizeof sheets / sizeof *sheets };

static bool is_on_sheet(int i)
{
    const double per_px = 6 * tan(0.2617993877991494) * 2 / SIDE;
    return fabs((i % SIDE + 0.5 - SIDE / 2) * per_px) < 0.8 && fabs((i / SIDE + 0.5 - SIDE / 2) * per_px) < 0.8;
}

static void sheets_are_what_they_are_wherever_they_lie(void **state)
{
    (void)state;
    for (int lanes = 16; lanes; lanes = lanes == 16 && getenv("KARST_TEST_FULL") ? 1 : 0) {
        const karst_engine_config like = {.exposure = KARST_EXPOSURE_GIVEN, .lanes = lanes};
        karst_engine *engine = scene_create(text, &like, SIDE, SIDE, NULL);
        for (int i = 0; i < NUM_SHEETS; i++)
            for (int glass = 0; glass < 2; glass++) {
                const karst_parameter parameters[] = {
                    {"front", sheets[i].front_m}, {"wide", sheets[i].wide_m}, {"glass", glass}};
                int num = 0, num_off = 0;
                assert_ok(karst_engine_set_parameters(engine, parameters, 3, &error));
                scene_settle(engine, 600, light, 3 * NUM, NULL);
                for (int k = 0; k < NUM; k++) {
                    if (!is_on_sheet(k))
                        continue;
                    /* a wall faces the eye; a pane leaves 0.96 of the light, and less where it is met flatly */
                    const float *l = light + 3 * (size_t)k, left = glass ? 0.95f : 1;
                    num++;
                    num_off += !(fabsf(l[0] - (glass ? 0.0f : 1.0f)) < 0.01f && fabsf(l[1] - 0.5f * left) < 0.02f &&
                                 fabsf(l[2] - 0.75f * left) < 0.02f);
                }
                print_message("%s from %g m on, %g m thin, %d lanes: %d of %d pixels are off\n",
                              glass ? "glass" : "a wall", sheets[i].front_m, sheets[i].wide_m, lanes, num_off, num);
                assert_true(num > NUM / 10);
                assert_true(num_off <= num / 50);
            }
        karst_engine_destroy(engine);
    }
}

/* A pane that is turned about two axes, without an end. What is seen through it gives off red, what it mirrors green,
 * and both blue. */
static const char turned_text[] =
    "/*{ \"voxel\": 0.015625, \"view\": 150, \"sun\": { \"azimuth\": 0, \"elevation\": -90 },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"params\": { \"away\": { \"value\": 4, \"min\": 0, \"max\": 100 },\n"
    "\"wide\": { \"value\": 0.02, \"min\": 0, \"max\": 1 },\n"
    "\"x\": { \"value\": 0, \"min\": -1, \"max\": 1 }, \"y\": { \"value\": 0, \"min\": -1, \"max\": 1 },\n"
    "\"z\": { \"value\": 1, \"min\": -1, \"max\": 1 } },\n"
    "\"camera\": { \"position\": [\"0\", \"0\", \"0\"], \"fov\": 30 } }*/\n"
    "float beyond(vec3 p) { return dot(p - vec3(0.0, 0.0, away), vec3(x, y, z)); }\n"
    "float density(vec3 p) { return length(p) - 80.0; }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0);\n"
    "    m.emission = beyond(p) > 0.0 ? vec3(1.0, 0.0, 1.0) : vec3(0.0, 1.0, 1.0); return m; }\n"
    "float clear(vec3 p) { return min(wide * 0.5 - abs(beyond(p)), 60.0 - length(p)); }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; return m; }\n";

/* What a surface reflects of unpolarised light that meets it by this cosine; index 1.5. */
static double reflected_of(double cosine)
{
    const double far = sqrt(1 - (1 - cosine * cosine) / 2.25);
    const double s = (cosine - 1.5 * far) / (cosine + 1.5 * far), p = (1.5 * cosine - far) / (1.5 * cosine + far);
    return (s * s + p * p) / 2;
}

/* Of pixels that meet the pane within 0.3 of its distance: how many there are, and how many do not show what they
 * should. Of one sample the second face parts nothing, so 1 - R comes through. Of many it is (1 - R) / (1 + R) in the
 * mean, whose sum, of `through`, is told as well. */
typedef struct {
    int num, num_off;
    double through, truth;
} pane_sum;

static pane_sum look_through(double away_m, const double normal[3], bool one_sample)
{
    const double per_px = tan(0.2617993877991494) * 2 / SIDE, off_axis = away_m * normal[2];
    pane_sum sum = {0, 0, 0, 0};
    for (int k = 0; k < NUM; k++) {
        const double x = (k % SIDE + 0.5 - SIDE / 2) * per_px, y = (SIDE / 2 - k / SIDE - 0.5) * per_px,
                     along = x * normal[0] + y * normal[1] + normal[2], cosine = along / sqrt(1 + x * x + y * y),
                     far = off_axis / along;
        if (cosine < 0.05 || hypot(hypot(x * far, y * far), far - away_m) > 0.3 * away_m)
            continue;
        const double reflected = reflected_of(cosine), through = one_sample ? 1 - reflected
                                                                            : (1 - reflected) / (1 + reflected);
        const float *l = light + 3 * (size_t)k;
        sum.num++;
        sum.num_off += fabs((double)l[0] - through) > 1e-3 || fabs((double)l[1] - (1 - through)) > 1e-3;
        sum.through += (double)l[0];
        sum.truth += through;
    }
    return sum;
}

static void set_pane(karst_engine *engine, double away_m, double wide_m, const double normal[3])
{
    const karst_parameter parameters[] = {
        {"away", away_m}, {"wide", wide_m}, {"x", normal[0]}, {"y", normal[1]}, {"z", normal[2]}};
    assert_ok(karst_engine_set_parameters(engine, parameters, 5, &error));
}

/* About an axis that is neither x nor y. */
static void turn_pane(double angle_deg, double normal[3])
{
    const double angle = angle_deg * 3.14159265358979323846 / 180;
    normal[0] = -0.8 * sin(angle), normal[1] = 0.6 * sin(angle), normal[2] = cos(angle);
}

static void panes_let_through_what_they_should_at_any_angle(void **state)
{
    (void)state;
    static const double angles_deg[] = {0, 20, 45, 60, 75, 82}, aways_m[] = {1.5, 5, 13, 40}, wides_m[] = {0.02, 0.15};
    static float of_16[3 * NUM];
    const karst_engine_config like = {.exposure = KARST_EXPOSURE_GIVEN}, of_1 = {.lanes = 1};
    karst_engine *engine = scene_create(turned_text, &like, SIDE, SIDE, NULL);
    double normal[3];
    for (int wide = 0; wide < 2; wide++)
        for (int a = 0; a < 6; a++) {
            int num = 0, num_off = 0;
            turn_pane(angles_deg[a], normal);
            for (int k = 0; k < 4; k++) {
                set_pane(engine, aways_m[k], wides_m[wide], normal);
                scene_settle(engine, 600, light, 3 * NUM, NULL);
                const pane_sum sum = look_through(aways_m[k], normal, true);
                num += sum.num, num_off += sum.num_off;
            }
            print_message("%g m, turned by %g degrees, from near and far: %d of %d pixels are off\n", wides_m[wide],
                          angles_deg[a], num_off, num);
            assert_true(num > NUM / 8);
            assert_true(num_off <= num / 500);
        }
    memcpy(of_16, light, sizeof of_16);
    karst_engine_destroy(engine);
    engine = scene_create(turned_text, &of_1, SIDE, SIDE, NULL);
    set_pane(engine, aways_m[3], wides_m[1], normal);
    scene_settle(engine, 600, light, 3 * NUM, NULL);
    assert_memory_equal(light, of_16, sizeof of_16);
    karst_engine_destroy(engine);
}

/* With chance at each face, and by full light: whole panes' transmittance. */
static void samples_add_up_to_panes(void **state)
{
    (void)state;
    for (int full = 0; full < 2; full++) {
        const karst_engine_config like = {
            .exposure = KARST_EXPOSURE_GIVEN,
            .samples = 16,
            .integrator = full ? KARST_INTEGRATOR_FULL : KARST_INTEGRATOR_DIRECT};
        karst_engine *engine = scene_create(turned_text, &like, SIDE, SIDE, NULL);
        for (int a = 45; a <= 75; a += 15) {
            double normal[3];
            turn_pane(a, normal);
            set_pane(engine, 13, 0.02, normal);
            scene_settle(engine, 600, light, 3 * NUM, NULL);
            const pane_sum sum = look_through(13, normal, false);
            print_message("%s, turned by %d degrees: %.4f comes through of %.4f\n", full ? "full" : "direct", a,
                          sum.through / sum.num, sum.truth / sum.num);
            assert_true(fabs(sum.through - sum.truth) < 0.01 * sum.num);
        }
        karst_engine_destroy(engine);
    }
}

/* A shell of glass thinner than what bricks show, near its rim. What shines behind it says where it was seen. */
static const char shell_text[] =
    "/*{ \"voxel\": 0.00390625, \"view\": 60, \"sun\": { \"azimuth\": 0, \"elevation\": -90 },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"params\": { \"radius\": { \"value\": 1, \"min\": 0, \"max\": 4 },\n"
    "\"wide\": { \"value\": 0.02, \"min\": 0, \"max\": 1 } },\n"
    "\"camera\": { \"position\": [\"0\", \"0\", \"-6\"], \"fov\": 10 } }*/\n"
    "float density(vec3 p) { return length(p) - 20.0; }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0); m.emission = 0.5 + 0.02 * p; return m; }\n"
    "float clear(vec3 p) { return wide * 0.5 - abs(length(p + vec3(radius - 0.1, 0.0, 0.0)) - radius); }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; return m; }\n";

typedef struct {
    double o[3], d[3]; /* from the shell's middle */
    bool inside;
} shell_ray;

static double dot3(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* To the nearest of its two spheres; -1: there is none. */
static double to_shell(const shell_ray *r, double radius_m, double wide_m)
{
    double nearest = -1;
    for (int i = 0; i < 4; i++) {
        const double of = radius_m + (i & 1 ? wide_m : -wide_m) / 2, b = dot3(r->o, r->d),
                     square = b * b - dot3(r->o, r->o) + of * of;
        const double t = square > 0 ? -b + (i & 2 ? sqrt(square) : -sqrt(square)) : -1;
        if (t > 1e-9 && (nearest < 0 || t < nearest))
            nearest = t;
    }
    return nearest;
}

/* Turns a ray where it is; the share of it that is reflected. goes_back: of that. */
static double turn_at_shell(shell_ray *r, double t, int goes_back, double u)
{
    double n[3];
    for (int a = 0; a < 3; a++)
        r->o[a] += t * r->d[a];
    const double away = dot3(r->o, r->d) > 0 ? -1 : 1, scale = away / sqrt(dot3(r->o, r->o));
    for (int a = 0; a < 3; a++)
        n[a] = scale * r->o[a];
    const double ratio = r->inside ? 1.5 : 1 / 1.5, cosine = -dot3(r->d, n),
                 square = 1 - ratio * ratio * (1 - cosine * cosine), far = sqrt(fmax(square, 0)),
                 s = (ratio * cosine - far) / (ratio * cosine + far),
                 p = (ratio * far - cosine) / (ratio * far + cosine),
                 reflected = square <= 0 ? 1 : (s * s + p * p) / 2;
    const bool back = goes_back < 0 ? u < reflected : goes_back != 0;
    for (int a = 0; a < 3; a++)
        r->d[a] = back ? r->d[a] + 2 * cosine * n[a] : ratio * r->d[a] + (ratio * cosine - far) * n[a];
    const double length = sqrt(dot3(r->d, r->d));
    for (int a = 0; a < 3; a++)
        r->d[a] /= length;
    r->inside ^= !back;
    return reflected;
}

/* What a ray sees; both its ways from the first surface, one from each later one. */
static void see_shell(const shell_ray *eye, double radius_m, double wide_m, double sum[3])
{
    const double first = to_shell(eye, radius_m, wide_m), middle_x = 0.1 - radius_m;
    sum[0] = sum[1] = sum[2] = 0;
    for (int branch = 0; branch < (first < 0 ? 1 : 2); branch++) {
        shell_ray r = *eye;
        double share = 1;
        if (first >= 0) {
            const double reflected = turn_at_shell(&r, first, branch == 0, 0);
            share = branch ? 1 - reflected : reflected;
        }
        for (int bounce = 1; first >= 0; bounce++) {
            const double t = to_shell(&r, radius_m, wide_m), u = 0.5 + 0.618034 * (bounce - 1);
            if (t < 0)
                break;
            turn_at_shell(&r, t, -1, u - floor(u));
        }
        const double o[3] = {r.o[0] + middle_x, r.o[1], r.o[2]}, b = dot3(o, r.d),
                     t = -b + sqrt(b * b - dot3(o, o) + 400);
        for (int a = 0; a < 3; a++)
            sum[a] += share * (0.5 + 0.02 * (o[a] + t * r.d[a]));
    }
}

static void thin_shells_are_seen_through_up_to_their_rims(void **state)
{
    (void)state;
    static const double wides_m[] = {0.02, 0.005}, radii_m[] = {1, 3};
    const karst_engine_config like = {.exposure = KARST_EXPOSURE_GIVEN, .bounces = 200};
    const double per_px = tan(0.08726646259971647) * 2 / SIDE;
    karst_engine *engine = scene_create(shell_text, &like, SIDE, SIDE, NULL);
    for (int i = 0; i < 4; i++) {
        const double radius_m = radii_m[i & 1], wide_m = wides_m[i >> 1];
        const karst_parameter parameters[] = {{"radius", radius_m}, {"wide", wide_m}};
        karst_stats stats;
        int num = 0, num_off = 0;
        assert_ok(karst_engine_set_parameters(engine, parameters, 2, &error));
        scene_settle(engine, 600, light, 3 * NUM, &stats);
        for (int k = 0; k < NUM; k++) {
            const double x = (k % SIDE + 0.5 - SIDE / 2) * per_px, y = (SIDE / 2 - k / SIDE - 0.5) * per_px,
                         length = sqrt(1 + x * x + y * y);
            shell_ray eye = {{radius_m - 0.1, 0, -6}, {x / length, y / length, 1 / length}, false};
            const double b = dot3(eye.o, eye.d), passes_m = sqrt(dot3(eye.o, eye.o) - b * b);
            double truth[3];
            if (passes_m > 0.98 * radius_m) /* what bricks show beyond the rim is glass to rays */
                continue;
            see_shell(&eye, radius_m, wide_m, truth);
            double off = 0;
            for (int a = 0; a < 3; a++)
                off = fmax(off, fabs((double)light[3 * k + a] - truth[a]));
            num++;
            num_off += off > 0.02;
        }
        print_message("a shell of %g m, %g m thin: %d of %d pixels are off, %d rays are cut off\n", radius_m, wide_m,
                      num_off, num, (int)stats.num_rays_cut);
        assert_true(num > NUM / 8);
        assert_true(num_off <= num / 33);
        assert_true(stats.num_rays_cut <= NUM / 200);
    }
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(sheets_are_what_they_are_wherever_they_lie),
                                       cmocka_unit_test(panes_let_through_what_they_should_at_any_angle),
                                       cmocka_unit_test(samples_add_up_to_panes),
                                       cmocka_unit_test(thin_shells_are_seen_through_up_to_their_rims)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
