/* Edits: operations on the land of a world, applied in order, seen at every distance. */
#ifndef KARST_EDIT_H
#define KARST_EDIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/engine.h"
#include "karst/error.h"
#include "karst/position.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    KARST_EDIT_SPHERE,
    KARST_EDIT_BOX,     /* along the axes */
    KARST_EDIT_CAPSULE, /* a rounded rod from `at` to `at` + to_m */
    KARST_EDIT_PLANE,   /* all that lies below the plane through `at` */
    KARST_EDIT_NOISE    /* a sphere whose surface noise makes rough */
} karst_edit_shape;

typedef enum {
    KARST_EDIT_ADD,     /* land in the shape */
    KARST_EDIT_REMOVE,  /* air in the shape */
    KARST_EDIT_FLATTEN, /* in a sphere or a box: land below a plane through `at`, air above */
    KARST_EDIT_PAINT,   /* a colour on what lies in the shape; the land stays as it is */
    KARST_EDIT_SMOOTH   /* in a sphere: land is drawn towards the plane through `at`, most in the middle */
} karst_edit_mode;

/* One edit. It is exact wherever it lies; lengths are metres, 2^-20 voxel to 2^60 voxels. */
typedef struct {
    karst_edit_shape shape;
    karst_edit_mode mode;
    karst_position at; /* the centre, in the engine's voxels (karst_engine_voxel_log2_m); at most 2^61 of them out */
    double radius_m;   /* sphere, capsule, noise; above 0 */
    double half_m[3];  /* box: half its sides; each above 0 */
    double to_m[3];    /* capsule */
    double normal[3];  /* plane, flatten, smooth: any length above 0; all 0: up */
    double blend_m;    /* edges where the edit meets the land are rounded off over so much of the density, which is
                        * metres in most worlds; 0: sharp. paint: metres over which it fades at its edge. smooth: 0 */
    double amplitude_m, scale_m; /* noise: how rough (0 to the radius), and how wide its largest bumps are */
    uint32_t seed;               /* noise */
    bool has_colour;  /* paint: always; add: what is added has a colour of its own, not the world's */
    double colour[3]; /* with it: albedo, linear red, green and blue, 0 to 1 each */
    double strength;  /* with it: how much of the colour below it covers, above 0, at most 1. smooth: the plane's share
                       * of the density in the middle, as much; at r of the radius it is (1 - r^2)^2 of that */
} karst_edit;

/* What an edit or an undo made the engine forget. */
typedef struct {
    uint64_t num_nodes;  /* nodes of the tree whose verdicts fell */
    uint64_t num_bricks; /* and of these, with a brick */
} karst_edit_report;

/* Appends edits to the engine's, to be seen from the next frame on. What they touch is made anew, and nothing else; a
 * settled picture is that of an engine that had them from the start. The first edits of an engine compile what they
 * need, which takes a second or two with PoCL, and so do the first with a colour, which also take memory: twice that of
 * the pool of bricks. With `refine` hits go to the edited density's surface. Edits that were undone and not redone are
 * gone. All are taken or none. Errors: KARST_USAGE (a value out of range: which edit, counted from 1; more than
 * KARST_MAX_EDITS), KARST_FAILED. Call it from the engine's own thread. */
bool karst_engine_edit(karst_engine *engine, const karst_edit *edits, size_t num_edits, karst_error *error);
#define KARST_MAX_EDITS 10000000u
/* Takes the last edits back, at most as many as there are, and makes them again; *num becomes how many. Errors:
 * KARST_FAILED; then *num is 0. From the engine's own thread. */
bool karst_engine_undo(karst_engine *engine, size_t *num, karst_error *error);
bool karst_engine_redo(karst_engine *engine, size_t *num, karst_error *error);
/* How many edits are in force, and how many could be redone. */
size_t karst_engine_num_edits(const karst_engine *engine, size_t *num_redoable);
/* What the last edit, undo or redo made the engine forget. */
karst_edit_report karst_engine_edit_report(const karst_engine *engine);

/* Reads a file of edits for a world of these voxels: malloc'ed, *num of them. The format is JSON:
 *
 *     { "edits": [
 *         { "shape": "sphere", "mode": "remove", "at": ["1000000000010", "0", "0"], "radius": 5 },
 *         { "shape": "box", "mode": "add", "at": [0, 20, 0], "half": [1, 1, 1], "blend": 0.5 } ] }
 *
 * "at" and "to" are metres, as numbers or as decimal texts, which are exact; "to" is the other end of a capsule;
 * "normal" belongs to planes, "flatten" and "smooth"; "amplitude", "scale" and "seed" to "noise"; "colour" ([r, g, b])
 * to "paint" and "add", "strength" (1 if left out) to these and "smooth". Errors: KARST_BAD_DATA
 * (cannot be read, no JSON, an unknown shape, mode or field, values out of range: the message names the file, the edit
 * or line and the field), KARST_FAILED. Thread-safe. */
karst_edit *karst_edits_load(const char *path, int voxel_log2_m, size_t *num, karst_error *error);

/* Reads one edit from a line, for a world of these voxels: the shape, its values, what becomes of the land (`add` if
 * that is left out), and what else there is to say:
 *
 *     sphere,X,Y,Z,RADIUS   box,X,Y,Z,HALF_X,HALF_Y,HALF_Z   capsule,X,Y,Z,TO_X,TO_Y,TO_Z,RADIUS   plane,X,Y,Z
 *     noise,X,Y,Z,RADIUS,AMPLITUDE,SCALE      then ,add ,remove ,flatten ,paint or ,smooth  then ,blend=M ,seed=N
 *     ,normal=X:Y:Z ,colour=R:G:B ,strength=S
 *
 * All are metres, and as karst_edits_load takes them; places are exact decimals. *edit changes only on success. Errors:
 * KARST_USAGE (what is wrong with which value), KARST_FAILED (memory). Thread-safe. */
bool karst_edit_parse(const char *text, int voxel_log2_m, karst_edit *edit, karst_error *error);
/* Writes one edit as an object of the list that karst_edits_load reads, which gives the same edit back (the far end of
 * a capsule to 2^-32 voxel). 2048 bytes always suffice; returns the length, as snprintf does; -1 (and "") if there is
 * no such shape or mode, or voxel_log2_m is out of range. Thread-safe. */
int karst_edit_format(const karst_edit *edit, int voxel_log2_m, char *text, size_t size_bytes);

/* From now on a sampler's densities are those of its world with these edits, instead of any before; gradients and
 * bounds are not known where edits are near. The positions are in the world's voxels. All are taken or none. Errors:
 * KARST_USAGE, KARST_FAILED. */
bool karst_sampler_set_edits(karst_sampler *sampler, const karst_edit *edits, size_t num_edits, karst_error *error);
/* The same, one after another: appends edits to the sampler's, as karst_engine_edit does to an engine's; those that
 * karst_sampler_keep_edits took out of force are gone. All are taken or none. Errors: KARST_USAGE, KARST_FAILED. Like
 * all functions on a sampler: by one thread at a time. */
bool karst_sampler_append_edits(karst_sampler *sampler, const karst_edit *edits, size_t num_edits, karst_error *error);
/* From now on the first `num` of a sampler's edits are in force, at most as many as it was given: an undo or a redo.
 * Returns how many that are. */
size_t karst_sampler_keep_edits(karst_sampler *sampler, size_t num);

#ifdef __cplusplus
}
#endif
#endif
