/* Files that come with Karst, worlds and camera paths: where they lie. */
#ifndef KARST_DATA_H
#define KARST_DATA_H

#include <stdbool.h>
#include <stddef.h>

#include "karst/error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Such a file is KIND/NAME+suffix, KIND being "worlds" (suffix ".karst") or "paths" (".json"), in one of these folders,
 * looked at in this order:
 *
 *   1. the environment variable KARST_DATA_DIR, if it is set and not empty;
 *   2. going up from where the shared library lies, then from where the program lies: share/karst, as an installation
 *      has it, and demos, as the source tree has it;
 *   3. share/karst of the PREFIX that the library was built for.
 *
 * Thread-safe as long as nobody changes the environment meanwhile. */

/* Writes the path of `name` into `path`, with its 0. What holds a '/' or ends in `suffix` is a path already, and is
 * copied whether or not such a file exists. Errors: KARST_BAD_DATA (there is none), KARST_USAGE (it does not fit in
 * size_bytes; PATH_MAX always suffices for names). */
bool karst_data_find(const char *kind, const char *name, const char *suffix, char *path, size_t size_bytes,
                     karst_error *error);

/* Bytes that a listed name takes, with its 0. */
#define KARST_DATA_NAME_BYTES 48
/* Names without suffix of all files of a kind that karst_data_find would find, in order, each once; files with longer
 * names are left out. Writes at most max_names of them and returns how many. */
size_t karst_data_list(const char *kind, const char *suffix, char names[][KARST_DATA_NAME_BYTES], size_t max_names);

#ifdef __cplusplus
}
#endif
#endif
