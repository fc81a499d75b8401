/* What a program does about its OpenCL driver before it opens a device, and when it ends.
 *
 * PoCL keeps compiled kernels on disk, and ends the program where it cannot write there or where a file there is
 * damaged. A program that calls karst_driver_begin has a driver's store of Karst's own, beside its store of programs:
 * in $KARST_CACHE_DIR/driver, $XDG_CACHE_HOME/karst/driver or ~/.cache/karst/driver. Where none of these can be
 * written, or the disk is full, it is a folder for this user alone in $TMPDIR, /tmp, /var/tmp or /dev/shm. Who has set
 * POCL_CACHE_DIR has that folder used, as long as it can be written.
 *
 * A marker in the folder says that a run has begun and not ended. A run that finds the marker of a dead one leaves that
 * folder alone and goes on in a new, empty one in or beside it ("karst-2" after "karst-1"), as the driver may have died
 * of what lies there.
 *
 * It is opt-in, since it sets the environment variable POCL_CACHE_DIR. Other drivers than PoCL do not look at that. */
#ifndef KARST_DRIVER_H
#define KARST_DRIVER_H

#include <stdbool.h>
#include <stddef.h>

#include "karst/log.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Before any other thread and any other call that opens or lists devices. Warns in `log` where another folder than the
 * usual one is used, and where a damaged one was set aside. Does nothing the second time. A helper process
 * (karst/helper.h) has its folder from its parent and does not call this. */
void karst_driver_begin(const karst_log *log);
/* The run is over, well or by a wish to end, or it has drawn what it is going to draw: what happens from now on is not
 * the fault of the driver's store. Does nothing after a call of the driver failed in a way that a damaged store
 * explains. Async-signal-safe; may be called again. */
void karst_driver_end(void);
/* Whether a call of the driver failed so, in this process. */
bool karst_driver_is_suspect(void);

#ifdef __cplusplus
}
#endif
#endif
