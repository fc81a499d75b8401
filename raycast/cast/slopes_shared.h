/* How steep a brick is along each axis. Compiled twice: see core/device/dialect.h.
 *
 * A partial derivative of the interpolant is a weighted mean of differences along a cell's edges: so along an axis q
 * rises by no more in a cell than by the largest difference between neighbours there, and along a ray by no more than
 * the sum of those times the ray's components. That is often far less than what karst_brick_info.safe_cells allows any
 * way: ground that is looked along rises little. Kept as shares of the latter, of ten bits, in karst_brick_info.slopes:
 * the first word along the axes, the second one against them.
 */
#ifndef KARST_RAYCAST_SLOPES_SHARED_H
#define KARST_RAYCAST_SLOPES_SHARED_H

#include "cache/layout_shared.h"

#define KARST_SLOPE_ONE 511            /* as steep as the brick may be any way */
#define KARST_SLOPES_KNOWN 0x80000000u /* in the second word: the brick was looked at */

/* The share that stands for a rise of at most so much of q a cell. */
K_INLINE int karst_slope_share(float rise, float safe_cells)
{
    const float share = rise * safe_cells * (float)KARST_SLOPE_ONE;
    return share >= (float)KARST_SLOPE_ONE    ? KARST_SLOPE_ONE
           : share <= (float)-KARST_SLOPE_ONE ? -KARST_SLOPE_ONE
                                              : (int)k_floor(share) + 1;
}

/* Of the three axes, one way. */
K_INLINE uint karst_slope_word(int x, int y, int z)
{
    return ((uint)x & 1023u) | ((uint)y & 1023u) << 10 | ((uint)z & 1023u) << 20;
}
K_INLINE int karst_slope_of(uint word, int axis) { return (int)(word << (22 - 10 * axis)) >> 22; }

#endif
