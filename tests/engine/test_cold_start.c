/* Cold starts with a helper process (karst/helper.h): the settled picture is the same in every byte as without one, the
 * helper does its part of the compiling, what it compiled is what the engine wants, all of it if it is given the time,
 * and it may die on the way. Each run is a process of its own, as PoCL reads where its store lies once. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <ftw.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "core/engine/engine_parts.h"
#include "core/device/helper.h"
#include "karst/karst.h"

enum { WIDTH_PX = 64, HEIGHT_PX = 48 };

static const char world_text[] =
    "/*{ \"voxel\": 0.25, \"view\": 200, \"camera\": { \"position\": [\"0\", \"14\", \"-20\"], \"pitch\": -20 } }*/\n"
    "float density(vec3 p) { return 4.0 * fbm(p / 16.0, 3) - p.y; }\n"
    "vec3 colour(vec3 p, vec3 n) { return vec3(0.5 + 0.5 * noise(p), n.y, 0.2); }\n";

typedef struct {
    uint8_t pixels[WIDTH_PX * HEIGHT_PX * 4];
    uint32_t num_done; /* by the helper */
    bool was_started, has_ended, has_failed, good;
} result;

/* How a run starts: alone, with a helper, or by doing nothing but what a helper does. */
typedef enum { ALONE, HELPED, AHEAD } start;

static void draw(const char *path, start how, result *r)
{
    karst_error error = {0};
    bool settled = false;
    karst_helper *helper = how == HELPED ? karst_helper_create(&error) : NULL;
    const karst_engine_config config = {.world = path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH_PX,
                                        .height_px = HEIGHT_PX,
                                        .pool_bytes = (uint64_t)48 << 20,
                                        .helper = helper};
    if (how == AHEAD) {
        r->good = karst_engine_compile_ahead(&config, &error);
        if (!r->good)
            fprintf(stderr, "%s\n", error.message);
        return;
    }
    karst_engine *engine = karst_engine_create(&config, &error);
    r->good = engine && karst_engine_settle(engine, 0, NULL, NULL, &settled, &error) && settled &&
              karst_engine_read_pixels(engine, r->pixels, sizeof r->pixels, &error);
    if (!r->good)
        fprintf(stderr, "%s\n", error.message);
    karst_engine_destroy(engine);
    if (helper) {
        /* The engine does not wait for what it does not need. */
        for (int i = 0; i < 3000 && karst_helper_was_started(helper) && !karst_helper_has_ended(helper); i++)
            nanosleep(&(struct timespec){.tv_nsec = 10000000}, NULL);
        r->has_ended = karst_helper_has_ended(helper);
        r->has_failed = karst_helper_has_failed(helper);
        r->num_done = karst_helper_count_done(helper);
        r->was_started = karst_helper_was_started(helper);
    }
    karst_helper_destroy(helper);
}

static int num_kernels, num_bounds;

static int count_one(const char *path, const struct stat *status, int type, struct FTW *walk)
{
    (void)status;
    (void)walk;
    size_t length = strlen(path);
    /* Whoever is killed while it links leaves a file of the driver's behind that nobody uses. */
    bool is_kernel =
        type == FTW_F && length > 3 && !strcmp(path + length - 3, ".so") && !strstr(path, "/tempfile_");
    num_kernels += is_kernel;
    num_bounds += is_kernel && strstr(path, "/karst_bound_nodes.so");
    return 0;
}

/* In a process of its own; returns how many kernels lie in the store afterwards. */
static int draw_apart(const char *folder, const char *store, start how, result *r)
{
    char path[256];
    memset(r, 0, sizeof *r);
    snprintf(path, sizeof path, "%s/world.karst", folder);
    FILE *file = fopen(path, "w");
    assert_true(file && fputs(world_text, file) >= 0 && fclose(file) == 0);
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        char name[256];
        snprintf(name, sizeof name, "%s/%s", folder, store);
        setenv("POCL_CACHE_DIR", name, 1);
        setenv("KARST_CACHE_DIR", "off", 1);
        draw(path, how, r);
        _exit(0);
    }
    int status = -1;
    assert_true(child > 0 && waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
    assert_true(r->good);
    snprintf(path, sizeof path, "%s/%s", folder, store);
    num_kernels = num_bounds = 0;
    nftw(path, count_one, 16, FTW_PHYS);
    return num_kernels;
}

static int remove_one(const char *path, const struct stat *status, int type, struct FTW *walk)
{
    (void)status;
    (void)type;
    (void)walk;
    return remove(path);
}

static void test_starts(void **state)
{
    (void)state;
    char folder[] = "/tmp/karst-start-XXXXXX";
    result *r = mmap(NULL, 3 * sizeof *r, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(r != MAP_FAILED && mkdtemp(folder));
    int num_helped = draw_apart(folder, "helped", HELPED, r), num_again = draw_apart(folder, "helped", ALONE, r + 1);
    print_message("the helper compiled %u programs and kernels; %d kernels in the store\n", r[0].num_done, num_helped);
    assert_true(r[0].was_started && r[0].num_done >= 4);
    /* To the last step of its task. */
    assert_true(r[0].has_ended && !r[0].has_failed);
    assert_memory_equal(r[0].pixels, r[1].pixels, sizeof r->pixels);
    /* Nothing was missing afterwards. */
    assert_int_equal(num_again, num_helped);

    setenv("KARST_TEST_HELPER_DIES", "1100", 1);
    int num_deserted = draw_apart(folder, "deserted", HELPED, r + 2);
    print_message("a helper that died had compiled %u\n", r[2].num_done);
    assert_memory_equal(r[0].pixels, r[2].pixels, sizeof r->pixels);
    /* Nothing that the helper compiled was for nothing. */
    assert_true(r[2].was_started && r[2].has_failed && r[2].num_done < r[0].num_done);
    assert_int_equal(num_deserted, num_helped);
    nftw(folder, remove_one, 16, FTW_DEPTH | FTW_PHYS);
    munmap(r, 3 * sizeof *r);
}

/* What a helper would compile that had all the time is all that the engine launches, but for the bounds, which that one
 * begins with. */
static void test_task(void **state)
{
    (void)state;
    char folder[] = "/tmp/karst-start-XXXXXX";
    result *r = mmap(NULL, sizeof *r, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(r != MAP_FAILED && mkdtemp(folder));
    int num_ahead = draw_apart(folder, "ahead", AHEAD, r);
    assert_int_equal(num_bounds, 0);
    int num_drawn = draw_apart(folder, "ahead", ALONE, r);
    print_message("%d kernels compiled ahead, %d in the store after a picture\n", num_ahead, num_drawn);
    assert_true(num_bounds > 0 && num_ahead > num_bounds);
    assert_int_equal(num_drawn - num_ahead, num_bounds);
    nftw(folder, remove_one, 16, FTW_DEPTH | FTW_PHYS);
    munmap(r, sizeof *r);
}

int main(void)
{
    if (karst_helper_is_this_process()) {
        const char *dies_ms = getenv("KARST_TEST_HELPER_DIES");
        timer_t timer;
        struct sigevent event = {.sigev_notify = SIGEV_SIGNAL, .sigev_signo = SIGKILL};
        long ms = dies_ms ? atol(dies_ms) : 0;
        const struct itimerspec when = {.it_value = {ms / 1000, ms % 1000 * 1000000}};
        if (dies_ms && (timer_create(CLOCK_PROCESS_CPUTIME_ID, &event, &timer) != 0 ||
                        timer_settime(timer, 0, &when, NULL) != 0))
            return KARST_FAILED;
        return karst_helper_run();
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_starts), cmocka_unit_test(test_task)};
    return cmocka_run_group_tests_name("cold starts", tests, NULL, NULL);
}
