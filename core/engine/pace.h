/* The pace: how much coarser than the ladder's rung a picture asks while production is behind its budget in ms.
 *
 * A budget holds for so many bricks a frame and no more. Where the view wants more, asking for all of it at once gives
 * a patchwork: some at its level, some as coarse as what happens to be there. Instead the whole view asks for voxels
 * `factor` times as wide, so many that most of it is there, and sharpens evenly as production follows. Without a budget
 * in ms the factor is 1; and a view that stands still always comes back to 1, so that no settled picture depends on it.
 *
 * Levels hold for a doubling of distance each. So a factor 2^s larger or smaller changes the level asked for of some
 * share s of the picture: what the steps are made of. Plain data, no device and no clock. */
#ifndef KARST_CORE_PACE_H
#define KARST_CORE_PACE_H

#include <stdbool.h>
#include <stdint.h>

/* The most, in motion and for a new view. */
#define KARST_PACE_MOST 2.0

typedef struct {
    double factor; /* 1 to KARST_PACE_MOST */
    bool new_view; /* most of what is seen is new, and not there yet */
    bool sharpens; /* it was new, and what it was to show first was there */
    int num_short; /* frames in a row that were short of what was asked for */
} karst_pace;

/* What one frame came to. */
typedef struct {
    uint64_t num_hits, num_provisional; /* pixels with a surface, and those of them above the level asked for */
    uint64_t num_deferred;              /* wants left out because they were over the budget */
    bool moved;                         /* the view is not the one of the frame before */
    bool steady;                        /* and went on as it did before */
} karst_pace_frame;

void karst_pace_init(karst_pace *pace);
/* Before anything is made for a frame whose hits are known: of a view that is new nothing finer is made than what it
 * will be asked for. num_deferred is not looked at. */
void karst_pace_look(karst_pace *pace, const karst_pace_frame *frame);
/* Takes a frame's outcome; the factor is the next frame's. */
void karst_pace_step(karst_pace *pace, const karst_pace_frame *frame);
/* Asks for all: nothing is held back any more. */
bool karst_pace_at_rest(const karst_pace *pace);

#endif
