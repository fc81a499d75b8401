/* Channels: what a brick holds for each of its samples. A scene names the ones that it uses; the others take no space,
 * no code and no time. Density is always the first. */
#ifndef KARST_PRODUCERS_CHANNELS_H
#define KARST_PRODUCERS_CHANNELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"

/* How a component lies in a brick slot. */
typedef enum {
    KARST_FORMAT_SCALED_I16, /* signed 16 bits times the brick's own scale */
    KARST_FORMAT_UNIT_U16    /* 16 bits for 0 to 1 */
} karst_channel_format;

typedef struct {
    const char *name; /* lower case; kernels know it as CHANNEL_<NAME>_... */
    karst_channel_format format;
    uint32_t components; /* 1 to 4, beside one another */
    /* Filled in by karst_channels_lay_out: */
    uint32_t staging_offset; /* first sample in a brick's staging memory, in floats; samples are `components` apart */
    uint32_t slot_offset;    /* first sample in a brick slot, in 16-bit words */
    uint32_t slot_stride;    /* from one sample to the next, in 16-bit words */
} karst_channel;

typedef struct {
    const karst_channel *channels; /* borrowed */
    size_t num_channels;
    uint32_t staging_stride; /* from one brick to the next, in floats: a multiple of 64 bytes */
    uint32_t slot_stride;    /* from one slot to the next, in 16-bit words: a multiple of 64 bytes */
} karst_channel_layout;

/* Places the channels one after another, each beginning on a multiple of 64 bytes, and says what a brick takes in all.
 * Errors: KARST_USAGE (components out of range). */
bool karst_channels_lay_out(karst_channel *channels, size_t num_channels, karst_channel_layout *layout,
                            karst_error *error);

/* The layout as build options for kernels: -DSTAGING_STRIDE, -DSLOT_STRIDE and, per channel, -DCHANNEL_<NAME>_STAGING,
 * _SLOT and _STRIDE. Returns the length as snprintf does. */
int karst_channels_options(const karst_channel_layout *layout, char *text, size_t size_bytes);

#endif
