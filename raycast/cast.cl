/* Entry points of casting: a stream of rays in, hit records and stamps out. See raycast/cast.h. */
#include "raycast/rays.clh"
#include "raycast/rays_shared.h"
#include "raycast/views_shared.h"
#include "raycast/walk.clh"

/* Directions flatter than this on an axis count as this, upwards: their inverse stays finite, and a ray that runs in a
 * plane belongs to the cell above it on every level. */
#define FLAT 1.0e-18f

/* What casting a packet gives, lane by lane; `kind` as in karst_hit. */
typedef struct {
    vfloat t;
    vint kind, brick, cell, node;
    vector3 position;
} packet_hits;

/* What a beam keeps of its packets beside what walking needs. */
typedef struct {
    vector3 origin; /* not mirrored; unused by streams from the anchor itself */
    vfloat t_end;
    vint octants, alive;
} packet_start;

/* Puts packet p on its way: the lanes of `valid`. */
RAY_INLINE void start_packet(beam *b, packet_start *start, int p, K_GLOBAL const karst_cast_view *view,
                             const vector3 *origin, const vector3 *direction, vfloat t_min, vfloat t_max, vfloat width,
                             vfloat cone, vint valid)
{
    const vfloat zero = (vfloat)(0.0f);
    findings *found = &b->found[p];
    found->kind = found->brick = found->node = found->cell = (vint)(0);
    found->t = t_max;
    found->dt = zero;
    found->at.x = found->at.y = found->at.z = found->step.x = found->step.y = found->step.z = zero;
    found->f.c0 = found->f.c1 = found->f.c2 = found->f.c3 = zero;
#ifdef CAST_COUNT_STEPS
    found->steps = (vint)(0);
#endif
    b->incomplete[p] = (vint)(0);

    packet *rays = &b->rays[p];
    vint down_x = v_le(direction->x, (vfloat)(-FLAT)), down_y = v_le(direction->y, (vfloat)(-FLAT)),
         down_z = v_le(direction->z, (vfloat)(-FLAT));
    rays->direction.x = lane_max(k_fabs(direction->x), (vfloat)(FLAT));
    rays->direction.y = lane_max(k_fabs(direction->y), (vfloat)(FLAT));
    rays->direction.z = lane_max(k_fabs(direction->z), (vfloat)(FLAT));
    rays->inverse.x = 1.0f / rays->direction.x;
    rays->inverse.y = 1.0f / rays->direction.y;
    rays->inverse.z = 1.0f / rays->direction.z;
    rays->t_min = lane_max(t_min, zero);
    rays->lod_shift = width * view->detail;
    rays->lod_slope = lane_max(cone * view->detail, (vfloat)(1.0e-20f));
    rays->lod_scale = 1.0f / rays->lod_slope;
    rays->fresh = (vint)(0);
    start->origin = *origin;
    start->t_end = t_max;
    start->octants = (down_x & 1) | (down_y & 2) | (down_z & 4);
    start->alive = valid & v_lt(t_min, t_max);
}

/* Casts the packets that were started. from_anchor (a constant): origins are zero. */
RAY_INLINE void cast_beam(const pools *pool, K_GLOBAL const karst_cast_view *view, const int from_anchor, beam *b,
                          const packet_start start[BEAM_PACKETS])
{
    /* Usually all lanes climb and fall on the same axes; else each octant is walked by itself. */
    int some = 0, all = 7;
    for (int p = 0; p < BEAM_PACKETS; p++)
        for (int axis = 0; axis < 3; axis++) {
            vint down = v_ne(start[p].octants & (1 << axis), (vint)(0));
            some |= v_any(start[p].alive & down) ? 1 << axis : 0;
            all &= v_any(start[p].alive & ~down) ? ~(1 << axis) : 7;
        }
    for (int octant = 0; octant < 8; octant++) {
        if ((octant & ~some) || (all & ~octant))
            continue;
        for (int p = 0; p < BEAM_PACKETS; p++) {
            vint mine = start[p].alive & v_eq(start[p].octants, (vint)(octant));
            packet *rays = &b->rays[p];
            rays->t_max = v_select(mine, start[p].t_end, (vfloat)(RAY_DONE));
            if (!from_anchor) {
                rays->origin.x = octant & 1 ? -start[p].origin.x : start[p].origin.x;
                rays->origin.y = octant & 2 ? -start[p].origin.y : start[p].origin.y;
                rays->origin.z = octant & 4 ? -start[p].origin.z : start[p].origin.z;
            }
        }
        b->octant = (uint)octant;
        bound_beam(b, from_anchor);
        if (b->live)
            walk_octree(pool, view, from_anchor, b);
    }
}

/* What packet p came to. any_hit: where along the cell the surface lies does not matter. */
RAY_INLINE packet_hits finish_packet(const beam *b, const packet_start *start, int p, int any_hit)
{
    const findings *found = &b->found[p];
    packet_hits hits;
    vfloat s = (vfloat)(0.0f);
    vint hit = v_ne(found->kind, (vint)(0));
    if (!any_hit && v_any(hit))
        s = cubic_first_root(&found->f, hit);
    hits.t = v_select(hit, k_fma(s, found->dt, found->t), start->t_end);
    hits.kind = found->kind | (b->incomplete[p] & (int)KARST_HIT_INCOMPLETE);
#ifdef CAST_COUNT_STEPS
    hits.kind |= lane_min_int(found->steps, (vint)(KARST_STEPS_MAX)) << KARST_STEPS_SHIFT;
#endif
    hits.brick = found->brick;
    hits.cell = found->cell;
    hits.node = found->node;
    hits.position.x = lane_unit(k_fma(s, found->step.x, found->at.x));
    hits.position.y = lane_unit(k_fma(s, found->step.y, found->at.y));
    hits.position.z = lane_unit(k_fma(s, found->step.z, found->at.z));
    return hits;
}

/* Lane by lane into the records; `index` where `valid`. */
#if LANES == 16
#define STORE_HIT_(l)                                                                                          \
    if (valid.l)                                                                                               \
        vstore8((uint8)(as_uint(hits->t.l), (uint)hits->kind.l, (uint)hits->brick.l, (uint)hits->cell.l,       \
                        as_uint(hits->position.x.l), as_uint(hits->position.y.l), as_uint(hits->position.z.l), \
                        (uint)hits->node.l),                                                                   \
                (size_t)index.l, (K_GLOBAL uint *)out);
RAY_INLINE void store_hits(K_GLOBAL karst_hit *out, const packet_hits *hits, vint index,
                           vint valid){EACH_LANE(STORE_HIT_)}
#else
RAY_INLINE void store_hits(K_GLOBAL karst_hit *out, const packet_hits *hits, vint index, vint valid)
{
    if (!valid)
        return;
    karst_hit hit = {hits->t,
                     (uint)hits->kind,
                     (uint)hits->brick,
                     (uint)hits->cell,
                     {hits->position.x, hits->position.y, hits->position.z},
                     (uint)hits->node};
    out[index] = hit;
}
#endif

__kernel K_WIDE void cast_pinhole(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_pinhole pinhole,
                                  K_GLOBAL karst_hit *hits)
{
    const pools pool = POOL_FIELDS;
    const uint first = (uint)get_global_id(0) * BEAM_PACKETS;
    const vfloat zero = (vfloat)(0.0f);
    const vector3 origin = {zero, zero, zero};
    beam b;
    packet_start start[BEAM_PACKETS];
    vint x, y;
    for (int p = 0; p < BEAM_PACKETS; p++) {
        vint valid = packet_pixels(first + (uint)p, pinhole.width_px, pinhole.height_px, &x, &y);
        vector3 direction = pinhole_direction(&pinhole, x, y);
        start_packet(&b, &start[p], p, view, &origin, &direction, (vfloat)(pinhole.t_min), (vfloat)(pinhole.t_max),
                     zero, (vfloat)(pinhole.cone), valid);
    }
    cast_beam(&pool, view, 1, &b, start);
    for (int p = 0; p < BEAM_PACKETS; p++) {
        vint valid = packet_pixels(first + (uint)p, pinhole.width_px, pinhole.height_px, &x, &y);
        packet_hits found = finish_packet(&b, &start[p], p, 0);
        store_hits(hits, &found, packet_order(x, y, pinhole.width_px, pinhole.height_px), valid);
    }
}

/* Field `word` of the rays in the lanes, as floats. */
#define RAY_WORD(word) v_gather_float(words, first + (word))

__kernel K_WIDE void cast_rays(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, K_GLOBAL const karst_ray *rays,
                               uint num_rays, int any_hit, K_GLOBAL karst_hit *hits)
{
    const pools pool = POOL_FIELDS;
    const uint base = (uint)get_global_id(0) * (LANES * BEAM_PACKETS);
    if (base >= num_rays)
        return;
    beam b;
    packet_start start[BEAM_PACKETS];
    const vint lane = V_LANE;
    for (int p = 0; p < BEAM_PACKETS; p++) {
        const uint at = base + (uint)(p * LANES), left = at < num_rays ? num_rays - at : 0u;
        K_GLOBAL const float *words = (K_GLOBAL const float *)(rays + (left ? at : base));
        vint valid = v_lt(lane, (vint)((int)min(left, (uint)LANES)));
        vint first = v_select(valid, lane, (vint)(0)) * (int)(sizeof(karst_ray) / sizeof(float));
        vector3 origin = {RAY_WORD(0), RAY_WORD(1), RAY_WORD(2)};
        vector3 direction = {RAY_WORD(4), RAY_WORD(5), RAY_WORD(6)};
        start_packet(&b, &start[p], p, view, &origin, &direction, RAY_WORD(3), RAY_WORD(7), RAY_WORD(8), RAY_WORD(9),
                     valid);
    }
    cast_beam(&pool, view, 0, &b, start);
    for (int p = 0; p < BEAM_PACKETS; p++) {
        const uint at = base + (uint)(p * LANES), left = at < num_rays ? num_rays - at : 0u;
        packet_hits found = finish_packet(&b, &start[p], p, any_hit);
        if (left)
            store_hits(hits + at, &found, lane, v_lt(lane, (vint)((int)min(left, (uint)LANES))));
    }
}
