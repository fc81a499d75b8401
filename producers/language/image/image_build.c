/* From samples to the coefficients of a spline, a pyramid of them, and bounds of it by tiles. */
#include "producers/language/image/image.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    karst_image_header *header;
    float *floats; /* the header's beginning */
} builder;

/* ---- coefficients ---- */

/* Factors of the spline's recursive filter. Beyond this many samples nothing is left of one. */
#define POLE (-0.26794919243112270647)
#define REACH 32

/* Where sample i of a line lies: beyond its ends the line repeats, or stays. */
static size_t inside(long i, size_t count, bool repeats)
{
    if (!repeats)
        return i < 0 ? 0 : (size_t)i >= count ? count - 1 : (size_t)i;
    long rest = i % (long)count;
    return (size_t)(rest < 0 ? rest + (long)count : rest);
}

/* Line of values to coefficients whose spline goes through them: (c[i-1] + 4 c[i] + c[i+1]) / 6 is value i. What lies
 * beyond an end that stays is c of that end; two passes of a filter, there solved as a system of three diagonals. */
static void filter_line(double *line, double *work, size_t count, bool repeats)
{
    if (count < 2)
        return;
    if (!repeats) {
        double divisor = 5;
        line[0] = line[0] * 6 / divisor;
        for (size_t i = 1; i < count; i++) {
            work[i] = 1 / divisor;
            divisor = (i + 1 == count ? 5 : 4) - work[i];
            line[i] = (line[i] * 6 - line[i - 1]) / divisor;
        }
        for (size_t i = count - 1; i-- > 0;)
            line[i] -= work[i + 1] * line[i + 1];
        return;
    }
    double sum = 0;
    for (int k = REACH; k >= 0; k--)
        sum = line[inside(-k, count, true)] + POLE * sum;
    work[0] = sum;
    for (size_t i = 1; i < count; i++)
        work[i] = line[i] + POLE * work[i - 1];
    sum = 0;
    for (int k = REACH; k >= 0; k--)
        sum = POLE * (sum - work[inside((long)count - 1 + k, count, true)]);
    line[count - 1] = 6 * sum;
    for (size_t i = count - 1; i-- > 0;)
        line[i] = 6 * (sum = POLE * (sum - work[i]));
}

/* The value of a line's spline at a place. */
static double value_at(const double *coefficients, size_t count, double at)
{
    const double whole = floor(at), t = at - whole, s = 1 - t;
    const double w[4] = {s * s * s / 6, 2. / 3 + t * t * (t / 2 - 1), 2. / 3 + s * s * (s / 2 - 1), t * t * t / 6};
    double sum = 0;
    for (int k = 0; k < 4; k++)
        sum += w[k] * coefficients[inside((long)whole + k - 1, count, true)];
    return sum;
}

/* A line of `from` samples, mirrored and made `to` long where that is asked for, filtered. The middles of cells stay
 * middles. */
static void make_line(double *line, double *work, size_t from, size_t to, karst_wrap wrap)
{
    if (wrap == KARST_WRAP_MIRROR)
        for (size_t i = 0; i < from; i++)
            line[2 * from - 1 - i] = line[i];
    const size_t count = wrap == KARST_WRAP_MIRROR ? 2 * from : from;
    filter_line(line, work, count, wrap != KARST_WRAP_CLAMP);
    if (count == to)
        return;
    for (size_t i = 0; i < to; i++)
        work[i] = value_at(line, count, ((double)i + 0.5) * (double)count / (double)to - 0.5);
    memcpy(line, work, to * sizeof *line);
    filter_line(line, work, to, true);
}

static size_t length_of(size_t count, karst_wrap wrap)
{
    size_t power = 1, wanted = wrap == KARST_WRAP_MIRROR ? 2 * count : count;
    while (power < wanted)
        power *= 2;
    return wrap == KARST_WRAP_CLAMP ? count : power;
}

/* Rows first, into the first level, then its columns. */
static bool make_coefficients(const builder *b, const float *samples, uint32_t width, uint32_t height, uint32_t stride,
                              karst_wrap wrap)
{
    const size_t columns = (size_t)b->header->level[0].size[0], rows = (size_t)b->header->level[0].size[1];
    const size_t longest = 2 * (columns > rows ? columns : rows) + 2 * (size_t)(width > height ? width : height);
    double *line = malloc(2 * longest * sizeof *line), *work = line ? line + longest : NULL;
    float *to = b->floats + b->header->level[0].values;
    if (!line)
        return false;
    for (size_t y = 0; y < height; y++) {
        for (size_t x = 0; x < width; x++)
            line[x] = (double)samples[(y * width + x) * stride];
        make_line(line, work, width, columns, wrap);
        for (size_t x = 0; x < columns; x++)
            to[y * columns + x] = (float)line[x];
    }
    for (size_t x = 0; x < columns; x++) {
        for (size_t y = 0; y < height; y++)
            line[y] = (double)to[y * columns + x];
        make_line(line, work, height, rows, wrap);
        for (size_t y = 0; y < rows; y++)
            to[y * columns + x] = (float)line[y];
    }
    free(line);
    return true;
}

/* ---- levels ---- */

/* Coefficient (x, y) of a level, beyond its edges, too. */
static double coefficient(const builder *b, uint32_t level, long x, long y)
{
    const karst_image_level *l = &b->header->level[level];
    const bool repeats = b->header->repeats;
    return (double)b->floats[l->values + inside(y, (size_t)l->size[1], repeats) * (size_t)l->size[0] +
                             inside(x, (size_t)l->size[0], repeats)];
}

static void make_level(const builder *b, uint32_t level)
{
    const karst_image_level *l = &b->header->level[level];
    static const double weight[3] = {0.25, 0.5, 0.25};
    for (long y = 0; y < l->size[1]; y++)
        for (long x = 0; x < l->size[0]; x++) {
            double sum = 0;
            for (int j = 0; j < 3; j++)
                for (int i = 0; i < 3; i++)
                    sum += weight[i] * weight[j] * coefficient(b, level - 1, 2 * x + i - 1, 2 * y + j - 1);
            b->floats[l->values + (size_t)(y * l->size[0] + x)] = (float)sum;
        }
}

/* ---- tiles ---- */

static float *tile_of(const builder *b, uint32_t level, long x, long y)
{
    const karst_image_level *l = &b->header->level[level];
    const bool repeats = b->header->repeats;
    const long margin = repeats ? 0 : 1;
    return b->floats + l->bounds +
           (inside(y + margin, (size_t)l->tiles[1], repeats) * (size_t)l->tiles[0] +
            inside(x + margin, (size_t)l->tiles[0], repeats)) *
               IMAGE_TILE_FLOATS;
}

static float below(double value)
{
    float f = (float)value;
    return (double)f > value ? nextafterf(f, -INFINITY) : f;
}
static float above(double value)
{
    float f = (float)value;
    return (double)f < value ? nextafterf(f, INFINITY) : f;
}

static void widen(float *low, float *high, double value)
{
    *low = fminf(*low, below(value));
    *high = fmaxf(*high, above(value));
}

/* Coefficient (x, y) of a level's spline as one of the level before, whose cells are half as wide. */
static double refined(const builder *b, uint32_t level, long x, long y)
{
    static const double even[3] = {0.125, 0.75, 0.125}, odd[3] = {0.5, 0.5, 0};
    const double *u = x & 1 ? odd : even, *v = y & 1 ? odd : even;
    const long left = (x >> 1) - (x & 1 ? 0 : 1), top = (y >> 1) - (y & 1 ? 0 : 1);
    double sum = 0;
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++)
            if (u[i] * v[j] != 0)
                sum += u[i] * v[j] * coefficient(b, level, left + i, top + j);
    return sum;
}

/* How far a level's spline may lie from that of the level before, over the first one's tile: both are splines of the
 * finer coefficients, and so is their difference, which is no larger than its largest coefficient. */
static double change_of(const builder *b, uint32_t level, long x, long y)
{
    double most = 0;
    for (long j = -1; j < 10; j++)
        for (long i = -1; i < 10; i++)
            most = fmax(
                most, fabs(coefficient(b, level - 1, 8 * x + i, 8 * y + j) - refined(b, level, 8 * x + i, 8 * y + j)));
    return most;
}

static void add_tile(float *record, const float *part)
{
    for (int i = 0; i < IMAGE_TILE_DETAIL; i += 2) {
        record[i] = fminf(record[i], part[i]);
        record[i + 1] = fmaxf(record[i + 1], part[i + 1]);
    }
    record[IMAGE_TILE_DETAIL] = fmaxf(record[IMAGE_TILE_DETAIL], part[IMAGE_TILE_DETAIL]);
}

/* Of its own level by the coefficients around its cells; of those before by their tiles. */
static void make_tile(const builder *b, uint32_t level, long x, long y)
{
    float record[IMAGE_TILE_FLOATS] = {INFINITY, -INFINITY, INFINITY, -INFINITY, INFINITY, -INFINITY};
    const double per_cell = ldexp(1, -(int)level);
    for (long j = -1; j < 6; j++)
        for (long i = -1; i < 6; i++) {
            double c = coefficient(b, level, 4 * x + i, 4 * y + j);
            widen(&record[IMAGE_TILE_LOW], &record[IMAGE_TILE_HIGH], c);
            if (i < 5)
                widen(&record[IMAGE_TILE_SLOPE], &record[IMAGE_TILE_SLOPE + 1],
                      (coefficient(b, level, 4 * x + i + 1, 4 * y + j) - c) * per_cell);
            if (j < 5)
                widen(&record[IMAGE_TILE_SLOPE + 2], &record[IMAGE_TILE_SLOPE + 3],
                      (coefficient(b, level, 4 * x + i, 4 * y + j + 1) - c) * per_cell);
        }
    if (level > 0) {
        for (int k = 0; k < 4; k++)
            add_tile(record, tile_of(b, level - 1, 2 * x + (k & 1), 2 * y + (k >> 1)));
        record[IMAGE_TILE_DETAIL] = above((double)record[IMAGE_TILE_DETAIL] + change_of(b, level, x, y));
    }
    memcpy(tile_of(b, level, x, y), record, sizeof record);
}

static void make_tiles(const builder *b, uint32_t level)
{
    const karst_image_level *l = &b->header->level[level];
    const long margin = b->header->repeats ? 0 : 1;
    for (long y = -margin; y < l->tiles[1] - margin; y++)
        for (long x = -margin; x < l->tiles[0] - margin; x++)
            make_tile(b, level, x, y);
}

/* All of it together. */
static void sum_up(karst_image_header *header, const float *floats)
{
    float all[IMAGE_TILE_FLOATS] = {INFINITY, -INFINITY, INFINITY, -INFINITY, INFINITY, -INFINITY};
    const karst_image_level *last = &header->level[header->num_levels - 1];
    for (long i = 0; i < (long)last->tiles[0] * last->tiles[1]; i++)
        add_tile(all, floats + last->bounds + i * IMAGE_TILE_FLOATS);
    header->low = all[IMAGE_TILE_LOW];
    header->high = all[IMAGE_TILE_HIGH];
    memcpy(header->slope, all + IMAGE_TILE_SLOPE, sizeof header->slope);
}

/* ---- the whole ---- */

static int tiles_of(int size, bool repeats) { return repeats ? size <= 4 ? 1 : size / 4 : (size + 3) / 4 + 2; }

/* Places everything; returns how many floats that is. */
static size_t lay_out(karst_image_header *header, size_t columns, size_t rows, bool repeats)
{
    size_t at = sizeof *header / sizeof(float), size[2] = {columns, rows}, least = repeats ? 1 : 2;
    header->repeats = repeats;
    for (uint32_t level = 0; level < IMAGE_MOST_LEVELS; level++) {
        karst_image_level *l = &header->level[level];
        header->num_levels = level + 1;
        for (int i = 0; i < 2; i++) {
            l->size[i] = (int)size[i];
            l->tiles[i] = tiles_of(l->size[i], repeats);
        }
        l->values = (uint)at;
        at += size[0] * size[1];
        l->bounds = (uint)at;
        at += (size_t)l->tiles[0] * (size_t)l->tiles[1] * IMAGE_TILE_FLOATS;
        if (size[0] <= least && size[1] <= least)
            break;
        for (int i = 0; i < 2; i++)
            size[i] = size[i] <= least ? size[i] : repeats ? size[i] / 2 : size[i] / 2 + 1;
    }
    return at;
}

static uint64_t digest_of(const uint64_t *words, size_t count)
{
    uint64_t digest = 0x9e3779b97f4a7c15u;
    for (size_t i = 0; i < count; i++) {
        digest = (digest ^ words[i]) * 0xff51afd7ed558ccdu;
        digest ^= digest >> 32;
    }
    return digest;
}

bool karst_samples_image_build(karst_samples_image *image, const float *samples, uint32_t width, uint32_t height,
                               uint32_t stride, karst_wrap wrap, karst_error *error)
{
    const size_t columns = length_of(width, wrap), rows = length_of(height, wrap);
    karst_image_header header = {0};
    *image = (karst_samples_image){0};
    if (columns > KARST_IMAGE_MOST_SIDE || rows > KARST_IMAGE_MOST_SIDE || columns * rows > KARST_IMAGE_MOST_SAMPLES)
        return karst_fail(error, KARST_BAD_DATA,
                          "%zu x %zu samples are too many: at most %u along a side, and %zu in all", columns, rows,
                          KARST_IMAGE_MOST_SIDE, KARST_IMAGE_MOST_SAMPLES);
    const size_t num_floats = lay_out(&header, columns, rows, wrap != KARST_WRAP_CLAMP);
    image->num_words = (uint32_t)((num_floats + 1) / 2);
    image->words = calloc(image->num_words, sizeof *image->words);
    builder b = {.header = (karst_image_header *)image->words, .floats = (float *)image->words};
    if (image->words)
        memcpy(image->words, &header, sizeof header);
    if (!image->words || !make_coefficients(&b, samples, width, height, stride, wrap)) {
        karst_samples_image_finish(image);
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    for (uint32_t level = 0; level < header.num_levels; level++) {
        if (level > 0)
            make_level(&b, level);
        make_tiles(&b, level);
        const karst_image_level *l = &header.level[level];
        image->bound_bytes += (uint32_t)l->tiles[0] * (uint32_t)l->tiles[1] * IMAGE_TILE_FLOATS * 4u;
    }
    sum_up(b.header, b.floats);
    image->low = b.header->low;
    image->high = b.header->high;
    for (int i = 0; i < 2; i++) {
        image->size[i] = (uint32_t)header.level[0].size[i];
        image->period[i] = wrap == KARST_WRAP_CLAMP ? 0 : image->size[i];
    }
    image->digest = digest_of(image->words, image->num_words);
    return true;
}

void karst_samples_image_finish(karst_samples_image *image)
{
    free(image->words);
    *image = (karst_samples_image){0};
}

double karst_samples_image_steepness(const karst_samples_image *image)
{
    const float *slope = ((const karst_image_header *)image->words)->slope;
    double u = (double)fmaxf(-slope[0], slope[1]), v = (double)fmaxf(-slope[2], slope[3]);
    return hypot(u, v) * (1 + 0x1p-20);
}
