/* The world's parameters, to be moved with mouse and keys. */
#include "demos/view/view.h"

#include <math.h>
#include <string.h>

#define PAD 10.0
#define ROW 38.0
#define HEAD 30.0
#define WIDTH 270.0
#define MARGIN 12.0

static view_slider make_slider(const karst_parameter_info *info)
{
    view_slider s = {.value = info->value, .original = info->value, .step = info->step};
    snprintf(s.name, sizeof s.name, "%s", info->name);
    snprintf(s.label, sizeof s.label, "%s", *info->label ? info->label : info->name);
    snprintf(s.unit, sizeof s.unit, "%s", info->unit);
    s.is_structural = info->is_structural;
    /* Without a range, some way to both sides of where it is. */
    double reach = fmax(1, 2 * fabs(info->value));
    s.min = isfinite(info->min) && info->min > -1e300 ? info->min : info->value >= 0 ? 0 : info->value - reach;
    s.max = isfinite(info->max) && info->max < 1e300 ? info->max : info->value + reach;
    return s;
}

void view_sliders_read(viewer *v, bool keep_values)
{
    view_sliders *all = &v->sliders;
    const view_sliders old = *all;
    all->num_sliders = 0;
    for (size_t i = 0; v->metadata && i < v->metadata->num_parameters && all->num_sliders < VIEW_MAX_SLIDERS; i++) {
        view_slider s = make_slider(&v->metadata->parameters[i]);
        for (int k = 0; keep_values && k < old.num_sliders; k++)
            if (strcmp(old.sliders[k].name, s.name) == 0 && old.sliders[k].value == s.value)
                s.original = old.sliders[k].original;
        all->sliders[all->num_sliders++] = s;
    }
    if (all->chosen >= all->num_sliders)
        all->chosen = 0;
    all->dragged = -1;
    all->changed = false;
    if (!all->num_sliders)
        all->shown = false;
    v->hud_dirty = true;
}

void view_sliders_set(viewer *v, int index, double value)
{
    view_slider *s = &v->sliders.sliders[index];
    if (s->step > 0)
        value = s->min + round((value - s->min) / s->step) * s->step;
    value = fmin(s->max, fmax(s->min, value));
    if (value == s->value)
        return;
    s->value = value;
    s->changed = v->sliders.changed = true;
    v->hud_dirty = true;
}

/* ---- mouse and keys ---- */

bool view_sliders_press(viewer *v, double x_px, double y_px)
{
    view_sliders *all = &v->sliders;
    const view_panel *panel = &v->overlay.panels[VIEW_PANEL_SLIDERS];
    if (!all->shown || x_px < panel->x || x_px >= panel->x + panel->width || y_px < panel->y ||
        y_px >= panel->y + panel->height)
        return false;
    int row = (int)floor((y_px - all->first_y) / all->row_height) + all->first_row;
    if (y_px >= all->first_y && row >= 0 && row < all->num_sliders) {
        all->chosen = all->dragged = row;
        view_sliders_drag(v, x_px);
        v->hud_dirty = true;
    }
    return true;
}

void view_sliders_drag(viewer *v, double x_px)
{
    view_sliders *all = &v->sliders;
    if (all->dragged < 0 || all->dragged >= all->num_sliders || all->track_width <= 0)
        return;
    const view_slider *s = &all->sliders[all->dragged];
    double share = fmin(1, fmax(0, (x_px - all->track_x) / all->track_width));
    view_sliders_set(v, all->dragged, s->min + share * (s->max - s->min));
}

void view_sliders_step(viewer *v, int direction, int mods)
{
    view_sliders *all = &v->sliders;
    if (!all->num_sliders)
        return;
    const view_slider *s = &all->sliders[all->chosen];
    double by = s->step > 0 ? s->step : (s->max - s->min) / 100;
    if (mods & GLFW_MOD_SHIFT)
        by *= 10;
    if (mods & GLFW_MOD_CONTROL && !(s->step > 0))
        by /= 10;
    view_sliders_set(v, all->chosen, s->value + direction * by);
}

/* ---- drawing ---- */

void view_sliders_draw(viewer *v)
{
    view_sliders *all = &v->sliders;
    const double s = v->scale;
    int room = (int)((v->height_px / s - 2 * MARGIN - HEAD - PAD - 60) / ROW);
    int rows = all->num_sliders < room ? all->num_sliders : room < 1 ? 1 : room;
    if (all->chosen < all->first_row)
        all->first_row = all->chosen;
    if (all->chosen >= all->first_row + rows)
        all->first_row = all->chosen - rows + 1;
    if (all->first_row > all->num_sliders - rows)
        all->first_row = all->num_sliders - rows;
    double width = fmin(WIDTH, v->width_px / s - 2 * MARGIN), height = HEAD + rows * ROW + PAD;
    int top = view_hud_top(v);
    cairo_t *cairo = view_panel_begin(v, VIEW_PANEL_SLIDERS, (int)ceil(width * s), (int)ceil(height * s));
    if (!cairo)
        return;
    view_draw_panel(cairo, width * s, height * s, s);
    view_draw_text(cairo, PAD * s, 20 * s, 12 * s, 0, VIEW_TEXT_STRONG, "Parameters");
    view_draw_text(cairo, (width - PAD) * s, 20 * s, 10.5 * s, 1, VIEW_TEXT_DIM, "Backspace resets, F2 saves");
    for (int i = 0; i < rows; i++) {
        const view_slider *slider = &all->sliders[all->first_row + i];
        double y = HEAD + i * ROW;
        bool chosen = all->first_row + i == all->chosen;
        if (chosen) {
            cairo_set_source_rgba(cairo, 1, 1, 1, 0.07);
            cairo_rectangle(cairo, 4 * s, y * s, (width - 8) * s, (ROW - 2) * s);
            cairo_fill(cairo);
        }
        char text[64];
        snprintf(text, sizeof text, "%.5g%s%s", slider->value, *slider->unit ? " " : "", slider->unit);
        view_draw_text(cairo, PAD * s, (y + 15) * s, 12 * s, 0, chosen ? VIEW_TEXT : VIEW_TEXT_DIM, slider->label);
        view_draw_text(cairo, (width - PAD) * s, (y + 15) * s, 12 * s, 1,
                       slider->value != slider->original ? VIEW_TEXT_STRONG : VIEW_TEXT, text);
        double range = slider->max - slider->min;
        view_draw_bar(cairo, PAD * s, (y + 22) * s, (width - 2 * PAD) * s, 7 * s,
                      range > 0 ? (slider->value - slider->min) / range : 0, chosen ? 1 : 0);
        if (slider->value != slider->original && range > 0) { /* where it came from */
            double x = PAD + (width - 2 * PAD) * (slider->original - slider->min) / range;
            cairo_set_source_rgba(cairo, 1, 1, 1, 0.7);
            cairo_rectangle(cairo, floor(x * s), (y + 20) * s, fmax(1, s), 11 * s);
            cairo_fill(cairo);
        }
    }
    view_panel_end(v, VIEW_PANEL_SLIDERS, cairo, (int)(MARGIN * s), top);
    all->track_x = (MARGIN + PAD) * s;
    all->track_width = (width - 2 * PAD) * s;
    all->first_y = top + HEAD * s;
    all->row_height = ROW * s;
}
