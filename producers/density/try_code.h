/* Generated code before a device's compiler, without its kernels: whether it is accepted. That takes a tenth of the
 * time. */
#ifndef KARST_DENSITY_TRY_CODE_H
#define KARST_DENSITY_TRY_CODE_H

#include "producers/density/world_file.h"

/* `source` is what "world.clh" is to be, built with these options (NULL: none). Errors: KARST_FAILED with the first
 * lines of what the compiler says. */
bool karst_try_code(karst_context *context, const char *source, const char *options, karst_error *error);
/* All code of a world: its density and bounds, its colours, and, if `gradient` is not NULL, density and gradient (of
 * karst_derive; laying it out takes room in its arena). Errors: KARST_FAILED. */
bool karst_try_world(karst_context *context, const karst_world_file *file, const karst_resolved_world *gradient,
                     karst_error *error);

#endif
