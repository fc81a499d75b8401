/* Evaluate: samples of a density program, brick by brick, into staging memory. */
#ifndef KARST_PRODUCERS_EVALUATE_H
#define KARST_PRODUCERS_EVALUATE_H

#include "core/device/context.h"
#include "producers/channels.h"
#include "producers/steps/load_shared.h"
#include "producers/steps/shape.h"

typedef struct karst_evaluator karst_evaluator;

/* Builds the kernel around the density program `world` ("world.clh"), with its `options`, for bricks laid out as
 * `layout` says (borrowed). Errors: KARST_FAILED. */
karst_evaluator *karst_evaluator_create(karst_context *context, karst_shape shape, const karst_channel_layout *layout,
                                        const karst_virtual_file *world, const char *options, karst_error *error);
void karst_evaluator_destroy(karst_evaluator *evaluator); /* NULL is fine */
/* Makes one of a fork (karst_context_fork) one of the context that was forked. */
void karst_evaluator_move(karst_evaluator *evaluator, karst_context *context);

/* What a program with data reads (producers/steps/density.clh); borrowed until another is set. NULL, as at first:
 * nothing. */
void karst_evaluator_set_data(karst_evaluator *evaluator, const karst_buffer *data);

/* Enqueues the samples of loads[0 ... count - 1] (karst_load) into `staging` (floats, layout->staging_stride a brick);
 * loads proven constant are skipped. `scrubs` (karst_scrub)
 * takes how many samples of each were raised and given up. Time goes to KARST_STAGE_EVALUATE. */
bool karst_evaluate_bricks(karst_evaluator *evaluator, karst_buffer *loads, uint32_t count, karst_buffer *staging,
                           karst_buffer *scrubs, karst_error *error);

#endif
