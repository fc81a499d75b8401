/* What a device can do at most: see karst/measure.h. */
#include "cache/layout_shared.h"
#include "core/engine/engine_measure_shared.h"
#include "noise/fbm.clh"

/* Chains that live in registers at once: of AVX2's sixteen two hold one. As many multiply-adds in all. */
#ifdef V_AVX2
#define CHAINS (KARST_MEASURE_FMA_CHAINS / 2)
#else
#define CHAINS KARST_MEASURE_FMA_CHAINS
#endif

K_WIDE __kernel void measure_fma(__global float *out, float b)
{
    /* Unrolled, so that the chains live in registers: PoCL leaves short loops as they are, and arrays in memory. */
    vfloat a[CHAINS];
#pragma unroll
    for (int i = 0; i < CHAINS; i++)
        a[i] = (vfloat)(i + b);
    for (int step = 0; step < KARST_MEASURE_FMA_STEPS * (KARST_MEASURE_FMA_CHAINS / CHAINS); step++)
#pragma unroll
        for (int i = 0; i < CHAINS; i++)
            a[i] = k_fma(a[i], (vfloat)(b), (vfloat)(b));
    vfloat sum = a[0];
#pragma unroll
    for (int i = 1; i < CHAINS; i++)
        sum += a[i];
    out += get_global_id(0) * LANES;
    v_store_float(sum, out);
}

/* A CPU's cores each stream through a stretch of their own; elsewhere neighbours read neighbours. */
__kernel void measure_copy(__global const float4 *from, __global float4 *to, uint num)
{
#if KARST_DEVICE_CPU
    uint begin = (uint)get_global_id(0) * KARST_MEASURE_COPY_CHUNK;
    for (uint i = begin; i < begin + KARST_MEASURE_COPY_CHUNK && i < num; i++)
        to[i] = from[i];
#else
    uint i = (uint)get_global_id(0);
    if (i < num)
        to[i] = from[i];
#endif
}

/* One row of samples along x, from `lane0` on; one a lane. */
void noise_row(int brick, int iy, int iz, int lane0, __global float *out)
{
    long frequency = 1L << 45;
    noise_octaves octaves = noise_octaves_at(frequency, KARST_MEASURE_OCTAVES, 1.0f, 0.5f, 0);
    noise_axis x = noise_axis_at(16L * brick, frequency, 0);
    noise_axis y = noise_axis_at(iy, frequency, 0), z = noise_axis_at(iz, frequency, 0);
    noise_position p;
    p.axis[0] = noise_axis_sample(&x, V_LANE + (vint)(lane0));
    p.axis[1] = noise_axis_sample(&y, (vint)(0));
    p.axis[2] = noise_axis_sample(&z, (vint)(0));
    vfloat d = noise_fbm(&p, 7u, &octaves, KARST_MEASURE_OCTAVES, (vfloat)(0.0f));
    v_store_float(d, out);
}

/* Eight octaves at 16 x 17 x 17 samples of each brick. With 16 lanes a brick for each work-item, else a sample. */
K_WIDE __kernel void measure_noise(__global float *out, int num_bricks)
{
#if LANES == 16
    int brick = get_global_id(0);
    if (brick >= num_bricks)
        return;
    for (int iz = 0; iz < KARST_BRICK_SIDE; iz++)
        for (int iy = 0; iy < KARST_BRICK_SIDE; iy++) {
            __global float *row = out + ((brick * KARST_BRICK_SIDE + iz) * KARST_BRICK_SIDE + iy) * 16;
            noise_row(brick, iy, iz, 0, row);
        }
#else
    int id = get_global_id(0), row = id / 16, brick = row / (KARST_BRICK_SIDE * KARST_BRICK_SIDE);
    if (brick >= num_bricks)
        return;
    noise_row(brick, row % KARST_BRICK_SIDE, row / KARST_BRICK_SIDE % KARST_BRICK_SIDE, id % 16, out + id);
#endif
}
