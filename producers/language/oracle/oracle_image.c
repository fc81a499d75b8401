/* Images and fields in double, by the definition of B-splines: no code is shared with what devices run. */
#include "producers/language/oracle/oracle_internal.h"

#include <math.h>

/* The cubic B-spline of knots at whole numbers, or its derivative. */
static double spline(double x, bool is_slope)
{
    const double a = fabs(x), sign = x < 0 ? -1 : 1;
    if (a >= 2)
        return 0;
    if (a >= 1)
        return is_slope ? -sign * (2 - a) * (2 - a) / 2 : (2 - a) * (2 - a) * (2 - a) / 6;
    return is_slope ? sign * a * (1.5 * a - 2) : 2. / 3 - a * a + a * a * a / 2;
}

static int index_of(int64_t i, int size, bool repeats)
{
    if (!repeats)
        return i < 0 ? 0 : i >= size ? size - 1 : (int)i;
    return (int)((i % size + size) % size);
}

static int level_of(const karst_octave *octave, const karst_image_header *image, int level)
{
    const int last = (int)image->num_levels - 1;
    if (octave->frequency == KARST_OCTAVE_FADED)
        return last;
    int m = 0;
    while (level >= 0 && m < last && ldexp((double)octave->frequency, level - 56) > ldexp(1, m))
        m++;
    return m;
}

/* Where a place lies on a level: the cell, and how far into it, in so many parts of a cell. */
static int64_t cell_on(const karst_oracle_cell *at, int level, int parts, double *t)
{
    const int64_t whole = (int)at->cell;
    const double cell = ldexp((double)parts * ((double)whole + at->fraction), -level);
    *t = cell - floor(cell);
    return (int64_t)floor(cell);
}

/* The channel of a texture that an octave means: straight lines between roots. */
static double texture_value(const karst_octave *octave, const karst_image_header *image, int m,
                            const karst_oracle_cell at[3])
{
    const int channel = (int)octave->amplitude;
    const karst_texture_channel *code = (const karst_texture_channel *)(image + 1) + channel;
    const karst_image_level *l = &image->level[m];
    const uint *words = (const uint *)image + l->values;
    double t[2], root = 0;
    const int64_t column = cell_on(&at[0], m, 2, &t[0]), row = cell_on(&at[1], m, 2, &t[1]);
    for (int k = 0; k < 4; k++) {
        const int x = index_of(column + (k & 1), l->size[0], true), y = index_of(row + (k >> 1), l->size[1], true);
        const uint word = words[y * TEXTURE_ROW_WORDS(l->size[0]) + x];
        root += (k & 1 ? t[0] : 1 - t[0]) * (k >> 1 ? t[1] : 1 - t[1]) *
                (double)(word >> (TEXTURE_BITS * channel) & TEXTURE_MOST);
    }
    return (double)code->low + (double)code->step * root * root;
}

double karst_oracle_image(const karst_octave *octave, const karst_oracle_cell at[3], int level, int along)
{
    const karst_image_header *image = image_of(octave);
    if (along >= 0 && octave->frequency == KARST_OCTAVE_FADED)
        return 0;
    const int m = level_of(octave, image, level), num_axes = (int)image->num_axes;
    if (image->num_packed)
        return texture_value(octave, image, m, at);
    const karst_image_level *l = &image->level[m];
    const float *values = (const float *)image + l->values;
    double t[3], sum = 0;
    int64_t cell[3];
    for (int i = 0; i < num_axes; i++) {
        const int64_t whole = (int)at[i].cell;
        cell[i] = (int64_t)floor(ldexp((double)whole, -m));
        t[i] = ldexp((double)(whole - cell[i] * ((int64_t)1 << m)) + at[i].fraction, -m);
    }
    for (int z = num_axes > 2 ? -1 : 2; z <= 2; z++)
        for (int y = -1; y <= 2; y++)
            for (int x = -1; x <= 2; x++) {
                size_t plane = 0;
                double weight = spline(t[0] - x, along == 0) * spline(t[1] - y, along == 1);
                if (num_axes > 2) {
                    plane = (size_t)index_of(cell[2] + z, l->size[2], image->repeats);
                    weight *= spline(t[2] - z, along == 2);
                }
                const size_t row =
                    plane * (size_t)l->size[1] + (size_t)index_of(cell[1] + y, l->size[1], image->repeats);
                sum += weight *
                       (double)
                           values[row * (size_t)l->size[0] + (size_t)index_of(cell[0] + x, l->size[0], image->repeats)];
            }
    return along < 0 ? sum : sum / ldexp(1, m);
}
