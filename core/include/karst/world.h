/* Worlds without a picture: what a world file says of itself, and its density at points, with no device at all. */
#ifndef KARST_WORLD_H
#define KARST_WORLD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/camera.h"
#include "karst/error.h"
#include "karst/log.h"
#include "karst/position.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Whether matter thinner than two of the voxels that a distance asks for is shown two of them wide, or let go. */
typedef enum {
    KARST_THIN_AUTO,   /* shown, unless noise is in all that the density joins, or it is very long: hills do not pay */
    KARST_THIN_ALWAYS, /* shown wherever there may be some: with noise bricks take two or three times as long */
    KARST_THIN_NEVER
} karst_thin;

/* A value for a parameter of a world file, instead of its header's. */
typedef struct {
    const char *name;
    double value;
} karst_parameter;

/* ---- a world ---- */

typedef struct karst_world karst_world;

/* What of a world is opened: the functions here, meshes, voxels and queries then see that as if it were the land. */
typedef enum {
    KARST_WORLD_LAND,
    KARST_WORLD_CLEAR, /* `float clear(vec3 p)`: clear matter, with the colours of its own surface */
    KARST_WORLD_AIR    /* `medium air(vec3 p)`: the density is its extinction per metre, without particles */
} karst_world_part;

/* Zero-initialised fields mean the default that stands beside them. */
typedef struct {
    const char *world; /* name of a shipped world, such as "hills", or the path of a world file: what holds a '/' or
                        * ends in ".karst"; required */
    const karst_parameter *parameters; /* borrowed during the call; clamped to their ranges */
    size_t num_parameters;
    bool has_seed;
    uint32_t seed;        /* instead of the world's own */
    const karst_log *log; /* borrowed during the call; gets what there is to say of the text; NULL: silent */
    karst_world_part part;
} karst_world_config;

/* Compiles a world. Close it with karst_world_close, when its samplers are gone. Errors: KARST_USAGE (no name,
 * a part that it has not), KARST_BAD_WORLD (an unknown name, an unknown parameter, a text that does not compile: file,
 * line and column; the log has the line itself with a caret), KARST_FAILED. A world never changes: any number of
 * threads may read one. */
karst_world *karst_world_open(const karst_world_config *config, karst_error *error);
void karst_world_close(karst_world *world); /* NULL is fine */

typedef struct {
    const char *name;
    const char *label, *unit; /* "" where the header says nothing */
    double value;             /* in this world */
    double min, max;          /* infinite where the header says nothing */
    double step;              /* 0: any value */
    bool is_structural;       /* decides loops, array sizes or octaves: another value means another program */
    bool is_used;
} karst_parameter_info;

/* What a world says of itself, defaults filled in. Strings are never NULL. */
typedef struct {
    const char *path; /* of the file */
    const char *name, *author, *description;
    int voxel_log2_m; /* a level-0 voxel is 2^this metres wide; positions count in these */
    uint32_t seed;
    karst_camera camera;
    double sun_azimuth_deg, sun_elevation_deg;
    double view_distance_m;
    double extent_m;           /* how far from the origin it means something; 0: not said */
    double declared_lipschitz; /* 0: none */
    bool has_colour;           /* it defines colour() or surface() */
    size_t num_parameters;
    const karst_parameter_info *parameters; /* of the header, in its order */
} karst_world_metadata;

/* Owned by the world, valid until it is closed. */
const karst_world_metadata *karst_world_get_metadata(const karst_world *world);

/* Hands a report for people, line by line without newlines, to `print`: warnings, parameters and which of them are
 * structural, noises and whether they are separable, the Lipschitz constant or what has none, how far precision holds,
 * the estimated cost of a voxel, and of a node's bounds. Errors: KARST_FAILED (memory). */
bool karst_world_check(const karst_world *world, void (*print)(void *user, const char *line), void *user,
                       karst_error *error);

/* Has the compiler of a device (see `karst info`: number, part of a name, "cpu", "gpu"; NULL: first GPU, else first
 * CPU) read all code that is made of the world: what it accepts here, it accepts when a picture is drawn. Some tenths
 * of a second; far less for code that the driver has seen before. Thread-safe. Errors: KARST_NO_DEVICE, KARST_FAILED
 * (it is refused: with the compiler's first lines). */
bool karst_world_try_code(const karst_world *world, const char *device, karst_error *error);

/* ---- samples ---- */

/* Everywhere here a footprint is in metres and means: without detail finer than that. As in bricks it is the voxel of a
 * level, 2^n level-0 voxels: the widest that is at most the footprint. Below a level-0 voxel, 0 included, it means all
 * detail there is: the full density. */

/* That level; -1: all detail. */
int karst_world_level(const karst_world *world, double footprint_m);

/* A value twice: as every device computes it, bit for bit, and in double with noise and positions in double too. Their
 * difference is the device's rounding error. */
typedef struct {
    float device;
    double precise;
} karst_sample;

/* What it takes to sample a world: memory of its own for one thread at a time. Make one for each thread. */
typedef struct karst_sampler karst_sampler;

/* The world outlives it. Thread-safe. Errors: KARST_FAILED (memory). */
karst_sampler *karst_sampler_create(const karst_world *world, karst_error *error);
void karst_sampler_destroy(karst_sampler *sampler); /* NULL is fine */

/* The density: positive in solid, negative in air. Not finite where the world's own arithmetic overflows. */
karst_sample karst_sampler_density(karst_sampler *sampler, const karst_position *at, double footprint_m);
/* Only the `precise` half of the same, in half the time or so. */
double karst_sampler_precise_density(karst_sampler *sampler, const karst_position *at, double footprint_m);

/* The density's exact gradient per metre: it points into the solid. Where the density has a kink it is that of one
 * side; jumps contribute nothing. `density` may be NULL. false: the world is too large to have one. */
bool karst_sampler_gradient(karst_sampler *sampler, const karst_position *at, double footprint_m,
                            karst_sample gradient[3], karst_sample *density);

/* The albedo (of colour() or surface()), linear RGB, for a normal of length 1, with what edits have painted over it.
 * false: the world defines none, and nothing is painted there. */
bool karst_sampler_colour(karst_sampler *sampler, const karst_position *at, const float normal[3], double footprint_m,
                          karst_sample rgb[3]);

/* The same for many points: the `device` halves of karst_sampler_density and karst_sampler_gradient at each, bit for
 * bit, in a tenth of the time or so. For world files of any size; those too large for it are sampled one by one.
 * `density` and `gradient` have `num` elements; neither may be NULL. false, with nothing written: as above. Uses some
 * MiB of the thread's stack. */
void karst_sampler_densities(karst_sampler *sampler, const karst_position *at, size_t num, double footprint_m,
                             float *density);
bool karst_sampler_gradients(karst_sampler *sampler, const karst_position *at, size_t num, double footprint_m,
                             float (*gradient)[3], float *density);

/* An interval that holds the density, as devices compute it, at every point of the closed box at most half_m away from
 * `centre` along each axis, for every footprint from 0 to this one. By proof, not by sampling; small boxes have narrow
 * ones. false: nothing is known (the range is then -INFINITY to INFINITY). */
bool karst_sampler_bounds(karst_sampler *sampler, const karst_position *centre, const double half_m[3],
                          double footprint_m, double range[2]);

#ifdef __cplusplus
}
#endif
#endif
