/* Surfaces where the density jumps, against closed forms: where rays meet them, and which way they face, in the
 * reference, in pictures, and in refined ones. Which worlds: jumping.h. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "karst/karst.h"

#include "tests/hard/jumping.h"

enum { WIDTH = 80, HEIGHT = 60, NUM = WIDTH * HEIGHT, EDGE_PX = 2 };
#define VIEW_M 150.0
#define FOV_DEG 60.0
#define VOXEL_LOG2_M (-6)

static jumping_hit truth[NUM];
static bool is_edge[NUM]; /* another surface, another cell or nothing at all within EDGE_PX */
static char path[64];
static karst_camera camera;

static void write_world(const jumping_world *w)
{
    snprintf(path, sizeof path, "/tmp/karst-jumping-%d.karst", (int)getpid());
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "/*{ \"voxel\": %g, \"view\": %g }*/\n%s", ldexp(1, VOXEL_LOG2_M), VIEW_M, w->text);
    assert_int_equal(fclose(file), 0);
}

static void find_truth(const jumping_world *w)
{
    double right[3], up[3], forward[3], from[3];
    const double half = tan(FOV_DEG * 0.5 * 0.017453292519943295), footprint = 2 * half / HEIGHT;
    karst_error error = {0};
    if (!karst_camera_parse(w->camera, VOXEL_LOG2_M, &camera, &error))
        fail_msg("%s: %s", w->name, error.message);
    camera.fov_deg = FOV_DEG;
    karst_camera_axes(&camera, right, up, forward);
    for (int i = 0; i < 3; i++)
        from[i] = ldexp((double)camera.position.voxel[i] + camera.position.fraction[i] * 0x1p-32, VOXEL_LOG2_M);
    if (w->density(jumping_place(from, forward, 0)) > 0)
        fail_msg("%s: the camera stands in land", w->name);
    for (int n = 0; n < NUM; n++) {
        const double u = (2 * (n % WIDTH + 0.5) / WIDTH - 1) * half * WIDTH / HEIGHT,
                     v = (1 - 2 * (n / WIDTH + 0.5) / HEIGHT) * half;
        double way[3], length = sqrt(1 + u * u + v * v);
        for (int i = 0; i < 3; i++)
            way[i] = (forward[i] + u * right[i] + v * up[i]) / length;
        truth[n] = jumping_truth(w, from, way, footprint, VIEW_M);
    }
    for (int n = 0; n < NUM; n++) {
        const int x = n % WIDTH, y = n / WIDTH;
        is_edge[n] = false;
        for (int b = y - EDGE_PX; b <= y + EDGE_PX; b++)
            for (int a = x - EDGE_PX; a <= x + EDGE_PX; a++) {
                if (a < 0 || b < 0 || a >= WIDTH || b >= HEIGHT) { /* what lies beyond the picture is not known */
                    is_edge[n] = true;
                    continue;
                }
                const jumping_hit *other = &truth[b * WIDTH + a];
                is_edge[n] |= other->is_hit != truth[n].is_hit || other->patch != truth[n].patch ||
                              fabs(other->t_m - truth[n].t_m) > 0.25 * truth[n].t_m;
            }
    }
}

/* Of pixels away from edges, how many look at a jump, and how many of all face another way or lie elsewhere. */
typedef struct {
    int num_jumps, num_slopes, num_turned, num_off;
    double sum_deg;
} tally;

static double angle_deg(const double a[3], const double b[3])
{
    const double cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return acos(fmin(fmax(cosine, -1), 1)) * 57.29577951308232;
}

/* `turned_deg`, `off`: what counts as turned, and as elsewhere, in footprints across the surface. */
static void count(tally *t, int n, double t_m, const double normal[3], double turned_deg, double off)
{
    const double footprint_m = truth[n].t_m * 2 * tan(FOV_DEG * 0.5 * 0.017453292519943295) / HEIGHT;
    const double turned = angle_deg(truth[n].normal, normal);
    if (is_edge[n] || !truth[n].is_hit)
        return;
    *(truth[n].jumps ? &t->num_jumps : &t->num_slopes) += 1;
    t->num_turned += !(turned <= turned_deg);
    t->sum_deg += isfinite(turned) ? turned : 180;
    const bool is_off = !(fabs(t_m - truth[n].t_m) <= off * footprint_m);
    t->num_off += is_off;
    if (getenv("JUMPS_TELL") && (is_off || !(turned <= turned_deg)))
        print_message("  %d, %d: %s at %g m, found at %g, turned by %.2f (%.3f %.3f %.3f, is %.3f %.3f %.3f)\n",
                      n % WIDTH, n / WIDTH, truth[n].jumps ? "jump" : "slope", truth[n].t_m, t_m, turned, normal[0],
                      normal[1], normal[2], truth[n].normal[0], truth[n].normal[1], truth[n].normal[2]);
}

static void tell(const char *name, const char *how, const tally *t)
{
    const int num = t->num_jumps + t->num_slopes;
    print_message("%-22s %-9s %4d pixels of jumps, %4d of slopes: %4d turned, mean %6.3f degrees, %4d elsewhere\n",
                  name, how, t->num_jumps, t->num_slopes, t->num_turned, num ? t->sum_deg / num : 0, t->num_off);
}

static bool check_reference(const jumping_world *w)
{
    static karst_reference_hit hits[NUM];
    karst_error error = {0};
    tally t = {0};
    const karst_reference_config config = {
        .world = path, .camera = &camera, .width_px = WIDTH, .height_px = HEIGHT, .footprint = KARST_FOOTPRINT_NONE};
    if (!karst_reference_trace(&config, hits, NULL, NULL, NULL, &error))
        fail_msg("%s: %s", w->name, error.message);
    for (int n = 0; n < NUM; n++)
        count(&t, n, hits[n].t_m, hits[n].normal, 0.5, 0.01);
    tell(w->name, "reference", &t);
    return t.num_jumps > 60 && !t.num_turned && !t.num_off;
}

static bool check_picture(const jumping_world *w, bool refine, int lanes)
{
    static float depth_m[NUM], normals[3 * NUM];
    karst_error error = {0};
    tally t = {0};
    bool settled = false;
    const karst_engine_config config = {.world = path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH,
                                        .height_px = HEIGHT,
                                        .pool_bytes = (uint64_t)96 << 20,
                                        .no_shadows = true,
                                        .refine = refine,
                                        .lanes = lanes};
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine || !karst_engine_set_camera(engine, &camera, &error) ||
        !karst_engine_settle(engine, 400, NULL, NULL, &settled, &error) || !settled ||
        !karst_engine_read_depth(engine, depth_m, NUM, &error) ||
        !karst_engine_read_normals(engine, normals, (size_t)NUM * 3, &error))
        fail_msg("%s: %s", w->name, error.message);
    karst_engine_destroy(engine);
    for (int n = 0; n < NUM; n++) {
        const double normal[3] = {(double)normals[3 * n], (double)normals[3 * n + 1], (double)normals[3 * n + 2]};
        count(&t, n, (double)depth_m[n], normal, 10, 1);
    }
    tell(w->name, refine ? "refined" : "bricks", &t);
    const int num = t.num_jumps + t.num_slopes;
    /* also of refined ones, as the normals of jumps stay the bricks' */
    return t.num_turned * 50 <= num && t.num_off * 100 <= num && t.sum_deg <= 2 * num;
}

/* JUMPS_ONLY: those whose name holds this. Every seventh, or all with KARST_TEST_FULL=1. */
static bool is_wanted(int i)
{
    const char *only = getenv("JUMPS_ONLY");
    return only ? strstr(jumping_worlds[i].name, only) != NULL : getenv("KARST_TEST_FULL") || i % 7 == 0;
}

static void test_reference(void **state)
{
    int num_bad = 0;
    (void)state;
    for (int i = 0; i < JUMPING_NUM_WORLDS; i++) {
        if (!is_wanted(i))
            continue;
        write_world(&jumping_worlds[i]);
        find_truth(&jumping_worlds[i]);
        num_bad += !check_reference(&jumping_worlds[i]);
    }
    unlink(path);
    assert_int_equal(num_bad, 0);
}

/* All with KARST_TEST_FULL=1; else one, as each compiles its kernels. */
static void test_pictures(void **state)
{
    int num_bad = 0;
    (void)state;
    for (int i = 0; i < JUMPING_NUM_WORLDS; i++) {
        const jumping_world *w = &jumping_worlds[i];
        if (!is_wanted(i) || (!getenv("KARST_TEST_FULL") && strcmp(w->name, "sawtooth") != 0))
            continue;
        write_world(w);
        find_truth(w);
        num_bad += !check_picture(w, false, 16);
        num_bad += !check_picture(w, true, 16);
    }
    unlink(path);
    assert_int_equal(num_bad, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_reference), cmocka_unit_test(test_pictures)};
    return cmocka_run_group_tests_name("jumps", tests, NULL, NULL);
}
