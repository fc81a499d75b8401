/* Fuzzes the readers of points, and of light maps: any bytes, taken for each format, must give points or a message
 * that names the bytes, soon. The first byte says which format. `make fuzz` builds and runs it, from files in
 * tests/fuzz/points. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/files/light_points.h"
#include "core/files/point_source.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(bool holds, const char *what)
{
    if (holds)
        return;
    fprintf(stderr, "fuzz_points: %s\n", what);
    abort();
}

static void read_light_map(const uint8_t *data, size_t size)
{
    static int file = -1;
    char path[64];
    karst_error error = {0};
    size_t num;
    if (file < 0)
        file = memfd_create("light", 0);
    require(file >= 0 && ftruncate(file, 0) == 0 && pwrite(file, data, size, 0) == (ssize_t)size, "no file");
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    karst_light_point *points = karst_light_points_load(path, 1, 100, &num, &error);
    require(points ? num >= 1 && num <= 100 : error.status == KARST_BAD_DATA && strstr(error.message, path),
            "a failure without its file");
    free(points);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    karst_file_point points[64];
    karst_error error = {0};
    size_t num = 1;
    if (size < 2)
        return 0;
    if (data[0] == 'l') {
        read_light_map(data + 1, size - 1);
        return 0;
    }
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
