/* What frames, scouts and rounds alike ask of the engine's state. */
#include "core/engine/engine_parts.h"

void karst_engine_next_serial(karst_engine *engine)
{
    if (++engine->serial == 0) /* which means none */
        engine->serial = 1;
}

double karst_engine_detail_px(const karst_engine *engine)
{
    return engine->detail_px * karst_ladder_factor(&engine->ladder) * engine->pace.factor;
}
