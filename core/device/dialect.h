/* The dialect: what C11 on the host and OpenCL C 1.2 on a device both read.
 *
 * COMPILED TWICE, MUST AGREE BIT FOR BIT. Every header that ends in _shared.h, and every .clh file, includes this
 * one and uses only its names. Rules for code in the dialect:
 *   - no contraction: a*b+c is two roundings, k_fma(a,b,c) is one; the choice is part of the result;
 *   - only + - * / k_fma k_sqrt k_floor k_rint k_fabs on floats, nothing from a maths library;
 *   - no macros with any number of arguments, which OpenCL C does not have;
 *   - int is 32 bits, long is 64 bits, both two's complement; shifts of negative ints are arithmetic.
 *
 * Only OpenCL compilers define __OPENCL_C_VERSION__ (PoCL's host headers may define __OPENCL_VERSION__).
 */
#ifndef KARST_CORE_DIALECT_H
#define KARST_CORE_DIALECT_H

#ifdef __OPENCL_C_VERSION__

#pragma OPENCL FP_CONTRACT OFF

#define K_INLINE inline static
/* Before a loop of few rounds over an array: compilers here leave it a loop, and the array in memory. */
#define K_UNROLL _Pragma("unroll")
#define K_GLOBAL __global
#define K_CONSTANT __constant const
#define K_PRIVATE __private
#define K_ASSERT_SIZE(type, bytes) typedef char type##_has_##bytes##_bytes[sizeof(type) == (bytes) ? 1 : -1]

#define k_fma(a, b, c) fma(a, b, c)
#define k_sqrt(x) sqrt(x)
/* PoCL's floor and rint of vectors are ten instructions, its fabs five; the compiler's own are one. The same bits.
 * oclgrind knows only the former: KARST_PLAIN_FLOOR. */
#if defined(__has_builtin) && !defined(KARST_PLAIN_FLOOR)
#if __has_builtin(__builtin_elementwise_floor) && __has_builtin(__builtin_elementwise_roundeven)
#define k_floor(x) __builtin_elementwise_floor(x)
#define k_rint(x) __builtin_elementwise_roundeven(x)
#endif
#if __has_builtin(__builtin_elementwise_abs)
#define k_fabs(x) __builtin_elementwise_abs(x)
#endif
#endif
#ifndef k_floor
#define k_floor(x) floor(x)
#define k_rint(x) rint(x)
#endif
#ifndef k_fabs
#define k_fabs(x) fabs(x)
#endif
#define k_as_float(u) as_float(u)
#define k_as_uint(f) as_uint(f)
#define k_mul_hi_ulong(a, b) mul_hi((ulong)(a), (ulong)(b))
#define k_clz(x) ((int)clz((uint)(x)))
#define k_popcount(x) ((int)popcount((uint)(x)))

#else /* host */

#include <math.h>
#include <stdint.h>
#include <string.h>

typedef uint8_t uchar;
typedef uint16_t ushort;
typedef unsigned int uint;
typedef unsigned long ulong;
_Static_assert(sizeof(long) == 8 && sizeof(int) == 4, "the dialect needs an LP64 host");

#define K_INLINE static inline __attribute__((unused))
#define K_UNROLL
#define K_GLOBAL
#define K_CONSTANT const
#define K_PRIVATE
#define K_ASSERT_SIZE(type, bytes) _Static_assert(sizeof(type) == (bytes), #type " must be " #bytes " bytes")

#define k_fma(a, b, c) fmaf(a, b, c)
#define k_sqrt(x) sqrtf(x)
#define k_floor(x) floorf(x)
#define k_rint(x) rintf(x)
#define k_fabs(x) fabsf(x)
K_INLINE float k_as_float(uint u)
{
    float f;
    memcpy(&f, &u, 4);
    return f;
}
K_INLINE uint k_as_uint(float f)
{
    uint u;
    memcpy(&u, &f, 4);
    return u;
}
__extension__ typedef unsigned __int128 k_ulong128;
K_INLINE ulong k_mul_hi_ulong(ulong a, ulong b) { return (ulong)(((k_ulong128)a * b) >> 64); }
K_INLINE int k_clz(uint x) { return x ? __builtin_clz(x) : 32; }
K_INLINE int k_popcount(uint x) { return __builtin_popcount(x); }

#endif

/* min and max as selects, so that ties, zeros and NaN are the same everywhere: b wins only if smaller (larger). */
#define k_min(a, b) ((b) < (a) ? (b) : (a))
#define k_max(a, b) ((b) > (a) ? (b) : (a))

#endif
