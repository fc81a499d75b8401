/* Casting a hilly scene against the floor kernel of the same run: bench_cast [width height [lanes [options]]]. */
#include <math.h>
#include <time.h>

#include "raycast/cast/floor.h"
#include "raycast/light/shade.h"
#include "tests/raycast/scene.h"

static double hash(int64_t x, int64_t y, int64_t z)
{
    uint32_t h = (uint32_t)x * 0x8da6b343u ^ (uint32_t)y * 0xd8163841u ^ (uint32_t)z * 0xcb1ab31fu;
    h ^= h >> 16;
    h *= 0x7feb352du;
    h ^= h >> 15;
    h *= 0x846ca68bu;
    h ^= h >> 16;
    return h * (2.0 / 4294967295.0) - 1;
}

static double value_noise(double x, double y, double z)
{
    double f[3] = {floor(x), floor(y), floor(z)}, t[3] = {x - f[0], y - f[1], z - f[2]}, v[2][2];
    for (int a = 0; a < 3; a++)
        t[a] = t[a] * t[a] * (3 - 2 * t[a]);
    for (int k = 0; k < 2; k++)
        for (int j = 0; j < 2; j++) {
            double a = hash((int64_t)f[0], (int64_t)f[1] + j, (int64_t)f[2] + k),
                   b = hash((int64_t)f[0] + 1, (int64_t)f[1] + j, (int64_t)f[2] + k);
            v[k][j] = a + (b - a) * t[0];
        }
    double a = v[0][0] + (v[0][1] - v[0][0]) * t[1], b = v[1][0] + (v[1][1] - v[1][0]) * t[1];
    return a + (b - a) * t[2];
}

/* Hills with overhangs; octaves finer than the voxel are left out. */
static double hills(const double p[3], double width, const void *user)
{
    (void)user;
    double sum = -p[1], size = 4096, height = 900;
    for (int i = 0; i < 9; i++, size *= 0.5, height *= 0.5)
        if (size >= 2 * width)
            sum += height * 0.5 * value_noise(p[0] / size + i * 17.3, p[1] / size, p[2] / size - i * 5.1);
    return sum;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* What was hit, on which levels, and what the last cast stamped. */
static void report(scene *s, const karst_cast_view *view, karst_buffer *hits, size_t num_pixels)
{
    karst_error error = {0};
    karst_hit *h = malloc(num_pixels * sizeof(karst_hit));
    scene_check(karst_buffer_read(hits, 0, h, num_pixels * sizeof(karst_hit), &error), &error);
    uint32_t count[4] = {0}, levels[12] = {0}, sum = 0;
    for (size_t i = 0; i < num_pixels; i++) {
        count[KARST_HIT_KIND(h[i].kind)]++;
        levels[KARST_HIT_LEVEL(h[i].kind) < 12 ? KARST_HIT_LEVEL(h[i].kind) : 11]++;
        uint32_t words[8];
        memcpy(words, &h[i], 32);
        for (int k = 0; k < 8; k++)
            sum = sum * 31 + words[k];
    }
    printf("miss %u surface %u provisional %u solid %u; levels", count[0], count[1], count[2], count[3]);
    for (int i = 0; i < 12; i++)
        printf(" %u", levels[i]);
    printf("; hash %08x\n", sum);
    uint32_t *stamps = malloc(s->num_bricks * 4), marched = 0, walked = 0;
    scene_check(karst_buffer_read(s->buffers.brick_stamp, 0, stamps, s->num_bricks * 4, &error), &error);
    for (uint32_t i = 0; i < s->num_bricks; i++)
        marched += stamps[i] == view->serial - 1;
    stamps = realloc(stamps, s->num_tiles * 4);
    scene_check(karst_buffer_read(s->buffers.tile_stamp, 0, stamps, s->num_tiles * 4, &error), &error);
    for (uint32_t i = 0; i < s->num_tiles; i++)
        walked += stamps[i] == view->serial - 1;
    printf("marched %u bricks, walked %u tiles\n", marched, walked);
    free(stamps);
    free(h);
}

/* As PPM. */
static void dump(const char *path, karst_buffer *pixels, int width, int height)
{
    karst_error error = {0};
    const size_t num_pixels = (size_t)width * (size_t)height;
    FILE *out = fopen(path, "wb");
    if (!out)
        return;
    uint8_t *rgba = malloc(num_pixels * 4);
    scene_check(karst_buffer_read(pixels, 0, rgba, num_pixels * 4, &error), &error);
    fprintf(out, "P6\n%d %d\n255\n", width, height);
    for (size_t i = 0; i < num_pixels; i++)
        fwrite(rgba + 4 * i, 3, 1, out);
    free(rgba);
    fclose(out);
}

int main(int argc, char **argv)
{
    int width = argc > 2 ? atoi(argv[1]) : 800, height = argc > 2 ? atoi(argv[2]) : 600,
        lanes = argc > 3 ? atoi(argv[3]) : 0;
    const char *options = argc > 4 ? argv[4] : "";
    karst_error error = {0};
    karst_context *context = karst_context_create("cpu", lanes, NULL, &error);
    scene_check(context, &error);
    scene s = scene_create(context, 60000, 45000, 1, 10, hills, NULL);
    s.lipschitz = 2.5;
    scene_classify_tile(&s, KARST_ROOT_TILE);
    for (uint32_t i = 8; i < 16; i++)
        s.nodes[i].link = KARST_NODE_LINK(KARST_STATE_UNKNOWN, 0);
    scene_upload(&s);
    const double camera[3] = {100.3, 0, 37.7};
    double eye[3] = {camera[0], 0, camera[2]};
    while (hills(eye, 1, NULL) > -60)
        eye[1] += 5;
    karst_cast_view view = scene_view(&s, eye, 1);
    float half = 0.577f;
    karst_pinhole pinhole = {.right = {1, 0, 0},
                             .up = {0, 0.968f, 0.25f},
                             .forward = {0, -0.25f, 0.968f},
                             .half_height = half,
                             .half_width = half * (float)width / (float)height,
                             .t_max = 12000,
                             .cone = 2 * half / (float)height,
                             .width_px = width,
                             .height_px = height};
    karst_caster *caster = karst_caster_create_with(context, &s.buffers, options, &error);
    scene_check(caster, &error);
    karst_buffer *hits = scene_buffer(context, "hits", (size_t)width * height * sizeof(karst_hit));
    uint32_t served = 1, rounds = 0;
    clock_t start = clock();
    while (served) {
        scene_check(karst_cast_pinhole(caster, &view, &pinhole, hits, &error), &error);
        served = scene_serve(&s, view.serial);
        view.serial++;
        rounds++;
    }
    printf("settled after %u rounds, %.1f s: %u tiles, %u bricks\n", rounds, (double)(clock() - start) / CLOCKS_PER_SEC,
           s.num_tiles, s.num_bricks);
    report(&s, &view, hits, (size_t)width * height);

    karst_floor *f = karst_floor_create(context, width, height, &error);
    scene_check(f, &error);
    const bool shadows = getenv("SHADOWS") != NULL;
    karst_shader *shader = karst_shader_create(context, shadows, &error);
    scene_check(shader, &error);
    size_t num_pixels = (size_t)width * height;
    karst_buffer *pixels = scene_buffer(context, "pixels", num_pixels * 4),
                 *depth = scene_buffer(context, "depth", num_pixels * 4);
    karst_buffer *counters = scene_buffer(context, "counters", KARST_SHADE_COUNTERS * 4);
    karst_buffer *rays = scene_buffer(context, "rays", karst_cast_shadow_bytes(width, height));
    karst_light light = {.sun_direction = {0.766f, 0.35f, 0.539f},
                         .sun_colour = {3.2f, 2.6f, 2.0f},
                         .sky_zenith = {0.10f, 0.24f, 0.55f},
                         .sky_horizon = {0.58f, 0.70f, 0.82f},
                         .ground_flat = {0.13f, 0.18f, 0.05f},
                         .ground_steep = {0.27f, 0.23f, 0.19f},
                         .haze_distance = 15000,
                         .shadow_distance = 12000};
    for (served = shadows; served;) {
        view.serial++;
        scene_check(
            karst_cast_pinhole(caster, &view, &pinhole, hits, &error) &&
                karst_shade_pixels(shader, &view, &pinhole, &light, hits, rays, pixels->mem, depth, counters, &error) &&
                karst_cast_shadows(caster, &view, &pinhole, &light, rays, pixels->mem, &error),
            &error);
        served = scene_serve(&s, view.serial);
    }
    printf("with shadows: %u tiles, %u bricks\n", s.num_tiles, s.num_bricks);
    double cast_ms[41], floor_ms[41], shade_ms[41], shadow_ms[41];
    for (int i = 0; i < 41; i++) {
        uint64_t ns[KARST_NUM_STAGES] = {0}, floor_ns;
        scene_check(karst_profile_collect(context, ns, &error), &error);
        memset(ns, 0, sizeof(ns));
        scene_check(karst_cast_pinhole(caster, &view, &pinhole, hits, &error) &&
                        karst_profile_collect(context, ns, &error),
                    &error);
        cast_ms[i] = (double)ns[KARST_STAGE_CAST] * 1e-6;
        memset(ns, 0, sizeof(ns));
        scene_check(karst_shade_pixels(shader, &view, &pinhole, &light, hits, shadows ? rays : NULL, pixels->mem, depth,
                                       counters, &error) &&
                        karst_profile_collect(context, ns, &error),
                    &error);
        shade_ms[i] = (double)ns[KARST_STAGE_SHADE] * 1e-6;
        memset(ns, 0, sizeof(ns));
        if (shadows)
            scene_check(karst_cast_shadows(caster, &view, &pinhole, &light, rays, pixels->mem, &error) &&
                            karst_profile_collect(context, ns, &error),
                        &error);
        shadow_ms[i] = (double)(ns[KARST_STAGE_CAST] + ns[KARST_STAGE_SHADE]) * 1e-6;
        scene_check(karst_floor_run(f, &floor_ns, &error), &error);
        floor_ms[i] = (double)floor_ns * 1e-6;
    }
    qsort(cast_ms, 41, sizeof(double), compare);
    qsort(shade_ms, 41, sizeof(double), compare);
    qsort(shadow_ms, 41, sizeof(double), compare);
    printf("shade: best %.2f median %.2f ms; shadow rays: best %.2f median %.2f ms\n", shade_ms[0], shade_ms[20],
           shadow_ms[0], shadow_ms[20]);
    qsort(floor_ms, 41, sizeof(double), compare);
    printf("cast: best %.2f median %.2f ms; floor: best %.2f median %.2f ms; ratio best %.2f median %.2f\n", cast_ms[0],
           cast_ms[20], floor_ms[0], floor_ms[20], cast_ms[0] / floor_ms[0], cast_ms[20] / floor_ms[20]);
    if (getenv("DUMP"))
        dump(getenv("DUMP"), pixels, width, height);
    karst_floor_destroy(f);
    karst_shader_destroy(shader);
    karst_caster_destroy(caster);
    karst_buffer_destroy(pixels);
    karst_buffer_destroy(depth);
    karst_buffer_destroy(counters);
    karst_buffer_destroy(rays);
    karst_buffer_destroy(hits);
    scene_destroy(&s);
    karst_context_destroy(context);
    return 0;
}
