/* One OpenCL device in use: context, queue, what it can do, its memory account and its stage timer.
 * Private to the library (core's basics; no kernels here). */
#ifndef KARST_CORE_CONTEXT_H
#define KARST_CORE_CONTEXT_H

#define CL_TARGET_OPENCL_VERSION 120
#define CL_USE_DEPRECATED_OPENCL_1_2_APIS
#include <CL/cl.h>

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"
#include "karst/log.h"
#include "karst/stats.h"

typedef struct karst_context karst_context;
typedef struct karst_buffer karst_buffer;

#define KARST_FORK_PROGRAMS 16u /* that a fork launches at most */

struct karst_context {
    const karst_log *log; /* borrowed; may be NULL */
    cl_platform_id platform;
    cl_device_id device;
    cl_context cl;
    cl_command_queue queue; /* in order, profiling on */
    char name[128];         /* device name for people */
    bool is_cpu;            /* host memory is device memory */
    int lanes;              /* 16 on CPUs, 1 elsewhere, or as asked at creation */
    int compute_units;
    size_t max_allocation_bytes; /* of one buffer */
    size_t global_memory_bytes;
    bool exact_floats;   /* denormals, inf/nan, round to nearest, fma, correctly rounded divide and sqrt */
    bool rounded_divide; /* programs are built with -cl-fp32-correctly-rounded-divide-sqrt */
    bool has_gl_sharing;
    bool shares_gl;        /* created to share objects with an OpenGL context: see karst_context_create_sharing */
    karst_buffer *buffers; /* list of live buffers, newest first */
    struct karst_profile *profile; /* stage timer, see core/device/profile.h */
    bool is_fork; /* launches only programs that are new; see karst_context_fork */
    bool only_kept; /* programs that are not kept on disk are not built: that is an error */
    cl_program new_programs[KARST_FORK_PROGRAMS];
    uint32_t num_new_programs;
    struct karst_program_backlog *program_backlog; /* still to be kept; see core/device/program_cache.h */
    struct karst_helper *helper; /* NULL, or who shares the compiling; borrowed. See core/device/helper.h */
};

/* A device as `karst info` lists it. */
typedef struct {
    cl_platform_id platform;
    cl_device_id device;
    int index; /* what `--device` takes, from 0 */
    char platform_name[128];
    char name[128];
    const char *type;    /* "CPU", "GPU" or "accelerator" */
    bool is_cpu, is_gpu; /* a device may say that it is both */
    char version[64];    /* "OpenCL 3.0 ..." */
    char driver[64];
    int compute_units;
    size_t global_memory_bytes;
    size_t max_allocation_bytes; /* of one buffer */
    size_t max_work_group;       /* work-items */
    bool exact_floats;           /* see karst_context */
    bool rounded_divide;         /* takes -cl-fp32-correctly-rounded-divide-sqrt */
    bool has_gl_sharing;
    const char *unusable; /* NULL, or why Karst cannot use it */
} karst_device_info;

/* All devices of all platforms, platforms in order of their names, into malloc'ed memory that the caller frees. The
 * same machine gives the same numbers. NULL and KARST_NO_DEVICE (how to mend it) if there is none. */
karst_device_info *karst_context_list(size_t *num_devices, karst_error *error);

/* Opens the device that `selector` names: NULL or "" for the first GPU, else the first CPU; "cpu" or "gpu"; a number as
 * `karst info` lists them; or part of a name, ignoring case. `lanes` 0 lets the device decide, else 1 or 16. Errors:
 * KARST_NO_DEVICE with a line that says how to mend it. Destroy with karst_context_destroy. */
karst_context *karst_context_create(const char *selector, int lanes, const karst_log *log, karst_error *error);
/* The same, sharing objects with an OpenGL context that is current, if the device chosen can: `gl_properties` are those
 * of karst_display_sharing (core/display/surface.h), ended by 0; NULL for none. Where the device has no
 * cl_khr_gl_sharing or does not drive that OpenGL context, the OpenCL context is an ordinary one and shares_gl stays
 * false. */
karst_context *karst_context_create_sharing(const char *selector, int lanes, const cl_context_properties *gl_properties,
                                            const karst_log *log, karst_error *error);
/* The two steps of which that is made. The device of a list that `selector` names; NULL and error if there is none. */
const karst_device_info *karst_context_choose(const karst_device_info *devices, size_t num_devices,
                                              const char *selector, karst_error *error);
karst_context *karst_context_open(const karst_device_info *chosen, int lanes,
                                  const cl_context_properties *gl_properties, const karst_log *log,
                                  karst_error *error);
/* The same device and OpenCL context with a queue, an account and a clock of their own and no log: for trying programs
 * out on another thread. A launch does nothing if its program had been built before in this process, since it may be
 * running: PoCL 3.1 counts the users of a kernel and loses count (an assertion of its own) if one runs on two queues
 * in grids of different size. Errors: KARST_FAILED. */
karst_context *karst_context_fork(const karst_context *context, karst_error *error);
/* Shares the compiling with a helper, which outlives the context, if the driver is one that gains by it: PoCL compiles
 * under one lock for a process, and finds what other processes compiled on disk. */
void karst_context_set_helper(karst_context *context, struct karst_helper *helper);
bool karst_context_is_pocl(const karst_context *context);
void karst_context_destroy(karst_context *context); /* NULL is fine; all buffers must be gone */

/* ---- buffers (buffer.c): every byte on the device has a name ---- */
struct karst_buffer {
    karst_context *context;
    cl_mem mem;
    size_t size_bytes;
    char name[32]; /* as it stands in memory_bytes of the statistics; several may share one */
    karst_buffer *next, **link;
    void *host; /* where it lies, if a CPU's own memory is the buffer's; else NULL. For telling the system, and for
                 * karst_buffer_memory */
};

/* A zeroed read-write buffer (or a copy of `initial`). Errors: KARST_FAILED; size 0 or above the device's largest is
 * refused with a message that names the buffer and the size. */
karst_buffer *karst_buffer_create(karst_context *context, const char *name, size_t size_bytes, const void *initial,
                                  karst_error *error);
/* The same with undefined contents, for pools that are written before they are read: a CPU commits a page when it is
 * first touched, so making a large pool takes no time. */
karst_buffer *karst_buffer_create_blank(karst_context *context, const char *name, size_t size_bytes,
                                        karst_error *error);
/* Has the system find memory for this part of a blank buffer now, so that who touches it first does not wait for that;
 * contents stay. Does nothing where the device has memory of its own, or the system has no such call. */
void karst_buffer_commit(karst_buffer *buffer, size_t offset_bytes, size_t size_bytes);
/* The buffer's bytes for the host to read and write without a command, while nothing that is enqueued uses them: PoCL's
 * CPU devices have them there, mapped or not. NULL elsewhere. Valid as long as the buffer. */
void *karst_buffer_memory(const karst_buffer *buffer);
/* Enters memory that is not the device's own in the account (an OpenGL buffer, say): mem is NULL, and it is only for
 * destroying. */
karst_buffer *karst_buffer_account(karst_context *context, const char *name, size_t size_bytes, karst_error *error);
/* A buffer that kernels read and that is this memory, where the device's memory is the host's; elsewhere a copy of it.
 * It is of 0 bytes to whoever counts memory or copies from it. Borrows the memory, which begins with a page, for the
 * buffer's life. Errors: KARST_FAILED. */
karst_buffer *karst_buffer_create_over(karst_context *context, const char *name, const void *memory, size_t size_bytes,
                                       karst_error *error);
void karst_buffer_destroy(karst_buffer *buffer); /* NULL is fine */
/* Write and read wait until it is done; fill (whole 32-bit values) does not. Ranges outside the buffer are refused. */
bool karst_buffer_write(karst_buffer *buffer, size_t offset_bytes, const void *data, size_t size_bytes,
                        karst_error *error);
bool karst_buffer_read(karst_buffer *buffer, size_t offset_bytes, void *data, size_t size_bytes, karst_error *error);
/* Enqueues a write: `data` must stay as it is until the queue is waited for. */
bool karst_buffer_send(karst_buffer *buffer, size_t offset_bytes, const void *data, size_t size_bytes,
                       karst_error *error);
/* Enqueues a read: `data` holds it once the queue is waited for, and must be there until then. */
bool karst_buffer_fetch(karst_buffer *buffer, size_t offset_bytes, void *data, size_t size_bytes, karst_error *error);
/* The contents in the host's own memory, to be read and written until unmapped; waits for what was enqueued. For CPU
 * devices, where nothing is copied. Errors: KARST_FAILED (NULL). */
void *karst_buffer_map(karst_buffer *buffer, karst_error *error);
bool karst_buffer_unmap(karst_buffer *buffer, void *mapped, karst_error *error);
bool karst_buffer_fill(karst_buffer *buffer, uint32_t value, size_t offset_bytes, size_t size_bytes,
                       karst_error *error);
/* Sums live buffers by name into stats->memory[], which it begins anew; names that find no place go into "other". */
void karst_context_memory(const karst_context *context, karst_stats *stats);

/* ---- programs (program.c): kernels from embedded sources ---- */
typedef struct karst_program karst_program;
typedef struct {
    const char *path; /* as named in #include */
    const char *text; /* borrowed during the call */
} karst_virtual_file;

/* Builds `entry` (a path such as "cache/collect.cl") with the options given. #include "path" is resolved by Karst
 * itself, each file once, in this order: `files`, $KARST_KERNEL_DIR (if set), the embedded sources. #line keeps file
 * and line of every error. Always passed: -cl-std=CL1.2 -cl-fp32-correctly-rounded-divide-sqrt (where honoured)
 * -DLANES=n -DKARST_DEVICE_CPU=0 or 1; -DKARST_VECTORS_PLAIN or -DKARST_VECTORS_AVX2 if $KARST_VECTORS is "plain" or
 * "avx2". Errors: KARST_FAILED with the first lines of the build log in the message, all of it in the log at error
 * level. An #include inside #if is resolved whatever the condition is, and again where it stands outside: headers carry
 * guards. What was built is kept on disk: see core/device/program_cache.h. */
karst_program *karst_program_build(karst_context *context, const char *entry, const char *options,
                                   const karst_virtual_file *files, size_t num_files, karst_error *error);
/* Whether the same would be accepted: the compiler's front end alone, in a tenth of the time. Nothing is kept. Errors:
 * as above. */
bool karst_program_try(karst_context *context, const char *entry, const char *options, const karst_virtual_file *files,
                       size_t num_files, karst_error *error);
void karst_program_destroy(karst_program *program);
/* Makes a program of a fork one of the context that was forked. */
void karst_program_move(karst_program *program, karst_context *context);
/* A kernel of the program; release with clReleaseKernel. NULL and error if there is none of that name. */
cl_kernel karst_program_kernel(karst_program *program, const char *name, karst_error *error);

/* Enqueues a one-dimensional launch under a stage's clock. local_size must be one fixed number for a kernel;
 * global_size is rounded up to it (kernels check their bounds). A global size of 0 is no launch and no error. */
bool karst_launch(karst_context *context, cl_kernel kernel, karst_stage stage, size_t global_size, size_t local_size,
                  karst_error *error);

/* Sets all arguments of a kernel, in order: each pair is (size, pointer to value). Stops at the first failure and names
 * the argument; another number of them than the kernel has is an error. */
typedef struct {
    size_t size_bytes;
    const void *value;
} karst_argument;
bool karst_arguments(cl_kernel kernel, const karst_argument *arguments, size_t num_arguments, karst_error *error);
#define KARST_ARGUMENTS(kernel, error, ...)                          \
    karst_arguments((kernel), (const karst_argument[]){__VA_ARGS__}, \
                    sizeof((const karst_argument[]){__VA_ARGS__}) / sizeof(karst_argument), (error))
/* clang-format off */
#define KARST_BUFFER_ARG(buffer) {sizeof(cl_mem), &(buffer)->mem}
#define KARST_VALUE_ARG(variable) {sizeof(variable), &(variable)}
/* clang-format on */

/* Waits for the queue. */
bool karst_finish(karst_context *context, karst_error *error);
const char *karst_cl_error_name(cl_int code);

/* ---- profile (profile.c): device time by stage, from event timestamps ---- */
/* Waits for all launches since the last call and adds their device time to ns[stage]. */
bool karst_profile_collect(karst_context *context, uint64_t ns[KARST_NUM_STAGES], karst_error *error);
/* What is launched from now on casts rays of that stream; KARST_NUM_STREAMS: of none. The device time of each since it
 * was taken last, as of the last karst_profile_collect. */
void karst_profile_set_stream(karst_context *context, karst_stream stream);
void karst_profile_take_streams(karst_context *context, uint64_t ns[KARST_NUM_STREAMS]);
/* Also count host time spent in a stage (display, host parts of collect). */
void karst_profile_add_host(karst_context *context, karst_stage stage, uint64_t ns);
uint64_t karst_clock_ns(void); /* monotonic */

#endif
