/* Entry point of refining: hits of bricks to hits of the true density. See raycast/cast/refine.h. */
#include "raycast/cast/rays.clh"
#include "raycast/rays_shared.h"
#include "raycast/shade_shared.h"
/* The world's density and gradient. */
#include "world.clh"

#include "raycast/cast/exact.clh"

/* Farther than this from where the brick had it, in voxels of its level, a root is another one. */
#define REFINE_REACH 2.0f
/* But thin matter is shown wider than it is, to either side by a voxel along each axis (producers/steps/raise.clh), and
 * where levels blend by one of the next level's: so far across its surface, in voxels, may lie what a stream's rays
 * come to. What a brick errs by is far less than the second. Rays that meet it more flatly than the third, a cosine, do
 * as if it was that. */
#define REFINE_RAISED 3.5f
#define REFINE_IS_RAISED 0.25f
#define REFINE_FLATTEST 0.03125f
/* A Newton step shorter than this, in voxels, needs no second look: its error goes with its square. */
#define REFINE_CLOSE 0.015625f
/* Longer steps ahead, in voxels, are taken only if nothing is solid at so many places on the way, and as many in the
 * voxel behind, nor where the density there leads to before the next place. The second length is for rays that the true
 * slope and the brick's normal do not agree for: the square of their cosine is below the third. There may stand what
 * lies between the samples. */
#define REFINE_AHEAD 0.25f
#define REFINE_AHEAD_BENT 0.0625f
#define REFINE_BENT 0.9f
#define REFINE_LOOKS 4
/* Where Newton's step does not lead nearer: steps towards the other sign, in voxels, and so many to narrow what they
 * find. */
#define REFINE_SEARCH_STEPS 5
#define REFINE_NARROW_STEPS 5
/* Behind air whose density rises there, this little past where it would be 0 if it went on straight. */
#define REFINE_PAST 1.03125f
/* Of the step between two places of different signs: what is left of it after that many is a jump. */
#define REFINE_JUMP 0.25f
__constant float search_steps[REFINE_SEARCH_STEPS] = {0.5f, 0.5f, 0.5f, 1.0f, 1.5f};

/* With REFINE_LAYER the density is the world's with the content of layers, whose data travel along. */
#ifdef REFINE_LAYER
#define LAYER_TAKEN , K_GLOBAL const ulong *layer, K_GLOBAL const ulong *beneath
#define LAYER_OF(field) , (field)->layer, (field)->beneath
#define LAYER_GIVEN , layer, beneath
#else
#define LAYER_GIVEN
#define LAYER_TAKEN
#define LAYER_OF(field)
#endif

/* The field that hits of one level lie on: that level's density, or, where levels blend, f + w (c - f) with the next
 * one's (raycast/cast/blend.clh). */
typedef struct {
    K_GLOBAL const ulong *data;
    const karst_shade_anchor *anchor;
    const vector3 *direction;
    int level;
    vint lanes;                       /* whose hits blend */
    float weight_slope, weight_start; /* the weight at t: slope * t + start, in [0, 1] */
#ifdef REFINE_STREAM
    const vector3 *origin; /* of the rays, from the anchor */
    vfloat sign;           /* -1 of rays that leave matter: to them it is air */
    float voxels_per_m;
#endif
#ifdef REFINE_LAYER
    K_GLOBAL const ulong *layer, *beneath;
#endif
} refine_field;

typedef struct {
    vfloat t;
    vfloat gradient[3];
#if defined(REFINE_THIN) && defined(REFINE_STREAM)
    vint in_air; /* where the brick has its surface the density is far below 0 */
#endif
    vint found, jumps; /* jumps: the density does not go through 0 there, and has no slope that says how it lies */
} refined;

RAY_INLINE vint is_positive(vfloat d) { return v_gt(d, (vfloat)(0.0f)); }

K_CALLED vfloat density_at(K_GLOBAL const ulong *data, const world_point_at *place, int level LAYER_TAKEN)
{
    const vfloat d = world_point(data, place, level);
#ifdef REFINE_LAYER
    return layer_density(layer, beneath, place, level, d);
#else
    return d;
#endif
}

K_CALLED vfloat surface_at(K_GLOBAL const ulong *data, const world_point_at *place, int level,
                              vfloat gradient[3] LAYER_TAKEN)
{
    const vfloat d = world_surface(data, place, level, gradient);
#ifdef REFINE_LAYER
    return layer_surface(layer, beneath, place, level, d, gradient);
#else
    return d;
#endif
}

RAY_INLINE vfloat field_weight(const refine_field *field, vfloat t)
{
    vfloat w = lane_unit(k_fma(t, (vfloat)(field->weight_slope), (vfloat)(field->weight_start)));
    return v_select(field->lanes, w, (vfloat)(0.0f));
}

#ifdef REFINE_STREAM
#define SIGNED(d) ((d)*field->sign)
#else
#define SIGNED(d) (d)
#endif

RAY_INLINE void field_places(world_point_at *place, const refine_field *field, vfloat t)
{
#ifdef REFINE_STREAM
    exact_place(place, 0, field->anchor, k_fma(field->direction->x, t, field->origin->x));
    exact_place(place, 1, field->anchor, k_fma(field->direction->y, t, field->origin->y));
    exact_place(place, 2, field->anchor, k_fma(field->direction->z, t, field->origin->z));
#else
    exact_places(place, field->anchor, field->direction, t);
#endif
}

RAY_INLINE vfloat field_density(const refine_field *field, vfloat t)
{
    world_point_at place;
    field_places(&place, field, t);
    vfloat d = density_at(field->data, &place, field->level LAYER_OF(field)), w = field_weight(field, t);
    vint blended = v_gt(w, (vfloat)(0.0f));
    if (v_any(blended))
        d = v_select(blended, k_fma(w, density_at(field->data, &place, field->level + 1 LAYER_OF(field)) - d, d), d);
    return SIGNED(d);
}

RAY_INLINE vfloat field_surface(const refine_field *field, vfloat t, vfloat gradient[3])
{
    world_point_at place;
    field_places(&place, field, t);
    vfloat d = surface_at(field->data, &place, field->level, gradient LAYER_OF(field)), w = field_weight(field, t);
    vint blended = v_gt(w, (vfloat)(0.0f));
    if (v_any(blended)) {
        vfloat next[3];
        const vfloat d_next = surface_at(field->data, &place, field->level + 1, next LAYER_OF(field));
        d = v_select(blended, k_fma(w, d_next - d, d), d);
        for (int i = 0; i < 3; i++)
            gradient[i] = v_select(blended, k_fma(w, next[i] - gradient[i], gradient[i]), gradient[i]);
    }
#ifdef REFINE_STREAM
    for (int i = 0; i < 3; i++)
        gradient[i] *= field->sign;
#endif
    return SIGNED(d);
}

/* For lanes of `m`, whose density is d0 at t and d1 at t1: the change of sign that lies nearest, backward from solid
 * and forward from air, bracketed and narrowed. */
RAY_INLINE refined refine_by_search(const refine_field *field, vfloat t, vfloat d0, vfloat t1, vfloat d1, vint m)
{
    const float voxel = k_as_float((uint)(field->level + 127) << 23);
    const vfloat one_half = (vfloat)(0.5f), zero = (vfloat)(0.0f);
    refined r;
    vfloat side = v_select(is_positive(d0), (vfloat)(-voxel), (vfloat)(voxel));
    /* the near end with the sign of d0, the far end with the other */
    vfloat near = t, at_near = d0, far = t1, at_far = d1;
    r.found = m & (is_positive(d0) ^ is_positive(d1)) & v_lt(k_fabs(d1), (vfloat)(INFINITY));
    for (int i = 0; i < REFINE_SEARCH_STEPS; i++) {
        vint go = m & ~r.found;
        if (!v_any(go))
            break;
        vfloat next = k_fma(side, (vfloat)(search_steps[i]), near);
        vfloat d = field_density(field, lane_max(next, zero));
        vint other = go & (is_positive(d) ^ is_positive(d0)) & v_ge(next, zero);
        far = v_select(other, next, far);
        at_far = v_select(other, d, at_far);
        r.found |= other;
        near = v_select(go & ~other, next, near);
        at_near = v_select(go & ~other, d, at_near);
    }
    r.t = t;
    r.gradient[0] = r.gradient[1] = r.gradient[2] = zero;
    r.jumps = (vint)(0);
    if (!v_any(r.found))
        return r;
    const vfloat step = k_fabs(at_near - at_far);
    vfloat before = at_near, behind = at_far; /* the densities themselves */
    /* False position that halves the weight of an end that stays (Illinois). */
    for (int i = 0; i < REFINE_NARROW_STEPS; i++) {
        vfloat share = at_near / (at_near - at_far);
        share = v_select(v_gt(share, zero) & v_lt(share, (vfloat)(1.0f)), share, one_half);
        vfloat next = k_fma(far - near, share, near);
        vfloat d = field_density(field, v_select(r.found, next, t));
        vint as_far = is_positive(d) ^ is_positive(at_near);
        at_near = v_select(as_far, at_near * one_half, d);
        at_far = v_select(as_far, d, at_far * one_half);
        before = v_select(as_far, before, d);
        behind = v_select(as_far, d, behind);
        near = v_select(as_far, near, next);
        far = v_select(as_far, next, far);
        r.t = v_select(r.found, next, t);
    }
    r.jumps = r.found & v_gt(k_fabs(before - behind), step * (vfloat)(REFINE_JUMP));
    r.t = v_select(r.jumps, (near + far) * one_half, r.t);
    field_surface(field, r.t, r.gradient);
    return r;
}

#ifdef REFINE_THIN
/* How far along a ray its root may be, if it comes to a density d with this gradient, which rises so fast along it. */
RAY_INLINE vfloat refine_reach(float voxel, vfloat d, vfloat slope, const vfloat gradient[3], float voxels_per_m)
{
    const vfloat square = k_fma(gradient[0], gradient[0], k_fma(gradient[1], gradient[1], gradient[2] * gradient[2])),
                 steep = k_sqrt(square), reach = (vfloat)(REFINE_REACH * voxel);
    const vint raised = v_gt(k_fabs(d) * voxels_per_m, steep * (vfloat)(REFINE_IS_RAISED * voxel)) &
                        v_gt(steep, (vfloat)(0.0f));
    const vfloat along = steep / lane_max(slope, steep * (vfloat)(REFINE_FLATTEST));
    return v_select(raised, lane_max(along * (vfloat)(REFINE_RAISED * voxel), reach), reach);
}
#endif

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

#ifdef REFINE_STREAM
/* How rays begin: in matter, or in air on a surface; from where they are cast, later than that where they leave thin
 * matter; how far they go, and how wide they are. */
typedef struct {
    vint back, front;
    vfloat from, to, width;
} ray_start;

#ifdef REFINE_THIN
#include "raycast/cast/onwards.clh"
#endif
#endif

RAY_INLINE vint is_bent(const vfloat gradient[3], const vector3 *normal)
{
    const vfloat common = k_fma(gradient[0], normal->x, k_fma(gradient[1], normal->y, gradient[2] * normal->z)),
                 square = k_fma(gradient[0], gradient[0], k_fma(gradient[1], gradient[1], gradient[2] * gradient[2]));
    return v_lt(common * common, square * (vfloat)(REFINE_BENT));
}

/* Whether there is matter at a place, or where its density leads to within what lies between two looks, but before
 * `end`; for lanes of `m`. */
RAY_INLINE vint is_solid_near(const refine_field *field, vfloat at, vfloat end, float voxels_per_m, vint m)
{
    const vector3 *direction = field->direction;
    const float voxel = k_as_float((uint)(field->level + 127) << 23);
    vfloat gradient[3];
    const vfloat d = field_surface(field, at, gradient),
                 slope = k_fma(gradient[0], direction->x, k_fma(gradient[1], direction->y, gradient[2] * direction->z)),
                 step = -d * (vfloat)(REFINE_PAST * voxels_per_m) / slope;
    vint solid = is_positive(d);
    const vint leads = m & ~solid & v_le(k_fabs(step), (vfloat)(voxel / REFINE_LOOKS)) &
                       v_lt(at + step, end - (vfloat)(REFINE_CLOSE * voxel));
    if (v_any(leads)) {
        const vfloat there = lane_max(v_select(leads, at + step, at), (vfloat)(0.0f));
        solid |= leads & is_positive(field_density(field, there));
    }
    return solid;
}

/* The lanes of `m`, which hit at t, with the brick's normal. */
RAY_INLINE refined refine_lanes(const refine_field *field, vfloat t, const vector3 *normal, float voxels_per_m, vint m)
{
    const vfloat zero = (vfloat)(0.0f);
    const float voxel = k_as_float((uint)(field->level + 127) << 23);
    const vector3 *direction = field->direction;
    refined r;
    r.jumps = (vint)(0);
    vfloat d0 = field_surface(field, t, r.gradient);
    /* Into solid the density rises. */
    vfloat slope = k_fma(r.gradient[0], direction->x, k_fma(r.gradient[1], direction->y, r.gradient[2] * direction->z));
    vfloat voxels_per_unit = voxels_per_m / slope;
    vfloat step = -d0 * voxels_per_unit, t1 = t, d1 = d0;
    /* What is exact stays; only its normal may be wanted, if it looks back along the ray. */
    vint exact = m & v_eq(d0, zero);
#ifdef REFINE_THIN
    const vfloat reach = refine_reach(voxel, d0, slope, r.gradient, voxels_per_m);
#else
    const vfloat reach = (vfloat)(REFINE_REACH * voxel);
#endif
#if defined(REFINE_THIN) && defined(REFINE_STREAM)
    const vfloat square = k_fma(r.gradient[0], r.gradient[0],
                                k_fma(r.gradient[1], r.gradient[1], r.gradient[2] * r.gradient[2]));
    r.in_air = v_lt(d0 * voxels_per_m, (vfloat)(-REFINE_IS_RAISED * voxel) * k_sqrt(square));
#endif
    r.found = m & v_gt(slope, zero) & v_le(k_fabs(step), reach);
    r.t = v_select(r.found, lane_max(t + step, zero), t);
    vint unsure = r.found & v_gt(k_fabs(step), (vfloat)(REFINE_CLOSE * voxel));
    if (v_any(unsure)) {
        t1 = v_select(unsure, r.t, t);
        d1 = v_select(unsure, field_density(field, t1), d0);
        /* Most of the way to zero, as the density is nearly straight here, or as near as can be told. */
        vint nearer =
            v_le(k_fabs(d1), k_fabs(d0) * 0.25f) | v_le(k_fabs(d1 * voxels_per_unit), (vfloat)(REFINE_CLOSE * voxel));
        r.found &= ~unsure | nearer;
        /* The secant through both, no farther again. */
        vfloat next = -d1 * step / (d1 - d0);
        next = v_select(v_le(k_fabs(next), k_fabs(step)), next, zero);
        r.t = v_select(unsure, lane_max(t1 + next, zero), r.t);
    }
    vint rest = m & ~r.found & ~exact & v_lt(k_fabs(d0), (vfloat)(3.0e38f));
    if (v_any(rest)) {
        /* Matter that was just passed has its surface before it: the search begins in it, and goes back. */
        const vfloat back = d0 * voxels_per_unit * (vfloat)(REFINE_PAST);
        vint passed = rest & v_lt(slope, zero) & ~is_positive(d0) & v_le(back, (vfloat)(voxel)) & v_le(back, t);
        vfloat from = t, d_from = d0;
        if (v_any(passed)) {
            from = v_select(passed, t - back, t);
            d_from = field_density(field, from);
            passed &= is_positive(d_from);
            from = v_select(passed, from, t);
            d_from = v_select(passed, d_from, d0);
        }
        t1 = v_select(passed, from, t1);
        d1 = v_select(passed, d_from, d1);
        refined searched = refine_by_search(field, from, d_from, t1, d1, rest);
        r.t = v_select(searched.found, searched.t, r.t);
        for (int i = 0; i < 3; i++)
            r.gradient[i] = v_select(searched.found, searched.gradient[i], r.gradient[i]);
        r.found |= searched.found;
        r.jumps = searched.jumps;
    }
    /* Whoever would go ahead looks on the way, and back: the surface may be there, and this one another. */
    r.found &= v_le(r.t - t, reach);
    const vint bent = is_bent(r.gradient, normal);
    const vfloat unlooked = v_select(bent, (vfloat)(REFINE_AHEAD_BENT * voxel), (vfloat)(REFINE_AHEAD * voxel));
    vint ahead = r.found & v_gt(r.t - t, unlooked);
    for (int i = 1; i < 2 * REFINE_LOOKS && v_any(ahead); i++) {
        const float part = (float)i / REFINE_LOOKS;
        vfloat at = part < 1.0f ? k_fma(r.t - t, (vfloat)(part), t) : lane_max(t - (part - 0.75f) * voxel, zero);
        vint solid = ahead & is_solid_near(field, at, r.t, voxels_per_m, ahead);
        r.found &= ~solid;
        ahead &= ~solid;
    }
    return r;
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
        hit->normal[0] = OF_LANE(normal.x, l);           \
        hit->normal[1] = OF_LANE(normal.y, l);           \
        hit->normal[2] = OF_LANE(normal.z, l);           \
    }

#ifdef REFINE_STREAM
/* A normal that the brick's does not agree with is of another surface, beside an edge. */
#define LEAST_AGREEMENT 0.5f

/* Hits of rays in lanes, at `at` in the list: where they are and their normals. */
RAY_INLINE void refine_ray_lanes(const vector3 *origin, const vector3 *direction, const ray_start *start,
                                 vint at, vint valid, const karst_shade_anchor *anchor, K_GLOBAL const ulong *data,
                                 float voxels_per_m, K_GLOBAL karst_hit *hits LAYER_TAKEN)
{
    vint record = at * (int)(sizeof(karst_hit) / sizeof(int));
    vint word = HIT_WORD(1), kind = word & 0xff, level = word >> 8 & 0xff;
    const vint met =
        valid & (v_eq(kind, (vint)((int)KARST_HIT_SURFACE)) | v_eq(kind, (vint)((int)KARST_HIT_PROVISIONAL)));
    vint left = met;
#ifdef REFINE_THIN
    /* what lies before these is not shown: bricks have matter there */
    const vint leaves = valid & start->front & v_gt(start->from, (vfloat)(0.0f));
    level = v_select(leaves & ~met, level_of_width(start->width), level);
    left |= leaves;
#endif
    if (!v_any(left))
        return;
    const vfloat one = (vfloat)(1.0f), sign = v_select(start->back, -one, one);
    const vector3 before = {v_as_float(HIT_WORD(4)), v_as_float(HIT_WORD(5)), v_as_float(HIT_WORD(6))};
    vfloat t = v_select(left, v_as_float(HIT_WORD(0)), (vfloat)(0.0f));
    vint found = (vint)(0);
    vector3 normal = *direction;
    while (v_any(left)) {
        const int here = (int)v_min_across(v_select(left, v_to_float(level), (vfloat)(1000.0f)));
        vint mine = left & v_eq(level, (vint)(here));
        const refine_field field = {data, anchor, direction, here, (vint)(0), 0.0f, 0.0f, origin, sign, voxels_per_m
                                    LAYER_GIVEN};
        refined r = refine_lanes(&field, t, &before, voxels_per_m, mine & met);
        field_surface(&field, r.t, r.gradient);
        for (int i = 0; i < 3; i++)
            r.gradient[i] *= sign;
        vector3 down = {before.x, before.y, before.z};
        vint good = r.found & normal_of_gradient(r.gradient, &down);
        /* bricks say nothing of normals at faces of nodes that are air */
        good &= v_gt(k_fma(down.x, before.x, k_fma(down.y, before.y, down.z * before.z)), (vfloat)(LEAST_AGREEMENT)) |
                (v_eq(before.x, (vfloat)(0.0f)) & v_eq(before.y, (vfloat)(0.0f)) & v_eq(before.z, (vfloat)(0.0f)));
#ifdef REFINE_THIN
        const ray_hits hits_here = {t, mine & met, good, r.in_air};
        const vint onwards = search_onwards(&field, start, &hits_here, mine & leaves, &r.t, &down);
        good |= onwards;
        word = v_select(onwards & leaves, onwards_word(word, here), word);
        const vfloat cosine = k_fma(down.x, direction->x, k_fma(down.y, direction->y, down.z * direction->z));
        const vfloat least = (vfloat)(REFINE_IS_RAISED * k_as_float((uint)(here + 127) << 23));
        word |= good & v_gt(k_fabs((r.t - t) * cosine), least) & (int)KARST_HIT_THIN;
#endif
        t = v_select(good, r.t, t);
        normal.x = v_select(good, down.x, normal.x);
        normal.y = v_select(good, down.y, normal.y);
        normal.z = v_select(good, down.z, normal.z);
        found |= good;
        left &= ~mine;
    }
    EACH_LANE(STORE_REFINED_)
}

/* Of the rays of a stream. */
__kernel K_WIDE void refine_rays(K_GLOBAL const karst_ray *rays, K_GLOBAL const uint *count, karst_shade_anchor anchor,
                                 K_GLOBAL const ulong *data, float voxels_per_m,
                                 K_GLOBAL karst_hit *hits LAYER_TAKEN)
{
    const uint lowest = (uint)get_global_id(0) * LANES, num_rays = *count;
    if (lowest >= num_rays)
        return;
    const vint valid = v_lt(V_LANE + (int)lowest, (vint)((int)num_rays));
    const vint lane = v_select(valid, V_LANE + (vint)(0), (vint)(0));
    K_GLOBAL const float *words = (K_GLOBAL const float *)(rays + lowest);
    const vint first = lane * (int)(sizeof(karst_ray) / sizeof(float));
    const vector3 origin = {v_gather_float(words, first), v_gather_float(words, first + 1),
                            v_gather_float(words, first + 2)};
    const vector3 direction = {v_gather_float(words, first + 4), v_gather_float(words, first + 5),
                               v_gather_float(words, first + 6)};
    const vint side = v_gather_int((K_GLOBAL const int *)words, first + 11);
    const ray_start start = {v_eq(side, (vint)((int)KARST_SIDE_BACK)), v_eq(side, (vint)((int)KARST_SIDE_FRONT)),
                             v_gather_float(words, first + 3), v_gather_float(words, first + 7),
                             v_gather_float(words, first + 8)};
    refine_ray_lanes(&origin, &direction, &start, lane, valid, &anchor, data,
                     voxels_per_m, hits + lowest LAYER_GIVEN);
}

/* Of a camera's, in packet order. */
__kernel K_WIDE void refine_camera(karst_pinhole pinhole, int is_inside, karst_shade_anchor anchor,
                                   K_GLOBAL const ulong *data, float voxels_per_m,
                                   K_GLOBAL karst_hit *hits LAYER_TAKEN)
{
    vint x, y;
    vint valid = packet_pixels((uint)get_global_id(0), pinhole.width_px, pinhole.height_px, &x, &y);
    if (!v_any(valid))
        return;
    const vector3 direction = pinhole_direction(&pinhole, x, y);
    const vector3 origin = {(vfloat)(0.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
    const vint at = v_select(valid, packet_order(x, y, pinhole.width_px, pinhole.height_px), (vint)(0));
    const vfloat none = (vfloat)(0.0f);
    const ray_start start = {(vint)(is_inside ? -1 : 0), (vint)(0), none, none, none};
    refine_ray_lanes(&origin, &direction, &start, at, valid, &anchor, data, voxels_per_m,
                     hits LAYER_GIVEN);
}
#else
__kernel K_WIDE void refine_hits(karst_pinhole pinhole, karst_shade_anchor anchor, K_GLOBAL const ulong *data,
                                 float voxels_per_m, float footprint, float blend,
                                 K_GLOBAL karst_hit *hits LAYER_TAKEN)
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
    vector3 normal = {v_as_float(HIT_WORD(4)), v_as_float(HIT_WORD(5)), v_as_float(HIT_WORD(6))};
    while (v_any(left)) {
        const int here = (int)v_min_across(v_select(left, v_to_float(level), (vfloat)(1000.0f)));
        vint mine = left & v_eq(level, (vint)(here));
        refine_field field = {data, &anchor, &direction, here, (vint)(0), 0.0f, 0.0f};
#ifdef REFINE_LAYER
        field.layer = layer;
        field.beneath = beneath;
#endif
        if (blend > 0.0f) { /* as level_weight in raycast/cast/blend.clh */
            field.lanes = mine & v_eq(kind, (vint)((int)KARST_HIT_SURFACE));
            field.weight_slope = footprint * k_as_float((uint)(126 - here) << 23) / blend;
            field.weight_start = (blend - 1.0f) / blend;
        }
        refined r = refine_lanes(&field, t, &normal, voxels_per_m, mine);
        vector3 down;
        const vint jumps = r.found & r.jumps; /* whose normals stay the bricks' */
        vint good = r.found & ~jumps & normal_of_gradient(r.gradient, &down);
        t = v_select(good | jumps, r.t, t);
        normal.x = v_select(good, down.x, normal.x);
        normal.y = v_select(good, down.y, normal.y);
        normal.z = v_select(good, down.z, normal.z);
        word &= ~(good & (int)KARST_HIT_UNBLENDED); /* the true density has both levels */
        found |= good | jumps;
        left &= ~mine;
    }
    EACH_LANE(STORE_REFINED_)
}
#endif
