/* What fills the space outside matter (`medium air(vec3 p)` in a world file), along single rays: how deep it is, as a
 * device finds it in bricks, and as the oracle says in double. */
#ifndef KARST_MEDIUM_H
#define KARST_MEDIUM_H

#include <stdbool.h>

#include "karst/error.h"
#include "karst/log.h"
#include "karst/position.h"
#include "karst/world.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Zero-initialised fields mean the default that stands beside them. */
typedef struct {
    karst_position from;
    double direction[3]; /* any length above 0 */
    double footprint_m;  /* detail finer than that is left out, 0 to 10^6 m; 0: as a picture 1000 pixels high leaves it
                          * out, by a thousandth of the way */
    const char *device;   /* as `karst info` lists them; NULL: the first GPU, else the first CPU */
    const karst_log *log; /* NULL: silent */
    double time_s;        /* where particles are, and what iTime is; -1e9 to 1e9 */
} karst_medium_ray;

typedef struct {
    double hit_m;         /* where the ray meets land; INFINITY: nowhere within the world's view distance */
    double length_m;      /* how far it was followed */
    double optical_depth; /* of the way there: the integral of the extinction, by the device, from bricks */
    double oracle_optical_depth; /* the same by Simpson's rule on the oracle's extinction, in double; of particles, by
                                  * where the ray is in which ball, with no detail left out: exact */
    double transmittance;        /* exp(-optical_depth): the share of light that comes through */
} karst_medium_depth;

/* Whether the world says what fills the space outside matter. Thread-safe. */
bool karst_world_has_medium(const karst_world *world);
/* Follows a ray from its start to land, or as far as the world's view distance. Extinction below 0 counts as 0. Uses
 * some 100 MiB of the device's memory during the call, and seconds the first time, for its compiler. Thread-safe.
 * Errors: KARST_USAGE (a field out of range, no medium, a footprint so small that the ray's bricks find no room),
 * KARST_NO_DEVICE, KARST_FAILED. */
bool karst_world_medium_depth(const karst_world *world, const karst_medium_ray *ray, karst_medium_depth *depth,
                              karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
