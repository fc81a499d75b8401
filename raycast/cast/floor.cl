/* The floor of casting a picture: per ray, coherent as in 4x4 packets, KARST_FLOOR_READS dependent reads of a node
 * table and as many trilinear samples of a 16-bit brick; no skipping, no shading. */
#include "raycast/cast/floor_shared.h"
#include "raycast/cast/rays.clh"
#include "raycast/cast/samples.clh"

/* Samples at the corners of a cell, as floats: v_xyz. Ratios to the floor are compared over the years: so it reads
 * cells in its own way, which stays as it is when the cast finds a better one. */
typedef struct {
    vfloat v000, v100, v010, v110, v001, v101, v011, v111;
} corners;

#if LANES == 16
#define LOAD_ROW_(first, second, offset)                        \
    {                                                           \
        K_GLOBAL const short *row = bricks + (offset);          \
        const vint two = as_int16((uint16)(EACH_INDEX_(TWO_))); \
        (first) = v_to_float(two << 16 >> 16);                  \
        (second) = v_to_float(two >> 16);                       \
    }
#else
#define LOAD_ROW_(first, second, offset) \
    (first) = (float)bricks[index + (offset)], (second) = (float)bricks[index + (offset) + 1];
#endif
RAY_INLINE void load_corners(K_GLOBAL const short *bricks, vint index, corners *v)
{
#if LANES == 16
    READ_INDICES_(index)
#endif
    LOAD_ROW_(v->v000, v->v100, 0)
    LOAD_ROW_(v->v010, v->v110, ROW_Y)
    LOAD_ROW_(v->v001, v->v101, ROW_Z)
    LOAD_ROW_(v->v011, v->v111, ROW_YZ)
}

RAY_INLINE vfloat corners_at(const corners *v, vfloat x, vfloat y, vfloat z)
{
    vfloat p00 = k_fma(v->v100 - v->v000, x, v->v000), p10 = k_fma(v->v110 - v->v010, x, v->v010);
    vfloat p01 = k_fma(v->v101 - v->v001, x, v->v001), p11 = k_fma(v->v111 - v->v011, x, v->v011);
    vfloat p0 = k_fma(p10 - p00, y, p00), p1 = k_fma(p11 - p01, y, p01);
    return k_fma(p1 - p0, z, p0);
}

__kernel K_WIDE void floor_picture(K_GLOBAL const uint *table, K_GLOBAL const short *bricks, int width, int height,
                                   K_GLOBAL float *out)
{
    vint x, y;
    vint valid = packet_pixels((uint)get_global_id(0), width, height, &x, &y);
    if (!v_any(valid))
        return;
    /* Each ray goes its own way through the table; neighbours mostly go together. */
    vint at = (x >> 3) + (y >> 3) * 64;
    vint brick = (vint)(0);
    for (int i = 0; i < KARST_FLOOR_READS; i++) {
        at = v_uint_to_int(v_gather_uint(table, at & (KARST_FLOOR_TABLE - 1)));
        brick = (at >> 8) & (KARST_FLOOR_BRICKS - 1);
    }
    brick *= KARST_BRICK_STRIDE;
    vfloat sum = (vfloat)(0.0f);
    vfloat px = v_to_float(x & 15) * 0.9f + 0.3f, py = v_to_float(y & 15) * 0.9f + 0.4f, pz = (vfloat)(0.7f);
    for (int i = 0; i < KARST_FLOOR_READS; i++) {
        vint cx = v_to_int(px), cy = v_to_int(py), cz = v_to_int(pz);
        corners v;
        load_corners(bricks, brick + sample_index(cx, cy, cz), &v);
        vfloat value = corners_at(&v, px - v_to_float(cx), py - v_to_float(cy), pz - v_to_float(cz));
        sum += value;
        /* The next sample's place waits for this one's value. */
        pz = lane_min(pz + k_fma(value, (vfloat)(1.0e-6f), (vfloat)(1.8f)), (vfloat)(15.9f));
    }
#if LANES == 16
#define STORE_(l) \
    if (valid.l)  \
    out[y.l * width + x.l] = sum.l
    STORE_(s0);
    STORE_(s1);
    STORE_(s2);
    STORE_(s3);
    STORE_(s4);
    STORE_(s5);
    STORE_(s6);
    STORE_(s7);
    STORE_(s8);
    STORE_(s9);
    STORE_(sa);
    STORE_(sb);
    STORE_(sc);
    STORE_(sd);
    STORE_(se);
    STORE_(sf);
#else
    out[y * width + x] = sum;
#endif
}
