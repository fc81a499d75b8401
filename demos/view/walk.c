/* Walking: on the ground and along walls, by the density itself. The body is a column of points above the feet; where
 * it would enter solid it is moved out along the gradient, so that what remains of a step is the part along the wall.
 */
#include "demos/view/view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define GRAVITY_M_S2 9.81
#define RADIUS 0.18   /* of the body, in eye heights */
#define STEP 0.30     /* what one climbs without a jump, in eye heights */
#define JUMP 0.6      /* how high, in eye heights */
#define PIECE 0.12    /* a way is walked in pieces of at most this, in eye heights */
#define MAX_PIECES 64 /* a faster walk passes through what is thinner than its pieces */
#define MOST_PUSHES 4
#define REACTION_S 0.07

/* Detail finer than a hundredth of the eye's height is not felt. */
static double footprint_m(const viewer *v) { return v->settings.eye_m / 100; }

static double density_at(viewer *v, const karst_position *feet, double up_m)
{
    karst_position at = karst_position_add_m(*feet, (double[3]){0, up_m, 0}, v->metadata->voxel_log2_m);
    return karst_sampler_precise_density(v->sampler, &at, footprint_m(v));
}

static bool is_solid(viewer *v, const karst_position *feet, double up_m)
{
    double density = density_at(v, feet, up_m);
    return density > 0; /* what is not finite counts as air, as in bricks */
}

/* How far solid reaches into the body at a height, and the way out: first order, from density and gradient. */
static bool push_out(viewer *v, karst_position *feet, double up_m)
{
    karst_position at = karst_position_add_m(*feet, (double[3]){0, up_m, 0}, v->metadata->voxel_log2_m);
    karst_sample gradient[3], density;
    if (!karst_sampler_gradient(v->sampler, &at, footprint_m(v), gradient, &density))
        return false;
    double square = 0, across = 0, radius_m = RADIUS * v->settings.eye_m;
    for (int axis = 0; axis < 3; axis++) {
        double g = gradient[axis].precise;
        square += g * g;
        across += axis == 1 ? 0 : g * g;
    }
    if (!(square > 0) || !isfinite(square) || !isfinite(density.precise))
        return false;
    /* Solid within the radius? The density at distance r against the gradient is about d + r |g|. */
    double inside_m = density.precise / sqrt(square) + radius_m;
    if (inside_m <= 0)
        return false;
    /* Walls push sideways; only what is nearly level pushes up, and that is the ground's task. */
    if (across < 0.25 * square)
        return false;
    double way_m = fmin(inside_m * sqrt(square / across), radius_m) / sqrt(across);
    double back_m[3] = {-gradient[0].precise * way_m, 0, -gradient[2].precise * way_m};
    *feet = karst_position_add_m(*feet, back_m, v->metadata->voxel_log2_m);
    return true;
}

/* The height of the ground relative to the feet, looked for from `from_m` down to `to_m`; false: there is none. */
static bool find_ground(viewer *v, const karst_position *feet, double from_m, double to_m, double *height_m)
{
    const int pieces = 8;
    if (is_solid(v, feet, from_m)) /* in the rock */
        return false;
    double air_m = from_m;
    for (int i = 1; i <= pieces; i++) {
        double at_m = from_m + (to_m - from_m) * i / pieces;
        if (!is_solid(v, feet, at_m)) {
            air_m = at_m;
            continue;
        }
        double solid_m = at_m;
        for (int k = 0; k < 16; k++) {
            double middle_m = (air_m + solid_m) / 2;
            if (is_solid(v, feet, middle_m))
                solid_m = middle_m;
            else
                air_m = middle_m;
        }
        *height_m = air_m;
        return true;
    }
    return false;
}

/* Sideways, stopping at what is too high to step on. */
static void walk_piece(viewer *v, karst_position *feet, const double way_m[3])
{
    const double eye_m = v->settings.eye_m;
    karst_position to = karst_position_add_m(*feet, way_m, v->metadata->voxel_log2_m);
    for (int push = 0; push < MOST_PUSHES; push++) {
        bool pushed = false;
        for (double up = STEP + RADIUS; up <= 1; up += 0.25)
            pushed = push_out(v, &to, up * eye_m) || pushed;
        if (!pushed)
            break;
    }
    /* In a corner no push helps: one stays. */
    for (double up = STEP + RADIUS; up <= 1; up += 0.25)
        if (is_solid(v, &to, up * eye_m))
            return;
    *feet = to;
}

karst_sampler *view_sampler_create(const viewer *v, karst_world *compiled, karst_error *error)
{
    karst_sampler *sampler = karst_sampler_create(compiled, error);
    size_t num;
    if (!sampler || karst_engine_num_edits(v->engine, NULL) == 0)
        return sampler;
    karst_edit *edits = view_edits_all(v, &num, NULL, error);
    if (!edits || !karst_sampler_set_edits(sampler, edits, num, error)) {
        karst_sampler_destroy(sampler);
        sampler = NULL;
    }
    free(edits);
    return sampler;
}

bool view_walk_begin(viewer *v)
{
    karst_error error = {0};
    if (!v->metadata) {
        view_complain(v, "the world cannot be sampled, so there is no ground to walk on");
        return false;
    }
    if (!v->sampler)
        v->sampler = view_sampler_create(v, v->compiled, &error);
    if (!v->sampler)
        view_complain(v, "%s", error.message);
    return v->sampler != NULL;
}

bool view_walk(viewer *v, const double wish_m_s[3], bool jump, double dt_s)
{
    view_motion *m = &v->motion;
    const double eye_m = v->settings.eye_m;
    const int voxel_log2_m = v->metadata->voxel_log2_m;
    karst_position before = m->camera.position;
    karst_position feet = karst_position_add_m(before, (double[3]){0, -eye_m, 0}, voxel_log2_m);

    double left = exp(-dt_s / REACTION_S), way_m[3], length_m = 0;
    for (int axis = 0; axis < 3; axis += 2) {
        double lag = m->velocity_m_s[axis] - wish_m_s[axis];
        way_m[axis] = wish_m_s[axis] * dt_s + lag * REACTION_S * (1 - left);
        m->velocity_m_s[axis] = wish_m_s[axis] + lag * left;
        length_m += way_m[axis] * way_m[axis];
    }
    way_m[1] = 0;
    length_m = sqrt(length_m);
    if (length_m < 1e-4 * eye_m) {
        length_m = 0;
        memset(m->velocity_m_s, 0, sizeof m->velocity_m_s);
    }
    int pieces = (int)fmin(MAX_PIECES, ceil(length_m / (PIECE * eye_m)));
    for (int i = 0; i < pieces; i++) {
        double piece_m[3] = {way_m[0] / pieces, 0, way_m[2] / pieces}, height_m;
        walk_piece(v, &feet, piece_m);
        /* Up a slope piece by piece, or the next one would start inside of it. */
        if (m->on_ground && find_ground(v, &feet, STEP * eye_m, -STEP * eye_m, &height_m))
            feet = karst_position_add_m(feet, (double[3]){0, height_m, 0}, voxel_log2_m);
    }

    if (jump && m->on_ground) {
        m->fall_m_s = sqrt(2 * GRAVITY_M_S2 * JUMP * eye_m);
        m->on_ground = false;
    }
    double drop_m = m->fall_m_s * dt_s - GRAVITY_M_S2 * dt_s * dt_s / 2, height_m;
    if (is_solid(v, &feet, STEP * eye_m)) {
        /* Inside of something, as after a flight into it: up and out, ever faster. */
        m->fall_m_s = fmax(eye_m, m->fall_m_s * 1.2);
        feet = karst_position_add_m(feet, (double[3]){0, fmin(m->fall_m_s * dt_s, 100 * eye_m), 0}, voxel_log2_m);
        m->on_ground = false;
    } else if (m->fall_m_s <= 0 &&
               find_ground(v, &feet, STEP * eye_m, fmin(drop_m, m->on_ground ? -STEP * eye_m : 0) - 1e-3 * eye_m,
                           &height_m)) {
        feet = karst_position_add_m(feet, (double[3]){0, height_m, 0}, voxel_log2_m);
        m->on_ground = true;
        m->fall_m_s = 0;
    } else {
        m->on_ground = false;
        if (drop_m > 0 && is_solid(v, &feet, eye_m * 1.1 + drop_m)) /* the ceiling */
            drop_m = m->fall_m_s = 0;
        feet = karst_position_add_m(feet, (double[3]){0, drop_m, 0}, voxel_log2_m);
        m->fall_m_s -= GRAVITY_M_S2 * dt_s;
    }
    m->camera.position = karst_position_add_m(feet, (double[3]){0, eye_m, 0}, voxel_log2_m);
    /* Standing is no motion: bisection would move the eye by less than one sees. */
    double moved_m[3];
    karst_position_difference_m(before, m->camera.position, voxel_log2_m, moved_m);
    if (m->on_ground && length_m == 0 && fabs(moved_m[1]) < 1e-3 * eye_m) {
        m->camera.position = before;
        return false;
    }
    return true;
}
