/* Blocks of rays, and the work-items of a scan, by the lanes of a device: raycast/light/scan.clh. */
#ifndef KARST_RAYCAST_SCAN_SHARED_H
#define KARST_RAYCAST_SCAN_SHARED_H

#include "core/device/dialect.h"

/* Rays in a block that has `rays` of them with 16 lanes. */
#define KARST_SCAN_BLOCK(lanes, rays) ((lanes) == 1 ? 1u : (rays))
/* Work-items of the one group that scans. */
#define KARST_SCAN_ITEMS(lanes) ((lanes) == 1 ? 256u : 1u)

#endif
