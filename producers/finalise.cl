/* Finalise: samples in staging memory become a constant or clear node or a brick. KARST_GROUP work-items share a
 * brick (1: the CPU shape); whatever the shape, results are maxima, counts and bit masks, which do not depend on the
 * order. */
#include "core/lanes.clh"
#include "producers/finalise_shared.h"

#define ROW KARST_BRICK_SIDE
#define PLANE (KARST_BRICK_SIDE * KARST_BRICK_SIDE)
#if KARST_GROUP == 1
#define LOCAL_ID 0 /* not asked for: what asks is inlined wherever it is called */
#else
#define LOCAL_ID ((int)get_local_id(0))
#endif
#define NUM_GROUP_CELLS 7
/* The fine mask lies behind the samples. */
#define SLOT_SAMPLES (SLOT_STRIDE + KARST_FINE_BYTES * 8 / KARST_BRICK_BITS)

#if KARST_GROUP == 1
#define FINALISE_CALL static __attribute__((noinline)) K_WIDE
#else
#define FINALISE_CALL K_INLINE K_WIDE /* barriers stand in entries */
#endif

#if LANES == 1
#define LOAD_Q(p) ((float)*(p))
#define STORE_Q(q, p) (*(p) = (karst_brick_sample)(q))
#elif KARST_BRICK_BITS == 32
#define LOAD_Q(p) vload16(0, p)
#define STORE_Q(q, p) v_store_float(q, p)
#else
#define LOAD_Q(p) convert_float16(vload16(0, p))
#if KARST_BRICK_BITS == 16
typedef short16 loose_q __attribute__((aligned(2))); /* one store, see lanes.clh */
#define STORE_Q(q, p) (*(K_GLOBAL loose_q *)(p) = convert_short16(q))
#else
typedef char16 loose_q __attribute__((aligned(1)));
#define STORE_Q(q, p) (*(K_GLOBAL loose_q *)(p) = convert_char16(q))
#endif
#endif
#if KARST_BRICK_BITS == 32
#define ROUND_Q(q) (q)
#else
#define ROUND_Q(q) k_rint(q)
#endif

/* A value of each work-item becomes one of the group. The group's cells start at 0 and each is used once. */
#if KARST_GROUP == 1
#define group_max(value, cell) (value)
#define group_sum(value, cell) (value)
#define group_or(value, cell) (value)
#define GROUP_BARRIER()
#else
#define GROUP_BARRIER() barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
K_INLINE uint group_max(uint value, __local uint *cell)
{
    atomic_max(cell, value);
    GROUP_BARRIER();
    return *cell;
}
K_INLINE uint group_sum(uint value, __local uint *cell)
{
    atomic_add(cell, value);
    GROUP_BARRIER();
    return *cell;
}
K_INLINE uint group_or(uint value, __local uint *cell)
{
    atomic_or(cell, value);
    GROUP_BARRIER();
    return *cell;
}
#endif
#define group_min(value, cell) (~group_max(~(value), cell))
/* Floats >= 0 are in the order of their bits. */
#define group_max_float(value, cell) k_as_float(group_max(k_as_uint(value), cell))
#define group_min_float(value, cell) k_as_float(group_min(k_as_uint(value), cell))

#define ANY_SOLID 1u
#define ANY_AIR 2u

typedef struct {
    float least, largest; /* |d| */
    uint sides;           /* ANY_* */
    uint num_scrubbed, first_scrubbed;
} sample_survey;

/* The words of a fine mask while it is made: the work-item's own, or the group's. */
#if KARST_GROUP == 1
#define FINE_SPACE
#define mark_fine(word, bits) (*(word) |= (bits))
#else
#define FINE_SPACE __local
#define mark_fine(word, bits) atomic_or(word, bits)
#endif

/* Scrubs the samples and finds least, largest and sides. */
K_INLINE K_WIDE void survey_samples(K_GLOBAL float *samples, sample_survey *survey)
{
    vfloat least = (vfloat)(INFINITY), lowest = (vfloat)(INFINITY), highest = (vfloat)(-INFINITY);
    uint num_scrubbed = 0, first_scrubbed = KARST_NO_SAMPLE;

    for (int first = LOCAL_ID * LANES; first < KARST_BRICK_SAMPLES; first += KARST_GROUP * LANES) {
        vfloat d = v_load_float(samples + first);
        if (first + LANES > KARST_BRICK_SAMPLES) /* past the last sample, the first of these again */
            d = v_select(v_lt((vint)(first) + V_LANE, (vint)(KARST_BRICK_SAMPLES)), d, (vfloat)(samples[first]));
        vint bad = ~v_lt(k_fabs(d), (vfloat)(INFINITY));
        if (v_any(bad)) {
            int lanes[LANES];
            d = v_select(bad, (vfloat)(KARST_SCRUBBED), d);
            v_store_float(d, samples + first);
            v_store_int(bad, lanes);
            for (int lane = 0; lane < LANES && first + lane < KARST_BRICK_SAMPLES; lane++) {
                num_scrubbed += lanes[lane] ? 1u : 0u;
                first_scrubbed = lanes[lane] ? min(first_scrubbed, (uint)(first + lane)) : first_scrubbed;
            }
        }
        least = v_min(least, k_fabs(d));
        lowest = v_min(lowest, d);
        highest = v_max(highest, d);
    }
    float low = v_min_across(lowest), high = v_max_across(highest);
    survey->least = v_min_across(least);
    survey->largest = k_fabs(k_max(high, -low));
    survey->sides = (high > 0.0f ? ANY_SOLID : 0u) | (low <= 0.0f ? ANY_AIR : 0u);
    survey->num_scrubbed = num_scrubbed;
    survey->first_scrubbed = first_scrubbed;
}

/* A row of cells from x, in pairs: bit i of a row of the fine mask tells whether pair i has a lane on. */
K_INLINE K_WIDE uint pair_bits(vint on, int x)
{
#if LANES == 16
    int8 pairs = on.even | on.odd;
#if defined(__AVX512VL__) && defined(__AVX512DQ__)
    return (uint)(uchar)__builtin_ia32_cvtd2mask256(pairs);
#else
    int8 bits = pairs & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    int4 fours = bits.lo | bits.hi;
    return (uint)(fours.x | fours.y | fours.z | fours.w);
#endif
#else
    return on ? 1u << x / KARST_FINE_CELLS : 0u;
#endif
}

/* The block mask that follows from a fine one. */
K_INLINE void blocks_of_fine(const FINE_SPACE uint *fine, uint blocks[2])
{
    blocks[0] = blocks[1] = 0u;
    for (int word = 0; word < KARST_FINE_WORDS; word++) {
        uint rows = (fine[word] | fine[word] >> 8) & 0x00ff00ffu; /* two of blocks, eight bits each, then four */
        rows = (rows | rows >> 1) & 0x00550055u;
        rows = (rows | rows >> 1) & 0x00330033u;
        rows = (rows | rows >> 2) & 0x000f000fu;
        blocks[word >> 3] |= ((rows | rows >> 12) & 0xffu) << ((word & 1) * 8 + (word >> 2 & 1) * 16);
    }
}

/* Cells are walked in columns of x and z, LANES neighbours in x at a time, up along y: each cell begins with what its
 * lower neighbour found of the four corners that they share. */
#define NUM_COLUMNS (KARST_BRICK_CELLS * KARST_BRICK_CELLS)

/* The least and largest of four corners of a cell at one height. */
typedef struct {
    vfloat low, high;
} corner_survey;

K_INLINE K_WIDE corner_survey survey_corners(K_GLOBAL const float *corner)
{
    vfloat d00 = v_load_float(corner), d10 = v_load_float(corner + 1);
    vfloat d01 = v_load_float(corner + PLANE), d11 = v_load_float(corner + PLANE + 1);
    corner_survey survey;
    survey.low = v_min(v_min(d00, d10), v_min(d01, d11));
    survey.high = v_max(v_max(d00, d10), v_max(d01, d11));
    return survey;
}

/* The surface cells (corners on both sides): marks them in the fine mask, whose words start at 0, and returns the
 * largest |d| at a corner of one. */
K_INLINE K_WIDE float survey_surface(K_GLOBAL const float *samples, FINE_SPACE uint *fine)
{
    vfloat reach = (vfloat)(0.0f);

    for (int column = LOCAL_ID * LANES; column < NUM_COLUMNS; column += KARST_GROUP * LANES) {
        int x = column % KARST_BRICK_CELLS, z = column / KARST_BRICK_CELLS;
        K_GLOBAL const float *corner = samples + z * PLANE + x;
        corner_survey below = survey_corners(corner);
        for (int y = 0; y < KARST_BRICK_CELLS; y++) {
            corner_survey above = survey_corners(corner + (y + 1) * ROW);
            vfloat low = v_min(below.low, above.low), high = v_max(below.high, above.high);
            vint mixed = v_gt(high, (vfloat)(0.0f)) & ~v_gt(low, (vfloat)(0.0f));
            if (v_any(mixed)) {
                reach = v_select(mixed, v_max(reach, v_max(high, -low)), reach);
                const int row = y / KARST_FINE_CELLS + KARST_BRICK_CELLS / KARST_FINE_CELLS * (z / KARST_FINE_CELLS);
                mark_fine(fine + (row >> 2), pair_bits(mixed, x) << (row & 3) * 8);
            }
            below = above;
        }
    }
    return v_max_across(reach);
}

/* Samples to q: nearest, clamped, and never on the other side of zero. The padding at the end becomes whatever the
 * staging's holds. */
K_INLINE K_WIDE void encode_samples(K_GLOBAL const float *samples, float range, K_GLOBAL karst_brick_sample *slot)
{
#if KARST_BRICK_BITS == 32
    const float q_per_unit = 1.0f / karst_brick_scale(range, KARST_BRICK_BITS), most_q = range * q_per_unit;
#else
    const float most_q = karst_max_q(KARST_BRICK_BITS), q_per_unit = most_q / range;
#endif
    vfloat per_unit = (vfloat)(q_per_unit), most = (vfloat)(range);
    vfloat none = (vfloat)(0.0f), least = (vfloat)(karst_least_q(KARST_BRICK_BITS));

    for (int first = LOCAL_ID * LANES; first < KARST_BRICK_SAMPLES; first += KARST_GROUP * LANES) {
        vfloat d = v_load_float(samples + first);
        vfloat size = v_min(k_fabs(d), most);
        vfloat q = v_min(v_max(ROUND_Q(size * per_unit), least), (vfloat)(most_q));
        STORE_Q(v_select(v_gt(d, none), q, v_select(v_lt(d, none), -q, none)), slot + first);
    }
}

/* The square of the steepest slope of the interpolant of q, in q per cell.
 *
 * In a cell, each component of the trilinear interpolant's gradient is a weighted mean of the differences along the
 * four edges of that axis; so the largest of the four bounds it, and the three together bound the gradient's length. */
K_INLINE K_WIDE float survey_slope(K_GLOBAL const karst_brick_sample *slot)
{
    vfloat steepest = (vfloat)(0.0f);

    for (int column = LOCAL_ID * LANES; column < NUM_COLUMNS; column += KARST_GROUP * LANES) {
        int x = column % KARST_BRICK_CELLS, z = column / KARST_BRICK_CELLS;
        K_GLOBAL const karst_brick_sample *q = slot + z * PLANE + x;
        vfloat q00 = LOAD_Q(q), q10 = LOAD_Q(q + 1), q01 = LOAD_Q(q + PLANE), q11 = LOAD_Q(q + PLANE + 1);
        vfloat dx = v_max(k_fabs(q10 - q00), k_fabs(q11 - q01)), dz = v_max(k_fabs(q01 - q00), k_fabs(q11 - q10));
        for (int y = 0; y < KARST_BRICK_CELLS; y++) {
            q += ROW;
            vfloat p00 = LOAD_Q(q), p10 = LOAD_Q(q + 1), p01 = LOAD_Q(q + PLANE), p11 = LOAD_Q(q + PLANE + 1);
            vfloat ex = v_max(k_fabs(p10 - p00), k_fabs(p11 - p01)), ez = v_max(k_fabs(p01 - p00), k_fabs(p11 - p10));
            vfloat sy = v_max(v_max(k_fabs(p00 - q00), k_fabs(p10 - q10)), v_max(k_fabs(p01 - q01), k_fabs(p11 - q11)));
            vfloat sx = v_max(dx, ex), sz = v_max(dz, ez);
            steepest = v_max(steepest, k_fma(sx, sx, k_fma(sy, sy, sz * sz)));
            q00 = p00, q10 = p10, q01 = p01, q11 = p11;
            dx = ex, dz = ez;
        }
    }
    return v_max_across(steepest);
}

/* How a brick is looked at: see finalise_rows.clh for the other way. */
#if KARST_GROUP == 1 && defined(V_HAS_BITS)
#include "producers/finalise_rows.clh"
#define SURVEY_SAMPLES(samples, survey) survey_rows(samples, &solid, survey)
#define SURVEY_SURFACE(samples, fine) survey_surface_rows(samples, &solid, fine)
#define ENCODE_SAMPLES(samples, range, slot) encode_rows(samples, range, slot, &kept_q)
#define SURVEY_SLOPE(slot) survey_slope_rows(&kept_q)
#else
#define SURVEY_SAMPLES survey_samples
#define SURVEY_SURFACE survey_surface
#define ENCODE_SAMPLES encode_samples
#define SURVEY_SLOPE survey_slope
#endif

K_INLINE K_GLOBAL karst_brick_sample *slot_at(uint slot, uint bricks_per_segment, K_GLOBAL karst_brick_sample *b0,
                                        K_GLOBAL karst_brick_sample *b1, K_GLOBAL karst_brick_sample *b2,
                                        K_GLOBAL karst_brick_sample *b3, K_GLOBAL karst_brick_sample *b4,
                                        K_GLOBAL karst_brick_sample *b5, K_GLOBAL karst_brick_sample *b6,
                                        K_GLOBAL karst_brick_sample *b7)
{
    uint segment = slot / bricks_per_segment;
    K_GLOBAL karst_brick_sample *base = segment == 0   ? b0
                                  : segment == 1 ? b1
                                  : segment == 2 ? b2
                                  : segment == 3 ? b3
                                  : segment == 4 ? b4
                                  : segment == 5 ? b5
                                  : segment == 6 ? b6
                                                 : b7;
    return base + (ulong)(slot - segment * bricks_per_segment) * SLOT_SAMPLES;
}

/* The i-th load of a chunk, load first + i of the work, its samples the i-th of the staging memory. */
typedef struct {
    K_GLOBAL const karst_load *load;
    K_GLOBAL float *samples;
    K_GLOBAL uint *result;
    K_GLOBAL karst_scrub *scrub;
    K_GLOBAL karst_brick_info *info;
    K_GLOBAL karst_brick_sample *q;
    K_GLOBAL uint *fine;
} brick_places;

#if KARST_GROUP == 1
#define CELLS_ARGUMENT
#define CELLS
#else
#define CELLS_ARGUMENT , __local uint *cells
#define CELLS , cells
#endif

/* Not in the entry itself, which drivers compile several times over. */
FINALISE_CALL void finalise_brick(const brick_places *at CELLS_ARGUMENT)
{
    sample_survey survey;
#ifdef KARST_PRODUCERS_FINALISE_ROWS_CLH
    solid_bits solid;
    float_samples kept_q;
#endif
    SURVEY_SAMPLES(at->samples, &survey);
    float least = group_min_float(survey.least, cells + 0), largest = group_max_float(survey.largest, cells + 1);
    uint sides = group_or(survey.sides, cells + 2);
    karst_scrub scrub;
    scrub.count = group_sum(survey.num_scrubbed, cells + 3);
    scrub.first = group_min(survey.first_scrubbed, cells + 4);
    uint state =
        karst_state_from_samples(least, (sides & ANY_SOLID) != 0, (sides & ANY_AIR) != 0, scrub.count, at->load->doubt);
    int kept = at->load->keep && (state == KARST_STATE_CLEAR_AIR || state == KARST_STATE_CLEAR_SOLID);
    if (LOCAL_ID == 0) {
        *at->result = kept ? state | KARST_LOAD_KEPT : state;
        *at->scrub = scrub;
    }
    if (state != KARST_STATE_BRICK && !kept)
        return;

#if KARST_GROUP == 1
    uint fine[KARST_FINE_WORDS];
    for (int word = 0; word < KARST_FINE_WORDS; word++)
        fine[word] = 0u;
#else
    __local uint *fine = cells + NUM_GROUP_CELLS;
#endif
    float reach = group_max_float(SURVEY_SURFACE(at->samples, fine), cells + 5);
    float range = karst_brick_range(largest, kept ? largest : reach, KARST_BRICK_BITS);
    ENCODE_SAMPLES(at->samples, range, at->q);
    GROUP_BARRIER();
    float slope_squared = group_max_float(SURVEY_SLOPE(at->q), cells + 6);
    if (LOCAL_ID == 0) {
        karst_brick_info info = {karst_brick_scale(range, KARST_BRICK_BITS), karst_safe_cells(slope_squared), {0u, 0u}};
        blocks_of_fine(fine, info.blocks);
        *at->info = info;
        for (int word = 0; word < KARST_FINE_WORDS; word++)
            at->fine[word] = fine[word];
    }
}

/* One work-item adds what was scrubbed from `count` loads to the total, and remembers the first place. */
FINALISE_CALL void tally(K_GLOBAL const karst_load *loads, K_GLOBAL const karst_scrub *scrubs, uint count,
                         K_GLOBAL karst_scrub_total *total)
{
    for (uint i = 0; i < count; i++) {
        if (scrubs[i].count == 0)
            continue;
        if (total->count == 0) {
            int sample[3] = {(int)scrubs[i].first % ROW, (int)scrubs[i].first / ROW % ROW,
                             (int)scrubs[i].first / PLANE};
            for (int axis = 0; axis < 3; axis++)
                total->voxel[axis] = loads[i].origin[axis] + ((long)sample[axis] << loads[i].level);
            total->level = loads[i].level;
        }
        total->count += scrubs[i].count;
    }
}

/* Work-group i finalises load first + i of the work, whose samples are the i-th of the staging memory. A second launch,
 * with a `total` that is not NULL, adds up what the first scrubbed: a kernel of its own would cost a start of the
 * program another compilation. */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_GROUP, 1, 1))) void
karst_finalise_bricks(K_GLOBAL const karst_load *restrict loads, K_GLOBAL float *staging, uint first, uint count,
                      K_GLOBAL const uint *restrict load_slots, K_GLOBAL uint *restrict load_results,
                      K_GLOBAL karst_brick_info *restrict brick_info, K_GLOBAL karst_scrub *restrict scrubs,
                      K_GLOBAL karst_scrub_total *restrict total, uint bricks_per_segment,
                      K_GLOBAL karst_brick_sample *b0, K_GLOBAL karst_brick_sample *b1, K_GLOBAL karst_brick_sample *b2,
                      K_GLOBAL karst_brick_sample *b3, K_GLOBAL karst_brick_sample *b4, K_GLOBAL karst_brick_sample *b5,
                      K_GLOBAL karst_brick_sample *b6, K_GLOBAL karst_brick_sample *b7)
{
    uint brick = (uint)get_group_id(0);
#if KARST_GROUP > 1
    __local uint cells[NUM_GROUP_CELLS + KARST_FINE_WORDS];
#endif

    if (total) {
        if ((brick | (uint)LOCAL_ID) == 0u)
            tally(loads, scrubs, count, total);
        return;
    }
    if (brick >= count)
        return;
    if (loads[brick].state != KARST_STATE_UNKNOWN) {
        if (LOCAL_ID == 0) {
            karst_scrub none = {0u, KARST_NO_SAMPLE};
            load_results[first + brick] = loads[brick].state;
            scrubs[brick] = none;
        }
        return;
    }
#if KARST_GROUP > 1
    if (LOCAL_ID < NUM_GROUP_CELLS + KARST_FINE_WORDS)
        cells[LOCAL_ID] = 0u;
    GROUP_BARRIER();
#endif
    uint slot = load_slots[first + brick];
    brick_places at;
    at.load = loads + brick;
    at.samples = staging + (ulong)brick * STAGING_STRIDE + CHANNEL_DENSITY_STAGING;
    at.result = load_results + first + brick;
    at.scrub = scrubs + brick;
    at.info = brick_info + slot;
    K_GLOBAL karst_brick_sample *in_slot = slot_at(slot, bricks_per_segment, b0, b1, b2, b3, b4, b5, b6, b7);
    at.q = in_slot + CHANNEL_DENSITY_SLOT;
    at.fine = (K_GLOBAL uint *)(in_slot + SLOT_STRIDE);
    finalise_brick(&at CELLS);
}
