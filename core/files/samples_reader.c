/* What all readers of samples do. */
#include <stdarg.h>
#include <stdlib.h>

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

bool karst_samples_begin(const karst_samples_reader *r, uint64_t width, uint64_t height, uint32_t num_channels)
{
    if (width < 1 || height < 1)
        return karst_samples_fail(r, "it has no samples");
    if (width > KARST_SAMPLES_MOST_SIDE || height > KARST_SAMPLES_MOST_SIDE || width * height > KARST_SAMPLES_MOST)
        return karst_samples_fail(r, "%llu x %llu samples are too many: at most %u along a side, and %zu in all",
                                  (unsigned long long)width, (unsigned long long)height, KARST_SAMPLES_MOST_SIDE,
                                  KARST_SAMPLES_MOST);
    r->samples->width = (uint32_t)width;
    r->samples->height = (uint32_t)height;
    r->samples->num_channels = num_channels;
    r->samples->values = calloc((size_t)(width * height) * num_channels, sizeof(float));
    return r->samples->values || karst_fail(r->error, KARST_FAILED, "%.400s: out of memory for %llu x %llu samples",
                                            r->path, (unsigned long long)width, (unsigned long long)height);
}

double karst_samples_scale(const karst_samples_form *form, double value, double most, double own_high)
{
    return form->has_range ? form->low + (form->high - form->low) * (value / most) : value / most * own_high;
}
