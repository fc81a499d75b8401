/* Opening the world of a configuration, for all that the reference draws. */
#ifndef KARST_REFERENCE_OPEN_H
#define KARST_REFERENCE_OPEN_H

#include "karst/reference.h"
#include "producers/density/world_file.h"

/* With the configuration's parameters; the caller destroys it. NULL on errors: KARST_BAD_WORLD, KARST_USAGE,
 * KARST_FAILED. */
karst_world_file *karst_reference_open(const karst_reference_config *config, karst_error *error);

#endif
