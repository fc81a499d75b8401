/* Points of light maps as files have them: PLYs whose points have a place, a normal, and what light falls there. */
#ifndef KARST_CORE_FILES_LIGHT_POINTS_H
#define KARST_CORE_FILES_LIGHT_POINTS_H

#include <stdbool.h>
#include <stddef.h>

#include "karst/error.h"

typedef struct {
    double at_m[3]; /* in the world, in its axes */
    double radius_m; /* how far from there it counts */
    float normal[3]; /* any length but 0 */
    float light[3];  /* linear red, green and blue of a white surface there */
} karst_light_point;

/* All points of a PLY with x y z, nx ny nz and red green blue as floats; malloc'ed, *num of them, 1 to `most`. Where
 * the file has no radius, all have reach_m; 0: then that is an error. Nothing that the file says is believed before it
 * is there. Errors: KARST_BAD_DATA naming the file and the point; KARST_FAILED (memory). Thread-safe. */
karst_light_point *karst_light_points_load(const char *path, double reach_m, size_t most, size_t *num,
                                           karst_error *error);

#endif
