/* Files that come with Karst are found in the source tree, in an installation and where the environment says. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/data.h"

static char program[4096], scratch[] = "/tmp/karst_data_XXXXXX";

static void make_folder(const char *name)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", scratch, name);
    assert_int_equal(mkdir(path, 0700), 0);
}

static void make_file(const char *name)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", scratch, name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_int_equal(fclose(file), 0);
}

static int set_up(void **state)
{
    (void)state;
    unsetenv("KARST_DATA_DIR");
    return mkdtemp(scratch) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    char command[64];
    snprintf(command, sizeof command, "rm -rf %s", scratch);
    return system(command);
}

static void test_source_tree(void **state)
{
    (void)state;
    char path[4096];
    karst_error error = {0};
    assert_true(karst_data_find("worlds", "alps", ".karst", path, sizeof path, &error));
    assert_non_null(strstr(path, "/demos/worlds/alps.karst"));
    assert_true(karst_data_find("paths", "orbit", ".json", path, sizeof path, &error));
    assert_int_equal(access(path, R_OK), 0);
}

static void test_paths_are_kept(void **state)
{
    (void)state;
    char path[32];
    karst_error error = {0};
    assert_true(karst_data_find("worlds", "./mine", ".karst", path, sizeof path, &error));
    assert_string_equal(path, "./mine");
    assert_true(karst_data_find("worlds", "mine.karst", ".karst", path, sizeof path, &error));
    assert_string_equal(path, "mine.karst");
    assert_false(
        karst_data_find("worlds", "./a/name/too/long/for/the/room/there/is", ".karst", path, sizeof path, &error));
    assert_int_equal(error.status, KARST_USAGE);
}

static void assert_unknown(const char *name)
{
    char path[4096];
    karst_error error = {0};
    assert_false(karst_data_find("worlds", name, ".karst", path, sizeof path, &error));
    assert_int_equal(error.status, KARST_BAD_DATA);
    assert_non_null(strstr(error.message, "no world called '"));
}

static void test_unknown(void **state)
{
    (void)state;
    assert_unknown("nowhere");
    assert_unknown("");
    assert_unknown(".karst");
    make_folder("odd");
    make_folder("odd/worlds");
    make_folder("odd/worlds/folder.karst");
    char folder[64];
    snprintf(folder, sizeof folder, "%s/odd", scratch);
    setenv("KARST_DATA_DIR", folder, 1);
    assert_unknown("folder");
    unsetenv("KARST_DATA_DIR");
}

static void test_environment_comes_first(void **state)
{
    (void)state;
    char path[4096], expected[128], names[64][KARST_DATA_NAME_BYTES];
    size_t num_shipped = karst_data_list("worlds", ".karst", names, 64);
    make_folder("worlds");
    make_file("worlds/alps.karst");
    make_file("worlds/mine.karst");
    make_file("worlds/.karst");
    make_file("worlds/mine.json");
    make_file("worlds/a_name_as_long_as_this_one_is_does_not_fit_in_a_list.karst");
    setenv("KARST_DATA_DIR", scratch, 1);
    assert_true(karst_data_find("worlds", "alps", ".karst", path, sizeof path, NULL));
    snprintf(expected, sizeof expected, "%s/worlds/alps.karst", scratch);
    assert_string_equal(path, expected);
    assert_true(karst_data_find("worlds", "dunes", ".karst", path, sizeof path, NULL)); /* and others after it */
    assert_int_equal(karst_data_list("worlds", ".karst", names, 64), num_shipped + 1);  /* alps once, and mine */
    for (size_t i = 0; i < num_shipped; i++)
        assert_true(strcmp(names[i], names[i + 1]) < 0);
    char few[2][KARST_DATA_NAME_BYTES];
    assert_int_equal(karst_data_list("worlds", ".karst", few, 2), 2); /* the first ones, whatever the folders' order */
    assert_string_equal(few[0], names[0]);
    assert_string_equal(few[1], names[1]);
    assert_int_equal(karst_data_list("worlds", ".karst", NULL, 0), 0);
    unsetenv("KARST_DATA_DIR");
}

/* This program, copied to where an installation has it, is asked what it finds. */
static void test_installation(void **state)
{
    (void)state;
    make_folder("usr");
    make_folder("usr/bin");
    make_folder("usr/share");
    make_folder("usr/share/karst");
    make_folder("usr/share/karst/worlds");
    make_file("usr/share/karst/worlds/installed.karst");
    char command[8192], found[512] = "", expected[128];
    snprintf(command, sizeof command, "cp '%s' %s/usr/bin/program && %s/usr/bin/program find installed", program,
             scratch, scratch);
    FILE *pipe = popen(command, "r");
    assert_non_null(pipe);
    assert_non_null(fgets(found, sizeof found, pipe));
    assert_int_equal(pclose(pipe), 0);
    snprintf(expected, sizeof expected, "%s/usr/share/karst/worlds/installed.karst", scratch);
    assert_string_equal(found, expected);
}

int main(int argc, char **argv)
{
    if (argc == 3 && strcmp(argv[1], "find") == 0) {
        char path[4096];
        karst_error error = {0};
        bool found = karst_data_find("worlds", argv[2], ".karst", path, sizeof path, &error);
        fputs(found ? path : error.message, stdout);
        return found ? 0 : 1;
    }
    if (!realpath(argv[0], program))
        return 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_source_tree),  cmocka_unit_test(test_paths_are_kept),
        cmocka_unit_test(test_unknown),      cmocka_unit_test(test_environment_comes_first),
        cmocka_unit_test(test_installation),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
