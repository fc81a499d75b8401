/* The land under the cross-hair, as the sampler has it: what tools touch. */
#include "demos/view/view.h"

#include <math.h>

#define REACH_FROZEN 4.0 /* of the size, along the ray: how far a stroke may have moved the land */
#define REACH 0.5

static double density_at(void *user, const karst_position *at)
{
    viewer *v = user;
    return karst_sampler_precise_density(v->sampler, at, v->edits.brush.size_m / 64);
}

view_ground view_edits_ground(viewer *v)
{
    return (view_ground){density_at, v, karst_engine_voxel_log2_m(v->engine)};
}

static bool is_frozen(const viewer *v)
{
    const view_edits *e = &v->edits;
    return e->is_down && e->brush.tool != VIEW_TOOL_SMOOTH;
}

void view_edits_freeze(viewer *v)
{
    if (v->sampler && is_frozen(v))
        karst_sampler_keep_edits(v->sampler, v->edits.num_frozen);
}

void view_edits_thaw(viewer *v)
{
    if (v->sampler)
        karst_sampler_keep_edits(v->sampler, karst_engine_num_edits(v->engine, NULL));
}

bool view_edits_find_spot(viewer *v, view_spot *spot)
{
    const view_edits *e = &v->edits;
    if (!v->sampler || !e->is_seen || !v->probe.hit || !isfinite(v->probe.depth_m))
        return false;
    double right[3], up[3], forward[3], ahead_m[3], towards[3], height_m;
    const view_ground ground = view_edits_ground(v);
    const bool frozen = is_frozen(v);
    karst_camera_axes(&e->seen, right, up, forward);
    for (int axis = 0; axis < 3; axis++) {
        ahead_m[axis] = forward[axis] * v->probe.depth_m;
        towards[axis] = -forward[axis];
    }
    karst_position at = karst_position_add_m(e->seen.position, ahead_m, ground.voxel_log2_m);
    /* The picture's hit is of what is there now. */
    const double reach_m = (frozen ? REACH_FROZEN : REACH) * e->brush.size_m;
    if (view_find_surface(&ground, &at, towards, reach_m, &height_m, NULL)) {
        for (int axis = 0; axis < 3; axis++)
            ahead_m[axis] = height_m * towards[axis];
        at = karst_position_add_m(at, ahead_m, ground.voxel_log2_m);
    } else if (frozen) {
        return false;
    }
    *spot = view_find_spot(&ground, &at, e->brush.size_m, towards);
    return true;
}
