/* Entry points of occlusion: see raycast/light/occlusion.h. */
#include "raycast/light/lamps.clh"
#include "raycast/light/occlusion_shared.h"
#include "raycast/light/path_rays.clh"
#include "raycast/light/surface.clh"

/* A pixel's neighbour counts while it lies within so many pixels' widths of the pixel's own plane, less and less. */
#define PLANE_WIDTHS 3.0f
/* And from this cosine between both normals on, wholly from where FACING_SCALE brings it to 1. */
#define FACING_LEAST 0.4f
#define FACING_SCALE 2.5f
/* Of surfaces that are no kin: where none of a pixel's own has a cone, they say what is known. */
#define LEAST_KINSHIP 1.0e-4f
/* Cones start so many voxels of its level above a surface, as rays to the sun do: its own roughness does not stop them
 * (raycast/cast/graze.clh). Rays that start exactly on it cost eight times as much. */
#define OFFSET_VOXELS 1.5f
/* Cones that rise less over a surface carry a hundredth of the light in all, and take longest. */
#define LEAST_COSINE 0.1f

/* The pixels of an item: 4x4 of them, or one of those. */
typedef struct {
    vint x, y, inside;
    uint first_ray; /* of direction 0 */
} cell_pixels;

#define QUARTERS (2 * KARST_OCCLUSION_CELLS) /* of cells, on a square's side */
RAY_INLINE cell_pixels pixels_of_item(uint item, int width_px, int height_px)
{
    cell_pixels p;
    const uint quarter = item / (KARST_PACKET_RAYS / LANES);
    const vint lane = V_LANE + (int)(item % (KARST_PACKET_RAYS / LANES));
    const uint in_square = quarter % (QUARTERS * QUARTERS), square = quarter / (QUARTERS * QUARTERS);
    const uint across = ((uint)width_px + KARST_OCCLUSION_SQUARE - 1) / KARST_OCCLUSION_SQUARE;
    const uint column = in_square % QUARTERS, row = in_square / QUARTERS;
    p.x = (lane & 3) + (int)(square % across * KARST_OCCLUSION_SQUARE + 4 * column);
    p.y = (lane >> 2) + (int)(square / across * KARST_OCCLUSION_SQUARE + 4 * row);
    p.inside = v_mask(v_lt(p.x, (vint)(width_px))) & v_mask(v_lt(p.y, (vint)(height_px)));
    /* Sixteen neighbouring cells, 4x4, are a packet of each direction. */
    const uint cell_x = column / 2, cell_y = row / 2, packet = cell_y / 4 * (KARST_OCCLUSION_CELLS / 4) + cell_x / 4;
    p.first_ray = square * KARST_OCCLUSION_SQUARE_RAYS + packet * KARST_PACKET_RAYS + cell_y % 4 * 4 + cell_x % 4;
    return p;
}

/* Which direction is a pixel's, by its place in the whole: as Bayer's matrix orders them, so that those of pixels next
 * to one another differ most. */
RAY_INLINE vint direction_of(const karst_pinhole *seen, uint turn, vint x, vint y)
{
    const vint v = y + seen->y0_px, u = (x + seen->x0_px) ^ v;
    const vint number =
        (u & 1) << 5 | (v & 1) << 4 | (u & 2) << 2 | (v & 2) << 1 | (u & 4) >> 1 | (v & 4) >> 2;
    return (number + (int)turn) & (KARST_OCCLUSION_CONES - 1);
}

RAY_INLINE vint ray_of(const cell_pixels *p, vint number)
{
    return number * (KARST_OCCLUSION_SQUARE_RAYS / KARST_OCCLUSION_CONES) + (int)p->first_ray;
}

RAY_INLINE vint place_in_planes(const karst_occlusion_task *task, vint x, vint y)
{
    return (y + KARST_OCCLUSION_REACH) * task->pitch + x + KARST_OCCLUSION_AROUND;
}

RAY_INLINE void scatter(K_GLOBAL float *plane, vint place, uint lanes, vfloat v)
{
    int at[LANES];
    float value[LANES];
    v_store_int(place, at);
    v_store_float(v, value);
    for (int l = 0; l < LANES; l++)
        if (lanes >> l & 1u)
            plane[at[l]] = value[l];
}

RAY_INLINE vint tenth_bits(vfloat component) { return v_to_int(k_fma(component, (vfloat)(511.5f), (vfloat)(512.0f))); }
RAY_INLINE vint pack_normal(const vector3 *n)
{
    return tenth_bits(n->x) | tenth_bits(n->y) << 10 | tenth_bits(n->z) << 20 | 1 << 30;
}
RAY_INLINE vector3 unpack_normal(vint bits)
{
    const vfloat scale = (vfloat)(1.0f / 511.5f), least = (vfloat)(-1.0f);
    const vector3 n = {k_fma(v_to_float(bits & 1023), scale, least), k_fma(v_to_float(bits >> 10 & 1023), scale, least),
                       k_fma(v_to_float(bits >> 20 & 1023), scale, least)};
    return n;
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

RAY_INLINE void store_rise(K_GLOBAL karst_ray *rays, const path_rays *r, vfloat rise)
{
    int index[LANES];
    float value[LANES];
    v_store_int(r->index, index);
    v_store_float(rise, value);
    for (int l = 0; l < LANES; l++)
        rays[index[l]].rise = value[l];
}

/* Makes the cones, which are idle where nothing is hit or they do not leave the surface; and the planes of what pixels
 * are. */
__kernel K_WIDE void occlusion_rays(karst_pinhole seen, karst_occlusion_task task, float cone,
                                    K_GLOBAL const karst_hit *hits, K_GLOBAL karst_ray *rays, K_GLOBAL float *planes,
                                    uint num_items)
{
    const uint item = (uint)get_global_id(0);
    if (item >= num_items)
        return;
    const vfloat zero = (vfloat)(0.0f);
    const cell_pixels p = pixels_of_item(item, seen.width_px, seen.height_px);
    const vint number = direction_of(&seen, task.turn, p.x, p.y);
    path_rays r;
    r.valid = (vint)(-1);
    r.lanes = mask_bits(r.valid);
    r.index = ray_of(&p, number);
    r.pixel = p.y << 16 | p.x;
    r.flags = (vint)(0);
    r.throughput.r = r.throughput.g = r.throughput.b = zero;
    r.origin.x = r.origin.y = r.origin.z = zero;
    r.direction.x = r.direction.z = zero, r.direction.y = (vfloat)(1.0f);
    r.t_max = zero;
    r.width = (vfloat)(1.0f);
    r.cone = (vfloat)(cone);
    vfloat rise = zero;
    if (v_any(p.inside)) {
        const vector3 direction = pinhole_direction(&seen, p.x, p.y);
        const vint order = packet_order(p.x, p.y, seen.width_px, seen.height_px);
        const surface_hits s = load_surface(hits, order, p.inside, &direction, 0.0f, 0.0f);
        const vint hit = v_mask(v_ne(s.kind, (vint)((int)KARST_HIT_MISS))) & p.inside;
        const uint inside = mask_bits(p.inside);
        const vector3 to = {direction.x * s.t, direction.y * s.t, direction.z * s.t};
        const vfloat voxel = v_as_float((s.level + 127) << 23), width = s.t * seen.cone;
        const vint place = place_in_planes(&task, p.x, p.y);
        vfloat weight = zero;
        if (v_any(hit)) {
            const vector3 way = cone_of(&task, number);
            const vfloat cosine = dot_of(&way, &s.normal);
            const vint leaves = hit & v_gt(cosine, (vfloat)(LEAST_COSINE));
            weight = v_select(leaves, cosine, zero);
            const vfloat up = voxel * (vfloat)(OFFSET_VOXELS);
            rise = lane_max(cosine, (vfloat)(LEAST_COSINE));
            r.origin.x = v_select(hit, k_fma(s.normal.x, up, to.x), zero);
            r.origin.y = v_select(hit, k_fma(s.normal.y, up, to.y), zero);
            r.origin.z = v_select(hit, k_fma(s.normal.z, up, to.z), zero);
            r.direction.x = v_select(hit, way.x, zero);
            r.direction.y = v_select(hit, way.y, (vfloat)(1.0f));
            r.direction.z = v_select(hit, way.z, zero);
            r.width = v_select(hit, lane_max(width, voxel * (vfloat)(1.0001f / task.detail)), r.width);
            r.t_max = v_select(leaves, to_end(&to, &way, seen.t_max), zero);
        }
        scatter(planes, place, inside, to.x);
        scatter(planes + task.plane, place, inside, to.y);
        scatter(planes + 2 * (size_t)task.plane, place, inside, to.z);
        scatter(planes + KARST_OCCLUSION_NORMAL * (size_t)task.plane, place, inside,
                v_as_float(v_select(hit, pack_normal(&s.normal), (vint)(0))));
        scatter(planes + KARST_OCCLUSION_WIDTH * (size_t)task.plane, place, inside, lane_max(width, voxel));
        scatter(planes + KARST_OCCLUSION_WEIGHT * (size_t)task.plane, place, inside, weight);
    }
    store_paths(rays, &r, KARST_SIDE_ANY);
    store_rise(rays, &r, rise);
}

/* What cones met, to where their pixels are. */
__kernel K_WIDE void occlusion_see(karst_pinhole seen, karst_occlusion_task task, K_GLOBAL const karst_hit *hits,
                                   K_GLOBAL float *planes, uint num_items)
{
    const uint item = (uint)get_global_id(0);
    if (item >= num_items)
        return;
    const cell_pixels p = pixels_of_item(item, seen.width_px, seen.height_px);
    if (!v_any(p.inside))
        return;
    const vint ray = ray_of(&p, direction_of(&seen, task.turn, p.x, p.y));
    const vint kind =
        v_gather_int((K_GLOBAL const int *)hits, ray * (int)(sizeof(karst_hit) / sizeof(int)) + 1) & 0xff;
    const vint place = place_in_planes(&task, p.x, p.y);
    const vfloat weight = v_gather_float(planes + KARST_OCCLUSION_WEIGHT * (size_t)task.plane,
                                         v_select(p.inside, place, (vint)(0)));
    scatter(planes + KARST_OCCLUSION_SEEN * (size_t)task.plane, place, mask_bits(p.inside),
            v_select(v_eq(kind, (vint)((int)KARST_HIT_MISS)), weight, (vfloat)(0.0f)));
}

/* A pixel, and how much its neighbours count. */
typedef struct {
    vector3 at, normal;
    vint is_hit;
    vfloat per; /* width */
} centre;

RAY_INLINE centre load_centre(K_GLOBAL const float *own, size_t plane)
{
    const vint bits = v_as_int(v_load_float(own + KARST_OCCLUSION_NORMAL * plane));
    const centre c = {{v_load_float(own), v_load_float(own + plane), v_load_float(own + 2 * plane)},
                      unpack_normal(bits),
                      v_mask(v_ne(bits, (vint)(0))),
                      1.0f / lane_max(v_load_float(own + KARST_OCCLUSION_WIDTH * plane) * PLANE_WIDTHS,
                                      (vfloat)(1.0e-30f))};
    return c;
}

RAY_INLINE vfloat kinship(const centre *c, K_GLOBAL const float *other, size_t plane)
{
    const vint bits = v_as_int(v_load_float(other + KARST_OCCLUSION_NORMAL * plane));
    const vector3 n = unpack_normal(bits);
    const vfloat off =
        k_fma(c->normal.x, v_load_float(other) - c->at.x,
              k_fma(c->normal.y, v_load_float(other + plane) - c->at.y,
                    c->normal.z * (v_load_float(other + 2 * plane) - c->at.z)));
    const vfloat flat = lane_max((vfloat)(1.0f) - k_fabs(off) * c->per, (vfloat)(0.0f));
    const vfloat facing = lane_unit((dot_of(&c->normal, &n) - FACING_LEAST) * FACING_SCALE);
    return v_select(v_ne(bits, (vint)(0)), k_fma(flat, facing, (vfloat)(LEAST_KINSHIP)), (vfloat)(0.0f));
}

/* Pixels at both ends of a neighbourhood count half: so each direction counts once. */
RAY_INLINE float end_share(int step)
{
    return step == KARST_OCCLUSION_REACH || step == -KARST_OCCLUSION_REACH ? 0.5f : 1.0f;
}

/* LANES neighbours in a row of what is looked at: sums over neighbours in that row. */
__kernel K_WIDE void occlusion_rows(karst_pinhole seen, karst_occlusion_task task, K_GLOBAL float *planes,
                                    uint num_items)
{
    const uint item = (uint)get_global_id(0), across = ((uint)task.width_px + LANES - 1) / LANES;
    if (item >= num_items)
        return;
    const int first = (int)(item % across * LANES), y = (int)(item / across);
    const vint x = V_LANE + first;
    const size_t plane = task.plane;
    K_GLOBAL float *own = planes + (size_t)(y + KARST_OCCLUSION_REACH) * (size_t)task.pitch + first + task.left_px +
                          KARST_OCCLUSION_AROUND;
    const vfloat zero = (vfloat)(0.0f);
    const centre c = load_centre(own, plane);
    vfloat sum = zero, total = zero;
    for (int step = -KARST_OCCLUSION_REACH; step <= KARST_OCCLUSION_REACH; step++) {
        const vint column = x + (task.left_px + step);
        const vint there =
            v_mask(v_ge(column, (vint)(0))) & v_mask(v_lt(column, (vint)(seen.width_px)));
        const vfloat k = v_select(there, kinship(&c, own + step, plane) * end_share(step), zero);
        sum = k_fma(k, v_select(there, v_load_float(own + step + KARST_OCCLUSION_SEEN * plane), zero), sum);
        total = k_fma(k, v_select(there, v_load_float(own + step + KARST_OCCLUSION_WEIGHT * plane), zero), total);
    }
    const uint inside = mask_bits(v_mask(v_lt(x, (vint)(task.width_px))));
    const vint place = x + ((y + KARST_OCCLUSION_REACH) * task.pitch + task.left_px + KARST_OCCLUSION_AROUND);
    scatter(planes + KARST_OCCLUSION_ROW * plane, place, inside, sum);
    scatter(planes + (KARST_OCCLUSION_ROW + 1) * plane, place, inside, total);
}

/* LANES neighbours in a row of the picture: from sums over rows. */
__kernel K_WIDE void occlusion_gather(karst_pinhole seen, karst_occlusion_task task, K_GLOBAL const float *planes,
                                      K_GLOBAL float *open, uint num_items)
{
    const uint item = (uint)get_global_id(0), across = ((uint)task.width_px + LANES - 1) / LANES;
    if (item >= num_items)
        return;
    const int first = (int)(item % across * LANES), y = (int)(item / across);
    const vint x = V_LANE + first, inside = v_mask(v_lt(x, (vint)(task.width_px)));
    const size_t plane = task.plane;
    K_GLOBAL const float *own = planes + (size_t)(y + task.top_px + KARST_OCCLUSION_REACH) * (size_t)task.pitch +
                                first + task.left_px + KARST_OCCLUSION_AROUND;
    const centre c = load_centre(own, plane);
    vfloat sum = (vfloat)(0.0f), total = (vfloat)(0.0f);
    for (int step = -KARST_OCCLUSION_REACH; step <= KARST_OCCLUSION_REACH; step++) {
        K_GLOBAL const float *other = own + step * task.pitch;
        if (y + task.top_px + step < 0 || y + task.top_px + step >= seen.height_px)
            continue;
        const vfloat k = v_select(inside, kinship(&c, other, plane) * end_share(step), (vfloat)(0.0f));
        sum = k_fma(k, v_select(inside, v_load_float(other + KARST_OCCLUSION_ROW * plane), (vfloat)(0.0f)), sum);
        total =
            k_fma(k, v_select(inside, v_load_float(other + (KARST_OCCLUSION_ROW + 1) * plane), (vfloat)(0.0f)), total);
    }
    /* Where no cone is near nothing is known, and nothing is hidden. */
    const vint known = c.is_hit & v_mask(v_gt(total, (vfloat)(0.0f)));
    const vfloat share = sum / lane_max(total, (vfloat)(1.0e-30f));
    scatter(open, packet_order(x, (vint)(y), task.width_px, task.height_px), mask_bits(inside),
            v_select(known, lane_unit(share), (vfloat)(1.0f)));
}
