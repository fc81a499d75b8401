/* Scouts: few rays that ask for what many will need, soon after in this frame or some frames ahead. They stamp and want
 * like the picture's, with the frame's serial; what they hit is of no interest. */
#include <math.h>

#include "core/engine_parts.h"
#include "raycast/pinhole.h"

/* One ray for so many pixels across and down. A brick's voxels are half a pixel wide at least, so it is 8 pixels wide
 * where it is seen from the front. */
#define SCOUT_PIXELS 7
/* More than the rounding of both sides can need: sides go up to 16384 pixels. */
#define MORE_RAYS 4096
/* How far ahead, in frames. What is seen first is wanted, subdivided, loaded: three frames. */
#define FRAMES_AHEAD 6
/* Motion is steady when two frames' steps differ by no more than this share. */
#define STEADY 0.5

size_t karst_engine_scout_bytes(size_t num_pixels)
{
    return (num_pixels / (SCOUT_PIXELS * SCOUT_PIXELS) + MORE_RAYS) * sizeof(karst_hit);
}

static int scout_side(int side_px) { return side_px >= SCOUT_PIXELS ? side_px / SCOUT_PIXELS : 1; }

uint32_t karst_engine_scout_rays(const karst_engine *engine)
{
    return (uint32_t)scout_side(engine->width_px) * (uint32_t)scout_side(engine->height_px);
}

bool karst_engine_scout(karst_engine *engine, const karst_camera *camera, karst_error *error)
{
    karst_cast_view view;
    karst_pinhole pinhole;
    int width_px = engine->width_px, height_px = engine->height_px;
    karst_cast_view_init(&view, &camera->position, engine->root_corner, engine->top_level);
    view.serial = engine->serial;
    view.detail = (float)karst_engine_detail_px(engine);
    view.stands_for = SCOUT_PIXELS * SCOUT_PIXELS;
    /* The picture's rays, but for most of them: each asks for as much detail as those it stands for. */
    karst_pinhole_init(&pinhole, camera, width_px, height_px, engine->view_distance_voxels);
    pinhole.width_px = scout_side(width_px);
    pinhole.height_px = scout_side(height_px);
    pinhole.half_width *= fminf(1, (float)(pinhole.width_px * SCOUT_PIXELS) / (float)width_px);
    pinhole.half_height *= fminf(1, (float)(pinhole.height_px * SCOUT_PIXELS) / (float)height_px);
    return karst_cast_pinhole(engine->caster, &view, &pinhole, engine->scout_hits, error);
}

static double length(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

static bool is_steady(double a, double b, double difference)
{
    return difference <= STEADY * fmax(fabs(a), fabs(b));
}

void karst_engine_note_motion(karst_engine *engine)
{
    karst_engine_motion *motion = &engine->motion, before = *motion;
    const karst_camera *now = &engine->camera;
    if (!before.has_camera) {
        *motion = (karst_engine_motion){.has_camera = true, .camera = *now};
        return;
    }
    karst_position_difference_m(before.camera.position, now->position, engine->world->voxel_log2_m, motion->step_m);
    motion->yaw_deg = now->yaw_deg - before.camera.yaw_deg;
    motion->pitch_deg = now->pitch_deg - before.camera.pitch_deg;
    motion->camera = *now;
    double change_m[3];
    for (int axis = 0; axis < 3; axis++)
        change_m[axis] = motion->step_m[axis] - before.step_m[axis];
    double step_m = length(motion->step_m);
    bool moves = step_m > 0 || motion->yaw_deg != 0 || motion->pitch_deg != 0;
    motion->steady = moves && is_steady(step_m, length(before.step_m), length(change_m)) &&
                     is_steady(motion->yaw_deg, before.yaw_deg, fabs(motion->yaw_deg - before.yaw_deg)) &&
                     is_steady(motion->pitch_deg, before.pitch_deg, fabs(motion->pitch_deg - before.pitch_deg));
}

bool karst_engine_look_ahead(const karst_engine *engine, karst_camera *ahead)
{
    const karst_engine_motion *motion = &engine->motion;
    double voxel_m = exp2(engine->world->voxel_log2_m), way_m[3];
    for (int axis = 0; axis < 3; axis++)
        way_m[axis] = FRAMES_AHEAD * motion->step_m[axis];
    /* Within the root window, and where something of this view is still seen. */
    if (!motion->steady || length(way_m) > engine->view_distance_voxels * voxel_m / 4)
        return false;
    *ahead = engine->camera;
    ahead->position = karst_position_add_m(ahead->position, way_m, engine->world->voxel_log2_m);
    ahead->yaw_deg += FRAMES_AHEAD * motion->yaw_deg;
    ahead->pitch_deg = fmax(-90, fmin(90, ahead->pitch_deg + FRAMES_AHEAD * motion->pitch_deg));
    return true;
}
