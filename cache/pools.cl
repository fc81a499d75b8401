/* All kernels of the cache as one program: one compilation instead of four. */
#include "cache/wants.cl"
#include "cache/lru.cl"
#include "cache/evict.cl"
#include "cache/publish.cl"
