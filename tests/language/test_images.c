/* image(NAME, p) and field(NAME, p): their bounds over random boxes hold for every wrap, size and argument, at every
 * footprint, and would not without any one of their rules; the tape gives the oracle's bits, and those lie where
 * doubles do; the surface goes through the samples; its gradient is that of doubles. Texts that name data which is not
 * there. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <cmocka.h>
#include <math.h>
#include <unistd.h>

/* Every rule that can be broken. */
enum broken { BREAK_NOTHING, BREAK_TILES, BREAK_LEVELS, BREAK_DETAIL, BREAK_SLOPE, BREAK_DERIVATIVE, NUM_BROKEN };
static enum broken broken;
#define IMAGE_MUTANT(rule) (broken == BREAK_##rule)

#include "karst/image.h"
#include "producers/language/language.h"
#include "producers/language/graph/derive.h"
#include "producers/language/oracle/oracle.h"
#include "producers/language/tape/tape.h"
#include "producers/language/tape/tape.clh"
#include "tests/language/field_file.h"
#include "tests/language/random_graph.h"
#include "tests/support/files.h"

enum { MOST_SLOTS = 64, NUM_BOXES = 400, NUM_SAMPLES = 12, TEXT_BYTES = 4096 };

static char folder[512];

/* ---- worlds ---- */

typedef struct {
    karst_program_graph *program;
    karst_world_layout layout;
    karst_tape tape;
    uint64_t *data;
    int slots[MOST_SLOTS * TAPE_BOUND_ELEMENTS];
    tape_program runs;
    karst_oracle *oracle;
} image_world;

static karst_program_graph *compile(const char *text, bool *ok, karst_error *error)
{
    char name[600];
    snprintf(name, sizeof name, "%s/world.karst", folder);
    return karst_language_compile(name, text, strlen(text), NULL, 0, ok, error);
}

static void open_world(image_world *w, const char *text)
{
    bool ok;
    karst_error error = {0};
    w->program = compile(text, &ok, &error);
    if (!ok)
        fail_msg("%s", error.message);
    const karst_resolved_world *world = &w->program->world;
    const int voxel_log2_m = w->program->header.voxel_log2_m;
    assert_true(karst_world_layout_init(&w->layout, world));
    assert_true(karst_tape_build(&w->layout, &world->root[KARST_ROOT_DENSITY], 1, &w->tape, &error));
    assert_true(w->tape.num_slots <= MOST_SLOTS && w->tape.has_images);
    w->data = calloc(w->layout.num_words, sizeof *w->data);
    assert_true(karst_world_data_fill(&w->layout, NULL, 1, voxel_log2_m, w->data));
    w->runs = (tape_program){.code = w->tape.code,
                             .num_instructions = w->tape.num_instructions,
                             .constants = w->tape.constants,
                             .data = w->data,
                             .values = (const uint *)(w->data + w->layout.values_word),
                             .num_values = w->layout.num_values,
                             .slots = w->slots};
    w->oracle = karst_oracle_create(world, NULL, 1, voxel_log2_m, &error);
    assert_non_null(w->oracle);
}

static void close_world(image_world *w)
{
    karst_oracle_destroy(w->oracle);
    free(w->data);
    karst_tape_finish(&w->tape);
    karst_program_graph_destroy(w->program);
}

static float value_at(image_world *w, const affine_position *at, int level)
{
    tape_values(&w->runs, at, NULL, level);
    return k_as_float((uint)tape_load(&w->runs, w->tape.output[0]));
}

static karst_position position_of(const affine_position *at)
{
    karst_position p;
    for (int i = 0; i < 3; i++) {
        p.voxel[i] = at->voxel[i];
        p.fraction[i] = at->fraction[i];
    }
    return p;
}

/* ---- files ---- */

static const char *path_of(const char *name)
{
    static char path[1200];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

/* Rough samples, some with cliffs. */
static void write_samples(int width, int height, bool cliffs)
{
    float *values = malloc((size_t)width * (size_t)height * sizeof *values);
    for (int i = 0; i < width * height; i++)
        values[i] = (float)(cliffs ? (random_chance(3) ? 90 : -10) + random_unit()
                                   : 20 * sin(0.3 * (i % width)) + 15 * cos(0.2 * (i / width)) + 4 * random_unit());
    write_file(path_of("samples.raw"), values, (size_t)width * (size_t)height * sizeof *values);
    free(values);
}

/* The same in space, 10 m apart. */
static void write_field(const int size[3], bool cliffs)
{
    const int num = size[0] * size[1] * size[2];
    float *values = malloc((size_t)num * sizeof *values);
    for (int i = 0; i < num; i++)
        values[i] = (float)(cliffs ? (random_chance(3) ? 90 : -10) + random_unit()
                                   : 20 * sin(0.3 * (i % size[0])) + 15 * cos(0.2 * (i / size[0] % size[1])) +
                                         i / size[0] / size[1] + 4 * random_unit());
    assert_true(write_field_file(path_of("samples.nvdb"), values, size, 10));
    free(values);
}

static const char *field_text(const char *wrap, const char *body)
{
    static char text[TEXT_BYTES];
    snprintf(text, sizeof text,
             "/*{ \"voxel\": 0.25, \"data\": { \"d\": { \"file\": \"samples.nvdb\", \"grid\": \"x\", \"wrap\": \"%s\" "
             "} } }*/\n%s\n",
             wrap, body);
    return text;
}

static const char *world_text(int width, int height, const char *wrap, const char *size, const char *body)
{
    static char text[TEXT_BYTES];
    snprintf(text, sizeof text,
             "/*{ \"voxel\": 0.25, \"data\": { \"d\": { \"file\": \"samples.raw\", \"format\": \"float32\", "
             "\"shape\": [%d, %d], \"size\": %s, \"wrap\": \"%s\" } } }*/\n%s\n",
             width, height, size, wrap, body);
    return text;
}

/* ---- bounds ---- */

static const struct {
    int width, height;
    const char *wrap, *size, *body;
    bool cliffs;
    int depth; /* of a field */
} cases[] = {
    {37, 21, "clamp", "[370, 210]", "float density(vec3 p) { return image(d, p.xz) - p.y; }", false, 0},
    {64, 64, "repeat", "[640, 640]", "float density(vec3 p) { return image(d, p.xz) - p.y; }", true, 0},
    {20, 33, "repeat", "[200, 300]", "float density(vec3 p) { return image(d, p.xz + 30.0 * noise(p / 90.0)); }", false,
     0},
    {9, 16, "mirror", "[50, 60]", "float density(vec3 p) { return image(d, mat2(0.6, 0.8, -0.8, 0.6) * p.zy) + p.x; }",
     true, 0},
    {50, 40, "clamp", "[3, 2]", "float density(vec3 p) { return image(d, vec2(length(p.xz), p.y / 7.0)); }", false, 0},
    {40, 40, "clamp", "[4000, 4000]",
     "float density(vec3 p) { float h = image(d, p.xz); return h + image(d, 5.0 * p.xz + h) / 5.0 - p.y; }", false, 0},
    {1, 1, "clamp", "[1, 1]", "float density(vec3 p) { return image(d, p.xz) - p.y; }", false, 0},
    {13, 9, "clamp", NULL, "float density(vec3 p) { return field(d, p) - 0.3 * p.y; }", false, 11},
    {16, 8, "repeat", NULL, "float density(vec3 p) { return field(d, p + 30.0 * noise(p / 90.0)); }", true, 8},
    {7, 10, "mirror", NULL, "float density(vec3 p) { return field(d, vec3(0.6 * p.x + 0.8 * p.z, p.y, p.x)) + p.x; }",
     true, 5},
    {20, 20, "clamp", NULL, "float density(vec3 p) { float h = field(d, p); return h + field(d, 5.0 * p + h) / 5.0; }",
     false, 20},
    {2, 1, "clamp", NULL, "float density(vec3 p) { return field(d, p * 0.01) - p.y; }", true, 1},
};

static void open_case(image_world *w, int number)
{
    const int width = cases[number].width, height = cases[number].height;
    if (cases[number].depth) {
        write_field((const int[3]){width, height, cases[number].depth}, cases[number].cliffs);
        open_world(w, field_text(cases[number].wrap, cases[number].body));
        return;
    }
    write_samples(width, height, cases[number].cliffs);
    open_world(w, world_text(width, height, cases[number].wrap, cases[number].size, cases[number].body));
}

static op_box random_box(void)
{
    op_box box = {.level = (int)random_below(13) - 1};
    const double spread = random_magnitude(1, 1e5);
    const double radius = box.level < 0 || random_chance(3) ? random_magnitude(1e-3, 10) : ldexp(8, box.level);
    const double far = random_chance(5) ? 1e10 : random_chance(8) ? 1e15 : 0;
    for (int axis = 0; axis < 3; axis++) {
        box.centre.voxel[axis] = (int64_t)((2 * random_unit() - 1) * spread + far);
        box.centre.fraction[axis] = random_chance(2) ? random_bits() : 0;
        box.radius[axis] = (float)radius;
    }
    return box;
}

static affine_position random_place_in(const op_box *box)
{
    affine_position at;
    for (int axis = 0; axis < 3; axis++) {
        const int64_t most = (int64_t)((double)box->radius[axis] * 0x1p32);
        const int64_t offset =
            random_chance(3) ? (random_chance(2) ? most : -most) : (int64_t)((random_unit() * 2 - 1) * (double)most);
        const int64_t sum = (int64_t)box->centre.fraction[axis] + offset;
        at.voxel[axis] = box->centre.voxel[axis] + (sum >> 32);
        at.fraction[axis] = (uint32_t)sum;
    }
    return at;
}

static double apart_at_most(const op_bound *b, const affine_position *x, const affine_position *s)
{
    double apart = (double)b->d + ((double)b->r.hi - (double)b->r.lo);
    for (int axis = 0; axis < 3; axis++) {
        const double delta = (double)(x->voxel[axis] - s->voxel[axis]) +
                             ((double)x->fraction[axis] - (double)s->fraction[axis]) * 0x1p-32;
        apart += fmax(delta * (double)b->g[axis].lo, delta * (double)b->g[axis].hi);
    }
    return apart;
}

/* How many of a case's boxes say what is not so. */
static int count_lies(int number, int *num_decided)
{
    image_world w;
    int lies = 0;
    random_state = 11 + (uint64_t)number;
    open_case(&w, number);
    for (int n = 0; n < NUM_BOXES; n++) {
        const op_box box = random_box();
        if (tape_bounds(&w.runs, &box, NULL))
            continue;
        const op_bound b = tape_load_bound(&w.runs, w.tape.output[0]);
        bool holds = true;
        *num_decided += b.v.lo > 0 || b.v.hi < 0;
        for (int k = 0; k < NUM_SAMPLES; k++) {
            const affine_position at = random_place_in(&box), sample = random_place_in(&box);
            const int level = box.level < 0 ? -1 : (int)random_below((uint32_t)box.level + 3) - 1;
            const float value = value_at(&w, &at, level), there = value_at(&w, &sample, box.level);
            const float centre = value_at(&w, &box.centre, level);
            const karst_position p = position_of(&at);
            const double precise = karst_oracle_density(w.oracle, &p, level).precise;
            holds = holds && value >= b.v.lo && value <= b.v.hi && precise >= (double)b.v.lo &&
                    precise <= (double)b.v.hi && centre >= b.c.lo && centre <= b.c.hi &&
                    (double)value - (double)there <= apart_at_most(&b, &at, &sample);
        }
        lies += !holds;
    }
    close_world(&w);
    return lies;
}

static void test_bounds_hold_and_every_rule_is_needed(void **state)
{
    static const char *const names[NUM_BROKEN] = {"nothing", "TILES", "LEVELS", "DETAIL", "SLOPE", "DERIVATIVE"};
    (void)state;
    for (int b = 0; b < BREAK_DERIVATIVE; b++) {
        int lies = 0, of_fields = 0, decided = 0;
        for (int i = 0; i < (int)(sizeof cases / sizeof *cases); i++) {
            broken = (enum broken)b;
            const int of_case = count_lies(i, &decided);
            if (b == BREAK_NOTHING && of_case)
                fail_msg("%d boxes of case %d say what is not so", of_case, i);
            lies += of_case;
            of_fields += cases[i].depth ? of_case : 0;
        }
        broken = BREAK_NOTHING;
        print_message("without %s: %d boxes say what is not so, %d of them of fields; %d have one sign\n", names[b],
                      lies, of_fields, decided);
        assert_true(b == BREAK_NOTHING ? decided > 1000 : lies > of_fields && of_fields > 0);
    }
}

/* A slope that is part of a density, by its supremum. */
static void test_derivatives_are_bounded(void **state)
{
    (void)state;
    random_state = 3;
    write_samples(32, 32, true);
    for (int b = 0; b < 2; b++) {
        broken = b ? BREAK_DERIVATIVE : BREAK_NOTHING;
        karst_octave octave = {.frequency = 1, .seed = 0};
        karst_samples_image image;
        karst_error error = {0};
        float samples[64];
        for (int i = 0; i < 64; i++)
            samples[i] = (float)(i % 8 == 3 ? 5 : 0);
        assert_true(karst_samples_image_build(&image, samples, 8, 8, 1, KARST_WRAP_REPEAT, &error));
        /* the record and its header, one behind the other */
        uint64_t *words = calloc(sizeof octave / 8 + image.num_words, 8);
        octave.image = sizeof octave / 8;
        memcpy(words, &octave, sizeof octave);
        memcpy(words + octave.image, image.words, image.num_words * sizeof *words);
        const op_bound s = bounds_image_slope((const karst_octave *)words, 0);
        float steepest = 0;
        for (int i = 0; i < 800; i++) {
            const noise_position p = {{{(uint)i / 100, (uint)(i % 100) * 42949672u}, {3, 7}, {0, 0}}};
            steepest = fmaxf(steepest, fabsf(image_value(image_of((const karst_octave *)words), 0, &p, 0)));
        }
        assert_int_equal(b, !(steepest <= s.v.hi && -steepest >= s.v.lo));
        free(words);
        karst_samples_image_finish(&image);
    }
    broken = BREAK_NOTHING;
}

/* ---- values ---- */

static void test_tape_gives_the_oracles_bits_near_doubles(void **state)
{
    (void)state;
    for (int i = 0; i < (int)(sizeof cases / sizeof *cases); i++) {
        image_world w;
        random_state = 5 + (uint64_t)i;
        open_case(&w, i);
        for (int n = 0; n < 500; n++) {
            op_box box = random_box();
            box.level = (int)random_below(13) - 1;
            box.radius[0] = box.radius[1] = box.radius[2] = 0;
            const karst_position p = position_of(&box.centre);
            const karst_oracle_value there = karst_oracle_density(w.oracle, &p, box.level);
            const float value = value_at(&w, &box.centre, box.level);
            if (k_as_uint(value) != k_as_uint(there.device))
                fail_msg("case %d: %.9g by the tape, %.9g by the oracle", i, (double)value, (double)there.device);
            if (tape_bounds(&w.runs, &box, NULL))
                continue;
            const double allowed = (double)tape_load_bound(&w.runs, w.tape.output[0]).d;
            if (!(fabs((double)value - there.precise) <= allowed))
                fail_msg("case %d: %.9g as float, %.12g as double, are more than %g apart", i, (double)value,
                         there.precise, allowed);
        }
        close_world(&w);
    }
}

static const char plain[] = "float density(vec3 p) { return image(d, p.xz); }";

static void test_the_surface_goes_through_the_samples(void **state)
{
    static const char *const wraps[] = {"clamp", "repeat", "mirror"};
    (void)state;
    for (int i = 0; i < 3; i++) {
        image_world w;
        size_t length;
        random_state = 17;
        write_samples(16, 8, true);
        float *samples = read_file(path_of("samples.raw"), &length);
        open_world(&w, world_text(16, 8, wraps[i], "[64, 32]", plain));
        for (int y = 0; y < 8; y++)
            for (int x = 0; x < 16; x++) {
                /* voxels of 0.25 m, samples in the middles of cells of 4 m, the first row farthest */
                affine_position at = {.voxel = {16 * x + 8, 5, 16 * (7 - y) + 8}};
                const float value = value_at(&w, &at, -1), sample = samples[16 * y + x];
                if (!(fabsf(value - sample) < 1e-4f))
                    fail_msg("%s: sample %d, %d is %.9g, not %.9g", wraps[i], x, y, (double)value, (double)sample);
                if (i == 0)
                    continue;
                /* once more, a trillion images away */
                at.voxel[0] += 256ll * 2 * 1000000000000;
                at.voxel[2] -= 128ll * 2 * 1000000000001;
                assert_int_equal(k_as_uint(value), k_as_uint(value_at(&w, &at, -1)));
            }
        close_world(&w);
        free(samples);
    }
}

static void test_fields_go_through_their_samples(void **state)
{
    static const char *const wraps[] = {"clamp", "repeat", "mirror"};
    static const int size[3] = {8, 16, 4};
    static float samples[8 * 16 * 4];
    (void)state;
    random_state = 41;
    for (int i = 0; i < 8 * 16 * 4; i++)
        samples[i] = (float)((random_chance(3) ? 90 : -10) + random_unit());
    assert_true(write_field_file(path_of("samples.nvdb"), samples, size, 4));
    for (int i = 0; i < 3; i++) {
        image_world w;
        open_world(&w, field_text(wraps[i], "float density(vec3 p) { return field(d, p); }"));
        assert_true(w.tape.has_fields);
        for (int n = 0; n < 8 * 16 * 4; n++) {
            /* voxels of 0.25 m, samples in the middles of cells of 4 m */
            affine_position at = {.voxel = {16 * (n % 8) + 8, 16 * (n / 8 % 16) + 8, 16 * (n / 128) + 8}};
            const float value = value_at(&w, &at, -1);
            if (!(fabsf(value - samples[n]) < 1e-3f))
                fail_msg("%s: sample %d is %.9g, not %.9g", wraps[i], n, (double)value, (double)samples[n]);
            at.voxel[1] += i == 0 ? 0 : 256ll * 2 * 1000000000000;
            assert_int_equal(k_as_uint(value), k_as_uint(value_at(&w, &at, -1)));
        }
        close_world(&w);
    }
}

/* Coarse footprints show the mean, and never more than is there. */
static void test_coarse_levels_show_less(void **state)
{
    image_world w;
    size_t length;
    double mean = 0, finest = 0, coarsest = 0;
    (void)state;
    random_state = 23;
    write_samples(32, 32, true);
    float *samples = read_file(path_of("samples.raw"), &length);
    for (int i = 0; i < 1024; i++)
        mean += (double)samples[i] / 1024;
    open_world(&w, world_text(32, 32, "repeat", "[128, 128]", plain));
    for (int n = 0; n < 200; n++) {
        affine_position at = {.voxel = {random_below(512), 0, random_below(512)}};
        finest = fmax(finest, fabs((double)value_at(&w, &at, 0) - mean));
        coarsest = fmax(coarsest, fabs((double)value_at(&w, &at, 10) - mean));
    }
    assert_true(finest > 20);
    assert_true(coarsest < 0.01);
    close_world(&w);
    free(samples);
}

/* From above, from a side, and in between: what images of the planes say. */
static void test_textures_are_images_of_three_planes(void **state)
{
    static const struct {
        const char *normal, *plane;
    } sides[] = {{"0.2, -0.9, 0.3", "p.xz"}, {"1.0, 0.1, 0.0", "p.zy"}, {"0.1, 0.0, -0.8", "p.xy"}};
    char text[TEXT_BYTES], body[512];
    image_world a, b;
    (void)state;
    random_state = 37;
    write_samples(32, 16, true);
    for (int i = 0; i < 3; i++) {
        snprintf(body, sizeof body, "float density(vec3 p) { return texture(d, p, vec3(%s), 24.0); }", sides[i].normal);
        open_world(&a, world_text(32, 16, "repeat", "[24, 12]", body));
        snprintf(body, sizeof body, "float density(vec3 p) { return image(d, %s); }", sides[i].plane);
        open_world(&b, world_text(32, 16, "repeat", "[24, 12]", body));
        for (int n = 0; n < 100; n++) {
            affine_position at = {.voxel = {random_below(4096), random_below(4096), (int64_t)random_bits() << 20}};
            const int level = (int)random_below(8) - 1;
            assert_int_equal(k_as_uint(value_at(&a, &at, level)), k_as_uint(value_at(&b, &at, level)));
        }
        close_world(&a);
        close_world(&b);
    }
    /* a normal between two planes gives what lies between both */
    snprintf(text, sizeof text, "%s",
             world_text(32, 16, "repeat", "[24, 12]",
                        "float density(vec3 p) { return texture(d, p, vec3(0.7, 0.7, 0.0), 24.0) -\n"
                        "    0.5 * (image(d, p.xz) + image(d, p.zy)); }"));
    open_world(&a, text);
    for (int n = 0; n < 100; n++) {
        affine_position at = {.voxel = {random_below(4096), random_below(4096), random_below(4096)}};
        assert_true(fabsf(value_at(&a, &at, -1)) < 1e-4f);
    }
    close_world(&a);
}

static void compare_gradients(const char *text)
{
    image_world w;
    karst_error error = {0};
    open_world(&w, text);
    karst_gradient_world *derived = karst_derive(&w.program->world, &error);
    assert_non_null(derived);
    karst_oracle *oracle = karst_oracle_create(&derived->world, NULL, 1, w.program->header.voxel_log2_m, &error);
    assert_non_null(oracle);
    for (int n = 0; n < 200; n++) {
        affine_position at = {.voxel = {random_below(4096), random_below(64), random_below(4096)}};
        for (int axis = 0; axis < 3; axis++)
            at.fraction[axis] = random_bits();
        karst_oracle_value gradient[3];
        const karst_position p = position_of(&at);
        karst_oracle_gradient(oracle, &p, 2, gradient);
        for (int axis = 0; axis < 3; axis++) {
            karst_position a = p, b = p; /* a 64th of a voxel to each side */
            const uint32_t step = 1u << 26;
            b.voxel[axis] += b.fraction[axis] > UINT32_MAX - step;
            b.fraction[axis] += step;
            a.voxel[axis] -= a.fraction[axis] < step;
            a.fraction[axis] -= step;
            const double slope =
                (karst_oracle_precise_density(w.oracle, &b, 2) - karst_oracle_precise_density(w.oracle, &a, 2)) /
                (0.25 / 32);
            assert_true(fabs(slope - gradient[axis].precise) < 1e-4);
            assert_true(fabs(slope - (double)gradient[axis].device) < 1e-3);
        }
    }
    karst_oracle_destroy(oracle);
    karst_gradient_world_destroy(derived);
    close_world(&w);
}

static void test_gradients_are_those_of_doubles(void **state)
{
    (void)state;
    random_state = 29;
    write_samples(32, 32, false);
    compare_gradients(
        world_text(32, 32, "repeat", "[128, 128]",
                   "float density(vec3 p) { return image(d, p.zx * 0.5 + vec2(noise(p / 50.0))) - p.y; }"));
    write_field((const int[3]){32, 16, 8}, false);
    compare_gradients(
        field_text("repeat", "float density(vec3 p) { return field(d, p.zxy * 0.5 + vec3(noise(p / 50.0))) - p.y; }"));
}

/* ---- texts ---- */

static void test_hostile_texts_are_told(void **state)
{
#define HEADER(data) "/*{ \"data\": { " data " } }*/\n"
#define FIELD "float density(vec3 p) { return field(d, p) - p.y; }\n"
#define IMAGE "float density(vec3 p) { return image(d, p.xz) - p.y; }\n"
    static const struct {
        const char *text, *said;
        int status;
    } texts[] = {
        {HEADER("\"d\": { \"file\": \"none.png\", \"size\": [1, 1] }") IMAGE, "No such file", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"..\", \"size\": [1, 1] }") IMAGE, "no regular file", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"/dev/zero\", \"size\": [1, 1] }") IMAGE, "no regular file", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"pipe\", \"size\": [1, 1] }") IMAGE, "no regular file", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"\", \"size\": [1, 1] }") IMAGE, "a file has a name", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"text\", \"size\": [1, 1] }") IMAGE, "no PNG, TIFF or OpenEXR", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"text\", \"format\": \"float32\", \"shape\": [9, 9], \"size\": [1, 1] }") IMAGE,
         "it has 5 bytes, and 9 x 9 numbers of float32 are 324", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"text\", \"format\": \"float32\", \"shape\": [32768, 32768], \"size\": [1, 1] }")
             IMAGE,
         "too many", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"text\", \"format\": \"float16\", \"shape\": [9, 9], \"size\": [1, 1] }") IMAGE,
         "no raw numbers are called", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"text\", \"format\": \"uint8\", \"size\": [1, 1] }") IMAGE, "have a \"shape\"",
         KARST_BAD_WORLD},
        {HEADER("\"d\": { \"file\": \"a.exr\" }") IMAGE, "has no size", KARST_BAD_WORLD},
        {HEADER("\"d\": { \"file\": \"a.exr\", \"size\": [0, 1] }") IMAGE, "from 1e-06", KARST_BAD_WORLD},
        {HEADER("\"d\": { \"file\": \"a.exr\", \"size\": 5 }") IMAGE, "two numbers", KARST_BAD_WORLD},
        {HEADER("\"d\": { \"file\": \"a.exr\", \"size\": [1, 1], \"wrap\": \"turn\" }") IMAGE, "no way of going on",
         KARST_BAD_WORLD},
        {HEADER("\"d\": { \"size\": [1, 1] }") IMAGE, "has no file", KARST_BAD_WORLD},
        {HEADER("\"2\": { \"file\": \"a.exr\" }") IMAGE, "a word that the functions can use", KARST_BAD_WORLD},
        {IMAGE, "no data called 'd'", KARST_BAD_WORLD},
        {HEADER("\"dem\": { \"file\": \"a.exr\", \"size\": [1, 1] }") IMAGE, "no data called 'd'", KARST_BAD_WORLD},
        {"float density(vec3 p) { return image(1.0, p.xz); }", "called by the name of its data", KARST_BAD_WORLD},
        {"float density(vec3 p) { return image(); }", "called by the name of its data", KARST_BAD_WORLD},
        {HEADER("\"d\": { \"file\": \"a.exr\", \"size\": [1, 1] }") "float density(vec3 p) { return image(d, p); }",
         "the place in an image", KARST_BAD_WORLD},
        {HEADER("\"d\": { \"file\": \"a.exr\", \"size\": [1, 1] }") "float density(vec3 p) { return image(d); }",
         "write image(d, p)", KARST_BAD_WORLD},
        {HEADER("\"d\": { \"file\": \"a.exr\", \"size\": [1, 1] }") "float density(vec3 p) { return d; }", "'d'",
         KARST_BAD_WORLD},
        {HEADER("\"d\": { \"file\": \"a.exr\" }") "float density(vec3 p) { return texture(d, p, p, 2.0) - p.y; }",
         "goes on beyond its edges", KARST_BAD_WORLD},
        {HEADER("\"d\": { \"file\": \"a.exr\", \"wrap\": \"repeat\" }") "float density(vec3 p) { return texture(d, p, "
                                                                        "p); }",
         "write texture(d, p, n, size)", KARST_BAD_WORLD},
        {HEADER("\"d\": { \"file\": \"a.exr\", \"wrap\": \"repeat\" }") "float density(vec3 p) { return texture(d, p, "
                                                                        "p, 1.0, 2.0); }",
         "no more than 3 arguments", KARST_BAD_WORLD},
        {"float density(vec3 p) { return texture(d, p.xz).x; }", "no screen and no textures", KARST_BAD_WORLD},
        {HEADER("\"d\": { \"file\": \"a.exr\", \"wrap\": \"repeat\" }") "float density(vec3 p) { return texture(d, p, "
                                                                        "p, 0.0) - p.y; }",
         NULL, KARST_OK},
        {HEADER("\"d\": { \"file\": \"a.exr\", \"wrap\": \"mirror\" }") "float density(vec3 p) { return texture(d, p, "
                                                                        "normalize(p), 2.0) - p.y; }",
         NULL, KARST_OK},
        {HEADER("\"d\": { \"file\": \"samples.nvdb\" }") "float density(vec3 p) { return field(d, p); }", NULL,
         KARST_OK},
        {HEADER("\"d\": { \"file\": \"samples.nvdb\", \"grid\": \"y\" }") FIELD, "no grid that is called 'y'",
         KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"none.nvdb\" }") FIELD, "No such file", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"/dev/zero\" }") FIELD, "no regular file", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"a.exr\" }") FIELD, "no NanoVDB file", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"samples.nvdb\", \"size\": [1, 1] }") IMAGE, "no PNG, TIFF", KARST_BAD_DATA},
        {HEADER("\"d\": { \"file\": \"samples.nvdb\" }") "float density(vec3 p) { return field(d); }",
         "write field(d, p)", KARST_BAD_WORLD},
        /* what is not used is not opened, and a function of the text's own hides the one for data */
        {HEADER("\"d\": { \"file\": \"none.png\" }") "float density(vec3 p) { return -p.y; }", NULL, KARST_OK},
        {"float image(float d, vec2 p) { return d * p.x; }\nfloat density(vec3 p) { return image(1.0, p.xz); }", NULL,
         KARST_OK},
        /* finer than a voxel of 2^40 m could tell, and the same everywhere */
        {"/*{ \"voxel\": 1e12, \"data\": { \"d\": { \"file\": \"a.exr\", \"size\": [1, 1] } } }*/" IMAGE, NULL,
         KARST_OK},
        {HEADER("\"d\": { \"file\": \"a.exr\", \"size\": [1, 1] }") "float density(vec3 p) { return image(d, "
                                                                    "vec2(0.5)) - p.y; }",
         NULL, KARST_OK},
    };
    (void)state;
    const float values[6] = {1, 2, 3, 4, 5, 7};
    const karst_image_channel one = {"Z", values, 1};
    assert_true(karst_image_write_channels(path_of("a.exr"), &one, 1, 3, 2, NULL));
    write_file(path_of("text"), "hello", 5);
    assert_int_equal(mkfifo(path_of("pipe"), 0600), 0);
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        bool ok;
        karst_error error = {0};
        karst_program_graph *program = compile(texts[i].text, &ok, &error);
        assert_non_null(program);
        if (error.status != (karst_status)texts[i].status || (texts[i].said && !strstr(error.message, texts[i].said)))
            fail_msg("text %zu: status %d, \"%s\"", i, (int)error.status, error.message);
        if (ok) { /* what it gives is a number */
            karst_oracle *oracle = karst_oracle_create(&program->world, NULL, 1, program->header.voxel_log2_m, &error);
            assert_non_null(oracle);
            assert_true(isfinite(karst_oracle_density(oracle, &(karst_position){.voxel = {7, 8, 9}}, 1).device));
            karst_oracle_destroy(oracle);
        }
        karst_program_graph_destroy(program);
    }
}

/* ---- the whole ---- */

static void remove_folder(void)
{
    static const char *const names[] = {"samples.raw", "samples.nvdb", "a.exr", "text", "pipe"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        unlink(path_of(names[i]));
    rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bounds_hold_and_every_rule_is_needed),
        cmocka_unit_test(test_derivatives_are_bounded),
        cmocka_unit_test(test_tape_gives_the_oracles_bits_near_doubles),
        cmocka_unit_test(test_the_surface_goes_through_the_samples),
        cmocka_unit_test(test_fields_go_through_their_samples),
        cmocka_unit_test(test_coarse_levels_show_less),
        cmocka_unit_test(test_textures_are_images_of_three_planes),
        cmocka_unit_test(test_gradients_are_those_of_doubles),
        cmocka_unit_test(test_hostile_texts_are_told),
    };
    snprintf(folder, sizeof folder, "%.200s/karst-images-XXXXXX", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    if (!mkdtemp(folder))
        return 1;
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    remove_folder();
    return failed;
}
