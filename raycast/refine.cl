/* Entry point of refining: hits of bricks to hits of the true density. See raycast/refine.h. */
#include "raycast/rays.clh"
#include "raycast/rays_shared.h"
#include "raycast/shade_shared.h"
/* The world's density and gradient. */
#include "world.clh"

#include "raycast/exact.clh"

/* Farther than this from where the brick had it, in voxels of its level, a root is another one. */
#define REFINE_REACH 2.0f

typedef struct {
    vfloat t;
    vector3 normal;
    vint found;
} refined;

/* The lanes of `m`, which hit at t, at one level. */
RAY_INLINE refined refine_level(K_GLOBAL const ulong *data, const karst_shade_anchor *anchor, const vector3 *direction,
                                vfloat t, int level, float voxels_per_m, vint m)
{
    const vfloat zero = (vfloat)(0.0f);
    const float reach = REFINE_REACH * k_as_float((uint)(level + 127) << 23);
    world_point_at place;
    vfloat gradient[3];
    refined r;
    exact_places(&place, anchor, direction, t);
    vfloat d0 = world_surface(data, &place, level, gradient);
    /* Into solid the density rises. */
    vfloat slope = k_fma(gradient[0], direction->x, k_fma(gradient[1], direction->y, gradient[2] * direction->z));
    vfloat step = -d0 / slope * voxels_per_m;
    r.found = m & v_gt(slope, zero) & v_le(k_fabs(step), (vfloat)(reach));
    r.t = t;
    r.normal.x = r.normal.y = r.normal.z = zero;
    if (!v_any(r.found))
        return r;
    step = v_select(r.found, step, zero);
    exact_places(&place, anchor, direction, t + step);
    vfloat d1 = world_point(data, &place, level);
    r.found &= v_le(k_fabs(d1), k_fabs(d0));
    /* The secant through both, no farther again. */
    vfloat next = -d1 * step / (d1 - d0);
    next = v_select(v_le(k_fabs(next), k_fabs(step)), next, zero);
    r.t = t + step + next;
    vfloat square = k_fma(gradient[0], gradient[0], k_fma(gradient[1], gradient[1], gradient[2] * gradient[2]));
    r.found &= v_gt(square, zero) & v_lt(square, (vfloat)(3.0e38f)) & v_gt(r.t, zero);
    vfloat scale = -1.0f / k_sqrt(v_select(r.found, square, (vfloat)(1.0f)));
    r.normal.x = gradient[0] * scale;
    r.normal.y = gradient[1] * scale;
    r.normal.z = gradient[2] * scale;
    return r;
}

#define HIT_WORD(word) v_gather_int((K_GLOBAL const int *)hits, record + (word))
#if LANES == 16
#define STORE_REFINED_(l)                       \
    if (found.l) {                              \
        K_GLOBAL karst_hit *hit = hits + at.l;  \
        hit->t = t.l;                           \
        hit->kind = (uint)word.l;               \
        hit->position[0] = normal.x.l;          \
        hit->position[1] = normal.y.l;          \
        hit->position[2] = normal.z.l;          \
    }
#else
#define STORE_REFINED_(l)              \
    if (found) {                       \
        K_GLOBAL karst_hit *hit = hits + at; \
        hit->t = t;                    \
        hit->kind = (uint)word;        \
        hit->position[0] = normal.x;   \
        hit->position[1] = normal.y;   \
        hit->position[2] = normal.z;   \
    }
#define EACH_LANE(F) F(s0)
#endif

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
        t = v_select(r.found, r.t, t);
        normal.x = v_select(r.found, r.normal.x, normal.x);
        normal.y = v_select(r.found, r.normal.y, normal.y);
        normal.z = v_select(r.found, r.normal.z, normal.z);
        found |= r.found;
        left &= ~mine;
    }
    word |= (int)KARST_HIT_REFINED;
    EACH_LANE(STORE_REFINED_)
}
