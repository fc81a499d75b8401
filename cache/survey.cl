/* Survey: a pass over all stamps. A work-item goes through one chunk of KARST_CHUNK entries, counts, and lists what it
 * finds at the chunk's own place; then one work-group puts the pieces together. No atomics, and order is kept. */
#include "cache/survey_shared.h"
#include "core/device/lanes.clh"

/* A bit for each lane. */
#ifdef V_HAS_BITS
K_INLINE K_WIDE uint bits_of(vint mask) { return (uint)v_bits(mask); }
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

/* Not used for so many casts; what never was is older than all. */
static vint is_old(vint stamp, uint serial, uint least_age)
{
    return v_ge((vuint)(serial)-v_as_uint(stamp), (vuint)(least_age)) | v_eq(stamp, (vint)(0));
}

static uint age_of(int a, int b, uint serial)
{
    uint x = karst_survey_age((uint)a, serial), y = karst_survey_age((uint)b, serial);
    return k_min(x, y);
}

static uint num_chunks_of(uint num) { return (num + KARST_CHUNK - 1) / KARST_CHUNK; }

/* Of each chunk: x what is in use (or, of request chunks, has a want), y what was found, z what of it is exactly of the
 * age. */
static uint counts_at(uint kind, karst_survey_ask ask)
{
    uint at = 0;
    for (uint k = 0; k < kind; k++)
        at += num_chunks_of(ask.num[k]);
    return at;
}

/* Lists slots i and on where `fits` says so, with their ages; returns how many. There is room for a whole vector. */
K_INLINE K_WIDE uint list_slots(vint fits, uint i, __global const int *a, __global const int *b, uint serial,
                                __global uint *slots, __global uint *ages)
{
    uint bits = bits_of(fits);
#ifdef V_HAS_PACK
    vint x = v_load_int(a), y = v_load_int(b), slot = (vint)((int)i) + V_LANE;
    vuint never = (vuint)(0xffffffffu);
    vuint x_age = v_select(v_eq(x, (vint)(0)), never, (vuint)(serial)-v_as_uint(x));
    vuint y_age = v_select(v_eq(y, (vint)(0)), never, (vuint)(serial)-v_as_uint(y));
    vint age = as_int16(v_min(x_age, y_age));
    v_store_int(v_pack_int(slot, bits), (__global int *)slots);
    v_store_int(v_pack_int(age, bits), (__global int *)ages);
#else
    uint at = 0;
    for (uint left = bits; left; left &= left - 1, at++) {
        uint lane = 31 - clz(left & -left);
        slots[at] = i + lane;
        ages[at] = age_of(a[lane], b[lane], serial);
    }
#endif
    return popcount(bits);
}

/* Used that many casts ago. */
static vint is_stamp(vint stamp, uint serial, uint age) { return v_eq(stamp, (vint)((int)(serial - age))); }

/* Where pieces go is cold memory: it is asked for before. */
K_INLINE void expect_pieces(__global uint *slots, __global uint *ages)
{
#if defined(__x86_64__) && KARST_DEVICE_CPU
    __builtin_prefetch((const void *)(size_t)slots, 1);
    __builtin_prefetch((const void *)(size_t)ages, 1);
#endif
}

/* So many vectors are looked at before it is asked whether there is anything to list in them: mostly not. */
#define STEP 4u

/* One chunk of slots; a and b are both stamps, of tiles the same one. What is found goes to pieces[0...num) and, ages,
 * to pieces[num...2 num). */
K_INLINE K_WIDE void survey_slots(__global const int *a, __global const int *b, uint begin, uint end,
                                  karst_survey_ask ask, uint kind, __global uint4 *counts, __global uint *pieces)
{
    vint used = (vint)(0), exact = (vint)(0);
    uint num_used = 0, num_exact = 0, at = begin, i = begin, least_age = ask.ages[kind], serial = ask.serial;
    bool stand_ins = kind == KARST_SURVEY_BRICKS && ask.stand_ins;
    /* Never (0) is of no age, and neither is what is as old as that. */
    vint has_exact = (vint)(least_age != 0xffffffffu && serial != least_age ? -1 : 0);
    __global uint *slots = pieces, *ages = pieces + ask.num[kind];
    expect_pieces(slots + at, ages + at);
    expect_pieces(slots + at + 16, ages + at + 16);
    for (; i + STEP * LANES <= end; i += STEP * LANES) {
        vint fits[STEP], any = (vint)(0);
#pragma unroll
        for (uint j = 0; j < STEP; j++) {
            vint x = v_load_int(a + i + j * LANES), y = v_load_int(b + i + j * LANES);
            vint as_asked = v_eq(x, (vint)((int)serial)), as_any = as_asked;
            if (kind == KARST_SURVEY_BRICKS)
                as_any |= v_eq(y, (vint)((int)serial));
            used -= as_any;
            fits[j] = is_old(x, serial, least_age);
            if (kind == KARST_SURVEY_BRICKS)
                fits[j] &= is_old(y, serial, least_age);
            if (stand_ins)
                fits[j] = as_any & ~as_asked;
            any |= fits[j];
        }
        if (least_age == 0u || !v_any(any))
            continue;
#pragma unroll
        for (uint j = 0; j < STEP; j++) {
            uint first = i + j * LANES;
            vint same = is_stamp(v_load_int(a + first), serial, least_age);
            if (kind == KARST_SURVEY_BRICKS)
                same |= is_stamp(v_load_int(b + first), serial, least_age);
            same &= has_exact;
            exact -= (stand_ins ? fits[j] : same & fits[j]);
            at += list_slots(fits[j], first, a + first, b + first, serial, slots + at, ages + at);
        }
        expect_pieces(slots + at + 24, ages + at + 24);
    }
    for (; i < end; i++) {
        uint age = age_of(a[i], b[i], serial);
        num_used += age == 0u;
        if (least_age == 0u || !(stand_ins ? age == 0u && a[i] != (int)serial : age >= least_age))
            continue;
        num_exact += stand_ins || (age == least_age && age != 0xffffffffu);
        slots[at] = i;
        ages[at++] = age;
    }
    counts[0] = (uint4)(num_used + lanes_total(used), at - begin, num_exact + lanes_total(exact), 0u);
}

static void survey_requests(__global const int *want_chunk, uint begin, uint end, uint serial, __global uint4 *counts,
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
    counts[0] = (uint4)(at - begin, at - begin, 0u, 0u);
}

__kernel K_WIDE void karst_survey(__global const int *tile_stamp, __global const int *brick_stamp,
                                  __global const int *brick_fallback, __global const int *want_chunk,
                                  karst_survey_ask ask, __global uint4 *counts, __global uint *tiles,
                                  __global uint *bricks, __global uint *active)
{
    uint chunk = (uint)get_global_id(0), kind = 0;
    while (kind < KARST_SURVEY_KINDS && chunk >= num_chunks_of(ask.num[kind]))
        chunk -= num_chunks_of(ask.num[kind++]);
    if (kind == KARST_SURVEY_KINDS)
        return;
    uint begin = chunk * KARST_CHUNK, end = min(ask.num[kind], begin + KARST_CHUNK);
    counts += counts_at(kind, ask) + chunk;
    if (kind == KARST_SURVEY_TILES)
        survey_slots(tile_stamp, tile_stamp, begin, end, ask, KARST_SURVEY_TILES, counts, tiles);
    else if (kind == KARST_SURVEY_BRICKS)
        survey_slots(brick_stamp, brick_fallback, begin, end, ask, KARST_SURVEY_BRICKS, counts, bricks);
    else
        survey_requests(want_chunk, begin, end, ask.serial, counts, active);
}

/* A lane's chunks of a kind. */
static uint2 lane_share(uint num_chunks)
{
    uint share = (num_chunks + KARST_SCAN_WIDTH - 1) / KARST_SCAN_WIDTH, lane = (uint)get_local_id(0);
    return (uint2)(min(num_chunks, lane * share), min(num_chunks, (lane + 1) * share));
}

/* Puts the chunks' lists together; one work-group, of which a lane goes through a row of chunks. Of exactly the age the
 * first ask.most are kept. */
__kernel __attribute__((reqd_work_group_size(KARST_SCAN_WIDTH, 1, 1))) void
karst_survey_pack(karst_survey_ask ask, __global const uint4 *counts, __global const uint *tiles,
                  __global const uint *bricks, __global const uint *active, __global karst_survey_slot *packed_tiles,
                  __global karst_survey_slot *packed_bricks, __global uint *packed_active,
                  __global karst_survey_result *result)
{
    __local uint4 sums[KARST_SURVEY_KINDS][KARST_SCAN_WIDTH];
    uint lane = (uint)get_local_id(0);
    for (uint kind = 0; kind < KARST_SURVEY_KINDS; kind++) {
        uint2 share = lane_share(num_chunks_of(ask.num[kind]));
        uint4 sum = (uint4)(0u);
        for (uint i = share.x; i < share.y; i++)
            sum += counts[counts_at(kind, ask) + i];
        sums[kind][lane] = sum;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint kind = lane; kind < KARST_SURVEY_KINDS; kind += KARST_SCAN_WIDTH) {
        uint4 sum = (uint4)(0u);
        for (uint i = 0; i < KARST_SCAN_WIDTH; i++) {
            uint4 own = sums[kind][i];
            sums[kind][i] = sum;
            sum += own;
        }
        if (kind == KARST_SURVEY_REQUESTS) {
            result->num_active = sum.x;
        } else {
            uint left_out = sum.z - min(sum.z, ask.most[kind]);
            result->num_used[kind] = sum.x;
            result->num_found[kind] = sum.y - left_out;
            result->num_left_out[kind] = left_out;
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint kind = 0; kind < 2; kind++) {
        __global const uint *pieces = kind == KARST_SURVEY_TILES ? tiles : bricks;
        __global karst_survey_slot *packed = kind == KARST_SURVEY_TILES ? packed_tiles : packed_bricks;
        uint2 share = lane_share(num_chunks_of(ask.num[kind]));
        bool stand_ins = kind == KARST_SURVEY_BRICKS && ask.stand_ins;
        uint most = ask.most[kind], num_exact = sums[kind][lane].z;
        uint at = sums[kind][lane].y - (num_exact - min(num_exact, most));
        for (uint i = share.x; i < share.y; i++) {
            uint4 count = counts[counts_at(kind, ask) + i];
            if (num_exact >= most && count.y == count.z)
                continue;
            for (uint from = i * KARST_CHUNK, end = from + count.y; from < end; from++) {
                karst_survey_slot one = {pieces[from], pieces[ask.num[kind] + from]};
                bool exact = stand_ins || (one.age == ask.ages[kind] && one.age != 0xffffffffu);
                if (exact && num_exact++ >= most)
                    continue;
                packed[at++] = one;
            }
        }
    }
    uint2 share = lane_share(num_chunks_of(ask.num[KARST_SURVEY_REQUESTS]));
    uint at = sums[KARST_SURVEY_REQUESTS][lane].y;
    for (uint i = share.x; i < share.y; i++)
        for (uint left = counts[counts_at(KARST_SURVEY_REQUESTS, ask) + i].y, from = i * KARST_CHUNK; left > 0; left--)
            packed_active[at++] = active[from++];
}
