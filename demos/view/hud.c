/* What stands in the panels. */
#include "demos/view/view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const view_page_names[] = {"none", "status", "frame", "cache"};

#define TEXT 12.0 /* sizes at scale 1, pixels */
#define SMALL 10.5
#define LINE 18.0
#define PAD 10.0
#define MARGIN 12.0
#define UPDATE_S 0.1 /* faster than that nobody reads */
#define NUM_STAGES KARST_NUM_STAGES

static const view_page pages_with_graphs[] = {VIEW_PAGE_FRAME, VIEW_PAGE_CACHE};

/* ---- texts ---- */

/* 1234567 -> "1 234 567": with thin spaces, as figures are set. */
static const char *group_digits(uint64_t number, char text[48])
{
    char digits[24];
    int length = snprintf(digits, sizeof digits, "%llu", (unsigned long long)number);
    char *to = text;
    for (int i = 0; i < length; i++) {
        if (i && (length - i) % 3 == 0)
            to += sprintf(to, "\u2009");
        *to++ = digits[i];
    }
    *to = 0;
    return text;
}

/* One coordinate, cut (not rounded) to centimetres, however long: it is exact. */
static const char *format_coordinate(const viewer *v, int axis, char text[192])
{
    const karst_position *p = &v->motion.camera.position;
    karst_coordinate_format(p->voxel[axis], p->fraction[axis], karst_engine_voxel_log2_m(v->engine), text, 192);
    char *point = strchr(text, '.');
    if (point && strlen(point) > 3)
        point[3] = 0;
    return text;
}

/* ---- pieces ---- */

typedef struct {
    cairo_t *cairo;
    double s;    /* scale */
    double x, y; /* of the next line: left, baseline */
    double width;
} sheet;

static sheet begin_sheet(viewer *v, view_panel_kind kind, double width, double height)
{
    sheet p = {.s = v->scale, .width = width};
    p.cairo = view_panel_begin(v, kind, (int)ceil(width * p.s), (int)ceil(height * p.s));
    p.x = PAD;
    p.y = PAD + TEXT;
    if (p.cairo)
        view_draw_panel(p.cairo, width * p.s, height * p.s, p.s);
    return p;
}

static double say(sheet *p, double x, double size, double align, view_style style, const char *text)
{
    return view_draw_text(p->cairo, x * p->s, p->y * p->s, size * p->s, align, style, text) / p->s;
}

/* A name on the left, a figure on the right. */
static void say_pair(sheet *p, const char *name, const char *value)
{
    say(p, p->x, TEXT, 0, VIEW_TEXT_DIM, name);
    say(p, p->width - PAD, TEXT, 1, VIEW_TEXT, value);
    p->y += LINE;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Oldest first into `out`; returns how many. */
static size_t unroll(const view_history *h, const double *ring, double *out)
{
    for (size_t i = 0; i < h->num; i++)
        out[i] = ring[(h->next + VIEW_HISTORY - h->num + i) % VIEW_HISTORY];
    return h->num;
}

static double largest(const double *values, size_t num)
{
    double most = 0;
    for (size_t i = 0; i < num; i++)
        most = fmax(most, values[i]);
    return most;
}

/* ---- status ---- */

static void draw_status(viewer *v)
{
    char lines[3][640], a[192], b[192], c[192], speed[48], depth[48];
    const karst_camera *camera = &v->motion.camera;
    snprintf(lines[0], sizeof lines[0], "%s, %s, %s m    yaw %.1f\u00b0  pitch %.1f\u00b0  fov %.3g\u00b0",
             format_coordinate(v, 0, a), format_coordinate(v, 1, b), format_coordinate(v, 2, c), camera->yaw_deg,
             camera->pitch_deg, camera->fov_deg);
    char samples[48] = "", given[96] = "", under[96], shown[48] = "";
    if (v->stats.num_pixels && v->resolution.share < VIEW_FULL_SHARE)
        snprintf(given, sizeof given, "    given %d %% of each side", 100 * v->resolution.share / VIEW_FULL_SHARE);
    else if (v->stats.detail_given_px > v->stats.detail_asked_px * 1.001)
        snprintf(given, sizeof given, "    given voxels of %.2f px for %.2f", v->stats.detail_given_px,
                 v->stats.detail_asked_px);
    if (v->probe.hit)
        snprintf(under, sizeof under, "level %d%s at %s", v->probe.level, v->probe.provisional ? " (stand-in)" : "",
                 view_format_length(v->probe.depth_m, "", depth));
    else
        snprintf(under, sizeof under, "sky");
    if (v->settings.look.samples > 1 && v->stats.num_samples)
        snprintf(samples, sizeof samples, "    %u of %llu samples", v->stats.num_samples,
                 (unsigned long long)v->settings.look.samples);
    if (v->view != KARST_VIEW_PICTURE)
        snprintf(shown, sizeof shown, "    view: %s", karst_view_name(v->view));
    snprintf(lines[1], sizeof lines[1], "%s  %s    %s%s%s%s%s%s%s", view_mode_names[v->motion.mode],
             view_format_length(v->motion.speed_m_s, "/s", speed), under, given, shown, samples,
             v->capture.recording ? "    \u25cf recording a path" : "", v->capture.video ? "    \u25cf video" : "",
             v->reload.running ? "    compiling\u2026"
             : v->settled      ? "    settled"
                               : "");
    snprintf(v->status, sizeof v->status, "%s", lines[1]);
    const int num_lines = view_edits_describe(v, lines[2], sizeof lines[2]) ? 3 : 2;
    /* As wide as the longest line, which only a drawn panel can tell. */
    sheet p = begin_sheet(v, VIEW_PANEL_STATUS, 1, 1);
    if (!p.cairo)
        return;
    double width = 0;
    for (int i = 0; i < num_lines; i++)
        width = fmax(width, view_text_width(p.cairo, TEXT * p.s, VIEW_TEXT, lines[i]) / p.s);
    cairo_destroy(p.cairo);
    width = fmin(ceil((width + 2 * PAD) / 40) * 40, v->width_px / v->scale - 2 * MARGIN);
    double height = num_lines * LINE + 2 * PAD - 4;
    p = begin_sheet(v, VIEW_PANEL_STATUS, width, height);
    if (!p.cairo)
        return;
    for (int i = 0; i < num_lines; i++) {
        const bool is_bad = i == 2 && strstr(lines[i], "NOT saved");
        say(&p, p.x, TEXT, 0, is_bad ? VIEW_TEXT_BAD : i == 1 ? VIEW_TEXT_DIM : VIEW_TEXT, lines[i]);
        p.y += LINE;
    }
    view_panel_end(v, VIEW_PANEL_STATUS, p.cairo, (int)(MARGIN * p.s), v->height_px - (int)((MARGIN + height) * p.s));
}

/* ---- pages ---- */

static void draw_frame_page(viewer *v)
{
    double values[VIEW_HISTORY], sorted[VIEW_HISTORY];
    size_t num = unroll(&v->history, v->history.frame_ms, values);
    memcpy(sorted, values, num * sizeof *values);
    qsort(sorted, num, sizeof *sorted, compare_doubles);
    double median = num ? sorted[num / 2] : 0, worst = num ? sorted[num - 1 - num / 100] : 0;
    const double width = 280, graph = 64, height = PAD + 2 * LINE + graph + 8 + (NUM_STAGES + 2) * LINE + PAD;
    sheet p = begin_sheet(v, VIEW_PANEL_PAGE, width, height);
    if (!p.cairo)
        return;
    char text[96];
    say(&p, p.x, TEXT, 0, VIEW_TEXT_STRONG, "Frame time");
    snprintf(text, sizeof text, "target %.0f fps", v->settings.fps);
    say(&p, width - PAD, SMALL, 1, VIEW_TEXT_DIM, text);
    p.y += LINE;
    snprintf(text, sizeof text, "median %.1f ms (%.0f fps)", median, median > 0 ? 1000 / median : 0);
    say(&p, p.x, TEXT, 0, VIEW_TEXT, text);
    snprintf(text, sizeof text, "1 %% low %.0f fps", worst > 0 ? 1000 / worst : 0);
    say(&p, width - PAD, TEXT, 1, VIEW_TEXT, text);
    p.y += 8;
    double target = 1000 / v->settings.fps, top = fmax(2 * target, fmin(worst * 1.2, 20 * target));
    view_draw_graph(p.cairo, PAD * p.s, p.y * p.s, (width - 2 * PAD) * p.s, graph * p.s, values, num, top, target, 0);
    p.y += graph + LINE + 4;
    double sum = 0, stages[NUM_STAGES];
    for (int stage = 0; stage < NUM_STAGES; stage++) {
        double all = 0;
        size_t count = num < 30 ? num : 30; /* of late */
        for (size_t i = 0; i < count; i++)
            all += v->history.stages_ms[(v->history.next + VIEW_HISTORY - 1 - i) % VIEW_HISTORY][stage];
        stages[stage] = count ? all / (double)count : 0;
        sum += stages[stage];
    }
    for (int stage = 0; stage < NUM_STAGES; stage++) {
        say(&p, p.x, TEXT, 0, VIEW_TEXT_DIM, karst_stage_name((karst_stage)stage));
        view_draw_bar(p.cairo, 96 * p.s, (p.y - 8) * p.s, (width - 96 - 66) * p.s, 7 * p.s,
                      sum > 0 ? stages[stage] / sum : 0, stage);
        snprintf(text, sizeof text, "%.*f ms", stages[stage] < 100 ? 2 : 1, stages[stage]);
        say(&p, width - PAD, TEXT, 1, VIEW_TEXT, text);
        p.y += LINE;
    }
    double of_side = 100.0 * v->resolution.share / VIEW_FULL_SHARE;
    snprintf(text, sizeof text, "%.2f px, %.2f asked", v->stats.detail_given_px, v->stats.detail_asked_px);
    say_pair(&p, "voxels", text);
    snprintf(text, sizeof text, "%dx%d of %dx%d", v->stats.num_pixels ? (int)(v->width_px * of_side / 100) : 0,
             v->stats.num_pixels ? (int)(v->height_px * of_side / 100) : 0, v->width_px, v->height_px);
    say_pair(&p, "pixels", text);
    view_panel_end(v, VIEW_PANEL_PAGE, p.cairo, v->width_px - (int)((width + MARGIN) * p.s), view_hud_top(v));
}

static void draw_churn(sheet *p, const view_history *h, const double *ring, const char *name, int hue)
{
    double values[VIEW_HISTORY];
    const double graph = 26;
    char text[64], digits[48];
    size_t num = unroll(h, ring, values);
    double top = largest(values, num);
    say(p, p->x, TEXT, 0, VIEW_TEXT_DIM, name);
    snprintf(text, sizeof text, "%s", group_digits(num ? (uint64_t)values[num - 1] : 0, digits));
    say(p, p->width - PAD, TEXT, 1, VIEW_TEXT, text);
    p->y += 5;
    view_draw_graph(p->cairo, PAD * p->s, p->y * p->s, (p->width - 2 * PAD) * p->s, graph * p->s, values, num,
                    fmax(8, top), -1, hue);
    p->y += graph + LINE;
}

static void draw_pool(sheet *p, const char *name, const karst_stats_pool *pool, uint64_t num_resident, int hue)
{
    char used[48], text[128];
    double total = pool->num_total ? (double)pool->num_total : 1;
    say(p, p->x, TEXT, 0, VIEW_TEXT_DIM, name);
    snprintf(text, sizeof text, "%s used, %.0f %% held", group_digits(pool->num_used, used),
             100 * (double)num_resident / total);
    say(p, p->width - PAD, TEXT, 1, VIEW_TEXT, text);
    p->y += 6;
    view_draw_bar(p->cairo, PAD * p->s, p->y * p->s, (p->width - 2 * PAD) * p->s, 7 * p->s,
                  (double)num_resident / total, 4);
    view_draw_bar(p->cairo, PAD * p->s, p->y * p->s, (p->width - 2 * PAD) * p->s, 7 * p->s,
                  (double)pool->num_used / total, hue);
    p->y += LINE + 4;
}

static void draw_cache_page(viewer *v)
{
    const double width = 280, height = PAD + 4 * LINE + 2 * (LINE + 10) + 3 * (26 + LINE + 5) + 14;
    sheet p = begin_sheet(v, VIEW_PANEL_PAGE, width, height);
    if (!p.cairo)
        return;
    char text[96], digits[48];
    uint64_t total_bytes = 0;
    for (size_t i = 0; i < v->stats.num_memory; i++)
        total_bytes += v->stats.memory[i].size_bytes;
    say(&p, p.x, TEXT, 0, VIEW_TEXT_STRONG, "Cache");
    snprintf(text, sizeof text, "%.0f MiB in all", (double)total_bytes / 1048576);
    say(&p, width - PAD, SMALL, 1, VIEW_TEXT_DIM, text);
    p.y += LINE + 2;
    draw_pool(&p, "bricks", &v->stats.bricks, v->stats.num_resident_bricks, 0);
    draw_pool(&p, "tiles", &v->stats.tiles, v->stats.num_resident_tiles, 2);
    draw_churn(&p, &v->history, v->history.produced, "produced in a frame", 2);
    draw_churn(&p, &v->history, v->history.evicted, "evicted", 1);
    draw_churn(&p, &v->history, v->history.reproduced, "produced again", 3);
    say_pair(&p, "requests", group_digits(v->stats.num_requests, digits));
    snprintf(text, sizeof text, "%s of %s", group_digits(v->stats.num_provisional, digits),
             group_digits(v->stats.num_hits, (char[48]){0}));
    say_pair(&p, "hits on stand-ins", text);
    say_pair(&p, "rays without data", group_digits(v->stats.num_incomplete, digits));
    view_panel_end(v, VIEW_PANEL_PAGE, p.cairo, v->width_px - (int)((width + MARGIN) * p.s), view_hud_top(v));
}

/* ---- help, prompt, messages ---- */

static void draw_help(viewer *v)
{
    size_t num_sections = 0;
    for (size_t i = 0; i < view_num_keys; i++)
        num_sections += view_keys[i].section != NULL;
    const double width = 690, line = 17, gap = 9, label = 150;
    double height = 2 * PAD + 24 + line * (double)(view_num_keys) + gap * (double)(num_sections - 1);
    /* Small windows get small type. */
    double room = fmin(v->width_px / (width + 2 * MARGIN), v->height_px / (height + 2 * MARGIN)), scale = v->scale;
    if (room < scale)
        scale = fmax(0.3, room);
    cairo_t *cairo = view_panel_begin(v, VIEW_PANEL_HELP, (int)(width * scale), (int)(height * scale));
    if (!cairo)
        return;
    cairo_scale(cairo, scale, scale);
    view_draw_panel(cairo, width, height, 1);
    view_draw_panel(cairo, width, height, 1); /* much text: darker */
    view_draw_text(cairo, PAD + 4, PAD + 14, 13, 0, VIEW_TEXT_STRONG, "Keys");
    double y = PAD + 24 + 14;
    for (size_t i = 0; i < view_num_keys; i++) {
        if (view_keys[i].section) {
            if (i)
                y += gap;
            view_draw_text(cairo, PAD + 4, y, SMALL, 0, VIEW_TEXT_DIM, view_keys[i].section);
        }
        view_set_hue(cairo, 1, 1);
        cairo_move_to(cairo, PAD + 96, y);
        cairo_select_font_face(cairo, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
        cairo_set_font_size(cairo, 11.5);
        cairo_show_text(cairo, view_keys[i].label);
        view_draw_text(cairo, PAD + 86 + label - 30, y, 11.5, 0, VIEW_TEXT, view_keys[i].help);
        y += line;
    }
    view_panel_end(v, VIEW_PANEL_HELP, cairo, (int)((v->width_px - width * scale) / 2),
                   (int)((v->height_px - height * scale) / 2));
}

static void draw_prompt(viewer *v)
{
    const double width = fmin(520, v->width_px / v->scale - 2 * MARGIN), height = 3 * LINE + 2 * PAD;
    sheet p = begin_sheet(v, VIEW_PANEL_PROMPT, width, height);
    if (!p.cairo)
        return;
    say(&p, p.x, TEXT, 0, VIEW_TEXT_STRONG, v->prompt_is_world ? "Open" : "Go to");
    say(&p, p.width - PAD, SMALL, 1, VIEW_TEXT_DIM,
        v->prompt_is_world ? "a world of Karst's, such as hills, or a file"
                           : "x,y,z or x,y,z,yaw,pitch,fov in metres and degrees");
    p.y += LINE + 2;
    char text[sizeof v->prompt + 8];
    snprintf(text, sizeof text, "%s\u258f", v->prompt);
    /* The end is what one types at. */
    const char *shown = text;
    while (strlen(shown) > 8 && view_text_width(p.cairo, TEXT * p.s, VIEW_TEXT_MONO, shown) > (p.width - 2 * PAD) * p.s)
        shown++;
    say(&p, p.x, TEXT, 0, VIEW_TEXT_MONO, shown);
    p.y += LINE + 2;
    say(&p, p.x, SMALL, 0, *v->prompt_error ? VIEW_TEXT_BAD : VIEW_TEXT_DIM,
        *v->prompt_error ? v->prompt_error : "Enter goes, Esc stays, Ctrl+V pastes");
    view_panel_end(v, VIEW_PANEL_PROMPT, p.cairo, (int)((v->width_px - width * p.s) / 2), v->height_px / 3);
}

static void draw_toast(viewer *v)
{
    sheet p = begin_sheet(v, VIEW_PANEL_TOAST, 1, 1);
    if (!p.cairo)
        return;
    double most = v->width_px / v->scale - 2 * MARGIN;
    double width = fmin(view_text_width(p.cairo, TEXT * p.s, VIEW_TEXT, v->toast) / p.s + 2 * PAD + 4, most);
    cairo_destroy(p.cairo);
    double height = LINE + 2 * PAD - 4;
    p = begin_sheet(v, VIEW_PANEL_TOAST, width, height);
    if (!p.cairo)
        return;
    say(&p, p.x + 2, TEXT, 0, v->toast_bad ? VIEW_TEXT_BAD : VIEW_TEXT, v->toast);
    /* Above the status. */
    view_panel_end(v, VIEW_PANEL_TOAST, p.cairo, (int)((v->width_px - width * p.s) / 2),
                   v->height_px - (int)((2 * MARGIN + 3 * LINE + 2 * PAD + height) * p.s));
}

/* The compiler's words as they are: its caret stands under the right letter only in type of one width. */
static void draw_error(viewer *v)
{
    char text[sizeof v->reload.error];
    snprintf(text, sizeof text, "%s", v->reload.error);
    int num_lines = 2;
    for (const char *p = text; *p; p++)
        num_lines += *p == '\n';
    num_lines = num_lines > 14 ? 14 : num_lines;
    const double line = 16, size = 11.5;
    double width = fmin(820, v->width_px / v->scale - 2 * MARGIN), height = num_lines * line + 2 * PAD + 4;
    sheet p = begin_sheet(v, VIEW_PANEL_ERROR, width, height);
    if (!p.cairo)
        return;
    view_set_hue(p.cairo, 3, 0.9);
    cairo_rectangle(p.cairo, 0, 6 * p.s, 3 * p.s, (height - 12) * p.s);
    cairo_fill(p.cairo);
    say(&p, p.x + 4, TEXT, 0, VIEW_TEXT_BAD, "The world file has a mistake; this is its last good state");
    p.y += line + 2;
    char *rest = text;
    for (int i = 1; i < num_lines && rest; i++) {
        char *end = strchr(rest, '\n');
        if (end)
            *end++ = 0;
        say(&p, p.x + 4, size, 0, VIEW_TEXT_MONO, rest);
        p.y += line;
        rest = end;
    }
    view_panel_end(v, VIEW_PANEL_ERROR, p.cairo, (int)(MARGIN * p.s), (int)(MARGIN * p.s));
}

static void draw_cross(viewer *v)
{
    const int side = (int)(15 * v->scale) | 1;
    cairo_t *cairo = view_panel_begin(v, VIEW_PANEL_CROSS, side, side);
    if (!cairo)
        return;
    double middle = side / 2.0, arm = 6 * v->scale, hole = 2 * v->scale;
    for (int pass = 0; pass < 2; pass++) {
        cairo_set_source_rgba(cairo, pass, pass, pass, pass ? 0.85 : 0.45);
        cairo_set_line_width(cairo, pass ? v->scale : 3 * v->scale);
        for (int i = 0; i < 4; i++) {
            double x = i == 0 ? 1 : i == 1 ? -1 : 0, y = i == 2 ? 1 : i == 3 ? -1 : 0;
            cairo_move_to(cairo, middle + x * hole, middle + y * hole);
            cairo_line_to(cairo, middle + x * arm, middle + y * arm);
        }
        cairo_stroke(cairo);
    }
    view_panel_end(v, VIEW_PANEL_CROSS, cairo, (v->width_px - side) / 2, (v->height_px - side) / 2);
}

/* ---- all ---- */

static void draw_or_hide(viewer *v, view_panel_kind kind, bool wanted, void (*draw)(viewer *))
{
    if (wanted)
        draw(v);
    else
        view_panel_hide(v, kind);
}

bool view_hud_update(viewer *v, bool all)
{
    if (*v->toast && v->now_s > v->toast_until_s) {
        v->toast[0] = 0;
        v->hud_dirty = true;
    }
    bool has_graph = false;
    for (size_t i = 0; i < sizeof pages_with_graphs / sizeof *pages_with_graphs; i++)
        has_graph = has_graph || v->page == pages_with_graphs[i];
    bool figures_changed = v->page != VIEW_PAGE_NONE && v->num_shown != v->num_frames;
    if (!all && !v->hud_dirty && !(figures_changed && v->now_s - v->hud_at_s > UPDATE_S))
        return false;
    if (v->width_px < 1 || v->height_px < 1)
        return false;
    /* A window smaller than a panel shows the world alone. */
    bool room = v->width_px >= 120 * v->scale && v->height_px >= 60 * v->scale;
    bool full = v->page != VIEW_PAGE_NONE && v->engine && room;
    full = full && !v->help_shown;
    /* Nor does one panel lie over another: pages are 280 by 310, the status line below and sliders beside them. */
    bool page = full && has_graph && v->width_px >= (v->sliders.shown ? 590 : 310) * v->scale &&
                v->height_px >= 330 * v->scale;
    bool covered = page && v->height_px < 400 * v->scale;
    draw_or_hide(v, VIEW_PANEL_ERROR, *v->reload.error && room && !v->help_shown, draw_error); /* others stand below */
    draw_or_hide(v, VIEW_PANEL_STATUS, full && !covered, draw_status);
    draw_or_hide(v, VIEW_PANEL_CROSS, full, draw_cross);
    /* Beside a page, and below nothing else. */
    bool gauges = full && !v->sliders.shown && v->height_px >= 200 * v->scale && v->width_px >= 560 * v->scale;
    draw_or_hide(v, VIEW_PANEL_COMPASS, gauges, view_draw_compass);
    draw_or_hide(v, VIEW_PANEL_DEPTH,
                 full && v->view == KARST_VIEW_DEPTH && !*v->reload.error && v->width_px >= 900 * v->scale,
                 view_draw_depth_scale);
    draw_or_hide(v, VIEW_PANEL_PAGE, page, v->page == VIEW_PAGE_CACHE ? draw_cache_page : draw_frame_page);
    draw_or_hide(v, VIEW_PANEL_SLIDERS, v->sliders.shown && room && !v->help_shown, view_sliders_draw);
    draw_or_hide(v, VIEW_PANEL_PROMPT, v->prompt_shown && room, draw_prompt);
    draw_or_hide(v, VIEW_PANEL_HELP, v->help_shown && room, draw_help);
    draw_or_hide(v, VIEW_PANEL_TOAST, *v->toast && room, draw_toast);
    v->hud_dirty = false;
    v->hud_at_s = v->now_s;
    v->num_shown = v->num_frames;
    return true;
}
