/* Casting streams of rays into scenes, for tests: hits on the host, densities of scenes, a slow reference. */
#ifndef KARST_TESTS_RAYCAST_CASTING_H
#define KARST_TESTS_RAYCAST_CASTING_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "tests/raycast/scene.h"

/* ---- densities: signed distances in level-0 voxels, positive inside ---- */
SCENE_UNUSED static double ball(const double p[3], double width, const void *user)
{
    const double *c = user; /* centre, radius */
    (void)width;
    return c[3] - sqrt((p[0] - c[0]) * (p[0] - c[0]) + (p[1] - c[1]) * (p[1] - c[1]) + (p[2] - c[2]) * (p[2] - c[2]));
}

/* Solid where normal . p < offset; with thickness > 0 only that far down. */
SCENE_UNUSED static double plate(const double p[3], double width, const void *user)
{
    const double *n = user; /* unit normal, offset, thickness */
    (void)width;
    double depth = n[3] - (n[0] * p[0] + n[1] * p[1] + n[2] * p[2]);
    return n[4] > 0 && n[4] - depth < depth ? n[4] - depth : depth;
}

/* An endless round rod along y: x, z, radius. */
SCENE_UNUSED static double needle(const double p[3], double width, const void *user)
{
    const double *c = user;
    (void)width;
    return c[2] - hypot(p[0] - c[0], p[2] - c[1]);
}

/* Wavy sheets that fold within a few voxels: many cells with two or three surfaces. */
SCENE_UNUSED static double folds(const double p[3], double width, const void *user)
{
    (void)user;
    (void)width;
    return (sin(p[0] * 0.9) * cos(p[1] * 0.7) + sin(p[1] * 0.8) * cos(p[2] * 0.9) + sin(p[2] * 0.7) * cos(p[0] * 0.8) -
            0.9) *
           0.5;
}

/* ---- random numbers, the same everywhere ---- */
SCENE_UNUSED static double next_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) * 0x1p-53;
}

SCENE_UNUSED static void random_direction(uint64_t *state, double d[3])
{
    double length;
    do {
        length = 0;
        for (int a = 0; a < 3; a++) {
            d[a] = 2 * next_random(state) - 1;
            length += d[a] * d[a];
        }
    } while (length > 1 || length < 0.01);
    for (int a = 0; a < 3; a++)
        d[a] /= sqrt(length);
}

/* A ray that wants level 0 all along, from `origin` (relative to the anchor). */
SCENE_UNUSED static karst_ray make_ray(const double origin[3], const double direction[3], double t_max)
{
    karst_ray ray = {.t_max = (float)t_max};
    for (int a = 0; a < 3; a++) {
        ray.origin[a] = (float)origin[a];
        ray.direction[a] = (float)direction[a];
    }
    return ray;
}

/* ---- casting ---- */
SCENE_UNUSED static karst_context *open_context(int lanes)
{
    karst_error error = {0};
    karst_context *context = karst_context_create("cpu", lanes, NULL, &error);
    scene_check(context, &error);
    return context;
}

/* For groups of tests: 16 lanes, 1 lane. */
SCENE_UNUSED static karst_context *contexts[2];
SCENE_UNUSED static int open_contexts(void **state)
{
    (void)state;
    contexts[0] = open_context(16);
    contexts[1] = open_context(1);
    return 0;
}

SCENE_UNUSED static int close_contexts(void **state)
{
    (void)state;
    karst_context_destroy(contexts[0]);
    karst_context_destroy(contexts[1]);
    return 0;
}

SCENE_UNUSED static karst_caster *open_caster(const scene *s, const char *options)
{
    karst_error error = {0};
    karst_caster *caster = karst_caster_create_with(s->context, &s->buffers, options, &error);
    scene_check(caster, &error);
    return caster;
}

/* Hits of all rays, malloc'ed. */
SCENE_UNUSED static karst_hit *cast(const scene *s, karst_caster *caster, const karst_cast_view *view,
                                    const karst_ray *rays, uint32_t num_rays, bool any_hit)
{
    karst_error error = {0};
    karst_buffer *in = karst_buffer_create(s->context, "rays", num_rays * sizeof(*rays), rays, &error);
    scene_check(in, &error);
    karst_buffer *out = scene_buffer(s->context, "hits", num_rays * sizeof(karst_hit));
    karst_hit *hits = malloc(num_rays * sizeof(*hits));
    scene_check(karst_cast_rays(caster, view, in, num_rays, any_hit, out, &error), &error);
    scene_check(karst_buffer_read(out, 0, hits, num_rays * sizeof(*hits), &error), &error);
    karst_buffer_destroy(in);
    karst_buffer_destroy(out);
    return hits;
}

SCENE_UNUSED static karst_hit *cast_picture(const scene *s, karst_caster *caster, const karst_cast_view *view,
                                            const karst_pinhole *pinhole)
{
    karst_error error = {0};
    size_t bytes = (size_t)pinhole->width_px * (size_t)pinhole->height_px * sizeof(karst_hit);
    karst_buffer *out = scene_buffer(s->context, "hits", bytes);
    karst_hit *hits = malloc(bytes);
    scene_check(karst_cast_pinhole(caster, view, pinhole, out, &error), &error);
    scene_check(karst_buffer_read(out, 0, hits, bytes, &error), &error);
    karst_buffer_destroy(out);
    return hits;
}

SCENE_UNUSED static karst_pinhole make_pinhole(int width, int height, double yaw_deg, double pitch_deg, double t_max)
{
    double y = yaw_deg * (3.14159265358979 / 180), p = pitch_deg * (3.14159265358979 / 180);
    double half = 0.6;
    karst_pinhole pinhole = {
        .forward = {(float)(sin(y) * cos(p)), (float)sin(p), (float)(cos(y) * cos(p))},
        .up = {(float)(-sin(y) * sin(p)), (float)cos(p), (float)(-cos(y) * sin(p))},
        .right = {(float)cos(y), 0, (float)-sin(y)},
        .half_height = (float)half,
        .half_width = (float)(half * width / height),
        .t_max = (float)t_max,
        .cone = (float)(2 * half / height),
        .width_px = width,
        .height_px = height,
    };
    return pinhole;
}

/* The stamps of a kind, malloc'ed. */
SCENE_UNUSED static uint32_t *read_stamps(karst_buffer *buffer)
{
    karst_error error = {0};
    uint32_t *stamps = malloc(buffer->size_bytes);
    scene_check(karst_buffer_read(buffer, 0, stamps, buffer->size_bytes, &error), &error);
    return stamps;
}

SCENE_UNUSED static uint32_t count_stamps(karst_buffer *buffer, uint32_t serial)
{
    uint32_t *stamps = read_stamps(buffer), count = 0;
    for (size_t i = 0; i < buffer->size_bytes / 4; i++)
        count += stamps[i] == serial;
    free(stamps);
    return count;
}

/* ---- the reference: the interpolated level-0 samples along a ray, in double and very small steps ---- */

/* In density units; *slope: what it changes by over one voxel here. Outside of the root: air. */
SCENE_UNUSED static double interpolated(const scene *s, const double p[3], double *slope)
{
    double half = ldexp(KARST_BRICK_CELLS, s->top_level);
    *slope = 1;
    for (int a = 0; a < 3; a++)
        if (!(p[a] >= -half && p[a] < half))
            return -1;
    uint32_t node = scene_find(s, p, 0);
    uint32_t state = KARST_NODE_STATE(s->nodes[node].link);
    if (state != KARST_STATE_BRICK)
        return state == KARST_STATE_SOLID ? 1 : -1;
    int64_t n[3];
    int level, cell[3];
    double f[3];
    scene_node_place(s, node, n, &level);
    for (int a = 0; a < 3; a++) {
        double x = p[a] - (double)n[a] * KARST_BRICK_CELLS;
        cell[a] = (int)floor(x) > 15 ? 15 : (int)floor(x);
        f[a] = x - cell[a];
    }
    uint32_t slot = s->nodes[node].brick;
    const int16_t *q = s->bricks + (size_t)slot * KARST_BRICK_STRIDE;
    double value = 0, least = 1e9, most = -1e9;
    for (int i = 0; i < 8; i++) {
        int at[3] = {cell[0] + (i & 1), cell[1] + (i >> 1 & 1), cell[2] + (i >> 2)};
        double w = 1, v = q[at[0] + KARST_BRICK_SIDE * (at[1] + KARST_BRICK_SIDE * at[2])];
        for (int a = 0; a < 3; a++)
            w *= i >> a & 1 ? f[a] : 1 - f[a];
        value += w * v;
        least = v < least ? v : least;
        most = v > most ? v : most;
    }
    *slope = (most - least) * s->brick_info[slot].scale;
    return value * s->brick_info[slot].scale;
}

#define REFERENCE_STEP 0.01

/* First t at which the interpolant is positive, INFINITY if none (surfaces touched over less than a step may be
 * missed). */
SCENE_UNUSED static double reference(const scene *s, const double anchor[3], const karst_ray *ray, double until)
{
    double slope, before = ray->t_min;
    double end = ray->t_max < until ? ray->t_max : until;
    for (int64_t i = 0;; i++) {
        double t = ray->t_min + (double)i * REFERENCE_STEP, p[3];
        if (t > end)
            return INFINITY;
        for (int a = 0; a < 3; a++)
            p[a] = anchor[a] + ray->origin[a] + (double)ray->direction[a] * t;
        if (interpolated(s, p, &slope) > 0)
            return i ? 0.5 * (before + t) : t;
        before = t;
    }
}

/* Whether the hit is the first surface of the interpolant: not after the reference's, and on (or inside) the surface.
 */
SCENE_UNUSED static bool hit_agrees(const scene *s, const double anchor[3], const karst_ray *ray, const karst_hit *hit)
{
    bool is_hit = KARST_HIT_KIND(hit->kind) != KARST_HIT_MISS;
    double expected = reference(s, anchor, ray, is_hit ? hit->t : 1e30), slope, p[3];
    if (!is_hit)
        return isinf(expected) && hit->t == ray->t_max;
    if (hit->t > expected + 2 * REFERENCE_STEP)
        return false;
    for (int a = 0; a < 3; a++)
        p[a] = anchor[a] + ray->origin[a] + (double)ray->direction[a] * hit->t;
    double value = interpolated(s, p, &slope);
    return value > -2e-3 * slope;
}

#endif
