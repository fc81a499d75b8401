#include "core/export/index_map.h"

#include <stdlib.h>
#include <string.h>

#define NOTHING UINT64_MAX
enum { FIRST_SIZE = 1024 };

static size_t slot_of(const karst_index_map *map, uint64_t key)
{
    uint64_t hash = key * 0x9e3779b97f4a7c15u;
    size_t slot = (size_t)(hash ^ hash >> 32) & (map->size - 1);
    while (map->keys[slot] != NOTHING && map->keys[slot] != key)
        slot = (slot + 1) & (map->size - 1);
    return slot;
}

static bool grow(karst_index_map *map)
{
    karst_index_map larger = {.size = map->size ? 2 * map->size : FIRST_SIZE};
    larger.keys = malloc(larger.size * sizeof *larger.keys);
    larger.values = malloc(larger.size * sizeof *larger.values);
    if (!larger.keys || !larger.values) {
        karst_index_map_finish(&larger);
        return false;
    }
    karst_index_map_clear(&larger);
    for (size_t i = 0; i < map->size; i++)
        if (map->keys[i] != NOTHING)
            karst_index_map_add(&larger, map->keys[i], map->values[i]);
    karst_index_map_finish(map);
    *map = larger;
    return true;
}

bool karst_index_map_add(karst_index_map *map, uint64_t key, uint32_t value)
{
    if (2 * map->num >= map->size && !grow(map))
        return false;
    const size_t slot = slot_of(map, key);
    if (map->keys[slot] == key)
        return true;
    map->keys[slot] = key;
    map->values[slot] = value;
    map->num++;
    return true;
}

const uint32_t *karst_index_map_find(const karst_index_map *map, uint64_t key)
{
    if (!map->size)
        return NULL;
    const size_t slot = slot_of(map, key);
    return map->keys[slot] == key ? &map->values[slot] : NULL;
}

void karst_index_map_clear(karst_index_map *map)
{
    if (map->size)
        memset(map->keys, 0xff, map->size * sizeof *map->keys);
    map->num = 0;
}

void karst_index_map_finish(karst_index_map *map)
{
    free(map->keys);
    free(map->values);
    *map = (karst_index_map){0};
}
