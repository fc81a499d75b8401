/* How soon caustics can be used: a viewer's frames, with a budget, until the picture of world `caustics` is near to the
 * settled one. Clocks begin where a program starts with its kernels kept, and where the camera has jumped elsewhere.
 * The same picture without photons stands beside. Medians of three. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "karst/karst.h"
#include "tests/support/pool.h"

enum { WIDTH_PX = 640, HEIGHT_PX = 480, NUM_PIXELS = WIDTH_PX * HEIGHT_PX, NUM_RUNS = 3, MAX_FRAMES = 1000 };
#define MARK_S 1.0
/* As of a viewer's view that stands (demos/view/resolution.c). */
#define NEW_VIEW_BUDGET_MS 120.0
#define BUDGET_MS 700.0
#define NEW_VIEW 0.8
/* rms of light that is off, of the brightest that photons bring, where they bring a hundredth of that. */
#define USABLE 0.05

static float without[2][3 * NUM_PIXELS], settled[2][3 * NUM_PIXELS], now[3 * NUM_PIXELS];

static double seconds(void) { return (double)karst_clock_ns() * 1e-9; }

static int compare_floats(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static bool go_on(void *user)
{
    (void)user;
    return true;
}

static karst_engine *make(uint32_t photons, double budget_ms, karst_helper *helper)
{
    karst_error error = {0};
    const karst_engine_config config = {.world = "caustics",
                                        .width_px = WIDTH_PX,
                                        .height_px = HEIGHT_PX,
                                        .display = KARST_DISPLAY_NONE,
                                        .samples = 2, /* so that it keeps light */
                                        .budget_ms = budget_ms,
                                        .helper = helper,
                                        .caustics = photons};
    karst_engine *engine = karst_engine_create(&config, &error);
    pool_expect(engine != NULL, "engine", &error);
    if (budget_ms > 0)
        karst_engine_set_patience(engine, go_on, NULL);
    return engine;
}

/* The world's own view, and one from the other side. */
static void look_from(karst_engine *engine, int view)
{
    karst_error error = {0};
    karst_camera camera = karst_engine_default_camera(engine);
    if (view)
        pool_expect(karst_camera_parse("0.6,2.9,2.2,180,-55,50", karst_engine_voxel_log2_m(engine), &camera, &error),
               "camera", &error);
    pool_expect(karst_engine_set_camera(engine, &camera, &error), "camera", &error);
}

/* What photons bring to each pixel of a view. */
static float *brought(int view)
{
    static float light[3 * NUM_PIXELS];
    for (int i = 0; i < 3 * NUM_PIXELS; i++)
        light[i] = settled[view][i] - without[view][i];
    return light;
}

/* Of all but one of ten thousand. */
static float peak_of(int view)
{
    static float sorted[3 * NUM_PIXELS];
    memcpy(sorted, brought(view), sizeof sorted);
    qsort(sorted, 3 * NUM_PIXELS, sizeof *sorted, compare_floats);
    return sorted[3 * NUM_PIXELS - 3 * NUM_PIXELS / 10000];
}

static double off(int view, float peak)
{
    const float *light = brought(view);
    double sum = 0;
    int num = 0;
    for (int i = 0; i < 3 * NUM_PIXELS; i++)
        if (light[i] > peak / 100) {
            const double d = (double)now[i] - (double)settled[view][i];
            sum += d * d;
            num++;
        }
    return sqrt(sum / (num ? num : 1)) / (double)peak;
}

/* Draws frames until they are near to the settled ones of the view; seconds since begin_s. */
static double until_usable(karst_engine *engine, int view, double begin_s)
{
    karst_error error = {0};
    const float peak = peak_of(view);
    double paused_s = 0;
    karst_stats stats = {.num_provisional = 1};
    for (int i = 0; i < MAX_FRAMES; i++) {
        const bool is_new = (double)stats.num_provisional > NEW_VIEW * (double)stats.num_hits;
        pool_expect(karst_engine_set_budget_ms(engine, is_new ? NEW_VIEW_BUDGET_MS : BUDGET_MS, &error) &&
                        karst_engine_frame(engine, &error),
                    "frame", &error);
        karst_engine_stats(engine, &stats);
        const double end_s = seconds();
        pool_expect(karst_engine_read_radiance(engine, now, 3 * NUM_PIXELS, &error), "light", &error);
        const double is_off = off(view, peak), took_s = end_s - begin_s - paused_s;
        if (getenv("KARST_VERBOSE"))
            fprintf(stderr, "    %.3f s: %.4f off, %llu photons\n", took_s, is_off,
                    (unsigned long long)stats.caustics.num_photons);
        if (is_off <= USABLE)
            return took_s;
        paused_s += seconds() - end_s;
    }
    return INFINITY;
}

static void settle(uint32_t photons, float light[2][3 * NUM_PIXELS])
{
    karst_error error = {0};
    karst_engine *engine = make(photons, 0, NULL);
    for (int view = 0; view < 2; view++) {
        bool done = false;
        look_from(engine, view);
        pool_expect(karst_engine_settle(engine, MAX_FRAMES, NULL, NULL, &done, &error) && done, "settle", &error);
        pool_expect(karst_engine_read_radiance(engine, light[view], 3 * NUM_PIXELS, &error), "light", &error);
    }
    karst_engine_destroy(engine);
}

static void bench(uint32_t photons)
{
    karst_error error = {0};
    double took_s[2][NUM_RUNS];
    settle(photons, settled);
    for (int run = 0; run < NUM_RUNS; run++) {
        const double begin_s = seconds();
        karst_helper *helper = karst_helper_create(&error);
        karst_engine *engine = make(photons, BUDGET_MS, helper);
        took_s[0][run] = until_usable(engine, 0, begin_s);
        look_from(engine, 1);
        took_s[1][run] = until_usable(engine, 1, seconds());
        karst_engine_destroy(engine);
        karst_helper_destroy(helper);
    }
    for (int view = 0; view < 2; view++)
        qsort(took_s[view], NUM_RUNS, sizeof **took_s, compare_doubles);
    const double start_s = took_s[0][NUM_RUNS / 2], jump_s = took_s[1][NUM_RUNS / 2];
    printf("    %8u photons: %6.3f s from the start, %6.3f s after a jump   mark: %.0f s%s\n", photons, start_s, jump_s,
           MARK_S, start_s <= MARK_S && jump_s <= MARK_S ? "" : "  NOT MET");
}

int main(void)
{
    if (karst_helper_is_this_process())
        return karst_helper_run();
    printf("Caustics of `caustics`, %d x %d: until they are off the settled ones by %.0f %% of their peak, rms\n",
           WIDTH_PX, HEIGHT_PX, 100 * USABLE);
    settle(0, without);
    bench(20000);
    bench(100000);
    bench(1000000);
    return 0;
}
