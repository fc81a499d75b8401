#include "core/pace.h"

#include <math.h>

/* The share of the hits that is held at the level asked for. */
#define GOAL 0.94
/* Less than this is a new view; and in steady motion, whose wants do not end by waiting, less than this. */
#define NEW_VIEW 0.5
#define NEW_VIEW_STEADY 0.15
/* Octaves in a frame at most. Slow enough in motion that levels blend rather than pop; but where much is seen for the
 * first time, as behind a crest, stand-ins pop anyway, and coarser is whole at once. */
#define MOST_COARSER 0.04
#define FAR_BEHIND 0.09
#define CATCH_UP 1.5
#define MOST_FINER 0.025
/* Where all that was asked for was made there is time for more. */
#define FINER_WITH_TIME_LEFT 0.25
/* A view that stands and is not new, as when a flight ends, is wanted whole at once. */
#define ALL_OCTAVES 100.0
/* A new view sharpens as fast as it can, in motion too. */
#define MOST_FINER_NEW 0.25
#define FINER_NEW_WITH_TIME_LEFT 0.08

void karst_pace_init(karst_pace *pace) { *pace = (karst_pace){.factor = 1}; }

bool karst_pace_at_rest(const karst_pace *pace) { return pace->factor == 1; }

/* Octaves to go finer; below 0: coarser. */
static double octaves_finer(const karst_pace *pace, const karst_pace_frame *frame, double share)
{
    bool flies = frame->moved && !pace->new_view;
    double spare = share - GOAL;
    if (!frame->moved && !pace->new_view)
        return ALL_OCTAVES;
    bool calm = flies && pace->factor <= KARST_PACE_MOST_MOVING;
    if (frame->num_deferred == 0 && frame->moved)
        return calm ? MOST_FINER : spare < 0 ? 0 : FINER_NEW_WITH_TIME_LEFT;
    if (frame->num_deferred == 0)
        return FINER_WITH_TIME_LEFT;
    if (spare >= 0)
        return fmin(spare, calm ? MOST_FINER : MOST_FINER_NEW);
    /* Of a new view what is behind comes by itself. */
    return !flies ? 0 : spare < -FAR_BEHIND ? CATCH_UP * spare : fmax(spare, -MOST_COARSER);
}

void karst_pace_step(karst_pace *pace, const karst_pace_frame *frame)
{
    double share = frame->num_hits ? 1 - (double)frame->num_provisional / (double)frame->num_hits : 1;
    if (share < (frame->steady ? NEW_VIEW_STEADY : NEW_VIEW) && frame->num_deferred > 0 && frame->moved)
        pace->new_view = true;
    if (pace->new_view && share < NEW_VIEW && frame->num_deferred > 0) {
        pace->factor = KARST_PACE_MOST;
        return;
    }
    double finer = octaves_finer(pace, frame, share);
    /* Once it is beyond the bound of flight, because of what opened, it finds its way back as it can. */
    bool sudden = share < NEW_VIEW || pace->factor > KARST_PACE_MOST_MOVING;
    double most = sudden ? KARST_PACE_MOST : KARST_PACE_MOST_MOVING;
    pace->factor = fmin(fmax(pace->factor * exp2(-finer), 1), most);
    if (pace->factor < 1.01 && finer > 0)
        pace->factor = 1;
    if (pace->factor <= KARST_PACE_MOST_MOVING && share >= GOAL)
        pace->new_view = false;
}
