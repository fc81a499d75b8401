/* Light maps of what fills the air: how bright a world's media are to the camera in light from each of six sides, and
 * how much they hide. A game engine lights a flat card by them as if it were the smoke itself ("six-way lighting"). */
#ifndef KARST_MAPS_H
#define KARST_MAPS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/engine.h"
#include "karst/error.h"
#include "karst/stats.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Settles the camera's picture of the media alone (no land, clear matter, sky, haze or lights) in light from six sides
 * of the camera, and fills two maps, four floats a pixel, top row first:
 *
 *   positive   lit from the right, from above, from the front (the eye's side); how much is hidden, 0 to 1
 *   negative   lit from the left, from below, from behind; what the media give off by themselves
 *
 * Light is the mean of red, green and blue that reaches the eye, where 1 is what a white surface facing that light
 * would send back; what is behind shows by 1 - hidden on top of that (so these are premultiplied). Every side shines as
 * a sun whose light nothing weakens but the media: each picture is by the engine's mode of media, with its samples.
 * num_values: of each map, width * height * 4. progress, user: as for karst_engine_settle, which is called some eight
 * times with max_frames (0: as many as it takes by default); *settled: all of them came to an end. The engine's sun,
 * time and camera stay; its next frame shows the world again. Not thread-safe, as all that an engine does.
 *
 * Errors: KARST_USAGE (the world has no media; full light, which knows none; num_values is wrong), KARST_FAILED. The
 * maps are undefined after one. Which map has which side is as L. Mattsson has it ("Simulating optical depth for
 * participating media using ray tracing", 2022, 4.2.2). */
bool karst_engine_six_way(karst_engine *engine, uint32_t max_frames,
                          bool (*progress)(void *user, const karst_stats *stats), void *user, float *positive,
                          float *negative, size_t num_values, bool *settled, karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
