/* Where Karst keeps what it need not make again. Private to core. */
#ifndef KARST_CORE_STORE_H
#define KARST_CORE_STORE_H

#include <stdbool.h>

/* The folder for a part of the store ("programs", "driver"), made if need be: in $KARST_CACHE_DIR, else in
 * $XDG_CACHE_HOME/karst, else in ~/.cache/karst. False (and "") if there is none: it cannot be made, or others than
 * this user may write into it. $KARST_CACHE_DIR "" or "off" is none, unless `even_if_off`: then it counts as not set.
 * Thread-safe. */
bool karst_store_folder(const char *part, bool even_if_off, char folder[1024]);
/* Whether a folder is there, is the user's own, and nobody else may write into it. */
bool karst_store_is_own(const char *folder);

#endif
