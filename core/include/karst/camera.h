/* The camera: where one stands and looks. */
#ifndef KARST_CAMERA_H
#define KARST_CAMERA_H

#include "karst/position.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Yaw 0 looks along +z, 90 along +x; pitch 90 looks straight up (+y). Degrees. fov is vertical. */
typedef struct {
    karst_position position;
    double yaw_deg;   /* any finite number */
    double pitch_deg; /* -90 to 90 */
    double fov_deg;   /* 0.0001 to 179 */
} karst_camera;

/* Orthonormal right-handed view axes in world space: right, up, forward. Errors: none (values are clamped to their ranges). */
void karst_camera_axes(const karst_camera *camera, double right[3], double up[3], double forward[3]);

/* Parses "X,Y,Z,YAW,PITCH[,FOV]" (the --camera option): positions exact decimal metres. fov keeps its value in *camera if left out.
 * Errors: KARST_USAGE naming the field. */
bool karst_camera_parse(const char *text, int voxel_log2_m, karst_camera *camera, karst_error *error);
/* The inverse; 512 bytes always suffice. */
int karst_camera_format(const karst_camera *camera, int voxel_log2_m, char *text, size_t size_bytes);

#ifdef __cplusplus
}
#endif
#endif
