/* Sampling camera paths: cubic Hermite curves through the keyframes, with slopes that never overshoot. */
#include "karst/path.h"

#include <math.h>
#include <stdlib.h>

#include "core/base/path_internal.h"

#define DEGREES_PER_RADIAN 57.29577951308232

/* ---- slopes ---- */

/* The slope of the parabola through three points, held to where a cubic through them stays monotone (Fritsch and
 * Carlson, 1980: at most three times the flatter chord), and 0 at a turning point. */
static double inner_slope(double left_s, double left, double right_s, double right)
{
    double a = left / left_s, b = right / right_s;
    if ((a > 0) != (b > 0) || a == 0 || b == 0)
        return 0;
    double slope = (right_s * a + left_s * b) / (left_s + right_s);
    double most = 3 * fmin(fabs(a), fabs(b));
    return slope > most ? most : slope < -most ? -most : slope;
}

/* The same parabola at its first point, never against the first chord nor more than three times as steep. */
static double end_slope(double first_s, double first, double second_s, double second)
{
    double a = first / first_s, b = second / second_s;
    double slope = ((2 * first_s + second_s) * a - first_s * b) / (first_s + second_s);
    if ((slope > 0) != (a > 0) || a == 0)
        return 0;
    return fabs(slope) > 3 * fabs(a) ? 3 * a : slope;
}

static double span_s(const karst_path *path, size_t key) { return path->keys[key + 1].time_s - path->keys[key].time_s; }

/* Whether a curve, rather than a jump, leads from the keyframe to the next. */
static bool leads_on(const karst_path *path, size_t key) { return key + 1 < path->num_keys && span_s(path, key) > 0; }

static double slope_at(const karst_path *path, size_t key, int channel)
{
    const karst_path_key *keys = path->keys;
    bool after = leads_on(path, key), before = key > 0 && leads_on(path, key - 1);
    if (before && after)
        return inner_slope(span_s(path, key - 1), keys[key - 1].delta[channel], span_s(path, key),
                           keys[key].delta[channel]);
    if (after && leads_on(path, key + 1))
        return end_slope(span_s(path, key), keys[key].delta[channel], span_s(path, key + 1),
                         keys[key + 1].delta[channel]);
    if (after)
        return keys[key].delta[channel] / span_s(path, key);
    if (before && key > 1 && leads_on(path, key - 2))
        return end_slope(span_s(path, key - 1), keys[key - 1].delta[channel], span_s(path, key - 2),
                         keys[key - 2].delta[channel]);
    return before ? keys[key - 1].delta[channel] / span_s(path, key - 1) : 0;
}

void karst_path_measure(karst_path *path)
{
    for (size_t i = 0; i < path->num_keys; i++) {
        karst_path_key *key = &path->keys[i];
        double *d = key->direction;
        karst_position_difference_m(path->target, key->position, path->voxel_log2_m, d);
        key->distance_m = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        for (int axis = 0; axis < 3 && key->distance_m > 0; axis++)
            d[axis] /= key->distance_m;
    }
}

void karst_path_prepare(karst_path *path)
{
    for (size_t i = 0; i < path->num_keys; i++) {
        karst_path_key *a = &path->keys[i], *b = a + 1;
        if (!leads_on(path, i))
            continue;
        a->delta[KARST_PATH_YAW] = b->yaw_deg - a->yaw_deg;
        a->delta[KARST_PATH_PITCH] = b->pitch_deg - a->pitch_deg;
        if (path->kind == KARST_PATH_ZOOM) {
            for (int axis = 0; axis < 3; axis++)
                a->delta[KARST_PATH_X + axis] = b->direction[axis] - a->direction[axis];
            a->delta[KARST_PATH_DISTANCE] = log(b->distance_m / a->distance_m);
            a->delta[KARST_PATH_FOV] = log(b->fov_deg / a->fov_deg);
        } else {
            karst_position_difference_m(a->position, b->position, path->voxel_log2_m, a->delta);
            a->delta[KARST_PATH_FOV] = b->fov_deg - a->fov_deg;
        }
    }
    for (size_t i = 0; i < path->num_keys; i++)
        for (int channel = 0; channel < KARST_PATH_CHANNELS; channel++)
            path->keys[i].slope_s[channel] = slope_at(path, i, channel);
}

/* ---- sampling ---- */

/* Where a time lies: a share u of the span after keyframe `near` or, mirrored, before it. */
typedef struct {
    const karst_path_key *near, *far;
    double u;      /* 0 to 1/2, from near towards far */
    double span_s; /* negative if far is the earlier one */
} place;

static place find_place(const karst_path *path, double time_s)
{
    const karst_path_key *keys = path->keys;
    size_t last = path->num_keys - 1, low = 0, high = last;
    if (!(time_s > keys[0].time_s))
        time_s = keys[0].time_s;
    /* The last keyframe that is not after the time: of a jump's two, the second. */
    while (low < high) {
        size_t middle = high - (high - low) / 2;
        if (keys[middle].time_s <= time_s)
            low = middle;
        else
            high = middle - 1;
    }
    if (low == last)
        return (place){.near = &keys[last], .far = &keys[last]};
    double span = span_s(path, low), after = (time_s - keys[low].time_s) / span,
           before = (keys[low + 1].time_s - time_s) / span;
    if (after <= before)
        return (place){&keys[low], &keys[low + 1], after, span};
    return (place){&keys[low + 1], &keys[low], before, -span};
}

/* What a channel differs by from its value at the nearer keyframe. */
static double offset_of(const karst_path *path, const place *at, int channel)
{
    if (at->near == at->far)
        return 0;
    double u = at->u, delta = at->span_s > 0 ? at->near->delta[channel] : -at->far->delta[channel];
    if (path->kind == KARST_PATH_LINEAR)
        return u * delta;
    double near_rise = at->near->slope_s[channel] * at->span_s, far_rise = at->far->slope_s[channel] * at->span_s;
    /* The Hermite cubic from 0 to delta with these slopes, in powers of u. */
    return u * (near_rise + u * ((3 * delta - 2 * near_rise - far_rise) + u * (near_rise + far_rise - 2 * delta)));
}

/* Away from the target by direction and distance. */
static karst_position zoom_position(const karst_path *path, const place *at)
{
    if (at->u == 0)
        return at->near->position;
    double d[3], length_squared = 0;
    for (int axis = 0; axis < 3; axis++) {
        d[axis] = at->near->direction[axis] + offset_of(path, at, KARST_PATH_X + axis);
        length_squared += d[axis] * d[axis];
    }
    double scale = at->near->distance_m * exp(offset_of(path, at, KARST_PATH_DISTANCE)) / sqrt(length_squared);
    for (int axis = 0; axis < 3; axis++)
        d[axis] *= scale;
    return karst_position_add_m(path->target, d, path->voxel_log2_m);
}

static void look_at(const karst_path *path, karst_camera *camera)
{
    double d[3];
    karst_position_difference_m(camera->position, path->target, path->voxel_log2_m, d);
    camera->yaw_deg = atan2(d[0], d[2]) * DEGREES_PER_RADIAN;
    camera->pitch_deg = atan2(d[1], hypot(d[0], d[2])) * DEGREES_PER_RADIAN;
}

karst_camera karst_path_sample(const karst_path *path, double time_s)
{
    place at = find_place(path, time_s);
    karst_camera camera = {.yaw_deg = at.near->yaw_deg + offset_of(path, &at, KARST_PATH_YAW),
                           .pitch_deg = at.near->pitch_deg + offset_of(path, &at, KARST_PATH_PITCH)};
    double fov_offset = offset_of(path, &at, KARST_PATH_FOV);
    if (path->kind == KARST_PATH_ZOOM) {
        camera.position = zoom_position(path, &at);
        camera.fov_deg = at.near->fov_deg * exp(fov_offset);
        if (path->looks_at_target)
            look_at(path, &camera);
    } else {
        double offset_m[3];
        for (int axis = 0; axis < 3; axis++)
            offset_m[axis] = offset_of(path, &at, KARST_PATH_X + axis);
        camera.position = karst_position_add_m(at.near->position, offset_m, path->voxel_log2_m);
        camera.fov_deg = at.near->fov_deg + fov_offset;
    }
    return camera;
}

/* ---- what else it holds ---- */

double karst_path_start_s(const karst_path *path) { return path->keys[0].time_s; }
double karst_path_end_s(const karst_path *path) { return path->keys[path->num_keys - 1].time_s; }
const char *karst_path_world(const karst_path *path) { return path->world; }
const char *karst_path_description(const karst_path *path) { return path->description; }

void karst_path_destroy(karst_path *path)
{
    if (!path)
        return;
    free(path->world);
    free(path->description);
    free(path->keys);
    free(path);
}
