/* From places on the land to edits: what each tool of the viewer lays, and how densely. Knows neither window nor
 * engine, only a density. */
#ifndef KARST_DEMOS_VIEW_STROKE_H
#define KARST_DEMOS_VIEW_STROKE_H

#include <karst/edit.h>

typedef enum {
    VIEW_NO_TOOL,
    VIEW_TOOL_ADD,
    VIEW_TOOL_DIG,
    VIEW_TOOL_SMOOTH,
    VIEW_TOOL_FLATTEN,
    VIEW_TOOL_PAINT,
    VIEW_TOOL_STAMP,
    VIEW_NUM_TOOLS
} view_tool;
extern const char *const view_tool_names[VIEW_NUM_TOOLS];

typedef struct {
    const char *name;
    double albedo[3]; /* linear */
} view_paint;
#define VIEW_NUM_PAINTS 8
extern const view_paint view_paints[VIEW_NUM_PAINTS];

typedef enum { VIEW_STAMP_BOULDER, VIEW_STAMP_BLOCK, VIEW_STAMP_POST, VIEW_NUM_STAMPS } view_stamp;
extern const char *const view_stamp_names[VIEW_NUM_STAMPS];

/* Of the size: half of what boulders and blocks are high; posts. */
#define VIEW_STAMP_HALF 0.7
#define VIEW_POST_RADIUS 0.2
#define VIEW_POST_LENGTH 2.0 /* at full strength */

typedef struct {
    view_tool tool;
    double size_m;   /* nothing is changed farther from the place, but for what is blended */
    double strength; /* above 0, at most 1: how much one touch does */
    int paint;
    view_stamp stamp;
} view_brush;

/* The land: its density, positive in solid, as one sees it now. */
typedef struct {
    double (*density)(void *user, const karst_position *at);
    void *user;
    int voxel_log2_m;
} view_ground;

/* A place on the land, and which way is out of it. */
typedef struct {
    karst_position at;
    double normal[3]; /* of length 1 */
} view_spot;

/* What lies between a button's going down and its coming up. Zero: a new one. */
typedef struct {
    size_t num_laid;
    view_spot last;         /* where the last edit was laid */
    karst_position last_at; /* and its centre */
    double last_s;
    view_spot begin;    /* flatten: the plane of the stroke */
    bool has_begin;
} view_stroke;

/* How far the surface is from a place along a direction of length 1, at most reach_m either way: the crossing nearest
 * to the place, with air ahead. *steepness (may be NULL) becomes how fast the density falls there, per metre. */
bool view_find_surface(const view_ground *ground, const karst_position *at, const double direction[3], double reach_m,
                       double *height_m, double *steepness);
/* The spot at a place: which way the density falls over some width; `towards` where it does not. */
view_spot view_find_spot(const view_ground *ground, const karst_position *at, double width_m, const double towards[3]);
/* Becomes the plane that the land around a spot is nearest to, within a radius. false: there is too little land. */
bool view_fit_plane(const view_ground *ground, const view_spot *spot, double radius_m, view_spot *plane,
                    double *steepness);
/* Two directions at right angles to one another and to a third; all have length 1. */
void view_make_sides(const double normal[3], double u[3], double v[3]);

/* The radius of what a touch changes of an even land. */
double view_brush_circle_m(const view_brush *brush);
/* Whether a held brush lays something at a spot at a time. Spots are of the land as it was when the stroke began, but
 * for smoothing: what is added on what was just added would grow into the sky. A brush that is held still goes on
 * adding, digging and smoothing, slowly: then the land as it is counts from there on. */
typedef enum { VIEW_NOT_DUE, VIEW_DUE_BY_WAY, VIEW_DUE_BY_TIME } view_due;
view_due view_stroke_due(const view_stroke *stroke, const view_brush *brush, const view_spot *spot, double now_s,
                         int voxel_log2_m);
/* What it lays there; false: nothing, because no plane fits. */
bool view_stroke_lay(view_stroke *stroke, const view_brush *brush, const view_spot *spot, double now_s,
                     const view_ground *ground, karst_edit *edit);

#endif
