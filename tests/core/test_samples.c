/* Samples of files: every kind that is read says the same numbers, and files that are cut off or changed get an answer,
 * and a message where it is none. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <math.h>
#include <tiffio.h>
#include <unistd.h>
#include <zlib.h>

#include "core/files/samples.h"
#include "karst/image.h"
#include "tests/support/files.h"

static char folder[512];

static uint64_t random_state;
static uint32_t random_below(uint32_t n)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(random_state >> 33) % n;
}

static const char *path_of(const char *name)
{
    static char path[1200];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static void write_tiff(const char *name, int bits, int format, int channels, int tile)
{
    TIFF *tiff = TIFFOpen(path_of(name), "w");
    assert_non_null(tiff);
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 40);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 24);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, bits);
    TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, format);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, channels);
    TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, channels > 2 ? PHOTOMETRIC_RGB : PHOTOMETRIC_MINISBLACK);
    if (tile) {
        TIFFSetField(tiff, TIFFTAG_TILEWIDTH, tile);
        TIFFSetField(tiff, TIFFTAG_TILELENGTH, tile);
    }
    unsigned char row[40 * 4 * 8];
    for (int y = 0; y < 24 && !tile; y++) {
        for (int i = 0; i < 40 * channels; i++) {
            const int value = (i + y) % 100;
            const float f = (float)value;
            const double d = value;
            const uint16_t u16 = (uint16_t)value;
            const uint32_t u32 = (uint32_t)value;
            memcpy(row + i * bits / 8,
                   format == SAMPLEFORMAT_IEEEFP ? bits == 32 ? (const void *)&f : &d
                   : bits == 8                   ? (const void *)&(const unsigned char){(unsigned char)value}
                   : bits == 16                  ? (const void *)&u16
                                                 : &u32,
                   (size_t)bits / 8);
        }
        assert_int_equal(TIFFWriteScanline(tiff, row, (uint32_t)y, 0), 1);
    }
    if (tile) { /* of floats, one channel */
        float *values = calloc((size_t)tile * (size_t)tile, sizeof *values);
        for (int y = 0; y < 24; y += tile)
            for (int x = 0; x < 40; x += tile) {
                for (int i = 0; i < tile * tile; i++)
                    values[i] = (float)((x + i % tile + y + i / tile) % 100);
                assert_true(TIFFWriteTile(tiff, values, (uint32_t)x, (uint32_t)y, 0, 0) > 0);
            }
        free(values);
    }
    TIFFClose(tiff);
}

/* Every kind of TIFF says the same numbers. */
static void test_tiffs_are_read(void **state)
{
    static const struct {
        int bits, format, channels, tile;
    } kinds[] = {{8, SAMPLEFORMAT_UINT, 1, 0},    {16, SAMPLEFORMAT_UINT, 1, 0},   {32, SAMPLEFORMAT_UINT, 1, 0},
                 {8, SAMPLEFORMAT_INT, 1, 0},     {16, SAMPLEFORMAT_INT, 1, 0},    {32, SAMPLEFORMAT_INT, 1, 0},
                 {32, SAMPLEFORMAT_IEEEFP, 1, 0}, {64, SAMPLEFORMAT_IEEEFP, 1, 0}, {8, SAMPLEFORMAT_UINT, 3, 0},
                 {16, SAMPLEFORMAT_UINT, 4, 0},   {32, SAMPLEFORMAT_IEEEFP, 1, 16}};
    (void)state;
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        karst_samples samples;
        karst_error error = {0};
        write_tiff("a.tif", kinds[k].bits, kinds[k].format, kinds[k].channels, kinds[k].tile);
        if (!karst_samples_read(path_of("a.tif"), &(karst_samples_form){0}, &samples, &error))
            fail_msg("kind %zu: %s", k, error.message);
        assert_true(samples.width == 40 && samples.height == 24);
        assert_int_equal(samples.num_channels, kinds[k].channels > 1 ? 3 : 1);
        assert_int_equal(samples.num_bits, kinds[k].format == SAMPLEFORMAT_IEEEFP ? 0 : kinds[k].bits);
        for (int y = 0; y < 24; y++)
            for (int x = 0; x < 40; x++)
                for (int c = 0; c < (int)samples.num_channels; c++)
                    assert_true(samples.values[(y * 40 + x) * (int)samples.num_channels + c] ==
                                (float)((x * kinds[k].channels + c + y) % 100));
        karst_samples_finish(&samples);
    }
}

static void test_pngs_and_exrs_are_read(void **state)
{
    karst_samples samples;
    karst_error error = {0};
    uint8_t rgba[4 * 6] = {255, 0, 128, 255, 10, 20, 30, 255, 0, 0, 0, 255, 255, 255, 255, 0, 1, 2, 3, 4, 5, 6, 7, 8};
    const karst_samples_form none = {0}, range = {.has_range = true, .low = -100, .high = 155};
    (void)state;
    assert_true(karst_image_write_png(path_of("a.png"), rgba, 3, 2, &error));
    assert_true(karst_samples_read(path_of("a.png"), &none, &samples, &error));
    assert_true(samples.num_channels == 3 && samples.width == 3 && samples.height == 2);
    assert_true(samples.values[0] == 1 && samples.values[1] == 0 && fabsf(samples.values[2] - 0.2158605f) < 1e-6f);
    karst_samples_finish(&samples);
    assert_true(karst_samples_read(path_of("a.png"), &range, &samples, &error));
    assert_true(samples.values[0] == 155 && samples.values[1] == -100 && samples.values[2] == 28);
    karst_samples_finish(&samples);
    float values[6] = {1.5f, -2, 3e5f, 0, 7, 8};
    const karst_image_channel one = {"Z", values, 1};
    assert_true(karst_image_write_channels(path_of("a.exr"), &one, 1, 3, 2, &error));
    if (!karst_samples_read(path_of("a.exr"), &none, &samples, &error))
        fail_msg("%s", error.message);
    assert_true(samples.num_channels == 1 && samples.width == 3 && samples.height == 2);
    assert_memory_equal(samples.values, values, sizeof values);
    karst_samples_finish(&samples);
    values[4] = NAN;
    assert_true(karst_image_write_channels(path_of("nan.exr"), &one, 1, 3, 2, &error));
    assert_false(karst_samples_read(path_of("nan.exr"), &none, &samples, &error));
    assert_int_equal(error.status, KARST_BAD_DATA);
    assert_non_null(strstr(error.message, "row 2, column 2 is not a number"));
}

/* Whatever is cut off or changed in a file: an answer, and a message if it is none. */
static void test_damaged_files_are_told(void **state)
{
    static const char *const names[] = {"a.png", "a.tif", "a.exr", "deep.png"};
    (void)state;
    write_file(path_of("deep.png"), "", 0);
    size_t length;
    FILE *file = fopen("demos/worlds/data/survey.png", "rb");
    assert_non_null(file);
    unsigned char *deep = malloc(1 << 20);
    length = fread(deep, 1, 1 << 20, file);
    fclose(file);
    write_file(path_of("deep.png"), deep, length);
    free(deep);
    random_state = 31;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        unsigned char *bytes = read_file(path_of(names[i]), &length);
        int refused = 0;
        for (int n = 0; n < 60; n++) {
            unsigned char *changed = malloc(length);
            size_t kept = length;
            memcpy(changed, bytes, length);
            if (n % 2)
                kept = random_below((uint32_t)length);
            else
                for (uint32_t k = 1 + random_below(8); k > 0; k--)
                    changed[random_below((uint32_t)(length < 400 || n % 4 ? length : 400))] ^=
                        (unsigned char)(1 + random_below(255));
            write_file(path_of("changed"), changed, kept);
            free(changed);
            karst_samples samples;
            karst_error error = {0};
            if (karst_samples_read(path_of("changed"), &(karst_samples_form){0}, &samples, &error)) {
                karst_samples_finish(&samples);
                continue;
            }
            refused++;
            assert_true(error.status == KARST_BAD_DATA && strstr(error.message, "changed: "));
        }
        free(bytes);
        assert_true(refused >= 25);
    }
}

/* A small file whose header claims the most samples costs neither memory nor room on a disk. */
static void test_a_header_that_lies_costs_nothing(void **state)
{
    (void)state;
    size_t length;
    unsigned char *bytes = read_file(path_of("a.png"), &length);
    static const unsigned char sides[8] = {0, 0, 0x40, 0, 0, 0, 0x40, 0};
    memcpy(bytes + 16, sides, sizeof sides);
    bytes[25] = 0; /* grey: of one channel 2^28 samples are not too many */
    const unsigned long sum = crc32(0, bytes + 12, 17);
    for (int i = 0; i < 4; i++)
        bytes[29 + i] = (unsigned char)(sum >> (24 - 8 * i));
    write_file(path_of("changed"), bytes, length);
    free(bytes);
    karst_samples samples;
    karst_error error = {0};
    assert_false(karst_samples_read(path_of("changed"), &(karst_samples_form){0}, &samples, &error));
    assert_int_equal(error.status, KARST_BAD_DATA);
    if (!strstr(error.message, "too few for 16384 x 16384 samples"))
        fail_msg("%s", error.message);
}

static void remove_folder(void)
{
    static const char *const names[] = {"a.tif", "a.png", "a.exr", "nan.exr", "deep.png", "changed"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        unlink(path_of(names[i]));
    rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tiffs_are_read),
        cmocka_unit_test(test_pngs_and_exrs_are_read),
        cmocka_unit_test(test_damaged_files_are_told),
        cmocka_unit_test(test_a_header_that_lies_costs_nothing),
    };
    snprintf(folder, sizeof folder, "%.200s/karst-samples-XXXXXX", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    if (!mkdtemp(folder))
        return 1;
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    remove_folder();
    return failed;
}
