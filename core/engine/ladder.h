/* The detail ladder: which detail a view gets when its working set does not fit the pools (DESIGN invariant 4, "calm").
 *
 * A rung r asks for voxels 2^(r/4) times as wide as the user asked for. The ladder ends on the finest rung that fits,
 * whichever rung it came from, so that a settled picture depends on the view and not on its history: a rung that failed
 * is not tried again until the view, the world or the pools change; a rung that settled above the coarsest failure
 * tries the next finer one. Plain data, no device. */
#ifndef KARST_CORE_LADDER_H
#define KARST_CORE_LADDER_H

#include <stdbool.h>
#include <stdint.h>

#define KARST_LADDER_RUNGS 96 /* 2^24 times as wide: from centimetres past a planet */

typedef struct {
    int rung;
    int failed; /* coarsest rung known to fail for this view; -1: none */
    uint32_t frames_on_rung;
    uint32_t frames_since_starved;
    uint64_t least_starved; /* wants that found no slot, in the best frame on this rung; 0: none starved yet */
    uint32_t frames_since_better;
    uint64_t num_produced; /* on this rung, with this view */
    bool moved; /* the view changed since the last step */
} karst_ladder;

/* What one round of production came to. */
typedef struct {
    uint64_t num_used, num_total; /* slots of the fuller pool: in use by this view, and usable */
    uint64_t num_starved;         /* wants that found no slot to recycle */
    uint64_t num_requests;        /* all wants */
    uint64_t num_produced;        /* tiles and bricks granted */
} karst_ladder_round;

void karst_ladder_init(karst_ladder *ladder);
/* The view, the world or the pools changed: what failed may fit now. The rung stays where it is until there is reason
 * to move. */
void karst_ladder_view_changed(karst_ladder *ladder);
/* Takes a round's outcome; may move the rung. Returns true if the rung moved (the next frame asks for other detail). */
bool karst_ladder_step(karst_ladder *ladder, const karst_ladder_round *round);
/* 2^(rung/4). */
double karst_ladder_factor(const karst_ladder *ladder);
/* The rung is the finest that fits: nothing further will be tried for this view. */
bool karst_ladder_at_rest(const karst_ladder *ladder);

#endif
