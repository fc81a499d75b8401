/* Launching kernels: arguments, and enqueueing under a stage's clock. */
#include "core/device/driver_internal.h"
#include "core/device/helper.h"
#include "core/device/profile.h"

#include <stdint.h>
#include <string.h>

/* The kernel's own name for messages. */
static const char *kernel_name(cl_kernel kernel, char *name, size_t size_bytes)
{
    name[0] = 0;
    if (clGetKernelInfo(kernel, CL_KERNEL_FUNCTION_NAME, size_bytes, name, NULL) != CL_SUCCESS || !name[0])
        return "(unnamed kernel)";
    return name;
}

bool karst_arguments(cl_kernel kernel, const karst_argument *arguments, size_t num_arguments, karst_error *error)
{
    char name[128];
    cl_uint expected = 0;
    cl_int code = clGetKernelInfo(kernel, CL_KERNEL_NUM_ARGS, sizeof(expected), &expected, NULL);
    /* Too few would silently keep the values of an earlier call. */
    if (code == CL_SUCCESS && expected != num_arguments)
        return karst_fail(error, KARST_FAILED, "kernel %s takes %u arguments but was given %zu",
                          kernel_name(kernel, name, sizeof(name)), expected, num_arguments);
    for (size_t i = 0; i < num_arguments; i++) {
        code = clSetKernelArg(kernel, (cl_uint)i, arguments[i].size_bytes, arguments[i].value);
        if (code != CL_SUCCESS)
            return karst_fail(error, KARST_FAILED, "cannot set argument %zu (of %zu bytes) of kernel %s: %s", i,
                              arguments[i].size_bytes, kernel_name(kernel, name, sizeof(name)),
                              karst_cl_error_name(code));
    }
    return true;
}

/* Explains a launch that was refused. */
static bool launch_failed(karst_context *context, cl_kernel kernel, size_t local_size, cl_int code, karst_error *error)
{
    char name[128];
    kernel_name(kernel, name, sizeof(name));
    size_t largest = 0;
    if ((code == CL_INVALID_WORK_GROUP_SIZE || code == CL_INVALID_WORK_ITEM_SIZE) &&
        clGetKernelWorkGroupInfo(kernel, context->device, CL_KERNEL_WORK_GROUP_SIZE, sizeof(largest), &largest, NULL) ==
            CL_SUCCESS &&
        local_size > largest)
        return karst_fail(error, KARST_FAILED,
                          "kernel %s cannot run in work-groups of %zu: the largest that %s takes is %zu (%s)", name,
                          local_size, context->name, largest, karst_cl_error_name(code));
    karst_driver_suspect();
    return karst_fail(error, KARST_FAILED, "cannot launch kernel %s on %s: %s", name, context->name,
                      karst_cl_error_name(code));
}

static bool is_new_program(const karst_context *context, cl_kernel kernel)
{
    cl_program program;
    bool is_new = false;
    if (clGetKernelInfo(kernel, CL_KERNEL_PROGRAM, sizeof program, &program, NULL) != CL_SUCCESS)
        return false;
    for (uint32_t i = 0; i < context->num_new_programs; i++)
        is_new = is_new || context->new_programs[i] == program;
    return is_new;
}

bool karst_launch(karst_context *context, cl_kernel kernel, karst_stage stage, size_t global_size, size_t local_size,
                  karst_error *error)
{
    char name[128];
    if (global_size == 0)
        return true;
    if (local_size == 0 || (unsigned)stage >= KARST_NUM_STAGES || global_size > SIZE_MAX - (local_size - 1))
        return karst_fail(error, KARST_FAILED, "cannot launch kernel %s: %zu work-items in groups of %zu, stage %d",
                          kernel_name(kernel, name, sizeof(name)), global_size, local_size, (int)stage);
    if (context->is_fork && !is_new_program(context, kernel))
        return true;
    size_t rounded = (global_size + local_size - 1) / local_size * local_size;
    cl_event event = NULL;
    uint64_t key, start_ns = karst_clock_ns();
    karst_claim claim = karst_helper_begin_launch(context->helper, kernel, rounded, local_size, &key);
    if (karst_helper_is_child(context->helper) && (claim == KARST_CLAIM_DONE || claim == KARST_CLAIM_OTHERS))
        return true;
    cl_int code = clEnqueueNDRangeKernel(context->queue, kernel, 1, NULL, &rounded, &local_size, 0, NULL, &event);
    if (code != CL_SUCCESS)
        return launch_failed(context, kernel, local_size, code, error);
    if (claim == KARST_CLAIM_MINE) {
        clWaitForEvents(1, &event); /* what is compiled when it first runs */
        karst_helper_done(context->helper, key);
    }
    if (claim != KARST_CLAIM_NOBODY)
        karst_log_print(context->log, KARST_LOG_DEBUG, "%s %s in %.0f ms",
                        claim == KARST_CLAIM_MINE ? "compiled" : "waited for",
                        kernel_name(kernel, name, sizeof name), (double)(karst_clock_ns() - start_ns) * 1e-6);
    return karst_profile_add_event(context, stage, kernel, event, error);
}
