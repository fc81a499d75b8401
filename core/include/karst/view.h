/* What a viewer needs of an engine beyond pictures: fewer pixels for a while, a budget that changes, what lies under a
 * pixel, and pictures that show what the engine does. */
#ifndef KARST_VIEW_H
#define KARST_VIEW_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/engine.h"
#include "karst/error.h"

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

#ifdef __cplusplus
}
#endif
#endif
