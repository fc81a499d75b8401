/* Producing bricks: how fast, beside what the machine can do in the same run, and how few are made in vain, beside
 * naive intervals.
 *
 * Machines are shared and noisy: what counts are the ratios. What is compared takes turns; figures are medians. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "core/engine/engine_measure_shared.h"
#include "core/device/profile.h"
#include "producers/density/density_producer.h"
#include "producers/density/world_file.h"
#include "tests/support/pool.h"

#define CAPACITY 4096
#define NUM_ROUNDS 9
#define NUM_SPEED_BRICKS 512
#define NUM_SCALAR_BRICKS 16
#define NUM_NOISE_BRICKS 256
#define FMA_ITEMS 64
#define NUM_OCTAVES 8
#define TOP_LEVEL 5 /* of the tile from which bounds are followed down: 1024 voxels across */
#define NUM_STATES 8

/* The plainest land of eight octaves, 1024 to 8 voxels long, and the same moved about by three noises. */
static const char plain_text[] = "/*{ \"name\": \"plain fBm\", \"voxel\": 1 }*/\n"
                                 "float density(vec3 p) { return 200.0 * fbm(p / 1024.0, 8) - p.y; }\n";
static const char warped_text[] =
    "/*{ \"name\": \"warped fBm\", \"voxel\": 1 }*/\n"
    "float density(vec3 p) {\n"
    "    vec3 q = p + 80.0 * vec3(noise(p / 700.0, 1), noise(p / 700.0, 2), noise(p / 700.0, 3));\n"
    "    return 200.0 * fbm(q / 1024.0, 8) - p.y;\n"
    "}\n";

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, int n)
{
    qsort(values, (size_t)n, sizeof *values, compare_doubles);
    return values[n / 2];
}

/* Core-microseconds of each stage since the last call. */
static void take_us(karst_context *context, double us[KARST_NUM_STAGES])
{
    karst_error error = {0};
    uint64_t ns[KARST_NUM_STAGES] = {0};
    pool_expect(karst_profile_collect(context, ns, &error), "profile", &error);
    for (int stage = 0; stage < KARST_NUM_STAGES; stage++)
        us[stage] = (double)ns[stage] * 1e-3 * context->compute_units;
}

/* ---- lists of nodes ---- */

typedef struct {
    pool_node *nodes;
    uint32_t count;
} node_list;

static void add(node_list *list, pool_node node)
{
    if ((list->count & (list->count - 1)) == 0) {
        list->nodes = realloc(list->nodes, (list->count ? 2 * list->count : 1) * sizeof *list->nodes);
        pool_expect(list->nodes, "out of memory", NULL);
    }
    list->nodes[list->count++] = node;
}

/* Loads all nodes; adds those with a surface to `bricks` (may be NULL), and counts results. */
static void load(karst_producer *producer, pool *p, const node_list *list, node_list *bricks,
                 uint32_t num_states[NUM_STATES])
{
    static uint32_t states[CAPACITY];
    karst_error error = {0};
    for (uint32_t first = 0; first < list->count; first += CAPACITY) {
        uint32_t count = list->count - first < CAPACITY ? list->count - first : CAPACITY;
        pool_ask(p, list->nodes + first, count);
        p->work.num_subdivides = 0;
        pool_expect(karst_producer_answer(producer, &p->cache, &p->work, &error), "load", &error);
        pool_read_results(p, states);
        for (uint32_t i = 0; i < count; i++) {
            num_states[states[i]]++;
            if (bricks && states[i] == KARST_STATE_BRICK)
                add(bricks, list->nodes[first + i]);
        }
    }
}

/* Bounds the children of all nodes; those left open go to `open`. */
static void subdivide(karst_producer *producer, pool *p, const node_list *list, node_list *open)
{
    static karst_node nodes[CAPACITY * KARST_TILE_NODES];
    static karst_tile_info infos[CAPACITY];
    karst_error error = {0};
    for (uint32_t first = 0; first < list->count; first += CAPACITY) {
        uint32_t count = list->count - first < CAPACITY ? list->count - first : CAPACITY;
        pool_ask(p, list->nodes + first, count);
        p->work.num_loads = 0;
        pool_expect(karst_producer_answer(producer, &p->cache, &p->work, &error), "subdivide", &error);
        pool_read_tiles(p, nodes, infos);
        for (uint32_t i = 0; i < count * KARST_TILE_NODES; i++)
            if (KARST_NODE_STATE(nodes[i].link) == KARST_STATE_LOST)
                add(open, pool_child(list->nodes[first + i / KARST_TILE_NODES], (int)(i % KARST_TILE_NODES)));
    }
}

/* ---- how few ---- */

typedef struct {
    node_list open, bricks; /* leaf nodes that bounds leave, and those of them with a surface */
    uint32_t num_bounded;   /* nodes on all levels */
    uint32_t num_told;      /* leaf nodes that samples prove constant */
    double bounds_us, load_us;
} descent;

static void descend(karst_producer *producer, pool *p, descent *d)
{
    node_list list = {0};
    double us[KARST_NUM_STAGES];
    uint32_t states[NUM_STATES] = {0};
    *d = (descent){.num_bounded = 0};
    for (int i = 0; i < KARST_TILE_NODES; i++)
        add(&list, (pool_node){{(i & 1) - 1, (i >> 1 & 1) - 1, (i >> 2) - 1}, TOP_LEVEL});
    node_list warm = {0};
    subdivide(producer, p, &list, &warm); /* the first launch compiles */
    load(producer, p, &list, NULL, states);
    memset(states, 0, sizeof states);
    free(warm.nodes);
    take_us(p->context, us);
    for (int level = TOP_LEVEL; level > 0; level--) {
        node_list open = {0};
        d->num_bounded += list.count * KARST_TILE_NODES;
        subdivide(producer, p, &list, &open);
        free(list.nodes);
        list = open;
    }
    take_us(p->context, us);
    d->bounds_us = us[KARST_STAGE_SUBDIVIDE];
    d->open = list;
    load(producer, p, &list, &d->bricks, states);
    take_us(p->context, us);
    d->load_us = us[KARST_STAGE_EVALUATE] + us[KARST_STAGE_FINALISE];
    d->num_told = states[KARST_STATE_AIR] + states[KARST_STATE_SOLID];
}

static void descent_finish(descent *d)
{
    free(d->open.nodes);
    free(d->bricks.nodes);
}

static karst_world_file *compile(const char *text)
{
    karst_error error = {0};
    karst_world_file *file = strstr(text, "density")
                                 ? karst_world_file_compile("bench", text, strlen(text), NULL, 0, NULL, &error)
                                 : karst_world_file_open(text, NULL, 0, NULL, &error);
    pool_expect(file, text, &error);
    return file;
}

static karst_producer *produce(karst_context *context, const karst_world_file *file, const karst_world_build *build)
{
    karst_error error = {0};
    karst_producer *producer = karst_world_file_producer_built(context, file, file->info.seed, CAPACITY, build, &error);
    pool_expect(producer, "producer", &error);
    return producer;
}

static void print_descent(const char *name, const char *kind, const descent *d, double num_leaves, uint32_t num_surface)
{
    double num_constant = num_leaves - num_surface;
    printf("%-22s %-8s %9u %9.2f %9.1f %9.1f %10.2f %10.0f %10.0f\n", name, kind, d->open.count,
           (double)d->open.count / num_surface, 100 * (num_leaves - d->open.count) / num_constant,
           100 * (num_leaves - d->open.count + d->num_told) / num_constant, d->bounds_us / d->num_bounded,
           d->bounds_us * 1e-3, d->load_us * 1e-3);
}

static void bench_tightness(karst_context *context, pool *p, const char *text, const char *marks)
{
    const double num_leaves = (double)KARST_TILE_NODES * (1ul << 3 * TOP_LEVEL);
    const karst_world_build naive_build = {.options = "-DBOUNDS_NAIVE -DWORLD_REFINE_DEPTH=0"};
    karst_world_file *file = compile(text);
    karst_producer *producer = produce(context, file, NULL), *naive_producer = produce(context, file, &naive_build);
    descent d, naive;
    descend(producer, p, &d);
    descend(naive_producer, p, &naive);
    pool_expect(d.bricks.count == naive.bricks.count, "bounds differ in what has a surface", NULL);
    print_descent(file->info.name, "", &d, num_leaves, d.bricks.count);
    print_descent("", "naive", &naive, num_leaves, d.bricks.count);
    printf("%-22s %-8s %u with surface; saved %.0f ms for %.0f ms of bounds   %s\n", "", "", d.bricks.count,
           (naive.load_us - d.load_us) * 1e-3, (d.bounds_us - naive.bounds_us) * 1e-3, marks);
    fflush(stdout);
    descent_finish(&d);
    descent_finish(&naive);
    karst_producer_destroy(producer);
    karst_producer_destroy(naive_producer);
    karst_world_file_destroy(file);
}

/* ---- how fast ---- */

typedef struct {
    karst_context *context;
    karst_program *program;
    cl_kernel fma, noise;
    karst_buffer *out;
} ceilings;

static void ceilings_open(ceilings *c, karst_context *context)
{
    karst_error error = {0};
    size_t samples = (size_t)NUM_NOISE_BRICKS * KARST_BRICK_SIDE * KARST_BRICK_SIDE * 16;
    int num_bricks = NUM_NOISE_BRICKS;
    float b = 0.999f;
    c->context = context;
    c->program = karst_program_build(context, "core/engine/engine_measure.cl", "", NULL, 0, &error);
    pool_expect(c->program && (c->fma = karst_program_kernel(c->program, "measure_fma", &error)) &&
                    (c->noise = karst_program_kernel(c->program, "measure_noise", &error)) &&
                    (c->out = karst_buffer_create(context, "noise", samples * sizeof(float), NULL, &error)) &&
                    KARST_ARGUMENTS(c->fma, &error, KARST_BUFFER_ARG(c->out), KARST_VALUE_ARG(b)) &&
                    KARST_ARGUMENTS(c->noise, &error, KARST_BUFFER_ARG(c->out), KARST_VALUE_ARG(num_bricks)),
                "ceilings", &error);
}

static void ceilings_close(ceilings *c)
{
    clReleaseKernel(c->fma);
    clReleaseKernel(c->noise);
    karst_program_destroy(c->program);
    karst_buffer_destroy(c->out);
}

/* Multiply-adds and samples of noise, each for a core-microsecond. */
static void measure_ceilings(ceilings *c, double *fma_rate, double *noise_rate)
{
    karst_error error = {0};
    double us[KARST_NUM_STAGES];
    take_us(c->context, us);
    pool_expect(karst_launch(c->context, c->fma, KARST_STAGE_EVALUATE, FMA_ITEMS, 1, &error), "fma", &error);
    take_us(c->context, us);
    *fma_rate = (double)FMA_ITEMS * KARST_MEASURE_FMA_CHAINS * KARST_MEASURE_FMA_STEPS * c->context->lanes /
                us[KARST_STAGE_EVALUATE];
    pool_expect(karst_launch(c->context, c->noise, KARST_STAGE_EVALUATE, NUM_NOISE_BRICKS, 1, &error), "noise", &error);
    take_us(c->context, us);
    *noise_rate = (double)NUM_NOISE_BRICKS * KARST_BRICK_SIDE * KARST_BRICK_SIDE * 16 / us[KARST_STAGE_EVALUATE];
}

/* Bricks with a surface at level 0, spread over those that there are. */
static node_list some_bricks(karst_producer *producer, pool *p, uint32_t most)
{
    descent d;
    node_list some = {0};
    descend(producer, p, &d);
    for (uint32_t i = 0; i < most && i < d.bricks.count; i++)
        add(&some, d.bricks.nodes[(uint64_t)i * d.bricks.count / (most < d.bricks.count ? most : d.bricks.count)]);
    descent_finish(&d);
    return some;
}

static double process_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec * 1e6 + (double)now.tv_nsec * 1e-3;
}

/* Core-microseconds a brick, bounds of the load included: of the stages' clock, which runs on while a core waits; and
 * CPU time of the process, in which the host's part is included. */
typedef struct {
    double clock, cpu;
} brick_times;

/* With KARST_BENCH_SPANS: what ran when in a round, in us. */
static void print_spans(const karst_context *context)
{
    static karst_span spans[256];
    size_t num = getenv("KARST_BENCH_SPANS") ? karst_profile_spans(context, spans, 256) : 0;
    for (size_t i = 0; i < num && i < 256; i++)
        printf("    %8.1f to %8.1f  %6.1f  %s\n", (double)(spans[i].start_ns - spans[0].start_ns) * 1e-3,
               (double)(spans[i].end_ns - spans[0].start_ns) * 1e-3,
               (double)(spans[i].end_ns - spans[i].start_ns) * 1e-3, spans[i].name);
}

static brick_times brick_us(karst_producer *producer, pool *p, const node_list *bricks)
{
    karst_error error = {0};
    double us[KARST_NUM_STAGES];
    take_us(p->context, us);
    pool_ask(p, bricks->nodes, bricks->count);
    p->work.num_subdivides = 0;
    double start_us = process_us();
    pool_expect(karst_producer_answer(producer, &p->cache, &p->work, &error) && karst_finish(p->context, &error),
                "load", &error);
    double cpu_us = process_us() - start_us;
    take_us(p->context, us);
    return (brick_times){(us[KARST_STAGE_EVALUATE] + us[KARST_STAGE_FINALISE]) / bricks->count, cpu_us / bricks->count};
}

static void bench_speed(karst_context *context, pool *p, const char *text, const char *marks)
{
    karst_error error = {0};
    karst_world_file *file = compile(text);
    karst_producer *producer = produce(context, file, NULL);
    node_list bricks = some_bricks(producer, p, NUM_SPEED_BRICKS);
    ceilings c = {0};
    double us[NUM_ROUNDS], cpu_us[NUM_ROUNDS], part[NUM_ROUNDS], fma[NUM_ROUNDS], noise[NUM_ROUNDS];
    ceilings_open(&c, context);
    karst_profile_trace(context, getenv("KARST_BENCH_SPANS") != NULL, NULL);
    for (int round = -1; round < NUM_ROUNDS; round++) {
        int r = round < 0 ? 0 : round; /* the first warms up */
        measure_ceilings(&c, &fma[r], &noise[r]);
        brick_times times = brick_us(producer, p, &bricks);
        if (round == NUM_ROUNDS - 1)
            print_spans(context);
        us[r] = times.clock;
        cpu_us[r] = times.cpu;
        part[r] = fma[r] / (4 * NUM_OCTAVES) * times.clock / KARST_BRICK_SAMPLES;
    }
    ceilings_close(&c);

    /* a voxel for each work-item, one lane: what a plain kernel would be */
    const karst_world_build scalar_build = {.shape = KARST_SHAPE_GROUPS};
    karst_context *scalar = karst_context_create(getenv("KARST_DEVICE"), 1, NULL, &error);
    pool_expect(scalar, "context", &error);
    karst_producer *scalar_producer = produce(scalar, file, &scalar_build);
    pool scalar_pool;
    pool_open(&scalar_pool, scalar, CAPACITY, 1);
    node_list few = bricks;
    few.count = few.count < NUM_SCALAR_BRICKS ? few.count : NUM_SCALAR_BRICKS;
    brick_us(scalar_producer, &scalar_pool, &few);
    double scalar_us = brick_us(scalar_producer, &scalar_pool, &few).clock;

    double brick = median(us, NUM_ROUNDS), rate = KARST_BRICK_SAMPLES / brick;
    double ceiling = median(fma, NUM_ROUNDS) / (4 * NUM_OCTAVES), bare = median(noise, NUM_ROUNDS);
    printf("%-22s %9.1f %10.0f %8.2f %8.2f %9.1f %9.2f %12.2f %9.1f   %s\n", file->info.name, rate, 1e6 / brick, brick,
           median(cpu_us, NUM_ROUNDS), ceiling, median(part, NUM_ROUNDS), rate / bare,
           KARST_BRICK_SAMPLES / scalar_us, marks);
    fflush(stdout);
    free(bricks.nodes);
    pool_close(&scalar_pool);
    karst_producer_destroy(scalar_producer);
    karst_context_destroy(scalar);
    karst_producer_destroy(producer);
    karst_world_file_destroy(file);
}

typedef void bench(karst_context *context, pool *p, const char *text, const char *marks);

/* Each in a process of its own: drivers are at their best when they have loaded few programs. */
static void run(bench *what, const char *text, const char *marks)
{
    fflush(stdout);
    pid_t child = fork();
    pool_expect(child >= 0, "fork", NULL);
    if (child > 0) {
        int status;
        pool_expect(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0, text, NULL);
        return;
    }
    karst_error error = {0};
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), 0, NULL, &error);
    pool_expect(context, "context", &error);
    pool p;
    pool_open(&p, context, CAPACITY, 1);
    what(context, &p, text, marks);
    fflush(stdout);
    pool_close(&p);
    karst_context_destroy(context);
    exit(0);
}

int main(int argc, char **argv)
{
    const char *only = argc > 1 ? argv[1] : "";
    setenv("POCL_AFFINITY", "1", 0); /* as the command binds its threads (demos/command/command_driver.c) */
    if (!strstr("speed", only) && !strstr("bounds", only)) {
        fprintf(stderr, "usage: bench_standard_production [speed|bounds [WORLD.karst]]\n");
        return 2;
    }
    if (argc > 2) {
        run(strstr("speed", only) ? bench_speed : bench_tightness, argv[2], "");
        return 0;
    }
    if (strstr("speed", only)) {
        printf("\nproduction: evaluate and finalise, for each core, median of %d\n", NUM_ROUNDS);
        printf("%-22s %9s %10s %8s %8s %9s %9s %12s %9s\n", "", "Msample/s", "bricks/s", "us/brick", "CPU us",
               "FMA / 32", "a part", "x bare noise", "scalar");
        run(bench_speed, plain_text, "marks: a part of 7, and of 5");
        run(bench_speed, warped_text, "mark: 0.8 x bare noise");
        run(bench_speed, "demos/worlds/hills.karst", "mark: 4000 bricks/s");
    }
    if (strstr("bounds", only)) {
        printf("\nbounds from a tile of 1024 voxels to leaves of 16, and the same by naive intervals\n");
        printf("%-22s %-8s %9s %9s %9s %9s %10s %10s %10s\n", "", "", "bricks", "/ surface", "proven %", "and after",
               "us a node", "bounds ms", "loads ms");
        run(bench_tightness, plain_text, "marks: 2.0, 95 %, 6 us");
        run(bench_tightness, warped_text, "marks: 2.5, 91 %, 6 us");
        run(bench_tightness, "demos/worlds/hills.karst", "");
    }
    return 0;
}
