/* Light maps: see raycast/light/light_map.h. Done place by place, on any device. */
#undef LANES
#define LANES 1
#include "raycast/cast/cast_shared.h"
#include "raycast/cast/jitter.clh"
#include "raycast/light/light.clh"
#include "raycast/light/light_map_shared.h"
#include "raycast/rays_shared.h"

/* Points of surfaces that look another way, or lie that many radii behind, are not of this one. */
#define LEAST_COSINE 0.25f
#define FLATNESS 0.5f
/* Where points together count that much, light is theirs alone: one of them, in the middle of its radius. */
#define WHOLE 0.25f

typedef struct {
    vector3 at, normal;
    float covered, weight, sum[3];
} map_sums;

RAY_INLINE float dot_of(const vector3 *a, const vector3 *b)
{
    return k_fma(a->x, b->x, k_fma(a->y, b->y, a->z * b->z));
}

RAY_INLINE float unpacked(uint bits) { return (float)((int)(bits & 1023u) - 512) * (1.0f / 511.0f); }

RAY_INLINE void add_cell(K_GLOBAL const karst_light_map_record *points, K_GLOBAL const uint *begins,
                         K_GLOBAL const uint *entries, uint bucket, int level, int finest_level, map_sums *s)
{
    for (uint i = begins[bucket]; i < begins[bucket + 1]; i++) {
        const karst_light_map_record p = points[entries[i]];
        const vector3 to = {p.place[0] - s->at.x, p.place[1] - s->at.y, p.place[2] - s->at.z};
        const float per = 1.0f / (p.radius * p.radius), square = dot_of(&to, &to) * per;
        const int own_level = karst_light_map_level(p.radius);
        /* Cells of two levels may share a bucket. */
        if (!(square < 1.0f) || (own_level > finest_level ? own_level : finest_level) != level)
            continue;
        const vector3 n = {unpacked(p.normal), unpacked(p.normal >> 10), unpacked(p.normal >> 20)};
        const float cosine = dot_of(&n, &s->normal);
        if (!(cosine > LEAST_COSINE) || !(k_fabs(dot_of(&to, &s->normal)) <= FLATNESS * p.radius))
            continue;
        const float counts = (1.0f - square) * (1.0f - square) * cosine, weight = counts * per;
        s->covered += counts;
        s->weight += weight;
        for (int c = 0; c < 3; c++)
            s->sum[c] = k_fma(p.light[c], weight, s->sum[c]);
    }
}

/* The number of a cell; far from all points any that none lies in. */
RAY_INLINE int cell_at(float v, float per) { return (int)k_floor(k_min(k_max(v * per, -1.0e9f), 1.0e9f)); }

__kernel void light_map_gather(karst_light_map_task task, karst_light light, K_GLOBAL const karst_ray *rays,
                               K_GLOBAL const uint *count, K_GLOBAL const karst_light_map_record *points,
                               K_GLOBAL const uint *begins, K_GLOBAL const uint *entries, K_GLOBAL float *parts)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count || !(rays[i].t_max > 0.0f))
        return;
    const karst_ray ray = rays[i];
    map_sums s;
    s.at.x = ray.origin[0] + task.offset[0], s.at.y = ray.origin[1] + task.offset[1];
    s.at.z = ray.origin[2] + task.offset[2];
    s.normal.x = ray.direction[0], s.normal.y = ray.direction[1], s.normal.z = ray.direction[2];
    s.covered = s.weight = s.sum[0] = s.sum[1] = s.sum[2] = 0.0f;
    for (int l = 0; l < KARST_LIGHT_MAP_LEVELS; l++) {
        if (!(task.levels >> l & 1u))
            continue;
        const int level = task.finest_level + l;
        const float per = karst_light_map_power(-level);
        const uint bucket = karst_light_map_bucket(cell_at(s.at.x, per), cell_at(s.at.y, per),
                                                   cell_at(s.at.z, per), level, task.mask);
        add_cell(points, begins, entries, bucket, level, task.finest_level, &s);
    }
    if (!(s.weight > 0.0f))
        return;
    const colour around = light_from_around(&light, &s.normal);
    const float taken[3] = {around.r, around.g, around.b};
    const float share = k_min(s.covered * (1.0f / WHOLE), 1.0f), mean = 1.0f / s.weight;
    const uint place = karst_packet_order(ray.pixel & 0xffffu, ray.pixel >> 16 & 0x3fffu, (uint)task.width_px,
                                          (uint)task.height_px);
    const size_t plane = (size_t)task.width_px * (size_t)task.height_px;
    for (int c = 0; c < 3; c++)
        parts[(size_t)c * plane + place] += ray.throughput[c] * share * (s.sum[c] * mean - taken[c]);
}
