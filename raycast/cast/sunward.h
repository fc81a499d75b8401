/* What bricks are to rays towards the sun: kept beside the brick pool, for shadows to be cast with less looking.
 *
 * The records say of a brick what follows from its samples and the sun's direction alone. Whoever keeps them is told of
 * all that producers write into slots. Not thread-safe. */
#ifndef KARST_RAYCAST_SUNWARD_H
#define KARST_RAYCAST_SUNWARD_H

#include "cache/cache.h"
#include "raycast/cast/sunward_shared.h"

typedef struct karst_sunward karst_sunward;

/* Builds the kernel and allocates the records: 144 bytes a slot. The buffers stay the cache's. Errors: KARST_FAILED. */
karst_sunward *karst_sunward_create(karst_context *context, const karst_cache_buffers *cache, karst_error *error);
void karst_sunward_destroy(karst_sunward *sunward); /* NULL is fine */

/* From now on the sun is there (a unit vector): if it was not, all bricks are looked at again. Asynchronous. */
bool karst_sunward_aim(karst_sunward *sunward, const float direction[3], karst_error *error);
/* A round's loads have been answered. Before the first karst_sunward_aim nothing is done. Asynchronous. */
bool karst_sunward_note(karst_sunward *sunward, const karst_work *work, karst_error *error);

bool karst_sunward_is_aimed(const karst_sunward *sunward, const float direction[3]);
/* The records, by slot; borrowed. */
const karst_buffer *karst_sunward_bricks(const karst_sunward *sunward);

#endif
