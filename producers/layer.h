/* The table of layers: content that is combined with the world's density where it lies, in the scene's order.
 *
 * A layer takes part at two points of production (producers/producer.h), and both know nothing of its kind: what bounds
 * say of a node, before that becomes a verdict, and a brick's samples, between evaluate and finalise. Scenes without
 * layers run none of this. A layer belongs to one context, and is not thread-safe. */
#ifndef KARST_PRODUCERS_LAYER_H
#define KARST_PRODUCERS_LAYER_H

#include "cache/cache.h"

typedef struct karst_layer karst_layer;

/* Where layers put the colours of a chunk of loads: the second channel, beside the samples in staging memory. */
typedef struct {
    karst_buffer *planes;   /* float: for each load four planes of KARST_BRICK_PADDED, in the order of its samples: red,
                             * green and blue (linear), each times coverage, and coverage, 0 to 1 */
    karst_buffer *coloured; /* uint for each load, 0 before the first layer: 1 once one has a colour there. Until then
                             * its planes mean nothing: who sets it zeroes them first */
} karst_layer_colours;

/* What each kind of layer fills in. `self` is the layer. The first three enqueue on the context's queue and return at
 * once. Errors: KARST_FAILED. */
typedef struct {
    const char *kind; /* "edits" */
    /* After subdivide: corrects the states of the new tiles' nodes. AIR and SOLID stay only where the layer proves that
     * they hold with it, at every footprint from 0 to the parent's voxel; LOST may become either. */
    bool (*bound_tiles)(karst_layer *self, const karst_cache_buffers *cache, const karst_work *work,
                        karst_error *error);
    /* Before evaluate: the same for loads[0 ... count - 1] (karst_load), UNKNOWN in place of LOST. Where the layer
     * changes samples by steps that slopes say nothing of, doubt becomes infinite. */
    bool (*bound_loads)(karst_layer *self, karst_buffer *loads, uint32_t count, karst_error *error);
    /* After evaluate: changes the samples of the loads that are UNKNOWN, stride_floats a brick, and lays its own
     * colours over those of the layers before it. A sample's value depends on its place and level alone, whichever
     * brick asks, and so does its colour; values do not depend on whether there are colours. `colours` NULL: nothing
     * in the scene has any. */
    bool (*evaluate)(karst_layer *self, karst_buffer *loads, uint32_t count, karst_buffer *staging,
                     uint32_t stride_floats, const karst_layer_colours *colours, karst_error *error);
    /* Where content changed since the last call: boxes that live until the layer changes again; how many. */
    size_t (*take_dirty)(karst_layer *self, const karst_drop_box **boxes);
    /* What it keeps agrees with itself: for tests. */
    bool (*check)(karst_layer *self, karst_error *error);
    void (*destroy)(karst_layer *self);
} karst_layer_ops;

struct karst_layer {
    const karst_layer_ops *ops;
    uint64_t version; /* changes with the content */
};

#endif
