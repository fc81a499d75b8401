/* Entry point of refining: hits of bricks to hits of the true density. See raycast/refine.h. */
#include "raycast/rays.clh"
#include "raycast/rays_shared.h"
#include "raycast/shade_shared.h"
/* The world's density and gradient. */
#include "world.clh"

#include "raycast/exact.clh"

/* Farther than this from where the brick had it, in voxels of its level, a root is another one. */
#define REFINE_REACH 2.0f
/* Where Newton's step does not lead nearer: so many steps of half a voxel towards the other sign, and so many to narrow
 * what they find. */
#define REFINE_SEARCH_STEPS 8
#define REFINE_NARROW_STEPS 5

typedef struct {
    vfloat t;
    vfloat gradient[3];
    vint found;
} refined;

RAY_INLINE vint is_positive(vfloat d) { return v_gt(d, (vfloat)(0.0f)); }

/* For lanes of `m`, whose density is d0 at t: the change of sign that lies nearest, backward from solid and forward
 * from air, bracketed and narrowed. */
RAY_INLINE refined refine_by_search(K_GLOBAL const ulong *data, const karst_shade_anchor *anchor,
                                    const vector3 *direction, vfloat t, vfloat d0, int level, vint m)
{
    const vfloat half_voxel = (vfloat)(k_as_float((uint)(level + 126) << 23)), one_half = (vfloat)(0.5f);
    world_point_at place;
    refined r;
    vfloat step = v_select(is_positive(d0), -half_voxel, half_voxel);
    /* the near end with the sign of d0, the far end with the other */
    vfloat near = t, at_near = d0, far = t, at_far = d0;
    r.found = (vint)(0);
    for (int i = 0; i < REFINE_SEARCH_STEPS; i++) {
        vint go = m & ~r.found;
        if (!v_any(go))
            break;
        vfloat next = near + step;
        exact_places(&place, anchor, direction, lane_max(next, (vfloat)(0.0f)));
        vfloat d = world_point(data, &place, level);
        vint other = go & (is_positive(d) ^ is_positive(d0)) & v_ge(next, (vfloat)(0.0f));
        far = v_select(other, next, far);
        at_far = v_select(other, d, at_far);
        r.found |= other;
        near = v_select(go & ~other, next, near);
        at_near = v_select(go & ~other, d, at_near);
    }
    r.t = t;
    r.gradient[0] = r.gradient[1] = r.gradient[2] = (vfloat)(0.0f);
    if (!v_any(r.found))
        return r;
    /* False position that halves the weight of an end that stays (Illinois). */
    for (int i = 0; i < REFINE_NARROW_STEPS; i++) {
        vfloat share = at_near / (at_near - at_far);
        share = v_select(v_gt(share, (vfloat)(0.0f)) & v_lt(share, (vfloat)(1.0f)), share, one_half);
        vfloat next = k_fma(far - near, share, near);
        exact_places(&place, anchor, direction, v_select(r.found, next, t));
        vfloat d = world_point(data, &place, level);
        vint as_far = is_positive(d) ^ is_positive(at_near);
        at_near = v_select(as_far, at_near * one_half, d);
        at_far = v_select(as_far, d, at_far * one_half);
        near = v_select(as_far, near, next);
        far = v_select(as_far, next, far);
        r.t = v_select(r.found, next, t);
    }
    exact_places(&place, anchor, direction, r.t);
    world_surface(data, &place, level, r.gradient);
    return r;
}

/* The lanes of `m`, which hit at t, at one level. */
RAY_INLINE refined refine_level(K_GLOBAL const ulong *data, const karst_shade_anchor *anchor, const vector3 *direction,
                                vfloat t, int level, float voxels_per_m, vint m)
{
    const vfloat zero = (vfloat)(0.0f);
    const float reach = REFINE_REACH * k_as_float((uint)(level + 127) << 23);
    world_point_at place;
    refined r;
    exact_places(&place, anchor, direction, t);
    vfloat d0 = world_surface(data, &place, level, r.gradient);
    /* Into solid the density rises. */
    vfloat slope = k_fma(r.gradient[0], direction->x, k_fma(r.gradient[1], direction->y, r.gradient[2] * direction->z));
    vfloat step = -d0 / slope * voxels_per_m;
    r.found = m & v_gt(slope, zero) & v_le(k_fabs(step), (vfloat)(reach));
    r.t = t;
    if (v_any(r.found)) {
        step = v_select(r.found, step, zero);
        exact_places(&place, anchor, direction, lane_max(t + step, zero));
        vfloat d1 = world_point(data, &place, level);
        /* Most of the way to zero: the density is nearly straight here. */
        r.found &= v_le(k_fabs(d1), k_fabs(d0) * 0.25f);
        /* The secant through both, no farther again. */
        vfloat next = -d1 * step / (d1 - d0);
        next = v_select(v_le(k_fabs(next), k_fabs(step)), next, zero);
        r.t = v_select(r.found, t + step + next, t);
    }
    vint rest = m & ~r.found & v_lt(k_fabs(d0), (vfloat)(3.0e38f));
    if (v_any(rest)) {
        refined searched = refine_by_search(data, anchor, direction, t, d0, level, rest);
        r.t = v_select(searched.found, searched.t, r.t);
        for (int i = 0; i < 3; i++)
            r.gradient[i] = v_select(searched.found, searched.gradient[i], r.gradient[i]);
        r.found |= searched.found;
    }
    return r;
}

/* Down the gradient; off where there is none. */
RAY_INLINE vint normal_of_gradient(const vfloat gradient[3], vector3 *normal)
{
    /* scaled first: squares of very large or small gradients are no floats */
    vfloat most = lane_max(lane_max(k_fabs(gradient[0]), k_fabs(gradient[1])), k_fabs(gradient[2]));
    vint good = v_gt(most, (vfloat)(1.0e-37f)) & v_lt(most, (vfloat)(1.0e37f));
    vfloat scale = 1.0f / v_select(good, most, (vfloat)(1.0f));
    vfloat x = gradient[0] * scale, y = gradient[1] * scale, z = gradient[2] * scale;
    vfloat square = k_fma(x, x, k_fma(y, y, z * z));
    good &= v_gt(square, (vfloat)(0.0f));
    vfloat unit = -1.0f / k_sqrt(v_select(good, square, (vfloat)(1.0f)));
    normal->x = x * unit;
    normal->y = y * unit;
    normal->z = z * unit;
    return good;
}

#define HIT_WORD(word) v_gather_int((K_GLOBAL const int *)hits, record + (word))
#if LANES == 16
#define OF_LANE(v, l) (v).l
#else
#define OF_LANE(v, l) (v)
#define EACH_LANE(F) F(s0)
#endif
#define STORE_REFINED_(l)                                \
    if (OF_LANE(found, l)) {                             \
        K_GLOBAL karst_hit *hit = hits + OF_LANE(at, l); \
        hit->t = OF_LANE(t, l);                          \
        hit->kind = (uint)OF_LANE(word, l);              \
        hit->position[0] = OF_LANE(normal.x, l);         \
        hit->position[1] = OF_LANE(normal.y, l);         \
        hit->position[2] = OF_LANE(normal.z, l);         \
    }

__kernel K_WIDE void refine_hits(karst_pinhole pinhole, karst_shade_anchor anchor, K_GLOBAL const ulong *data,
                                 float voxels_per_m, K_GLOBAL karst_hit *hits)
{
    vint x, y;
    vint valid = packet_pixels((uint)get_global_id(0), pinhole.width_px, pinhole.height_px, &x, &y);
    if (!v_any(valid))
        return;
    vector3 direction = pinhole_direction(&pinhole, x, y);
    vint at = v_select(valid, packet_order(x, y, pinhole.width_px, pinhole.height_px), (vint)(0));
    vint record = at * (int)(sizeof(karst_hit) / sizeof(int));
    vint word = HIT_WORD(1), kind = word & 0xff, level = word >> 8 & 0xff;
    vint left = valid & (v_eq(kind, (vint)((int)KARST_HIT_SURFACE)) | v_eq(kind, (vint)((int)KARST_HIT_PROVISIONAL)));
    if (!v_any(left))
        return;
    vfloat t = v_select(left, v_as_float(HIT_WORD(0)), (vfloat)(0.0f));
    vint found = (vint)(0);
    vector3 normal = direction;
    while (v_any(left)) {
        const int here = (int)v_min_across(v_select(left, v_to_float(level), (vfloat)(1000.0f)));
        vint mine = left & v_eq(level, (vint)(here));
        refined r = refine_level(data, &anchor, &direction, t, here, voxels_per_m, mine);
        vector3 down;
        vint good = r.found & normal_of_gradient(r.gradient, &down);
        t = v_select(good, r.t, t);
        normal.x = v_select(good, down.x, normal.x);
        normal.y = v_select(good, down.y, normal.y);
        normal.z = v_select(good, down.z, normal.z);
        found |= good;
        left &= ~mine;
    }
    word |= (int)KARST_HIT_REFINED;
    EACH_LANE(STORE_REFINED_)
}
