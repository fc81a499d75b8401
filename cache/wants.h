/* Wants: what rays asked for, read from their stamps and put in order.
 *
 * The cost follows the wants: only request chunks in which a ray stored one are read. However many there are, memory is
 * bounded: the list is made and read in pieces, and of each only the best are kept. */
#ifndef KARST_CACHE_WANTS_H
#define KARST_CACHE_WANTS_H

#include "cache/buffers.h"
#include "cache/mapped.h"
#include "cache/shape.h"
#include "cache/survey.h"
#include "cache/wants_shared.h"

/* One kind of work, best first: by class, then by node. A want that was deferred keeps its class, so that it is served
 * as soon as all before it are; its age is not kept. */
typedef struct {
    uint32_t num_all; /* valid wants */
    uint32_t num;     /* of them in the list */
    uint32_t nodes[KARST_CACHE_MAX_WORK];
    uint16_t classes[KARST_CACHE_MAX_WORK];
} karst_wants_choice;

typedef struct {
    karst_context *context;
    karst_pass_shape shape;
    const karst_cache_buffers *pools; /* borrowed */
    karst_survey *survey;             /* borrowed: names the request chunks to look at */
    karst_mapped *mapped;             /* borrowed */
    cl_kernel mark, list, accept;
    karst_buffer *marks;      /* uint2 for 32 nodes of each active chunk */
    karst_buffer *counts;     /* uint for each work-item: wants in its share */
    karst_buffer *wants;      /* karst_want[KARST_WANTS_LIST] */
    karst_buffer *identities; /* ulong for each accepted piece of work */
    karst_wants_view view;    /* of this round */
    karst_want *host_wants;
    uint32_t num_last, num_read; /* wants in the last round; read in this one before it was known how many there are */
    karst_wants_choice *loads, *subdivides, *spare;
} karst_wants;

/* Errors: KARST_FAILED. karst_wants_finish takes what a failed init left, or zeros. */
bool karst_wants_init(karst_wants *wants, karst_context *context, const karst_cache_buffers *pools,
                      karst_survey *survey, karst_mapped *mapped, karst_error *error);
/* Of cache/collect.cl, before what the device does; the host does without. Errors: KARST_FAILED. */
bool karst_wants_take_kernels(karst_wants *wants, karst_program *program, karst_error *error);
void karst_wants_finish(karst_wants *wants);

/* Starts to make a list of the wants of a serial, behind karst_survey_begin; `turn` as in karst_want_delay.
 * Returns at once. */
bool karst_wants_begin(karst_wants *wants, uint32_t serial, uint32_t turn, const int64_t camera[3], karst_error *error);
/* After karst_survey_end: chooses the best max_loads and max_subdivides of them (at most KARST_CACHE_MAX_WORK of
 * either) into wants->loads and wants->subdivides. May wait. */
bool karst_wants_choose(karst_wants *wants, uint32_t max_loads, uint32_t max_subdivides, karst_error *error);
/* Both at once, by the host where pools are mapped, after karst_survey_by_host. */
void karst_wants_choose_by_host(karst_wants *wants, uint32_t serial, uint32_t turn, const int64_t camera[3],
                                uint32_t max_loads, uint32_t max_subdivides);
/* Of what was chosen, keeps as much as fits into budget_ns, the best of both kinds together; of each at least one. */
void karst_wants_fit(karst_wants *wants, double load_ns, double subdivide_ns, double budget_ns);
/* Stamps the tiles of chosen nodes, which now stand in two buffers, as in use; names go to wants->identities, loads
 * first. */
bool karst_wants_accept(karst_wants *wants, karst_buffer *load_nodes, uint32_t num_loads, karst_buffer *subdivide_nodes,
                        uint32_t num_subdivides, uint32_t serial, karst_error *error);
/* The same by the host where pools are mapped, of what stands in wants->loads and ->subdivides; names go to
 * `identities`. */
void karst_wants_accept_mapped(const karst_wants *wants, uint32_t serial, uint64_t *identities);

/* Adds to a choice those of `more` that have the flag, keeping the best `limit`; `more` stands in the order of nodes,
 * behind all that the choice was made from before. `spare` is room for the result and trades places with it. */
void karst_wants_merge(karst_wants_choice **choice, karst_wants_choice **spare, const karst_want *more,
                       uint32_t num_more, uint32_t flag, uint32_t limit);

#endif
