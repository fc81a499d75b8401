/* Air that is exactly 0, in pictures: shapes whose density is flattened in the ways in which people write it. Rays meet
 * what they meet of the signed shape, at the same places and facing the same way: in the reference, and with
 * KARST_TEST_FULL=1 in pictures of bricks, which lie no farther from the truth than those of the signed text.
 * FLAT_ONLY: worlds whose name holds this; FLAT_TELL: which rays are wrong. */
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

#include "karst/karst.h"
#include "karst/view.h"

enum { MOST_WIDTH = 80, MOST_HEIGHT = 60, MOST_PIXELS = MOST_WIDTH * MOST_HEIGHT };

/* Signed densities d. */
static const struct {
    const char *name, *camera, *value;
} shapes[] = {
    {"ball", "\"3\", \"7\", \"-14\"], \"yaw\": -12, \"pitch\": -24", "6.0 - length(p)"},
    {"hills", "\"0\", \"9\", \"0\"], \"yaw\": 30, \"pitch\": -22", "5.0 * noise(p.xz / 9.0) - p.y"},
    {"box", "\"-7\", \"6\", \"-9\"], \"yaw\": 38, \"pitch\": -27", "-box(p, vec3(4.0, 2.0, 3.0))"},
    {"ring", "\"0\", \"9\", \"-11\"], \"yaw\": 0, \"pitch\": -38", "1.5 - length(vec2(length(p.xz) - 5.0, p.y))"},
    {"two balls", "\"-4\", \"4\", \"-13\"], \"yaw\": 14, \"pitch\": -15",
     "max(4.0 - length(p), 2.5 - length(p - vec3(4.0, 2.0, 0.0)))"},
    {"shell", "\"0\", \"1\", \"0\"], \"yaw\": 50, \"pitch\": 10",
     "min(0.7 - abs(length(p) - 9.0), 6.0 * noise(p / 4.0) + 1.0)"},
    {"columns", "\"0\", \"3\", \"0\"], \"yaw\": 31, \"pitch\": -8",
     "max(min(1.3 - length(mod(p.xz + 3.0, 6.0) - vec2(4.8, 1.5)), 5.0 - p.y), -p.y)"},
    {"octahedron", "\"-5\", \"7\", \"-10\"], \"yaw\": 26, \"pitch\": -32", "5.0 - abs(p.x) - abs(p.y) - abs(p.z)"},
    {"ridges", "\"0\", \"11\", \"0\"], \"yaw\": 75, \"pitch\": -25", "5.0 * ridged(p.xz / 24.0, 3) - p.y"},
    {"gyroid", "\"0\", \"8.5\", \"0\"], \"yaw\": 15, \"pitch\": -30",
     "min(dot(sin(p), cos(p.zxy)) + 0.2, 6.0 - p.y)"},
    {"cells", "\"0\", \"9\", \"0\"], \"yaw\": 120, \"pitch\": -28", "min(1.7 - 3.0 * worley(p / 5.0).x, 6.5 - p.y)"},
    {"values", "\"0\", \"9\", \"0\"], \"yaw\": 200, \"pitch\": -26", "6.0 * valuenoise(p.xz / 7.0) - p.y"},
    {"cone", "\"0\", \"6\", \"-16\"], \"yaw\": 2, \"pitch\": -14",
     "max(6.0 - p.y - 1.2 * length(p.xz), -p.y - 1.0)"},
};

/* What is 0 or less where d is, and positive where d is. */
static const char *const forms[] = {
    "return max(0.0, d);",
    "return clamp(d, 0.0, 1.0);",
    "return d > 0.0 ? 1.0 : 0.0;",
    "return 1.0 - step(d, 0.0);",
    "return float(d > 0.0);",
    "return smoothstep(0.0, 2.0, d);",
    "return max(d, 0.0) * max(d, 0.0);",
    "return 0.5 * (d + abs(d));",
    "if (d <= 0.0) return 0.0; return d * 255.0;",
    "return 1.0 - exp(-max(d, 0.0));",
    "return saturate(40.0 * d);",
    "return sign(max(d, 0.0));",
    "return sqrt(max(d, 0.0));",
    "return pow(clamp(d, 0.0, 1.0), 3.0);",
    "return ceil(saturate(d));",
    "return d * float(d > 0.0);",
    "return min(max(d, 0.0), 0.25) * 1e-3;",
    "float v = 0.0; if (d > 0.0) v = 255.0; return v;",
    "bool solid = d > 0.0; return solid ? 0.5 : 0.0;",
};
enum {
    NUM_SHAPES = sizeof shapes / sizeof *shapes,
    NUM_FORMS = sizeof forms / sizeof *forms,
    NUM_FLAT = NUM_SHAPES * NUM_FORMS
};

static char world_path[64], flat_name[128];
static int width_px, height_px;

typedef struct {
    karst_reference_hit hits[MOST_PIXELS];
    float depth_m[MOST_PIXELS], normals[3 * MOST_PIXELS];
} picture;
static picture signed_one, flat_one;

/* Number n of all, in an order that soon has each shape and each form. */
static size_t shape_of(size_t n) { return n % NUM_SHAPES; }
static size_t form_of(size_t n) { return n % NUM_FORMS; }

static void write_world(size_t shape, const char *form)
{
    snprintf(world_path, sizeof world_path, "/tmp/karst-flat-%d.karst", (int)getpid());
    FILE *file = fopen(world_path, "w");
    assert_non_null(file);
    fprintf(file,
            "/*{ \"voxel\": 0.015625, \"view\": 200, \"camera\": { \"position\": [%s } }*/\n"
            "float density(vec3 p) { float d = %s; %s }\n",
            shapes[shape].camera, shapes[shape].value, form);
    assert_int_equal(fclose(file), 0);
}

static void trace(picture *p)
{
    karst_error error = {0};
    karst_reference_stats stats = {0};
    const karst_reference_config config = {.world = world_path,
                                           .width_px = width_px,
                                           .height_px = height_px,
                                           .footprint = KARST_FOOTPRINT_NONE,
                                           .max_intervals = 20000};
    if (!karst_reference_trace(&config, p->hits, NULL, NULL, &stats, &error))
        fail_msg("%s: %s", flat_name, error.message);
    if (stats.num_unresolved)
        fail_msg("%s: %llu rays are given up", flat_name, (unsigned long long)stats.num_unresolved);
}

static double angle_deg(const double a[3], const double b[3])
{
    const double cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return acos(fmin(fmax(cosine, -1), 1)) * 57.29577951308232;
}

/* The rays of the flat world that end elsewhere, or see another face. */
static size_t num_wrong_rays(size_t *num_hits)
{
    size_t wrong = 0;
    *num_hits = 0;
    for (int k = 0; k < width_px * height_px; k++) {
        const karst_reference_hit *a = &signed_one.hits[k], *b = &flat_one.hits[k];
        const bool is_hit = a->kind == KARST_REFERENCE_SURFACE;
        const double turned_deg = is_hit ? angle_deg(a->normal, b->normal) : 0;
        *num_hits += is_hit;
        if (a->kind == b->kind && !(is_hit && fabs(a->t_m - b->t_m) > 1e-3 * a->footprint_m) && turned_deg <= 1)
            continue;
        wrong++;
        if (getenv("FLAT_TELL"))
            print_message("  %d, %d: at %.9g m (%.3f %.3f %.3f), found at %.9g (%.3f %.3f %.3f), turned by %.3f\n",
                          k % width_px, k / width_px, a->t_m, a->normal[0], a->normal[1], a->normal[2], b->t_m,
                          b->normal[0], b->normal[1], b->normal[2], turned_deg);
    }
    return wrong;
}

static bool is_set(const char *name) { return getenv(name) != NULL; }

static bool is_wanted(size_t n, size_t every)
{
    const char *only = getenv("FLAT_ONLY");
    snprintf(flat_name, sizeof flat_name, "%s: %s", shapes[shape_of(n)].name, forms[form_of(n)]);
    /* what decides this one are floats, which jump now before and now behind where doubles do */
    const bool is_jumpy = !strcmp(flat_name, "ball: return ceil(saturate(d));");
    return only ? strstr(flat_name, only) != NULL : n % every == 0 || is_jumpy;
}

/* All in full; else every 20th, each of another shape and form, at few rays: they compile no kernels. */
static void test_reference(void **state)
{
    (void)state;
    const bool full = is_set("KARST_TEST_FULL");
    size_t num_worlds = 0, num_bad = 0, all_hits = 0;
    width_px = 32, height_px = 24;
    for (size_t n = 0; n < NUM_FLAT; n++) {
        size_t num_hits;
        if (!is_wanted(n, full ? 1 : 20))
            continue;
        write_world(shape_of(n), "return d;");
        trace(&signed_one);
        write_world(shape_of(n), forms[form_of(n)]);
        trace(&flat_one);
        const size_t wrong = num_wrong_rays(&num_hits);
        num_worlds++;
        all_hits += num_hits;
        if (num_hits * 50 < (size_t)(width_px * height_px))
            fail_msg("%s: %zu rays hit", flat_name, num_hits);
        if (wrong * 50 > num_hits) { /* at rims and creases two faces are within rounding of one another */
            num_bad++;
            print_message("%s: %zu of %zu rays see something else\n", flat_name, wrong, num_hits);
        }
    }
    unlink(world_path);
    print_message("%zu flat worlds, %zu rays that hit\n", num_worlds, all_hits);
    assert_int_equal(num_bad, 0);
}

static void draw(picture *p)
{
    karst_error error = {0};
    bool settled = false;
    const karst_engine_config config = {.world = world_path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = width_px,
                                        .height_px = height_px,
                                        .pool_bytes = (uint64_t)96 << 20,
                                        .no_shadows = true};
    const size_t num = (size_t)(width_px * height_px);
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine || !karst_engine_settle(engine, 400, NULL, NULL, &settled, &error) || !settled ||
        !karst_engine_read_depth(engine, p->depth_m, num, &error) ||
        !karst_engine_read_normals(engine, p->normals, 3 * num, &error))
        fail_msg("%s: %s", flat_name, error.message);
    karst_engine_destroy(engine);
}

typedef struct {
    size_t hits, lost, off;
    double turned_deg; /* on average */
} fault;

static fault compare(const picture *p)
{
    fault f = {0};
    size_t faces = 0;
    for (int k = 0; k < width_px * height_px; k++) {
        const karst_reference_hit *hit = &signed_one.hits[k];
        const bool is_hit = hit->kind == KARST_REFERENCE_SURFACE, is_found = isfinite(p->depth_m[k]);
        f.hits += is_hit;
        f.lost += is_hit != is_found;
        if (!is_hit || !is_found)
            continue;
        const double normal[3] = {(double)p->normals[3 * k], (double)p->normals[3 * k + 1],
                                  (double)p->normals[3 * k + 2]};
        if (fabs((double)p->depth_m[k] - hit->t_m) > 2 * hit->footprint_m) {
            f.off++;
            continue;
        }
        faces++;
        f.turned_deg += angle_deg(normal, hit->normal);
    }
    f.turned_deg /= faces ? (double)faces : 1;
    return f;
}

/* A third of all: three of each shape, and of each form two. */
static void test_pictures(void **state)
{
    (void)state;
    size_t num_worlds = 0, num_bad = 0;
    width_px = MOST_WIDTH, height_px = MOST_HEIGHT;
    for (size_t n = 0; n < NUM_FLAT && is_set("KARST_TEST_FULL"); n++) {
        if (!is_wanted(n, 1) || (!getenv("FLAT_ONLY") && n >= 3 * (size_t)NUM_SHAPES))
            continue;
        write_world(shape_of(n), "return d;");
        trace(&signed_one);
        draw(&signed_one);
        write_world(shape_of(n), forms[form_of(n)]);
        draw(&flat_one);
        const fault s = compare(&signed_one), f = compare(&flat_one);
        const size_t room = f.hits / 100;
        const bool is_bad = f.lost > s.lost + room || f.off > s.off + room || f.turned_deg > 1.25 * s.turned_deg + 1;
        num_worlds++;
        num_bad += is_bad;
        print_message("%s %-60s %zu hits; signed and flat: lost or false %zu, %zu; off %zu, %zu; turned %.2f, %.2f\n",
                      is_bad ? "BAD" : "   ", flat_name, f.hits, s.lost, f.lost, s.off, f.off, s.turned_deg,
                      f.turned_deg);
    }
    unlink(world_path);
    if (num_worlds)
        print_message("%zu pictures of flat worlds\n", num_worlds);
    assert_int_equal(num_bad, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_reference), cmocka_unit_test(test_pictures)};
    return cmocka_run_group_tests_name("flat air", tests, NULL, NULL);
}
