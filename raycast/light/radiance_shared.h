/* Radiance of a picture, summed over samples, on its way to bytes. Compiled twice: see core/device/dialect.h.
 *
 * Sums, and the parts that shading makes of a sample, are linear floats, plane by plane in packet order
 * (karst_packet_order): of a sum red, green and blue; of a sample these without the sun, then what the sun adds where
 * nothing hides it. Marks are in pixel order: not 0 where something does. */
#ifndef KARST_RAYCAST_RADIANCE_SHARED_H
#define KARST_RAYCAST_RADIANCE_SHARED_H

#include "core/device/dialect.h"

#define KARST_RADIANCE_PLANES 3
/* Of a sample whose surfaces mirror: the share of what its mirrored ray sees that reaches the pixel. */
#define KARST_RADIANCE_MIRROR_PLANE 6
/* And whose surfaces let light pass: the share of what lies straight behind that does. */
#define KARST_RADIANCE_PASS_PLANE 7

#define KARST_TONE_PLAIN 0u  /* each channel by its own curve: raycast/light/tone.clh */
#define KARST_TONE_FILMIC 1u /* raycast/light/film.clh */

/* Luminances are counted in shares of an octave, from 2^-12 to 2^12: a float's exponent and the first bits after it. */
#define KARST_METER_BINS 384
#define KARST_METER_SHIFT 19 /* sixteen bins an octave */
#define KARST_METER_FIRST ((127 - 12) << 4)

typedef struct {
    int width_px, height_px;
    uint has_sun;     /* parts have the sun's planes, and there are marks */
    uint num_summed;  /* samples in the sums */
    uint has_current; /* the parts are one sample more */
    uint tone;        /* KARST_TONE_* */
    uint num_items;   /* work-items that share the picture */
    float exposure;   /* a factor; 0: the metered one */
    int x0_px, y0_px; /* where the picture begins in the whole that it is a window of */
} karst_radiance_task;
K_ASSERT_SIZE(karst_radiance_task, 40);

#endif
