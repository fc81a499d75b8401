/* What packets of light fly through: cells of a box, filled from bricks. See raycast/media/fluence.h. */
#define MEDIA_HAS_LIGHT
#include "raycast/media/fluence_shared.h"
#include "raycast/media/land_pools.clh"
#include "raycast/media/march.clh"
#include "raycast/light/surface.clh"
#include "world.clh"
#include "raycast/cast/exact.clh"
#include "raycast/media/look.clh"

/* Which cells the lanes of an item have, and where. */
typedef struct {
    vint number, at[3], lanes;
} fill_cells;

RAY_INLINE fill_cells cells_of(const karst_fluence_box *box, uint first, uint num)
{
    fill_cells c;
    c.lanes = v_lt(V_LANE, (vint)((int)(num - first)));
    c.number = v_select(c.lanes, V_LANE + (int)first, (vint)(0));
    const vint row = c.number / box->size[0];
    c.at[0] = c.number - row * box->size[0];
    c.at[2] = row / box->size[1];
    c.at[1] = row - c.at[2] * box->size[1];
    return c;
}

/* The least and the most of each item's cells, and of all. */
RAY_INLINE void note_found(const fill_cells *c, vint has, vint missing, K_GLOBAL int *found)
{
    const uint num_missing = (uint)count_lanes(missing & c->lanes);
    if (num_missing)
        atomic_add(found + KARST_FLUENCE_MISSING, (int)num_missing);
    has &= c->lanes;
    if (!v_any(has))
        return;
    for (int axis = 0; axis < 3; axis++) {
        const vfloat at = v_to_float(c->at[axis]);
        atomic_min(found + KARST_FLUENCE_LEAST + axis, (int)least_of(at, has));
        atomic_max(found + KARST_FLUENCE_MOST + axis, (int)most_of(at, has));
    }
}

/* The mean extinction on a line across each cell, per cell, and what it looks like there. The box's corner is that of
 * `corner`, whatever the view; bricks have voxels half as wide as a cell. base: the number
 * of the grid's first cell, of all grids. */
__kernel K_WIDE void fluence_fill(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_media_task task,
                                  karst_shade_anchor anchor, karst_shade_anchor corner, karst_fluence_box box,
                                  uint base, K_GLOBAL float *extinction, K_GLOBAL float *look, K_GLOBAL int *found,
                                  K_GLOBAL const ulong *data)
{
    const pools pool = POOL_FIELDS;
    __local near_octave known[WORLD_NEAR_OCTAVES + 1];
    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0); /* as shade.cl */
    world_colour_prepare(data, corner.voxel, corner.fraction, octaves, (uint)get_local_id(0), (uint)get_local_size(0));
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint num = (uint)(box.size[0] * box.size[1] * box.size[2]), first = (uint)get_global_id(0) * LANES;
    if (first >= num)
        return;
    const vfloat none = (vfloat)(0.0f), one = (vfloat)(1.0f);
    const fill_cells c = cells_of(&box, first, num);
    media_frame frame;
    media_frame_of_corner(&frame, view, &anchor, corner.voxel);
    media_sums sums = EMPTY_SUMS;
    media_lighting lighting;
    lighting.most_depth = 1.0e30f;
    lighting.metres = task.metres;
    lighting.used = 0;
    const float side = box.cell;
    const media_rays way = {{v_to_float(c.at[0]) * side, (v_to_float(c.at[1]) + 0.5f) * side,
                             (v_to_float(c.at[2]) + 0.5f) * side},
                            {one, none, none},
                            none,
                            (vfloat)(side),
                            (vfloat)(0.5f * side),
                            none};
    walk_depth(&pool, &frame, &way, c.lanes, &lighting, &sums);
    const vint has = c.lanes & v_gt(sums.tau, none);
    note_found(&c, has, sums.missing, found);
    float depth[LANES], values[4][LANES];
    v_store_float(lane_min(sums.tau, (vfloat)(KARST_FLUENCE_MOST_DEPTH)), depth);
    for (int i = 0; i < 4; i++)
        v_store_float(none, values[i]);
    if (v_any(has)) {
        const vector3 place = {way.origin.x + 0.5f * side, way.origin.y, way.origin.z};
        const vfloat t = k_sqrt(k_fma(place.x, place.x, k_fma(place.y, place.y, place.z * place.z)));
        const vector3 toward = {place.x / t, place.y / t, place.z / t};
        lighting.direction = &toward;
#ifdef MEDIA_STREAMS
        lighting.origin = 0;
#endif
        lighting.to_sun = none;
        lighting.data = data;
        lighting.anchor = &corner;
        lighting.octaves = octaves;
        const media_look seen = look_at_medium(&lighting, t, (int)(k_as_uint(side) >> 23) - 127, has);
        v_store_float(seen.albedo.r, values[0]);
        v_store_float(seen.albedo.g, values[1]);
        v_store_float(seen.albedo.b, values[2]);
        v_store_float(seen.g, values[3]);
    }
    for (uint lane = 0; lane < LANES && first + lane < num; lane++) {
        extinction[base + first + lane] = depth[lane];
        for (int i = 0; i < 4; i++)
            look[4 * (base + first + lane) + (uint)i] = values[i][lane];
    }
}

/* Where land does not hide the sun: 1. */
__kernel K_WIDE void fluence_open(LAND_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_shade_anchor anchor,
                                  karst_shade_anchor corner, karst_fluence_box box, uint base, float4 to_sun,
                                  float most_t, K_GLOBAL const float *extinction, K_GLOBAL uint *open,
                                  K_GLOBAL int *found)
{
    const pools land = LAND_FIELDS;
    const uint num = (uint)(box.size[0] * box.size[1] * box.size[2]), first = (uint)get_global_id(0) * LANES;
    if (first >= num)
        return;
    const fill_cells c = cells_of(&box, first, num);
    const vint has = c.lanes & v_gt(v_gather_float(extinction + base, c.number), (vfloat)(0.0f));
    media_frame frame;
    media_frame_of_corner(&frame, view, &anchor, corner.voxel);
    media_sums hidden = EMPTY_SUMS;
    media_lighting lighting;
    lighting.most_depth = 1.0e30f;
    lighting.metres = 1.0f;
    lighting.used = 0;
    const float side = box.cell;
    const media_rays way = {{(v_to_float(c.at[0]) + 0.5f) * side, (v_to_float(c.at[1]) + 0.5f) * side,
                             (v_to_float(c.at[2]) + 0.5f) * side},
                            {(vfloat)(to_sun.x), (vfloat)(to_sun.y), (vfloat)(to_sun.z)},
                            (vfloat)(0.0f),
                            (vfloat)(most_t),
                            (vfloat)(side),
                            (vfloat)(0.06f)};
    if (v_any(has))
        walk_land(&land, &frame, &way, has, &lighting, &hidden);
    note_found(&c, (vint)(0), hidden.missing & has, found);
    int words[LANES];
    v_store_int(~hidden.done & 1, words);
    for (uint lane = 0; lane < LANES && first + lane < num; lane++)
        open[base + first + lane] = (uint)words[lane];
}
