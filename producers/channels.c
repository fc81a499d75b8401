#include "producers/channels.h"

#include <ctype.h>
#include <stdio.h>

#include "cache/layout_shared.h"

#define ALIGNMENT_BYTES 64

static uint32_t align(uint32_t count, uint32_t element_bytes)
{
    uint32_t step = ALIGNMENT_BYTES / element_bytes;
    return (count + step - 1) / step * step;
}

bool karst_channels_lay_out(karst_channel *channels, size_t num_channels, karst_channel_layout *layout,
                            karst_error *error)
{
    *layout = (karst_channel_layout){.channels = channels, .num_channels = num_channels};
    for (size_t i = 0; i < num_channels; i++) {
        karst_channel *channel = channels + i;
        if (channel->components < 1 || channel->components > 4)
            return karst_fail(error, KARST_USAGE, "channel '%s' has %u components: 1 to 4 fit", channel->name,
                              channel->components);
        channel->staging_offset = layout->staging_stride;
        channel->slot_offset = layout->slot_stride;
        channel->slot_stride = channel->components;
        layout->staging_stride =
            align(channel->staging_offset + KARST_BRICK_SAMPLES * channel->components, sizeof(float));
        layout->slot_stride = align(channel->slot_offset + KARST_BRICK_SAMPLES * channel->components, sizeof(int16_t));
    }
    return true;
}

int karst_channels_options(const karst_channel_layout *layout, char *text, size_t size_bytes)
{
    size_t length = 0;
    for (size_t i = 0; i <= layout->num_channels; i++) {
        char *at = length < size_bytes ? text + length : NULL;
        size_t space = at ? size_bytes - length : 0;
        if (i == layout->num_channels) {
            length += (size_t)snprintf(at, space, "-DSTAGING_STRIDE=%u -DSLOT_STRIDE=%u", layout->staging_stride,
                                       layout->slot_stride);
            break;
        }
        const karst_channel *channel = layout->channels + i;
        char name[32];
        size_t n = 0;
        for (; channel->name[n] && n + 1 < sizeof name; n++)
            name[n] = (char)toupper((unsigned char)channel->name[n]);
        name[n] = 0;
        length +=
            (size_t)snprintf(at, space, "-DCHANNEL_%s_STAGING=%u -DCHANNEL_%s_SLOT=%u -DCHANNEL_%s_STRIDE=%u ", name,
                             channel->staging_offset, name, channel->slot_offset, name, channel->slot_stride);
    }
    return (int)length;
}
