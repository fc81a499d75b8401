/* A sample of the density as a brick holds it: q, and scale * q is the density.
 *
 * Kernels are built for one width, -DKARST_BRICK_BITS=N; without it 16. The host asks by number. Compiled twice: see
 * core/device/dialect.h. */
#ifndef KARST_CACHE_SAMPLE_SHARED_H
#define KARST_CACHE_SAMPLE_SHARED_H

#include "core/device/dialect.h"

#ifndef KARST_BRICK_BITS
#define KARST_BRICK_BITS 16
#endif

/* Signed integers of 8 or 16 bits, or floats. */
#if KARST_BRICK_BITS == 32
typedef float karst_brick_sample;
#elif KARST_BRICK_BITS == 16
typedef short karst_brick_sample;
#elif KARST_BRICK_BITS == 8
#ifdef __OPENCL_VERSION__
typedef char karst_brick_sample;
#else
typedef signed char karst_brick_sample;
#endif
#else
#error "KARST_BRICK_BITS is 8, 16 or 32"
#endif

/* A brick keeps its full range, so that rays far from the surface see how far they are, unless that is more than this
 * many times the largest density at a corner of a surface cell: beyond it values are clamped. In a field that is near
 * to a distance the corners of surface cells reach 0.5 to 1.7 cells. 16 bits: nothing is clamped within 16 cells of
 * the surface, and a cell is some 2000 steps of q, whose normals differ by 0.03 degrees from exact ones. In a wild
 * field (an exponential, a pole) the surface cells keep 1000 steps, whatever the field does elsewhere. 8 bits: clamped
 * beyond a cell or two, so that a cell keeps some 50 steps. Floats need no clamp, but so they take the same steps. */
K_INLINE float karst_clamp_surfaces(int bits) { return bits == 8 ? 2.0f : 32.0f; }

/* Smaller ranges than this would make 1 / scale infinite. */
#define KARST_MIN_RANGE 0x1p-100f

/* The q of a brick's range: of integers the largest. */
K_INLINE float karst_max_q(int bits) { return bits == 8 ? 127.0f : 32767.0f; }

/* The largest |d| that a brick tells from larger ones. `largest` is max |d| over the brick, `surface` the same over
 * corners of surface cells. */
K_INLINE float karst_brick_range(float largest, float surface, int bits)
{
    float clamp = surface * karst_clamp_surfaces(bits); /* infinite for a huge surface: no clamp */
    float range = clamp < largest ? clamp : largest;
    return range > KARST_MIN_RANGE ? range : KARST_MIN_RANGE;
}

/* karst_brick_info.scale for that range. Of floats a power of two, which rounds nothing: q is below 2^15. */
K_INLINE float karst_brick_scale(float range, int bits)
{
    return bits == 32 ? k_as_float(k_as_uint(range) & 0x7f800000u) * 0x1p-14f : range / karst_max_q(bits);
}

/* The least |q| of what is not 0: so a sample keeps its sign. */
K_INLINE float karst_least_q(int bits) { return bits == 32 ? 0x1p-100f : 1.0f; }

#endif
