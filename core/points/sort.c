/* Points into Morton order, whatever their number: they are counted by the leading bits of their keys, spread over the
 * ranges of one file by that, and each range is sorted in memory, or spread again if it holds too many. */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/points/import_internal.h"

#define MOST_IN_MEMORY ((uint64_t)1 << 21) /* some 180 MB */
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
    uint64_t offset, num_written, num_all, num_done;
    karst_error *error;
} sorting;

/* Writes them in order, without those at a place that another has. */
static bool write_sorted(sorting *s, const karst_point *points, const sort_key *keys, size_t num)
{
    karst_point block[RANGE_BUFFER];
    size_t in_block = 0;
    for (size_t i = 0; i < num; i++) {
        if (i > 0 && keys[i].high == keys[i - 1].high && keys[i].low == keys[i - 1].low) {
            s->import->head.num_duplicates++;
        } else {
            block[in_block++] = points[keys[i].index];
        }
        if (in_block == RANGE_BUFFER || (i + 1 == num && in_block)) {
            if (!karst_points_write(s->import, s->to, block, in_block * sizeof *block,
                                    s->offset + s->num_written * sizeof *block, s->error))
                return false;
            s->num_written += in_block;
            in_block = 0;
        }
    }
    s->num_done += num;
    return karst_points_go_on(s->import, "sorting", (double)s->num_done / (double)s->num_all, s->error);
}

static bool sort_in_memory(sorting *s, int from, uint64_t first, uint64_t num)
{
    karst_point *points = malloc(num * sizeof *points + 1);
    sort_key *keys = malloc(num * sizeof *keys + 1), *other = malloc(num * sizeof *other + 1);
    bool done = points && keys && other;
    if (!done)
        karst_fail(s->error, KARST_FAILED, "out of memory for sorting %llu points", (unsigned long long)num);
    done = done && karst_points_read(s->import, from, points, num * sizeof *points, first * sizeof *points, s->error);
    for (uint64_t i = 0; done && i < num; i++)
        keys[i] = key_of(&points[i], (uint32_t)i);
    done = done && (num == 0 || write_sorted(s, points, sort_keys(keys, other, num), num));
    free(points);
    free(keys);
    free(other);
    return done;
}

/* ---- on disk ---- */

typedef struct {
    uint64_t first, num, num_put;
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
                                                (r->first + r->num_put) * sizeof *r->buffer, p->s->error);
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
        if (!last || (last->num + p->counts[b] > MOST_IN_MEMORY && p->counts[b])) {
            last = &p->ranges[p->num_ranges++];
            *last = (range){.first = first, .buffer = malloc(RANGE_BUFFER * sizeof(karst_point))};
            if (!last->buffer)
                return karst_fail(p->s->error, KARST_FAILED, "out of memory");
        }
        last->num += p->counts[b];
        p->range_of[b] = p->num_ranges - 1;
        first += p->counts[b];
    }
    return p->ranges || karst_fail(p->s->error, KARST_FAILED, "out of memory");
}

static bool sort_range(sorting *s, int from, uint64_t first, uint64_t num, int depth);

/* Spreads points over ranges of another file, then sorts those in turn. */
static bool spread_range(sorting *s, int from, uint64_t first, uint64_t num, int depth)
{
    spreading *p = calloc(1, sizeof *p);
    if (!p)
        return karst_fail(s->error, KARST_FAILED, "out of memory");
    p->s = s;
    p->depth = depth;
    p->to = karst_points_scratch(s->import, s->error);
    bool done = p->to >= 0 && for_blocks(s, from, first, num, count_block, p) && make_ranges(p) &&
                for_blocks(s, from, first, num, spread_block, p);
    for (uint32_t i = 0; done && i < p->num_ranges; i++)
        done = flush(p, &p->ranges[i]);
    for (uint32_t i = 0; p->ranges && i < p->num_ranges; i++)
        free(p->ranges[i].buffer);
    for (uint32_t i = 0; done && i < p->num_ranges; i++)
        done = sort_range(s, p->to, p->ranges[i].first, p->ranges[i].num, depth + 1);
    if (p->to >= 0)
        close(p->to);
    free(p->ranges);
    free(p);
    return done;
}

static bool sort_range(sorting *s, int from, uint64_t first, uint64_t num, int depth)
{
    if (num > UINT32_MAX / 2)
        return karst_fail(s->error, KARST_FAILED, "%llu points at nearly one place cannot be sorted",
                          (unsigned long long)num);
    return num > MOST_IN_MEMORY && depth < MAX_DEPTH ? spread_range(s, from, first, num, depth)
                                                     : sort_in_memory(s, from, first, num);
}

bool karst_points_sort(points_import *import, int from, uint64_t *num, int to, uint64_t offset, karst_error *error)
{
    sorting s = {.import = import, .to = to, .offset = offset, .num_all = *num ? *num : 1, .error = error};
    bool done = *num > UINT32_MAX / 2
                    ? karst_fail(error, KARST_USAGE, "%llu points: %u are the most, cut them into several models",
                                 (unsigned long long)*num, UINT32_MAX / 2)
                    : sort_range(&s, from, 0, *num, 0);
    close(from);
    *num = s.num_written;
    return done;
}
