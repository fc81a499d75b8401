/* From a camera to the pinhole that rays are made of. */
#ifndef KARST_RAYCAST_PINHOLE_H
#define KARST_RAYCAST_PINHOLE_H

#include "karst/camera.h"
#include "raycast/cast/cast_shared.h"

/* Rays from the camera's own position, to view_distance_voxels. Thread-safe. */
void karst_pinhole_init(karst_pinhole *pinhole, const karst_camera *camera, int width_px, int height_px,
                        double view_distance_voxels);

/* Leaves the rays of a window alone, of the whole picture that the pinhole was made for: width x height of its pixels,
 * from (x0, y0). Thread-safe. */
void karst_pinhole_cut(karst_pinhole *pinhole, int x0_px, int y0_px, int width_px, int height_px);

#endif
