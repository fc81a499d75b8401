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

/* How land is looked at from cells. */
typedef struct {
    const pools *pools;
    const media_frame *frame;
    const media_lighting *lighting;
    float side, width; /* of a cell; of the voxels that are asked for */
} land_looks;

/* Of the middles of a cell's eighths, whose bits are their places: those that `lanes` have outside of land. */
RAY_INLINE vint outside_land(const land_looks *land, const fill_cells *c, vint lanes, vint *missing)
{
    const float side = land->side;
    const vfloat none = (vfloat)(0.0f);
    vint outside = (vint)(0);
    for (int eighth = 0; eighth < 8; eighth++) {
        const media_rays way = {{(v_to_float(c->at[0]) + (eighth & 1 ? 0.75f : 0.25f)) * side,
                                 (v_to_float(c->at[1]) + (eighth & 2 ? 0.75f : 0.25f)) * side,
                                 (v_to_float(c->at[2]) + (eighth & 4 ? 0.75f : 0.25f)) * side},
                                {none, (vfloat)(1.0f), none},
                                none,
                                (vfloat)(side),
                                (vfloat)(land->width),
                                none};
        media_sums within = EMPTY_SUMS;
        look_in_land(land->pools, land->frame, &way, &lanes, 1u, land->lighting, &within);
        outside |= ~within.done & (1 << eighth);
        *missing |= within.missing & lanes;
    }
    return outside;
}

/* The mean extinction of each cell, as depth across it, and what it looks like there. Of what lies in land nothing
 * counts: light ends at its face, and what comes from there is the ground's. The box's corner is that of
 * `corner`, whatever the view; bricks have voxels half as wide as a cell, times `coarser`. base: the
 * number of the grid's first cell, of all grids. open: its bits 0 to 7 (KARST_FLUENCE_OUTSIDE) are set. */
__kernel K_WIDE void fluence_fill(POOL_PARAMETERS, LAND_PARAMETERS, uint with_land,
                                  K_GLOBAL const karst_cast_view *view, karst_media_task task,
                                  karst_shade_anchor anchor, karst_shade_anchor corner, karst_fluence_box box,
                                  float coarser, uint base, K_GLOBAL float *extinction, K_GLOBAL float *look,
                                  K_GLOBAL uint *open, K_GLOBAL int *found, K_GLOBAL const ulong *data)
{
    const pools pool = POOL_FIELDS, land = LAND_FIELDS;
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
    media_lighting lighting;
    lighting.most_depth = 1.0e30f;
    lighting.metres = task.metres;
    lighting.used = 0;
    const float side = box.cell, width = 0.5f * side * coarser; /* of a cell; of voxels */
    /* Between the samples, four lines have the mean of what is between them. */
    vfloat mean = none, depths[4];
    vint missing = (vint)(0), outside = (vint)(KARST_FLUENCE_OUTSIDE);
    for (int line = 0; line < 4; line++) {
        const float across = line & 1 ? 0.75f : 0.25f, along = line & 2 ? 0.75f : 0.25f;
        const media_rays way = {{v_to_float(c.at[0]) * side, (v_to_float(c.at[1]) + across) * side,
                                 (v_to_float(c.at[2]) + along) * side},
                                {one, none, none},
                                none,
                                (vfloat)(side),
                                (vfloat)(width),
                                none};
        media_sums sums = EMPTY_SUMS;
        walk_depth(&pool, &frame, &way, c.lanes, &lighting, &sums);
        depths[line] = sums.tau;
        mean = k_fma(sums.tau, (vfloat)(0.25f), mean);
        missing |= sums.missing;
    }
    const vint met = c.lanes & v_gt(mean, none);
    if (with_land && v_any(met)) {
        const land_looks looks = {&land, &frame, &lighting, side, width};
        outside = outside_land(&looks, &c, met, &missing);
        mean = none;
        for (int line = 0; line < 4; line++) {
            const vint ends = ((outside >> (2 * line)) & 1) + ((outside >> (2 * line + 1)) & 1);
            mean = k_fma(depths[line], 0.125f * v_to_float(ends), mean);
        }
    }
    const vint has = c.lanes & v_gt(mean, none);
    note_found(&c, has, missing, found);
    float depth[LANES], values[4][LANES];
    v_store_float(lane_min(mean, (vfloat)(KARST_FLUENCE_MOST_DEPTH)), depth);
    for (int i = 0; i < 4; i++)
        v_store_float(none, values[i]);
    if (v_any(has)) {
        const vector3 place = {(v_to_float(c.at[0]) + 0.5f) * side, (v_to_float(c.at[1]) + 0.5f) * side,
                               (v_to_float(c.at[2]) + 0.5f) * side};
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
    int words[LANES];
    v_store_int(outside, words);
    for (uint lane = 0; lane < LANES && first + lane < num; lane++) {
        extinction[base + first + lane] = depth[lane];
        open[base + first + lane] = (uint)words[lane];
        for (int i = 0; i < 4; i++)
            look[4 * (base + first + lane) + (uint)i] = values[i][lane];
    }
}

/* Lanes whose ray to the sun, from a place in their cell, meets no land. */
RAY_INLINE vint comes_to_sun(const land_looks *land, const fill_cells *c, const float in_cell[3], float4 to_sun,
                             float most_t, vint lanes, vint *missing)
{
    const float side = land->side;
    const media_rays way = {{(v_to_float(c->at[0]) + in_cell[0]) * side, (v_to_float(c->at[1]) + in_cell[1]) * side,
                             (v_to_float(c->at[2]) + in_cell[2]) * side},
                            {(vfloat)(to_sun.x), (vfloat)(to_sun.y), (vfloat)(to_sun.z)},
                            (vfloat)(0.0f),
                            (vfloat)(most_t),
                            (vfloat)(land->width),
                            (vfloat)(0.06f)};
    media_sums hidden = EMPTY_SUMS;
    walk_land(land->pools, land->frame, &way, lanes, land->lighting, &hidden);
    *missing |= hidden.missing & lanes;
    return lanes & ~hidden.done;
}

/* The share of each cell's medium that land does not hide from the sun, above the bits that are set already: by the
 * middle of a cell, and of those that have some land by the middles of their eighths. */
__kernel K_WIDE void fluence_open(LAND_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_shade_anchor anchor,
                                  karst_shade_anchor corner, karst_fluence_box box, float coarser, uint base,
                                  float4 to_sun, float most_t, K_GLOBAL const float *extinction, K_GLOBAL uint *open,
                                  K_GLOBAL int *found)
{
    const pools land = LAND_FIELDS;
    const uint num = (uint)(box.size[0] * box.size[1] * box.size[2]), first = (uint)get_global_id(0) * LANES;
    if (first >= num)
        return;
    const fill_cells c = cells_of(&box, first, num);
    const vint has = c.lanes & v_gt(v_gather_float(extinction + base, c.number), (vfloat)(0.0f));
    const vint outside = v_gather_int((K_GLOBAL const int *)open + base, c.number) & KARST_FLUENCE_OUTSIDE;
    const vint whole = has & v_eq(outside, (vint)(KARST_FLUENCE_OUTSIDE));
    media_frame frame;
    media_frame_of_corner(&frame, view, &anchor, corner.voxel);
    media_lighting lighting;
    lighting.most_depth = 1.0e30f;
    lighting.metres = 1.0f;
    lighting.used = 0;
    const land_looks looks = {&land, &frame, &lighting, box.cell, box.cell * coarser};
    vint missing = (vint)(0), share = (vint)(0);
    if (v_any(whole)) {
        const float middle[3] = {0.5f, 0.5f, 0.5f};
        share = comes_to_sun(&looks, &c, middle, to_sun, most_t, whole, &missing) & KARST_FLUENCE_ALL_OPEN;
    }
    if (v_any(has & ~whole)) {
        vint num_lit = (vint)(0), num_outside = (vint)(0);
        for (int eighth = 0; eighth < 8; eighth++) {
            const vint lanes = has & ~whole & v_ne((outside >> eighth) & 1, (vint)(0));
            const float middle[3] = {eighth & 1 ? 0.75f : 0.25f, eighth & 2 ? 0.75f : 0.25f,
                                     eighth & 4 ? 0.75f : 0.25f};
            if (!v_any(lanes))
                continue;
            num_outside += lanes & 1;
            num_lit += comes_to_sun(&looks, &c, middle, to_sun, most_t, lanes, &missing) & 1;
        }
        share = v_select(has & ~whole,
                         v_to_int(v_to_float(num_lit * KARST_FLUENCE_ALL_OPEN) /
                                  v_to_float(lane_max_int(num_outside, (vint)(1)))),
                         share);
    }
    note_found(&c, (vint)(0), missing, found);
    int words[LANES];
    v_store_int(outside | share << KARST_FLUENCE_OPEN_SHIFT, words);
    for (uint lane = 0; lane < LANES && first + lane < num; lane++)
        open[base + first + lane] = (uint)words[lane];
}
