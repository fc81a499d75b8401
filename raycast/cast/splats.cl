/* Entry points of discs: rays that land was cast for, and their hits or marks, which what discs hide is replaced in.
 * See raycast/cast/splats.h. */
#include "raycast/cast/rays.clh"
#include "raycast/cast/splats.clh"
#include "raycast/cast/sun.clh"
#include "raycast/shadow_shared.h"

/* A hit becomes the disc's where that is nearer. */
K_INLINE K_WIDE void cover_hit(splats_data data, K_GLOBAL const long *anchors, splat_ray *ray, K_GLOBAL karst_hit *hit)
{
    splat_hit met;
    if (KARST_HIT_KIND(hit->kind) != KARST_HIT_MISS)
        ray->t_max = k_min(ray->t_max, hit->t);
    if (!splats_trace(data, anchors, ray, &met))
        return;
    uint place = 0u;
    for (int part = 0; part < 3; part++)
        place |= (uint)(k_sqrt(k_min(met.colour[part], 1.0f)) * 1023.0f + 0.5f) << (10 * part);
    hit->t = met.t;
    hit->kind = (hit->kind & 0xffff0000u) | KARST_HIT_SPLAT | (uint)met.level << 8;
    hit->brick = 0u;
    hit->place = place;
    hit->node = met.has_colour ? 1u : 0u;
    for (int a = 0; a < 3; a++)
        hit->normal[a] = met.normal[a];
}

/* Of a picture, as cast_pinhole has it. */
__kernel K_WIDE void splats_pinhole(K_GLOBAL const ulong *data, K_GLOBAL const long *anchors, karst_pinhole pinhole,
                                    float detail, K_GLOBAL karst_hit *hits)
{
    vint x, y;
    float d[3][LANES];
    int place[LANES];
    const vint valid = packet_pixels((uint)get_global_id(0), pinhole.width_px, pinhole.height_px, &x, &y);
    const vector3 direction = pinhole_direction(&pinhole, x, y);
    v_store_float(direction.x, d[0]);
    v_store_float(direction.y, d[1]);
    v_store_float(direction.z, d[2]);
    v_store_int(v_select(valid, packet_order(x, y, pinhole.width_px, pinhole.height_px), (vint)(-1)), place);
    for (int lane = 0; lane < LANES; lane++) {
        splat_ray ray = {.direction = {d[0][lane], d[1][lane], d[2][lane]},
                         .t_min = pinhole.t_min,
                         .t_max = pinhole.t_max,
                         .cone = pinhole.cone * detail};
        if (place[lane] >= 0)
            cover_hit(data, anchors, &ray, hits + place[lane]);
    }
}

/* Of a stream, as cast_rays has it; `wanted` KARST_CAST_WHETHER: marks, where a ray ends. */
__kernel K_WIDE void splats_rays(K_GLOBAL const ulong *data, K_GLOBAL const long *anchors,
                                 K_GLOBAL const karst_ray *rays, uint num_rays, K_GLOBAL const uint *count, uint wanted,
                                 float detail, K_GLOBAL karst_hit *hits)
{
    const uint i = (uint)get_global_id(0);
    if (count && *count < num_rays)
        num_rays = *count;
    if (i >= num_rays)
        return;
    K_GLOBAL const karst_ray *from = rays + i;
    splat_ray ray = {.t_min = k_max(from->t_min, 0.0f),
                     .t_max = from->t_max,
                     .width = from->width * detail,
                     .cone = from->cone * detail,
                     .side = from->side,
                     .rise = from->rise};
    for (int a = 0; a < 3; a++) {
        ray.origin[a] = from->origin[a];
        ray.direction[a] = from->direction[a];
    }
    if (!(ray.t_min < ray.t_max))
        return;
    if (wanted != KARST_CAST_WHETHER) {
        cover_hit(data, anchors, &ray, hits + i);
        return;
    }
    K_GLOBAL uint *mark = (K_GLOBAL uint *)hits + i;
    splat_hit met;
    if (!*mark && splats_trace(data, anchors, &ray, &met))
        *mark = 1u;
}

/* Of shadow rays, as cast_shadows has them. */
__kernel K_WIDE void splats_shadows(K_GLOBAL const ulong *data, K_GLOBAL const long *anchors, karst_shadow_sun sun,
                                    K_GLOBAL const float *rays, float detail, K_GLOBAL uint *pixels)
{
    const size_t plane = (size_t)sun.width_px * (size_t)sun.height_px;
    vint x, y;
    const vint valid = packet_pixels((uint)get_global_id(0), sun.width_px, sun.height_px, &x, &y);
    const vint order = packet_order(x, y, sun.width_px, sun.height_px);
    const vint pixel = y * sun.width_px + x;
    const vfloat width = load_ordered(rays + KARST_SHADOW_WIDTH * plane, order, valid);
    int place[LANES], to[LANES];
    float d[3][LANES];
    v_store_int(v_select(valid & v_gt(width, (vfloat)(0.0f)), order, (vint)(-1)), place);
    v_store_int(pixel, to);
    vector3 direction = {(vfloat)(sun.direction[0]), (vfloat)(sun.direction[1]), (vfloat)(sun.direction[2])};
    if (sun.sample) {
        if (sun.of_stream) {
            const vint of = v_as_int(load_ordered(rays + KARST_SHADOW_DARK * plane, order, valid));
            x = of & 0xffff;
            y = of >> 16 & 0x7fff;
        }
        direction = towards_disc(&sun, x, y);
    }
    v_store_float(direction.x, d[0]);
    v_store_float(direction.y, d[1]);
    v_store_float(direction.z, d[2]);
    for (int lane = 0; lane < LANES; lane++) {
        if (place[lane] < 0)
            continue;
        K_GLOBAL const float *own = rays + place[lane];
        splat_ray ray = {.origin = {own[KARST_SHADOW_ORIGIN * plane], own[(KARST_SHADOW_ORIGIN + 1) * plane],
                                    own[(KARST_SHADOW_ORIGIN + 2) * plane]},
                         .direction = {d[0][lane], d[1][lane], d[2][lane]},
                         .t_max = sun.t_max,
                         .width = own[KARST_SHADOW_WIDTH * plane] * detail,
                         .cone = sun.cone * detail,
                         .rise = own[KARST_SHADOW_RISE * plane]};
        splat_hit met;
        if (splats_trace(data, anchors, &ray, &met))
            pixels[to[lane]] = k_as_uint(own[KARST_SHADOW_DARK * plane]);
    }
}
