/* Pictures that show what the engine does. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_VIEWS_SHARED_H
#define KARST_RAYCAST_VIEWS_SHARED_H

#include "core/device/dialect.h"

/* What to paint; the order is karst_view's (karst/view.h). */
#define KARST_PAINT_LEVEL 1
#define KARST_PAINT_BRICKS 2
#define KARST_PAINT_STEPS 3
#define KARST_PAINT_AGE 4
#define KARST_PAINT_PRODUCED 5
#define KARST_PAINT_PROVISIONAL 6
#define KARST_PAINT_DEPTH 7
#define KARST_PAINT_NORMAL 8
/* Painted of values that the engine knows (karst_views_paint_values). */
#define KARST_PAINT_ALBEDO 9
#define KARST_PAINT_OCCLUSION 10
#define KARST_PAINT_BOUNCES 11

/* A counting cast (-DCAST_COUNT_STEPS) leaves in the upper bits of a hit's `kind` how many nodes and cells its packet
 * looked at for the ray. */
#define KARST_STEPS_SHIFT 18
#define KARST_STEPS_MAX 0x3fff

#endif
