/* The camera: where one stands and looks. */
#ifndef KARST_CAMERA_H
#define KARST_CAMERA_H

#include "karst/position.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Yaw is a compass bearing with +z as north and +x as east: 0 looks along +z, 90 along +x, and it grows as one turns to
 * the right. Pitch 90 looks straight up (+y). fov is vertical. */
typedef struct {
    karst_position position;
    double yaw_deg;   /* any finite number */
    double pitch_deg; /* -90 to 90 */
    double fov_deg;   /* 0.0001 to 179 */
} karst_camera;

/* Orthonormal view axes in world space. `right` and `up` are the viewer's, that is the picture's: at yaw 0, pitch 0
 * they are +x, +y, and forward is +z. right x up = forward (cross products by components). Seen by a viewer, (x, y, z)
 * are thus left-handed axes: data in right-handed ones (glTF, say) must have one axis negated. At pitch +-90 yaw still
 * says where `up` points. Errors: none (values are clamped to their ranges, what is not finite counts as 0).
 * Thread-safe, as all functions here. */
void karst_camera_axes(const karst_camera *camera, double right[3], double up[3], double forward[3]);

/* Parses "X,Y,Z,YAW,PITCH[,FOV]" (the --camera option): positions exact decimal metres, a decimal point in every
 * locale. fov keeps its value in *camera if left out; *camera changes only on success. Errors: KARST_USAGE naming the
 * field and its range. */
bool karst_camera_parse(const char *text, int voxel_log2_m, karst_camera *camera, karst_error *error);
/* The inverse: karst_camera_parse gives the same camera back. 512 bytes always suffice; returns the length, as snprintf
 * does; -1 (and "") if voxel_log2_m is out of range. */
int karst_camera_format(const karst_camera *camera, int voxel_log2_m, char *text, size_t size_bytes);

#ifdef __cplusplus
}
#endif
#endif
