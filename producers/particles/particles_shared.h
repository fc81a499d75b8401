/* Particles as devices read them. Compiled twice: see core/device/dialect.h.
 *
 * Lengths are level-0 voxels, places are from the list's origin, and nothing lies farther from there than
 * PARTICLES_MOST_VOXELS: floats then tell places apart to a sixteenth of a voxel. */
#ifndef KARST_PRODUCERS_PARTICLES_SHARED_H
#define KARST_PRODUCERS_PARTICLES_SHARED_H

#include "core/device/dialect.h"

#define PARTICLES_MOST_VOXELS 1048576.0f

/* What several have in one place. */
#define PARTICLES_UNION 0u /* the largest extinction among them: overlap counts once */
#define PARTICLES_SUM 1u   /* each is a soft ball, extinction times (1 - (d/r)^2)^2, and these add up */

typedef struct {
    float at[3];
    float radius;
    float extinction; /* per metre; of a sum, at the centre */
    float share;      /* extinction times voxels^3 that it adds to what those before it have: see particle_list.c */
    uint kind;
    uint pad;
} karst_particle;
K_ASSERT_SIZE(karst_particle, 32);

/* The hull of eight particles that follow one another, or of eight such nodes; a little too large. */
#define PARTICLES_FAN 8u
#define PARTICLES_MAX_TREE 8
typedef struct {
    float min[3], max[3];
} karst_particle_node;
K_ASSERT_SIZE(karst_particle_node, 24);

typedef struct {
    long origin[3];       /* a level-0 voxel */
    uint num, num_levels; /* levels of nodes; level 0 has the leaves' */
    uint counts[PARTICLES_MAX_TREE];
    ulong particles, nodes[PARTICLES_MAX_TREE]; /* offsets in 64-bit words from the buffer's begin */
} karst_particles_head;
K_ASSERT_SIZE(karst_particles_head, 136);

/* Balls of fewer voxels than that are too small for samples to meet: they are shared out among the samples around. */
#define PARTICLES_LEAST_RADIUS 0.75f
/* So many voxels of its level beyond a particle samples change: half a diagonal and a soft edge of balls, a voxel on
 * each axis of those that are shared out. */
#define PARTICLES_REACH 1.75f

#endif
