/* Paths through clear matter, as kernels and host see them. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_CLEAR_PATHS_SHARED_H
#define KARST_RAYCAST_CLEAR_PATHS_SHARED_H

#include "core/device/dialect.h"

/* In karst_hit.kind, of a path's hits alone: the surface is one of clear matter. */
#define KARST_PATH_HIT_CLEAR 0x40000u

/* What a path's ray knows of lamps: nothing; the surface that scattered it last looked for them; and it has since met
 * clear matter, which hid them from there, so that it sees them itself. */
#define KARST_PATH_LOOKED_FOR_NONE 0u
#define KARST_PATH_LOOKED 1u
#define KARST_PATH_CROSSED 2u
/* Beside it, in rays that are not packed yet: they leave a surface of clear matter. */
#define KARST_PATH_FROM_CLEAR 0x100u

/* What the rays of a generation have in common. */
typedef struct {
    float absorption[3]; /* per level-0 voxel, where the eye is in clear matter */
    uint is_inside;      /* it is */
    float detail, voxel_m;
    float t_max; /* how far from the eye rays end */
    uint sample; /* of the pixels, from 1 */
    int width_px, height_px, x0_px, y0_px;
    uint bounce;  /* surfaces that the rays have met */
    uint is_last; /* no ray leaves the surfaces that they meet */
    uint is_sure; /* rays go on only from what lacks nothing */
    uint again;   /* no light is added, and nothing is counted */
    uint num_lamps;
    uint from_starts; /* rays leave where light is looked for: lamps through clear matter are not part of it */
} karst_clear_path_task;
K_ASSERT_SIZE(karst_clear_path_task, 72);

#endif
