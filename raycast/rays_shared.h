/* Rays, hits and the view as kernels and host see them. Compiled twice: see core/device/dialect.h.
 *
 * A stream of rays has one int64 anchor (a world position: level-0 voxel and fraction). A ray's origin is the anchor
 * plus a float offset; everything a ray touches is localised against the anchor in integers first and becomes float
 * only then. Offsets err by 2^-24 of their length, footprints are some 2^-10 of the distance travelled: so one anchor
 * serves a camera's rays and every ray that starts where one of them ended. Lengths are in *level-0 voxels* throughout
 * (floats).
 */
#ifndef KARST_RAYCAST_RAYS_SHARED_H
#define KARST_RAYCAST_RAYS_SHARED_H

#include "cache/layout_shared.h"

#define KARST_MAX_LEVELS 60

/* What a ray is to find. Rays that start on a surface say which side of matter they are on, since rounding does not:
 * such a ray hits nothing before it has been on that side. In the cell that it starts in it has been once it passed a
 * part that falls (or, of KARST_SIDE_BACK, rises) to there; from the next cell on, wherever it is there. If it comes to
 * a cell all of which lies on the other side first, it ends. So starts are told by cell and sign, not by a distance.
 *
 * Rays that only have to leave a surface, such as those to the sun, start just above it, and say how fast they rise:
 * the cosine of the angle to its normal. The roughness of what they leave does not stop them: raycast/cast/graze.clh.
 */
#define KARST_SIDE_ANY 0u   /* matter: a ray that starts in it ends at once */
#define KARST_SIDE_FRONT 1u /* from air into matter */
#define KARST_SIDE_BACK 2u  /* from matter into air */

/* One ray; arrays of it are streams. A ray with t_max <= t_min is idle and reports a miss. */
typedef struct {
    float origin[3];    /* from the stream's anchor, level-0 voxels */
    float t_min;        /* along the unit direction, level-0 voxels; 0 of rays with a side */
    float direction[3]; /* unit length */
    float t_max;
    float width; /* footprint at t = 0, level-0 voxels */
    float cone;  /* growth of the footprint per unit of t */
    uint pixel;  /* whatever the stream's maker wants back; where what rays lack is noted: KARST_RAY_X and _Y */
    uint side;   /* KARST_SIDE_* */
    float throughput[3]; /* the share of its light that reaches the pixel, of red, green and blue */
    float rise;          /* above the surface that it starts above, per unit of t; 0: it starts above none */
} karst_ray;
K_ASSERT_SIZE(karst_ray, 64);

#define KARST_HIT_MISS 0u
#define KARST_HIT_SURFACE 1u     /* at the level the footprint asks for */
#define KARST_HIT_PROVISIONAL 2u /* on a coarser brick than asked for, since that is missing */
#define KARST_HIT_SOLID 3u       /* ran into (or started in) proven solid without crossing a surface cell */
/* On discs of a model (raycast/cast/splats.h). There is no brick: `place` is their colour, square roots of red, green
 * and blue in 1023rds, and `node` is 1 if they have one, else 0. */
#define KARST_HIT_SPLAT 4u

/* Where a ray ended. `kind` KARST_HIT_MISS: t is t_max; if `incomplete` is set then the ray met a region without any
 * data. */
typedef struct {
    float t;         /* level-0 voxels along the ray */
    uint kind;       /* KARST_HIT_* in bits 0..7, level in bits 8..15, and bits 16 and on, below */
    uint brick;      /* slot of the brick (0: none) */
    uint place;      /* x | y << 10 | z << 20 in the brick, in 64ths of its cells */
    float normal[3]; /* of the field that was hit, unit length, towards the air; zeros: there is none (or no brick) */
    uint node;       /* node index of the brick's owner at the time (tile * 8 + child) */
} karst_hit;
K_ASSERT_SIZE(karst_hit, 32);

#define KARST_HIT_KIND(k) ((k)&0xffu)
#define KARST_HIT_LEVEL(k) ((k) >> 8 & 0xffu)
#define KARST_HIT_INCOMPLETE 0x10000u
#define KARST_HIT_UNBLENDED 0x20000u /* here its level blends into the next, whose brick is missing */
/* Bit 18 is that of paths (raycast/light/clear_paths_shared.h). */
#define KARST_HIT_THIN 0x80000u /* refined, on clear matter that bricks show wider than it is */
#define KARST_HIT_MISSING 0x100000u /* KARST_HIT_SOLID, where a ray ended at what is missing: nothing is proven there */
/* The cell that the place is in, on an axis. */
#define KARST_HIT_CELL(place, axis) ((place) >> (6 + 10 * (axis)) & 15u)

/* Where the anchor of a stream lies in the tree, for each level l from 0 to top_level. All exact.
 * node = floor(anchor / (KARST_BRICK_CELLS << l)) as int64 is not needed on the device: rays walk from the root tile,
 * whose corner is given relative to the anchor's own node, and double from there: child r' = 2 r - parity + bit. */
typedef struct {
    float
        in_node[3];  /* the anchor inside its own node of this level, in voxels of this level: [0, KARST_BRICK_CELLS) */
    uint parity;     /* bit a: the anchor's node coordinate on axis a is odd at this level */
    float to_end[3]; /* KARST_BRICK_CELLS - in_node: where the node is wide and its end near, the difference of floats
                        is not good enough */
    uint pad;
} karst_anchor_level;
K_ASSERT_SIZE(karst_anchor_level, 32);

typedef struct {
    karst_anchor_level levels[KARST_MAX_LEVELS];
    int root[3];      /* root tile's corner minus the anchor's node, at top_level */
    int top_level;    /* level of the root tile's nodes */
    int finest_level; /* never descend below this */
    uint serial;      /* this cast's stamp */
    float detail; /* voxels are asked to be at most `detail` footprints wide: level l holds where footprint*detail >=
                     2^l */
    float blend;  /* the last share of each level, counted in footprints, in which it turns into the next; 0: none. At
                     most 0.5 */
    float own_detail; /* hits on coarser levels than this asks for are counted; 0: none are. Rays do not look at it */
    uint stands_for;  /* rays of the picture that each of this cast's stands for */
    uint ends_at_missing; /* 1: rays end where they lack something, in place of marching what stands in for it. So all
                           * that they stamp and want, they do in every picture that lacks nothing */
    float blend_below; /* rays of a stream whose footprints, times detail, grow at least as fast do not blend levels; 0:
                        * all do */
    uint anchor_fraction[3];
    long anchor_voxel[3]; /* of level 0 */
} karst_cast_view;

/* As blend_below: such rays pass a level within a brick, and would blend over a voxel of their way. */
#define KARST_WIDE_RAYS (1.0f / KARST_BRICK_CELLS)

/* The pixel that a ray is of; the two highest bits are the maker's. */
#define KARST_RAY_X(pixel) ((pixel) & 0xffffu)
#define KARST_RAY_Y(pixel) ((pixel) >> 16 & 0x3fffu)

#endif
