/* Worley's noise on bricks: cells hashed once a brick, beside the same bits with nothing shared between samples, and
 * beside a build of one voxel a work-item. Through the producer's evaluate step, in samples of bricks; the forms take
 * turns. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "producers/density/density_producer.h"
#include "producers/density/world_file.h"
#include "tests/support/pool.h"

#define NUM_BRICKS 256
#define NUM_ROUNDS 11
#define SCALAR_ROUNDS 3
#define HOISTED_MARK 3.0

enum { HOISTED, POINTWISE, SCALAR, NUM_FORMS };

static const struct {
    const char *name, *density;
} worlds[] = {
    {"F2 - F1, cells of 4 voxels", "vec2 w = worley(p / 4.0); return w.y - w.x;"},
    {"F2 - F1, cells of 16 voxels", "vec2 w = worley(p / 16.0); return w.y - w.x;"},
    {"F2 - F1, cells of 64 voxels", "vec2 w = worley(p / 64.0); return w.y - w.x;"},
    {"F1, cells of 16 voxels", "return worley(p / 16.0).x - 0.5;"},
    {"F2, cells of 16 voxels", "return worley(p / 16.0).y - 0.7;"},
    {"F1, 4 octaves from 64 voxels", "return worleyfbm(p / 64.0, 4).x - 1.0;"},
};

typedef struct {
    karst_context *context;
    karst_world_file *file;
    karst_producer *producer;
    pool bricks;
    double ns[NUM_ROUNDS];
    uint32_t num_last; /* bricks in the last chunk */
} form;

static void form_open(form *f, const char *density, int which)
{
    karst_error error = {0};
    char text[512];
    snprintf(text, sizeof text, "/*{ \"voxel\": 1 }*/\nfloat density(vec3 p) { %s }\n", density);
    f->context = karst_context_create(getenv("KARST_DEVICE"), which == SCALAR ? 1 : 16, NULL, &error);
    pool_expect(f->context, "context", &error);
    f->file = karst_world_file_compile("worley.karst", text, strlen(text), NULL, 0, NULL, &error);
    pool_expect(f->file, "world", &error);
    if (which == POINTWISE) {
        static const char define[] = "#define EMIT_POINTWISE\n";
        char *source = malloc(sizeof define + strlen(f->file->code.source));
        pool_expect(source, "out of memory", NULL);
        sprintf(source, "%s%s", define, f->file->code.source);
        free(f->file->code.source);
        f->file->code.source = source;
    }
    const karst_world_build build = {.in_two_steps = true};
    f->producer = karst_world_file_producer_built(f->context, f->file, 1, NUM_BRICKS, &build, &error);
    pool_expect(f->producer, "producer", &error);
    pool_open(&f->bricks, f->context, NUM_BRICKS, 1);
}

static void form_close(form *f)
{
    pool_close(&f->bricks);
    karst_producer_destroy(f->producer);
    karst_world_file_destroy(f->file);
    karst_context_destroy(f->context);
}

/* One round: time of the device. */
static double evaluate(form *f)
{
    pool_node nodes[NUM_BRICKS];
    karst_error error = {0};
    uint64_t ns[KARST_NUM_STAGES] = {0};
    for (int i = 0; i < NUM_BRICKS; i++)
        nodes[i] = (pool_node){{i % 8 - 4, i / 8 % 8, i / 64}, 0};
    pool_ask(&f->bricks, nodes, NUM_BRICKS);
    f->bricks.work.num_subdivides = 0;
    for (uint32_t first = 0; first < NUM_BRICKS; first += f->producer->max_chunk) {
        uint32_t left = NUM_BRICKS - first, count = left < f->producer->max_chunk ? left : f->producer->max_chunk;
        pool_expect(f->producer->ops->load(f->producer, &f->bricks.cache, &f->bricks.work, first, count, &error),
                    "load", &error);
        f->num_last = count;
    }
    pool_expect(karst_profile_collect(f->context, ns, &error), "profile", &error);
    return (double)ns[KARST_STAGE_EVALUATE];
}

/* Of the floats that were evaluated last. */
static uint64_t hash_samples(form *f)
{
    karst_error error = {0};
    uint32_t stride;
    karst_buffer *staging = karst_density_producer_staging(f->producer, &stride);
    float *samples = malloc((size_t)f->num_last * stride * sizeof *samples);
    pool_expect(samples, "out of memory", NULL);
    pool_expect(karst_buffer_read(staging, 0, samples, (size_t)f->num_last * stride * sizeof *samples, &error), "read",
                &error);
    uint64_t hash = POOL_HASH_START;
    for (uint32_t i = 0; i < f->num_last; i++)
        hash = pool_hash(hash, samples + (size_t)i * stride, KARST_BRICK_SAMPLES * sizeof *samples);
    free(samples);
    return hash;
}

static int compare_numbers(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *ns, int count)
{
    qsort(ns, (size_t)count, sizeof *ns, compare_numbers);
    return ns[count / 2];
}

int main(void)
{
    printf("\nWorley's noise on bricks, encoded Msamples/s and core (mark: hoisted %.0f times the unhoisted form)\n",
           HOISTED_MARK);
    printf("%-32s %9s %10s %8s %7s\n", "", "hoisted", "unhoisted", "scalar", "times");
    for (size_t w = 0; w < sizeof worlds / sizeof *worlds; w++) {
        form forms[NUM_FORMS] = {0};
        double rate[NUM_FORMS], ratio[NUM_ROUNDS];
        cl_uint num_cores = 1;
        for (int i = 0; i < NUM_FORMS; i++) {
            form_open(&forms[i], worlds[w].density, i);
            evaluate(&forms[i]); /* compiles */
        }
        clGetDeviceInfo(forms[0].context->device, CL_DEVICE_MAX_COMPUTE_UNITS, sizeof num_cores, &num_cores, NULL);
        for (int round = 0; round < NUM_ROUNDS; round++)
            for (int i = 0; i < NUM_FORMS; i++)
                if (i != SCALAR || round < SCALAR_ROUNDS)
                    forms[i].ns[round] = evaluate(&forms[i]);
        for (int round = 0; round < NUM_ROUNDS; round++)
            ratio[round] = forms[POINTWISE].ns[round] / forms[HOISTED].ns[round];
        uint64_t hash = hash_samples(&forms[0]);
        for (int i = 0; i < NUM_FORMS; i++) {
            pool_expect(hash_samples(&forms[i]) == hash, "the forms differ", NULL);
            rate[i] = 1e3 * NUM_BRICKS * KARST_BRICK_SAMPLES /
                      median(forms[i].ns, i == SCALAR ? SCALAR_ROUNDS : NUM_ROUNDS) / num_cores;
            form_close(&forms[i]);
        }
        double times = median(ratio, NUM_ROUNDS); /* of the same round: a machine's speed changes */
        printf("%-32s %9.1f %10.1f %8.1f %7.1f   %s\n", worlds[w].name, rate[HOISTED], rate[POINTWISE], rate[SCALAR],
               times, times >= HOISTED_MARK ? "" : "below the mark");
        fflush(stdout);
    }
    return 0;
}
