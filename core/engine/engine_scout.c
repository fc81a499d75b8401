/* Scouts: few rays that ask for what many will need, soon after in this frame or some frames ahead. They stamp and want
 * like the picture's, with the frame's serial; what they hit is of no interest. */
#include <math.h>

#include "core/engine/engine_parts.h"
#include "karst/view.h"
#include "raycast/cast/pinhole.h"

/* Motion is steady when two frames' steps differ by no more than this share. */
#define STEADY 0.5
/* Farther round is another view: that one turns so long is a guess. */
#define MOST_TURNED_DEG 90

static int scout_side(int side_px, int apart_px) { return side_px >= apart_px ? side_px / apart_px : 1; }

uint32_t karst_engine_scout_rays(const karst_engine *engine, int apart_px)
{
    return (uint32_t)scout_side(engine->width_px, apart_px) * (uint32_t)scout_side(engine->height_px, apart_px);
}

/* A share of the way between two rays, another one each time and evenly spread (multiples of a root of x^3 = x + 1, and
 * of its square). */
static float between_rays(uint32_t turn, double root) { return (float)(fmod(turn * root, 1) - 0.5); }

/* Moves the picture by shares of a ray's. */
static void shift_rays(karst_pinhole *pinhole, float right, float up)
{
    right *= 2 * pinhole->half_width / (float)pinhole->width_px;
    up *= 2 * pinhole->half_height / (float)pinhole->height_px;
    for (int axis = 0; axis < 3; axis++)
        pinhole->forward[axis] += right * pinhole->right[axis] + up * pinhole->up[axis];
}

/* As if the window were the whole: a picture whose middle the camera does not look at. */
static void aim_at_window(const karst_engine_window *window, karst_pinhole *pinhole, int width_px, int height_px)
{
    shift_rays(pinhole, (float)(window->x0_px + 0.5 * (width_px - window->whole_width_px)),
               (float)(0.5 * (window->whole_height_px - height_px) - window->y0_px));
    pinhole->half_width *= (float)width_px / (float)window->whole_width_px;
    pinhole->half_height *= (float)height_px / (float)window->whole_height_px;
}

bool karst_engine_scout(karst_engine *engine, const karst_camera *camera, bool whole, int apart_px, karst_error *error)
{
    karst_cast_view view;
    karst_pinhole pinhole;
    int width_px = whole ? engine->whole_width_px : engine->width_px;
    int height_px = whole ? engine->whole_height_px : engine->height_px;
    karst_cast_view_init(&view, &camera->position, engine->root_corner, engine->top_level);
    view.serial = engine->serial;
    view.detail = (float)karst_engine_detail_px(engine);
    view.stands_for = (uint32_t)(apart_px * apart_px);
    /* The picture's rays, but for most of them: each asks for as much detail as those it stands for. */
    if (engine->window.whole_width_px) {
        karst_pinhole_init(&pinhole, camera, engine->window.whole_width_px, engine->window.whole_height_px,
                           engine->view_distance_voxels);
        aim_at_window(&engine->window, &pinhole, width_px, height_px);
    } else {
        karst_pinhole_init(&pinhole, camera, width_px, height_px, engine->view_distance_voxels);
    }
    pinhole.width_px = scout_side(engine->width_px, apart_px);
    pinhole.height_px = scout_side(engine->height_px, apart_px);
    if (whole) {
        uint32_t turn = engine->num_whole_scouts++;
        shift_rays(&pinhole, between_rays(turn, 0.7548776662466927), between_rays(turn, 0.5698402909980532));
    } else {
        pinhole.half_width *= fminf(1, (float)(pinhole.width_px * apart_px) / (float)width_px);
        pinhole.half_height *= fminf(1, (float)(pinhole.height_px * apart_px) / (float)height_px);
    }
    return karst_cast_pinhole(engine->caster, &view, &pinhole, NULL, error) &&
           karst_engine_cast_into_stores(engine, &view, &pinhole, error);
}

static double length(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

static bool is_steady(double a, double b, double difference)
{
    return difference <= STEADY * fmax(fabs(a), fabs(b));
}

/* The angle about the vertical from one step to the next. */
static double turn_between(const double from[3], const double to[3])
{
    return atan2(from[2] * to[0] - from[0] * to[2], from[0] * to[0] + from[2] * to[2]);
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
    motion->turn_rad = turn_between(before.step_m, motion->step_m);
    motion->moved = step_m > 0 || motion->yaw_deg != 0 || motion->pitch_deg != 0;
    motion->steady = motion->moved && is_steady(step_m, length(before.step_m), length(change_m)) &&
                     is_steady(motion->yaw_deg, before.yaw_deg, fabs(motion->yaw_deg - before.yaw_deg)) &&
                     is_steady(motion->pitch_deg, before.pitch_deg, fabs(motion->pitch_deg - before.pitch_deg));
}

void karst_engine_follow(karst_engine *engine, const karst_path *path, double time_s, double frame_s)
{
    engine->path = path;
    engine->path_s = time_s;
    engine->path_step_s = frame_s;
}

/* Where the motion of the last two frames leads. */
static bool extrapolate(const karst_engine *engine, int num_frames, karst_camera *ahead)
{
    const karst_engine_motion *motion = &engine->motion;
    double way_m[3] = {0, num_frames * motion->step_m[1], 0};
    if (!motion->steady || fabs(num_frames * motion->yaw_deg) > MOST_TURNED_DEG)
        return false;
    for (int i = 1; i <= num_frames; i++) {
        double turn = i * motion->turn_rad, c = cos(turn), s = sin(turn);
        way_m[0] += c * motion->step_m[0] + s * motion->step_m[2];
        way_m[2] += c * motion->step_m[2] - s * motion->step_m[0];
    }
    *ahead = engine->camera;
    ahead->position = karst_position_add_m(ahead->position, way_m, engine->world->voxel_log2_m);
    ahead->yaw_deg += num_frames * motion->yaw_deg;
    ahead->pitch_deg = fmax(-90, fmin(90, ahead->pitch_deg + num_frames * motion->pitch_deg));
    return true;
}

bool karst_engine_look_ahead(const karst_engine *engine, int num_frames, karst_camera *ahead)
{
    double way_m[3];
    if (engine->path)
        *ahead = karst_path_sample(engine->path, engine->path_s + num_frames * engine->path_step_s);
    else if (!extrapolate(engine, num_frames, ahead))
        return false;
    /* Within the root window, and where something of this view is still seen. */
    karst_position_difference_m(engine->camera.position, ahead->position, engine->world->voxel_log2_m, way_m);
    return length(way_m) <= engine->view_distance_voxels * exp2(engine->world->voxel_log2_m) / 4;
}
