/* Where samples lie, what becomes of their light, and bytes from it: kernels against the host. */
#include "raycast/cast/jitter.clh"
#include "raycast/light/film.clh"
#include "raycast/light/radiance.h"
#include "tests/raycast/casting.h"

static bool is_stratified(const jitter *points, uint32_t num, uint32_t log2_num)
{
    for (uint32_t across = 0; across <= log2_num; across++) {
        const uint32_t wide = 1u << across, high = 1u << (log2_num - across);
        uint8_t seen[64] = {0};
        for (uint32_t i = 0; i < num; i++) {
            uint32_t box = (uint32_t)(points[i].u * (float)wide) * high + (uint32_t)(points[i].v * (float)high);
            if (points[i].u < 0 || points[i].u >= 1 || points[i].v < 0 || points[i].v >= 1 || seen[box]++)
                return false;
        }
    }
    return true;
}

static void samples_are_spread_evenly(void **state)
{
    (void)state;
    jitter points[64];
    int num_plain = 0;
    for (int pixel = 0; pixel < 500; pixel++)
        for (uint32_t log2_num = 0; log2_num <= 6; log2_num++)
            for (int purpose = 0; purpose < 2; purpose++) {
                const uint32_t num = 1u << log2_num;
                for (uint32_t i = 0; i < num; i++)
                    points[i] = jitter_of(pixel * 7, pixel * 13, i + 1, purpose ? JITTER_SUN : JITTER_PIXEL);
                assert_true(is_stratified(points, num, log2_num));
                /* Independent points are not, so that the test would see it. */
                for (uint32_t i = 0; i < num; i++)
                    points[i] = jitter_of(pixel * 7 + (int)i, pixel * 13, i + 1, JITTER_PIXEL);
                num_plain += log2_num == 6 && is_stratified(points, num, log2_num);
            }
    assert_int_equal(num_plain, 0);
    /* Neighbours have nothing in common, nor have the two purposes. */
    double product[2] = {0, 0};
    for (int x = 0; x < 20000; x++) {
        const float u = jitter_of(x, 5, 1, JITTER_PIXEL).u - 0.5f;
        product[0] += (double)(u * (jitter_of(x + 1, 5, 1, JITTER_PIXEL).u - 0.5f)) * 12;
        product[1] += (double)(u * (jitter_of(x, 5, 1, JITTER_SUN).u - 0.5f)) * 12;
    }
    assert_true(fabs(product[0]) / 20000 < 0.03 && fabs(product[1]) / 20000 < 0.03);
}

static void places_on_a_disc_fill_it(void **state)
{
    (void)state;
    const int num = 1 << 14;
    int within[4] = {0};
    double sum[2] = {0};
    for (int i = 0; i < num; i++) {
        const jitter d = jitter_on_disc(jitter_of(3, 4, (uint32_t)i + 1, JITTER_SUN));
        const double square = (double)d.u * (double)d.u + (double)d.v * (double)d.v;
        assert_true(square <= 1 + 1e-5);
        for (int ring = 0; ring < 4; ring++)
            within[ring] += square <= (ring + 1) / 4.0;
        sum[0] += (double)d.u;
        sum[1] += (double)d.v;
    }
    for (int ring = 0; ring < 4; ring++)
        assert_true(fabs(within[ring] / (double)num - (ring + 1) / 4.0) < 0.01);
    assert_true(fabs(sum[0]) / num < 0.01 && fabs(sum[1]) / num < 0.01);
}

static double srgb(double x) { return 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055); }

static void bytes_are_those_of_srgb(void **state)
{
    (void)state;
    double worst = 0;
    for (int i = 0; i <= 100000; i++) {
        const float x = (float)i / 100000;
        const int byte = film_byte(x, 0.0f);
        worst = fmax(worst, fabs(byte - srgb((double)x)));
    }
    assert_true(worst < 0.55);
    assert_int_equal(film_byte(-1.0f, 0.0f), 0);
    assert_int_equal(film_byte(1e9f, 0.0f), 255);
}

/* An albedo of (0.6, 0.15, 0.1) in full sun, as worlds at noon have it. */
static void bright_red_stays_red(void **state)
{
    (void)state;
    const colour red = {0.6f * 2.9f, 0.15f * 2.7f, 0.1f * 2.5f}, film = film_tone(red);
    assert_true(film.r > 0.75f && film.g < 0.3f * film.r && film.b < 0.2f * film.r);
    /* which a curve for each channel does not do */
    assert_true(film_curve(red.g) > 0.5f * film_curve(red.r));
    float before = 0;
    for (float light = 1e-4f; light < 1e5f; light *= 1.1f) {
        const colour white = film_tone((colour){light, light, light}), blue = film_tone((colour){0, 0, light});
        assert_true(white.r == white.g && white.g == white.b && white.r >= before * 0.99999f);
        assert_true(blue.b >= blue.r && blue.r == blue.g);
        before = white.r;
    }
    const colour glare = film_tone((colour){400, 300, 200});
    assert_true(glare.b > 0.9f * glare.r);
}

enum { WIDTH = 83, HEIGHT = 41, NUM = WIDTH * HEIGHT };

static float luminance_of(const float *rgb)
{
    return k_fma(rgb[0], 0.2126f, k_fma(rgb[1], 0.7152f, rgb[2] * 0.0722f));
}

static int by_value(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return x < y ? -1 : x > y;
}

/* Samples of made-up light through the kernels; the means and bytes that they must come to, on the host. */
static void light_becomes_bytes(void **state)
{
    (void)state;
    static float parts[6 * NUM], rgb[3 * NUM], mean[3 * NUM], sorted[NUM];
    static uint32_t marks[NUM], bytes[2][NUM];
    const uint32_t num_samples = 3;
    for (int k = 0; k < 2; k++) {
        karst_error error = {0};
        karst_radiance *r = karst_radiance_create(contexts[k], true, false, &error);
        scene_check(r && karst_radiance_set_room(r, NUM, &error), &error);
        karst_buffer *pixels = scene_buffer(contexts[k], "pixels", NUM * 4);
        memset(mean, 0, sizeof mean);
        uint32_t random = 7;
        for (uint32_t sample = 0; sample < num_samples; sample++) {
            for (int i = 0; i < 6 * NUM; i++) {
                random = random * 1664525 + 1013904223;
                parts[i] = ldexpf((float)(random >> 8), -24 - (int)(random % 7));
            }
            for (int i = 0; i < NUM; i++)
                marks[i] = (random = random * 1664525 + 1013904223) >> 31;
            for (uint32_t y = 0; y < HEIGHT; y++)
                for (uint32_t x = 0; x < WIDTH; x++)
                    for (size_t c = 0; c < 3; c++) {
                        const size_t place = karst_packet_order(x, y, WIDTH, HEIGHT);
                        const float lit = marks[y * WIDTH + x] ? 0 : parts[(3 + c) * NUM + place];
                        float *sum = &mean[3 * (y * WIDTH + x) + c];
                        *sum = parts[c * NUM + place] + lit + *sum;
                    }
            scene_check(karst_buffer_write(karst_radiance_parts(r), 0, parts, sizeof parts, &error) &&
                            karst_buffer_write(karst_radiance_marks(r), 0, marks, sizeof marks, &error),
                        &error);
            if (sample + 1 < num_samples)
                scene_check(karst_radiance_add(r, WIDTH, HEIGHT, sample, &error), &error);
        }
        /* Two summed, the third at hand. */
        const karst_radiance_look metered = {.tone = KARST_TONE_FILMIC},
                                  fixed = {.tone = KARST_TONE_FILMIC, .exposure = 0.7f};
        float exposure;
        scene_check(karst_radiance_show(r, WIDTH, HEIGHT, num_samples - 1, true, &metered, pixels->mem, &error) &&
                        karst_radiance_read_exposure(r, &exposure, &error) &&
                        karst_radiance_show(r, WIDTH, HEIGHT, num_samples - 1, true, &fixed, pixels->mem, &error) &&
                        karst_buffer_read(pixels, 0, bytes[k], sizeof bytes[k], &error) &&
                        karst_radiance_add(r, WIDTH, HEIGHT, num_samples - 1, &error) &&
                        karst_radiance_read(r, WIDTH, HEIGHT, num_samples, rgb, &error),
                    &error);
        for (int i = 0; i < NUM; i++) {
            for (int c = 0; c < 3; c++) {
                mean[3 * i + c] *= 1.0f / (float)num_samples;
                assert_true(rgb[3 * i + c] == mean[3 * i + c]);
            }
            sorted[i] = luminance_of(&mean[3 * i]);
            const colour c = film_tone((colour){mean[3 * i] * 0.7f, mean[3 * i + 1] * 0.7f, mean[3 * i + 2] * 0.7f});
            const float dither = tone_dither(i % WIDTH, i / WIDTH);
            assert_int_equal(bytes[k][i], (uint32_t)film_byte(c.r, dither) | (uint32_t)film_byte(c.g, dither) << 8 |
                                              (uint32_t)film_byte(c.b, dither) << 16 | 0xff000000u);
        }
        qsort(sorted, NUM, sizeof *sorted, by_value);
        assert_true(fabsf(exposure / sqrtf(0.3f / sorted[NUM / 2]) - 1) < 0.02f);
        /* Nothing is as bright as a night is dark: the meter does not go on for ever, and counts begin at 0. */
        memset(parts, 0, sizeof parts);
        scene_check(karst_buffer_write(karst_radiance_parts(r), 0, parts, sizeof parts, &error) &&
                        karst_radiance_show(r, WIDTH, HEIGHT, 0, true, &metered, pixels->mem, &error) &&
                        karst_radiance_read_exposure(r, &exposure, &error),
                    &error);
        assert_true(exposure == 4);
        assert_false(karst_radiance_show(r, WIDTH, HEIGHT, 0, false, &metered, pixels->mem, &error));
        assert_false(karst_radiance_show(r, WIDTH + 1, HEIGHT, 0, true, &metered, pixels->mem, &error));
        karst_buffer_destroy(pixels);
        karst_radiance_destroy(r);
    }
    assert_memory_equal(bytes[0], bytes[1], sizeof bytes[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(samples_are_spread_evenly), cmocka_unit_test(places_on_a_disc_fill_it),
        cmocka_unit_test(bytes_are_those_of_srgb),   cmocka_unit_test(bright_red_stays_red),
        cmocka_unit_test(light_becomes_bytes),
    };
    return cmocka_run_group_tests(tests, open_contexts, close_contexts);
}
