/* Files that are written in parts, and appear whole or not at all. */
#ifndef KARST_EXPORT_OUT_FILE_H
#define KARST_EXPORT_OUT_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "karst/error.h"

/* A file without a name in the folder of `path`: it is gone with the process. NULL and errno. */
FILE *karst_out_part(const char *path);
/* The same for what is written from its beginning to its end, then read: it stays in memory while it is short. */
FILE *karst_out_short_part(const char *path);

/* Writes the header, then what the parts hold, to a new file beside `path`, which then takes its place. A device or
 * pipe is written to directly. `progress` (may be NULL): false stops. Errors: KARST_FAILED naming the path; nothing is
 * left behind. */
bool karst_out_assemble(const char *path, const void *header, size_t header_bytes, FILE *const *parts, int num_parts,
                        bool (*progress)(void *user), void *user, karst_error *error);

#endif
