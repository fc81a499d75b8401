/* Names of the stages: they stand in statistics files, so they never change. */
#include "karst/stats.h"

const char *karst_stage_name(karst_stage stage)
{
    switch (stage) {
    case KARST_STAGE_CAST:
        return "cast";
    case KARST_STAGE_REFINE:
        return "refine";
    case KARST_STAGE_SHADE:
        return "shade";
    case KARST_STAGE_COLLECT:
        return "collect";
    case KARST_STAGE_SUBDIVIDE:
        return "subdivide";
    case KARST_STAGE_EVALUATE:
        return "evaluate";
    case KARST_STAGE_FINALISE:
        return "finalise";
    case KARST_STAGE_DISPLAY:
        return "display";
    case KARST_STAGE_MEDIA:
        return "media";
    case KARST_STAGE_SUN_DEPTH:
        return "sun_depth";
    case KARST_NUM_STAGES:
        break;
    }
    return "unknown";
}

const char *karst_stream_name(karst_stream stream)
{
    switch (stream) {
    case KARST_STREAM_PRIMARY:
        return "primary";
    case KARST_STREAM_SHADOW:
        return "shadow";
    case KARST_STREAM_MIRROR:
        return "mirror";
    case KARST_STREAM_CLEAR:
        return "clear";
    case KARST_STREAM_OCCLUSION:
        return "occlusion";
    case KARST_NUM_STREAMS:
        break;
    }
    return "unknown";
}
