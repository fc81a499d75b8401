/* From samples to the coefficients of a spline, a pyramid of them, and bounds of it by tiles. */
#include "producers/language/image/image.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    karst_image_header *header;
    float *floats;                /* the header's beginning */
    const karst_image_room *room; /* NULL: it lies in memory */
    const karst_image_file *file;
    size_t num_touched; /* floats since pages were let go */
} builder;

/* Floats after which pages go that are in memory: 64 MiB. */
#define MOST_TOUCHED ((size_t)16 << 20)

static void touch(builder *b, size_t num)
{
    b->num_touched += num;
    if (b->room && b->num_touched >= MOST_TOUCHED) {
        karst_image_file_let_go(b->file);
        if (b->room->let_go)
            b->room->let_go(b->room->user);
        b->num_touched = 0;
    }
}

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

/* Lines side by side that are made together: columns one by one would touch all of the memory for each. */
#define BESIDE 128
/* Systems map so many floats around the one that is touched, if the file's are in memory. */
#define TOUCHED_AROUND 16384

/* Lines along an axis, in place; of the first one from the samples. The first of them begins at `first`, and as many
 * lie beside it along the first axis, a float apart. */
typedef struct {
    size_t from, to, step;
    size_t longest; /* of a line's room */
    karst_wrap wrap;
    double *lines, *work;
} line_maker;

static void make_lines(builder *b, const line_maker *m, float *first, size_t num)
{
    const size_t touched = m->step < TOUCHED_AROUND ? m->step : TOUCHED_AROUND;
    for (size_t k = 0; k < m->from; k++) {
        for (size_t i = 0; i < num; i++)
            m->lines[i * m->longest + k] = (double)first[k * m->step + i];
        touch(b, touched);
    }
    for (size_t i = 0; i < num; i++)
        make_line(m->lines + i * m->longest, m->work, m->from, m->to, m->wrap);
    for (size_t k = 0; k < m->to; k++) {
        for (size_t i = 0; i < num; i++)
            first[k * m->step + i] = (float)m->lines[i * m->longest + k];
        touch(b, touched);
    }
}

/* Lines along the first axis first, into the first level, then along the others, in place. */
static bool make_coefficients(builder *b, const float *samples, const uint32_t size[3], uint32_t stride,
                              karst_wrap wrap)
{
    const int *to_size = b->header->level[0].size;
    line_maker m = {.wrap = wrap};
    for (int axis = 0; axis < 3; axis++) {
        const size_t room = 2 * (size_t)to_size[axis] + 2 * (size_t)size[axis];
        m.longest = m.longest > room ? m.longest : room;
    }
    m.lines = malloc((BESIDE + 1) * m.longest * sizeof *m.lines);
    float *to = b->floats + b->header->level[0].values;
    if (!m.lines)
        return false;
    m.work = m.lines + BESIDE * m.longest;
    const size_t step[3] = {1, (size_t)to_size[0], (size_t)to_size[0] * (size_t)to_size[1]};
    const size_t width = (size_t)to_size[0];
    for (size_t j = 0; j < size[2]; j++)
        for (size_t i = 0; i < size[1]; i++) {
            float *row = to + i * step[1] + j * step[2];
            for (size_t k = 0; k < size[0]; k++)
                m.lines[k] = (double)samples[((j * size[1] + i) * size[0] + k) * stride];
            make_line(m.lines, m.work, size[0], width, wrap);
            for (size_t k = 0; k < width; k++)
                row[k] = (float)m.lines[k];
            touch(b, width);
        }
    /* how far lines are made along each axis */
    size_t made[3] = {width, size[1], size[2]};
    for (uint32_t axis = 1; axis < b->header->num_axes; axis++) {
        const int v = axis == 2 ? 1 : 2;
        m.from = size[axis];
        m.to = (size_t)to_size[axis];
        m.step = step[axis];
        for (size_t j = 0; j < made[v]; j++)
            for (size_t i = 0; i < width; i += BESIDE)
                make_lines(b, &m, to + i + j * step[v], width - i < BESIDE ? width - i : BESIDE);
        made[axis] = m.to;
    }
    free(m.lines);
    return true;
}

/* ---- levels ---- */

static bool is_flat(const builder *b) { return b->header->num_axes < 3; }

/* Where places first and so on lie along an axis of a level. */
static void place_along(const builder *b, uint32_t level, int axis, long first, int num, size_t *to)
{
    for (int i = 0; i < num; i++)
        to[i] = inside(first + i, (size_t)b->header->level[level].size[axis], b->header->repeats);
}

static void make_level(builder *b, uint32_t level)
{
    const karst_image_level *l = &b->header->level[level], *fine = &b->header->level[level - 1];
    static const double weight[3] = {0.25, 0.5, 0.25}, middle[3] = {0, 1, 0};
    const double *across = is_flat(b) ? middle : weight;
    const float *values = b->floats + fine->values;
    size_t at[3][3];
    for (long z = 0; z < l->size[2]; z++)
        for (long y = 0; y < l->size[1]; y++) {
            place_along(b, level - 1, 2, 2 * z - 1, 3, at[2]);
            place_along(b, level - 1, 1, 2 * y - 1, 3, at[1]);
            float *row = b->floats + l->values + (size_t)(z * l->size[1] + y) * (size_t)l->size[0];
            for (long x = 0; x < l->size[0]; x++) {
                double sum = 0;
                place_along(b, level - 1, 0, 2 * x - 1, 3, at[0]);
                for (int k = 0; k < 3; k++)
                    for (int j = 0; j < 3 && across[k] > 0; j++) {
                        const float *from =
                            values + (at[2][k] * (size_t)fine->size[1] + at[1][j]) * (size_t)fine->size[0];
                        for (int i = 0; i < 3; i++)
                            sum += weight[i] * weight[j] * across[k] * (double)from[at[0][i]];
                    }
                row[x] = (float)sum;
            }
            touch(b, 5 * (size_t)l->size[0]);
        }
}

/* ---- tiles ---- */

static float *tile_of(const builder *b, uint32_t level, const long at[3])
{
    const karst_image_level *l = &b->header->level[level];
    const bool repeats = b->header->repeats;
    size_t place = 0;
    for (int axis = (int)b->header->num_axes - 1; axis >= 0; axis--)
        place = place * (size_t)l->tiles[axis] + inside(at[axis] + !repeats, (size_t)l->tiles[axis], repeats);
    return b->floats + l->bounds + place * IMAGE_TILE_FLOATS(b->header->num_axes);
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

/* Coefficients around a tile: so many along an axis that has any. */
enum { OWN = 7, COARSE = 7, FINE = 11 };

static int along(const builder *b, int axis, int num) { return axis == 2 && is_flat(b) ? 1 : num; }

/* A block of coefficients of a level, from (x, y, z) on, `num` along each axis. */
static void take_block(const builder *b, uint32_t level, const long first[3], int num, double *to)
{
    const karst_image_level *l = &b->header->level[level];
    const float *values = b->floats + l->values;
    size_t at[3][FINE];
    for (int axis = 0; axis < 3; axis++)
        place_along(b, level, axis, axis == 2 && is_flat(b) ? 0 : first[axis], along(b, axis, num), at[axis]);
    for (int k = 0; k < along(b, 2, num); k++)
        for (int j = 0; j < num; j++) {
            const float *row = values + (at[2][k] * (size_t)l->size[1] + at[1][j]) * (size_t)l->size[0];
            for (int i = 0; i < num; i++)
                *to++ = (double)row[at[0][i]];
        }
}

/* Coefficients of a level's spline as those of the level before, whose cells are half as wide, along one axis: from
 * COARSE of them to FINE, the first of which is an odd one. */
static void refine_axis(const double *from, double *to, size_t step, size_t num_lines, size_t inner)
{
    for (size_t line = 0; line < num_lines; line++) {
        const double *c = from + line / inner * inner * COARSE + line % inner;
        double *f = to + line / inner * inner * FINE + line % inner;
        for (size_t i = 0; i < FINE; i++) {
            const double *left = c + i / 2 * step;
            f[i * step] =
                i & 1 ? 0.125 * left[0] + 0.75 * left[step] + 0.125 * left[2 * step] : 0.5 * left[0] + 0.5 * left[step];
        }
    }
}

/* How far a level's spline may lie from that of the level before, over the first one's tile: both are splines of the
 * finer coefficients, and so is their difference, which is no larger than its largest coefficient. */
static double change_of(const builder *b, uint32_t level, const long at[3])
{
    double first[FINE * FINE * FINE], second[FINE * FINE * FINE], most = 0;
    const long coarse[3] = {4 * at[0] - 1, 4 * at[1] - 1, 4 * at[2] - 1},
               fine[3] = {8 * at[0] - 1, 8 * at[1] - 1, 8 * at[2] - 1};
    const size_t planes = (size_t)along(b, 2, COARSE), all = FINE * FINE * (size_t)along(b, 2, FINE);
    take_block(b, level, coarse, COARSE, first);
    refine_axis(first, second, 1, COARSE * planes, 1);
    refine_axis(second, first, FINE, FINE * planes, FINE);
    const double *refined = first, *own = second;
    if (!is_flat(b)) {
        refine_axis(first, second, FINE * FINE, FINE * FINE, FINE * FINE);
        refined = second;
        own = first;
    }
    take_block(b, level - 1, fine, FINE, refined == first ? second : first);
    for (size_t i = 0; i < all; i++)
        most = fmax(most, fabs(own[i] - refined[i]));
    return most;
}

static void add_tile(float *record, const float *part, uint32_t num_axes)
{
    record[IMAGE_TILE_LOW] = fminf(record[IMAGE_TILE_LOW], part[IMAGE_TILE_LOW]);
    record[IMAGE_TILE_HIGH] = fmaxf(record[IMAGE_TILE_HIGH], part[IMAGE_TILE_HIGH]);
    record[IMAGE_TILE_DETAIL] = fmaxf(record[IMAGE_TILE_DETAIL], part[IMAGE_TILE_DETAIL]);
    for (uint32_t i = IMAGE_TILE_SLOPE; i < IMAGE_TILE_SLOPE + 2 * num_axes; i += 2) {
        record[i] = fminf(record[i], part[i]);
        record[i + 1] = fmaxf(record[i + 1], part[i + 1]);
    }
}

#define NO_TILE                                                                               \
    {                                                                                         \
        INFINITY, -INFINITY, 0, INFINITY, -INFINITY, INFINITY, -INFINITY, INFINITY, -INFINITY \
    }

/* The least and the largest difference of neighbours along an axis, for all cells of a tile. */
static void find_slopes(const builder *b, const double *block, int axis, double range[2])
{
    const int num[3] = {OWN - (axis == 0), OWN - (axis == 1), along(b, 2, OWN) - (axis == 2)};
    const int step = axis == 0 ? 1 : axis == 1 ? OWN : OWN * OWN;
    range[0] = INFINITY;
    range[1] = -INFINITY;
    for (int k = 0; k < num[2]; k++)
        for (int j = 0; j < num[1]; j++)
            for (int i = 0; i < num[0]; i++) {
                const double *c = block + (k * OWN + j) * OWN + i, slope = c[step] - c[0];
                range[0] = slope < range[0] ? slope : range[0];
                range[1] = slope > range[1] ? slope : range[1];
            }
}

/* Of its own level by the coefficients around its cells; of those before by their tiles. */
static void make_tile(const builder *b, uint32_t level, const long at[3])
{
    const uint32_t num_axes = b->header->num_axes;
    const double per_cell = ldexp(1, -(int)level);
    const long first[3] = {4 * at[0] - 1, 4 * at[1] - 1, 4 * at[2] - 1};
    float record[IMAGE_TILE_MOST_FLOATS] = NO_TILE;
    double block[OWN * OWN * OWN], low = INFINITY, high = -INFINITY;
    take_block(b, level, first, OWN, block);
    for (int i = 0; i < OWN * OWN * along(b, 2, OWN); i++) {
        low = block[i] < low ? block[i] : low;
        high = block[i] > high ? block[i] : high;
    }
    record[IMAGE_TILE_LOW] = below(low);
    record[IMAGE_TILE_HIGH] = above(high);
    for (uint32_t axis = 0; axis < num_axes; axis++) {
        double slope[2];
        find_slopes(b, block, (int)axis, slope);
        record[IMAGE_TILE_SLOPE + 2 * axis] = below(slope[0] * per_cell);
        record[IMAGE_TILE_SLOPE + 2 * axis + 1] = above(slope[1] * per_cell);
    }
    if (level > 0) {
        for (int k = 0; k < 1 << num_axes; k++)
            add_tile(record,
                     tile_of(b, level - 1,
                             (const long[3]){2 * at[0] + (k & 1), 2 * at[1] + (k >> 1 & 1), 2 * at[2] + (k >> 2)}),
                     num_axes);
        record[IMAGE_TILE_DETAIL] = above((double)record[IMAGE_TILE_DETAIL] + change_of(b, level, at));
    }
    memcpy(tile_of(b, level, at), record, IMAGE_TILE_FLOATS(num_axes) * sizeof *record);
}

static void make_tiles(builder *b, uint32_t level)
{
    const karst_image_level *l = &b->header->level[level];
    const long margin = b->header->repeats ? 0 : 1, across = is_flat(b) ? 0 : margin;
    for (long z = -across; z < l->tiles[2] - across; z++)
        for (long y = -margin; y < l->tiles[1] - margin; y++) {
            for (long x = -margin; x < l->tiles[0] - margin; x++)
                make_tile(b, level, (const long[3]){x, y, z});
            /* rows of this level and of the one before, and records of both */
            touch(b, (size_t)l->tiles[0] * (4 * 7 + 8 * 11 + 5 * IMAGE_TILE_MOST_FLOATS));
        }
}

static size_t num_tiles(const karst_image_level *l)
{
    return (size_t)l->tiles[0] * (size_t)l->tiles[1] * (size_t)l->tiles[2];
}

/* All of it together. */
static void sum_up(karst_image_header *header, const float *floats)
{
    float all[IMAGE_TILE_MOST_FLOATS] = NO_TILE;
    const karst_image_level *last = &header->level[header->num_levels - 1];
    for (size_t i = 0; i < num_tiles(last); i++)
        add_tile(all, floats + last->bounds + i * IMAGE_TILE_FLOATS(header->num_axes), header->num_axes);
    header->low = all[IMAGE_TILE_LOW];
    header->high = all[IMAGE_TILE_HIGH];
    memcpy(header->slope, all + IMAGE_TILE_SLOPE, 2 * header->num_axes * sizeof *header->slope);
}

/* ---- the whole ---- */

static int tiles_of(int size, bool repeats) { return repeats ? size <= 4 ? 1 : size / 4 : (size + 3) / 4 + 2; }

/* Places everything; returns how many floats that is. */
static size_t lay_out(karst_image_header *header, const size_t first_size[3], uint32_t num_axes, bool repeats)
{
    size_t at = sizeof *header / sizeof(float), size[3] = {first_size[0], first_size[1], first_size[2]};
    const size_t least = repeats ? 1 : 2;
    header->repeats = repeats;
    header->num_axes = num_axes;
    for (uint32_t level = 0; level < IMAGE_MOST_LEVELS; level++) {
        karst_image_level *l = &header->level[level];
        bool is_last = true;
        header->num_levels = level + 1;
        for (uint32_t i = 0; i < 3; i++) {
            l->size[i] = (int)size[i];
            l->tiles[i] = i < num_axes ? tiles_of(l->size[i], repeats) : 1;
            is_last = is_last && (i >= num_axes || size[i] <= least);
        }
        l->values = (uint)at;
        at += size[0] * size[1] * size[2];
        l->bounds = (uint)at;
        at += num_tiles(l) * IMAGE_TILE_FLOATS(num_axes);
        if (is_last)
            break;
        for (uint32_t i = 0; i < num_axes; i++)
            size[i] = size[i] <= least ? size[i] : repeats ? size[i] / 2 : size[i] / 2 + 1;
    }
    return at;
}

#define DIGEST_START 0x9e3779b97f4a7c15u

static uint64_t digest_of(uint64_t digest, const uint64_t *words, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        digest = (digest ^ words[i]) * 0xff51afd7ed558ccdu;
        digest ^= digest >> 32;
    }
    return digest;
}

/* What an image says of itself, once its words are there. */
static void describe(karst_samples_image *image, karst_wrap wrap)
{
    const karst_image_header *header = (const karst_image_header *)image->words;
    image->num_axes = header->num_axes;
    image->low = header->low;
    image->high = header->high;
    for (uint32_t i = 0; i < image->num_axes; i++) {
        image->size[i] = (uint32_t)header->level[0].size[i];
        image->period[i] = wrap == KARST_WRAP_CLAMP ? 0 : image->size[i];
    }
}

static bool make_words(karst_samples_image *image, const karst_image_room *room, size_t num_floats, karst_error *error)
{
    image->num_words = (uint32_t)((num_floats + 1) / 2);
    if (room && num_floats * sizeof(float) > room->most_in_memory_bytes) {
        if (!karst_image_file_begin(&image->file, room->key, image->num_words * sizeof *image->words, error))
            return false;
        image->words = image->file.memory;
        image->num_words = (uint32_t)(image->file.memory_bytes / sizeof *image->words);
        return true;
    }
    image->words = calloc(image->num_words, sizeof *image->words);
    return image->words || karst_fail(error, KARST_FAILED, "out of memory");
}

static uint64_t digest_in_parts(const karst_samples_image *image)
{
    const size_t part = MOST_TOUCHED / 2;
    uint64_t digest = DIGEST_START;
    for (size_t at = 0; at < image->num_words; at += part) {
        digest = digest_of(digest, image->words + at, image->num_words - at < part ? image->num_words - at : part);
        karst_image_file_let_go(&image->file);
    }
    return digest;
}

static bool keep(karst_samples_image *image, const karst_image_room *room, karst_error *error)
{
    karst_image_facts facts = room->facts;
    if (!image->file.is_open)
        return true;
    facts.words_bytes = image->file.memory_bytes;
    facts.digest = image->digest;
    facts.bound_bytes = image->bound_bytes;
    return karst_image_file_keep(&image->file, room->key, &facts, error);
}

static bool build(karst_samples_image *image, const karst_image_room *room, const float *samples,
                  const uint32_t size[3], uint32_t num_axes, uint32_t stride, karst_wrap wrap, karst_error *error)
{
    karst_image_header header = {0};
    size_t lengths[3] = {1, 1, 1};
    for (uint32_t i = 0; i < num_axes; i++)
        lengths[i] = length_of(size[i], wrap);
    const size_t num_floats = lay_out(&header, lengths, num_axes, wrap != KARST_WRAP_CLAMP);
    if (!make_words(image, room, num_floats, error))
        return false;
    builder b = {.header = (karst_image_header *)image->words,
                 .floats = (float *)image->words,
                 .room = room,
                 .file = &image->file};
    memcpy(image->words, &header, sizeof header);
    if (!make_coefficients(&b, samples, size, stride, wrap)) {
        karst_samples_image_finish(image);
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    for (uint32_t level = 0; level < header.num_levels; level++) {
        if (level > 0)
            make_level(&b, level);
        make_tiles(&b, level);
        image->bound_bytes += (uint32_t)(num_tiles(&header.level[level]) * IMAGE_TILE_FLOATS(num_axes) * sizeof(float));
    }
    sum_up(b.header, b.floats);
    describe(image, wrap);
    image->digest = digest_in_parts(image);
    if (!room || keep(image, room, error))
        return true;
    karst_samples_image_finish(image);
    return false;
}

bool karst_samples_image_find(karst_samples_image *image, const char *key, karst_wrap wrap, karst_image_facts *facts)
{
    karst_image_header header = {0};
    *image = (karst_samples_image){0};
    if (!karst_image_file_find(&image->file, key, facts))
        return false;
    image->words = image->file.memory;
    image->num_words = (uint32_t)(image->file.memory_bytes / sizeof *image->words);
    /* Whatever the file says, nothing is looked for beyond its end. */
    const size_t lengths[3] = {length_of(facts->width, wrap), length_of(facts->height, wrap), 1};
    bool good = facts->width <= KARST_IMAGE_MOST_SIDE && facts->height <= KARST_IMAGE_MOST_SIDE && facts->width > 0 &&
                facts->height > 0 && facts->num_channels >= 1 && facts->num_channels <= 3 &&
                lengths[0] * lengths[1] <= KARST_IMAGE_MOST_SAMPLES && image->file.memory_bytes > sizeof header;
    if (good) {
        const karst_image_header *own = (const karst_image_header *)image->words;
        good = lay_out(&header, lengths, 2, wrap != KARST_WRAP_CLAMP) * sizeof(float) <= image->file.memory_bytes;
        header.low = own->low;
        header.high = own->high;
        memcpy(header.slope, own->slope, sizeof header.slope);
        good = good && memcmp(&header, own, sizeof header) == 0;
    }
    if (!good) {
        karst_samples_image_finish(image);
        return false;
    }
    image->bound_bytes = facts->bound_bytes;
    image->digest = facts->digest;
    describe(image, wrap);
    return true;
}

bool karst_samples_image_build_in(karst_samples_image *image, const karst_image_room *room, const float *samples,
                                  uint32_t width, uint32_t height, uint32_t stride, karst_wrap wrap, karst_error *error)
{
    const size_t columns = length_of(width, wrap), rows = length_of(height, wrap);
    *image = (karst_samples_image){0};
    if (columns > KARST_IMAGE_MOST_SIDE || rows > KARST_IMAGE_MOST_SIDE || columns * rows > KARST_IMAGE_MOST_SAMPLES)
        return karst_fail(error, KARST_BAD_DATA,
                          "%zu x %zu samples are too many: at most %u along a side, and %zu in all", columns, rows,
                          KARST_IMAGE_MOST_SIDE, KARST_IMAGE_MOST_SAMPLES);
    return build(image, room, samples, (const uint32_t[3]){width, height, 1}, 2, stride, wrap, error);
}

bool karst_samples_image_build(karst_samples_image *image, const float *samples, uint32_t width, uint32_t height,
                               uint32_t stride, karst_wrap wrap, karst_error *error)
{
    return karst_samples_image_build_in(image, NULL, samples, width, height, stride, wrap, error);
}

bool karst_samples_field_build(karst_samples_image *image, const float *samples, const uint32_t size[3],
                               karst_wrap wrap, karst_error *error)
{
    const size_t x = length_of(size[0], wrap), y = length_of(size[1], wrap), z = length_of(size[2], wrap);
    *image = (karst_samples_image){0};
    if (x > KARST_FIELD_MOST_SIDE || y > KARST_FIELD_MOST_SIDE || z > KARST_FIELD_MOST_SIDE ||
        x * y * z > KARST_FIELD_MOST_SAMPLES)
        return karst_fail(error, KARST_BAD_DATA,
                          "%zu x %zu x %zu samples are too many: at most %u along a side, and %zu in all", x, y, z,
                          KARST_FIELD_MOST_SIDE, KARST_FIELD_MOST_SAMPLES);
    return build(image, NULL, samples, size, 3, 1, wrap, error);
}

void karst_samples_image_finish(karst_samples_image *image)
{
    if (!image->file.is_open)
        free(image->words);
    karst_image_file_close(&image->file);
    *image = (karst_samples_image){0};
}

double karst_samples_image_steepness(const karst_samples_image *image)
{
    const float *slope = ((const karst_image_header *)image->words)->slope;
    double u = (double)fmaxf(-slope[0], slope[1]), v = (double)fmaxf(-slope[2], slope[3]),
           w = image->num_axes > 2 ? (double)fmaxf(-slope[4], slope[5]) : 0;
    return hypot(hypot(u, v), w) * (1 + 0x1p-20);
}
