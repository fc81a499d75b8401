/* Light that media scatter often, as kernels and host see it: raycast/media/fluence.h. Compiled twice: see
 * core/device/dialect.h. */
#ifndef KARST_RAYCAST_MEDIA_FLUENCE_SHARED_H
#define KARST_RAYCAST_MEDIA_FLUENCE_SHARED_H

#include "core/device/dialect.h"

/* There are two grids: of all of a medium, and of what of it is near, if that has finer cells. The second one's arrays
 * lie behind the first one's. */
#define KARST_FLUENCE_GRIDS 2
/* How much farther the first one reaches. */
#define KARST_FLUENCE_FARTHER 8
/* A box is cut into cubes, cells, of so many at most; whole blocks of them on each side. */
#define KARST_FLUENCE_MOST_CELLS (1u << 18)
#define KARST_FLUENCE_BLOCK 4
/* What a packet starts with, of its strongest colour, in quanta of energy. Below an eighth of that chance decides. */
#define KARST_FLUENCE_WHOLE (1u << 20)
/* Of a cell: the sums of red, green, blue, and, where the phase has a direction, of x, y, z: 64 bits each. */
#define KARST_FLUENCE_WORDS 6
#define KARST_FLUENCE_PHASE_WORDS 12
/* Packets that a work-item follows. */
#define KARST_FLUENCE_RUN 64u
/* An optical depth of at least so much across a cell is taken where there is any medium, so that packets are noted
 * often; and of at most so much: what is thicker lets as little through, and takes longer. */
#define KARST_FLUENCE_LEAST_DEPTH 0.5f
#define KARST_FLUENCE_MOST_DEPTH 8.0f

/* What is known of land in a cell: which middles of its eighths lie outside; and the share of those that the sun comes
 * to, from 0 to KARST_FLUENCE_ALL_OPEN. */
#define KARST_FLUENCE_OUTSIDE 255
#define KARST_FLUENCE_OPEN_SHIFT 8
#define KARST_FLUENCE_ALL_OPEN 256

/* Where cells lie: cell (i, j, k) is number i + size[0] * (j + size[1] * k). */
typedef struct {
    int size[3];     /* in cells; multiples of KARST_FLUENCE_BLOCK; all 0: there is no medium */
    float cell;      /* the side of one, in level-0 voxels: a power of two */
    float corner[4]; /* from the anchor of who looks, in level-0 voxels; [3] is unused */
    float from[4], to[4]; /* what of the medium was looked at, likewise: beyond, the grid knows nothing of it */
} karst_fluence_box;
K_ASSERT_SIZE(karst_fluence_box, 64);

typedef struct {
    karst_fluence_box grids[KARST_FLUENCE_GRIDS];
} karst_fluence_boxes;
K_ASSERT_SIZE(karst_fluence_boxes, 128);

/* Packets of light: those below num_sun come from the sun, the others from all around. */
typedef struct {
    uint first, end, num_sun; /* the packets of a launch, from 0 */
    float around;             /* quanta in a unit of radiance from around */
    int sun[3];               /* quanta that a packet of the sun starts with */
    uint has_land;            /* it hides the sun where cells are not open */
    float faces[3];           /* shares of the sun's light that enters by faces across x, y, z */
    int last_face;            /* the last of them that has any */
    uint grid;                /* which is traced */
    uint pad[3];
} karst_fluence_task;
K_ASSERT_SIZE(karst_fluence_task, 64);

/* Where energy went, in quanta of all colours, 64 bits each: given + won = escaped + absorbed + shaded + lost + cut. */
#define KARST_FLUENCE_GIVEN 0
#define KARST_FLUENCE_ESCAPED 1
#define KARST_FLUENCE_ABSORBED 2
#define KARST_FLUENCE_SHADED 3 /* land hides the sun */
#define KARST_FLUENCE_WON 4    /* weak packets that chance kept, twice as strong */
#define KARST_FLUENCE_LOST 5   /* and ended */
#define KARST_FLUENCE_CUT 6    /* they were followed too long */
#define KARST_FLUENCE_SUMS 7

/* What was found of the medium: the least and the most cell that has any, on each axis; and how many rays lacked
 * something. */
#define KARST_FLUENCE_LEAST 0
#define KARST_FLUENCE_MOST 3
#define KARST_FLUENCE_MISSING 6
#define KARST_FLUENCE_FOUND 7

#endif
