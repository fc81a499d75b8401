/* Layers that worlds' headers name, by kinds (producers/layer_kind.h): engine_layers.c. Only core/engine/ includes
 * this. */
#ifndef KARST_CORE_ENGINE_LAYERS_H
#define KARST_CORE_ENGINE_LAYERS_H

#include "core/engine/engine_parts.h"
#include "producers/layer_kind.h"

/* A world's layer of a kind; NULL: it has none, or it is not made yet. */
karst_layer *karst_engine_world_layer(const karst_engine_world *world, const karst_layer_kind *kind);

/* Of those that change the land, clear matter, or what fills the air: whether an open world's header names any; whether
 * two worlds of one voxel name the same. */
bool karst_engine_world_names_layers(const karst_engine_world *world, karst_layer_place place);
bool karst_engine_world_same_layers(const karst_engine_world *a, const karst_engine_world *b, karst_layer_place place);

bool karst_engine_world_has_coloured_layers(const karst_engine_world *world); /* of those that are made */
void karst_engine_world_hand_layers(karst_engine_world *from, karst_engine_world *to);
void karst_engine_world_close_layers(karst_engine_world *world);

/* The shown world's layers follow `values` of parameters, or, with NULL, the engine's time; what changed is forgotten.
 * Errors: KARST_USAGE (numbers; then nothing has changed), KARST_BAD_DATA, KARST_FAILED. */
bool karst_engine_move_layers(karst_engine *engine, const karst_number *values, karst_error *error);

/* Forgets at once, between two frames, what a layer says has changed; the next frame makes anew what the last one's
 * rays used. Errors: KARST_FAILED. */
bool karst_engine_drop_dirty(karst_engine *engine, karst_layer *layer, karst_layer_place place,
                             karst_dropped *dropped, karst_error *error);

#endif
