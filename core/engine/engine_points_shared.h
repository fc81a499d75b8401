/* Points as karst_device_points sends them. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_CORE_ENGINE_POINTS_SHARED_H
#define KARST_CORE_ENGINE_POINTS_SHARED_H

#include "core/device/dialect.h"

/* A karst_position. */
typedef struct {
    long voxel[3];
    uint fraction[3];
    uint pad;
} karst_point_place;
K_ASSERT_SIZE(karst_point_place, 40);

#endif
