/* karst info: all that is there is named, and what is missing comes with its package. */
#include <dlfcn.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/engine.h"

static const char *hidden;

/* The library's own calls of dlopen end up here. */
void *dlopen(const char *name, int flags)
{
    static void *(*real)(const char *, int);
    if (!real)
        *(void **)&real = dlsym(RTLD_NEXT, "dlopen");
    return real(name && hidden && strstr(name, hidden) ? "libnot-installed.so" : name, flags);
}

static char heard[65536];
static void hear(void *user, const char *line)
{
    assert_ptr_equal(user, heard);
    assert_null(strchr(line, '\n'));
    strncat(heard, line, sizeof heard - strlen(heard) - 2);
    strcat(heard, "\n");
}

static void listen_to_info(void)
{
    heard[0] = '\0';
    karst_info(hear, heard);
}

/* The line that begins with `start`, after blanks; "" if there is none. */
static const char *line_of(const char *start)
{
    static char line[4096];
    for (const char *at = heard; *at; at = strchr(at, '\n') + 1) {
        const char *text = at + strspn(at, " ");
        if (strncmp(text, start, strlen(start)) == 0) {
            snprintf(line, sizeof line, "%.*s", (int)strcspn(text, "\n"), text);
            return line;
        }
    }
    return "";
}

/* In a child, before anything here has asked the loader for devices: it looks only once. */
static void test_no_device(void **state)
{
    (void)state;
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        setenv("OCL_ICD_VENDORS", "/nonexistent", 1);
        setenv("OPENCL_VENDOR_PATH", "/nonexistent", 1);
        listen_to_info();
        _exit(strstr(line_of("none: "), "pocl-opencl-icd") && strstr(heard, "displays (") ? 0 : 1);
    }
    int status = -1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
}

static void test_everything_is_named(void **state)
{
    (void)state;
    listen_to_info();
    assert_non_null(strstr(line_of("libkarst"), karst_version()));
    assert_non_null(strstr(line_of("libkarst"), "compiled by "));
    assert_true(line_of("0  ")[0]);
    assert_non_null(strstr(heard, ", the default"));
    assert_non_null(strstr(heard, "largest buffer "));
    assert_non_null(strstr(line_of("egl "), "OpenGL "));
    assert_non_null(strstr(line_of("osmesa "), "OpenGL "));
    assert_non_null(strstr(line_of("none "), "read from the device"));
    assert_non_null(strstr(line_of("limits: "), "16384 x 16384"));
    assert_null(strstr(heard, "missing"));
}

static void test_missing_display(void **state)
{
    (void)state;
    hidden = "libEGL";
    listen_to_info();
    assert_non_null(strstr(line_of("egl "), "install libegl1, libegl-mesa0 and libgl1-mesa-dri"));
    assert_non_null(strstr(line_of("osmesa "), "the default"));
    hidden = "libOSMesa";
    listen_to_info();
    assert_non_null(strstr(line_of("osmesa "), "install libosmesa6"));
    assert_non_null(strstr(line_of("egl "), "the default"));
    hidden = NULL;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_device), /* first */
        cmocka_unit_test(test_everything_is_named),
        cmocka_unit_test(test_missing_display),
    };
    return cmocka_run_group_tests_name("info", tests, NULL, NULL);
}
