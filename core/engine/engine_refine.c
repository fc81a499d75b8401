/* What refining hits needs of a world: its gradient as generated code, and the data that this reads. */
#include <math.h>
#include <stdlib.h>

#include "core/engine/engine_parts.h"
#include "producers/language/emit/emit.h"

static bool update(karst_engine_refining *refining, const karst_engine_world *world, karst_error *error)
{
    if (!refining->data)
        return true;
    const karst_world_layout *layout = &refining->layout;
    size_t size_bytes = layout->num_words * sizeof(uint64_t);
    uint64_t *words = calloc(1, size_bytes);
    bool done =
        words && karst_world_data_fill(layout, world->values, world->seed, world->file->info.voxel_log2_m, words)
            ? karst_buffer_write(refining->data, 0, words, size_bytes, error)
            : karst_fail(error, KARST_FAILED, "out of memory");
    free(words);
    return done;
}

bool karst_engine_world_update_refiner(karst_engine_world *world, karst_error *error)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        if (!update(&world->content[i].refining, world, error))
            return false;
    return update(&world->refining, world, error) && update(&world->photon_refining, world, error);
}

static karst_refiner *make_refiner(const karst_engine_refining *refining, const karst_world_file *file, bool for_rays,
                                   karst_context *context, karst_error *error)
{
    char *source = NULL;
    if (!karst_emit_surface(&refining->layout, &source, error))
        return NULL;
    const karst_refine_world refined = {.source = source,
                                        .options = "-DWORLD_HAS_DATA",
                                        .data = refining->data,
                                        .voxel_m = ldexp(1, file->info.voxel_log2_m)};
    karst_refiner *refiner = for_rays ? karst_refiner_create_for_rays(context, &refined, error)
                                      : karst_refiner_create(context, &refined, error);
    free(source);
    return refiner;
}

static bool build(karst_engine_refining *refining, const karst_engine_world *world, const karst_world_file *file,
                  bool for_rays, karst_context *context, karst_error *error)
{
    refining->gradient = karst_derive(&file->program->world, error);
    if (!refining->gradient)
        return false;
    if (!karst_world_layout_init(&refining->layout, &refining->gradient->world))
        return karst_fail(error, KARST_BAD_WORLD, "%.300s: its gradient needs too much memory", file->info.name);
    refining->data =
        karst_buffer_create(context, "refine", refining->layout.num_words * sizeof(uint64_t), NULL, error);
    if (!refining->data || !update(refining, world, error))
        return false;
    refining->refiner = make_refiner(refining, file, for_rays, context, error);
    return refining->refiner != NULL;
}

static void finish(karst_engine_refining *refining)
{
    karst_refiner_destroy(refining->refiner);
    karst_buffer_destroy(refining->data);
    karst_gradient_world_destroy(refining->gradient);
    *refining = (karst_engine_refining){.refiner = NULL};
}

bool karst_engine_world_build_refiner(karst_engine_world *world, karst_context *context, karst_error *error)
{
    return build(&world->refining, world, world->file, false, context, error);
}

/* None where the gradient is too large. */
static bool build_for_rays(karst_engine_refining *refining, const karst_engine_world *world,
                           const karst_world_file *file, karst_context *context, karst_error *error)
{
    karst_error why = {0};
    if (!file || build(refining, world, file, true, context, &why))
        return true;
    finish(refining);
    return why.status == KARST_BAD_WORLD || karst_fail(error, why.status, "%s", why.message);
}

bool karst_engine_world_build_clear_refiner(karst_engine_world *world, karst_context *context, karst_error *error)
{
    return build_for_rays(&world->content[KARST_CONTENT_CLEAR].refining, world,
                          world->file->content[KARST_CONTENT_CLEAR], context, error);
}

bool karst_engine_world_build_photon_refiner(karst_engine_world *world, karst_context *context, karst_error *error)
{
    return build_for_rays(&world->photon_refining, world, world->file, context, error);
}

void karst_engine_world_close_refiner(karst_engine_world *world)
{
    finish(&world->refining);
    finish(&world->photon_refining);
    finish(&world->content[KARST_CONTENT_CLEAR].refining);
}
