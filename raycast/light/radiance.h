/* Radiance: the samples of a picture summed in linear light, metered, and toned into bytes. */
#ifndef KARST_RAYCAST_RADIANCE_H
#define KARST_RAYCAST_RADIANCE_H

#include "core/device/context.h"
#include "raycast/cast/cast_shared.h"
#include "raycast/light/radiance_shared.h"

typedef struct karst_radiance karst_radiance;

/* How light becomes bytes. */
typedef struct {
    uint32_t tone;  /* KARST_TONE_* */
    float exposure; /* a factor; 0: by the picture's median luminance */
    int x0_px, y0_px; /* where the picture begins in the whole that it is a window of: bytes are dithered as there */
} karst_radiance_look;

/* `sun`: samples come with what the sun adds, and with marks of where it is hidden; num_shares: 0; 1: with shares for
 * mirrored rays; 2: also with those for rays that pass land. Errors: KARST_FAILED. */
karst_radiance *karst_radiance_create(karst_context *context, bool sun, unsigned num_shares, karst_error *error);
void karst_radiance_destroy(karst_radiance *radiance); /* NULL is fine */
/* Room for pictures of so many pixels; what was summed is lost. Errors: KARST_FAILED. */
bool karst_radiance_set_room(karst_radiance *radiance, size_t num_pixels, karst_error *error);
/* What that takes, whether it fits or not. */
double karst_radiance_bytes(const karst_radiance *radiance, double num_pixels);
/* What karst_shade_pixels of a shader for radiance writes as depth, and as pixels (borrowed). */
karst_buffer *karst_radiance_parts(karst_radiance *radiance);
karst_buffer *karst_radiance_marks(karst_radiance *radiance);

/* Bytes of the mean of the first `num_summed` samples and, if `has_current`, of the one at hand, into pixels (RGBA8,
 * top row first). Asynchronous. Errors: KARST_FAILED. */
bool karst_radiance_show(karst_radiance *radiance, int width_px, int height_px, uint32_t num_summed, bool has_current,
                         const karst_radiance_look *look, cl_mem pixels, karst_error *error);
/* Adds the sample at hand to the first `num_summed` (0: it is the first). Asynchronous. Errors: KARST_FAILED. */
bool karst_radiance_add(karst_radiance *radiance, int width_px, int height_px, uint32_t num_summed,
                        karst_error *error);
/* The mean of the first `num_summed` (1 or more), and of the one at hand: three floats a pixel, top row first. Waits.
 * Errors: KARST_FAILED. */
bool karst_radiance_read(karst_radiance *radiance, int width_px, int height_px, uint32_t num_summed, float *rgb,
                         karst_error *error);
/* Sums from the host, laid out as karst_radiance_read gives them: what was summed is lost. Waits. Errors: KARST_FAILED.
 */
bool karst_radiance_load(karst_radiance *radiance, int width_px, int height_px, const float *rgb, karst_error *error);
/* Metering by parts: enters the luminances of sums that are one sample in the counts; and, from the counts of so many
 * pixels, the exposure, which leaves them zero. Nothing may be shown between. Asynchronous. Errors: KARST_FAILED. */
bool karst_radiance_count(karst_radiance *radiance, int width_px, int height_px, karst_error *error);
bool karst_radiance_expose(karst_radiance *radiance, uint32_t num_pixels, karst_error *error);
/* The exposure that was metered last. Waits. Errors: KARST_FAILED. */
bool karst_radiance_read_exposure(karst_radiance *radiance, float *exposure, karst_error *error);

#endif
