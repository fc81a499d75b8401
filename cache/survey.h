/* Survey: one look at all stamps for a round. It counts what is in use, lists the request chunks with a want, and finds
 * the slots that were not used for a given number of casts.
 *
 * (Stream compaction for LRU: C. Crassin, "GigaVoxels", 2011, section 7.3. Karst keeps no list between rounds: all
 * stamps are read anyway to count what is in use, and only the oldest slots are put in order, on the host.) */
#ifndef KARST_CACHE_SURVEY_H
#define KARST_CACHE_SURVEY_H

#include "cache/buffers.h"
#include "cache/mapped.h"
#include "cache/scan.h"
#include "cache/shape.h"
#include "cache/survey_shared.h"

/* What was found of tiles or bricks. */
typedef struct {
    karst_survey_slot *slots; /* ascending; valid after karst_survey_read_found */
    uint32_t num, num_read;   /* num_read: brought along before it was known how many there are */
    bool valid;               /* looked for in this round, as... */
    bool stand_ins;           /* ...bricks that are only in use as stand-ins, or as what is not in use */
    uint32_t age;             /* of so many casts or more; 1, and none left out: there are no others */
    uint32_t num_left_out;    /* of exactly that age, the last ones */
} karst_survey_list;

typedef struct {
    karst_context *context;
    karst_pass_shape shape;
    const karst_cache_buffers *pools; /* borrowed */
    uint32_t num_slots[2]; /* that are looked at: of tiles none, where another store's survey does that */
    uint32_t num_request_chunks;
    cl_kernel look, pack;
    karst_buffer *counts;                    /* uint4 for each chunk */
    karst_buffer *result;                    /* karst_survey_result */
    karst_buffer *active;                    /* uint: request chunks with a want, ascending */
    karst_buffer *found[2];                  /* karst_survey_slot[num_tiles], [num_bricks]: ascending slots */
    karst_buffer *pieces[2], *active_pieces; /* the same, where each chunk's look put them */
    karst_survey_list lists[2];
    const karst_scan *scan; /* of a survey by the host... */
    uint32_t *host_active;  /* ...and its request chunks with a want, ascending */
    /* Of the last survey. */
    karst_survey_ask ask;
    karst_survey_result host_result;
} karst_survey;

/* Errors: KARST_FAILED. karst_survey_finish takes what a failed init left, or zeros. */
bool karst_survey_init(karst_survey *survey, karst_context *context, const karst_cache_buffers *pools, bool has_tiles,
                       karst_error *error);
/* Of cache/collect.cl, before karst_survey_begin; a survey by the host does without. Errors: KARST_FAILED. */
bool karst_survey_take_kernels(karst_survey *survey, karst_program *program, karst_error *error);
void karst_survey_finish(karst_survey *survey);

/* Starts a survey: of `ask` serial, ages, most and stand_ins count. Returns at once. A list that is not asked for
 * stays as it is. */
bool karst_survey_begin(karst_survey *survey, const karst_survey_ask *ask, karst_error *error);
/* Waits for it: host_result and the lists' numbers are valid. */
bool karst_survey_end(karst_survey *survey, karst_error *error);
/* Both at once, by the host, where the pools are mapped. */
void karst_survey_by_host(karst_survey *survey, const karst_survey_ask *ask, const karst_mapped *mapped);
/* Sees to it that a list's slots are here. May wait. */
bool karst_survey_read_found(karst_survey *survey, uint32_t kind, karst_error *error);

#endif
