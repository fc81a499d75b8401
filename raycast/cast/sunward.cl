/* Entry point: what bricks are to rays towards the sun. See raycast/cast/sunward.h. */
#include "raycast/cast/packing.clh"
#include "raycast/cast/samples.clh"
#include "raycast/cast/segments.clh"
#include "raycast/cast/sunward_shared.h"

/* Samples of neighbours in x, as lanes. */
#if LANES == 1
#define LOAD_SAMPLES(p) ((float)*(p))
#elif KARST_BRICK_BITS == 32
#define LOAD_SAMPLES(p) vload16(0, p)
#else
#define LOAD_SAMPLES(p) convert_float16(vload16(0, p))
#endif

/* The four samples of a row of cells at one height. */
typedef struct {
    vfloat v00, v10, v01, v11; /* x, z */
} cell_corners;

RAY_INLINE cell_corners corners_at_height(K_GLOBAL const karst_brick_sample *q)
{
    const cell_corners c = {LOAD_SAMPLES(q), LOAD_SAMPLES(q + 1), LOAD_SAMPLES(q + ROW_Z), LOAD_SAMPLES(q + ROW_Z + 1)};
    return c;
}

RAY_INLINE vfloat most_of_two(vfloat a, vfloat b, float share) { return lane_max(a * share, b * share); }

/* Bits of 16 cells to those of their pairs, and of 8 pairs to those of their pairs. */
RAY_INLINE uint bits_of_pairs(uint bits)
{
    bits = (bits | bits >> 1) & 0x5555u;
    bits = (bits | bits >> 1) & 0x3333u;
    bits = (bits | bits >> 2) & 0x0f0fu;
    return (bits | bits >> 4) & 0xffu;
}

#define FINE_SIDE (KARST_BRICK_CELLS / KARST_FINE_CELLS) /* fine blocks along a brick */
#define COLUMN 0x0101010101010101ul                      /* of a plane of them: bit x + 8 y */

/* What `planes` hold so far on in x and y: bit x, y comes from x + dx, y + dy. Shifts are less than FINE_SIDE. */
RAY_INLINE ulong8 planes_on(ulong8 planes, int dx, int dy)
{
    planes = dx < 0 ? planes << (ulong)-dx & COLUMN * (0xfful << -dx & 0xfful)
                    : planes >> (ulong)dx & COLUMN * (0xfful >> dx);
    return dy < 0 ? planes << (ulong)(-8 * dy) : planes >> (ulong)(8 * dy);
}

/* The fine blocks, plane by plane along z, from which a ray towards the sun may come to one of `open` in the brick.
 * Along the axis on which rays are fastest, k blocks on, one that began anywhere in a block has moved by k - 1 to k + 1
 * blocks, and on the other axes by their share of it; never back, and from the first plane to the next not at all if it
 * must. */
RAY_INLINE ulong8 blocks_before(const ulong open[FINE_SIDE], const float sun[4])
{
    ulong behind[3 * FINE_SIDE];
    for (int z = 0; z < 3 * FINE_SIDE; z++)
        behind[z] = z / FINE_SIDE == 1 ? open[z - FINE_SIDE] : 0ul;
    const float way[3] = {k_fabs(sun[0]), k_fabs(sun[1]), k_fabs(sun[2])};
    const int fastest = way[0] >= way[1] && way[0] >= way[2] ? 0 : way[1] >= way[2] ? 1 : 2;
    ulong8 before = (ulong8)(0ul);
    for (int k = 0; k < FINE_SIDE; k++) {
        int from[3], to[3];
        for (int axis = 0; axis < 3; axis++) {
            const float share = way[axis] / way[fastest];
            int first = k, last = k;
            if (axis != fastest) {
                first = k < 2 ? 0 : (int)k_floor(share * (float)(k - 1) - KARST_SUNWARD_ROUNDING);
                last = 1 + (int)k_floor(share * (float)(k + 1) + KARST_SUNWARD_ROUNDING);
                first = first < 0 ? 0 : first;
            }
            last = last < FINE_SIDE ? last : FINE_SIDE - 1;
            from[axis] = sun[axis] < 0.0f ? -last : first;
            to[axis] = sun[axis] < 0.0f ? -first : last;
        }
        for (int dz = from[2]; dz <= to[2]; dz++) {
            const ulong8 planes = vload8(0, behind + FINE_SIDE + dz);
            ulong8 columns = (ulong8)(0ul);
            for (int dx = from[0]; dx <= to[0]; dx++)
                columns |= planes_on(planes, dx, 0);
            for (int dy = from[1]; dy <= to[1]; dy++)
                before |= planes_on(columns, 0, dy);
        }
    }
    return before;
}

/* Bit i to bit 2 i. */
RAY_INLINE uint bits_apart(uint bits)
{
    bits = (bits | bits << 8) & 0x00ff00ffu;
    bits = (bits | bits << 4) & 0x0f0f0f0fu;
    bits = (bits | bits << 2) & 0x33333333u;
    return (bits | bits << 1) & 0x55555555u;
}

#if LANES == 16
#define SURVEY_CALL static K_WIDE __attribute__((noinline))
#else
#define SURVEY_CALL RAY_INLINE
#endif

SURVEY_CALL void survey_brick(K_GLOBAL const karst_brick_sample *samples, float any_way, const float sun[4],
                              K_GLOBAL karst_sunward_brick *brick)
{
    const vfloat none = (vfloat)(0.0f);
    vfloat steepest = none;
    ulong open[FINE_SIDE], airy[FINE_SIDE]; /* fine blocks: with cells to look at, with one that is not all solid */
    uint blocks[2] = {0u, 0u};
    for (int plane = 0; plane < FINE_SIDE; plane++)
        open[plane] = airy[plane] = 0ul;
    for (int z = 0; z < KARST_BRICK_CELLS; z++)
        for (int y = 0; y < KARST_BRICK_CELLS; y++) {
            uint row = 0, air = 0;
            for (int x = 0; x < KARST_BRICK_CELLS; x += LANES) {
                K_GLOBAL const karst_brick_sample *q = samples + z * ROW_Z + y * ROW_Y + x;
                const cell_corners a = corners_at_height(q), b = corners_at_height(q + ROW_Y);
                vfloat rise = lane_max(most_of_two(a.v10 - a.v00, a.v11 - a.v01, sun[0]),
                                       most_of_two(b.v10 - b.v00, b.v11 - b.v01, sun[0]));
                rise += lane_max(most_of_two(b.v00 - a.v00, b.v10 - a.v10, sun[1]),
                                 most_of_two(b.v01 - a.v01, b.v11 - a.v11, sun[1]));
                rise += lane_max(most_of_two(a.v01 - a.v00, a.v11 - a.v10, sun[2]),
                                 most_of_two(b.v01 - b.v00, b.v11 - b.v10, sun[2]));
                steepest = lane_max(steepest, rise);
                const vfloat high = lane_max(lane_max(lane_max(a.v00, a.v10), lane_max(a.v01, a.v11)),
                                             lane_max(lane_max(b.v00, b.v10), lane_max(b.v01, b.v11)));
                const vfloat low = lane_min(lane_min(lane_min(a.v00, a.v10), lane_min(a.v01, a.v11)),
                                            lane_min(lane_min(b.v00, b.v10), lane_min(b.v01, b.v11)));
                row |= mask_bits(v_gt(high, none) & v_le(low, none) & v_gt(rise, (vfloat)(-KARST_SUNWARD_FALL))) << x;
                air |= mask_bits(v_le(low, none)) << x;
            }
            airy[z >> 1] |= (ulong)bits_of_pairs(air) << (y >> 1) * FINE_SIDE;
            if (!row)
                continue;
            const uint pairs = bits_of_pairs(row);
            open[z >> 1] |= (ulong)pairs << (y >> 1) * FINE_SIDE;
            blocks[z >> 3] |= (bits_of_pairs(pairs) & 15u) << ((y >> 2) * 4 + (z >> 2 & 1) * 16);
        }
    ulong before[FINE_SIDE];
    vstore8(blocks_before(open, sun), 0, before);
    for (int word = 0; word < KARST_SUNWARD_WORDS; word++) {
        /* two rows of fine blocks */
        const int plane = word >> 2, shift = (word & 3) * 16, wide = (plane >> 1) * 16 + (word & 3) * 4;
        const uint look = (uint)((open[plane] | ~airy[plane]) >> shift) & 0xffffu,
                   held = (uint)(before[plane] >> shift) & 0xffffu;
        uint leap = ~(blocks[wide >> 5] >> (wide & 31)) & 15u;
        leap = (leap | leap << 2) & 0x33u;
        leap = (leap | leap << 1) & 0x55u;
        leap *= 0x303u;
        const uint step = bits_apart(held), high = bits_apart(~held & 0xffffu | leap & 0xffffu);
        brick->ways[word] = (step * KARST_SUNWARD_STEP | high * KARST_SUNWARD_FREE) & bits_apart(~look & 0xffffu) * 3u;
    }
    brick->blocks[0] = blocks[0];
    brick->blocks[1] = blocks[1];
    const float safe = 1.0f / (v_max_across(steepest) + KARST_SUNWARD_ROUNDING);
    brick->safe_cells = safe > any_way ? safe : any_way;
}

/* A work-item for each load, or slot. */
__kernel K_WIDE void survey_sunward(karst_sunward_task task, K_GLOBAL const uint *load_slots,
                                    K_GLOBAL const uint *load_results, K_GLOBAL const karst_brick_owner *owners,
                                    K_GLOBAL const karst_brick_info *brick_info, BRICK_PARAMETERS,
                                    K_GLOBAL karst_sunward_brick *sunward)
{
    const brick_pool bricks = BRICK_FIELDS;
    const uint i = (uint)get_global_id(0);
    if (i >= task.num)
        return;
    uint slot = i;
    if (task.from_loads) {
        const uint result = load_results[i];
        if (result != KARST_STATE_BRICK && !(result & KARST_LOAD_KEPT))
            return;
        slot = load_slots[i];
    } else if (slot == KARST_NONE || owners[slot].owner == KARST_NO_NODE) {
        return;
    }
    survey_brick(brick_samples(&bricks, slot), brick_info[slot].safe_cells, task.direction, sunward + slot);
}
