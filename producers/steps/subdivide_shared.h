/* The proof by bounds. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_PRODUCERS_SUBDIVIDE_SHARED_H
#define KARST_PRODUCERS_SUBDIVIDE_SHARED_H

#include "producers/steps/load_shared.h"

/* The state of a node whose density lies in [lo, hi], at every point and every footprint that world_bounds speaks for;
 * 0 is air. The comparisons are false for NaN; an interval with an infinite end is "unknown", as the contract of
 * world_bounds says. */
K_INLINE uint karst_state_from_bounds(float lo, float hi)
{
    int finite = lo > -INFINITY && hi < INFINITY;
#ifdef KARST_MEDIUM /* producers/steps/medium.h */
    return finite && hi <= 0.0f ? KARST_STATE_AIR : KARST_STATE_UNKNOWN;
#endif
    return finite && lo > 0.0f ? KARST_STATE_SOLID : finite && hi <= 0.0f ? KARST_STATE_AIR : KARST_STATE_UNKNOWN;
}

/* karst_load.doubt from the slopes (per level-0 voxel) and the slack of world_bounds and world_slack.
 *
 * Samples are a voxel h = 2^level apart, corners of the node included, so each point p of the closed node has a sample
 * s with |p - s| <= h/2 on each axis. Let w be any footprint from 0 to the parent's voxel. Then |d(p, w) - d(s, h)| <=
 * |d(p, w) - d(p, h)| + |d(p, h) - d(s, h)| <= slack + sum over axes of slope * h/2, the latter along the axis-parallel
 * way from s to p, which stays in the node (h itself is in the slopes' range of footprints). Rounding of densities is
 * in slack; the four roundings here are each below 2^-24 of the sum, which 2^-20 covers. */
K_INLINE float karst_load_doubt(float slope_x, float slope_y, float slope_z, float slack, int level)
{
    float half_voxel = k_as_float((uint)(127 + level - 1) << 23); /* 2^(level - 1) */
    float reach = (slope_x + slope_y + slope_z) * half_voxel;
    return (reach + slack) * (1.0f + 0x1p-20f);
}

#endif
