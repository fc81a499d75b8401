/* Fields as voxels: what a box of worlds holds, as grids in a NanoVDB file (.nvdb), for programs that draw or simulate
 * volumes. No device is used.
 *
 * The files are those of NanoVDB 32.4 (K. Museth, "NanoVDB: A GPU-friendly and portable VDB data structure", 2021), as
 * Debian's libnanovdb-dev reads them: floats, full checksums, not compressed. Voxel i of an axis has its centre
 * (i + 1/2) voxels from the box's lower corner; the file's own coordinates are metres from that corner, with Karst's
 * axes (x right, y up, z forward). */
#ifndef KARST_VOXELS_H
#define KARST_VOXELS_H

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

#define KARST_VOXELS_MAX_SIDE 32768 /* along an axis */
#define KARST_VOXELS_BAND 3         /* voxels on each side of a surface that have a distance of their own */
#define KARST_VOXELS_MOST_GRIDS 16

typedef enum {
    /* The density of each voxel's centre, in the bits of karst_query_densities; all voxels of the box are active, and
     * the background is 0. */
    KARST_VOXELS_DENSITY,
    /* A level set: metres to the surface, below 0 in matter. Voxels nearer than KARST_VOXELS_BAND voxels are active;
     * others are as far as that, on their side, and so is the background outside. A distance is that to the plane
     * through the nearest crossing of the surface with an edge between voxels, across the exact gradient there. What
     * bounds prove to be far from surfaces is never sampled. */
    KARST_VOXELS_DISTANCE,
    /* A fog volume: the density where it is above 0, which is active, and 0 elsewhere. Of a world that was opened as
     * its air (karst_world_config.part) that is the extinction, per metre. */
    KARST_VOXELS_FOG
} karst_voxels_kind;

/* One grid of the file. */
typedef struct {
    const karst_world *world; /* borrowed */
    const char *name;         /* up to 255 bytes */
    karst_voxels_kind kind;
    const karst_edit *edits; /* borrowed, in the world's voxels; NULL: none */
    size_t num_edits;
} karst_voxels_grid;

/* Zero-initialised fields mean the default that stands beside them. */
typedef struct {
    /* The box: its lower corner, in level-0 voxels, which must be as wide in all worlds, and how many voxels there are
     * along each axis, 1 to KARST_VOXELS_MAX_SIDE. */
    karst_position corner;
    int64_t num_voxels[3];
    double voxel_m;     /* how wide one is; above 0, finite */
    double footprint_m; /* metres: without finer detail, as in karst/world.h; 0: all detail there is; not below 0 */
    int num_threads;    /* 0: one for each core; to 256. The file does not depend on it */
} karst_voxels_config;

typedef struct {
    uint64_t num_active;  /* voxels, of all grids */
    uint64_t num_leaves;  /* blocks of 8^3 that are stored */
    uint64_t num_samples; /* densities that were evaluated, gradients included */
} karst_voxels_stats;

/* Writes a file with so many grids, 1 to KARST_VOXELS_MOST_GRIDS, whole or not at all (beside as .karst-*.tmp, then
 * renamed). Memory grows with 264 KiB for each 4096^3 voxels and 4 bytes for each block of 8^3 that is stored.
 * `progress` (may be NULL) gets the share done; false stops with KARST_FAILED. `stats` may be NULL. Thread-safe.
 * Errors: KARST_USAGE (a field out of range; a box that leaves the world; a name that is not .nvdb), KARST_FAILED
 * naming the path (disk full; memory; it was stopped). */
bool karst_voxels_write(const char *path, const karst_voxels_config *config, const karst_voxels_grid *grids,
                        size_t num_grids, bool (*progress)(void *user, double share), void *user,
                        karst_voxels_stats *stats, karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
