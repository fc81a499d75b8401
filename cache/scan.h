/* The host's look through stamps, for devices whose memory is its own: 2 MB of them in less time than a command takes
 * to be waited for. What is found is exactly what survey.cl finds. */
#ifndef KARST_CACHE_SCAN_H
#define KARST_CACHE_SCAN_H

#include <stdint.h>

#include "cache/survey_shared.h"

#define KARST_SCAN_WORD 64u /* stamps at once: a bit for each in a word */

/* What depends on the width of vectors; all widths give the same. Stamps and words are `num` words of them. */
typedef struct {
    /* Bits of the stamps that are this one. */
    void (*equal)(const uint32_t *stamps, uint32_t num, uint32_t serial, uint64_t *words);
    /* Bits of those that are so old (1 at least), or 0. */
    void (*old)(const uint32_t *stamps, uint32_t num, uint32_t serial, uint32_t age, uint64_t *words);
    uint32_t (*count)(const uint64_t *words, uint32_t num); /* of bits */
} karst_scan;

/* Width 0 is any processor's. NULL: this one has none of that number. */
#define KARST_SCAN_WIDTHS 4
const karst_scan *karst_scan_of_width(int width);
const karst_scan *karst_scan_best(void);

/* What of a kind of slots a look found. */
typedef struct {
    uint32_t num_used, num_found, num_left_out;
} karst_scan_counts;

/* Looks at slots of ask->num[kind]; a and b are both their stamps, of tiles the same ones. Those that are found go to
 * `slots`, ascending, which has room for all. */
karst_scan_counts karst_scan_slots(const karst_scan *scan, const uint32_t *a, const uint32_t *b,
                                   const karst_survey_ask *ask, uint32_t kind, karst_survey_slot *slots);
/* Lists those of `num` stamps that are this one, ascending; returns how many. */
uint32_t karst_scan_list(const karst_scan *scan, const uint32_t *stamps, uint32_t num, uint32_t serial,
                         uint32_t *listed);

#endif
