/* Single paths of light through a medium, backwards. */
#ifndef KARST_REFERENCE_SCATTER_PATH_H
#define KARST_REFERENCE_SCATTER_PATH_H

#include "karst/reference.h"
#include "producers/language/oracle/oracle.h"
#include "reference/scatter_tree.h"

/* What all paths share. */
typedef struct {
    const karst_scatter_tree *tree;
    const karst_reference_light *light;
    double voxel_m;
    double to_sun[3], sun_colour[3]; /* what a white surface across the sun's rays would show */
    double sky[3], ground[3]; /* around_of_world: from straight above, and from straight below */
    bool has_emission;
} karst_scatter_scene;

/* Of one thread. */
typedef struct {
    const karst_scatter_scene *scene;
    karst_sampler *sampler; /* of the extinction */
    karst_oracle *oracle;   /* of albedo, g and emission */
    uint64_t random;        /* state */
    uint64_t num_lookups, num_collisions;
    double exceeded; /* an extinction above its bound; 0: there was none */
} karst_scatter_walker;

/* Follows path number `path` of a pixel from a place, in level-0 voxels from the tree's corner; adds what it brings to
 * rgb. The direction has length 1. */
void karst_scatter_path(karst_scatter_walker *walker, uint64_t pixel, uint64_t path, const double from[3],
                        const double direction[3], double rgb[3]);

#endif
