/* All kernels of the cache as one program: one compilation instead of five. */
#include "cache/survey.cl"
#include "cache/wants.cl"
#include "cache/lru.cl"
#include "cache/evict.cl"
#include "cache/publish.cl"
