/* Usage lists: which slots of a pool are recycled, the least recently used first. The order is exactly that of (last
 * use, slot): of tiles the casts since they were walked through, of bricks since they were used, as asked for or as a
 * stand-in. It depends on the stamps of the moment and on nothing else. */
#ifndef KARST_CACHE_LRU_H
#define KARST_CACHE_LRU_H

#include "cache/buffers.h"
#include "cache/lru_shared.h"
#include "cache/mapped.h"
#include "cache/shape.h"
#include "cache/survey.h"

typedef struct {
    karst_context *context;
    karst_pass_shape shape;
    uint32_t kind;                    /* KARST_SURVEY_TILES or _BRICKS */
    const karst_cache_buffers *pools; /* borrowed */
    karst_survey *survey;             /* borrowed: finds what is old */
    karst_mapped *mapped;             /* borrowed: where pools are mapped, the host looks and nothing is launched */
    karst_buffer *victims;            /* uint[KARST_CACHE_MAX_WORK] */
    karst_buffer *freed;              /* uint[KARST_CACHE_MAX_WORK]: of tiles, the bricks that went with each */
    karst_buffer *result;             /* karst_lru_result */
    cl_kernel look, take;
    uint32_t *host_victims;   /* of a look by the host */
    uint32_t *slots;          /* what the survey found, in order */
    karst_survey_slot *spare; /* room to sort in */
    uint32_t num;             /* slots in it */
    bool sorted;              /* it is of the last survey, its oldest */
    /* A look that was started: at how many slots, and what came of it. */
    karst_lru_ask ask;
    karst_lru_result host_result;
    uint32_t least;
    bool started, again, is_last;
    bool arrived;          /* there was a wait since it was started */
    bool took_all_at_once; /* the first look of the last karst_lru_recycle found all */
    /* As in the last rounds; only what a round costs depends on these. */
    uint32_t expected_need, expected_age, expected_serial;
    uint32_t expected_misfits; /* slots that had to be passed over, for 64 that were taken */
    bool was_short, gets_older;
} karst_lru;

/* Errors: KARST_FAILED. karst_lru_finish takes what a failed init left, or zeros. */
bool karst_lru_init(karst_lru *lru, karst_context *context, uint32_t kind, const karst_cache_buffers *pools,
                    karst_survey *survey, karst_mapped *mapped, karst_error *error);
/* Of cache/collect.cl, where pools are not mapped. Errors: KARST_FAILED. */
bool karst_lru_take_kernels(karst_lru *lru, karst_program *program, karst_error *error);
void karst_lru_finish(karst_lru *lru);

/* What was found counts no longer: the next karst_lru_recycle looks anew. */
void karst_lru_forget(karst_lru *lru);

/* What a survey should find for this pool, if as much is asked for as in the last round and num_free slots are free. */
void karst_lru_expect(karst_lru *lru, uint32_t num_free, karst_survey_ask *ask);

/* What is to be launched on lru->victims; nothing is to happen to those from lru->result->num_taken on. Where pools are
 * mapped: to be done to the first `num` of lru->host_victims. */
typedef bool (*karst_lru_unlink)(void *user, uint32_t num, karst_error *error);

/* Of the slots that may be recycled (in use, not stamped with `serial`, tiles without children) the first `need`, 1 to
 * KARST_CACHE_MAX_WORK, go to `victims` in order, and `unlink` is launched on them. The root tile is never taken.
 * stand_ins: bricks that are used only as a stand-in are taken, and nothing else. Counts come to host_result; fewer
 * than `need` were taken: there are no more. */
bool karst_lru_recycle(karst_lru *lru, uint32_t serial, bool stand_ins, uint32_t need, karst_lru_unlink unlink,
                       void *user, karst_error *error);
/* Starts that and does not wait for it; the next karst_lru_recycle does. `behind`: of bricks, behind what was started
 * for tiles; bricks that go with the tiles count as taken, and nothing is taken if not all tiles were: then forget it
 * (started = false). */
bool karst_lru_start(karst_lru *lru, uint32_t serial, bool stand_ins, uint32_t need, const karst_lru *behind,
                     karst_lru_unlink unlink, void *user, karst_error *error);

#endif
