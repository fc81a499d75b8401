/* Who fills the stores of a cache (cache/cache.h): each has a producer that evaluates its content, and bounds it. */
#ifndef KARST_PRODUCERS_STORES_H
#define KARST_PRODUCERS_STORES_H

#include "producers/producer.h"

/* A store's content. Its verdicts are air where the producer's density is proved to be at most 0, and solid where it is
 * proved to be positive, whatever that means to the store: matter, or that a medium is there. */
typedef struct {
    karst_store *store;       /* borrowed */
    karst_producer *producer; /* borrowed; its finalise kernels are built for the store's brick_bits
                                 (karst_cache_brick_option) */
} karst_store_source;

/* Answers the work of a round of `asking`: every source bounds its tiles in its own store, and the one of `asking`
 * loads the bricks. Enqueues and returns at once. Errors: KARST_FAILED; KARST_USAGE (no source is of that store). */
bool karst_stores_answer(const karst_store_source *sources, size_t num_sources, const karst_store *asking,
                         const karst_work *work, karst_error *error);

#endif
