/* Models made of points as a layer (producers/layer.h): a union of the world's density with their surfaces. */
#ifndef KARST_PRODUCERS_POINTS_H
#define KARST_PRODUCERS_POINTS_H

#include "producers/layer.h"
#include "producers/points/model_list.h"
#include "producers/steps/shape.h"

/* A layer of these models, for a world of these voxels. Its kernels are built here. Errors: as karst_model_list_init.
 */
karst_layer *karst_points_layer_create(karst_context *context, karst_shape shape, const karst_model *models, size_t num,
                                       int voxel_log2_m, const karst_log *log, karst_error *error);
const karst_model_list *karst_points_layer_list(const karst_layer *layer);
/* The models as devices read them, for points_places.clh. */
const karst_buffer *karst_points_layer_data(const karst_layer *layer);

#endif
