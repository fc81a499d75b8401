/* Loads in one kernel: samples of a density program, brick by brick, and what becomes of them. For KARST_SHAPE_ROWS. */
#ifndef KARST_PRODUCERS_LOAD_H
#define KARST_PRODUCERS_LOAD_H

#include "cache/cache.h"
#include "producers/channels.h"
#include "producers/steps/load_shared.h"

typedef struct karst_loader karst_loader;

/* What it leaves behind of the loads of a launch, one for each. */
typedef struct {
    karst_buffer *loads;  /* karst_load; doubt is not known */
    karst_buffer *least;  /* float: the least |d| of a load that has no surface and of which nothing was scrubbed, so
                             that it may be constant (karst_bound_clear_loads); negative for others */
    karst_buffer *scrubs; /* karst_scrub */
    karst_buffer *total;  /* one karst_scrub_total: their sum so far */
} karst_load_books;

/* Builds the kernel around the density program `world` ("world.clh"), with its `options`, for bricks laid out as
 * `layout` says. Errors: KARST_FAILED. */
karst_loader *karst_loader_create(karst_context *context, const karst_channel_layout *layout,
                                  const karst_virtual_file *world, const char *options, karst_error *error);
void karst_loader_destroy(karst_loader *loader); /* NULL is fine */
/* Makes one of a fork (karst_context_fork) one of the context that was forked. */
void karst_loader_move(karst_loader *loader, karst_context *context);

/* What a program with data reads (producers/steps/density.clh); borrowed until another is set. NULL, as at first:
 * nothing. */
void karst_loader_set_data(karst_loader *loader, const karst_buffer *data);

/* Enqueues loads [first, first + count) of the work: evaluates and finalises them; none is taken for constant yet.
 * Samples that are not finite are scrubbed to air. `books` are of `count` loads at least. With
 * count 0 the kernel runs and does nothing, for drivers that compile it then. Time goes to KARST_STAGE_EVALUATE. */
bool karst_load_bricks(karst_loader *loader, const karst_cache_buffers *cache, const karst_work *work, uint32_t first,
                       uint32_t count, const karst_load_books *books, karst_error *error);

#endif
