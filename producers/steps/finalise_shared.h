/* How samples become bricks. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_PRODUCERS_FINALISE_SHARED_H
#define KARST_PRODUCERS_FINALISE_SHARED_H

#include "producers/steps/load_shared.h"

/* What a sample that is not finite becomes: air, as little as can be told from 0. */
#ifdef KARST_MEDIUM
#define KARST_SCRUBBED 0.0f
#else
#define KARST_SCRUBBED (-KARST_MIN_RANGE)
#endif
/* Longer safe steps than this leave the brick anyway. */
#define KARST_MAX_SAFE_CELLS 32.0f

/* karst_brick_info.safe_cells from the square of the steepest slope of q, in q per cell. The relative error of the sum
 * of squares, the root and the quotient is below 2^-21. */
K_INLINE float karst_safe_cells(float slope_squared)
{
    float safe = (1.0f - 0x1p-20f) / k_sqrt(slope_squared > 1e-6f ? slope_squared : 1e-6f);
    return k_min(safe, KARST_MAX_SAFE_CELLS);
}

/* The state of a node from its samples: the least |d| and whether there are solid (d > 0) and air ones among them.
 *
 * Constant is a proof: with every sample on one side of zero and farther from it than `doubt`, every point of the node,
 * at every footprint from 0 to the parent's voxel, lies on the samples' side too, since it differs from the sample
 * nearest to it by `doubt` at most (karst_load_doubt). A doubt that is not finite proves nothing; neither do samples of
 * which some were scrubbed.
 *
 * Without a proof, samples on one side still say that this level's interpolant has no zero: the node is clear, and
 * keeps no brick. */
K_INLINE uint karst_state_from_samples(float least, int any_solid, int any_air, uint num_scrubbed, float doubt)
{
#ifdef KARST_MUTANT_SAMPLING /* what the proof is there to avoid; tests build it to see that it is caught */
    doubt = 0.0f;
#endif
#ifdef KARST_MEDIUM /* producers/steps/medium.h: bounds alone prove anything */
    return any_solid ? KARST_STATE_BRICK : KARST_STATE_CLEAR_AIR;
#endif
    int proven = num_scrubbed == 0u && least > doubt && any_solid != any_air;
    if (proven)
        return any_solid ? KARST_STATE_SOLID : KARST_STATE_AIR;
    return any_solid && any_air ? KARST_STATE_BRICK : any_solid ? KARST_STATE_CLEAR_SOLID : KARST_STATE_CLEAR_AIR;
}

#endif
