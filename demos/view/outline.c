/* Where the tool in hand would touch: lines on the land, as large as the edit would be. */
#include "demos/view/view.h"

#include <math.h>

#define NUM_POINTS 40
#define MARGIN_PX 4.0

typedef struct {
    double x, y; /* of the picture, pixels; what lies behind the eye has none */
    bool is_ahead;
} dot;

typedef struct {
    viewer *v;
    double right[3], up[3], forward[3], px; /* px: pixels of a length as far ahead as it is long */
} eye;

static eye open_eye(viewer *v)
{
    eye e = {.v = v, .px = v->height_px / (2 * tan(v->motion.camera.fov_deg * M_PI / 360))};
    karst_camera_axes(&v->motion.camera, e.right, e.up, e.forward);
    return e;
}

static dot see(const eye *e, const karst_position *at)
{
    double way_m[3], across[3] = {0};
    karst_position_difference_m(e->v->motion.camera.position, *at, karst_engine_voxel_log2_m(e->v->engine), way_m);
    for (int axis = 0; axis < 3; axis++) {
        across[0] += way_m[axis] * e->right[axis];
        across[1] += way_m[axis] * e->up[axis];
        across[2] += way_m[axis] * e->forward[axis];
    }
    if (!(across[2] > 0))
        return (dot){0, 0, false};
    return (dot){e->v->width_px / 2.0 + across[0] / across[2] * e->px,
                 e->v->height_px / 2.0 - across[1] / across[2] * e->px, true};
}

/* ---- what is drawn: one line of dots, broken where nothing is ahead ---- */

#define MAX_DOTS 128
typedef struct {
    dot dots[MAX_DOTS];
    int num;
} drawing;

static void add(drawing *d, dot one)
{
    if (d->num < MAX_DOTS)
        d->dots[d->num++] = one;
}

static void add_place(drawing *d, const eye *e, const view_spot *spot, const double offset_m[3])
{
    const karst_position at = karst_position_add_m(spot->at, offset_m, karst_engine_voxel_log2_m(e->v->engine));
    add(d, see(e, &at));
}

/* A circle around the spot, laid on the land where that is near. */
static void add_circle(drawing *d, const eye *e, const view_spot *spot, double radius_m, bool on_land)
{
    const view_ground ground = view_edits_ground(e->v);
    double u[3], v[3];
    view_make_sides(spot->normal, u, v);
    for (int i = 0; i <= NUM_POINTS; i++) {
        const double angle = 2 * M_PI * i / NUM_POINTS;
        double offset_m[3], height_m;
        for (int axis = 0; axis < 3; axis++)
            offset_m[axis] = radius_m * (cos(angle) * u[axis] + sin(angle) * v[axis]);
        const karst_position at = karst_position_add_m(spot->at, offset_m, ground.voxel_log2_m);
        if (on_land && view_find_surface(&ground, &at, spot->normal, radius_m, &height_m, NULL))
            for (int axis = 0; axis < 3; axis++)
                offset_m[axis] += height_m * spot->normal[axis];
        add_place(d, e, spot, offset_m);
    }
    add(d, (dot){0});
}

static void add_stick(drawing *d, const eye *e, const view_spot *spot, double from_m, double to_m)
{
    for (int end = 0; end < 2; end++) {
        double offset_m[3];
        for (int axis = 0; axis < 3; axis++)
            offset_m[axis] = (end ? to_m : from_m) * spot->normal[axis];
        add_place(d, e, spot, offset_m);
    }
    add(d, (dot){0});
}

/* The twelve edges of a box along the axes, as far along the normal as the stamp is. */
static void add_box(drawing *d, const eye *e, const view_spot *spot, double half_m, double out_m)
{
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 4; side++) {
            for (int end = -1; end <= 1; end += 2) {
                double offset_m[3];
                offset_m[axis] = end * half_m;
                offset_m[(axis + 1) % 3] = side & 1 ? half_m : -half_m;
                offset_m[(axis + 2) % 3] = side & 2 ? half_m : -half_m;
                for (int i = 0; i < 3; i++)
                    offset_m[i] += out_m * spot->normal[i];
                add_place(d, e, spot, offset_m);
            }
            add(d, (dot){0});
        }
}

static void outline(drawing *d, const eye *e, const view_spot *spot)
{
    const view_brush *brush = &e->v->edits.brush;
    const double circle_m = view_brush_circle_m(brush), size_m = brush->size_m;
    const bool is_stamp = brush->tool == VIEW_TOOL_STAMP;
    if (is_stamp && brush->stamp == VIEW_STAMP_BLOCK) {
        add_box(d, e, spot, VIEW_STAMP_HALF * size_m, VIEW_STAMP_HALF * size_m * (2 * brush->strength - 1));
        return;
    }
    if (is_stamp && brush->stamp == VIEW_STAMP_POST) {
        add_circle(d, e, spot, VIEW_POST_RADIUS * size_m, false);
        add_stick(d, e, spot, 0, VIEW_POST_LENGTH * size_m * brush->strength);
        return;
    }
    add_circle(d, e, spot, is_stamp ? VIEW_STAMP_HALF * size_m : circle_m, !is_stamp);
    switch (brush->tool) {
    case VIEW_TOOL_ADD: /* how high, how deep */
        add_stick(d, e, spot, 0, brush->strength * size_m);
        break;
    case VIEW_TOOL_DIG:
        add_stick(d, e, spot, 0, -brush->strength * size_m);
        break;
    case VIEW_TOOL_SMOOTH: /* where it is at half its strength */
        add_circle(d, e, spot, 0.54 * size_m, true);
        break;
    case VIEW_TOOL_FLATTEN:
        add_stick(d, e, spot, -size_m / 4, size_m / 4);
        break;
    default:
        break;
    }
}

/* ---- the panel ---- */

static void draw_lines(cairo_t *cairo, const drawing *d, double left, double top)
{
    for (int i = 0; i < d->num; i++)
        if (!d->dots[i].is_ahead)
            cairo_new_sub_path(cairo);
        else
            cairo_line_to(cairo, d->dots[i].x - left, d->dots[i].y - top);
}

/* The part of the window that the lines lie in: left, top, right, bottom; false: none. */
static bool find_box(const viewer *v, const drawing *d, double box[4])
{
    const double margin = MARGIN_PX * v->scale;
    box[0] = box[1] = INFINITY;
    box[2] = box[3] = -INFINITY;
    for (int i = 0; i < d->num; i++)
        if (d->dots[i].is_ahead) {
            box[0] = fmin(box[0], d->dots[i].x - margin);
            box[1] = fmin(box[1], d->dots[i].y - margin);
            box[2] = fmax(box[2], d->dots[i].x + margin);
            box[3] = fmax(box[3], d->dots[i].y + margin);
        }
    box[0] = floor(fmax(0, box[0]));
    box[1] = floor(fmax(0, box[1]));
    box[2] = ceil(fmin(v->width_px, box[2]));
    box[3] = ceil(fmin(v->height_px, box[3]));
    return box[2] > box[0] && box[3] > box[1];
}

static void set_colour(cairo_t *cairo, const view_brush *brush, double alpha)
{
    if (brush->tool != VIEW_TOOL_PAINT) {
        cairo_set_source_rgba(cairo, 1, 1, 1, alpha);
        return;
    }
    const double *albedo = view_paints[brush->paint].albedo;
    cairo_set_source_rgba(cairo, pow(albedo[0], 1 / 2.2), pow(albedo[1], 1 / 2.2), pow(albedo[2], 1 / 2.2), alpha);
}

void view_outline_update(viewer *v)
{
    const view_brush *brush = &v->edits.brush;
    view_spot spot;
    drawing d = {.num = 0};
    double box[4];
    bool shown = brush->tool != VIEW_NO_TOOL && !v->help_shown && v->width_px > 0;
    if (shown) {
        view_edits_freeze(v);
        shown = view_edits_find_spot(v, &spot);
        if (shown) {
            const eye e = open_eye(v);
            outline(&d, &e, &spot);
        }
        view_edits_thaw(v);
    }
    if (!shown || !find_box(v, &d, box)) {
        view_panel_hide(v, VIEW_PANEL_OUTLINE);
        return;
    }
    cairo_t *cairo = view_panel_begin(v, VIEW_PANEL_OUTLINE, (int)(box[2] - box[0]), (int)(box[3] - box[1]));
    if (!cairo)
        return;
    cairo_set_line_join(cairo, CAIRO_LINE_JOIN_ROUND);
    if (brush->tool == VIEW_TOOL_PAINT) {
        draw_lines(cairo, &d, box[0], box[1]);
        set_colour(cairo, brush, 0.35);
        cairo_fill(cairo);
    }
    for (int pass = 0; pass < 2; pass++) { /* dark around, so that it is seen on any land */
        draw_lines(cairo, &d, box[0], box[1]);
        if (pass)
            set_colour(cairo, brush, 0.95);
        else
            cairo_set_source_rgba(cairo, 0, 0, 0, 0.5);
        cairo_set_line_width(cairo, (pass ? 1.5 : 3.5) * v->scale);
        cairo_stroke(cairo);
    }
    view_panel_end(v, VIEW_PANEL_OUTLINE, cairo, (int)box[0], (int)box[1]);
}
