/* Where one looks, how large things are, and what the greys of the depth view mean. */
#include "demos/view/view.h"

#include <math.h>
#include <string.h>

#define SIZE 11.0 /* of type at scale 1, pixels */
#define MARGIN 12.0
#define COMPASS 56.0 /* pixels at scale 1 */
#define LONGEST_BAR 110.0
#define DEPTH_WIDTH 300.0
#define DEPTH_HEIGHT 42.0

/* The largest of 1, 2 and 5 times a power of ten that is at most `length`. */
static double round_down(double length)
{
    double power = pow(10, floor(log10(length)));
    return length >= 5 * power ? 5 * power : length >= 2 * power ? 2 * power : power;
}

/* Metres that a pixel spans at a distance, at the picture's middle. */
static double pixel_m(const viewer *v, double depth_m)
{
    return 2 * tan(v->motion.camera.fov_deg * M_PI / 360) * depth_m / v->height_px;
}

static void draw_needle(cairo_t *cairo, double x, double y, double radius, double yaw_deg, double scale)
{
    static const char *const names[] = {"N", "E", "S", "W"};
    view_set_hue(cairo, 4, 0.8);
    cairo_set_line_width(cairo, scale);
    cairo_arc(cairo, x, y, radius, 0, 2 * M_PI);
    cairo_stroke(cairo);
    /* Up is where one looks. */
    for (int i = 0; i < 4; i++) {
        double angle = (90.0 * i - yaw_deg) * M_PI / 180;
        view_draw_text(cairo, x + sin(angle) * radius * 0.68, y - cos(angle) * radius * 0.68 + 3.5 * scale,
                       (i ? 8 : 11) * scale, 0.5, i ? VIEW_TEXT_DIM : VIEW_TEXT_STRONG, names[i]);
    }
    view_set_hue(cairo, 1, 1);
    cairo_move_to(cairo, x, y - radius - 3 * scale);
    cairo_line_to(cairo, x - 3 * scale, y - radius + 3 * scale);
    cairo_line_to(cairo, x + 3 * scale, y - radius + 3 * scale);
    cairo_close_path(cairo);
    cairo_fill(cairo);
}

/* North is +z, east is +x. The bar is as long as things at the cross-hair's distance are. */
void view_draw_compass(viewer *v)
{
    const double s = v->scale, width = COMPASS + 16 + LONGEST_BAR + 16, height = COMPASS + 14;
    cairo_t *cairo = view_panel_begin(v, VIEW_PANEL_COMPASS, (int)ceil(width * s), (int)ceil(height * s));
    if (!cairo)
        return;
    view_draw_panel(cairo, width * s, height * s, s);
    draw_needle(cairo, (COMPASS / 2 + 8) * s, (height / 2 + 1) * s, (COMPASS / 2 - 3) * s, v->motion.camera.yaw_deg, s);
    if (v->probe.hit && v->probe.depth_m > 0) {
        char text[48], at[64];
        double a_pixel_m = pixel_m(v, v->probe.depth_m), bar_m = round_down(LONGEST_BAR * s * a_pixel_m);
        double left = (COMPASS + 20) * s, bar = bar_m / a_pixel_m, y = height * s * 0.5;
        view_set_hue(cairo, 1, 1);
        cairo_set_line_width(cairo, 1.5 * s);
        cairo_move_to(cairo, left, y - 4 * s);
        cairo_line_to(cairo, left, y);
        cairo_line_to(cairo, left + bar, y);
        cairo_line_to(cairo, left + bar, y - 4 * s);
        cairo_stroke(cairo);
        view_draw_text(cairo, left, y - 9 * s, SIZE * s, 0, VIEW_TEXT, view_format_length(bar_m, "", text));
        snprintf(at, sizeof at, "at %s", view_format_length(v->probe.depth_m, "", text));
        view_draw_text(cairo, left, y + 15 * s, SIZE * s, 0, VIEW_TEXT_DIM, at);
    }
    view_panel_end(v, VIEW_PANEL_COMPASS, cairo, (int)(MARGIN * s), view_hud_top(v));
}

/* The share of black that the depth view gives a distance. */
static double darkness(double depth_m, double voxel_m, double most_m)
{
    return log2(1 + depth_m / voxel_m) / log2(1 + most_m / voxel_m);
}

void view_draw_depth_scale(viewer *v)
{
    const double s = v->scale, voxel_m = ldexp(1, karst_engine_voxel_log2_m(v->engine)),
                 most_m = v->settings.view_distance_m > 0 ? v->settings.view_distance_m
                          : v->metadata                   ? v->metadata->view_distance_m
                                                          : 0;
    cairo_t *cairo =
        most_m > 0 ? view_panel_begin(v, VIEW_PANEL_DEPTH, (int)ceil(DEPTH_WIDTH * s), (int)ceil(DEPTH_HEIGHT * s))
                   : NULL;
    if (!cairo) {
        view_panel_hide(v, VIEW_PANEL_DEPTH);
        return;
    }
    view_draw_panel(cairo, DEPTH_WIDTH * s, DEPTH_HEIGHT * s, s);
    const double left = 14 * s, width = (DEPTH_WIDTH - 28) * s;
    for (double x = 0; x < width; x++) {
        double bright = 1 - x / width, grey = 0.9 * bright * bright + 0.1; /* as raycast/light/views.cl paints it */
        cairo_set_source_rgb(cairo, grey, grey, grey);
        cairo_rectangle(cairo, left + x, 8 * s, 1, 12 * s);
        cairo_fill(cairo);
    }
    /* Powers of ten that find room. */
    double last = -1e9;
    for (double depth_m = pow(10, ceil(log10(voxel_m))); depth_m <= most_m; depth_m *= 10) {
        double x = left + width * darkness(depth_m, voxel_m, most_m);
        char text[48];
        if (x - last < 44 * s)
            continue;
        last = x;
        cairo_set_source_rgb(cairo, 1, 0.6, 0.2);
        cairo_rectangle(cairo, x, 8 * s, s, 14 * s);
        cairo_fill(cairo);
        view_draw_text(cairo, x, 34 * s, 10 * s, 0.5, VIEW_TEXT, view_format_length(depth_m, "", text));
    }
    view_panel_end(v, VIEW_PANEL_DEPTH, cairo, (int)((v->width_px - DEPTH_WIDTH * s) / 2), (int)(MARGIN * s));
}
