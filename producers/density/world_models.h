/* The models that a world's header names. */
#ifndef KARST_PRODUCERS_WORLD_MODELS_H
#define KARST_PRODUCERS_WORLD_MODELS_H

#include "producers/density/world_file.h"
#include "producers/points/model_list.h"

/* All of them, with their paths from the world's own folder on, *num of them; free them with karst_world_models_free.
 * NULL on errors: KARST_USAGE (places that are none), KARST_FAILED. */
karst_model *karst_world_models(const karst_world_file *file, size_t *num, karst_error *error);
void karst_world_models_free(karst_model *models, size_t num); /* NULL is fine */

#endif
