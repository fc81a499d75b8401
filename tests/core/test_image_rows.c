/* Pictures row by row: the same bytes as at once, nothing left behind, and what is read back is what was written. */
#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/image.h"

enum { WIDTH = 33, HEIGHT = 53, NUM = WIDTH * HEIGHT };

static char folder[] = "/tmp/karst-rows-XXXXXX";
static uint8_t rgba[NUM * 4];
static float rgb[NUM * 3], depth_m[NUM];
static const char *const names[] = {"R", "G", "B", "Z"};
static const karst_image_channel channels[] = {{"R", rgb, 3}, {"G", rgb + 1, 3}, {"B", rgb + 2, 3}, {"Z", depth_m, 1}};

static const char *in_folder(const char *name)
{
    static char paths[4][320];
    static int next;
    next = (next + 1) % 4;
    snprintf(paths[next], sizeof paths[next], "%s/%s", folder, name);
    return paths[next];
}

static int num_files(void)
{
    int num = 0;
    DIR *list = opendir(folder);
    assert_non_null(list);
    while (readdir(list))
        num++;
    closedir(list);
    return num - 2;
}

static size_t read_file(const char *path, char *bytes, size_t size_bytes)
{
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    const size_t size = fread(bytes, 1, size_bytes, file);
    fclose(file);
    return size;
}

static void assert_same_files(const char *a, const char *b)
{
    static char bytes[2][1 << 16];
    const size_t size = read_file(a, bytes[0], sizeof *bytes);
    assert_true(size > 0 && size < sizeof *bytes);
    assert_int_equal(read_file(b, bytes[1], sizeof *bytes), size);
    assert_memory_equal(bytes[0], bytes[1], size);
}

static int make_picture(void **state)
{
    (void)state;
    assert_non_null(mkdtemp(folder));
    for (int i = 0; i < NUM; i++) {
        for (int c = 0; c < 4; c++)
            rgba[4 * i + c] = (uint8_t)(i * 5 + c * 40);
        for (int c = 0; c < 3; c++)
            rgb[3 * i + c] = (float)(i * 3 + c) / 777.0f;
        depth_m[i] = (float)i * 1.25f;
    }
    return 0;
}

static int clean(void **state)
{
    (void)state;
    DIR *list = opendir(folder);
    struct dirent *entry;
    while (list && (entry = readdir(list)))
        unlink(in_folder(entry->d_name));
    closedir(list);
    return rmdir(folder);
}

static karst_image_writer *begin_exr(const char *path, const char *note)
{
    karst_error error = {0};
    karst_image_writer *writer = karst_image_begin_exr(path, names, 4, note, WIDTH, HEIGHT, &error);
    if (!writer)
        fail_msg("%s", error.message);
    return writer;
}

static bool add_channels(karst_image_writer *writer, int y, int num_rows, karst_error *error)
{
    karst_image_channel rows[4];
    for (int i = 0; i < 4; i++) {
        rows[i] = channels[i];
        rows[i].values += y * WIDTH * rows[i].stride;
    }
    return karst_image_add_channels(writer, rows, 4, num_rows, error);
}

static void test_rows_are_the_picture(void **state)
{
    (void)state;
    karst_error error = {0};
    assert_true(karst_image_write_png(in_folder("a.png"), rgba, WIDTH, HEIGHT, &error));
    karst_image_writer *writer = karst_image_begin_png(in_folder("b.png"), WIDTH, HEIGHT, &error);
    assert_non_null(writer);
    for (int y = 0; y < HEIGHT; y += 7)
        assert_true(karst_image_add_bytes(writer, rgba + y * WIDTH * 4, HEIGHT - y < 7 ? HEIGHT - y : 7, &error));
    assert_int_equal(access(in_folder("b.png"), F_OK), -1);
    assert_int_equal(access(karst_image_temporary(writer), F_OK), 0);
    assert_true(karst_image_end(writer, &error));
    assert_same_files(in_folder("a.png"), in_folder("b.png"));

    assert_true(karst_image_write_channels(in_folder("a.exr"), channels, 4, WIDTH, HEIGHT, &error));
    writer = begin_exr(in_folder("b.exr"), NULL);
    assert_true(add_channels(writer, 0, 16, &error) && add_channels(writer, 16, 32, &error) &&
                add_channels(writer, 48, 5, &error));
    assert_true(karst_image_end(writer, &error));
    assert_same_files(in_folder("a.exr"), in_folder("b.exr"));
    assert_int_equal(num_files(), 4);
    float linear[6];
    karst_image_make_linear((const uint8_t[]){0, 255, 128, 7, 255, 0, 0, 7}, 2, linear);
    assert_true(linear[0] == 0 && linear[1] == 1 && linear[2] > 0.21f && linear[2] < 0.22f && linear[3] == 1);
}

static void test_rows_come_back(void **state)
{
    (void)state;
    karst_error error = {0};
    int width_px, height_px;
    static float values[NUM * 3];
    karst_image_writer *writer = begin_exr(in_folder("c.exr"), "what it is");
    assert_true(add_channels(writer, 0, HEIGHT, &error) && karst_image_end(writer, &error));
    karst_image_reader *reader = karst_image_open_exr(in_folder("c.exr"), &width_px, &height_px, &error);
    assert_non_null(reader);
    assert_int_equal(width_px, WIDTH);
    assert_int_equal(height_px, HEIGHT);
    assert_string_equal(karst_image_note(reader), "what it is");
    static const int parts[][2] = {{0, HEIGHT}, {15, 2}, {48, 5}, {3, 40}, {52, 1}};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        const int y = parts[i][0], num = parts[i][1];
        assert_true(karst_image_read_rows(reader, names, 3, y, num, values, &error));
        assert_memory_equal(values, rgb + 3 * y * WIDTH, (size_t)(num * WIDTH) * 3 * sizeof(float));
        assert_true(karst_image_read_rows(reader, names + 3, 1, y, num, values, &error));
        assert_memory_equal(values, depth_m + y * WIDTH, (size_t)(num * WIDTH) * sizeof(float));
    }
    const char *const other[] = {"sum.R"};
    assert_false(karst_image_read_rows(reader, other, 1, 0, 1, values, &error));
    assert_int_equal(error.status, KARST_BAD_DATA);
    error = (karst_error){0};
    assert_false(karst_image_read_rows(reader, names, 3, 50, 4, values, &error));
    assert_int_equal(error.status, KARST_USAGE);
    error = (karst_error){0};
    assert_false(karst_image_read_rows(reader, names, 4, 0, 1, values, &error));
    assert_int_equal(error.status, KARST_USAGE);
    karst_image_close(reader);
    karst_image_close(NULL);
}

static void test_bytes_come_back(void **state)
{
    (void)state;
    karst_error error = {0};
    int width_px, height_px;
    static uint8_t rows[NUM * 4];
    assert_true(karst_image_write_png(in_folder("f.png"), rgba, WIDTH, HEIGHT, &error));
    karst_image_reader *reader = karst_image_open_png(in_folder("f.png"), &width_px, &height_px, &error);
    assert_non_null(reader);
    assert_int_equal(width_px, WIDTH);
    assert_int_equal(height_px, HEIGHT);
    assert_null(karst_image_note(reader));
    for (int y = 0; y < HEIGHT; y += 7)
        assert_true(karst_image_read_bytes(reader, rows + y * WIDTH * 4, HEIGHT - y < 7 ? HEIGHT - y : 7, &error));
    for (int i = 0; i < NUM; i++) {
        assert_memory_equal(rows + 4 * i, rgba + 4 * i, 3);
        assert_int_equal(rows[4 * i + 3], 255);
    }
    assert_false(karst_image_read_bytes(reader, rows, 1, &error));
    assert_int_equal(error.status, KARST_USAGE);
    error = (karst_error){0};
    float value;
    assert_false(karst_image_read_rows(reader, names, 1, 0, 1, &value, &error));
    assert_int_equal(error.status, KARST_USAGE);
    karst_image_close(reader);
}

/* Whether all of a PNG comes, a row at a time; else why not. */
static bool read_bytes(const char *path, karst_error *why)
{
    static uint8_t row[KARST_IMAGE_MAX_PX * 4];
    int width_px = 0, height_px = 0;
    karst_image_reader *reader = karst_image_open_png(path, &width_px, &height_px, why);
    bool done = reader != NULL;
    for (int y = 0; done && y < height_px; y++)
        done = karst_image_read_bytes(reader, row, 1, why);
    if (reader && !done) { /* and it stays so */
        karst_error again = {0};
        assert_false(karst_image_read_bytes(reader, row, 1, &again));
        assert_int_equal(again.status, KARST_BAD_DATA);
    }
    karst_image_close(reader);
    return done;
}

/* libpng checks each part's CRC: what is damaged is refused, wherever. */
static void test_damaged_bytes_are_refused(void **state)
{
    (void)state;
    static char good[1 << 16], bad[1 << 16];
    assert_true(karst_image_write_png(in_folder("g.png"), rgba, WIDTH, HEIGHT, NULL));
    const size_t size = read_file(in_folder("g.png"), good, sizeof good);
    for (size_t at = 0; at < size; at += at < 64 || at + 32 > size ? 1 : 61)
        for (int cut = 0; cut < 2; cut++) {
            karst_error why = {0};
            memcpy(bad, good, size);
            bad[at] = (char)(bad[at] ^ 0x81);
            FILE *file = fopen(in_folder("g.png"), "wb");
            assert_true(file && fwrite(bad, 1, cut ? at : size, file) == (cut ? at : size) && fclose(file) == 0);
            if (read_bytes(in_folder("g.png"), &why))
                fail_msg("byte %zu %s: nothing was noticed", at, cut ? "and all behind are gone" : "has changed");
            assert_int_equal(why.status, KARST_BAD_DATA);
        }
    /* One with rows in seven passes: 2 x 2 pixels, up to where they begin. */
    static const uint8_t interlaced[] = {0x89, 'P',  'N',  'G',  13,   10, 26, 10, 0,  0,   0,   13,  'I', 'H',
                                         'D',  'R',  0,    0,    0,    2,  0,  0,  0,  2,   8,   2,   0,   0,
                                         1,    0x8A, 0xD3, 0xAA, 0xE5, 0,  0,  0,  10, 'I', 'D', 'A', 'T'};
    FILE *file = fopen(in_folder("g.png"), "wb");
    assert_true(file && fwrite(interlaced, 1, sizeof interlaced, file) == sizeof interlaced && fclose(file) == 0);
    karst_error why = {0};
    assert_false(read_bytes(in_folder("g.png"), &why));
    assert_int_equal(why.status, KARST_BAD_DATA);
    assert_non_null(strstr(why.message, "interlaced"));
}

/* A byte changed anywhere, or an end anywhere: it is refused, or its values are read; nothing worse. */
static void test_damage_is_survived(void **state)
{
    (void)state;
    static char good[1 << 16], bad[1 << 16];
    static float values[NUM * 3];
    karst_error error = {0};
    karst_image_writer *writer = begin_exr(in_folder("d.exr"), "{}");
    assert_true(add_channels(writer, 0, HEIGHT, &error) && karst_image_end(writer, &error));
    const size_t size = read_file(in_folder("d.exr"), good, sizeof good);
    int num_refused = 0;
    for (size_t at = 0; at < size; at += at < 900 ? 1 : 97)
        for (int cut = 0; cut < 2; cut++) {
            int width_px = 0, height_px = 0;
            karst_error why = {0};
            memcpy(bad, good, size);
            bad[at] = (char)(bad[at] ^ 0x81);
            FILE *file = fopen(in_folder("d.exr"), "wb");
            assert_true(file && fwrite(bad, 1, cut ? at : size, file) == (cut ? at : size) && fclose(file) == 0);
            karst_image_reader *reader = karst_image_open_exr(in_folder("d.exr"), &width_px, &height_px, &why);
            bool done = reader != NULL;
            for (int y = 0; done && y < height_px; y += 16)
                done =
                    width_px <= WIDTH &&
                    karst_image_read_rows(reader, names, 3, y, height_px - y < 16 ? height_px - y : 16, values, &why);
            if (reader)
                karst_image_note(reader);
            num_refused += why.status == KARST_BAD_DATA;
            karst_image_close(reader);
        }
    assert_true(num_refused > 500);
}

static void test_what_is_wrong_is_refused_and_leaves_nothing(void **state)
{
    (void)state;
    const int before = num_files();
    karst_error error = {0};
    int width_px, height_px;
#define ASSERT_REFUSED(call, kind)            \
    do {                                      \
        error = (karst_error){0};             \
        assert_false(call);                   \
        assert_int_equal(error.status, kind); \
    } while (0)
    ASSERT_REFUSED(karst_image_begin_png(in_folder("e.png"), 0, 5, &error) != NULL, KARST_USAGE);
    ASSERT_REFUSED(karst_image_begin_png("/no/such/folder/e.png", 5, 5, &error) != NULL, KARST_FAILED);
    ASSERT_REFUSED(karst_image_begin_exr("/no/such/folder/e.exr", names, 4, NULL, 5, 5, &error) != NULL, KARST_FAILED);
    ASSERT_REFUSED(karst_image_begin_exr(in_folder("e.exr"), names, 0, NULL, 5, 5, &error) != NULL, KARST_USAGE);
    ASSERT_REFUSED(karst_image_begin_exr("/dev/null", names, 4, NULL, 5, 5, &error) != NULL, KARST_FAILED);
    const char *const twice[] = {"R", "R"};
    ASSERT_REFUSED(karst_image_begin_exr(in_folder("e.exr"), twice, 2, NULL, 5, 5, &error) != NULL, KARST_USAGE);
    karst_image_writer *writer = begin_exr(in_folder("e.exr"), NULL);
    ASSERT_REFUSED(add_channels(writer, 0, 15, &error), KARST_USAGE);
    ASSERT_REFUSED(add_channels(writer, 0, HEIGHT + 1, &error), KARST_USAGE);
    ASSERT_REFUSED(karst_image_add_bytes(writer, rgba, 1, &error), KARST_USAGE);
    ASSERT_REFUSED(karst_image_add_channels(writer, channels, 3, 16, &error), KARST_USAGE);
    karst_image_discard(writer);
    writer = begin_exr(in_folder("e.exr"), NULL);
    error = (karst_error){0};
    assert_true(add_channels(writer, 0, 32, &error));
    ASSERT_REFUSED(karst_image_end(writer, &error), KARST_USAGE);
    writer = karst_image_begin_png(in_folder("e.png"), WIDTH, HEIGHT, NULL);
    assert_true(karst_image_add_bytes(writer, rgba, 3, NULL));
    ASSERT_REFUSED(karst_image_add_bytes(writer, rgba, HEIGHT, &error), KARST_USAGE);
    karst_image_discard(writer);
    karst_image_discard(NULL);
    assert_int_equal(num_files(), before);
    ASSERT_REFUSED(karst_image_open_exr(in_folder("none.exr"), &width_px, &height_px, &error) != NULL, KARST_BAD_DATA);
    ASSERT_REFUSED(karst_image_open_exr(in_folder("a.png"), &width_px, &height_px, &error) != NULL, KARST_BAD_DATA);
    ASSERT_REFUSED(karst_image_open_png(in_folder("none.png"), &width_px, &height_px, &error) != NULL, KARST_BAD_DATA);
    ASSERT_REFUSED(karst_image_open_png(in_folder("a.exr"), &width_px, &height_px, &error) != NULL, KARST_BAD_DATA);
    karst_image_reader *reader = karst_image_open_exr(in_folder("a.exr"), &width_px, &height_px, NULL);
    assert_non_null(reader);
    static uint8_t bytes[WIDTH * 4];
    ASSERT_REFUSED(karst_image_read_bytes(reader, bytes, 1, &error), KARST_USAGE);
    karst_image_close(reader);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rows_are_the_picture),
                                       cmocka_unit_test(test_rows_come_back),
                                       cmocka_unit_test(test_damage_is_survived),
                                       cmocka_unit_test(test_bytes_come_back),
                                       cmocka_unit_test(test_damaged_bytes_are_refused),
                                       cmocka_unit_test(test_what_is_wrong_is_refused_and_leaves_nothing)};
    return cmocka_run_group_tests(tests, make_picture, clean);
}
