/* The camera, frame by frame: fly, walk, orbit. What moves is the same at any frame time: speeds approach what keys ask
 * for exponentially, and ways are the integral of that, not a sum of steps. */
#include "demos/view/devices.h"
#include "demos/view/view.h"

#include <math.h>
#include <string.h>

#define REST 0.02       /* of the speed: slower is standing */
#define REACTION_S 0.07 /* in which a speed comes 63 % of the way */
#define ARROW_DEG_PER_S 60.0
#define ORBIT_DEG_PER_S 45.0

const char *const view_mode_names[] = {"fly", "walk", "orbit"};

/* ---- what keys and gamepad ask for ---- */

/* The share of the step that a key was held. */
static double held(viewer *v, int key, double dt_s)
{
    double time_s = v->key_held_s[key];
    v->key_held_s[key] = 0;
    if (v->key_down_s[key] >= 0) {
        double end_s = v->now_s, start_s = fmax(v->key_down_s[key], end_s - dt_s);
        time_s += fmax(0, end_s - start_s);
        /* A key that went down just now moves with this frame: what is owed is not lost, the next step counts from now.
         */
        v->key_down_s[key] = end_s;
    }
    return fmin(1, time_s / dt_s);
}

bool view_gamepad_present(void)
{
    for (int joystick = GLFW_JOYSTICK_1; joystick <= GLFW_JOYSTICK_LAST; joystick++)
        if (glfwJoystickIsGamepad(joystick))
            return true;
    return false;
}

static void add_gamepad(view_wishes *w, double dt_s)
{
    for (int joystick = GLFW_JOYSTICK_1; joystick <= GLFW_JOYSTICK_LAST; joystick++) {
        GLFWgamepadstate pad;
        if (!glfwJoystickIsGamepad(joystick) || !glfwGetGamepadState(joystick, &pad))
            continue;
        view_pad_add(w, &pad, dt_s);
        return;
    }
}

static view_wishes read_wishes(viewer *v, double dt_s)
{
    view_wishes w = {.faster = 1};
    w.forward = held(v, GLFW_KEY_W, dt_s) - held(v, GLFW_KEY_S, dt_s);
    w.right = held(v, GLFW_KEY_D, dt_s) - held(v, GLFW_KEY_A, dt_s);
    w.up = held(v, GLFW_KEY_E, dt_s) - held(v, GLFW_KEY_Q, dt_s);
    /* Arrows look around, and zoomed in as slowly as the picture is narrow. */
    double degrees = ARROW_DEG_PER_S * dt_s * fmin(1, v->motion.camera.fov_deg / 60);
    w.turn_deg = (held(v, GLFW_KEY_RIGHT, dt_s) - held(v, GLFW_KEY_LEFT, dt_s)) * degrees;
    w.tilt_deg = (held(v, GLFW_KEY_UP, dt_s) - held(v, GLFW_KEY_DOWN, dt_s)) * degrees;
    if (v->key_down_s[GLFW_KEY_LEFT_SHIFT] >= 0 || v->key_down_s[GLFW_KEY_RIGHT_SHIFT] >= 0)
        w.faster *= 10;
    if (v->key_down_s[GLFW_KEY_LEFT_CONTROL] >= 0 || v->key_down_s[GLFW_KEY_RIGHT_CONTROL] >= 0)
        w.faster /= 10;
    add_gamepad(&w, dt_s);
    return w;
}

/* ---- looking ---- */

/* Keeps yaw where formats and people like it, and pitch short of turning over. */
static void turn(karst_camera *camera, double turn_deg, double tilt_deg)
{
    camera->yaw_deg = fmod(camera->yaw_deg + turn_deg, 360);
    if (camera->yaw_deg < 0)
        camera->yaw_deg += 360;
    camera->pitch_deg = fmin(90, fmax(-90, camera->pitch_deg + tilt_deg));
}

/* On a sphere around the pivot, looking at it. */
static void place_on_orbit(viewer *v)
{
    view_motion *m = &v->motion;
    double right[3], up[3], forward[3], back_m[3];
    karst_camera_axes(&m->camera, right, up, forward);
    for (int axis = 0; axis < 3; axis++)
        back_m[axis] = -forward[axis] * m->pivot_distance_m;
    m->camera.position = karst_position_add_m(m->pivot, back_m, karst_engine_voxel_log2_m(v->engine));
}

void view_look(viewer *v, double x_px, double y_px)
{
    view_motion *m = &v->motion;
    double degrees_per_px = m->camera.fov_deg / (v->height_px > 0 ? v->height_px : 1);
    if (m->mode == VIEW_ORBIT) {
        turn(&m->camera, 2 * x_px * degrees_per_px, -2 * y_px * degrees_per_px);
        place_on_orbit(v);
    } else {
        turn(&m->camera, x_px * degrees_per_px, -y_px * degrees_per_px);
    }
    m->dirty = true;
}

/* ---- modes ---- */

static void start_orbit(viewer *v)
{
    view_motion *m = &v->motion;
    double right[3], up[3], forward[3], ahead_m[3];
    m->pivot_distance_m = v->probe.hit && v->probe.depth_m > 0 ? v->probe.depth_m : 10 * m->speed_m_s;
    karst_camera_axes(&m->camera, right, up, forward);
    for (int axis = 0; axis < 3; axis++)
        ahead_m[axis] = forward[axis] * m->pivot_distance_m;
    m->pivot = karst_position_add_m(m->camera.position, ahead_m, karst_engine_voxel_log2_m(v->engine));
}

void view_set_mode(viewer *v, view_mode mode)
{
    if (mode == VIEW_WALK) {
        if (!view_walk_begin(v))
            mode = VIEW_ORBIT;
        else if (v->motion.mode != VIEW_WALK) { /* people walk so fast */
            v->flying_speed_m_s = v->motion.speed_m_s;
            v->motion.speed_m_s = v->settings.eye_m * 2;
        }
    } else if (v->motion.mode == VIEW_WALK) {
        v->motion.speed_m_s = v->flying_speed_m_s;
    }
    memset(v->motion.velocity_m_s, 0, sizeof v->motion.velocity_m_s);
    v->motion.fall_m_s = 0;
    v->motion.on_ground = false;
    v->motion.mode = mode;
    if (mode == VIEW_ORBIT)
        start_orbit(v);
    view_toast(v, "%s", view_mode_names[mode]);
}

void view_set_camera(viewer *v, const karst_camera *camera)
{
    v->motion.camera = *camera;
    v->motion.dirty = true;
    memset(v->motion.velocity_m_s, 0, sizeof v->motion.velocity_m_s);
    v->motion.fall_m_s = 0;
    v->motion.on_ground = false;
    if (v->motion.mode == VIEW_ORBIT)
        v->motion.mode = VIEW_FLY;
}

/* The way of this step, while the velocity approaches what is wished for. */
static void approach(double velocity_m_s[3], const double wish_m_s[3], double dt_s, double way_m[3])
{
    double left = exp(-dt_s / REACTION_S);
    for (int axis = 0; axis < 3; axis++) {
        double lag = velocity_m_s[axis] - wish_m_s[axis];
        way_m[axis] = wish_m_s[axis] * dt_s + lag * REACTION_S * (1 - left);
        velocity_m_s[axis] = wish_m_s[axis] + lag * left;
    }
}

static bool fly(viewer *v, const view_wishes *w, double dt_s)
{
    view_motion *m = &v->motion;
    double right[3], up[3], forward[3], wish_m_s[3], way_m[3];
    karst_camera_axes(&m->camera, right, up, forward);
    double length = sqrt(w->right * w->right + w->up * w->up + w->forward * w->forward);
    double speed_m_s = m->speed_m_s * w->faster / fmax(1, length);
    bool wished = length > 0, drifting = false;
    if (wished)
        m->asked_speed_m_s = m->speed_m_s * w->faster;
    for (int axis = 0; axis < 3; axis++) {
        /* Up is the world's: one wants to rise, whichever way one looks. */
        double direction = w->right * right[axis] + w->forward * forward[axis] + (axis == 1 ? w->up : 0);
        wish_m_s[axis] = direction * speed_m_s;
        drifting = drifting || fabs(m->velocity_m_s[axis]) > REST * m->speed_m_s;
    }
    if (!wished && !drifting) {
        memset(m->velocity_m_s, 0, sizeof m->velocity_m_s);
        return false;
    }
    approach(m->velocity_m_s, wish_m_s, dt_s, way_m);
    m->camera.position = karst_position_add_m(m->camera.position, way_m, karst_engine_voxel_log2_m(v->engine));
    return true;
}

/* Ahead is where one looks, but along the ground. */
static bool walk(viewer *v, const view_wishes *w, double dt_s)
{
    double yaw = v->motion.camera.yaw_deg * (M_PI / 180), length = hypot(w->right, w->forward);
    double speed_m_s = v->motion.speed_m_s * w->faster / fmax(1, length);
    double wish_m_s[3] = {(w->right * cos(yaw) + w->forward * sin(yaw)) * speed_m_s, 0,
                          (w->forward * cos(yaw) - w->right * sin(yaw)) * speed_m_s};
    return view_walk(v, wish_m_s, w->up > 0, dt_s);
}

static bool orbit(viewer *v, const view_wishes *w, double dt_s)
{
    view_motion *m = &v->motion;
    if (w->right == 0 && w->up == 0 && w->forward == 0)
        return false;
    turn(&m->camera, -w->right * ORBIT_DEG_PER_S * dt_s * fmin(w->faster, 3),
         -w->up * ORBIT_DEG_PER_S * dt_s * fmin(w->faster, 3));
    m->pivot_distance_m *= exp(-w->forward * dt_s * fmin(w->faster, 3));
    place_on_orbit(v);
    return true;
}

bool view_move(viewer *v, double dt_s)
{
    view_motion *m = &v->motion;
    karst_camera before = m->camera;
    view_wishes w = read_wishes(v, dt_s);
    bool moved = m->dirty, looked = m->dirty;
    m->dirty = false;
    if (w.turn_deg != 0 || w.tilt_deg != 0)
        turn(&m->camera, w.turn_deg, w.tilt_deg);
    switch (m->mode) {
    case VIEW_WALK:
        moved = walk(v, &w, dt_s) || moved;
        break;
    case VIEW_FLY:
    case VIEW_NUM_MODES:
        moved = fly(v, &w, dt_s) || moved;
        break;
    case VIEW_ORBIT:
        if (w.turn_deg != 0 || w.tilt_deg != 0)
            place_on_orbit(v);
        moved = orbit(v, &w, dt_s) || moved;
        break;
    }
    moved = moved || memcmp(&before, &m->camera, sizeof before) != 0;
    if (moved)
        m->looked = looked;
    return moved;
}
