/* Colours on their way from layers into bricks. Knows nothing of either. */
#ifndef KARST_PRODUCERS_COLOURS_H
#define KARST_PRODUCERS_COLOURS_H

#include "cache/cache.h"
#include "cache/colours.h"
#include "producers/layer.h"
#include "producers/steps/shape.h"

typedef struct karst_colour_step karst_colour_step;

/* For chunks of max_chunk loads, whose colours go to `to`, which is borrowed. Errors: KARST_FAILED. */
karst_colour_step *karst_colour_step_create(karst_context *context, karst_shape shape, const karst_colours *to,
                                            uint32_t max_chunk, karst_error *error);
void karst_colour_step_destroy(karst_colour_step *step); /* NULL is fine */

/* Before the layers evaluate `count` loads: none has colours. Where layers put them. Errors (NULL): KARST_FAILED. */
const karst_layer_colours *karst_colour_step_begin(karst_colour_step *step, uint32_t count, karst_error *error);
/* After finalise: packs the colours of the loads [first, first + count) that became bricks into their slots; slots of
 * loads without any have none. Time goes to KARST_STAGE_FINALISE. Errors: KARST_FAILED. */
bool karst_colour_step_end(karst_colour_step *step, const karst_work *work, uint32_t first, uint32_t count,
                           karst_error *error);

#endif
