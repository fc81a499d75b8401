/* Worlds that change while an engine shows them: other values of parameters, and other worlds. */
#ifndef KARST_CHANGE_H
#define KARST_CHANGE_H

#include <stdbool.h>
#include <stddef.h>

#include "karst/engine.h"
#include "karst/error.h"
#include "karst/world.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Sets parameters of the world that is shown, from the next frame on; the others keep their values. Values are clamped
 * to the ranges of the header. Nothing is compiled, unless a structural parameter changes (karst_parameter_info says
 * which those are), which takes as long as a new world. What was made stays, unless the density itself depends on what
 * changed; then it is made anew, coarse first, so set the parameters that belong together in one call. Errors:
 * KARST_USAGE (a name that the world does not have; nothing changes), KARST_BAD_WORLD (a structural value with which it
 * does not compile; nothing changes), KARST_FAILED. */
bool karst_engine_set_parameters(karst_engine *engine, const karst_parameter *parameters, size_t num_parameters,
                                 karst_error *error);
/* The value in force. Errors: KARST_USAGE (no such name). */
bool karst_engine_parameter(const karst_engine *engine, const char *name, double *value, karst_error *error);

/* Sets the time in seconds, -1e9 to 1e9, from the next frame on; an engine begins at 0. It says where the particles are
 * that a world's header names, and what iTime is in its text. What did not move stays. Of what iTime changes all is
 * made anew. Errors: KARST_USAGE (a time out of range or not a number; particles that move too far apart for the
 * world's voxels; a text whose compiling depends on iTime), KARST_FAILED; then the time is as it was. */
bool karst_engine_set_time(karst_engine *engine, double time_s, karst_error *error);
double karst_engine_time(const karst_engine *engine);

/* When the sun moves, or what fills the air, each frame makes one part in `groups` of the depths towards the sun that
 * it looks at anew: the oldest first, and of these the most visible. 1, with which an engine begins, makes all of them.
 * A view that stands comes to rest with the same picture, some frames later; karst_engine_settle makes all at once.
 * After the groups of Mattsson ("Simulating optical depth for participating media using ray tracing", 2022). From the
 * next frame on. Errors: KARST_USAGE (0, or more than KARST_ENGINE_MAX_MEDIA_GROUPS). */
#define KARST_ENGINE_MAX_MEDIA_GROUPS 1024u
bool karst_engine_set_media_groups(karst_engine *engine, uint32_t groups, karst_error *error);

/* A world made ready for an engine. */
typedef struct karst_prepared_world karst_prepared_world;

/* Compiles a world, and what runs of it on the engine's device, without touching the engine: it may be called from
 * another thread while the engine draws frames, one preparation at a time. It takes seconds where the programs are not
 * kept from an earlier time. `config` is read during the call only. Errors: as karst_world_open, and KARST_FAILED.
 * Ends with karst_engine_change_world or karst_prepared_world_destroy, before the engine is destroyed. */
karst_prepared_world *karst_engine_prepare_world(karst_engine *engine, const karst_world_config *config,
                                                 karst_error *error);
void karst_prepared_world_destroy(karst_prepared_world *world); /* NULL is fine */

/* Has the device's driver load what it compiles with. PoCL does that for the first program of a process that it did not
 * keep from an earlier time, and it takes a second or two: so much sooner is a first karst_engine_prepare_world ready
 * afterwards. To be called as that, from another thread if need be, but not beside it. Nothing is left of it; where the
 * driver cannot do it, nothing happens. */
void karst_engine_load_compiler(karst_engine *engine);

/* Shows a prepared world from the next frame on, and takes it over, also when it fails (then the old one stays).
 * Called from the engine's own thread. The camera stays where it is, in metres. If the density is the same (the text
 * changed in colours, names, sun or comments only), all that was made stays: no brick is made again. *kept, which may
 * be NULL, says so. Errors: KARST_USAGE (view distance of the configuration against the voxels of this world),
 * KARST_FAILED. */
bool karst_engine_change_world(karst_engine *engine, karst_prepared_world *world, bool *kept, karst_error *error);

/* Colours that are edited can be shown at once, before code of their own is compiled: on an interpreter that all worlds
 * share, a little slower, with the same pixels in every byte. This compiles it: some 2 s of one core where the driver's
 * store lacks it. It may be called from another thread while the engine draws frames, as karst_engine_prepare_world,
 * but not at the same time as that. Errors: KARST_FAILED. */
bool karst_engine_prepare_colours(karst_engine *engine, karst_error *error);
/* Shows a world from the next frame on if it differs from the one that is shown in its colours alone (or in names, sun,
 * sky), and the interpreter is ready; *shown says so, else nothing changes. Takes some tens of ms. Called from the
 * engine's own thread; karst_engine_prepare_world and karst_engine_change_world then bring the compiled colours. No
 * brick is made again. Errors: KARST_BAD_WORLD (a text that does not compile; nothing changes), KARST_FAILED (the
 * engine can only be destroyed). */
bool karst_engine_show_colours(karst_engine *engine, const karst_world_config *config, bool *shown, karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
