/* Survey: a pass over all stamps. A work-item goes through one chunk of KARST_CHUNK entries, counts, and lists what it
 * finds at the chunk's own place; then one work-group puts the pieces together. No atomics, and order is kept. */
#include "cache/survey_shared.h"
#include "core/lanes.clh"

/* A bit for each lane. */
#ifdef V_ANY_BY_MASK
K_INLINE K_WIDE uint bits_of(vint mask) { return (uint)(ushort)__builtin_ia32_cvtd2mask512(mask); }
#elif LANES == 16
static uint bits_of(vint mask)
{
    int16 bits = mask & ((int16)(1) << V_LANE);
    int8 a = bits.lo | bits.hi;
    int4 b = a.lo | a.hi;
    int2 c = b.lo | b.hi;
    return (uint)(c.x | c.y);
}
#else
static uint bits_of(vint mask) { return (uint)mask & 1u; }
#endif

static uint lanes_total(vint v)
{
#if LANES == 16
    int8 a = v.lo + v.hi;
    int4 b = a.lo + a.hi;
    int2 c = b.lo + b.hi;
    return (uint)(c.x + c.y);
#else
    return (uint)v;
#endif
}

static vint equal(__global const int *stamps, uint serial) { return v_eq(v_load_int(stamps), (vint)((int)serial)); }

/* Casts since a stamp; of never, the most. */
static vuint ages_of(__global const int *stamps, uint serial)
{
    vint stamp = v_load_int(stamps);
    return v_select(v_eq(stamp, (vint)(0)), (vuint)(0xffffffffu), (vuint)(serial)-v_as_uint(stamp));
}

static uint age_of(int a, int b, uint serial)
{
    uint x = karst_survey_age((uint)a, serial), y = karst_survey_age((uint)b, serial);
    return k_min(x, y);
}

static uint num_chunks_of(uint num) { return (num + KARST_CHUNK - 1) / KARST_CHUNK; }

/* Of each chunk one count of what is in use (or, of request chunks, has a want), then one of what was found. */
static uint counts_at(uint kind, karst_survey_ask ask)
{
    uint at = 0;
    for (uint k = 0; k < kind; k++)
        at += 2 * num_chunks_of(ask.num[k]);
    return at;
}

/* One chunk of slots; a and b are both stamps, of tiles the same one. */
static void survey_slots(__global const int *a, __global const int *b, uint begin, uint end, karst_survey_ask ask,
                         uint least_age, bool stand_ins, __global uint *counts, __global karst_survey_slot *found)
{
    vint used = (vint)(0);
    uint num_used = 0, at = begin, i = begin;
    for (; i + LANES <= end; i += LANES) {
        vint as_asked = equal(a + i, ask.serial), as_any = as_asked | equal(b + i, ask.serial), fits;
        used -= as_any;
        if (least_age == 0u)
            continue;
        if (stand_ins) {
            fits = as_any & ~as_asked;
        } else {
            vuint x = ages_of(a + i, ask.serial), y = ages_of(b + i, ask.serial);
            fits = v_ge(v_min(x, y), (vuint)(least_age));
        }
        if (!v_any(fits))
            continue;
        for (uint left = bits_of(fits); left; left &= left - 1) {
            uint slot = i + 31 - clz(left & -left);
            karst_survey_slot one = {slot, age_of(a[slot], b[slot], ask.serial)};
            found[at++] = one;
        }
    }
    for (; i < end; i++) {
        uint age = age_of(a[i], b[i], ask.serial);
        num_used += age == 0u;
        if (least_age == 0u || !(stand_ins ? age == 0u && a[i] != (int)ask.serial : age >= least_age))
            continue;
        karst_survey_slot one = {i, age};
        found[at++] = one;
    }
    counts[0] = num_used + lanes_total(used);
    counts[1] = at - begin;
}

static void survey_requests(__global const int *want_chunk, uint begin, uint end, uint serial, __global uint *counts,
                            __global uint *active)
{
    uint at = begin, i = begin;
    for (; i + LANES <= end; i += LANES) {
        vint asked = equal(want_chunk + i, serial);
        if (!v_any(asked))
            continue;
        for (uint left = bits_of(asked); left; left &= left - 1)
            active[at++] = i + 31 - clz(left & -left);
    }
    for (; i < end; i++)
        if (want_chunk[i] == (int)serial)
            active[at++] = i;
    counts[0] = at - begin;
    counts[1] = 0;
}

__kernel void karst_survey(__global const int *tile_stamp, __global const int *brick_stamp,
                           __global const int *brick_fallback, __global const int *want_chunk, karst_survey_ask ask,
                           __global uint *counts, __global karst_survey_slot *tiles, __global karst_survey_slot *bricks,
                           __global uint *active)
{
    uint chunk = (uint)get_global_id(0), kind = 0;
    while (kind < KARST_SURVEY_KINDS && chunk >= num_chunks_of(ask.num[kind]))
        chunk -= num_chunks_of(ask.num[kind++]);
    if (kind == KARST_SURVEY_KINDS)
        return;
    uint begin = chunk * KARST_CHUNK, end = min(ask.num[kind], begin + KARST_CHUNK);
    counts += counts_at(kind, ask) + 2 * chunk;
    if (kind == KARST_SURVEY_TILES)
        survey_slots(tile_stamp, tile_stamp, begin, end, ask, ask.ages[0], false, counts, tiles);
    else if (kind == KARST_SURVEY_BRICKS)
        survey_slots(brick_stamp, brick_fallback, begin, end, ask, ask.ages[1], ask.stand_ins, counts, bricks);
    else
        survey_requests(want_chunk, begin, end, ask.serial, counts, active);
}

/* Puts the chunks' lists together; one work-group, of which a lane goes through a row of chunks. */
__kernel __attribute__((reqd_work_group_size(KARST_SCAN_WIDTH, 1, 1))) void
karst_survey_pack(karst_survey_ask ask, __global const uint *counts, __global const karst_survey_slot *tiles,
                  __global const karst_survey_slot *bricks, __global const uint *active,
                  __global karst_survey_slot *packed_tiles, __global karst_survey_slot *packed_bricks,
                  __global uint *packed_active, __global karst_survey_result *result)
{
    __local uint used[KARST_SURVEY_KINDS][KARST_SCAN_WIDTH], found[KARST_SURVEY_KINDS][KARST_SCAN_WIDTH];
    uint lane = (uint)get_local_id(0);
    for (uint kind = 0; kind < KARST_SURVEY_KINDS; kind++) {
        uint num = num_chunks_of(ask.num[kind]), share = (num + KARST_SCAN_WIDTH - 1) / KARST_SCAN_WIDTH;
        __global const uint *row = counts + counts_at(kind, ask);
        uint num_used = 0, num_found = 0;
        for (uint i = min(num, lane * share), end = min(num, (lane + 1) * share); i < end; i++) {
            num_used += row[2 * i];
            num_found += row[2 * i + 1];
        }
        used[kind][lane] = num_used;
        found[kind][lane] = num_found;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint kind = lane; kind < KARST_SURVEY_KINDS; kind += KARST_SCAN_WIDTH) {
        uint num_used = 0, num_found = 0;
        for (uint i = 0; i < KARST_SCAN_WIDTH; i++) {
            uint own_used = used[kind][i], own_found = found[kind][i];
            used[kind][i] = num_used;
            found[kind][i] = num_found;
            num_used += own_used;
            num_found += own_found;
        }
        if (kind == KARST_SURVEY_REQUESTS) {
            result->num_active = num_used;
        } else {
            result->num_used[kind] = num_used;
            result->num_found[kind] = num_found;
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint kind = 0; kind < KARST_SURVEY_KINDS; kind++) {
        uint num = num_chunks_of(ask.num[kind]), share = (num + KARST_SCAN_WIDTH - 1) / KARST_SCAN_WIDTH;
        __global const uint *row = counts + counts_at(kind, ask);
        uint at = kind == KARST_SURVEY_REQUESTS ? used[kind][lane] : found[kind][lane];
        for (uint i = min(num, lane * share), end = min(num, (lane + 1) * share); i < end; i++) {
            uint from = i * KARST_CHUNK;
            if (kind == KARST_SURVEY_REQUESTS)
                for (uint left = row[2 * i]; left > 0; left--)
                    packed_active[at++] = active[from++];
            else if (kind == KARST_SURVEY_TILES)
                for (uint left = row[2 * i + 1]; left > 0; left--)
                    packed_tiles[at++] = tiles[from++];
            else
                for (uint left = row[2 * i + 1]; left > 0; left--)
                    packed_bricks[at++] = bricks[from++];
        }
    }
}
