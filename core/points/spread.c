/* Importing points: they are spread over ranges of a file, by the leading bits of their keys, so that each range fits
 * memory. Points are counted first, so that the file has room for each range; then each block of them is parted in
 * memory, and its parts are appended to their ranges. Blocks are appended in order, so points of a range are, too. */
#include <stdlib.h>
#include <string.h>

#include "core/points/import_internal.h"
#include "core/points/key.h"

#define BUCKET_BITS 12
#define NUM_BUCKETS (1u << BUCKET_BITS)
_Static_assert(NUM_BUCKETS == POINTS_MOST_RANGES, "a bucket is a range at most");
_Static_assert(BUCKET_BITS * POINTS_MOST_DEPTH <= POINTS_HIGH_BITS, "of the leading bits");
#define MOST_THREADS 4u
#define BLOCKS_IN_MEMORY 16u /* those of all threads are a quarter of what is sorted in memory */

typedef struct {
    points_import *import;
    int from, to;
    uint32_t depth;
    size_t block;
    uint64_t counts[NUM_BUCKETS];
    uint16_t range_of[NUM_BUCKETS];
    points_range ranges[NUM_BUCKETS]; /* while it is filled, `num` is what is there */
    uint32_t num_ranges;
} spreading;

typedef struct {
    points_raw *raw; /* NULL: points are whole already */
    karst_point *points, *parted;
    uint16_t *bucket;
    size_t num;
    uint32_t counts[NUM_BUCKETS]; /* of buckets; once it is parted, of ranges */
} spread_slot;

static void clear(void *user)
{
    spread_slot *slot = user;
    free(slot->raw);
    free(slot->points);
    free(slot->parted);
    free(slot->bucket);
}

static bool make_room(const spreading *s, spread_slot *slot, karst_error *error)
{
    if (slot->points)
        return true;
    slot->raw = s->depth ? NULL : malloc(s->block * sizeof *slot->raw);
    slot->points = malloc(s->block * sizeof *slot->points);
    slot->parted = malloc(s->block * sizeof *slot->parted);
    slot->bucket = malloc(s->block * sizeof *slot->bucket);
    return ((slot->raw || s->depth) && slot->points && slot->parted && slot->bucket) ||
           karst_fail(error, KARST_FAILED, "out of memory");
}

/* Reads a block, and counts how many points of it each bucket has. */
static bool look_at_block(void *user, points_block *block, karst_error *error)
{
    const spreading *s = user;
    spread_slot *slot = block->slot;
    const size_t num = (size_t)(block->end - block->begin);
    const int shift = POINTS_HIGH_BITS - BUCKET_BITS * (int)(s->depth + 1);
    slot->num = 0;
    if (!make_room(s, slot, error))
        return false;
    slot->num = num;
    if (s->depth == 0)
        slot->num =
            karst_points_read_whole(s->import, s->from, block->begin, num, slot->raw, slot->points, error);
    else if (!karst_points_read(s->import, s->from, slot->points, num * sizeof *slot->points,
                                block->begin * sizeof *slot->points, error))
        return false;
    if (slot->num == SIZE_MAX)
        return false;
    memset(slot->counts, 0, sizeof slot->counts);
    for (size_t i = 0; i < slot->num; i++) {
        slot->bucket[i] = points_high_key(&slot->points[i]) >> shift & (NUM_BUCKETS - 1);
        slot->counts[slot->bucket[i]]++;
    }
    return true;
}

static bool put_counts(void *user, points_block *block, karst_error *error)
{
    spreading *s = user;
    const spread_slot *slot = block->slot;
    (void)error;
    for (uint32_t b = 0; b < NUM_BUCKETS; b++)
        s->counts[b] += slot->counts[b];
    return true;
}

/* Reads a block, and puts its points beside those of their ranges. */
static bool part_block(void *user, points_block *block, karst_error *error)
{
    const spreading *s = user;
    spread_slot *slot = block->slot;
    uint32_t counts[NUM_BUCKETS] = {0}, starts[NUM_BUCKETS];
    if (!look_at_block(user, block, error))
        return false;
    for (uint32_t b = 0; b < NUM_BUCKETS; b++)
        counts[s->range_of[b]] += slot->counts[b];
    for (uint32_t r = 0, at = 0; r < s->num_ranges; r++) {
        starts[r] = at;
        at += counts[r];
    }
    for (size_t i = 0; i < slot->num; i++)
        slot->parted[starts[s->range_of[slot->bucket[i]]]++] = slot->points[i];
    memcpy(slot->counts, counts, sizeof counts);
    return true;
}

static bool put_parts(void *user, points_block *block, karst_error *error)
{
    spreading *s = user;
    const spread_slot *slot = block->slot;
    const karst_point *points = slot->parted;
    for (uint32_t r = 0; r < s->num_ranges; r++) {
        points_range *range = &s->ranges[r];
        if (!karst_points_write(s->import, s->to, points, slot->counts[r] * sizeof *points,
                                (range->first + range->num) * sizeof *points, error))
            return false;
        range->num += slot->counts[r];
        points += slot->counts[r];
    }
    return true;
}

uint64_t karst_points_most_in_range(const points_import *import)
{
    return import->limits.most_in_memory / POINTS_SORTERS;
}

/* Neighbouring buckets share a range as long as that fits memory. */
static void make_ranges(spreading *s)
{
    const uint64_t most = karst_points_most_in_range(s->import);
    uint64_t first = 0, in_range = 0;
    for (uint32_t b = 0; b < NUM_BUCKETS; b++) {
        if (b == 0 || (in_range + s->counts[b] > most && s->counts[b])) {
            s->ranges[s->num_ranges++].first = first;
            in_range = 0;
        }
        in_range += s->counts[b];
        s->range_of[b] = (uint16_t)(s->num_ranges - 1);
        first += s->counts[b];
    }
}

/* Calls for all blocks. */
static bool for_blocks(spreading *s, const points_range *all, bool is_second,
                       bool (*work)(void *user, points_block *block, karst_error *error),
                       bool (*put)(void *user, points_block *block, karst_error *error), karst_error *error)
{
    const points_turns turns = {
        .loop = {is_second ? "sorting" : "into whole units", all->first, all->first + all->num, all->first + all->num,
                 s->block, false},
        .most_threads = MOST_THREADS,
        .slot_bytes = sizeof(spread_slot),
        .clear = clear,
        .work = work,
        .put = put};
    return karst_points_in_turns(s->import, &turns, s, error);
}

points_range *karst_points_spread_range(points_import *import, int from, const points_range *all, uint32_t depth,
                                        int to, uint32_t *num, karst_error *error)
{
    spreading *s = calloc(1, sizeof *s);
    points_range *ranges = NULL;
    if (!s) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    s->import = import;
    s->from = from;
    s->to = to;
    s->depth = depth;
    s->block = (size_t)(import->limits.most_in_memory / BLOCKS_IN_MEMORY);
    bool done = for_blocks(s, all, false, look_at_block, put_counts, error);
    if (done)
        make_ranges(s);
    done = done && for_blocks(s, all, true, part_block, put_parts, error);
    if (done && !(ranges = malloc(s->num_ranges * sizeof *ranges)))
        karst_fail(error, KARST_FAILED, "out of memory");
    if (ranges)
        memcpy(ranges, s->ranges, s->num_ranges * sizeof *ranges);
    *num = s->num_ranges;
    free(s);
    return ranges;
}

bool karst_points_spread(points_import *import, karst_error *error)
{
    const points_range all = {0, karst_points_num_raw(import)};
    int from = karst_points_file(import, POINTS_RAW, error), list = karst_points_file(import, POINTS_RANGES, error),
        to = karst_points_file(import, POINTS_SPREAD, error);
    if (from < 0 || list < 0 || to < 0)
        return false;
    uint32_t num = 0;
    points_range *ranges = karst_points_spread_range(import, from, &all, 0, to, &num, error);
    const uint64_t head = num;
    bool done = ranges && karst_points_write(import, list, &head, sizeof head, 0, error) &&
                karst_points_write(import, list, ranges, num * sizeof *ranges, sizeof head, error);
    free(ranges);
    return done;
}
