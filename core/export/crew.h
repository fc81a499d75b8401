/* Work in many equal parts, shared among threads with a sampler each. */
#ifndef KARST_EXPORT_CREW_H
#define KARST_EXPORT_CREW_H

#include <stdbool.h>
#include <stddef.h>

#include "karst/query.h"

/* Calls `work` for ranges that make up 0 to num - 1, on several threads at once, each with a sampler of its own that
 * has the configuration's edits. Progress is told meanwhile. Errors: KARST_FAILED, KARST_USAGE of edits. */
bool karst_crew_run(const karst_world *world, const karst_query_config *config, size_t num,
                    void (*work)(void *user, karst_sampler *sampler, size_t first, size_t end), void *user,
                    karst_error *error);

#endif
