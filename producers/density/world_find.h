/* Opening a world by what users call it: a name or a path, with parameters. */
#ifndef KARST_LANGUAGE_WORLD_FIND_H
#define KARST_LANGUAGE_WORLD_FIND_H

#include <limits.h>

#include "karst/world.h"
#include "producers/density/world_file.h"

/* Finds the world's file, whose path goes to `path`, and compiles it; what there is to say of its text goes to the
 * configuration's log, line by line. Destroy with karst_world_file_destroy. Errors: KARST_USAGE (no name),
 * KARST_BAD_WORLD (unknown: the message lists those that there are; or it does not compile), KARST_FAILED. */
karst_world_file *karst_world_find(const karst_world_config *config, char path[PATH_MAX], karst_error *error);

#endif
