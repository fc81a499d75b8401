/* Entry points of rays inside clear matter whose index varies: see raycast/light/bend.h. */
#include "raycast/cast/packing.clh"
#include "raycast/light/bend_shared.h"
#include "raycast/light/clear_shared.h"
#include "raycast/light/contact.clh"
#include "raycast/rays_shared.h"
/* Clear matter's density and gradient, world_surface; those of the index, other_surface; and world_ranges, bounds of
 * the index, of its gradient and of clear matter, in this order. */
#include "world.clh"

#include "raycast/cast/exact.clh"

/* The world's own text, around a chord's start. */
typedef struct {
    K_GLOBAL const ulong *data, *index_data, *bound_data;
    const world_point_at *start;
    int level;
    float voxel_m;
} bend_field;

#include "raycast/light/bend.clh"

K_CALLED vfloat matter_at(K_GLOBAL const ulong *data, const world_point_at *place, int level)
{
    return world_point(data, place, level);
}

K_CALLED vfloat slope_of_matter(K_GLOBAL const ulong *data, const world_point_at *place, int level, vfloat gradient[3])
{
    return world_surface(data, place, level, gradient);
}

K_CALLED vfloat index_at(K_GLOBAL const ulong *data, const world_point_at *place, int level)
{
    return other_point(data, place, level);
}

K_CALLED vfloat slope_of_index(K_GLOBAL const ulong *data, const world_point_at *place, int level, vfloat gradient[3])
{
    return other_surface(data, place, level, gradient);
}

RAY_INLINE void move_place(world_point_at *place, int axis, vfloat offset)
{
    const vfloat whole = k_floor(offset);
    const vfloat part = lane_min(offset - whole, (vfloat)(0x1.fffffep-1f));
    const vlong fraction =
        v_float_to_long(part * (vfloat)(0x1p32f)) + v_ulong_to_long(v_uint_to_ulong(place->fraction[axis]));
    place->voxel[axis] += v_float_to_long(whole) + (fraction >> 32);
    place->fraction[axis] = v_ulong_to_uint(v_long_to_ulong(fraction));
}

RAY_INLINE void bend_place(world_point_at *place, const bend_field *field, const vector3 *at)
{
    *place = *field->start;
    move_place(place, 0, at->x);
    move_place(place, 1, at->y);
    move_place(place, 2, at->z);
}

/* What an index may be; a little below 1 it is taken as 1 without a word, since that is what rounding makes of 1. */
#define LEAST_INDEX 0.9999f
#define STEEPEST 1.0e6f
RAY_INLINE vfloat bend_index(const bend_field *field, const vector3 *at, vfloat gradient[3], vint *fault)
{
    world_point_at place;
    bend_place(&place, field, at);
    const vfloat said = slope_of_index(field->index_data, &place, field->level, gradient), n = dielectric_ior(said);
    const vint least = v_mask(v_ge(said, (vfloat)(LEAST_INDEX)));
    const vint kept = least & v_mask(v_le(said, (vfloat)(DIELECTRIC_MOST_IOR)));
    *fault = ~least;
    for (int i = 0; i < 3; i++) {
        const vfloat g = gradient[i] * field->voxel_m;
        gradient[i] = v_select(kept & v_mask(v_lt(k_fabs(g), (vfloat)(STEEPEST))), g, (vfloat)(0.0f));
    }
    return n;
}

RAY_INLINE vfloat bend_index_alone(const bend_field *field, const vector3 *at)
{
    world_point_at place;
    bend_place(&place, field, at);
    return dielectric_ior(index_at(field->index_data, &place, field->level));
}

RAY_INLINE vfloat bend_matter(const bend_field *field, const vector3 *at)
{
    world_point_at place;
    bend_place(&place, field, at);
    return matter_at(field->data, &place, field->level);
}

/* The index, its gradient per metre, clear matter. */
enum { RANGE_INDEX, RANGE_GRADIENT, RANGE_CLEAR = RANGE_GRADIENT + 3 };
/* What rounding may make of values that do not jump. */
#define LEAST_JUMP 1.0e-6f
#ifdef BEND_UNBOUNDED /* bounds would take longer than steps */
RAY_INLINE bend_bound bend_bounds(const bend_field *field, const vector3 *at, vfloat radius)
{
    const vint no = (vint)(0);
    const vfloat zero = radius * 0.0f;
    const bend_bound b = {no, no, zero + 1.0f, zero + DIELECTRIC_MOST_IOR, zero, zero, no};
    (void)field, (void)at;
    return b;
}
#else
K_CALLED bend_bound bend_bounds(const bend_field *field, const vector3 *at, vfloat radius)
{
    const vfloat zero = (vfloat)(0.0f), steepest = (vfloat)(STEEPEST);
    world_point_at place;
    world_range of[WORLD_RANGES];
    bend_place(&place, field, at);
    const vint unknown = world_ranges(field->bound_data, &place, radius, field->level, of);
    bend_bound b;
    b.inside = ~unknown & v_mask(v_gt(of[RANGE_CLEAR].range.lo, zero));
    /* Where n is taken as another it is constant, and where it goes over into that its gradient jumps. */
    const iv n = of[RANGE_INDEX].range;
    const vint low = v_mask(v_lt(n.hi, (vfloat)(LEAST_INDEX))),
               high = v_mask(v_gt(n.lo, (vfloat)(DIELECTRIC_MOST_IOR)));
    const vint whole = v_mask(v_ge(n.lo, (vfloat)(LEAST_INDEX))) & v_mask(v_le(n.hi, (vfloat)(DIELECTRIC_MOST_IOR)));
    const vint is_constant = ~unknown & (low | high);
    b.least = dielectric_ior(v_select(unknown, zero, n.lo));
    b.most = dielectric_ior(v_select(unknown, (vfloat)(DIELECTRIC_MOST_IOR), n.hi));
    vfloat square = zero, bends = zero, jumps = zero;
    vint steep = (vint)(0);
    for (int i = 0; i < 3; i++) {
        const world_range *g = of + RANGE_GRADIENT + i;
        const vfloat most = lane_max(k_fabs(g->range.lo), k_fabs(g->range.hi)) * field->voxel_m;
        steep |= v_mask(v_ge(most, steepest));
        square = k_fma(most, most, square);
        jumps = k_fma(g->jump * field->voxel_m, g->jump * field->voxel_m, jumps);
        for (int j = 0; j < 3; j++) {
            const vfloat bend = g->slope[j] * field->voxel_m;
            bends = k_fma(bend, bend, bends);
        }
    }
    const vfloat steepness = k_fma(b.most, k_sqrt(bends), square), jump = b.most * k_sqrt(jumps);
    b.parts = v_mask(v_gt(of[RANGE_INDEX].jump, (vfloat)(LEAST_JUMP))) | steep | ~whole;
    b.parts &= ~is_constant;
    b.steepness = v_select(is_constant, zero, steepness);
    b.jump = v_select(is_constant, zero, jump);
    b.known = ~unknown;
    return b;
}
#endif

/* Out of clear matter; against the way where the density has no gradient. */
RAY_INLINE vector3 normal_at(const bend_field *field, const vector3 *at, const vector3 *way)
{
    world_point_at place;
    vfloat g[3];
    bend_place(&place, field, at);
    slope_of_matter(field->data, &place, field->level, g);
    const vfloat most = lane_max(lane_max(k_fabs(g[0]), k_fabs(g[1])), k_fabs(g[2]));
    const vint good = v_mask(v_gt(most, (vfloat)(1.0e-37f))) & v_mask(v_lt(most, (vfloat)(1.0e37f)));
    const vfloat per = (vfloat)(-1.0f) / v_select(good, most, (vfloat)(1.0f));
    const vector3 down = {v_select(good, g[0] * per, way->x), v_select(good, g[1] * per, way->y),
                          v_select(good, g[2] * per, way->z)};
    return dielectric_unit(&down);
}

#define BEND_WORD_(word) v_gather_float(words, first + (word))
#define RAY_FLOATS (sizeof(karst_ray) / sizeof(float))

/* The level whose voxels are as wide as the footprint asks for. */
RAY_INLINE vint level_of(vfloat footprint)
{
    const vint level = ((v_as_int(footprint) >> 23) & 0xff) - 127;
    return lane_min_int(lane_max_int(level, (vint)(0)), (vint)(KARST_MAX_LEVELS - 1));
}

typedef struct {
    vector3 origin, way, velocity, end, normal;
    vfloat speed, t_max, arc, length, sigma, radius;
    vint state, met, steps;
} chord_lanes;

/* Of lanes whose rays are inside. */
RAY_INLINE void follow(const bend_field *field, const bend_settings *with, vint mine, chord_lanes *c, bend_path *p)
{
    const vfloat zero = (vfloat)(0.0f);
    p->s.at.x = p->s.at.y = p->s.at.z = zero;
    p->s.matter = zero;
    bend_look(field, &p->s);
    const vfloat speed = v_select(v_mask(v_gt(c->speed, zero)), c->speed, p->s.index);
    p->s.velocity.x = c->way.x * speed, p->s.velocity.y = c->way.y * speed, p->s.velocity.z = c->way.z * speed;
    p->met = c->met, p->steps = c->steps, p->sigma = c->sigma, p->radius = c->radius;
    bend_chord(field, with, mine, p);
    const vector3 way = dielectric_unit(&p->s.velocity);
    const vfloat length = k_sqrt(bend_dot(&p->s.at, &p->s.at));
    const vint some = v_mask(v_gt(length, zero));
    const vfloat per = (vfloat)(1.0f) / v_select(some, length, (vfloat)(1.0f));
    const vector3 along = {p->s.at.x * per, p->s.at.y * per, p->s.at.z * per};
    if (v_any(p->leaves & mine)) {
        const vector3 n = normal_at(field, &p->s.at, &way);
        c->normal = bend_select(mine, &n, &c->normal);
    }
    const vector3 chord = bend_select(some, &along, &way), end = bend_add(&c->origin, (vfloat)(1.0f), &p->s.at);
    const vfloat now = k_sqrt(bend_dot(&p->s.velocity, &p->s.velocity));
    c->end = bend_select(mine, &end, &c->end);
    c->velocity = bend_select(mine, &way, &c->velocity);
    c->way = bend_select(mine, &chord, &c->way);
    c->speed = v_select(mine, now, c->speed);
    c->sigma = v_select(mine, p->sigma, c->sigma);
    c->radius = v_select(mine, p->radius, c->radius);
    c->arc = v_select(mine, p->arc, c->arc);
    c->length = v_select(mine, length, c->length);
    c->met = v_select(mine, p->met, c->met);
    c->steps = v_select(mine, p->steps, c->steps);
    c->state = v_select(mine, (vint)((int)KARST_BEND_ON), c->state);
    c->state = v_select(mine & p->leaves, (vint)((int)KARST_BEND_LEAVES), c->state);
    c->state = v_select(mine & p->cut, (vint)((int)KARST_BEND_CUT), c->state);
}

RAY_INLINE void count_faults(K_GLOBAL uint *counts, const chord_lanes *c, const bend_path *p, vint mine)
{
    int num[LANES];
    float place[3][LANES];
    const vector3 at = bend_add(&c->origin, (vfloat)(1.0f), &p->first_fault);
    v_store_int(v_select(mine, p->num_faults, (vint)(0)), num);
    v_store_float(at.x, place[0]), v_store_float(at.y, place[1]), v_store_float(at.z, place[2]);
    for (int l = 0; l < LANES; l++)
        if (num[l] && atomic_add(&counts[KARST_BEND_COUNT_FAULTS], (uint)num[l]) == 0)
            for (int i = 0; i < 3; i++)
                ((K_GLOBAL float *)counts)[KARST_BEND_FAULT_PLACE + i] = place[i][l];
}

/* The next chord of each ray that has one: LANES rays for each work-item. */
__kernel K_WIDE void bend_chords(karst_bend_task task, K_GLOBAL karst_ray *rays, K_GLOBAL const uint *count,
                                 K_GLOBAL const karst_clear_way *ways, K_GLOBAL const uint *met,
                                 K_GLOBAL karst_bend *bends, karst_shade_anchor anchor, K_GLOBAL const ulong *data,
                                 K_GLOBAL const ulong *index_data, K_GLOBAL const ulong *bound_data,
                                 K_GLOBAL uint *counts)
{
    const uint lowest = (uint)get_global_id(0) * LANES, num_rays = *count;
    if (lowest >= num_rays)
        return;
    int states[LANES], mets[LANES], steps[LANES];
    float speeds[LANES], t_maxes[LANES], sigmas[LANES], radii[LANES];
    uint inside_bits = 0;
    for (uint l = 0; l < LANES; l++) {
        const uint i = lowest + l < num_rays ? lowest + l : lowest;
        K_GLOBAL karst_bend *b = bends + i;
        if (task.is_first && lowest + l < num_rays) {
            b->state = ways[i].side == KARST_SIDE_BACK ? KARST_BEND_ON : KARST_BEND_STRAIGHT;
            b->t_max = rays[i].t_max;
            b->met = met[i];
            b->steps = 0;
            b->speed = b->sigma = b->radius = 0.0f;
        }
        states[l] = (int)b->state, mets[l] = (int)b->met, steps[l] = (int)b->steps;
        speeds[l] = b->speed, t_maxes[l] = b->t_max, sigmas[l] = b->sigma, radii[l] = b->radius;
        if (lowest + l < num_rays && b->state == KARST_BEND_ON)
            inside_bits |= 1u << l;
    }
    if (!inside_bits)
        return;
    vint left = bits_mask(inside_bits);
    K_GLOBAL const float *words = (K_GLOBAL const float *)(rays + lowest);
    const vint valid = v_mask(v_lt(V_LANE + (int)lowest, (vint)((int)num_rays)));
    const vint first = v_select(valid, V_LANE + (vint)(0), (vint)(0)) * (int)RAY_FLOATS;
    chord_lanes c;
    c.origin.x = BEND_WORD_(0), c.origin.y = BEND_WORD_(1), c.origin.z = BEND_WORD_(2);
    c.way.x = BEND_WORD_(4), c.way.y = BEND_WORD_(5), c.way.z = BEND_WORD_(6);
    c.velocity = c.normal = c.way, c.end = c.origin;
    c.arc = c.length = (vfloat)(0.0f);
    c.speed = v_load_float(speeds), c.t_max = v_load_float(t_maxes), c.sigma = v_load_float(sigmas);
    c.radius = v_load_float(radii);
    c.state = v_load_int(states), c.met = v_load_int(mets), c.steps = v_load_int(steps);
    const vint level = level_of(BEND_WORD_(8) * task.detail);
    world_point_at start;
    exact_place(&start, 0, &anchor, c.origin.x);
    exact_place(&start, 1, &anchor, c.origin.y);
    exact_place(&start, 2, &anchor, c.origin.z);
    const vint pixel = v_as_int(BEND_WORD_(10));
    while (v_any(left)) {
        const int here = (int)v_min_across(v_select(left, v_to_float(level), (vfloat)(1000.0f)));
        const vint mine = left & v_mask(v_eq(level, (vint)(here)));
        const bend_field field = {data, index_data, bound_data, &start, here, task.voxel_m};
        const bend_settings with = {k_as_float((uint)(here + 127) << 23), task.tolerance, c.t_max, pixel,
                                    task.sample, task.branch, task.most_met, task.x0_px, task.y0_px};
        bend_path p;
        p.first_fault = c.origin;
        follow(&field, &with, mine, &c, &p);
        if (v_any(v_mask(v_gt(p.num_faults, (vint)(0)))))
            count_faults(counts, &c, &p, mine);
        left &= ~mine;
    }
    float out[13][LANES];
    v_store_float(c.end.x, out[0]), v_store_float(c.end.y, out[1]), v_store_float(c.end.z, out[2]);
    v_store_float(c.arc, out[3]), v_store_float(c.velocity.x, out[4]), v_store_float(c.velocity.y, out[5]);
    v_store_float(c.velocity.z, out[6]), v_store_float(c.speed, out[7]), v_store_float(c.normal.x, out[8]);
    v_store_float(c.normal.y, out[9]), v_store_float(c.normal.z, out[10]), v_store_float(c.length, out[11]);
    v_store_float(c.sigma, sigmas), v_store_float(c.radius, radii);
    v_store_int(c.state, states), v_store_int(c.met, mets), v_store_int(c.steps, steps);
    float way[3][LANES];
    v_store_float(c.way.x, way[0]), v_store_float(c.way.y, way[1]), v_store_float(c.way.z, way[2]);
    for (uint l = 0; l < LANES; l++) {
        if (!(inside_bits >> l & 1u))
            continue;
        const karst_bend b = {{out[0][l], out[1][l], out[2][l]},
                              out[3][l],
                              {out[4][l], out[5][l], out[6][l]},
                              out[7][l],
                              {out[8][l], out[9][l], out[10][l]},
                              out[11][l],
                              sigmas[l],
                              t_maxes[l],
                              (uint)states[l],
                              (uint)mets[l],
                              (uint)steps[l],
                              radii[l],
                              {0, 0}};
        bends[lowest + l] = b;
        for (int i = 0; i < 3; i++)
            rays[lowest + l].direction[i] = way[i][l];
        /* what touches the end of clear matter may lie a little beyond it */
        const float beyond = states[l] == (int)KARST_BEND_LEAVES
                                 ? contact_most(rays[lowest + l].width * task.detail)
                                 : 0.0f;
        rays[lowest + l].t_max = out[11][l] + beyond;
    }
}

/* ---- what the chords met ---- */

/* Surfaces of bricks lie where the true density's do to so many voxels of the ray's level, as do chords and paths; and
 * rays that leave as flat as this, as a cosine, meet them the farther apart. */
#define SAME_SURFACE 2.0f
#define FLATTEST 0.01f

/* The share of light that is left after a way. */
RAY_INLINE float left_of(float absorption, float way)
{
    /* As tone_exp2_minus, of one number. */
    const float x = k_min(k_max(absorption * way * 1.44269504f, 0.0f), 126.0f);
    const int whole = (int)x;
    const float f = x - (float)whole;
    float p = k_fma(f, 1.5403530e-4f, -1.3333558e-3f);
    p = k_fma(f, p, 9.6181291e-3f);
    p = k_fma(f, p, -5.5504109e-2f);
    p = k_fma(f, p, 2.4022651e-1f);
    p = k_fma(f, p, -6.9314718e-1f);
    return k_fma(f, p, 1.0f) * k_as_float((uint)(127 - whole) << 23);
}

/* The ray's last stretch: along `way`, to what lies t along its chord. */
RAY_INLINE void turn_ray(K_GLOBAL karst_ray *ray, const float at[3], const float way[3], float t)
{
    for (int i = 0; i < 3; i++) {
        ray->direction[i] = way[i];
        ray->origin[i] = k_fma(-t, way[i], at[i]);
    }
}

RAY_INLINE void miss(K_GLOBAL karst_hit *hit, float t)
{
    const karst_hit none = {t, KARST_HIT_MISS, 0, 0, {0.0f, 0.0f, 0.0f}, 0};
    *hit = none;
}

/* The end of clear matter where the path found it; of `met`, which the chord met there, if it did. */
RAY_INLINE void leave(K_GLOBAL karst_hit *kept, const karst_hit *met, K_GLOBAL const karst_bend *b, int level)
{
    const karst_hit end = {b->length,
                           KARST_HIT_KIND(met->kind) != KARST_HIT_MISS
                               ? met->kind | KARST_HIT_UNBLENDED
                               : KARST_HIT_SURFACE | (uint)level << 8 | KARST_HIT_UNBLENDED,
                           met->brick,
                           met->place,
                           {b->normal[0], b->normal[1], b->normal[2]},
                           met->node};
    *kept = end;
}

/* After a chord was cast: what of it counts. One ray for each work-item. */
__kernel void bend_met(karst_bend_task task, K_GLOBAL karst_ray *rays, K_GLOBAL const uint *count,
                       K_GLOBAL const karst_clear_way *ways, K_GLOBAL karst_bend *bends, K_GLOBAL const karst_hit *hits,
                       K_GLOBAL const karst_hit *over_hits, K_GLOBAL karst_hit *kept, K_GLOBAL karst_hit *over_kept,
                       K_GLOBAL uint *counts, K_GLOBAL uint *counters)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count || bends[i].state == KARST_BEND_DONE)
        return;
    K_GLOBAL karst_bend *b = bends + i;
    K_GLOBAL karst_ray *ray = rays + i;
    const karst_hit land = hits[i], over = over_hits[i];
    const float touches = contact_begins(&land, ray->direction[0], ray->direction[1], ray->direction[2]);
    const int on_land = KARST_HIT_KIND(land.kind) != KARST_HIT_MISS &&
                        (b->state == KARST_BEND_STRAIGHT || touches <= b->length),
              on_clear = KARST_HIT_KIND(over.kind) != KARST_HIT_MISS;
    const int level = (int)((k_as_uint(ray->width * task.detail) >> 23) & 0xffu) - 127;
    const float rise = k_fabs(k_fma(over.normal[0], ray->direction[0],
                                    k_fma(over.normal[1], ray->direction[1], over.normal[2] * ray->direction[2])));
    const int met_level = (int)KARST_HIT_LEVEL(over.kind), widest = k_max(k_max(level, 0), on_clear ? met_level : 0);
    const float near = SAME_SURFACE * k_as_float((uint)(widest + 127) << 23) / k_max(rise, FLATTEST);
    float travelled = b->arc, t = b->length;
    int goes_on = 0, ends_nowhere = 0;
    kept[i] = land, over_kept[i] = over;
    if (b->state == KARST_BEND_STRAIGHT) {
        b->state = KARST_BEND_DONE;
        b->t_max = ray->t_max;
        ray->t_max = 0.0f;
        return;
    }
    if (on_land && !(on_clear && over.t < touches)) {
        miss(over_kept + i, b->length);
        t = land.t;
        travelled = b->length > 0.0f ? b->arc * (t / b->length) : t;
    } else if (on_clear && over.t < b->length - near && (task.is_first || over.t > near)) {
        /* Behind its first chord a path starts inside, whatever a brick says. */
        const float share = b->length > 0.0f ? over.t / b->length : 0.0f;
        float at[3], way[3], square = 0.0f;
        t = over.t;
        travelled = b->arc * share;
        for (int k = 0; k < 3; k++) {
            at[k] = k_fma(t, ray->direction[k], ray->origin[k]);
            /* The path turns evenly about its chord: as much before it as after. */
            way[k] = k_fma(2.0f * share - 1.0f, b->way[k] - ray->direction[k], ray->direction[k]);
            square = k_fma(way[k], way[k], square);
        }
        for (int k = 0; k < 3; k++)
            way[k] /= k_sqrt(square);
        turn_ray(ray, at, way, t);
    } else if (b->state == KARST_BEND_LEAVES) {
        float end[3] = {b->end[0], b->end[1], b->end[2]}, way[3] = {b->way[0], b->way[1], b->way[2]};
        miss(kept + i, t);
        leave(over_kept + i, &over, b, level > 0 ? level : 0);
        turn_ray(ray, end, way, t);
    } else {
        const int is_cut = b->met > task.most_met || b->steps >= KARST_BEND_MOST_STEPS || task.is_last;
        goes_on = b->state == KARST_BEND_ON && !task.is_last;
        if (!goes_on && is_cut)
            atomic_add(&counters[KARST_CLEAR_COUNT_CUT], 1u);
        for (int k = 0; k < 3; k++) {
            ray->direction[k] = b->way[k];
            ray->origin[k] = b->end[k];
        }
        ray->width = k_fma(ray->cone, b->arc, ray->width);
        t = 0.0f;
        ends_nowhere = !goes_on;
    }
    /* What comes of the last stretch, straight, is taken later. */
    for (int k = 0; k < 3; k++)
        ray->throughput[k] *= left_of(ways[i].absorption[k], travelled - t);
    if (goes_on) {
        atomic_add(&counts[KARST_BEND_COUNT_ON], 1u);
        return;
    }
    if (ends_nowhere) {
        miss(kept + i, 0.0f);
        miss(over_kept + i, 0.0f);
    }
    b->state = KARST_BEND_DONE;
    ray->t_max = 0.0f;
}

/* The stream as if each ray had been its last stretch alone. */
__kernel void bend_end(K_GLOBAL karst_ray *rays, K_GLOBAL const uint *count, K_GLOBAL const karst_bend *bends,
                       K_GLOBAL const karst_hit *kept, K_GLOBAL const karst_hit *over_kept, K_GLOBAL uint *met,
                       K_GLOBAL karst_hit *hits, K_GLOBAL karst_hit *over_hits)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count)
        return;
    rays[i].t_max = bends[i].t_max;
    met[i] = bends[i].met;
    hits[i] = kept[i];
    over_hits[i] = over_kept[i];
}
