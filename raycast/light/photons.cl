/* Photons: see raycast/light/photons.h. Casting them has lanes; what is done between casts is done one by one, on any
 * device. */
#undef LANES
#define LANES 1
#include "raycast/cast/cast_shared.h"
#include "raycast/cast/jitter.clh"
#include "raycast/light/clear_shared.h"
#include "raycast/light/dielectric.clh"
#include "raycast/light/light.clh"
#include "raycast/light/photons_shared.h"

/* What random numbers are for. */
#define PHOTON_PLACE 0x3c6ef372u
#define PHOTON_CHOICE 0x5be0cd19u
/* Powers of the root of x^5 = x + 1, below 1, in 2^32nds (M. Roberts' R-sequence of four numbers): their multiples are
 * spread evenly, together too. For the lamp's disc, and for the first two turns. */
#define PHOTON_DISC_U 0xdb4f0b91u
#define PHOTON_DISC_V 0xbbe05633u
#define PHOTON_TURN_0 0xa0f2ec75u
#define PHOTON_TURN_1 0x89e18285u

RAY_INLINE float dot_of(const vector3 *a, const vector3 *b)
{
    return k_fma(a->x, b->x, k_fma(a->y, b->y, a->z * b->z));
}

RAY_INLINE vector3 vector_of(const float v[4])
{
    const vector3 r = {v[0], v[1], v[2]};
    return r;
}

/* a u + b v + c w */
RAY_INLINE vector3 combine(const vector3 *a, float u, const vector3 *b, float v, const vector3 *c, float w)
{
    const vector3 r = {k_fma(a->x, u, k_fma(b->x, v, c->x * w)), k_fma(a->y, u, k_fma(b->y, v, c->y * w)),
                       k_fma(a->z, u, k_fma(b->z, v, c->z * w))};
    return r;
}

RAY_INLINE float length_of(const vector3 *v) { return k_sqrt(dot_of(v, v)); }

/* To the sphere around the eye in which its view lies. */
RAY_INLINE float to_end(const vector3 *from, const vector3 *direction, float t_max)
{
    const float along = dot_of(from, direction), far = length_of(from);
    const float rest = k_max((t_max - far) * (t_max + far), 0.0f);
    return k_max(k_sqrt(k_fma(along, along, rest)) - along, 0.0f);
}

RAY_INLINE float power_of(int exponent) { return k_as_float((uint)(exponent + 127) << 23); }

RAY_INLINE float unit_of(uint v) { return (float)(v >> 8) * (1.0f / 16777216.0f); }

RAY_INLINE uint scrambled(uint v)
{
    v ^= v >> 16;
    v *= 0x7feb352du;
    v ^= v >> 15;
    v *= 0x846ca68bu;
    return v ^ v >> 16;
}

RAY_INLINE float brightest(const float c[3]) { return k_max(c[0], k_max(c[1], c[2])); }

/* Of a photon's colours, in whole quanta. */
RAY_INLINE uint quanta(const karst_photon_task *task, const float flux[3])
{
    return (uint)(flux[0] * task->quantum) + (uint)(flux[1] * task->quantum) + (uint)(flux[2] * task->quantum);
}

/* ---- from lamps ---- */

/* The last cell that begins at or before a photon. */
RAY_INLINE uint cell_of(K_GLOBAL const karst_photon_cell *cells, uint num_cells, uint photon)
{
    uint low = 0, high = num_cells;
    while (high - low > 1) {
        const uint middle = low + (high - low) / 2;
        if (cells[middle].first <= photon)
            low = middle;
        else
            high = middle;
    }
    return low;
}

typedef struct {
    vector3 from, direction;
    float share;  /* of the lamp's colour that each unit of the cell's area or solid angle has there */
    float across; /* how wide the cell is, at the distance of what it shines on or, of a probe's sun, by itself */
} sent;

/* table: KARST_PHOTON_ROWS + 1 radii of a sun's rings; then as many directions around, two floats each. Rows are even
 * in area, columns in the angle but for what `share` mends: a column's points lie on the chord. */
RAY_INLINE sent send(const karst_photon_lamp *lamp, K_GLOBAL const float *table, uint cell, jitter at, jitter on)
{
    const uint row = cell / KARST_PHOTON_ROWS, column = cell % KARST_PHOTON_ROWS;
    K_GLOBAL const float *turns = table + KARST_PHOTON_ROWS + 1 + 2 * column;
    const float x = k_fma(at.v, turns[2] - turns[0], turns[0]), y = k_fma(at.v, turns[3] - turns[1], turns[1]);
    const float chord = k_fma(x, x, y * y), sine = k_fma(turns[0], turns[3], -turns[1] * turns[2]);
    const vector3 a = vector_of(lamp->across), b = vector_of(lamp->along), axis = vector_of(lamp->axis);
    sent s;
    if (lamp->kind == KARST_LAMP_SUN) {
        const float inner = table[row], outer = table[row + 1];
        const float radius = k_sqrt(k_fma(at.u, k_fma(outer, outer, -inner * inner), inner * inner));
        s.from = combine(&a, radius * x, &b, radius * y, &axis, 0.0f);
        const float disc = lamp->axis[3];
        vector3 to = combine(&a, on.u * disc, &b, on.v * disc, &axis, 1.0f);
        const float per = -1.0f / length_of(&to);
        s.direction.x = to.x * per, s.direction.y = to.y * per, s.direction.z = to.z * per;
        s.share = 1.0f;
        s.across = (outer - inner);
        return s;
    }
    const float step = (1.0f - lamp->least_cosine) / (float)KARST_PHOTON_ROWS;
    const float cosine = k_min(k_fma((float)row + at.u, step, lamp->least_cosine), 1.0f);
    const float around = k_sqrt(k_max(k_fma(-cosine, cosine, 1.0f), 0.0f) / chord);
    s.direction = combine(&a, around * x, &b, around * y, &axis, cosine);
    const float per = 1.0f / length_of(&s.direction);
    s.direction.x *= per, s.direction.y *= per, s.direction.z *= per;
    /* A ball looks the same from everywhere: light of a direction comes from a disc across it. */
    const vector3 *d = &s.direction, middle = vector_of(lamp->place);
    const float sign = d->z < 0.0f ? -1.0f : 1.0f, p = -1.0f / (sign + d->z), q = d->x * d->y * p;
    const vector3 right = {k_fma(sign * d->x * d->x, p, 1.0f), sign * q, -sign * d->x},
                  up = {q, k_fma(d->y * d->y, p, sign), -d->y};
    const float height = k_sqrt(k_max(1.0f - k_fma(on.u, on.u, on.v * on.v), 0.0f)), radius = lamp->place[3];
    s.from = combine(&right, on.u * radius, &up, on.v * radius, d, height * radius);
    s.from.x += middle.x, s.from.y += middle.y, s.from.z += middle.z;
    /* Of the angle: evenly along the chord is not evenly around. */
    s.share = sine / (chord * k_max(table[3 * KARST_PHOTON_ROWS + 3], 1.0e-6f));
    if (lamp->kind == KARST_LAMP_SPOT)
        s.share *= smooth(lamp->dark, lamp->bright, cosine);
    s.across = 0.0f;
    return s;
}

/* The batch's photons, or the probes of a lamp, as the first stream. */
__kernel void photons_send(karst_photon_task task, K_GLOBAL const karst_photon_lamp *lamps,
                           K_GLOBAL const karst_photon_cell *cells, K_GLOBAL const float *table,
                           K_GLOBAL karst_ray *rays, K_GLOBAL karst_clear_way *ways,
                           K_GLOBAL karst_photon_fate *fates, K_GLOBAL uint *count)
{
    const uint i = (uint)get_global_id(0), photon = karst_photon_of(task.batch, task.num_batches, i);
    const uint num = karst_photons_of_batch(task.num_photons, task.batch, task.num_batches);
    if (i == 0)
        *count = num;
    if (i >= num)
        return;
    karst_photon_cell cell = {photon, photon | task.lamp << 16, 0, 1u | 1u << 16, 1.0f, 0.0f};
    if (task.is_probe != 1)
        cell = cells[cell_of(cells, task.num_cells, photon)];
    const uint number = photon - cell.first, of_lamp = cell.cell & 0xffffu;
    const uint grid_rows = cell.grid & 0xffffu, grid_columns = cell.grid >> 16;
    const karst_photon_lamp lamp = lamps[cell.cell >> 16];
    const uint chance = scrambled(photon ^ PHOTON_PLACE);
    const float per_part = power_of(-(int)(cell.part >> 16));
    jitter at, on;
    at.u = ((float)(number / grid_columns) + (float)(chance >> 16) * 0x1p-16f) / (float)grid_rows;
    at.v = ((float)(number % grid_columns) + (float)(chance & 0xffffu) * 0x1p-16f) / (float)grid_columns;
    at.u = ((float)(cell.part & 0xffu) + at.u) * per_part;
    at.v = ((float)(cell.part >> 8 & 0xffu) + at.v) * per_part;
    on.u = unit_of(photon * PHOTON_DISC_U), on.v = unit_of(photon * PHOTON_DISC_V);
    on = jitter_on_disc(on);
    sent s = send(&lamp, table, of_lamp, at, on);
    const float nearest = length_of(&s.from);
    uint side = KARST_SIDE_ANY;
    float t_max;
    if (lamp.kind == KARST_LAMP_SUN) {
        const vector3 back = {-s.direction.x, -s.direction.y, -s.direction.z};
        const float before = to_end(&s.from, &back, task.t_max);
        s.from = combine(&s.from, 1.0f, &back, before, &back, 0.0f);
        t_max = to_end(&s.from, &s.direction, task.t_max);
    } else {
        /* Of a lamp outside the view, from where that begins. */
        const float along = dot_of(&s.from, &s.direction), far = nearest;
        const float square = k_fma(along, along, -(far - task.t_max) * (far + task.t_max));
        const int outside = far > task.t_max, meets = square > 0.0f && along < 0.0f;
        if (outside && meets) {
            const float before = -along - k_sqrt(square);
            s.from = combine(&s.from, 1.0f, &s.direction, before, &s.direction, 0.0f);
        }
        /* A body that glows may be where the lamp is. */
        side = outside ? KARST_SIDE_ANY : KARST_SIDE_FRONT;
        t_max = outside && !meets ? 0.0f : to_end(&s.from, &s.direction, task.t_max);
    }
    /* As fine as the picture sees what the cell shines on; probes half a cell and some pixels, or a place of a grid, so
     * that what is thinner is as wide. */
    float width = task.pixel_cone * cell.distance, cone = 0.0f;
    if (task.is_probe) {
        const float wide = task.is_probe == 1 ? 0.5f : 1.0f / (float)grid_rows;
        width = k_max(wide * s.across, task.is_probe == 1 ? 4.0f * task.pixel_cone * nearest : width);
        cone = lamp.kind == KARST_LAMP_SUN ? 0.0f : wide * table[3 * KARST_PHOTON_ROWS + 3];
    }
    const karst_ray ray = {{s.from.x, s.from.y, s.from.z},
                           0.0f,
                           {s.direction.x, s.direction.y, s.direction.z},
                           t_max,
                           width,
                           cone,
                           photon,
                           side,
                           {lamp.colour[0] * s.share * cell.share, lamp.colour[1] * s.share * cell.share,
                            lamp.colour[2] * s.share * cell.share},
                           0.0f};
    const uint inside = lamp.is_inside ? KARST_SIDE_BACK : KARST_SIDE_ANY;
    const karst_clear_way way = {{lamp.absorption[0], lamp.absorption[1], lamp.absorption[2]}, inside};
    const uint begins_as = lamp.is_inside ? KARST_PHOTON_TURNED : KARST_PHOTON_FLIES;
    const karst_photon_fate fate = {begins_as, quanta(&task, ray.throughput), 0, 0};
    rays[i] = ray;
    ways[i] = way;
    fates[i] = fate;
}

/* As clear_turn: rays are cast twice, with the side that they have in each kind of matter. */
__kernel void photons_turn(K_GLOBAL karst_ray *rays, K_GLOBAL karst_clear_way *ways, K_GLOBAL const uint *count)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    const uint side = rays[i].side;
    rays[i].side = ways[i].side;
    ways[i].side = side;
}

/* ---- at surfaces ---- */

typedef struct {
    int clear, land; /* which it met first: neither, or one */
    float t;
    vector3 to;
    karst_hit hit;
} photon_end;

RAY_INLINE photon_end end_of(const karst_photon_task *task, const karst_ray *ray, K_GLOBAL const karst_hit *hits,
                             K_GLOBAL const karst_hit *over_hits, uint i)
{
    photon_end e;
    if (task->has_land)
        e.hit = hits[i];
    e.land = task->has_land && KARST_HIT_KIND(e.hit.kind) != KARST_HIT_MISS;
    e.clear = 0;
    if (task->has_clear) {
        const karst_hit over = over_hits[i];
        e.clear = KARST_HIT_KIND(over.kind) != KARST_HIT_MISS && (!e.land || over.t < e.hit.t);
        if (e.clear)
            e.land = 0;
        if (e.clear || !task->has_land)
            e.hit = over;
    }
    e.t = e.hit.t;
    e.to.x = k_fma(ray->direction[0], e.t, ray->origin[0]);
    e.to.y = k_fma(ray->direction[1], e.t, ray->origin[1]);
    e.to.z = k_fma(ray->direction[2], e.t, ray->origin[2]);
    return e;
}

/* How far from the eye probes met first what mirrors or is clear; 0: they did not. mirrored: as photons_meet has it. */
__kernel void photons_look(karst_photon_task task, K_GLOBAL const karst_ray *rays, K_GLOBAL const uint *count,
                           K_GLOBAL const karst_hit *hits, K_GLOBAL const karst_hit *over_hits,
                           K_GLOBAL const karst_ray *mirrored, K_GLOBAL float *seen)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    const karst_ray ray = rays[i];
    const photon_end e = end_of(&task, &ray, hits, over_hits, i);
    const int turns = e.clear || (e.land && (mirrored[i].pixel & KARST_PATH_MIRRORED));
    seen[2 * i] = turns && ray.t_max > 0.0f ? length_of(&e.to) : 0.0f;
    seen[2 * i + 1] = e.t;
}

/* Photons that fly nowhere near the picture widen so many times as fast as its pixels. */
#define UNSEEN_CONE 8.0f

RAY_INLINE uint pack_axis(float v) { return (uint)((int)k_rint(k_fma(v, 511.0f, 512.0f)) & 1023); }
RAY_INLINE float unpack_axis(uint packed) { return ((float)(packed & 1023u) - 512.0f) * (1.0f / 511.0f); }

RAY_INLINE uint pack_normal(const vector3 *n)
{
    return pack_axis(n->x) | pack_axis(n->y) << 10 | pack_axis(n->z) << 20 | 1u << 30;
}

/* How far a ray flies until it is outside the picture for good; 0: it never is inside. The picture is as much wider as
 * photons are gathered from. */
RAY_INLINE float leaves_picture(const karst_pinhole *pinhole, float reach, const vector3 *from, const vector3 *way)
{
    const vector3 right = vector_of(pinhole->right), up = vector_of(pinhole->up), forward = vector_of(pinhole->forward);
    const float wide = pinhole->half_width + reach, high = pinhole->half_height + reach;
    const float x = dot_of(&right, from), y = dot_of(&up, from), z = dot_of(&forward, from);
    const float dx = dot_of(&right, way), dy = dot_of(&up, way), dz = dot_of(&forward, way);
    const float at[4] = {k_fma(wide, z, x), k_fma(wide, z, -x), k_fma(high, z, y), k_fma(high, z, -y)};
    const float rise[4] = {k_fma(wide, dz, dx), k_fma(wide, dz, -dx), k_fma(high, dz, dy), k_fma(high, dz, -dy)};
    float begin = 0.0f, end = 3.0e38f;
    for (int side = 0; side < 4; side++) {
        if (rise[side] < 0.0f)
            end = k_min(end, at[side] / -rise[side]);
        else if (rise[side] > 0.0f)
            begin = k_max(begin, -at[side] / rise[side]);
        else if (at[side] < 0.0f)
            end = 0.0f;
    }
    return end > begin ? end : 0.0f;
}

/* What becomes of each photon of a stream where it meets something: next has the rays that go on, others are idle.
 * next comes with the rays that land would have leave it (karst_shade_paths). room: rays of a plane of `matter`. The
 * batch's place is from photons[first] on; photons 0: they leave nothing. */
__kernel void photons_meet(karst_photon_task task, karst_pinhole pinhole, K_GLOBAL const karst_ray *rays,
                           K_GLOBAL const karst_clear_way *ways, K_GLOBAL const uint *count,
                           K_GLOBAL const karst_hit *hits, K_GLOBAL const karst_hit *over_hits,
                           K_GLOBAL const float *matter, uint room, K_GLOBAL karst_ray *next,
                           K_GLOBAL karst_clear_way *next_ways, K_GLOBAL karst_photon_fate *fates,
                           K_GLOBAL karst_photon *photons, uint first)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    const karst_ray ray = rays[i];
    const karst_clear_way way = ways[i];
    const photon_end e = end_of(&task, &ray, hits, over_hits, i);
    const int inside = way.side == KARST_SIDE_BACK;
    const uint place = karst_photon_ray(task.num_batches, ray.pixel);
    const vector3 d = {ray.direction[0], ray.direction[1], ray.direction[2]};
    karst_photon_fate fate = fates[place];
    karst_ray out = ray;
    karst_clear_way out_way = way;
    if (inside)
        for (int c = 0; c < 3; c++)
            out.throughput[c] *= tone_exp2_minus(way.absorption[c] * e.t * 1.44269504f);
    fate.lost += quanta(&task, ray.throughput) - quanta(&task, out.throughput);
    vector3 n = {e.hit.normal[0], e.hit.normal[1], e.hit.normal[2]};
    const vector3 back = {-d.x, -d.y, -d.z};
    if (n.x == 0.0f && n.y == 0.0f && n.z == 0.0f)
        n = back;
    vector3 way_on = back;
    uint end = KARST_PHOTON_ESCAPED; /* unless it goes on */
    int goes_on = 0;
    if (e.clear) {
        goes_on = !task.is_last;
        end = KARST_PHOTON_CUT;
        if (inside)
            n.x = -n.x, n.y = -n.y, n.z = -n.z;
        const float ior = matter[i];
        const dielectric turn = dielectric_of(&d, &n, inside ? ior : 1.0f / ior);
        /* Turns must know nothing of one another. The first two of a run's photons are spread evenly; runs know nothing
         * of one another, lest there be stripes. */
        uint chance = ray.pixel * (task.generation == 0 ? PHOTON_TURN_0 : PHOTON_TURN_1);
        chance += scrambled(ray.pixel / KARST_PHOTON_RUN ^ (PHOTON_CHOICE + task.generation));
        if (task.generation > 1)
            chance = scrambled(ray.pixel ^ (PHOTON_CHOICE + task.generation * 0x9e3779b1u));
        const float u = unit_of(chance);
        const int reflects = u < turn.reflected, stays = reflects ? inside : !inside;
        way_on = reflects ? dielectric_reflected(&turn, &d, &n) : dielectric_refracted(&turn, &d, &n);
        for (int c = 0; c < 3; c++) {
            const float there = inside ? way.absorption[c] : matter[(size_t)(1 + c) * room + i] * task.voxel_m;
            out_way.absorption[c] = stays ? there : 0.0f;
        }
        out.side = KARST_SIDE_ANY;
        out_way.side = stays ? KARST_SIDE_BACK : KARST_SIDE_FRONT;
    } else if (e.land) {
        const karst_ray from_land = next[i];
        if (from_land.pixel & KARST_PATH_MIRRORED) {
            goes_on = !task.is_last;
            end = KARST_PHOTON_CUT;
            way_on.x = from_land.direction[0], way_on.y = from_land.direction[1], way_on.z = from_land.direction[2];
            out.side = KARST_SIDE_FRONT;
            out_way.side = inside ? KARST_SIDE_BACK : KARST_SIDE_ANY;
        } else {
            end = fate.fate == KARST_PHOTON_TURNED ? KARST_PHOTON_LANDED : KARST_PHOTON_DIRECT;
        }
    }
    if (task.is_sure && (e.clear || e.land) && KARST_HIT_KIND(e.hit.kind) != KARST_HIT_SURFACE) {
        goes_on = 0;
        end = KARST_PHOTON_UNSURE;
    }
    if (goes_on && brightest(out.throughput) > 0.0f) {
        const float far = length_of(&e.to), level = k_as_float((KARST_HIT_LEVEL(e.hit.kind) + 127u) << 23);
        out.origin[0] = e.to.x, out.origin[1] = e.to.y, out.origin[2] = e.to.z;
        out.direction[0] = way_on.x, out.direction[1] = way_on.y, out.direction[2] = way_on.z;
        out.t_max = to_end(&e.to, &way_on, task.t_max);
        /* As fine as the picture: no wider than its pixels are anywhere on the way, but for what comes nearer. */
        out.width = k_max(task.pixel_cone * far, level * (1.0001f / task.detail));
        out.cone = k_max(dot_of(&e.to, &way_on) / k_max(far, 1.0e-6f), 0.0f) * task.pixel_cone;
        /* Where nobody looks, far less does: twice as wide at the picture's edge, and on like that. */
        const float seen = leaves_picture(&pinhole, 2.0f * task.reach, &e.to, &way_on);
        if (seen > 0.0f)
            out.cone = k_max(out.cone, k_min(out.width / seen, 1.0f));
        else
            out.cone = k_max(out.cone, UNSEEN_CONE * task.pixel_cone);
        fate.fate = KARST_PHOTON_TURNED;
    } else {
        out.t_max = 0.0f;
        fate.fate = goes_on ? KARST_PHOTON_ESCAPED : end;
        fate.left = quanta(&task, out.throughput);
        if (fate.fate == KARST_PHOTON_LANDED && photons) {
            const karst_photon photon = {{e.to.x, e.to.y, e.to.z},
                                         0,
                                         {out.throughput[0], out.throughput[1], out.throughput[2]},
                                         pack_normal(&n)};
            photons[first + place] = photon;
        }
    }
    next[i] = out;
    next_ways[i] = out_way;
    fates[place] = fate;
}

/* ---- streams without gaps: as paths_count, paths_scan, paths_pack ---- */

__kernel void photons_count(K_GLOBAL const karst_ray *next, K_GLOBAL const uint *count, K_GLOBAL uint *counts,
                            uint num_blocks)
{
    const uint block = (uint)get_global_id(0), first = block * KARST_PHOTON_BLOCK, num_rays = *count;
    if (block >= num_blocks)
        return;
    uint num = 0;
    for (uint i = first; i < first + KARST_PHOTON_BLOCK && i < num_rays; i++)
        num += next[i].t_max > 0.0f;
    counts[block] = num;
}

/* From counts to where each block begins, and how many there are in all. One work-item. */
__kernel void photons_scan(K_GLOBAL uint *counts, uint num_blocks, K_GLOBAL uint *total)
{
    uint sum = 0;
    for (uint i = 0; i < num_blocks; i++) {
        const uint here = counts[i];
        counts[i] = sum;
        sum += here;
    }
    *total = sum;
}

__kernel void photons_pack(K_GLOBAL const karst_ray *next, K_GLOBAL const karst_clear_way *next_ways,
                           K_GLOBAL const uint *count, K_GLOBAL const uint *begins, uint num_blocks,
                           K_GLOBAL karst_ray *rays, K_GLOBAL karst_clear_way *ways)
{
    const uint block = (uint)get_global_id(0), first = block * KARST_PHOTON_BLOCK, num_rays = *count;
    if (block >= num_blocks)
        return;
    uint to = begins[block];
    for (uint i = first; i < first + KARST_PHOTON_BLOCK && i < num_rays; i++)
        if (next[i].t_max > 0.0f) {
            rays[to] = next[i];
            ways[to++] = next_ways[i];
        }
}

/* ---- where all energy went ---- */

__kernel void photons_sum(K_GLOBAL const karst_photon_fate *fates, uint num, K_GLOBAL ulong *sums)
{
    const uint item = (uint)get_global_id(0), first = item * KARST_PHOTON_SUM_RAYS;
    ulong sum[KARST_PHOTON_SUMS] = {0, 0, 0, 0, 0, 0, 0};
    if (first >= num)
        return;
    for (uint i = first; i < first + KARST_PHOTON_SUM_RAYS && i < num; i++) {
        const karst_photon_fate fate = fates[i];
        sum[KARST_PHOTON_SUM_GIVEN] += fate.given;
        sum[KARST_PHOTON_SUM_LOST] += fate.lost;
        sum[KARST_PHOTON_SUM_LANDED] += fate.fate == KARST_PHOTON_LANDED ? fate.left : 0;
        sum[KARST_PHOTON_SUM_DIRECT] += fate.fate == KARST_PHOTON_DIRECT ? fate.left : 0;
        sum[KARST_PHOTON_SUM_ESCAPED] += fate.fate == KARST_PHOTON_ESCAPED ? fate.left : 0;
        sum[KARST_PHOTON_SUM_CUT] += fate.fate == KARST_PHOTON_CUT ? fate.left : 0;
        sum[KARST_PHOTON_SUM_NUM_LANDED] += fate.fate == KARST_PHOTON_LANDED;
    }
    for (int s = 0; s < KARST_PHOTON_SUMS; s++)
        sums[item * KARST_PHOTON_SUMS + (uint)s] = sum[s];
}

/* ---- the grid ----
 *
 * A photon is looked for within `reach` of its distance from the eye. A cell is as wide as the power of two above
 * that, so neighbours are of the same width or the next. */

typedef struct {
    int exponent; /* of the cell's width */
    int x, y, z;
} grid_cell;

/* The exponent of the power of two above, of positive floats. */
RAY_INLINE int exponent_above(float v) { return (int)(k_as_uint(v) >> 23) - 126; }
RAY_INLINE int cell_at(float v, float per) { return (int)k_floor(v * per); }

/* Different for all cells that are looked at together. */
RAY_INLINE uint tag_of(const grid_cell *c)
{
    return ((uint)c->x & 1023u) | ((uint)c->y & 1023u) << 10 | ((uint)c->z & 1023u) << 20 | (uint)c->exponent << 30;
}

RAY_INLINE uint bucket_of(const grid_cell *c, uint mask)
{
    uint h = (uint)c->x * 0x9e3779b1u ^ (uint)c->y * 0x85ebca77u ^ (uint)c->z * 0xc2b2ae3du ^
             (uint)c->exponent * 0x27d4eb2fu;
    h ^= h >> 15;
    h *= 0x2c1b3c6du;
    h ^= h >> 12;
    return h & mask;
}

RAY_INLINE grid_cell cell_of_place(const karst_photon_task *task, const float place[3])
{
    const vector3 at = {place[0], place[1], place[2]};
    grid_cell c;
    c.exponent = exponent_above(k_max(task->reach * length_of(&at), 1.0e-6f));
    const float per = power_of(-c.exponent);
    c.x = cell_at(at.x, per), c.y = cell_at(at.y, per), c.z = cell_at(at.z, per);
    return c;
}

/* How many of each bucket: `buckets` begin with zeros. */
__kernel void photons_tag(karst_photon_task task, K_GLOBAL karst_photon *photons, uint num, K_GLOBAL uint *buckets)
{
    const uint i = (uint)get_global_id(0);
    if (i >= num || !photons[i].normal)
        return;
    const float place[3] = {photons[i].place[0], photons[i].place[1], photons[i].place[2]};
    const grid_cell c = cell_of_place(&task, place);
    photons[i].tag = tag_of(&c);
    atomic_inc(&buckets[bucket_of(&c, task.mask)]);
}

__kernel void photons_block_sums(K_GLOBAL const uint *buckets, K_GLOBAL uint *sums, uint num_blocks)
{
    const uint block = (uint)get_global_id(0);
    if (block >= num_blocks)
        return;
    uint sum = 0;
    for (uint i = 0; i < KARST_PHOTON_BLOCK; i++)
        sum += buckets[block * KARST_PHOTON_BLOCK + i];
    sums[block] = sum;
}

/* Where each bucket begins; counts are zeros again. */
__kernel void photons_begins(K_GLOBAL uint *buckets, K_GLOBAL const uint *sums, K_GLOBAL uint *begins, uint num_blocks)
{
    const uint block = (uint)get_global_id(0);
    if (block >= num_blocks)
        return;
    uint sum = sums[block];
    for (uint i = block * KARST_PHOTON_BLOCK; i < (block + 1) * KARST_PHOTON_BLOCK; i++) {
        begins[i] = sum;
        sum += buckets[i];
        buckets[i] = 0;
    }
}

/* In any order within a bucket: what is gathered is summed in whole numbers. */
__kernel void photons_sort(karst_photon_task task, K_GLOBAL const karst_photon *photons, uint num,
                           K_GLOBAL uint *buckets, K_GLOBAL const uint *begins, K_GLOBAL karst_photon *sorted)
{
    const uint i = (uint)get_global_id(0);
    if (i >= num || !photons[i].normal)
        return;
    const float place[3] = {photons[i].place[0], photons[i].place[1], photons[i].place[2]};
    const grid_cell c = cell_of_place(&task, place);
    const uint bucket = bucket_of(&c, task.mask);
    sorted[begins[bucket] + atomic_inc(&buckets[bucket])] = photons[i];
}

/* ---- gathering ---- */

/* What one photon may add, in quanta: 2^24 of them stay within a long. */
#define MOST_QUANTA 2.7e11f
/* Photons on land that looks another way, or lies behind, are not of this surface. */
#define LEAST_COSINE 0.5f
#define FLATNESS 0.35f

typedef struct {
    vector3 at, normal;
    float radius, per_square, norm;
    long sum[3];
} gathered;

RAY_INLINE void gather_cell(const karst_photon_task *task, K_GLOBAL const karst_photon *sorted,
                            K_GLOBAL const uint *buckets, K_GLOBAL const uint *begins, const grid_cell *c, gathered *g)
{
    const uint tag = tag_of(c), bucket = bucket_of(c, task->mask), begin = begins[bucket], num = buckets[bucket];
    for (uint i = begin; i < begin + num; i++) {
        K_GLOBAL const karst_photon *p = &sorted[i];
        const vector3 to = {p->place[0] - g->at.x, p->place[1] - g->at.y, p->place[2] - g->at.z};
        const float square = dot_of(&to, &to) * g->per_square;
        if (!(square < 1.0f) || p->tag != tag)
            continue;
        const vector3 n = {unpack_axis(p->normal), unpack_axis(p->normal >> 10), unpack_axis(p->normal >> 20)};
        const float high = dot_of(&to, &g->normal);
        if (!(dot_of(&n, &g->normal) > LEAST_COSINE) || !(k_fabs(high) <= FLATNESS * g->radius))
            continue;
        const float weight = (1.0f - square) * g->norm;
        for (int k = 0; k < 3; k++)
            g->sum[k] += (long)k_min(p->flux[k] * weight, MOST_QUANTA);
    }
}

/* Adds to the parts what photons make of the surfaces that rays stand for: each starts in its surface, along the
 * normal, and its throughput is what of the light that falls there reaches its pixel. */
__kernel void photons_gather(karst_photon_task task, K_GLOBAL const karst_ray *rays, K_GLOBAL const uint *count,
                             K_GLOBAL const karst_photon *sorted, K_GLOBAL const uint *buckets,
                             K_GLOBAL const uint *begins, int width_px, int height_px, K_GLOBAL float *parts)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count || !(rays[i].t_max > 0.0f))
        return;
    const karst_ray ray = rays[i];
    gathered g;
    g.at.x = ray.origin[0] + task.offset[0], g.at.y = ray.origin[1] + task.offset[1];
    g.at.z = ray.origin[2] + task.offset[2];
    g.normal.x = ray.direction[0], g.normal.y = ray.direction[1], g.normal.z = ray.direction[2];
    const float far = length_of(&g.at);
    g.radius = k_max(task.reach * far, 1.0e-6f);
    g.per_square = 1.0f / (g.radius * g.radius);
    /* V. Epanechnikov's kernel on a disc. */
    g.norm = g.per_square * (2.0f / 3.14159265f) * task.scale;
    g.sum[0] = g.sum[1] = g.sum[2] = 0;
    const int finest = exponent_above(k_max(task.reach * (far - g.radius), 1.0e-6f));
    const int coarsest = exponent_above(k_max(task.reach * (far + g.radius), 1.0e-6f));
    for (int exponent = finest; exponent <= coarsest; exponent++) {
        const float per = power_of(-exponent);
        grid_cell c;
        c.exponent = exponent;
        for (c.z = cell_at(g.at.z - g.radius, per); c.z <= cell_at(g.at.z + g.radius, per); c.z++)
            for (c.y = cell_at(g.at.y - g.radius, per); c.y <= cell_at(g.at.y + g.radius, per); c.y++)
                for (c.x = cell_at(g.at.x - g.radius, per); c.x <= cell_at(g.at.x + g.radius, per); c.x++)
                    gather_cell(&task, sorted, buckets, begins, &c, &g);
    }
    const uint place = karst_packet_order(ray.pixel & 0xffffu, ray.pixel >> 16 & 0x3fffu, (uint)width_px,
                                          (uint)height_px);
    const size_t plane = (size_t)width_px * (size_t)height_px;
    const float per = task.whole / task.scale;
    for (int k = 0; k < 3; k++)
        parts[(size_t)k * plane + place] += ray.throughput[k] * ((float)g.sum[k] * per);
}
