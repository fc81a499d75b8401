/* What bends rays inside clear matter: the index of refraction as generated code, and the data that this reads. */
#include <math.h>
#include <stdlib.h>

#include "core/engine/engine_parts.h"
#include "producers/language/emit/emit.h"

bool karst_engine_world_bends(const karst_engine_world *world)
{
    const karst_world_file *file = world->file->content[KARST_CONTENT_CLEAR];
    return file && karst_has_output(file->layout.world.root, KARST_OUTPUT_INDEX) &&
           !file->layout.is_known[file->layout.world.root[KARST_ROOT_INDEX]];
}

static bool make_bender(karst_engine_world *world, karst_context *context, bool fine, karst_error *error)
{
    const karst_engine_refining *clear = &world->content[KARST_CONTENT_CLEAR].refining;
    karst_engine_bending *bending = &world->bending;
    char *source = NULL;
    if (!karst_emit_two_surfaces(&clear->layout, &bending->index.layout, &source, error))
        return false;
    const karst_bend_world bent = {.source = source,
                                   .options = "-DWORLD_HAS_DATA",
                                   .data = clear->data,
                                   .index_data = bending->index.data,
                                   .voxel_m = ldexp(1, world->file->info.voxel_log2_m)};
    bending->bender = karst_bender_create(context, &bent, fine ? KARST_BEND_FINE_TOLERANCE : KARST_BEND_TOLERANCE,
                                          error);
    free(source);
    return bending->bender != NULL;
}

bool karst_engine_world_build_bending(karst_engine_world *world, karst_context *context, bool fine, karst_error *error)
{
    if (!karst_engine_world_bends(world))
        return true;
    const karst_resolved_world *clear = &world->file->content[KARST_CONTENT_CLEAR]->program->world;
    const karst_resolved_world index = {.graph = clear->graph,
                                        .root[KARST_ROOT_DENSITY] = clear->root[KARST_ROOT_INDEX]};
    karst_error why = {0};
    if (!world->content[KARST_CONTENT_CLEAR].refining.gradient)
        karst_fail(&why, KARST_BAD_WORLD, "the gradient of clear matter is too large");
    else if (karst_engine_derive(&world->bending.index, world, &index, context, &why) &&
             make_bender(world, context, fine, &why))
        return true;
    if (why.status != KARST_BAD_WORLD)
        return karst_fail(error, why.status, "%s", why.message);
    return karst_fail(error, KARST_BAD_WORLD,
                      "%.300s: rays cannot be followed through an index that varies (%s): make clear() or index() "
                      "simpler, or give clear_surface() an ior",
                      world->file->info.name, why.message);
}

void karst_engine_world_close_bending(karst_engine_world *world)
{
    karst_bender_destroy(world->bending.bender);
    karst_engine_finish_refining(&world->bending.index);
    world->bending = (karst_engine_bending){.bender = NULL};
}

bool karst_engine_report_index(karst_engine *engine, karst_error *error)
{
    karst_engine_bending *bending = &engine->shown.bending;
    uint32_t num = 0;
    float place[3];
    if (!bending->bender || bending->reported)
        return true;
    if (!karst_bender_faults(bending->bender, &num, place, error))
        return false;
    if (num == 0)
        return true;
    const double voxel_m = exp2(engine->world->voxel_log2_m);
    double at_m[3];
    for (int i = 0; i < 3; i++)
        at_m[i] = ((double)engine->drawn.position.voxel[i] + (double)place[i]) * voxel_m;
    bending->reported = true;
    karst_log_print(engine->log, KARST_LOG_WARNING,
                    "%s: the index of refraction is below 1, or no number, where light goes, and is taken as 1: "
                    "met %u times in this picture, first at %.9g,%.9g,%.9g",
                    engine->world->name, num, at_m[0], at_m[1], at_m[2]);
    return true;
}
