/* Clear matter in pictures: where rays go through it, against long double; what is lost; that nothing else is. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/scene.h"

enum { WIDTH = 48, HEIGHT = 48, NUM = WIDTH * HEIGHT };

/* A wall behind what there is of clear matter gives off light that says where it was seen. The sun's glow in the sky
 * is nothing beside it. */
#define HEAD                                                                                                     \
    "/*{ \"voxel\": 0.00390625, \"view\": 60, \"sun\": { \"azimuth\": 0, \"elevation\": -90 },\n"                 \
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"                              \
    "\"params\": { \"body\": { \"value\": 3, \"min\": 0, \"max\": 5 },\n"                                         \
    "\"absorption\": { \"value\": 0, \"min\": 0, \"max\": 1 } },\n"                                               \
    "\"camera\": { \"position\": [\"0\", \"0\", \"-4\"], \"fov\": 30 } }*/\n"
#define WALL "float density(vec3 p) { return p.z - 8.0; }\n" LIGHT
#define LIGHT                                                                               \
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0);\n"                \
    "    m.emission = 1000.0 * vec3(p.x + 30.0, p.y + 30.0, 30.0); return m; }\n"
#define WALL_Z 8.0L
#define EYE_Z (-4.0L)

typedef struct {
    float light[3 * NUM];
    uint8_t bytes[4 * NUM];
    karst_stats stats;
} picture;

static karst_engine *create(const char *text, const karst_engine_config *like)
{
    return scene_create(text, like, WIDTH, HEIGHT, NULL);
}

static void settle(karst_engine *engine, picture *p)
{
    scene_settle(engine, 600, p->light, 3 * NUM, &p->stats);
    assert_ok(karst_engine_read_pixels(engine, p->bytes, sizeof p->bytes, &error));
}

static void take(const char *text, const karst_engine_config *config, picture *p)
{
    karst_engine *engine = create(text, config);
    settle(engine, p);
    karst_engine_destroy(engine);
}

static picture one, other;

/* ---- rays in long double ---- */

typedef struct {
    long double x, y, z;
} vec;

static vec add(vec a, vec b, long double scale)
{
    return (vec){a.x + scale * b.x, a.y + scale * b.y, a.z + scale * b.z};
}
static long double dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static vec unit(vec a) { return add((vec){0, 0, 0}, a, 1 / sqrtl(dot(a, a))); }

/* Snell's law; the normal looks against the ray. false: all is reflected. *share becomes what goes through. */
static bool refract(vec *d, vec n, long double ratio, long double *share)
{
    const long double ci = -dot(*d, n), square = 1 - ratio * ratio * (1 - ci * ci);
    if (square <= 0)
        return false;
    const long double ct = sqrtl(square);
    const long double rs = (ratio * ci - ct) / (ratio * ci + ct), rp = (ratio * ct - ci) / (ratio * ct + ci);
    *share = 1 - (rs * rs + rp * rp) / 2;
    *d = unit(add(add((vec){0, 0, 0}, *d, ratio), n, ratio * ci - ct));
    return true;
}

/* Where a ray meets a sphere around the origin; the nearer place or the farther one. */
static bool meet_sphere(vec o, vec d, long double radius, bool far, long double *t)
{
    const long double b = dot(o, d), square = b * b - dot(o, o) + radius * radius;
    if (square <= 0)
        return false;
    *t = -b + (far ? sqrtl(square) : -sqrtl(square));
    return true;
}

/* Bodies of index 1.5 around the origin: a slab that is turned; a wedge; a sphere; a sphere with a hollow core of half
 * its radius. `way`: how far the ray went inside. */
typedef enum { SLAB, PRISM, BALL, HOLLOW } body;

static const vec slab_normal = {0.5L, 0, -0.8660254037844386467637231707529362L};
static const vec prism_back = {0.258819045102520762348898837624048328L, 0, 0.965925826289068286749743199728897368L};

static bool cross_plane(vec *o, vec d, vec n, long double height)
{
    const long double t = (height - dot(*o, n)) / dot(d, n);
    *o = add(*o, d, t);
    return t > 0;
}

static vec towards(vec n, vec d) { return dot(n, d) > 0 ? add((vec){0, 0, 0}, n, -1) : n; }

static bool through(body b, vec *o, vec *d, long double *share, long double *way)
{
    const long double into = 1 / 1.5L, out = 1.5L;
    long double later, t;
    vec start;
    *way = 0;
    switch (b) {
    case SLAB:
        cross_plane(o, *d, slab_normal, 0.25L);
        start = *o;
        if (!refract(d, towards(slab_normal, *d), into, share))
            return false;
        cross_plane(o, *d, slab_normal, -0.25L);
        *way = sqrtl(dot(add(*o, start, -1), add(*o, start, -1)));
        return refract(d, towards(slab_normal, *d), out, &later);
    case PRISM:
        cross_plane(o, *d, (vec){0, 0, -1}, 0.25L);
        start = *o;
        if (!refract(d, (vec){0, 0, -1}, into, share))
            return false;
        cross_plane(o, *d, prism_back, 0.25L);
        *way = sqrtl(dot(add(*o, start, -1), add(*o, start, -1)));
        return refract(d, towards(prism_back, *d), out, &later);
    case BALL:
    case HOLLOW:
        if (!meet_sphere(*o, *d, 1, false, &t))
            return false;
        *o = add(*o, *d, t);
        if (!refract(d, unit(*o), into, share))
            return false;
        if (b == HOLLOW && meet_sphere(*o, *d, 0.5L, false, &t)) {
            *o = add(*o, *d, t);
            *way += t;
            if (!refract(d, unit(*o), out, &later))
                return false;
            meet_sphere(*o, *d, 0.5L, true, &t);
            *o = add(*o, *d, t);
            if (!refract(d, towards(unit(*o), *d), into, &later))
                return false;
        }
        meet_sphere(*o, *d, 1, true, &t);
        *o = add(*o, *d, t);
        *way += t;
        return refract(d, towards(unit(*o), *d), out, &later);
    }
    return false;
}

static vec pixel_ray(int x, int y)
{
    const long double half = tanl(15 * 3.14159265358979323846264338327950288L / 180);
    return unit((vec){((x + 0.5L) * 2 / WIDTH - 1) * half, (1 - (y + 0.5L) * 2 / HEIGHT) * half, 1});
}

/* How far the rays that the picture's pixels saw the wall by are from the true ones, in radians, at worst and in the
 * middle of the list; of pixels that are `within` so much of the picture's middle. */
static int compare(const void *a, const void *b)
{
    const long double d = *(const long double *)a - *(const long double *)b;
    return d < 0 ? -1 : d > 0;
}

static int measure(body b, const picture *p, int within, long double *worst, long double *median,
                   long double absorption)
{
    static long double off[NUM];
    int num = 0;
    for (int y = HEIGHT / 2 - within; y < HEIGHT / 2 + within; y++)
        for (int x = WIDTH / 2 - within; x < WIDTH / 2 + within; x++) {
            vec o = {0, 0, EYE_Z}, d = pixel_ray(x, y);
            long double share = 1, way;
            if (!through(b, &o, &d, &share, &way) || d.z < 0.3L)
                continue;
            /* Nearer to a ball's rim what is reflected meets the wall, too. */
            if (b >= BALL && hypot(x + 0.5 - WIDTH / 2, y + 0.5 - HEIGHT / 2) > 14)
                continue;
            const long double t = (WALL_Z - o.z) / d.z;
            const vec wall = add(o, d, t);
            const float *light = p->light + 3 * (y * WIDTH + x);
            const long double weight = (long double)light[2] / 30000;
            /* What is seen is right to within the rest of a voxel; and the light that is left. */
            const long double seen_x = (long double)light[0] / weight / 1000 - 30,
                              seen_y = (long double)light[1] / weight / 1000 - 30;
            if (absorption > 0)
                share *= expl(-absorption * way);
            if (fabsl(weight - share) > 2e-3L)
                fail_msg("pixel %d,%d: %.5Lf of the light is left, not %.5Lf", x, y, weight, share);
            /* Across the ray, seen from where it left. */
            const vec apart = {seen_x - wall.x, seen_y - wall.y, 0};
            const vec across = add(apart, d, -dot(apart, d));
            off[num++] = sqrtl(dot(across, across)) / t;
        }
    qsort(off, (size_t)num, sizeof *off, compare);
    *worst = off[num - 1];
    *median = off[num / 2];
    return num;
}

/* All of them in one text, so that it is compiled once; by itself it is the hollow ball. Beyond 3 a cube on the ground,
 * which goes on in that by what is beyond 4. */
static const char bodies_text[] = HEAD
    "float density(vec3 p) { return body > 3.5 ? max(p.z - 8.0, -1.0 - p.y) : p.z - 8.0; }\n" LIGHT
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; m.absorption = vec3(absorption); return m; }\n"
    "float clear(vec3 p) {\n"
    "    float d = 0.25 - abs(dot(p, vec3(0.5, 0.0, -0.8660254037844386)));\n"
    "    if (body > 0.5) d = min(0.25 + p.z, 0.25 - dot(p, vec3(0.25881904510252074, 0.0, 0.9659258262890683)));\n"
    "    if (body > 1.5) d = 1.0 - length(p);\n"
    "    if (body > 2.5) d = min(1.0 - length(p), length(p) - 0.5);\n"
    "    if (body > 3.5) d = min(1.0 - max(abs(p.x), abs(p.z)), min(1.0 - p.y, p.y + body - 3.0));\n"
    "    return d;\n"
    "}\n";

static void rays_leave_bodies_where_they_should(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        body body;
        int within;
        long double most, absorption;
    } bodies[] = {{"slab", SLAB, 20, 1e-6L, 0},
                  {"prism", PRISM, 20, 1e-6L, 0},
                  {"ball", BALL, 14, 1e-6L, 0},
                  {"hollow ball", HOLLOW, 6, 1e-6L, 0},
                  {"green ball", BALL, 14, 1e-5L, 0.7L}};
    for (size_t i = 0; i < sizeof bodies / sizeof *bodies; i++) {
        long double worst, median;
        const karst_parameter parameters[] = {{"body", bodies[i].body}, {"absorption", (double)bodies[i].absorption}};
        const karst_engine_config config = {.bounces = 8, .parameters = parameters, .num_parameters = 2};
        take(bodies_text, &config, &one);
        const int num = measure(bodies[i].body, &one, bodies[i].within, &worst, &median, bodies[i].absorption);
        print_message("%s: %d rays, off by %.2Lg rad at most, %.2Lg in the middle\n", bodies[i].name, num, worst,
                      median);
        assert_true(num > 100);
        assert_true(worst < bodies[i].most);
    }
}

/* A cube that touches the ground, face on face, shows it as one does that goes on in it: there is no air between. */
static void what_touches_is_seen_through_clear_matter(void **state)
{
    (void)state;
    const bool full = getenv("KARST_TEST_FULL") != NULL;
    for (int lanes = 16; lanes; lanes = lanes == 16 && full ? 1 : 0)
        for (int paths = 0; paths <= full; paths++) {
            int num_off = 0;
            karst_parameter parameters[] = {{"body", 4}, {"absorption", 0}};
            const karst_engine_config config = {.integrator = paths ? KARST_INTEGRATOR_FULL : KARST_INTEGRATOR_DIRECT,
                                                .lanes = lanes,
                                                .parameters = parameters,
                                                .num_parameters = 2};
            take(bodies_text, &config, &one);
            parameters[0].value = 4.25;
            take(bodies_text, &config, &other);
            for (int i = 0; i < 3 * NUM; i++)
                num_off += fabsf(one.light[i] - other.light[i]) > 0.02f * other.light[i];
            print_message("on the ground, %d lanes: %d values are not as those of one that goes on in it\n", lanes,
                          num_off);
            assert_true(num_off <= 3 * NUM / 100); /* its edges */
        }
}

/* A shell of land all around that gives off as much light everywhere. */
#define UNIFORM                                                                                  \
    "/*{ \"voxel\": 0.015625, \"view\": 60, \"sun\": { \"azimuth\": 0, \"elevation\": -90 },\n"   \
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"              \
    "\"params\": { \"body\": { \"value\": 0, \"min\": 0, \"max\": 4 } },\n"                              \
    "\"camera\": { \"position\": [\"0\", \"0\", \"-4\"], \"fov\": 40 } }*/\n"                    \
    "float density(vec3 p) { return length(p) - 20.0; }\n"                                       \
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0); m.emission = vec3(0.5); return m; }\n" \
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; return m; }\n"
static const char furnaces[] = UNIFORM
    "float clear(vec3 p) {\n"
    "    vec3 q = abs(vec3(0.8 * p.x + 0.6 * p.z, p.y, 0.8 * p.z - 0.6 * p.x));\n"
    "    float d = 1.0 - length(p);\n"
    "    if (body > 0.5) d = min(1.0 - length(p), length(p) - 0.5);\n"
    "    if (body > 1.5) d = 0.7 - max(q.x, max(q.y, q.z));\n"
    "    if (body > 2.5) d = 0.35 - length(vec2(length(p.xy) - 0.9, p.z));\n"
    "    if (body > 3.5) d = 6.0 - length(p);\n" /* the eye is in it */
    "    return d;\n"
    "}\n";
enum { NUM_FURNACES = 5 };

/* Clear matter that absorbs nothing is invisible where all directions are as bright. */
static void nothing_is_lost_or_added(void **state)
{
    (void)state;
    for (int i = 0; i < NUM_FURNACES; i++)
        for (uint32_t samples = 1; samples <= (getenv("KARST_TEST_FULL") ? 4 : 1); samples += 3) {
            const karst_parameter parameter = {"body", i};
            const karst_engine_config config = {
                .samples = samples, .bounces = 256, .parameters = &parameter, .num_parameters = 1};
            int num_off = 0;
            take(furnaces, &config, &one);
            for (int k = 0; k < 3 * NUM; k++)
                num_off += fabsf(one.light[k] / 0.5f - 1) > 1.0f / 255;
            print_message("furnace %d, %u samples: %d values are off, %d rays, %d cut off\n", i, samples, num_off,
                          (int)one.stats.num_rays[KARST_STREAM_CLEAR], (int)one.stats.num_rays_cut);
            assert_true(one.stats.num_rays[KARST_STREAM_CLEAR] > 200);
            assert_int_equal(num_off, 0);
        }
}

/* Nor is it seen where rays are cut off: they see what lies behind. Elsewhere the sky is black here. */
static void rays_that_are_cut_off_see_what_lies_behind(void **state)
{
    (void)state;
    for (int i = 0; i < NUM_FURNACES - 1; i++) {
        const karst_parameter parameter = {"body", i};
        const karst_engine_config config = {.bounces = 1, .parameters = &parameter, .num_parameters = 1};
        int num_off = 0;
        take(furnaces, &config, &one);
        for (int k = 0; k < 3 * NUM; k++)
            num_off += fabsf(one.light[k] / 0.5f - 1) > 1.0f / 255;
        print_message("furnace %d, 1 bounce: %d values are off, %d rays are cut off\n", i, num_off,
                      (int)one.stats.num_rays_cut);
        assert_true(one.stats.num_rays_cut > 100);
        assert_int_equal(num_off, 0);
    }
}

/* The same bits with 16 lanes and with 1, and whatever was looked at before. */
static void pictures_depend_on_the_view_alone(void **state)
{
    (void)state;
    for (uint32_t samples = 1; samples <= 3; samples += 2) {
        karst_engine_config config = {.samples = samples};
        take(bodies_text, &config, &one);
        config.lanes = 1;
        take(bodies_text, &config, &other);
        assert_memory_equal(one.light, other.light, sizeof one.light);
        config.lanes = 0;
        karst_engine *engine = create(bodies_text, &config);
        karst_camera camera = karst_engine_default_camera(engine), back = camera;
        back.yaw_deg = 25;
        assert_ok(karst_engine_set_camera(engine, &back, &error));
        settle(engine, &other);
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
        settle(engine, &other);
        assert_memory_equal(one.light, other.light, sizeof one.light);
        karst_engine_destroy(engine);
    }
}

/* Fewer bounces cut rays off, and say how many. */
static void what_is_cut_off_is_counted(void **state)
{
    (void)state;
    karst_engine_config config = {.bounces = 1};
    take(bodies_text, &config, &one);
    assert_true(one.stats.num_rays_cut > 300);
    config.bounces = 12;
    take(bodies_text, &config, &other);
    print_message("of 1 bounce %d rays are cut off, of 12 %d\n", (int)one.stats.num_rays_cut,
                  (int)other.stats.num_rays_cut);
    assert_true(other.stats.num_rays_cut < one.stats.num_rays_cut / 20);
    karst_error error = {0};
    config.bounces = KARST_ENGINE_MAX_BOUNCES + 1;
    config.world = "hills";
    assert_null(karst_engine_create(&config, &error));
    assert_int_equal(error.status, KARST_USAGE);
}

/* A pool of water with land under it, or a ball of glass around the eye. */
static const char water[] =
    "/*{ \"voxel\": 0.015625, \"view\": 60, \"sun\": { \"azimuth\": 60, \"elevation\": 40 },\n"
    "\"sky\": { \"zenith\": [0.1, 0.2, 0.4], \"horizon\": [0.4, 0.5, 0.6], \"haze\": 1e12 },\n"
    "\"camera\": { \"position\": [\"0\", \"1\", \"-4\"], \"pitch\": 15, \"fov\": 70 },\n"
    "\"params\": { \"ball\": { \"value\": 0, \"min\": 0, \"max\": 2 } } }*/\n"
    "float density(vec3 p) { return 0.4 * sin(p.x) * sin(0.7 * p.z) - p.y; }\n"
    "float clear(vec3 p) { return ball > 1.5 ? sqrt(-1.0 - p.x * p.x) :\n"
    "    ball > 0.5 ? 2.0 - length(p - vec3(0.0, 1.0, -4.0)) :\n"
    "    2.0 + 0.05 * sin(3.0 * p.x + p.z) - p.y; }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.absorption = vec3(0.1, 0.04, 0.03); return m; }\n";

/* Eyes: in water, looking up; on its surface, to a millimetre; over it, looking down to its floor; in glass. */
static const struct {
    const char *name, *height;
    double ball, pitch_deg;
} eyes[] = {{"in water", "1", 0, 15},
            {"on water", "2.0378", 0, -10},
            {"over water", "3", 0, -40},
            {"in glass", "1", 1, 5}};
enum { NUM_EYES = sizeof eyes / sizeof *eyes, OVER_WATER = 2 };

static void look_with(karst_engine *engine, int eye, picture *p, float depths[NUM])
{
    const karst_parameter ball = {"ball", eyes[eye].ball};
    karst_camera camera = karst_engine_default_camera(engine);
    assert_ok(karst_position_parse("0", eyes[eye].height, "-4", karst_engine_voxel_log2_m(engine), &camera.position,
                                   &error));
    camera.pitch_deg = eyes[eye].pitch_deg;
    assert_ok(karst_engine_set_parameters(engine, &ball, 1, &error));
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
    settle(engine, p);
    assert_ok(karst_engine_read_depth(engine, depths, NUM, &error));
}

/* No hole is seen, and the floor of the lake is where it was, to some voxels of the level that there is. */
static void eyes_see_no_holes_in_pools_of_any_size(void **state)
{
    (void)state;
    static float truth[NUM_EYES][NUM], depths[NUM];
    static picture best[NUM_EYES];
    const karst_engine_config large = {.samples = 1, .tone = KARST_TONE_OF_FILM};
    uint32_t all = 0, tiles = 0;
    karst_engine *engine = create(water, &large);
    for (int eye = 0; eye < NUM_EYES; eye++) {
        look_with(engine, eye, &best[eye], truth[eye]);
        const uint32_t land = (uint32_t)best[eye].stats.bricks.num_used,
                       clear = (uint32_t)best[eye].stats.stores[0].bricks.num_used;
        all = land > all ? land : all, all = 2 * clear > all ? 2 * clear : all;
        tiles = best[eye].stats.tiles.num_used > tiles ? (uint32_t)best[eye].stats.tiles.num_used : tiles;
    }
    /* What is no number is no matter. */
    const karst_parameter no_number = {"ball", 2};
    assert_ok(karst_engine_set_parameters(engine, &no_number, 1, &error));
    settle(engine, &other);
    assert_int_equal(other.stats.num_rays[KARST_STREAM_CLEAR], 0);
    for (int k = 0; k < 3 * NUM; k++)
        assert_true(isfinite(other.light[k]) && other.light[k] > 0);
    karst_engine_destroy(engine);
    static const uint32_t percents[] = {100, 50, 25, 10};
    double worst_px = 0;
    for (int i = 0; i < 4; i++) {
        const karst_engine_config small = {.num_bricks = 34 + all * percents[i] / 100,
                                           .num_tiles = 48 + tiles * percents[i] / 100,
                                           .tone = KARST_TONE_OF_FILM};
        engine = create(water, &small);
        for (int eye = 0; eye < NUM_EYES; eye++) {
            int num_black = 0, num_lost = 0;
            look_with(engine, eye, &other, depths);
            const double given_px = other.stats.detail_given_px;
            for (int k = 0; k < NUM; k++) {
                num_black += other.light[3 * k] + other.light[3 * k + 1] + other.light[3 * k + 2] <= 0;
                const double off = fabs((double)depths[k] - truth[eye][k]), m = truth[eye][k];
                num_lost += eye == OVER_WATER && !(off < 0.05 + 8 * given_px * m / HEIGHT);
            }
            print_message("%u %%, %s: %.2f px, %d pixels are black, of %d the floor is lost\n", percents[i],
                          eyes[eye].name, given_px, num_black, num_lost);
            assert_int_equal(num_black, 0);
            assert_int_equal(num_lost, 0);
            if (percents[i] == 100)
                assert_memory_equal(best[eye].light, other.light, sizeof other.light);
            worst_px = fmax(worst_px, given_px);
        }
        karst_engine_destroy(engine);
    }
    assert_true(worst_px > 1);
}

/* A cube whose faces lie on samples and between nodes: on one side of them matter whose last samples are 0, on the
 * other air that is known without a look. It shows what one a hair larger does. */
static void faces_between_nodes_are_met_from_within(void **state)
{
    (void)state;
    static const char text[] =
        HEAD WALL "float clear(vec3 p) { return %s - max(max(abs(p.x - 0.5), abs(p.y - 0.5)), abs(p.z)); }\n"
                  "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; return m; }\n";
    const karst_engine_config config = {.exposure = KARST_EXPOSURE_GIVEN};
    char cube[sizeof text + sizeof HEAD];
    for (int lanes = 16; lanes; lanes = lanes == 16 && getenv("KARST_TEST_FULL") ? 1 : 0) {
        karst_engine_config like = config;
        like.lanes = lanes;
        snprintf(cube, sizeof cube, text, "1.0");
        take(cube, &like, &one);
        snprintf(cube, sizeof cube, text, "1.0001");
        take(cube, &like, &other);
        int num_off = 0, num_bent = 0;
        for (int i = 0; i < NUM; i++) {
            /* what is seen of the wall is where the ray meets it */
            const float *a = one.light + 3 * (size_t)i, *b = other.light + 3 * (size_t)i;
            num_off += fabsf(a[0] - b[0]) > 0.02f * b[0] || fabsf(a[1] - b[1]) > 0.02f * b[1];
            const double straight = 12 * tan(0.2617993877991494) * ((i % WIDTH + 0.5) / (WIDTH / 2.0) - 1);
            num_bent += fabs(30.0 * (double)a[0] / (double)a[2] - 30 - straight) > 0.1;
        }
        print_message("a cube, %d lanes: of %d pixels %d are bent, %d are not as those of one 0.1 mm larger\n", lanes,
                      NUM, num_bent, num_off);
        assert_true(num_bent > NUM / 8);
        assert_true(num_off <= NUM / 50); /* its edges */
    }
}

/* Cubes that share faces, which lie on samples, some of them between nodes: they are as one body. */
static void bodies_that_share_faces_are_one(void **state)
{
    (void)state;
    static const char text[] =
        HEAD WALL "float clear(vec3 p) { vec3 q = abs(p - vec3(0.25, 0.0, 0.0)); if (body > 0.5) q = abs(q - 0.5);\n"
                  "    return (body > 0.5 ? 0.5 : 1.0) - max(q.x, max(q.y, q.z)); }\n"
                  "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; return m; }\n";
    int num_off = 0;
    karst_parameter shared = {"body", 0};
    const karst_engine_config config = {.parameters = &shared, .num_parameters = 1};
    take(text, &config, &one);
    shared.value = 1;
    take(text, &config, &other);
    for (int i = 0; i < NUM; i++)
        num_off += fabsf(one.light[3 * i] - other.light[3 * i]) > 0.02f * one.light[3 * i];
    print_message("eight cubes: of %d pixels %d are not as those of one\n", NUM, num_off);
    assert_true(num_off <= NUM / 500);
}

/* Stripes on the wall, which a ball shows about as wide as they are, turned round: rays narrow in it. A pane does
 * nothing to them. How bright and dark they are in the picture's middle. */
static void stripes_are_seen_behind_glass(void **state)
{
    (void)state;
    static const char text[] =
        HEAD "float density(vec3 p) { return p.z - 8.0; }\n"
             "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0);\n"
             "    m.emission = vec3(0.5 + 0.5 * sin(p.x * 12.0)); return m; }\n"
             "float clear(vec3 p) { return body < 0.5 ? -1.0 : body < 1.5 ? 1.0 - length(p) :\n"
             "    0.125 - max(abs(p.z), max(abs(p.x), abs(p.y)) - 2.0); }\n"
             "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; return m; }\n";
    float contrast[3];
    karst_parameter shown = {"body", 0};
    const karst_engine_config config = {.parameters = &shown, .num_parameters = 1};
    for (int i = 0; i < 3; i++) {
        float least = 1, most = 0;
        shown.value = i;
        take(text, &config, &one);
        for (int k = 0; k < NUM; k++)
            if (abs(k % WIDTH - WIDTH / 2) < 6 && abs(k / WIDTH - HEIGHT / 2) < 3) {
                least = fminf(least, one.light[3 * k]);
                most = fmaxf(most, one.light[3 * k]);
            }
        contrast[i] = most - least;
    }
    print_message("stripes: %.3f, behind a ball %.3f, behind a pane %.3f\n", (double)contrast[0],
                  (double)contrast[1], (double)contrast[2]);
    assert_true(contrast[1] > 0.8f * contrast[0]);
    assert_true(contrast[2] > 0.9f * contrast[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rays_leave_bodies_where_they_should),
        cmocka_unit_test(what_touches_is_seen_through_clear_matter),
        cmocka_unit_test(nothing_is_lost_or_added),
        cmocka_unit_test(rays_that_are_cut_off_see_what_lies_behind),
        cmocka_unit_test(pictures_depend_on_the_view_alone),
        cmocka_unit_test(what_is_cut_off_is_counted),
        cmocka_unit_test(eyes_see_no_holes_in_pools_of_any_size),
        cmocka_unit_test(faces_between_nodes_are_met_from_within),
        cmocka_unit_test(bodies_that_share_faces_are_one),
        cmocka_unit_test(stripes_are_seen_behind_glass),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
