/* What to say where there is no device. Private to core. */
#ifndef KARST_CORE_DEVICE_MISSING_H
#define KARST_CORE_DEVICE_MISSING_H

#include "core/device/context.h"

/* Fails with KARST_NO_DEVICE: whether a driver is missing, cannot be loaded or gives no device, why, and what to do.
 * The codes are those of listing platforms and of the last listing of devices. Returns 0. */
int karst_device_missing(cl_int platforms_code, cl_int devices_code, karst_error *error);
/* Whether this process may use so much memory only, and what to do about it (else ""). */
bool karst_device_memory_limit(char text[128]);

#endif
