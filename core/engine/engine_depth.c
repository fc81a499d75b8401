/* What somebody else has drawn, before land. */
#include "core/engine/engine_parts.h"
#include "karst/depth.h"

void karst_engine_uncover(karst_engine *engine)
{
    karst_cover_destroy(engine->cover);
    engine->cover = NULL;
}

bool karst_engine_set_depth(karst_engine *engine, const float *depth_m, size_t num_values, karst_error *error)
{
    const size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    if (!depth_m && !num_values) {
        engine->view_changed |= engine->cover != NULL;
        karst_engine_uncover(engine);
        return true;
    }
    if (!depth_m || num_values != num_pixels)
        return karst_fail(error, KARST_USAGE, "depth of %dx%d takes %zu values, not %zu", engine->width_px,
                          engine->height_px, num_pixels, depth_m ? num_values : 0);
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        if (engine->shown.file->content[i])
            return karst_fail(error, KARST_USAGE,
                              "%s has clear matter or air, which would lie before what is drawn: depth is for worlds "
                              "of land alone",
                              engine->shown.file->info.name);
    if (engine->integrator == KARST_INTEGRATOR_FULL)
        return karst_fail(error, KARST_USAGE, "full light goes on behind what is drawn: depth needs direct light");
    karst_cover *cover = karst_cover_create(engine->context, engine->width_px, engine->height_px, depth_m,
                                            ldexp(1, engine->world->voxel_log2_m), error);
    if (!cover)
        return false;
    karst_engine_uncover(engine);
    engine->cover = cover;
    engine->view_changed = true;
    return true;
}
