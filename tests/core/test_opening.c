/* Drivers opened beside: the same devices and display as by direct calls, nothing of the caller's called on the thread,
 * and nothing left open by who takes nothing. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <pthread.h>

#include "core/display/display_platform.h"
#include "core/base/log_later.h"
#include "core/display/opening.h"

/* ---- a log that knows its thread ---- */
typedef struct {
    pthread_t thread;
    int num_lines, num_elsewhere;
    char last[400];
} heard;

static void hear(void *user, karst_log_level level, const char *line)
{
    heard *h = user;
    (void)level;
    h->num_lines++;
    h->num_elsewhere += !pthread_equal(h->thread, pthread_self());
    strncpy(h->last, line, sizeof h->last - 1);
}

static void test_lines_are_kept_and_said_in_order(void **state)
{
    (void)state;
    heard h = {.thread = pthread_self()};
    const karst_log log = {.write = hear, .user = &h, .max_level = KARST_LOG_INFO};
    karst_log_later later;
    karst_log_later_init(&later, &log);
    karst_log_print(&later.log, KARST_LOG_INFO, "first %d", 1);
    karst_log_print(&later.log, KARST_LOG_DEBUG, "more than is asked for");
    karst_log_print(&later.log, KARST_LOG_WARNING, "second");
    assert_int_equal(h.num_lines, 0);
    karst_log_later_say(&later, &log);
    assert_int_equal(h.num_lines, 2);
    assert_string_equal(h.last, "second");
    karst_log_later_say(&later, &log);
    assert_int_equal(h.num_lines, 2);
    karst_log_print(&later.log, KARST_LOG_ERROR, "dropped");
    karst_log_later_say(&later, NULL);
    karst_log_later_say(&later, &log);
    assert_int_equal(h.num_lines, 2);

    karst_log_later_init(&later, NULL);
    karst_log_print(&later.log, KARST_LOG_ERROR, "to nobody");
    karst_log_later_say(&later, &log);
    assert_int_equal(h.num_lines, 2);
}

static void test_the_devices_are_those_of_the_list(void **state)
{
    (void)state;
    karst_error error = {0};
    size_t num = 0, num_listed = 0;
    karst_opening *opening = karst_opening_begin(false, KARST_DISPLAY_NONE, NULL, &error);
    assert_non_null(opening);
    const karst_device_info *devices = karst_opening_devices(opening, &num, &error);
    karst_device_info *listed = karst_context_list(&num_listed, &error);
    assert_non_null(devices);
    assert_non_null(listed);
    assert_int_equal(num, num_listed);
    for (size_t i = 0; i < num; i++) {
        assert_ptr_equal(devices[i].device, listed[i].device);
        assert_string_equal(devices[i].name, listed[i].name);
    }
    const karst_device_info *chosen = karst_context_choose(devices, num, "cpu", &error);
    assert_non_null(chosen);
    karst_context *context = karst_context_open(chosen, 0, NULL, NULL, &error);
    karst_opening_end(opening); /* a context needs the list no longer */
    assert_non_null(context);
    assert_true(karst_finish(context, &error));
    karst_context_destroy(context);
    free(listed);
}

static void test_a_display_is_current_nowhere_until_it_is_bound(void **state)
{
    (void)state;
    karst_error error = {0};
    heard h = {.thread = pthread_self()};
    const karst_log log = {.write = hear, .user = &h, .max_level = KARST_LOG_INFO};
    karst_opening *opening = karst_opening_begin(true, KARST_DISPLAY_EGL, &log, &error);
    assert_non_null(opening);
    size_t num = 0;
    assert_non_null(karst_opening_devices(opening, &num, &error));
    assert_int_equal(h.num_lines, 0);
    karst_display *display = karst_opening_display(opening, &error);
    assert_non_null(display);
    assert_true(h.num_lines > 0);
    assert_int_equal(h.num_elsewhere, 0);
    assert_non_null(strstr(h.last, "display: EGL"));
    assert_ptr_equal(display->log, &log);
    assert_false(display->platform->is_bound(display->native));
    karst_opening_end(opening); /* what was taken stays */
    assert_true(karst_display_bind(display, &error));
    assert_true(display->platform->is_bound(display->native));
    assert_non_null(display->gl.GetString(GL_VERSION));
    karst_display_leave(display);
    assert_false(display->platform->is_bound(display->native));
    karst_display_destroy(display);
}

static void test_what_fails_is_told_where_it_is_asked_for(void **state)
{
    (void)state;
    karst_error error = {0};
    /* a window's display is not to be opened so */
    karst_opening *opening = karst_opening_begin(true, KARST_DISPLAY_WINDOW, NULL, &error);
    assert_non_null(opening);
    size_t num = 0;
    assert_non_null(karst_opening_devices(opening, &num, &error));
    assert_int_equal(error.status, 0);
    assert_null(karst_opening_display(opening, &error));
    assert_int_equal(error.status, KARST_USAGE);
    karst_opening_end(opening);
}

static void test_what_nobody_takes_is_closed(void **state)
{
    (void)state;
    heard h = {.thread = pthread_self()};
    const karst_log log = {.write = hear, .user = &h, .max_level = KARST_LOG_INFO};
    karst_opening *opening = karst_opening_begin(true, KARST_DISPLAY_EGL, &log, NULL);
    assert_non_null(opening);
    karst_opening_end(opening); /* leaks are AddressSanitizer's to find */
    assert_int_equal(h.num_lines, 0);
    karst_opening_end(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lines_are_kept_and_said_in_order),
        cmocka_unit_test(test_the_devices_are_those_of_the_list),
        cmocka_unit_test(test_a_display_is_current_nowhere_until_it_is_bound),
        cmocka_unit_test(test_what_fails_is_told_where_it_is_asked_for),
        cmocka_unit_test(test_what_nobody_takes_is_closed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
