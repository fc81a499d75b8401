#include "core/pace.h"

#include <math.h>

/* The share of the hits that is held at the level asked for: what production makes first is what most pixels show, so
 * that a view is better off a little behind than coarser. */
#define GOAL 0.9
/* Less than this is a new view; and in steady motion, whose wants do not end by waiting, less than this. */
#define NEW_VIEW 0.5
#define NEW_VIEW_STEADY 0.15
/* Octaves in a frame at most. Slow enough in motion that levels blend rather than pop; but where much is seen for the
 * first time, as behind a crest, stand-ins pop anyway. */
#define MOST_COARSER 0.04
#define FAR_BEHIND 0.09
#define CATCH_UP 0.6
#define MOST_FINER 0.06
/* A new view sharpens as fast as it can, and so does one where all that was asked for was made. */
#define MOST_FINER_NEW 0.5
#define FINER_WITH_TIME_LEFT 0.12

void karst_pace_init(karst_pace *pace) { *pace = (karst_pace){.factor = 1}; }

bool karst_pace_at_rest(const karst_pace *pace) { return pace->factor == 1; }

/* Octaves to go finer; below 0: coarser. */
static double octaves_finer(const karst_pace *pace, const karst_pace_frame *frame, double share)
{
    double spare = share - GOAL;
    if (frame->num_deferred == 0)
        return FINER_WITH_TIME_LEFT;
    if (spare >= 0)
        return fmin(spare, pace->new_view ? MOST_FINER_NEW : MOST_FINER);
    /* Of a new view what is behind comes by itself. */
    return pace->new_view ? 0 : spare < -FAR_BEHIND ? CATCH_UP * spare : fmax(spare, -MOST_COARSER);
}

void karst_pace_step(karst_pace *pace, const karst_pace_frame *frame)
{
    double share = frame->num_hits ? 1 - (double)frame->num_provisional / (double)frame->num_hits : 1;
    if (share < (frame->steady ? NEW_VIEW_STEADY : NEW_VIEW) && frame->moved)
        pace->new_view = true;
    if (pace->new_view && share < NEW_VIEW && frame->num_deferred > 0) {
        pace->factor = KARST_PACE_MOST;
        return;
    }
    /* A view that stands and is not new, as when a flight ends, is wanted whole at once. */
    if (!frame->moved && !pace->new_view) {
        pace->factor = 1;
        return;
    }
    double finer = octaves_finer(pace, frame, share);
    pace->factor = fmin(fmax(pace->factor * exp2(-finer), 1), KARST_PACE_MOST);
    if (pace->factor < 1.01 && finer > 0)
        pace->factor = 1;
    if (share >= GOAL)
        pace->new_view = false;
}
