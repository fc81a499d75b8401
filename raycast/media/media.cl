/* Entry points of media: depths of rays, and depth towards the sun beside bricks. See raycast/media/media.h. */
#include "raycast/media/land_pools.clh"
#include "raycast/media/march.clh"

/* Two rays a word apart, and so on: word w of ray `ray`. */
#define RAY_WORD(w) v_gather_float((K_GLOBAL const float *)rays, at + (w))

/* Optical depths of a stream's rays, from where they start to t_max. */
__kernel K_WIDE void media_depths(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_media_task task,
                                K_GLOBAL const karst_ray *rays, uint num_rays, K_GLOBAL float *depths,
                                K_GLOBAL uint *counters)
{
    const pools pool = POOL_FIELDS;
    const uint first = (uint)get_global_id(0) * LANES;
    if (first >= num_rays)
        return;
    const vint lanes = v_lt(V_LANE, (vint)((int)(num_rays - first)));
    const vint at = v_select(lanes, V_LANE + (int)first, (vint)((int)first)) * (int)(sizeof(karst_ray) / sizeof(float));
    const media_rays way = {{RAY_WORD(0), RAY_WORD(1), RAY_WORD(2)},
                            {RAY_WORD(4), RAY_WORD(5), RAY_WORD(6)},
                            RAY_WORD(3),
                            RAY_WORD(7),
                            RAY_WORD(8) * task.detail,
                            RAY_WORD(9) * task.detail};
    media_frame frame;
    media_sums sums = EMPTY_SUMS;
    media_lighting light;
    light.most_depth = task.most_depth;
    light.metres = task.metres;
    light.used = 0;
    media_frame_of_view(&frame, view);
    walk_depth(&pool, &frame, &way, lanes, &light, &sums);
    float depth[LANES];
    v_store_float(sums.tau, depth);
    for (uint lane = 0; lane < LANES && first + lane < num_rays; lane++)
        depths[first + lane] = depth[lane];
    const uint num_missing = (uint)count_lanes(sums.missing & lanes);
    if (num_missing)
        atomic_add(counters + KARST_MEDIA_LACKING, num_missing);
}

/* Rays of a stream, to lamps, lose what media take of their light. Idle ones stay as they are. */
__kernel K_WIDE void media_dim(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_media_task task,
                               K_GLOBAL karst_ray *rays, K_GLOBAL const uint *count, K_GLOBAL uint *counters)
{
    const pools pool = POOL_FIELDS;
    const uint first = (uint)get_global_id(0) * LANES, num_rays = *count;
    if (first >= num_rays)
        return;
    const vint lanes = v_lt(V_LANE, (vint)((int)(num_rays - first)));
    const vint at = v_select(lanes, V_LANE + (int)first, (vint)((int)first)) * (int)(sizeof(karst_ray) / sizeof(float));
    const media_rays way = {{RAY_WORD(0), RAY_WORD(1), RAY_WORD(2)},
                            {RAY_WORD(4), RAY_WORD(5), RAY_WORD(6)},
                            (vfloat)(0.0f),
                            RAY_WORD(7),
                            RAY_WORD(8) * task.detail,
                            RAY_WORD(9) * task.detail};
    media_frame frame;
    media_sums sums = EMPTY_SUMS;
    media_lighting light;
    light.most_depth = task.most_depth;
    light.metres = task.metres;
    light.used = 0;
    media_frame_of_view(&frame, view);
    walk_depth(&pool, &frame, &way, lanes, &light, &sums);
    float left[LANES];
    v_store_float(tone_exp2_minus(sums.tau * LOG2_E), left);
    for (uint lane = 0; lane < LANES && first + lane < num_rays; lane++)
        for (int c = 0; c < 3 && left[lane] < 1.0f; c++)
            rays[first + lane].throughput[c] *= left[lane];
    const uint num_missing = (uint)count_lanes(sums.missing & lanes);
    if (num_missing)
        atomic_add(counters + KARST_MEDIA_LACKING, num_missing);
}

/* How voxels grow towards the sun, per unit of t: as wide as the sun and its glare are, and no finer than what a place
 * of the grid stands for. Where levels meet at a slab's face that rays leave at a fifth, its depth comes out too large:
 * by 1.8 % of the light at 0.06, by 0.5 % at 0.03. */
#ifdef MEDIA_ONCE
#define SUN_DEPTH_CONE 0.03f
#else
#define SUN_DEPTH_CONE 0.06f
#endif

/* What the pixels of a picture ask for, with nothing drawn; it counts as looked at. Of MEDIA_BEAM packets. */
__kernel K_WIDE void media_ask(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_media_task task,
                                karst_pinhole pinhole, K_GLOBAL const karst_hit *hits, K_GLOBAL uint *used)
{
    const pools pool = POOL_FIELDS;
    const vfloat none = (vfloat)(0.0f);
    media_rays ways[MEDIA_BEAM];
    media_sums sums[MEDIA_BEAM];
    vint lanes[MEDIA_BEAM];
    uint num = 0; /* packets that lie in the picture */
    for (uint p = 0; p < MEDIA_BEAM; p++) {
        vint x, y;
        const media_sums empty = EMPTY_SUMS;
        const vint valid = packet_pixels((uint)get_global_id(0) * MEDIA_BEAM + p, pinhole.width_px, pinhole.height_px,
                                         &x, &y);
        if (!v_any(valid))
            continue;
        const vint order = v_select(valid, packet_order(x, y, pinhole.width_px, pinhole.height_px), (vint)(0)) *
                           (int)(sizeof(karst_hit) / sizeof(float));
        const media_rays way = {{none, none, none},
                                pinhole_direction(&pinhole, x, y),
                                none,
                                v_gather_float((K_GLOBAL const float *)hits, order),
                                none,
                                (vfloat)(pinhole.cone * task.detail)};
        ways[num] = way;
        sums[num] = empty;
        lanes[num++] = valid;
    }
    media_frame frame;
    media_lighting light;
    light.most_depth = task.most_depth;
    light.metres = task.metres;
    light.used = used;
    media_frame_of_view(&frame, view);
    walk_depths(&pool, &frame, ways, lanes, num, &light, sums);
}

/* Bricks that a picture looked at and whose grids are not whole: each is made by one work-item. */
__kernel K_WIDE void media_sun(POOL_PARAMETERS, LAND_PARAMETERS, K_GLOBAL const karst_cast_view *view,
                               karst_media_task task, karst_shade_anchor anchor, float4 to_sun, float most_t,
                               uint num_slots, uint with_land, K_GLOBAL const uint *used,
                               K_GLOBAL const karst_brick_owner *owners,
                               K_GLOBAL uint *grids, K_GLOBAL karst_sun_depth *states, K_GLOBAL uint *counters)
{
    const pools pool = POOL_FIELDS, land = LAND_FIELDS;
    const uint slot = (uint)get_global_id(0);
    if (slot >= num_slots || used[slot] != view->serial)
        return;
    const karst_brick_owner owner = owners[slot];
    karst_sun_depth state = states[slot];
    if (owner.owner == KARST_NO_NODE || (state.is_whole && state.sun == task.sun && state.owner == owner.owner &&
                                         state.owner_generation == owner.owner_generation))
        return;
    K_GLOBAL const karst_tile_info *info = tile_info + owner.owner / KARST_TILE_NODES;
    const int level = info->level;
    long corner[3];
    for (int axis = 0; axis < 3; axis++)
        corner[axis] = (info->corner[axis] + (long)(owner.owner >> axis & 1u)) << (level + KARST_BRICK_CELLS_LOG2);
    media_frame frame;
    media_frame_of_corner(&frame, view, &anchor, corner);
    const float apart = level_voxel(level) * (float)KARST_SUN_DEPTH_CELLS;
    media_lighting light;
    light.most_depth = 64.0f;
    light.metres = task.metres;
    light.used = 0;
    vint missing = (vint)(0);
    for (int first = 0; first < KARST_SUN_DEPTH_PLACES; first += MEDIA_BEAM * LANES) {
        media_rays ways[MEDIA_BEAM];
        media_sums sums[MEDIA_BEAM], hidden[MEDIA_BEAM], within[MEDIA_BEAM];
        vint lanes[MEDIA_BEAM], dark[MEDIA_BEAM], any_dark = (vint)(0);
        uint num = 0;
        for (; num < MEDIA_BEAM && first + (int)num * LANES < KARST_SUN_DEPTH_PLACES; num++) {
            const media_sums empty = EMPTY_SUMS;
            const vint number = V_LANE + (first + (int)num * LANES);
            lanes[num] = v_lt(number, (vint)(KARST_SUN_DEPTH_PLACES));
            const vint place = v_select(lanes[num], number, (vint)(0)), row = place / KARST_SUN_DEPTH_SIDE;
            const media_rays way = {{v_to_float(place - row * KARST_SUN_DEPTH_SIDE) * apart,
                                     v_to_float(row % KARST_SUN_DEPTH_SIDE) * apart,
                                     v_to_float(row / KARST_SUN_DEPTH_SIDE) * apart},
                                    {(vfloat)(to_sun.x), (vfloat)(to_sun.y), (vfloat)(to_sun.z)},
                                    (vfloat)(0.0f),
                                    (vfloat)(most_t),
                                    (vfloat)(apart),
                                    (vfloat)(SUN_DEPTH_CONE)};
            ways[num] = way;
            sums[num] = hidden[num] = within[num] = empty;
        }
        walk_depths(&pool, &frame, ways, lanes, num, &light, sums);
        if (with_land)
            walk_lands(&land, &frame, ways, lanes, num, &light, hidden);
        for (uint p = 0; p < num; p++) {
            dark[p] = hidden[p].done & lanes[p];
            any_dark |= dark[p];
        }
        if (v_any(any_dark))
            look_in_land(&land, &frame, ways, dark, num, &light, within);
        for (uint p = 0; p < num; p++) {
            missing |= (sums[p].missing | hidden[p].missing) & lanes[p];
            const vint word = (v_as_int(sums[p].tau) & ~KARST_SUN_DEPTH_BITS) |
                              (~hidden[p].done & KARST_SUN_DEPTH_LIT) | (within[p].done & KARST_SUN_DEPTH_WITHIN);
            const int at = first + (int)p * LANES;
            int words[LANES];
            v_store_int(word, words);
            for (int lane = 0; lane < LANES && at + lane < KARST_SUN_DEPTH_PLACES; lane++)
                grids[(size_t)slot * KARST_SUN_DEPTH_PLACES + (size_t)(at + lane)] = (uint)words[lane];
        }
    }
    state.owner = owner.owner;
    state.owner_generation = owner.owner_generation;
    state.sun = task.sun;
    state.is_whole = v_any(missing) ? 0u : 1u;
    states[slot] = state;
    atomic_inc(counters + KARST_MEDIA_MADE);
}
