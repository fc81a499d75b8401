/* Memory behind a pool's slots, found ahead by a thread of its own. The first touch of a page costs much (5 ms for a
 * large page on a virtual machine), and drawing leaves cores idle often enough to do that beside it. */
#ifndef KARST_CACHE_COMMIT_H
#define KARST_CACHE_COMMIT_H

#include <stdbool.h>
#include <stdint.h>

#include "cache/buffers.h"

typedef struct karst_commit karst_commit;

/* For these buffers (borrowed; they outlive it): at once for all but bricks, for those as asked. NULL: no memory or no
 * thread, and pages are found when they are touched. */
karst_commit *karst_commit_create(const karst_cache_buffers *buffers);
/* Stops at once: what is asked for and not there yet is left. */
void karst_commit_destroy(karst_commit *commit);
/* Asks for memory behind all slots below end; what was asked for stays asked for. Waits for nothing. */
void karst_commit_until(karst_commit *commit, uint32_t end);
/* Waits until all that was asked for is there (tests). Returns below which slot memory is there. */
uint32_t karst_commit_wait(karst_commit *commit);

#endif
