/* Optical depth along rays through a store of extinction, beside land on the same tree: against closed forms, against
 * double quadrature of the oracle's extinction, and against itself at other levels, lanes and bits. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "cache/pools.h"
#include "producers/density/world_file.h"
#include "producers/language/oracle/oracle.h"
#include "producers/steps/medium.h"
#include "producers/stores.h"
#include "raycast/media/media.h"
#include "tests/support/pool.h"

#define TOP_LEVEL 8
#define TILES 9000u
#define LAND_BRICKS 64u
#define AIR_BRICKS 7000u
#define MAX_LOADS 2048u
#define MAX_ROUNDS 60
#define NUM_RAYS 16u /* of each case */

static karst_context *contexts[2]; /* 16 lanes, and 1 */

static void expect(bool good, const char *what, const karst_error *error) { pool_expect(good, what, error); }

/* A world whose land is far below. */
static karst_world_file *compile(const char *air)
{
    char text[2048];
    karst_error error = {0};
    snprintf(text, sizeof text,
             "/*{ \"name\": \"test\", \"voxel\": 1, \"seed\": 5 }*/\n"
             "float density(vec3 p) { return -100000.0 - p.y; }\n%s",
             air);
    karst_world_file *file = karst_world_file_compile("test", text, strlen(text), NULL, 0, NULL, &error);
    expect(file, air, &error);
    return file;
}

static const karst_world_file *air_of(const karst_world_file *land)
{
    assert_non_null(land->content[KARST_CONTENT_AIR]);
    return land->content[KARST_CONTENT_AIR];
}

typedef struct {
    karst_context *context;
    karst_cache *cache;
    karst_store *air;
    karst_store_source sources[2];
    karst_media *media;
    karst_buffer *rays, *depths;
    int64_t root_corner[3];
    uint32_t serial;
} scene;

static void scene_open(scene *s, karst_context *context, const karst_world_file *land, int bits,
                       const karst_world_build *build)
{
    karst_error error = {0};
    *s = (scene){.context = context, .root_corner = {-1, -1, -1}};
    s->cache = karst_cache_create_of(context, TILES, LAND_BRICKS, 0, bits, &error);
    expect(s->cache && karst_cache_place_root(s->cache, s->root_corner, TOP_LEVEL, &error), "cache", &error);
    const karst_store_config config = {.name = "air", .num_bricks = AIR_BRICKS, .brick_bits = bits};
    s->air = karst_cache_add_store(s->cache, &config, &error);
    expect(s->air, "store", &error);
    const karst_world_file *air = air_of(land);
    char finalise[64];
    snprintf(finalise, sizeof finalise, "%s " KARST_MEDIUM_OPTION,
             karst_cache_brick_option(karst_store_get_buffers(s->air)));
    karst_world_build built = build ? *build : (karst_world_build){.shape = KARST_SHAPE_AUTO};
    built.options = KARST_MEDIUM_OPTION;
    built.finalise_options = finalise;
    karst_store *store = karst_cache_find_store(s->cache, KARST_STORE_LAND);
    const karst_world_build of_land = {.shape = KARST_SHAPE_AUTO,
                                       .finalise_options = karst_cache_brick_option(karst_store_get_buffers(store))};
    s->sources[0] = (karst_store_source){
        store, karst_world_file_producer_built(context, land, 5, MAX_LOADS, &of_land, &error)};
    s->sources[1] =
        (karst_store_source){s->air, karst_world_file_producer_built(context, air, 5, MAX_LOADS, &built, &error)};
    expect(s->sources[0].producer && s->sources[1].producer, "producers", &error);
    const karst_media_config media = {.air = karst_store_get_buffers(s->air)};
    s->media = karst_media_create(context, &media, &error);
    expect(s->media, "media", &error);
    s->rays = karst_buffer_create(context, "rays", NUM_RAYS * sizeof(karst_ray), NULL, &error);
    s->depths = karst_buffer_create(context, "depths", NUM_RAYS * sizeof(float), NULL, &error);
    expect(s->rays && s->depths, "buffers", &error);
}

static void scene_close(scene *s)
{
    karst_buffer_destroy(s->rays);
    karst_buffer_destroy(s->depths);
    karst_media_destroy(s->media);
    karst_producer_destroy(s->sources[0].producer);
    karst_producer_destroy(s->sources[1].producer);
    karst_cache_destroy(s->cache);
}

static void answer(scene *s, const karst_work *work)
{
    karst_error error = {0};
    expect(karst_stores_answer(s->sources, 2, s->air, work, &error) &&
               karst_cache_publish(s->cache, work, NULL, NULL, &error),
           "answer", &error);
}

/* Depths of rays once nothing is lacking. */
static void settle(scene *s, const karst_ray *rays, float *depths)
{
    const karst_position anchor = {{0}, {0}};
    uint32_t num_missing = 1;
    karst_error error = {0};
    karst_work work;
    expect(karst_buffer_write(s->rays, 0, rays, NUM_RAYS * sizeof *rays, &error), "rays", &error);
    for (int round = 0; num_missing; round++) {
        assert_true(round < MAX_ROUNDS);
        s->serial++;
        expect(karst_store_root_work(s->air, s->serial, &work, &error), "root", &error);
        if (work.num_loads)
            answer(s, &work);
        karst_cast_view view;
        karst_cast_view_init(&view, &anchor, s->root_corner, TOP_LEVEL);
        view.serial = s->serial;
        expect(karst_media_depths(s->media, &view, s->rays, NUM_RAYS, 1, s->depths, &num_missing, &error), "depths",
               &error);
        const karst_collect_params params = {.serial = s->serial,
                                             .frame = s->serial,
                                             .turn = s->serial,
                                             .camera = anchor,
                                             .max_tiles = MAX_LOADS,
                                             .max_bricks = MAX_LOADS};
        expect(karst_store_collect(s->air, &params, &work, &error), "collect", &error);
        if (work.num_loads + work.num_subdivides)
            answer(s, &work);
        else
            assert_int_equal(num_missing, 0);
    }
    expect(karst_cache_check(s->cache, &error), "check", &error);
    expect(karst_buffer_read(s->depths, 0, depths, NUM_RAYS * sizeof *depths, &error), "read", &error);
}

/* ---- rays ---- */

static double random_unit(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) * 0x1p-53;
}

/* Rays of level `level` through a ball of that radius round the origin, from outside of it. */
static void random_rays(karst_ray rays[NUM_RAYS], double radius, int level, uint64_t seed)
{
    for (uint32_t i = 0; i < NUM_RAYS; i++) {
        double d[3], at[3], length = 0;
        do {
            length = 0;
            for (int a = 0; a < 3; a++) {
                d[a] = 2 * random_unit(&seed) - 1;
                length += d[a] * d[a];
            }
        } while (length > 1 || length < 0.01);
        rays[i] = (karst_ray){.t_max = (float)(4 * radius), .width = ldexpf(1, level)};
        for (int a = 0; a < 3; a++) {
            d[a] = i < 3 ? (a == (int)i) : d[a] / sqrt(length); /* some along the axes */
            at[a] = (2 * random_unit(&seed) - 1) * 0.5 * radius;
            rays[i].direction[a] = (float)d[a];
            rays[i].origin[a] = (float)(at[a] - 2 * radius * d[a]);
        }
    }
}

/* ---- closed forms ---- */

typedef struct {
    const char *name, *text;
    double (*depth)(const karst_ray *ray);
} closed_form;

/* The integral over the way of what depends on the height alone, given its own from 0 up, which is odd. */
static double across_heights(const karst_ray *r, double (*sum)(double))
{
    const double from = (double)r->origin[1], rate = (double)r->direction[1], to = from + rate * (double)r->t_max;
    return fabs(rate) < 1e-9 ? -1 : (copysign(sum(fabs(to)), to) - copysign(sum(fabs(from)), from)) / rate;
}

/* 0.004 per metre up to 99 m, and none from 101 m on, as samples a metre apart have it. */
static double slab_sum(double y)
{
    const double over = fmin(fmax(y - 99, 0), 2);
    return 0.004 * (fmin(y, 99) + over - over * over / 4);
}
static double of_slab(const karst_ray *r) { return across_heights(r, slab_sum); }

/* 0.00005 per metre and metre up to 128 m, and none from 129 m on. */
static double ramp_sum(double y)
{
    const double low = fmin(y, 128), over = fmin(fmax(y - 128, 0), 1);
    return 0.00005 * (low * low / 2 + 128 * (over - over * over / 2));
}
static double of_ramp(const karst_ray *r) { return across_heights(r, ramp_sum); }

/* Where the line is nearest to the origin, and how near, squared. */
static double nearest(const karst_ray *r, double *square)
{
    double along = 0;
    *square = 0;
    for (int a = 0; a < 3; a++) {
        along += (double)r->origin[a] * (double)r->direction[a];
        *square += (double)r->origin[a] * (double)r->origin[a];
    }
    *square -= along * along;
    return -along;
}

/* k (1 - r^2 / R^2): a polynomial along the chord. */
static double ball_sum(double u, double chord2) { return chord2 * u - u * u * u / 3; }
static double of_ball(const karst_ray *r)
{
    double square, middle = nearest(r, &square);
    const double chord2 = 160000 - square, half = sqrt(fmax(chord2, 0));
    const double from = fmax(-middle, -half), to = fmin((double)r->t_max - middle, half);
    return to > from ? 0.003 / 160000 * (ball_sum(to, chord2) - ball_sum(from, chord2)) : 0;
}

/* k exp(-r^2 / (2 s^2)). */
static double of_gaussian(const karst_ray *r)
{
    const double s = 200, root = s * sqrt(2);
    double square, middle = nearest(r, &square);
    return 0.002 * s * sqrt(M_PI / 2) * exp(-square / (2 * s * s)) *
           (erf(((double)r->t_max - middle) / root) + erf(middle / root));
}

static const closed_form forms[] = {
    {"slab",
     "medium air(vec3 p) { medium m; m.extinction = 0.004 * clamp(100.5 - abs(p.y), 0.0, 1.0); return m; }",
     of_slab},
    {"ramp", "medium air(vec3 p) { medium m; m.extinction = abs(p.y) < 128.5 ? 0.00005 * abs(p.y) : 0.0; return m; }",
     of_ramp},
    {"ball",
     "medium air(vec3 p) { medium m; m.extinction = 0.003 * (1.0 - dot(p, p) / 160000.0); return m; }", of_ball},
    {"gaussian",
     "medium air(vec3 p) { medium m; m.extinction = 0.002 * exp(-dot(p, p) / 80000.0); return m; }", of_gaussian},
};

static void measure(const closed_form *form, int bits, karst_context *context, double *worst)
{
    karst_ray rays[NUM_RAYS];
    float depths[NUM_RAYS];
    scene s;
    karst_world_file *land = compile(form->text);
    random_rays(rays, 150, 0, 11);
    scene_open(&s, context, land, bits, NULL);
    settle(&s, rays, depths);
    *worst = 0;
    for (uint32_t i = 0; i < NUM_RAYS; i++) {
        const double expected = form->depth(&rays[i]), error = fabs(exp((double)-depths[i]) / exp(-expected) - 1);
        *worst = fmax(*worst, expected < 0 ? 0 : error);
    }
    printf("# %s, %d bits: transmittance to %.3g\n", form->name, bits, *worst);
    scene_close(&s);
    karst_world_file_destroy(land);
}

static void test_closed_forms(void **state)
{
    (void)state;
    for (size_t f = 0; f < sizeof forms / sizeof *forms; f++)
        for (int bits = 16; bits <= 32; bits += 16) {
            double worst;
            measure(&forms[f], bits, contexts[0], &worst);
            assert_true(worst < (bits == 32 ? 1e-5 : 2e-4));
        }
}

/* ---- clouds ---- */

#define CLOUD                                                                                              \
    "medium air(vec3 p) { medium m; m.extinction = 0.02 * (fbm(p / 96.0, 5) + 0.15 - dot(p, p) / 90000.0); " \
    "return m; }"

/* The integral of what the oracle says at a level, where it is positive: by Simpson's rule, in double. */
static double quadrature(karst_oracle *oracle, const karst_ray *r, int level)
{
    const int num = 4 * (int)r->t_max; /* four parts a voxel */
    const double step = (double)r->t_max / num;
    double sum = 0;
    for (int i = 0; i <= num; i++) {
        double at_m[3];
        for (int a = 0; a < 3; a++)
            at_m[a] = (double)r->origin[a] + (double)r->direction[a] * step * i;
        const karst_position at = karst_position_add_m((karst_position){{0}, {0}}, at_m, 0);
        sum += fmax(karst_oracle_precise_density(oracle, &at, level), 0) * (i == 0 || i == num ? 1 : i & 1 ? 4 : 2);
    }
    return sum * step / 3;
}

/* In double: the samples of level 0 at the corners of each cell that the ray passes, and the integral of what lies
 * between them, by Gauss's two points. */
static double across_cells(karst_oracle *oracle, const karst_ray *r)
{
    double t = 0, sum = 0;
    while (t < (double)r->t_max) {
        double next = (double)r->t_max, corner[3], samples[8];
        for (int a = 0; a < 3; a++) {
            const double d = (double)r->direction[a], at = (double)r->origin[a] + d * (t + 1e-9);
            const double plane = d > 0 ? floor(at) + 1 : ceil(at) - 1;
            next = d == 0 ? next : fmin(next, (plane - (double)r->origin[a]) / d);
        }
        for (int a = 0; a < 3; a++)
            corner[a] = floor((double)r->origin[a] + (double)r->direction[a] * (t + next) / 2);
        for (int i = 0; i < 8; i++) {
            const karst_position at = {
                {(int64_t)corner[0] + (i & 1), (int64_t)corner[1] + (i >> 1 & 1), (int64_t)corner[2] + (i >> 2)}, {0}};
            samples[i] = fmax(karst_oracle_precise_density(oracle, &at, 0), 0);
        }
        for (int point = -1; point <= 1; point += 2) {
            double v[8];
            memcpy(v, samples, sizeof v);
            for (int a = 0, num = 4; a < 3; a++, num /= 2)
                for (int i = 0; i < num; i++) {
                    const double middle = (t + next) / 2 + point * (next - t) / 2 / sqrt(3);
                    const double part = (double)r->origin[a] + (double)r->direction[a] * middle - corner[a];
                    v[i] = v[2 * i] + (v[2 * i + 1] - v[2 * i]) * part;
                }
            sum += v[0] * (next - t) / 2;
        }
        t = next;
    }
    return sum;
}

/* Samples that have next to nothing to do with one another: what lies between them is integrated exactly. */
static void test_cells(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_ray rays[NUM_RAYS];
    float depths[NUM_RAYS];
    scene s;
    karst_world_file *land =
        compile("medium air(vec3 p) { medium m; m.extinction = 0.02 * noise(p / 3.7); return m; }");
    const karst_world_file *air = air_of(land);
    karst_number seedless = {0};
    karst_oracle *oracle = karst_oracle_create(&air->program->world, &seedless, 5, 0, &error);
    expect(oracle, "oracle", &error);
    random_rays(rays, 60, 0, 3);
    scene_open(&s, contexts[0], land, 32, NULL);
    settle(&s, rays, depths);
    double worst = 0;
    for (uint32_t i = 0; i < NUM_RAYS; i++) {
        assert_true(depths[i] > 0.05f);
        worst = fmax(worst, fabs((double)depths[i] / across_cells(oracle, &rays[i]) - 1));
    }
    printf("# cells of noise: depth to %.3g\n", worst);
    assert_true(worst < 1e-5);
    scene_close(&s);
    karst_oracle_destroy(oracle);
    karst_world_file_destroy(land);
}

static void test_cloud(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_ray rays[NUM_RAYS];
    float depths[NUM_RAYS];
    scene s;
    karst_world_file *land = compile(CLOUD);
    const karst_world_file *air = air_of(land);
    karst_number seedless = {0};
    karst_oracle *oracle = karst_oracle_create(&air->program->world, &seedless, 5, 0, &error);
    expect(oracle, "oracle", &error);
    random_rays(rays, 120, 0, 3);
    scene_open(&s, contexts[0], land, 16, NULL);
    settle(&s, rays, depths);
    double squares = 0, mean = 0;
    for (uint32_t i = 0; i < NUM_RAYS; i++) {
        const double expected = quadrature(oracle, &rays[i], 0);
        squares += pow(exp((double)-depths[i]) - exp(-expected), 2) / NUM_RAYS;
        mean += expected / NUM_RAYS;
    }
    printf("# cloud of mean depth %.3g: transmittance to %.3g rms\n", mean, sqrt(squares));
    assert_true(mean > 0.3 && sqrt(squares) < 1e-3);
    scene_close(&s);
    karst_oracle_destroy(oracle);
    karst_world_file_destroy(land);
}

#define LARGE_CLOUD                                                                                           \
    "medium air(vec3 p) { medium m; m.extinction = 0.03 * (fbm(p / 384.0, 7) - 0.08 - dot(p, p) / 5000000.0); " \
    "return m; }"

/* The mean depth of a cloud, most of which is air, does not depend on the level that it is seen at, from its finest
 * octave to its coarsest. */
static void test_levels(void **state)
{
    (void)state;
    karst_ray rays[NUM_RAYS];
    float depths[NUM_RAYS];
    scene s;
    double finest = 0;
    karst_world_file *land = compile(LARGE_CLOUD);
    scene_open(&s, contexts[0], land, 16, NULL);
    for (int level = 0; level <= 6; level++) {
        double mean = 0;
        random_rays(rays, 400, level, 3);
        settle(&s, rays, depths);
        for (uint32_t i = 0; i < NUM_RAYS; i++)
            mean += (double)depths[i] / NUM_RAYS;
        finest = level ? finest : mean;
        printf("# level %d: mean depth %.5g, %+.2f %%\n", level, mean, 100 * (mean / finest - 1));
        assert_true(fabs(mean / finest - 1) < 0.03);
    }
    scene_close(&s);
    karst_world_file_destroy(land);
}

/* Lanes, and the shape of the kernels that make bricks, leave no trace; nor do the eight bricks of a mean. */
static void test_same_bits(void **state)
{
    (void)state;
    karst_ray rays[NUM_RAYS];
    float depths[4][NUM_RAYS];
    const karst_world_build builds[] = {{.shape = KARST_SHAPE_AUTO},
                                        {.shape = KARST_SHAPE_AUTO, .in_two_steps = true},
                                        {.shape = KARST_SHAPE_GROUPS}};
    karst_world_file *land = compile(CLOUD);
    random_rays(rays, 120, 3, 3);
    for (int i = 0; i < 4; i++) {
        scene s;
        scene_open(&s, contexts[i == 3], land, 16, i < 3 ? &builds[i] : NULL);
        settle(&s, rays, depths[i]);
        scene_close(&s);
        assert_memory_equal(depths[i], depths[0], sizeof depths[0]);
    }
    karst_world_file_destroy(land);
}

/* A medium that is the same everywhere: to the last bits but for rounding of sums, at every level. */
static void test_uniform(void **state)
{
    (void)state;
    karst_ray rays[NUM_RAYS];
    float depths[NUM_RAYS];
    scene s;
    karst_world_file *land = compile("medium air(vec3 p) { medium m; m.extinction = 0.005; return m; }");
    scene_open(&s, contexts[0], land, 16, NULL);
    for (int level = 3; level <= 6; level += 3) {
        random_rays(rays, 120, level, 3);
        settle(&s, rays, depths);
        for (uint32_t i = 0; i < NUM_RAYS; i++)
            assert_true(fabs((double)depths[i] / (0.005 * 480) - 1) < 1e-6);
    }
    scene_close(&s);
    karst_world_file_destroy(land);
}

/* What is negative or no number counts as nothing, and is counted. */
static void test_strange_values(void **state)
{
    (void)state;
    karst_ray rays[NUM_RAYS];
    float depths[NUM_RAYS];
    static const struct {
        const char *value;
        bool is_negative, is_bad;
    } cases[] = {
        {"p.x > 40.0 ? -3.0 : -2.0 + p.y * 0.0001", true, false},
        {"1e38 * (p.y * p.y + 1.0) * 1e38", false, true},
        {"1.0 / (p.x - p.x)", false, true},
    };
    random_rays(rays, 60, 2, 3);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[256];
        uint64_t num_negative, num_lost;
        scene s;
        snprintf(text, sizeof text, "medium air(vec3 p) { medium m; m.extinction = %s; return m; }", cases[i].value);
        karst_world_file *land = compile(text);
        scene_open(&s, contexts[0], land, 16, NULL);
        settle(&s, rays, depths);
        for (uint32_t k = 0; k < NUM_RAYS; k++)
            assert_true(depths[k] == 0);
        karst_density_producer_thin(s.sources[1].producer, &num_negative, &num_lost);
        /* Where bounds prove that there is nothing, no sample is taken. */
        if ((karst_density_producer_non_finite(s.sources[1].producer) > 0) != cases[i].is_bad)
            fail_msg("%s: %s", cases[i].value, cases[i].is_bad ? "was not counted" : "is no number");
        scene_close(&s);
        karst_world_file_destroy(land);
    }
    /* Partly negative: samples are taken where it changes. */
    uint64_t num_negative, num_lost;
    scene s;
    karst_world_file *land = compile(CLOUD);
    scene_open(&s, contexts[0], land, 16, NULL);
    settle(&s, rays, depths);
    karst_density_producer_thin(s.sources[1].producer, &num_negative, &num_lost);
    assert_true(num_negative > 1000 && num_lost == 0);
    scene_close(&s);
    karst_world_file_destroy(land);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_closed_forms), cmocka_unit_test(test_cells),
                                       cmocka_unit_test(test_cloud),
                                       cmocka_unit_test(test_levels),       cmocka_unit_test(test_same_bits),
                                       cmocka_unit_test(test_uniform),      cmocka_unit_test(test_strange_values)};
    karst_error error = {0};
    for (int i = 0; i < 2; i++) {
        contexts[i] = karst_context_create(getenv("KARST_DEVICE"), i ? 1 : 0, NULL, &error);
        expect(contexts[i], "context", &error);
    }
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    for (int i = 0; i < 2; i++)
        karst_context_destroy(contexts[i]);
    return failed;
}
