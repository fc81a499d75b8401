/* Usage lists: what the survey found, put in order, and launchers of lru.cl. */
#include "cache/lru.h"

#include <stdlib.h>
#include <string.h>

#define STAGE KARST_STAGE_COLLECT
#define DIGIT_BITS 11
#define DIGIT_SIZE (1u << DIGIT_BITS)

bool karst_lru_init(karst_lru *lru, karst_context *context, uint32_t kind, const karst_cache_buffers *pools,
                    karst_survey *survey, karst_mapped *mapped, karst_error *error)
{
    bool tiles = kind == KARST_SURVEY_TILES;
    *lru = (karst_lru){.context = context,
                       .shape = karst_pass_shape_of(context),
                       .kind = kind,
                       .pools = pools,
                       .survey = survey,
                       .mapped = mapped,
                       .expected_age = 16};
    size_t num = tiles ? pools->num_tiles : pools->num_bricks;
    lru->victims = karst_buffer_create(context, "work_lists", KARST_CACHE_MAX_WORK * sizeof(uint32_t), NULL, error);
    lru->result = karst_buffer_create(context, "work_lists", sizeof(karst_lru_result), NULL, error);
    lru->freed = karst_buffer_create(context, "work_lists", KARST_CACHE_MAX_WORK * sizeof(uint32_t), NULL, error);
    if (!lru->victims || !lru->result || !lru->freed)
        return false;
    lru->slots = malloc(num * sizeof(uint32_t));
    lru->spare = malloc(num * sizeof(*lru->spare));
    lru->host_victims = malloc(KARST_CACHE_MAX_WORK * sizeof(uint32_t));
    if (!lru->slots || !lru->spare || !lru->host_victims)
        return karst_fail(error, KARST_FAILED, "out of memory for a list of %zu slots", num);
    return true;
}

bool karst_lru_take_kernels(karst_lru *lru, karst_program *program, karst_error *error)
{
    const char *look = lru->kind == KARST_SURVEY_TILES ? "karst_lru_look_at_tiles" : "karst_lru_look_at_bricks";
    return (lru->look = karst_program_kernel(program, look, error)) &&
           (lru->take = karst_program_kernel(program, "karst_lru_take", error));
}

void karst_lru_finish(karst_lru *lru)
{
    if (lru->look)
        clReleaseKernel(lru->look);
    if (lru->take)
        clReleaseKernel(lru->take);
    karst_buffer_destroy(lru->victims);
    karst_buffer_destroy(lru->result);
    karst_buffer_destroy(lru->freed);
    free(lru->host_victims);
    free(lru->slots);
    free(lru->spare);
    *lru = (karst_lru){0};
}

/* How many slots to find: some are free, have children or are wanted after all. */
static uint32_t with_some_more(const karst_lru *lru, uint32_t need)
{
    return need + (uint32_t)((uint64_t)need * lru->expected_misfits / 64) + need / 4 + 64;
}

/* Twice as many as that: so what is found lasts for a while, and when it gets less there is still enough. */
static uint32_t enough(const karst_lru *lru, uint32_t need) { return 2 * with_some_more(lru, need) + 1; }

void karst_lru_forget(karst_lru *lru)
{
    lru->survey->lists[lru->kind].valid = false;
    lru->sorted = lru->started = false;
}

static void ask_for(karst_lru *lru, uint32_t age, uint32_t most, karst_survey_ask *ask)
{
    ask->ages[lru->kind] = age;
    ask->most[lru->kind] = most;
    lru->survey->lists[lru->kind].valid = false;
    lru->sorted = false;
}

/* The same age as last time, or what is as old as that by now. The first holds where the same share of a pool is used
 * again and again, the second for what a whole view left behind at once; which of them is what the last rounds tell. */
static uint32_t expected_age(const karst_lru *lru, uint32_t serial)
{
    uint32_t more = lru->gets_older ? serial - lru->expected_serial : 0, most = UINT32_MAX / 2;
    return lru->expected_age < most && more < most - lru->expected_age ? lru->expected_age + more : most;
}

void karst_lru_expect(karst_lru *lru, uint32_t num_free, karst_survey_ask *ask)
{
    uint32_t need = lru->expected_need;
    bool is_short = need && num_free < 2 * need + 64;
    ask_for(lru, is_short ? expected_age(lru, ask->serial) : 0, enough(lru, need), ask);
}

/* Looks once more, for what was not expected. */
static bool find(karst_lru *lru, uint32_t serial, bool stand_ins, uint32_t age, uint32_t most, karst_error *error)
{
    karst_survey_ask ask = {.serial = serial, .stand_ins = stand_ins};
    ask_for(lru, age, most, &ask);
    if (lru->mapped->nodes) {
        karst_survey_by_host(lru->survey, &ask, lru->mapped);
        return true;
    }
    return karst_survey_begin(lru->survey, &ask, error) && karst_survey_end(lru->survey, error);
}

/* More than the list has: the rest of its last age, or what is half as old. */
static bool find_more(karst_lru *lru, uint32_t serial, bool stand_ins, karst_error *error)
{
    const karst_survey_list *list = &lru->survey->lists[lru->kind];
    uint32_t most = list->num < UINT32_MAX / 8 ? 4 * list->num + enough(lru, lru->expected_need) : UINT32_MAX;
    lru->gets_older = false;
    return find(lru, serial, stand_ins, list->num_left_out ? list->age : (list->age + 1) / 2, most, error);
}

/* 0 for what was never used, then the oldest first. */
static uint32_t youth_of(karst_survey_slot one, uint32_t oldest) { return one.age > oldest ? 0 : oldest - one.age + 1; }

/* A stable pass by one digit of the youth; only the first `limit` get a place. */
static void sort_digit(const karst_survey_slot *from, uint32_t num, uint32_t oldest, int shift, karst_survey_slot *to,
                       uint32_t limit)
{
    uint32_t sums[DIGIT_SIZE] = {0};
    for (uint32_t i = 0; i < num; i++)
        sums[youth_of(from[i], oldest) >> shift & (DIGIT_SIZE - 1)]++;
    for (uint32_t digit = 0, sum = 0; digit < DIGIT_SIZE; digit++) {
        uint32_t own = sums[digit];
        sums[digit] = sum;
        sum += own;
    }
    for (uint32_t i = 0; i < num; i++) {
        uint32_t at = sums[youth_of(from[i], oldest) >> shift & (DIGIT_SIZE - 1)]++;
        if (at < limit)
            to[at] = from[i];
    }
}

/* The oldest of what was found, `least` or more of them if there are, go to lru->slots, oldest first; those of one age
 * stay in the order of slots. Most often one digit is enough. */
static void sort(karst_lru *lru, uint32_t least)
{
    karst_survey_list *list = &lru->survey->lists[lru->kind];
    karst_survey_slot *from = list->slots, *to = lru->spare;
    uint32_t oldest = 0, youngest = UINT32_MAX, num = list->num;
    for (uint32_t i = 0; i < num; i++) {
        uint32_t age = from[i].age;
        youngest = age < youngest ? age : youngest;
        oldest = age != UINT32_MAX && age > oldest ? age : oldest;
    }
    uint32_t most = youngest > oldest ? 0 : oldest - youngest + 1, place = enough(lru, lru->expected_need) - 1;
    lru->num = num;
    if (most < DIGIT_SIZE) {
        uint32_t limit = least > place ? least : place + 1;
        lru->num = limit < num ? limit : num;
    }
    for (int shift = 0; shift == 0 || (shift < 32 && most >> shift); shift += DIGIT_BITS) {
        sort_digit(from, num, oldest, shift, to, lru->num);
        karst_survey_slot *swap = from;
        from = to;
        to = swap;
    }
    for (uint32_t i = 0; i < lru->num; i++)
        lru->slots[i] = from[i].slot;
    /* What the next round is to find is known if there was enough, else it is a little less old. */
    uint32_t age = place < lru->num ? from[place].age : list->age - list->age / 8 - 1;
    lru->expected_age = age ? age : 1;
    lru->expected_serial = lru->survey->ask.serial;
    lru->gets_older = lru->gets_older || num > 8 * place + 1024;
    lru->sorted = true;
}

/* The list and at least `least` of it in order. */
static bool read_sorted(karst_lru *lru, uint32_t least, karst_error *error)
{
    const karst_survey_list *list = &lru->survey->lists[lru->kind];
    if (lru->sorted && (lru->num == list->num || lru->num >= least))
        return true;
    if (!karst_survey_read_found(lru->survey, lru->kind, error))
        return false;
    uint64_t start_ns = karst_clock_ns();
    sort(lru, least);
    karst_profile_add_host(lru->context, STAGE, karst_clock_ns() - start_ns);
    return true;
}

static bool launch_look(karst_lru *lru, const karst_lru *behind, karst_error *error)
{
    const karst_cache_buffers *pools = lru->pools;
    const karst_lru_ask *ask = &lru->ask;
    karst_buffer *slots = lru->survey->found[lru->kind]; /* which has been read */
    if (!(lru->kind == KARST_SURVEY_TILES
              ? KARST_ARGUMENTS(lru->look, error, KARST_BUFFER_ARG(slots), KARST_VALUE_ARG(*ask),
                                KARST_BUFFER_ARG(pools->tile_stamp), KARST_BUFFER_ARG(pools->nodes),
                                KARST_BUFFER_ARG(pools->tile_info))
              : KARST_ARGUMENTS(lru->look, error, KARST_BUFFER_ARG(slots), KARST_VALUE_ARG(*ask),
                                KARST_BUFFER_ARG(pools->brick_stamp), KARST_BUFFER_ARG(pools->brick_fallback),
                                KARST_BUFFER_ARG(pools->brick_owner))))
        return false;
    return karst_buffer_send(slots, 0, lru->slots, ask->num * sizeof(uint32_t), error) &&
           karst_launch(lru->context, lru->look, STAGE, ask->num, lru->shape.item_local, error) &&
           KARST_ARGUMENTS(lru->take, error, KARST_BUFFER_ARG(slots), KARST_VALUE_ARG(*ask),
                           KARST_BUFFER_ARG(behind ? behind->result : lru->result),
                           KARST_BUFFER_ARG(behind ? behind->freed : lru->freed), KARST_BUFFER_ARG(lru->victims),
                           KARST_BUFFER_ARG(lru->result)) &&
           karst_launch(lru->context, lru->take, STAGE, lru->shape.scan_width, lru->shape.scan_width, error);
}

/* The same by the host. What the survey found carries no stamp of this serial, but tiles may have got one since. */
static void look_at_mapped(karst_lru *lru)
{
    const karst_mapped *m = lru->mapped;
    const karst_lru_ask *ask = &lru->ask;
    karst_lru_result *result = &lru->host_result;
    uint64_t start_ns = karst_clock_ns();
    for (uint32_t i = 0; i < ask->num && result->num_fit < ask->need; i++) {
        uint32_t slot = lru->slots[i],
                 ahead = lru->slots[i + KARST_MAPPED_AHEAD < ask->num ? i + KARST_MAPPED_AHEAD : i];
        uint32_t what;
        if (lru->kind == KARST_SURVEY_TILES) {
            __builtin_prefetch(&m->nodes[ahead * KARST_TILE_NODES]);
            __builtin_prefetch(&m->tile_info[ahead]);
            __builtin_prefetch(&m->tile_stamp[ahead]);
            what = karst_lru_look_at_tile(slot, m->tile_stamp[slot], ask->serial, m->nodes, m->tile_info);
        } else {
            __builtin_prefetch(&m->brick_owner[ahead]);
            what = slot != KARST_NONE && m->brick_owner[slot].owner != KARST_NO_NODE ? KARST_LRU_FITS : 0;
        }
        result->num_kept += what == KARST_LRU_KEPT;
        if (what == KARST_LRU_FITS) {
            lru->host_victims[result->num_fit++] = slot;
            result->num_seen = i + 1;
        }
    }
    result->num_taken = ask->all_or_none && result->num_fit < ask->need ? 0 : result->num_fit;
    karst_profile_add_host(lru->context, STAGE, karst_clock_ns() - start_ns);
}

bool karst_lru_start(karst_lru *lru, uint32_t serial, bool stand_ins, uint32_t need, const karst_lru *behind,
                     karst_lru_unlink unlink, void *user, karst_error *error)
{
    const karst_survey_list *list = &lru->survey->lists[lru->kind];
    if ((!list->valid || list->stand_ins != stand_ins) &&
        !find(lru, serial, stand_ins, stand_ins ? 1 : expected_age(lru, serial), enough(lru, need), error))
        return false;
    if (!lru->again)
        lru->least = lru->was_short ? UINT32_MAX : with_some_more(lru, need);
    if (!read_sorted(lru, lru->least, error))
        return false;
    uint32_t num = lru->num < lru->least ? lru->num : lru->least;
    lru->is_last = list->age == 1 && list->num_left_out == 0 && num == list->num;
    lru->ask = (karst_lru_ask){.num = num,
                               .need = need,
                               .all_or_none = !lru->is_last,
                               .serial = serial,
                               .stand_ins = stand_ins,
                               .need_before = behind ? behind->ask.need : 0};
    lru->started = true;
    lru->arrived = false;
    lru->host_result = (karst_lru_result){0};
    if (lru->mapped->nodes) {
        look_at_mapped(lru);
        lru->arrived = true;
        return unlink(user, lru->host_result.num_taken, error);
    }
    return launch_look(lru, behind, error) && unlink(user, need, error) &&
           karst_buffer_fetch(lru->result, 0, &lru->host_result, sizeof(lru->host_result), error);
}

bool karst_lru_recycle(karst_lru *lru, uint32_t serial, bool stand_ins, uint32_t need, karst_lru_unlink unlink,
                       void *user, karst_error *error)
{
    const karst_survey_list *list = &lru->survey->lists[lru->kind];
    const karst_lru_result *result = &lru->host_result;
    /* First the oldest, as many as should do, then more and more of them. As long as there may be more, a look that
     * finds too few leaves everything as it is: what is recycled first may make others fit. */
    for (lru->again = false;; lru->again = true) {
        bool is_here = lru->started;
        if ((!is_here && !karst_lru_start(lru, serial, stand_ins, need, NULL, unlink, user, error)) ||
            ((!is_here || !lru->arrived) && !karst_finish(lru->context, error)))
            return false;
        lru->started = lru->arrived = false;
        if (lru->is_last || result->num_taken == need)
            break;
        if (lru->ask.num == list->num && !find_more(lru, serial, stand_ins, error))
            return false;
        lru->least = lru->least > UINT32_MAX / 4 ? UINT32_MAX : 4 * lru->least;
    }
    lru->took_all_at_once = !lru->again && result->num_taken == need;
    lru->again = false;
    if (!stand_ins) {
        lru->was_short = result->num_taken < need;
        if (!lru->was_short)
            lru->expected_misfits = (uint32_t)((uint64_t)(result->num_seen - need) * 64 / need);
    }
    return true;
}
