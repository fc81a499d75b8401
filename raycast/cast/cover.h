/* Covering: hits that lie behind what somebody else has drawn become misses. */
#ifndef KARST_RAYCAST_COVER_H
#define KARST_RAYCAST_COVER_H

#include "raycast/cast/cast.h"

typedef struct karst_cover karst_cover;

/* For pictures of width x height pixels, each with its depth_m (top row first, INFINITY where nothing is), where a
 * level-0 voxel is voxel_m wide. Errors: KARST_FAILED. */
karst_cover *karst_cover_create(karst_context *context, int width_px, int height_px, const float *depth_m,
                                double voxel_m, karst_error *error);
void karst_cover_destroy(karst_cover *cover); /* NULL is fine */

/* Of the hits of a picture of that size; asynchronous on the context's queue. Errors: KARST_FAILED. */
bool karst_cover_hits(karst_cover *cover, karst_buffer *hits, karst_error *error);

#endif
