/* Devices and buffers. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/device/context.h"

/* ---- devices ---- */

/* In a child, since the ICD loader looks for drivers once in a process. Must come before any other test. */
static void test_no_driver_says_what_to_install(void **state)
{
    (void)state;
    const char *preload = getenv("LD_PRELOAD");
    if (preload && strstr(preload, "oclgrind"))
        skip(); /* it stands in for the loader */
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        setenv("OCL_ICD_VENDORS", "/nonexistent/", 1);
        setenv("OCL_ICD_FILENAMES", "", 1);
        karst_error error = {0};
        karst_context *context = karst_context_create(NULL, 0, NULL, &error);
        bool good = !context && error.status == KARST_NO_DEVICE && strstr(error.message, "install pocl-opencl-icd");
        if (!good)
            fprintf(stderr, "without a driver: status %d, %s\n", (int)error.status, error.message);
        _exit(good ? 0 : 1);
    }
    int status = 0;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
}

static void test_the_list_is_numbered_and_repeatable(void **state)
{
    (void)state;
    karst_error error = {0};
    size_t num = 0, num_again = 0;
    karst_device_info *devices = karst_context_list(&num, &error);
    karst_device_info *again = karst_context_list(&num_again, &error);
    assert_non_null(devices);
    assert_non_null(again);
    assert_int_equal(num, num_again);
    assert_true(num >= 1);
    for (size_t i = 0; i < num; i++) {
        assert_int_equal(devices[i].index, i);
        assert_ptr_equal(devices[i].device, again[i].device);
        assert_true(devices[i].name[0] && devices[i].platform_name[0] && devices[i].version[0] && devices[i].driver[0]);
        assert_true(devices[i].compute_units > 0);
        assert_true(devices[i].max_allocation_bytes > 0);
        assert_true(devices[i].global_memory_bytes >= devices[i].max_allocation_bytes);
        if (i > 0)
            assert_true(strcmp(devices[i - 1].platform_name, devices[i].platform_name) <= 0);
    }
    free(devices);
    free(again);
}

/* The device that a selector opens; fails the test if it opens none. */
static cl_device_id opened(const char *selector)
{
    karst_error error = {0};
    karst_context *context = karst_context_create(selector, 0, NULL, &error);
    if (!context)
        fail_msg("%s: %s", selector ? selector : "(default)", error.message);
    cl_device_id device = context->device;
    karst_context_destroy(context);
    return device;
}

static void test_every_device_opens_by_number_and_name(void **state)
{
    (void)state;
    karst_error error = {0};
    size_t num = 0;
    karst_device_info *devices = karst_context_list(&num, &error);
    assert_non_null(devices);
    const karst_device_info *first_cpu = NULL, *first_gpu = NULL;
    for (size_t i = 0; i < num; i++) {
        char number[24], part[129];
        if (devices[i].unusable)
            continue;
        first_cpu = first_cpu || !devices[i].is_cpu ? first_cpu : &devices[i];
        first_gpu = first_gpu || !devices[i].is_gpu ? first_gpu : &devices[i];
        snprintf(number, sizeof(number), "%zu", i);
        assert_ptr_equal(opened(number), devices[i].device);
        /* All but the first letter, in the other case: the first device that holds it. */
        snprintf(part, sizeof(part), "%s", devices[i].name + 1);
        for (char *c = part; *c; c++)
            *c = (char)(*c >= 'a' && *c <= 'z' ? *c - 32 : *c >= 'A' && *c <= 'Z' ? *c + 32 : *c);
        size_t expected = i;
        for (size_t j = i; j-- > 0;)
            if (strstr(devices[j].name, devices[i].name + 1))
                expected = j;
        assert_ptr_equal(opened(part), devices[expected].device);
    }
    if (first_cpu)
        assert_ptr_equal(opened("CPU"), first_cpu->device);
    if (first_gpu)
        assert_ptr_equal(opened("gpu"), first_gpu->device);
    const karst_device_info *standard = first_gpu ? first_gpu : first_cpu;
    if (standard) {
        assert_ptr_equal(opened(NULL), standard->device);
        assert_ptr_equal(opened(""), standard->device);
    }
    free(devices);
}

static void test_a_platform_name_selects_its_first_device(void **state)
{
    (void)state;
    karst_error error = {0};
    size_t num = 0;
    karst_device_info *devices = karst_context_list(&num, &error);
    assert_non_null(devices);
    bool is_device_name = false;
    for (size_t i = 0; i < num; i++)
        is_device_name |= strstr(devices[i].name, devices[0].platform_name) != NULL;
    if (!is_device_name && !devices[0].unusable)
        assert_ptr_equal(opened(devices[0].platform_name), devices[0].device);
    free(devices);
}

static void test_an_unknown_selector_lists_the_devices(void **state)
{
    (void)state;
    static const char *const selectors[] = {"no such thing", "999999", "99999999999999999999", "-1", " "};
    karst_error listed = {0};
    size_t num = 0;
    karst_device_info *devices = karst_context_list(&num, &listed);
    assert_non_null(devices);
    for (size_t i = 0; i < sizeof(selectors) / sizeof(*selectors); i++) {
        karst_error error = {0};
        karst_context *context = karst_context_create(selectors[i], 0, NULL, &error);
        if (context && i >= 3) { /* a minus or a blank may well stand in a name */
            karst_context_destroy(context);
            continue;
        }
        assert_null(context);
        assert_int_equal(error.status, KARST_NO_DEVICE);
        assert_non_null(strstr(error.message, selectors[i]));
        assert_non_null(strstr(error.message, devices[0].name));
    }
    free(devices);
}

static void test_lanes_follow_the_device_or_the_caller(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_context *context = karst_context_create(NULL, 0, NULL, &error);
    assert_non_null(context);
    assert_int_equal(context->lanes, context->is_cpu ? 16 : 1);
    assert_true(context->name[0] && context->compute_units > 0 && context->max_allocation_bytes > 0);
    karst_context_destroy(context);
    for (int lanes = 1; lanes <= 16; lanes += 15) {
        context = karst_context_create(NULL, lanes, NULL, &error);
        assert_non_null(context);
        assert_int_equal(context->lanes, lanes);
        karst_context_destroy(context);
    }
    assert_null(karst_context_create(NULL, 8, NULL, &error));
    assert_int_equal(error.status, KARST_USAGE);
}

/* ---- buffers ---- */

typedef struct {
    karst_context *context;
    int num_errors_logged;
} fixture;

static void count_errors(void *user, karst_log_level level, const char *line)
{
    (void)line;
    *(int *)user += level == KARST_LOG_ERROR;
}

static int set_up(void **state)
{
    static fixture f;
    static karst_log log;
    f.num_errors_logged = 0;
    log = (karst_log){count_errors, &f.num_errors_logged, KARST_LOG_ERROR};
    karst_error error = {0};
    f.context = karst_context_create(NULL, 0, &log, &error);
    *state = &f;
    if (!f.context)
        fprintf(stderr, "%s\n", error.message);
    return f.context ? 0 : -1;
}

static int tear_down(void **state)
{
    karst_context_destroy(((fixture *)*state)->context);
    return 0;
}

static void test_buffers_are_zeroed_or_copied(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    static const size_t sizes[] = {1, 3, 4, 63, 64, 65, 100000, (300u << 10) + 3, (1u << 20) + 4, 3u << 20};
    for (size_t i = 0; i < sizeof(sizes) / sizeof(*sizes); i++) {
        /* Leave something in the memory that the driver is likely to hand out again: what malloc takes of the system
         * apart it gives back at first, and keeps from the second time on. */
        for (int time = 0; time < 3; time++) {
            karst_buffer *dirty = karst_buffer_create(f->context, "dirt", (sizes[i] + 3) / 4 * 4, NULL, &error);
            assert_non_null(dirty);
            assert_true(karst_buffer_fill(dirty, 0xdeadbeef, 0, dirty->size_bytes, &error));
            karst_buffer_destroy(dirty);
        }
        unsigned char *data = malloc(sizes[i]);
        assert_non_null(data);
        memset(data, 0x55, sizes[i]);
        karst_buffer *buffer = karst_buffer_create(f->context, "zeros", sizes[i], NULL, &error);
        assert_non_null(buffer);
        assert_true(karst_buffer_read(buffer, 0, data, sizes[i], &error));
        for (size_t b = 0; b < sizes[i]; b++)
            assert_int_equal(data[b], 0);
        karst_buffer_destroy(buffer);
        for (size_t b = 0; b < sizes[i]; b++)
            data[b] = (unsigned char)(b * 7 + 1);
        buffer = karst_buffer_create(f->context, "copy", sizes[i], data, &error);
        assert_non_null(buffer);
        unsigned char *back = calloc(sizes[i], 1);
        assert_non_null(back);
        assert_true(karst_buffer_read(buffer, 0, back, sizes[i], &error));
        assert_memory_equal(back, data, sizes[i]);
        karst_buffer_destroy(buffer);
        free(back);
        free(data);
    }
    assert_int_equal(error.status, KARST_OK);
}

/* Is this byte of the buffer in memory? */
static bool is_resident(const karst_buffer *buffer, size_t offset_bytes)
{
    uintptr_t page_bytes = (uintptr_t)sysconf(_SC_PAGESIZE);
    uintptr_t page = ((uintptr_t)buffer->host + offset_bytes) & ~(page_bytes - 1);
    unsigned char resident = 0;
    assert_int_equal(mincore((void *)page, page_bytes, &resident), 0);
    return resident & 1;
}

static void test_zeros_take_no_memory_until_they_are_touched(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    const size_t size_bytes = (size_t)64 << 20;
    if (!karst_context_is_pocl(f->context))
        skip();
    karst_buffer *buffer = karst_buffer_create(f->context, "zeros", size_bytes, NULL, &error);
    assert_non_null(buffer);
    for (size_t at = 4096; at < size_bytes; at += size_bytes / 16)
        assert_false(is_resident(buffer, at));
    uint32_t word = 1;
    assert_true(karst_buffer_read(buffer, size_bytes / 2, &word, sizeof word, &error));
    assert_int_equal(word, 0);
    karst_buffer_destroy(buffer);
}

static void test_memory_is_found_ahead(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    const size_t size_bytes = (size_t)64 << 20, half_bytes = size_bytes / 2;
    karst_buffer *buffer = karst_buffer_create_blank(f->context, "blank", size_bytes, &error);
    assert_non_null(buffer);
    assert_true(karst_buffer_fill(buffer, 0xdeadbeef, 4096 + 4, 8192, &error));
    karst_buffer_commit(buffer, 1000, half_bytes - 1000);
    karst_buffer_commit(buffer, size_bytes, 4096);
    karst_buffer_commit(buffer, size_bytes + 4096, 4096);
    uint32_t words[2048];
    assert_true(karst_buffer_read(buffer, 4096 + 4, words, sizeof words, &error));
    for (size_t i = 0; i < 2048; i++)
        assert_int_equal(words[i], 0xdeadbeef);
    bool refused = false;
#ifdef MADV_POPULATE_WRITE
    refused = buffer->host && madvise(NULL, 0, MADV_POPULATE_WRITE) != 0;
    if (buffer->host && !refused) {
        assert_true(f->context->is_cpu);
        assert_false(is_resident(buffer, half_bytes + half_bytes / 2));
        for (size_t at = 1000; at < half_bytes; at += 4096)
            assert_true(is_resident(buffer, at));
        karst_buffer_commit(buffer, size_bytes - 10, 4096); /* no further than the end */
        assert_true(is_resident(buffer, size_bytes - 1));
    }
#endif
    if (refused)
        print_message("this system does not find memory ahead\n");
    karst_buffer_destroy(buffer);
    assert_int_equal(f->num_errors_logged, 0);
}

static void test_write_read_and_fill_keep_to_their_ranges(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    uint32_t data[16], back[16];
    for (uint32_t i = 0; i < 16; i++)
        data[i] = 100 + i;
    karst_buffer *buffer = karst_buffer_create(f->context, "values", sizeof(data), data, &error);
    assert_non_null(buffer);
    assert_true(karst_buffer_write(buffer, 4, &(uint32_t){7}, 4, &error));
    assert_true(karst_buffer_fill(buffer, 9, 8, 12, &error));
    memset(back, 0xee, sizeof(back));
    assert_true(karst_buffer_fetch(buffer, 0, back, sizeof(back), &error) && karst_finish(f->context, &error));
    assert_int_equal(((const uint32_t *)(const void *)back)[2], 9);
    assert_true(karst_buffer_read(buffer, 0, back, sizeof(back), &error));
    for (uint32_t i = 0; i < 16; i++)
        assert_int_equal(back[i], i == 1 ? 7 : i >= 2 && i <= 4 ? 9 : 100 + i);
    assert_true(karst_buffer_write(buffer, 64, data, 0, &error));
    assert_true(karst_buffer_fill(buffer, 1, 64, 0, &error));
    static const size_t bad[][2] = {{0, 65}, {64, 1}, {65, 0}, {4, SIZE_MAX}, {SIZE_MAX, 4}, {SIZE_MAX - 3, 8}};
    for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++) {
        karst_error refused = {0};
        assert_false(karst_buffer_write(buffer, bad[i][0], data, bad[i][1], &refused));
        assert_non_null(strstr(refused.message, "values"));
        assert_false(karst_buffer_read(buffer, bad[i][0], back, bad[i][1], NULL));
        assert_false(karst_buffer_fetch(buffer, bad[i][0], back, bad[i][1], NULL));
        assert_false(karst_buffer_fill(buffer, 0, bad[i][0], bad[i][1], NULL));
    }
    assert_false(karst_buffer_fill(buffer, 0, 2, 4, NULL));
    assert_false(karst_buffer_fill(buffer, 0, 4, 6, NULL));
    karst_buffer_destroy(buffer);
    karst_buffer_destroy(NULL);
}

static void test_what_does_not_fit_is_refused_by_name_and_size(void **state)
{
    fixture *f = *state;
    karst_context *context = f->context;
    const size_t largest = context->max_allocation_bytes, global = context->global_memory_bytes;
    context->max_allocation_bytes = (size_t)2 << 30;
    karst_error error = {0};
    assert_null(karst_buffer_create(context, "bricks", ((size_t)32 << 30) / 10, NULL, &error));
    assert_int_equal(error.status, KARST_FAILED);
    assert_string_equal(
        error.message,
        "cannot allocate 3.2 GiB for bricks: the device's largest buffer is 2.0 GiB; use a smaller --pool");
    error = (karst_error){0};
    assert_null(karst_buffer_create(context, "nodes", 0, NULL, &error));
    assert_non_null(strstr(error.message, "nodes"));
    error = (karst_error){0};
    assert_null(karst_buffer_create(context, "hits", SIZE_MAX, NULL, &error));
    assert_non_null(strstr(error.message, "16.0 EiB for hits"));

    /* All buffers together stay within the device's memory. */
    context->global_memory_bytes = 1 << 20;
    error = (karst_error){0};
    karst_buffer *first = karst_buffer_create(context, "first", 700 << 10, NULL, &error);
    assert_non_null(first);
    assert_null(karst_buffer_create(context, "second", 400 << 10, NULL, &error));
    assert_string_equal(error.message, "cannot allocate 400.0 KiB for second: the device has 1.0 MiB, of which 700.0 "
                                       "KiB are taken; use a smaller --pool");
    error = (karst_error){0};
    karst_buffer *second = karst_buffer_create(context, "second", 324 << 10, NULL, &error); /* to the last byte */
    assert_non_null(second);
    karst_buffer_destroy(first);
    karst_buffer_destroy(second);
    context->max_allocation_bytes = largest;
    context->global_memory_bytes = global;
}

static uint64_t memory_of(const karst_stats *stats, const char *name)
{
    for (size_t i = 0; i < stats->num_memory; i++)
        if (strcmp(stats->memory[i].name, name) == 0)
            return stats->memory[i].size_bytes;
    return 0;
}

static void test_every_byte_is_accounted_for(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    karst_stats *stats = calloc(1, sizeof(*stats));
    assert_non_null(stats);
    karst_buffer *a = karst_buffer_create(f->context, "bricks", 1000, NULL, &error);
    karst_buffer *b = karst_buffer_create(f->context, "nodes", 64, NULL, &error);
    karst_buffer *c = karst_buffer_create(f->context, "bricks", 24, NULL, &error);
    karst_buffer *d = karst_buffer_create(f->context, "a name that is longer than its field", 5, NULL, &error);
    assert_true(a && b && c && d);
    karst_context_memory(f->context, stats);
    assert_int_equal(stats->num_memory, 3);
    assert_int_equal(memory_of(stats, "bricks"), 1024);
    assert_int_equal(memory_of(stats, "nodes"), 64);
    assert_int_equal(memory_of(stats, "a name that is longer than its "), 5);
    karst_buffer_destroy(b); /* from the middle */
    karst_buffer_destroy(d); /* the newest */
    karst_buffer_destroy(a); /* the oldest */
    karst_context_memory(f->context, stats);
    assert_int_equal(stats->num_memory, 1);
    assert_int_equal(memory_of(stats, "bricks"), 24);
    karst_buffer_destroy(c);
    karst_context_memory(f->context, stats);
    assert_int_equal(stats->num_memory, 0);

    /* More names than the table holds: the sum stays right. */
    karst_buffer *many[72];
    uint64_t sum = 0, expected = 0;
    for (size_t i = 0; i < 72; i++) {
        char name[32];
        snprintf(name, sizeof(name), "number %zu", i);
        many[i] = karst_buffer_create(f->context, name, i + 1, NULL, &error);
        assert_non_null(many[i]);
        expected += i + 1;
    }
    karst_context_memory(f->context, stats);
    assert_int_equal(stats->num_memory, 64);
    for (size_t i = 0; i < stats->num_memory; i++)
        sum += stats->memory[i].size_bytes;
    assert_int_equal(sum, expected);
    assert_true(memory_of(stats, "other") > 0);
    for (size_t i = 0; i < 72; i++)
        karst_buffer_destroy(many[i]);
    free(stats);
    assert_int_equal(error.status, KARST_OK);
}

static void test_opengl_memory_is_accounted_for_and_nothing_more(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    karst_stats *stats = calloc(1, sizeof(*stats));
    assert_non_null(stats);
    karst_buffer *texture = karst_buffer_account(f->context, "texture", 640, &error);
    assert_non_null(texture);
    assert_null(texture->mem);
    karst_context_memory(f->context, stats);
    assert_int_equal(memory_of(stats, "texture"), 640);
    assert_false(karst_buffer_fill(texture, 0, 0, 640, &error));
    assert_non_null(strstr(error.message, "texture"));
    karst_buffer_destroy(texture);
    karst_context_memory(f->context, stats);
    assert_int_equal(stats->num_memory, 0);
    free(stats);
}

static void test_a_device_that_cannot_share_opens_without(void **state)
{
    fixture *f = *state;
    /* No OpenGL context 1 exists anywhere. */
    const cl_context_properties nowhere[] = {0x2008 /* CL_GL_CONTEXT_KHR */, 1, 0x2009 /* CL_EGL_DISPLAY_KHR */, 1, 0};
    karst_error error = {0};
    if (f->context->has_gl_sharing)
        skip(); /* a driver may well crash on what it takes for a pointer */
    karst_context *context = karst_context_create_sharing(NULL, 0, nowhere, NULL, &error);
    assert_non_null(context);
    assert_false(context->shares_gl);
    karst_context_destroy(context);
}

static void test_a_forgotten_buffer_is_told_and_safe(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    karst_buffer *a = karst_buffer_create(f->context, "forgotten", 16, NULL, &error);
    karst_buffer *b = karst_buffer_create(f->context, "forgotten too", 16, NULL, &error);
    assert_true(a && b);
    karst_context_destroy(f->context);
    f->context = NULL;
    assert_int_equal(f->num_errors_logged, 2);
    karst_buffer_destroy(a);
    karst_buffer_destroy(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_driver_says_what_to_install),
        cmocka_unit_test(test_the_list_is_numbered_and_repeatable),
        cmocka_unit_test(test_every_device_opens_by_number_and_name),
        cmocka_unit_test(test_a_platform_name_selects_its_first_device),
        cmocka_unit_test(test_an_unknown_selector_lists_the_devices),
        cmocka_unit_test(test_lanes_follow_the_device_or_the_caller),
        cmocka_unit_test_setup_teardown(test_buffers_are_zeroed_or_copied, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_zeros_take_no_memory_until_they_are_touched, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_memory_is_found_ahead, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_write_read_and_fill_keep_to_their_ranges, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_what_does_not_fit_is_refused_by_name_and_size, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_every_byte_is_accounted_for, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_opengl_memory_is_accounted_for_and_nothing_more, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_a_device_that_cannot_share_opens_without, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_a_forgotten_buffer_is_told_and_safe, set_up, tear_down),
    };
    /* PoCL offers the same processor twice when asked to: so there is something to choose from. */
    setenv("POCL_DEVICES", "pthread basic", 0);
    return cmocka_run_group_tests_name("context", tests, NULL, NULL);
}
