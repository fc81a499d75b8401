/* Worlds that are prepared beside frames while nothing was ever compiled: the driver then compiles for both threads at
 * the same time. PoCL 3.1 has died of kernels on two queues; each run is a process of its own with an empty store, so
 * that a death is seen. One run of one change; KARST_TEST_FULL=1 makes 30 of three (KARST_TEST_RUNS says how many). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include <pthread.h>
#include <stdatomic.h>

#include "karst/karst.h"

enum { NUM_WORLDS = 3 };
static const char *const densities[NUM_WORLDS + 1] = {
    "4.0 * noise(p / 16.0) - p.y", "6.0 * sin(p.x / 9.0) * cos(p.z / 7.0) - p.y", "2.0 * worley(p / 8.0).x - 0.3 * p.y",
    "min(9.0 - length(p), abs(fract(p.x) - 0.5) + 0.1 * fbm(p, 3))"};

static char folder[200];

static void write_world(int number)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%d.karst", folder, number);
    FILE *file = fopen(path, "w");
    if (!file)
        exit(2);
    fprintf(
        file,
        "/*{ \"voxel\": 0.25, \"view\": 200, \"camera\": { \"position\": [\"0\", \"14\", \"-20\"], \"pitch\": -20 } "
        "}*/\nfloat density(vec3 p) { return %s; }\nvec3 colour(vec3 p, vec3 n) { return vec3(0.%d, n.y, 0.2); }\n",
        densities[number], number + 1);
    fclose(file);
}

typedef struct {
    karst_engine *engine;
    char path[256];
    karst_prepared_world *world;
    karst_error error;
    atomic_bool is_done;
} preparation;

static void *prepare(void *user)
{
    preparation *p = user;
    const karst_world_config config = {.world = p->path};
    p->world = karst_engine_prepare_world(p->engine, &config, &p->error);
    atomic_store(&p->is_done, true);
    return NULL;
}

static int fail_run(const char *what, const karst_error *error)
{
    fprintf(stderr, "%s: %s\n", what, error->message);
    return 1;
}

/* The first frame and the first preparation begin together; the camera moves on, so that frames have work. */
static int run(void)
{
    char first[256];
    karst_error error = {0};
    for (int i = 0; i <= NUM_WORLDS; i++)
        write_world(i);
    snprintf(first, sizeof first, "%s/0.karst", folder);
    karst_engine *engine = karst_engine_create(&(karst_engine_config){.world = first,
                                                                      .display = KARST_DISPLAY_NONE,
                                                                      .width_px = 64,
                                                                      .height_px = 48,
                                                                      .budget_bricks = 64,
                                                                      .pool_bytes = (uint64_t)48 << 20},
                                               &error);
    if (!engine)
        return fail_run("create", &error);
    int num_changes = getenv("KARST_TEST_RUNS") || getenv("KARST_TEST_FULL") ? NUM_WORLDS : 1;
    for (int i = 1; i <= num_changes; i++) {
        preparation p = {.engine = engine};
        pthread_t thread;
        bool kept;
        snprintf(p.path, sizeof p.path, "%s/%d.karst", folder, i);
        if (pthread_create(&thread, NULL, prepare, &p))
            return 2;
        while (!atomic_load(&p.is_done)) {
            karst_camera camera = karst_engine_camera(engine);
            camera.position.voxel[2] += 2;
            camera.yaw_deg += 1;
            if (!karst_engine_set_camera(engine, &camera, &error) || !karst_engine_frame(engine, &error))
                return fail_run("frame", &error);
        }
        pthread_join(thread, NULL);
        if (!p.world || !karst_engine_change_world(engine, p.world, &kept, &error) ||
            !karst_engine_frame(engine, &error))
            return fail_run("change", p.world ? &error : &p.error);
    }
    karst_engine_destroy(engine);
    return 0;
}

static void test_cold_changes(void **state)
{
    (void)state;
    const char *runs = getenv("KARST_TEST_RUNS");
    int num_runs = runs ? atoi(runs) : getenv("KARST_TEST_FULL") ? 30 : 1, num_died = 0;
    snprintf(folder, sizeof folder, "%.100s/karst-cold-XXXXXX", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    assert_non_null(mkdtemp(folder));
    for (int i = 0; i < num_runs; i++) {
        char command[500];
        fflush(NULL);
        pid_t child = fork();
        if (child == 0) {
            char store[256];
            snprintf(store, sizeof store, "%s/store", folder);
            setenv("POCL_CACHE_DIR", store, 1);
            setenv("KARST_CACHE_DIR", "off", 1);
            _exit(run());
        }
        int status = -1;
        assert_true(child > 0 && waitpid(child, &status, 0) == child);
        if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
            print_message("run %d: %s %d\n", i, WIFSIGNALED(status) ? "signal" : "status",
                          WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
            num_died++;
        }
        snprintf(command, sizeof command, "rm -rf %s/store", folder);
        assert_int_equal(system(command), 0);
    }
    char command[500];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    assert_int_equal(system(command), 0);
    print_message("%d runs, %d died\n", num_runs, num_died);
    assert_int_equal(num_died, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_cold_changes)};
    return cmocka_run_group_tests_name("worlds changed with nothing compiled", tests, NULL, NULL);
}
