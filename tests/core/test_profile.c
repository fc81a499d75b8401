/* Launches, their arguments, and device time by stage. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/device/context.h"

static const karst_virtual_file source[] = {{
    "test.cl",
    "__kernel void count(__global int *out, int n)\n"
    "{\n"
    "    int i = (int)get_global_id(0);\n"
    "    if (i < n)\n"
    "        out[i] = (int)get_global_size(0) * 1000 + (int)get_local_size(0);\n"
    "}\n"
    "__kernel void work(__global uint *out, uint rounds)\n"
    "{\n"
    "    uint x = out[0];\n"
    "    for (uint i = 0; i < rounds; i++)\n"
    "        x = (x ^ x >> 15) * 0x2c1b3c6du + i;\n"
    "    out[0] = x;\n"
    "}\n"
    "__kernel __attribute__((reqd_work_group_size(4, 1, 1))) void fours(__global int *out) { out[get_global_id(0)] = "
    "4; }\n",
}};

typedef struct {
    karst_context *context;
    karst_program *program;
    cl_kernel count, work, fours;
    karst_buffer *out;
} fixture;

static int set_up(void **state)
{
    static fixture f;
    karst_error error = {0};
    memset(&f, 0, sizeof(f));
    *state = &f;
    f.context = karst_context_create(NULL, 0, NULL, &error);
    f.program = f.context ? karst_program_build(f.context, "test.cl", NULL, source, 1, &error) : NULL;
    if (!f.program) {
        fprintf(stderr, "%s\n", error.message);
        return -1;
    }
    f.count = karst_program_kernel(f.program, "count", &error);
    f.work = karst_program_kernel(f.program, "work", &error);
    f.fours = karst_program_kernel(f.program, "fours", &error);
    f.out = karst_buffer_create(f.context, "out", 4096, NULL, &error);
    return f.count && f.work && f.fours && f.out ? 0 : -1;
}

static int tear_down(void **state)
{
    fixture *f = *state;
    clReleaseKernel(f->count);
    clReleaseKernel(f->work);
    clReleaseKernel(f->fours);
    karst_buffer_destroy(f->out);
    karst_program_destroy(f->program);
    karst_context_destroy(f->context);
    return 0;
}

static void launch_work(fixture *f, karst_stage stage, cl_uint rounds)
{
    karst_error error = {0};
    assert_true(KARST_ARGUMENTS(f->work, &error, KARST_BUFFER_ARG(f->out), KARST_VALUE_ARG(rounds)));
    if (!karst_launch(f->context, f->work, stage, 1, 1, &error))
        fail_msg("%s", error.message);
}

static void test_global_sizes_are_rounded_up_and_local_ones_kept(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    static const size_t cases[][3] = {{1, 1, 1}, {1, 8, 8}, {8, 8, 8}, {9, 8, 16}, {100, 16, 112}};
    for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
        int out[1024], n = (int)cases[c][0];
        assert_true(karst_buffer_fill(f->out, 0, 0, 4096, &error));
        assert_true(KARST_ARGUMENTS(f->count, &error, KARST_BUFFER_ARG(f->out), KARST_VALUE_ARG(n)));
        assert_true(karst_launch(f->context, f->count, KARST_STAGE_CAST, cases[c][0], cases[c][1], &error));
        assert_true(karst_buffer_read(f->out, 0, out, sizeof(out), &error));
        for (int i = 0; i < 1024; i++)
            assert_int_equal(out[i], i < n ? (int)(cases[c][2] * 1000 + cases[c][1]) : 0);
    }
    int n = 1024, first = -1;
    assert_true(karst_buffer_fill(f->out, 0, 0, 4096, &error));
    assert_true(KARST_ARGUMENTS(f->count, &error, KARST_BUFFER_ARG(f->out), KARST_VALUE_ARG(n)));
    assert_true(karst_launch(f->context, f->count, KARST_STAGE_CAST, 0, 8, &error)); /* nothing to do is no launch */
    assert_true(karst_buffer_read(f->out, 0, &first, sizeof(first), &error));
    assert_int_equal(first, 0);
    assert_int_equal(error.status, KARST_OK);
}

static void test_a_failed_launch_names_kernel_and_reason(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    size_t largest = 0;
    int n = 0;
    assert_int_equal(clGetKernelWorkGroupInfo(f->count, f->context->device, CL_KERNEL_WORK_GROUP_SIZE, sizeof(largest),
                                              &largest, NULL),
                     CL_SUCCESS);
    assert_true(KARST_ARGUMENTS(f->count, &error, KARST_BUFFER_ARG(f->out), KARST_VALUE_ARG(n)));
    char expected[128];
    snprintf(expected, sizeof(expected), "kernel count cannot run in work-groups of %zu: the largest that ",
             largest + 1);
    /* NVIDIA's driver takes more than it promises. */
    if (karst_launch(f->context, f->count, KARST_STAGE_CAST, largest + 1, largest + 1, &error)) {
        assert_false(f->context->is_cpu);
        print_message("# work-groups of %zu run, of %zu that are promised\n", largest + 1, largest);
    } else {
        assert_int_equal(error.status, KARST_FAILED);
        if (strncmp(error.message, expected, strlen(expected)) != 0)
            fail_msg("%s", error.message);
    }
    error = (karst_error){0};
    assert_true(KARST_ARGUMENTS(f->fours, &error, KARST_BUFFER_ARG(f->out)));
    assert_true(karst_launch(f->context, f->fours, KARST_STAGE_CAST, 5, 4, &error));
    assert_false(
        karst_launch(f->context, f->fours, KARST_STAGE_CAST, 5, 8, &error)); /* not what the kernel was made for */
    if (!strstr(error.message, "cannot launch kernel fours") || !strstr(error.message, "CL_INVALID_WORK_GROUP_SIZE"))
        fail_msg("%s", error.message);
    assert_false(karst_launch(f->context, f->count, KARST_STAGE_CAST, 8, 0, NULL));
    assert_false(karst_launch(f->context, f->count, KARST_STAGE_CAST, SIZE_MAX, 8, NULL));
    assert_false(karst_launch(f->context, f->count, KARST_NUM_STAGES, 8, 8, NULL));
    assert_true(karst_finish(f->context, NULL));
}

static void test_arguments_are_checked(void **state)
{
    fixture *f = *state;
    int n = 3;
    char narrow = 0;
    karst_error error = {0};
    assert_false(KARST_ARGUMENTS(f->count, &error, KARST_BUFFER_ARG(f->out)));
    assert_string_equal(error.message, "kernel count takes 2 arguments but was given 1");
    error = (karst_error){0};
    assert_false(KARST_ARGUMENTS(f->count, &error, KARST_BUFFER_ARG(f->out), KARST_VALUE_ARG(n), KARST_VALUE_ARG(n)));
    error = (karst_error){0};
    assert_false(KARST_ARGUMENTS(f->count, &error, KARST_BUFFER_ARG(f->out), KARST_VALUE_ARG(narrow)));
    assert_string_equal(error.message, "cannot set argument 1 (of 1 bytes) of kernel count: CL_INVALID_ARG_SIZE");
    error = (karst_error){0};
    assert_true(KARST_ARGUMENTS(f->count, &error, KARST_BUFFER_ARG(f->out), KARST_VALUE_ARG(n)));
    assert_int_equal(error.status, KARST_OK);
}

static void test_time_goes_to_its_stage(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    uint64_t ns[KARST_NUM_STAGES] = {0};
    launch_work(f, KARST_STAGE_CAST, 1);
    assert_true(karst_profile_collect(f->context, ns, &error)); /* the first launch compiles */
    memset(ns, 0, sizeof(ns));

    uint64_t start = karst_clock_ns();
    launch_work(f, KARST_STAGE_EVALUATE, 4000000);
    launch_work(f, KARST_STAGE_SHADE, 100000);
    launch_work(f, KARST_STAGE_EVALUATE, 4000000);
    assert_true(karst_profile_collect(f->context, ns, &error));
    uint64_t wall = karst_clock_ns() - start;
    for (int stage = 0; stage < KARST_NUM_STAGES; stage++) {
        if (stage == KARST_STAGE_EVALUATE || stage == KARST_STAGE_SHADE)
            assert_true(ns[stage] > 0);
        else
            assert_int_equal(ns[stage], 0);
    }
    assert_true(ns[KARST_STAGE_EVALUATE] > ns[KARST_STAGE_SHADE]); /* 80 times the work */
    assert_true(ns[KARST_STAGE_EVALUATE] + ns[KARST_STAGE_SHADE] <= wall);

    /* What was collected is not counted again; sums go on top of what the caller has. */
    uint64_t before = ns[KARST_STAGE_EVALUATE];
    assert_true(karst_profile_collect(f->context, ns, &error));
    assert_int_equal(ns[KARST_STAGE_EVALUATE], before);
    launch_work(f, KARST_STAGE_EVALUATE, 100000);
    assert_true(karst_profile_collect(f->context, ns, &error));
    assert_true(ns[KARST_STAGE_EVALUATE] > before);
    assert_int_equal(error.status, KARST_OK);
}

static void test_host_time_joins_the_next_collect(void **state)
{
    fixture *f = *state;
    uint64_t ns[KARST_NUM_STAGES] = {0};
    karst_profile_add_host(f->context, KARST_STAGE_DISPLAY, 1000);
    karst_profile_add_host(f->context, KARST_STAGE_DISPLAY, 234);
    karst_profile_add_host(f->context, KARST_STAGE_COLLECT, 5);
    karst_profile_add_host(f->context, KARST_NUM_STAGES, 5);
    assert_true(karst_profile_collect(f->context, ns, NULL));
    assert_int_equal(ns[KARST_STAGE_DISPLAY], 1234);
    assert_int_equal(ns[KARST_STAGE_COLLECT], 5);
    assert_true(karst_profile_collect(f->context, ns, NULL));
    assert_int_equal(ns[KARST_STAGE_DISPLAY], 1234);
}

/* More launches than are kept pending: no time is lost with those that are folded early, and destroying the rest is
 * clean. */
static void test_launches_that_nobody_collects_do_not_pile_up(void **state)
{
    fixture *f = *state;
    karst_error error = {0};
    uint64_t ns[KARST_NUM_STAGES] = {0};
    for (int i = 0; i < 5000; i++)
        launch_work(f, i < 10 ? KARST_STAGE_SUBDIVIDE : KARST_STAGE_CAST, i < 10 ? 20000 : 1);
    assert_true(karst_profile_collect(f->context, ns, &error));
    assert_true(ns[KARST_STAGE_CAST] > 0);
    assert_true(ns[KARST_STAGE_SUBDIVIDE] > 0);
    launch_work(f, KARST_STAGE_CAST, 1);
    assert_int_equal(error.status, KARST_OK);
}

static void test_the_clock_goes_forward(void **state)
{
    (void)state;
    uint64_t last = karst_clock_ns();
    for (int i = 0; i < 1000; i++) {
        uint64_t now = karst_clock_ns();
        assert_true(now >= last);
        last = now;
    }
    assert_true(last > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_global_sizes_are_rounded_up_and_local_ones_kept, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_a_failed_launch_names_kernel_and_reason, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_arguments_are_checked, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_time_goes_to_its_stage, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_host_time_joins_the_next_collect, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_launches_that_nobody_collects_do_not_pile_up, set_up, tear_down),
        cmocka_unit_test(test_the_clock_goes_forward),
    };
    return cmocka_run_group_tests_name("profile", tests, NULL, NULL);
}
