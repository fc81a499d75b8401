/* What all readers of samples do. */
#include <stdarg.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/files/samples_internal.h"

bool karst_samples_fail(const karst_samples_reader *r, const char *format, ...)
{
    char message[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    return karst_fail(r->error, KARST_BAD_DATA, "%.400s: %s", r->path, message);
}

/* No packed file that means it has more samples in a byte, and a header that lies is not to cost a gigabyte. */
#define MOST_SAMPLES_A_BYTE 8192

/* Room on the disk is taken before it is written to, since a page that finds none is a bus error. */
static void map_values(karst_samples *samples, size_t num_bytes)
{
    const char *named = getenv("TMPDIR");
    char path[1100];
    snprintf(path, sizeof path, "%.1000s/karst-samples-XXXXXX", named && *named ? named : "/tmp");
    int fd = mkstemp(path);
    if (fd < 0)
        return;
    unlink(path);
    void *memory = posix_fallocate(fd, 0, (off_t)num_bytes) == 0
                       ? mmap(NULL, num_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0)
                       : MAP_FAILED;
    close(fd);
    if (memory == MAP_FAILED)
        return;
    samples->values = memory;
    samples->mapped_bytes = num_bytes;
}

void karst_samples_let_go(const karst_samples *samples)
{
    if (samples->mapped_bytes)
        madvise(samples->values, samples->mapped_bytes, MADV_DONTNEED);
}

void karst_samples_row_done(const karst_samples_reader *r, uint32_t y)
{
    const size_t in_row = (size_t)r->samples->width * r->samples->num_channels;
    if ((y + 1) * in_row / KARST_SAMPLES_BETWEEN != y * in_row / KARST_SAMPLES_BETWEEN)
        karst_samples_let_go(r->samples);
}

bool karst_samples_begin(const karst_samples_reader *r, uint64_t width, uint64_t height, uint32_t num_channels)
{
    if (width < 1 || height < 1)
        return karst_samples_fail(r, "it has no samples");
    if (width > KARST_SAMPLES_MOST_SIDE || height > KARST_SAMPLES_MOST_SIDE ||
        width * height > KARST_SAMPLES_MOST / num_channels)
        return karst_samples_fail(r, "%llu x %llu samples are too many: at most %u along a side, and %zu in all",
                                  (unsigned long long)width, (unsigned long long)height, KARST_SAMPLES_MOST_SIDE,
                                  KARST_SAMPLES_MOST / num_channels);
    r->samples->width = (uint32_t)width;
    r->samples->height = (uint32_t)height;
    r->samples->num_channels = num_channels;
    const size_t num = (size_t)(width * height) * num_channels;
    const size_t most_a_byte = r->form->format ? 1 : MOST_SAMPLES_A_BYTE;
    if (num > KARST_SAMPLES_MOST_IN_MEMORY && num / most_a_byte > r->length_bytes)
        return karst_samples_fail(r, "it has %llu bytes, too few for %llu x %llu samples",
                                  (unsigned long long)r->length_bytes, (unsigned long long)width,
                                  (unsigned long long)height);
    if (num > KARST_SAMPLES_MOST_IN_MEMORY)
        map_values(r->samples, num * sizeof(float));
    else
        r->samples->values = calloc(num, sizeof(float));
    return r->samples->values || karst_fail(r->error, KARST_FAILED,
                                            "%.400s: no room in memory or for temporary files for %llu x %llu samples",
                                            r->path, (unsigned long long)width, (unsigned long long)height);
}

double karst_samples_scale(const karst_samples_form *form, double value, double most, double own_high)
{
    return form->has_range ? form->low + (form->high - form->low) * (value / most) : value / most * own_high;
}
