/* Charts as SVG, drawn with cairo: lines, points, steps and stacked areas in panels one below the other. Series differ
 * by lightness and by dashes, marks or hatching, never by hue alone, so a chart can be read in grey and by the
 * colour-blind. */
#ifndef KARST_DEMOS_PLOT_H
#define KARST_DEMOS_PLOT_H

#include <stdbool.h>
#include <stddef.h>

#include <karst/error.h>

#define PLOT_MAX_SERIES 12 /* of one panel */

typedef enum {
    PLOT_LINE,
    PLOT_POINTS,
    PLOT_LINE_AND_POINTS,
    PLOT_STEPS,  /* holds each value until the next one's place */
    PLOT_STACKED /* an area on top of those before it in the panel, which need the same places */
} plot_kind;

typedef struct {
    const char *name; /* for the legend; NULL: not in it */
    plot_kind kind;
    size_t num;
    const double *x, *y;      /* x must not fall, except with PLOT_POINTS; what is not finite leaves a gap (as a stacked
                               * area: counts as 0) */
    const double *low, *high; /* NULL, or a band around y (a spread) */
} plot_series;

typedef struct {
    const char *label; /* with its unit */
    bool logarithmic;  /* values of 0 and less are left out */
    double min, max;   /* both 0: what the data needs */
} plot_axis;

/* A horizontal line with a name, such as a mark to be met. */
typedef struct {
    const char *name;
    double y;
} plot_level;

typedef struct {
    const char *title; /* NULL: none */
    plot_axis x, y;
    const plot_series *series;
    size_t num_series;
    const plot_level *levels;
    size_t num_levels;
    double height; /* relative to the other panels' */
} plot_panel;

typedef struct {
    const char *title, *subtitle; /* NULL: none */
    double width_pt, height_pt;   /* 0: 900 x 600 */
    const plot_panel *panels;
    size_t num_panels;
} plot_page;

/* The page as an SVG file's text, malloc'ed. Everything in `page` is borrowed during the call. Errors: KARST_FAILED
 * (memory, or what cairo says), KARST_USAGE (more series than a panel takes). Any thread. */
char *plot_svg(const plot_page *page, karst_error *error);

#endif
