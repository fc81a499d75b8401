/* Charts as SVG: see plot.h. A page is laid out from its panels, each panel finds its ranges, then axes, series, levels
 * and the legend are drawn in that order. */
#include "plot.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cairo-svg.h>

#define MARGIN_PT 12.0
#define AXIS_LEFT_PT 64.0
#define AXIS_BOTTOM_PT 38.0
#define LEGEND_PT 150.0
#define TEXT_PT 11.0
#define TITLE_PT 15.0
#define MAX_TICKS 64

/* How the n-th series of a panel looks. Neighbours are far apart in lightness too. */
typedef struct {
    double area[3]; /* fill of a stacked area */
    double line[3]; /* of anything else: dark enough on white */
    char hatch;     /* of an area: none, / \ - | x + */
    double dashes[4];
    int num_dashes;
    char mark; /* o s ^ d x + v * */
} style;

static const style styles[PLOT_MAX_SERIES] = {
    {{0.00, 0.25, 0.36}, {0.00, 0.00, 0.00}, ' ', {0}, 0, 'o'},
    {{0.90, 0.62, 0.00}, {0.00, 0.45, 0.70}, '/', {7, 3}, 2, 's'},
    {{0.48, 0.12, 0.36}, {0.84, 0.37, 0.00}, ' ', {2, 2}, 2, '^'},
    {{0.94, 0.89, 0.26}, {0.00, 0.50, 0.36}, '\\', {9, 3, 2, 3}, 4, 'd'},
    {{0.00, 0.45, 0.70}, {0.60, 0.25, 0.45}, '-', {12, 4}, 2, 'x'},
    {{0.80, 0.80, 0.80}, {0.40, 0.40, 0.40}, 'x', {4, 2}, 2, '+'},
    {{0.84, 0.37, 0.00}, {0.15, 0.55, 0.80}, '|', {1, 3}, 2, 'v'},
    {{0.60, 0.85, 0.70}, {0.70, 0.50, 0.00}, '+', {14, 3, 4, 3}, 4, '*'},
    {{0.25, 0.25, 0.25}, {0.30, 0.00, 0.50}, '/', {6, 2, 1, 2}, 4, 'o'},
    {{0.95, 0.70, 0.80}, {0.50, 0.00, 0.00}, '-', {3, 5}, 2, 's'},
    {{0.10, 0.45, 0.25}, {0.00, 0.30, 0.30}, '\\', {10, 2}, 2, '^'},
    {{0.97, 0.97, 0.85}, {0.25, 0.25, 0.00}, '|', {5, 5}, 2, 'd'},
};

typedef struct {
    char *text;
    size_t length, capacity;
} output;

typedef struct {
    double left, top, width, height; /* of the data's rectangle */
    double x_min, x_max, y_min, y_max;
    bool x_logarithmic, y_logarithmic;
} frame;

static cairo_status_t take_output(void *closure, const unsigned char *data, unsigned length)
{
    output *out = closure;
    if (out->length + length + 1 > out->capacity) {
        size_t capacity = 2 * (out->length + length + 1);
        char *grown = realloc(out->text, capacity);
        if (!grown)
            return CAIRO_STATUS_NO_MEMORY;
        out->text = grown;
        out->capacity = capacity;
    }
    memcpy(out->text + out->length, data, length);
    out->length += length;
    out->text[out->length] = '\0';
    return CAIRO_STATUS_SUCCESS;
}

static bool drawable(double value, bool logarithmic) { return isfinite(value) && (!logarithmic || value > 0); }

/* ---- ranges and ticks ---- */

static void widen(double *min, double *max, double value, bool logarithmic)
{
    if (!drawable(value, logarithmic))
        return;
    *min = fmin(*min, value);
    *max = fmax(*max, value);
}

/* 1, 2 or 5 times a power of ten, so that about `num` steps make `span`. */
static double nice_step(double span, double num)
{
    double raw = span / num, power = pow(10, floor(log10(raw))), part = raw / power;
    return (part <= 1 ? 1 : part <= 2 ? 2 : part <= 5 ? 5 : 10) * power;
}

/* Takes the axis' own range if it has one, else the data's, rounded up to ticks; never empty. */
static void choose_range(const plot_axis *axis, double *min, double *max, bool from_zero)
{
    if (axis->min != 0 || axis->max != 0) {
        *min = axis->min;
        *max = axis->max;
        if (drawable(*min, axis->logarithmic) && *max > *min)
            return;
    }
    if (!(*max >= *min)) { /* nothing to draw */
        *min = axis->logarithmic ? 1 : 0;
        *max = axis->logarithmic ? 10 : 1;
    } else if (axis->logarithmic) {
        double decades = log10(*max / *min);
        *min = decades < 1 ? *min / 1.5 : *min / 1.2;
        *max = decades < 1 ? *max * 1.5 : *max * 1.2;
    } else {
        if (from_zero && *min > 0)
            *min = 0;
        if (*max == *min)
            *max = *min + (*min == 0 ? 1 : fabs(*min));
        double step = nice_step(*max - *min, 5);
        if (from_zero) {
            *min = floor(*min / step) * step;
            *max = ceil(*max / step) * step;
        }
    }
}

static int find_ticks(double min, double max, bool logarithmic, double room_pt, double ticks[MAX_TICKS])
{
    int num = 0;
    if (!logarithmic) {
        double step = nice_step(max - min, fmax(2, room_pt));
        for (double at = ceil(min / step - 1e-9); at * step <= max + step * 1e-9 && num < MAX_TICKS; at++)
            ticks[num++] = at == 0 ? 0 : at * step; /* never -0 */
        return num;
    }
    static const double parts[] = {1, 2, 5};
    double decades = log10(max / min);
    int num_parts = decades <= 2.5 ? 3 : 1, skip = (int)ceil(decades / fmax(2, room_pt));
    skip = skip < 1 ? 1 : skip;
    for (int power = (int)floor(log10(min)); power <= (int)ceil(log10(max)); power++)
        for (int part = 0; part < num_parts && power % skip == 0; part++) {
            double at = parts[part] * pow(10, power);
            if (at >= min * 0.999 && at <= max * 1.001 && num < MAX_TICKS)
                ticks[num++] = at;
        }
    return num;
}

static void find_ranges(const plot_panel *panel, frame *f)
{
    double x_min = INFINITY, x_max = -INFINITY, y_min = INFINITY, y_max = -INFINITY;
    bool areas = false;
    const plot_series *first_area = NULL;
    for (size_t s = 0; s < panel->num_series; s++) {
        const plot_series *series = &panel->series[s];
        for (size_t i = 0; i < series->num; i++) {
            widen(&x_min, &x_max, series->x[i], panel->x.logarithmic);
            if (series->kind == PLOT_STACKED)
                continue;
            widen(&y_min, &y_max, series->y[i], panel->y.logarithmic);
            if (series->low && series->high) {
                widen(&y_min, &y_max, series->low[i], panel->y.logarithmic);
                widen(&y_min, &y_max, series->high[i], panel->y.logarithmic);
            }
        }
        if (series->kind == PLOT_STACKED) {
            areas = true;
            first_area = first_area ? first_area : series;
        }
    }
    for (size_t i = 0; areas && i < first_area->num; i++) {
        double sum = 0;
        for (size_t s = 0; s < panel->num_series; s++)
            if (panel->series[s].kind == PLOT_STACKED && i < panel->series[s].num && isfinite(panel->series[s].y[i]))
                sum += panel->series[s].y[i];
        widen(&y_min, &y_max, sum, panel->y.logarithmic);
    }
    for (size_t l = 0; l < panel->num_levels; l++)
        widen(&y_min, &y_max, panel->levels[l].y, panel->y.logarithmic);
    choose_range(&panel->x, &x_min, &x_max, false);
    choose_range(&panel->y, &y_min, &y_max, true);
    f->x_min = x_min;
    f->x_max = x_max;
    f->y_min = y_min;
    f->y_max = y_max;
    f->x_logarithmic = panel->x.logarithmic;
    f->y_logarithmic = panel->y.logarithmic;
}

static double place(double value, double min, double max, bool logarithmic)
{
    return logarithmic ? log(value / min) / log(max / min) : (value - min) / (max - min);
}

static double x_at(const frame *f, double x)
{
    return f->left + f->width * place(x, f->x_min, f->x_max, f->x_logarithmic);
}

static double y_at(const frame *f, double y)
{
    return f->top + f->height * (1 - place(y, f->y_min, f->y_max, f->y_logarithmic));
}

/* ---- text ---- */

static void set_colour(cairo_t *cr, const double rgb[3], double alpha)
{
    cairo_set_source_rgba(cr, rgb[0], rgb[1], rgb[2], alpha);
}

static void set_font(cairo_t *cr, double size_pt, bool bold)
{
    cairo_select_font_face(cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                           bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cr, size_pt);
}

/* `align` 0: begins at x, 0.5: is centred there, 1: ends there. */
static void draw_text(cairo_t *cr, double x, double y, double align, const char *text)
{
    cairo_text_extents_t extents;
    cairo_text_extents(cr, text, &extents);
    cairo_move_to(cr, x - align * extents.x_advance, y);
    cairo_show_text(cr, text);
}

static void format_value(double value, char *text, size_t size_bytes)
{
    double size = fabs(value);
    snprintf(text, size_bytes, size != 0 && (size >= 1e5 || size < 1e-3) ? "%.3g" : "%.6g", value);
}

/* ---- a panel ---- */

static void draw_axes(cairo_t *cr, const plot_panel *panel, const frame *f)
{
    double ticks[MAX_TICKS];
    char text[32];
    set_font(cr, TEXT_PT, false);
    cairo_set_line_width(cr, 0.5);
    int num = find_ticks(f->y_min, f->y_max, f->y_logarithmic, f->height / 32, ticks);
    for (int i = 0; i < num; i++) {
        double y = y_at(f, ticks[i]);
        cairo_set_source_rgb(cr, 0.85, 0.85, 0.85);
        cairo_move_to(cr, f->left, y);
        cairo_line_to(cr, f->left + f->width, y);
        cairo_stroke(cr);
        cairo_set_source_rgb(cr, 0, 0, 0);
        format_value(ticks[i], text, sizeof text);
        draw_text(cr, f->left - 6, y + TEXT_PT * 0.35, 1, text);
    }
    num = find_ticks(f->x_min, f->x_max, f->x_logarithmic, f->width / 70, ticks);
    for (int i = 0; i < num; i++) {
        double x = x_at(f, ticks[i]);
        cairo_set_source_rgb(cr, 0.85, 0.85, 0.85);
        cairo_move_to(cr, x, f->top);
        cairo_line_to(cr, x, f->top + f->height);
        cairo_stroke(cr);
        cairo_set_source_rgb(cr, 0, 0, 0);
        format_value(ticks[i], text, sizeof text);
        draw_text(cr, x, f->top + f->height + TEXT_PT + 4, 0.5, text);
    }
    cairo_set_source_rgb(cr, 0, 0, 0);
    cairo_set_line_width(cr, 0.8);
    cairo_rectangle(cr, f->left, f->top, f->width, f->height);
    cairo_stroke(cr);
    if (panel->x.label)
        draw_text(cr, f->left + f->width / 2, f->top + f->height + 2 * TEXT_PT + 9, 0.5, panel->x.label);
    if (panel->y.label) {
        cairo_save(cr);
        cairo_translate(cr, f->left - AXIS_LEFT_PT + TEXT_PT, f->top + f->height / 2);
        cairo_rotate(cr, -M_PI / 2);
        draw_text(cr, 0, 0, 0.5, panel->y.label);
        cairo_restore(cr);
    }
    if (panel->title) {
        set_font(cr, TEXT_PT + 1, true);
        draw_text(cr, f->left, f->top - 6, 0, panel->title);
    }
}

static void draw_mark(cairo_t *cr, char mark, double x, double y)
{
    const double r = 3.2;
    cairo_new_path(cr);
    switch (mark) {
    case 's':
        cairo_rectangle(cr, x - r, y - r, 2 * r, 2 * r);
        break;
    case '^':
    case 'v': {
        double up = mark == '^' ? -r : r;
        cairo_move_to(cr, x, y + up);
        cairo_line_to(cr, x + r, y - up);
        cairo_line_to(cr, x - r, y - up);
        cairo_close_path(cr);
        break;
    }
    case 'd':
        cairo_move_to(cr, x, y - r * 1.3);
        cairo_line_to(cr, x + r * 1.3, y);
        cairo_line_to(cr, x, y + r * 1.3);
        cairo_line_to(cr, x - r * 1.3, y);
        cairo_close_path(cr);
        break;
    case 'x':
    case '+':
    case '*':
        if (mark != 'x') {
            cairo_move_to(cr, x - r, y);
            cairo_line_to(cr, x + r, y);
            cairo_move_to(cr, x, y - r);
            cairo_line_to(cr, x, y + r);
        }
        if (mark != '+') {
            cairo_move_to(cr, x - r, y - r);
            cairo_line_to(cr, x + r, y + r);
            cairo_move_to(cr, x - r, y + r);
            cairo_line_to(cr, x + r, y - r);
        }
        cairo_set_line_width(cr, 1.4);
        cairo_stroke(cr);
        return;
    default:
        cairo_arc(cr, x, y, r, 0, 2 * M_PI);
    }
    cairo_fill(cr);
}

/* Lines across the current path, which is used up. */
static void hatch_path(cairo_t *cr, char hatch)
{
    double left, top, right, bottom;
    const double step = 5;
    if (hatch == ' ') {
        cairo_new_path(cr);
        return;
    }
    cairo_path_extents(cr, &left, &top, &right, &bottom);
    cairo_save(cr);
    cairo_clip(cr);
    cairo_new_path(cr);
    double reach = bottom - top;
    if (hatch == '/' || hatch == 'x')
        for (double x = left - reach; x < right; x += step) {
            cairo_move_to(cr, x, bottom);
            cairo_line_to(cr, x + reach, top);
        }
    if (hatch == '\\' || hatch == 'x')
        for (double x = left - reach; x < right; x += step) {
            cairo_move_to(cr, x, top);
            cairo_line_to(cr, x + reach, bottom);
        }
    if (hatch == '-' || hatch == '+')
        for (double y = ceil(top / step) * step; y < bottom; y += step) {
            cairo_move_to(cr, left, y);
            cairo_line_to(cr, right, y);
        }
    if (hatch == '|' || hatch == '+')
        for (double x = ceil(left / step) * step; x < right; x += step) {
            cairo_move_to(cr, x, top);
            cairo_line_to(cr, x, bottom);
        }
    cairo_set_source_rgba(cr, 0, 0, 0, 0.55);
    cairo_set_line_width(cr, 0.7);
    cairo_stroke(cr);
    cairo_restore(cr);
}

static void fill_area(cairo_t *cr, const style *look)
{
    set_colour(cr, look->area, 1);
    cairo_fill_preserve(cr);
    cairo_path_t *path = cairo_copy_path(cr);
    hatch_path(cr, look->hatch);
    cairo_append_path(cr, path);
    cairo_path_destroy(path);
    cairo_set_source_rgb(cr, 0, 0, 0);
    cairo_set_line_width(cr, 0.4);
    cairo_stroke(cr);
}

/* The area between `base` and base + y; the sum becomes the next one's base. */
static void draw_stacked(cairo_t *cr, const plot_series *series, const style *look, const frame *f, double *base)
{
    if (series->num == 0)
        return;
    cairo_new_path(cr);
    for (size_t i = 0; i < series->num; i++)
        cairo_line_to(cr, x_at(f, series->x[i]), y_at(f, f->y_logarithmic ? fmax(base[i], f->y_min) : base[i]));
    for (size_t i = series->num; i-- > 0;) {
        base[i] += isfinite(series->y[i]) ? series->y[i] : 0;
        cairo_line_to(cr, x_at(f, series->x[i]), y_at(f, f->y_logarithmic ? fmax(base[i], f->y_min) : base[i]));
    }
    cairo_close_path(cr);
    fill_area(cr, look);
}

static void draw_line(cairo_t *cr, const plot_series *series, const style *look, const frame *f)
{
    bool pen_down = false;
    if (series->low && series->high) {
        cairo_new_path(cr);
        for (size_t i = 0; i < series->num; i++)
            if (drawable(series->high[i], f->y_logarithmic))
                cairo_line_to(cr, x_at(f, series->x[i]), y_at(f, series->high[i]));
        for (size_t i = series->num; i-- > 0;)
            if (drawable(series->low[i], f->y_logarithmic))
                cairo_line_to(cr, x_at(f, series->x[i]), y_at(f, series->low[i]));
        cairo_close_path(cr);
        set_colour(cr, look->line, 0.18);
        cairo_fill(cr);
    }
    set_colour(cr, look->line, 1);
    if (series->kind != PLOT_POINTS) {
        cairo_new_path(cr);
        double last_y = 0;
        for (size_t i = 0; i < series->num; i++) {
            bool ok = drawable(series->x[i], f->x_logarithmic) && drawable(series->y[i], f->y_logarithmic);
            if (ok) {
                double x = x_at(f, series->x[i]), y = y_at(f, series->y[i]);
                if (pen_down && series->kind == PLOT_STEPS)
                    cairo_line_to(cr, x, last_y);
                if (pen_down)
                    cairo_line_to(cr, x, y);
                else
                    cairo_move_to(cr, x, y);
                last_y = y;
            }
            pen_down = ok;
        }
        cairo_set_line_width(cr, 1.4);
        cairo_set_line_join(cr, CAIRO_LINE_JOIN_ROUND);
        cairo_set_dash(cr, look->dashes, look->num_dashes, 0);
        cairo_stroke(cr);
        cairo_set_dash(cr, NULL, 0, 0);
    }
    if (series->kind == PLOT_POINTS || series->kind == PLOT_LINE_AND_POINTS)
        for (size_t i = 0; i < series->num; i++)
            if (drawable(series->x[i], f->x_logarithmic) && drawable(series->y[i], f->y_logarithmic))
                draw_mark(cr, look->mark, x_at(f, series->x[i]), y_at(f, series->y[i]));
}

static void draw_legend(cairo_t *cr, const plot_panel *panel, const frame *f)
{
    double x = f->left + f->width + 12, y = f->top + 6;
    set_font(cr, TEXT_PT, false);
    /* Areas from the top one down, as they lie; the others in their own order after them. */
    for (int areas = 1; areas >= 0; areas--)
        for (size_t n = 0; n < panel->num_series; n++) {
            size_t s = areas ? panel->num_series - 1 - n : n;
            const plot_series *series = &panel->series[s];
            if (!series->name || (series->kind == PLOT_STACKED) != (areas == 1))
                continue;
            if (areas) {
                cairo_rectangle(cr, x, y - 5, 24, 11);
                fill_area(cr, &styles[s]);
            } else {
                double xs[2] = {0, 24}, ys[2] = {0, 0};
                plot_series sample = {.kind = series->kind == PLOT_STEPS ? PLOT_LINE : series->kind,
                                      .num = series->kind == PLOT_POINTS ? 1 : 2,
                                      .x = series->kind == PLOT_POINTS ? &(double){12} : xs,
                                      .y = ys};
                frame here = {.left = x, .top = y, .width = 24, .height = 1, .x_max = 24, .y_max = 1, .y_min = 0};
                draw_line(cr, &sample, &styles[s], &here);
            }
            cairo_set_source_rgb(cr, 0, 0, 0);
            draw_text(cr, x + 30, y + TEXT_PT * 0.35, 0, series->name);
            y += TEXT_PT + 6;
        }
}

static bool draw_panel(cairo_t *cr, const plot_panel *panel, frame *f, karst_error *error)
{
    size_t num_base = 0;
    if (panel->num_series > PLOT_MAX_SERIES)
        return karst_fail(error, KARST_USAGE, "%zu series in a panel: %d are the most", panel->num_series,
                          PLOT_MAX_SERIES);
    for (size_t s = 0; s < panel->num_series; s++)
        if (panel->series[s].kind == PLOT_STACKED && panel->series[s].num > num_base)
            num_base = panel->series[s].num;
    double *base = calloc(num_base + 1, sizeof *base);
    if (!base)
        return karst_fail(error, KARST_FAILED, "out of memory for a chart");
    find_ranges(panel, f);
    draw_axes(cr, panel, f);
    cairo_save(cr);
    cairo_rectangle(cr, f->left - 1, f->top - 1, f->width + 2, f->height + 2);
    cairo_clip(cr);
    for (size_t s = 0; s < panel->num_series; s++)
        if (panel->series[s].kind == PLOT_STACKED)
            draw_stacked(cr, &panel->series[s], &styles[s], f, base);
    for (size_t s = 0; s < panel->num_series; s++)
        if (panel->series[s].kind != PLOT_STACKED)
            draw_line(cr, &panel->series[s], &styles[s], f);
    for (size_t l = 0; l < panel->num_levels; l++) {
        double y = y_at(f, panel->levels[l].y);
        cairo_set_source_rgb(cr, 0, 0, 0);
        cairo_set_line_width(cr, 1);
        cairo_set_dash(cr, (const double[]){5, 3}, 2, 0);
        cairo_move_to(cr, f->left, y);
        cairo_line_to(cr, f->left + f->width, y);
        cairo_stroke(cr);
        cairo_set_dash(cr, NULL, 0, 0);
        if (panel->levels[l].name) {
            cairo_text_extents_t extents;
            set_font(cr, TEXT_PT, false);
            cairo_text_extents(cr, panel->levels[l].name, &extents);
            cairo_set_source_rgba(cr, 1, 1, 1, 0.8);
            cairo_rectangle(cr, f->left + f->width - 7 - extents.x_advance, y - TEXT_PT - 4, extents.x_advance + 6,
                            TEXT_PT + 3);
            cairo_fill(cr);
            cairo_set_source_rgb(cr, 0, 0, 0);
            draw_text(cr, f->left + f->width - 4, y - 4, 1, panel->levels[l].name);
        }
    }
    cairo_restore(cr);
    draw_legend(cr, panel, f);
    free(base);
    return true;
}

/* ---- the page ---- */

static bool draw_page(cairo_t *cr, const plot_page *page, double width, double height, karst_error *error)
{
    double top = MARGIN_PT, sum = 0;
    cairo_set_source_rgb(cr, 1, 1, 1);
    cairo_paint(cr);
    cairo_set_source_rgb(cr, 0, 0, 0);
    if (page->title) {
        set_font(cr, TITLE_PT, true);
        draw_text(cr, MARGIN_PT, top + TITLE_PT, 0, page->title);
        top += TITLE_PT + 6;
    }
    if (page->subtitle) {
        set_font(cr, TEXT_PT, false);
        draw_text(cr, MARGIN_PT, top + TEXT_PT, 0, page->subtitle);
        top += TEXT_PT + 6;
    }
    for (size_t p = 0; p < page->num_panels; p++)
        sum += page->panels[p].height > 0 ? page->panels[p].height : 1;
    /* What titles and axes need between the panels goes off the top. */
    const double around = TEXT_PT + 14 + AXIS_BOTTOM_PT;
    double room = height - top - MARGIN_PT - around * (double)page->num_panels;
    for (size_t p = 0; p < page->num_panels; p++) {
        double share = (page->panels[p].height > 0 ? page->panels[p].height : 1) / sum;
        frame f = {.left = MARGIN_PT + AXIS_LEFT_PT,
                   .top = top + TEXT_PT + 14,
                   .width = width - 2 * MARGIN_PT - AXIS_LEFT_PT - LEGEND_PT,
                   .height = fmax(20, room * share)};
        if (!draw_panel(cr, &page->panels[p], &f, error))
            return false;
        top = f.top + f.height + AXIS_BOTTOM_PT;
    }
    return true;
}

char *plot_svg(const plot_page *page, karst_error *error)
{
    double width = page->width_pt > 0 ? page->width_pt : 900, height = page->height_pt > 0 ? page->height_pt : 600;
    output out = {0};
    cairo_surface_t *surface = cairo_svg_surface_create_for_stream(take_output, &out, width, height);
    cairo_t *cr = cairo_create(surface);
    bool ok = draw_page(cr, page, width, height, error);
    cairo_status_t status = cairo_status(cr);
    cairo_destroy(cr);
    cairo_surface_finish(surface);
    if (status == CAIRO_STATUS_SUCCESS)
        status = cairo_surface_status(surface);
    cairo_surface_destroy(surface);
    if (ok && status != CAIRO_STATUS_SUCCESS)
        ok = karst_fail(error, KARST_FAILED, "cannot draw a chart: %s", cairo_status_to_string(status));
    if (!ok) {
        free(out.text);
        return NULL;
    }
    return out.text;
}
