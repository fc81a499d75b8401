/* The pace against a model of a view: voxels f times as wide need a factor f^2 fewer bricks, a flight makes a share of
 * them stale in each frame, and a budget makes so many. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "core/engine/pace.h"

#define NUM_HITS 480000

typedef struct {
    double need;    /* bricks of the view at factor 1 */
    double a_frame; /* bricks that a frame makes */
    double stale;   /* share of the view that each frame makes anew, at factor 1: what is near passes by sooner */
    double finest;  /* factor down to which the view is there, on average */
    bool steady;    /* flies as it did before */
} model;

/* Shares of the picture go by octaves: what is there down to `finest` is at the level asked for of factor f but for
 * log2(finest / f) of it. */
static double share_there(const model *m, double factor) { return 1 - fmin(1, fmax(0, log2(m->finest / factor))); }

static double held(const model *m) { return m->need / (m->finest * m->finest); }

static double frame(model *m, karst_pace *pace, bool moved)
{
    double have = held(m) * (1 - m->stale), want = m->need / (pace->factor * pace->factor);
    double missing = fmax(0, want - have), made = fmin(missing, m->a_frame);
    m->finest = sqrt(m->need / (have + made));
    double share = share_there(m, pace->factor);
    karst_pace_frame outcome = {.num_hits = NUM_HITS,
                                .num_provisional = (uint64_t)((1 - share) * NUM_HITS),
                                .num_deferred = (uint64_t)ceil(missing - made),
                                .moved = moved,
                                .steady = m->steady};
    karst_pace_step(pace, &outcome);
    return share;
}

/* What is wanted is up to three times what a budget makes: most is there, in every frame, at up to twice as wide voxels
 * and no more than needed. */
static void test_holds_a_flight_at_its_level(void **state)
{
    (void)state;
    for (double demand = 0.5; demand < 3.1; demand += 0.25) {
        model m = {.need = 10000, .a_frame = 70, .stale = 70 * demand / 10000, .finest = 1, .steady = true};
        karst_pace pace;
        karst_pace_init(&pace);
        double sum = 0, least = 1, most = 1;
        for (int i = 0; i < 900; i++) {
            double share = frame(&m, &pace, true);
            sum += share;
            least = fmin(least, share);
            most = fmax(most, pace.factor);
            assert_true(pace.factor >= 1 && pace.factor <= KARST_PACE_MOST);
        }
        print_message("demand %g: %.3f on average, %.3f at least\n", demand, sum / 900, least);
        assert_true(sum / 900 > 0.89 && least > 0.75);
        if (demand < 1)
            assert_true(most == 1);
        else
            assert_true(most <= 1.2 * sqrt(demand) && pace.factor >= 0.9 * sqrt(demand));
    }
}

/* However much is wanted: it is not asked for coarser than twice, in flight or where nearly all is new. */
static void test_is_bounded_in_flight(void **state)
{
    (void)state;
    karst_pace pace;
    karst_pace_init(&pace);
    for (int i = 0; i < 1000; i++) {
        karst_pace_frame outcome = {
            .num_hits = NUM_HITS, .num_provisional = NUM_HITS * 4 / 10, .num_deferred = 1000, .moved = true};
        outcome.steady = true;
        if (i >= 500)
            outcome.num_provisional = NUM_HITS * 9 / 10;
        karst_pace_step(&pace, &outcome);
        assert_true(pace.factor <= KARST_PACE_MOST);
    }
    assert_true(pace.factor == KARST_PACE_MOST && pace.new_view);
}

/* A valley opens behind a crest: the view is coarser at once, and sharpens from there. */
static void test_a_sudden_valley(void **state)
{
    (void)state;
    model m = {.need = 10000, .a_frame = 100, .stale = 0.006, .finest = 1, .steady = true};
    karst_pace pace;
    karst_pace_init(&pace);
    int num_short = 0;
    for (int i = 0; i < 300; i++) {
        if (i == 100)
            m.finest *= 1.7;
        double before = pace.factor, share = frame(&m, &pace, true);
        num_short += share < 0.75;
        if (i > 102)
            assert_true(log2(pace.factor / before) < 0.1 && log2(pace.factor / before) > -0.13);
    }
    assert_true(num_short >= 1 && num_short <= 3);
    assert_true(pace.factor == 1);
}

/* A new view is there coarse within few frames, and sharpens from then on, never short of nine tenths, to all of it:
 * standing, or turning slowly. */
static void test_a_jump_goes_from_coarse_to_fine(void **state)
{
    (void)state;
    for (int moving = 0; moving < 2; moving++) {
        model m = {.need = 5000, .a_frame = 120, .finest = 1000};
        karst_pace pace;
        karst_pace_init(&pace);
        int whole_at = 0, full_at = 0;
        double before = KARST_PACE_MOST;
        for (int i = 1; i <= 600 && !full_at; i++) {
            double share = frame(&m, &pace, moving || i == 1);
            if (!whole_at && share >= 0.9)
                whole_at = i;
            /* In the end one who stands wants all of the rest at once. */
            bool at_the_end = !moving && before <= KARST_PACE_MOST;
            assert_true(!whole_at || at_the_end || share >= (moving ? 0.85 : 0.7));
            assert_true(!whole_at || pace.factor <= before * 1.03);
            before = pace.factor;
            if (karst_pace_at_rest(&pace) && share > 0.999)
                full_at = i;
        }
        assert_true(whole_at > 0 && whole_at <= 15);
        /* What all of it takes, and little more. */
        assert_true(full_at > 0 && full_at < 1.3 * 5000 / 120);
    }
}

/* A jump is noticed before anything is made for it, and held although at first nothing is put off; not so a view of
 * which most is there, one that goes on steadily, or one that stands. */
static void test_a_jump_is_noticed_at_once(void **state)
{
    (void)state;
    static const struct {
        double share;
        bool moved, steady, is_new;
    } views[] = {{0, true, false, true},      {0.4, true, false, true}, {0.6, true, false, false},
                 {0.1, true, true, true},     {0.4, true, true, false}, {0, false, false, false}};
    for (size_t i = 0; i < sizeof views / sizeof *views; i++) {
        karst_pace pace;
        karst_pace_init(&pace);
        const karst_pace_frame frame = {.num_hits = NUM_HITS,
                                        .num_provisional = (uint64_t)((1 - views[i].share) * NUM_HITS),
                                        .moved = views[i].moved,
                                        .steady = views[i].steady};
        karst_pace_look(&pace, &frame);
        assert_int_equal(pace.new_view, views[i].is_new);
        assert_true(pace.factor == (views[i].is_new ? KARST_PACE_MOST : 1));
        for (int n = 0; n < 5 && views[i].is_new; n++) {
            karst_pace_step(&pace, &frame);
            assert_true(pace.factor == KARST_PACE_MOST);
        }
    }
    /* But not for ever: what the pools do not hold is the ladder's. */
    karst_pace pace;
    karst_pace_init(&pace);
    const karst_pace_frame frame = {.num_hits = NUM_HITS, .num_provisional = NUM_HITS, .moved = true};
    karst_pace_look(&pace, &frame);
    for (int n = 0; n < 15; n++)
        karst_pace_step(&pace, &(karst_pace_frame){.num_hits = NUM_HITS, .num_provisional = NUM_HITS});
    assert_true(karst_pace_at_rest(&pace));
}

/* In motion, what was new and is there sharpens faster than what flies by, waits for what was asked for and is not seen
 * yet instead of going back, and after some frames of that counts as any other view. */
static void test_what_was_new_sharpens(void **state)
{
    (void)state;
    karst_pace pace;
    karst_pace_init(&pace);
    karst_pace_frame frame = {.num_hits = NUM_HITS, .num_provisional = NUM_HITS, .num_deferred = 100, .moved = true};
    karst_pace_look(&pace, &frame);
    frame.num_provisional = NUM_HITS / 50;
    karst_pace_step(&pace, &frame);
    assert_true(!pace.new_view && pace.sharpens);
    assert_true(pace.factor < KARST_PACE_MOST * exp2(-0.12));
    double held = pace.factor;
    frame.num_provisional = NUM_HITS / 4;
    frame.steady = true;
    int num_held = 0;
    for (; num_held < 30; num_held++) {
        karst_pace_step(&pace, &frame);
        if (pace.factor != held)
            break;
    }
    assert_true(num_held >= 4 && num_held < 15);
    assert_true(pace.factor > held && !pace.sharpens);
}

/* A flight that ends asks for all at once; a turn of the head to what is there, too. */
static void test_a_stop_asks_for_all(void **state)
{
    (void)state;
    karst_pace pace = {.factor = 1.9};
    const karst_pace_frame outcome = {.num_hits = NUM_HITS, .num_provisional = NUM_HITS / 4 * 3, .num_deferred = 500};
    karst_pace_step(&pace, &outcome);
    assert_true(karst_pace_at_rest(&pace));
}

/* What the pools cannot hold is the ladder's: nothing is deferred for want of time, and the pace asks for all. */
static void test_comes_to_rest_without_help(void **state)
{
    (void)state;
    karst_pace pace = {.factor = 8, .new_view = true};
    int frames = 0;
    for (; !karst_pace_at_rest(&pace) && frames < 100; frames++) {
        karst_pace_frame outcome = {.num_hits = NUM_HITS, .num_provisional = NUM_HITS / 4};
        karst_pace_step(&pace, &outcome);
    }
    assert_true(frames < 15);
    /* The sky alone. */
    pace.factor = 2;
    for (frames = 0; !karst_pace_at_rest(&pace) && frames < 100; frames++)
        karst_pace_step(&pace, &(karst_pace_frame){.num_hits = 0});
    assert_true(frames < 15);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_holds_a_flight_at_its_level),
        cmocka_unit_test(test_is_bounded_in_flight),
        cmocka_unit_test(test_a_sudden_valley),
        cmocka_unit_test(test_a_jump_goes_from_coarse_to_fine),
        cmocka_unit_test(test_a_jump_is_noticed_at_once),
        cmocka_unit_test(test_what_was_new_sharpens),
        cmocka_unit_test(test_a_stop_asks_for_all),
        cmocka_unit_test(test_comes_to_rest_without_help),
    };
    return cmocka_run_group_tests_name("pace", tests, NULL, NULL);
}
