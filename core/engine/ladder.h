/* The detail ladder: which detail a view gets when its working set does not fit the pools (DESIGN invariant 4, "calm").
 *
 * A rung r asks for voxels 2^(r/4) times as wide as the user asked for. The ladder ends on the finest rung that fits,
 * whichever rung it came from, so that a settled picture depends on the view and not on its history. That wants starve
 * says little: through stand-ins rays want more than they need in the end, and what earlier views left behind helps or
 * hinders. So a ladder that starves far from what fits climbs, by a guess, and that proves nothing. Next to a rung that
 * fits it asks for a verdict, which is of view and pools alone. Not all rays have a part in it: paths that media
 * scatter go where stand-ins let them. So a rung that is stuck once more after a verdict that it fits is too large. A
 * rung that is too large is not tried again until the view, the world or the pools change. Plain data, no device. */
#ifndef KARST_CORE_LADDER_H
#define KARST_CORE_LADDER_H

#include <stdbool.h>
#include <stdint.h>

#define KARST_LADDER_RUNGS 96 /* 2^24 times as wide: from centimetres past a planet */

/* Whether what the view needs on this rung fits the pools, all of it, whatever lies in them. */
typedef enum {
    KARST_LADDER_NO_VERDICT, /* nobody looks: that wants starve counts */
    KARST_LADDER_UNDECIDED,
    KARST_LADDER_FITS,
    KARST_LADDER_TOO_LARGE
} karst_ladder_verdict;

typedef struct {
    int rung;
    int failed;    /* coarsest rung known to fail for this view; -1: none */
    int fitted;    /* rung that was last seen to fit this view; -1: none */
    int judged;    /* rung that a verdict said fits this view; -1: none */
    bool deciding; /* the next rounds bring a verdict on this rung */
    uint32_t frames_on_rung;
    uint32_t frames_since_starved;
    uint64_t least_starved; /* wants that found no slot, in the best frame on this rung; 0: none starved yet */
    uint32_t frames_since_better;
    uint64_t num_produced; /* on this rung, with this view */
    bool moved; /* the view changed since the last step */
} karst_ladder;

/* What one round of production came to. */
typedef struct {
    uint64_t num_used, num_total; /* slots of the fuller pool: in use by this view, and what a settled one may use */
    uint64_t num_starved;         /* wants that found no slot to recycle */
    uint64_t num_requests;        /* all wants */
    uint64_t num_produced;        /* tiles and bricks granted */
    karst_ladder_verdict verdict; /* counts while the ladder is deciding */
} karst_ladder_round;

void karst_ladder_init(karst_ladder *ladder);
/* The view, the world or the pools changed: what failed may fit now. The rung stays where it is until there is reason
 * to move. */
void karst_ladder_view_changed(karst_ladder *ladder);
/* Takes a round's outcome; may move the rung. Returns true if the rung moved (the next frame asks for other detail). */
bool karst_ladder_step(karst_ladder *ladder, const karst_ladder_round *round);
/* The rounds to come are to be of rays that are sure (raycast/cast/cast.h), and to bring a verdict: while there is none
 * the rung does not move. */
bool karst_ladder_is_deciding(const karst_ladder *ladder);
/* 2^(rung/4). */
double karst_ladder_factor(const karst_ladder *ladder);
/* The rung is the finest that fits: nothing further will be tried for this view. */
bool karst_ladder_at_rest(const karst_ladder *ladder);

#endif
