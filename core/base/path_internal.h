/* What a camera path is made of. Private to core/base/path.c, which samples it, and core/base/path_file.c, which reads
 * it. */
#ifndef KARST_CORE_PATH_INTERNAL_H
#define KARST_CORE_PATH_INTERNAL_H

#include <stddef.h>

#include "karst/path.h"

typedef enum { KARST_PATH_LINEAR, KARST_PATH_SMOOTH, KARST_PATH_ZOOM } karst_path_kind;

/* What is interpolated, each as a number of its own. */
enum {
    KARST_PATH_X, /* metres from the keyframe; in a zoom the direction from the target, a unit vector */
    KARST_PATH_Y,
    KARST_PATH_Z,
    KARST_PATH_YAW, /* degrees, unwound */
    KARST_PATH_PITCH,
    KARST_PATH_FOV,      /* degrees; in a zoom their natural logarithm */
    KARST_PATH_DISTANCE, /* natural logarithm of metres from the target; only in a zoom */
    KARST_PATH_CHANNELS
};

typedef struct {
    double time_s;
    karst_position position;
    double yaw_deg, pitch_deg, fov_deg; /* yaw unwound: no way to the next keyframe is cut at 360 */
    /* Derived by karst_path_prepare. */
    double direction[3], distance_m;     /* from the target; only in a zoom */
    double delta[KARST_PATH_CHANNELS];   /* to the next keyframe; 0 where there is none, or a jump */
    double slope_s[KARST_PATH_CHANNELS]; /* per second, here */
} karst_path_key;

struct karst_path {
    karst_path_kind kind;
    int voxel_log2_m;
    bool looks_at_target;
    karst_position target;
    char *world, *description;
    size_t num_keys; /* at least 1 */
    karst_path_key *keys;
};

/* Fills in what is derived of the keyframes. In a zoom distance_m of each is positive (karst_path_measure). */
void karst_path_prepare(karst_path *path);
/* Fills in direction and distance_m of all keyframes of a zoom. */
void karst_path_measure(karst_path *path);

#endif
