/* Entry points of painting what the engine knows. See raycast/light/views.h. Nobody waits for these: they are plain. */
#include "raycast/light/surface.clh"
#include "raycast/views_shared.h"

#define LINE_CELLS 0.75f   /* half the width of a brick's border, where cells are about as wide as pixels */
#define FADE_FRAMES 240.0f /* in which a brick's brightness falls to a third */
#define MANY_BOUNCES 6.0f   /* that are bright */
#define BUSY_STEPS 240.0f  /* that are bright */

typedef struct {
    vfloat r, g, b;
} paint;

RAY_INLINE paint plain(float r, float g, float b)
{
    paint p = {(vfloat)(r), (vfloat)(g), (vfloat)(b)};
    return p;
}

RAY_INLINE paint mix_paint(paint a, paint b, vfloat share)
{
    paint p = {k_fma(b.r - a.r, share, a.r), k_fma(b.g - a.g, share, a.g), k_fma(b.b - a.b, share, a.b)};
    return p;
}

RAY_INLINE paint scale_paint(paint a, vfloat scale)
{
    paint p = {a.r * scale, a.g * scale, a.b * scale};
    return p;
}

/* A wave between 0 and 1 of period 1. */
RAY_INLINE vfloat wave(vfloat x)
{
    vfloat part = x - k_floor(x);
    return k_fabs(part * 2.0f - 1.0f);
}

/* Neighbouring levels differ as much as colours can: a golden section of the circle apart. */
RAY_INLINE paint level_paint(vint level)
{
    vfloat hue = v_to_float(level) * 0.61803399f;
    paint p = {k_fma(wave(hue), (vfloat)(0.72f), (vfloat)(0.24f)),
               k_fma(wave(hue + 0.3333333f), (vfloat)(0.72f), (vfloat)(0.24f)),
               k_fma(wave(hue + 0.6666667f), (vfloat)(0.72f), (vfloat)(0.24f))};
    return p;
}

/* Dark, violet, orange, pale: rises in brightness all the way. */
RAY_INLINE paint heat_paint(vfloat share)
{
    vfloat s = lane_unit(share);
    paint low = mix_paint(plain(0.03f, 0.03f, 0.10f), plain(0.50f, 0.13f, 0.50f), lane_unit(s * 3.0f));
    paint middle = mix_paint(low, plain(0.97f, 0.50f, 0.20f), lane_unit(s * 3.0f - 1.0f));
    return mix_paint(middle, plain(1.0f, 0.97f, 0.75f), lane_unit(s * 3.0f - 2.0f));
}

/* log2 of what is at least 1, with straight pieces between the powers of two. */
RAY_INLINE vfloat rough_log2(vfloat x) { return (v_to_float(v_as_int(x)) - 1065353216.0f) * (1.0f / 8388608.0f); }

RAY_INLINE vint to_byte(vfloat value) { return v_to_int(lane_unit(value) * 255.0f + 0.5f); }

#if LANES == 16
#define EACH_PAINTED_LANE(DO) \
    DO(s0) DO(s1) DO(s2) DO(s3) DO(s4) DO(s5) DO(s6) DO(s7) DO(s8) DO(s9) DO(sa) DO(sb) DO(sc) DO(sd) DO(se) DO(sf)
#define STORE_PIXEL(l) \
    if (valid.l)       \
        pixels[at.l] = (uint)bytes.l;
#define STORE_NORMAL(l)                       \
    if (valid.l) {                            \
        normals[(size_t)at.l * 3] = nx.l;     \
        normals[(size_t)at.l * 3 + 1] = ny.l; \
        normals[(size_t)at.l * 3 + 2] = nz.l; \
    }
#else
#define EACH_PAINTED_LANE(DO) DO(s)
#define STORE_PIXEL(l) \
    if (valid)         \
        pixels[at] = (uint)bytes;
#define STORE_NORMAL(l)                   \
    if (valid) {                          \
        normals[(size_t)at * 3] = nx;     \
        normals[(size_t)at * 3 + 1] = ny; \
        normals[(size_t)at * 3 + 2] = nz; \
    }
#endif

__kernel K_WIDE void views_paint(karst_pinhole pinhole, K_GLOBAL const karst_hit *hits, K_GLOBAL const uint *born,
                                 uint frame, int what, K_GLOBAL uint *pixels)
{
    vint x, y;
    vint valid = packet_pixels((uint)get_global_id(0), pinhole.width_px, pinhole.height_px, &x, &y);
    if (!v_any(valid))
        return;
    vector3 direction = pinhole_direction(&pinhole, x, y);
    vint place = v_select(valid, packet_order(x, y, pinhole.width_px, pinhole.height_px), (vint)(0));
    surface_hits s = load_surface(hits, place, valid, &direction, 0.0f, 0.0f);
    vint at = v_select(valid, y * pinhole.width_px + x, (vint)(0));
    vint hit = v_ne(s.kind, (vint)((int)KARST_HIT_MISS));
    vint record = place * (int)(sizeof(karst_hit) / sizeof(int));
    vint slot = v_select(hit, v_gather_int((K_GLOBAL const int *)hits, record + 2), (vint)(0));
    /* Shape without the world's colours and sun: light from above, a little from the side. */
    vfloat facing = k_fma(s.normal.x, (vfloat)(0.35f), k_fma(s.normal.y, (vfloat)(0.85f), s.normal.z * 0.39f));
    vfloat form = k_fma(lane_max(facing, (vfloat)(0.0f)), (vfloat)(0.65f), (vfloat)(0.35f));
    paint sky = plain(0.07f, 0.08f, 0.10f), grey = scale_paint(plain(0.62f, 0.64f, 0.68f), form), colour = sky;

    if (what == KARST_PAINT_LEVEL) {
        colour = scale_paint(level_paint(s.level), form);
    } else if (what == KARST_PAINT_BRICKS) {
        vint in_brick = v_gather_int((K_GLOBAL const int *)hits, record + 3), edge = (vint)(0);
        for (int axis = 0; axis < 3; axis++) {
            vfloat c = v_to_float(in_brick >> 10 * axis & 1023) * (1.0f / 64.0f);
            edge |= v_lt(lane_min(c, KARST_BRICK_CELLS - c), (vfloat)(LINE_CELLS));
        }
        vint below = v_gather_int((K_GLOBAL const int *)pixels, at);
        paint picture = {v_to_float(below & 255) * (1.0f / 255.0f), v_to_float(below >> 8 & 255) * (1.0f / 255.0f),
                         v_to_float(below >> 16 & 255) * (1.0f / 255.0f)};
        vint lined = edge & hit & v_ne(slot, (vint)(0));
        colour = mix_paint(picture, level_paint(s.level), v_select(lined, (vfloat)(0.85f), (vfloat)(0.0f)));
        hit = valid; /* the sky stays as it is */
    } else if (what == KARST_PAINT_STEPS) {
        vint steps = v_uint_to_int(v_int_to_uint(s.word) >> KARST_STEPS_SHIFT);
        colour = heat_paint(v_to_float(steps) * (1.0f / BUSY_STEPS));
        hit = valid; /* rays into the sky work too */
    } else if (what == KARST_PAINT_AGE || what == KARST_PAINT_PRODUCED) {
        vint made = v_gather_int((K_GLOBAL const int *)born, slot);
        vint known = hit & v_ne(made, (vint)(0)) & v_ne(slot, (vint)(0));
        vfloat age = v_select(known, v_to_float((vint)((int)frame) - made), (vfloat)(1.0e9f));
        if (what == KARST_PAINT_AGE)
            colour = scale_paint(heat_paint(FADE_FRAMES * 0.5f / (age + FADE_FRAMES * 0.5f)), form);
        else
            colour = mix_paint(grey, scale_paint(plain(0.35f, 0.95f, 0.45f), form),
                               v_select(v_lt(age, (vfloat)(0.5f)), (vfloat)(1.0f), (vfloat)(0.0f)));
    } else if (what == KARST_PAINT_PROVISIONAL) {
        vint standing_in = v_eq(s.kind, (vint)((int)KARST_HIT_PROVISIONAL));
        colour = mix_paint(grey, scale_paint(plain(1.0f, 0.40f, 0.32f), form),
                           v_select(standing_in, (vfloat)(1.0f), (vfloat)(0.0f)));
    } else if (what == KARST_PAINT_DEPTH) {
        vfloat share = rough_log2(1.0f + lane_max(s.t, (vfloat)(0.0f))) / rough_log2((vfloat)(1.0f + pinhole.t_max));
        vfloat bright = lane_unit(1.0f - share);
        colour.r = colour.g = colour.b = k_fma(bright * bright, (vfloat)(0.9f), (vfloat)(0.1f));
    } else {
        colour.r = k_fma(s.normal.x, (vfloat)(0.5f), (vfloat)(0.5f));
        colour.g = k_fma(s.normal.y, (vfloat)(0.5f), (vfloat)(0.5f));
        colour.b = k_fma(s.normal.z, (vfloat)(0.5f), (vfloat)(0.5f));
    }
    colour.r = v_select(hit, colour.r, sky.r);
    colour.g = v_select(hit, colour.g, sky.g);
    colour.b = v_select(hit, colour.b, sky.b);
    vint bytes = to_byte(colour.r) | to_byte(colour.g) << 8 | to_byte(colour.b) << 16 | (int)0xff000000;
    EACH_PAINTED_LANE(STORE_PIXEL)
}

__kernel K_WIDE void views_normals(karst_pinhole pinhole, K_GLOBAL const karst_hit *hits, K_GLOBAL float *normals)
{
    vint x, y;
    vint valid = packet_pixels((uint)get_global_id(0), pinhole.width_px, pinhole.height_px, &x, &y);
    if (!v_any(valid))
        return;
    vector3 direction = pinhole_direction(&pinhole, x, y);
    vint place = v_select(valid, packet_order(x, y, pinhole.width_px, pinhole.height_px), (vint)(0));
    surface_hits s = load_surface(hits, place, valid, &direction, 0.0f, 0.0f);
    vint at = v_select(valid, y * pinhole.width_px + x, (vint)(0));
    vint hit = v_ne(s.kind, (vint)((int)KARST_HIT_MISS));
    const vfloat zero = (vfloat)(0.0f);
    vfloat nx = v_select(hit, s.normal.x, zero), ny = v_select(hit, s.normal.y, zero),
           nz = v_select(hit, s.normal.z, zero);
    EACH_PAINTED_LANE(STORE_NORMAL)
}

/* Slots of a round's loads: born with `frame`. */
__kernel void views_note(K_GLOBAL const uint *slots, uint num_slots, uint frame, K_GLOBAL uint *born)
{
    uint i = (uint)get_global_id(0);
    if (i < num_slots)
        born[slots[i]] = frame;
}

/* What the engine knows as numbers in packet order: an albedo in three planes, openness in one, counts of bounces. */
__kernel K_WIDE void views_paint_values(karst_pinhole pinhole, K_GLOBAL const karst_hit *hits,
                                        K_GLOBAL const float *values, int what, K_GLOBAL uint *pixels)
{
    vint x, y;
    const vint valid = packet_pixels((uint)get_global_id(0), pinhole.width_px, pinhole.height_px, &x, &y);
    if (!v_any(valid))
        return;
    const vector3 direction = pinhole_direction(&pinhole, x, y);
    const vint place = v_select(valid, packet_order(x, y, pinhole.width_px, pinhole.height_px), (vint)(0));
    const surface_hits s = load_surface(hits, place, valid, &direction, 0.0f, 0.0f);
    const vint at = v_select(valid, y * pinhole.width_px + x, (vint)(0));
    const vint hit = v_ne(s.kind, (vint)((int)KARST_HIT_MISS));
    const size_t plane = (size_t)pinhole.width_px * (size_t)pinhole.height_px;
    const paint sky = plain(0.07f, 0.08f, 0.10f);
    const vfloat first = v_gather_float(values, place);
    paint colour;
    if (what == KARST_PAINT_BOUNCES) {
        colour = heat_paint(v_to_float(v_as_int(first)) * (1.0f / MANY_BOUNCES));
    } else { /* square roots: about as bright as the light would be */
        colour.r = colour.g = colour.b = k_sqrt(lane_unit(first));
        if (what == KARST_PAINT_ALBEDO) {
            colour.g = k_sqrt(lane_unit(v_gather_float(values + plane, place)));
            colour.b = k_sqrt(lane_unit(v_gather_float(values + 2 * plane, place)));
        }
        colour.r = v_select(hit, colour.r, sky.r);
        colour.g = v_select(hit, colour.g, sky.g);
        colour.b = v_select(hit, colour.b, sky.b);
    }
    const vint bytes = to_byte(colour.r) | to_byte(colour.g) << 8 | to_byte(colour.b) << 16 | (int)0xff000000;
    EACH_PAINTED_LANE(STORE_PIXEL)
}

/* Rays of a stream: their pixels are followed once more. */
__kernel void views_count(K_GLOBAL const karst_ray *rays, K_GLOBAL const uint *count, uint max_rays, int width_px,
                          int height_px, K_GLOBAL uint *bounces)
{
    const uint i = (uint)get_global_id(0);
    if (i >= max_rays || i >= count[0] || rays[i].t_max <= rays[i].t_min)
        return;
    const int x = (int)(rays[i].pixel & 0xffffu), y = (int)(rays[i].pixel >> 16 & 0x3fffu);
    if (x < width_px && y < height_px)
        atomic_add(&bounces[karst_packet_order((uint)x, (uint)y, (uint)width_px, (uint)height_px)], 1u);
}
