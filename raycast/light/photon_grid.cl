/* Spots of photons, and gathering them: see raycast/light/photon_grid.h. */
#include "raycast/light/scan.clh"

#undef LANES
#define LANES 1
#include "raycast/cast/cast_shared.h"
#include "raycast/cast/vectors.clh"
#include "raycast/light/photon_grid_shared.h"

/* Photons on land that looks another way, or lies behind, are not of this surface. */
#define LEAST_COSINE 0.5f
#define FLATNESS 0.35f
/* Radii of a spot in differences of neighbours: spots that overlap so far show no grid. */
#define SPREAD 1.4f
/* What one photon may add, in quanta: 2^24 of them stay within a long. */
#define MOST_QUANTA 2.7e11f

RAY_INLINE float dot_of(const vector3 *a, const vector3 *b)
{
    return k_fma(a->x, b->x, k_fma(a->y, b->y, a->z * b->z));
}

RAY_INLINE float power_of(int exponent) { return k_as_float((uint)(exponent + 127) << 23); }
/* The exponent of the power of two above, of positive floats. */
RAY_INLINE int exponent_above(float v) { return (int)(k_as_uint(v) >> 23) - 126; }
RAY_INLINE int cell_at(float v, float per) { return (int)k_floor(v * per); }

RAY_INLINE float unpack_axis(uint packed) { return ((float)(packed & 1023u) - 512.0f) * (1.0f / 511.0f); }

RAY_INLINE vector3 unpack_normal(uint packed)
{
    const vector3 n = {unpack_axis(packed), unpack_axis(packed >> 10), unpack_axis(packed >> 20)};
    return n;
}

/* Two directions across a normal (T. Duff and others, "Building an orthonormal basis, revisited", 2017). */
RAY_INLINE void axes_of(const vector3 *n, vector3 *right, vector3 *up)
{
    const float sign = n->z < 0.0f ? -1.0f : 1.0f, p = -1.0f / (sign + n->z), q = n->x * n->y * p;
    right->x = k_fma(sign * n->x * n->x, p, 1.0f), right->y = sign * q, right->z = -sign * n->x;
    up->x = q, up->y = k_fma(n->y * n->y, p, sign), up->z = -n->y;
}

/* ---- spots ---- */

/* Squares of differences across a normal, added up: a symmetric matrix. */
typedef struct {
    float pp, ps, ss, num;
} differences;

/* That to a photon, if it is of the same light. */
RAY_INLINE void add_neighbour(const karst_photon_grid_task *task, K_GLOBAL const karst_photon *photons, uint slot,
                              uint neighbour, const karst_photon *photon, const vector3 *n, const vector3 *right,
                              const vector3 *up, differences *d)
{
    const uint batch = neighbour / KARST_PHOTON_RUN % task->num_batches;
    const uint record = karst_photon_record(batch, task->batch_rays, slot,
                                            karst_photon_place(task->num_batches, neighbour));
    if (record >= task->num_records)
        return;
    const karst_photon other = photons[record];
    if (!other.normal || (other.way ^ photon->way) > KARST_PHOTON_FLOWN)
        return;
    const vector3 to = {other.place[0] - photon->place[0], other.place[1] - photon->place[1],
                        other.place[2] - photon->place[2]};
    const vector3 m = unpack_normal(other.normal);
    const float high = dot_of(&to, n), p = dot_of(&to, right), s = dot_of(&to, up);
    if (!(dot_of(&m, n) > LEAST_COSINE) || !(high * high <= FLATNESS * FLATNESS * k_fma(p, p, s * s)))
        return;
    d->pp = k_fma(p, p, d->pp), d->ps = k_fma(p, s, d->ps), d->ss = k_fma(s, s, d->ss);
    d->num += 1.0f;
}

RAY_INLINE void mean_of(differences *d)
{
    const float per = d->num > 0.0f ? 1.0f / d->num : 0.0f;
    d->pp *= per, d->ps *= per, d->ss *= per;
}

/* The larger eigenvalue. */
RAY_INLINE float longest_of(float pp, float ps, float ss)
{
    const float apart = 0.5f * (pp - ss);
    return k_fma(0.5f, pp + ss, k_sqrt(k_fma(apart, apart, ps * ps)));
}

/* Where light of a record lies; false: it left none. */
RAY_INLINE int spot_of(const karst_photon_grid_task *task, K_GLOBAL const karst_photon *photons,
                       K_GLOBAL const karst_photon_cell *cells, K_GLOBAL const karst_photon_lamp *lamps, uint record,
                       karst_photon_spot *spot)
{
    const karst_photon photon = photons[record];
    if (!photon.normal)
        return 0;
    const uint place = record % task->batch_rays, slot = record / task->batch_rays % KARST_PHOTON_SLOTS;
    const uint batch = record / task->batch_rays / KARST_PHOTON_SLOTS;
    const uint number = karst_photon_of(batch, task->num_batches, place);
    const karst_photon_cell cell = cells[karst_photon_find(cells, task->num_cells, number)];
    const uint columns = cell.grid >> 16, rows = cell.grid & 0xffffu, of_grid = number - cell.first;
    const uint column = of_grid % columns, row = of_grid / columns;
    const vector3 n = unpack_normal(photon.normal), at = {photon.place[0], photon.place[1], photon.place[2]};
    const float far = k_max(k_sqrt(dot_of(&at, &at)), 1.0e-6f);
    vector3 right, up;
    axes_of(&n, &right, &up);
    differences u = {0.0f, 0.0f, 0.0f, 0.0f}, v = {0.0f, 0.0f, 0.0f, 0.0f};
    if (row > 0)
        add_neighbour(task, photons, slot, number - columns, &photon, &n, &right, &up, &u);
    if (row + 1 < rows)
        add_neighbour(task, photons, slot, number + columns, &photon, &n, &right, &up, &u);
    if (column > 0)
        add_neighbour(task, photons, slot, number - 1, &photon, &n, &right, &up, &v);
    if (column + 1 < columns)
        add_neighbour(task, photons, slot, number + 1, &photon, &n, &right, &up, &v);
    mean_of(&u);
    mean_of(&v);
    const float least = task->least * far, most = task->most * far;
    float pp, ps, ss;
    if (u.num > 0.0f && v.num > 0.0f) {
        pp = (u.pp + v.pp) * (SPREAD * SPREAD), ps = (u.ps + v.ps) * (SPREAD * SPREAD);
        ss = (u.ss + v.ss) * (SPREAD * SPREAD);
    } else {
        /* As wide in every direction as in that which is known. */
        const float square = (u.pp + u.ss + v.pp + v.ss) * (SPREAD * SPREAD), reach = task->reach * far;
        pp = ss = u.num > 0.0f || v.num > 0.0f ? square : reach * reach;
        ps = 0.0f;
    }
    /* A sun's disc blurs what it lights as far off as it was turned: a disc has the variance of a kernel that is wider
     * by the root of 3/2. */
    K_GLOBAL const karst_photon_lamp *lamp = &lamps[cell.cell >> 16];
    if (lamp->kind == KARST_LAMP_SUN) {
        const float blur = lamp->axis[3] * karst_photon_flown(photon.way), square = 1.5f * blur * blur;
        pp += square, ss += square;
    }
    float square = longest_of(pp, ps, ss);
    const float room = most * most - least * least, fits = square > room ? room / square : 1.0f;
    pp = k_fma(pp, fits, least * least), ps *= fits, ss = k_fma(ss, fits, least * least);
    square = longest_of(pp, ps, ss);
    const float per = 1.0f / square;
    pp *= per, ps *= per, ss *= per;
    const float area = k_max(k_fma(pp, ss, -ps * ps), 1.0e-6f), bright = (2.0f / 3.14159265f) / (square * k_sqrt(area));
    spot->place[0] = at.x, spot->place[1] = at.y, spot->place[2] = at.z;
    spot->normal = photon.normal;
    spot->pp = ss / area, spot->ps = -ps / area, spot->ss = pp / area;
    spot->radius = k_sqrt(square);
    for (int c = 0; c < 3; c++)
        spot->light[c] = photon.flux[c] * bright;
    return 1;
}

/* ---- the table ----
 *
 * A cell is as wide as the power of two above a spot's diameter: so a place lies in spots of two cells along each axis
 * at most. */

typedef struct {
    int exponent; /* of the cell's width */
    int x, y, z;
} grid_cell;

/* Different for all cells that are looked at together. */
RAY_INLINE uint tag_of(const grid_cell *c)
{
    return ((uint)c->x & 511u) | ((uint)c->y & 511u) << 9 | ((uint)c->z & 511u) << 18 | ((uint)c->exponent & 31u) << 27;
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

RAY_INLINE grid_cell cell_of_spot(const karst_photon_spot *spot)
{
    grid_cell c;
    c.exponent = exponent_above(2.0f * spot->radius);
    const float per = power_of(-c.exponent);
    c.x = cell_at(spot->place[0], per), c.y = cell_at(spot->place[1], per), c.z = cell_at(spot->place[2], per);
    return c;
}

/* How many of each bucket, and which widths of cells there are: both begin with zeros. */
__kernel void photon_grid_count(karst_photon_grid_task task, K_GLOBAL const karst_photon *photons,
                                K_GLOBAL const karst_photon_cell *cells, K_GLOBAL const karst_photon_lamp *lamps,
                                K_GLOBAL uint *buckets, K_GLOBAL uint *widths)
{
    const uint i = (uint)get_global_id(0);
    karst_photon_spot spot;
    if (i >= task.num_records || !spot_of(&task, photons, cells, lamps, i, &spot))
        return;
    const grid_cell c = cell_of_spot(&spot);
    const uint width = 1u << ((uint)c.exponent & 31u);
    atomic_inc(&buckets[bucket_of(&c, task.mask)]);
    if (!(*(volatile K_GLOBAL uint *)widths & width))
        atomic_or(widths, width);
}

__kernel void photon_grid_sums(K_GLOBAL const uint *buckets, K_GLOBAL uint *sums, uint num_blocks)
{
    const uint block = (uint)get_global_id(0);
    if (block >= num_blocks)
        return;
    uint sum = 0;
    for (uint i = 0; i < KARST_PHOTON_BUCKETS; i++)
        sum += buckets[block * KARST_PHOTON_BUCKETS + i];
    sums[block] = sum;
}

/* From counts to where each block begins, and how many there are in all. */
SCAN_KERNEL void photon_grid_scan(K_GLOBAL uint *counts, uint num_blocks, K_GLOBAL uint *total)
{
    __local uint sums[SCAN_ITEMS];
    const uint sum = scan_counts(counts, num_blocks, sums);
    if (get_local_id(0) != 0)
        return;
    *total = sum;
}

/* Where each bucket begins; counts are zeros again. */
__kernel void photon_grid_begins(K_GLOBAL uint *buckets, K_GLOBAL const uint *sums, K_GLOBAL uint *begins,
                                 uint num_blocks)
{
    const uint block = (uint)get_global_id(0);
    if (block >= num_blocks)
        return;
    uint sum = sums[block];
    for (uint i = block * KARST_PHOTON_BUCKETS; i < (block + 1) * KARST_PHOTON_BUCKETS; i++) {
        begins[i] = sum;
        sum += buckets[i];
        buckets[i] = 0;
    }
}

/* In any order within a bucket: what is gathered is summed in whole numbers. */
__kernel void photon_grid_sort(karst_photon_grid_task task, K_GLOBAL const karst_photon *photons,
                               K_GLOBAL const karst_photon_cell *cells, K_GLOBAL const karst_photon_lamp *lamps,
                               K_GLOBAL uint *buckets, K_GLOBAL const uint *begins,
                               K_GLOBAL karst_photon_spot *spots)
{
    const uint i = (uint)get_global_id(0);
    karst_photon_spot spot;
    if (i >= task.num_records || !spot_of(&task, photons, cells, lamps, i, &spot))
        return;
    const grid_cell c = cell_of_spot(&spot);
    const uint bucket = bucket_of(&c, task.mask);
    spot.tag = tag_of(&c);
    spots[begins[bucket] + atomic_inc(&buckets[bucket])] = spot;
}

/* ---- gathering ---- */

typedef struct {
    vector3 at, normal;
    long sum[3];
} gathered;

RAY_INLINE void gather_cell(const karst_photon_grid_task *task, K_GLOBAL const karst_photon_spot *spots,
                            K_GLOBAL const uint *buckets, K_GLOBAL const uint *begins, const grid_cell *c, gathered *g)
{
    const uint tag = tag_of(c), bucket = bucket_of(c, task->mask), begin = begins[bucket], num = buckets[bucket];
    for (uint i = begin; i < begin + num; i++) {
        K_GLOBAL const karst_photon_spot *spot = &spots[i];
        const vector3 to = {g->at.x - spot->place[0], g->at.y - spot->place[1], g->at.z - spot->place[2]};
        const float radius = spot->radius;
        if (spot->tag != tag || !(dot_of(&to, &to) < radius * radius * (1.0f + FLATNESS * FLATNESS)))
            continue;
        const vector3 n = unpack_normal(spot->normal);
        vector3 right, up;
        axes_of(&n, &right, &up);
        const float per = 1.0f / radius, p = dot_of(&to, &right) * per, s = dot_of(&to, &up) * per;
        const float square = k_fma(spot->pp * p, p, k_fma(2.0f * spot->ps * p, s, spot->ss * s * s));
        const float high = dot_of(&to, &g->normal);
        if (!(square < 1.0f) || !(dot_of(&n, &g->normal) > LEAST_COSINE) || !(k_fabs(high) <= FLATNESS * radius))
            continue;
        const float weight = (1.0f - square) * task->scale;
        for (int k = 0; k < 3; k++)
            g->sum[k] += (long)k_min(spot->light[k] * weight, MOST_QUANTA);
    }
}

/* Adds to the parts what photons make of the surfaces that rays stand for: each starts in its surface, along the
 * normal, and its throughput is what of the light that falls there reaches its pixel. */
__kernel void photon_grid_gather(karst_photon_grid_task task, K_GLOBAL const karst_ray *rays,
                                 K_GLOBAL const uint *count, K_GLOBAL const karst_photon_spot *spots,
                                 K_GLOBAL const uint *buckets, K_GLOBAL const uint *begins,
                                 K_GLOBAL const uint *widths, int width_px, int height_px, K_GLOBAL float *parts)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count || !(rays[i].t_max > 0.0f))
        return;
    const karst_ray ray = rays[i];
    const uint present = *widths;
    gathered g;
    g.at.x = ray.origin[0] + task.offset[0], g.at.y = ray.origin[1] + task.offset[1];
    g.at.z = ray.origin[2] + task.offset[2];
    g.normal.x = ray.direction[0], g.normal.y = ray.direction[1], g.normal.z = ray.direction[2];
    const float far = k_max(k_sqrt(dot_of(&g.at, &g.at)), 1.0e-6f);
    g.sum[0] = g.sum[1] = g.sum[2] = 0;
    /* Spots are no smaller and no larger than their distance allows, which is at most a radius less, or more. */
    const int finest = exponent_above(1.99f * far * task.least / k_fma(1.1f, task.least, 1.0f));
    const int coarsest = exponent_above(2.01f * far * task.most / k_fma(-1.1f, task.most, 1.0f));
    for (int exponent = finest; exponent <= coarsest; exponent++) {
        const float per = power_of(-exponent), reach = power_of(exponent - 1);
        grid_cell c;
        c.exponent = exponent;
        if (!(present >> ((uint)exponent & 31u) & 1u))
            continue;
        for (c.z = cell_at(g.at.z - reach, per); c.z <= cell_at(g.at.z + reach, per); c.z++)
            for (c.y = cell_at(g.at.y - reach, per); c.y <= cell_at(g.at.y + reach, per); c.y++)
                for (c.x = cell_at(g.at.x - reach, per); c.x <= cell_at(g.at.x + reach, per); c.x++)
                    gather_cell(&task, spots, buckets, begins, &c, &g);
    }
    const uint place = karst_packet_order(ray.pixel & 0xffffu, ray.pixel >> 16 & 0x3fffu, (uint)width_px,
                                          (uint)height_px);
    const size_t plane = (size_t)width_px * (size_t)height_px;
    const float per = task.whole / task.scale;
    for (int k = 0; k < 3; k++)
        parts[(size_t)k * plane + place] += ray.throughput[k] * ((float)g.sum[k] * per);
}
