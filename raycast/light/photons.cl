/* Photons: see raycast/light/photons.h. Casting them has lanes; what is done between casts is done one by one, on any
 * device. */
#include "raycast/light/scan.clh"

#undef LANES
#define LANES 1
#include "raycast/cast/cast_shared.h"
#include "raycast/cast/jitter.clh"
#include "raycast/light/clear_shared.h"
#include "raycast/light/clear_turn.clh"
#include "raycast/light/contact.clh"
#include "raycast/light/dielectric.clh"
#include "raycast/light/light.clh"
#include "raycast/light/photons_shared.h"
#include "raycast/light/raised.clh"

#define BLOCK_RAYS SCAN_BLOCK(KARST_PHOTON_BLOCK)

/* What random numbers are for. */
#define PHOTON_PLACE 0x3c6ef372u
#define PHOTON_CHOICE 0x5be0cd19u
/* Powers of the root of x^3 = x + 1, below 1, in 2^32nds (M. Roberts' R-sequence of two numbers): their multiples are
 * spread evenly, together too. For the disc of a lamp. */
#define PHOTON_DISC_U 0xc13fa9a9u
#define PHOTON_DISC_V 0x91e10da5u

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
        /* From the disc's middle: what light from all over it blurs, spots say (photon_grid.cl). */
        s.direction.x = -axis.x, s.direction.y = -axis.y, s.direction.z = -axis.z;
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

/* The batch's photons, or those of a list of its places, or the probes of a lamp that such a list names, as the first
 * stream. What photons left before is forgotten. */
__kernel void photons_send(karst_photon_task task, K_GLOBAL const karst_photon_lamp *lamps,
                           K_GLOBAL const karst_photon_cell *cells, K_GLOBAL const float *table,
                           K_GLOBAL const uint *list, K_GLOBAL karst_ray *rays, K_GLOBAL karst_clear_way *ways,
                           K_GLOBAL karst_photon_fate *fates, K_GLOBAL karst_photon *photons, K_GLOBAL uint *count)
{
    const uint i = (uint)get_global_id(0);
    const uint num = task.num_listed ? task.num_listed
                                     : karst_photons_of_batch(task.num_photons, task.batch, task.num_batches);
    if (i == 0)
        *count = num;
    if (i >= num)
        return;
    const uint of_batch = task.num_listed ? list[i] : i;
    const uint photon = karst_photon_of(task.batch, task.num_batches, of_batch);
    karst_photon_cell cell = {photon, photon | task.lamp << 16, 0, 1u | 1u << 16, 1.0f, 0.0f};
    if (task.is_probe != 1)
        cell = cells[karst_photon_find(cells, task.num_cells, photon)];
    const uint number = photon - cell.first, of_lamp = cell.cell & 0xffffu;
    const uint grid_rows = cell.grid & 0xffffu, grid_columns = cell.grid >> 16;
    const karst_photon_lamp lamp = lamps[cell.cell >> 16];
    /* The middles of photons' places, so that their neighbours say how the light between them spreads. */
    const uint chance = task.is_probe ? scrambled(photon ^ PHOTON_PLACE) : 0x80008000u;
    const float per_part = power_of(-(int)(cell.part >> 16));
    jitter at, on;
    at.u = ((float)(number / grid_columns) + (float)(chance >> 16) * 0x1p-16f) / (float)grid_rows;
    at.v = ((float)(number % grid_columns) + (float)(chance & 0xffffu) * 0x1p-16f) / (float)grid_columns;
    at.u = ((float)(cell.part & 0xffu) + at.u) * per_part;
    at.v = ((float)(cell.part >> 8 & 0xffu) + at.v) * per_part;
    on.u = unit_of(photon * PHOTON_DISC_U), on.v = unit_of(photon * PHOTON_DISC_V);
    on = jitter_on_disc(on);
    if (task.is_probe)
        on.u = on.v = 0.0f;
    sent s = send(&lamp, table, of_lamp, at, on);
    const float nearest = length_of(&s.from);
    uint side = KARST_SIDE_ANY;
    float t_max;
    if (lamp.kind == KARST_LAMP_SUN) {
        const vector3 back = vector_of(lamp.axis);
        s.from = combine(&s.from, 1.0f, &back, to_end(&s.from, &back, task.t_max), &back, 0.0f);
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
    const karst_clear_way way = {{lamp.absorption[0], lamp.absorption[1], lamp.absorption[2]}, inside, 0.0f};
    rays[i] = ray;
    ways[i] = way;
    if (task.is_probe)
        return;
    karst_photon_fate fate = {lamp.is_inside ? KARST_PHOTON_TURNED : KARST_PHOTON_FLIES,
                              quanta(&task, ray.throughput), 0, 0, 0};
    for (uint slot = 0; slot < KARST_PHOTON_SLOTS; slot++) {
        fates[slot * task.batch_rays + of_batch] = fate;
        photons[karst_photon_record(task.batch, task.batch_rays, slot, of_batch)].normal = 0;
        fate.fate = KARST_PHOTON_NOTHING;
        fate.given = 0;
    }
}

__kernel void photons_turn(K_GLOBAL karst_ray *rays, K_GLOBAL karst_clear_way *ways, K_GLOBAL const uint *count)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    turn_to_other_matter(rays + i, ways + i);
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
        e.clear = KARST_HIT_KIND(over.kind) != KARST_HIT_MISS;
        if (e.clear && e.land)
            e.clear = over.t < contact_begins(&e.hit, ray->direction[0], ray->direction[1], ray->direction[2]);
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

RAY_INLINE int lacks(const photon_end *e) { return (e->clear || e->land) && (e->hit.kind & KARST_HIT_MISSING); }

/* How far from the eye probes met first what mirrors or is clear, by their numbers; 0: they did not; -1: they met what
 * is missing. mirrored: as photons_meet has it. */
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
    const float distance = turns && ray.t_max > 0.0f ? length_of(&e.to) : 0.0f;
    seen[2 * ray.pixel] = lacks(&e) ? -1.0f : distance;
    seen[2 * ray.pixel + 1] = e.t;
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

/* Light that a surface parts: what goes through, or stays with land, and what is mirrored. */
typedef struct {
    float share[2];
    vector3 way[2];
    uint goes_on[2];
    uint side[2], clear_side[2]; /* of the rays */
    float clear_from[2];         /* karst_clear_way.t_min */
    uint stays[2];               /* in what it was in: the clear matter on its way does not change */
    uint end;                    /* of what does not go on */
} photon_turn;

/* from_land: the ray that land would have leave it, with the share of light that is mirrored. */
RAY_INLINE photon_turn turn_of(const karst_photon_task *task, const karst_ray *ray, const karst_clear_way *way,
                               const photon_end *e, const vector3 *normal, float ior, const karst_ray *from_land,
                               uint fate)
{
    const vector3 d = vector_of(ray->direction), back = {-d.x, -d.y, -d.z};
    const uint inside = way->side == KARST_SIDE_BACK;
    photon_turn t = {{1.0f, 0.0f}, {back, back}, {0, 0}, {KARST_SIDE_ANY, KARST_SIDE_ANY}, {0, 0},
                     {0.0f, 0.0f}, {1, 1},
                     KARST_PHOTON_ESCAPED};
    if (e->clear) {
        vector3 n = *normal;
        if (inside)
            n.x = -n.x, n.y = -n.y, n.z = -n.z;
        const dielectric bend = dielectric_of(&d, &n, inside ? ior : 1.0f / ior);
        t.share[0] = 1.0f - bend.reflected, t.share[1] = bend.reflected;
        t.way[0] = dielectric_refracted(&bend, &d, &n), t.way[1] = dielectric_reflected(&bend, &d, &n);
        t.goes_on[0] = t.goes_on[1] = 1;
        t.stays[0] = 0;
        t.clear_side[0] = inside ? KARST_SIDE_FRONT : KARST_SIDE_BACK;
        t.clear_side[1] = inside ? KARST_SIDE_BACK : KARST_SIDE_FRONT;
        t.clear_from[inside ? 0 : 1] =
            raised_until((int)e->hit.kind, &n, inside ? bend.far_cosine : bend.cosine);
        t.end = KARST_PHOTON_CUT;
    } else if (e->land) {
        t.end = fate == KARST_PHOTON_TURNED ? KARST_PHOTON_LANDED : KARST_PHOTON_DIRECT;
        if (from_land->pixel & KARST_PATH_MIRRORED) {
            const float share = brightest(from_land->throughput) / k_max(brightest(ray->throughput), 1.0e-30f);
            t.share[1] = k_min(share, 1.0f);
            t.share[0] = 1.0f - t.share[1];
            t.way[1] = vector_of(from_land->direction);
            t.goes_on[1] = 1;
            t.side[1] = KARST_SIDE_FRONT;
            t.clear_side[1] = inside ? KARST_SIDE_BACK : KARST_SIDE_ANY;
        }
    }
    return t;
}

/* A ray on from where one ended. */
RAY_INLINE void go_on(const karst_photon_task *task, const karst_pinhole *pinhole, const photon_end *e,
                      const vector3 *way, karst_ray *out)
{
    const float far = length_of(&e->to), level = k_as_float((KARST_HIT_LEVEL(e->hit.kind) + 127u) << 23);
    out->origin[0] = e->to.x, out->origin[1] = e->to.y, out->origin[2] = e->to.z;
    out->direction[0] = way->x, out->direction[1] = way->y, out->direction[2] = way->z;
    out->t_max = to_end(&e->to, way, task->t_max);
    /* As fine as the picture: no wider than its pixels are anywhere on the way, but for what comes nearer. */
    out->width = k_max(task->pixel_cone * far, level * (1.0001f / task->detail));
    out->cone = k_max(dot_of(&e->to, way) / k_max(far, 1.0e-6f), 0.0f) * task->pixel_cone;
    /* Where nobody looks, far less does: twice as wide at the picture's edge, and on like that. */
    const float seen = leaves_picture(pinhole, 2.0f * task->reach, &e->to, way);
    if (seen > 0.0f)
        out->cone = k_max(out->cone, k_min(out->width / seen, 1.0f));
    else
        out->cone = k_max(out->cone, UNSEEN_CONE * task->pixel_cone);
}

/* What becomes of each ray of a stream where it meets something: born has room for task.parts of each, one after the
 * other, and gets those that go on; others are idle. next: the rays that land would have leave it (karst_shade_paths).
 * room: rays of a plane of `matter`. */
__kernel void photons_meet(karst_photon_task task, karst_pinhole pinhole, K_GLOBAL const karst_ray *rays,
                           K_GLOBAL const karst_clear_way *ways, K_GLOBAL const uint *count,
                           K_GLOBAL const karst_hit *hits, K_GLOBAL const karst_hit *over_hits,
                           K_GLOBAL const float *matter, uint room, K_GLOBAL const karst_ray *next,
                           K_GLOBAL karst_ray *born, K_GLOBAL karst_clear_way *born_ways,
                           K_GLOBAL karst_photon_fate *fates, K_GLOBAL karst_photon *photons)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    const karst_ray ray = rays[i];
    const karst_clear_way way = ways[i];
    const photon_end e = end_of(&task, &ray, hits, over_hits, i);
    const uint place = karst_photon_place(task.num_batches, ray.pixel & KARST_PHOTON_NUMBER);
    const uint slot = ray.pixel >> KARST_PHOTON_SLOT_SHIFT & (KARST_PHOTON_SLOTS - 1u);
    karst_photon_fate fate = fates[slot * task.batch_rays + place];
    karst_ray out = ray;
    if (way.side == KARST_SIDE_BACK)
        for (int c = 0; c < 3; c++)
            out.throughput[c] *= tone_exp2_minus(way.absorption[c] * e.t * 1.44269504f);
    const float light[3] = {out.throughput[0], out.throughput[1], out.throughput[2]};
    fate.lost += (int)(quanta(&task, ray.throughput) - quanta(&task, light));
    vector3 n = {e.hit.normal[0], e.hit.normal[1], e.hit.normal[2]};
    if (n.x == 0.0f && n.y == 0.0f && n.z == 0.0f)
        n.x = -ray.direction[0], n.y = -ray.direction[1], n.z = -ray.direction[2];
    const karst_ray from_land = next[i];
    photon_turn t = turn_of(&task, &ray, &way, &e, &n, e.clear ? matter[i] : 1.0f, &from_land, fate.fate);
    if (lacks(&e)) {
        t.share[0] = 1.0f, t.share[1] = 0.0f;
        t.goes_on[0] = 0;
        t.end = KARST_PHOTON_UNSURE;
    }
    /* Where light is not parted any more chance takes one part whole. */
    const float stays_here = t.share[0];
    if (task.parts == 1) {
        const float u = unit_of(scrambled(ray.pixel ^ (PHOTON_CHOICE + task.generation * 0x9e3779b1u)));
        t.share[1] = u < t.share[1] ? 1.0f : 0.0f;
        t.share[0] = 1.0f - t.share[1];
    }
    const uint before = quanta(&task, light);
    uint after = 0;
    for (uint part = 0; part < 2; part++) {
        const uint into = part && task.parts == 2 ? slot | 1u << task.generation : slot;
        const uint to = i * task.parts + (task.parts == 2 ? part : 0u);
        if (!(t.share[part] > 0.0f)) {
            if (task.parts == 2)
                born[to].t_max = 0.0f;
            continue;
        }
        karst_photon_fate of = {t.end, 0, 0, 0,
                                karst_photon_way(fate.way, 2u * e.clear + part, task.generation ? e.t : 0.0f)};
        for (int c = 0; c < 3; c++)
            out.throughput[c] = light[c] * t.share[part];
        const uint energy = quanta(&task, out.throughput);
        after += energy;
        out.t_max = 0.0f;
        if (t.goes_on[part] && task.is_last)
            of.fate = KARST_PHOTON_CUT;
        else if (t.goes_on[part])
            go_on(&task, &pinhole, &e, &t.way[part], &out);
        if (out.t_max > 0.0f && brightest(out.throughput) > 0.0f) {
            of.fate = KARST_PHOTON_TURNED;
        } else {
            of.fate = t.goes_on[part] && !task.is_last ? KARST_PHOTON_ESCAPED : of.fate;
            of.left = energy;
            out.t_max = 0.0f;
        }
        if (of.fate == KARST_PHOTON_LANDED) {
            /* Land scatters what it does not mirror of what falls there; who gathers counts that. */
            const float per = task.parts == 2 ? 1.0f : 1.0f / stays_here;
            const karst_photon photon = {{e.to.x, e.to.y, e.to.z},
                                         of.way,
                                         {light[0] * per, light[1] * per, light[2] * per},
                                         pack_normal(&n)};
            photons[karst_photon_record(task.batch, task.batch_rays, into, place)] = photon;
        }
        if (out.t_max > 0.0f) {
            karst_clear_way out_way = way;
            for (int c = 0; c < 3 && !t.stays[part]; c++)
                out_way.absorption[c] = way.side == KARST_SIDE_BACK
                                            ? 0.0f
                                            : matter[(size_t)(1 + c) * room + i] * task.voxel_m;
            out_way.side = t.clear_side[part];
            out_way.t_min = t.clear_from[part];
            out.side = t.side[part];
            out.pixel = (ray.pixel & KARST_PHOTON_NUMBER) | into << KARST_PHOTON_SLOT_SHIFT;
            born_ways[to] = out_way;
        }
        born[to] = out;
        if (into == slot) {
            fate.fate = of.fate;
            fate.left = of.left;
            fate.way = of.way;
        } else {
            fates[into * task.batch_rays + place] = of;
        }
    }
    if (!(t.share[0] > 0.0f) && task.parts == 2)
        fate.fate = KARST_PHOTON_NOTHING;
    fate.lost += (int)(before - after);
    fates[slot * task.batch_rays + place] = fate;
}

/* ---- streams without gaps: as paths_count, paths_scan, paths_pack ---- */

/* parts: rays that each of the stream has room for. */
__kernel void photons_count(K_GLOBAL const karst_ray *born, K_GLOBAL const uint *count, uint parts,
                            K_GLOBAL uint *counts, uint num_blocks)
{
    const uint block = (uint)get_global_id(0), first = block * BLOCK_RAYS, num_rays = *count * parts;
    if (block >= num_blocks)
        return;
    uint num = 0;
    for (uint i = first; i < first + BLOCK_RAYS && i < num_rays; i++)
        num += born[i].t_max > 0.0f;
    counts[block] = num;
}

/* From counts to where each block begins, and how many there are in all. */
SCAN_KERNEL void photons_scan(K_GLOBAL uint *counts, uint num_blocks, K_GLOBAL uint *total)
{
    __local uint sums[SCAN_ITEMS];
    const uint sum = scan_counts(counts, num_blocks, sums);
    if (get_local_id(0) != 0)
        return;
    *total = sum;
}

__kernel void photons_pack(K_GLOBAL const karst_ray *born, K_GLOBAL const karst_clear_way *born_ways,
                           K_GLOBAL const uint *count, uint parts, K_GLOBAL const uint *begins, uint num_blocks,
                           K_GLOBAL karst_ray *rays, K_GLOBAL karst_clear_way *ways)
{
    const uint block = (uint)get_global_id(0), first = block * BLOCK_RAYS, num_rays = *count * parts;
    if (block >= num_blocks)
        return;
    uint to = begins[block];
    for (uint i = first; i < first + BLOCK_RAYS && i < num_rays; i++)
        if (born[i].t_max > 0.0f) {
            rays[to] = born[i];
            ways[to++] = born_ways[i];
        }
}
