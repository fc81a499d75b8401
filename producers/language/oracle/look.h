/* Where to stand in a world whose text says nothing of it: a pasted function has a shape, but neither camera nor scale.
 * Only where the density is positive counts, never its values. A body that has air all around it is seen whole. Else a
 * few hundred rays of the host's oracle try cameras around the origin, and the one that shows most is taken; then a
 * few more try where the sun may stand. */
#ifndef KARST_LANGUAGE_LOOK_H
#define KARST_LANGUAGE_LOOK_H

#include "karst/camera.h"
#include "producers/language/oracle/oracle.h"

typedef struct {
    double eye_m[3];
    double yaw_deg, pitch_deg; /* as in karst/camera.h; the field of view is KARST_LOOK_FOV_DEG */
    double near_m;             /* how far off the nearest tenth of what is seen begins */
    double sun_azimuth_deg, sun_elevation_deg;
    bool is_indoors; /* no sun that was tried reaches what is seen */
} karst_look;
#define KARST_LOOK_FOV_DEG 60

/* Tries cameras from `nearest_m` to `farthest_m` around the origin, then suns. It takes at most some 10^7 evaluations
 * of single nodes for each, of which a point takes `num_nodes`; where that is too few, or nothing is to be seen from
 * any of them, returns false. Deterministic. `voxel_log2_m` is the oracle's. */
bool karst_look_around(karst_oracle *oracle, uint32_t num_nodes, int voxel_log2_m, double nearest_m, double farthest_m,
                       karst_look *look);

#endif
