/* Entry points of radiance: summing samples, metering a picture, and its tone. See raycast/light/radiance.h. */
#include "raycast/light/film.clh"
#include "raycast/light/radiance_shared.h"
#include "raycast/cast/rays.clh"

/* The middle of a picture that needs no other exposure: what most shipped worlds have at noon. */
#define TYPICAL_LUMINANCE 0.3f
#define MOST_EXPOSURE 4.0f /* and the least is its inverse */

#define RADIANCE_PARAMETERS                                                                          \
    karst_radiance_task task, K_GLOBAL float *sums, K_GLOBAL const float *parts, K_GLOBAL const uint *marks
#define PLANE ((size_t)task->width_px * (size_t)task->height_px)

/* The sample at hand. */
RAY_INLINE colour load_sample(const karst_radiance_task *task, K_GLOBAL const float *parts, K_GLOBAL const uint *marks,
                              vint x, vint y, vint order, vint valid)
{
    colour c = {load_ordered(parts, order, valid), load_ordered(parts + PLANE, order, valid),
                load_ordered(parts + 2 * PLANE, order, valid)};
    if (task->has_sun) {
        const vint at = v_select(valid, y * task->width_px + x, (vint)(0));
        const vint lit = v_eq(v_gather_int((K_GLOBAL const int *)marks, at), (vint)(0));
        const vfloat none = (vfloat)(0.0f);
        c.r += v_select(lit, load_ordered(parts + 3 * PLANE, order, valid), none);
        c.g += v_select(lit, load_ordered(parts + 4 * PLANE, order, valid), none);
        c.b += v_select(lit, load_ordered(parts + 5 * PLANE, order, valid), none);
    }
    return c;
}

/* The mean of all samples so far. */
RAY_INLINE colour load_mean(const karst_radiance_task *task, K_GLOBAL const float *sums, K_GLOBAL const float *parts,
                            K_GLOBAL const uint *marks, vint x, vint y, vint order, vint valid)
{
    colour c = {(vfloat)(0.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
    if (task->num_summed) {
        c.r = load_ordered(sums, order, valid);
        c.g = load_ordered(sums + PLANE, order, valid);
        c.b = load_ordered(sums + 2 * PLANE, order, valid);
    }
    if (task->has_current) {
        const colour sample = load_sample(task, parts, marks, x, y, order, valid);
        c.r += sample.r, c.g += sample.g, c.b += sample.b;
    }
    const uint num = task->num_summed + task->has_current;
    if (num > 1) {
        const vfloat share = (vfloat)(1.0f / (float)num);
        c.r *= share, c.g *= share, c.b *= share;
    }
    return c;
}

/* Adds the sample at hand to the sums. */
__kernel K_WIDE void radiance_add(RADIANCE_PARAMETERS)
{
    const karst_radiance_task *of = &task;
    vint x, y;
    const vint valid = packet_pixels((uint)get_global_id(0), of->width_px, of->height_px, &x, &y);
    if (!v_any(valid))
        return;
    const vint order = packet_order(x, y, of->width_px, of->height_px);
    const size_t plane = (size_t)of->width_px * (size_t)of->height_px;
    colour c = load_sample(of, parts, marks, x, y, order, valid);
    if (of->num_summed) {
        c.r += load_ordered(sums, order, valid);
        c.g += load_ordered(sums + plane, order, valid);
        c.b += load_ordered(sums + 2 * plane, order, valid);
    }
    store_ordered(sums, order, valid, c.r);
    store_ordered(sums + plane, order, valid, c.g);
    store_ordered(sums + 2 * plane, order, valid, c.b);
}

/* Counts the picture's luminances: each work-item a share of the packets, so that sums are of integers. */
__kernel K_WIDE void radiance_meter(RADIANCE_PARAMETERS, K_GLOBAL uint *bins)
{
    uint own[KARST_METER_BINS];
    for (int i = 0; i < KARST_METER_BINS; i++)
        own[i] = 0;
    const uint groups = (((uint)task.width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE) *
                        (((uint)task.height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE);
    const uint num = groups * KARST_GROUP_PACKETS * (KARST_PACKET_RAYS / LANES), item = (uint)get_global_id(0);
    if (item >= task.num_items)
        return;
    for (uint id = item; id < num; id += task.num_items) {
        vint x, y;
        const vint valid = packet_pixels(id, task.width_px, task.height_px, &x, &y);
        if (!v_any(valid))
            continue;
        const vint order = packet_order(x, y, task.width_px, task.height_px);
        const colour c = load_mean(&task, sums, parts, marks, x, y, order, valid);
        const vfloat luminance = k_fma(c.r, (vfloat)(0.2126f), k_fma(c.g, (vfloat)(0.7152f), c.b * 0.0722f));
        vint bin = (v_as_int(lane_max(luminance, (vfloat)(0.0f))) >> KARST_METER_SHIFT) - KARST_METER_FIRST;
        bin = lane_min_int(lane_max_int(bin, (vint)(0)), (vint)(KARST_METER_BINS - 1));
        bin = v_select(valid, bin, (vint)(-1));
        int bin_of[LANES];
        v_store_int(bin, bin_of);
        for (int lane = 0; lane < LANES; lane++)
            if (bin_of[lane] >= 0)
                own[bin_of[lane]]++;
    }
    for (int i = 0; i < KARST_METER_BINS; i++)
        if (own[i])
            atomic_add(&bins[i], own[i]);
}

/* From the counts to a factor, half of what would bring the picture's median where it typically is: night stays
 * darker than day. What is black, as space is, does not count. Leaves the counts zero. One work-item. */
__kernel void radiance_expose(K_GLOBAL uint *bins, uint num_pixels, K_GLOBAL float *exposure)
{
    uint below = 0, half_of = (num_pixels - bins[0]) / 2;
    float median = 0.0f;
    bins[0] = 0;
    for (int i = 1; i < KARST_METER_BINS; i++) {
        const uint here = bins[i];
        if (below <= half_of && half_of < below + here) {
            /* evenly within the bin, so that nothing leaps as the view moves */
            const float low = k_as_float((uint)(i + KARST_METER_FIRST) << KARST_METER_SHIFT),
                        high = k_as_float((uint)(i + 1 + KARST_METER_FIRST) << KARST_METER_SHIFT);
            median = k_fma((high - low) / (float)here, (float)(half_of - below) + 0.5f, low);
        }
        below += here;
        bins[i] = 0;
    }
    const float factor = k_sqrt(TYPICAL_LUMINANCE / k_max(median, 1.0e-6f));
    *exposure = k_min(k_max(factor, 1.0f / MOST_EXPOSURE), MOST_EXPOSURE);
}

#if LANES == 16
#define STORE_PIXEL_(l) \
    if (valid.l)        \
        pixels[index.l] = (uint)bytes.l;
#define STORE_PIXELS EACH_LANE(STORE_PIXEL_)
#else
#define STORE_PIXELS \
    if (valid)       \
        pixels[index] = (uint)bytes;
#endif

__kernel K_WIDE void radiance_tone(RADIANCE_PARAMETERS, K_GLOBAL const float *metered, K_GLOBAL uint *pixels)
{
    vint x, y;
    const vint valid = packet_pixels((uint)get_global_id(0), task.width_px, task.height_px, &x, &y);
    if (!v_any(valid))
        return;
    const vint order = packet_order(x, y, task.width_px, task.height_px);
    colour c = load_mean(&task, sums, parts, marks, x, y, order, valid);
    const float exposure = task.exposure > 0.0f ? task.exposure : *metered;
    c.r *= exposure, c.g *= exposure, c.b *= exposure;
    const vfloat dither = tone_dither(x + task.x0_px, y + task.y0_px);
    vint bytes;
    if (task.tone == KARST_TONE_FILMIC) {
        c = film_tone(c);
        bytes = film_byte(c.r, dither) | film_byte(c.g, dither) << 8 | film_byte(c.b, dither) << 16;
    } else {
        bytes = tone_byte(c.r, dither) | tone_byte(c.g, dither) << 8 | tone_byte(c.b, dither) << 16;
    }
    bytes |= (int)0xff000000;
    const vint index = y * task.width_px + x;
    STORE_PIXELS
}
