/* Entry points of rays through clear matter: see raycast/light/clear.h. Blocks are those of raycast/light/blocks.clh,
 * and as many neighbours of a stream. */
#include "raycast/cast/packing.clh"
#include "raycast/light/clear_shared.h"
#include "raycast/light/light.clh"
#include "raycast/light/radiance_shared.h"
#include "raycast/shadow_shared.h"
#include "raycast/light/blocks.clh"
#include "raycast/light/choice.clh"
#include "raycast/light/clear_beam.clh"
#include "raycast/light/clear_rays.clh"
#include "raycast/light/clear_turn.clh"
#include "raycast/light/contact.clh"
#include "raycast/light/dielectric.clh"
#include "raycast/light/raised.clh"
#include "raycast/light/through.clh"
#include "world.clh"
#if defined(SHADE_WORLD_COLOUR) && (defined(WORLD_OUTPUT_IOR) || defined(WORLD_OUTPUT_ABSORPTION))
#define HAS_MATTER
#include "raycast/cast/exact.clh"
#endif

#define USUAL_IOR 1.33f

/* With CLEAR_BENDS rays inside clear matter are not straight (raycast/light/bend.h): each has its own number of
 * surfaces met, jumps of the index among them, and the eye's own rays begin as a stream where that is inside. */
#ifdef CLEAR_BENDS
#define MET_PARAMETERS , K_GLOBAL const uint *met, uint most_met
#define IS_CUT(e) v_mask(v_ge((e)->met, (vint)((int)most_met)))
#define MET_OUTPUT , K_GLOBAL uint *next_met
#define MET , met, most_met
#define EYE_IS_IN(task) ((task)->is_inside)
#else
#define MET_PARAMETERS
#define IS_CUT(e) (task.is_last ? (vint)(-1) : (vint)(0))
#define MET_OUTPUT
#define MET
#define EYE_IS_IN(task) 0
#endif

/* With CLEAR_PASSES land lets light pass: shares of it, by ray. */
#ifdef CLEAR_PASSES
#define PASS_PARAMETERS , K_GLOBAL const float *passing
#define PASSING , passing
#define OF_BRANCH_2(task) ((task)->branch == 2u)
#define SHARE_PLANE(task) (OF_BRANCH_2(task) ? KARST_RADIANCE_PASS_PLANE : KARST_RADIANCE_MIRROR_PLANE)
#define GOES_THROUGH(e) ((e)->passes)
#else
#define PASS_PARAMETERS
#define PASSING
#define OF_BRANCH_2(task) 0
#define SHARE_PLANE(task) KARST_RADIANCE_MIRROR_PLANE
#define GOES_THROUGH(e) ((vint)(0))
#endif

/* ---- surfaces of clear matter ---- */

RAY_INLINE vfloat at_least_none(vfloat v) { return v_select(v_gt(v, (vfloat)(0.0f)), v, (vfloat)(0.0f)); }

#ifdef HAS_MATTER
/* Its index and absorption at the hits, t away along a direction from the anchor; blended as the hits are. */
RAY_INLINE void find_matter(K_GLOBAL const ulong *data, __local const near_octave *octaves,
                            const karst_shade_anchor *anchor, const surface_hits *s, const vector3 *way, vfloat far,
                            vint hit, vfloat matter[KARST_CLEAR_MATTER_PLANES])
{
    world_point_at place;
    world_near_at near;
    const vfloat t = v_select(hit, far, (vfloat)(0.0f));
    exact_steps(&near, anchor, way, t, v_max_across(t));
    if (WORLD_COLOUR_TAKES_PLACES || near.is_far)
        exact_places(&place, anchor, way, t);
    vint own = hit, next = hit & v_gt(s->weight, (vfloat)(0.0f));
    matter[0] = matter[1] = matter[2] = matter[3] = (vfloat)(0.0f);
    while (v_any(own | next)) {
        vfloat left = v_select(own, v_to_float(s->level), v_select(next, v_to_float(s->level + 1), (vfloat)(1000.0f)));
        int level = (int)v_min_across(left);
        vint from_own = own & v_eq(s->level, (vint)(level)), from_next = next & v_eq(s->level, (vint)(level - 1));
        const vfloat none = (vfloat)(0.0f), facing[] = {s->normal.x, s->normal.y, s->normal.z, none, none, none};
        vfloat values[WORLD_NUM_OUTPUTS];
        world_outputs(data, &near, octaves, &place, level, facing, values);
        vfloat share = v_select(from_own, 1.0f - s->weight, v_select(from_next, s->weight, (vfloat)(0.0f)));
#ifdef WORLD_OUTPUT_IOR
        matter[0] = k_fma(share, dielectric_ior(values[WORLD_OUTPUT_IOR]), matter[0]);
#else
        matter[0] = (vfloat)(USUAL_IOR);
#endif
#ifdef WORLD_OUTPUT_ABSORPTION
        K_UNROLL
        for (int c = 0; c < 3; c++)
            matter[1 + c] = k_fma(share, at_least_none(values[WORLD_OUTPUT_ABSORPTION + c]), matter[1 + c]);
#endif
        own &= ~from_own;
        next &= ~from_next;
    }
}
#define MATTER_PREPARE(item, num) world_colour_prepare(data, anchor.voxel, anchor.fraction, octaves, item, num)
#else
typedef int near_octave;
#define WORLD_NEAR_OCTAVES 0
RAY_INLINE void find_matter(K_GLOBAL const ulong *data, __local const near_octave *octaves,
                            const karst_shade_anchor *anchor, const surface_hits *s, const vector3 *way, vfloat far,
                            vint hit, vfloat matter[KARST_CLEAR_MATTER_PLANES])
{
    (void)data, (void)octaves, (void)anchor, (void)s, (void)way, (void)far, (void)hit;
    matter[0] = (vfloat)(USUAL_IOR);
    matter[1] = matter[2] = matter[3] = (vfloat)(0.0f);
}
#define MATTER_PREPARE(item, num)
#endif

RAY_INLINE void store_matter(K_GLOBAL float *planes, size_t room, vint index, vint valid,
                             const vfloat matter[KARST_CLEAR_MATTER_PLANES])
{
    for (int i = 0; i < KARST_CLEAR_MATTER_PLANES; i++)
        store_ordered(planes + (size_t)i * room, index, valid, matter[i]);
}

RAY_INLINE vint is_hit(const surface_hits *s) { return v_mask(v_ne(s->kind, (vint)((int)KARST_HIT_MISS))); }

/* Those that end in clear matter; where both are met at once it is land. */
RAY_INLINE vint ends_in_clear(const karst_clear_task *task, const vector3 *direction, const surface_hits *land,
                              const surface_hits *over)
{
    const vector3 *n = &land->normal;
    const vfloat cosine = k_fma(direction->x, n->x, k_fma(direction->y, n->y, direction->z * n->z)),
                 touches = land->t - contact_width(land->word, cosine);
    return task->has_clear ? is_hit(over) & (~is_hit(land) | v_mask(v_lt(over->t, touches))) : (vint)(0);
}

RAY_INLINE void blend_levels(surface_hits *s, float blend, vfloat footprint)
{
    if (blend > 0.0f)
        s->weight = v_select(v_eq(s->word & (int)(0xffu | KARST_HIT_UNBLENDED), (vint)((int)KARST_HIT_SURFACE)),
                             level_weight(blend, footprint, s->level), s->weight);
}

/* PACKETS packets for each work-item with 16 lanes; a group shares what it makes ready with one. */
#if LANES == 16
#define PACKETS 64u
#else
#define PACKETS 1u
#endif

/* Of the surfaces that the camera's rays end in, in packet order. */
__kernel K_WIDE void clear_matter_of_picture(karst_pinhole pinhole, float detail, float blend,
                                             K_GLOBAL const karst_hit *hits, K_GLOBAL float *matter,
                                             karst_shade_anchor anchor, K_GLOBAL const ulong *data, uint num_packets)
{
    __local near_octave known[WORLD_NEAR_OCTAVES + 1];
    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0); /* as in shade_pixels */
    MATTER_PREPARE((uint)get_local_id(0), (uint)get_local_size(0));
#if LANES != 16
    barrier(CLK_LOCAL_MEM_FENCE);
#endif
    const size_t plane = (size_t)pinhole.width_px * (size_t)pinhole.height_px;
    const uint first = (uint)get_global_id(0) * PACKETS;
    for (uint packet = first; packet < first + PACKETS && packet < num_packets; packet++) {
        vint x, y;
        const vint valid = packet_pixels(packet, pinhole.width_px, pinhole.height_px, &x, &y);
        if (!v_any(valid))
            continue;
        const vector3 direction = pinhole_direction(&pinhole, x, y);
        const vint place = packet_order(x, y, pinhole.width_px, pinhole.height_px);
        const surface_hits s = load_surface(hits, place, valid, &direction, pinhole.cone * detail, blend);
        const vint hit = is_hit(&s) & valid;
        if (!v_any(hit))
            continue;
        vfloat found[KARST_CLEAR_MATTER_PLANES];
        find_matter(data, octaves, &anchor, &s, &direction, s.t, hit, found);
        store_matter(matter, plane, place, valid, found);
    }
}

/* Of a stream's surfaces. */
__kernel K_WIDE void clear_matter_of_stream(K_GLOBAL const karst_ray *rays, K_GLOBAL const uint *count,
                                            K_GLOBAL const karst_clear_way *ways, float detail, float blend,
                                            K_GLOBAL const karst_hit *hits, K_GLOBAL float *matter, uint room,
                                            karst_shade_anchor anchor, K_GLOBAL const ulong *data)
{
    __local near_octave known[WORLD_NEAR_OCTAVES + 1];
    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0);
    const uint num_rays = *count, begin = (uint)get_global_id(0) * PACKETS * LANES;
#if LANES == 16
    if (begin >= num_rays)
        return;
    MATTER_PREPARE(0, 1);
#else
    MATTER_PREPARE((uint)get_local_id(0), (uint)get_local_size(0));
    barrier(CLK_LOCAL_MEM_FENCE);
#endif
    for (uint lowest = begin; lowest < begin + PACKETS * LANES && lowest < num_rays; lowest += LANES) {
        const clear_rays r = load_rays(rays, ways, lowest, num_rays);
        surface_hits s = load_surface(hits, r.index, r.valid, &r.direction, 0.0f, 0.0f);
        const vint hit = is_hit(&s) & r.valid;
        if (!v_any(hit))
            continue;
        blend_levels(&s, blend, k_fma(s.t, r.cone, r.width) * detail);
        const vector3 to = {k_fma(r.direction.x, s.t, r.origin.x), k_fma(r.direction.y, s.t, r.origin.y),
                            k_fma(r.direction.z, s.t, r.origin.z)};
        const vfloat far =
            lane_max(k_sqrt(k_fma(to.x, to.x, k_fma(to.y, to.y, to.z * to.z))), (vfloat)(1.0e-6f));
        const vfloat per = 1.0f / far;
        const vector3 way = {to.x * per, to.y * per, to.z * per};
        vfloat found[KARST_CLEAR_MATTER_PLANES];
        find_matter(data, octaves, &anchor, &s, &way, far, hit, found);
        store_matter(matter, room, r.index, r.valid, found);
    }
}

/* ---- the camera's own rays ---- */

RAY_INLINE colour own_absorption(const karst_clear_task *task)
{
    const colour a = {(vfloat)(task->absorption[0]), (vfloat)(task->absorption[1]), (vfloat)(task->absorption[2])};
    return a;
}

/* Where the eye is in clear matter: its rays, in packet order, which look for the matter's end. */
__kernel K_WIDE void clear_camera(karst_pinhole pinhole, K_GLOBAL karst_ray *rays, uint num_packets)
{
    const uint packet = (uint)get_global_id(0);
    vint x, y;
    if (packet >= num_packets * (KARST_PACKET_RAYS / LANES))
        return;
    const vint valid = packet_pixels(packet, pinhole.width_px, pinhole.height_px, &x, &y);
    const vector3 direction = pinhole_direction(&pinhole, x, y);
    const vint order = packet_order(x, y, pinhole.width_px, pinhole.height_px);
    float words[3][LANES];
    int at[LANES];
    const uint lanes = mask_bits(valid);
    v_store_float(direction.x, words[0]), v_store_float(direction.y, words[1]), v_store_float(direction.z, words[2]);
    v_store_int(order, at);
    for (int l = 0; l < LANES; l++)
        if (lanes >> l & 1u) {
            const karst_ray ray = {{0.0f, 0.0f, 0.0f},
                                   0.0f,
                                   {words[0][l], words[1][l], words[2][l]},
                                   pinhole.t_max,
                                   0.0f,
                                   pinhole.cone,
                                   0,
                                   KARST_SIDE_BACK,
                                   {1.0f, 1.0f, 1.0f},
                                   0};
            rays[at[l]] = ray;
        }
}

/* After shading: pixels that show clear matter first have nothing of the land behind it but the haze before it, no
 * shadow ray, and in the mirror plane what haze lets through. Where the eye is in clear matter others have what that
 * leaves of their light. */
__kernel K_WIDE void clear_cover(karst_clear_task task, karst_pinhole pinhole, karst_light light_of_picture,
                                 K_GLOBAL const karst_hit *hits, K_GLOBAL const karst_hit *over_hits,
                                 K_GLOBAL float *parts, K_GLOBAL float *shadow_rays,
                                 uint num_packets SHADE_SKY_PARAMETERS)
{
    const uint packet = (uint)get_global_id(0);
    const karst_light *light = &light_of_picture;
    vint x, y;
    if (packet >= num_packets * (KARST_PACKET_RAYS / LANES))
        return;
    const vint valid = packet_pixels(packet, pinhole.width_px, pinhole.height_px, &x, &y);
    if (!v_any(valid))
        return;
    const size_t plane = (size_t)pinhole.width_px * (size_t)pinhole.height_px;
    const vector3 direction = pinhole_direction(&pinhole, x, y);
    const vint order = packet_order(x, y, pinhole.width_px, pinhole.height_px);
    const surface_hits land = load_surface(hits, order, valid, &direction, 0.0f, 0.0f),
                       over = load_surface(over_hits, order, valid, &direction, 0.0f, 0.0f);
    const vint covered = EYE_IS_IN(&task) ? valid : ends_in_clear(&task, &direction, &land, &over) & valid;
    if (!task.is_inside && !v_any(covered))
        return;
    colour c = {(vfloat)(0.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
    vfloat share = (vfloat)(1.0f);
    colour left = {(vfloat)(1.0f), (vfloat)(1.0f), (vfloat)(1.0f)};
    if (task.is_inside) {
        const colour a = own_absorption(&task);
        const vfloat t = v_select(is_hit(&land), land.t, (vfloat)(task.t_max));
        left.r = left_after(a.r, t), left.g = left_after(a.g, t), left.b = left_after(a.b, t);
    } else {
        const vfloat to_sun = dot3(&direction, light->sun_direction);
#ifdef SHADE_ATMOSPHERE
        const air_way passage = air_way_of(&sky, sky_table, &direction, to_sun, over.t);
#endif
        c = HAZY(c, &direction, to_sun, over.t);
        share = CLEAR(&direction, over.t);
    }
    const vfloat zero = (vfloat)(0.0f);
    const vfloat base[3] = {c.r, c.g, c.b}, kept[3] = {left.r, left.g, left.b};
    for (int i = 0; i < 3; i++) {
        K_GLOBAL float *of_base = parts + (size_t)i * plane, *of_sun = parts + (size_t)(3 + i) * plane;
        store_ordered(of_base, order, valid,
                      v_select(covered, base[i], load_ordered(of_base, order, valid) * kept[i]));
        if (shadow_rays)
            store_ordered(of_sun, order, valid,
                          v_select(covered, zero, load_ordered(of_sun, order, valid) * kept[i]));
    }
    K_GLOBAL float *mirror = parts + KARST_RADIANCE_MIRROR_PLANE * plane;
    store_ordered(mirror, order, valid, v_select(covered, share, load_ordered(mirror, order, valid)));
    if (shadow_rays) {
        K_GLOBAL float *width = shadow_rays + KARST_SHADOW_WIDTH * plane;
        store_ordered(width, order, valid, v_select(covered, zero, load_ordered(width, order, valid)));
    }
}

/* ---- from the picture to the first stream ---- */

typedef struct {
    vint m, x, y, order;
    vector3 direction;
    surface_hits land, over;
    vint clear; /* of m, those that ended in clear matter */
    vfloat share;
} first_pixels;

RAY_INLINE first_pixels load_first(const karst_clear_task *task, const karst_pinhole *pinhole,
                                   K_GLOBAL const float *parts, K_GLOBAL const karst_hit *hits,
                                   K_GLOBAL const karst_hit *over_hits, K_GLOBAL const uint *lacking, uint block,
                                   uint item)
{
    first_pixels p;
    const size_t plane = (size_t)pinhole->width_px * (size_t)pinhole->height_px;
    const vint valid = block_pixels(block, item, pinhole->width_px, pinhole->height_px, &p.x, &p.y);
    p.m = p.clear = valid;
    if (!v_any(valid))
        return p;
    p.order = packet_order(p.x, p.y, pinhole->width_px, pinhole->height_px);
    p.share = load_ordered(parts + SHARE_PLANE(task) * plane, p.order, valid);
    p.m = valid & v_gt(p.share, (vfloat)(0.0f));
    /* whole packets: how wide beams are is told by those beside them (raycast/light/clear_beam.clh) */
    if (task->only_lacking)
        p.m &= v_any(valid & v_ne(v_as_int(load_ordered((K_GLOBAL const float *)lacking, p.order, valid)), (vint)(0)))
                   ? (vint)(-1)
                   : (vint)(0);
    if (!v_any(p.m))
        return p;
    p.direction = pinhole_direction(pinhole, p.x, p.y);
    p.land = load_surface(hits, p.order, valid, &p.direction, 0.0f, 0.0f);
    p.over = load_surface(over_hits, p.order, valid, &p.direction, 0.0f, 0.0f);
    p.clear = EYE_IS_IN(task) ? p.m : p.m & ends_in_clear(task, &p.direction, &p.land, &p.over);
    if (task->branch)
        p.m = EYE_IS_IN(task) ? (vint)(0) : OF_BRANCH_2(task) ? p.m & ~p.clear : p.clear;
    return p;
}

__kernel K_WIDE void clear_count_first(karst_clear_task task, karst_pinhole pinhole, K_GLOBAL const float *parts,
                                       K_GLOBAL const karst_hit *hits, K_GLOBAL const karst_hit *over_hits,
                                       K_GLOBAL uint *counts, uint num_blocks, K_GLOBAL const uint *lacking)
{
    const uint block = (uint)get_global_id(0);
    if (block >= num_blocks)
        return;
    uint num = 0;
    for (uint i = 0; i < BLOCK_ITEMS; i++) {
        const first_pixels p = load_first(&task, &pinhole, parts, hits, over_hits, lacking, block, i);
        num += (uint)count_lanes(p.m);
    }
    counts[block] = num;
}

/* From counts to where each block's rays begin, and how many there are in all. */
SCAN_KERNEL void clear_scan(K_GLOBAL uint *counts, uint num_blocks, K_GLOBAL uint *total, K_GLOBAL uint *counters)
{
    __local uint sums[SCAN_ITEMS];
    const uint sum = scan_counts(counts, num_blocks, sums);
    if (get_local_id(0) != 0)
        return;
    *total = sum;
    counters[KARST_CLEAR_COUNT_RAYS] += sum;
}

/* To the sphere around the eye in which its view lies, as in bounce.cl. */
RAY_INLINE vfloat to_sphere(const vector3 *o, const vector3 *d, float t_max)
{
    const vfloat along = k_fma(o->x, d->x, k_fma(o->y, d->y, o->z * d->z));
    const vfloat far = k_sqrt(k_fma(o->x, o->x, k_fma(o->y, o->y, o->z * o->z)));
    const vfloat rest = lane_max((t_max - far) * (t_max + far), (vfloat)(0.0f));
    return k_sqrt(k_fma(along, along, rest)) - along;
}

RAY_INLINE vector3 turned_to(vint back, const vector3 *n)
{
    const vector3 t = {v_select(back, -n->x, n->x), v_select(back, -n->y, n->y), v_select(back, -n->z, n->z)};
    return t;
}

RAY_INLINE vector3 select_vector(vint m, const vector3 *a, const vector3 *b)
{
    const vector3 v = {v_select(m, a->x, b->x), v_select(m, a->y, b->y), v_select(m, a->z, b->z)};
    return v;
}

#define SIDES(m, a, b) v_select(m, (vint)((int)(a)), (vint)((int)(b)))

#ifdef CLEAR_PASSES
/* Rays that go on straight behind land, in it at first, as they came: into clear matter, if they are not in it, as soon
 * as there is some. */
RAY_INLINE void store_passing(const karst_clear_task *task, const karst_pinhole *pinhole, const first_pixels *p,
                              K_GLOBAL karst_ray *rays, K_GLOBAL karst_clear_way *ways)
{
    const vfloat t = p->land.t, scale = task->adds_nothing ? (vfloat)(0.0f) : p->share;
    const colour own = own_absorption(task);
    clear_rays r;
    r.direction = p->direction;
    r.origin.x = p->direction.x * t, r.origin.y = p->direction.y * t, r.origin.z = p->direction.z * t;
    r.t_max = to_sphere(&r.origin, &r.direction, task->t_max);
    r.width = lane_max(t * pinhole->cone, v_as_float((p->land.level + 127) << 23) * (vfloat)(1.0001f / task->detail));
    r.cone = (vfloat)(pinhole->cone);
    r.pixel = p->y << 16 | p->x;
    r.throughput.r = r.throughput.g = r.throughput.b = scale;
    r.absorption = own;
    r.clear_from = (vfloat)(0.0f);
    if (task->is_inside) {
        r.throughput.r *= left_after(own.r, t), r.throughput.g *= left_after(own.g, t);
        r.throughput.b *= left_after(own.b, t);
    }
    store_rays(rays, ways, &r, p->m, (vint)((int)KARST_SIDE_BACK),
               (vint)((int)(task->is_inside ? KARST_SIDE_BACK : KARST_SIDE_ANY)));
}
#endif

/* Makes the rays of a branch: one work-item for each block. */
__kernel K_WIDE void clear_first(karst_clear_task task, karst_pinhole pinhole, K_GLOBAL const karst_hit *hits,
                                 K_GLOBAL const karst_hit *over_hits, K_GLOBAL const float *matter,
                                 K_GLOBAL const float *parts, K_GLOBAL const uint *begins, uint num_blocks,
                                 K_GLOBAL karst_ray *rays, K_GLOBAL karst_clear_way *ways,
                                 K_GLOBAL const uint *lacking MET_OUTPUT)
{
    const uint block = (uint)get_global_id(0);
    const size_t plane = (size_t)pinhole.width_px * (size_t)pinhole.height_px;
    const vfloat one = (vfloat)(1.0f), zero = (vfloat)(0.0f);
    const vint inside = v_mask((vint)(task.is_inside ? -1 : 0));
    if (block >= num_blocks)
        return;
    uint begin = begins[block];
    for (uint i = 0; i < BLOCK_ITEMS; i++) {
        const first_pixels p = load_first(&task, &pinhole, parts, hits, over_hits, lacking, block, i);
        if (!v_any(p.m))
            continue;
#ifdef CLEAR_PASSES
        if (OF_BRANCH_2(&task)) {
#ifdef CLEAR_BENDS
            for (uint l = 0; l < (uint)count_lanes(p.m); l++)
                next_met[begin + l] = 1;
#endif
            store_passing(&task, &pinhole, &p, rays + begin, ways + begin);
            begin += (uint)count_lanes(p.m);
            continue;
        }
#endif
        const vint clear = p.clear;
        const vfloat t = v_select(clear, p.over.t, p.land.t);
        const vector3 of_clear = turned_to(inside, &p.over.normal), n = select_vector(clear, &of_clear, &p.land.normal);
        const vfloat ior = v_select(clear, load_ordered(matter, p.order, p.m), one);
        const dielectric d = dielectric_of(&p.direction, &n, v_select(inside, ior, one / ior));
        const vfloat share = v_select(clear, task.branch ? one - d.reflected : d.reflected, one);
        const vint idle = task.branch ? v_le(share, zero) : (vint)(0);
        clear_rays r;
        r.direction = task.branch ? dielectric_refracted(&d, &p.direction, &n)
                                  : dielectric_reflected(&d, &p.direction, &n);
        r.origin.x = p.direction.x * t, r.origin.y = p.direction.y * t, r.origin.z = p.direction.z * t;
        r.t_max = v_select(idle, zero, to_sphere(&r.origin, &r.direction, task.t_max));
        const vint level = v_select(clear, p.over.level, p.land.level);
        r.width = lane_max(t * pinhole.cone, v_as_float((level + 127) << 23) * (vfloat)(1.0001f / task.detail));
        if (task.branch && HAS_BEAMS) {
            const beam_ray own = {{zero, zero, zero}, p.direction, r.origin, n};
            beam_of_picture(over_hits, &pinhole, p.x, p.y, &own, d.ratio, ~inside, &r);
        } else {
            vfloat bent = zero;
            if (v_any(clear))
                bent = mirrored_cone(over_hits, &pinhole, p.x, p.y, &p.over.normal);
            if (v_any(p.m & ~clear))
                bent = v_select(clear, bent, mirrored_cone(hits, &pinhole, p.x, p.y, &p.land.normal));
            r.cone = task.branch ? 0.5f * (bent + pinhole.cone) : bent;
        }
        r.pixel = p.y << 16 | p.x;
        const colour own = own_absorption(&task);
        const vfloat scale = task.adds_nothing ? zero : share * p.share;
        r.throughput.r = scale, r.throughput.g = scale, r.throughput.b = scale;
        if (task.is_inside) {
            r.throughput.r *= left_after(own.r, t), r.throughput.g *= left_after(own.g, t);
            r.throughput.b *= left_after(own.b, t);
        }
        const vint stays = task.branch ? ~inside : inside; /* is in clear matter afterwards */
        r.absorption.r = v_select(inside, own.r, load_ordered(matter + plane, p.order, p.m) * task.voxel_m);
        r.absorption.g = v_select(inside, own.g, load_ordered(matter + 2 * plane, p.order, p.m) * task.voxel_m);
        r.absorption.b = v_select(inside, own.b, load_ordered(matter + 3 * plane, p.order, p.m) * task.voxel_m);
        r.absorption.r = v_select(stays, r.absorption.r, zero), r.absorption.g = v_select(stays, r.absorption.g, zero);
        r.absorption.b = v_select(stays, r.absorption.b, zero);
        const vint outside = v_select(clear, (vint)((int)KARST_SIDE_FRONT), (vint)((int)KARST_SIDE_ANY));
        r.clear_from = v_select(clear & ~stays,
                                raised_until(p.over.word, &n, task.branch ? d.far_cosine : d.cosine), zero);
        if (EYE_IS_IN(&task)) {
            r.clear_from = zero;
            r.direction = p.direction;
            r.origin.x = r.origin.y = r.origin.z = r.width = zero;
            r.t_max = (vfloat)(pinhole.t_max), r.cone = (vfloat)(pinhole.cone);
            r.throughput.r = r.throughput.g = r.throughput.b = task.adds_nothing ? zero : p.share;
        }
#ifdef CLEAR_BENDS
        for (uint l = 0; l < (uint)count_lanes(p.m); l++)
            next_met[begin + l] = 1;
#endif
        store_rays(rays + begin, ways + begin, &r, p.m, SIDES(clear, KARST_SIDE_ANY, KARST_SIDE_FRONT),
                   v_select(stays, (vint)((int)KARST_SIDE_BACK), outside));
        begin += (uint)count_lanes(p.m);
    }
}

/* ---- from stream to stream ---- */

/* hits: those of the first cast, which rays need not go beyond; 0: on the way back. */
__kernel void clear_turn(K_GLOBAL karst_ray *rays, K_GLOBAL karst_clear_way *ways, K_GLOBAL const uint *count,
                         K_GLOBAL const karst_hit *hits)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    turn_to_other_matter(rays + i, ways + i);
    if (hits && hits[i].t < rays[i].t_max)
        rays[i].t_max = hits[i].t;
}

/* Where they ended: in clear matter, and of those the ones that go on. Of rays that are to be sure, what they lacked
 * looks like proven matter. */
typedef struct {
    surface_hits land, over;
    vint clear, on;
#ifdef CLEAR_PASSES
    vint passes; /* on land that lets light pass; of `on`, those that do so */
    vfloat share;
#endif
#ifdef CLEAR_BENDS
    vint met;
#endif
} stream_ends;

RAY_INLINE stream_ends ends_of(const karst_clear_task *task, const clear_rays *r, K_GLOBAL const karst_hit *hits,
                               K_GLOBAL const karst_hit *over_hits PASS_PARAMETERS MET_PARAMETERS)
{
    stream_ends e;
    e.land = load_surface(hits, r->index, r->valid, &r->direction, 0.0f, 0.0f);
    e.over = load_surface(over_hits, r->index, r->valid, &r->direction, 0.0f, 0.0f);
    e.clear = ends_in_clear(task, &r->direction, &e.land, &e.over) & r->valid;
#ifdef CLEAR_BENDS
    e.met = lane_min_int(v_gather_int((K_GLOBAL const int *)met, v_select(r->valid, r->index, (vint)(0))),
                         (vint)((int)most_met));
    e.on = e.clear & v_mask(v_lt(e.met, (vint)((int)most_met)));
#else
    e.on = task->is_last ? (vint)(0) : e.clear;
#endif
    if (task->is_sure)
        e.on &= v_mask(v_eq(e.over.kind, (vint)((int)KARST_HIT_SURFACE)));
#ifdef CLEAR_PASSES
    e.share = load_ordered(passing, r->index, r->valid);
    e.passes = is_hit(&e.land) & ~e.clear & r->valid & v_mask(v_gt(e.share, (vfloat)(0.0f)));
    vint through = e.passes;
    if (task->is_sure)
        through &= v_mask(v_eq(e.land.kind, (vint)((int)KARST_HIT_SURFACE)));
#ifdef CLEAR_BENDS
    e.on |= through & v_mask(v_lt(e.met, (vint)((int)most_met)));
#else
    e.on |= task->is_last ? (vint)(0) : through;
#endif
#endif
    return e;
}

/* Rays that met what is missing, or stands in for it; of those that are to be sure that is as if it were proven. */
RAY_INLINE vint lacks_something(const stream_ends *e)
{
    const vint land = v_mask(v_eq(e->land.kind, (vint)((int)KARST_HIT_PROVISIONAL))) |
                      v_mask(v_eq(e->land.kind, (vint)((int)KARST_HIT_SOLID))),
               over = v_mask(v_eq(e->over.kind, (vint)((int)KARST_HIT_PROVISIONAL))) |
                      v_mask(v_eq(e->over.kind, (vint)((int)KARST_HIT_SOLID)));
    return land | over | v_mask(v_ne((e->land.word | e->over.word) & (int)KARST_HIT_INCOMPLETE, (vint)(0)));
}

__kernel K_WIDE void clear_count_next(karst_clear_task task, K_GLOBAL const karst_ray *rays,
                                      K_GLOBAL const karst_clear_way *ways, K_GLOBAL const uint *count,
                                      K_GLOBAL const karst_hit *hits, K_GLOBAL const karst_hit *over_hits,
                                      K_GLOBAL uint *counts, uint num_blocks PASS_PARAMETERS MET_PARAMETERS)
{
    const uint block = (uint)get_global_id(0), num_rays = *count;
    if (block >= num_blocks)
        return;
    uint num = 0;
    for (uint lowest = block * BLOCK_RAYS; lowest < (block + 1) * BLOCK_RAYS && lowest < num_rays; lowest += LANES) {
        const clear_rays r = load_rays(rays, ways, lowest, num_rays);
        num += (uint)count_lanes(ends_of(&task, &r, hits, over_hits PASSING MET).on);
    }
    counts[block] = num;
}

/* Rays that end in clear matter go on, packed, and add nothing where they ended; of others, what the matter that they
 * are in leaves of their light. Those that are cut off see what lies straight behind: land, else the sky. */
__kernel K_WIDE void clear_next(karst_clear_task task, K_GLOBAL karst_ray *rays, K_GLOBAL const karst_clear_way *ways,
                                K_GLOBAL const uint *count, K_GLOBAL karst_hit *hits,
                                K_GLOBAL const karst_hit *over_hits, K_GLOBAL const float *matter,
                                K_GLOBAL const uint *begins, uint num_blocks, K_GLOBAL karst_ray *next,
                                K_GLOBAL karst_clear_way *next_ways, K_GLOBAL float *shadow_rays, uint room,
                                K_GLOBAL uint *counters, K_GLOBAL uint *lacking PASS_PARAMETERS MET_PARAMETERS
                                    MET_OUTPUT)
{
    const uint block = (uint)get_global_id(0), num_rays = *count;
    const vfloat one = (vfloat)(1.0f), zero = (vfloat)(0.0f);
    if (block >= num_blocks)
        return;
    for (uint i = 0; shadow_rays && i < BLOCK_RAYS; i++)
        shadow_rays[KARST_SHADOW_WIDTH * (size_t)room + block * BLOCK_RAYS + i] = 0.0f;
    uint begin = begins[block], num_cut = 0, num_provisional = 0;
    for (uint lowest = block * BLOCK_RAYS; lowest < (block + 1) * BLOCK_RAYS && lowest < num_rays; lowest += LANES) {
        const clear_rays r = load_rays(rays, ways, lowest, num_rays);
        const stream_ends e = ends_of(&task, &r, hits, over_hits PASSING MET);
        const vint through = e.on & GOES_THROUGH(&e), turned = e.on & ~through;
        const vfloat t = v_select(e.clear, e.over.t, e.land.t);
        clear_rays to = r;
        to.throughput.r *= v_select(r.is_inside, left_after(r.absorption.r, t), one);
        to.throughput.g *= v_select(r.is_inside, left_after(r.absorption.g, t), one);
        to.throughput.b *= v_select(r.is_inside, left_after(r.absorption.b, t), one);
        /* What is left at this end: of those that go on, nothing. */
        float left[3][LANES];
        int kinds[LANES];
        const vint cut = e.clear & IS_CUT(&e);
        vint gone = e.clear & ~cut;
        if (task.is_sure)
            gone |= v_mask(v_eq(e.land.kind, (vint)((int)KARST_HIT_SOLID)));
        v_store_float(v_select(turned, zero, to.throughput.r), left[0]);
        v_store_float(v_select(turned, zero, to.throughput.g), left[1]);
        v_store_float(v_select(turned, zero, to.throughput.b), left[2]);
        v_store_int(v_select(gone, e.land.word & ~0xff, e.land.word), kinds);
        int places[LANES];
        const uint lacks = mask_bits(lacks_something(&e) & r.valid);
        v_store_int(packet_order(r.pixel & 0xffff, r.pixel >> 16, task.width_px, task.height_px), places);
        for (uint l = 0; l < LANES && lowest + l < num_rays; l++) {
            if (lacks >> l & 1u)
                lacking[places[l]] = 1u;
            for (int c = 0; c < 3; c++)
                rays[lowest + l].throughput[c] = left[c][l];
            hits[lowest + l].kind = (uint)kinds[l];
        }
        num_provisional +=
            (uint)count_lanes(e.clear & v_mask(v_eq(e.over.kind, (vint)((int)KARST_HIT_PROVISIONAL))));
        num_cut += (uint)count_lanes(cut | (GOES_THROUGH(&e) & IS_CUT(&e)));
        if (!v_any(e.on))
            continue;
        const vector3 n = turned_to(r.is_inside, &e.over.normal);
        const vfloat ior = load_ordered(matter, r.index, r.valid);
        const dielectric d = dielectric_of(&r.direction, &n, v_select(r.is_inside, ior, one / ior));
#ifdef CLEAR_BENDS
        const vfloat u = choice_of_lanes(task.sample, task.x0_px, task.y0_px, r.pixel, task.branch, e.met, e.on);
#else
        const vfloat u = choice_of(task.sample, task.x0_px, task.y0_px, r.pixel, task.branch, task.bounce);
#endif
        const vint back = v_lt(u, d.reflected);
        const vector3 reflected = dielectric_reflected(&d, &r.direction, &n),
                      refracted = dielectric_refracted(&d, &r.direction, &n);
        to.direction = select_vector(back, &reflected, &refracted);
#ifdef CLEAR_PASSES
        to.direction = select_vector(through, &r.direction, &to.direction);
        const vfloat share = v_select(through, e.share, one);
        to.throughput.r *= share, to.throughput.g *= share, to.throughput.b *= share;
#endif
        to.origin.x = k_fma(r.direction.x, t, r.origin.x), to.origin.y = k_fma(r.direction.y, t, r.origin.y);
        to.origin.z = k_fma(r.direction.z, t, r.origin.z);
        to.t_max = to_sphere(&to.origin, &to.direction, task.t_max);
        to.width = k_fma(t, r.cone, r.width);
        const beam_turn turn = {d.ratio, back};
        if (HAS_BEAMS)
            beam_of_stream(rays, over_hits, num_rays, &r, &n, &turn, task.cone, turned, &to);
        to.width = lane_max(to.width,
                            v_as_float((v_select(through, e.land.level, e.over.level) + 127) << 23) *
                                (vfloat)(1.0001f / task.detail));
        const vint stays = v_select(back | through, r.is_inside, ~r.is_inside);
        to.clear_from = v_select(stays | through, zero,
                                 raised_until(e.over.word, &n, v_select(back, d.cosine, d.far_cosine)));
        const vfloat voxel_m = (vfloat)(task.voxel_m);
        const colour there = {load_ordered(matter + room, r.index, r.valid) * voxel_m,
                              load_ordered(matter + 2 * (size_t)room, r.index, r.valid) * voxel_m,
                              load_ordered(matter + 3 * (size_t)room, r.index, r.valid) * voxel_m};
        to.absorption.r = v_select(stays, v_select(r.is_inside, r.absorption.r, there.r), zero);
        to.absorption.g = v_select(stays, v_select(r.is_inside, r.absorption.g, there.g), zero);
        to.absorption.b = v_select(stays, v_select(r.is_inside, r.absorption.b, there.b), zero);
        store_rays(next + begin, next_ways + begin, &to, e.on, SIDES(through, KARST_SIDE_BACK, KARST_SIDE_ANY),
                   v_select(stays, (vint)((int)KARST_SIDE_BACK), SIDES(through, KARST_SIDE_ANY, KARST_SIDE_FRONT)));
#ifdef CLEAR_BENDS
        int mets[LANES];
        pack_int(mets, e.met + 1, mask_bits(e.on));
        for (uint l = 0; l < (uint)count_lanes(e.on); l++)
            next_met[begin + l] = (uint)mets[l];
#endif
        begin += (uint)count_lanes(e.on);
    }
    if (num_cut)
        atomic_add(&counters[KARST_CLEAR_COUNT_CUT], num_cut);
    if (num_provisional)
        atomic_add(&counters[KARST_CLEAR_COUNT_PROVISIONAL], num_provisional);
}
