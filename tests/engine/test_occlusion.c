/* Occlusion: against many rays, closed forms, and what it may not depend on. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/engine/engine_parts.h"
#include "karst/karst.h"
#include "raycast/light/openness.h"
#include "tests/support/ok.h"

enum { WIDTH = 96, HEIGHT = 72, NUM = WIDTH * HEIGHT };
enum { TRUE_WIDTH = 320, TRUE_HEIGHT = 240, TRUE_NUM = TRUE_WIDTH * TRUE_HEIGHT }; /* beside many rays */
enum { BOUND_WIDTH = 40, BOUND_HEIGHT = 30, SMALL_BOUND_WIDTH = 16, BOUND_NUM = BOUND_WIDTH * BOUND_HEIGHT };

static karst_engine_config base_config(const char *world)
{
    return (karst_engine_config){.world = world,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = WIDTH,
                                 .height_px = HEIGHT,
                                 .occlusion = KARST_OCCLUSION_ON,
                                 .exposure = KARST_EXPOSURE_GIVEN,
                                 .pool_bytes = (uint64_t)64 << 20};
}

static karst_engine *create(const karst_engine_config *config)
{
    karst_error error = {0};
    karst_engine *engine = karst_engine_create(config, &error);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

typedef struct {
    float open[TRUE_NUM], light[3 * TRUE_NUM], depth[TRUE_NUM], normal[3 * TRUE_NUM];
    float bounds[3 * BOUND_NUM]; /* where they are asked for: the least, the most, the likely one */
    karst_stats stats;
} picture;

static void settle(karst_engine *engine, picture *p)
{
    bool settled = false;
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    karst_engine_stats(engine, &p->stats);
    assert_true(settled);
    const size_t num = (size_t)engine->width_px * (size_t)engine->height_px;
    assert_ok(karst_engine_read_radiance(engine, p->light, 3 * num, &error));
    assert_ok(karst_engine_read_aov(engine, KARST_AOV_DEPTH, p->depth, num, &error));
    assert_ok(karst_engine_read_aov(engine, KARST_AOV_NORMAL, p->normal, 3 * num, &error));
    if (engine->occlusion)
        assert_ok(karst_engine_read_aov(engine, KARST_AOV_OCCLUSION, p->open, num, &error));
}

static void take(const karst_engine_config *config, picture *p)
{
    karst_engine *engine = create(config);
    settle(engine, p);
    karst_engine_destroy(engine);
}

static picture one, other;

/* A world's text in a file that goes again. */
static void write_world(const char *text, char path[64])
{
    snprintf(path, 64, "/tmp/karst-occlusion-XXXXXX.karst");
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
}

/* One world, since each takes seconds to compile: a slope, above it a court on a thick floor, above that a closed box.
 * None sees another, as views end after 400 m. In red light all but the box is white. */
enum { COURT_M = 600, BOX_M = 1200 };
static const char stage[] =
    "/*{ \"voxel\": 0.015625, \"view\": 400, \"sun\": { \"azimuth\": 60, \"elevation\": 40 }, \"occlusion\": true,\n"
    "\"sky\": { \"zenith\": [1, 1, 1], \"horizon\": [1, 1, 1], \"haze\": 1e12 },\n"
    "\"camera\": { \"position\": [\"0\", \"601.5\", \"-5\"], \"pitch\": -12, \"fov\": 70 } }*/\n"
    "vec3 colour(vec3 p, vec3 n) { return vec3(p.y < 900.0 ? 1.0 : 0.5, 0.25, 0.1); }\n"
    "float density(vec3 p) {\n"
    "    vec3 c = p - vec3(0.0, 600.0, 0.0);\n"
    "    float wall = min(min(c.z - 1.0, 3.0 - c.z), 3.0 - abs(c.y));\n"
    "    float ball = 0.8 - length(c - vec3(-1.5, 1.2, -0.5));\n"
    "    float pit = 1.0 - length(c - vec3(2.0, 0.0, -1.5));\n"
    "    float court = min(max(max(min(-c.y, -pit), wall), ball), c.y + 10.0);\n"
    "    vec3 q = abs(p - vec3(0.0, 1201.0, 0.0));\n"
    "    float box = min(max(max(q.x, q.y), q.z) - 6.0, 9.0 - max(max(q.x, q.y), q.z));\n"
    "    return max(max(-p.y - 0.3 * p.x, court), box);\n"
    "}\n";

static char stage_path[64];

static int write_stage(void **state)
{
    (void)state;
    write_world(stage, stage_path);
    return 0;
}

static int remove_stage(void **state)
{
    (void)state;
    return unlink(stage_path);
}

/* As take, so many metres above the court. */
static void take_above(const karst_engine_config *config, int up_m, picture *p)
{
    karst_engine *engine = create(config);
    karst_camera camera = karst_engine_default_camera(engine);
    camera.position.voxel[1] += up_m * 64;
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
    settle(engine, p);
    karst_engine_destroy(engine);
}

/* ---- against many rays ---- */

enum { TRUE_RAYS = 4096, AT_ONCE = 16 };

/* Rays with a cosine's density about a normal: as a lattice with the golden section has them. */
static void true_rays(karst_ray *rays, const float origin[3], const float n[3], float width, float t_max)
{
    const double up[3] = {n[0], n[1], n[2]};
    const int axis = fabs(up[0]) < 0.7 ? 0 : 1;
    double a[3], b[3], along = up[axis], length = 0;
    for (int i = 0; i < 3; i++) {
        a[i] = (i == axis) - along * up[i];
        length += a[i] * a[i];
    }
    for (int i = 0; i < 3; i++)
        a[i] /= sqrt(length);
    for (int i = 0; i < 3; i++)
        b[i] = up[(i + 1) % 3] * a[(i + 2) % 3] - up[(i + 2) % 3] * a[(i + 1) % 3];
    for (int r = 0; r < TRUE_RAYS; r++) {
        const double square = (r + 0.5) / TRUE_RAYS, turn = 2 * M_PI * 0.61803398874989485 * r;
        const double u = sqrt(square) * cos(turn), v = sqrt(square) * sin(turn), w = sqrt(1 - square);
        rays[r] = (karst_ray){.t_max = t_max, .width = width, .cone = 0.0625f, .side = KARST_SIDE_FRONT};
        double sum = 0, d[3];
        for (int i = 0; i < 3; i++) {
            d[i] = u * a[i] + v * b[i] + w * up[i];
            sum += d[i] * d[i];
        }
        for (int i = 0; i < 3; i++) {
            rays[r].origin[i] = origin[i];
            rays[r].direction[i] = (float)(d[i] / sqrt(sum));
        }
    }
}

/* What they see, once there is what they ask for, as far as the pool has room. */
static void cast_true(karst_engine *engine, karst_buffer *rays, karst_hit *hits, uint32_t num)
{
    karst_cast_view view;
    karst_pinhole pinhole;
    karst_buffer *on_device = karst_buffer_create(engine->context, "hits", num * sizeof *hits, NULL, NULL);
    assert_non_null(on_device);
    for (int round = 0; round < 24; round++) {
        karst_allowance left = {.bricks = 4096, .tiles = 4096, .ns = INFINITY};
        karst_work work;
        karst_engine_next_serial(engine);
        karst_engine_picture_view(engine, &view, &pinhole);
        view.blend_below = KARST_OCCLUSION_BLENDS_BELOW(view.detail);
        assert_ok(karst_cast_rays(engine->caster, &view, rays, num, false, on_device, &error));
        assert_ok(karst_engine_answer_round(engine, &engine->camera.position, &left, &work, &error));
        if (work.num_loads + work.num_subdivides == 0)
            break;
    }
    assert_ok(karst_buffer_read(on_device, 0, hits, num * sizeof *hits, &error));
    karst_buffer_destroy(on_device);
}

typedef struct {
    double square, bias, worst;
    double likely_square; /* of the estimate within its bounds */
    int num, outside;     /* pixels; whose truth the bounds do not hold */
    long proofs, wrong;   /* rays in cells of which something is proved; that are no such rays */
    float widths[BOUND_NUM];
} off_by;

/* What is proved of each cell of directions, in packet order, by the finest ones and by coarse ones: what is proved
 * wrongly of both sides may cancel in a pixel's bounds, and is told best where cells are large. */
enum { NUM_DEPTHS = KARST_OPENNESS_DEPTH + 1 };
static uint8_t proved[NUM_DEPTHS][BOUND_NUM * KARST_OPENNESS_CELLS];

static void prove_cells(karst_engine *engine)
{
    karst_cast_view view;
    karst_pinhole pinhole;
    karst_openness *openness;
    const size_t num = (size_t)engine->width_px * (size_t)engine->height_px;
    karst_buffer *bounds = karst_buffer_create(engine->context, "bounds", 2 * num * sizeof(float), NULL, NULL);
    assert_ok((openness = karst_openness_create(engine->context, karst_cache_get_buffers(engine->cache), &error)));
    karst_engine_picture_view(engine, &view, &pinhole);
    memset(proved, KARST_OPENNESS_UNDECIDED, sizeof proved);
    for (int depth = 0; depth < NUM_DEPTHS; depth++) {
        karst_buffer *cells =
            karst_buffer_create(engine->context, "cells", num * KARST_OPENNESS_CELLS, proved[depth], NULL);
        assert_true(bounds && cells);
        assert_ok(karst_openness_bound(openness, &view, &pinhole, engine->hits, KARST_OCCLUSION_CONE, depth, bounds,
                                       cells, &error));
        assert_ok(karst_buffer_read(cells, 0, proved[depth], num * KARST_OPENNESS_CELLS, &error));
        karst_buffer_destroy(cells);
    }
    karst_buffer_destroy(bounds);
    karst_openness_destroy(openness);
}

/* Which of the finest cells a ray of true_rays lies in; -1: as good as on an edge. */
static int cell_of_ray(int ray)
{
    const double turn = fmod(0.61803398874989485 * ray, 1) * (KARST_OPENNESS_AROUND << KARST_OPENNESS_DEPTH);
    const double up = (1 - (ray + 0.5) / TRUE_RAYS) * KARST_OPENNESS_FINEST_UP;
    return fabs(turn - rint(turn)) < 1e-3 ? -1 : (int)turn * KARST_OPENNESS_FINEST_UP + (int)up;
}

/* What is proved of a pixel's directions, beside its rays. */
static void look_at_proofs(uint32_t place, const karst_hit *hits, off_by *off)
{
    for (int r = 0; r < TRUE_RAYS; r++) {
        const int cell = cell_of_ray(r), is_open = KARST_HIT_KIND(hits[r].kind) == KARST_HIT_MISS;
        for (int depth = 0; depth < NUM_DEPTHS && cell >= 0; depth++) {
            const int found = proved[depth][place * KARST_OPENNESS_CELLS + (uint32_t)cell];
            off->proofs += found != KARST_OPENNESS_UNDECIDED;
            off->wrong += found == (is_open ? KARST_OPENNESS_HIDDEN : KARST_OPENNESS_OPEN);
        }
    }
}

static int by_size(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* A pixel's rays; false: it has none, as it shows no surface. */
static bool aim_true(const karst_engine *engine, int x, int y, const karst_hit *records, karst_ray *rays)
{
    karst_cast_view view;
    karst_pinhole pinhole;
    const int width_px = engine->width_px, height_px = engine->height_px;
    const karst_hit *hit =
        &records[karst_packet_order((uint32_t)x, (uint32_t)y, (uint32_t)width_px, (uint32_t)height_px)];
    const float *n = one.normal + 3 * (y * width_px + x);
    if (KARST_HIT_KIND(hit->kind) != KARST_HIT_SURFACE || !(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] > 0.5f))
        return false;
    karst_engine_picture_view(engine, &view, &pinhole);
    const float voxel_m = exp2f((float)karst_engine_voxel_log2_m(engine));
    const float sx = ((x + 0.5f) * 2 / width_px - 1) * pinhole.half_width,
                sy = (1 - (y + 0.5f) * 2 / height_px) * pinhole.half_height;
    float d[3], origin[3], length = 0;
    for (int i = 0; i < 3; i++) {
        d[i] = pinhole.forward[i] + sx * pinhole.right[i] + sy * pinhole.up[i];
        length += d[i] * d[i];
    }
    for (int i = 0; i < 3; i++)
        origin[i] = d[i] / sqrtf(length) * one.depth[y * width_px + x] / voxel_m;
    const float width = fmaxf(hit->t * pinhole.cone, ldexpf(1.0001f / view.detail, (int)KARST_HIT_LEVEL(hit->kind)));
    true_rays(rays, origin, n, width, pinhole.t_max - hit->t);
    return true;
}

/* The pixels `at`, whose rays those are. */
static void compare_some(karst_engine *engine, const int *at, int num_at, const karst_ray *rays, karst_hit *hits,
                         off_by *off)
{
    const uint32_t num = (uint32_t)(num_at * TRUE_RAYS);
    if (num == 0)
        return;
    karst_buffer *stream = karst_buffer_create(engine->context, "rays", num * sizeof *rays, rays, NULL);
    assert_non_null(stream);
    cast_true(engine, stream, hits, num);
    karst_buffer_destroy(stream);
    for (int i = 0; i < num_at; i++) {
        int misses = 0;
        for (int r = 0; r < TRUE_RAYS; r++)
            misses += KARST_HIT_KIND(hits[i * TRUE_RAYS + r].kind) == KARST_HIT_MISS;
        const double truth = (double)misses / TRUE_RAYS, by = one.open[at[i]] - truth;
        off->square += by * by;
        off->bias += by;
        off->worst = fmax(off->worst, fabs(by));
        if (engine->width_px <= BOUND_WIDTH) {
            const float *bounds = one.bounds + 3 * at[i];
            off->widths[off->num % BOUND_NUM] = bounds[1] - bounds[0];
            off->outside += truth < bounds[0] || truth > bounds[1];
            const uint32_t width = (uint32_t)engine->width_px, height = (uint32_t)engine->height_px;
            const uint32_t place = karst_packet_order((uint32_t)at[i] % width, (uint32_t)at[i] / width, width, height);
            look_at_proofs(place, hits + i * TRUE_RAYS, off);
            off->likely_square += (bounds[2] - truth) * (bounds[2] - truth);
        }
        off->num++;
    }
}

/* So many pixels of a world's picture that show a surface, spread over it; or of a small one's, with bounds. */
static off_by compare_with_rays(const char *world, int num_pixels, int bounds_width_px)
{
    const bool bounds = bounds_width_px > 0;
    karst_engine_config config = base_config(world);
    config.width_px = bounds ? bounds_width_px : TRUE_WIDTH;
    config.height_px = bounds ? bounds_width_px * BOUND_HEIGHT / BOUND_WIDTH : TRUE_HEIGHT;
    config.pool_bytes = (uint64_t)512 << 20;
    karst_engine *engine = create(&config);
    settle(engine, &one);
    const size_t num = (size_t)config.width_px * (size_t)config.height_px;
    if (bounds) {
        assert_ok(karst_engine_read_aov(engine, KARST_AOV_OPENNESS, one.bounds, 3 * num, &error));
        prove_cells(engine);
    }
    karst_hit *records = malloc(num * sizeof *records), *hits = malloc(AT_ONCE * TRUE_RAYS * sizeof *hits);
    karst_ray *rays = malloc(AT_ONCE * TRUE_RAYS * sizeof *rays);
    assert_true(records && hits && rays);
    assert_ok(karst_buffer_read(engine->hits, 0, records, num * sizeof *records, &error));
    off_by off = {0};
    int at[AT_ONCE], num_at = 0;
    for (size_t i = 0; i < num && off.num + num_at < num_pixels; i++) {
        const int place = (int)(i * 30011 % num), x = place % config.width_px, y = place / config.width_px;
        if (aim_true(engine, x, y, records, rays + num_at * TRUE_RAYS))
            at[num_at++] = place;
        if (num_at == AT_ONCE) {
            compare_some(engine, at, num_at, rays, hits, &off);
            num_at = 0;
        }
    }
    compare_some(engine, at, num_at, rays, hits, &off);
    free(records);
    free(hits);
    free(rays);
    karst_engine_destroy(engine);
    return off;
}

/* What is found of each world, and a little more: land as rough as its pixels are small is far from the court's. The
 * last three are worlds that nothing was chosen by. */
static const struct {
    const char *name;
    double most_rms, most_width; /* of the estimate; of the bounds, in the median */
    double most_cost;            /* of casting the picture's rays, which are few steps each in the court */
} worlds[] = {{NULL, 0.045, 0.6, 1.5},     {"karst", 0.047, 1, 0.6},    {"hills", 0.066, 0.9, 0.6},
              {"ruins", 0.082, 1, 0.6},    {"asteroid", 0.041, 0.6, 0.65}, {"canyons", 0.036, 0.5, 0.6},
              {"alps", 0.038, 0.5, 0.6},   {"regions", 0.046, 0.7, 0.6}, {"dunes", 0.022, 0.3, 0.6},
              {"islands", 0.084, 1, 0.6}};
enum { NUM_WORLDS = sizeof worlds / sizeof *worlds };

static void bounds_hold_what_many_rays_see(void **state)
{
    (void)state;
    const bool full = getenv("KARST_TEST_FULL") != NULL;
    for (int i = 0; i < (full ? NUM_WORLDS : 1); i++) {
        off_by off = compare_with_rays(worlds[i].name ? worlds[i].name : stage_path, full ? 200 : 60,
                                       full ? BOUND_WIDTH : SMALL_BOUND_WIDTH);
        assert_true(off.num >= 60);
        qsort(off.widths, (size_t)off.num, sizeof off.widths[0], by_size);
        print_message("%s: %d pixels, %d outside, %ld of %ld rays; as wide as %.3f (median), %.3f (worst); "
                      "rms %.4f, within them %.4f\n",
                      worlds[i].name ? worlds[i].name : "court", off.num, off.outside, off.wrong, off.proofs,
                      off.widths[off.num / 2], off.widths[off.num - 1], sqrt(off.square / off.num),
                      sqrt(off.likely_square / off.num));
        assert_int_equal(off.outside, 0);
        assert_int_equal(off.wrong, 0);
        assert_true(off.proofs > 500L * off.num); /* of 4,096 rays a pixel, and four depths */
        assert_true(off.widths[off.num / 2] <= worlds[i].most_width);
    }
}

static double cpu_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* CPU time of occlusion at 800x600, as a share of casting the picture's rays: medians, by turns. */
static double cost_of(const char *world)
{
    enum { TURNS = 15 };
    karst_engine_config config = base_config(world);
    config.width_px = 800, config.height_px = 600;
    config.pool_bytes = (uint64_t)1 << 30;
    karst_engine *engine = create(&config);
    karst_cast_view view;
    karst_pinhole pinhole;
    bool settled = false;
    double took[2][TURNS];
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    assert_true(settled);
    karst_engine_picture_view(engine, &view, &pinhole);
    for (int i = 0; i < TURNS; i++) {
        const double start = cpu_s();
        assert_ok(karst_cast_pinhole(engine->caster, &view, &pinhole, engine->hits, &error) &&
                  karst_finish(engine->context, &error));
        const double cast = cpu_s();
        assert_ok(karst_engine_draw_occlusion(engine, &view, &pinhole, &error) &&
                  karst_finish(engine->context, &error));
        took[0][i] = cast - start, took[1][i] = cpu_s() - cast;
    }
    karst_engine_destroy(engine);
    for (int i = 0; i < 2; i++)
        qsort(took[i], TURNS, sizeof took[i][0], by_value);
    return took[1][TURNS / 2] / took[0][TURNS / 2];
}

static void estimates_are_near_many_rays(void **state)
{
    (void)state;
    const bool full = getenv("KARST_TEST_FULL") != NULL;
    for (int i = 0; i < (full ? NUM_WORLDS : 1); i++) {
        const char *name = worlds[i].name ? worlds[i].name : "court";
        const char *world = worlds[i].name ? worlds[i].name : stage_path;
        const off_by off = compare_with_rays(world, full ? 200 : 40, 0);
        const double rms = sqrt(off.square / off.num);
        print_message("%s: %d pixels, rms %.4f, mean %+.4f, worst %.3f\n", name, off.num, rms, off.bias / off.num,
                      off.worst);
        assert_true(off.num >= (full ? 200 : 40));
        assert_true(rms <= worlds[i].most_rms);
        if (full) {
            const double cost = cost_of(world);
            print_message("%s: costs %.3f of casting the picture's rays\n", name, cost);
            assert_true(cost <= worlds[i].most_cost);
        }
    }
}

/* ---- closed forms ---- */

static void a_plane_is_open(void **state)
{
    (void)state;
    for (int lanes = 16; lanes; lanes = lanes == 16 ? 1 : 0) {
        karst_engine_config config = base_config(stage_path);
        config.lanes = lanes;
        take_above(&config, -COURT_M, &one);
        config.occlusion = KARST_OCCLUSION_OFF;
        if (lanes == 16)
            take_above(&config, -COURT_M, &other);
        for (int i = 0; i < NUM; i++)
            assert_true(one.open[i] == 1);
        assert_memory_equal(one.light, other.light, 3 * NUM * sizeof(float));
        assert_true(one.stats.num_rays[KARST_STREAM_OCCLUSION] > NUM / 4 / KARST_OCCLUSION_BLOCK);
        assert_int_equal(other.stats.num_rays[KARST_STREAM_OCCLUSION], 0);
    }
}

/* Samples go through their pixels beside the middle, each elsewhere; and pixels look at one another. */
static void a_plane_is_open_in_every_sample(void **state)
{
    (void)state;
    karst_engine_config config = base_config(stage_path);
    config.samples = 3;
    take_above(&config, -COURT_M, &one);
    config.occlusion = KARST_OCCLUSION_OFF;
    take_above(&config, -COURT_M, &other);
    float most = 0;
    for (int i = 0; i < 3 * NUM; i++)
        most = fmaxf(most, fabsf(one.light[i] - other.light[i]));
    print_message("samples of a plane are off by %g at most\n", most);
    assert_true(most < 1e-3f); /* near the horizon they are not moved as far */
}

static void a_closed_box_is_black(void **state)
{
    (void)state;
    const karst_engine_config config = base_config(stage_path);
    take_above(&config, BOX_M - COURT_M, &one);
    float most = 0, widest = 0;
    for (int i = 0; i < NUM; i++) {
        assert_true(isfinite(one.depth[i]));
        widest = fmaxf(widest, one.open[i]);
        for (int c = 0; c < 3; c++)
            most = fmaxf(most, one.light[3 * i + c]);
    }
    print_message("a closed box is %g open at most, its brightest part %g\n", widest, most);
    assert_true(widest == 0);
    assert_true(most < 1e-6f);
}

/* Of white surfaces nothing is lost, however they hide one another: what is thrown back comes again. */
static void a_furnace_stays_white(void **state)
{
    (void)state;
    karst_engine_config config = base_config(stage_path);
    take(&config, &one);
    config.occlusion = KARST_OCCLUSION_OFF;
    take(&config, &other);
    float most = 0;
    bool any = false;
    for (int i = 0; i < 3 * NUM; i += 3) /* red alone */
        most = fmaxf(most, fabsf(one.light[i] - other.light[i]));
    for (int i = 0; i < NUM; i++)
        any = any || one.open[i] < 0.7f;
    print_message("white surfaces are off by %g at most\n", most);
    assert_true(any && most < 1e-5f);
}

/* ---- what it may not depend on ---- */

static void bounds_do_not_depend_on_lanes(void **state)
{
    (void)state;
    enum { SMALL_WIDTH = 12, SMALL_HEIGHT = 9, NUM_BOUNDS = 3 * SMALL_WIDTH * SMALL_HEIGHT };
    static float bounds[2][NUM_BOUNDS];
    for (int i = 0; i < 2; i++) {
        karst_engine_config config = base_config(stage_path);
        config.width_px = SMALL_WIDTH, config.height_px = SMALL_HEIGHT;
        config.lanes = i ? 1 : 16;
        karst_engine *engine = create(&config);
        settle(engine, &one);
        assert_ok(karst_engine_read_aov(engine, KARST_AOV_OPENNESS, bounds[i], NUM_BOUNDS, &error));
        karst_engine_destroy(engine);
    }
    for (int i = 0; i < NUM_BOUNDS; i += 3)
        assert_true(0 <= bounds[0][i] && bounds[0][i] <= bounds[0][i + 2] && bounds[0][i + 2] <= bounds[0][i + 1] &&
                    bounds[0][i + 1] <= 1);
    assert_memory_equal(bounds[0], bounds[1], sizeof bounds[0]);
}

static void it_depends_on_the_view_alone(void **state)
{
    (void)state;
    karst_engine_config config = base_config(stage_path);
    karst_engine *engine = create(&config);
    karst_camera camera = karst_engine_default_camera(engine), away = camera;
    away.position.voxel[0] += 120;
    away.yaw_deg += 50;
    assert_ok(karst_engine_set_camera(engine, &away, &error));
    settle(engine, &one);
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
    settle(engine, &one);
    karst_engine_destroy(engine);
    config.lanes = 1;
    take(&config, &other);
    assert_memory_equal(one.open, other.open, NUM * sizeof(float));
    assert_memory_equal(one.light, other.light, 3 * NUM * sizeof(float));
    config.samples = 3;
    take(&config, &one);
    config.lanes = 16;
    take(&config, &other);
    assert_memory_equal(one.open, other.open, NUM * sizeof(float));
    assert_memory_equal(one.light, other.light, 3 * NUM * sizeof(float));
}

static void a_window_is_a_part_of_the_whole(void **state)
{
    (void)state;
    enum { WHOLE_WIDTH = 2 * WIDTH, WHOLE_HEIGHT = 2 * HEIGHT }; /* the last window sees no other edge */
    static const karst_engine_window windows[] = {
        {WHOLE_WIDTH, WHOLE_HEIGHT, 13, 18}, {WHOLE_WIDTH, WHOLE_HEIGHT, WHOLE_WIDTH - 41, WHOLE_HEIGHT - 29}};
    for (uint32_t samples = 1; samples <= 2; samples++) {
        karst_engine_config config = base_config(stage_path);
        config.samples = samples;
        config.width_px = WHOLE_WIDTH, config.height_px = WHOLE_HEIGHT;
        take(&config, &one);
        config.window = windows[samples - 1];
        config.width_px = 41, config.height_px = 29;
        take(&config, &other);
        for (int y = 0; y < 29; y++)
            for (int x = 0; x < 41; x++) {
                const int here = y * 41 + x,
                          there = (y + config.window.y0_px) * WHOLE_WIDTH + x + config.window.x0_px;
                assert_true(other.open[here] == one.open[there]);
                assert_memory_equal(other.light + 3 * here, one.light + 3 * there, 3 * sizeof(float));
            }
    }
}

/* It is on where a world says so, and what is asked for overrules that. */
static void what_is_not_there_is_said(void **state)
{
    (void)state;
    char path[64];
    karst_error said = {0};
    karst_engine_config config = base_config(stage_path);
    config.occlusion = (karst_occlusion_mode)7;
    assert_null(karst_engine_create(&config, &said));
    assert_int_equal(said.status, KARST_USAGE);
    config.occlusion = KARST_OCCLUSION_OFF;
    karst_engine *engine = create(&config);
    settle(engine, &one);
    said = (karst_error){0};
    assert_false(karst_engine_read_aov(engine, KARST_AOV_OCCLUSION, one.open, NUM, &said));
    assert_int_equal(said.status, KARST_USAGE);
    said = (karst_error){0};
    assert_false(karst_engine_read_aov(engine, KARST_AOV_OPENNESS, one.light, 3 * NUM, &said));
    assert_int_equal(said.status, KARST_USAGE);
    karst_engine_destroy(engine);
    config.occlusion = KARST_OCCLUSION_OF_WORLD;
    take(&config, &one);
    assert_true(one.stats.num_rays[KARST_STREAM_OCCLUSION] > 0);
    for (int says = 0; says < 2; says++) {
        const karst_world_info world = {.has_occlusion = says};
        for (int mode = KARST_OCCLUSION_OF_WORLD; mode <= KARST_OCCLUSION_OFF; mode++) {
            config.occlusion = (karst_occlusion_mode)mode;
            assert_int_equal(karst_engine_wants_occlusion(&config, &world),
                             mode == KARST_OCCLUSION_ON || (mode == KARST_OCCLUSION_OF_WORLD && says));
        }
    }
    config.occlusion = KARST_OCCLUSION_OF_WORLD;
    write_world("/*{ \"occlusion\": 1 }*/\nfloat density(vec3 p) { return -p.y; }\n", path);
    said = (karst_error){0};
    config.world = path;
    assert_null(karst_engine_create(&config, &said));
    assert_int_equal(said.status, KARST_BAD_WORLD);
    assert_non_null(strstr(said.message, "occlusion"));
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bounds_hold_what_many_rays_see),
        cmocka_unit_test(estimates_are_near_many_rays), cmocka_unit_test(a_plane_is_open),
        cmocka_unit_test(a_plane_is_open_in_every_sample),
        cmocka_unit_test(a_closed_box_is_black),        cmocka_unit_test(a_furnace_stays_white),
        cmocka_unit_test(bounds_do_not_depend_on_lanes),
        cmocka_unit_test(it_depends_on_the_view_alone), cmocka_unit_test(a_window_is_a_part_of_the_whole),
        cmocka_unit_test(what_is_not_there_is_said),
    };
    return cmocka_run_group_tests(tests, write_stage, remove_stage);
}
