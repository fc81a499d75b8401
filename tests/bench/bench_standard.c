/* The standard benchmark: hills at 800x600, settled, every ray recast, beside a floor and beside bare noise measured in
 * the same run.
 *
 * Machines are shared and noisy: what counts are the ratios. Every figure is a median; the measured things take turns,
 * so that a slow spell of the machine falls on all of them alike. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "karst/karst.h"
#include "cache/layout_shared.h"
#include "raycast/floor.h"

#define WIDTH_PX 800
#define HEIGHT_PX 600
#define NUM_ROUNDS 15
#define NUM_NOISE_BRICKS 512
#define NUM_OCTAVES 8
#define FMA_ITEMS 64
#define FMA_STEPS 20000
#define FMA_CHAINS 10

static const char rate_source[] =
    "#include \"noise/fbm.clh\"\n"
    "#include \"cache/layout_shared.h\"\n"
    /* Eight octaves at each sample of a brick, one sample a lane, nothing shared but the octaves' weights: stored
       samples are what counts. */
    "K_WIDE __kernel void noise_rate(__global float *out, int num_bricks)\n"
    "{\n"
    "    int brick = get_global_id(0);\n"
    "    if (brick >= num_bricks)\n"
    "        return;\n"
    "    long frequency = 1L << 45;\n"
    "    noise_octaves octaves = noise_octaves_at(frequency, NUM_OCTAVES, 1.0f, 0.5f, 0);\n"
    "    noise_axis x = noise_axis_at(16L * brick, frequency, 0);\n"
    "    for (int iz = 0; iz < KARST_BRICK_SIDE; iz++)\n"
    "        for (int iy = 0; iy < KARST_BRICK_SIDE; iy++) {\n"
    "            noise_axis y = noise_axis_at(iy, frequency, 0), z = noise_axis_at(iz, frequency, 0);\n"
    "            noise_position p;\n"
    "            p.axis[0] = noise_axis_sample(&x, V_LANE);\n"
    "            p.axis[1] = noise_axis_sample(&y, (vint)(0));\n"
    "            p.axis[2] = noise_axis_sample(&z, (vint)(0));\n"
    "            vfloat d = noise_fbm(&p, 7u, &octaves, NUM_OCTAVES, (vfloat)(0.0f));\n"
    "            __global float *row = out + ((brick * KARST_BRICK_SIDE + iz) * KARST_BRICK_SIDE + iy) * 16;\n"
    "            v_store_float(d, row);\n"
    "        }\n"
    "}\n"
    "K_WIDE __kernel void fma_rate(__global float *out, float b)\n"
    "{\n"
    "    vfloat a[FMA_CHAINS];\n"
    "    for (int i = 0; i < FMA_CHAINS; i++)\n"
    "        a[i] = (vfloat)(i + b);\n"
    "    for (int step = 0; step < FMA_STEPS; step++)\n"
    "        for (int i = 0; i < FMA_CHAINS; i++)\n"
    "            a[i] = k_fma(a[i], (vfloat)(b), (vfloat)(b));\n"
    "    vfloat sum = a[0];\n"
    "    for (int i = 1; i < FMA_CHAINS; i++)\n"
    "        sum += a[i];\n"
    "    out += get_global_id(0) * LANES;\n"
    "    v_store_float(sum, out);\n"
    "}\n";

static void die(const char *what, const karst_error *error)
{
    fprintf(stderr, "bench: %s: %s\n", what, error->message);
    exit(error->status ? (int)error->status : 1);
}

static void print_line(void *user, karst_log_level level, const char *line)
{
    (void)user;
    (void)level;
    fprintf(stderr, "%s\n", line);
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(const double *values, int n)
{
    double sorted[NUM_ROUNDS];
    memcpy(sorted, values, (size_t)n * sizeof *values);
    qsort(sorted, (size_t)n, sizeof *sorted, compare_doubles);
    return sorted[n / 2];
}

/* Device time of what was launched since the last call, whatever its stage. */
static double take_ms(karst_context *context)
{
    karst_error error = {0};
    uint64_t ns[KARST_NUM_STAGES] = {0}, sum = 0;
    if (!karst_profile_collect(context, ns, &error))
        die("profile", &error);
    for (int stage = 0; stage < KARST_NUM_STAGES; stage++)
        sum += ns[stage];
    return (double)sum * 1e-6;
}

typedef struct {
    karst_engine *engine;
    karst_stats settled;
    double settle_ms, evaluate_ms, finalise_ms, subdivide_ms;
    uint64_t num_bricks, num_tiles, num_constant;
    double frame_ms[NUM_ROUNDS], cast_ms[NUM_ROUNDS], shade_ms[NUM_ROUNDS], collect_ms[NUM_ROUNDS],
        display_ms[NUM_ROUNDS];
} view;

static bool add_frame(void *user, const karst_stats *stats)
{
    view *v = user;
    v->evaluate_ms += (double)stats->time_ns[KARST_STAGE_EVALUATE] * 1e-6;
    v->finalise_ms += (double)stats->time_ns[KARST_STAGE_FINALISE] * 1e-6;
    v->subdivide_ms += (double)stats->time_ns[KARST_STAGE_SUBDIVIDE] * 1e-6;
    v->num_bricks += stats->num_bricks_produced;
    v->num_tiles += stats->num_tiles_produced;
    v->num_constant += stats->num_bricks_constant;
    v->settled = *stats;
    return true;
}

static void settle(view *v, bool shadows, const karst_log *log)
{
    karst_error error = {0};
    bool settled;
    karst_engine_config config = {
        .world = "hills", .width_px = WIDTH_PX, .height_px = HEIGHT_PX, .no_shadows = !shadows, .log = log};
    v->engine = karst_engine_create(&config, &error);
    if (!v->engine)
        die("engine", &error);
    uint64_t start_ns = karst_clock_ns();
    if (!karst_engine_settle(v->engine, 0, add_frame, v, &settled, &error))
        die("settle", &error);
    v->settle_ms = (double)(karst_clock_ns() - start_ns) * 1e-6;
    if (!settled) {
        fprintf(stderr, "bench: hills did not settle\n");
        exit(1);
    }
}

static void measure_frame(view *v, int round)
{
    karst_error error = {0};
    karst_stats stats;
    if (!karst_engine_frame(v->engine, &error))
        die("frame", &error);
    karst_engine_stats(v->engine, &stats);
    v->frame_ms[round] = (double)stats.time_ns_frame * 1e-6;
    v->cast_ms[round] = (double)stats.time_ns[KARST_STAGE_CAST] * 1e-6;
    v->shade_ms[round] = (double)stats.time_ns[KARST_STAGE_SHADE] * 1e-6;
    v->collect_ms[round] = (double)stats.time_ns[KARST_STAGE_COLLECT] * 1e-6;
    v->display_ms[round] = (double)stats.time_ns[KARST_STAGE_DISPLAY] * 1e-6;
}

static void print_view(const char *name, const view *v, double floor_ms)
{
    double frame_ms = median(v->frame_ms, NUM_ROUNDS);
    printf("%-34s %8.2f ms  %6.2f x floor   cast %.2f  shade %.2f  collect %.3f  display %.2f\n", name, frame_ms,
           frame_ms / floor_ms, median(v->cast_ms, NUM_ROUNDS), median(v->shade_ms, NUM_ROUNDS),
           median(v->collect_ms, NUM_ROUNDS), median(v->display_ms, NUM_ROUNDS));
}

int main(void)
{
    karst_error error = {0};
    karst_log log = {.write = print_line, .max_level = KARST_LOG_WARNING};
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), 0, &log, &error);
    if (!context)
        die("device", &error);
    double cores = context->compute_units;

    char options[128];
    snprintf(options, sizeof options, "-DNUM_OCTAVES=%d -DFMA_CHAINS=%d -DFMA_STEPS=%d", NUM_OCTAVES, FMA_CHAINS,
             FMA_STEPS);
    karst_virtual_file file = {"bench_rate.cl", rate_source};
    karst_program *program = karst_program_build(context, "bench_rate.cl", options, &file, 1, &error);
    cl_kernel noise = program ? karst_program_kernel(program, "noise_rate", &error) : NULL;
    cl_kernel fma_kernel = program ? karst_program_kernel(program, "fma_rate", &error) : NULL;
    int num_noise_bricks = NUM_NOISE_BRICKS;
    size_t noise_samples = (size_t)num_noise_bricks * KARST_BRICK_SIDE * KARST_BRICK_SIDE * 16;
    karst_buffer *out = karst_buffer_create(context, "noise", noise_samples * sizeof(float), NULL, &error);
    karst_floor *floor_kernel = karst_floor_create(context, WIDTH_PX, HEIGHT_PX, &error);
    float b = 0.999f;
    if (!noise || !fma_kernel || !out || !floor_kernel ||
        !KARST_ARGUMENTS(noise, &error, KARST_BUFFER_ARG(out), KARST_VALUE_ARG(num_noise_bricks)) ||
        !KARST_ARGUMENTS(fma_kernel, &error, KARST_BUFFER_ARG(out), KARST_VALUE_ARG(b)))
        die("kernels", &error);

    view plain = {0}, shadowed = {0};
    settle(&plain, false, &log);
    settle(&shadowed, true, &log);

    double floor_ms[NUM_ROUNDS], noise_ms[NUM_ROUNDS], fma_ms[NUM_ROUNDS];
    for (int round = -2; round < NUM_ROUNDS; round++) {
        int r = round < 0 ? 0 : round; /* the first two warm up */
        uint64_t floor_ns;
        if (!karst_floor_run(floor_kernel, &floor_ns, &error))
            die("floor", &error);
        floor_ms[r] = (double)floor_ns * 1e-6;
        measure_frame(&plain, r);
        measure_frame(&shadowed, r);
        if (!karst_launch(context, noise, KARST_STAGE_EVALUATE, (size_t)num_noise_bricks, 1, &error))
            die("noise", &error);
        noise_ms[r] = take_ms(context);
        if (!karst_launch(context, fma_kernel, KARST_STAGE_EVALUATE, FMA_ITEMS, 1, &error))
            die("fma", &error);
        fma_ms[r] = take_ms(context);
    }

    double floor_median_ms = median(floor_ms, NUM_ROUNDS);
    double noise_rate = (double)noise_samples / (median(noise_ms, NUM_ROUNDS) * 1e3 * cores);
    double fma_rate =
        (double)FMA_ITEMS * FMA_STEPS * FMA_CHAINS * context->lanes / (median(fma_ms, NUM_ROUNDS) * 1e6 * cores);
    double hills_samples = (double)plain.num_bricks * KARST_BRICK_SAMPLES;
    double hills_rate = hills_samples / (plain.evaluate_ms * 1e3 * cores);
    printf("%s, %g cores, hills, %dx%d, %g px a voxel, median of %d\n\n", context->name, cores, WIDTH_PX, HEIGHT_PX,
           plain.settled.detail_given_px, NUM_ROUNDS);
    printf("%-34s %8.2f ms\n", "floor (8 nodes + 8 samples a ray)", floor_median_ms);
    print_view("settled frame, no shadows", &plain, floor_median_ms);
    print_view("settled frame, sun shadows", &shadowed, floor_median_ms);
    printf("%-34s %8.2f x the frame without\n", "",
           median(shadowed.frame_ms, NUM_ROUNDS) / median(plain.frame_ms, NUM_ROUNDS));
    printf("\n%-34s %8.1f Gfma/s per core\n", "FMA ceiling", fma_rate);
    printf("%-34s %8.1f Msamples/s per core\n", "bare noise, 8 octaves, pointwise", noise_rate);
    printf("%-34s %8.1f Msamples/s per core  %.2f x bare noise\n", "hills, evaluate", hills_rate,
           hills_rate / noise_rate);
    printf("%-34s %8.0f bricks per core-second (evaluate and finalise)\n", "",
           (double)plain.num_bricks / ((plain.evaluate_ms + plain.finalise_ms) * 1e-3 * cores));
    printf("%-34s %8.2f us of a core a node\n", "bounds (subdivide)",
           plain.subdivide_ms * 1e3 * cores / ((double)plain.num_tiles * 8));
    printf("\n%-34s %8.0f ms in %u frames: %llu bricks and %llu tiles made, %llu bricks constant after all\n",
           "settling from nothing", plain.settle_ms, plain.settled.frame, (unsigned long long)plain.num_bricks,
           (unsigned long long)plain.num_tiles, (unsigned long long)plain.num_constant);
    printf("%-34s %8llu bricks, %llu tiles\n", "in use when settled", (unsigned long long)plain.settled.bricks.num_used,
           (unsigned long long)plain.settled.tiles.num_used);

    karst_engine_destroy(plain.engine);
    karst_engine_destroy(shadowed.engine);
    karst_floor_destroy(floor_kernel);
    clReleaseKernel(noise);
    clReleaseKernel(fma_kernel);
    karst_program_destroy(program);
    karst_buffer_destroy(out);
    karst_context_destroy(context);
    return 0;
}
