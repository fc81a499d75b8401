/* Density and gradient at points, LANES of them a work-item. */
#include "core/device/lanes.clh"
#include "producers/steps/density.clh"
#include "world.clh"
#include "core/engine/engine_points_shared.h"

#define PLACE_LONGS (int)(sizeof(karst_point_place) / sizeof(long))
#define PLACE_UINTS (int)(sizeof(karst_point_place) / sizeof(uint))
#define FRACTION_AT 6 /* uints */

K_INLINE K_WIDE world_point_at place_of(K_GLOBAL const karst_point_place *places, vint lane)
{
    world_point_at at;
    for (int axis = 0; axis < 3; axis++) {
        at.voxel[axis] = v_gather_long((K_GLOBAL const long *)places, lane * PLACE_LONGS + axis);
        at.fraction[axis] = v_gather_uint((K_GLOBAL const uint *)places, lane * PLACE_UINTS + FRACTION_AT + axis);
    }
    return at;
}

/* gradient: three floats a point, if it is wanted. */
__kernel K_WIDE void find_points(K_GLOBAL const karst_point_place *places, uint num, world_data data, int level,
                                 int wants_gradient, K_GLOBAL float *density, K_GLOBAL float *gradient)
{
    const uint first = (uint)get_global_id(0) * LANES;
    if (first >= num)
        return;
    const int left = (int)min(num - first, (uint)LANES);
    const vint lane = v_select(v_lt(V_LANE + (vint)(0), (vint)(left)), V_LANE + (vint)(0), (vint)(0));
    const world_point_at at = place_of(places + first, lane);
    float values[4][LANES];
    if (wants_gradient) {
        vfloat slopes[3];
        v_store_float(world_surface(data, &at, level, slopes), values[3]);
        for (int axis = 0; axis < 3; axis++)
            v_store_float(slopes[axis], values[axis]);
        for (int i = 0; i < left; i++)
            for (int axis = 0; axis < 3; axis++)
                gradient[3 * (first + (uint)i) + (uint)axis] = values[axis][i];
    } else {
        v_store_float(world_point(data, &at, level), values[3]);
    }
    for (int i = 0; i < left; i++)
        density[first + (uint)i] = values[3][i];
}
