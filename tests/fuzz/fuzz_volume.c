/* Fuzzes the reader of NanoVDB files: a small right file with bytes of it changed, or cut off, or any bytes at all,
 * must give samples or a message that names the file, soon. An input is a byte of flags (1: the rest is the file
 * itself; 2: four bytes say where the right one is cut off), then changes: four bytes of place, one of number, and as
 * many bytes. `make fuzz` builds and runs it. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/files/volume.h"
#include "tests/language/field_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(bool holds, const char *what)
{
    if (holds)
        return;
    fprintf(stderr, "fuzz_volume: %s\n", what);
    abort();
}

static uint8_t *base;
static size_t base_bytes;

/* The right file: 9 x 4 x 3 samples, in two leaves. */
static void make_base(void)
{
    char folder[] = "/tmp/karst-fuzz-XXXXXX", path[64];
    float samples[9 * 4 * 3];
    for (int i = 0; i < 9 * 4 * 3; i++)
        samples[i] = (float)i;
    require(mkdtemp(folder) != NULL, "no folder");
    snprintf(path, sizeof path, "%s/base.nvdb", folder);
    require(write_field_file(path, samples, (const int[3]){9, 4, 3}, 0.5), "no file to begin with");
    FILE *file = fopen(path, "rb");
    require(file && fseek(file, 0, SEEK_END) == 0, "no file to begin with");
    base_bytes = (size_t)ftell(file);
    base = malloc(base_bytes);
    rewind(file);
    require(base && fread(base, 1, base_bytes, file) == base_bytes, "no memory");
    fclose(file);
    unlink(path);
    rmdir(folder);
}

static uint32_t word_of(const uint8_t *bytes)
{
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

/* The file that an input stands for, into `to`, which has room for the right one; returns its length. */
static size_t make_file(const uint8_t *data, size_t size, uint8_t *to)
{
    const uint8_t flags = data[0];
    size_t at = 1, length = base_bytes;
    if (flags & 1) {
        length = size - 1 < base_bytes ? size - 1 : base_bytes;
        memcpy(to, data + 1, length);
        return length;
    }
    memcpy(to, base, base_bytes);
    if ((flags & 2) && size >= 5) {
        length = word_of(data + 1) % (base_bytes + 1);
        at = 5;
    }
    while (at + 5 < size) {
        const size_t place = word_of(data + at) % base_bytes, num = data[at + 4] % 8u + 1;
        at += 5;
        for (size_t i = 0; i < num && at < size && place + i < base_bytes; i++)
            to[place + i] = data[at++];
    }
    return length;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static int file = -1;
    static uint8_t *bytes;
    char path[64];
    if (size < 1)
        return 0;
    if (!base) {
        make_base();
        bytes = malloc(base_bytes);
        file = memfd_create("volume", 0);
    }
    const size_t length = make_file(data, size, bytes);
    require(file >= 0 && ftruncate(file, 0) == 0 && pwrite(file, bytes, length, 0) == (ssize_t)length, "no file");
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    karst_volume volume;
    karst_error error = {0};
    if (karst_volume_read(path, NULL, &volume, &error)) {
        const size_t num = (size_t)volume.size[0] * volume.size[1] * volume.size[2];
        for (size_t i = 0; i < num; i++)
            require(isfinite(volume.values[i]), "a value that is not finite");
        karst_volume_finish(&volume);
        return 0;
    }
    require(error.status == KARST_BAD_DATA && strncmp(error.message, path, strlen(path)) == 0,
            "a failure without its file");
    return 0;
}
