/* Programs: building kernels from sources, and saying what is wrong with them. */
#include "core/device/build_log.h"
#include "core/device/driver_internal.h"
#include "core/device/helper.h"
#include "core/device/program_cache.h"
#include "core/device/source.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define MAX_OPTIONS 2048
#define MAX_MESSAGE_LINES 3 /* of a build log in an error */

struct karst_program {
    karst_context *context;
    cl_program cl;
    char entry[256];
};

/* The driver's build log, malloc'ed; NULL if there is none. */
static char *build_log(const karst_context *context, cl_program program)
{
    size_t size = 0;
    if (clGetProgramBuildInfo(program, context->device, CL_PROGRAM_BUILD_LOG, 0, NULL, &size) != CL_SUCCESS ||
        size == 0)
        return NULL;
    char *log = calloc(size + 1, 1);
    if (log && clGetProgramBuildInfo(program, context->device, CL_PROGRAM_BUILD_LOG, size, log, NULL) != CL_SUCCESS) {
        free(log);
        return NULL;
    }
    return log;
}

static bool says_error(const char *line, size_t length)
{
    for (size_t i = 0; i + 5 <= length; i++)
        if (strncasecmp(line + i, "error", 5) == 0)
            return true;
    return false;
}

/* Picks the first lines that tell of an error (else the first lines at all), joined by "; ". */
static void first_errors(const char *log, char *text, size_t size_bytes)
{
    text[0] = 0;
    for (int only_errors = 1; only_errors >= 0 && !text[0]; only_errors--) {
        int taken = 0;
        size_t n = 0;
        for (const char *line = log; *line && taken < MAX_MESSAGE_LINES && n < size_bytes;) {
            size_t length = strcspn(line, "\r\n");
            size_t blanks = strspn(line, " \t");
            if (length > blanks && (!only_errors || says_error(line, length))) {
                int written = snprintf(text + n, size_bytes - n, "%s%.*s", taken ? "; " : "", (int)(length - blanks),
                                       line + blanks);
                n += written > 0 ? (size_t)written : 0;
                taken++;
            }
            line += length;
            line += strspn(line, "\r\n");
        }
    }
}

static void build_failed(const karst_context *context, const char *entry, const char *options, const char *source,
                         cl_program program, cl_int code, karst_error *error)
{
    char text[900];
    char *said = build_log(context, program);
    char *log = said ? karst_build_log_with_places(said, source) : NULL;
    free(said);
    if (log && log[strspn(log, " \t\r\n")]) {
        karst_log_print(context->log, KARST_LOG_ERROR, "building %s for %s with %s", entry, context->name, options);
        karst_log_print(context->log, KARST_LOG_ERROR, "%s", log);
        const char *store = getenv("POCL_CACHE_DIR");
        /* No word of what is wrong with the text, or it is about the driver's own files. */
        if (!says_error(log, strlen(log)) || (store && *store && strstr(log, store)))
            karst_driver_suspect();
        first_errors(log, text, sizeof(text));
        karst_fail(error, KARST_FAILED, "cannot build %s: %s", entry, text);
    } else {
        karst_driver_suspect();
        karst_fail(error, KARST_FAILED, "cannot build %s for %s with %s: %s", entry, context->name, options,
                   karst_cl_error_name(code));
    }
    free(log);
}

/* Compiles expanded source, up to kernels or up to what a linker takes; the result is released by the caller. */
static cl_program compile(karst_context *context, const char *entry, const char *options, const char *source,
                          bool is_linked, karst_error *error)
{
    cl_int code = CL_SUCCESS;
    cl_program program = clCreateProgramWithSource(context->cl, 1, &source, NULL, &code);
    if (code != CL_SUCCESS) {
        karst_fail(error, KARST_FAILED, "cannot build %s: %s", entry, karst_cl_error_name(code));
        return NULL;
    }
    code = is_linked ? clBuildProgram(program, 1, &context->device, options, NULL, NULL)
                     : clCompileProgram(program, 1, &context->device, options, 0, NULL, NULL, NULL, NULL);
    if (code != CL_SUCCESS) {
        build_failed(context, entry, options, source, program, code, error);
        clReleaseProgram(program);
        return NULL;
    }
    return program;
}

/* ---- which programs this process has built ---- */

#define MAX_BUILT 1024

static uint64_t hash_text(uint64_t hash, const char *text)
{
    while (*text) /* FNV-1a */
        hash = (hash ^ (unsigned char)*text++) * 0x100000001b3u;
    return hash;
}

/* Notes a program by its hash; false if it was noted before, or nothing more can be. */
static bool note_program(uint64_t hash)
{
    static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    static uint64_t built[MAX_BUILT];
    static size_t num_built;
    pthread_mutex_lock(&lock);
    bool is_new = num_built < MAX_BUILT;
    for (size_t i = 0; i < num_built && is_new; i++)
        is_new = built[i] != hash;
    if (is_new)
        built[num_built++] = hash;
    pthread_mutex_unlock(&lock);
    return is_new;
}

/* Kernels may be built as for a CPU with fewer instructions. */
static const char *vectors_option(void)
{
    const char *vectors = getenv("KARST_VECTORS");
    if (vectors && !strcmp(vectors, "plain"))
        return "-DKARST_VECTORS_PLAIN ";
    return vectors && !strcmp(vectors, "avx2") ? "-DKARST_VECTORS_AVX2 " : "";
}

/* What every program is built with, and its own options. */
static bool write_options(const karst_context *context, const char *entry, const char *options, char all[MAX_OPTIONS],
                          karst_error *error)
{
    /* NVIDIA's compiler counts its warnings on stderr, past Karst's log: -w. */
    int length = snprintf(all, MAX_OPTIONS, "-cl-std=CL1.2 %s%s-DLANES=%d -DKARST_DEVICE_CPU=%d %s%s",
                          context->is_cpu ? "" : "-w ",
                          context->rounded_divide ? "-cl-fp32-correctly-rounded-divide-sqrt " : "", context->lanes,
                          context->is_cpu ? 1 : 0, vectors_option(), options ? options : "");
    return (length >= 0 && length < MAX_OPTIONS) ||
           karst_fail(error, KARST_FAILED, "cannot build %s: its options are too long", entry);
}

bool karst_program_try(karst_context *context, const char *entry, const char *options, const karst_virtual_file *files,
                       size_t num_files, karst_error *error)
{
    char all_options[MAX_OPTIONS];
    char *source = write_options(context, entry, options, all_options, error)
                       ? karst_source_expand(entry, files, num_files, error)
                       : NULL;
    cl_program cl = source ? compile(context, entry, all_options, source, false, error) : NULL;
    if (cl)
        clReleaseProgram(cl);
    free(source);
    return cl != NULL;
}

karst_program *karst_program_build(karst_context *context, const char *entry, const char *options,
                                   const karst_virtual_file *files, size_t num_files, karst_error *error)
{
    char all_options[MAX_OPTIONS];
    char *source = write_options(context, entry, options, all_options, error)
                       ? karst_source_expand(entry, files, num_files, error)
                       : NULL;
    if (!source)
        return NULL;
    uint64_t start = karst_clock_ns();
    karst_program_key key;
    karst_program_key_init(&key, context, entry, all_options, source);
    uint64_t hash = hash_text(hash_text(0xcbf29ce484222325u, source), all_options);
    cl_program cl = karst_program_cache_load(context, &key, all_options);
    bool was_kept = cl != NULL;
    if (!cl && context->only_kept) {
        karst_fail(error, KARST_FAILED, "%s is not kept", entry);
    } else if (!cl) {
        karst_claim claim = karst_helper_begin_build(context->helper, hash);
        const int turn = karst_program_cache_take_turn(&key);
        cl = karst_program_cache_load(context, &key, all_options); /* whose turn it was may have kept it */
        was_kept = cl != NULL;
        if (!cl)
            cl = compile(context, entry, all_options, source, true, error);
        karst_program_cache_end_turn(turn);
        karst_helper_end_build(context->helper, hash, claim);
        if (cl && !was_kept)
            karst_program_cache_store(context, &key, cl);
    }
    bool is_new = cl && note_program(hash);
    if (cl)
        karst_helper_note_program(context->helper, cl, hash);
    karst_program_key_free(&key);
    free(source);
    if (!cl)
        return NULL;
    if (context->is_fork && is_new && context->num_new_programs < KARST_FORK_PROGRAMS)
        context->new_programs[context->num_new_programs++] = cl;
    karst_program *program = calloc(1, sizeof(*program));
    if (!program) {
        karst_fail(error, KARST_FAILED, "out of memory");
        clReleaseProgram(cl);
        return NULL;
    }
    program->context = context;
    program->cl = cl;
    snprintf(program->entry, sizeof(program->entry), "%s", entry);
    karst_log_print(context->log, KARST_LOG_DEBUG, "%s %s in %.0f ms", was_kept ? "loaded" : "built", entry,
                    (double)(karst_clock_ns() - start) * 1e-6);
    return program;
}

void karst_program_destroy(karst_program *program)
{
    if (!program)
        return;
    karst_helper_forget_program(program->context->helper, program->cl);
    clReleaseProgram(program->cl);
    free(program);
}

void karst_program_move(karst_program *program, karst_context *context) { program->context = context; }

cl_kernel karst_program_kernel(karst_program *program, const char *name, karst_error *error)
{
    cl_int code = CL_SUCCESS;
    cl_kernel kernel = clCreateKernel(program->cl, name, &code);
    if (code != CL_SUCCESS) {
        karst_driver_suspect(); /* the sources are the library's own: they have it */
        karst_fail(error, KARST_FAILED, "%s has no kernel %s: %s", program->entry, name, karst_cl_error_name(code));
        return NULL;
    }
    return kernel;
}
