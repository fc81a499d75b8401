/* Layers of an engine's scene: its world's models, then edits (karst/edit.h). */
#include <stdlib.h>

#include "core/engine/engine_parts.h"
#include "karst/edit.h"
#include "karst/saved.h"
#include "producers/edits/edits.h"

/* What changed is forgotten at once, between two frames; the next one makes anew what the last one's rays used. */
static bool drop_dirty(karst_engine *engine, karst_error *error)
{
    const karst_drop_box *boxes;
    size_t num = engine->edits->ops->take_dirty(engine->edits, &boxes);
    engine->dropped = (karst_dropped){0};
    engine->view_changed = true;
    engine->media_is_stale = true; /* the land shades them */
    return karst_cache_drop(engine->cache, boxes, num, engine->serial, &engine->dropped, error);
}

bool karst_engine_world_set_layers(karst_engine *engine, karst_engine_world *world, karst_error *error)
{
    const karst_world_build build = {.shape = KARST_SHAPE_AUTO,
                                     .finalise_options =
                                         karst_cache_brick_option(karst_cache_get_buffers(engine->cache))};
    karst_layer *layers[2];
    size_t num = 0;
    if (!karst_engine_world_load_models(engine, world, error) ||
        !karst_engine_world_set_particles(engine, world, error))
        return false;
    if (world->models)
        layers[num++] = world->models;
    if (engine->edits && world->file->info.voxel_log2_m != karst_edits_list(engine->edits)->voxel_log2_m)
        return karst_fail(error, KARST_USAGE,
                          "%s has voxels of 2^%d m, and the edits were made in voxels of 2^%d m: undo them first, or "
                          "give the world the same voxel",
                          world->file->info.name, world->file->info.voxel_log2_m,
                          karst_edits_list(engine->edits)->voxel_log2_m);
    if (engine->edits)
        layers[num++] = engine->edits;
    return num == 0 || (karst_finish(engine->context, error) &&
                        karst_world_file_set_layers(world->producer, world->file, &build, layers, num,
                                                    engine->colours, error));
}

static bool make_layer(karst_engine *engine, karst_error *error)
{
    if (engine->edits)
        return true;
    karst_engine_refining refining = {.refiner = NULL}, *shown = &engine->shown.refining;
    if (engine->refine && !karst_engine_world_make_refining(&engine->shown, engine->context, true, &refining, error))
        return false;
    engine->edits = karst_edits_create(engine->context, KARST_SHAPE_AUTO, engine->world->voxel_log2_m, error);
    if (engine->edits && karst_engine_world_set_layers(engine, &engine->shown, error)) {
        if (engine->refine) {
            karst_engine_finish_refining(shown);
            *shown = refining;
        }
        return true;
    }
    karst_engine_finish_refining(&refining);
    if (engine->edits)
        engine->edits->ops->destroy(engine->edits);
    engine->edits = NULL;
    return false;
}

/* From now on layers have colours: room for them, and a shader that shows them. */
static bool make_colours(karst_engine *engine, karst_error *error)
{
    const karst_cache_buffers *bricks = karst_cache_get_buffers(engine->cache);
    if (engine->edits && !karst_edits_allow_colours(engine->edits, error))
        return false;
    if (engine->colours)
        return true;
    karst_colours *colours = karst_colours_create(engine->context, bricks, error);
    karst_shader *shader =
        colours ? karst_engine_world_shader(&engine->shown, engine->context, engine->shade | KARST_SHADE_PAINT,
                                            engine->producer->data[0], error)
                : NULL;
    engine->colours = colours;
    if (!shader || !karst_engine_world_set_layers(engine, &engine->shown, error)) {
        karst_shader_destroy(shader);
        karst_colours_destroy(colours);
        engine->colours = NULL;
        return false;
    }
    karst_shader_destroy(engine->shader);
    engine->shader = engine->shown.shader = shader;
    engine->shade |= KARST_SHADE_PAINT;
    karst_shader_set_colours(shader, colours, bricks);
    karst_shader_set_skies(shader, engine->shown.skies);
    return true;
}

bool karst_engine_colour_models(karst_engine *engine, karst_error *error)
{
    return !karst_engine_world_has_coloured_models(&engine->shown) || make_colours(engine, error);
}

bool karst_engine_edit(karst_engine *engine, const karst_edit *edits, size_t num_edits, karst_error *error)
{
    bool has_colours = false;
    for (size_t i = 0; i < num_edits; i++)
        has_colours = has_colours || edits[i].has_colour;
    return num_edits == 0 || (make_layer(engine, error) && (!has_colours || make_colours(engine, error)) &&
                              karst_edits_append(engine->edits, edits, num_edits, error) && drop_dirty(engine, error));
}

bool karst_engine_load_edits(karst_engine *engine, const char *path, karst_error *error)
{
    size_t num;
    int voxel_log2_m = engine->world->voxel_log2_m;
    karst_edit *edits = karst_saved_is_name(path) ? karst_saved_load_edits(path, voxel_log2_m, &num, engine->log, error)
                                                  : karst_edits_load(path, voxel_log2_m, &num, error);
    bool done = edits && karst_engine_edit(engine, edits, num, error);
    free(edits);
    return done;
}

static bool go_to(karst_engine *engine, uint32_t num, karst_error *error)
{
    return karst_edits_set_num(engine->edits, num, error) && drop_dirty(engine, error);
}

bool karst_engine_undo(karst_engine *engine, size_t *num, karst_error *error)
{
    size_t redoable, most = karst_engine_num_edits(engine, &redoable), wanted = *num < most ? *num : most;
    *num = 0;
    if (wanted && !go_to(engine, (uint32_t)(most - wanted), error))
        return false;
    *num = wanted;
    return true;
}

bool karst_engine_redo(karst_engine *engine, size_t *num, karst_error *error)
{
    size_t most, in_force = karst_engine_num_edits(engine, &most), wanted = *num < most ? *num : most;
    *num = 0;
    if (wanted && !go_to(engine, (uint32_t)(in_force + wanted), error))
        return false;
    *num = wanted;
    return true;
}

size_t karst_engine_num_edits(const karst_engine *engine, size_t *num_redoable)
{
    uint32_t num = engine->edits ? karst_edit_list_num(karst_edits_list(engine->edits)) : 0;
    if (num_redoable)
        *num_redoable = engine->edits ? karst_edits_list(engine->edits)->num_made - num : 0;
    return num;
}

karst_edit_report karst_engine_edit_report(const karst_engine *engine)
{
    return (karst_edit_report){engine->dropped.num_nodes, engine->dropped.num_bricks};
}
