/* The reference: where rays really meet a world, slow and right.
 *
 * No engine, no bricks, no device: the world's graph is evaluated on the host in double, and along each ray the first
 * point where the density becomes positive is found by bisecting intervals that are proven free of it, so that no root
 * is stepped over, however thin the thing. Rays, footprints and levels are those of an engine with the same settings.
 */
#ifndef KARST_REFERENCE_H
#define KARST_REFERENCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/camera.h"
#include "karst/engine.h"
#include "karst/error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Which density a ray meets at distance t, where its footprint is w(t) = t * 2 tan(fov / 2) / height. */
typedef enum {
    KARST_FOOTPRINT_LEVELS, /* d(p, voxel of the level that an engine shows at t): the widest that is at most detail_px
                             * footprints wide, from t alone; without gradual changes (karst_engine_config.no_blend) */
    KARST_FOOTPRINT_NONE,   /* the full density, d(p, 0) */
    KARST_FOOTPRINT_BLENDED /* the same, but in the last part of a level (the same that engines blend in) its density f
                             * turns into the next one's, c, as f + w (c - f), w rising from 0 to 1 with t */
} karst_footprint;

/* Zero-initialised fields mean the default that stands beside them. */
typedef struct {
    const char *world;                 /* path of a world file; required */
    const karst_parameter *parameters; /* borrowed during the call, as in karst_engine_config */
    size_t num_parameters;
    bool has_seed;
    uint32_t seed;              /* instead of the world's own */
    const karst_camera *camera; /* NULL: the world's */
    int width_px, height_px;    /* of the picture; each 1 to 16384; required */
    double detail_px;           /* 1.0; 0.25 to 64 */
    double view_distance_m;     /* 0: what the world says */
    karst_footprint footprint;
    int num_threads;        /* 0: one for each core; to 256 */
    uint32_t max_intervals; /* looked at along one ray at most, before it is given up; 2^20 */
} karst_reference_config;

typedef enum {
    KARST_REFERENCE_MISS,      /* no solid before the view distance */
    KARST_REFERENCE_SURFACE,   /* first solid at t_m, within 1e-9 of the distance (or 2^-30 voxel) */
    KARST_REFERENCE_INSIDE,    /* the ray begins in solid, or a level does: t_m is where */
    KARST_REFERENCE_UNRESOLVED /* given up at t_m: nothing solid before */
} karst_reference_kind;

typedef struct {
    double t_m;       /* along the ray; INFINITY for a miss */
    double normal[3]; /* of length 1, towards the air: the density's exact gradient; against the ray where there is none
                       */
    double footprint_m; /* the ray's, there (of a miss: at the view distance) */
    int level;          /* -1: full density; of two that blend the finer */
    karst_reference_kind kind;
} karst_reference_hit;

typedef struct {
    uint64_t num_intervals;  /* that were looked at */
    uint64_t num_grazes;     /* intervals as narrow as the tolerance that were neither proven empty nor end in solid */
    uint64_t num_unresolved; /* rays */
} karst_reference_stats;

/* Traces width_px * height_px rays into `hits`, top row first. `progress` (may be NULL) is called now and then, from
 * this thread, with the share done; returning false ends the work with KARST_FAILED. Errors: KARST_USAGE (a field out
 * of range, a world with models of points, which are not known here), KARST_BAD_WORLD, KARST_FAILED. Any thread.
 * `stats` may be NULL. */
bool karst_reference_trace(const karst_reference_config *config, karst_reference_hit *hits,
                           bool (*progress)(void *user, double share), void *user, karst_reference_stats *stats,
                           karst_error *error);

/* The picture that an engine with infinitely fine voxels and many rays a pixel would draw, without shadows: rays_px^2
 * rays a pixel (1 to 8 on a side), at the middles of its parts, of the full density, whatever the configuration's
 * footprint; colours at full detail; light is averaged before it is made bytes. RGBA, top row first, width * height * 4
 * bytes. Errors and progress as above. */
bool karst_reference_picture(const karst_reference_config *config, int rays_px, uint8_t *rgba,
                             bool (*progress)(void *user, double share), void *user, karst_reference_stats *stats,
                             karst_error *error);

/* ---- light in media ---- */

/* What the light is, and how many paths tell it. Zero-initialised fields mean the default that stands beside them. */
typedef struct {
    uint32_t paths_px;    /* of each pixel: 64; 1 to 2^24 */
    bool spread_px;       /* they go through all of the pixel; else through its centre */
    uint32_t max_bounces; /* what was scattered more often is left out; 1: single scattering. 0: as often as it is */
    bool no_sun;          /* the sun does not shine */
    double above[3], below[3]; /* radiance of red, green and blue from infinity, of directions that rise and of those
                                * that fall; 0 or more */
    uint32_t max_nodes;        /* of the tree of proved bounds: 32768; 9 to 2^24 */
    bool one_majorant;         /* one bound for the whole medium, the largest of those: to compare with */
    bool around_of_world; /* in place of above and below, what is scattered is lit from all around as engines light it
                           * without an atmosphere: by the world's sky, and by what its ground throws back of sky and
                           * sun; nothing is seen behind the medium */
} karst_reference_light;

typedef struct {
    uint64_t num_paths;
    uint64_t num_lookups;    /* of the extinction at a place: collisions, true and false, of paths and sun rays */
    uint64_t num_collisions; /* of paths with the medium */
    uint64_t num_nodes;      /* of the tree of bounds */
} karst_reference_light_stats;

/* What media (`medium air(vec3 p)`) show of the light, in a picture of width_px * height_px pixels: linear radiance in
 * `rgb`, three doubles a pixel, top row first; `deviation` (may be NULL): the standard deviation of each, of the mean.
 * The unit is that of karst_engine_read_radiance.
 *
 * Paths go backwards from the camera by delta tracking (E. Woodcock and others, 1965), so that nothing is biased by
 * steps: the extinction is the full one, in double, whatever the configuration's footprint. Majorants are the upper
 * ends of karst_sampler_bounds in the nodes of an octree that is as wide as the view distance, refined where most would
 * be looked up in vain. Scattering is that of Henyey and Greenstein ("Diffuse radiation in the galaxy", 1941), with g
 * as engines take it, from -0.95 to 0.95. The sun is as strong as it is without an atmosphere, of the
 * header's colour if that names one, and a point. Land, haze
 * and particles are not there. The same paths are followed whatever the number of threads.
 *
 * Errors: KARST_USAGE (a field out of range, no medium, particles, bounds that prove no finite extinction),
 * KARST_BAD_WORLD, KARST_FAILED (an extinction above its proved bound, too); progress as above. Any thread. `stats` may
 * be NULL. */
bool karst_reference_scatter(const karst_reference_config *config, const karst_reference_light *light, double *rgb,
                             double *deviation, bool (*progress)(void *user, double share), void *user,
                             karst_reference_light_stats *stats, karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
