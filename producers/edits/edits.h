/* Edits as a layer (producers/layer.h): a list of operations on the density, applied in order. */
#ifndef KARST_PRODUCERS_EDITS_H
#define KARST_PRODUCERS_EDITS_H

#include "producers/edits/edit_list.h"
#include "producers/layer.h"
#include "producers/steps/shape.h"

/* A layer without edits, for a world of these voxels. Its kernels are built here. Errors: KARST_FAILED. */
karst_layer *karst_edits_create(karst_context *context, karst_shape shape, int voxel_log2_m, karst_error *error);
/* From now on edits may have colours: builds the kernel that lays them. Before, karst_layer_ops.evaluate takes none.
 * Errors: KARST_FAILED. */
bool karst_edits_allow_colours(karst_layer *edits, karst_error *error);

/* Changes what is in force; karst_layer_ops.take_dirty then tells where. Errors: as in karst/edit.h. */
bool karst_edits_append(karst_layer *edits, const karst_edit *new_edits, size_t num, karst_error *error);
bool karst_edits_set_num(karst_layer *edits, uint32_t num, karst_error *error);
const karst_edit_list *karst_edits_list(const karst_layer *edits);
/* What devices read (edits_shared.h, producers/edits/edits_points.clh): another buffer after an append. */
const karst_buffer *karst_edits_data(const karst_layer *edits);

#endif
