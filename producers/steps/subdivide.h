/* Subdivide: tiles for nodes, with the bounds of their children; and the bounds of loads. */
#ifndef KARST_PRODUCERS_SUBDIVIDE_H
#define KARST_PRODUCERS_SUBDIVIDE_H

#include "cache/cache.h"
#include "producers/steps/load_shared.h"
#include "producers/steps/shape.h"

typedef struct karst_subdivider karst_subdivider;

/* Builds the kernels around the density program `world` ("world.clh"), with its `options`. Errors: KARST_FAILED. */
karst_subdivider *karst_subdivider_create(karst_context *context, const karst_virtual_file *world, const char *options,
                                          karst_error *error);
void karst_subdivider_destroy(karst_subdivider *subdivider); /* NULL is fine */
/* Makes one of a fork (karst_context_fork) one of the context that was forked. */
void karst_subdivider_move(karst_subdivider *subdivider, karst_context *context);

/* What a program with data reads (producers/steps/density.clh); borrowed until another is set. NULL, as at first:
 * nothing. */
void karst_subdivider_set_data(karst_subdivider *subdivider, const karst_buffer *data);

/* Enqueues the tiles of work->subdivide_nodes: level, corner and eight nodes each. Time goes to KARST_STAGE_SUBDIVIDE.
 */
bool karst_subdivide_tiles(karst_subdivider *subdivider, const karst_cache_buffers *cache, const karst_work *work,
                           karst_error *error);
/* Enqueues the karst_load of work->load_nodes [first, first + count) into loads[0 ...]. Time goes to
 * KARST_STAGE_EVALUATE. */
bool karst_bound_loads(karst_subdivider *subdivider, const karst_cache_buffers *cache, const karst_work *work,
                       uint32_t first, uint32_t count, karst_buffer *loads, karst_error *error);
/* Enqueues the proofs for loads [first, first + count) that were made in one (load.h) and came out clear: results of
 * those that are constant become so. `least` is theirs from index 0 on. Time goes to KARST_STAGE_EVALUATE. */
bool karst_bound_clear_loads(karst_subdivider *subdivider, const karst_cache_buffers *cache, const karst_work *work,
                             uint32_t first, uint32_t count, const karst_buffer *least, karst_error *error);

#endif
