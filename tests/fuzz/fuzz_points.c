/* Fuzzes the readers of points: any bytes, taken for each format, must give points or a message that names the bytes,
 * soon. The first byte says which format. `make fuzz` builds and runs it, from files in tests/fuzz/points. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/files/point_source.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(bool holds, const char *what)
{
    if (holds)
        return;
    fprintf(stderr, "fuzz_points: %s\n", what);
    abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    karst_file_point points[64];
    karst_error error = {0};
    size_t num = 1;
    if (size < 2)
        return 0;
    FILE *file = fmemopen((void *)(uintptr_t)(data + 1), size - 1, "rb");
    if (!file)
        return 0; /* memory */
    karst_point_source *source =
        karst_point_source_open(file, "bytes", (karst_point_format)((data[0] - 48u) % 4), &error);
    bool done = source != NULL;
    /* However much it says that it holds, points take bytes; but for a PLY whose vertices are lists of nothing. */
    for (size_t round = 0; done && num && round < 10000; round++) {
        done = karst_point_source_read(source, points, 64, &num, &error);
        require(!done || num <= 64, "more points than there is room for");
    }
    require(done || (error.status == KARST_BAD_DATA && strncmp(error.message, "bytes:", 6) == 0),
            "a failure without its place");
    karst_point_source_close(source);
    return 0;
}
