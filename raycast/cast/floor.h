/* The floor kernel: what the memory traffic alone of a cast picture costs, to measure a frame against (on a noisy
 * machine the ratio holds). */
#ifndef KARST_RAYCAST_FLOOR_H
#define KARST_RAYCAST_FLOOR_H

#include "core/device/context.h"

typedef struct karst_floor karst_floor;

/* Builds the kernel and its data (some 3 MB). Errors: KARST_FAILED. Destroy with karst_floor_destroy. */
karst_floor *karst_floor_create(karst_context *context, int width_px, int height_px, karst_error *error);
void karst_floor_destroy(karst_floor *floor_kernel); /* NULL is fine */
/* Runs it once for a picture and waits; *time_ns is its device time. Other launches must have been collected
 * (karst_profile_collect) before. */
bool karst_floor_run(karst_floor *floor_kernel, uint64_t *time_ns, karst_error *error);

#endif
