/* OpenEXR files: written by Karst, read back by the library's own reader. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include <OpenEXR/openexr.h>

#include "karst/image.h"

enum { WIDTH = 21, HEIGHT = 37, MAX_CHANNELS = 8 }; /* neither a multiple of a chunk's 16 rows */

static char folder[] = "/tmp/karst-exr-XXXXXX";
static char path[64];

typedef struct {
    int num_channels;
    char names[MAX_CHANNELS][8];
    float values[MAX_CHANNELS][WIDTH * HEIGHT];
} picture;

static void read_picture(picture *p)
{
    exr_context_initializer_t start = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_context_t file;
    exr_decode_pipeline_t decoder = EXR_DECODE_PIPELINE_INITIALIZER;
    int32_t rows;
    assert_int_equal(exr_start_read(&file, path, &start), EXR_ERR_SUCCESS);
    exr_attr_box2i_t window;
    assert_int_equal(exr_get_data_window(file, 0, &window), EXR_ERR_SUCCESS);
    assert_int_equal(window.max.x - window.min.x + 1, WIDTH);
    assert_int_equal(window.max.y - window.min.y + 1, HEIGHT);
    assert_int_equal(exr_get_scanlines_per_chunk(file, 0, &rows), EXR_ERR_SUCCESS);
    for (int y = 0; y < HEIGHT; y += rows) {
        exr_chunk_info_t chunk;
        assert_int_equal(exr_read_scanline_chunk_info(file, 0, y, &chunk), EXR_ERR_SUCCESS);
        assert_int_equal(y == 0 ? exr_decoding_initialize(file, 0, &chunk, &decoder)
                                : exr_decoding_update(file, 0, &chunk, &decoder),
                         EXR_ERR_SUCCESS);
        p->num_channels = decoder.channel_count;
        assert_true(p->num_channels <= MAX_CHANNELS);
        for (int i = 0; i < decoder.channel_count; i++) {
            assert_int_equal(decoder.channels[i].data_type, EXR_PIXEL_FLOAT);
            strncpy(p->names[i], decoder.channels[i].channel_name, sizeof p->names[i] - 1);
            decoder.channels[i].user_pixel_stride = sizeof(float);
            decoder.channels[i].user_line_stride = WIDTH * sizeof(float);
            decoder.channels[i].user_bytes_per_element = sizeof(float);
            decoder.channels[i].decode_to_ptr = (uint8_t *)(p->values[i] + y * WIDTH);
        }
        if (y == 0)
            assert_int_equal(exr_decoding_choose_default_routines(file, 0, &decoder), EXR_ERR_SUCCESS);
        assert_int_equal(exr_decoding_run(file, 0, &decoder), EXR_ERR_SUCCESS);
    }
    exr_decoding_destroy(file, &decoder);
    assert_int_equal(exr_finish(&file), EXR_ERR_SUCCESS);
}

static const float *find(const picture *p, const char *name)
{
    for (int i = 0; i < p->num_channels; i++)
        if (strcmp(p->names[i], name) == 0)
            return p->values[i];
    fail_msg("there is no channel %s", name);
    return NULL;
}

static uint8_t rgba[WIDTH * HEIGHT * 4];
static float depth_m[WIDTH * HEIGHT], normals[WIDTH * HEIGHT * 3];

static int make_picture(void **state)
{
    (void)state;
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/a.exr", folder);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        for (int c = 0; c < 4; c++)
            rgba[4 * i + c] = (uint8_t)(i * 7 + c * 50);
        depth_m[i] = i % 5 ? (float)i * 1.5f : INFINITY;
        for (int axis = 0; axis < 3; axis++)
            normals[3 * i + axis] = (float)(i + axis) / 1000.0f - 0.3f;
    }
    return 0;
}

static int clean(void **state)
{
    (void)state;
    unlink(path);
    return rmdir(folder);
}

static void test_every_value_comes_back(void **state)
{
    (void)state;
    static picture p;
    assert_true(karst_image_write_exr(path, rgba, depth_m, normals, WIDTH, HEIGHT, NULL));
    read_picture(&p);
    assert_int_equal(p.num_channels, 7);
    const float *r = find(&p, "R"), *g = find(&p, "G"), *b = find(&p, "B"), *z = find(&p, "Z");
    const float *x = find(&p, "N.X"), *y = find(&p, "N.Y"), *nz = find(&p, "N.Z");
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const float *colours[] = {r, g, b};
        for (int c = 0; c < 3; c++) {
            double s = rgba[4 * i + c] / 255.0, linear = s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
            assert_true(fabs(colours[c][i] - linear) < 1e-6);
        }
        assert_true(z[i] == depth_m[i]);
        assert_true(x[i] == normals[3 * i] && y[i] == normals[3 * i + 1] && nz[i] == normals[3 * i + 2]);
    }
}

static void test_depth_and_normals_may_be_left_out(void **state)
{
    (void)state;
    static picture p;
    assert_true(karst_image_write_exr(path, rgba, NULL, NULL, WIDTH, HEIGHT, NULL));
    read_picture(&p);
    assert_int_equal(p.num_channels, 3);
}

static void test_failures_say_why_and_leave_nothing(void **state)
{
    (void)state;
    karst_error error = {0};
    assert_false(karst_image_write_exr("/no/such/folder/a.exr", rgba, NULL, NULL, WIDTH, HEIGHT, &error));
    assert_int_equal(error.status, KARST_FAILED);
    assert_non_null(strstr(error.message, "/no/such/folder/a.exr"));
    error = (karst_error){0};
    assert_false(karst_image_write_exr(path, rgba, NULL, NULL, 0, HEIGHT, &error));
    assert_int_equal(error.status, KARST_USAGE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_value_comes_back),
        cmocka_unit_test(test_depth_and_normals_may_be_left_out),
        cmocka_unit_test(test_failures_say_why_and_leave_nothing),
    };
    return cmocka_run_group_tests(tests, make_picture, clean);
}
