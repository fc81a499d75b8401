/* Device buffers: zeroed, bounded, and accounted for by name. */
#include "core/device/context.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

/* "3.2 GiB" for messages. */
static const char *size_text(size_t size_bytes, char text[32])
{
    static const char *const units[] = {"bytes", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB"};
    double value = (double)size_bytes;
    int unit = 0;
    while (value >= 1023.95 && unit < 6) {
        value /= 1024;
        unit++;
    }
    snprintf(text, 32, unit ? "%.1f %s" : "%.0f %s", value, units[unit]);
    return text;
}

static size_t total_bytes(const karst_context *context)
{
    size_t total = 0;
    for (const karst_buffer *b = context->buffers; b; b = b->next)
        total += b->size_bytes;
    return total;
}

/* Refuses what cannot work before the driver may promise it: PoCL commits memory only when it is written. */
static bool check_size(const karst_context *context, const char *name, size_t size_bytes, karst_error *error)
{
    char size[32], limit[32], taken[32];
    if (size_bytes == 0)
        return karst_fail(error, KARST_FAILED, "cannot allocate a buffer of 0 bytes for %s", name);
    if (size_bytes > context->max_allocation_bytes)
        return karst_fail(error, KARST_FAILED,
                          "cannot allocate %s for %s: the device's largest buffer is %s; use a smaller --pool",
                          size_text(size_bytes, size), name, size_text(context->max_allocation_bytes, limit));
    size_t total = total_bytes(context);
    if (total > context->global_memory_bytes || size_bytes > context->global_memory_bytes - total)
        return karst_fail(error, KARST_FAILED,
                          "cannot allocate %s for %s: the device has %s, of which %s are taken; use a smaller --pool",
                          size_text(size_bytes, size), name, size_text(context->global_memory_bytes, limit),
                          size_text(total, taken));
    return true;
}

#define LARGE_PAGE_BYTES ((uintptr_t)2 << 20)

/* Asks for large pages where whole ones fit, which no system must grant: scattered reads of 256 MiB and more got 10 to
 * 25 % faster. */
static void advise_large_pages(void *memory, size_t size_bytes)
{
    uintptr_t first = ((uintptr_t)memory + LARGE_PAGE_BYTES - 1) & ~(LARGE_PAGE_BYTES - 1);
    uintptr_t end = ((uintptr_t)memory + size_bytes) & ~(LARGE_PAGE_BYTES - 1);
    if (end > first)
        madvise((void *)first, end - first, MADV_HUGEPAGE);
}

/* Less is written faster than asked for. */
#define LEAST_UNTOUCHED_BYTES ((size_t)256 << 10)

/* Zeroes memory. If it is the process's own (private and anonymous), whole pages are given back instead of written: the
 * system finds them, zeroed, when they are touched, and those of a large pool that are never touched take nothing. */
static void zero(uint8_t *memory, size_t size_bytes, bool is_own)
{
    uintptr_t page_bytes = (uintptr_t)sysconf(_SC_PAGESIZE), at = (uintptr_t)memory;
    uintptr_t first = (at + page_bytes - 1) & ~(page_bytes - 1), end = (at + size_bytes) & ~(page_bytes - 1);
    if (!is_own || size_bytes < LEAST_UNTOUCHED_BYTES || madvise((void *)first, end - first, MADV_DONTNEED) != 0) {
        memset(memory, 0, size_bytes);
        return;
    }
    memset(memory, 0, first - at);
    memset((void *)end, 0, at + size_bytes - end);
}

/* On CPUs the mapping is the buffer's own memory, so that it can be backed by large pages before it is first touched,
 * and zeroed in place. PoCL's is from malloc. oclgrind takes what clEnqueueFillBuffer wrote for uninitialised, but sees
 * this. */
static cl_int prepare_mapped(karst_context *context, cl_mem mem, size_t size_bytes, bool zeroed, void **host)
{
    cl_int code = CL_SUCCESS;
    void *mapped = clEnqueueMapBuffer(context->queue, mem, CL_TRUE, CL_MAP_WRITE_INVALIDATE_REGION, 0, size_bytes, 0,
                                      NULL, NULL, &code);
    if (code != CL_SUCCESS)
        return code;
    *host = mapped;
    advise_large_pages(mapped, size_bytes);
    if (zeroed)
        zero(mapped, size_bytes, karst_context_is_pocl(context));
    return clEnqueueUnmapMemObject(context->queue, mem, mapped, 0, NULL, NULL);
}

static cl_int prepare(karst_context *context, cl_mem mem, size_t size_bytes, bool zeroed, void **host)
{
    static const uint8_t zeros[64];
    if (context->is_cpu)
        return prepare_mapped(context, mem, size_bytes, zeroed, host);
    if (!zeroed)
        return CL_SUCCESS;
    /* In the widest pattern that divides the size: some drivers go pattern by pattern. */
    size_t pattern = sizeof(zeros);
    while (size_bytes % pattern)
        pattern /= 2;
    return clEnqueueFillBuffer(context->queue, mem, zeros, pattern, 0, size_bytes, 0, NULL, NULL);
}

static void enter(karst_buffer *buffer, karst_context *context, const char *name, size_t size_bytes)
{
    buffer->context = context;
    buffer->size_bytes = size_bytes;
    snprintf(buffer->name, sizeof(buffer->name), "%s", name);
    buffer->next = context->buffers;
    buffer->link = &context->buffers;
    if (buffer->next)
        buffer->next->link = &buffer->next;
    context->buffers = buffer;
}

static karst_buffer *create(karst_context *context, const char *name, size_t size_bytes, const void *initial,
                            bool zeroed, karst_error *error)
{
    if (!check_size(context, name, size_bytes, error))
        return NULL;
    karst_buffer *buffer = calloc(1, sizeof(*buffer));
    if (!buffer) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    cl_int code = CL_SUCCESS;
    buffer->mem = clCreateBuffer(context->cl, CL_MEM_READ_WRITE, size_bytes, NULL, &code);
    if (code == CL_SUCCESS && initial)
        code = clEnqueueWriteBuffer(context->queue, buffer->mem, CL_TRUE, 0, size_bytes, initial, 0, NULL, NULL);
    else if (code == CL_SUCCESS)
        code = prepare(context, buffer->mem, size_bytes, zeroed, &buffer->host);
    if (code != CL_SUCCESS) {
        char size[32];
        karst_fail(error, KARST_FAILED, "cannot allocate %s for %s: %s; use a smaller --pool",
                   size_text(size_bytes, size), name, karst_cl_error_name(code));
        if (buffer->mem)
            clReleaseMemObject(buffer->mem);
        free(buffer);
        return NULL;
    }
    enter(buffer, context, name, size_bytes);
    return buffer;
}

karst_buffer *karst_buffer_create(karst_context *context, const char *name, size_t size_bytes, const void *initial,
                                  karst_error *error)
{
    return create(context, name, size_bytes, initial, true, error);
}

karst_buffer *karst_buffer_create_blank(karst_context *context, const char *name, size_t size_bytes, karst_error *error)
{
    return create(context, name, size_bytes, NULL, false, error);
}

karst_buffer *karst_buffer_create_over(karst_context *context, const char *name, const void *memory, size_t size_bytes,
                                       karst_error *error)
{
    karst_buffer *buffer = karst_buffer_account(context, name, 0, error);
    cl_int code = CL_SUCCESS;
    if (!buffer)
        return NULL;
    buffer->mem =
        clCreateBuffer(context->cl, CL_MEM_READ_ONLY | CL_MEM_USE_HOST_PTR, size_bytes, (void *)memory, &code);
    if (code == CL_SUCCESS)
        return buffer;
    karst_fail(error, KARST_FAILED, "cannot use %zu bytes of memory for %s: %s", size_bytes, name,
               karst_cl_error_name(code));
    karst_buffer_destroy(buffer);
    return NULL;
}

karst_buffer *karst_buffer_account(karst_context *context, const char *name, size_t size_bytes, karst_error *error)
{
    karst_buffer *buffer = calloc(1, sizeof(*buffer));
    if (!buffer) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    enter(buffer, context, name, size_bytes);
    return buffer;
}

void *karst_buffer_memory(const karst_buffer *buffer)
{
    return karst_context_is_pocl(buffer->context) ? buffer->host : NULL;
}

void karst_buffer_commit(karst_buffer *buffer, size_t offset_bytes, size_t size_bytes)
{
#ifdef MADV_POPULATE_WRITE
    if (!buffer->host || offset_bytes >= buffer->size_bytes)
        return;
    size_t left_bytes = buffer->size_bytes - offset_bytes;
    uintptr_t page_bytes = (uintptr_t)sysconf(_SC_PAGESIZE), at = (uintptr_t)buffer->host + offset_bytes;
    uintptr_t first = at & ~(page_bytes - 1), end = at + (size_bytes < left_bytes ? size_bytes : left_bytes);
    /* Refused by old systems: then it is as it was. */
    madvise((void *)first, ((end + page_bytes - 1) & ~(page_bytes - 1)) - first, MADV_POPULATE_WRITE);
#else
    (void)buffer, (void)offset_bytes, (void)size_bytes;
#endif
}

void karst_buffer_destroy(karst_buffer *buffer)
{
    if (!buffer)
        return;
    if (buffer->link) { /* NULL: the context went first */
        *buffer->link = buffer->next;
        if (buffer->next)
            buffer->next->link = buffer->link;
    }
    if (buffer->mem)
        clReleaseMemObject(buffer->mem);
    free(buffer);
}

static bool check_range(const karst_buffer *buffer, const char *what, size_t offset_bytes, size_t size_bytes,
                        karst_error *error)
{
    if (offset_bytes > buffer->size_bytes || size_bytes > buffer->size_bytes - offset_bytes)
        return karst_fail(error, KARST_FAILED, "cannot %s %zu bytes at %zu of buffer %s: it has %zu", what, size_bytes,
                          offset_bytes, buffer->name, buffer->size_bytes);
    return true;
}

static bool check_code(const karst_buffer *buffer, const char *what, cl_int code, karst_error *error)
{
    if (code != CL_SUCCESS)
        return karst_fail(error, KARST_FAILED, "cannot %s buffer %s: %s", what, buffer->name,
                          karst_cl_error_name(code));
    return true;
}

bool karst_buffer_write(karst_buffer *buffer, size_t offset_bytes, const void *data, size_t size_bytes,
                        karst_error *error)
{
    if (!check_range(buffer, "write", offset_bytes, size_bytes, error))
        return false;
    if (size_bytes == 0)
        return true;
    cl_int code = clEnqueueWriteBuffer(buffer->context->queue, buffer->mem, CL_TRUE, offset_bytes, size_bytes, data, 0,
                                       NULL, NULL);
    return check_code(buffer, "write", code, error);
}

bool karst_buffer_read(karst_buffer *buffer, size_t offset_bytes, void *data, size_t size_bytes, karst_error *error)
{
    if (!check_range(buffer, "read", offset_bytes, size_bytes, error))
        return false;
    if (size_bytes == 0)
        return true;
    cl_int code = clEnqueueReadBuffer(buffer->context->queue, buffer->mem, CL_TRUE, offset_bytes, size_bytes, data, 0,
                                      NULL, NULL);
    return check_code(buffer, "read", code, error);
}

bool karst_buffer_fetch(karst_buffer *buffer, size_t offset_bytes, void *data, size_t size_bytes, karst_error *error)
{
    if (!check_range(buffer, "read", offset_bytes, size_bytes, error))
        return false;
    if (size_bytes == 0)
        return true;
    cl_int code = clEnqueueReadBuffer(buffer->context->queue, buffer->mem, CL_FALSE, offset_bytes, size_bytes, data, 0,
                                      NULL, NULL);
    return check_code(buffer, "read", code, error);
}

bool karst_buffer_send(karst_buffer *buffer, size_t offset_bytes, const void *data, size_t size_bytes,
                       karst_error *error)
{
    if (!check_range(buffer, "write", offset_bytes, size_bytes, error))
        return false;
    if (size_bytes == 0)
        return true;
    cl_int code = clEnqueueWriteBuffer(buffer->context->queue, buffer->mem, CL_FALSE, offset_bytes, size_bytes, data, 0,
                                       NULL, NULL);
    return check_code(buffer, "write", code, error);
}

bool karst_buffer_fill(karst_buffer *buffer, uint32_t value, size_t offset_bytes, size_t size_bytes, karst_error *error)
{
    if (!check_range(buffer, "fill", offset_bytes, size_bytes, error))
        return false;
    if (offset_bytes % sizeof(value) || size_bytes % sizeof(value))
        return karst_fail(error, KARST_FAILED, "cannot fill %zu bytes at %zu of buffer %s: not whole 32-bit values",
                          size_bytes, offset_bytes, buffer->name);
    if (size_bytes == 0)
        return true;
    cl_int code = clEnqueueFillBuffer(buffer->context->queue, buffer->mem, &value, sizeof(value), offset_bytes,
                                      size_bytes, 0, NULL, NULL);
    return check_code(buffer, "fill", code, error);
}

void *karst_buffer_map(karst_buffer *buffer, karst_error *error)
{
    cl_int code = CL_SUCCESS;
    void *mapped = clEnqueueMapBuffer(buffer->context->queue, buffer->mem, CL_TRUE, CL_MAP_READ | CL_MAP_WRITE, 0,
                                      buffer->size_bytes, 0, NULL, NULL, &code);
    return check_code(buffer, "map", code, error) ? mapped : NULL;
}

bool karst_buffer_unmap(karst_buffer *buffer, void *mapped, karst_error *error)
{
    cl_int code = clEnqueueUnmapMemObject(buffer->context->queue, buffer->mem, mapped, 0, NULL, NULL);
    return check_code(buffer, "unmap", code, error);
}

#define MAX_NAMES (sizeof(((karst_stats *)0)->memory) / sizeof(karst_stats_memory))

/* The entry that `name` is summed in; the last one takes all names that find no place. */
static karst_stats_memory *find_entry(karst_stats *stats, const char *name)
{
    for (size_t i = 0; i < stats->num_memory; i++)
        if (strcmp(stats->memory[i].name, name) == 0)
            return &stats->memory[i];
    if (stats->num_memory == MAX_NAMES)
        return &stats->memory[MAX_NAMES - 1];
    karst_stats_memory *entry = &stats->memory[stats->num_memory++];
    snprintf(entry->name, sizeof(entry->name), "%s", stats->num_memory == MAX_NAMES ? "other" : name);
    entry->size_bytes = 0;
    return entry;
}

void karst_context_memory(const karst_context *context, karst_stats *stats)
{
    stats->num_memory = 0;
    for (const karst_buffer *b = context->buffers; b; b = b->next)
        find_entry(stats, b->name)->size_bytes += b->size_bytes;
}
