/* What refining hits needs of a world: its gradient as generated code, and the data that this reads. */
#include <math.h>
#include <stdlib.h>

#include "core/engine/engine_parts.h"
#include "producers/language/emit/emit.h"

bool karst_engine_world_update_refiner(karst_engine_world *world, karst_error *error)
{
    if (!world->refine_data)
        return true;
    const karst_world_layout *layout = &world->gradient_layout;
    size_t size_bytes = layout->num_words * sizeof(uint64_t);
    uint64_t *words = calloc(1, size_bytes);
    bool done =
        words && karst_world_data_fill(layout, world->values, world->seed, world->file->info.voxel_log2_m, words)
            ? karst_buffer_write(world->refine_data, 0, words, size_bytes, error)
            : karst_fail(error, KARST_FAILED, "out of memory");
    free(words);
    return done;
}

static karst_refiner *build(const karst_engine_world *world, karst_context *context, karst_error *error)
{
    char *source = NULL;
    if (!karst_emit_surface(&world->gradient_layout, &source, error))
        return NULL;
    const karst_refine_world refined = {.source = source,
                                        .options = "-DWORLD_HAS_DATA",
                                        .data = world->refine_data,
                                        .voxel_m = ldexp(1, world->file->info.voxel_log2_m)};
    karst_refiner *refiner = karst_refiner_create(context, &refined, error);
    free(source);
    return refiner;
}

bool karst_engine_world_build_refiner(karst_engine_world *world, karst_context *context, karst_error *error)
{
    world->gradient = karst_derive(&world->file->program->world, error);
    if (!world->gradient)
        return false;
    if (!karst_world_layout_init(&world->gradient_layout, &world->gradient->world))
        return karst_fail(error, KARST_BAD_WORLD, "%.300s: its gradient needs too much memory", world->file->info.name);
    world->refine_data =
        karst_buffer_create(context, "refine", world->gradient_layout.num_words * sizeof(uint64_t), NULL, error);
    if (!world->refine_data || !karst_engine_world_update_refiner(world, error))
        return false;
    world->refiner = build(world, context, error);
    return world->refiner != NULL;
}

void karst_engine_world_close_refiner(karst_engine_world *world)
{
    karst_refiner_destroy(world->refiner);
    karst_buffer_destroy(world->refine_data);
    karst_gradient_world_destroy(world->gradient);
    world->refiner = NULL;
    world->refine_data = NULL;
    world->gradient = NULL;
}
