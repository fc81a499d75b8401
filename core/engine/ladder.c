#include "core/engine/ladder.h"

#include <math.h>

/* Frames that a starved rung may go on producing before it counts as failed: wants seen through stand-ins are more than
 * the final ones, so some starvation passes by itself. */
#define MAX_STARVED_FRAMES 24
/* It is no use going on once so many wants starve for each that is answered. */
#define STARVED_TO_PRODUCED 8
/* Frames that it may do so without fewer wants starving than ever before: by then stand-ins push one another out. */
#define MAX_FRAMES_NO_BETTER 8
/* Slots' worth of production that a rung may take for a view. What fits takes less than three: itself, its stand-ins
 * and the way there. With a small budget what does not fit need never starve: each round's few find slots among what
 * the next rounds will miss. */
#define MAX_POOLS_PRODUCED 8
/* By how much a working set grows at least, mostly, from one rung to the next finer one. */
#define USUAL_GROWTH 1.2
/* In motion: rounds without starvation before a finer rung is tried. */
#define CALM_FRAMES_TO_REFINE 10

void karst_ladder_init(karst_ladder *ladder) { *ladder = (karst_ladder){.failed = -1, .fitted = -1, .judged = -1}; }

void karst_ladder_view_changed(karst_ladder *ladder)
{
    ladder->failed = ladder->fitted = ladder->judged = -1;
    ladder->deciding = false;
    ladder->frames_on_rung = 0;
    ladder->frames_since_better = 0;
    ladder->least_starved = 0;
    ladder->num_produced = 0;
    ladder->moved = true;
}

static void begin_rung(karst_ladder *ladder, int rung)
{
    ladder->rung = rung;
    ladder->deciding = false;
    ladder->frames_on_rung = 0;
    ladder->frames_since_starved = 0;
    ladder->frames_since_better = 0;
    ladder->least_starved = 0;
    ladder->num_produced = 0;
}

static bool move_to(karst_ladder *ladder, int rung)
{
    begin_rung(ladder, rung < KARST_LADDER_RUNGS ? rung : KARST_LADDER_RUNGS - 1);
    return true;
}

/* The rung is too large: back to the one that fits, or on to the next. */
static bool fail_rung(karst_ladder *ladder)
{
    if (ladder->rung > ladder->failed)
        ladder->failed = ladder->rung;
    ladder->deciding = false;
    return ladder->rung + 1 < KARST_LADDER_RUNGS && move_to(ladder, ladder->rung + 1);
}

/* Rungs to climb at once. A surface's working set falls with the square of the voxel, that is by half every two rungs.
 * What is wanted now is less than what the rung needs in the end, so this rarely climbs too far; when it does, the
 * ladder comes back down. */
static int rungs_to_climb(const karst_ladder_round *round)
{
    double need = (double)(round->num_used + round->num_starved) / (double)(round->num_total ? round->num_total : 1);
    int rungs = need > 1 ? (int)floor(2 * log2(need)) : 1;
    return rungs < 1 ? 1 : rungs > 8 ? 8 : rungs;
}

/* Wants starve, or the rung takes more than what fits could: may it be that they will not any longer? */
static bool is_stuck(karst_ladder *ladder, const karst_ladder_round *round, bool thrashes)
{
    ladder->frames_since_starved = 0;
    ladder->frames_since_better++;
    if (ladder->least_starved == 0 || round->num_starved < ladder->least_starved) {
        ladder->least_starved = round->num_starved;
        ladder->frames_since_better = 0;
    }
    return round->num_produced * STARVED_TO_PRODUCED < round->num_starved || thrashes ||
           ladder->frames_on_rung > MAX_STARVED_FRAMES || ladder->frames_since_better > MAX_FRAMES_NO_BETTER;
}

/* Far from what fits, or for a view that is none any more, a guess will do: what it leaves out is looked at later. */
static bool leave_stuck_rung(karst_ladder *ladder, const karst_ladder_round *round, bool moved)
{
    const int rungs = rungs_to_climb(round);
    if (ladder->rung + 1 >= KARST_LADDER_RUNGS)
        return fail_rung(ladder);
    if (!moved && ladder->judged == ladder->rung)
        return fail_rung(ladder);
    if (moved || (rungs > 1 && ladder->fitted != ladder->rung + 1))
        return move_to(ladder, ladder->rung + rungs);
    ladder->deciding = true;
    return false;
}

bool karst_ladder_step(karst_ladder *ladder, const karst_ladder_round *round)
{
    bool moved = ladder->moved;
    ladder->moved = false;
    ladder->frames_on_rung++;
    ladder->num_produced += round->num_produced;

    if (ladder->deciding) {
        if (round->verdict == KARST_LADDER_UNDECIDED)
            return false;
        if (round->verdict != KARST_LADDER_FITS)
            return fail_rung(ladder);
        ladder->judged = ladder->rung;
        begin_rung(ladder, ladder->rung); /* all is there: the next picture finds it */
        return false;
    }
    bool thrashes = ladder->num_produced > MAX_POOLS_PRODUCED * round->num_total;
    if (round->num_starved > 0 || thrashes) {
        const bool next_to_fitted =
            !moved && ladder->fitted == ladder->rung + 1 && ladder->judged != ladder->rung;
        return (next_to_fitted || is_stuck(ladder, round, thrashes)) && leave_stuck_rung(ladder, round, moved);
    }
    ladder->frames_since_starved++;

    if (round->num_requests == 0) {
        if (round->num_used > round->num_total)
            return fail_rung(ladder);
        ladder->fitted = ladder->rung;
        if (ladder->rung <= ladder->failed + 1)
            return false;
        move_to(ladder, ladder->rung - 1);
        ladder->deciding = !moved && (double)round->num_used * USUAL_GROWTH > (double)round->num_total;
        return true;
    }
    /* Never settled in motion: refine once the finer rung's working set is likely to fit with room to spare. */
    if (ladder->rung > ladder->failed + 1 && moved && ladder->frames_since_starved >= CALM_FRAMES_TO_REFINE &&
        (double)round->num_used * 1.7 < (double)round->num_total)
        return move_to(ladder, ladder->rung - 1);
    return false;
}

bool karst_ladder_is_deciding(const karst_ladder *ladder) { return ladder->deciding; }

double karst_ladder_factor(const karst_ladder *ladder) { return exp2(ladder->rung / 4.0); }

bool karst_ladder_at_rest(const karst_ladder *ladder)
{
    return ladder->rung <= ladder->failed + 1 && !ladder->deciding;
}
