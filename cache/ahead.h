/* Recycling ahead: how many slots. Private to cache/ and its tests. */
#ifndef KARST_CACHE_AHEAD_H
#define KARST_CACHE_AHEAD_H

#include "cache/slots.h"

/* A reserve takes no more of a pool than one part in so many. */
#define KARST_AHEAD_SHARE 32u
/* Rounds that want fewer slots recycle for themselves: that takes less than another survey would. */
#define KARST_AHEAD_LEAST 128u

/* How many slots to recycle after rounds of which the largest wanted num_chosen, no fewer than `least`; num_used are in
 * use. None as long as another such round and an eighth finds its slots free; else there are to be four times as many
 * as it wanted. Of what may be recycled at most a half is: what was left just now may be looked at again. */
uint32_t karst_ahead_need(const karst_slots *slots, uint32_t num_chosen, uint32_t least, uint32_t num_used);

#endif
