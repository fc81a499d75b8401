/* Questions to a device, many at once: rays through an engine's bricks, and the density at points.
 *
 * karst/query.h answers the like on the host, by proof and without a device. Here rays meet what pictures show: bricks
 * of the level that a ray's footprint asks for, in the bits of the picture's own rays. Points are evaluated one by one,
 * in the bits of karst_sampler_densities and karst_sampler_gradients. */
#ifndef KARST_RAYS_H
#define KARST_RAYS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/engine.h"
#include "karst/query.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- rays ---- */

/* A ray with its own footprint. Offsets are floats: they err by 2^-24 of their length. */
typedef struct {
    float from_m[3];    /* from the camera of the last frame, along the world's axes */
    float direction[3]; /* of length 1, to 1e-5 */
    float length_m;     /* how far it goes; above 0; ends as far from the camera as the engine sees at most */
    float width_m;      /* its footprint where it starts, and */
    float cone; /* by how much that grows with each metre; neither below 0. Voxels are asked to be as wide as the
                 * footprint times the engine's detail */
} karst_engine_ray;

typedef enum {
    KARST_ENGINE_MISS,
    KARST_ENGINE_SURFACE,
    KARST_ENGINE_SOLID /* it starts in solid, or met solid without a surface */
} karst_engine_hit_kind;

typedef struct {
    float t_m;       /* along the ray; INFINITY: it met nothing */
    float normal[3]; /* of length 1, towards the air; zeros: there is none */
    karst_engine_hit_kind kind;
    int level;     /* of the brick that was hit */
    bool is_final; /* it lacked nothing: not on a coarser brick than asked for, nor past one that is missing */
} karst_engine_hit;

typedef struct {
    uint32_t num_rounds;   /* casts, the last of which lacked nothing where all hits are final */
    uint64_t num_produced; /* bricks and tiles that were made for it */
    uint64_t cast_ns;      /* of the device, for the last cast of each batch */
    bool complete;         /* all hits are final */
} karst_engine_rays_report;

/* Casts rays through the engine's bricks, and has made what they lack, until they lack nothing or max_rounds rounds
 * are over (0: 1000 for each batch of 2^18 rays). Land alone is hit, with the engine's edits and models; hits are as
 * bricks have them, also of an engine that refines (karst_engine_config.refine). Rays that are neighbours in the array
 * travel together: give those that go together after one another. Rays that all start at the camera, with one
 * footprint, are as fast as a picture's; others take half as long again. The engine's pictures do not change; bricks
 * that only they need may be gone, and are made again by the next frame. The first call compiles kernels. `report` may
 * be NULL. Errors: KARST_USAGE (no frame has been drawn yet, a field out of range), KARST_FAILED (device, memory). From
 * the engine's thread. Method: as pictures, docs/ARCHITECTURE.md. */
bool karst_engine_cast_rays(karst_engine *engine, const karst_engine_ray *rays, size_t num, uint32_t max_rounds,
                            karst_engine_hit *hits, karst_engine_rays_report *report, karst_error *error);

/* The rays of the last frame's pixels, in every bit, in the order in which pictures cast them: blocks of 32 x 32. Fills
 * width * height of both, which `num` must be; pixels[i] is x + y * width of ray i. Of a picture of several samples
 * they are those through the pixels' centres. Errors: KARST_USAGE (no frame has been drawn yet; another number). From
 * the engine's thread. */
bool karst_engine_picture_rays(const karst_engine *engine, karst_engine_ray *rays, uint32_t *pixels, size_t num,
                               karst_error *error);

/* ---- points ---- */

/* A world's density on a device: its kernel and memory there. */
typedef struct karst_device_points karst_device_points;

/* Opens a device (as `karst info` lists them; NULL: the first GPU, else the first CPU) and compiles the world's density
 * and gradient for it, which takes seconds the first time. The world must outlive it. Errors: KARST_NO_DEVICE,
 * KARST_USAGE (a world that is too large to have a gradient, that shows models, or whose density is not computed as it
 * is written, such as a body that steps between 0 and 1: ask karst_query_densities), KARST_FAILED. Thread-safe. */
karst_device_points *karst_device_points_create(const karst_world *world, const char *device, const karst_log *log,
                                                karst_error *error);
void karst_device_points_destroy(karst_device_points *points); /* NULL is fine */

/* Densities at `num` points, above 0 inside; and, where `gradient` is not NULL, the gradients there, per metre, towards
 * the solid: the bits of karst_sampler_densities and karst_sampler_gradients. Without detail finer than footprint_m
 * (0: all there is; not below 0). Points go to the device in batches of 2^18. Errors: KARST_USAGE (the footprint),
 * KARST_FAILED. Not thread-safe for one `points`. */
bool karst_device_points_find(karst_device_points *points, const karst_position *at, size_t num, double footprint_m,
                              float *density, float (*gradient)[3], karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
