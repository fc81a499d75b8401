/* Many processes that start at once with one cold cache, Karst's and the driver's: each builds a program and runs it,
 * all are right, and the cache is whole afterwards. Here four; with KARST_TEST_FULL=1 64. tests/cli/cold.sh does the
 * same with the command and all the kernels of a world, which takes minutes. */
#include <dirent.h>
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

#include "core/device/program_cache.h"

enum { MOST_PROCESSES = 64, BUILT = 10, LOADED = 11 };

static char folder[] = "/tmp/karst-cold-XXXXXX";

/* ---- one of them ---- */

static bool was_loaded;

static void note(void *user, karst_log_level level, const char *line)
{
    (void)user;
    (void)level;
    was_loaded = was_loaded || strstr(line, "loaded small.cl");
}

/* Exit code: BUILT or LOADED if all is well. */
static int build_and_run(void)
{
    static const karst_log log = {.write = note, .max_level = KARST_LOG_DEBUG};
    const karst_virtual_file file = {
        "small.cl", "__kernel void store(__global int *out) { out[get_global_id(0)] = 7 * get_global_id(0); }\n"};
    karst_error error = {0};
    int stored[64] = {0};
    karst_context *context = karst_context_create(NULL, 1, &log, &error);
    char start;
    while (read(STDIN_FILENO, &start, 1) > 0) /* until all are there */
        ;
    karst_program *program = context ? karst_program_build(context, "small.cl", "", &file, 1, &error) : NULL;
    cl_kernel kernel = program ? karst_program_kernel(program, "store", &error) : NULL;
    karst_buffer *out = kernel ? karst_buffer_create(context, "out", sizeof stored, NULL, &error) : NULL;
    bool right = out && KARST_ARGUMENTS(kernel, &error, KARST_BUFFER_ARG(out)) &&
                 karst_launch(context, kernel, KARST_STAGE_CAST, 64, 16, &error) &&
                 karst_buffer_read(out, 0, stored, sizeof stored, &error);
    for (int i = 0; i < 64; i++)
        right = right && stored[i] == 7 * i;
    if (!right)
        fprintf(stderr, "%s\n", error.message);
    if (context)
        karst_program_cache_finish(context);
    karst_buffer_destroy(out);
    if (kernel)
        clReleaseKernel(kernel);
    karst_program_destroy(program);
    karst_context_destroy(context);
    return !right ? EXIT_FAILURE : was_loaded ? LOADED : BUILT;
}

/* ---- all of them ---- */

static pid_t start_one(const int from[2])
{
    const pid_t pid = fork();
    if (pid == 0) {
        dup2(from[0], STDIN_FILENO);
        close(from[0]);
        close(from[1]);
        execl("/proc/self/exe", "test_cold_processes", "one", (char *)NULL);
        _exit(EXIT_FAILURE);
    }
    return pid;
}

/* How many of `num` that start at once end with this code. */
static int run(int num, int code)
{
    pid_t pids[MOST_PROCESSES];
    int from[2], num_so = 0, status;
    assert_int_equal(pipe(from), 0);
    for (int i = 0; i < num; i++)
        pids[i] = start_one(from);
    close(from[0]);
    usleep(300000); /* a good part of them waits by then; nothing depends on it */
    close(from[1]);
    for (int i = 0; i < num; i++) {
        assert_int_equal(waitpid(pids[i], &status, 0), pids[i]);
        if (!WIFEXITED(status) || (WEXITSTATUS(status) != BUILT && WEXITSTATUS(status) != LOADED))
            fail_msg("process %d of %d: status 0x%x", i + 1, num, status);
        num_so += WEXITSTATUS(status) == code;
    }
    return num_so;
}

static void test_many_at_once(void **state)
{
    (void)state;
    char programs[80], pocl[80], command[96];
    const int num = getenv("KARST_TEST_FULL") ? MOST_PROCESSES : 4;
    assert_non_null(mkdtemp(folder));
    snprintf(programs, sizeof programs, "%s/programs", folder);
    snprintf(pocl, sizeof pocl, "%s/pocl", folder);
    setenv("KARST_CACHE_DIR", folder, 1);
    setenv("POCL_CACHE_DIR", pocl, 1);
    const int num_built = run(num, BUILT);
    print_message("# %d of %d built it, the others found it\n", num_built, num);
    assert_true(num_built >= 1);
    int num_entries = 0;
    DIR *list = opendir(programs);
    assert_non_null(list);
    for (const struct dirent *entry; (entry = readdir(list)) != NULL;) {
        if (!strcmp(entry->d_name, ".") || !strcmp(entry->d_name, "..") || !strncmp(entry->d_name, ".turn-", 6))
            continue;
        if (!strstr(entry->d_name, ".program") || entry->d_name[0] == '.')
            fail_msg("%s is left", entry->d_name);
        num_entries++;
    }
    closedir(list);
    assert_int_equal(num_entries, 1);
    assert_int_equal(run(1, LOADED), 1);
    snprintf(command, sizeof command, "rm -rf %s", folder);
    assert_int_equal(system(command), 0);
}

int main(int argc, char **argv)
{
    (void)argv;
    if (argc > 1)
        return build_and_run();
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_many_at_once)};
    return cmocka_run_group_tests_name("cold processes", tests, NULL, NULL);
}
