/* Light that media scatter often, from a coarse grid: its energy is kept to the last quantum, it is what paths in
 * double say, and neither lanes nor what was seen before leave a trace in it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/engine/engine_parts.h"
#include "karst/karst.h"
#include "karst/reference.h"
#include "raycast/media/fluence.h"

/* From the repository's root, as tests are run. */
static const char cloud[] = "docs/accuracy/cloud.karst";

#define FEW_PACKETS 8192u

#define assert_ok(call)                               \
    do {                                              \
        karst_error error = {0};                      \
        if (!(call))                                  \
            fail_msg("%s: %s", #call, error.message); \
    } while (0)

static bool is_full(void) { return getenv("KARST_TEST_FULL") != NULL; }

typedef struct {
    int width_px, height_px, lanes;
    double detail_px, depth, g, white;
    uint32_t samples, packets;
} setting;

static karst_engine *create(const setting *s)
{
    const karst_parameter parameters[] = {{"depth", s->depth}, {"forward", s->g}, {"white", s->white}};
    const karst_engine_config config = {.world = cloud,
                                        .parameters = parameters,
                                        .num_parameters = 3,
                                        .pool_bytes = (uint64_t)128 << 20,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = s->width_px,
                                        .height_px = s->height_px,
                                        .detail_px = s->detail_px,
                                        .samples = s->samples,
                                        .tone = KARST_TONE_OF_FILM,
                                        .scattering = KARST_SCATTERING_FLUENCE,
                                        .lanes = s->lanes};
    karst_error error = {0};
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine)
        fail_msg("%s", error.message);
    engine->fluence_packets = s->packets;
    return engine;
}

static void settle(karst_engine *engine, float *light)
{
    bool settled = false;
    const size_t num = (size_t)engine->width_px * (size_t)engine->height_px * 3;
    assert_ok(karst_engine_settle(engine, 2000, NULL, NULL, &settled, &error) &&
              karst_engine_read_radiance(engine, light, num, &error));
    assert_true(settled);
}

/* ---- energy ---- */

static uint64_t all_of(const uint64_t s[KARST_FLUENCE_SUMS])
{
    return s[KARST_FLUENCE_ESCAPED] + s[KARST_FLUENCE_ABSORBED] + s[KARST_FLUENCE_SHADED] + s[KARST_FLUENCE_LOST] +
           s[KARST_FLUENCE_CUT];
}

/* To the quantum; and chance gives as much as it takes. */
static void what_goes_in_comes_out_or_is_absorbed(void **state)
{
    (void)state;
    static const double whites[] = {1, 0.5};
    for (int i = 0; i < 2; i++) {
        const setting s = {.width_px = 8, .height_px = 6, .detail_px = 1, .samples = 1, .packets = FEW_PACKETS,
                           .depth = 10, .g = 0.5, .white = whites[i]};
        float light[8 * 6 * 3];
        uint64_t sums[KARST_FLUENCE_SUMS];
        int size[3];
        karst_engine *engine = create(&s);
        settle(engine, light);
        assert_ok(karst_fluence_sums(engine->media->fluence, 0, size, sums, &error));
        karst_engine_destroy(engine);
        print_message("# albedo %g: given %.4e, escaped %.4f, absorbed %.4f, won %.4f, lost %.4f\n", s.white,
                      (double)sums[KARST_FLUENCE_GIVEN],
                      (double)sums[KARST_FLUENCE_ESCAPED] / (double)sums[KARST_FLUENCE_GIVEN],
                      (double)sums[KARST_FLUENCE_ABSORBED] / (double)sums[KARST_FLUENCE_GIVEN],
                      (double)sums[KARST_FLUENCE_WON] / (double)sums[KARST_FLUENCE_GIVEN],
                      (double)sums[KARST_FLUENCE_LOST] / (double)sums[KARST_FLUENCE_GIVEN]);
        assert_true(sums[KARST_FLUENCE_GIVEN] > (uint64_t)FEW_PACKETS * KARST_FLUENCE_WHOLE);
        assert_true(sums[KARST_FLUENCE_GIVEN] + sums[KARST_FLUENCE_WON] == all_of(sums));
        const double won = (double)sums[KARST_FLUENCE_WON], lost = (double)sums[KARST_FLUENCE_LOST];
        assert_true(fabs(won - lost) < 0.002 * (double)sums[KARST_FLUENCE_GIVEN]);
        assert_true(sums[KARST_FLUENCE_SHADED] == 0 && sums[KARST_FLUENCE_CUT] == 0);
        if (i == 0)
            assert_true(sums[KARST_FLUENCE_ABSORBED] == 0 && sums[KARST_FLUENCE_ESCAPED] == sums[KARST_FLUENCE_GIVEN]);
        else
            assert_true(won > 0 && sums[KARST_FLUENCE_ABSORBED] > sums[KARST_FLUENCE_GIVEN] / 10);
    }
}

/* ---- truth ---- */

/* What pictures differ by from paths in double, as shares of their mean: in the mean, and rms without the truth's own
 * noise. */
static void compare(const setting *s, uint32_t paths_px, double *bias, double *rms)
{
    const size_t num = (size_t)s->width_px * (size_t)s->height_px * 3;
    const karst_parameter parameters[] = {{"depth", s->depth}, {"forward", s->g}, {"white", s->white}};
    const karst_reference_config config = {.world = cloud,
                                           .parameters = parameters,
                                           .num_parameters = 3,
                                           .width_px = s->width_px,
                                           .height_px = s->height_px};
    const karst_reference_light light = {
        .paths_px = paths_px, .spread_px = true, .max_nodes = 16384, .around_of_world = true};
    float *seen = calloc(num, sizeof *seen);
    double *truth = calloc(2 * num, sizeof *truth), *deviation = truth + num;
    double mean = 0, off = 0, squares = 0, noises = 0;
    assert_true(seen && truth);
    assert_ok(karst_reference_scatter(&config, &light, truth, deviation, NULL, NULL, NULL, &error));
    karst_engine *engine = create(s);
    settle(engine, seen);
    karst_engine_destroy(engine);
    for (size_t i = 0; i < num; i++) {
        const double d = (double)seen[i] - truth[i];
        mean += truth[i] / (double)num;
        off += d / (double)num;
        squares += d * d / (double)num;
        noises += deviation[i] * deviation[i] / (double)num;
    }
    *bias = off / mean;
    *rms = sqrt(fmax(squares - noises, 0)) / mean;
    print_message("# depth %g, g %g, %dx%d: mean %.4f, bias %+.2f %%, rms %.2f %%, the truth's own noise %.2f %%\n",
                  s->depth, s->g, s->width_px, s->height_px, mean, 100 * *bias, 100 * *rms, 100 * sqrt(noises) / mean);
    free(seen);
    free(truth);
}

static void light_scattered_often_is_right(void **state)
{
    (void)state;
    static const double depths[] = {10, 1, 100}, g[] = {0, 0.5};
    const bool full = is_full();
    for (int i = 0; i < (full ? 6 : 1); i++) {
        const setting s = {.width_px = full ? 32 : 20,
                           .height_px = full ? 24 : 15,
                           .detail_px = full ? 0.25 : 0.5,
                           .samples = full ? 16 : 4,
                           .packets = full ? 0 : 32768,
                           .depth = depths[i % 3],
                           .g = g[i / 3],
                           .white = 0.99};
        double bias, rms;
        compare(&s, full ? 1000 : 60, &bias, &rms);
        assert_true(fabs(bias) < 0.05 && rms < (full ? 0.1 : 0.2));
    }
}

/* ---- traces ---- */

static void lanes_leave_no_trace(void **state)
{
    (void)state;
    enum { NUM = 12 * 9 * 3 };
    setting s = {.width_px = 12, .height_px = 9, .detail_px = 1, .samples = 1, .packets = FEW_PACKETS, .depth = 5,
                 .g = 0.5, .white = 0.9, .lanes = 16};
    float sixteen[NUM], one[NUM];
    karst_engine *engine = create(&s);
    settle(engine, sixteen);
    karst_engine_destroy(engine);
    s.lanes = 1;
    engine = create(&s);
    settle(engine, one);
    karst_engine_destroy(engine);
    assert_memory_equal(sixteen, one, sizeof one);
}

/* Neither a sun that was elsewhere, a medium that was thicker, nor an eye that went away and came back. */
static void history_leaves_no_trace(void **state)
{
    (void)state;
    enum { NUM = 12 * 9 * 3 };
    const setting s = {.width_px = 12, .height_px = 9, .detail_px = 1, .samples = 1, .packets = FEW_PACKETS, .depth = 5,
                       .g = 0, .white = 0.9};
    float before[NUM], moved[NUM], after[NUM];
    const karst_sun other = {90, 20};
    karst_engine *engine = create(&s);
    settle(engine, before);
    const karst_camera home = karst_engine_camera(engine);
    karst_camera away = home;
    away.position.voxel[2] -= 400;
    for (int turn = 0; turn < 3; turn++) {
        const karst_parameter thick = {"depth", 20}, thin = {"depth", 5};
        if (turn == 0)
            assert_ok(karst_engine_set_sun(engine, &other, &error));
        else if (turn == 1)
            assert_ok(karst_engine_set_parameters(engine, &thick, 1, &error));
        else
            assert_ok(karst_engine_set_camera(engine, &away, &error));
        /* Half of the way there, as somebody watches. */
        for (int frame = 0; frame < 2; frame++)
            assert_ok(karst_engine_frame(engine, &error));
        settle(engine, moved);
        assert_memory_not_equal(before, moved, sizeof before);
        assert_ok(karst_engine_set_sun(engine, NULL, &error) && karst_engine_set_camera(engine, &home, &error) &&
                  karst_engine_set_parameters(engine, &thin, 1, &error));
        settle(engine, after);
        assert_memory_equal(before, after, sizeof before);
    }
    karst_engine_destroy(engine);
}

/* Nothing is traced for a view that stands. */
static void a_standing_view_rests(void **state)
{
    (void)state;
    const setting s = {.width_px = 8, .height_px = 6, .detail_px = 1, .samples = 1, .packets = 1u << 15, .depth = 5,
                       .white = 0.9};
    karst_engine *engine = create(&s);
    karst_stats stats;
    uint32_t frames = 0;
    for (bool rests = false; !rests; frames++) {
        assert_true(frames < 100);
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        rests = stats.settled;
        /* Not before the last packets are traced. */
        assert_true(!rests || !karst_fluence_lacks(engine->media->fluence));
    }
    /* Two frames of packets, after those that find the medium. */
    assert_true(frames >= 3);
    assert_ok(karst_engine_frame(engine, &error));
    karst_engine_stats(engine, &stats);
    assert_true(stats.settled);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(what_goes_in_comes_out_or_is_absorbed),
                                       cmocka_unit_test(light_scattered_often_is_right),
                                       cmocka_unit_test(lanes_leave_no_trace),
                                       cmocka_unit_test(history_leaves_no_trace),
                                       cmocka_unit_test(a_standing_view_rests)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
