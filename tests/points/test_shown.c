/* Worlds with models: refined hits lie on the models' own function, with its gradient, edited or not; and what looks at
 * worlds without a device (samplers, and with them queries, heights and meshes) has the models, too. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "producers/points/model_list.h"
#include "tests/points/clouds.h"
#include "tests/support/ok.h"

#define WIDTH 128
#define HEIGHT 96
#define VOXEL_LOG2_M (-4)
#define SCALE 10.0 /* of the torus, whose rings have radii of 1 and 0.4 */

static char folder[] = "/tmp/karst-shown-XXXXXX";
static char model_path[64], world_path[64];
static const char world_text[] =
    "/*{ \"voxel\": 0.0625, \"camera\": { \"position\": [\"0\", \"14\", \"-34\"], \"pitch\": -20, \"fov\": 60 },\n"
    "\"models\": [{ \"points\": \"torus.karstpoints\", \"at\": [\"0\", \"2\", \"0\"], \"turn\": [20, 35, 0],\n"
    "\"scale\": 10 }] }*/\n"
    "float density(vec3 p) { return -p.y - 8.0; }\n";

/* The models alone, as the world has them. */
static karst_model_list load(void)
{
    karst_model_list list;
    karst_model model = {.path = model_path, .turn_deg = {20, 35, 0}, .scale = SCALE};
    assert_ok(karst_position_parse("0", "2", "0", VOXEL_LOG2_M, &model.at, &error));
    assert_ok(karst_model_list_init(&list, &model, 1, VOXEL_LOG2_M, UINT64_MAX, NULL, &error));
    return list;
}

static karst_position place_of(const double p_m[3])
{
    return karst_position_add_m((karst_position){.voxel = {0}}, p_m, VOXEL_LOG2_M);
}

/* ---- refined hits ---- */

static const karst_edit edit = {.shape = KARST_EDIT_SPHERE, .mode = KARST_EDIT_REMOVE, .radius_m = 4};
static const double edit_at_m[3] = {-4, 4, -9};

typedef struct {
    double at_surface, upright; /* shares of hits on the model */
    int num;
} seen;

/* Whether the ray to a place comes near what was cut out: behind it lies the inner end of the crust. */
static bool passes_cut(const double p_m[3])
{
    const double eye_m[3] = {0, 14, -34};
    double along = 0, square = 0, apart = 0;
    for (int a = 0; a < 3; a++) {
        along += (p_m[a] - eye_m[a]) * (edit_at_m[a] - eye_m[a]);
        square += (p_m[a] - eye_m[a]) * (p_m[a] - eye_m[a]);
    }
    for (int a = 0; a < 3; a++) {
        const double nearest = eye_m[a] + (p_m[a] - eye_m[a]) * fmin(along / square, 1);
        apart += (nearest - edit_at_m[a]) * (nearest - edit_at_m[a]);
    }
    return sqrt(apart) < 4.2;
}

static seen look(bool refine, bool is_edited)
{
    karst_engine_config config = {.world = world_path,
                                  .display = KARST_DISPLAY_NONE,
                                  .width_px = WIDTH,
                                  .height_px = HEIGHT,
                                  .pool_bytes = (uint64_t)1 << 27,
                                  .refine = refine,
                                  .no_blend = true,
                                  .no_shadows = true};
    static float position[WIDTH * HEIGHT * 3], normal[WIDTH * HEIGHT * 3], level[WIDTH * HEIGHT];
    karst_engine *engine;
    bool settled;
    assert_ok(engine = karst_engine_create(&config, &error));
    if (is_edited) {
        karst_edit placed = edit;
        placed.at = place_of(edit_at_m);
        assert_ok(karst_engine_edit(engine, &placed, 1, &error));
    }
    assert_ok(karst_engine_settle(engine, 200, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_read_aov(engine, KARST_AOV_POSITION, position, WIDTH * HEIGHT * 3, &error) &&
              karst_engine_read_aov(engine, KARST_AOV_NORMAL, normal, WIDTH * HEIGHT * 3, &error) &&
              karst_engine_read_aov(engine, KARST_AOV_LEVEL, level, WIDTH * HEIGHT, &error));
    karst_engine_destroy(engine);
    karst_model_list list = load();
    seen found = {0};
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double p_m[3], along = 0, square = 0;
        float gradient[3] = {0};
        for (int a = 0; a < 3; a++)
            p_m[a] = (double)position[3 * i + a];
        if (level[i] < 0 || p_m[1] < -7.5 || (is_edited && passes_cut(p_m)))
            continue;
        const karst_position at = place_of(p_m);
        const float d = karst_model_list_at(&list, &at, (int)level[i], -1e30f, gradient);
        for (int a = 0; a < 3; a++) {
            square += (double)gradient[a] * (double)gradient[a];
            along -= (double)gradient[a] * (double)normal[3 * i + a];
        }
        found.num++;
        found.at_surface += fabs((double)d) < 2e-4 * sqrt(square); /* bricks are off by some 1e-3 */
        found.upright += along > cos(1 / 57.29577951308232) * sqrt(square);
    }
    karst_model_list_finish(&list);
    found.at_surface /= found.num;
    found.upright /= found.num;
    print_message("# %s%s: %d hits, %.4f at the surface, %.4f upright\n", refine ? "refined" : "as bricks have them",
                  is_edited ? ", edited" : "", found.num, found.at_surface, found.upright);
    return found;
}

static void refined_hits_lie_on_models(void **state)
{
    (void)state;
    const seen refined = look(true, false);
    assert_true(refined.num > 800 && refined.at_surface > 0.99 && refined.upright > 0.99);
    if (!getenv("KARST_TEST_FULL"))
        return;
    const seen bricks = look(false, false), edited = look(true, true);
    assert_true(bricks.num > 800 && bricks.at_surface < 0.1);
    assert_true(edited.num > 400 && edited.at_surface > 0.99 && edited.upright > 0.99);
}

/* ---- without a device ---- */

/* A place near the torus, as the world has it. */
static void near_torus(const karst_model_list *list, double p_m[3])
{
    (void)list;
    for (int a = 0; a < 3; a++)
        p_m[a] = (random_unit() - 0.5) * 30 + (a == 1 ? 2 : 0);
}

static void samplers_have_models(void **state)
{
    (void)state;
    karst_world *world;
    karst_sampler *sampler;
    assert_ok(world = karst_world_open(&(karst_world_config){.world = world_path}, &error));
    assert_ok(sampler = karst_sampler_create(world, &error));
    karst_model_list list = load();
    random_state = 9;
    int num_values = 0, num_slopes = 0, num_good = 0;
    double sum = 0;
    for (int i = 0; i < 4000; i++) {
        double p_m[3];
        near_torus(&list, p_m);
        const karst_position at = place_of(p_m);
        const double footprint_m = i % 3 ? 0 : 0.2;
        const float own = (float)(-p_m[1] - 8), with = karst_model_list_at(&list, &at, i % 3 ? -1 : 1, own, NULL);
        const karst_sample density = karst_sampler_density(sampler, &at, footprint_m);
        float batch;
        karst_sampler_densities(sampler, &at, 1, footprint_m, &batch);
        assert_true(density.device == batch && fabs((double)(density.device - with)) < 1e-4);
        if (with == own || p_m[1] < -6)
            continue;
        num_values++;
        karst_sample gradient[3];
        assert_true(karst_sampler_gradient(sampler, &at, footprint_m, gradient, NULL));
        double apart = 0, length = 0;
        bool is_inner = true;
        for (int a = 0; a < 3; a++) {
            double ends[2], step_m[3] = {0};
            for (int end = 0; end < 2; end++) {
                step_m[a] = end ? 0.01 : -0.01;
                const karst_position beside = karst_position_add_m(at, step_m, VOXEL_LOG2_M);
                ends[end] = karst_sampler_density(sampler, &beside, footprint_m).precise;
                is_inner = is_inner && ends[end] > -4;
            }
            const double slope = (ends[1] - ends[0]) / 0.02;
            apart += (slope - gradient[a].precise) * (slope - gradient[a].precise);
            length += slope * slope;
        }
        num_slopes += is_inner;
        num_good += is_inner && sqrt(apart) < 0.02 * sqrt(length) + 0.002;
        sum += is_inner ? sqrt(length) : 0;
    }
    print_message("# %d of %d places have a model's value; of %d slopes %d are right, %.2f long\n", num_values, 4000,
                  num_slopes, num_good, sum / num_slopes);
    assert_true(num_values > 60 && num_slopes > 50 && num_good > 0.97 * num_slopes);
    karst_sampler_destroy(sampler);
    karst_world_close(world);
    karst_model_list_finish(&list);
}

static void bounds_hold_models(void **state)
{
    (void)state;
    karst_world *world;
    karst_sampler *sampler;
    assert_ok(world = karst_world_open(&(karst_world_config){.world = world_path}, &error));
    assert_ok(sampler = karst_sampler_create(world, &error));
    random_state = 10;
    int num_air = 0, num_solid = 0;
    for (int i = 0; i < 1500; i++) {
        double p_m[3], half_m[3], range[2];
        near_torus(NULL, p_m);
        p_m[1] = fabs(p_m[1]) + 3;
        const double size = random_magnitude(0.01, 4), footprint_m = i % 2 ? 0 : random_magnitude(0.03, 2);
        for (int a = 0; a < 3; a++)
            half_m[a] = size * random_unit();
        const karst_position centre = place_of(p_m);
        if (!karst_sampler_bounds(sampler, &centre, half_m, footprint_m, range))
            continue;
        num_air += range[1] <= 0;
        for (int k = 0; k < 30; k++) {
            double to_m[3];
            for (int a = 0; a < 3; a++)
                to_m[a] = (2 * random_unit() - 1) * half_m[a];
            const karst_position at = karst_position_add_m(centre, to_m, VOXEL_LOG2_M);
            const float d = karst_sampler_density(sampler, &at, footprint_m * random_unit()).device;
            num_solid += d > 0;
            assert_true((double)d >= range[0] && (double)d <= range[1]);
        }
    }
    print_message("# %d boxes are proved air; %d places are solid\n", num_air, num_solid);
    assert_true(num_air > 300 && num_solid > 200);
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

/* Rays from outside meet the torus where it is. */
static void queries_have_models(void **state)
{
    (void)state;
    enum { NUM = 200 };
    karst_world *world;
    assert_ok(world = karst_world_open(&(karst_world_config){.world = world_path}, &error));
    const karst_query_config config = {.footprint_m = 0};
    static karst_query_ray rays[NUM];
    static karst_query_hit hits[NUM];
    random_state = 12;
    const double spacing_m = SCALE * spacing_of(&known_surfaces[1], 20000);
    for (int i = 0; i < NUM; i++) { /* from outside onto the torus, turned as the model is */
        double p[3], normal[3], at_m[3], out[3];
        random_on_surface(&known_surfaces[1], p, normal);
        const double turn = 3.14159265358979323846 / 180, cx = cos(20 * turn), sx = sin(20 * turn), cy = cos(35 * turn),
                     sy = sin(35 * turn);
        for (int k = 0; k < 2; k++) {
            const double *v = k ? normal : p;
            const double y = cx * v[1] - sx * v[2], z = sx * v[1] + cx * v[2];
            const double turned[3] = {cy * v[0] + sy * z, y, -sy * v[0] + cy * z};
            for (int a = 0; a < 3; a++)
                (k ? out : at_m)[a] = turned[a];
        }
        for (int a = 0; a < 3; a++) {
            at_m[a] = SCALE * at_m[a] + (a == 1 ? 2 : 0) + 3 * out[a];
            rays[i].direction[a] = -out[a];
        }
        if (at_m[1] < -7.9) { /* in the ground */
            i--;
            continue;
        }
        rays[i].from = place_of(at_m);
        rays[i].length_m = 8;
    }
    assert_ok(karst_query_rays(world, &config, rays, NUM, hits, &error));
    double square = 0;
    for (int i = 0; i < NUM; i++) {
        assert_int_equal(hits[i].kind, KARST_QUERY_SURFACE);
        square += (hits[i].t_m - 3) * (hits[i].t_m - 3);
    }
    print_message("# rays: rms %.3f spacings\n", sqrt(square / NUM) / spacing_m);
    assert_true(sqrt(square / NUM) < 0.3 * spacing_m);
    karst_world_close(world);
}

static void a_missing_model_is_named(void **state)
{
    (void)state;
    karst_error why = {0};
    char away[80];
    snprintf(away, sizeof away, "%s.away", model_path);
    assert_int_equal(rename(model_path, away), 0);
    assert_null(karst_world_open(&(karst_world_config){.world = world_path}, &why));
    assert_int_equal(why.status, KARST_BAD_DATA);
    assert_non_null(strstr(why.message, "torus.karstpoints"));
    assert_int_equal(rename(away, model_path), 0);
}

static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    char input[64];
    snprintf(input, sizeof input, "%s/torus.ply", folder);
    snprintf(model_path, sizeof model_path, "%s/torus.karstpoints", folder);
    snprintf(world_path, sizeof world_path, "%s/world.karst", folder);
    random_state = 3;
    write_cloud(input, &known_surfaces[1], 20000, 0);
    const karst_points_import_config config = {.input = input, .output = model_path, .axes = KARST_POINTS_AS_THEY_ARE};
    bool done = karst_points_import(&config, NULL, NULL);
    unlink(input);
    FILE *file = fopen(world_path, "w");
    done = done && file && fputs(world_text, file) >= 0;
    return file && fclose(file) == 0 && done ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    unlink(model_path);
    unlink(world_path);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(refined_hits_lie_on_models), cmocka_unit_test(samplers_have_models),
        cmocka_unit_test(bounds_hold_models),         cmocka_unit_test(queries_have_models),
        cmocka_unit_test(a_missing_model_is_named),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
