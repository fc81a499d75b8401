/* Entry points of occlusion: see raycast/light/occlusion.h. */
#include "raycast/light/lamps.clh"
#include "raycast/light/occlusion_shared.h"
#include "raycast/light/path_rays.clh"
#include "raycast/light/surface.clh"

/* A probe counts for a pixel as their distances from the eye are alike: not from this share of the pixel's on. */
#define FAR_APART 0.25f
/* Of those that are: where no other is near, they say what is known. */
#define LEAST_KINSHIP 1.0e-4f
/* Away from its cone a probe has only its own surface, which may not be a pixel's that looks another way: it counts
 * less as hidden. */
#define BELOW_SHARE 0.5f
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
        vector3 way = {zero, zero, zero};
        if (v_any(hit)) {
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
        const vint place = p.y * task.across + p.x;
        scatter(planes + KARST_OCCLUSION_T * task.plane, place, inside, s.t);
        scatter(planes + KARST_OCCLUSION_WAY * task.plane, place, inside, way.x);
        scatter(planes + (KARST_OCCLUSION_WAY + 1) * task.plane, place, inside, way.y);
        scatter(planes + (KARST_OCCLUSION_WAY + 2) * task.plane, place, inside, way.z);
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
    const vint kind =
        v_gather_int((K_GLOBAL const int *)hits, ray * (int)(sizeof(karst_hit) / sizeof(int)) + 1) & 0xff;
    const vint place = v_select(p.inside, p.y * task.across + p.x, (vint)(0));
    scatter(planes + KARST_OCCLUSION_OPEN * task.plane, place, mask_bits(p.inside),
            v_select(v_mask(v_eq(kind, (vint)((int)KARST_HIT_MISS))), (vfloat)(1.0f), (vfloat)(0.0f)));
}

/* A column or a row of probes about a pixel: those at both ends, which look the same way, share one probe's weight. */
RAY_INLINE vfloat end_share(int step, vfloat part)
{
    return step == -KARST_OCCLUSION_REACH  ? (vfloat)(1.0f) - part
           : step == KARST_OCCLUSION_REACH ? part
                                           : (vfloat)(1.0f);
}

/* The pixels between four probes, or one of them: from the probes around, by the pixel's own normal. */
__kernel K_WIDE void occlusion_gather(karst_pinhole seen, karst_occlusion_task task, K_GLOBAL const karst_hit *hits,
                                      K_GLOBAL const float *planes, K_GLOBAL float *open, uint num_items)
{
    const uint item = (uint)get_global_id(0);
    if (item >= num_items)
        return;
    const int first_x = task.left_px / KARST_OCCLUSION_STEP_X, first_y = task.top_px / KARST_OCCLUSION_STEP_Y;
    const uint across = (uint)((task.left_px + task.width_px - 1) / KARST_OCCLUSION_STEP_X - first_x + 1);
    const uint block = item / (KARST_OCCLUSION_BLOCK / LANES);
    const vint lane = V_LANE + (int)(item % (KARST_OCCLUSION_BLOCK / LANES) * LANES);
    const int probe_x = first_x + (int)(block % across), probe_y = first_y + (int)(block / across);
    const vint in_x = (lane & (KARST_PACKET_SIDE - 1)) + lane / KARST_PACKET_RAYS * KARST_PACKET_SIDE,
               in_y = lane / KARST_PACKET_SIDE & (KARST_OCCLUSION_STEP_Y - 1); /* packets beside one another */
    const vint x = in_x + probe_x * KARST_OCCLUSION_STEP_X, y = in_y + probe_y * KARST_OCCLUSION_STEP_Y;
    const vint shown_x = x - task.left_px, shown_y = y - task.top_px;
    const vint inside = v_mask(v_ge(shown_x, (vint)(0))) & v_mask(v_lt(shown_x, (vint)(task.width_px))) &
                        v_mask(v_ge(shown_y, (vint)(0))) & v_mask(v_lt(shown_y, (vint)(task.height_px)));
    if (!v_any(inside))
        return;
    const vector3 direction = pinhole_direction(&seen, x, y);
    const vint order = v_select(inside, packet_order(x, y, seen.width_px, seen.height_px), (vint)(0));
    const surface_hits s = load_surface(hits, order, inside, &direction, 0.0f, 0.0f); /* of one packet */
    const vint hit = v_mask(v_ne(s.kind, (vint)((int)KARST_HIT_MISS))) & inside;
    const vfloat part_x = v_to_float(in_x) * (1.0f / KARST_OCCLUSION_STEP_X),
                 part_y = v_to_float(in_y) * (1.0f / KARST_OCCLUSION_STEP_Y);
    const vfloat per_far = 1.0f / lane_max(s.t * FAR_APART, (vfloat)(1.0e-30f)), from = s.t * per_far;
    const vfloat zero = (vfloat)(0.0f);
    /* Of what is open, of all that cones looked at, and the same less what lies away from them. */
    vfloat open_sum = zero, sum = zero, signed_sum = zero;
    const int last = v_any(hit) ? KARST_OCCLUSION_REACH : -KARST_OCCLUSION_REACH - 1; /* in the sky there is no sum */
    for (int down = -KARST_OCCLUSION_REACH; down <= last; down++) {
        const int row = probe_y + down;
        if (row < 0 || row >= task.down)
            continue;
        vfloat row_open = zero, row_sum = zero, row_signed = zero;
        for (int right = -KARST_OCCLUSION_REACH; right <= KARST_OCCLUSION_REACH; right++) {
            const int column = probe_x + right;
            if (column < 0 || column >= task.across)
                continue;
            K_GLOBAL const float *probe = planes + ((uint)row * (uint)task.across + (uint)column);
            const vfloat cosine = k_fma(s.normal.x, (vfloat)(probe[KARST_OCCLUSION_WAY * task.plane]),
                                        k_fma(s.normal.y, (vfloat)(probe[(KARST_OCCLUSION_WAY + 1) * task.plane]),
                                              s.normal.z * probe[(KARST_OCCLUSION_WAY + 2) * task.plane]));
            const vfloat apart = k_fma((vfloat)(probe[KARST_OCCLUSION_T * task.plane]), per_far, -from);
            vfloat alike = lane_max(k_fma(-apart, apart, (vfloat)(1.0f)), (vfloat)(LEAST_KINSHIP));
            if (right == -KARST_OCCLUSION_REACH || right == KARST_OCCLUSION_REACH)
                alike *= end_share(right, part_x);
            const vfloat share = cosine * alike, k = lane_max(share, zero);
            row_open = k_fma(k, (vfloat)(probe[KARST_OCCLUSION_OPEN * task.plane]), row_open);
            row_sum += k;
            row_signed += share;
        }
        const vfloat share_y = end_share(down, part_y);
        open_sum = k_fma(row_open, share_y, open_sum);
        sum = k_fma(row_sum, share_y, sum);
        signed_sum = k_fma(row_signed, share_y, signed_sum);
    }
    const vfloat total = k_fma(sum - signed_sum, (vfloat)(BELOW_SHARE), sum);
    /* Where no probe is near nothing is known, and nothing is hidden. */
    const vint known = hit & v_mask(v_gt(total, (vfloat)(0.0f)));
    const vfloat share =
        v_select(known, lane_unit(open_sum / lane_max(total, (vfloat)(1.0e-30f))), (vfloat)(1.0f));
    if (task.left_px == 0 && task.top_px == 0) /* the order is the same, of whole packets */
        store_ordered(open, packet_order(shown_x, shown_y, task.width_px, task.height_px), inside, share);
    else
        scatter(open, v_select(inside, packet_order(shown_x, shown_y, task.width_px, task.height_px), (vint)(0)),
                mask_bits(inside), share);
}
