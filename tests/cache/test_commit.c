/* Memory behind slots, found by the thread beside: as much as was asked for and not all there is, whatever lies
 * there stays, and an end does not wait for the rest. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmocka.h>

#include "tests/support/cache_rig.h"

/* Two segments, of 32 MiB or so each. */
enum { NUM_SLOTS = 6000, SEGMENT_BYTES = 32 << 20, NUM_TILES = 20000 };

static size_t brick_bytes(const karst_cache_buffers *b)
{
    return KARST_BRICK_BYTES((size_t)b->brick_bits);
}

static karst_buffer *segment_of(const karst_cache_buffers *b, uint32_t slot, size_t *offset_bytes)
{
    *offset_bytes = slot % b->bricks_per_segment * brick_bytes(b);
    return b->bricks[slot / b->bricks_per_segment];
}

/* Is all of a part of a buffer in memory? */
static bool is_part_resident(const karst_buffer *buffer, size_t offset_bytes, size_t size_bytes)
{
    size_t page_bytes = (size_t)sysconf(_SC_PAGESIZE);
    uintptr_t first = ((uintptr_t)buffer->host + offset_bytes) & ~(uintptr_t)(page_bytes - 1);
    uintptr_t end = (uintptr_t)buffer->host + offset_bytes + size_bytes;
    for (uintptr_t page = first; page < end; page += page_bytes) {
        unsigned char resident = 0;
        assert_int_equal(mincore((void *)page, page_bytes, &resident), 0);
        if (!(resident & 1))
            return false;
    }
    return true;
}

static bool is_resident(const karst_cache_buffers *b, uint32_t slot)
{
    size_t offset_bytes;
    const karst_buffer *buffer = segment_of(b, slot, &offset_bytes);
    return is_part_resident(buffer, offset_bytes, brick_bytes(b));
}

static bool can_be_told(const karst_cache_buffers *b)
{
#ifdef MADV_POPULATE_WRITE
    return b->bricks[0]->host && madvise(NULL, 0, MADV_POPULATE_WRITE) == 0;
#else
    (void)b;
    return false;
#endif
}

static void test_as_much_as_asked_for(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_context *context = rig_open_context();
    karst_cache *cache = karst_cache_create(context, NUM_TILES, NUM_SLOTS, SEGMENT_BYTES, &error);
    rig_expect(context, "karst_cache_create", &error);
    const karst_cache_buffers *b = karst_cache_get_buffers(cache);
    assert_true(b->num_segments > 1);
    size_t offset_bytes;
    karst_buffer *segment = segment_of(b, 100, &offset_bytes);
    uint32_t words[64];
    assert_true(karst_buffer_fill(segment, 0xdeadbeef, offset_bytes, sizeof words, &error));

    karst_commit *commit = karst_commit_create(b);
    assert_non_null(commit);
    assert_int_equal(karst_commit_wait(commit), 0);
    uint32_t end = b->bricks_per_segment + 200; /* across the segments' border */
    karst_commit_until(commit, 1000);
    karst_commit_until(commit, 500); /* no step back */
    karst_commit_until(commit, end);
    assert_int_equal(karst_commit_wait(commit), end);
    assert_true(karst_buffer_read(segment, offset_bytes, words, sizeof words, &error));
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        assert_int_equal(words[i], 0xdeadbeef);
    if (can_be_told(b)) {
        for (uint32_t slot = 0; slot < end; slot++)
            assert_true(is_resident(b, slot));
        assert_false(is_resident(b, NUM_SLOTS - 1));
        assert_true(is_part_resident(b->nodes, 0, b->nodes->size_bytes));
        assert_true(is_part_resident(b->tile_info, 0, b->tile_info->size_bytes));
        assert_true(is_part_resident(b->want_rays, 0, b->want_rays->size_bytes));
    } else {
        print_message("this system does not find memory ahead\n");
    }
    karst_commit_until(commit, NUM_SLOTS);
    karst_commit_destroy(commit); /* in the middle of it */
    karst_commit_destroy(NULL);
    karst_cache_destroy(cache);
    karst_context_destroy(context);
}

/* What the cache asks for: the slots that come next, no more. */
static void test_slots_that_come_next(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_context *context = rig_open_context();
    karst_cache *cache = karst_cache_create(context, 64, NUM_SLOTS, SEGMENT_BYTES, &error);
    rig_expect(context, "karst_cache_create", &error);
    assert_null(cache->commit);
    karst_cache_commit_ahead(cache, 300);
    assert_non_null(cache->commit);
    assert_int_equal(karst_commit_wait(cache->commit), 301); /* slot 0 means none */
    karst_cache_commit_ahead(cache, 300);
    assert_int_equal(karst_commit_wait(cache->commit), 301);
    karst_cache_commit_ahead(cache, 2 * NUM_SLOTS);
    assert_int_equal(karst_commit_wait(cache->commit), NUM_SLOTS);
    karst_cache_destroy(cache);
    karst_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_as_much_as_asked_for),
        cmocka_unit_test(test_slots_that_come_next),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
