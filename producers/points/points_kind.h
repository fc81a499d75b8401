/* The models that a world's header names: see docs/POINTS.md. */
#ifndef KARST_PRODUCERS_POINTS_KIND_H
#define KARST_PRODUCERS_POINTS_KIND_H

#include "producers/layer_kind.h"
#include "producers/points/points.h"
#include "producers/points/splat_list.h"

extern const karst_layer_kind karst_points_kind, karst_clear_points_kind; /* in the land; of clear matter */

/* All of land, or of clear matter, that are shown as surfaces, with their paths from the world's own folder on, *num of
 * them; free them with karst_named_models_free. NULL on errors: KARST_BAD_DATA (paths), KARST_USAGE (places that are
 * none), KARST_FAILED. */
karst_model *karst_named_models(const karst_program_graph *program, bool is_clear, int voxel_log2_m, size_t *num,
                                karst_error *error);
void karst_named_models_free(karst_model *models, size_t num); /* NULL is fine */
/* Likewise of those that are shown as discs. */
karst_splat_source *karst_named_splats(const karst_program_graph *program, int voxel_log2_m, size_t *num,
                                       karst_error *error);
void karst_named_splats_free(karst_splat_source *sources, size_t num); /* NULL is fine */

/* model_materials.c: what the models are made of, where the header says so, becomes part of what the program's surfaces
 * say (karst_program_add_materials); `plain` as there. Errors: KARST_BAD_DATA (their files), KARST_BAD_WORLD (too
 * large), KARST_USAGE (places that are none), KARST_FAILED. */
bool karst_take_model_materials(karst_program_graph *program, const float plain[2][3], karst_error *error);

#endif
