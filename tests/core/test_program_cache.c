/* Programs kept on disk: what is kept is used, and what is damaged, foreign or old is not. */
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

#include <dirent.h>
#include <fcntl.h>

#include "core/device/program_cache.h"
#include "tests/support/files.h"

typedef struct {
    karst_context *context;
    karst_log log;
    char text[4096]; /* what was said since it was last cleared */
    char folder[64], programs[80];
} fixture;

static void note(void *user, karst_log_level level, const char *line)
{
    fixture *f = user;
    (void)level;
    size_t n = strlen(f->text);
    snprintf(f->text + n, sizeof f->text - n, "%s\n", line);
}

static void remove_entries(const char *folder)
{
    DIR *dir = opendir(folder);
    const struct dirent *entry;
    char path[400];
    while (dir && (entry = readdir(dir)) != NULL) {
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        if (entry->d_name[0] != '.' || strncmp(entry->d_name, ".turn-", 6) == 0)
            unlink(path);
    }
    if (dir)
        closedir(dir);
}

static int set_up(void **state)
{
    fixture *f = calloc(1, sizeof *f);
    karst_error error = {0};
    *state = f;
    f->log = (karst_log){.write = note, .user = f, .max_level = KARST_LOG_DEBUG};
    snprintf(f->folder, sizeof f->folder, "/tmp/karst-cache-XXXXXX");
    if (!mkdtemp(f->folder))
        return -1;
    snprintf(f->programs, sizeof f->programs, "%s/programs", f->folder);
    setenv("KARST_CACHE_DIR", f->folder, 1);
    f->context = karst_context_create(NULL, 1, &f->log, &error);
    return f->context ? 0 : -1;
}

static int tear_down(void **state)
{
    fixture *f = *state;
    karst_context_destroy(f->context);
    remove_entries(f->programs);
    rmdir(f->programs);
    rmdir(f->folder);
    free(f);
    return 0;
}

/* Builds a small program that stores `value`, runs it, and waits until it is kept. Returns whether it was loaded. */
static bool build_and_run(fixture *f, int value)
{
    karst_error error = {0};
    char options[40];
    const karst_virtual_file file = {"small.cl", "__kernel void store(__global int *out) { out[0] = VALUE; }\n"};
    snprintf(options, sizeof options, "-DVALUE=%d", value);
    f->text[0] = 0;
    karst_program *program = karst_program_build(f->context, "small.cl", options, &file, 1, &error);
    if (!program)
        fail_msg("%s", error.message);
    cl_kernel kernel = karst_program_kernel(program, "store", &error);
    karst_buffer *out = karst_buffer_create(f->context, "out", sizeof(int), NULL, &error);
    assert_non_null(kernel);
    assert_non_null(out);
    int stored = 0;
    assert_true(KARST_ARGUMENTS(kernel, &error, KARST_BUFFER_ARG(out)));
    assert_true(karst_launch(f->context, kernel, KARST_STAGE_CAST, 1, 1, &error));
    assert_true(karst_buffer_read(out, 0, &stored, sizeof stored, &error));
    assert_int_equal(stored, value);
    karst_buffer_destroy(out);
    clReleaseKernel(kernel);
    karst_program_destroy(program);
    karst_program_cache_finish(f->context);
    bool loaded = strstr(f->text, "loaded small.cl") != NULL;
    assert_true(loaded || strstr(f->text, "built small.cl"));
    return loaded;
}

/* The entries' names; returns how many. */
static int list_entries(const fixture *f, char names[][400], int max_names)
{
    DIR *dir = opendir(f->programs);
    const struct dirent *entry;
    int num = 0;
    while (dir && (entry = readdir(dir)) != NULL)
        if (entry->d_name[0] != '.' && num < max_names)
            snprintf(names[num++], 400, "%s/%s", f->programs, entry->d_name);
    if (dir)
        closedir(dir);
    return num;
}

static void test_what_was_kept_is_used(void **state)
{
    fixture *f = *state;
    char names[8][400];
    assert_false(build_and_run(f, 7));
    assert_int_equal(list_entries(f, names, 8), 1);
    assert_true(build_and_run(f, 7));
    /* Other options are another program. */
    assert_false(build_and_run(f, 8));
    assert_int_equal(list_entries(f, names, 8), 2);
    assert_true(build_and_run(f, 8));
    assert_true(build_and_run(f, 7));
    /* Deleting it is harmless. */
    remove_entries(f->programs);
    rmdir(f->programs);
    assert_false(build_and_run(f, 7));
    assert_true(build_and_run(f, 7));
}

/* Whether the entry as it now stands is taken, judged without waiting for it to be made anew. */
static bool is_taken(fixture *f, const char *path, const char *source, const char *options)
{
    karst_program_key key;
    karst_program_key_init(&key, f->context, "small.cl", options, source);
    assert_string_equal(key.path, path);
    cl_program program = karst_program_cache_load(f->context, &key, options);
    karst_program_key_free(&key);
    if (program)
        clReleaseProgram(program);
    return program != NULL;
}

static void test_what_is_damaged_is_built_anew(void **state)
{
    fixture *f = *state;
    static const char source[] = "__kernel void store(__global int *out) { out[0] = 1; }\n",
                      options[] = "-cl-std=CL1.2";
    karst_error error = {0};
    karst_program_key key;
    (void)error;
    karst_program_key_init(&key, f->context, "small.cl", options, source);
    cl_int code;
    const char *text = source;
    cl_program program = clCreateProgramWithSource(f->context->cl, 1, &text, NULL, &code);
    assert_int_equal(clBuildProgram(program, 1, &f->context->device, options, NULL, NULL), CL_SUCCESS);
    karst_program_cache_store(f->context, &key, program);
    karst_program_cache_finish(f->context);
    clReleaseProgram(program);
    size_t size;
    unsigned char *good = read_file(key.path, &size), *bad = malloc(size);
    assert_true(is_taken(f, key.path, source, options));

    /* Cut off anywhere, and longer than it says. */
    const size_t lengths[] = {0, 1, 39, 40, 41, 100, size / 2, size - 1};
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++) {
        write_file(key.path, good, lengths[i]);
        assert_false(is_taken(f, key.path, source, options));
        assert_int_equal(access(key.path, F_OK), lengths[i] == 0 ? 0 : -1); /* deleted; an empty one is just replaced */
    }
    FILE *longer = fopen(key.path, "wb");
    fwrite(good, 1, size, longer);
    fputc(0, longer);
    fclose(longer);
    assert_false(is_taken(f, key.path, source, options));
    /* One bit anywhere: header, key, binary. */
    for (size_t at = 0; at < size; at += at < 200 ? 1 : 1 + size / 97) {
        memcpy(bad, good, size);
        bad[at] ^= (unsigned char)(1 << at % 8);
        write_file(key.path, bad, size);
        if (is_taken(f, key.path, source, options))
            fail_msg("byte %zu of %zu changed, and the entry is taken", at, size);
    }
    /* As it was. */
    write_file(key.path, good, size);
    assert_true(is_taken(f, key.path, source, options));

    /* A good entry of another program under this name, as after a collision of names. */
    karst_program_key other;
    karst_program_key_init(&other, f->context, "small.cl", "-cl-std=CL1.2 -DX", source);
    assert_string_not_equal(other.path, key.path);
    write_file(other.path, good, size);
    assert_false(is_taken(f, other.path, source, "-cl-std=CL1.2 -DX"));
    /* Nor is a link followed. */
    assert_int_equal(symlink(key.path, other.path), 0);
    assert_false(is_taken(f, other.path, source, "-cl-std=CL1.2 -DX"));
    karst_program_key_free(&other);
    karst_program_key_free(&key);
    free(good);
    free(bad);
}

static void test_without_a_folder_it_is_off(void **state)
{
    fixture *f = *state;
    karst_program_key key;
    char path[200];
    static const char *const off[] = {"", "off", "/nowhere/at/all", "/dev/null/cache"};
    for (size_t i = 0; i < sizeof off / sizeof *off; i++) {
        setenv("KARST_CACHE_DIR", off[i], 1);
        karst_program_key_init(&key, f->context, "a", "b", "c");
        assert_string_equal(key.folder, "");
        karst_program_key_free(&key);
    }
    assert_false(build_and_run(f, 5));
    assert_false(build_and_run(f, 5));
    assert_null(f->context->program_backlog);

    /* A folder that others may write to is not to be trusted. */
    setenv("KARST_CACHE_DIR", f->folder, 1);
    assert_int_equal(mkdir(f->programs, 0700), 0);
    assert_int_equal(chmod(f->programs, 0777), 0);
    karst_program_key_init(&key, f->context, "a", "b", "c");
    assert_string_equal(key.folder, "");
    karst_program_key_free(&key);
    assert_int_equal(chmod(f->programs, 0700), 0);
    karst_program_key_init(&key, f->context, "a", "b", "c");
    assert_string_equal(key.folder, f->programs);
    karst_program_key_free(&key);

    /* Where it lies if nobody says. */
    unsetenv("KARST_CACHE_DIR");
    char *old_home = strdup(getenv("HOME") ? getenv("HOME") : ""), *old_xdg = getenv("XDG_CACHE_HOME");
    old_xdg = old_xdg ? strdup(old_xdg) : NULL;
    setenv("XDG_CACHE_HOME", f->folder, 1);
    karst_program_key_init(&key, f->context, "a", "b", "c");
    snprintf(path, sizeof path, "%s/karst/programs", f->folder);
    assert_string_equal(key.folder, path);
    karst_program_key_free(&key);
    rmdir(path);
    snprintf(path, sizeof path, "%s/karst", f->folder);
    rmdir(path);
    setenv("XDG_CACHE_HOME", "relative", 1); /* is to be ignored */
    setenv("HOME", f->folder, 1);
    karst_program_key_init(&key, f->context, "a", "b", "c");
    snprintf(path, sizeof path, "%s/.cache/karst/programs", f->folder);
    assert_string_equal(key.folder, path);
    karst_program_key_free(&key);
    for (int i = 0; i < 3; i++) {
        rmdir(path);
        *strrchr(path, '/') = 0;
    }
    if (old_xdg)
        setenv("XDG_CACHE_HOME", old_xdg, 1);
    else
        unsetenv("XDG_CACHE_HOME");
    setenv("HOME", old_home, 1);
    free(old_home);
    free(old_xdg);
}

static void test_its_size_is_bounded(void **state)
{
    fixture *f = *state;
    char names[16][400], path[200];
    assert_false(build_and_run(f, 1));
    /* Files without blocks: 40 MiB each in name only. The older the number, the longer ago. */
    for (int i = 0; i < 8; i++) {
        snprintf(path, sizeof path, "%s/old%d.program", f->programs, i);
        FILE *file = fopen(path, "wb");
        assert_non_null(file);
        assert_int_equal(ftruncate(fileno(file), 40 << 20), 0);
        struct timespec then = {.tv_sec = 1000000000 + 1000 * i};
        assert_int_equal(futimens(fileno(file), (const struct timespec[2]){then, then}), 0);
        fclose(file);
    }
    snprintf(path, sizeof path, "%s/dead.new", f->programs);
    write_file(path, (const unsigned char *)"x", 1);
    struct timespec then = {.tv_sec = 1000000000};
    assert_int_equal(utimensat(AT_FDCWD, path, (const struct timespec[2]){then, then}, 0), 0);
    assert_false(build_and_run(f, 2));
    /* Of 320 MiB, what fits into three quarters of 256 is left: the four youngest, and both that are in use. */
    assert_int_equal(list_entries(f, names, 16), 6);
    for (int i = 0; i < 8; i++) {
        snprintf(path, sizeof path, "%s/old%d.program", f->programs, i);
        assert_int_equal(access(path, F_OK), i < 4 ? -1 : 0);
    }
    assert_true(build_and_run(f, 1));
    assert_true(build_and_run(f, 2));
}

/* Closing a device right after building: what was not kept yet is dropped, and no half file stays. */
static void test_closing_at_once(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    const karst_virtual_file file = {"small.cl", "__kernel void store(__global int *out) { out[0] = 9; }\n"};
    karst_program *program = karst_program_build(f->context, "small.cl", NULL, &file, 1, &error);
    assert_non_null(program);
    karst_program_destroy(program);
    karst_context_destroy(f->context);
    char names[4][400];
    int num = list_entries(f, names, 4);
    for (int i = 0; i < num; i++)
        assert_non_null(strstr(names[i], ".program"));
    f->context = karst_context_create(NULL, 1, &f->log, &error);
    assert_non_null(f->context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_what_was_kept_is_used, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_what_is_damaged_is_built_anew, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_without_a_folder_it_is_off, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_its_size_is_bounded, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_closing_at_once, set_up, tear_down),
    };
    return cmocka_run_group_tests_name("program cache", tests, NULL, NULL);
}
