/* Finalise: constant or not, by proof; 16-bit bricks with scale, steepest slope and block mask. Knows nothing of the
 * world. */
#ifndef KARST_PRODUCERS_FINALISE_H
#define KARST_PRODUCERS_FINALISE_H

#include "cache/cache.h"
#include "producers/channels.h"
#include "producers/steps/load_shared.h"
#include "producers/steps/shape.h"

typedef struct karst_finaliser karst_finaliser;

/* Builds the kernels for bricks laid out as `layout` says. `options` (may be "") are added. Errors: KARST_FAILED. */
karst_finaliser *karst_finaliser_create(karst_context *context, karst_shape shape, const karst_channel_layout *layout,
                                        const char *options, karst_error *error);
void karst_finaliser_destroy(karst_finaliser *finaliser); /* NULL is fine */
/* Makes one of a fork (karst_context_fork) one of the context that was forked. */
void karst_finaliser_move(karst_finaliser *finaliser, karst_context *context);

/* Enqueues loads [first, first + count) of the work: `loads` and `staging` hold theirs from index 0 on. Samples that
 * are not finite are scrubbed to air; `scrubs` (karst_scrub) takes how many of each load, `total` (one
 * karst_scrub_total) their sum so far. Time goes to KARST_STAGE_FINALISE. */
bool karst_finalise_bricks(karst_finaliser *finaliser, const karst_cache_buffers *cache, const karst_work *work,
                           uint32_t first, uint32_t count, karst_buffer *loads, karst_buffer *staging,
                           karst_buffer *scrubs, karst_buffer *total, karst_error *error);

#endif
