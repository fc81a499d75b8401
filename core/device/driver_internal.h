/* What the library notes for karst/driver.h. Private to core. */
#ifndef KARST_CORE_DRIVER_INTERNAL_H
#define KARST_CORE_DRIVER_INTERNAL_H

#include "karst/driver.h"

/* A call of the driver failed in a way that a damaged store explains: the run's marker stays. Thread-safe. */
void karst_driver_suspect(void);

#endif
