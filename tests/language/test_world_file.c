/* World files as worlds: those that Karst ships are in order, and what cannot be compiled says so. */
#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/camera.h"
#include "producers/density/world_file.h"

static void test_shipped_worlds(void **state)
{
    struct dirent **entries;
    int count = scandir("demos/worlds", &entries, NULL, alphasort), checked = 0;
    (void)state;
    if (count < 0)
        fail_msg("run this from the root of the repository");
    for (int i = 0; i < count; i++) {
        char path[512], expected[300];
        const char *name = entries[i]->d_name;
        karst_error error = {0};
        char *diagnostics;
        karst_camera camera = {.fov_deg = 60};
        snprintf(path, sizeof path, "demos/worlds/%s", name);
        if (!strstr(name, ".karst")) {
            free(entries[i]);
            continue;
        }
        karst_world_file *file = karst_world_file_open(path, NULL, 0, &diagnostics, &error);
        if (!file)
            fail_msg("%s: %s", path, error.message);
        if (diagnostics)
            fail_msg("%s", diagnostics);
        snprintf(expected, sizeof expected, "%s.karst", file->info.name);
        assert_string_equal(expected, name);
        assert_true(strlen(file->info.description) > 10);
        assert_true(file->program->header.has_camera && file->program->header.has_sun && file->program->header.has_sky);
        assert_true(karst_has_output(file->program->world.root, KARST_OUTPUT_COLOUR));
        assert_non_null(strstr(file->code.source, "world_row"));
        assert_non_null(strstr(file->code.colour_source, "world_colour"));
        if (!karst_camera_parse(file->info.camera, file->info.voxel_log2_m, &camera, &error))
            fail_msg("%s: %s", path, error.message);
        karst_world_file_destroy(file);
        free(entries[i]);
        checked++;
    }
    free(entries);
    assert_true(checked >= 11);
}

static karst_world_file *compile(const char *text, karst_error *error)
{
    return karst_world_file_compile("test.karst", text, strlen(text), NULL, 0, NULL, error);
}

#define LARGE(first) "    float d = " first ";\n    for (int i = 0; i < 3000; i++) d = sin(d + p.x * float(i));\n"

static int count_of(const char *text, const char *word)
{
    int count = 0;
    while ((text = strstr(text, word))) {
        text++;
        count++;
    }
    return count;
}

/* However many noises might be tensors, the sums of those that are fit a thread's stack. */
static void test_many_tensors(void **state)
{
    char text[256];
    karst_error error = {0};
    (void)state;
    for (int num = 1; num <= 64; num *= 2) {
        snprintf(text, sizeof text,
                 "float density(vec3 p) {\n    float d = -p.y;\n"
                 "    for (int i = 1; i <= %d; i++) d += noise(p / (64.0 + float(i)));\n    return d;\n}\n",
                 num);
        karst_world_file *file = compile(text, &error);
        assert_true(file && !file->code.is_tape);
        int most = (int)KARST_EMIT_MAX_TENSOR_NOISES;
        assert_int_equal(count_of(file->code.source, "[EMIT_TENSOR_SUMS];\n"), num < most ? num : most);
        karst_world_file_destroy(file);
    }
}

/* What is too large for code runs on its tape. */
static void test_too_large(void **state)
{
    karst_error error = {0};
    (void)state;
    karst_world_file *file = compile("float density(vec3 p) {\n" LARGE("0.0") "    return d;\n}\n", &error);
    if (!file)
        fail_msg("%s", error.message);
    assert_true(file->code.is_tape);
    assert_non_null(strstr(file->code.source, "tape_world.clh"));
    karst_world_file_destroy(file);
    file = compile("float density(vec3 p) {\n    float d = -p.y;\n"
                   "    for (int i = 1; i < 200; i++) d += noise(p * float(i));\n    return d;\n}\n",
                   &error); /* what noise calls takes long to compile, too */
    assert_true(file && file->code.is_tape);
    karst_world_file_destroy(file);
    file = compile("float density(vec3 p) { return -p.y; }\n"
                   "vec3 colour(vec3 p, vec3 n) {\n" LARGE("n.x") "    return vec3(d);\n}\n",
                   &error);
    assert_true(file && !file->code.is_tape && file->code.is_colour_tape && file->colour_tape.num_instructions > 3000);
    assert_non_null(strstr(file->code.colour_source, "tape_colour.clh"));
    karst_world_file_destroy(file);
    /* What needs more values at a time than a thread's stack has room for is told where it is made. */
    assert_null(compile("float density(vec3 p) {\n    float a[1000], b[1000], c[1000], d = 0.0;\n"
                        "    for (int i = 0; i < 1000; i++) {\n        float k = float(i + 1);\n"
                        "        a[i] = sin(p.x * k); b[i] = sin(p.y * k); c[i] = sin(p.z * k);\n    }\n"
                        "    for (int i = 0; i < 1000; i++) d = d * a[i] + b[i] * c[i];\n"
                        "    for (int i = 999; i >= 0; i--) d = d * a[i] + b[i] * c[i] * c[i];\n"
                        "    return d;\n}\n",
                        &error));
    assert_int_equal(error.status, KARST_BAD_WORLD);
    assert_non_null(strstr(error.message, ":8:"));
    assert_non_null(strstr(error.message, "density is too large: 3"));
    assert_non_null(strstr(error.message, "at most 2048 are possible"));
}

/* Nothing of a user's text reaches the generated code. */
static void test_no_user_text(void **state)
{
    karst_error error = {0};
    (void)state;
    karst_world_file *file =
        compile("/*{ \"name\": \"evil\\\" } __kernel\", \"params\": { \"vfloat\": 1, \"abort\": 2 } }*/\n"
                "float as_float(float world_row) { return world_row * vfloat; } // } __kernel void x() {\n"
                "float density(vec3 kernel_p) { return as_float(-kernel_p.y) + abort; }\n",
                &error);
    if (!file)
        fail_msg("%s", error.message);
    assert_null(strstr(file->code.source, "__kernel"));
    assert_null(strstr(file->code.source, "abort"));
    assert_null(strstr(file->code.source, "kernel_p"));
    assert_null(strstr(file->code.source, "evil"));
    karst_world_file_destroy(file);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_shipped_worlds),
        cmocka_unit_test(test_many_tensors),
        cmocka_unit_test(test_too_large),
        cmocka_unit_test(test_no_user_text),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
