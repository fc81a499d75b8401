/* Files that a file names: they are looked for from its own folder on. */
#ifndef KARST_CORE_BESIDE_H
#define KARST_CORE_BESIDE_H

#include <stdbool.h>

#include "karst/error.h"

#define KARST_BESIDE_BYTES 4096

/* The path of `name`, as the file at `file` has it: absolute as it is, else from that file's folder on. Nothing is
 * opened. Errors: KARST_BAD_DATA (empty, or longer than KARST_BESIDE_BYTES with its folder). Thread-safe. */
bool karst_path_beside(const char *file, const char *name, char path[KARST_BESIDE_BYTES], karst_error *error);

#endif
