/* The first solid along one ray. */
#ifndef KARST_REFERENCE_TRACE_H
#define KARST_REFERENCE_TRACE_H

#include "karst/reference.h"
#include "reference/range.h"

/* A ray from the anchor. Lengths in level-0 voxels. */
typedef struct {
    double direction[3];
    double t_min, t_max;
    float lod_scale;        /* level l > 0 begins at 2^l * lod_scale, as in raycast/cast/walk.clh; 0: full density */
    float blend;            /* the last share of each level in which it turns into the next: as karst_cast_view.blend */
    uint32_t max_intervals; /* before the ray is given up */
} karst_reference_ray;

typedef struct {
    karst_reference_kind kind;
    double t;      /* of a miss: t_max */
    int level;     /* the finer of two that blend */
    double weight; /* of the next one there */
    uint64_t num_intervals, num_grazes;
} karst_reference_root;

karst_reference_root karst_reference_first(karst_ranger *ranger, const karst_position *anchor,
                                           const karst_reference_ray *ray);

#endif
