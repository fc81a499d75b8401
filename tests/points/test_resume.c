/* An import that is cut off goes on from where it was and makes the bytes of one that was not: whichever call of its
 * progress it dies at, and whichever moment; how many threads it has and how much it does in memory at once leave no
 * trace; and what was done for another input or with other options is of no use. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>

#include "core/points/import_internal.h"
#include "tests/points/clouds.h"
#include "tests/support/ok.h"

static char folder[] = "/tmp/karst-resume-XXXXXX";
static char input[64], output[64], work[80];
static char *expected;
static size_t num_expected;

/* Many ranges, of which some are spread twice, checkpoints in the middle of steps, and no page stays. */
static const points_limits small = {.most_in_memory = 4096, .most_between = 4096, .most_resident_bytes = 0};

static char *bytes_of(const char *path, size_t *num)
{
    FILE *file = fopen(path, "rb");
    char *bytes = malloc(4 << 20);
    *num = file ? fread(bytes, 1, 4 << 20, file) : 0;
    if (file)
        fclose(file);
    return bytes;
}

static void expect_the_bytes(void)
{
    size_t num;
    char *bytes = bytes_of(output, &num);
    assert_int_equal(num, num_expected);
    assert_memory_equal(bytes, expected, num);
    free(bytes);
    assert_int_not_equal(access(work, F_OK), 0);
    unlink(output);
}

/* What its progress does: dies at a call, and notes whether the input is read. */
typedef struct {
    int calls, dies_at;
    bool reads, is_wrong; /* a share that is none */
} fate;

static bool go_on(void *user, const char *what, double share)
{
    fate *f = user;
    f->is_wrong = f->is_wrong || !(share >= 0 && share <= 1);
    f->reads = f->reads || strcmp(what, "reading") == 0;
    if (++f->calls == f->dies_at)
        raise(SIGKILL);
    return true;
}

static karst_points_import_config config_of(fate *f)
{
    return (karst_points_import_config){.input = input,
                                        .output = output,
                                        .axes = KARST_POINTS_AS_THEY_ARE,
                                        .progress = go_on,
                                        .user = f,
                                        .num_threads = 2,
                                        .resumable = true};
}

/* In a process of its own that dies at a call, or after so many microseconds; false: it was done before. */
static bool import_in_threads_and_die(uint32_t num_threads, int dies_at, long after_us)
{
    pid_t child = fork();
    if (child == 0) {
        fate f = {.dies_at = dies_at};
        karst_points_import_config config = config_of(&f);
        config.num_threads = num_threads;
        _exit(!karst_points_import_within(&config, &small, NULL, NULL));
    }
    if (after_us >= 0) {
        const struct timespec wait = {after_us / 1000000, after_us % 1000000 * 1000};
        nanosleep(&wait, NULL);
        kill(child, SIGKILL);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFSIGNALED(status) || WEXITSTATUS(status) == 0);
    return WIFSIGNALED(status);
}

static bool import_and_die(int dies_at, long after_us) { return import_in_threads_and_die(2, dies_at, after_us); }

/* Goes on; returns its progress. */
static fate finish_in_threads(uint32_t num_threads)
{
    fate f = {0};
    karst_points_import_config config = config_of(&f);
    config.num_threads = num_threads;
    assert_ok(karst_points_import_within(&config, &small, NULL, &error));
    assert_false(f.is_wrong);
    return f;
}

static fate finish(void) { return finish_in_threads(2); }

static void memory_leaves_no_trace(void **state)
{
    (void)state;
    fate f = finish();
    expect_the_bytes();
    print_message("# %d calls of progress\n", f.calls);
    assert_true(f.reads && f.calls > 50);
}

/* Small limits part each step into many blocks, which threads take in turns. */
static void threads_leave_no_trace(void **state)
{
    (void)state;
    const uint32_t nums[] = {1, 2, 3, 8};
    for (size_t i = 0; i < 2 * sizeof nums / sizeof *nums; i++) {
        fate f = {0};
        karst_points_import_config config = config_of(&f);
        config.num_threads = nums[i / 2];
        assert_ok(karst_points_import_within(&config, i % 2 ? &small : &karst_points_usual_limits, NULL, &error));
        expect_the_bytes();
    }
}

/* A lattice, where many neighbours are equally far, so that it counts which of them come first. */
static void vectors_leave_no_trace(void **state)
{
    (void)state;
    char lattice[80];
    fate f = {0};
    points_limits plain = small;
    plain.has_no_vectors = true;
    snprintf(lattice, sizeof lattice, "%s/lattice.xyz", folder);
    FILE *file = fopen(lattice, "w");
    assert_non_null(file);
    for (int i = 0; i < 90; i++)
        for (int j = 0; j < 90; j++)
            fprintf(file, "%d %d %d\n", 4 * i, (3 * i + 5 * j) % 7, 4 * j);
    assert_int_equal(fclose(file), 0);
    karst_points_import_config config = config_of(&f);
    config.input = lattice;
    size_t num_plain, num;
    assert_ok(karst_points_import_within(&config, &plain, NULL, &error));
    char *bytes_plain = bytes_of(output, &num_plain);
    unlink(output);
    assert_ok(karst_points_import_within(&config, &small, NULL, &error));
    char *bytes = bytes_of(output, &num);
    assert_int_equal(num, num_plain);
    assert_memory_equal(bytes, bytes_plain, num);
    free(bytes);
    free(bytes_plain);
    unlink(output);
    unlink(lattice);
}

/* One thread asks as often each time. How often the first of two asks depends on what the other does. */
static void dying_at_any_call_leaves_no_trace(void **state)
{
    (void)state;
    const int num_calls = finish_in_threads(1).calls, step = getenv("KARST_TEST_FULL") ? 1 : num_calls / 9;
    expect_the_bytes();
    for (int dies_at = 1; dies_at < num_calls; dies_at += step) {
        const uint32_t num_threads = 1 + (uint32_t)(dies_at / step) % 2;
        const bool died = import_in_threads_and_die(num_threads, dies_at, -1);
        assert_true(died || num_threads == 2);
        /* And once more, unless it is done before. */
        if (!died || !import_and_die(1 + dies_at % 20, -1)) {
            expect_the_bytes();
            continue;
        }
        fate f = finish();
        expect_the_bytes();
        /* What was done is not done again. */
        assert_true(!f.reads || dies_at < 20);
    }
}

static void dying_at_any_moment_leaves_no_trace(void **state)
{
    (void)state;
    const int num = getenv("KARST_TEST_FULL") ? 20 : 3;
    struct timespec begin, end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    finish();
    clock_gettime(CLOCK_MONOTONIC, &end);
    expect_the_bytes();
    const double all_us = (double)(end.tv_sec - begin.tv_sec) * 1e6 + (double)(end.tv_nsec - begin.tv_nsec) / 1e3;
    random_state = 5;
    int num_died = 0;
    for (int i = 0; i < num; i++) {
        bool died = false;
        for (int k = 0; k < 2; k++)
            died = import_and_die(0, (long)(all_us * random_unit())) || died;
        num_died += died;
        finish();
        expect_the_bytes();
    }
    print_message("# died in %d of %d\n", num_died, num);
}

static void what_is_of_another_import_is_not_used(void **state)
{
    (void)state;
    size_t num_up, num;
    fate f = {0};
    karst_points_import_config up = config_of(&f);
    up.turn = KARST_POINTS_TURN_UP;
    assert_ok(karst_points_import_within(&up, &small, NULL, &error));
    char *bytes_up = bytes_of(output, &num_up);
    assert_true(num_up != num_expected || memcmp(bytes_up, expected, num_up) != 0);
    unlink(output);
    /* Other options. */
    assert_true(import_in_threads_and_die(1, 40, -1));
    assert_ok(karst_points_import_within(&up, &small, NULL, &error));
    char *bytes = bytes_of(output, &num);
    assert_int_equal(num, num_up);
    assert_memory_equal(bytes, bytes_up, num);
    free(bytes);
    free(bytes_up);
    unlink(output);
    /* A checkpoint that is damaged. */
    assert_true(import_in_threads_and_die(1, 40, -1));
    char name[128];
    snprintf(name, sizeof name, "%s/checkpoint", work);
    int fd = open(name, O_RDWR);
    assert_int_equal(pwrite(fd, "x", 1, 200), 1);
    close(fd);
    assert_true(finish().reads);
    expect_the_bytes();
    /* Another file of the same name. */
    assert_true(import_in_threads_and_die(1, 40, -1));
    const struct timespec times[2] = {{1000, 0}, {1000, 0}};
    assert_int_equal(utimensat(AT_FDCWD, input, times, 0), 0);
    assert_true(finish().reads);
    expect_the_bytes();
}

static void only_one_is_at_work(void **state)
{
    (void)state;
    fate f = {0};
    const karst_points_import_config config = config_of(&f);
    karst_error why = {0};
    char name[128];
    assert_true(import_in_threads_and_die(1, 40, -1));
    snprintf(name, sizeof name, "%s/lock", work);
    int fd = open(name, O_RDWR);
    assert_int_equal(flock(fd, LOCK_EX), 0);
    assert_false(karst_points_import_within(&config, &small, NULL, &why));
    assert_int_equal(why.status, KARST_FAILED);
    assert_non_null(strstr(why.message, "another process"));
    close(fd);
    finish();
    expect_the_bytes();
}

/* Points, some at one place, and some far from all others; the reference was not resumable. */
static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    snprintf(input, sizeof input, "%s/in.xyz", folder);
    snprintf(output, sizeof output, "%s/out.karstpoints", folder);
    snprintf(work, sizeof work, "%s.import", output);
    FILE *file = fopen(input, "w");
    random_state = 1;
    for (int i = 0; file && i < 12000; i++) {
        double p[3], normal[3];
        random_on_surface(&known_surfaces[1], p, normal);
        for (int k = 0; k < (i % 100 ? 1 : 2); k++)
            fprintf(file, "%.9g %.9g %.9g %d 40 90\n", p[0], p[1], p[2], i % 256);
        if (i % 4000 == 0)
            fprintf(file, "%d 4 3 1 1 1\n", i / 1000);
    }
    if (!file || fclose(file) != 0)
        return -1;
    const karst_points_import_config config = {
        .input = input, .output = output, .axes = KARST_POINTS_AS_THEY_ARE, .num_threads = 1};
    karst_points_about about;
    if (!karst_points_import(&config, &about, NULL) || about.num_duplicates != 120 || about.num_outliers != 3)
        return -1;
    expected = bytes_of(output, &num_expected);
    unlink(output);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    free(expected);
    unlink(input);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(memory_leaves_no_trace),
        cmocka_unit_test(threads_leave_no_trace),
        cmocka_unit_test(vectors_leave_no_trace),
        cmocka_unit_test(dying_at_any_call_leaves_no_trace),
        cmocka_unit_test(dying_at_any_moment_leaves_no_trace),
        cmocka_unit_test(what_is_of_another_import_is_not_used),
        cmocka_unit_test(only_one_is_at_work),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
