/* Entry points of paths, but for what happens at surfaces (raycast/light/paths.clh): the first rays, what comes of
 * rays to lamps, and the next stream without gaps. See raycast/light/paths.h. */
#include "raycast/light/path_rays.clh"
#include "raycast/light/scan.clh"

/* Rays of a stream that a work-item counts, and moves. */
#define BLOCK_RAYS SCAN_BLOCK(KARST_PATH_BLOCK)

/* A ray for each pixel, in packet order; and no light yet, unless parts are kept. lacking: a word for each pixel; bit 0
 * says that its path lacked something when it was last followed, and is 0 from now on; KARST_PATH_LACKED_BEFORE, that
 * it did since it was last drawn. only_lacking: rays of others are idle, and keep their light. */
__kernel K_WIDE void paths_begin(karst_pinhole pinhole, K_GLOBAL karst_ray *rays, K_GLOBAL float *parts,
                                 uint keep_parts, K_GLOBAL uint *count, K_GLOBAL float *lacking, uint only_lacking)
{
    const vfloat zero = (vfloat)(0.0f), one = (vfloat)(1.0f);
    const size_t plane = (size_t)pinhole.width_px * (size_t)pinhole.height_px;
    path_rays r;
    vint x, y;
    if (get_global_id(0) == 0)
        *count = (uint)plane;
    r.valid = packet_pixels((uint)get_global_id(0), pinhole.width_px, pinhole.height_px, &x, &y);
    if (!v_any(r.valid))
        return;
    r.lanes = mask_bits(r.valid);
    r.index = packet_order(x, y, pinhole.width_px, pinhole.height_px);
    r.origin.x = r.origin.y = r.origin.z = zero;
    r.direction = pinhole_direction(&pinhole, x, y);
    r.t_max = (vfloat)(pinhole.t_max);
    vint goes = r.valid, before = (vint)(0);
    if (only_lacking) {
        const vint word = v_as_int(load_ordered(lacking, r.index, r.valid));
        goes &= v_ne(keep_parts ? word & 1 : word, (vint)(0));
        if (keep_parts)
            before = v_select(v_ne(word, (vint)(0)), (vint)((int)KARST_PATH_LACKED_BEFORE), (vint)(0));
        r.t_max = v_select(goes, r.t_max, zero);
    }
    store_ordered(lacking, r.index, r.valid, v_as_float(before));
    r.width = zero;
    r.cone = (vfloat)(pinhole.cone);
    r.throughput.r = r.throughput.g = r.throughput.b = one;
    r.pixel = y << 16 | x;
    r.flags = (vint)((int)KARST_PATH_SEES_SUN);
    store_paths(rays, &r, KARST_SIDE_ANY);
    if (keep_parts)
        return;
    store_ordered(parts, r.index, goes, zero);
    store_ordered(parts + plane, r.index, goes, zero);
    store_ordered(parts + 2 * plane, r.index, goes, zero);
}

/* Adds the light of lamps that nothing hides: of the rays to them, one for each of the stream, those without a mark.
 * LANES of them for each work-item. */
__kernel K_WIDE void paths_add(int width_px, int height_px, K_GLOBAL const karst_ray *rays, K_GLOBAL const uint *count,
                               K_GLOBAL const int *marks, K_GLOBAL float *parts)
{
    const uint lowest = (uint)get_global_id(0) * LANES, num_rays = *count;
    if (lowest >= num_rays)
        return;
    const path_rays r = load_paths(rays, lowest, num_rays);
    const vint lit = r.valid & v_gt(r.t_max, (vfloat)(0.0f)) &
                     v_eq(v_gather_int(marks, v_select(r.valid, r.index, (vint)(0))), (vint)(0));
    const colour whole = {(vfloat)(1.0f), (vfloat)(1.0f), (vfloat)(1.0f)};
    if (v_any(lit))
        add_paths(parts, (size_t)width_px * (size_t)height_px, width_px, height_px, &r, mask_bits(lit), &whole);
}

/* ---- rays to each lamp ---- */

/* Rays of a stream that have a mark bring no light. */
__kernel void paths_hide(K_GLOBAL karst_ray *rays, K_GLOBAL const uint *count, K_GLOBAL const uint *marks)
{
    const uint i = (uint)get_global_id(0);
    if (i >= *count || !marks[i])
        return;
    rays[i].t_max = 0.0f;
    rays[i].throughput[0] = rays[i].throughput[1] = rays[i].throughput[2] = 0.0f;
}

/* How many rays each block of a part has, of as many parts as lamps cast shadows: one work-item for each block. */
__kernel void paths_count_lit(K_GLOBAL const uint *shining, K_GLOBAL uint *counts, uint num_blocks)
{
    const uint block = (uint)get_global_id(0), first = block * (BLOCK_RAYS / LANES);
    if (block >= num_blocks)
        return;
    uint num = 0;
    for (uint i = first; i < first + BLOCK_RAYS / LANES; i++)
        num += (uint)k_popcount(shining[i]);
    counts[block] = num;
}

/* Moves them together, in their order. */
__kernel void paths_pack_lit(K_GLOBAL const karst_ray *rays, K_GLOBAL const uint *shining, K_GLOBAL const uint *begins,
                             uint num_blocks, K_GLOBAL karst_ray *packed)
{
    const uint block = (uint)get_global_id(0), first = block * (BLOCK_RAYS / LANES);
    if (block >= num_blocks)
        return;
    K_GLOBAL karst_ray *out = packed + begins[block];
    for (uint i = first; i < first + BLOCK_RAYS / LANES; i++)
        for (uint left = shining[i]; left; left &= left - 1u)
            *out++ = rays[i * LANES + (uint)k_popcount((left & (0u - left)) - 1u)];
}

/* Adds the light of lamps that nothing hides, lamp by lamp: of the rays of block b of each part those that have no
 * mark. One work-item for each block of a part. */
__kernel void paths_add_lit(int width_px, int height_px, K_GLOBAL const karst_ray *packed,
                            K_GLOBAL const uint *begins, K_GLOBAL const uint *counted, uint num_blocks,
                            uint num_parts, K_GLOBAL const uint *marks, K_GLOBAL float *parts)
{
    const uint in_part = (uint)get_global_id(0);
    const size_t plane = (size_t)width_px * (size_t)height_px;
    if (in_part >= num_blocks)
        return;
    for (uint part = 0; part < num_parts; part++) {
        const uint block = part * num_blocks + in_part;
        const uint end = block + 1 < num_parts * num_blocks ? begins[block + 1] : *counted;
        for (uint i = begins[block]; i < end; i++) {
            if (marks[i])
                continue;
            const uint pixel = packed[i].pixel & ~KARST_PATH_SEES_SUN;
            K_GLOBAL float *at = parts + karst_packet_order(pixel & 0xffffu, pixel >> 16, (uint)width_px,
                                                            (uint)height_px);
            for (int c = 0; c < 3; c++)
                at[(size_t)c * plane] += packed[i].throughput[c];
        }
    }
}

/* How many rays of each block go on: one work-item for each. */
__kernel void paths_count(K_GLOBAL const karst_ray *next, K_GLOBAL const uint *count, K_GLOBAL uint *counts,
                          uint num_blocks)
{
    const uint block = (uint)get_global_id(0), first = block * BLOCK_RAYS, num_rays = *count;
    if (block >= num_blocks)
        return;
    uint num = 0;
    for (uint i = first; i < first + BLOCK_RAYS && i < num_rays; i++)
        num += next[i].t_max > 0.0f;
    counts[block] = num;
}

/* From counts to where each block's rays begin, and how many there are in all. */
SCAN_KERNEL void paths_scan(K_GLOBAL uint *counts, uint num_blocks, K_GLOBAL uint *next_count, K_GLOBAL uint *counters,
                         uint again)
{
    __local uint sums[SCAN_ITEMS];
    const uint sum = scan_counts(counts, num_blocks, sums);
    if (get_local_id(0) != 0)
        return;
    *next_count = sum;
    if (!again)
        counters[5] += sum;
}

/* Moves them there, in their order. */
__kernel void paths_pack(K_GLOBAL const karst_ray *next, K_GLOBAL const uint *count, K_GLOBAL const uint *begins,
                         uint num_blocks, K_GLOBAL karst_ray *rays)
{
    const uint block = (uint)get_global_id(0), first = block * BLOCK_RAYS, num_rays = *count;
    if (block >= num_blocks)
        return;
    K_GLOBAL karst_ray *out = rays + begins[block];
    for (uint i = first; i < first + BLOCK_RAYS && i < num_rays; i++)
        if (next[i].t_max > 0.0f)
            *out++ = next[i];
}
