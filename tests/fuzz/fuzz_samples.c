/* Readers of samples on any bytes: PNG, TIFF, OpenEXR, and raw numbers of any shape. `make fuzz` builds and runs it;
 * samples/ holds a small file of each kind, behind four bytes of what the caller knows. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/files/samples.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const formats[] = {NULL, "uint8", "uint16", "int16", "float32"};
    static int file = -1;
    char path[64];
    if (size < 4)
        return 0;
    if (file < 0)
        file = memfd_create("samples", 0);
    /* the first bytes say what the caller knows; the rest is the file */
    const karst_samples_form form = {.has_range = data[0] & 1,
                                     .low = data[1],
                                     .high = data[2],
                                     .format = formats[data[3] & 0x80 ? 1 + (data[3] & 3) : 0],
                                     .shape = {data[1], data[2]}};
    if (file < 0 || ftruncate(file, 0) || pwrite(file, data + 4, size - 4, 0) != (ssize_t)(size - 4))
        abort();
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    karst_samples samples;
    karst_error error = {0};
    if (karst_samples_read(path, &form, &samples, &error)) {
        volatile float sum = 0;
        for (size_t i = 0; i < (size_t)samples.width * samples.height * samples.num_channels; i++)
            sum = sum + samples.values[i];
        karst_samples_finish(&samples);
    } else if (!*error.message) {
        abort();
    }
    return 0;
}
