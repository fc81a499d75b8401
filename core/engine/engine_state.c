/* What frames, scouts and rounds alike ask of the engine's state. */
#include "core/engine/engine_parts.h"

/* Bricks are made before it is known whether they stay. Slots for that: one at least, one in so many, at most... */
#define BRICKS_TO_SPARE 64u
#define MOST_SPARE 8u

void karst_engine_next_serial(karst_engine *engine)
{
    if (++engine->serial == 0) /* which means none */
        engine->serial = 1;
}

double karst_engine_detail_px(const karst_engine *engine)
{
    return engine->detail_px * karst_ladder_factor(&engine->ladder) * engine->pace.factor;
}

uint32_t karst_engine_usable_bricks(const karst_cache_buffers *buffers)
{
    const uint32_t bricks = buffers->num_bricks - 1, share = bricks / BRICKS_TO_SPARE;
    return bricks - (share < 1 ? 1 : share < MOST_SPARE ? share : MOST_SPARE);
}
