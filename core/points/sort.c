/* Points into Morton order, whatever their number: each of the ranges that they were spread over is sorted in memory, a
 * few at a time, or spread again if it holds too many. */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/points/import_internal.h"
#include "core/points/key.h"

typedef struct {
    uint64_t high; /* the leading 63 bits */
    uint32_t low;
    uint32_t index;
} sort_key;

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
    int from, to;
    const points_range *ranges;
    uint32_t depth;
    bool notes; /* ranges that are done are noted */
    uint32_t next, end; /* ranges that are sorted in memory together, and are not taken yet */
    uint64_t num_written, num_done, num_noted;
    uint64_t num_taken, num_all; /* points, for progress */
} sorting;

typedef struct {
    karst_point *points, *made;
    sort_key *keys, *other;
    uint64_t room; /* points */
    size_t num_made;
} sort_slot;

static void clear(void *user)
{
    sort_slot *slot = user;
    free(slot->points);
    free(slot->made);
    free(slot->keys);
    free(slot->other);
    *slot = (sort_slot){.room = 0};
}

static bool make_room(sort_slot *slot, uint64_t num, karst_error *error)
{
    if (num <= slot->room)
        return true;
    clear(slot);
    slot->points = malloc(num * sizeof *slot->points);
    slot->made = malloc(num * sizeof *slot->made);
    slot->keys = malloc(num * sizeof *slot->keys);
    slot->other = malloc(num * sizeof *slot->other);
    if (!slot->points || !slot->made || !slot->keys || !slot->other)
        return karst_fail(error, KARST_FAILED, "out of memory for sorting %llu points", (unsigned long long)num);
    slot->room = num;
    return true;
}

static bool take_range(void *user, points_block *block, double *share, bool *any, karst_error *error)
{
    sorting *s = user;
    (void)error;
    *any = s->next < s->end;
    if (!*any)
        return true;
    *share = (double)s->num_taken / (double)s->num_all;
    block->begin = s->next++;
    block->end = s->next;
    s->num_taken += s->ranges[block->begin].num;
    return true;
}

/* Sorts a range, and leaves out points at a place that another has. */
static bool sort_range(void *user, points_block *block, karst_error *error)
{
    const sorting *s = user;
    sort_slot *slot = block->slot;
    const points_range *range = &s->ranges[block->begin];
    const uint64_t num = range->num;
    slot->num_made = 0;
    if (num == 0)
        return true;
    if (!make_room(slot, num, error) ||
        !karst_points_read(s->import, s->from, slot->points, num * sizeof *slot->points,
                           range->first * sizeof *slot->points, error))
        return false;
    for (uint64_t i = 0; i < num; i++)
        slot->keys[i] = (sort_key){points_high_key(&slot->points[i]), points_low_key(&slot->points[i]), (uint32_t)i};
    const sort_key *keys = sort_keys(slot->keys, slot->other, num);
    for (uint64_t i = 0; i < num; i++)
        if (i == 0 || keys[i].high != keys[i - 1].high || keys[i].low != keys[i - 1].low)
            slot->made[slot->num_made++] = slot->points[keys[i].index];
    return true;
}

static bool put_range(void *user, points_block *block, karst_error *error)
{
    sorting *s = user;
    const sort_slot *slot = block->slot;
    const uint64_t num = s->ranges[block->begin].num;
    points_progress *now = &s->import->now;
    if (!karst_points_write(s->import, s->to, slot->made, slot->num_made * sizeof *slot->made,
                            s->num_written * sizeof *slot->made, error))
        return false;
    s->num_written += slot->num_made;
    s->num_done += num;
    s->import->head->num_duplicates += num - slot->num_made;
    if (!s->notes)
        return true;
    now->done = block->end;
    now->num_sorted = s->num_written;
    if (s->num_done - s->num_noted < s->import->limits.most_between)
        return true;
    s->num_noted = s->num_done;
    return karst_points_checkpoint(s->import, error);
}

/* Ranges that fit memory, POINTS_SORTERS together. */
static bool sort_in_memory(sorting *s, uint32_t first, uint32_t end, karst_error *error)
{
    const points_turns turns = {.loop = {.what = "sorting"},
                                .most_threads = POINTS_SORTERS,
                                .slot_bytes = sizeof(sort_slot),
                                .clear = clear,
                                .take = take_range,
                                .work = sort_range,
                                .put = put_range};
    s->next = first;
    s->end = end;
    return karst_points_in_turns(s->import, &turns, s, error);
}

/* ---- on disk ---- */

static bool sort_ranges(sorting *s, uint32_t first, uint32_t num, karst_error *error);

/* Spreads a range that is too large, then sorts what comes of it. */
static bool sort_large(sorting *s, uint32_t which, karst_error *error)
{
    sorting finer = *s;
    uint32_t num = 0;
    finer.from = karst_points_scratch(s->import, error);
    points_range *ranges = finer.from < 0 ? NULL
                                          : karst_points_spread_range(s->import, s->from, &s->ranges[which], s->depth,
                                                                      finer.from, &num, error);
    finer.ranges = ranges;
    finer.depth++;
    finer.notes = false;
    bool done = ranges && sort_ranges(&finer, 0, num, error);
    s->num_written = finer.num_written;
    s->num_done = finer.num_done;
    s->num_taken = finer.num_taken;
    if (done && s->notes) {
        s->import->now.done = which + 1;
        s->import->now.num_sorted = s->num_written;
    }
    free(ranges);
    if (finer.from >= 0)
        close(finer.from);
    return done;
}

static bool sort_ranges(sorting *s, uint32_t first, uint32_t num, karst_error *error)
{
    const uint64_t most = karst_points_most_in_range(s->import);
    for (uint32_t i = first, end; i < num; i = end) {
        /* What lies at nearly one place cannot be spread: it is sorted by itself. */
        const bool is_large = s->ranges[i].num > most, is_spread = is_large && s->depth < POINTS_MOST_DEPTH;
        for (end = i + 1; !is_large && end < num && s->ranges[end].num <= most;)
            end++;
        if (!(is_spread ? sort_large(s, i, error) : sort_in_memory(s, i, end, error)))
            return false;
    }
    return true;
}

/* ---- the step ---- */

bool karst_points_sort(points_import *import, karst_error *error)
{
    points_progress *now = &import->now;
    sorting s = {.import = import, .depth = 1, .notes = true, .num_all = now->num ? now->num : 1};
    uint64_t num = 0;
    int list = karst_points_file(import, POINTS_RANGES, error);
    if (list < 0 || !karst_points_read(import, list, &num, sizeof num, 0, error))
        return false;
    points_range *ranges = num <= POINTS_MOST_RANGES ? malloc((num + 1) * sizeof *ranges) : NULL;
    s.ranges = ranges;
    s.from = karst_points_file(import, POINTS_SPREAD, error);
    s.to = karst_points_file(import, POINTS_SORTED, error);
    s.num_written = now->done ? now->num_sorted : 0;
    bool done = (ranges || karst_fail(error, KARST_FAILED, "out of memory")) && s.from >= 0 && s.to >= 0 &&
                karst_points_read(import, list, ranges, num * sizeof *ranges, sizeof num, error);
    for (uint64_t i = 0; done && i < now->done; i++)
        s.num_taken += ranges[i].num;
    done = done && sort_ranges(&s, (uint32_t)now->done, (uint32_t)num, error);
    free(ranges);
    if (!done)
        return false;
    now->num = s.num_written;
    return now->num >= POINTS_FEWEST ||
           karst_fail(error, KARST_BAD_DATA, "%s: only %llu points lie apart from one another: %u are the fewest",
                      import->config->input, (unsigned long long)now->num, POINTS_FEWEST);
}
