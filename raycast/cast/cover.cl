/* Entry point of covering. See raycast/cast/cover.h. */
#include "raycast/rays_shared.h"

/* `ends`: level-0 voxels along each ray, in the order of the hits. */
__kernel void cover_hits(K_GLOBAL const float *ends, uint num, K_GLOBAL karst_hit *hits)
{
    const uint i = (uint)get_global_id(0);
    if (i >= num || KARST_HIT_KIND(hits[i].kind) == KARST_HIT_MISS || !(hits[i].t > ends[i]))
        return;
    hits[i].kind = KARST_HIT_MISS;
    hits[i].t = ends[i];
    hits[i].brick = 0;
}
