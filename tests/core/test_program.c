/* Kernel sources put together, and programs built from them. */
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

#include "core/device/build_log.h"
#include "core/device/embedded.h"
#include "core/device/source.h"

#define COUNT(array) (sizeof(array) / sizeof(*(array)))

/* ---- sources ---- */

static void assert_expands(const char *entry, const karst_virtual_file *files, size_t num_files, const char *expected)
{
    karst_error error = {0};
    char *text = karst_source_expand(entry, files, num_files, &error);
    if (!text)
        fail_msg("%s", error.message);
    assert_string_equal(text, expected);
    free(text);
}

static void assert_refused(const char *entry, const karst_virtual_file *files, size_t num_files, const char *expected)
{
    karst_error error = {0};
    assert_null(karst_source_expand(entry, files, num_files, &error));
    assert_int_equal(error.status, KARST_FAILED);
    assert_string_equal(error.message, expected);
}

static void test_each_file_comes_once_and_lines_keep_their_numbers(void **state)
{
    (void)state;
    const karst_virtual_file files[] = {
        {"a.cl", "one\n#include \"b.clh\"\nthree\n  #  include \"sub/c.clh\" // why\nfive"},
        {"b.clh", "#include \"sub/c.clh\"\nb2\n"},
        {"sub/c.clh", "c1\n#include <math.h>\n"},
    };
    assert_expands("a.cl", files, COUNT(files),
                   "#line 1 \"a.cl\"\none\n"
                   "#line 1 \"b.clh\"\n"
                   "#line 1 \"sub/c.clh\"\nc1\n#include <math.h>\n"
                   "#line 1 \"b.clh\"\n\nb2\n"
                   "#line 2 \"a.cl\"\n\nthree\n // why\nfive\n");
}

static void test_comments_and_text_are_no_includes(void **state)
{
    (void)state;
    const karst_virtual_file files[] = {
        {"a.cl", "// #include \"x\"\n/* \n#include \"x\"\n */ int a; /* // */\n#define S \"/*\"\n#include \"b\"\n'\"' "
                 "/*\n#include \"x\"\n*/\n"},
        {"b", "b1\n"},
    };
    assert_expands("a.cl", files, COUNT(files),
                   "#line 1 \"a.cl\"\n// #include \"x\"\n/* \n#include \"x\"\n */ int a; /* // */\n#define S \"/*\"\n"
                   "#line 1 \"b\"\nb1\n#line 6 \"a.cl\"\n\n'\"' /*\n#include \"x\"\n*/\n");
}

static void test_an_include_in_one_branch_does_not_count_in_others(void **state)
{
    (void)state;
    const karst_virtual_file files[] = {
        {"a.cl",
         "#if X\n#include \"b\"\n#include \"b\"\n#else\n#include \"b\"\n#endif\n#include \"b\"\n#include \"b\"\n"},
        {"b", "b1\n"},
    };
    assert_expands("a.cl", files, COUNT(files),
                   "#line 1 \"a.cl\"\n#if X\n#line 1 \"b\"\nb1\n#line 2 \"a.cl\"\n\n\n#else\n#line 1 \"b\"\nb1\n#line "
                   "5 \"a.cl\"\n\n#endif\n"
                   "#line 1 \"b\"\nb1\n#line 7 \"a.cl\"\n\n\n");
}

static void test_an_include_guard_is_no_branch(void **state)
{
    (void)state;
    const karst_virtual_file files[] = {
        {"a.cl", "#include \"g\"\n#include \"b\"\n"},
        {"g", "/* why */\n#ifndef G\n#define G\n#include \"b\"\n#endif\n"},
        {"b", "b1\n"},
    };
    assert_expands(
        "a.cl", files, COUNT(files),
        "#line 1 \"a.cl\"\n#line 1 \"g\"\n/* why */\n#ifndef G\n#define G\n#line 1 \"b\"\nb1\n#line 4 \"g\"\n\n#endif\n"
        "#line 1 \"a.cl\"\n\n\n");
}

static void test_circles_end(void **state)
{
    (void)state;
    const karst_virtual_file files[] = {
        {"a", "#include \"b\"\na2\n"},
        {"b", "#if X\n#include \"a\"\n#include \"b\"\n#endif\nb5\n"},
    };
    assert_expands("a", files, COUNT(files),
                   "#line 1 \"a\"\n#line 1 \"b\"\n#if X\n\n\n#endif\nb5\n#line 1 \"a\"\n\na2\n");
}

static void test_what_cannot_be_included_names_file_and_line(void **state)
{
    (void)state;
    const karst_virtual_file files[] = {
        {"a", "\n#include \"missing.clh\"\n"}, {"b", "x\n\n#include \"a\"\n"},          {"c", "#include \"../a\"\n"},
        {"d", "#include \"/etc/passwd\"\n"},   {"e", "#include \"x\n#include \"a\"\n"}, {"f", "#include \"\"\n"},
    };
    const size_t n = COUNT(files);
    assert_refused("a", files, n, "a:2: there is no kernel source \"missing.clh\"");
    assert_refused("b", files, n, "a:2: there is no kernel source \"missing.clh\"");
    assert_refused("c", files, n, "c:1: \"../a\" is no path from the top of Karst's sources");
    assert_refused("d", files, n, "d:1: \"/etc/passwd\" is no path from the top of Karst's sources");
    assert_refused("e", files, n, "e:1: the path of this #include has no end");
    assert_refused("f", files, n, "f:1: \"\" is no path from the top of Karst's sources");
    assert_refused("none.cl", files, n, "there is no kernel source \"none.cl\"");
}

static void test_nesting_is_bounded(void **state)
{
    (void)state;
    enum { DEEP = 40 };
    karst_virtual_file files[DEEP];
    char paths[DEEP][16], texts[DEEP][32];
    for (int i = 0; i < DEEP; i++) {
        snprintf(paths[i], sizeof(paths[i]), "f%d", i);
        snprintf(texts[i], sizeof(texts[i]), "#include \"f%d\"\n", i + 1);
        files[i] = (karst_virtual_file){paths[i], texts[i]};
    }
    assert_refused("f0", files, DEEP, "f32:1: includes are nested more than 32 deep");
    strcpy(texts[32], "the end\n");
    karst_error error = {0};
    char *text = karst_source_expand("f0", files, DEEP, &error);
    assert_non_null(text);
    assert_non_null(strstr(text, "the end\n"));
    free(text);
}

static char folder[] = "/tmp/karst_test_program_XXXXXX";

static void write_file(const char *path, const char *text, size_t length)
{
    char name[256];
    snprintf(name, sizeof(name), "%s/%s", folder, path);
    FILE *file = fopen(name, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(text, 1, length, file), length);
    assert_int_equal(fclose(file), 0);
}

static int make_folder(void **state)
{
    (void)state;
    char core[256], device[256];
    if (!mkdtemp(folder))
        return -1;
    snprintf(core, sizeof(core), "%s/core", folder);
    snprintf(device, sizeof(device), "%s/core/device", folder);
    return mkdir(core, 0700) || mkdir(device, 0700) || setenv("KARST_KERNEL_DIR", folder, 1);
}

static int remove_folder(void **state)
{
    (void)state;
    static const char *const names[] = {"core/device/dialect.h", "a.cl", "binary.cl", "core/device", "core"};
    for (size_t i = 0; i < COUNT(names); i++) {
        char name[256];
        snprintf(name, sizeof(name), "%s/%s", folder, names[i]);
        remove(name);
    }
    unsetenv("KARST_KERNEL_DIR");
    return rmdir(folder);
}

static void test_the_kernel_folder_goes_before_the_embedded_sources(void **state)
{
    (void)state;
    const karst_virtual_file files[] = {
        {"v.cl", "#include \"core/device/dialect.h\"\n#include \"core/device/lanes.clh\"\n"}, {"a.cl", "virtual\n"}};
    write_file("core/device/dialect.h", "from the disk\n", 14);
    write_file("a.cl", "on the disk\n", 12);
    karst_error error = {0};
    char *text = karst_source_expand("v.cl", files, COUNT(files), &error);
    assert_non_null(text);
    assert_non_null(strstr(text, "#line 1 \"core/device/dialect.h\"\nfrom the disk\n"));
    assert_non_null(strstr(text, "v_gather_float")); /* what the folder does not have is embedded */
    free(text);
    assert_expands("a.cl", files, COUNT(files), "#line 1 \"a.cl\"\nvirtual\n"); /* handed in goes first */
    assert_expands("a.cl", NULL, 0, "#line 1 \"a.cl\"\non the disk\n");

    write_file("binary.cl", "a\0b", 3);
    assert_null(karst_source_expand("binary.cl", NULL, 0, &error));
    assert_non_null(strstr(error.message, "binary.cl"));
    assert_non_null(strstr(error.message, "not text"));
    error = (karst_error){0};
    assert_null(karst_source_expand("core", NULL, 0, &error)); /* a folder */
    assert_non_null(strstr(error.message, "KARST_KERNEL_DIR"));
    size_t size = 100000;
    char *large = malloc(size + 1);
    assert_non_null(large);
    memset(large, 'x', size);
    large[size] = 0;
    write_file("a.cl", large, size);
    text = karst_source_expand("a.cl", NULL, 0, &error);
    assert_non_null(text);
    assert_int_equal(strlen(text), strlen("#line 1 \"a.cl\"\n") + size + 1);
    free(large);
    free(text);
}

/* Quoting must not change a byte of any kernel. */
static void test_embedded_sources_are_the_files(void **state)
{
    (void)state;
    size_t num_files = 0;
    for (const karst_embedded_file *e = karst_embedded_files; e->path; e++) {
        FILE *file = fopen(e->path, "rb");
        if (!file)
            skip(); /* not run from the sources' folder */
        size_t length = strlen(e->text);
        char *text = calloc(length + 2, 1);
        assert_non_null(text);
        assert_int_equal(fread(text, 1, length + 2, file), length);
        assert_memory_equal(text, e->text, length);
        fclose(file);
        free(text);
        num_files++;
    }
    assert_true(num_files >= 2);
}

/* ---- programs ---- */

typedef struct {
    karst_context *context;
    karst_log log;
    char text[20000]; /* errors logged */
    size_t length;
} fixture;

static void keep_line(void *user, karst_log_level level, const char *line)
{
    fixture *f = user;
    if (level == KARST_LOG_ERROR && f->length < sizeof(f->text))
        f->length += (size_t)snprintf(f->text + f->length, sizeof(f->text) - f->length, "%s\n", line);
}

static int set_up(void **state)
{
    static fixture f;
    memset(&f, 0, sizeof(f));
    f.log = (karst_log){keep_line, &f, KARST_LOG_DEBUG};
    karst_error error = {0};
    f.context = karst_context_create(NULL, 0, &f.log, &error);
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

static void test_a_program_runs_with_its_options_and_files(void **state)
{
    fixture *f = *state;
    const karst_virtual_file files[] = {
        {"test.cl", "#include \"core/device/lanes.clh\"\n#include \"world.clh\"\n"
                    "__kernel void tell(__global int *out) { out[0] = WORLD; out[1] = LANES; out[2] = "
                    "KARST_DEVICE_CPU; out[3] = OPTION; }\n"},
        {"world.clh", "#define WORLD 77\n"},
    };
    for (int lanes = 1; lanes <= 16; lanes += 15) {
        karst_error error = {0};
        int out[4];
        f->context->lanes = lanes;
        karst_program *program = karst_program_build(f->context, "test.cl", "-DOPTION=5", files, COUNT(files), &error);
        if (!program)
            fail_msg("%s", error.message);
        cl_kernel kernel = karst_program_kernel(program, "tell", &error);
        assert_non_null(kernel);
        karst_buffer *buffer = karst_buffer_create(f->context, "out", sizeof(out), NULL, &error);
        assert_non_null(buffer);
        assert_true(KARST_ARGUMENTS(kernel, &error, KARST_BUFFER_ARG(buffer)));
        assert_true(karst_launch(f->context, kernel, KARST_STAGE_CAST, 1, 1, &error));
        assert_true(karst_buffer_read(buffer, 0, out, sizeof(out), &error));
        assert_int_equal(out[0], 77);
        assert_int_equal(out[1], lanes);
        assert_int_equal(out[2], f->context->is_cpu);
        assert_int_equal(out[3], 5);
        karst_buffer_destroy(buffer);
        assert_null(karst_program_kernel(program, "whisper", &error));
        assert_non_null(strstr(error.message, "test.cl has no kernel whisper"));
        clReleaseKernel(kernel);
        karst_program_destroy(program);
    }
    karst_program_destroy(NULL);
}

/* oclgrind is run for its checks of memory; its compiler does not read #line. */
static void skip_without_line_directives(const fixture *f)
{
    if (strstr(f->context->name, "Oclgrind"))
        skip();
}

static void assert_has(const char *text, const char *part)
{
    if (!strstr(text, part))
        fail_msg("\"%s\" is not in: %s", part, text);
}

static void test_a_build_error_points_at_file_and_line(void **state)
{
    fixture *f = *state;
    skip_without_line_directives(f);
    const karst_virtual_file in_world[] = {
        {"test.cl", "#include \"core/device/lanes.clh\"\n#include \"world.clh\"\n"
                    "__kernel void k(__global int *out) { out[0] = world(1); }\n"},
        {"world.clh", "int world(int x)\n{\n    return x + missing_name;\n}\n"},
    };
    karst_error error = {0};
    assert_null(karst_program_build(f->context, "test.cl", NULL, in_world, COUNT(in_world), &error));
    assert_int_equal(error.status, KARST_FAILED);
    assert_has(error.message, "cannot build test.cl: ");
    assert_has(error.message, "world.clh:3:16: ");
    assert_has(error.message, "missing_name");
    assert_has(f->text, "world.clh:3:16: ");

    /* Behind an include, the including file's own lines count on. */
    const karst_virtual_file in_entry[] = {
        {"test.cl", "#include \"core/device/lanes.clh\"\n\n#include \"world.clh\"\n"
                    "__kernel void k(__global int *out) { out[0] = wolrd; }\n"},
        {"world.clh", "int world(int x) { return x; }\n"},
    };
    error = (karst_error){0};
    assert_null(karst_program_build(f->context, "test.cl", "", in_entry, COUNT(in_entry), &error));
    assert_has(error.message, "test.cl:4:");
    assert_has(error.message, "wolrd");
}

static void assert_places(const char *log, const char *expected)
{
    static const char source[] = "#define EARLY\n"
                                 "#line 1 \"test.cl\"\n"
                                 "/* one */\n"
                                 "#line 1 \"core/world.clh\"\n"
                                 "int world;\n"
                                 "int two;\n"
                                 "#line 3 \"test.cl\"\n"
                                 "int three;";
    char *text = karst_build_log_with_places(log, source);
    assert_non_null(text);
    assert_string_equal(text, expected);
    free(text);
}

static void test_places_of_compilers_that_read_no_line_directives(void **state)
{
    (void)state;
    assert_places("<kernel>:3:5: error: a\n  code\n<kernel>:6:1: note: b",
                  "test.cl:1:5: error: a\n  code\ncore/world.clh:2:1: note: b");
    assert_places("<kernel>:8:2: c\n", "test.cl:3:2: c\n");
    assert_places("<kernel>:99:2: behind the end", "test.cl:4:2: behind the end");
    static const char *const same[] = {"", "\n\n", "<kernel>:1:1: before all", "<kernel>", "<kernel>:", "<kernel>:x",
                                       "<kernel>:5", "<kernel>:-3:1: d", "<kernel>:99999999999999999999",
                                       "in <kernel>:3:1: e", "test.cl:4:2: f"};
    for (size_t i = 0; i < COUNT(same); i++)
        assert_places(same[i], same[i]);
}

static void test_a_long_build_log_is_cut_in_the_message_only(void **state)
{
    fixture *f = *state;
    skip_without_line_directives(f);
    char text[3000] = "";
    for (int i = 0; i < 15; i++)
        snprintf(text + strlen(text), sizeof(text) - strlen(text), "int f%d(void) { return missing_%d; }\n", i, i);
    const karst_virtual_file files[] = {{"test.cl", text}};
    karst_error error = {0};
    assert_null(karst_program_build(f->context, "test.cl", NULL, files, 1, &error));
    assert_has(error.message, "test.cl:1:");
    assert_has(error.message, "missing_2");
    assert_null(strstr(error.message, "missing_3"));
    assert_has(f->text, "missing_14");
}

static void test_bad_options_and_missing_sources_are_told(void **state)
{
    fixture *f = *state;
    const karst_virtual_file files[] = {{"test.cl", "__kernel void k(__global int *out) { out[0] = 1; }\n"}};
    karst_error error = {0};
    char options[3000];
    memset(options, ' ', sizeof(options));
    options[sizeof(options) - 1] = 0;
    assert_null(karst_program_build(f->context, "test.cl", options, files, 1, &error));
    assert_has(error.message, "options are too long");
    error = (karst_error){0};
    assert_null(karst_program_build(f->context, "no/such.cl", NULL, files, 1, &error));
    assert_has(error.message, "there is no kernel source \"no/such.cl\"");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_each_file_comes_once_and_lines_keep_their_numbers),
        cmocka_unit_test(test_comments_and_text_are_no_includes),
        cmocka_unit_test(test_an_include_in_one_branch_does_not_count_in_others),
        cmocka_unit_test(test_an_include_guard_is_no_branch),
        cmocka_unit_test(test_circles_end),
        cmocka_unit_test(test_what_cannot_be_included_names_file_and_line),
        cmocka_unit_test(test_nesting_is_bounded),
        cmocka_unit_test_setup_teardown(test_the_kernel_folder_goes_before_the_embedded_sources, make_folder,
                                        remove_folder),
        cmocka_unit_test(test_embedded_sources_are_the_files),
        cmocka_unit_test_setup_teardown(test_a_program_runs_with_its_options_and_files, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_a_build_error_points_at_file_and_line, set_up, tear_down),
        cmocka_unit_test(test_places_of_compilers_that_read_no_line_directives),
        cmocka_unit_test_setup_teardown(test_a_long_build_log_is_cut_in_the_message_only, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_bad_options_and_missing_sources_are_told, set_up, tear_down),
    };
    unsetenv("KARST_KERNEL_DIR");
    return cmocka_run_group_tests_name("program", tests, NULL, NULL);
}
