/* Usage lists: launchers of lru.cl, the passes and the sort. */
#include "cache/lru.h"

#include <stdlib.h>

#define STAGE KARST_STAGE_COLLECT

bool karst_lru_init(karst_lru *lru, karst_context *context, karst_program *program, uint32_t kind,
                    const karst_cache_buffers *pools, karst_error *error)
{
    bool tiles = kind == KARST_LRU_TILES;
    *lru = (karst_lru){.context = context, .shape = karst_shape_of(context), .kind = kind};
    lru->num = (tiles ? pools->num_tiles : pools->num_bricks) - 1;
    lru->stamps = tiles ? pools->tile_stamp : pools->brick_stamp;
    lru->fallback =
        tiles ? pools->tile_stamp : pools->brick_fallback; /* tiles have one stamp: the later of two equal ones */
    lru->nodes = pools->nodes;
    lru->tile_info = pools->tile_info;
    lru->brick_owner = pools->brick_owner;
    size_t num_chunks = karst_shape_chunks(&lru->shape, lru->num);
    lru->order = karst_buffer_create(context, "usage_lists", lru->num * sizeof(uint32_t), NULL, error);
    lru->spare = karst_buffer_create(context, "usage_lists", lru->num * sizeof(uint32_t), NULL, error);
    lru->marks =
        karst_buffer_create(context, "usage_lists", ((size_t)lru->num + 31) / 32 * sizeof(cl_uint2), NULL, error);
    lru->counts =
        karst_buffer_create(context, "usage_lists", num_chunks * KARST_LRU_RADIX_SIZE * sizeof(cl_uint2), NULL, error);
    lru->totals = karst_buffer_create(context, "usage_lists", sizeof(cl_uint2), NULL, error);
    if (!lru->order || !lru->spare || !lru->marks || !lru->counts || !lru->totals)
        return false;
    return (lru->mark = karst_program_kernel(program, "karst_lru_mark", error)) &&
           (lru->scan = karst_program_kernel(program, "karst_lru_scan", error)) &&
           (lru->part = karst_program_kernel(program, "karst_lru_part", error)) &&
           (lru->sort_mark = karst_program_kernel(program, "karst_lru_sort_mark", error)) &&
           (lru->sort_part = karst_program_kernel(program, "karst_lru_sort_part", error)) &&
           (lru->digit_count = karst_program_kernel(program, "karst_lru_digit_count", error)) &&
           (lru->digit_part = karst_program_kernel(program, "karst_lru_digit_part", error)) &&
           karst_lru_reset(lru, error);
}

void karst_lru_finish(karst_lru *lru)
{
    cl_kernel kernels[] = {lru->mark,      lru->scan,        lru->part,      lru->sort_mark,
                           lru->sort_part, lru->digit_count, lru->digit_part};
    for (size_t i = 0; i < sizeof(kernels) / sizeof(kernels[0]); i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_buffer_destroy(lru->order);
    karst_buffer_destroy(lru->spare);
    karst_buffer_destroy(lru->marks);
    karst_buffer_destroy(lru->counts);
    karst_buffer_destroy(lru->totals);
    *lru = (karst_lru){0};
}

bool karst_lru_reset(karst_lru *lru, karst_error *error)
{
    uint32_t *slots = malloc(lru->num * sizeof(*slots));
    if (!slots)
        return karst_fail(error, KARST_FAILED, "out of memory for a list of %u slots", lru->num);
    for (uint32_t i = 0; i < lru->num; i++)
        slots[i] = i + 1;
    bool ok = karst_buffer_write(lru->order, 0, slots, lru->num * sizeof(*slots), error);
    free(slots);
    lru->cursor = 0;
    lru->started = false;
    return ok;
}

void karst_lru_begin(karst_lru *lru, uint32_t serial)
{
    if (lru->started)
        return;
    /* Everything that will ever be handed out is used at this serial or later. */
    lru->sorted_serial = serial - 1;
    lru->started = true;
}

static bool launch_chunks(karst_lru *lru, cl_kernel kernel, uint32_t num, karst_error *error)
{
    return karst_launch(lru->context, kernel, STAGE, karst_shape_chunks(&lru->shape, num), lru->shape.chunk_local,
                        error);
}

static bool launch_mark(karst_lru *lru, karst_lru_window window, karst_error *error)
{
    return KARST_ARGUMENTS(lru->mark, error, KARST_BUFFER_ARG(lru->order), KARST_BUFFER_ARG(lru->stamps),
                           KARST_BUFFER_ARG(lru->fallback), KARST_BUFFER_ARG(lru->nodes),
                           KARST_BUFFER_ARG(lru->tile_info), KARST_BUFFER_ARG(lru->brick_owner),
                           KARST_VALUE_ARG(window), KARST_BUFFER_ARG(lru->marks), KARST_BUFFER_ARG(lru->counts)) &&
           launch_chunks(lru, lru->mark, window.num, error);
}

static bool launch_scan(karst_lru *lru, uint32_t num_counts, karst_error *error)
{
    return KARST_ARGUMENTS(lru->scan, error, KARST_BUFFER_ARG(lru->counts), KARST_VALUE_ARG(num_counts),
                           KARST_BUFFER_ARG(lru->totals)) &&
           karst_launch(lru->context, lru->scan, STAGE, lru->shape.scan_width, lru->shape.scan_width, error);
}

static bool launch_part(karst_lru *lru, karst_lru_window window, karst_buffer *victims, karst_error *error)
{
    return KARST_ARGUMENTS(lru->part, error, KARST_BUFFER_ARG(lru->order), KARST_BUFFER_ARG(lru->marks),
                           KARST_BUFFER_ARG(lru->counts), KARST_BUFFER_ARG(lru->totals), KARST_VALUE_ARG(window),
                           KARST_BUFFER_ARG(lru->stamps), KARST_BUFFER_ARG(lru->spare), KARST_BUFFER_ARG(victims)) &&
           launch_chunks(lru, lru->part, window.num, error);
}

static bool launch_sort_mark(karst_lru *lru, karst_error *error)
{
    return KARST_ARGUMENTS(lru->sort_mark, error, KARST_BUFFER_ARG(lru->order), KARST_BUFFER_ARG(lru->stamps),
                           KARST_BUFFER_ARG(lru->fallback), KARST_VALUE_ARG(lru->num),
                           KARST_VALUE_ARG(lru->sorted_serial), KARST_BUFFER_ARG(lru->marks),
                           KARST_BUFFER_ARG(lru->counts)) &&
           launch_chunks(lru, lru->sort_mark, lru->num, error);
}

static bool launch_sort_part(karst_lru *lru, karst_error *error)
{
    return KARST_ARGUMENTS(lru->sort_part, error, KARST_BUFFER_ARG(lru->order), KARST_BUFFER_ARG(lru->marks),
                           KARST_BUFFER_ARG(lru->counts), KARST_BUFFER_ARG(lru->totals), KARST_VALUE_ARG(lru->num),
                           KARST_BUFFER_ARG(lru->spare)) &&
           launch_chunks(lru, lru->sort_part, lru->num, error);
}

static bool launch_digit_count(karst_lru *lru, uint32_t first, uint32_t num, uint32_t shift, karst_error *error)
{
    return KARST_ARGUMENTS(lru->digit_count, error, KARST_BUFFER_ARG(lru->order), KARST_BUFFER_ARG(lru->stamps),
                           KARST_BUFFER_ARG(lru->fallback), KARST_VALUE_ARG(first), KARST_VALUE_ARG(num),
                           KARST_VALUE_ARG(lru->sorted_serial), KARST_VALUE_ARG(shift),
                           KARST_BUFFER_ARG(lru->counts)) &&
           launch_chunks(lru, lru->digit_count, num, error);
}

static bool launch_digit_part(karst_lru *lru, uint32_t first, uint32_t num, uint32_t shift, karst_error *error)
{
    return KARST_ARGUMENTS(lru->digit_part, error, KARST_BUFFER_ARG(lru->order), KARST_BUFFER_ARG(lru->stamps),
                           KARST_BUFFER_ARG(lru->fallback), KARST_BUFFER_ARG(lru->counts), KARST_VALUE_ARG(first),
                           KARST_VALUE_ARG(num), KARST_VALUE_ARG(lru->sorted_serial), KARST_VALUE_ARG(shift),
                           KARST_BUFFER_ARG(lru->spare)) &&
           launch_chunks(lru, lru->digit_part, num, error);
}

/* Takes a piece of `spare` over into the list. */
static bool copy_back(karst_lru *lru, uint32_t first, uint32_t num, karst_error *error)
{
    cl_int code = clEnqueueCopyBuffer(lru->context->queue, lru->spare->mem, lru->order->mem, first * sizeof(uint32_t),
                                      first * sizeof(uint32_t), num * sizeof(uint32_t), 0, NULL, NULL);
    if (code != CL_SUCCESS)
        return karst_fail(error, KARST_FAILED, "cannot copy within the usage lists: %s", karst_cl_error_name(code));
    return true;
}

bool karst_lru_take(karst_lru *lru, uint32_t serial, bool drop_fallback, uint32_t need, karst_buffer *victims,
                    uint32_t victims_first, uint32_t *num_taken, karst_error *error)
{
    uint32_t length = lru->shape.chunk * lru->shape.busy_chunks;
    if (length < 2 * need)
        length = 2 * need;
    *num_taken = 0;
    if (drop_fallback)
        lru->cursor = 0; /* stand-ins count as used: other passes left them behind */
    for (uint32_t at = lru->cursor; need > 0 && at < lru->num;) {
        if (length > lru->num - at)
            length = lru->num - at;
        karst_lru_window window = {lru->kind,          at,           length, need, victims_first, serial,
                                   lru->sorted_serial, drop_fallback};
        uint32_t totals[2];
        if (!launch_mark(lru, window, error) || !launch_scan(lru, karst_shape_chunks(&lru->shape, length), error) ||
            !launch_part(lru, window, victims, error) || !copy_back(lru, at, length, error) ||
            !karst_buffer_read(lru->totals, 0, totals, sizeof(totals), error))
            return false;
        uint32_t taken = totals[0] < need ? totals[0] : need;
        /* Nothing was kept before this window: what is gone is behind the cursor for good. */
        if (lru->cursor == at)
            lru->cursor += taken + totals[1];
        *num_taken += taken;
        victims_first += taken;
        need -= taken;
        at += length;
        length = length > lru->num / 2 ? lru->num : 2 * length;
    }
    return true;
}

bool karst_lru_sort(karst_lru *lru, uint32_t serial, karst_error *error)
{
    if (lru->sorted_serial == serial - 1)
        return true;
    uint32_t totals[2];
    if (!launch_sort_mark(lru, error) || !launch_scan(lru, karst_shape_chunks(&lru->shape, lru->num), error) ||
        !launch_sort_part(lru, error) || !karst_buffer_read(lru->totals, 0, totals, sizeof(totals), error))
        return false;
    karst_buffer *swap = lru->order;
    lru->order = lru->spare;
    lru->spare = swap;
    /* Those used since the last sort stand behind, by slot; uses are 1 to `span` casts after it. */
    uint32_t first = totals[0], num = totals[1], span = serial - lru->sorted_serial;
    for (uint32_t shift = 0; num > 1 && span > 1 && shift < 32 && span >> shift; shift += KARST_LRU_RADIX_BITS)
        if (!launch_digit_count(lru, first, num, shift, error) ||
            !launch_scan(lru, karst_shape_chunks(&lru->shape, num) * KARST_LRU_RADIX_SIZE, error) ||
            !launch_digit_part(lru, first, num, shift, error) || !copy_back(lru, first, num, error))
            return false;
    /* What this round hands out will be stamped with `serial` too, and is behind everything else. */
    lru->sorted_serial = serial - 1;
    lru->cursor = 0;
    return true;
}
