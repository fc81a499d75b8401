/* Devices: listing them, choosing one, opening it. */
#include "core/device/context.h"
#include "core/device/device_missing.h"
#include "core/device/driver_internal.h"
#include "core/device/profile.h"
#include "core/device/program_cache.h"

#include <CL/cl_gl.h>
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define MAX_PLATFORMS 64
#define MAX_DEVICES 256 /* of one platform */

/* Copies a driver's string with its runs of blanks made single ones. */
static void copy_tidy(char *to, size_t size_bytes, const char *from)
{
    size_t n = 0;
    for (; *from && n + 1 < size_bytes; from++) {
        bool blank = isspace((unsigned char)*from);
        if (!blank || (n > 0 && to[n - 1] != ' '))
            to[n++] = blank ? ' ' : *from;
    }
    while (n > 0 && to[n - 1] == ' ')
        n--;
    to[n] = 0;
}

static void platform_text(cl_platform_id platform, cl_platform_info what, char *to, size_t size_bytes)
{
    char text[256] = "";
    if (clGetPlatformInfo(platform, what, sizeof(text) - 1, text, NULL) != CL_SUCCESS)
        text[0] = 0;
    copy_tidy(to, size_bytes, text);
}

static void device_text(cl_device_id device, cl_device_info what, char *to, size_t size_bytes)
{
    char text[256] = "";
    if (clGetDeviceInfo(device, what, sizeof(text) - 1, text, NULL) != CL_SUCCESS)
        text[0] = 0;
    copy_tidy(to, size_bytes, text);
}

/* Whether `name` is one of the words in the device's list of extensions. */
static bool has_extension(cl_device_id device, const char *name)
{
    size_t size = 0, length = strlen(name);
    if (clGetDeviceInfo(device, CL_DEVICE_EXTENSIONS, 0, NULL, &size) != CL_SUCCESS || size == 0)
        return false;
    char *text = calloc(size + 1, 1);
    bool found = false;
    if (text && clGetDeviceInfo(device, CL_DEVICE_EXTENSIONS, size, text, NULL) == CL_SUCCESS)
        for (const char *at = text; !found && (at = strstr(at, name)) != NULL; at += length)
            found = (at == text || at[-1] == ' ') && (at[length] == ' ' || at[length] == 0);
    free(text);
    return found;
}

/* Reads a fixed-size property; zero if the device does not know it. */
#define DEVICE_VALUE(device, what, variable)                                                      \
    do {                                                                                          \
        memset(&(variable), 0, sizeof(variable));                                                 \
        if (clGetDeviceInfo((device), (what), sizeof(variable), &(variable), NULL) != CL_SUCCESS) \
            memset(&(variable), 0, sizeof(variable));                                             \
    } while (0)

static const char *why_unusable(cl_device_id device, const char *version)
{
    cl_bool available, compiler, little_endian;
    char profile[32];
    int major = 0, minor = 0;
    DEVICE_VALUE(device, CL_DEVICE_AVAILABLE, available);
    DEVICE_VALUE(device, CL_DEVICE_COMPILER_AVAILABLE, compiler);
    DEVICE_VALUE(device, CL_DEVICE_ENDIAN_LITTLE, little_endian);
    device_text(device, CL_DEVICE_PROFILE, profile, sizeof(profile));
    if (!available)
        return "not available";
    if (!compiler)
        return "its driver has no compiler";
    if (!little_endian)
        return "big-endian";
    if (strcmp(profile, "FULL_PROFILE") != 0)
        return "embedded profile";
    if (sscanf(version, "OpenCL %d.%d", &major, &minor) != 2 || major * 10 + minor < 12)
        return "older than OpenCL 1.2";
    return NULL;
}

static void describe(cl_platform_id platform, const char *platform_name, cl_device_id device, karst_device_info *info)
{
    cl_device_type type;
    cl_device_fp_config floats;
    cl_uint units;
    cl_ulong global, largest;
    memset(info, 0, sizeof(*info));
    info->platform = platform;
    info->device = device;
    copy_tidy(info->platform_name, sizeof(info->platform_name), platform_name);
    device_text(device, CL_DEVICE_NAME, info->name, sizeof(info->name));
    device_text(device, CL_DEVICE_VERSION, info->version, sizeof(info->version));
    device_text(device, CL_DRIVER_VERSION, info->driver, sizeof(info->driver));
    DEVICE_VALUE(device, CL_DEVICE_TYPE, type);
    DEVICE_VALUE(device, CL_DEVICE_SINGLE_FP_CONFIG, floats);
    DEVICE_VALUE(device, CL_DEVICE_MAX_COMPUTE_UNITS, units);
    DEVICE_VALUE(device, CL_DEVICE_GLOBAL_MEM_SIZE, global);
    DEVICE_VALUE(device, CL_DEVICE_MAX_MEM_ALLOC_SIZE, largest);
    DEVICE_VALUE(device, CL_DEVICE_MAX_WORK_GROUP_SIZE, info->max_work_group);
    info->is_cpu = (type & CL_DEVICE_TYPE_CPU) != 0;
    info->is_gpu = (type & CL_DEVICE_TYPE_GPU) != 0;
    info->type = info->is_gpu ? "GPU" : info->is_cpu ? "CPU" : "accelerator";
    info->compute_units = (int)units;
    info->global_memory_bytes = (size_t)global;
    info->max_allocation_bytes = (size_t)largest;
    const cl_device_fp_config exact = CL_FP_DENORM | CL_FP_INF_NAN | CL_FP_ROUND_TO_NEAREST | CL_FP_FMA;
    info->rounded_divide = (floats & CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT) != 0;
    info->exact_floats = (floats & exact) == exact && info->rounded_divide;
    info->has_gl_sharing = has_extension(device, "cl_khr_gl_sharing");
    info->unusable = why_unusable(device, info->version);
}

typedef struct {
    cl_platform_id id;
    char name[128];
    char version[128];
    cl_uint place; /* as the loader gave it: the last word in sorting */
} platform_entry;

/* The loader's order follows a directory's, which is not fixed. */
static int compare_platforms(const void *a, const void *b)
{
    const platform_entry *x = a, *y = b;
    int order = strcmp(x->name, y->name);
    if (order == 0)
        order = strcmp(x->version, y->version);
    return order ? order : (x->place > y->place) - (x->place < y->place);
}

/* *code is what the platform says if it gives none. */
static bool list_platform(const platform_entry *platform, karst_device_info **devices, size_t *num_devices,
                          cl_int *code, karst_error *error)
{
    cl_device_id ids[MAX_DEVICES];
    cl_uint count = 0;
    cl_int given = clGetDeviceIDs(platform->id, CL_DEVICE_TYPE_ALL, MAX_DEVICES, ids, &count);
    if (given != CL_SUCCESS) {
        *code = given;
        return true; /* a platform without devices says CL_DEVICE_NOT_FOUND */
    }
    if (count > MAX_DEVICES)
        count = MAX_DEVICES;
    karst_device_info *grown = realloc(*devices, (*num_devices + count + 1) * sizeof(*grown));
    if (!grown)
        return karst_fail(error, KARST_FAILED, "out of memory");
    *devices = grown;
    for (cl_uint i = 0; i < count; i++) {
        describe(platform->id, platform->name, ids[i], &grown[*num_devices]);
        grown[*num_devices].index = (int)*num_devices;
        (*num_devices)++;
    }
    return true;
}

karst_device_info *karst_context_list(size_t *num_devices, karst_error *error)
{
    cl_platform_id ids[MAX_PLATFORMS];
    platform_entry platforms[MAX_PLATFORMS];
    cl_uint count = 0;
    karst_device_info *devices = NULL;
    *num_devices = 0;
    cl_int devices_code = CL_SUCCESS, code = clGetPlatformIDs(MAX_PLATFORMS, ids, &count);
    if (code != CL_SUCCESS)
        count = 0;
    if (count > MAX_PLATFORMS)
        count = MAX_PLATFORMS;
    for (cl_uint i = 0; i < count; i++) {
        platforms[i] = (platform_entry){.id = ids[i], .place = i};
        platform_text(ids[i], CL_PLATFORM_NAME, platforms[i].name, sizeof(platforms[i].name));
        platform_text(ids[i], CL_PLATFORM_VERSION, platforms[i].version, sizeof(platforms[i].version));
    }
    qsort(platforms, count, sizeof(*platforms), compare_platforms);
    for (cl_uint i = 0; i < count; i++) {
        if (!list_platform(&platforms[i], &devices, num_devices, &devices_code, error)) {
            free(devices);
            *num_devices = 0;
            return NULL;
        }
    }
    if (*num_devices > 0)
        return devices;
    free(devices);
    karst_device_missing(code, devices_code, error);
    return NULL;
}

/* "; " separated: what one may choose from. Cut where `text` ends. */
static void list_text(const karst_device_info *devices, size_t num_devices, char *text, size_t size_bytes)
{
    size_t n = 0;
    text[0] = 0;
    for (size_t i = 0; i < num_devices && n < size_bytes; i++) {
        const karst_device_info *d = &devices[i];
        int length =
            snprintf(text + n, size_bytes - n, "%s%d: %s (%s, %s%s%s)", i ? "; " : "", d->index, d->name, d->type,
                     d->platform_name, d->unusable ? "; cannot be used: " : "", d->unusable ? d->unusable : "");
        n += length > 0 ? (size_t)length : 0;
    }
}

static bool contains(const char *text, const char *part)
{
    size_t length = strlen(part);
    for (; *text; text++)
        if (strncasecmp(text, part, length) == 0)
            return true;
    return false;
}

/* The value of a text that is all digits, else -1. */
static int selector_number(const char *selector)
{
    size_t digits = strspn(selector, "0123456789");
    return digits > 0 && digits < 7 && selector[digits] == 0 ? atoi(selector) : -1;
}

typedef enum { ANY_DEVICE, WANT_CPU, WANT_GPU, NAME_OF_DEVICE, NAME_OF_PLATFORM } wish;

static const karst_device_info *first_match(const karst_device_info *devices, size_t num_devices, wish wanted,
                                            const char *part)
{
    for (size_t i = 0; i < num_devices; i++) {
        const karst_device_info *d = &devices[i];
        if (d->unusable && wanted < NAME_OF_DEVICE) /* by its name one gets to hear why it cannot be used */
            continue;
        if (wanted == ANY_DEVICE || (wanted == WANT_CPU && d->is_cpu) || (wanted == WANT_GPU && d->is_gpu) ||
            (wanted == NAME_OF_DEVICE && contains(d->name, part)) ||
            (wanted == NAME_OF_PLATFORM && contains(d->platform_name, part)))
            return d;
    }
    return NULL;
}

const karst_device_info *karst_context_choose(const karst_device_info *devices, size_t num_devices,
                                              const char *selector, karst_error *error)
{
    const karst_device_info *found = NULL;
    char text[800];
    list_text(devices, num_devices, text, sizeof(text));
    if (!selector || !*selector) {
        static const wish order[] = {WANT_GPU, WANT_CPU, ANY_DEVICE};
        for (int i = 0; !found && i < 3; i++)
            found = first_match(devices, num_devices, order[i], NULL);
        if (!found)
            karst_fail(
                error, KARST_NO_DEVICE,
                "no usable OpenCL device: install pocl-opencl-icd (CPU) or your GPU's OpenCL driver; there is %s",
                text);
        return found;
    }
    int number = selector_number(selector);
    if (strcasecmp(selector, "cpu") == 0 || strcasecmp(selector, "gpu") == 0) {
        bool cpu = strcasecmp(selector, "cpu") == 0;
        found = first_match(devices, num_devices, cpu ? WANT_CPU : WANT_GPU, NULL);
        if (!found)
            karst_fail(error, KARST_NO_DEVICE, "no usable OpenCL %s: install %s; there is %s",
                       cpu ? "CPU device" : "GPU",
                       cpu ? "pocl-opencl-icd" : "its OpenCL driver, or choose another device", text);
        return found;
    }
    if (number >= 0 && (size_t)number < num_devices)
        found = &devices[number];
    if (!found)
        found = first_match(devices, num_devices, NAME_OF_DEVICE, selector);
    if (!found)
        found = first_match(devices, num_devices, NAME_OF_PLATFORM, selector);
    if (!found)
        karst_fail(error, KARST_NO_DEVICE,
                   "no OpenCL device is called \"%.64s\": choose cpu, gpu, a number or a part of a name, as `karst "
                   "info` lists them; there is %s",
                   selector, text);
    else if (found->unusable) {
        karst_fail(error, KARST_NO_DEVICE, "device %d, %s, cannot be used: %s; there is %s", found->index, found->name,
                   found->unusable, text);
        found = NULL;
    }
    return found;
}

#define MAX_PROPERTIES 16

/* The platform, then `gl_properties` (may be NULL). */
static void join_properties(cl_platform_id platform, const cl_context_properties *gl_properties,
                            cl_context_properties properties[MAX_PROPERTIES])
{
    int n = 0;
    properties[n++] = CL_CONTEXT_PLATFORM;
    properties[n++] = (cl_context_properties)platform;
    for (; gl_properties && *gl_properties && n + 2 < MAX_PROPERTIES; gl_properties += 2) {
        properties[n++] = gl_properties[0];
        properties[n++] = gl_properties[1];
    }
    properties[n] = 0;
}

/* Whether the device drives the OpenGL context that the properties name. */
static bool drives_gl(const karst_device_info *info, const cl_context_properties *properties)
{
    cl_device_id devices[MAX_DEVICES];
    size_t size = 0;
    clGetGLContextInfoKHR_fn get_info =
        (clGetGLContextInfoKHR_fn)clGetExtensionFunctionAddressForPlatform(info->platform, "clGetGLContextInfoKHR");
    if (!get_info || get_info(properties, CL_DEVICES_FOR_GL_CONTEXT_KHR, sizeof(devices), devices, &size) != CL_SUCCESS)
        return false;
    for (size_t i = 0; i < size / sizeof(*devices); i++)
        if (devices[i] == info->device)
            return true;
    return false;
}

static bool open_device(karst_context *context, const karst_device_info *info,
                        const cl_context_properties *gl_properties, karst_error *error)
{
    cl_context_properties properties[MAX_PROPERTIES];
    cl_int code = CL_SUCCESS;
    context->platform = info->platform;
    context->device = info->device;
    snprintf(context->name, sizeof(context->name), "%s", info->name);
    context->is_cpu = info->is_cpu;
    context->compute_units = info->compute_units;
    context->max_allocation_bytes = info->max_allocation_bytes;
    context->global_memory_bytes = info->global_memory_bytes;
    context->exact_floats = info->exact_floats;
    context->rounded_divide = info->rounded_divide;
    context->has_gl_sharing = info->has_gl_sharing;
    if (context->lanes == 0)
        context->lanes = info->is_cpu ? 16 : 1;
    join_properties(info->platform, gl_properties, properties);
    if (gl_properties && info->has_gl_sharing && drives_gl(info, properties)) {
        context->cl = clCreateContext(properties, 1, &info->device, NULL, NULL, &code);
        context->shares_gl = code == CL_SUCCESS;
    }
    if (!context->shares_gl) {
        join_properties(info->platform, NULL, properties);
        context->cl = clCreateContext(properties, 1, &info->device, NULL, NULL, &code);
    }
    if (code == CL_SUCCESS)
        context->queue = clCreateCommandQueue(context->cl, info->device, CL_QUEUE_PROFILING_ENABLE, &code);
    if (code != CL_SUCCESS)
        karst_driver_suspect();
    if (code != CL_SUCCESS)
        return karst_fail(error, KARST_NO_DEVICE, "cannot open device %d, %s: %s; choose another with --device",
                          info->index, info->name, karst_cl_error_name(code));
    context->profile = karst_profile_create(error);
    return context->profile != NULL;
}

karst_context *karst_context_create(const char *selector, int lanes, const karst_log *log, karst_error *error)
{
    return karst_context_create_sharing(selector, lanes, NULL, log, error);
}

karst_context *karst_context_open(const karst_device_info *chosen, int lanes,
                                  const cl_context_properties *gl_properties, const karst_log *log,
                                  karst_error *error)
{
    if (lanes != 0 && lanes != 1 && lanes != 16) {
        karst_fail(error, KARST_USAGE, "lanes must be 1 or 16 (or 0 for what suits the device), not %d", lanes);
        return NULL;
    }
    karst_context *context = calloc(1, sizeof(*context));
    if (!context) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    context->log = log;
    context->lanes = lanes;
    if (!open_device(context, chosen, gl_properties, error)) {
        karst_context_destroy(context);
        return NULL;
    }
    karst_log_print(log, KARST_LOG_INFO, "device %d: %s (%s, %s), %d lanes", chosen->index, chosen->name, chosen->type,
                    chosen->version, context->lanes);
    if (!chosen->exact_floats)
        karst_log_print(log, KARST_LOG_WARNING,
                        "%s does not promise exact float arithmetic: worlds may differ from other devices' in their "
                        "last bits",
                        chosen->name);
    return context;
}

karst_context *karst_context_create_sharing(const char *selector, int lanes, const cl_context_properties *gl_properties,
                                            const karst_log *log, karst_error *error)
{
    size_t num_devices = 0;
    karst_device_info *devices = karst_context_list(&num_devices, error);
    const karst_device_info *chosen = devices ? karst_context_choose(devices, num_devices, selector, error) : NULL;
    karst_context *context = chosen ? karst_context_open(chosen, lanes, gl_properties, log, error) : NULL;
    free(devices);
    return context;
}

karst_context *karst_context_fork(const karst_context *of, karst_error *error)
{
    karst_context *context = malloc(sizeof *context);
    if (!context) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    cl_int code;
    *context = *of;
    context->log = NULL;
    context->buffers = NULL;
    context->program_backlog = NULL;
    context->helper = NULL;
    context->is_fork = true;
    context->num_new_programs = 0;
    context->profile = karst_profile_create(error);
    clRetainContext(context->cl);
    context->queue = clCreateCommandQueue(context->cl, context->device, CL_QUEUE_PROFILING_ENABLE, &code);
    if (context->profile && context->queue)
        return context;
    if (!context->queue)
        karst_fail(error, KARST_FAILED, "no second queue on %s: %s", context->name, karst_cl_error_name(code));
    karst_context_destroy(context);
    return NULL;
}

void karst_context_set_helper(karst_context *context, struct karst_helper *helper)
{
    context->helper = karst_context_is_pocl(context) ? helper : NULL;
}

void karst_context_destroy(karst_context *context)
{
    if (!context)
        return;
    karst_program_cache_drop(context);
    if (context->queue)
        clFinish(context->queue);
    karst_profile_destroy(context->profile);
    /* A mistake of the library's own: said aloud, and the buffers cut loose so that destroying them later stays safe.
     */
    for (karst_buffer *b = context->buffers, *next; b; b = next) {
        next = b->next;
        karst_log_print(context->log, KARST_LOG_ERROR, "buffer %s (%zu bytes) outlives its device", b->name,
                        b->size_bytes);
        b->context = NULL;
        b->next = NULL;
        b->link = NULL;
    }
    if (context->queue)
        clReleaseCommandQueue(context->queue);
    if (context->cl)
        clReleaseContext(context->cl);
    free(context);
}
