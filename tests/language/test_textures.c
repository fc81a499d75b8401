/* texture(NAME, p, n, size) in colours: what a file's splines are at every half of a coordinate, packed, and straight
 * lines between. Densities keep the splines. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <math.h>

#include "producers/language/language.h"
#include "producers/language/oracle/oracle.h"
#include "producers/language/ops/octave.clh"
#include "tests/language/random_graph.h"

enum { MOST_SIDE = 16, NUM_PLACES = 400 };

/* Three images of the same size and what is made of them. */
typedef struct {
    float samples[3 * MOST_SIDE * MOST_SIDE];
    karst_samples_image channel[3], texture;
} textured;

static void make(textured *t, uint32_t width, uint32_t height, karst_wrap wrap, uint32_t num_channels)
{
    karst_error error = {0};
    for (uint32_t i = 0; i < num_channels * width * height; i++)
        t->samples[i] = (float)((double)random_below(256) / 255 * (i % num_channels == 1 ? 40 : 1));
    for (uint32_t c = 0; c < num_channels; c++)
        assert_true(
            karst_samples_image_build(&t->channel[c], t->samples + c, width, height, num_channels, wrap, &error));
    assert_true(karst_samples_image_pack(&t->texture, t->channel, num_channels, &error));
}

static void finish(textured *t)
{
    for (int c = 0; c < 3; c++)
        karst_samples_image_finish(&t->channel[c]);
    karst_samples_image_finish(&t->texture);
}

static const karst_image_header *header_of(const karst_samples_image *image)
{
    return (const karst_image_header *)image->words;
}

static void look_up(const textured *t, int level, const noise_position *p, float values[3])
{
    texture_values(header_of(&t->texture), level, &p->axis[0], &p->axis[1], values);
}

/* At halves of a level's cells. */
static noise_position halves(int level, int64_t x, int64_t y)
{
    const int64_t at[2] = {x, y};
    noise_position p = {{{0, 0}, {0, 0}, {0, 0}}};
    for (int i = 0; i < 2; i++) {
        const uint64_t place = (uint64_t)at[i] << (31 + level);
        p.axis[i].cell = (uint)(place >> 32);
        p.axis[i].fraction = (uint)place;
    }
    return p;
}

/* At halves, the splines to what a number of ten bits tells; between them, between them; and again after a period. */
static void check(uint32_t width, uint32_t height, karst_wrap wrap, uint32_t num_channels)
{
    textured t = {.samples = {0}};
    make(&t, width, height, wrap, num_channels);
    const karst_image_header *texture = header_of(&t.texture);
    assert_int_equal(texture->num_levels, header_of(&t.channel[0])->num_levels);
    for (int n = 0; n < NUM_PLACES; n++) {
        const int level = (int)random_below(texture->num_levels);
        const int64_t x = (int64_t)random_below(1000) - 500, y = (int64_t)random_below(1000) - 500;
        float corners[4][3], values[3], again[3];
        for (int k = 0; k < 4; k++) {
            const noise_position p = halves(level, x + (k & 1), y + (k >> 1));
            look_up(&t, level, &p, corners[k]);
            for (uint32_t c = 0; c < num_channels; c++) {
                const karst_image_header *image = header_of(&t.channel[c]);
                const float spline = image_value(image, level, &p, -1);
                assert_true(fabsf(corners[k][c] - spline) <= (image->high - image->low) / 1022);
            }
        }
        noise_position p = halves(level, x, y);
        for (int i = 0; i < 2; i++) { /* less than half a cell on */
            const uint64_t on = ((uint64_t)random_bits() << level) >> 1,
                           place = ((uint64_t)p.axis[i].cell << 32 | p.axis[i].fraction) + on;
            p.axis[i].cell = (uint)(place >> 32);
            p.axis[i].fraction = (uint)place;
        }
        look_up(&t, level, &p, values);
        for (uint32_t c = 0; c < num_channels; c++) {
            const float low = fminf(fminf(corners[0][c], corners[1][c]), fminf(corners[2][c], corners[3][c])),
                        high = fmaxf(fmaxf(corners[0][c], corners[1][c]), fmaxf(corners[2][c], corners[3][c]));
            const float slack = 1e-5f * (header_of(&t.channel[c])->high - header_of(&t.channel[c])->low);
            assert_true(values[c] >= low - slack && values[c] <= high + slack);
        }
        p.axis[0].cell += t.texture.period[0] * random_bits();
        p.axis[1].cell -= t.texture.period[1];
        look_up(&t, level, &p, again);
        assert_memory_equal(values, again, num_channels * sizeof *values);
    }
    finish(&t);
}

static void test_texture_is_splines_at_halves(void **state)
{
    (void)state;
    random_state = 5;
    check(16, 8, KARST_WRAP_REPEAT, 3);
    check(5, 7, KARST_WRAP_MIRROR, 3);
    check(12, 16, KARST_WRAP_REPEAT, 1);
    check(1, 1, KARST_WRAP_REPEAT, 3);
}

/* The coarsest level is the mean of all samples, which a number of ten bits tells. */
static void test_the_coarsest_level_is_the_mean(void **state)
{
    textured t = {.samples = {0}};
    (void)state;
    random_state = 6;
    make(&t, 16, 16, KARST_WRAP_REPEAT, 3);
    for (int c = 0; c < 3; c++) {
        double mean = 0;
        float values[3];
        for (int i = 0; i < 256; i++)
            mean += (double)t.samples[3 * i + c] / 256;
        const noise_position p = halves(0, random_below(100), random_below(100));
        look_up(&t, (int)header_of(&t.texture)->num_levels - 1, &p, values);
        assert_true(fabs((double)values[c] - mean) < (c == 1 ? 40 : 1) / 500.);
    }
    finish(&t);
}

static karst_program_graph *compile(const char *data, const char *body)
{
    char text[1024];
    bool ok;
    karst_error error = {0};
    snprintf(text, sizeof text, "/*{ \"data\": { \"d\": { \"file\": \"%s\", \"wrap\": \"repeat\" } } }*/\n%s", data,
             body);
    karst_program_graph *program =
        karst_language_compile("demos/worlds/world", text, strlen(text), NULL, 0, &ok, &error);
    if (!program || !ok)
        fail_msg("%s", error.message);
    return program;
}

static void count(const char *data, const char *body, int num_textures, int num_images)
{
    karst_program_graph *program = compile(data, body);
    const karst_graph *graph = program->world.graph;
    for (karst_expr e = 1; e < graph->num_nodes; e++)
        if (karst_graph_is_texture(graph, e))
            num_textures--;
        else
            num_images -= karst_graph_image_axes(graph, e) > 0;
    assert_int_equal(num_textures, 0);
    assert_int_equal(num_images, 0);
    karst_program_graph_destroy(program);
}

/* Three sides of three channels; densities, images and files of other numbers have splines. */
static void test_who_has_textures(void **state)
{
    static const char colour[] = "float density(vec3 p) { return -p.y; }\n"
                                 "vec3 colour(vec3 p, vec3 n) { return texture(d, p, n, 9.0); }";
    (void)state;
    count("data/rock.png", colour, 9, 0);
    count("data/survey.png", colour, 0, 3); /* of 16 bits, grey */
    count("data/rock.png", "float density(vec3 p) { return texture(d, p, vec3(0.0, 1.0, 0.0), 9.0).x - p.y; }", 0, 1);
    count("data/rock.png",
          "float density(vec3 p) { return texture(d, p, vec3(0.0, 1.0, 0.0), 9.0).x - p.y; }\n"
          "vec3 colour(vec3 p, vec3 n) { return texture(d, p, vec3(0.0, 1.0, 0.0), 9.0); }",
          3, 1);
}

/* A device's floats lie where doubles do. */
static void test_oracles_agree(void **state)
{
    karst_error error = {0};
    karst_program_graph *program =
        compile("data/rock.png", "float density(vec3 p) { return -p.y; }\n"
                                 "vec3 colour(vec3 p, vec3 n) { return texture(d, p, n, 9.0); }");
    karst_oracle *oracle = karst_oracle_create(&program->world, NULL, 1, program->header.voxel_log2_m, &error);
    assert_non_null(oracle);
    (void)state;
    random_state = 7;
    for (int n = 0; n < NUM_PLACES; n++) {
        const float facing[KARST_FACING_FLOATS] = {(float)random_unit(), (float)random_unit(), (float)random_unit()};
        karst_oracle_value v[KARST_NUM_ROOTS];
        karst_position p = {{0}, {0}};
        for (int i = 0; i < 3; i++) {
            p.voxel[i] = (int64_t)random_bits() - 0x80000000ll;
            p.fraction[i] = random_bits();
        }
        karst_oracle_shading(oracle, &p, facing, (int)random_below(12) - 1, v);
        for (int c = 0; c < 3; c++)
            assert_true(fabs(v[KARST_ROOT_COLOUR + c].precise - (double)v[KARST_ROOT_COLOUR + c].device) < 2e-6);
    }
    karst_oracle_destroy(oracle);
    karst_program_graph_destroy(program);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_texture_is_splines_at_halves),
        cmocka_unit_test(test_the_coarsest_level_is_the_mean),
        cmocka_unit_test(test_who_has_textures),
        cmocka_unit_test(test_oracles_agree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
