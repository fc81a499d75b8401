/* What tests may do to an engine, and programs may not. */
#ifndef KARST_CORE_ENGINE_INTERNAL_H
#define KARST_CORE_ENGINE_INTERNAL_H

#include "karst/engine.h"

/* The next frame is the one after number `frame`, its cast the one after `serial`, as if that many had been before.
 * Only for an engine that has drawn nothing yet: stamps of another age would lie in its pools. */
void karst_engine_start_counting_at(karst_engine *engine, uint32_t serial, uint32_t frame);

/* From now on bricks and tiles count as taking so long, whatever they take: what a budget in ms buys is then the same
 * on every machine. */
void karst_engine_pretend_cost(karst_engine *engine, double brick_ns, double tile_ns);

#endif
