/* Paths of light and the lamps that they look for, as kernels and host see them. Compiled twice: see
 * core/device/dialect.h. */
#ifndef KARST_RAYCAST_PATHS_SHARED_H
#define KARST_RAYCAST_PATHS_SHARED_H

#include "core/device/dialect.h"

/* In karst_ray.pixel: what the ray sees of lamps that have a place in the sky is its own, since the surface that it
 * comes from did not look for them. */
#define KARST_PATH_SEES_SUN 0x80000000u
/* And: the surface that the ray comes from mirrored it. */
#define KARST_PATH_MIRRORED 0x40000000u

/* Rays of a stream that are counted together: a block of raycast/light/scan.clh. */
#define KARST_PATH_BLOCK 256u

/* Beside bit 0 of a pixel's word (karst_caster_note_lacking). */
#define KARST_PATH_LACKED_BEFORE 2u

/* What random numbers are for: with each generation's number that is another purpose of raycast/cast/jitter.clh. */
#define KARST_PATH_OF_DIRECTION 0u
#define KARST_PATH_OF_CHOICE 1u
#define KARST_PATH_OF_LAMP 2u
#define KARST_PATH_OF_PICK 3u
#define KARST_PATH_OF_GLOSS 4u
#define KARST_PATH_OF_MEDIA 5u
K_INLINE uint karst_path_purpose(uint bounce, uint what)
{
    uint h = (bounce * 8u + what + 1u) * 0x9e3779b1u ^ 0x51ed270bu;
    h ^= h >> 16;
    h *= 0x85ebca6bu;
    h ^= h >> 13;
    h *= 0xc2b2ae35u;
    return h ^ h >> 16;
}

/* What shines on surfaces beside sky and emission. */
#define KARST_LAMP_SUN 0u   /* from a disc in the sky */
#define KARST_LAMP_POINT 1u /* from a ball, all around */
#define KARST_LAMP_SPOT 2u  /* from a ball, in a cone */
#define KARST_LAMP_NORMAL 3u /* from along each surface's normal: what surfaces make of light, whatever it is */
typedef struct {
    float place[4];     /* of a point or a spot: from the anchor, level-0 voxels; [3]: the ball's radius */
    float direction[4]; /* unit; to a sun, or where a spot shines; [3]: radius of a sun's disc, as seen at distance 1 */
    float colour[4];    /* of a white surface that faces it; unless it is a sun, one voxel away. [3] unused */
    float dark, bright; /* of a spot: the cosines to its direction where its light ends, and from where it is whole */
    uint kind;          /* KARST_LAMP_* */
    uint shadow;        /* 0: its light goes through matter */
} karst_lamp;
K_ASSERT_SIZE(karst_lamp, 64);
#define KARST_MOST_LAMPS 17 /* the sun, and sixteen of a world's own */

/* Of karst_path_task.mirrors_all: and rays that are mirrored carry the share that is. */
#define KARST_PATH_SHARES 2u

/* One generation of paths. */
typedef struct {
    uint bounce;    /* surfaces that its paths have left before */
    uint is_last;   /* no ray leaves the surfaces that it meets */
    uint sample;    /* of the pixels, from 1; 0: lamps are looked for in their middle */
    uint num_lamps;
    uint mirrors;   /* 0: surfaces do not mirror, whatever they say */
    uint again;     /* 1: for stamps and wishes alone: no light is added, and nothing is counted */
    uint each_lamp; /* 1: each lamp is looked for by itself, and sky and emission are left out; 0: one of them is */
    /* With each_lamp: of the stream's packets, taken column by column where it has strips, those from this one on, and
     * so many; and packets in a strip, as of a picture, or 0. */
    uint first_packet, num_packets, strip_packets;
    uint mirrors_all; /* 1: rays are mirrored wherever a surface mirrors at all; KARST_PATH_SHARES */
    uint turn; /* of photons, how often they were turned: chance of one turn must know nothing of the one before */
    uint passes;      /* 0: surfaces let nothing pass, whatever they say */
    uint only_lacking; /* 1: of the first generation idle rays are not looked at, and no surface is counted */
} karst_path_task;
K_ASSERT_SIZE(karst_path_task, 56);
/* Where a path's ray collides with a medium, before any surface. */
typedef struct {
    float t; /* along the ray; KARST_PATH_GOES_BY: it does not */
    float throughput[3]; /* that it comes there with */
} karst_path_collision;
K_ASSERT_SIZE(karst_path_collision, 16);
#define KARST_PATH_GOES_BY 3.0e38f
/* Strips whose packets are neighbours of a stream to lamps: with as many columns they are the pixels of a beam. */
#define KARST_PATH_STRIPS 8u
/* Of a lamp by itself, less than this at a pixel is not looked for: a third of a step of its byte. */
#define KARST_LAMP_LEAST (1.0f / 8192.0f)

#endif
