/* What is valid among the hostile texts gives a picture, soon and in bounded memory: from the text to the first frame,
 * which has no hole, in a process of its own with PoCL's store as it is when another world was shown before: the
 * engine's own programs are compiled, the world's are not. Times are of the wall clock, and of the processor over all
 * threads. The first line is the floor: a plane, with nothing compiled before. A few of the heaviest; KARST_TEST_FULL=1
 * takes all. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "karst/engine.h"
#include "tests/language/hostile_build.h"

/* The aim is 2 s on an idle machine of the kind that docs/PERFORMANCE.md names, and is printed, not asked for. What is
 * asked for is a ratio within this run, which a slower or busier machine does not change: no text takes more of the
 * processor than compiling the engine's own programs does, which the plane does first (the slowest takes 0.75 of it).
 */
enum { AIM_MS = 2000, MOST_MIB = 500 };

static const char *const heavy[] = {"many arcs", "many divisions", "many warps", "colours without end"};

typedef struct {
    bool drawn;
    double open_ms, frame_ms; /* of the processor */
    double wall_ms;
    uint64_t num_incomplete;
    char why[512];
} outcome;

static double milliseconds(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static void draw(const char *path, outcome *o)
{
    karst_engine_config config = {.world = path,
                                  .display = KARST_DISPLAY_NONE,
                                  .width_px = 64,
                                  .height_px = 48,
                                  .budget_ms = 8,
                                  .no_shadows = true};
    karst_error error = {0};
    karst_stats stats;
    double start = milliseconds(CLOCK_PROCESS_CPUTIME_ID), wall_start = milliseconds(CLOCK_MONOTONIC);
    karst_engine *engine = karst_engine_create(&config, &error);
    double opened = milliseconds(CLOCK_PROCESS_CPUTIME_ID);
    o->drawn = engine && karst_engine_frame(engine, &error);
    o->open_ms = opened - start;
    o->frame_ms = milliseconds(CLOCK_PROCESS_CPUTIME_ID) - opened;
    o->wall_ms = milliseconds(CLOCK_MONOTONIC) - wall_start;
    snprintf(o->why, sizeof o->why, "%.500s", error.message);
    if (!o->drawn)
        return;
    karst_engine_stats(engine, &stats);
    o->num_incomplete = stats.num_incomplete;
}

static char folder[256];
static double plane_ms; /* of the processor, with the engine's own programs to compile */

static void run(const char *command)
{
    if (system(command) != 0)
        fail_msg("%s", command);
}

/* Draws the text in a process of its own; `store` is copied for it, or filled if `fill`. */
static void draw_apart(const char *name, const char *text, size_t length, bool fill, outcome *o)
{
    char path[300], command[900];
    snprintf(path, sizeof path, "%s/hostile.karst", folder);
    FILE *file = fopen(path, "wb");
    assert_true(file && fwrite(text, 1, length, file) == length && fclose(file) == 0);
    snprintf(command, sizeof command, "rm -rf %s/store && cp -r %s/base %s/store", folder, folder, folder);
    if (!fill)
        run(command);
    memset(o, 0, sizeof *o);
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        snprintf(command, sizeof command, "%s/%s", folder, fill ? "base" : "store");
        setenv("POCL_CACHE_DIR", command, 1);
        setenv("KARST_CACHE_DIR", "off", 1);
        draw(path, o);
        _exit(0);
    }
    struct rusage usage;
    int status = -1;
    if (child < 0 || wait4(child, &status, 0, &usage) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
        fail_msg("%s: the process died", name);
    if (!o->drawn || o->num_incomplete)
        fail_msg("%s: %s", name, o->drawn ? "a hole in the first frame" : o->why);
    double ms = o->open_ms + o->frame_ms;
    print_message("%-42s %5.0f ms; CPU %5.0f ms (opened %5.0f, first frame %5.0f), %3ld MiB\n", name, o->wall_ms, ms,
                  o->open_ms, o->frame_ms, usage.ru_maxrss / 1024);
    if (fill)
        plane_ms = ms;
    else if (!getenv("KARST_TEST_QUICK") && (ms > plane_ms || usage.ru_maxrss / 1024 > MOST_MIB))
        fail_msg("%s took %.0f ms, the engine's own programs %.0f ms; %ld MiB", name, ms, plane_ms,
                 usage.ru_maxrss / 1024);
}

static bool is_heavy(const char *name)
{
    for (size_t i = 0; i < sizeof heavy / sizeof *heavy; i++)
        if (!strcmp(name, heavy[i]))
            return true;
    return false;
}

static void test_pictures(void **state)
{
    (void)state;
    built b = {.text = malloc(HOSTILE_MAX_BYTES)};
    outcome *o = mmap(NULL, sizeof *o, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(b.text && o != MAP_FAILED);
    char command[300];
    snprintf(folder, sizeof folder, "%.200s/karst-hostile-XXXXXX", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    assert_non_null(mkdtemp(folder));
    snprintf(command, sizeof command, "mkdir %s/base", folder);
    run(command);
    draw_apart("(a plane, nothing compiled)", DENSITY, strlen(DENSITY), true, o);
    double worst_ms = 0, worst_wall_ms = 0;
    int count = 0, num_late = 0, num_late_by_wall = 0, num_heavy = 0;
    for (size_t i = 0; i < NUM_HOSTILE_TEXTS; i++) {
        const hostile_text *t = &hostile_texts[i];
        num_heavy += is_heavy(t->name);
        if (t->said || (!getenv("KARST_TEST_FULL") && !is_heavy(t->name)))
            continue;
        build(&b, t);
        draw_apart(t->name, b.text, b.length, false, o);
        worst_ms = fmax(worst_ms, o->open_ms + o->frame_ms);
        num_late += o->open_ms + o->frame_ms > AIM_MS;
        worst_wall_ms = fmax(worst_wall_ms, o->wall_ms);
        num_late_by_wall += o->wall_ms > AIM_MS;
        count++;
    }
    print_message("%d texts: at most %.0f ms to a picture, %d above %d ms; CPU at most %.0f ms, %d above\n", count,
                  worst_wall_ms, num_late_by_wall, AIM_MS, worst_ms, num_late);
    assert_int_equal(num_heavy, sizeof heavy / sizeof *heavy);
    snprintf(command, sizeof command, "rm -rf %s", folder);
    run(command);
    munmap(o, sizeof *o);
    free(b.text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_pictures)};
    return cmocka_run_group_tests_name("pictures of hostile worlds", tests, NULL, NULL);
}
