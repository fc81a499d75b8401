/* Packets of light through cells of a medium: see raycast/media/fluence.h.
 *
 * Within a block of cells no interpolant is above the block's bound, so places are chosen as if the extinction were
 * that everywhere, and each is a collision as often as the extinction there says (E. Woodcock and others, "Techniques
 * used in the GEM code for Monte Carlo neutronics calculations in reactors and other systems of complex geometry",
 * 1965). Every such place, collision or not, is noted where the packet was scattered before: the sum of what it carries
 * over the bound is the fluence times the volume. A packet's way depends on its number alone, and sums are of whole
 * quanta: so neither lanes nor order leave a trace.
 *
 * Packets for the fine grid are aimed at it, and fly through the coarse one up to where the fine one knows of all that
 * there is. Once they leave it they are not followed: what comes back from outside is lost, near its faces. */
#include "raycast/light/light.clh"
#include "raycast/media/chance.clh"
#include "raycast/media/fluence_shared.h"

/* Powers of the root of x^3 = x + 1, and of that of x^5 = x + 1, below 1, in 2^32nds: multiples are spread evenly, two
 * or four together (M. Roberts' R-sequences). */
#define SUN_U 0xc13fa9a9u
#define SUN_V 0x91e10da6u
#define AROUND_U 0xdb4f0b91u
#define AROUND_V 0xbbe05633u
#define AROUND_TURN_U 0xa0f2ec75u
#define AROUND_TURN_V 0x89e18285u

/* Places on a packet's way at most. */
#define FLUENCE_MOST_PLACES 1000000
/* Below, chance decides whether a packet goes on. */
#define FLUENCE_LEAST (KARST_FLUENCE_WHOLE / 8)
/* Lanes that are done wait for so many before others start in them. */
#define FLUENCE_STARTS (LANES / 4)
/* Of cells in a block, on a side and in all. */
#define FLUENCE_SIDE_LOG2 2
#define FLUENCE_BLOCK_LOG2 6

#ifdef MEDIA_FLUENCE_PHASE
#define FLUENCE_WORDS KARST_FLUENCE_PHASE_WORDS
#else
#define FLUENCE_WORDS KARST_FLUENCE_WORDS
#endif

typedef struct {
    vfloat at[3]; /* in cells of the grid where it is, from its corner */
    vector3 direction;
    vint block[3], energy[3];
    vint live, scattered, of_sun, num_places;
    vint is_outside; /* in the coarse grid, on its way to the fine one */
    vuint chance;
    vulong sums[KARST_FLUENCE_SUMS];
} packets;

typedef struct {
    K_GLOBAL const float *extinction, *look, *bounds; /* of blocks: the most across a cell */
    K_GLOBAL const uint *open;
    K_GLOBAL uint *sums;
    const karst_fluence_box *box, *outer; /* what is traced; and what lies around it, 0: nothing does */
    int base, outer_base;                 /* their first cells */
} cells;

/* Of the grid where each packet is. */
RAY_INLINE vint size_of(const packets *p, const cells *in, int axis)
{
    const vint own = (vint)(in->box->size[axis]);
    return in->outer ? v_select(p->is_outside, (vint)(in->outer->size[axis]), own) : own;
}

RAY_INLINE vint base_of(const packets *p, const cells *in)
{
    return v_select(p->is_outside, (vint)(in->outer_base), (vint)(in->base));
}

RAY_INLINE vint whole_in(vfloat at, vint least, vint most)
{
    return lane_min_int(lane_max_int(v_to_int(at), least), most);
}

RAY_INLINE void note(packets *p, int sum, vint lanes)
{
    for (int c = 0; c < 3; c++)
        p->sums[sum] += v_uint_to_ulong(v_int_to_uint(v_select(lanes, p->energy[c], (vint)(0))));
}

/* ---- where they start ---- */

RAY_INLINE vfloat unit_at(vuint number, uint step)
{
    return v_to_float(v_uint_to_int((number * step + 0x80000000u) >> 8)) * (1.0f / 16777216.0f);
}

RAY_INLINE void enter(packets *p, vint lanes, int axis, vfloat at, const karst_fluence_box *box)
{
    p->at[axis] = v_select(lanes, at, p->at[axis]);
    const vint last = (vint)(box->size[axis] / KARST_FLUENCE_BLOCK - 1);
    const vint block = lane_min_int(lane_max_int(v_to_int(at * (1.0f / KARST_FLUENCE_BLOCK)), (vint)(0)), last);
    p->block[axis] = v_select(lanes, block, p->block[axis]);
}

/* Through the face of the box across `axis`, the upper one for lanes of `upper`, at (u, v) of its unit square. */
RAY_INLINE void enter_face(packets *p, vint lanes, int axis, vint upper, vfloat u, vfloat v,
                           const karst_fluence_box *box)
{
    const int across = axis == 0 ? 1 : 0, along = axis == 2 ? 1 : 2;
    enter(p, lanes, axis, v_select(upper, (vfloat)((float)box->size[axis]), (vfloat)(0.0f)), box);
    enter(p, lanes, across, u * (float)box->size[across], box);
    enter(p, lanes, along, v * (float)box->size[along], box);
}

RAY_INLINE void start_from_sun(packets *p, vint lanes, vuint number, const karst_fluence_box *box,
                               const karst_fluence_task *task, const karst_light *light)
{
    const vfloat pick = unit_at(number, SUN_U), v = unit_at(number, SUN_V);
    float before = 0.0f;
    for (int axis = 0; axis < 3; axis++) {
        const float share = task->faces[axis];
        /* The last has what rounding leaves. */
        const float after = axis == task->last_face ? 2.0f : before + share;
        const vint mine = lanes & v_ge(pick, (vfloat)(before)) & v_lt(pick, (vfloat)(after));
        const vfloat u = lane_unit((pick - before) * (1.0f / k_max(share, 1.0e-20f)));
        if (share > 0.0f)
            enter_face(p, mine, axis, (vint)(light->sun_direction[axis] > 0.0f ? -1 : 0), u, v, box);
        before = after;
    }
    p->direction.x = v_select(lanes, (vfloat)(-light->sun_direction[0]), p->direction.x);
    p->direction.y = v_select(lanes, (vfloat)(-light->sun_direction[1]), p->direction.y);
    p->direction.z = v_select(lanes, (vfloat)(-light->sun_direction[2]), p->direction.z);
    for (int c = 0; c < 3; c++)
        p->energy[c] = v_select(lanes, (vint)(task->sun[c]), p->energy[c]);
}

/* As light from all around is to what is lit by it (raycast/light/light.clh). */
RAY_INLINE void start_from_around(packets *p, vint lanes, vuint number, const karst_fluence_box *box,
                                  const karst_fluence_task *task, const karst_light *light)
{
    const float x = (float)box->size[0], y = (float)box->size[1], z = (float)box->size[2];
    const float areas[3] = {y * z, x * z, x * y}, per = 0.5f / (y * z + x * z + x * y);
    const vfloat pick = unit_at(number, AROUND_U), v = unit_at(number, AROUND_V);
    jitter turn;
    turn.u = unit_at(number, AROUND_TURN_U);
    turn.v = unit_at(number, AROUND_TURN_V);
    const jitter disc = jitter_on_disc(turn);
    const vfloat in = k_sqrt(lane_max(1.0f - k_fma(disc.u, disc.u, disc.v * disc.v), (vfloat)(0.0f)));
    float before = 0.0f;
    vfloat d[3] = {p->direction.x, p->direction.y, p->direction.z};
    for (int face = 0; face < 6; face++) {
        const int axis = face >> 1, across = axis == 0 ? 1 : 0, along = axis == 2 ? 1 : 2, upper = face & 1;
        /* The last has what rounding leaves. */
        const float after = face == 5 ? 2.0f : before + areas[axis] * per;
        const vint mine = lanes & v_ge(pick, (vfloat)(before)) & v_lt(pick, (vfloat)(after));
        const vfloat u = lane_unit((pick - before) * (1.0f / (areas[axis] * per)));
        enter_face(p, mine, axis, (vint)(-upper), u, v, box);
        d[axis] = v_select(mine, upper ? -in : in, d[axis]);
        d[across] = v_select(mine, disc.u, d[across]);
        d[along] = v_select(mine, disc.v, d[along]);
        before = after;
    }
    p->direction.x = d[0], p->direction.y = d[1], p->direction.z = d[2];
    const vector3 from = {-d[0], -d[1], -d[2]};
    const colour around = light_from_around(light, &from);
    const vfloat energy[3] = {around.r, around.g, around.b};
    for (int c = 0; c < 3; c++)
        p->energy[c] = v_select(lanes, v_to_int(k_fma(energy[c], (vfloat)(task->around), (vfloat)(0.5f))),
                                p->energy[c]);
}

RAY_INLINE void settle_block(packets *p, const cells *in, vint lanes)
{
    K_UNROLL
    for (int axis = 0; axis < 3; axis++) {
        const vint last = (size_of(p, in, axis) >> FLUENCE_SIDE_LOG2) - 1;
        p->block[axis] = v_select(lanes, whole_in(p->at[axis] * (1.0f / KARST_FLUENCE_BLOCK), (vint)(0), last),
                                  p->block[axis]);
    }
}

/* Back to where they come into what lies around. */
RAY_INLINE void go_back(packets *p, vint lanes, const cells *in)
{
    const vfloat along[3] = {p->direction.x, p->direction.y, p->direction.z}, none = (vfloat)(0.0f);
    const float per = 1.0f / in->outer->cell, scale = in->box->cell * per;
    vfloat at[3], t = (vfloat)(1.0e30f);
    K_UNROLL
    for (int axis = 0; axis < 3; axis++) {
        const float shift = (in->box->corner[axis] - in->outer->corner[axis]) * per,
                    size = (float)in->outer->size[axis];
        at[axis] = lane_min(lane_max(k_fma(p->at[axis], (vfloat)(scale), (vfloat)(shift)), none), (vfloat)(size));
        const vint climbs = v_gt(along[axis], none);
        const vfloat far = v_select(climbs, at[axis], size - at[axis]);
        t = lane_min(t, far / lane_max(k_fabs(along[axis]), (vfloat)(1.0e-12f)));
    }
    p->is_outside |= lanes;
    K_UNROLL
    for (int axis = 0; axis < 3; axis++)
        p->at[axis] = v_select(lanes, k_fma(-t, along[axis], at[axis]), p->at[axis]);
    settle_block(p, in, lanes);
}

RAY_INLINE void start(packets *p, vint lanes, vint number, const cells *in, const karst_fluence_task *task,
                      const karst_light *light)
{
    const karst_fluence_box *box = in->box;
    p->is_outside &= ~lanes;
    const vuint n = v_int_to_uint(number);
    const vint of_sun = lanes & v_lt(number, (vint)((int)task->num_sun));
    if (v_any(of_sun))
        start_from_sun(p, of_sun, n, box, task, light);
    if (v_any(lanes & ~of_sun))
        start_from_around(p, lanes & ~of_sun, n - task->num_sun, box, task, light);
    vuint h = n * 0x9e3779b1u + 0x27d4eb2fu;
    h ^= h >> 15;
    h *= 0x2c1b3c6du;
    h ^= h >> 12;
    h *= 0x297a2d39u;
    h ^= h >> 15;
    p->chance = v_int_to_uint(v_select(lanes, v_uint_to_int(h), v_uint_to_int(p->chance)));
    p->scattered &= ~lanes;
    p->of_sun = v_select(lanes, of_sun, p->of_sun);
    p->num_places = v_select(lanes, (vint)(0), p->num_places);
    if (in->outer)
        go_back(p, lanes, in);
    p->live |= lanes & v_gt(p->energy[0] | p->energy[1] | p->energy[2], (vint)(0));
    note(p, KARST_FLUENCE_GIVEN, lanes);
}

/* ---- where they go ---- */

/* Where packets outside come into a box, in cells of the coarse grid, as ways along their rays; corners are from the
 * anchor. Those that never do: a large number. */
RAY_INLINE vfloat way_into(const packets *p, const cells *in, vint lanes, const float from[3], const float to[3])
{
    const vfloat along[3] = {p->direction.x, p->direction.y, p->direction.z};
    const float per = 1.0f / in->outer->cell;
    vfloat enter = (vfloat)(0.0f), exit = (vfloat)(1.0e30f);
    K_UNROLL
    for (int axis = 0; axis < 3; axis++) {
        const vint climbs = v_gt(along[axis], (vfloat)(0.0f));
        const vfloat size = lane_max(k_fabs(along[axis]), (vfloat)(1.0e-12f)),
                     inverse = 1.0f / v_select(climbs, size, -size);
        const vfloat first = ((from[axis] - in->outer->corner[axis]) * per - p->at[axis]) * inverse,
                     second = ((to[axis] - in->outer->corner[axis]) * per - p->at[axis]) * inverse;
        enter = lane_max(enter, lane_min(first, second));
        exit = lane_min(exit, lane_max(first, second));
    }
    return v_select(lanes & v_lt(enter, exit), enter, (vfloat)(2.0e30f));
}

/* Those that have come to where the fine grid knows all: on to its cells, as there is nothing before them, whatever the
 * coarse ones say. Returns the lanes that go by. */
RAY_INLINE vint come_inside(packets *p, const cells *in, vint lanes)
{
    const float scale = in->outer->cell / in->box->cell, per = 1.0f / in->box->cell;
    const vfloat along[3] = {p->direction.x, p->direction.y, p->direction.z};
    float to[3];
    for (int axis = 0; axis < 3; axis++)
        to[axis] = k_fma((float)in->box->size[axis], in->box->cell, in->box->corner[axis]);
    const vfloat way = way_into(p, in, lanes, in->box->corner, to);
    const vint misses = lanes & v_gt(way, (vfloat)(1.0e30f));
    lanes &= ~misses;
    p->is_outside &= ~lanes;
    K_UNROLL
    for (int axis = 0; axis < 3; axis++) {
        const float shift = (in->outer->corner[axis] - in->box->corner[axis]) * per;
        const vfloat at = k_fma(k_fma(way, along[axis], p->at[axis]), (vfloat)(scale), (vfloat)(shift));
        const vfloat kept = lane_min(lane_max(at, (vfloat)(0.0f)), (vfloat)((float)in->box->size[axis]));
        p->at[axis] = v_select(lanes, kept, p->at[axis]);
    }
    settle_block(p, in, lanes);
    return misses;
}

/* To where chance says in their blocks, or to their ends. Returns the lanes that are still in one. *bound: its. */
RAY_INLINE vint fly(packets *p, const cells *in, vfloat *bound)
{
    const vfloat none = (vfloat)(0.0f);
    const vector3 *d = &p->direction;
    const vfloat along[3] = {d->x, d->y, d->z};
    const vint across = size_of(p, in, 0) >> FLUENCE_SIDE_LOG2, down = size_of(p, in, 1) >> FLUENCE_SIDE_LOG2;
    const vint first = base_of(p, in) >> FLUENCE_BLOCK_LOG2,
               block = p->block[0] + across * (p->block[1] + down * p->block[2]);
    *bound = v_gather_float(in->bounds, v_select(p->live, first + block, (vint)(0)));
    vfloat plane[3], t[3], end = (vfloat)(1.0e30f);
    K_UNROLL
    for (int axis = 0; axis < 3; axis++) {
        const vint climbs = v_gt(along[axis], none);
        const vint next = v_select(climbs, p->block[axis] + 1, p->block[axis]);
        plane[axis] = v_to_float(next * KARST_FLUENCE_BLOCK);
        const vfloat size = lane_max(k_fabs(along[axis]), (vfloat)(1.0e-12f));
        t[axis] = lane_max((plane[axis] - p->at[axis]) / v_select(climbs, size, -size), none);
        end = lane_min(end, t[axis]);
    }
    vint comes = (vint)(0);
    if (in->outer && v_any(p->live & p->is_outside)) {
        const vfloat enter = way_into(p, in, p->is_outside, in->box->from, in->box->to);
        comes = p->live & v_le(enter, end);
        end = v_select(comes, enter, end);
    }
    const vfloat way = minus_log(scatter_chance_of(&p->chance, p->live)) / lane_max(*bound, (vfloat)(1.0e-20f));
    const vint stays = p->live & v_gt(*bound, none) & v_lt(way, end), leaves = p->live & ~stays & ~comes;
    const vfloat step = v_select(stays, way, end);
    comes &= ~stays;
    vint gone = (vint)(0);
    K_UNROLL
    for (int axis = 0; axis < 3; axis++) {
        const vint crosses = leaves & v_le(t[axis], end);
        const vfloat to = k_fma(step, along[axis], p->at[axis]);
        p->at[axis] = v_select(crosses, plane[axis], v_select(p->live, to, p->at[axis]));
        const vint next = p->block[axis] + v_select(v_gt(along[axis], none), (vint)(1), (vint)(-1));
        p->block[axis] = v_select(crosses, next, p->block[axis]);
        gone |= crosses & (v_lt(next, (vint)(0)) | v_ge(next, size_of(p, in, axis) >> FLUENCE_SIDE_LOG2));
    }
    if (v_any(comes))
        gone |= come_inside(p, in, comes);
    if (v_any(gone)) {
        note(p, KARST_FLUENCE_ESCAPED, gone);
        p->live &= ~gone;
    }
    return stays;
}

RAY_INLINE void add_long(K_GLOBAL uint *words, long more)
{
    const uint low = (uint)(ulong)more, before = atomic_add(words, low);
    const uint high = (uint)(ulong)(more >> 32) + (before + low < before ? 1u : 0u);
    if (high)
        atomic_add(words + 1, high);
}

/* The lanes are somewhere in these cells, in places that come as often as the bound says. */
RAY_INLINE void note_fluence(const packets *p, const cells *in, vint lanes, vint cell, vfloat bound)
{
    const vfloat per = 1.0f / lane_max(bound, (vfloat)(1.0e-20f));
    int on[LANES], at[LANES], quanta[FLUENCE_WORDS / 2][LANES];
    v_store_int(lanes, on);
    v_store_int(cell, at);
    for (int c = 0; c < 3; c++)
        v_store_int(v_to_int(k_fma(v_to_float(p->energy[c]), per, (vfloat)(0.5f))), quanta[c]);
#ifdef MEDIA_FLUENCE_PHASE
    const vfloat sum = v_to_float(p->energy[0] + p->energy[1] + p->energy[2]) * per;
    v_store_int(v_to_int(k_rint(sum * p->direction.x)), quanta[3]);
    v_store_int(v_to_int(k_rint(sum * p->direction.y)), quanta[4]);
    v_store_int(v_to_int(k_rint(sum * p->direction.z)), quanta[5]);
#endif
    for (uint lane = 0; lane < LANES; lane++)
        for (int c = 0; on[lane] && c < FLUENCE_WORDS / 2; c++)
            if (quanta[c][lane])
                add_long(in->sums + FLUENCE_WORDS * (size_t)at[lane] + 2 * c, (long)quanta[c][lane]);
}

/* A cell whose share of the extinction at the lanes' places is their weight in the interpolant: one of eight. */
RAY_INLINE vint neighbour_of(packets *p, vint lanes, const cells *in)
{
    vuint next = p->chance * 747796405u + 2891336453u;
    vuint word = ((next >> ((next >> 28) + 4u)) ^ next) * 277803737u;
    word ^= word >> 22;
    p->chance = v_int_to_uint(v_select(lanes, v_uint_to_int(next), v_uint_to_int(p->chance)));
    vint cell = (vint)(0);
    for (int axis = 2; axis >= 0; axis--) {
        const vfloat at = p->at[axis] + 0.5f; /* so that it is above 0 */
        const vint upper = v_to_int(at);
        const vfloat part = at - v_to_float(upper);
        const vfloat pick = (v_to_float(v_uint_to_int((word >> (uint)(10 * axis)) & 1023u)) + 0.5f) * (1.0f / 1024.0f);
        const vint index = v_select(v_lt(pick, part), upper, upper - 1);
        const vint size = size_of(p, in, axis);
        cell = cell * size + lane_min_int(lane_max_int(index, (vint)(0)), size - 1);
    }
    return v_select(lanes, base_of(p, in) + cell, (vint)(0));
}

/* What a medium's cell does to those that collided in it. */
RAY_INLINE void collide(packets *p, const cells *in, vint lanes, vint cell, const karst_fluence_task *task)
{
    const vint none = (vint)(0);
    if (task->has_land) {
        const vint open = v_gather_int((K_GLOBAL const int *)in->open, cell) >> KARST_FLUENCE_OPEN_SHIFT;
        const vint asks = lanes & p->of_sun & ~p->scattered & v_lt(open, (vint)(KARST_FLUENCE_ALL_OPEN));
        vint dark = asks;
        if (v_any(asks)) {
            const vfloat pick = scatter_chance_of(&p->chance, asks) * (float)KARST_FLUENCE_ALL_OPEN;
            dark &= v_ge(pick, v_to_float(open));
        }
        note(p, KARST_FLUENCE_SHADED, dark);
        p->live &= ~dark;
        lanes &= ~dark;
    }
    vint most = none;
    for (int c = 0; c < 3; c++) {
        const vfloat albedo = v_gather_float(in->look, 4 * cell + c);
        const vint left = v_to_int(k_fma(v_to_float(p->energy[c]), albedo, (vfloat)(0.5f)));
        p->sums[KARST_FLUENCE_ABSORBED] +=
            v_uint_to_ulong(v_int_to_uint(v_select(lanes, p->energy[c] - left, none)));
        p->energy[c] = v_select(lanes, left, p->energy[c]);
        most = lane_max_int(most, p->energy[c]);
    }
    jitter square;
    square.u = scatter_chance_of(&p->chance, lanes);
    square.v = scatter_chance_of(&p->chance, lanes);
    const vector3 turned = scatter_direction(square, v_gather_float(in->look, 4 * cell + 3), &p->direction);
    p->direction.x = v_select(lanes, turned.x, p->direction.x);
    p->direction.y = v_select(lanes, turned.y, p->direction.y);
    p->direction.z = v_select(lanes, turned.z, p->direction.z);
    p->scattered |= lanes;
    const vint weak = lanes & v_lt(most, (vint)(FLUENCE_LEAST));
    if (!v_any(weak))
        return;
    const vint wins = weak & v_lt(scatter_chance_of(&p->chance, weak), (vfloat)(0.5f)), ends = weak & ~wins;
    note(p, KARST_FLUENCE_WON, wins);
    note(p, KARST_FLUENCE_LOST, ends);
    for (int c = 0; c < 3; c++)
        p->energy[c] = v_select(wins, 2 * p->energy[c], p->energy[c]);
    p->live &= ~ends;
}

RAY_INLINE void follow(packets *p, const cells *in, const karst_fluence_task *task)
{
    vfloat bound;
    const vint stays = fly(p, in, &bound);
    if (!v_any(stays))
        return;
    const vint noted = stays & p->scattered & ~p->is_outside;
    if (v_any(noted)) {
        vint place = (vint)(0);
        for (int axis = 2; axis >= 0; axis--)
            place = place * in->box->size[axis] + whole_in(p->at[axis], (vint)(0), (vint)(in->box->size[axis] - 1));
        note_fluence(p, in, noted, v_select(noted, in->base + place, (vint)(0)), bound);
    }
    const vint cell = neighbour_of(p, stays, in);
    const vfloat here = v_gather_float(in->extinction, cell);
    const vint met = stays & v_lt(scatter_chance_of(&p->chance, stays) * bound, here);
    if (v_any(met))
        collide(p, in, met, cell, task);
    p->num_places = v_select(stays, p->num_places + 1, p->num_places);
    const vint long_ago = p->live & v_gt(p->num_places, (vint)(FLUENCE_MOST_PLACES));
    if (v_any(long_ago)) {
        note(p, KARST_FLUENCE_CUT, long_ago);
        p->live &= ~long_ago;
    }
}

__kernel K_WIDE void fluence_trace(karst_fluence_boxes boxes, karst_fluence_task task, karst_light light,
                                   K_GLOBAL const float *extinction, K_GLOBAL const float *look,
                                   K_GLOBAL const uint *open, K_GLOBAL const float *bounds, K_GLOBAL uint *sums,
                                   K_GLOBAL uint *ledger)
{
    const cells in = {extinction, look, bounds, open, sums, &boxes.grids[task.grid],
                      task.grid ? &boxes.grids[0] : 0, (int)(task.grid * KARST_FLUENCE_MOST_CELLS), 0};
    const uint first = task.first + (uint)get_global_id(0) * KARST_FLUENCE_RUN;
    if (first >= task.end)
        return;
    const uint left = task.end - first, num = left < KARST_FLUENCE_RUN ? left : KARST_FLUENCE_RUN;
    const vint end = (vint)((int)(first + num));
    const vfloat none = (vfloat)(0.0f);
    vint number = V_LANE + (int)first;
    packets p = {{none, none, none}, {none, none, (vfloat)(1.0f)}, {(vint)(0), (vint)(0), (vint)(0)},
                 {(vint)(0), (vint)(0), (vint)(0)}, (vint)(0), (vint)(0), (vint)(0), (vint)(0), (vint)(0), (vuint)(0u),
                 {(vulong)(0ul), (vulong)(0ul), (vulong)(0ul), (vulong)(0ul), (vulong)(0ul), (vulong)(0ul),
                  (vulong)(0ul)}};
    for (;;) {
        const vint idle = ~p.live & v_lt(number, end);
        if (v_any(idle) && (!v_any(p.live) || count_lanes(idle) > FLUENCE_STARTS)) {
            start(&p, idle, number, &in, &task, &light);
            number = v_select(idle, number + LANES, number);
        }
        if (!v_any(p.live))
            break;
        follow(&p, &in, &task);
    }
    for (int sum = 0; sum < KARST_FLUENCE_SUMS; sum++) {
        int low[LANES], high[LANES];
        ulong all = 0;
        v_store_int(v_uint_to_int(v_ulong_to_uint(p.sums[sum])), low);
        v_store_int(v_uint_to_int(v_ulong_to_uint(p.sums[sum] >> 32)), high);
        for (uint lane = 0; lane < LANES; lane++)
            all += (ulong)(uint)low[lane] | (ulong)(uint)high[lane] << 32;
        add_long(ledger + 2 * ((int)task.grid * KARST_FLUENCE_SUMS + sum), (long)all);
    }
}

/* ---- before and after ---- */

/* No interpolant in a block is more: those of its places reach into the cells around. */
__kernel void fluence_bound(karst_fluence_box box, uint base, K_GLOBAL const float *extinction,
                            K_GLOBAL float *bounds)
{
    const int across = box.size[0] / KARST_FLUENCE_BLOCK, down = box.size[1] / KARST_FLUENCE_BLOCK,
              along = box.size[2] / KARST_FLUENCE_BLOCK, i = (int)get_global_id(0);
    if (i >= across * down * along)
        return;
    const int block[3] = {i % across, i / across % down, i / (across * down)};
    int low[3], high[3];
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = k_max(block[axis] * KARST_FLUENCE_BLOCK - 1, 0);
        high[axis] = k_min((block[axis] + 1) * KARST_FLUENCE_BLOCK, box.size[axis] - 1);
    }
    float most = 0.0f;
    for (int z = low[2]; z <= high[2]; z++)
        for (int y = low[1]; y <= high[1]; y++)
            for (int x = low[0]; x <= high[0]; x++)
                most = k_max(most, extinction[(int)base + x + box.size[0] * (y + box.size[1] * z)]);
    bounds[(base >> FLUENCE_BLOCK_LOG2) + (uint)i] = most > 0.0f ? k_max(most, KARST_FLUENCE_LEAST_DEPTH) : 0.0f;
}

/* What rays look up (raycast/media/fluence.clh). scale: of a quantum. */
__kernel void fluence_pack(karst_fluence_box box, uint base, float scale, K_GLOBAL const uint *sums,
                           K_GLOBAL uint *words)
{
    const int num = box.size[0] * box.size[1] * box.size[2], i = (int)get_global_id(0);
    if (i >= num)
        return;
    float value[FLUENCE_WORDS / 2], most = 0.0f;
    for (int c = 0; c < FLUENCE_WORDS / 2; c++) {
        K_GLOBAL const uint *sum = sums + FLUENCE_WORDS * (size_t)(base + (uint)i) + 2 * c;
        value[c] = (float)(long)((ulong)sum[0] | (ulong)sum[1] << 32) * scale;
        if (c < 3)
            most = k_max(most, value[c]);
    }
    const int exponent = k_min(k_max((int)(k_as_uint(most) >> 23) - 126, -15), 16); /* below 2^exponent */
    const float per = k_as_float((uint)(127 + 9 - exponent) << 23);
    uint word = (uint)(exponent + 15) << 27;
    for (int c = 0; c < 3; c++)
        word |= (uint)k_min(k_rint(value[c] * per), 511.0f) << (9 * c);
    words[2 * base + (uint)i] = word;
#ifdef MEDIA_FLUENCE_PHASE
    const float all = k_max(value[0] + value[1] + value[2], 1.0e-30f);
    uint way = 0;
    for (int axis = 0; axis < 3; axis++)
        way |= (uint)k_rint(k_max(k_min(value[3 + axis] / all, 1.0f), -1.0f) * 511.0f + 511.0f) << (10 * axis);
    words[2 * base + (uint)(num + i)] = way;
#endif
}
