/* From a world file's text to its first bricks, those of eight nodes, with the bounds of their children: with no kernel
 * cache at all, with a warm one, and after a change of parameters, for each shipped world. As in an engine whose frames
 * have a budget, the host makes them while nothing is compiled; so the time until the kernels have made them, too,
 * stands beside: alone, and with a helper process as the karst command has it (karst/helper.h). The kernels' bricks
 * must be the host's in every byte. Each start is a
 * process of its own, as drivers read where their cache lies once; figures are medians of three. CPU times are of that
 * process: what it would take on a machine with nothing else to do, where it waits for no helper.
 *
 * Names of worlds may be given. The context stands before the clock starts: a program has one, whatever it shows. */
#include <errno.h>
#include <ftw.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "core/device/helper.h"
#include "karst/karst.h"
#include "producers/density/density_producer.h"
#include "producers/density/world_file.h"
#include "tests/support/pool.h"

#define COLD_MARK_S 2.0
#define WARM_MARK_S 0.2
#define NUM_RUNS 3

static void print_line(void *user, karst_log_level level, const char *line)
{
    (void)user;
    (void)level;
    fprintf(stderr, "    %s\n", line);
}

static double seconds(void) { return (double)karst_clock_ns() * 1e-9; }

static double cpu_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

/* The nodes in which the camera stands, of levels among which there is one with a surface; the last is that below, as
 * a plane at height 0 is the face of all nodes above it. */
enum { NUM_NODES = 8, FIRST_LEVEL = 6 };

static void choose_nodes(const karst_world_file *file, pool_node nodes[NUM_NODES])
{
    karst_camera camera;
    karst_error error = {0};
    pool_expect(karst_camera_parse(file->info.camera, file->info.voxel_log2_m, &camera, &error), "camera", &error);
    for (int i = 0; i < NUM_NODES; i++) {
        nodes[i].level = FIRST_LEVEL + i;
        for (int axis = 0; axis < 3; axis++)
            nodes[i].at[axis] = camera.position.voxel[axis] >> (nodes[i].level + KARST_BRICK_CELLS_LOG2);
    }
    nodes[NUM_NODES - 1].at[1]--;
}

/* Subdivides and loads them; says when each step was done. */
static void first_brick(karst_producer *producer, const karst_world_file *file, pool *p, double done_s[2])
{
    karst_error error = {0};
    pool_node nodes[NUM_NODES];
    choose_nodes(file, nodes);
    pool_ask(p, nodes, NUM_NODES);
    pool_expect(producer->ops->subdivide(producer, &p->cache, &p->work, &error), "subdivide", &error);
    clFinish(p->context->queue);
    done_s[0] = seconds();
    pool_expect(producer->ops->load(producer, &p->cache, &p->work, 0, NUM_NODES, &error), "load", &error);
    clFinish(p->context->queue);
    done_s[1] = seconds();
}

/* What they came to, as bytes; there must be a brick. */
static uint64_t brick_hash(pool *p)
{
    uint32_t states[NUM_NODES], num_bricks = 0;
    int16_t q[KARST_BRICK_SAMPLES];
    karst_brick_info info;
    pool_read_results(p, states);
    uint64_t hash = pool_hash(POOL_HASH_START, states, sizeof states);
    for (uint32_t i = 0; i < NUM_NODES; i++)
        if (states[i] == KARST_STATE_BRICK) {
            pool_read_brick(p, i, q, &info);
            hash = pool_hash(pool_hash(hash, q, sizeof q), &info, sizeof info);
            num_bricks++;
        }
    pool_expect(num_bricks > 0, "no brick among the first", NULL);
    return hash;
}

/* In a child process: prints times in seconds. */
static void start(const char *path, bool helped)
{
    karst_error error = {0};
    karst_log log = {.write = print_line, .max_level = getenv("KARST_VERBOSE") ? KARST_LOG_DEBUG : KARST_LOG_WARNING};
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), 0, &log, &error);
    pool_expect(context, "context", &error);
    pool p;
    pool_open(&p, context, 16, 1);

    karst_helper *helper = helped ? karst_helper_create(&error) : NULL;
    karst_helper_set_task(helper, &(karst_engine_config){.world = path, .width_px = 64, .height_px = 48});
    karst_context_set_helper(context, helper);

    const karst_world_build build = {.shape = KARST_SHAPE_AUTO, .start_on_host = true};
    double begin = seconds(), begin_cpu = cpu_seconds();
    karst_world_file *file = karst_world_file_open(path, NULL, 0, NULL, &error);
    pool_expect(file, path, &error);
    double read = seconds();
    karst_producer *producer = karst_world_file_producer_built(context, file, file->info.seed, 16, &build, &error);
    pool_expect(producer, path, &error);
    double built = seconds();
    double done[2], compiled[2], changed[2];
    first_brick(producer, file, &p, done);
    uint64_t hash = brick_hash(&p);
    double compile = seconds();
    pool_expect(karst_density_producer_compile(producer, KARST_UNTIL_COMPILED, &error), "compile", &error);
    first_brick(producer, file, &p, compiled);
    double cpu_s = cpu_seconds() - begin_cpu;
    pool_expect(hash == brick_hash(&p), "the kernels' brick is another one", NULL);

    karst_number *values = calloc(file->program->num_parameters + 1, sizeof *values);
    pool_expect(values, "out of memory", NULL);
    for (uint32_t i = 0; i < file->program->num_parameters; i++)
        values[i] = file->program->parameters[i].value;
    double change = seconds();
    pool_expect(karst_world_file_set_parameters(producer, file, values, file->info.seed + 1, &error), "set", &error);
    first_brick(producer, file, &p, changed);
    printf("%.4f %.4f %.4f %.4f %.4f %.4f %.4f %.4f\n", done[1] - begin, read - begin, built - read, done[0] - built,
           done[1] - done[0], changed[1] - change, done[1] - begin + compiled[1] - compile, cpu_s);
    free(values);
    pool_close(&p);
    karst_producer_destroy(producer);
    karst_world_file_destroy(file);
    karst_context_destroy(context);
    karst_helper_destroy(helper);
}

typedef struct {
    double all_s, read_s, build_s, bounds_s, load_s, change_s;
    double kernels_s, cpu_s; /* until the kernels have made it, too */
} start_times;

static start_times run(const char *program, const char *how, const char *path)
{
    start_times t = {0};
    char command[4096];
    snprintf(command, sizeof command, "'%s' %s '%s'", program, how, path);
    FILE *pipe = popen(command, "r");
    pool_expect(pipe &&
                    fscanf(pipe, "%lf %lf %lf %lf %lf %lf %lf %lf", &t.all_s, &t.read_s, &t.build_s, &t.bounds_s,
                           &t.load_s, &t.change_s, &t.kernels_s, &t.cpu_s) == 8 &&
                    pclose(pipe) == 0,
                command, NULL);
    return t;
}

static int remove_one(const char *path, const struct stat *status, int type, struct FTW *walk)
{
    (void)status;
    (void)type;
    (void)walk;
    return remove(path);
}

static int compare_times(const void *a, const void *b)
{
    double x = ((const start_times *)a)->all_s, y = ((const start_times *)b)->all_s;
    return (x > y) - (x < y);
}

static void bench_world(const char *program, const char *path)
{
    start_times alone[NUM_RUNS], cold[NUM_RUNS], warm[NUM_RUNS];
    for (int i = 0; i < NUM_RUNS; i++) {
        for (int helped = 0; helped < 2; helped++) {
            char folder[] = "/tmp/karst_start_XXXXXX";
            pool_expect(mkdtemp(folder), "mkdtemp", NULL);
            setenv("POCL_CACHE_DIR", folder, 1);
            setenv("KARST_CACHE_DIR", folder, 1);
            if (helped) {
                cold[i] = run(program, "--helped", path);
                warm[i] = run(program, "--helped", path);
            } else {
                alone[i] = run(program, "--start", path);
            }
            nftw(folder, remove_one, 16, FTW_DEPTH | FTW_PHYS);
        }
    }
    qsort(alone, NUM_RUNS, sizeof *alone, compare_times);
    qsort(cold, NUM_RUNS, sizeof *cold, compare_times);
    qsort(warm, NUM_RUNS, sizeof *warm, compare_times);
    const start_times *a = &alone[NUM_RUNS / 2], *c = &cold[NUM_RUNS / 2], *w = &warm[NUM_RUNS / 2];
    const char *name = strrchr(path, '/');
    printf("%-20s %7.3f %7.3f %7.3f %7.3f %7.3f %7.3f %10.4f %8.2f %6.2f %8.2f %6.2f   %s\n",
           name ? name + 1 : path, c->all_s, c->read_s, c->build_s, c->bounds_s, c->load_s, w->all_s, w->change_s,
           a->kernels_s, a->cpu_s, c->kernels_s, c->cpu_s,
           c->all_s <= COLD_MARK_S && w->all_s <= WARM_MARK_S ? "" : "over the mark");
    fflush(stdout);
}

int main(int argc, char **argv)
{
    if (karst_helper_is_this_process())
        return karst_helper_run();
    if (argc == 3 && (!strcmp(argv[1], "--start") || !strcmp(argv[1], "--helped"))) {
        start(argv[2], !strcmp(argv[1], "--helped"));
        return 0;
    }
    printf("\nfrom text to the first bricks, of eight nodes, seconds (marks: %.1f cold, %.1f warm)\n", COLD_MARK_S,
           WARM_MARK_S);
    printf("%-20s %7s %7s %7s %7s %7s %7s %10s %8s %6s %8s %6s\n", "", "cold", "= text", "build", "bounds", "load",
           "warm", "parameter", "kernels", "CPU", "helped", "CPU");
    glob_t found = {0};
    for (int i = 1; i < argc; i++)
        bench_world(argv[0], argv[i]);
    if (argc < 2 && glob("demos/worlds/*.karst", 0, NULL, &found) == 0)
        for (size_t i = 0; i < found.gl_pathc; i++)
            bench_world(argv[0], found.gl_pathv[i]);
    globfree(&found);
    return 0;
}
