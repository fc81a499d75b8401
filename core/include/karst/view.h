/* What a viewer needs of an engine beyond pictures: fewer pixels for a while, a budget that changes, what lies under a
 * pixel, and pictures that show what the engine does. */
#ifndef KARST_VIEW_H
#define KARST_VIEW_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/engine.h"
#include "karst/error.h"
#include "karst/path.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Draws pictures of this size, with no more pixels than karst_engine_set_size (or creation) made room for, from the
 * next frame on: cheap enough to be done while things move, since only the display's pixel buffer is made anew. In a
 * window they are stretched over its viewport. Voxels are asked for as pixels are wide, so fewer pixels also ask for
 * coarser levels. Reading functions give this size. Errors: KARST_USAGE (more pixels than there is room for),
 * KARST_FAILED. */
bool karst_engine_set_drawn_size(karst_engine *engine, int width_px, int height_px, karst_error *error);
/* karst_engine_config.budget_ms from now on. Errors: KARST_USAGE (out of its range). */
bool karst_engine_set_budget_ms(karst_engine *engine, double budget_ms, karst_error *error);
/* Says that the next frame's camera is a path's at time_s, and that frames are frame_s apart. Then what is left of a
 * budget in ms is for what the path will see within the next 60 frames; else for where the motion of the last ones
 * leads. Holds for one frame, until whose end the path is borrowed. It changes no settled picture. */
void karst_engine_follow(karst_engine *engine, const karst_path *path, double time_s, double frame_s);
/* Whom to ask, before a frame's production and between its rounds, whether to go on; false: the frame ends with what is
 * there, but for the first round, which is made in any case. Who stands and has a budget in ms is then given up to four
 * times budget_bricks in a frame. So a viewer can give much time to a view that stands and
 * still answer at once. Asked on the thread that draws, when the picture lies in the window's framebuffer (it may be
 * shown there and then) and the engine is at work: `goes_on` must not call it. NULL: nobody. */
void karst_engine_set_patience(karst_engine *engine, bool (*goes_on)(void *user), void *user);
/* Has memory found for so much of the pool of bricks, by a thread of low priority beside frames: what is not found
 * ahead is when it is first needed, at some cost. Only for CPU devices; does nothing elsewhere. */
void karst_engine_find_memory(karst_engine *engine, uint64_t size_bytes);
/* Draws the last frame's picture again, over the current viewport of a window; does nothing elsewhere. Errors:
 * KARST_USAGE (there is none yet), KARST_FAILED. */
bool karst_engine_show(karst_engine *engine, karst_error *error);

/* What a ray of the last frame met. */
typedef struct {
    bool hit;
    bool provisional; /* on a coarser brick than asked for */
    int level;        /* of what it met; 0 for a miss */
    double depth_m;   /* along the ray; INFINITY for a miss */
} karst_probe;
/* At a pixel of the last frame's picture (0, 0 is top left). Errors: KARST_USAGE (outside), KARST_FAILED. */
bool karst_engine_probe(karst_engine *engine, int x_px, int y_px, karst_probe *probe, karst_error *error);

/* Pictures that show what the engine does. Their kernels are built when one is first asked for. */
typedef enum {
    KARST_VIEW_PICTURE,     /* the world as it looks */
    KARST_VIEW_LEVEL,       /* a colour for each level of detail */
    KARST_VIEW_BRICKS,      /* the borders of bricks, over the world */
    KARST_VIEW_STEPS,       /* how many nodes and cells each ray looked at: dark few, bright many */
    KARST_VIEW_AGE,         /* frames since a brick was made: bright young, dark old */
    KARST_VIEW_PRODUCED,    /* bricks that were made just before this frame */
    KARST_VIEW_PROVISIONAL, /* bricks that stand in for finer ones, which are missing */
    KARST_VIEW_DEPTH,       /* distance, logarithmically: bright near, dark far */
    KARST_VIEW_NORMAL,      /* x, y, z of the normal as red, green, blue */
    KARST_VIEW_ALBEDO,      /* the colour of surfaces, without light */
    KARST_VIEW_OCCLUSION,   /* how open surfaces are to the light from all around: white open, black not */
    KARST_VIEW_BOUNCES,     /* how often light was followed on from a pixel: mirrored, refracted, straight through */
    KARST_NUM_VIEWS
} karst_view;
/* "picture", "level", "bricks", "steps", "age", "produced", "provisional", "depth", "normal", "albedo",
 * "occlusion", "bounces". */
const char *karst_view_name(karst_view view);
bool karst_view_parse(const char *name, karst_view *view, karst_error *error); /* KARST_USAGE lists the names */
/* Takes effect with the next frame. "age" knows what was made since it was first asked for; older bricks count as old.
 * Errors: KARST_USAGE (no such view; albedo of an engine of one sample and plain tone, which keeps bytes; occlusion of
 * an engine without), KARST_FAILED. */
bool karst_engine_set_view(karst_engine *engine, karst_view view, karst_error *error);

/* Normals of the last frame, in world axes, three floats a pixel, top row first; zeros where nothing was hit. Builds
 * its kernel when first asked. Errors: KARST_USAGE (num_values is not 3 * width * height; no frame yet), KARST_FAILED.
 */
bool karst_engine_read_normals(karst_engine *engine, float *normals, size_t num_values, karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
