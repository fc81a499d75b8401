/* Edits of an engine's scene (karst/edit.h): a layer over those that its world names. */
#include <stdlib.h>

#include "core/engine/engine_layers.h"
#include "karst/edit.h"
#include "karst/saved.h"
#include "producers/edits/edits.h"

static bool drop_dirty(karst_engine *engine, karst_error *error)
{
    return karst_engine_drop_dirty(engine, engine->edits, KARST_LAYER_LAND, &engine->dropped, error);
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

bool karst_engine_colour_layers(karst_engine *engine, karst_error *error)
{
    return !karst_engine_world_has_coloured_layers(&engine->shown) || make_colours(engine, error);
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
