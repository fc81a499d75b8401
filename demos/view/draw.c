/* Type, panels, graphs, bars, and figures as text. */
#include "demos/view/view.h"

#include <math.h>

static const double hues[][3] = {
    {0.42, 0.75, 0.96}, {0.98, 0.75, 0.36}, {0.56, 0.84, 0.53}, {0.96, 0.52, 0.45},
    {0.76, 0.65, 0.95}, {0.45, 0.84, 0.80}, {0.93, 0.62, 0.80},
};
#define NUM_HUES ((int)(sizeof hues / sizeof *hues))

void view_set_hue(cairo_t *cairo, int hue, double alpha)
{
    const double *c = hues[hue % NUM_HUES];
    cairo_set_source_rgba(cairo, c[0], c[1], c[2], alpha);
}

static void round_box(cairo_t *cairo, double x, double y, double width, double height, double radius)
{
    radius = fmin(radius, fmin(width, height) / 2);
    cairo_new_sub_path(cairo);
    cairo_arc(cairo, x + width - radius, y + radius, radius, -M_PI / 2, 0);
    cairo_arc(cairo, x + width - radius, y + height - radius, radius, 0, M_PI / 2);
    cairo_arc(cairo, x + radius, y + height - radius, radius, M_PI / 2, M_PI);
    cairo_arc(cairo, x + radius, y + radius, radius, M_PI, 3 * M_PI / 2);
    cairo_close_path(cairo);
}

void view_draw_panel(cairo_t *cairo, double width, double height, double scale)
{
    round_box(cairo, 0, 0, width, height, 6 * scale);
    cairo_set_source_rgba(cairo, 0.055, 0.065, 0.085, 0.78);
    cairo_fill(cairo);
}

static void choose_face(cairo_t *cairo, double size, view_style style)
{
    cairo_select_font_face(cairo, style == VIEW_TEXT_MONO ? "monospace" : "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                           style == VIEW_TEXT_STRONG ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cairo, size);
}

double view_text_width(cairo_t *cairo, double size, view_style style, const char *text)
{
    cairo_text_extents_t extents;
    choose_face(cairo, size, style);
    cairo_text_extents(cairo, text, &extents);
    return extents.x_advance;
}

double view_draw_text(cairo_t *cairo, double x, double y, double size, double align, view_style style, const char *text)
{
    double width = view_text_width(cairo, size, style, text);
    switch (style) {
    case VIEW_TEXT_DIM:
        cairo_set_source_rgba(cairo, 0.68, 0.71, 0.76, 1);
        break;
    case VIEW_TEXT_BAD:
        cairo_set_source_rgba(cairo, 1, 0.56, 0.50, 1);
        break;
    default:
        cairo_set_source_rgba(cairo, 0.95, 0.96, 0.97, 1);
    }
    cairo_move_to(cairo, floor(x - align * width), floor(y));
    cairo_show_text(cairo, text);
    return width;
}

void view_draw_graph(cairo_t *cairo, double x, double y, double width, double height, const double *values,
                     size_t num_values, double top, double mark, int hue)
{
    cairo_set_source_rgba(cairo, 1, 1, 1, 0.05);
    cairo_rectangle(cairo, x, y, width, height);
    cairo_fill(cairo);
    if (mark >= 0 && mark < top) {
        cairo_set_source_rgba(cairo, 1, 1, 1, 0.30);
        cairo_set_line_width(cairo, 1);
        cairo_move_to(cairo, x, floor(y + height * (1 - mark / top)) + 0.5);
        cairo_rel_line_to(cairo, width, 0);
        cairo_stroke(cairo);
    }
    if (num_values < 2 || !(top > 0))
        return;
    cairo_save(cairo);
    cairo_rectangle(cairo, x, y, width, height);
    cairo_clip(cairo);
    double step = width / (VIEW_HISTORY - 1), start = x + width - step * (double)(num_values - 1);
    for (size_t i = 0; i < num_values; i++)
        cairo_line_to(cairo, start + step * (double)i, y + height * (1 - fmin(1, values[i] / top)));
    cairo_path_t *line = cairo_copy_path(cairo);
    cairo_line_to(cairo, x + width, y + height);
    cairo_line_to(cairo, start, y + height);
    view_set_hue(cairo, hue, 0.22);
    cairo_fill(cairo);
    cairo_append_path(cairo, line);
    cairo_path_destroy(line);
    view_set_hue(cairo, hue, 0.95);
    cairo_set_line_width(cairo, 1.25);
    cairo_stroke(cairo);
    cairo_restore(cairo);
}

void view_draw_bar(cairo_t *cairo, double x, double y, double width, double height, double share, int hue)
{
    round_box(cairo, x, y, width, height, height / 2);
    cairo_set_source_rgba(cairo, 1, 1, 1, 0.12);
    cairo_fill(cairo);
    share = fmin(1, fmax(0, share));
    if (share * width < 1)
        return;
    cairo_save(cairo);
    cairo_rectangle(cairo, x, y, share * width, height);
    cairo_clip(cairo);
    round_box(cairo, x, y, width, height, height / 2);
    view_set_hue(cairo, hue, 0.9);
    cairo_fill(cairo);
    cairo_restore(cairo);
}

const char *view_format_length(double metres, const char *suffix, char text[48])
{
    double size = fabs(metres);
    if (size < 1e-2)
        snprintf(text, 48, "%.3g mm%s", metres * 1e3, suffix);
    else if (size < 1)
        snprintf(text, 48, "%.3g cm%s", metres * 1e2, suffix);
    else if (size < 10000)
        snprintf(text, 48, size < 100 ? "%.3g m%s" : "%.0f m%s", metres, suffix);
    else if (size < 1e9)
        snprintf(text, 48, size < 1e6 ? "%.3g km%s" : "%.0f km%s", metres / 1e3, suffix);
    else
        snprintf(text, 48, "%.3g m%s", metres, suffix);
    return text;
}
