/* Entry points of light that passes land: see raycast/light/pass.h. Casting and shading have lanes; what is done
 * between them is done one by one, on any device. */
#include "raycast/light/scan.clh"

#undef LANES
#define LANES 1
#include "raycast/cast/cast_shared.h"
#include "raycast/cast/jitter.clh"
#include "raycast/rays_shared.h"
#include "raycast/shadow_shared.h"

/* Counters of hits that are stand-ins, and of rays that met a region without data: with those of mirrored rays. */
#define PROVISIONAL 6
#define INCOMPLETE 7

/* ---- leaving matter ---- */

/* The rays that are inside land; others are idle. */
__kernel void pass_inside(K_GLOBAL const karst_ray *rays, K_GLOBAL const uint *count, K_GLOBAL karst_ray *inside)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    karst_ray ray = rays[i];
    if (ray.side != KARST_SIDE_BACK)
        ray.t_max = 0.0f;
    inside[i] = ray;
}

RAY_INLINE void move_on(karst_ray *ray, const karst_hit *hit, float detail, uint side)
{
    const float voxel = k_as_float((KARST_HIT_LEVEL(hit->kind) + 127u) << 23);
    for (int a = 0; a < 3; a++)
        ray->origin[a] = k_fma(ray->direction[a], hit->t, ray->origin[a]);
    ray->t_max = k_max(ray->t_max - hit->t, 0.0f);
    ray->width = k_max(k_fma(hit->t, ray->cone, ray->width), voxel * (1.0001f / detail));
    ray->side = side;
    ray->rise = 0.0f;
}

RAY_INLINE void darken(karst_ray *ray)
{
    ray->t_max = 0.0f;
    ray->throughput[0] = ray->throughput[1] = ray->throughput[2] = 0.0f;
}

/* hits: where they come out. is_sure: rays that lacked anything end. */
__kernel void pass_leave(K_GLOBAL karst_ray *rays, K_GLOBAL const uint *count, K_GLOBAL const karst_hit *hits,
                         float detail, uint is_sure, K_GLOBAL uint *counters)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count || rays[i].side != KARST_SIDE_BACK)
        return;
    karst_ray ray = rays[i];
    const karst_hit hit = hits[i];
    const uint kind = KARST_HIT_KIND(hit.kind);
    if (kind == KARST_HIT_MISS || (is_sure && kind != KARST_HIT_SURFACE))
        darken(&ray);
    else
        move_on(&ray, &hit, detail, KARST_SIDE_FRONT);
    rays[i] = ray;
    if (kind == KARST_HIT_PROVISIONAL)
        atomic_inc(&counters[PROVISIONAL]);
    if (hit.kind & KARST_HIT_INCOMPLETE)
        atomic_inc(&counters[INCOMPLETE]);
}

/* ---- to lamps ---- */

/* Where rays to lamps ended: those that ended nowhere are there, and are cast no further (t_min); others pass by their
 * share, or are dark. Counts those that go on. */
__kernel void pass_on(K_GLOBAL karst_ray *rays, K_GLOBAL const uint *count, K_GLOBAL const karst_hit *hits,
                      K_GLOBAL const float *shares, float detail, uint is_sure, uint is_last, K_GLOBAL uint *going)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count || !(rays[i].t_max > rays[i].t_min))
        return;
    karst_ray ray = rays[i];
    const karst_hit hit = hits[i];
    const uint kind = KARST_HIT_KIND(hit.kind);
    const float share = kind == KARST_HIT_MISS ? 0.0f : shares[i];
    if (kind == KARST_HIT_MISS) {
        ray.t_min = ray.t_max;
    } else if (!(share > 0.0f) || is_last || (is_sure && kind != KARST_HIT_SURFACE)) {
        darken(&ray);
    } else {
        for (int c = 0; c < 3; c++)
            ray.throughput[c] *= share;
        move_on(&ray, &hit, detail, KARST_SIDE_BACK);
        if (ray.t_max > 0.0f)
            atomic_inc(going);
        else
            darken(&ray); /* the lamp is inside */
    }
    rays[i] = ray;
}

/* ---- shadow rays that land hides ---- */

/* Tiles of 32x32 pixels, packet by packet, so that neighbours of the stream are neighbours; a block is a tile, or a
 * pixel of one. */
#define SIDE_PX 32u
#define TILE_PX (SIDE_PX * SIDE_PX)
#define BLOCK_PX SCAN_BLOCK(TILE_PX)

/* The pixel of place i of a block; false: it is outside the picture. */
RAY_INLINE int block_pixel(uint block, uint i, uint width, uint height, uint *x, uint *y)
{
    const uint across = (width + SIDE_PX - 1) / SIDE_PX, place = block * BLOCK_PX + i;
    const uint tile = place / TILE_PX, in_tile = place % TILE_PX, packet = in_tile / 16;
    *x = tile % across * SIDE_PX + packet % 8 * 4 + in_tile % 4;
    *y = tile / across * SIDE_PX + packet / 8 * 4 + in_tile % 16 / 4;
    return *x < width && *y < height;
}

RAY_INLINE int is_dark(K_GLOBAL const float *shadow_rays, K_GLOBAL const uint *marks, size_t plane, uint width, uint x,
                       uint y, uint order)
{
    return shadow_rays[KARST_SHADOW_WIDTH * plane + order] > 0.0f && marks[y * width + x] != 0u;
}

/* How many each block has: one work-item for each. */
__kernel void pass_count_dark(K_GLOBAL const float *shadow_rays, K_GLOBAL const uint *marks, uint width, uint height,
                              K_GLOBAL uint *counts, uint num_blocks)
{
    const uint block = (uint)get_global_id(0);
    if (block >= num_blocks)
        return;
    const size_t plane = (size_t)width * height;
    uint num = 0, x, y;
    for (uint i = 0; i < BLOCK_PX; i++)
        if (block_pixel(block, i, width, height, &x, &y))
            num += (uint)is_dark(shadow_rays, marks, plane, width, x, y, karst_packet_order(x, y, width, height));
    counts[block] = num;
}

/* From counts to where each block's rays begin, and how many there are in all. */
SCAN_KERNEL void pass_scan(K_GLOBAL uint *counts, uint num_blocks, K_GLOBAL uint *total)
{
    __local uint sums[SCAN_ITEMS];
    const uint sum = scan_counts(counts, num_blocks, sums);
    if (get_local_id(0) != 0)
        return;
    *total = sum;
}

/* To the place on the sun that casting takes, too. */
RAY_INLINE void towards_sun(const karst_shadow_sun *sun, uint pixel, float direction[3])
{
    jitter at = {0.0f, 0.0f};
    if (sun->sample)
        at = jitter_on_disc(jitter_of((int)(pixel & 0xffffu) + sun->x0_px, (int)(pixel >> 16) + sun->y0_px,
                                      sun->sample, JITTER_SUN));
    float square = 0.0f;
    for (int a = 0; a < 3; a++)
        direction[a] = k_fma(at.u, sun->across[a], k_fma(at.v, sun->along[a], sun->direction[a]));
    square = k_fma(direction[0], direction[0], k_fma(direction[1], direction[1], direction[2] * direction[2]));
    const float scale = 1.0f / k_sqrt(square);
    for (int a = 0; a < 3; a++)
        direction[a] *= scale;
}

/* Makes their rays, with what the sun would add as throughput. */
__kernel void pass_dark_rays(karst_shadow_sun sun, K_GLOBAL const float *shadow_rays, K_GLOBAL const uint *marks,
                             K_GLOBAL const float *suns, ulong first, ulong stride, K_GLOBAL const uint *begins,
                             uint num_blocks, K_GLOBAL karst_ray *rays)
{
    const uint block = (uint)get_global_id(0);
    if (block >= num_blocks)
        return;
    const uint width = (uint)sun.width_px, height = (uint)sun.height_px;
    const size_t plane = (size_t)width * height;
    uint to = begins[block], x, y;
    for (uint i = 0; i < BLOCK_PX; i++) {
        if (!block_pixel(block, i, width, height, &x, &y))
            continue;
        const uint order = karst_packet_order(x, y, width, height);
        if (!is_dark(shadow_rays, marks, plane, width, x, y, order))
            continue;
        const uint own = k_as_uint(shadow_rays[KARST_SHADOW_DARK * plane + order]);
        karst_ray ray = {{0.0f, 0.0f, 0.0f},
                         0.0f,
                         {0.0f, 0.0f, 0.0f},
                         sun.t_max,
                         shadow_rays[KARST_SHADOW_WIDTH * plane + order],
                         sun.cone,
                         sun.of_stream ? own & ~KARST_SHADOW_OF_PIXEL : y << 16 | x,
                         KARST_SIDE_ANY,
                         {0.0f, 0.0f, 0.0f},
                         shadow_rays[KARST_SHADOW_RISE * plane + order]};
        for (int a = 0; a < 3; a++) {
            ray.origin[a] = shadow_rays[(KARST_SHADOW_ORIGIN + (size_t)a) * plane + order];
            ray.throughput[a] = suns[first + (size_t)a * stride + order];
        }
        float direction[3];
        towards_sun(&sun, ray.pixel, direction);
        for (int a = 0; a < 3; a++)
            ray.direction[a] = direction[a];
        rays[to++] = ray;
    }
}

/* Adds the light that they have to their pixels, no two of which are one. */
__kernel void pass_add(uint width, uint height, K_GLOBAL const karst_ray *rays, K_GLOBAL const uint *count,
                       K_GLOBAL float *parts)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    const uint pixel = rays[i].pixel;
    const size_t plane = (size_t)width * height,
                 place = karst_packet_order(pixel & 0xffffu, pixel >> 16, width, height);
    for (int c = 0; c < 3; c++)
        parts[(size_t)c * plane + place] += rays[i].throughput[c];
}
