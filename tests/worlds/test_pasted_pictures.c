/* Pasted worlds as pictures: each of tests/language/pasted, which have no header, is drawn as it comes, from where
 * Karst chooses to stand. All settle, and in the default pool they get the detail that they ask for, or half of it.
 * Every second of them at 128x72; KARST_TEST_FULL=1 draws all, at 800x600. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "karst/engine.h"

#define FOLDER "tests/language/pasted"
enum { NUM_PASTED = 20, MAX_FRAMES = 400 };

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

/* How many pixels of a row differ from the one to the left by more than a gradient does: as many, whatever the size, if
 * there is one shape. */
static double edges_of(karst_engine *engine, int width_px, int height_px)
{
    karst_error error = {0};
    size_t size_bytes = (size_t)width_px * (size_t)height_px * 4, num_edges = 0;
    uint8_t *rgba = malloc(size_bytes);
    assert_non_null(rgba);
    if (!karst_engine_read_pixels(engine, rgba, size_bytes, &error))
        fail_msg("%s", error.message);
    for (size_t i = 4; i < size_bytes; i += 4)
        num_edges += i / 4 % (size_t)width_px && abs(rgba[i + 1] - rgba[i - 3]) > 4;
    free(rgba);
    return (double)num_edges / height_px;
}

static void draw(const char *name)
{
    char path[256];
    snprintf(path, sizeof path, FOLDER "/%s", name);
    bool full = getenv("KARST_TEST_FULL"), settled = false;
    karst_engine_config config = {.world = path,
                                  .display = KARST_DISPLAY_NONE,
                                  .width_px = full ? 800 : 128,
                                  .height_px = full ? 600 : 72,
                                  .no_shadows = true};
    karst_error error = {0};
    karst_stats stats;
    double start = seconds();
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine || !karst_engine_settle(engine, MAX_FRAMES, NULL, NULL, &settled, &error))
        fail_msg("%s: %s", name, error.message);
    karst_engine_stats(engine, &stats);
    double share = (double)stats.num_hits / (double)stats.num_pixels;
    double edges = edges_of(engine, config.width_px, config.height_px);
    print_message(
        "%-28s asked %.2f px, given %.2f px; %3u frames, %5.1f s, %6llu bricks; hits %3.0f %%, edges %5.1f a row\n",
        name, stats.detail_asked_px, stats.detail_given_px, stats.frame, seconds() - start,
        (unsigned long long)stats.num_resident_bricks, 100 * share, edges);
    if (!settled || stats.num_incomplete)
        fail_msg("%s does not settle", name);
    if (stats.detail_given_px > 2 * stats.detail_asked_px)
        fail_msg("%s: given %g px for %g", name, stats.detail_given_px, stats.detail_asked_px);
    if (share < 0.1 || edges < 0.6)
        fail_msg("%s: there is nothing to be seen", name);
    karst_engine_destroy(engine);
}

static void test_pictures(void **s)
{
    (void)s;
    struct dirent **entries;
    int count = scandir(FOLDER, &entries, NULL, alphasort), num_found = 0;
    assert_true(count > 0);
    for (int i = 0; i < count; i++) {
        const char *name = entries[i]->d_name, *only = getenv("KARST_TEST_ONLY");
        if (strstr(name, ".karst") && (!only || strstr(name, only))) {
            if (only || num_found % 2 == 0 || getenv("KARST_TEST_FULL"))
                draw(name);
            num_found++;
        }
        free(entries[i]);
    }
    free(entries);
    assert_true(getenv("KARST_TEST_ONLY") || num_found == NUM_PASTED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_pictures)};
    return cmocka_run_group_tests_name("pictures of pasted worlds", tests, NULL, NULL);
}
