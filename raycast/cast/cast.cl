/* Entry points of casting: a stream of rays in, hit records and stamps out. See raycast/cast/cast.h. */
#include "raycast/cast/normal.clh"
#include "raycast/cast/rays.clh"
#include "raycast/rays_shared.h"
#include "raycast/shadow_shared.h"
#include "raycast/cast/slopes.clh"
#include "raycast/views_shared.h"
#include "raycast/cast/walk.clh"

/* Directions flatter than this on an axis count as this, upwards: their inverse stays finite, and a ray that runs in a
 * plane belongs to the cell above it on every level. */
#define FLAT 1.0e-18f

/* What becomes of rays, lane by lane; `kind` as in karst_hit. */
typedef struct {
    vfloat t;
    vint kind, brick, place, node;
    vector3 normal;
} packet_hits;

/* What a beam keeps of its packets beside what walking needs. */
typedef struct {
    vector3 origin; /* not mirrored; unused by streams from the anchor itself */
    vfloat t_end;
    vint octants, alive;
} packet_start;

/* Rays in lanes, as karst_ray has them. */
typedef struct {
    vector3 origin, direction;
    vfloat t_min, t_max, width, cone;
} ray_lanes;

/* Puts packet p on its way: the lanes of `valid`. What rays from the anchor, or to the sun, have in common the first
 * packet holds. */
RAY_INLINE void start_packet(beam *b, packet_start *start, int p, K_GLOBAL const karst_cast_view *view,
                             const int from_anchor, const int to_sun, const ray_lanes *of, vint valid)
{
    const vector3 *direction = &of->direction;
    const vfloat zero = (vfloat)(0.0f);
    b->states.done[p] = b->states.fresh[p] = b->states.incomplete[p] = 0;
    if (HAS_SIDES(from_anchor, to_sun))
        b->states.pending[p] = b->states.back[p] = 0;
#ifdef CAST_COUNT_STEPS
    v_store_int((vint)(0), b->states.steps + p * LANES);
#endif
    packet *rays = &b->rays[p];
    vint down_x = v_le(direction->x, (vfloat)(-FLAT)), down_y = v_le(direction->y, (vfloat)(-FLAT)),
         down_z = v_le(direction->z, (vfloat)(-FLAT));
    if (!to_sun || !p) {
        rays->direction.x = lane_max(k_fabs(direction->x), (vfloat)(FLAT));
        rays->direction.y = lane_max(k_fabs(direction->y), (vfloat)(FLAT));
        rays->direction.z = lane_max(k_fabs(direction->z), (vfloat)(FLAT));
        rays->inverse.x = 1.0f / rays->direction.x;
        rays->inverse.y = 1.0f / rays->direction.y;
        rays->inverse.z = 1.0f / rays->direction.z;
    }
    if (!from_anchor || !p)
        rays->lod_shift = of->width * view->detail;
    if ((!from_anchor && !to_sun) || !p) {
        rays->t_min = lane_max(of->t_min, zero);
        rays->lod_slope = lane_max(of->cone * view->detail, (vfloat)(1.0e-20f));
        rays->lod_scale = 1.0f / rays->lod_slope;
        start->t_end = of->t_max;
    }
    if (!from_anchor)
        start->origin = of->origin;
    start->octants = (down_x & 1) | (down_y & 2) | (down_z & 4);
    start->alive = valid & v_lt(of->t_min, of->t_max);
}

/* Casts those of the packets' rays that climb, and fall, on the axes of `octant`. */
RAY_INLINE void cast_octant(const pools *pool, K_GLOBAL const karst_cast_view *view, const int from_anchor,
                            const int to_sun, beam *b, const packet_start start[BEAM_PACKETS], int octant)
{
    for (int p = 0; p < BEAM_PACKETS; p++) {
        vint mine = start[p].alive & v_eq(start[p].octants, (vint)(octant));
        packet *rays = &b->rays[p];
        b->here[p] = mask_bits(mine);
        if (!from_anchor) {
            if (!to_sun)
                rays->t_max = v_select(mine, start[p].t_end, (vfloat)(RAY_DONE));
            rays->origin.x = octant & 1 ? -start[p].origin.x : start[p].origin.x;
            rays->origin.y = octant & 2 ? -start[p].origin.y : start[p].origin.y;
            rays->origin.z = octant & 4 ? -start[p].origin.z : start[p].origin.z;
        }
    }
    b->octant = (uint)octant;
    bound_beam(b, from_anchor, to_sun);
    if (b->live)
        walk_octree(pool, view, from_anchor, to_sun, b);
}

/* Casts the packets that were started. Constants: from_anchor: origins are zero; to_sun: they have one direction, cone
 * and t_max, t_min is 0, and all that is wanted of them is whether they are done. */
RAY_INLINE void cast_beam(const pools *pool, K_GLOBAL const karst_cast_view *view, const int from_anchor,
                          const int to_sun, beam *b, const packet_start start[BEAM_PACKETS])
{
    b->found.num = b->queue.num = 0;
    b->asked = 0;
    b->has_back = 0;
    if (HAS_SIDES(from_anchor, to_sun))
        for (int p = 0; p < BEAM_PACKETS; p++)
            b->has_back |= b->states.back[p] != 0;
    if (from_anchor || to_sun)
        b->end = v_max_across(start[0].t_end);
#if BEAM_RAYS == 1
    /* A loop over octants would make a GPU's neighbours wait for each other. */
    cast_octant(pool, view, from_anchor, to_sun, b, start, start[0].octants);
#else
    /* Usually all lanes climb and fall on the same axes; else each octant is walked by itself. */
    int some = 0, all = 7;
    vint falls = (vint)(0), climbs = (vint)(0); /* bit a: some ray of the lane does so on axis a */
    for (int p = 0; p < BEAM_PACKETS; p++) {
        falls |= start[p].alive & start[p].octants;
        climbs |= start[p].alive & ~start[p].octants;
    }
    for (int axis = 0; axis < 3; axis++) {
        some |= v_any(v_ne(falls & (1 << axis), (vint)(0))) ? 1 << axis : 0;
        all &= v_any(v_ne(climbs & (1 << axis), (vint)(0))) ? ~(1 << axis) : 7;
    }
    for (int octant = 0; octant < 8; octant++)
        if (!(octant & ~some) && !(all & ~octant))
            cast_octant(pool, view, from_anchor, to_sun, b, start, octant);
#endif
}

/* Lane by lane into the records of a beam's rays: number `ray`. */
#if LANES == 16
/* Eight vectors become records by shuffles, not word by word. */
typedef uint8 hit_words __attribute__((aligned(4)));
/* Words of two vectors by turns: those of lanes 0 and 1 of each group of four, or of 2 and 3; then pairs of words. */
#define WORDS_LO_(a, b) __builtin_shufflevector(a, b, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29)
#define WORDS_HI_(a, b) __builtin_shufflevector(a, b, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31)
#define PAIRS_LO_(a, b) __builtin_shufflevector(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29)
#define PAIRS_HI_(a, b) __builtin_shufflevector(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31)
#define STORE_HIT_(l, k, first, second)                                                                          \
    *(hit_words *)(out + ray.l) = __builtin_shufflevector(first, second, 4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3, \
                                                          16 + 4 * k, 17 + 4 * k, 18 + 4 * k, 19 + 4 * k);
/* The lanes a, b, c and d: one of each group of four. */
#define STORE_FOUR_(pairs, half, a, b, c, d)                                                                     \
    {                                                                                                            \
        const vuint first = pairs(half(t, kind), half(brick, place)), second = pairs(half(x, y), half(z, node)); \
        STORE_HIT_(a, 0, first, second)                                                                          \
        STORE_HIT_(b, 1, first, second)                                                                          \
        STORE_HIT_(c, 2, first, second)                                                                          \
        STORE_HIT_(d, 3, first, second)                                                                          \
    }
RAY_INLINE void store_hits(karst_hit *out, const packet_hits *hits, vint ray)
{
    const vuint t = v_as_uint(hits->t), kind = as_uint16(hits->kind), brick = as_uint16(hits->brick),
                place = as_uint16(hits->place), x = v_as_uint(hits->normal.x), y = v_as_uint(hits->normal.y),
                z = v_as_uint(hits->normal.z), node = as_uint16(hits->node);
    STORE_FOUR_(PAIRS_LO_, WORDS_LO_, s0, s4, s8, sc)
    STORE_FOUR_(PAIRS_HI_, WORDS_LO_, s1, s5, s9, sd)
    STORE_FOUR_(PAIRS_LO_, WORDS_HI_, s2, s6, sa, se)
    STORE_FOUR_(PAIRS_HI_, WORDS_HI_, s3, s7, sb, sf)
}
#else
RAY_INLINE void store_hits(karst_hit *out, const packet_hits *hits, vint ray)
{
    karst_hit hit = {hits->t,
                     (uint)hits->kind,
                     (uint)hits->brick,
                     (uint)hits->place,
                     {hits->normal.x, hits->normal.y, hits->normal.z},
                     (uint)hits->node};
    out[ray] = hit;
}
#endif

/* A packet's records to where they stay: in the lanes of `valid`, at `index`. They are read by another kernel, long
 * after: whole lines go past the caches, and need not be read to be written. */
RAY_INLINE void send_hits(K_GLOBAL karst_hit *out, const karst_hit *hits, const int index[LANES], uint valid)
{
#if LANES == 16
    K_GLOBAL uint16 *lines = (K_GLOBAL uint16 *)(out + index[0]);
    if (valid == 0xffffu && index[15] - index[0] == 15 && !((ulong)lines & 63u)) {
        for (int i = 0; i < LANES * (int)sizeof(karst_hit) / 64; i++)
            __builtin_nontemporal_store(((const uint16 *)hits)[i], lines + i);
        return;
    }
#endif
    for (; valid; valid &= valid - 1u) {
        const uint lane = (uint)k_popcount((valid & (0u - valid)) - 1u);
        out[index[lane]] = hits[lane];
    }
}

/* How fast they grow. */
RAY_INLINE vfloat slopes_of(const beam *b, vint ray)
{
    return v_gather_float((const K_PRIVATE float *)&b->rays[0].lod_slope,
                          ray / LANES * (int)(sizeof(packet) / sizeof(float)) + ray % LANES);
}

/* The footprints of rays at t, as lod_slope and lod_shift have them. */
RAY_INLINE vfloat footprints_of(const beam *b, const int from_anchor, vint ray, vfloat t)
{
    if (from_anchor) /* a picture's have one cone and no width */
        return t * b->rays[0].lod_slope;
    const vint word = ray / LANES * (int)(sizeof(packet) / sizeof(float)) + ray % LANES;
    return k_fma(t, v_gather_float((const K_PRIVATE float *)&b->rays[0].lod_slope, word),
                 v_gather_float((const K_PRIVATE float *)&b->rays[0].lod_shift, word));
}

/* A coordinate in a brick in 64ths of its cells. */
RAY_INLINE vint in_64ths(vint cell, vfloat part)
{
    return cell << 6 | lane_min_int(v_to_int(part * 64.0f), (vint)(63));
}

#define SHARES_ROOM (LIST_ROOM + (CUBIC_ROOTS - 1) * LANES)

/* What share of its way through its cell each ray makes before it ends. */
RAY_INLINE void find_shares(const findings *found, float share[SHARES_ROOM])
{
    for (uint first = 0; first < found->num; first += CUBIC_ROOTS * LANES) {
        cubic f[CUBIC_ROOTS];
        vint mask[CUBIC_ROOTS];
        vfloat s[CUBIC_ROOTS];
        K_UNROLL
        for (int k = 0; k < CUBIC_ROOTS; k++) {
            /* Lists hold no more vectors than the first whole one that is not full. */
            const uint i = first + (uint)k * LANES, from = i < found->num ? i : first;
            f[k].c0 = v_load_float(found->f[0] + from), f[k].c1 = v_load_float(found->f[1] + from);
            f[k].c2 = v_load_float(found->f[2] + from), f[k].c3 = v_load_float(found->f[3] + from);
            mask[k] = v_lt(V_LANE, (vint)((int)(found->num - i)));
        }
        cubic_first_roots(f, mask, s);
        K_UNROLL
        for (int k = 0; k < CUBIC_ROOTS; k++)
            v_store_float(s[k], share + first + k * LANES);
    }
}

/* Stores the records of a beam's rays; index: where each ray's goes, if it is a ray at all. any_hit: where along the
 * cell the surface lies does not matter. The normals are found here as what they are read from has just been marched.
 */
RAY_INLINE void store_beam(const pools *pool, K_GLOBAL const karst_cast_view *view, K_GLOBAL karst_hit *out,
                           const beam *b, const packet_start start[BEAM_PACKETS], const int index[BEAM_RAYS],
                           const uint valid[BEAM_PACKETS], const int from_anchor, int any_hit)
{
    const findings *found = &b->found;
    const normal_source source = {pool->bricks, pool->nodes, pool->brick_info, pool->tile_info};
    packet_hits hits;
    LIST_BEGIN karst_hit records[BEAM_RAYS + 1]; /* the last: of lanes without a ray */
    LIST_BEGIN float share[SHARES_ROOM];
    if (!any_hit)
        find_shares(found, share);
    for (uint i = 0; i < found->num; i += LANES) {
        const vint m = v_lt(V_LANE, (vint)((int)(found->num - i)));
        const vint ray = v_select(m, v_load_int(found->ray + i), (vint)(0));
        const vfloat s = any_hit ? (vfloat)(0.0f) : v_load_float(share + i);
        const vint incomplete = v_uint_to_int(v_gather_uint(b->states.incomplete, ray / LANES)) >> ray % LANES & 1;
        hits.t = k_fma(s, v_load_float(found->dt + i), v_load_float(found->t + i));
        hits.kind = v_load_int(found->kind + i) | incomplete * (int)KARST_HIT_INCOMPLETE;
#ifdef CAST_COUNT_STEPS
        hits.kind |= lane_min_int(v_gather_int(b->states.steps, ray), (vint)(KARST_STEPS_MAX)) << KARST_STEPS_SHIFT;
#endif
        /* lists are longer than what they hold */
        hits.brick = v_select(m, v_load_int(found->brick + i), (vint)((int)KARST_NONE));
        hits.node = v_load_int(found->node + i);
        const vint cell = v_select(m, v_load_int(found->cell + i), (vint)(0));
        vector3 at;
        at.x = lane_unit(k_fma(s, v_load_float(found->step[0] + i), v_load_float(found->at[0] + i)));
        at.y = lane_unit(k_fma(s, v_load_float(found->step[1] + i), v_load_float(found->at[1] + i)));
        at.z = lane_unit(k_fma(s, v_load_float(found->step[2] + i), v_load_float(found->at[2] + i)));
        hits.place =
            in_64ths(cell & 255, at.x) | in_64ths(cell >> 8 & 255, at.y) << 10 | in_64ths(cell >> 16 & 255, at.z) << 20;
        vfloat weight = (vfloat)(0.0f);
        if (!from_anchor)
            hits.kind |= v_ge(slopes_of(b, ray), (vfloat)(b->blend_below)) & (int)KARST_HIT_UNBLENDED;
        if (view->blend > 0.0f)
            weight = v_select(
                v_eq(hits.kind & (int)(0xffu | KARST_HIT_UNBLENDED), (vint)((int)KARST_HIT_SURFACE)),
                level_weight(view->blend, footprints_of(b, from_anchor, ray, hits.t), hits.kind >> 8 & 0xff), weight);
        const vint missing = find_normals(&source, hits.brick, hits.node, cell, &at, weight, &hits.normal);
        if (!any_hit) {
            const vector3 step = {v_load_float(found->step[0] + i), v_load_float(found->step[1] + i),
                                  v_load_float(found->step[2] + i)};
            turn_to_rays(v_ne(hits.brick, (vint)((int)KARST_NONE)), v_load_float(found->f[0] + i),
                         v_load_float(found->f[1] + i), &at, &step, &hits.normal);
        }
        hits.kind |= missing & (int)KARST_HIT_UNBLENDED;
        store_hits(records, &hits, v_select(m, ray, (vint)(BEAM_RAYS)));
    }
    for (int p = 0; p < BEAM_PACKETS; p++) {
        const uint misses = valid[p] & ~b->states.done[p];
        if (!misses)
            continue;
        hits.t = start[from_anchor ? 0 : p].t_end;
        hits.kind = bits_mask(b->states.incomplete[p]) & (int)KARST_HIT_INCOMPLETE;
#ifdef CAST_COUNT_STEPS
        hits.kind |= lane_min_int(v_load_int(b->states.steps + p * LANES), (vint)(KARST_STEPS_MAX))
                     << KARST_STEPS_SHIFT;
#endif
        hits.brick = hits.place = hits.node = (vint)(0);
        hits.normal.x = hits.normal.y = hits.normal.z = (vfloat)(0.0f);
        store_hits(records, &hits, v_select(bits_mask(misses), V_LANE + p * LANES, (vint)(BEAM_RAYS)));
    }
    for (int p = 0; p < BEAM_PACKETS; p++)
        send_hits(out, records + p * LANES, index + p * LANES, valid[p]);
#if LANES == 16 && defined(__SSE2__)
    __builtin_ia32_sfence(); /* such stores keep no order of their own */
#endif
}

#if BEAM_PACKETS > 1
/* Beams across a picture and down. */
#define BEAMS_(size_px, groups) (((uint)(size_px) + KARST_GROUP_SIDE * (groups)-1) / (KARST_GROUP_SIDE * (groups)))
#define BEAMS_ACROSS(width_px) BEAMS_(width_px, KARST_BEAM_ACROSS)
#define BEAMS_DOWN(height_px) BEAMS_(height_px, KARST_BEAM_DOWN)
#endif

/* The pixels of packet p of a beam, and which of them lie in the picture. */
RAY_INLINE vint beam_pixels(uint beam_number, int p, int width_px, int height_px, vint *x, vint *y)
{
#if BEAM_PACKETS > 1
    const uint across = BEAMS_ACROSS(width_px), groups_across = BEAMS_(width_px, 1), groups_down = BEAMS_(height_px, 1);
    const uint group = (uint)p / KARST_GROUP_PACKETS;
    const uint column = beam_number % across * KARST_BEAM_ACROSS + group % KARST_BEAM_ACROSS,
               row = beam_number / across * KARST_BEAM_DOWN + group / KARST_BEAM_ACROSS;
    const bool is_there = column < groups_across && row < groups_down;
    vint m = packet_pixels((is_there ? row * groups_across + column : 0u) * KARST_GROUP_PACKETS +
                               (uint)p % KARST_GROUP_PACKETS,
                           width_px, height_px, x, y);
    return is_there ? m : (vint)(0);
#else
    return packet_pixels(beam_number, width_px, height_px, x, y);
#endif
}

/* The beam of a picture that is cast at turn `turn`: they come down strips of so many rows, column by column, so that
 * what a beam's neighbours have read is still near. */
#define STRIP_BEAMS 2u
RAY_INLINE uint beam_at_turn(uint turn, int width_px, int height_px)
{
#if BEAM_PACKETS > 1
    const uint across = BEAMS_ACROSS(width_px), down = BEAMS_DOWN(height_px);
    const uint above = turn / (across * STRIP_BEAMS) * STRIP_BEAMS, in_strip = turn % (across * STRIP_BEAMS);
    const uint rows = down - above < STRIP_BEAMS ? down - above : STRIP_BEAMS;
    return (above + in_strip % rows) * across + in_strip / rows;
#else
    return turn;
#endif
}

/* What a work-item notes about its packets. */
typedef struct {
    beam_bits packets;  /* that are to be cast */
    K_GLOBAL uint *who; /* two words: packets that want something; 0: nobody wants to know */
} packet_notes;

RAY_INLINE vint is_to_cast(const packet_notes *notes, int p) { return (vint)(-(int)(notes->packets >> p & 1)); }

RAY_INLINE void note_packets(const packet_notes *notes, const beam *b)
{
#if BEAM_PACKETS > 1
    if (notes->who) {
        notes->who[0] = (uint)b->asked;
        notes->who[1] = (uint)(b->asked >> 32);
    }
#endif
}

/* Finds where this work-item notes that it wants something, and what it noted last; 0: it need not be cast. All words
 * of the first kind stand before those of the second. */
RAY_INLINE int begin_notes(pools *pool, K_GLOBAL const karst_cast_view *view, uint notes, packet_notes *of_packets)
{
    of_packets->packets = ~(beam_bits)0;
    of_packets->who = 0;
    if (notes == KARST_CAST_NOTES_NOTHING)
        return 1;
    pool->asked += 1 + get_global_id(0);
#if BEAM_PACKETS > 1
    of_packets->who = pool->asked + get_global_size(0) + get_global_id(0);
#endif
    if (notes != KARST_CAST_WHO_ASKED)
        return 1;
    if (*pool->asked != view->serial)
        return 0;
    *pool->asked = 0;
#if BEAM_PACKETS > 1
    of_packets->packets = of_packets->who[0] | (beam_bits)of_packets->who[1] << 32;
#endif
    return 1;
}

/* Entries are thin: PoCL compiles an entry, and whatever it takes in, three times; and it takes in what asks for the
 * work-item's number or how many there are. hits 0: nobody wants to know. */
BEAM_FUNCTION void cast_pinhole_beam(const pools *pool, K_GLOBAL const karst_cast_view *view,
                                     const karst_pinhole *pinhole, uint turn, uint num_turns, const packet_notes *notes,
                                     K_GLOBAL karst_hit *hits, K_GLOBAL karst_beam_hints *hints, uint num_slots)
{
    const uint beam_number = beam_at_turn(turn, pinhole->width_px, pinhole->height_px);
    const pools own = *pool; /* which no store can change */
    const vfloat zero = (vfloat)(0.0f);
    const vector3 origin = {zero, zero, zero};
    beam b;
    packet_start start[BEAM_PACKETS];
    int index[BEAM_RAYS];
    uint valid[BEAM_PACKETS];
    for (int p = 0; p < BEAM_PACKETS; p++) {
        vint x, y;
        vint m = beam_pixels(beam_number, p, pinhole->width_px, pinhole->height_px, &x, &y) & is_to_cast(notes, p);
        const ray_lanes rays = {
            origin, pinhole_direction(pinhole, x, y), (vfloat)(pinhole->t_min), (vfloat)(pinhole->t_max),
            zero,   (vfloat)(pinhole->cone)};
        start_packet(&b, &start[p], p, view, 1, 0, &rays, m);
        v_store_int(packet_order(x, y, pinhole->width_px, pinhole->height_px), index + p * LANES);
        valid[p] = mask_bits(m);
    }
    begin_hints(&b.hints, &own.bricks, hints, num_slots, turn, num_turns, view->serial);
    b.found.only_whether = 0;
    cast_beam(&own, view, 1, 0, &b, start);
    note_packets(notes, &b);
    if (hits)
        store_beam(&own, view, hits, &b, start, index, valid, 1, 0);
    end_hints(&b.hints);
}

__kernel K_WIDE void cast_pinhole(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_pinhole pinhole,
                                  K_GLOBAL karst_hit *hits, uint notes, K_GLOBAL karst_beam_hints *hints,
                                  uint num_slots)
{
    pools pool = POOL_FIELDS;
    packet_notes of_packets;
    if (!begin_notes(&pool, view, notes, &of_packets))
        return;
    cast_pinhole_beam(&pool, view, &pinhole, (uint)get_global_id(0), (uint)get_global_size(0), &of_packets, hits, hints,
                      num_slots);
}

#ifndef CAST_NO_STREAMS
/* Field `word` of the rays in the lanes, as floats. */
#define RAY_WORD(word) v_gather_float(words, first + (word))

/* A word for each ray of a beam: whether it ended. */
RAY_INLINE void mark_ended(K_GLOBAL int *marks, const beam *b, const int index[BEAM_RAYS],
                           const uint valid[BEAM_PACKETS])
{
    for (int p = 0; p < BEAM_PACKETS; p++)
        for (uint left = valid[p]; left; left &= left - 1u) {
            const uint lane = (uint)k_popcount((left & (0u - left)) - 1u);
            marks[index[p * LANES + (int)lane]] = (int)(b->states.done[p] >> lane & 1u);
        }
}

/* Where rays of a stream note that they lacked something: a word for each pixel of a picture, in packet order. */
typedef struct {
    K_GLOBAL uint *words; /* 0: nobody wants to know */
    uint width_px, height_px;
} lacking_notes;

/* For all rays of packets that asked for something: each of these may have. */
RAY_INLINE void note_lacking(const lacking_notes *lacking, K_GLOBAL const karst_ray *rays, beam_bits asked,
                             const int index[BEAM_RAYS], const packet_start start[BEAM_PACKETS])
{
#ifdef KARST_MUTANT_LACKING /* for a test: as if nothing had */
    asked = 0;
#endif
    for (; asked; asked &= asked - 1) {
        const uint p = FIRST_PACKET(asked);
        for (uint left = mask_bits(start[p].alive); left; left &= left - 1u) {
            const uint lane = (uint)k_popcount((left & (0u - left)) - 1u);
            const uint pixel = rays[index[p * LANES + lane]].pixel, x = KARST_RAY_X(pixel), y = KARST_RAY_Y(pixel);
            if (x < lacking->width_px && y < lacking->height_px)
                lacking->words[karst_packet_order(x, y, lacking->width_px, lacking->height_px)] |= 1u;
        }
    }
}

/* wanted: KARST_CAST_HITS and its like. Constant: from_anchor, where all start there with one footprint, and none has a
 * side. */
RAY_INLINE void cast_rays_of(const pools *pool, K_GLOBAL const karst_cast_view *view, K_GLOBAL const karst_ray *rays,
                             uint num_rays, uint wanted, uint beam_number, const int from_anchor,
                             K_GLOBAL karst_hit *hits, const lacking_notes *lacking)
{
    const pools own = *pool;
    beam b;
    packet_start start[BEAM_PACKETS];
    int index[BEAM_RAYS];
    uint valid[BEAM_PACKETS];
    for (int p = 0; p < BEAM_PACKETS; p++) {
        const uint lowest = (beam_number * BEAM_PACKETS + (uint)p) * LANES;
        vint at = V_LANE + (int)lowest;
        vint m = v_lt(at, (vint)((int)num_rays));
        valid[p] = mask_bits(m);
        v_store_int(at, index + p * LANES);
        /* from the packet's first ray, whose distance no int may hold in words */
        K_GLOBAL const float *words = (K_GLOBAL const float *)(rays + (valid[p] ? lowest : 0u));
        vint first = v_select(m, at - (int)lowest, (vint)(0)) * (int)(sizeof(karst_ray) / sizeof(float));
        const ray_lanes of = {{RAY_WORD(0), RAY_WORD(1), RAY_WORD(2)},
                              {RAY_WORD(4), RAY_WORD(5), RAY_WORD(6)},
                              RAY_WORD(3),
                              RAY_WORD(7),
                              RAY_WORD(8),
                              RAY_WORD(9)};
        start_packet(&b, &start[p], p, view, from_anchor, 0, &of, m);
        if (from_anchor)
            continue;
        const vint side = v_gather_int((K_GLOBAL const int *)words, first + 11);
        b.states.pending[p] = b.states.fresh[p] = mask_bits(m & v_ne(side, (vint)((int)KARST_SIDE_ANY)));
        b.states.back[p] = mask_bits(m & v_eq(side, (vint)((int)KARST_SIDE_BACK)));
        v_store_float(RAY_WORD(15), b.states.rise + p * LANES);
        v_store_float((vfloat)(0.0f), b.states.left + p * LANES);
    }
    begin_without_hints(&b.hints);
    b.blend_below = view->blend_below > 0.0f ? view->blend_below : 3.0e38f;
    b.found.only_whether = !hits || wanted == KARST_CAST_WHETHER;
    cast_beam(&own, view, from_anchor, 0, &b, start);
    if (lacking->words)
        note_lacking(lacking, rays, b.asked, index, start);
    if (hits && wanted == KARST_CAST_WHETHER)
        mark_ended((K_GLOBAL int *)hits, &b, index, valid);
    else if (hits)
        store_beam(&own, view, hits, &b, start, index, valid, from_anchor, wanted == KARST_CAST_ANY_HIT);
}

BEAM_FUNCTION void cast_rays_beam(const pools *pool, K_GLOBAL const karst_cast_view *view,
                                  K_GLOBAL const karst_ray *rays, uint num_rays, uint wanted, uint beam_number,
                                  K_GLOBAL karst_hit *hits, const lacking_notes *lacking)
{
    cast_rays_of(pool, view, rays, num_rays, wanted, beam_number, 0, hits, lacking);
}

/* count: how many there are, of num_rays at most; 0: as many. hits 0: nobody wants to know. lacking and the size: see
 * lacking_notes. */
__kernel K_WIDE void cast_rays(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, K_GLOBAL const karst_ray *rays,
                               uint num_rays, uint wanted, K_GLOBAL karst_hit *hits, K_GLOBAL const uint *count,
                               K_GLOBAL uint *lacking, uint width_px, uint height_px)
{
    const pools pool = POOL_FIELDS;
    const lacking_notes notes = {lacking, width_px, height_px};
    const uint beam_number = (uint)get_global_id(0);
    if (count && *count < num_rays)
        num_rays = *count;
    if (beam_number < (num_rays + BEAM_RAYS - 1) / BEAM_RAYS)
        cast_rays_beam(&pool, view, rays, num_rays, wanted, beam_number, hits, &notes);
}

#ifdef CAST_FROM_ANCHOR
BEAM_FUNCTION void cast_anchored_beam(const pools *pool, K_GLOBAL const karst_cast_view *view,
                                      K_GLOBAL const karst_ray *rays, uint num_rays, uint beam_number,
                                      K_GLOBAL karst_hit *hits)
{
    const lacking_notes nowhere = {0, 0, 0};
    cast_rays_of(pool, view, rays, num_rays, KARST_CAST_HITS, beam_number, 1, hits, &nowhere);
}

__kernel K_WIDE void cast_rays_from_anchor(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view,
                                           K_GLOBAL const karst_ray *rays, uint num_rays, K_GLOBAL karst_hit *hits)
{
    const pools pool = POOL_FIELDS;
    const uint beam_number = (uint)get_global_id(0);
    if (beam_number < (num_rays + BEAM_RAYS - 1) / BEAM_RAYS)
        cast_anchored_beam(&pool, view, rays, num_rays, beam_number, hits);
}
#endif

#endif

#ifndef CAST_NO_SHADOWS
/* Writes the dark colour of a packet's rays that ended; their pixels may not be readable. */
#if LANES == 16
#define DARKEN_(l) \
    if (ended.l)   \
        pixels[at.l] = (uint)dark.l;
RAY_INLINE void darken(K_GLOBAL uint *pixels, vint at, vint dark, vint ended){EACH_LANE(DARKEN_)}
#else
RAY_INLINE void darken(K_GLOBAL uint *pixels, vint at, vint dark, vint ended)
{
    if (ended)
        pixels[at] = (uint)dark;
}
#endif

/* With CAST_SUN_DISC each ray goes to a place of its own on the sun. */
#ifdef CAST_SUN_DISC
#define ONE_SUN 0
#include "raycast/cast/sun.clh"
#else
#define ONE_SUN 1
#endif

BEAM_FUNCTION
void cast_shadow_beam(const pools *pool, K_GLOBAL const karst_cast_view *view, const karst_shadow_sun *sun,
                      K_GLOBAL const float *rays, uint turn, uint num_turns, const packet_notes *notes,
                      K_GLOBAL uint *pixels, K_GLOBAL karst_beam_hints *hints, uint num_slots)
{
    const uint beam_number = beam_at_turn(turn, sun->width_px, sun->height_px);
    const pools own = *pool;
    const size_t plane = (size_t)sun->width_px * (size_t)sun->height_px;
    const vfloat zero = (vfloat)(0.0f);
    const vector3 centre = {(vfloat)(sun->direction[0]), (vfloat)(sun->direction[1]), (vfloat)(sun->direction[2])};
    beam b;
    packet_start start[BEAM_PACKETS];
    uint casts = 0;
    for (int p = 0; p < BEAM_PACKETS; p++) {
        vint x, y, valid = beam_pixels(beam_number, p, sun->width_px, sun->height_px, &x, &y);
        vint order = packet_order(x, y, sun->width_px, sun->height_px);
        vfloat width = load_ordered(rays + KARST_SHADOW_WIDTH * plane, order, valid);
        vint m = valid & v_gt(width, zero) & is_to_cast(notes, p);
        vector3 origin = {zero, zero, zero};
        vfloat rise = zero;
        if (v_any(m)) {
            rise = load_ordered(rays + KARST_SHADOW_RISE * plane, order, valid);
            origin.x = load_ordered(rays + KARST_SHADOW_ORIGIN * plane, order, valid);
            origin.y = load_ordered(rays + (KARST_SHADOW_ORIGIN + 1) * plane, order, valid);
            origin.z = load_ordered(rays + (KARST_SHADOW_ORIGIN + 2) * plane, order, valid);
            casts = 1;
        }
#ifdef CAST_SUN_DISC
        if (sun->of_stream) {
            const vint pixel = v_as_int(load_ordered(rays + KARST_SHADOW_DARK * plane, order, valid));
            x = pixel & 0xffff;
            y = pixel >> 16 & 0x7fff;
        }
        const vector3 direction = sun->sample ? towards_disc(sun, x, y) : centre;
#else
        const vector3 direction = centre;
#endif
        const ray_lanes of = {origin, direction, zero, (vfloat)(sun->t_max), width, (vfloat)(sun->cone)};
        start_packet(&b, &start[p], p, view, 0, ONE_SUN, &of, m);
        v_store_float(rise, b.states.rise + p * LANES);
    }
    if (!casts)
        return;
    begin_hints(&b.hints, &own.bricks, hints, num_slots, turn, num_turns, view->serial);
    b.found.only_whether = 1;
    b.blend_below = 3.0e38f;
    cast_beam(&own, view, 0, ONE_SUN, &b, start);
    note_packets(notes, &b);
    end_hints(&b.hints);
    for (int p = 0; p < BEAM_PACKETS && pixels; p++)
        if (b.states.done[p]) {
            vint x, y, valid = beam_pixels(beam_number, p, sun->width_px, sun->height_px, &x, &y);
            vint order = packet_order(x, y, sun->width_px, sun->height_px);
            vfloat dark = load_ordered(rays + KARST_SHADOW_DARK * plane, order, valid);
            darken(pixels, y * sun->width_px + x, v_as_int(dark), bits_mask(b.states.done[p]));
        }
}

/* Shadow rays of a picture: raycast/shadow_shared.h. Once more they leave its pixels alone. */
__kernel K_WIDE void cast_shadows(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_shadow_sun sun,
                                  K_GLOBAL const float *rays, K_GLOBAL uint *pixels, uint notes,
                                  K_GLOBAL const karst_sunward_brick *sunward, K_GLOBAL karst_beam_hints *hints,
                                  uint num_slots)
{
    pools pool = POOL_FIELDS;
    packet_notes of_packets;
    if (!begin_notes(&pool, view, notes, &of_packets))
        return;
    pool.sunward = sunward;
    cast_shadow_beam(&pool, view, &sun, rays, (uint)get_global_id(0), (uint)get_global_size(0), &of_packets,
                     notes == KARST_CAST_WHO_ASKED ? 0 : pixels, hints, num_slots);
}
#endif

/* Slots from `first` to `end` that are some node's and were not looked at since they were written; LANES for each
 * work-item. */
__kernel K_WIDE void survey_slopes(K_GLOBAL const karst_brick_owner *owners, K_GLOBAL karst_brick_info *brick_info,
                                   BRICK_PARAMETERS, uint first, uint end)
{
    const brick_pool bricks = BRICK_FIELDS;
    const uint from = first + (uint)get_global_id(0) * LANES;
    for (uint slot = from; slot < from + LANES && slot < end; slot++)
        if (slot != KARST_NONE && owners[slot].owner != KARST_NO_NODE &&
            !(brick_info[slot].slopes[1] & KARST_SLOPES_KNOWN))
            survey_slopes_of(brick_samples(&bricks, slot), brick_info + slot);
}
