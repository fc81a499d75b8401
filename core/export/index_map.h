/* Numbers by their keys: a table that grows. */
#ifndef KARST_EXPORT_INDEX_MAP_H
#define KARST_EXPORT_INDEX_MAP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Zero-initialise. Keys are not UINT64_MAX. */
typedef struct {
    uint64_t *keys;
    uint32_t *values;
    size_t num, size; /* size: a power of 2, or 0 */
} karst_index_map;

/* false: out of memory. A key that is there keeps its value. */
bool karst_index_map_add(karst_index_map *map, uint64_t key, uint32_t value);
/* NULL: it is not there. Valid until the next one is added. */
const uint32_t *karst_index_map_find(const karst_index_map *map, uint64_t key);
void karst_index_map_clear(karst_index_map *map); /* keeps its memory */
void karst_index_map_finish(karst_index_map *map);

#endif
