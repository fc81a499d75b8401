/* Launching the kernels that make streams without gaps: raycast/light/scan.clh. */
#ifndef KARST_RAYCAST_SCAN_H
#define KARST_RAYCAST_SCAN_H

#include "core/device/context.h"
#include "raycast/light/scan_shared.h"

/* Rays in a block that has `rays` of them with 16 lanes. */
static inline uint32_t karst_scan_block(const karst_context *context, uint32_t rays)
{
    return KARST_SCAN_BLOCK(context->lanes, rays);
}

/* Launches a kernel that scans, whose arguments are set: one group. */
static inline bool karst_launch_scan(karst_context *context, cl_kernel kernel, karst_error *error)
{
    const size_t items = KARST_SCAN_ITEMS(context->lanes);
    return karst_launch(context, kernel, KARST_STAGE_SHADE, items, items, error);
}

#endif
