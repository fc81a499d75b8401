/* From the splines of a file's channels to a texture: what they are at every half of a coordinate, packed. */
#include "producers/language/image/image.h"

#include <math.h>
#include <stdlib.h>

/* A spline's values at whole and half coordinates, from weights of the coefficients around. */
static const double whole_weights[4] = {1. / 6, 4. / 6, 1. / 6, 0},
                    half_weights[4] = {1. / 48, 23. / 48, 23. / 48, 1. / 48};

/* What the numbers of a channel stand for. */
typedef struct {
    double low, range;
} coding;

static uint32_t code_of(double value, coding c)
{
    const double share = c.range > 0 ? (value - c.low) / c.range : 0;
    return (uint32_t)lround(sqrt(fmin(fmax(share, 0), 1)) * TEXTURE_MOST);
}

/* Row `y`, counted in halves, of a level of a channel, added to the words; `line` has room for its coefficients. */
static void pack_row(const karst_samples_image *channel, uint32_t level, size_t y, coding c, uint32_t shift,
                     double *line, uint32_t *words)
{
    const karst_image_header *header = (const karst_image_header *)channel->words;
    const karst_image_level *l = &header->level[level];
    const float *values = (const float *)channel->words + l->values;
    const size_t width = (size_t)l->size[0], height = (size_t)l->size[1];
    const double *across = y % 2 ? half_weights : whole_weights;
    for (size_t x = 0; x < width; x++) {
        line[x] = 0;
        for (size_t k = 0; k < 4; k++)
            line[x] += across[k] * (double)values[((y / 2 + height - 1 + k) % height) * width + x];
    }
    for (size_t x = 0; x < 2 * width; x++) {
        const double *along = x % 2 ? half_weights : whole_weights;
        double value = 0;
        for (size_t k = 0; k < 4; k++)
            value += along[k] * line[(x / 2 + width - 1 + k) % width];
        words[x] |= code_of(value, c) << shift;
    }
    words[2 * width] = words[0];
}

/* Places everything; returns how many words of 32 bits that is. */
static size_t lay_out(karst_image_header *header, const karst_image_header *spline, uint32_t num_channels)
{
    size_t at = (sizeof *header + TEXTURE_MOST_CHANNELS * sizeof(karst_texture_channel)) / sizeof(uint32_t);
    *header =
        (karst_image_header){.num_levels = spline->num_levels, .repeats = 1, .num_axes = 2, .num_packed = num_channels};
    for (uint32_t i = 0; i < spline->num_levels; i++) {
        karst_image_level *l = &header->level[i];
        for (int axis = 0; axis < 2; axis++)
            l->size[axis] = 2 * spline->level[i].size[axis];
        l->size[2] = l->tiles[0] = l->tiles[1] = l->tiles[2] = 1;
        l->values = (uint)at;
        at += (size_t)TEXTURE_ROW_WORDS(l->size[0]) * (size_t)TEXTURE_ROW_WORDS(l->size[1]);
    }
    return at;
}

/* What is said of all channels. */
static void describe(karst_image_header *header, const karst_samples_image *channels)
{
    for (uint32_t c = 0; c < header->num_packed; c++) {
        const karst_image_header *spline = (const karst_image_header *)channels[c].words;
        header->low = c ? fminf(header->low, spline->low) : spline->low;
        header->high = c ? fmaxf(header->high, spline->high) : spline->high;
        for (int i = 0; i < 4; i += 2) {
            header->slope[i] = fminf(header->slope[i], spline->slope[i]);
            header->slope[i + 1] = fmaxf(header->slope[i + 1], spline->slope[i + 1]);
        }
    }
}

bool karst_samples_image_pack(karst_samples_image *texture, const karst_samples_image *channels, uint32_t num_channels,
                              karst_error *error)
{
    const karst_image_header *spline = (const karst_image_header *)channels[0].words;
    karst_image_header header;
    const size_t num_words = lay_out(&header, spline, num_channels);
    describe(&header, channels);
    *texture = (karst_samples_image){.num_words = (uint32_t)((num_words + 1) / 2),
                                     .num_axes = 2,
                                     .low = header.low,
                                     .high = header.high,
                                     .digest = 0x7465787475726573u};
    double *line = malloc((size_t)spline->level[0].size[0] * sizeof *line);
    texture->words = calloc(texture->num_words, sizeof *texture->words);
    if (!line || !texture->words) {
        free(line);
        karst_samples_image_finish(texture);
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    karst_image_header *to = (karst_image_header *)texture->words;
    karst_texture_channel *codes = (karst_texture_channel *)(to + 1);
    *to = header;
    for (uint32_t c = 0; c < num_channels; c++) {
        const coding code = {(double)channels[c].low, (double)channels[c].high - (double)channels[c].low};
        codes[c] = (karst_texture_channel){(float)code.low, (float)(code.range / (TEXTURE_MOST * TEXTURE_MOST))};
        for (uint32_t level = 0; level < header.num_levels; level++) {
            const karst_image_level *l = &header.level[level];
            for (size_t y = 0; y <= (size_t)l->size[1]; y++)
                pack_row(&channels[c], level, y, code, TEXTURE_BITS * c, line,
                         (uint32_t *)texture->words + l->values + y * (size_t)TEXTURE_ROW_WORDS(l->size[0]));
        }
        texture->digest = (texture->digest ^ channels[c].digest) * 0xff51afd7ed558ccdu;
        texture->digest ^= texture->digest >> 32;
    }
    for (int i = 0; i < 2; i++)
        texture->size[i] = texture->period[i] = channels[0].size[i];
    free(line);
    return true;
}
