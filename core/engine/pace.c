#include "core/engine/pace.h"

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
#define FINER_WITH_TIME_LEFT 0.12
#define FINER_AT_LAST 0.25
/* A view that was new a moment ago sharpens by so much for what it has to spare. */
#define SHARPEN 2.0
/* What is wanted first is little, and what is there already takes frames to be seen: so long a view may be short of
 * what is asked for though nothing was put off, or though it was not short when it began to sharpen. */
#define PATIENCE 8

void karst_pace_init(karst_pace *pace) { *pace = (karst_pace){.factor = 1}; }

bool karst_pace_at_rest(const karst_pace *pace) { return pace->factor == 1; }

static double share_at_level(const karst_pace_frame *frame)
{
    return frame->num_hits ? 1 - (double)frame->num_provisional / (double)frame->num_hits : 1;
}

static bool is_new(const karst_pace_frame *frame)
{
    return frame->moved && share_at_level(frame) < (frame->steady ? NEW_VIEW_STEADY : NEW_VIEW);
}

void karst_pace_look(karst_pace *pace, const karst_pace_frame *frame)
{
    if (!is_new(frame))
        return;
    if (!pace->new_view)
        pace->num_short = 0;
    pace->new_view = true;
    pace->factor = KARST_PACE_MOST;
}

/* Octaves to go finer; below 0: coarser. */
static double octaves_finer(const karst_pace *pace, const karst_pace_frame *frame, double share)
{
    double spare = share - GOAL;
    bool has_time = frame->num_deferred == 0, was_new = pace->new_view || pace->sharpens;
    if (spare >= 0)
        return fmax(was_new ? SHARPEN * spare : fmin(spare, MOST_FINER), has_time ? FINER_WITH_TIME_LEFT : 0);
    if (has_time)
        return pace->num_short > PATIENCE ? FINER_AT_LAST : 0;
    /* Of a new view what is behind comes by itself. */
    return was_new ? 0 : spare < -FAR_BEHIND ? CATCH_UP * spare : fmax(spare, -MOST_COARSER);
}

void karst_pace_step(karst_pace *pace, const karst_pace_frame *frame)
{
    double share = share_at_level(frame);
    pace->new_view |= is_new(frame);
    pace->num_short = share >= GOAL ? 0 : pace->num_short + 1;
    if (pace->num_short > PATIENCE)
        pace->sharpens = false;
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
    if (share >= GOAL && pace->new_view) {
        pace->new_view = false;
        pace->sharpens = true;
    }
    pace->sharpens = pace->sharpens && pace->factor > 1;
}
