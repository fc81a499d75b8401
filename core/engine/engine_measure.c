/* Ceilings and floor of an engine's device: see karst/measure.h. */
#include "karst/measure.h"

#include <stdlib.h>

#include "core/engine/engine_measure_shared.h"
#include "core/engine/engine_parts.h"
#include "core/device/profile.h"
#include "core/device/program_cache.h"
#include "raycast/cast/floor.h"
#include "raycast/rays_shared.h"

#define COPY_BYTES ((size_t)128 << 20)
#define NUM_NOISE_BRICKS 512

struct karst_measure {
    karst_context *context;
    karst_floor *floor_kernel;
    karst_program *program;
    cl_kernel fma, copy, noise;
    karst_buffer *from, *to;
    size_t num_fma_items, local_size;
};

karst_measure *karst_measure_create(karst_engine *engine, karst_error *error)
{
    karst_measure *m = calloc(1, sizeof *m);
    if (!m) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    karst_context *context = engine->context;
    m->context = context;
    m->local_size = context->is_cpu ? 1 : 64;
    m->num_fma_items = (size_t)context->compute_units * (context->is_cpu ? 32 : 2048);
    m->floor_kernel = karst_floor_create(context, engine->width_px, engine->height_px, error);
    m->from = m->floor_kernel ? karst_buffer_create(context, "measure", COPY_BYTES, NULL, error) : NULL;
    m->to = m->from ? karst_buffer_create(context, "measure", COPY_BYTES, NULL, error) : NULL;
    m->program = m->to ? karst_program_build(context, "core/engine/engine_measure.cl", "", NULL, 0, error) : NULL;
    m->fma = m->program ? karst_program_kernel(m->program, "measure_fma", error) : NULL;
    m->copy = m->fma ? karst_program_kernel(m->program, "measure_copy", error) : NULL;
    m->noise = m->copy ? karst_program_kernel(m->program, "measure_noise", error) : NULL;
    if (!m->noise) {
        karst_measure_destroy(m);
        return NULL;
    }
    karst_program_cache_finish(context);
    return m;
}

void karst_measure_destroy(karst_measure *m)
{
    if (!m)
        return;
    if (m->fma)
        clReleaseKernel(m->fma);
    if (m->copy)
        clReleaseKernel(m->copy);
    if (m->noise)
        clReleaseKernel(m->noise);
    karst_program_destroy(m->program);
    karst_buffer_destroy(m->from);
    karst_buffer_destroy(m->to);
    karst_floor_destroy(m->floor_kernel);
    free(m);
}

/* Device time of what was launched, in seconds; never 0, which would make a rate infinite. */
static bool take_s(karst_measure *m, double *time_s, karst_error *error)
{
    uint64_t ns[KARST_NUM_STAGES] = {0}, sum = 0;
    bool ok = karst_profile_collect(m->context, ns, error);
    for (int stage = 0; stage < KARST_NUM_STAGES; stage++)
        sum += ns[stage];
    *time_s = (double)(sum ? sum : 1) * 1e-9;
    return ok;
}

bool karst_measure_ceilings(karst_measure *m, karst_ceilings *ceilings, karst_error *error)
{
    float b = 0.999f;
    cl_uint num_copied = (cl_uint)(COPY_BYTES / sizeof(cl_float4));
    cl_int num_bricks = NUM_NOISE_BRICKS;
    size_t noise_samples = (size_t)NUM_NOISE_BRICKS * KARST_BRICK_SIDE * KARST_BRICK_SIDE * 16;
    size_t copy_items =
        m->context->is_cpu ? (num_copied + KARST_MEASURE_COPY_CHUNK - 1) / KARST_MEASURE_COPY_CHUNK : num_copied;
    size_t noise_items = m->context->lanes == 16 ? NUM_NOISE_BRICKS : noise_samples;
    double time_s;
    /* A frame's launches are not to be counted here. */
    if (!take_s(m, &time_s, error))
        return false;
    if (!KARST_ARGUMENTS(m->fma, error, KARST_BUFFER_ARG(m->to), KARST_VALUE_ARG(b)) ||
        !karst_launch(m->context, m->fma, KARST_STAGE_EVALUATE, m->num_fma_items, m->local_size, error) ||
        !take_s(m, &time_s, error))
        return false;
    ceilings->fma_per_s = (double)m->num_fma_items * KARST_MEASURE_FMA_STEPS * KARST_MEASURE_FMA_CHAINS *
                          (double)m->context->lanes / time_s;
    if (!KARST_ARGUMENTS(m->copy, error, KARST_BUFFER_ARG(m->from), KARST_BUFFER_ARG(m->to),
                         KARST_VALUE_ARG(num_copied)) ||
        !karst_launch(m->context, m->copy, KARST_STAGE_EVALUATE, copy_items, m->local_size, error) ||
        !take_s(m, &time_s, error))
        return false;
    ceilings->bytes_per_s = 2.0 * (double)COPY_BYTES / time_s;
    if (!KARST_ARGUMENTS(m->noise, error, KARST_BUFFER_ARG(m->to), KARST_VALUE_ARG(num_bricks)) ||
        !karst_launch(m->context, m->noise, KARST_STAGE_EVALUATE, noise_items, m->local_size, error) ||
        !take_s(m, &time_s, error))
        return false;
    ceilings->noise_per_s = (double)noise_samples / time_s;
    return true;
}

bool karst_measure_floor(karst_measure *m, karst_ceilings *ceilings, karst_error *error)
{
    uint64_t floor_ns;
    double frame_s; /* of a frame's launches, which are not to be counted here */
    if (!take_s(m, &frame_s, error) || !karst_floor_run(m->floor_kernel, &floor_ns, error))
        return false;
    ceilings->floor_ns = (double)floor_ns;
    return true;
}

int karst_measure_num_cores(const karst_measure *m) { return m->context->compute_units; }

int karst_brick_num_samples(void) { return KARST_BRICK_SAMPLES; }

bool karst_engine_count_hit_bricks(karst_engine *engine, uint64_t *num_bricks, karst_error *error)
{
    size_t num_hits = (size_t)engine->stats.num_pixels;
    uint32_t num_slots = karst_cache_get_buffers(engine->cache)->num_bricks;
    karst_hit *hits = malloc((num_hits + 1) * sizeof *hits);
    uint8_t *seen = calloc(num_slots, 1);
    *num_bricks = 0;
    bool ok = (hits && seen) || karst_fail(error, KARST_FAILED, "out of memory");
    ok = ok && karst_buffer_read(engine->hits, 0, hits, num_hits * sizeof *hits, error);
    for (size_t i = 0; ok && i < num_hits; i++)
        if (KARST_HIT_KIND(hits[i].kind) != KARST_HIT_MISS && hits[i].brick && hits[i].brick < num_slots &&
            !seen[hits[i].brick]) {
            seen[hits[i].brick] = 1;
            ++*num_bricks;
        }
    free(hits);
    free(seen);
    return ok;
}

/* ---- spans ---- */

bool karst_engine_set_tracing(karst_engine *engine, bool tracing, karst_error *error)
{
    return karst_profile_trace(engine->context, tracing, error);
}

size_t karst_engine_spans(const karst_engine *engine, karst_span *spans, size_t max_spans)
{
    return karst_profile_spans(engine->context, spans, max_spans);
}

uint64_t karst_clock(void) { return karst_clock_ns(); }
