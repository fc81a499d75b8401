/* The layers of an engine's scene: what its world's header names, then edits (engine_edit.c). */
#include "core/engine/engine_layers.h"

#include "producers/edits/edits.h"
#include "producers/particles/particles_kind.h"
#include "producers/points/points_kind.h"

/* All kinds, in the order in which they are combined with the world. */
static const karst_layer_kind *const kinds[] = {&karst_points_kind, &karst_clear_points_kind, &karst_particles_kind};

#define NUM_KINDS ((int)(sizeof kinds / sizeof *kinds))
_Static_assert(sizeof kinds / sizeof *kinds <= KARST_MOST_LAYER_KINDS, "a world has room for a layer of each kind");

static bool is_named(const karst_engine_world *world, int kind) { return kinds[kind]->is_named(world->file->program); }

karst_layer *karst_engine_world_layer(const karst_engine_world *world, const karst_layer_kind *kind)
{
    for (int i = 0; i < NUM_KINDS; i++)
        if (kinds[i] == kind)
            return world->layers[i];
    return NULL;
}

bool karst_engine_world_names_layers(const karst_engine_world *world, karst_layer_place place)
{
    for (int i = 0; i < NUM_KINDS; i++)
        if (kinds[i]->place == place && is_named(world, i))
            return true;
    return false;
}

bool karst_engine_world_same_layers(const karst_engine_world *a, const karst_engine_world *b, karst_layer_place place)
{
    for (int i = 0; i < NUM_KINDS; i++)
        if (kinds[i]->place == place && (is_named(a, i) || is_named(b, i)) &&
            !(is_named(a, i) && is_named(b, i) && kinds[i]->is_same &&
              kinds[i]->is_same(a->file->program, b->file->program)))
            return false;
    return true;
}

bool karst_engine_world_has_coloured_layers(const karst_engine_world *world)
{
    for (int i = 0; i < NUM_KINDS; i++)
        if (world->layers[i] && kinds[i]->has_colours && kinds[i]->has_colours(world->layers[i]))
            return true;
    return false;
}

void karst_engine_world_hand_layers(karst_engine_world *from, karst_engine_world *to)
{
    for (int i = 0; i < NUM_KINDS; i++) {
        to->layers[i] = from->layers[i];
        from->layers[i] = NULL;
    }
}

void karst_engine_world_close_layers(karst_engine_world *world)
{
    for (int i = 0; i < NUM_KINDS; i++) {
        if (world->layers[i])
            world->layers[i]->ops->destroy(world->layers[i]);
        world->layers[i] = NULL;
    }
}

/* ---- becoming part of what producers make ---- */

static karst_layer_scene scene_of(const karst_engine *engine, const karst_engine_world *world,
                                  const karst_number *values)
{
    return (karst_layer_scene){.context = engine->context,
                               .program = world->file->program,
                               .values = values,
                               .voxel_log2_m = world->file->info.voxel_log2_m,
                               .time_s = engine->time_s,
                               .log = engine->log};
}

/* Makes those of a place that are not there yet. */
static bool make_layers(const karst_engine *engine, karst_engine_world *world, karst_layer_place place,
                        karst_layer *layers[KARST_MOST_LAYER_KINDS], size_t *num, karst_error *error)
{
    const karst_layer_scene scene = scene_of(engine, world, world->values);
    *num = 0;
    for (int i = 0; i < NUM_KINDS; i++) {
        if (kinds[i]->place != place || !is_named(world, i))
            continue;
        if (!world->layers[i] && !(world->layers[i] = kinds[i]->create(&scene, error)))
            return false;
        layers[(*num)++] = world->layers[i];
    }
    return true;
}

/* Those of what a world has beside its land. */
static bool set_beside(karst_engine *engine, karst_engine_world *world, karst_layer_place place, karst_content content,
                       karst_error *error)
{
    karst_producer *producer = world->content[content].producer;
    karst_layer *layers[KARST_MOST_LAYER_KINDS];
    size_t num;
    char finalise[64];
    if (!producer)
        return true;
    if (!make_layers(engine, world, place, layers, &num, error))
        return false;
    if (num == 0)
        return true;
    const karst_cache_buffers *buffers = karst_store_get_buffers(engine->stores[content].store);
    const karst_world_build build =
        content == KARST_CONTENT_AIR
            ? karst_engine_air_build(buffers, finalise)
            : (karst_world_build){.shape = KARST_SHAPE_AUTO, .finalise_options = karst_cache_brick_option(buffers)};
    return karst_finish(engine->context, error) &&
           karst_world_file_set_layers(producer, world->file->content[content], &build, layers, num, NULL, error);
}

/* What refines the hits of rays in clear matter reads its models. */
static void show_models_to_rays(karst_engine_world *world)
{
    const karst_layer *models = karst_engine_world_layer(world, &karst_clear_points_kind);
    karst_refiner *refiner = world->content[KARST_CONTENT_CLEAR].refining.refiner;
    if (models && refiner)
        karst_refiner_set_layer(refiner, karst_points_layer_data(models), NULL);
}

bool karst_engine_world_set_layers(karst_engine *engine, karst_engine_world *world, karst_error *error)
{
    const karst_world_build build = {.shape = KARST_SHAPE_AUTO,
                                     .finalise_options =
                                         karst_cache_brick_option(karst_cache_get_buffers(engine->cache))};
    karst_layer *layers[KARST_MOST_LAYER_KINDS + 1];
    size_t num;
    if (!make_layers(engine, world, KARST_LAYER_LAND, layers, &num, error) ||
        !set_beside(engine, world, KARST_LAYER_CLEAR, KARST_CONTENT_CLEAR, error) ||
        !set_beside(engine, world, KARST_LAYER_AIR, KARST_CONTENT_AIR, error))
        return false;
    show_models_to_rays(world);
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

/* ---- change ---- */

bool karst_engine_drop_dirty(karst_engine *engine, karst_layer *layer, karst_layer_place place,
                             karst_dropped *dropped, karst_error *error)
{
    static const karst_content contents[] = {
        [KARST_LAYER_CLEAR] = KARST_CONTENT_CLEAR, [KARST_LAYER_AIR] = KARST_CONTENT_AIR};
    const karst_drop_box *boxes;
    const size_t num = layer->ops->take_dirty(layer, &boxes);
    *dropped = (karst_dropped){0};
    if (num == 0)
        return true;
    engine->view_changed = true;
    if (place == KARST_LAYER_AIR)
        engine->media_moves = true;
    else if (place == KARST_LAYER_LAND)
        engine->media_is_stale = true; /* the land shades them */
    return place == KARST_LAYER_LAND ? karst_cache_drop(engine->cache, boxes, num, engine->serial, dropped, error)
                                     : karst_store_drop(engine->stores[contents[place]].store, boxes, num,
                                                        engine->serial, dropped, error);
}

bool karst_engine_move_layers(karst_engine *engine, const karst_number *values, karst_error *error)
{
    karst_engine_world *world = &engine->shown;
    const karst_layer_scene scene = scene_of(engine, world, values);
    bool done = true;
    for (int i = 0; done && i < NUM_KINDS; i++) {
        karst_dropped dropped;
        if (world->layers[i] && kinds[i]->move)
            done = karst_finish(engine->context, error) && kinds[i]->move(world->layers[i], &scene, error) &&
                   karst_engine_drop_dirty(engine, world->layers[i], kinds[i]->place, &dropped, error);
    }
    return done;
}
