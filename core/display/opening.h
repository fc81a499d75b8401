/* Drivers opened on a thread of their own: they spend some 70 ms on loading libraries and looking at the machine, in
 * which an engine has other things to do. */
#ifndef KARST_CORE_OPENING_H
#define KARST_CORE_OPENING_H

#include "core/device/context.h"
#include "karst/display.h"

typedef struct karst_opening karst_opening;

/* Begins to list devices, and once it may go on, if `with_display`, to open a display of this kind. The thread calls
 * neither `log` nor anything else of the caller's: what there is to say is said by karst_opening_display. Errors:
 * KARST_FAILED. */
karst_opening *karst_opening_begin(bool with_display, karst_display_kind kind, const karst_log *log,
                                   karst_error *error);
/* As karst_context_list; the list is the opening's. */
const karst_device_info *karst_opening_devices(karst_opening *opening, size_t *num_devices, karst_error *error);
/* Lets the display be opened, beside whatever follows: once a device is opened, as PoCL sets LLVM up then and Mesa does
 * so, too, and only one at a time may. */
void karst_opening_go_on(karst_opening *opening);
/* Goes on, and waits. As karst_display_create, of a display that is current on no thread; the caller's from now on. */
karst_display *karst_opening_display(karst_opening *opening, karst_error *error);
/* Waits for the thread, and closes what nobody took. NULL is fine. */
void karst_opening_end(karst_opening *opening);

#endif
