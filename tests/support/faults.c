#include "tests/support/faults.h"

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <sqlite3.h>
#include <stdatomic.h>
#include <stddef.h>
#include <string.h>

/* ---- memory ---- */

static atomic_long num_until_fault = -1;
static atomic_bool memory_has_failed;

void faults_fail_memory(long n)
{
    memory_has_failed = false;
    num_until_fault = n;
}

bool faults_memory_failed(void) { return memory_has_failed; }

static bool memory_fails(void)
{
    if (num_until_fault < 0 || atomic_fetch_sub(&num_until_fault, 1) != 0)
        return false;
    memory_has_failed = true;
    return true;
}

void *__real_malloc(size_t size_bytes);
void *__real_calloc(size_t num, size_t size_bytes);
void *__real_realloc(void *memory, size_t size_bytes);
char *__real_strdup(const char *text);
void *__wrap_malloc(size_t size_bytes);
void *__wrap_calloc(size_t num, size_t size_bytes);
void *__wrap_realloc(void *memory, size_t size_bytes);
char *__wrap_strdup(const char *text);

void *__wrap_malloc(size_t size_bytes) { return memory_fails() ? NULL : __real_malloc(size_bytes); }
void *__wrap_calloc(size_t num, size_t size_bytes) { return memory_fails() ? NULL : __real_calloc(num, size_bytes); }
void *__wrap_realloc(void *memory, size_t size_bytes)
{
    return memory_fails() ? NULL : __real_realloc(memory, size_bytes);
}
char *__wrap_strdup(const char *text) { return memory_fails() ? NULL : __real_strdup(text); }

/* ---- the device ---- */

static atomic_bool device_fails;

void faults_fail_device(bool fails) { device_fails = fails; }

/* A call that answers with a code. */
#define DEVICE_CALL(name, parameters, arguments) \
    cl_int __real_##name parameters;             \
    cl_int __wrap_##name parameters;             \
    cl_int __wrap_##name parameters { return device_fails ? CL_OUT_OF_RESOURCES : __real_##name arguments; }

DEVICE_CALL(clFinish, (cl_command_queue queue), (queue))
DEVICE_CALL(clBuildProgram,
            (cl_program program, cl_uint num, const cl_device_id *devices, const char *options,
             void(CL_CALLBACK *notify)(cl_program, void *), void *user),
            (program, num, devices, options, notify, user))
DEVICE_CALL(clCompileProgram,
            (cl_program program, cl_uint num, const cl_device_id *devices, const char *options, cl_uint num_headers,
             const cl_program *headers, const char **names, void(CL_CALLBACK *notify)(cl_program, void *), void *user),
            (program, num, devices, options, num_headers, headers, names, notify, user))
DEVICE_CALL(clEnqueueNDRangeKernel,
            (cl_command_queue queue, cl_kernel kernel, cl_uint dimensions, const size_t *offset, const size_t *global,
             const size_t *local, cl_uint num, const cl_event *events, cl_event *event),
            (queue, kernel, dimensions, offset, global, local, num, events, event))
DEVICE_CALL(clEnqueueReadBuffer,
            (cl_command_queue queue, cl_mem buffer, cl_bool blocks, size_t offset_bytes, size_t size_bytes, void *data,
             cl_uint num, const cl_event *events, cl_event *event),
            (queue, buffer, blocks, offset_bytes, size_bytes, data, num, events, event))
DEVICE_CALL(clEnqueueWriteBuffer,
            (cl_command_queue queue, cl_mem buffer, cl_bool blocks, size_t offset_bytes, size_t size_bytes,
             const void *data, cl_uint num, const cl_event *events, cl_event *event),
            (queue, buffer, blocks, offset_bytes, size_bytes, data, num, events, event))
DEVICE_CALL(clEnqueueFillBuffer,
            (cl_command_queue queue, cl_mem buffer, const void *pattern, size_t pattern_bytes, size_t offset_bytes,
             size_t size_bytes, cl_uint num, const cl_event *events, cl_event *event),
            (queue, buffer, pattern, pattern_bytes, offset_bytes, size_bytes, num, events, event))

void *__real_dlopen(const char *name, int flags);
void *__wrap_dlopen(const char *name, int flags);
void *__wrap_dlopen(const char *name, int flags)
{
    return __real_dlopen(device_fails ? "libnot-installed.so" : name, flags);
}

cl_mem __real_clCreateBuffer(cl_context context, cl_mem_flags flags, size_t size_bytes, void *host, cl_int *code);
cl_mem __wrap_clCreateBuffer(cl_context context, cl_mem_flags flags, size_t size_bytes, void *host, cl_int *code);
cl_mem __wrap_clCreateBuffer(cl_context context, cl_mem_flags flags, size_t size_bytes, void *host, cl_int *code)
{
    if (!device_fails)
        return __real_clCreateBuffer(context, flags, size_bytes, host, code);
    *code = CL_OUT_OF_RESOURCES;
    return NULL;
}

void *__real_clEnqueueMapBuffer(cl_command_queue queue, cl_mem buffer, cl_bool blocks, cl_map_flags flags,
                                size_t offset_bytes, size_t size_bytes, cl_uint num, const cl_event *events,
                                cl_event *event, cl_int *code);
void *__wrap_clEnqueueMapBuffer(cl_command_queue queue, cl_mem buffer, cl_bool blocks, cl_map_flags flags,
                                size_t offset_bytes, size_t size_bytes, cl_uint num, const cl_event *events,
                                cl_event *event, cl_int *code);
void *__wrap_clEnqueueMapBuffer(cl_command_queue queue, cl_mem buffer, cl_bool blocks, cl_map_flags flags,
                                size_t offset_bytes, size_t size_bytes, cl_uint num, const cl_event *events,
                                cl_event *event, cl_int *code)
{
    if (!device_fails)
        return __real_clEnqueueMapBuffer(queue, buffer, blocks, flags, offset_bytes, size_bytes, num, events, event,
                                         code);
    *code = CL_OUT_OF_RESOURCES;
    return NULL;
}

/* ---- a database ---- */

static atomic_int database_code;

void faults_fail_database(int code) { database_code = code; }

#define DATABASE_CALL(name, parameters, arguments) \
    int __real_##name parameters;                  \
    int __wrap_##name parameters;                  \
    int __wrap_##name parameters { return database_code ? database_code : __real_##name arguments; }

DATABASE_CALL(sqlite3_step, (sqlite3_stmt * statement), (statement))
DATABASE_CALL(sqlite3_backup_step, (sqlite3_backup * backup, int num_pages), (backup, num_pages))
DATABASE_CALL(sqlite3_errcode, (sqlite3 * db), (db))
DATABASE_CALL(sqlite3_extended_errcode, (sqlite3 * db), (db))

int __real_sqlite3_exec(sqlite3 *db, const char *sql, int (*row)(void *, int, char **, char **), void *user,
                        char **message);
int __wrap_sqlite3_exec(sqlite3 *db, const char *sql, int (*row)(void *, int, char **, char **), void *user,
                        char **message);
/* Going back works: SQLite does that by itself where it must. */
int __wrap_sqlite3_exec(sqlite3 *db, const char *sql, int (*row)(void *, int, char **, char **), void *user,
                        char **message)
{
    return database_code && strcmp(sql, "ROLLBACK") != 0 ? database_code
                                                         : __real_sqlite3_exec(db, sql, row, user, message);
}
