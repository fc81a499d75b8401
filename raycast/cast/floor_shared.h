/* Sizes of the floor kernel's data. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_RAYCAST_FLOOR_SHARED_H
#define KARST_RAYCAST_FLOOR_SHARED_H

#include "cache/layout_shared.h"

#define KARST_FLOOR_READS 8
#define KARST_FLOOR_TABLE 65536 /* node words: 256 KiB */
#define KARST_FLOOR_BRICKS 256  /* 2.5 MB */

#endif
