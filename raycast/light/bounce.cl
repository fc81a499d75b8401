/* Entry points of bounces: from surfaces to the next stream of rays, packed by prefix sums. See raycast/light/bounce.h.
 *
 * The rays of a block of pixels (raycast/light/blocks.clh) are neighbours in the stream, in the order of their pixels.
 */
#include "raycast/cast/packing.clh"
#include "raycast/light/radiance_shared.h"
#include "raycast/shadow_shared.h"
#include "raycast/light/blocks.clh"

/* The lanes that mirror anything. */
RAY_INLINE vint mirrors(K_GLOBAL const float *shares, vint order, vint valid, vfloat *share)
{
    *share = load_ordered(shares, order, valid);
    return valid & v_gt(*share, (vfloat)(0.0f));
}

/* How many rays each block has: one work-item for each. */
__kernel K_WIDE void bounce_count(int width_px, int height_px, K_GLOBAL const float *parts, K_GLOBAL uint *counts,
                                  uint num_blocks)
{
    const uint block = (uint)get_global_id(0);
    if (block >= num_blocks)
        return;
    K_GLOBAL const float *shares = parts + KARST_RADIANCE_MIRROR_PLANE * ((size_t)width_px * (size_t)height_px);
    uint num = 0;
    for (uint i = 0; i < BLOCK_ITEMS; i++) {
        vint x, y;
        vfloat share;
        const vint valid = block_pixels(block, i, width_px, height_px, &x, &y);
        if (v_any(valid))
            num += (uint)count_lanes(mirrors(shares, packet_order(x, y, width_px, height_px), valid, &share));
    }
    counts[block] = num;
}

/* From counts to where each block's rays begin, and how many there are in all. */
SCAN_KERNEL void bounce_scan(K_GLOBAL uint *counts, uint num_blocks, K_GLOBAL uint *total, K_GLOBAL uint *counters)
{
    __local uint sums[SCAN_ITEMS];
    const uint sum = scan_counts(counts, num_blocks, sums);
    if (get_local_id(0) != 0)
        return;
    *total = sum;
    counters[5] += sum;
}

/* Where a packet's rays start and go, and which there are. */
typedef struct {
    vint m, x, y, order;
    vfloat share;
    surface_hits hits;
    vector3 origin, direction;
} mirrored_rays;

RAY_INLINE mirrored_rays mirrored_packet(const karst_pinhole *pinhole, K_GLOBAL const karst_hit *hits,
                                         K_GLOBAL const float *shares, uint block, uint item)
{
    mirrored_rays rays;
    const vint valid = block_pixels(block, item, pinhole->width_px, pinhole->height_px, &rays.x, &rays.y);
    rays.m = valid;
    if (!v_any(valid))
        return rays;
    rays.order = packet_order(rays.x, rays.y, pinhole->width_px, pinhole->height_px);
    rays.m = mirrors(shares, rays.order, valid, &rays.share);
    if (!v_any(rays.m))
        return rays;
    const vector3 d = pinhole_direction(pinhole, rays.x, rays.y);
    const surface_hits s = load_surface(hits, rays.order, valid, &d, 0.0f, 0.0f);
    const vector3 n = s.normal;
    /* A normal that looks away is of a surface seen edge on: there rays go on as they came. */
    const vfloat twice = 2.0f * lane_min(k_fma(d.x, n.x, k_fma(d.y, n.y, d.z * n.z)), (vfloat)(0.0f));
    vector3 r = {k_fma(-twice, n.x, d.x), k_fma(-twice, n.y, d.y), k_fma(-twice, n.z, d.z)};
    const vfloat scale = 1.0f / k_sqrt(k_fma(r.x, r.x, k_fma(r.y, r.y, r.z * r.z)));
    r.x *= scale, r.y *= scale, r.z *= scale;
    const vector3 origin = {d.x * s.t, d.y * s.t, d.z * s.t};
    rays.hits = s;
    rays.origin = origin;
    rays.direction = r;
    return rays;
}

/* Stores a packet's rays, one after the other. */
RAY_INLINE void store_rays(K_GLOBAL karst_ray *out, const mirrored_rays *rays, vfloat t_max, vfloat width, vfloat cone)
{
    float words[10][LANES];
    int pixel[LANES];
    const uint lanes = mask_bits(rays->m);
    v_store_float(rays->origin.x, words[0]), v_store_float(rays->origin.y, words[1]);
    v_store_float(rays->origin.z, words[2]), v_store_float(rays->direction.x, words[3]);
    v_store_float(rays->direction.y, words[4]), v_store_float(rays->direction.z, words[5]);
    v_store_float(t_max, words[6]), v_store_float(width, words[7]), v_store_float(cone, words[8]);
    v_store_float(rays->share, words[9]), v_store_int(rays->y << 16 | rays->x, pixel);
    for (int l = 0; l < LANES; l++)
        if (lanes >> l & 1u) {
            const karst_ray ray = {{words[0][l], words[1][l], words[2][l]},
                                   0.0f,
                                   {words[3][l], words[4][l], words[5][l]},
                                   words[6][l],
                                   words[7][l],
                                   words[8][l],
                                   (uint)pixel[l],
                                   KARST_SIDE_FRONT,
                                   {words[9][l], words[9][l], words[9][l]},
                                   0.0f};
            *out++ = ray;
        }
}

/* Makes the rays: one work-item for each block. There are no shadow rays until something is hit; shadow_rays 0: nor
 * then. */
__kernel K_WIDE void bounce_mirror(karst_pinhole pinhole, float detail, K_GLOBAL const karst_hit *hits,
                                   K_GLOBAL const float *parts, K_GLOBAL const uint *begins, uint num_blocks,
                                   K_GLOBAL karst_ray *rays, K_GLOBAL float *shadow_rays, uint room)
{
    const uint block = (uint)get_global_id(0);
    K_GLOBAL const float *shares =
        parts + KARST_RADIANCE_MIRROR_PLANE * ((size_t)pinhole.width_px * (size_t)pinhole.height_px);
    if (block >= num_blocks)
        return;
    for (uint i = 0; shadow_rays && i < BLOCK_RAYS; i++)
        shadow_rays[KARST_SHADOW_WIDTH * (size_t)room + block * BLOCK_RAYS + i] = 0.0f;
    K_GLOBAL karst_ray *out = rays + begins[block];
    for (uint i = 0; i < BLOCK_ITEMS; i++) {
        const mirrored_rays now = mirrored_packet(&pinhole, hits, shares, block, i);
        if (!v_any(now.m))
            continue;
        const surface_hits *s = &now.hits;
        /* To the sphere around the eye in which its view lies: farther on, what there is of the tree depends on where
         * the eye came from. */
        const vector3 *o = &now.origin, *r = &now.direction;
        const vfloat along = k_fma(o->x, r->x, k_fma(o->y, r->y, o->z * r->z));
        const vfloat rest = lane_max((pinhole.t_max - s->t) * (pinhole.t_max + s->t), (vfloat)(0.0f));
        const vfloat t_max = k_sqrt(k_fma(along, along, rest)) - along;
        const vfloat width =
            lane_max(s->t * pinhole.cone, v_as_float((s->level + 127) << 23) * (vfloat)(1.0001f / detail));
        store_rays(out, &now, t_max, width, mirrored_cone(hits, &pinhole, now.x, now.y, &s->normal));
        out += count_lanes(now.m);
    }
}

/* Closes the ranks of a stream's shadow rays, and of what the sun adds to them: those of PACKED_RAYS neighbours come
 * after one another from the first place on, in their order, and the places behind them are free. Few of what is
 * mirrored faces the sun, and rays that travel together are to be many. One work-item for each of those. */
#if LANES == 16 /* one lane alone has no use for it */
#define PACKED_RAYS (KARST_PACKED_BEAMS * BLOCK_RAYS)
RAY_INLINE void pack_plane(K_GLOBAL float *plane, uint to, uint from, uint bits)
{
    float lanes[LANES];
    pack_float(lanes, v_load_float(plane + from), bits);
    v_store_float(v_load_float(lanes), plane + to);
}

__kernel K_WIDE void bounce_pack_shadows(K_GLOBAL const uint *count, uint room, K_GLOBAL float *shadow_rays,
                                         K_GLOBAL float *suns)
{
    const uint begin = (uint)get_global_id(0) * PACKED_RAYS;
    if (begin >= *count)
        return;
    const uint end = room - begin < PACKED_RAYS ? room : begin + PACKED_RAYS;
    K_GLOBAL float *widths = shadow_rays + KARST_SHADOW_WIDTH * (size_t)room;
    uint to = begin;
    for (uint from = begin; from < end; from += LANES) {
        const uint bits = mask_bits(v_mask(v_gt(v_load_float(widths + from), (vfloat)(0.0f))));
        if (!bits)
            continue;
        for (int f = 0; f < KARST_SHADOW_FIELDS; f++)
            pack_plane(shadow_rays + (size_t)f * room, to, from, bits);
        for (int c = 0; c < KARST_RADIANCE_PLANES; c++)
            pack_plane(suns + (size_t)c * room, to, from, bits);
        to += (uint)k_popcount(bits);
    }
    for (uint i = to; i < end; i++)
        widths[i] = 0.0f;
}
#endif

/* Adds what the sun does to pixels, of the shadow rays of a stream that nothing hides it from: LANES places for each
 * work-item. */
__kernel K_WIDE void bounce_add_sun(int width_px, int height_px, K_GLOBAL const float *shadow_rays,
                                    K_GLOBAL const uint *count, uint room, K_GLOBAL const float *suns,
                                    K_GLOBAL const uint *marks, K_GLOBAL float *parts)
{
    const size_t plane = (size_t)width_px * (size_t)height_px;
    K_GLOBAL const float *widths = shadow_rays + KARST_SHADOW_WIDTH * (size_t)room;
    K_GLOBAL const uint *pixels = (K_GLOBAL const uint *)(shadow_rays + KARST_SHADOW_DARK * (size_t)room);
    const uint first = (uint)get_global_id(0) * LANES;
    for (uint i = first; i < first + LANES && i < *count; i++) {
        /* as a picture 32 pixels wide has them */
        const uint row = i / 128 * 4 + i % 16 / 4, column = i % 128 / 16 * 4 + i % 4;
        if (!(widths[i] > 0.0f) || marks[row * 32 + column])
            continue;
        const uint pixel = pixels[i] & ~KARST_SHADOW_OF_PIXEL, x = pixel & 0xffffu, y = pixel >> 16;
        const uint place = karst_packet_order(x, y, (uint)width_px, (uint)height_px);
        for (int c = 0; c < KARST_RADIANCE_PLANES; c++)
            parts[(size_t)c * plane + place] += suns[(size_t)c * room + i];
    }
}
