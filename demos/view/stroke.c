/* What tools lay: see demos/view/stroke.h. */
#include "demos/view/stroke.h"

#include <math.h>
#include <string.h>

#define SPACING 0.3        /* of the size, between touches of a stroke */
#define STAMP_SPACING 2.0
#define BRIDGE 3.0         /* of the size: farther apart, touches are not joined */
#define HELD_STILL_S 0.25
#define BLEND 0.15         /* of the size */
#define FARTHEST_PLANE 4.0 /* of the size, from which land is still flattened */

const char *const view_tool_names[VIEW_NUM_TOOLS] = {"none",    "add",   "dig",  "smooth",
                                                     "flatten", "paint", "stamp"};
const char *const view_stamp_names[VIEW_NUM_STAMPS] = {"boulder", "block", "post"};
const view_paint view_paints[VIEW_NUM_PAINTS] = {
    {"grass", {0.08, 0.19, 0.03}}, {"ochre", {0.42, 0.23, 0.06}}, {"brick", {0.35, 0.06, 0.03}},
    {"chalk", {0.82, 0.80, 0.74}}, {"slate", {0.09, 0.10, 0.12}}, {"sand", {0.55, 0.43, 0.26}},
    {"moss", {0.20, 0.24, 0.05}},  {"blue", {0.04, 0.12, 0.45}},
};

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static karst_position along(const view_ground *ground, const karst_position *at, const double direction[3], double m)
{
    const double offset_m[3] = {direction[0] * m, direction[1] * m, direction[2] * m};
    return karst_position_add_m(*at, offset_m, ground->voxel_log2_m);
}

static double density_along(const view_ground *ground, const karst_position *at, const double direction[3], double m)
{
    const karst_position place = along(ground, at, direction, m);
    return ground->density(ground->user, &place);
}

/* ---- the land ---- */

#define SEARCH_STEPS 4 /* each way */
#define HALVINGS 7

bool view_find_surface(const view_ground *ground, const karst_position *at, const double direction[3], double reach_m,
                       double *height_m, double *steepness)
{
    const double step_m = reach_m / SEARCH_STEPS;
    double densities[2 * SEARCH_STEPS + 1];
    int best = -1;
    for (int i = 0; i <= 2 * SEARCH_STEPS; i++)
        densities[i] = density_along(ground, at, direction, (i - SEARCH_STEPS) * step_m);
    for (int i = 0; i < 2 * SEARCH_STEPS; i++) {
        const bool crosses = densities[i] > 0 && !(densities[i + 1] > 0);
        if (crosses && (best < 0 || fabs(i + 0.5 - SEARCH_STEPS) < fabs(best + 0.5 - SEARCH_STEPS)))
            best = i;
    }
    if (best < 0)
        return false;
    double low_m = (best - SEARCH_STEPS) * step_m, high_m = low_m + step_m;
    for (int i = 0; i < HALVINGS; i++) {
        const double middle_m = (low_m + high_m) / 2;
        if (density_along(ground, at, direction, middle_m) > 0)
            low_m = middle_m;
        else
            high_m = middle_m;
    }
    *height_m = (low_m + high_m) / 2;
    if (steepness)
        *steepness = (densities[best] - densities[best + 1]) / step_m;
    return true;
}

view_spot view_find_spot(const view_ground *ground, const karst_position *at, double width_m, const double towards[3])
{
    view_spot spot = {.at = *at};
    double square = 0;
    for (int axis = 0; axis < 3; axis++) {
        const double direction[3] = {axis == 0, axis == 1, axis == 2};
        spot.normal[axis] = density_along(ground, at, direction, -width_m / 2) -
                            density_along(ground, at, direction, width_m / 2);
        square += spot.normal[axis] * spot.normal[axis];
    }
    const bool falls = square > 0 && isfinite(square);
    for (int axis = 0; axis < 3; axis++)
        spot.normal[axis] = falls ? spot.normal[axis] / sqrt(square) : towards[axis];
    return spot;
}

void view_make_sides(const double normal[3], double u[3], double v[3])
{
    /* Across the axis that the normal is farthest from. */
    int least = 0;
    for (int axis = 1; axis < 3; axis++)
        least = fabs(normal[axis]) < fabs(normal[least]) ? axis : least;
    const double axis[3] = {least == 0, least == 1, least == 2}, share = normal[least];
    double square = 0;
    for (int i = 0; i < 3; i++) {
        u[i] = axis[i] - share * normal[i];
        square += u[i] * u[i];
    }
    for (int i = 0; i < 3; i++)
        u[i] /= sqrt(square);
    for (int i = 0; i < 3; i++)
        v[i] = normal[(i + 1) % 3] * u[(i + 2) % 3] - normal[(i + 2) % 3] * u[(i + 1) % 3];
}

/* Solves a system of three equations whose matrix is symmetric; false: it says too little. */
static bool solve(const double m[3][3], const double right[3], double solution[3])
{
    double determinant = 0, of[4];
    for (int column = -1; column < 3; column++) { /* Cramer's rule; -1: the matrix itself */
        double a[3][3];
        memcpy(a, m, sizeof a);
        for (int row = 0; row < 3 && column >= 0; row++)
            a[row][column] = right[row];
        of[column + 1] = a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
                         a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
                         a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
    }
    determinant = of[0];
    if (!(fabs(determinant) > 1e-6))
        return false;
    for (int i = 0; i < 3; i++)
        solution[i] = of[i + 1] / determinant;
    return true;
}

bool view_fit_plane(const view_ground *ground, const view_spot *spot, double radius_m, view_spot *plane,
                    double *steepness)
{
    static const struct {
        int num;
        double radius;
    } rings[] = {{1, 0}, {6, 0.4}, {10, 0.8}};
    double u[3], v[3], m[3][3] = {{0}}, right[3] = {0}, fit[3], sum = 0;
    int num = 0;
    view_make_sides(spot->normal, u, v);
    for (size_t ring = 0; ring < sizeof rings / sizeof *rings; ring++)
        for (int i = 0; i < rings[ring].num; i++) {
            const double angle = 2 * M_PI * i / rings[ring].num, r = rings[ring].radius;
            const double row[3] = {1, r * cos(angle), r * sin(angle)}; /* in radii */
            double aside_m[3], height_m, steep;
            for (int axis = 0; axis < 3; axis++)
                aside_m[axis] = radius_m * (row[1] * u[axis] + row[2] * v[axis]);
            const karst_position at = karst_position_add_m(spot->at, aside_m, ground->voxel_log2_m);
            if (!view_find_surface(ground, &at, spot->normal, radius_m, &height_m, &steep))
                continue;
            num++;
            sum += steep;
            for (int a = 0; a < 3; a++) {
                right[a] += row[a] * height_m / radius_m;
                for (int b = 0; b < 3; b++)
                    m[a][b] += row[a] * row[b];
            }
        }
    if (num < 5 || !solve((const double(*)[3])m, right, fit))
        return false;
    double square = 0;
    for (int axis = 0; axis < 3; axis++) {
        plane->normal[axis] = spot->normal[axis] - fit[1] * u[axis] - fit[2] * v[axis];
        square += plane->normal[axis] * plane->normal[axis];
    }
    for (int axis = 0; axis < 3; axis++)
        plane->normal[axis] /= sqrt(square);
    plane->at = along(ground, &spot->at, spot->normal, fit[0] * radius_m);
    *steepness = sum / num;
    return true;
}

/* ---- tools ---- */

double view_brush_circle_m(const view_brush *brush)
{
    const bool is_cap = brush->tool == VIEW_TOOL_ADD || brush->tool == VIEW_TOOL_DIG;
    return brush->size_m * (is_cap ? sqrt(brush->strength * (2 - brush->strength)) : 1);
}

/* A density that is steep outweighs a plane, whose density is metres: this share of the plane moves land `share` of the
 * way. */
static double share_for(double share, double steepness)
{
    const double steep = steepness > 0 && isfinite(steepness) ? steepness : 1;
    return fmin(1, fmax(1e-3, share * steep / (1 - share + share * steep)));
}

/* A ball, or a rod from the centre of the last one. */
static void join(const view_stroke *stroke, const view_brush *brush, const karst_position *at, int voxel_log2_m,
                 karst_edit *edit)
{
    double way_m[3];
    edit->at = *at;
    edit->radius_m = brush->size_m;
    if (!stroke->num_laid)
        return;
    karst_position_difference_m(stroke->last_at, *at, voxel_log2_m, way_m);
    const double length_m = sqrt(dot(way_m, way_m));
    if (length_m < 1e-3 * brush->size_m || length_m > BRIDGE * brush->size_m)
        return;
    edit->shape = KARST_EDIT_CAPSULE;
    edit->at = stroke->last_at;
    memcpy(edit->to_m, way_m, sizeof edit->to_m);
}

static void towards_plane(const view_spot *plane, double radius_m, double share, karst_edit *edit)
{
    edit->mode = KARST_EDIT_SMOOTH;
    edit->at = plane->at;
    edit->radius_m = radius_m;
    edit->strength = share;
    memcpy(edit->normal, plane->normal, sizeof edit->normal);
}

static bool flatten(const view_stroke *stroke, const view_brush *brush, const view_spot *spot,
                    const view_ground *ground, karst_edit *edit)
{
    double from_begin_m[3];
    view_spot plane = stroke->begin;
    karst_position_difference_m(plane.at, spot->at, ground->voxel_log2_m, from_begin_m);
    const double height_m = dot(from_begin_m, plane.normal);
    if (fabs(height_m) > FARTHEST_PLANE * brush->size_m)
        return false;
    plane.at = along(ground, &spot->at, plane.normal, -height_m);
    const double radius_m = hypot(brush->size_m, height_m); /* so that it reaches the spot */
    towards_plane(&plane, radius_m, brush->strength, edit);
    if (brush->strength == 1) {
        edit->mode = KARST_EDIT_FLATTEN;
        edit->blend_m = BLEND * brush->size_m;
    }
    return true;
}

/* Each place has its own boulder. */
static uint32_t seed_of(const karst_position *at)
{
    uint64_t bits = 0x9e3779b97f4a7c15u;
    for (int axis = 0; axis < 3; axis++)
        bits = (bits ^ (uint64_t)at->voxel[axis] ^ (uint64_t)at->fraction[axis] << 32) * 0xbf58476d1ce4e5b9u;
    return (uint32_t)(bits >> 32);
}

static void stamp(const view_brush *brush, const view_spot *spot, const view_ground *ground, karst_edit *edit)
{
    const double size_m = brush->size_m, voxel_m = ldexp(1, ground->voxel_log2_m), half_m = VIEW_STAMP_HALF * size_m;
    switch (brush->stamp) {
    case VIEW_STAMP_BLOCK:
        edit->shape = KARST_EDIT_BOX;
        edit->half_m[0] = edit->half_m[1] = edit->half_m[2] = half_m;
        break;
    case VIEW_STAMP_POST:
        edit->shape = KARST_EDIT_CAPSULE;
        edit->radius_m = VIEW_POST_RADIUS * size_m;
        for (int axis = 0; axis < 3; axis++)
            edit->to_m[axis] = VIEW_POST_LENGTH * size_m * brush->strength * spot->normal[axis];
        edit->at = spot->at;
        return;
    default:
        edit->shape = KARST_EDIT_NOISE;
        edit->radius_m = half_m;
        edit->amplitude_m = 0.4 * size_m;
        edit->scale_m = fmax(0.8 * size_m, voxel_m);
        edit->seed = seed_of(&spot->at);
        break;
    }
    edit->at = along(ground, &spot->at, spot->normal, half_m * (2 * brush->strength - 1)); /* 0: sunk, 1: on the land */
    edit->blend_m = 0.05 * size_m;
}

view_due view_stroke_due(const view_stroke *stroke, const view_brush *brush, const view_spot *spot, double now_s,
                         int voxel_log2_m)
{
    double way_m[3];
    if (!stroke->num_laid)
        return VIEW_DUE_BY_WAY;
    karst_position_difference_m(stroke->last.at, spot->at, voxel_log2_m, way_m);
    const double spacing_m = (brush->tool == VIEW_TOOL_STAMP ? STAMP_SPACING : SPACING) * brush->size_m;
    if (sqrt(dot(way_m, way_m)) >= spacing_m)
        return VIEW_DUE_BY_WAY;
    const bool does_more =
        brush->tool == VIEW_TOOL_ADD || brush->tool == VIEW_TOOL_DIG || brush->tool == VIEW_TOOL_SMOOTH;
    return does_more && now_s - stroke->last_s >= HELD_STILL_S ? VIEW_DUE_BY_TIME : VIEW_NOT_DUE;
}

bool view_stroke_lay(view_stroke *stroke, const view_brush *brush, const view_spot *spot, double now_s,
                     const view_ground *ground, karst_edit *edit)
{
    const double size_m = brush->size_m;
    view_spot plane;
    double steepness = 1;
    *edit = (karst_edit){.scale_m = 1, .strength = 1};
    karst_position at = spot->at;
    switch (brush->tool) {
    case VIEW_TOOL_ADD:
    case VIEW_TOOL_DIG: {
        const double depth_m = (1 - brush->strength) * size_m;
        edit->mode = brush->tool == VIEW_TOOL_ADD ? KARST_EDIT_ADD : KARST_EDIT_REMOVE;
        at = along(ground, &spot->at, spot->normal, brush->tool == VIEW_TOOL_ADD ? -depth_m : depth_m);
        join(stroke, brush, &at, ground->voxel_log2_m, edit);
        edit->blend_m = BLEND * size_m;
        break;
    }
    case VIEW_TOOL_SMOOTH:
        if (!view_fit_plane(ground, spot, size_m, &plane, &steepness))
            return false;
        towards_plane(&plane, size_m, share_for(brush->strength, steepness), edit);
        break;
    case VIEW_TOOL_FLATTEN:
        if (!stroke->has_begin && !view_fit_plane(ground, spot, size_m, &stroke->begin, &steepness))
            stroke->begin = *spot;
        stroke->has_begin = true;
        if (!flatten(stroke, brush, spot, ground, edit))
            return false;
        break;
    case VIEW_TOOL_PAINT:
        edit->mode = KARST_EDIT_PAINT;
        join(stroke, brush, &at, ground->voxel_log2_m, edit);
        edit->blend_m = BLEND * size_m;
        edit->has_colour = true;
        edit->strength = brush->strength;
        memcpy(edit->colour, view_paints[brush->paint].albedo, sizeof edit->colour);
        break;
    case VIEW_TOOL_STAMP:
        stamp(brush, spot, ground, edit);
        break;
    default:
        return false;
    }
    stroke->num_laid++;
    stroke->last = *spot;
    stroke->last_at = at;
    stroke->last_s = now_s;
    return true;
}
