/* Questions to a world, many at once, on the host: no device is used.
 *
 * Answers are of the density as devices compute it, bit for bit as karst_sampler_density has it, at one footprint for
 * all. Surfaces are found by proof: a stretch of a line is passed only if bounds show that the density keeps its sign
 * there, so nothing is stepped over that is at least as thick as the tolerance. All functions are thread-safe, share
 * their work among threads of their own, and give the same answers with any number of them. */
#ifndef KARST_QUERY_H
#define KARST_QUERY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/edit.h"
#include "karst/error.h"
#include "karst/position.h"
#include "karst/world.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Zero-initialised fields mean the default that stands beside them. */
typedef struct {
    double footprint_m; /* metres: without finer detail, as in karst/world.h; 0: all detail there is; not below 0 */
    double within_m; /* how near to the true surface an answer is; a 128th of the world's level-0 voxel; at least 2^-24
                      * of it */
    const karst_edit *edits; /* borrowed during the call, in the world's voxels; NULL: none */
    size_t num_edits;
    int num_threads; /* 0: one for each core; to 256 */
    /* Called now and then, from the calling thread, with the share done; false stops with KARST_FAILED. */
    bool (*progress)(void *user, double share);
    void *user;
} karst_query_config;

/* Densities at `num` points: above 0 inside. Errors: KARST_USAGE (a field out of range), KARST_FAILED. */
bool karst_query_densities(const karst_world *world, const karst_query_config *config, const karst_position *at,
                           size_t num, float *density, karst_error *error);

/* Exact gradients at `num` points, per metre, towards the solid: karst_sampler_gradients' in every bit. `density` (may
 * be NULL) gets the densities there. Errors: as above; KARST_FAILED also where the world is too large to have a
 * gradient. */
bool karst_query_gradients(const karst_world *world, const karst_query_config *config, const karst_position *at,
                           size_t num, float (*gradient)[3], float *density, karst_error *error);

/* Albedos at `num` points, linear RGB: the `device` halves of karst_sampler_colour's. `normals`: of length 1, one for
 * each point; NULL: the density's there, towards the air (up where it has no slope). Edits do not change colours but by
 * these normals. Errors: as above; KARST_USAGE also where the world defines no colours. */
bool karst_query_colours(const karst_world *world, const karst_query_config *config, const karst_position *at,
                         const float (*normals)[3], size_t num, float (*rgb)[3], karst_error *error);

/* Intervals that hold the density everywhere in `num` closed boxes, at every footprint from 0 to the configuration's:
 * karst_sampler_bounds'. Box i reaches half_m[i] metres from centres[i] along each axis (0 or more); range[i] is its
 * lower and upper bound, -INFINITY to INFINITY where nothing is known. Errors: as above. */
bool karst_query_bounds(const karst_world *world, const karst_query_config *config, const karst_position *centres,
                        const double (*half_m)[3], size_t num, double (*range)[2], karst_error *error);

typedef struct {
    karst_position from;
    double direction[3]; /* any length above 0 */
    double length_m;     /* how far it goes; above 0, to 2^60 voxels */
} karst_query_ray;

typedef enum {
    KARST_QUERY_MISS,
    KARST_QUERY_SURFACE,   /* first solid */
    KARST_QUERY_INSIDE,    /* it begins in solid */
    KARST_QUERY_UNRESOLVED /* given up at t_m, after KARST_QUERY_MAX_STEPS: nothing solid before */
} karst_query_kind;
#define KARST_QUERY_MAX_STEPS 1000000

typedef struct {
    double t_m;       /* along the ray; INFINITY for a miss */
    double normal[3]; /* of a surface: of length 1, towards the air, the exact gradient's; 0 where there is none */
    karst_query_kind kind;
} karst_query_hit;

/* Where rays first meet solid. Errors: as above. */
bool karst_query_rays(const karst_world *world, const karst_query_config *config, const karst_query_ray *rays,
                      size_t num, karst_query_hit *hits, karst_error *error);

/* All surfaces along verticals: from each point down for depth_m (above 0, to 2^60 voxels). Of point i at most
 * max_surfaces go to down_m[i * max_surfaces ...], metres below the point, from the top; they alternate between
 * entering solid and leaving it, and starts_inside[i] says whether the first one leaves. counts[i] says how many were
 * written. Beyond those, and after KARST_QUERY_MAX_STEPS, nothing is looked for. Errors: as above. */
bool karst_query_heights(const karst_world *world, const karst_query_config *config, const karst_position *at,
                         size_t num, double depth_m, uint32_t max_surfaces, double *down_m, uint32_t *counts,
                         bool *starts_inside, karst_error *error);

/* The surface that is nearest to a point. */
typedef struct {
    karst_position at; /* next to it, on the other side from the point */
    double distance_m; /* from the point to there; INFINITY: none was found within reach */
    double at_least_m; /* by proof: nothing of the other side is nearer. Less than it need be where nothing could be
                        * proved */
    double normal[3];  /* as of karst_query_hit */
    bool is_inside;    /* the point is solid */
} karst_query_near;

/* Finds them for `num` points, none farther than reach_m (above 0, to 2^60 voxels). Some surface is found along
 * straight ways, and followed down its slope to where it is nearest. Then cubes around the point are looked at, the
 * nearest first; one whose side is not proved is cut into eight until its diagonal is within what the configuration
 * asks for, or a 16th of how far it is. What is found there is followed, too. So distance_m is that of a true
 * surface, and the nearest one lies between at_least_m and it: they differ by some 16th, and what was asked for,
 * where the density can be bounded. Points that lie side by side share what is known of cubes: ask for many at
 * once, at most 2^32. A point alone takes milliseconds. Errors: as above. */
bool karst_query_nearest(const karst_world *world, const karst_query_config *config, const karst_position *at,
                         size_t num, double reach_m, karst_query_near *found, karst_error *error);

/* A map of heights: the topmost surface along the vertical through the middle of each pixel, seen from above. */
typedef struct {
    /* The lowest x and z of the map, and the y where the search begins; what is solid there counts as a surface. */
    karst_position corner;
    double size_m[2];      /* along x and z; above 0 */
    int size_px[2];        /* 1 to 16384 each */
    double depth_m;        /* how far down a surface is looked for; above 0, to 2^60 voxels */
} karst_height_map;

/* Fills size_px[0] * size_px[1] values, the row with the greatest z first, x rising along a row: metres below corner.y,
 * INFINITY where there is no surface (or none was found in KARST_QUERY_MAX_STEPS). Air above many pixels is proved for
 * all of them at once. Errors: as above. */
bool karst_query_height_map(const karst_world *world, const karst_query_config *config, const karst_height_map *map,
                            double *down_m, karst_error *error);

/* Writes a map of heights, whole or not at all, by its name's end: .exr has one channel Y of 32-bit floats, metres as
 * they are; .png and .tif have 16 bits, in which 1 to 65535 stand for low_m to high_m in equal steps (what lies beyond
 * is clamped), and 0 for columns without land. Both numbers stand in the file: PNG as texts "height_offset_m" and
 * "height_step_m" (metres = offset + step * value), TIFF in its description. `height_m`: width_px * height_px values,
 * top row first; NaN: no land, which is NaN in an EXR, too. Errors: KARST_USAGE (another name; a side outside 1 to
 * 16384; not low_m < high_m), KARST_FAILED naming the path. Thread-safe. */
bool karst_heights_write(const char *path, const double *height_m, int width_px, int height_px, double low_m,
                         double high_m, karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
