/* Points into Morton order, whatever their number: they are counted by the leading bits of their keys, spread over the
 * ranges of one file by that, and each range is sorted in memory, a few at a time, or spread again if it holds too
 * many. */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/points/import_internal.h"

#define BUCKET_BITS 12
#define NUM_BUCKETS (1u << BUCKET_BITS)
#define MAX_DEPTH 5 /* of the 63 leading bits */
#define BLOCK 4096u /* points that are read and written at a time */
#define RANGE_BUFFER 512u

/* A point's key has 84 bits: x, y and z, 28 bits each, interleaved. */
typedef struct {
    uint64_t high; /* the leading 63 */
    uint32_t low;
    uint32_t index;
} sort_key;

static uint64_t spread(uint64_t v) /* 21 bits, two zeros between any two */
{
    v = (v | v << 32) & 0x1f00000000ffffu;
    v = (v | v << 16) & 0x1f0000ff0000ffu;
    v = (v | v << 8) & 0x100f00f00f00f00fu;
    v = (v | v << 4) & 0x10c30c30c30c30c3u;
    return (v | v << 2) & 0x1249249249249249u;
}

static sort_key key_of(const karst_point *point, uint32_t index)
{
    sort_key key = {.index = index};
    uint64_t low = 0;
    for (int a = 0; a < 3; a++) {
        uint32_t u = (uint32_t)(point->at[a] + KARST_POINTS_MAX_AT);
        key.high |= spread(u >> 7) << a;
        low |= spread(u & 127) << a;
    }
    key.low = (uint32_t)low;
    return key;
}

/* ---- in memory ---- */

/* A pass by the 11 bits of one word from `shift` on; false: they are all the same, and nothing was done. */
static bool pass(const sort_key *from, sort_key *to, size_t num, bool of_high, int shift)
{
    enum { RADIX = 2048 };
    static const uint64_t mask = RADIX - 1;
    uint32_t counts[RADIX] = {0};
#define DIGIT(k) ((of_high ? (k).high : (k).low) >> shift & mask)
    for (size_t i = 0; i < num; i++)
        counts[DIGIT(from[i])]++;
    if (counts[DIGIT(from[0])] == num)
        return false;
    for (uint32_t i = 0, at = 0; i < RADIX; i++) {
        uint32_t count = counts[i];
        counts[i] = at;
        at += count;
    }
    for (size_t i = 0; i < num; i++)
        to[counts[DIGIT(from[i])]++] = from[i];
#undef DIGIT
    return true;
}

/* Least digit first; returns whichever of the two arrays holds the result. */
static sort_key *sort_keys(sort_key *keys, sort_key *other, size_t num)
{
    for (int shift = 0; shift < 22; shift += 11)
        if (pass(keys, other, num, false, shift)) {
            sort_key *swap = keys;
            keys = other;
            other = swap;
        }
    for (int shift = 0; shift < 66; shift += 11)
        if (pass(keys, other, num, true, shift)) {
            sort_key *swap = keys;
            keys = other;
            other = swap;
        }
    return keys;
}

typedef struct {
    points_import *import;
    int to;
    uint64_t num_written, num_all, num_done;
    karst_error *error;
} sorting;

/* Points of a file that come before those of later ranges. */
typedef struct {
    uint64_t first, num;
} key_range;

#define SORTERS 4u /* ranges that are sorted at a time, in a part of the memory each */

typedef struct {
    sorting *s;
    int from;
    const key_range *range;
    karst_point *points;
    sort_key *keys, *other, *sorted;
    karst_error why;
    bool done;
} sorter;

static uint64_t most_in_range(const sorting *s) { return s->import->limits.most_in_memory / SORTERS; }

static void sort_some(void *user, uint64_t begin, uint64_t end)
{
    for (sorter *one = (sorter *)user + begin; one < (sorter *)user + end; one++) {
        const uint64_t num = one->range->num;
        one->points = malloc(num * sizeof *one->points + 1);
        one->keys = malloc(num * sizeof *one->keys + 1);
        one->other = malloc(num * sizeof *one->other + 1);
        one->done =
            (one->points && one->keys && one->other) ||
            karst_fail(&one->why, KARST_FAILED, "out of memory for sorting %llu points", (unsigned long long)num);
        one->done = one->done && karst_points_read(one->s->import, one->from, one->points, num * sizeof *one->points,
                                                   one->range->first * sizeof *one->points, &one->why);
        for (uint64_t i = 0; one->done && i < num; i++)
            one->keys[i] = key_of(&one->points[i], (uint32_t)i);
        if (one->done && num)
            one->sorted = sort_keys(one->keys, one->other, num);
    }
}

/* Writes them in order, without those at a place that another has. */
static bool write_sorted(sorting *s, const sorter *one)
{
    const sort_key *keys = one->sorted;
    const uint64_t num = one->range->num;
    karst_point block[RANGE_BUFFER];
    size_t in_block = 0;
    for (uint64_t i = 0; i < num; i++) {
        if (i > 0 && keys[i].high == keys[i - 1].high && keys[i].low == keys[i - 1].low)
            s->import->head->num_duplicates++;
        else
            block[in_block++] = one->points[keys[i].index];
        if (in_block == RANGE_BUFFER || (i + 1 == num && in_block)) {
            if (!karst_points_write(s->import, s->to, block, in_block * sizeof *block, s->num_written * sizeof *block,
                                    s->error))
                return false;
            s->num_written += in_block;
            in_block = 0;
        }
    }
    s->num_done += num;
    return true;
}

/* Ranges that fit memory together. */
static bool sort_in_memory(sorting *s, int from, const key_range *ranges, uint32_t num)
{
    sorter sorters[SORTERS];
    const points_loop loop = {"sorting", 0, num, num, 1};
    memset(sorters, 0, sizeof sorters);
    for (uint32_t i = 0; i < num; i++)
        sorters[i] = (sorter){.s = s, .from = from, .range = &ranges[i]};
    bool done = karst_points_in_parallel(s->import, &loop, sort_some, sorters, s->error);
    for (uint32_t i = 0; i < num; i++) {
        if (done && !sorters[i].done)
            done = karst_fail(s->error, sorters[i].why.status, "%s", sorters[i].why.message);
        done = done && write_sorted(s, &sorters[i]);
        free(sorters[i].points);
        free(sorters[i].keys);
        free(sorters[i].other);
    }
    return done && karst_points_go_on(s->import, "sorting", (double)s->num_done / (double)s->num_all, s->error);
}

/* ---- on disk ---- */

/* A range that is being filled. */
typedef struct {
    key_range of;
    uint64_t num_put;
    uint32_t in_buffer;
    karst_point *buffer;
} range;

static uint32_t bucket_of(const karst_point *point, int depth)
{
    return (uint32_t)(key_of(point, 0).high >> (63 - BUCKET_BITS * (depth + 1))) & (NUM_BUCKETS - 1);
}

/* Calls for each block of points of a file. */
static bool for_blocks(sorting *s, int from, uint64_t first, uint64_t num,
                       bool (*use)(void *user, const karst_point *points, size_t num), void *user)
{
    karst_point *block = malloc(BLOCK * sizeof *block);
    bool done = block || karst_fail(s->error, KARST_FAILED, "out of memory");
    for (uint64_t at = 0; done && at < num; at += BLOCK) {
        size_t count = num - at < BLOCK ? (size_t)(num - at) : BLOCK;
        done =
            karst_points_read(s->import, from, block, count * sizeof *block, (first + at) * sizeof *block, s->error) &&
            use(user, block, count);
    }
    free(block);
    return done;
}

typedef struct {
    sorting *s;
    int depth, to;
    uint64_t counts[NUM_BUCKETS];
    uint32_t range_of[NUM_BUCKETS];
    range *ranges;
    uint32_t num_ranges;
} spreading;

static bool count_block(void *user, const karst_point *points, size_t num)
{
    spreading *p = user;
    for (size_t i = 0; i < num; i++)
        p->counts[bucket_of(&points[i], p->depth)]++;
    return true;
}

static bool flush(spreading *p, range *r)
{
    bool done =
        r->in_buffer == 0 || karst_points_write(p->s->import, p->to, r->buffer, r->in_buffer * sizeof *r->buffer,
                                                (r->of.first + r->num_put) * sizeof *r->buffer, p->s->error);
    r->num_put += r->in_buffer;
    r->in_buffer = 0;
    return done;
}

static bool spread_block(void *user, const karst_point *points, size_t num)
{
    spreading *p = user;
    for (size_t i = 0; i < num; i++) {
        range *r = &p->ranges[p->range_of[bucket_of(&points[i], p->depth)]];
        r->buffer[r->in_buffer++] = points[i];
        if (r->in_buffer == RANGE_BUFFER && !flush(p, r))
            return false;
    }
    return true;
}

/* Neighbouring buckets share a range as long as that fits memory. */
static bool make_ranges(spreading *p)
{
    uint64_t first = 0;
    p->ranges = calloc(NUM_BUCKETS, sizeof *p->ranges);
    for (uint32_t b = 0; p->ranges && b < NUM_BUCKETS; b++) {
        range *last = p->num_ranges ? &p->ranges[p->num_ranges - 1] : NULL;
        if (!last || (last->of.num + p->counts[b] > most_in_range(p->s) && p->counts[b])) {
            last = &p->ranges[p->num_ranges++];
            *last = (range){.of = {first, 0}, .buffer = malloc(RANGE_BUFFER * sizeof(karst_point))};
            if (!last->buffer)
                return karst_fail(p->s->error, KARST_FAILED, "out of memory");
        }
        last->of.num += p->counts[b];
        p->range_of[b] = p->num_ranges - 1;
        first += p->counts[b];
    }
    return p->ranges || karst_fail(p->s->error, KARST_FAILED, "out of memory");
}

/* Spreads points of a file over ranges of another; returns those, which the caller frees, NULL on errors. */
static key_range *spread_range(sorting *s, int from, const key_range *all, int depth, int to, uint32_t *num)
{
    spreading *p = calloc(1, sizeof *p);
    key_range *ranges = NULL;
    if (!p) {
        karst_fail(s->error, KARST_FAILED, "out of memory");
        return NULL;
    }
    p->s = s;
    p->depth = depth;
    p->to = to;
    bool done = for_blocks(s, from, all->first, all->num, count_block, p) && make_ranges(p) &&
                for_blocks(s, from, all->first, all->num, spread_block, p);
    for (uint32_t i = 0; done && i < p->num_ranges; i++)
        done = flush(p, &p->ranges[i]);
    if (done && !(ranges = malloc(p->num_ranges * sizeof *ranges)))
        karst_fail(s->error, KARST_FAILED, "out of memory");
    for (uint32_t i = 0; p->ranges && i < p->num_ranges; i++) {
        if (ranges)
            ranges[i] = p->ranges[i].of;
        free(p->ranges[i].buffer);
    }
    *num = p->num_ranges;
    free(p->ranges);
    free(p);
    return ranges;
}

static bool sort_ranges(sorting *s, int from, const key_range *ranges, uint32_t num, int depth);

/* Spreads a range that is too large, then sorts what comes of it. */
static bool sort_large(sorting *s, int from, const key_range *large, int depth)
{
    uint32_t num = 0;
    int to = karst_points_scratch(s->import, s->error);
    key_range *ranges = to < 0 ? NULL : spread_range(s, from, large, depth, to, &num);
    bool done = ranges && sort_ranges(s, to, ranges, num, depth + 1);
    free(ranges);
    if (to >= 0)
        close(to);
    return done;
}

/* The next ranges, as many as are sorted at a time; returns how many, 0 on errors. */
static uint32_t sort_next(sorting *s, int from, const key_range *ranges, uint32_t num, int depth)
{
    uint32_t count = 0;
    if (ranges[0].num > most_in_range(s) && depth < MAX_DEPTH)
        return sort_large(s, from, ranges, depth);
    /* What lies at nearly one place cannot be spread: it is sorted by itself. */
    while (count < num && count < SORTERS && (count == 0 || ranges[count].num <= most_in_range(s)))
        count++;
    return sort_in_memory(s, from, ranges, count) ? count : 0;
}

static bool sort_ranges(sorting *s, int from, const key_range *ranges, uint32_t num, int depth)
{
    for (uint32_t i = 0, count; i < num; i += count)
        if (!(count = sort_next(s, from, ranges + i, num - i, depth)))
            return false;
    return true;
}

/* ---- the steps ---- */

/* The file of ranges begins with this; they follow. */
typedef struct {
    uint64_t num;
    uint64_t is_spread; /* they are of SPREAD, not of WHOLE */
} ranges_head;

bool karst_points_spread(points_import *import, karst_error *error)
{
    sorting s = {.import = import, .num_all = import->now.num, .error = error};
    const key_range all = {0, import->now.num};
    ranges_head head = {.num = 1, .is_spread = all.num > most_in_range(&s)};
    int from = karst_points_file(import, POINTS_WHOLE, error), to = karst_points_file(import, POINTS_RANGES, error);
    key_range *ranges = NULL;
    if (from < 0 || to < 0)
        return false;
    if (head.is_spread) {
        uint32_t num = 0;
        int spread_to = karst_points_file(import, POINTS_SPREAD, error);
        ranges = spread_to < 0 ? NULL : spread_range(&s, from, &all, 0, spread_to, &num);
        head.num = num;
        if (!ranges)
            return false;
    }
    bool done = karst_points_write(import, to, &head, sizeof head, 0, error) &&
                karst_points_write(import, to, ranges ? ranges : &all, head.num * sizeof all, sizeof head, error);
    free(ranges);
    return done;
}

bool karst_points_sort(points_import *import, karst_error *error)
{
    points_progress *now = &import->now;
    sorting s = {.import = import, .num_all = now->num ? now->num : 1, .error = error};
    ranges_head head;
    int list = karst_points_file(import, POINTS_RANGES, error);
    if (list < 0 || !karst_points_read(import, list, &head, sizeof head, 0, error))
        return false;
    key_range *ranges = head.num <= NUM_BUCKETS ? malloc(head.num * sizeof *ranges) : NULL;
    const int depth = head.is_spread ? 1 : 0;
    int from = karst_points_file(import, depth ? POINTS_SPREAD : POINTS_WHOLE, error);
    s.to = karst_points_file(import, POINTS_SORTED, error);
    bool done = (ranges || karst_fail(error, KARST_FAILED, "out of memory")) && from >= 0 && s.to >= 0 &&
                karst_points_read(import, list, ranges, head.num * sizeof *ranges, sizeof head, error);
    s.num_written = now->done ? now->num_sorted : 0;
    for (uint64_t noted = 0; done && now->done < head.num;) {
        uint32_t count = sort_next(&s, from, ranges + now->done, (uint32_t)(head.num - now->done), depth);
        done = count > 0;
        now->done += count;
        now->num_sorted = s.num_written;
        if (done && s.num_done - noted >= import->limits.most_between) {
            noted = s.num_done;
            done = karst_points_checkpoint(import, error);
        }
    }
    free(ranges);
    if (!done)
        return false;
    now->num = s.num_written;
    return now->num >= POINTS_FEWEST ||
           karst_fail(error, KARST_BAD_DATA, "%s: only %llu points lie apart from one another: %u are the fewest",
                      import->config->input, (unsigned long long)now->num, POINTS_FEWEST);
}
