/* Where a lamp's photons are to be sent: raycast/light/photons.h. What probes saw of its cells and of their parts
 * becomes grids of photons. Host only. */
#ifndef KARST_RAYCAST_PHOTONS_AIM_H
#define KARST_RAYCAST_PHOTONS_AIM_H

#include <stdbool.h>

#include "raycast/light/photons_shared.h"

/* What a probe met first that mirrors or is clear: how far from the eye, and along its ray; 0: nothing; below 0: it met
 * what is missing. */
typedef struct {
    float distance, t;
} karst_photon_seen;

/* What is known of a lamp. All in level-0 voxels. */
typedef struct {
    const karst_photon_lamp *lamp; /* borrowed */
    uint32_t number;               /* of the lamp */
    float t_max;                   /* how far from the eye all ends */
    uint32_t num_cells;            /* that hold something, or whose neighbours do */
    uint32_t parts_log2;           /* each is cut into so many parts a side */
    uint32_t cells[KARST_PHOTON_CELLS];
    uint32_t index[KARST_PHOTON_CELLS];          /* of a cell in `cells`; UINT32_MAX: it is not there */
    karst_photon_seen first[KARST_PHOTON_CELLS]; /* by probes of cells */
    karst_photon_seen parts[KARST_PHOTON_CELLS]; /* by those of parts: of cell after cell, row by row */
    bool knows_cells;                            /* `first` is known; then `parts` are looked at */
    uint32_t num_waiting;                        /* probes of these cells or parts that met what is missing */
    uint32_t waiting[KARST_PHOTON_CELLS];        /* their numbers, in order */
} karst_photon_aim;

/* Radius of the ring of a sun's disc that begins row `row` (0 to KARST_PHOTON_ROWS). */
double karst_photon_ring(float t_max, double row);
/* From `first` to the cells, and into how many parts they may be cut with at most most_parts in all: now into one. */
uint32_t karst_photons_find_cells(karst_photon_aim *aim, uint32_t most_parts);
/* A grid for each cell, of a probe for each of its parts. */
void karst_photons_probe_parts(karst_photon_aim *aim, uint32_t parts_log2, karst_photon_cell *into);
/* Parts twice as wide. */
void karst_photons_coarsen(karst_photon_aim *aim);
/* The parts that hold something, or whose neighbours do: their cells, with their areas as shares, and what each is
 * worth: light at the eye's distance. *angle grows by what they are across the light, at that distance. Returns how
 * many: at most KARST_PHOTON_CELLS. */
uint32_t karst_photons_find_parts(const karst_photon_aim *aim, karst_photon_cell *into, double *worth, double *angle);
/* Grids of all together at most num_photons, from what each part is worth; parts that are worth less than a photon are
 * left out in turn, and the others stand for them. lamps: by their numbers. *num: of parts; fewer are left. Returns
 * the number of photons. */
uint32_t karst_photons_share_out(const karst_photon_lamp *lamps, float t_max, karst_photon_cell *parts,
                                 const double *worth, uint32_t *num, uint32_t num_photons);

#endif
