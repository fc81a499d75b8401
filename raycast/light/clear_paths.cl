/* Paths through clear matter: see raycast/light/clear_paths.h. Casting and shading have lanes; what is done between
 * them is done one by one, on any device. */
#include "raycast/light/scan.clh"

#undef LANES
#define LANES 1
#include "raycast/cast/cast_shared.h"
#include "raycast/cast/jitter.clh"
#include "raycast/light/clear_paths_shared.h"
#include "raycast/light/clear_shared.h"
#include "raycast/light/clear_turn.clh"
#include "raycast/light/contact.clh"
#include "raycast/light/dielectric.clh"
#include "raycast/light/light.clh"
#include "raycast/light/paths_shared.h"
#include "raycast/light/raised.clh"

#define BLOCK_RAYS SCAN_BLOCK(KARST_PATH_BLOCK) /* as in paths.cl */

RAY_INLINE float dot_of(const vector3 *a, const vector3 *b)
{
    return k_fma(a->x, b->x, k_fma(a->y, b->y, a->z * b->z));
}

/* The share of light that is left after a way. */
RAY_INLINE float left_after(float absorption, float t) { return tone_exp2_minus(absorption * t * 1.44269504f); }

RAY_INLINE int on_something(uint kind) { return KARST_HIT_KIND(kind) != KARST_HIT_MISS; }

/* Where the camera's rays are. met: of rays whose index varies; else 0. */
__kernel void clear_paths_begin(karst_clear_path_task task, K_GLOBAL karst_clear_way *ways, K_GLOBAL uint *trails,
                                K_GLOBAL uint *met, K_GLOBAL const uint *count)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    const karst_clear_way way = {{task.absorption[0], task.absorption[1], task.absorption[2]},
                                 task.is_inside ? KARST_SIDE_BACK : KARST_SIDE_ANY,
                                 0.0f};
    ways[i] = way;
    trails[i] = KARST_PATH_LOOKED_FOR_NONE;
    if (met)
        met[i] = 1;
}

/* As clear_turn. */
__kernel void clear_paths_turn(K_GLOBAL karst_ray *rays, K_GLOBAL karst_clear_way *ways, K_GLOBAL const uint *count,
                               K_GLOBAL const karst_hit *hits)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    turn_to_other_matter(rays + i, ways + i);
    if (hits && hits[i].t < rays[i].t_max)
        rays[i].t_max = hits[i].t;
}

/* ---- where rays end ---- */

/* The light of a lamp that a ray sees, up to t away; `open`: nothing ends it. Of a surface that faces it a lamp's disc,
 * or ball, makes its colour: so it is as bright as that over the square of its radius. */
RAY_INLINE float seen_of_lamp(const karst_lamp *lamp, const karst_ray *ray, float t, int open, float *far)
{
    const vector3 d = {ray->direction[0], ray->direction[1], ray->direction[2]},
                  axis = {lamp->direction[0], lamp->direction[1], lamp->direction[2]};
    if (lamp->kind == KARST_LAMP_SUN) {
        const float radius = lamp->direction[3], along = dot_of(&d, &axis);
        const vector3 off = {k_fma(-along, axis.x, d.x), k_fma(-along, axis.y, d.y), k_fma(-along, axis.z, d.z)};
        *far = t;
        /* Its disc is flat: rays to it are even on that. */
        return open && along > 0.0f && radius > 0.0f && dot_of(&off, &off) <= radius * radius * along * along
                   ? 1.0f / (radius * radius * along * along * along)
                   : 0.0f;
    }
    const float radius = lamp->place[3];
    const vector3 to = {lamp->place[0] - ray->origin[0], lamp->place[1] - ray->origin[1],
                        lamp->place[2] - ray->origin[2]};
    const float along = dot_of(&to, &d);
    const vector3 off = {k_fma(-along, d.x, to.x), k_fma(-along, d.y, to.y), k_fma(-along, d.z, to.z)};
    const float square = k_fma(radius, radius, -dot_of(&off, &off));
    if (!(square > 0.0f) || !(radius > 0.0f))
        return 0.0f;
    *far = along - k_sqrt(square);
    if (!(*far > 0.0f) || *far >= t)
        return 0.0f;
    float strength = 1.0f / (radius * radius);
    if (lamp->kind == KARST_LAMP_SPOT)
        strength *= smooth(lamp->dark, lamp->bright, -dot_of(&d, &axis));
    return strength;
}

RAY_INLINE void add_lamps(const karst_clear_path_task *task, const karst_ray *ray, const karst_clear_way *way,
                          float t, int open, K_GLOBAL const karst_lamp *lamps, K_GLOBAL float *parts)
{
    const int inside = way->side == KARST_SIDE_BACK;
    const size_t plane = (size_t)task->width_px * (size_t)task->height_px;
    float sum[3] = {0.0f, 0.0f, 0.0f};
    for (uint k = 0; k < task->num_lamps; k++) {
        const karst_lamp lamp = lamps[k];
        float far = 0.0f;
        const float seen = lamp.shadow ? seen_of_lamp(&lamp, ray, t, open && !inside, &far) : 0.0f;
        if (!(seen > 0.0f))
            continue;
        for (int c = 0; c < 3; c++)
            sum[c] += lamp.colour[c] * seen * ray->throughput[c] *
                      (inside ? left_after(way->absorption[c], far) : 1.0f);
    }
    if (!(sum[0] + sum[1] + sum[2] > 0.0f))
        return;
    const uint pixel = ray->pixel & ~(KARST_PATH_SEES_SUN | KARST_PATH_MIRRORED);
    K_GLOBAL float *at = parts + karst_packet_order(pixel & 0xffffu, pixel >> 16, (uint)task->width_px,
                                                    (uint)task->height_px);
    for (int c = 0; c < 3; c++)
        at[(size_t)c * plane] += sum[c];
}

/* The nearer of each ray's two hits, where both touch the land's; over_hits: in clear matter. Rays that collide with a
 * medium before (collisions; 0: there is none) end there: what they come with is the collision's, and they bring
 * nothing from what is behind. */
__kernel void clear_paths_end(karst_clear_path_task task, K_GLOBAL karst_ray *rays,
                              K_GLOBAL const karst_clear_way *ways, K_GLOBAL const uint *trails,
                              K_GLOBAL const uint *count, K_GLOBAL const karst_hit *land_hits,
                              K_GLOBAL const karst_hit *over_hits, K_GLOBAL const karst_lamp *lamps,
                              K_GLOBAL karst_path_collision *collisions, K_GLOBAL karst_hit *hits,
                              K_GLOBAL float *parts)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    const karst_ray ray = rays[i];
    const karst_clear_way way = ways[i];
    karst_hit hit = land_hits[i];
    const karst_hit over = over_hits[i];
    const float touches = contact_begins(&hit, ray.direction[0], ray.direction[1], ray.direction[2]);
    if (on_something(over.kind) && (!on_something(hit.kind) || over.t < touches)) {
        const uint lacks = hit.kind & KARST_HIT_INCOMPLETE;
        hit = over;
        hit.kind |= lacks | KARST_PATH_HIT_CLEAR;
        hit.brick = hit.place = hit.node = 0; /* of the land's pools it is none */
    }
    const int collides = collisions && collisions[i].t < KARST_PATH_GOES_BY;
    if (collides) {
        hit.t = collisions[i].t;
        hit.kind &= ~KARST_PATH_HIT_CLEAR;
    }
    if (trails[i] == KARST_PATH_CROSSED && !task.again)
        add_lamps(&task, &ray, &way, hit.t, !collides && !on_something(hit.kind), lamps, parts);
    for (int c = 0; c < 3; c++) {
        const float left = way.side == KARST_SIDE_BACK ? left_after(way.absorption[c], hit.t) : 1.0f;
        if (collides)
            collisions[i].throughput[c] *= left;
        if (collides || way.side == KARST_SIDE_BACK)
            rays[i].throughput[c] = collides ? 0.0f : ray.throughput[c] * left;
    }
    hits[i] = hit;
}

/* ---- how they go on ---- */

/* To the sphere around the eye in which its view lies. */
RAY_INLINE float to_end(const vector3 *from, const vector3 *direction, float t_max)
{
    const float along = dot_of(from, direction), far = k_sqrt(dot_of(from, from));
    const float rest = k_max((t_max - far) * (t_max + far), 0.0f);
    return k_max(k_sqrt(k_fma(along, along, rest)) - along, 0.0f);
}

/* From a surface of clear matter: *out comes as the ray that met it, with what is left of its light. */
RAY_INLINE void part_at_surface(const karst_clear_path_task *task, const karst_ray *ray, const karst_hit *hit,
                                float ior, const float absorption_per_m[3], karst_ray *out, karst_clear_way *way)
{
    const int inside = way->side == KARST_SIDE_BACK;
    const vector3 d = {ray->direction[0], ray->direction[1], ray->direction[2]}, back = {-d.x, -d.y, -d.z},
                  to = {k_fma(d.x, hit->t, ray->origin[0]), k_fma(d.y, hit->t, ray->origin[1]),
                        k_fma(d.z, hit->t, ray->origin[2])};
    vector3 n = {hit->normal[0], hit->normal[1], hit->normal[2]};
    if (inside)
        n.x = -n.x, n.y = -n.y, n.z = -n.z;
    if (n.x == 0.0f && n.y == 0.0f && n.z == 0.0f)
        n = back;
    const dielectric turn = dielectric_of(&d, &n, inside ? ior : 1.0f / ior);
    const int x = (int)(ray->pixel & 0xffffu),
              y = (int)((ray->pixel & ~(KARST_PATH_SEES_SUN | KARST_PATH_MIRRORED)) >> 16);
    const float u = jitter_of(x + task->x0_px, y + task->y0_px, task->sample,
                              karst_path_purpose(task->bounce, KARST_PATH_OF_CHOICE))
                        .u;
    const int reflects = u < turn.reflected, stays = reflects ? inside : !inside;
    const vector3 on = reflects ? dielectric_reflected(&turn, &d, &n) : dielectric_refracted(&turn, &d, &n);
    for (int c = 0; c < 3; c++) {
        const float there = inside ? way->absorption[c] : k_max(absorption_per_m[c], 0.0f) * task->voxel_m;
        way->absorption[c] = stays ? there : 0.0f;
    }
    way->side = stays ? KARST_SIDE_BACK : KARST_SIDE_FRONT;
    way->t_min = stays ? 0.0f : raised_until((int)hit->kind, &n, reflects ? turn.cosine : turn.far_cosine);
    out->origin[0] = to.x, out->origin[1] = to.y, out->origin[2] = to.z;
    out->direction[0] = on.x, out->direction[1] = on.y, out->direction[2] = on.z;
    out->t_max = to_end(&to, &on, task->t_max);
    out->width = k_max(k_fma(hit->t, ray->cone, ray->width),
                       k_as_float((KARST_HIT_LEVEL(hit->kind) + 127u) << 23) * (1.0001f / task->detail));
    out->cone = ray->cone;
    out->pixel = ray->pixel & ~KARST_PATH_MIRRORED;
    out->side = KARST_SIDE_ANY;
}

/* next: rays as karst_shade_paths leaves them, for surfaces of clear matter with what is left of their light and, where
 * chance ends a path, idle. matter: planes of `room` rays. */
__kernel void clear_paths_go_on(karst_clear_path_task task, K_GLOBAL const karst_ray *rays,
                                K_GLOBAL const karst_clear_way *ways, K_GLOBAL const uint *trails,
                                K_GLOBAL const uint *count, K_GLOBAL const karst_hit *hits,
                                K_GLOBAL const float *matter, uint room, K_GLOBAL karst_ray *next,
                                K_GLOBAL karst_clear_way *next_ways, K_GLOBAL uint *next_trails,
                                K_GLOBAL karst_ray *to_lamps, K_GLOBAL uint *counters)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    const karst_ray ray = rays[i];
    const karst_hit hit = hits[i];
    karst_clear_way way = ways[i];
    way.t_min = 0.0f;
    uint trail = trails[i];
    const int inside = way.side == KARST_SIDE_BACK, clear = (hit.kind & KARST_PATH_HIT_CLEAR) != 0;
    const float to_lamp = to_lamps[i].t_max;
    if (to_lamp > 0.0f) {
        to_lamps[i].side = inside ? KARST_SIDE_BACK : KARST_SIDE_ANY; /* as it is cast into clear matter */
        for (int c = 0; inside && c < 3; c++)
            to_lamps[i].throughput[c] *= left_after(way.absorption[c], to_lamp);
    }
    if (task.is_last) {
        if (clear && !task.again)
            atomic_inc(&counters[KARST_CLEAR_COUNT_CUT]);
        return;
    }
    karst_ray out = next[i];
    if (out.t_max > 0.0f && clear) {
        float absorption[3];
        for (int c = 0; c < 3; c++)
            absorption[c] = matter[(size_t)(1 + c) * room + i];
        part_at_surface(&task, &ray, &hit, matter[i], absorption, &out, &way);
        trail = trail == KARST_PATH_LOOKED ? KARST_PATH_CROSSED : trail;
        if (task.is_sure && KARST_HIT_KIND(hit.kind) != KARST_HIT_SURFACE)
            out.t_max = 0.0f;
        next[i] = out;
    } else if (out.t_max > 0.0f) {
        way.side = inside ? KARST_SIDE_BACK : KARST_SIDE_ANY;
        if (out.side != KARST_SIDE_BACK) /* one that passes land knows what it knew */
            trail = task.from_starts || (out.pixel & KARST_PATH_SEES_SUN) ? KARST_PATH_LOOKED_FOR_NONE
                                                                          : KARST_PATH_LOOKED;
    }
    next_ways[i] = way;
    next_trails[i] = trail | (clear ? KARST_PATH_FROM_CLEAR : 0u);
}

/* Rays to lamps that clear matter hides bring no light; all are as they are cast into land. marks 0: none is hidden. */
__kernel void clear_paths_hide(K_GLOBAL karst_ray *to_lamps, K_GLOBAL const uint *count, K_GLOBAL const uint *marks)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    to_lamps[i].side = KARST_SIDE_FRONT;
    if (marks && marks[i])
        to_lamps[i].t_max = 0.0f;
}

/* As paths_pack, with what rays come with. */
__kernel void clear_paths_pack(K_GLOBAL const karst_ray *next, K_GLOBAL const karst_clear_way *next_ways,
                               K_GLOBAL const uint *next_trails, K_GLOBAL const uint *met,
                               K_GLOBAL const uint *count, K_GLOBAL const uint *begins, uint num_blocks,
                               uint again, K_GLOBAL karst_ray *rays, K_GLOBAL karst_clear_way *ways,
                               K_GLOBAL uint *trails, K_GLOBAL uint *next_met, K_GLOBAL uint *counters)
{
    const uint block = (uint)get_global_id(0), first = block * BLOCK_RAYS, num_rays = *count;
    if (block >= num_blocks)
        return;
    uint to = begins[block], num_clear = 0;
    for (uint i = first; i < first + BLOCK_RAYS && i < num_rays; i++) {
        if (!(next[i].t_max > 0.0f))
            continue;
        num_clear += (next_trails[i] & KARST_PATH_FROM_CLEAR) != 0;
        rays[to] = next[i];
        ways[to] = next_ways[i];
        trails[to] = next_trails[i] & ~KARST_PATH_FROM_CLEAR;
        if (met)
            next_met[to] = met[i] + 1;
        to++;
    }
    if (num_clear && !again)
        atomic_add(&counters[KARST_CLEAR_COUNT_RAYS], num_clear);
}
