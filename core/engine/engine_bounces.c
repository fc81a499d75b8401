/* How often light is followed on from pixels, while that is shown. */
#include "core/engine/engine_parts.h"

bool karst_engine_count_bounces(karst_engine *engine, const karst_pinhole *pinhole, const karst_bounce_stream *stream,
                                karst_error *error)
{
    return engine->view != KARST_PAINT_BOUNCES ||
           karst_views_count_bounces(engine->views, pinhole, stream->rays, stream->total, stream->room, error);
}
