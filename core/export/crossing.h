/* Where segments from solid to air meet the surface. */
#ifndef KARST_EXPORT_CROSSING_H
#define KARST_EXPORT_CROSSING_H

#include <stddef.h>
#include <stdint.h>

#include "core/export/grid.h"
#include "karst/world.h"

/* How near the surface is to what is found, in cells. */
#define KARST_CROSSING_WITHIN (1.0 / 1024)

typedef struct {
    double from[3], to[3];           /* in the grid: solid at the one, air at the other */
    float from_density, to_density;  /* there: above 0, and not */
    double found[3], found_solid[3]; /* filled in: on the surface, and solid beside it */
} karst_segment;

/* Finds a place where the density changes its sign on each segment, on the density that devices compute: as a false
 * position that is kept from standing still, many at a time. `scratch` holds a position and a float for each. Returns
 * how many densities were evaluated. */
uint64_t karst_find_crossings(karst_sampler *sampler, const karst_grid *grid, karst_segment *segments, size_t num,
                              karst_position *positions, float *densities);

#endif
