/* Errors, the log and the names of things. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/device/context.h"

static void test_the_first_error_wins(void **state)
{
    (void)state;
    karst_error error = {0};
    assert_int_equal(karst_fail(&error, KARST_BAD_WORLD, "line %d", 3), 0);
    assert_int_equal(karst_fail(&error, KARST_USAGE, "later"), 0);
    assert_int_equal(error.status, KARST_BAD_WORLD);
    assert_string_equal(error.message, "line 3");
    assert_int_equal(karst_fail(NULL, KARST_FAILED, "nobody listens"), 0);
}

static void test_an_error_is_never_ok(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_fail(&error, KARST_OK, "a mistake in a caller");
    assert_int_equal(error.status, KARST_FAILED);
}

static void test_a_message_is_one_line(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_fail(&error, KARST_FAILED, "%s", "two\nlines\tand\r\x1b[31m an escape \n\n");
    assert_string_equal(error.message, "two lines and  [31m an escape");
}

static void test_a_long_message_is_cut_between_characters(void **state)
{
    (void)state;
    /* One or two bytes in front: at least one of the three places of the cut falls inside a three-byte character. */
    for (int front = 0; front < 3; front++) {
        char text[2000] = "ab";
        size_t n = (size_t)front;
        for (; n + 3 < sizeof(text); n += 3)
            memcpy(text + n, "\xe2\x82\xac", 3); /* euro sign */
        text[n] = 0;
        karst_error error = {0};
        karst_fail(&error, KARST_FAILED, "%s", text);
        size_t length = strlen(error.message);
        assert_in_range(length, sizeof(error.message) - 5, sizeof(error.message) - 1);
        assert_string_equal(error.message + length - 3, "...");
        assert_int_equal((length - 3 - (size_t)front) % 3, 0);
        assert_memory_equal(error.message, text, length - 3);
    }
    karst_error error = {0};
    karst_fail(&error, KARST_FAILED, "%1023s", "x"); /* just fits */
    assert_int_equal(strlen(error.message), 1023);
    assert_int_equal(error.message[1022], 'x');
}

typedef struct {
    char lines[8][1500];
    karst_log_level levels[8];
    size_t num_lines;
} record;

static void record_line(void *user, karst_log_level level, const char *line)
{
    record *r = user;
    assert_true(r->num_lines < 8);
    snprintf(r->lines[r->num_lines], sizeof(r->lines[0]), "%s", line);
    r->levels[r->num_lines++] = level;
}

static void test_a_log_gets_single_lines_up_to_its_level(void **state)
{
    (void)state;
    record r = {.num_lines = 0};
    karst_log log = {record_line, &r, KARST_LOG_WARNING};
    karst_log_print(&log, KARST_LOG_INFO, "dropped");
    karst_log_print(&log, KARST_LOG_ERROR, "first %d\n\nsecond\r\nthird\n", 1);
    karst_log_print(&log, KARST_LOG_WARNING, "fourth");
    assert_int_equal(r.num_lines, 4);
    assert_string_equal(r.lines[0], "first 1");
    assert_string_equal(r.lines[1], "second");
    assert_string_equal(r.lines[2], "third");
    assert_string_equal(r.lines[3], "fourth");
    assert_int_equal(r.levels[2], KARST_LOG_ERROR);
    assert_int_equal(r.levels[3], KARST_LOG_WARNING);
}

static void test_a_log_takes_long_lines_and_may_be_missing(void **state)
{
    (void)state;
    record r = {.num_lines = 0};
    karst_log log = {record_line, &r, KARST_LOG_DEBUG};
    for (int length = 510; length <= 514; length++) { /* around the size that needs no allocation */
        r.num_lines = 0;
        karst_log_print(&log, KARST_LOG_DEBUG, "%0*d", length, 7);
        assert_int_equal(r.num_lines, 1);
        assert_int_equal(strlen(r.lines[0]), length);
        assert_int_equal(r.lines[0][length - 1], '7');
    }
    karst_log silent = {.max_level = KARST_LOG_DEBUG};
    karst_log_print(&silent, KARST_LOG_ERROR, "nobody");
    karst_log_print(NULL, KARST_LOG_ERROR, "nobody");
}

static void test_stages_have_the_names_of_the_statistics(void **state)
{
    (void)state;
    static const char *const names[KARST_NUM_STAGES] = {"cast",      "refine",   "shade",    "collect",
                                                        "subdivide", "evaluate", "finalise", "display",
                                                        "media", "sun_depth"};
    for (int i = 0; i < KARST_NUM_STAGES; i++)
        assert_string_equal(karst_stage_name((karst_stage)i), names[i]);
    assert_string_equal(karst_stage_name(KARST_NUM_STAGES), "unknown");
}

static void test_opencl_codes_have_their_names(void **state)
{
    (void)state;
    assert_string_equal(karst_cl_error_name(CL_SUCCESS), "CL_SUCCESS");
    assert_string_equal(karst_cl_error_name(-5), "CL_OUT_OF_RESOURCES");
    assert_string_equal(karst_cl_error_name(-54), "CL_INVALID_WORK_GROUP_SIZE");
    assert_string_equal(karst_cl_error_name(-1001), "CL_PLATFORM_NOT_FOUND_KHR");
    for (cl_int code = 5; code > -2000; code--)
        assert_non_null(karst_cl_error_name(code));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_first_error_wins),
        cmocka_unit_test(test_an_error_is_never_ok),
        cmocka_unit_test(test_a_message_is_one_line),
        cmocka_unit_test(test_a_long_message_is_cut_between_characters),
        cmocka_unit_test(test_a_log_gets_single_lines_up_to_its_level),
        cmocka_unit_test(test_a_log_takes_long_lines_and_may_be_missing),
        cmocka_unit_test(test_stages_have_the_names_of_the_statistics),
        cmocka_unit_test(test_opencl_codes_have_their_names),
    };
    return cmocka_run_group_tests_name("error", tests, NULL, NULL);
}
