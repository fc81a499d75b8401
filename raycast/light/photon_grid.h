/* How landed photons become light: each spreads over a spot of its own, and pixels add up the spots that they lie in.
 *
 * Photons are sent in grids. What a photon stands for lies around it, halfway to where its neighbours of the grid
 * landed, if light took the same way to them. So their distances say how wide its spot must be, and in which direction:
 * narrow where light is focused, wide where it spreads, and spots of neighbours overlap alike. (L. Schjoth and others,
 * "Photon differentials for global illumination", 2007, follow differentials along with each ray; here they are
 * differences of photons that are traced anyway.) No spot is smaller than what spreads light as a pixel's square does.
 * A sun sends all of them from the middle of its disc: spots are as much wider as light from all over the disc is
 * spread on its way from the first surface, as if that were a flat mirror.
 * Photons without neighbours are as wide as their number allows.
 *
 * Spots lie in a table of cells at least as wide as they are, of a size for each power of two. Everything is summed in
 * whole numbers, so that no order leaves a trace. */
#ifndef KARST_RAYCAST_PHOTON_GRID_H
#define KARST_RAYCAST_PHOTON_GRID_H

#include "core/device/context.h"
#include "raycast/cast/pinhole.h"
#include "raycast/light/photon_grid_shared.h"

typedef struct karst_photon_grid karst_photon_grid;

/* For so many photons at most (1 or more). Errors: KARST_FAILED. */
karst_photon_grid *karst_photon_grid_create(karst_context *context, uint32_t num_photons, karst_error *error);
void karst_photon_grid_destroy(karst_photon_grid *grid); /* NULL is fine */
/* What the table takes, and spots if half of all slots' leave one. Thread-safe. */
double karst_photon_grid_bytes(uint32_t num_photons);

/* From now on these are gathered: records of the batches that task->num_records says, and the grids and lamps that they
 * are of. All of it borrowed for the call. Waits. Errors: KARST_FAILED. */
bool karst_photon_grid_fill(karst_photon_grid *grid, const karst_photon_grid_task *task, const karst_buffer *photons,
                            const karst_buffer *cells, const karst_buffer *lamps, karst_error *error);
/* Adds to the picture's parts what they make of surfaces: karst_photons_gather. Of the task those fields are used that
 * karst_photon_grid_fill had, but for whole and offset. Asynchronous. Errors: KARST_FAILED. */
bool karst_photon_grid_gather(karst_photon_grid *grid, const karst_photon_grid_task *task, const karst_buffer *rays,
                              const karst_buffer *count, uint32_t max_rays, const karst_pinhole *pinhole,
                              karst_buffer *parts, karst_error *error);

#endif
