/* Entry points of occlusion: see raycast/light/occlusion.h. */
#include "raycast/light/lamps.clh"
#include "raycast/light/occlusion_near.clh"
#include "raycast/light/occlusion_shared.h"
#include "raycast/light/path_rays.clh"
#include "raycast/light/surface.clh"

/* A fit counts for a pixel as their distances from the eye are alike: not from this share of the pixel's on. */
#define FAR_APART 0.25f
/* Where no other is near, it says what is known. */
#define LEAST_KINSHIP 1.0e-4f
/* A probe counts for a fit in the same way, though never for nothing: directions are wanted on all sides. */
#define FAR_APART_IN_FIT 0.7f
#define LEAST_KINSHIP_IN_FIT 0.03f
/* What stands at a cone's end stands elsewhere as others see it. Those too far away to tell are left as they are: not
 * much more than so many times, squared, as far as that is. */
#define MOVES_WITHIN 0.5f
/* Added to how much directions spread, 1/3 on each axis where they are all around: what does not spread says little of
 * how openness changes along it. */
#define LEAST_SPREAD 0.02f
/* Of what cones around found open, on whichever side, a surface sees this share at least: a fit may fall below 0, and
 * what is white is black only where nothing at all is open. */
#define LEAST_SHARE 0.02f
/* How far from the eye what is not there is. */
#define NOWHERE 1.0e30f
/* Nothing that is met is nearer, voxels. */
#define NEAREST 1.0e-3f
/* Cones start so many voxels of its level above a surface, as rays to the sun do: its own roughness does not stop them
 * (raycast/cast/graze.clh). Rays that start exactly on it cost eight times as much. */
#define OFFSET_VOXELS (1.5f * START_PIXELS)
/* And are so many times as wide as what they start from: what is nearer than some pixels' widths, pixels' own normals
 * say. It halves what cones cost, or better. */
#define START_PIXELS 4.0f
/* Cones that rise less over a surface carry a hundredth of the light in all, and take longest. */
#define LEAST_COSINE 0.1f

/* The probes of an item: 4x4 of them, or one of those. */
typedef struct {
    vint x, y, inside; /* which probe it is */
    uint first_ray;    /* of direction 0 */
} cell_probes;

#define QUARTERS (2 * KARST_OCCLUSION_CELLS) /* of cells, on a square's side */
RAY_INLINE cell_probes probes_of_item(uint item, int across_probes, int down_probes)
{
    cell_probes p;
    const uint quarter = item / (KARST_PACKET_RAYS / LANES);
    const vint lane = V_LANE + (int)(item % (KARST_PACKET_RAYS / LANES));
    const uint in_square = quarter % (QUARTERS * QUARTERS), square = quarter / (QUARTERS * QUARTERS);
    const uint across = ((uint)across_probes + KARST_OCCLUSION_SQUARE - 1) / KARST_OCCLUSION_SQUARE;
    const uint column = in_square % QUARTERS, row = in_square / QUARTERS;
    p.x = (lane & 3) + (int)(square % across * KARST_OCCLUSION_SQUARE + 4 * column);
    p.y = (lane >> 2) + (int)(square / across * KARST_OCCLUSION_SQUARE + 4 * row);
    p.inside = v_mask(v_lt(p.x, (vint)(across_probes))) & v_mask(v_lt(p.y, (vint)(down_probes)));
    /* A beam has eight directions of eight neighbouring cells, 4x2. */
    const uint cell_x = column / 2, cell_y = row / 2, group = cell_y / 2 * (KARST_OCCLUSION_CELLS / 4) + cell_x / 4;
    p.first_ray = square * KARST_OCCLUSION_SQUARE_RAYS + group * (8 * KARST_OCCLUSION_CONES) +
                  8 * (cell_y % 2 * 4 + cell_x % 4);
    return p;
}

/* Where what is known of a probe is in a plane. */
RAY_INLINE vint place_of_probe(vint x, vint y, int across)
{
    const int evens = (across + 1) / 2;
    return (y * 2 + (x & 1)) * evens + (x >> 1);
}

/* The pixel of a probe, on an axis. */
RAY_INLINE vint pixel_of(vint probe, int step_px, int side_px)
{
    return lane_min_int(probe * step_px, (vint)(side_px - 1));
}

/* Which direction is a probe's, by its place in the whole: as Bayer's matrix orders them, so that those of probes next
 * to one another differ most. */
RAY_INLINE vint direction_of(const karst_pinhole *seen, uint turn, vint x, vint y)
{
    const vint v = y + seen->y0_px / KARST_OCCLUSION_STEP_Y, u = (x + seen->x0_px / KARST_OCCLUSION_STEP_X) ^ v;
    const vint number =
        (u & 1) << 5 | (v & 1) << 4 | (u & 2) << 2 | (v & 2) << 1 | (u & 4) >> 1 | (v & 4) >> 2;
    return (number + (int)turn) & (KARST_OCCLUSION_CONES - 1);
}

RAY_INLINE vint ray_of(const cell_probes *p, vint number)
{
    return (number & ~7) * 8 + (number & 7) + (int)p->first_ray;
}

RAY_INLINE vector3 cone_of(const karst_occlusion_task *task, vint number)
{
    int numbers[LANES];
    float x[LANES], y[LANES], z[LANES];
    v_store_int(number, numbers);
    for (int l = 0; l < LANES; l++) {
        x[l] = task->cones[numbers[l]][0];
        y[l] = task->cones[numbers[l]][1];
        z[l] = task->cones[numbers[l]][2];
    }
    const vector3 d = {v_load_float(x), v_load_float(y), v_load_float(z)};
    return d;
}

/* To the sphere around the eye in which its view lies, as in bounce.cl. */
RAY_INLINE vfloat to_end(const vector3 *o, const vector3 *d, float t_max)
{
    const vfloat along = dot_of(o, d), far = k_sqrt(dot_of(o, o));
    const vfloat rest = lane_max((t_max - far) * (t_max + far), (vfloat)(0.0f));
    return k_sqrt(k_fma(along, along, rest)) - along;
}

/* As load_surface, of rays that are no neighbours. */
RAY_INLINE surface_hits load_spread_surface(K_GLOBAL const karst_hit *hits, vint index, const vector3 *direction)
{
    K_GLOBAL const int *words = (K_GLOBAL const int *)hits;
    const vint record = index * (int)(sizeof(karst_hit) / sizeof(int));
    const vint x = v_gather_int(words, record + 4), y = v_gather_int(words, record + 5),
               z = v_gather_int(words, record + 6), known = v_ne((x | y | z) & 0x7fffffff, (vint)(0));
    surface_hits s;
    s.t = v_as_float(v_gather_int(words, record));
    s.word = v_gather_int(words, record + 1);
    s.kind = s.word & 0xff;
    s.level = s.word >> 8 & 0xff;
    s.weight = (vfloat)(0.0f);
    s.normal.x = v_select(known, v_as_float(x), -direction->x);
    s.normal.y = v_select(known, v_as_float(y), -direction->y);
    s.normal.z = v_select(known, v_as_float(z), -direction->z);
    return s;
}

RAY_INLINE void store_rise(K_GLOBAL karst_ray *rays, const path_rays *r, vfloat rise)
{
    int index[LANES];
    float value[LANES];
    v_store_int(r->index, index);
    v_store_float(rise, value);
    for (int l = 0; l < LANES; l++)
        rays[index[l]].rise = value[l];
}

/* Makes the cones, which are idle where nothing is hit or they do not leave the surface; and says where probes look. */
__kernel K_WIDE void occlusion_rays(karst_pinhole seen, karst_occlusion_task task, float cone,
                                    K_GLOBAL const karst_hit *hits, K_GLOBAL karst_ray *rays, K_GLOBAL float *planes,
                                    uint num_items)
{
    const uint item = (uint)get_global_id(0);
    if (item >= num_items)
        return;
    const vfloat zero = (vfloat)(0.0f);
    const cell_probes p = probes_of_item(item, task.across, task.down);
    const vint number = direction_of(&seen, task.turn, p.x, p.y);
    path_rays r;
    r.valid = (vint)(-1);
    r.lanes = mask_bits(r.valid);
    r.index = ray_of(&p, number);
    const vint x = pixel_of(p.x, KARST_OCCLUSION_STEP_X, seen.width_px),
               y = pixel_of(p.y, KARST_OCCLUSION_STEP_Y, seen.height_px);
    r.pixel = y << 16 | x;
    r.flags = (vint)(0);
    r.throughput.r = r.throughput.g = r.throughput.b = zero;
    r.origin.x = r.origin.y = r.origin.z = zero;
    r.direction.x = r.direction.z = zero, r.direction.y = (vfloat)(1.0f);
    r.t_max = zero;
    r.width = (vfloat)(1.0f);
    r.cone = (vfloat)(cone);
    vfloat rise = zero;
    if (v_any(p.inside)) {
        const vector3 direction = pinhole_direction(&seen, x, y);
        const vint order = v_select(p.inside, packet_order(x, y, seen.width_px, seen.height_px), (vint)(0));
        const surface_hits s = load_spread_surface(hits, order, &direction);
        const vint hit = v_mask(v_ne(s.kind, (vint)((int)KARST_HIT_MISS))) & p.inside;
        const uint inside = mask_bits(p.inside);
        const vector3 to = {direction.x * s.t, direction.y * s.t, direction.z * s.t};
        const vfloat voxel = v_as_float((s.level + 127) << 23), width = s.t * seen.cone;
        vector3 way = {zero, zero, zero}, from = way;
        if (v_any(hit)) {
            from.x = v_select(hit, to.x, zero), from.y = v_select(hit, to.y, zero);
            from.z = v_select(hit, to.z, zero);
            way = cone_of(&task, number);
            const vfloat to_number = dot_of(&way, &s.normal), cosine = k_fabs(to_number);
            const vint leaves = hit & v_gt(cosine, (vfloat)(LEAST_COSINE));
            const vfloat sign =
                v_select(leaves, v_select(v_mask(v_lt(to_number, zero)), (vfloat)(-1.0f), (vfloat)(1.0f)), zero);
            way.x *= sign, way.y *= sign, way.z *= sign;
            const vfloat up = voxel * (vfloat)(OFFSET_VOXELS);
            rise = lane_max(cosine, (vfloat)(LEAST_COSINE));
            r.origin.x = v_select(hit, k_fma(s.normal.x, up, to.x), zero);
            r.origin.y = v_select(hit, k_fma(s.normal.y, up, to.y), zero);
            r.origin.z = v_select(hit, k_fma(s.normal.z, up, to.z), zero);
            r.direction.x = v_select(leaves, way.x, zero);
            r.direction.y = v_select(leaves, way.y, (vfloat)(1.0f));
            r.direction.z = v_select(leaves, way.z, zero);
            r.width = v_select(hit, lane_max(width, voxel * (vfloat)(1.0001f / task.detail)) * START_PIXELS, r.width);
            r.t_max = v_select(leaves, to_end(&to, &way, seen.t_max), zero);
        }
        const vint place = place_of_probe(p.x, p.y, task.across);
        scatter(planes + KARST_OCCLUSION_T * task.plane, place, inside, v_select(hit, s.t, (vfloat)(NOWHERE)));
        scatter(planes + KARST_OCCLUSION_WAY * task.plane, place, inside, way.x);
        scatter(planes + (KARST_OCCLUSION_WAY + 1) * task.plane, place, inside, way.y);
        scatter(planes + (KARST_OCCLUSION_WAY + 2) * task.plane, place, inside, way.z);
        scatter(planes + KARST_OCCLUSION_PLACE * task.plane, place, inside, from.x);
        scatter(planes + (KARST_OCCLUSION_PLACE + 1) * task.plane, place, inside, from.y);
        scatter(planes + (KARST_OCCLUSION_PLACE + 2) * task.plane, place, inside, from.z);
    }
    store_paths(rays, &r, KARST_SIDE_ANY);
    store_rise(rays, &r, rise);
}

/* What cones met, to where their probes are. */
__kernel K_WIDE void occlusion_see(karst_pinhole seen, karst_occlusion_task task, K_GLOBAL const karst_hit *hits,
                                   K_GLOBAL float *planes, uint num_items)
{
    const uint item = (uint)get_global_id(0);
    if (item >= num_items)
        return;
    const cell_probes p = probes_of_item(item, task.across, task.down);
    if (!v_any(p.inside))
        return;
    const vint ray = ray_of(&p, direction_of(&seen, task.turn, p.x, p.y));
    const vint word = ray * (int)(sizeof(karst_hit) / sizeof(int));
    const vint kind = v_gather_int((K_GLOBAL const int *)hits, word + 1) & 0xff;
    const vfloat t = v_as_float(v_gather_int((K_GLOBAL const int *)hits, word));
    const vint place = v_select(p.inside, place_of_probe(p.x, p.y, task.across), (vint)(0));
    scatter(planes + KARST_OCCLUSION_NEAR * task.plane, place, mask_bits(p.inside),
            v_select(v_mask(v_eq(kind, (vint)((int)KARST_HIT_MISS))), (vfloat)(0.0f),
                     1.0f / lane_max(t, (vfloat)(NEAREST))));
}

/* How much a probe so many steps away counts for a fit, on an axis: it fades out, so that no edge is seen. */
RAY_INLINE float nearness(int step)
{
    const float part = (float)step / (float)(KARST_OCCLUSION_REACH + 1);
    return k_fma(-part, part, 1.0f);
}

/* How alike distances from the eye are; per_far: the inverse of how far apart they have nothing in common. */
RAY_INLINE vfloat kinship(vfloat other, vfloat t, vfloat per_far, float least)
{
    const vfloat apart = (other - t) * per_far;
    return lane_max(k_fma(-apart, apart, (vfloat)(1.0f)), (vfloat)(least));
}

/* Weighted sums over directions d that cones look in, and which of them are open. */
typedef struct {
    vfloat all, open;
    vector3 way, open_way;
    vfloat xx, xy, xz, yy, yz, zz;
} direction_sums;

RAY_INLINE void add_direction(direction_sums *s, const vector3 *way, vfloat weight, vfloat open)
{
    const vfloat x = way->x * weight, y = way->y * weight, z = way->z * weight;
    s->all += weight;
    s->way.x += x, s->way.y += y, s->way.z += z;
    s->open = k_fma(weight, open, s->open);
    s->open_way.x = k_fma(x, open, s->open_way.x);
    s->open_way.y = k_fma(y, open, s->open_way.y);
    s->open_way.z = k_fma(z, open, s->open_way.z);
    s->xx = k_fma(x, way->x, s->xx), s->xy = k_fma(x, way->y, s->xy), s->xz = k_fma(x, way->z, s->xz);
    s->yy = k_fma(y, way->y, s->yy), s->yz = k_fma(y, way->z, s->yz), s->zz = k_fma(z, way->z, s->zz);
}

/* The x of a x = b, where a is symmetric and positive: xx, xy, xz, yy, yz, zz. */
RAY_INLINE vector3 solved(const vfloat a[6], const vector3 *b)
{
    const vfloat xx = a[3] * a[5] - a[4] * a[4], xy = a[2] * a[4] - a[1] * a[5], xz = a[1] * a[4] - a[2] * a[3];
    const vfloat yy = a[0] * a[5] - a[2] * a[2], yz = a[1] * a[2] - a[0] * a[4], zz = a[0] * a[3] - a[1] * a[1];
    const vfloat scale = 1.0f / k_fma(a[0], xx, k_fma(a[1], xy, a[2] * xz));
    const vector3 x = {k_fma(xx, b->x, k_fma(xy, b->y, xz * b->z)) * scale,
                       k_fma(xy, b->x, k_fma(yy, b->y, yz * b->z)) * scale,
                       k_fma(xz, b->x, k_fma(yz, b->y, zz * b->z)) * scale};
    return x;
}

/* Least squares: openness as level + slope . direction, and at least so much. Where all is open, or nothing, it is so
 * exactly. */
RAY_INLINE void fit_line(const direction_sums *s, vfloat *level, vector3 *slope, vfloat *floor)
{
    const vint known = v_mask(v_gt(s->all, (vfloat)(0.0f)));
    const vfloat each = 1.0f / v_select(known, s->all, (vfloat)(1.0f)), least = LEAST_SPREAD;
    const vfloat open = s->open / v_select(known, s->all, (vfloat)(1.0f));
    const vector3 mean = {s->way.x * each, s->way.y * each, s->way.z * each};
    const vfloat spread[6] = {k_fma(s->xx, each, k_fma(-mean.x, mean.x, least)), k_fma(s->xy, each, -mean.x * mean.y),
                              k_fma(s->xz, each, -mean.x * mean.z), k_fma(s->yy, each, k_fma(-mean.y, mean.y, least)),
                              k_fma(s->yz, each, -mean.y * mean.z), k_fma(s->zz, each, k_fma(-mean.z, mean.z, least))};
    const vector3 open_way = {s->open_way.x * each, s->open_way.y * each, s->open_way.z * each};
    const vector3 along = {k_fma(-mean.x, open, open_way.x), k_fma(-mean.y, open, open_way.y),
                           k_fma(-mean.z, open, open_way.z)}; /* 0 where all is open, too */
    *slope = solved(spread, &along);
    *level = v_select(known, open - dot_of(slope, &mean), (vfloat)(1.0f)); /* nothing is known, and nothing is hidden */
    *floor = open * LEAST_SHARE;
}

/* Probes of a row, so many columns to the right of those where there are fits: from the one numbered `at` on. */
RAY_INLINE vfloat load_probes(K_GLOBAL const float *row, vint at, int right, int across)
{
    const int evens = (across + 1) / 2;
    return right & 1 ? load_row(row + evens, at, right >> 1, across / 2) : load_row(row, at, right >> 1, evens);
}

/* The direction of what a cone found, from a surface that lies `back` of the cone's own. near: as in the plane. */
RAY_INLINE vector3 seen_from(const vector3 *way, const vector3 *back, vfloat near)
{
    const vfloat keeps = k_fma(dot_of(back, back) * (near * near), (vfloat)(MOVES_WITHIN), (vfloat)(1.0f));
    const vector3 to = {k_fma(way->x, keeps, back->x * near), k_fma(way->y, keeps, back->y * near),
                        k_fma(way->z, keeps, back->z * near)};
    return unit_of(to);
}

/* At the probes of a row where there are fits, LANES of them: how openness depends on direction, from the cones
 * around. */
__kernel K_WIDE void occlusion_fit(karst_occlusion_task task, K_GLOBAL float *planes, uint num_items)
{
    const uint item = (uint)get_global_id(0);
    if (item >= num_items)
        return;
    const int fits_across = (task.across + 1) / KARST_OCCLUSION_FIT_STEP;
    const int items_across = (fits_across + LANES - 1) / LANES;
    const int row = (int)(item / (uint)items_across) * KARST_OCCLUSION_FIT_STEP;
    const vint at = V_LANE + (int)(item % (uint)items_across) * LANES, here = at * KARST_OCCLUSION_FIT_STEP;
    const vint inside = v_mask(v_lt(at, (vint)(fits_across)));
    const vfloat zero = (vfloat)(0.0f);
    const int row_size = (task.across + 1) / 2 * 2;
    K_GLOBAL const float *own = planes + row * row_size;
    const vfloat t = load_probes(own, at, 0, task.across);
    const vector3 from = {load_probes(own + KARST_OCCLUSION_PLACE * task.plane, at, 0, task.across),
                          load_probes(own + (KARST_OCCLUSION_PLACE + 1) * task.plane, at, 0, task.across),
                          load_probes(own + (KARST_OCCLUSION_PLACE + 2) * task.plane, at, 0, task.across)};
    const vfloat per_far = 1.0f / (t * FAR_APART_IN_FIT);
    direction_sums sums = {zero, zero, {zero, zero, zero}, {zero, zero, zero}, zero, zero, zero, zero, zero, zero};
    for (int down = -KARST_OCCLUSION_REACH; down <= KARST_OCCLUSION_REACH; down++) {
        if (row + down < 0 || row + down >= task.down)
            continue;
        K_GLOBAL const float *probes = own + down * row_size;
        for (int right = -KARST_OCCLUSION_REACH; right <= KARST_OCCLUSION_REACH; right++) {
            const vint there = here + right;
            if ((right & 1) && task.across == 1)
                continue;
            const vector3 way = {load_probes(probes + KARST_OCCLUSION_WAY * task.plane, at, right, task.across),
                                 load_probes(probes + (KARST_OCCLUSION_WAY + 1) * task.plane, at, right, task.across),
                                 load_probes(probes + (KARST_OCCLUSION_WAY + 2) * task.plane, at, right, task.across)};
            const vint has_cone = v_mask(v_gt(dot_of(&way, &way), (vfloat)(0.5f))) & v_mask(v_ge(there, (vint)(0))) &
                                  v_mask(v_lt(there, (vint)(task.across)));
            if (!v_any(has_cone)) /* sky */
                continue;
            K_GLOBAL const float *places = probes + KARST_OCCLUSION_PLACE * task.plane;
            const vector3 back = {load_probes(places, at, right, task.across) - from.x,
                                  load_probes(places + task.plane, at, right, task.across) - from.y,
                                  load_probes(places + 2 * task.plane, at, right, task.across) - from.z};
            const vfloat near = load_probes(probes + KARST_OCCLUSION_NEAR * task.plane, at, right, task.across);
            const vfloat alike = kinship(load_probes(probes + KARST_OCCLUSION_T * task.plane, at, right, task.across),
                                         t, per_far, LEAST_KINSHIP_IN_FIT);
            const vector3 seen = seen_from(&way, &back, near);
            add_direction(&sums, &seen, v_select(has_cone, alike * (nearness(right) * nearness(down)), zero),
                          v_select(v_mask(v_gt(near, zero)), zero, (vfloat)(1.0f)));
        }
    }
    vfloat level, floor;
    vector3 slope;
    fit_line(&sums, &level, &slope, &floor);
    const vint place = at + row * row_size;
    const uint lanes = mask_bits(inside);
    const float mean_cosine = 2.0f / 3.0f; /* to the normal, of directions that count by it */
    scatter(planes + KARST_OCCLUSION_LEVEL * task.plane, place, lanes, level);
    scatter(planes + KARST_OCCLUSION_SLOPE * task.plane, place, lanes, slope.x * mean_cosine);
    scatter(planes + (KARST_OCCLUSION_SLOPE + 1) * task.plane, place, lanes, slope.y * mean_cosine);
    scatter(planes + (KARST_OCCLUSION_SLOPE + 2) * task.plane, place, lanes, slope.z * mean_cosine);
    scatter(planes + KARST_OCCLUSION_FLOOR * task.plane, place, lanes, floor);
}

/* What the four fits around pixels say of them: fit_x, fit_y: the one before them; part_x, part_y: where they lie
 * between those. */
RAY_INLINE vfloat open_by_fits(const karst_occlusion_task *task, K_GLOBAL const float *planes, const surface_hits *s,
                               int fit_x, int fit_y, vfloat part_x, vfloat part_y)
{
    const vfloat per_far = 1.0f / lane_max(s->t * FAR_APART, (vfloat)(1.0e-30f));
    vfloat open = (vfloat)(0.0f), sum = open;
    for (int corner = 0; corner < 4; corner++) {
        const int column = fit_x + (corner & 1), row = (fit_y + (corner >> 1)) * KARST_OCCLUSION_FIT_STEP;
        if (column * KARST_OCCLUSION_FIT_STEP >= task->across || row >= task->down)
            continue;
        K_GLOBAL const float *probe = planes + (row * ((task->across + 1) / 2 * 2) + column);
        const vfloat near = (corner & 1 ? part_x : 1.0f - part_x) * (corner & 2 ? part_y : 1.0f - part_y);
        const vfloat weight = (near + LEAST_KINSHIP) * kinship((vfloat)(probe[KARST_OCCLUSION_T * task->plane]), s->t,
                                                               per_far, LEAST_KINSHIP);
        const vfloat says =
            k_fma(s->normal.x, (vfloat)(probe[KARST_OCCLUSION_SLOPE * task->plane]),
                  k_fma(s->normal.y, (vfloat)(probe[(KARST_OCCLUSION_SLOPE + 1) * task->plane]),
                        k_fma(s->normal.z, (vfloat)(probe[(KARST_OCCLUSION_SLOPE + 2) * task->plane]),
                              (vfloat)(probe[KARST_OCCLUSION_LEVEL * task->plane]))));
        open = k_fma(weight, lane_max(says, (vfloat)(probe[KARST_OCCLUSION_FLOOR * task->plane])), open);
        sum += weight;
    }
    return lane_unit(open / sum);
}

/* The pixels between four probes, or some of them: from the fits around, and what their own surroundings hide. */
__kernel K_WIDE void occlusion_gather(karst_pinhole seen, karst_occlusion_task task, K_GLOBAL const karst_hit *hits,
                                      K_GLOBAL const float *planes, K_GLOBAL const float *depths,
                                      K_GLOBAL float *open, uint num_items)
{
    const uint item = (uint)get_global_id(0);
    if (item >= num_items)
        return;
    const int first_x = task.left_px / KARST_OCCLUSION_STEP_X, first_y = task.top_px / KARST_OCCLUSION_STEP_Y;
    const uint across = (uint)((task.left_px + task.width_px - 1) / KARST_OCCLUSION_STEP_X - first_x + 1);
    const block_pixels b = pixels_of_item(item, across, first_x, first_y);
    const vint shown_x = b.x - task.left_px, shown_y = b.y - task.top_px;
    const vint inside = v_mask(v_ge(shown_x, (vint)(0))) & v_mask(v_lt(shown_x, (vint)(task.width_px))) &
                        v_mask(v_ge(shown_y, (vint)(0))) & v_mask(v_lt(shown_y, (vint)(task.height_px)));
    if (!v_any(inside))
        return;
    const vector3 direction = pinhole_direction(&seen, b.x, b.y);
    const vint order = v_select(inside, packet_order(b.x, b.y, seen.width_px, seen.height_px), (vint)(0));
    const surface_hits s = load_surface(hits, order, inside, &direction, 0.0f, 0.0f); /* of one packet */
    const vint hit = v_mask(v_ne(s.kind, (vint)((int)KARST_HIT_MISS))) & inside;
    vfloat share = (vfloat)(1.0f);
    if (v_any(hit)) {
        const int fit_x = b.block_x / KARST_OCCLUSION_FIT_STEP, fit_y = b.block_y / KARST_OCCLUSION_FIT_STEP;
        const int apart_x = KARST_OCCLUSION_FIT_STEP * KARST_OCCLUSION_STEP_X,
                  apart_y = KARST_OCCLUSION_FIT_STEP * KARST_OCCLUSION_STEP_Y;
        const vfloat part_x = v_to_float(b.x - fit_x * apart_x) * (1.0f / apart_x),
                     part_y = v_to_float(b.y - fit_y * apart_y) * (1.0f / apart_y);
        const vfloat width = lane_max(s.t * seen.cone, v_as_float((s.level + 127) << 23));
        const vfloat far = open_by_fits(&task, planes, &s, fit_x, fit_y, part_x, part_y);
        const vfloat near = hidden_nearby(&seen, depths, &b, &s.normal, width);
        share = v_select(hit, k_fma(-far, near, far), share);
    }
    if (task.left_px == 0 && task.top_px == 0) /* the order is the same, of whole packets */
        store_ordered(open, packet_order(shown_x, shown_y, task.width_px, task.height_px), inside, share);
    else
        scatter(open, v_select(inside, packet_order(shown_x, shown_y, task.width_px, task.height_px), (vint)(0)),
                mask_bits(inside), share);
}
