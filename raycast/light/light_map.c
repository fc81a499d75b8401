/* Making light maps, and launching their kernel. */
#include "raycast/light/light_map.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LOCAL_SIZE 64
#define MIN_BUCKETS_LOG2 8u
#define MAX_BUCKETS_LOG2 24u
#define MOST_CELLS 8 /* that a point lies in */

struct karst_light_map {
    karst_context *context;
    karst_program *program;
    cl_kernel gather;
    karst_buffer *points, *begins, *entries;
    int finest_level;
    uint32_t levels, mask;
};

static uint32_t packed_normal(const double n[3])
{
    const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    uint32_t bits = 0;
    for (int axis = 0; axis < 3; axis++)
        bits |= (uint32_t)((int)lrint(fmax(-1, fmin(1, n[axis] / length)) * 511) + 512) << 10 * axis;
    return bits;
}

static karst_light_map_record record_of(const karst_light_map_point *point)
{
    karst_light_map_record record = {.normal = packed_normal(point->normal),
                                     .radius = fmaxf((float)point->radius, 0x1p-60f)};
    for (int i = 0; i < 3; i++) {
        record.place[i] = (float)point->place[i];
        record.light[i] = (float)point->light[i];
        /* No finer than floats tell places: so cells have numbers, too. */
        record.radius = fmaxf(record.radius, 0x1p-21f * fabsf(record.place[i]));
    }
    return record;
}

static int level_of(const karst_light_map_record *record, int finest_level)
{
    const int level = karst_light_map_level(record->radius);
    return level > finest_level ? level : finest_level;
}

/* The buckets that a point lies in, each once; returns how many. */
static int buckets_of(const karst_light_map_record *record, int finest_level, uint32_t mask, uint32_t into[MOST_CELLS])
{
    const int level = level_of(record, finest_level);
    const float per = karst_light_map_power(-level);
    int low[3], high[3], num = 0;
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = (int)floorf((record->place[axis] - record->radius) * per);
        high[axis] = (int)floorf((record->place[axis] + record->radius) * per);
        if (high[axis] > low[axis] + 1) /* by rounding */
            high[axis] = low[axis] + 1;
    }
    for (int z = low[2]; z <= high[2]; z++)
        for (int y = low[1]; y <= high[1]; y++)
            for (int x = low[0]; x <= high[0]; x++) {
                const uint32_t bucket = karst_light_map_bucket(x, y, z, level, mask);
                bool known = false;
                for (int i = 0; i < num; i++)
                    known = known || into[i] == bucket;
                if (!known)
                    into[num++] = bucket;
            }
    return num;
}

/* Levels from the widest down: what would be below them is put into wider cells than it needs. */
static void find_levels(karst_light_map *map, const karst_light_map_record *records, size_t num)
{
    int finest = INT32_MAX, widest = INT32_MIN;
    for (size_t i = 0; i < num; i++) {
        const int level = karst_light_map_level(records[i].radius);
        finest = level < finest ? level : finest;
        widest = level > widest ? level : widest;
    }
    map->finest_level = widest - finest < KARST_LIGHT_MAP_LEVELS ? finest : widest - (KARST_LIGHT_MAP_LEVELS - 1);
    for (size_t i = 0; i < num; i++)
        map->levels |= 1u << (level_of(&records[i], map->finest_level) - map->finest_level);
}

/* Where each bucket's entries begin, then the entries, by the points' order. malloc'ed. */
static bool sort(const karst_light_map *map, const karst_light_map_record *records, size_t num, uint32_t **begins,
                 uint32_t **entries, karst_error *error)
{
    const size_t num_buckets = (size_t)map->mask + 1;
    uint32_t in[MOST_CELLS];
    *entries = NULL;
    if (!(*begins = calloc(num_buckets + 1, sizeof **begins)))
        return karst_fail(error, KARST_FAILED, "out of memory");
    uint32_t *counts = *begins + 1;
    for (size_t i = 0; i < num; i++)
        for (int b = buckets_of(&records[i], map->finest_level, map->mask, in); b-- > 0;)
            counts[in[b]]++;
    for (size_t bucket = 1; bucket <= num_buckets; bucket++)
        (*begins)[bucket] += (*begins)[bucket - 1];
    if (!(*entries = malloc(((*begins)[num_buckets] + 1) * sizeof **entries)))
        return karst_fail(error, KARST_FAILED, "out of memory");
    const uint32_t all = (*begins)[num_buckets];
    /* From the last point back, so that ends become begins. */
    for (size_t i = num; i-- > 0;)
        for (int b = buckets_of(&records[i], map->finest_level, map->mask, in); b-- > 0;)
            (*entries)[--counts[in[b]]] = (uint32_t)i;
    memmove(*begins, counts, num_buckets * sizeof **begins);
    (*begins)[num_buckets] = all;
    return true;
}

static bool make_buffers(karst_light_map *map, const karst_light_map_point *points, size_t num, karst_error *error)
{
    karst_light_map_record *records = malloc(num * sizeof *records);
    uint32_t *begins = NULL, *entries = NULL, log2 = MIN_BUCKETS_LOG2;
    if (!records)
        return karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; i < num; i++)
        records[i] = record_of(&points[i]);
    while (log2 < MAX_BUCKETS_LOG2 && ((size_t)1 << log2) < num)
        log2++;
    map->mask = (1u << log2) - 1;
    find_levels(map, records, num);
    bool done = sort(map, records, num, &begins, &entries, error);
    if (done) {
        const size_t num_begins = (size_t)map->mask + 2, num_entries = (size_t)begins[num_begins - 1] + 1;
        map->points = karst_buffer_create(map->context, "light map", num * sizeof *records, records, error);
        map->begins = karst_buffer_create(map->context, "light map", num_begins * sizeof *begins, begins, error);
        map->entries = karst_buffer_create(map->context, "light map", num_entries * sizeof *entries, entries, error);
        done = map->points && map->begins && map->entries;
    }
    free(records);
    free(begins);
    free(entries);
    return done;
}

karst_light_map *karst_light_map_create(karst_context *context, const karst_light_map_point *points, size_t num,
                                        karst_error *error)
{
    karst_light_map *map = calloc(1, sizeof *map);
    if (!map) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    map->context = context;
    if (num < 1 || num > KARST_LIGHT_MAP_MOST)
        karst_fail(error, KARST_FAILED, "a light map of %zu points: it may have 1 to %u", num, KARST_LIGHT_MAP_MOST);
    else if (make_buffers(map, points, num, error) &&
             (map->program = karst_program_build(context, "raycast/light/light_map.cl", "", NULL, 0, error)))
        map->gather = karst_program_kernel(map->program, "light_map_gather", error);
    if (map->gather)
        return map;
    karst_light_map_destroy(map);
    return NULL;
}

void karst_light_map_destroy(karst_light_map *map)
{
    if (!map)
        return;
    if (map->gather)
        clReleaseKernel(map->gather);
    karst_program_destroy(map->program);
    karst_buffer_destroy(map->points);
    karst_buffer_destroy(map->begins);
    karst_buffer_destroy(map->entries);
    free(map);
}

bool karst_light_map_gather(karst_light_map *map, const karst_buffer *rays, const karst_buffer *count,
                            uint32_t max_rays, const float offset[3], const karst_pinhole *pinhole,
                            const karst_light *light, karst_buffer *parts, karst_error *error)
{
    const karst_light_map_task task = {.offset = {offset[0], offset[1], offset[2]},
                                       .finest_level = map->finest_level,
                                       .levels = map->levels,
                                       .mask = map->mask,
                                       .width_px = pinhole->width_px,
                                       .height_px = pinhole->height_px};
    return KARST_ARGUMENTS(map->gather, error, KARST_VALUE_ARG(task), KARST_VALUE_ARG(*light), KARST_BUFFER_ARG(rays),
                           KARST_BUFFER_ARG(count), KARST_BUFFER_ARG(map->points), KARST_BUFFER_ARG(map->begins),
                           KARST_BUFFER_ARG(map->entries), KARST_BUFFER_ARG(parts)) &&
           karst_launch(map->context, map->gather, KARST_STAGE_SHADE,
                        (max_rays + LOCAL_SIZE - 1) / LOCAL_SIZE * LOCAL_SIZE, LOCAL_SIZE, error);
}
