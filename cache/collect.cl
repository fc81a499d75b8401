/* All kernels with which a device collects as one program: one compilation instead of four. */
#include "cache/survey.cl"
#include "cache/wants.cl"
#include "cache/lru.cl"
#include "cache/evict.cl"
