/* Points of a LAS file, versions 1.2 to 1.4, formats 0 to 10 (ASPRS LAS Specification 1.4-R15). */
#include <math.h>
#include <string.h>

#include "core/files/point_source_internal.h"

static uint32_t read_uint(const uint8_t *bytes, int num)
{
    uint32_t value = 0;
    for (int i = 0; i < num; i++)
        value |= (uint32_t)bytes[i] << 8 * i;
    return value;
}

static uint64_t read_uint64(const uint8_t *bytes)
{
    return read_uint(bytes, 4) | (uint64_t)read_uint(bytes + 4, 4) << 32;
}

static double read_double(const uint8_t *bytes)
{
    uint64_t bits = read_uint64(bytes);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Least length of a record, and where its colour lies (0: it has none), by format. */
static const struct {
    uint8_t bytes, colour;
} formats[] = {{20, 0}, {28, 0}, {26, 20}, {34, 28}, {57, 0}, {63, 28}, {30, 0}, {36, 30}, {38, 30}, {59, 0}, {67, 30}};
#define NUM_FORMATS (sizeof formats / sizeof *formats)

/* Withheld by who made the file, or classed as noise. */
static bool is_withheld(const uint8_t *record, uint32_t format)
{
    if (format < 6)
        return record[15] >> 7 || (record[15] & 31) == 7;
    return (record[15] & 4) || record[16] == 7 || record[16] == 18;
}

/* Colours have 16 bits; many writers use the lower 8 of them. Told by the first records. */
static void guess_colour_shift(karst_point_source *source)
{
    uint32_t step = source->as.las.record_bytes;
    source->as.las.colour_shift = 0;
    for (size_t at = source->begin; at + step <= source->end; at += step)
        for (int i = 0; i < 3; i++)
            if (read_uint(source->buffer + at + source->as.las.colour_offset + 2 * i, 2) > 255)
                source->as.las.colour_shift = 8;
}

static bool read_las(karst_point_source *source, karst_file_point *points, size_t most, size_t *num, karst_error *error)
{
    for (*num = 0; *num < most && source->as.las.num_left; source->as.las.num_left--) {
        const uint8_t *record = karst_point_source_bytes(source, source->as.las.record_bytes);
        if (!record)
            return karst_point_source_complain(source, error, "the file ends after %llu of %llu points: is it whole?",
                                               (unsigned long long)(source->as.las.num_all - source->as.las.num_left),
                                               (unsigned long long)source->as.las.num_all);
        if (source->has_colours && source->as.las.colour_shift < 0) {
            source->begin -= source->as.las.record_bytes;
            guess_colour_shift(source);
            source->begin += source->as.las.record_bytes;
        }
        if (is_withheld(record, source->as.las.format)) {
            source->num_withheld++;
            continue;
        }
        karst_file_point *point = &points[(*num)++];
        *point = (karst_file_point){0};
        for (int a = 0; a < 3; a++) {
            double whole = (int32_t)read_uint(record + 4 * a, 4);
            point->at[a] = whole * source->as.las.scale[a] + source->as.las.offset[a];
            if (source->has_colours)
                point->rgb[a] = (uint8_t)(read_uint(record + source->as.las.colour_offset + 2 * a, 2) >>
                                          source->as.las.colour_shift);
        }
    }
    return true;
}

static bool read_head(karst_point_source *source, const uint8_t *head, karst_error *error)
{
    const uint32_t minor = head[25], head_bytes = read_uint(head + 94, 2), format = head[104] & 63;
    if (head[24] != 1 || minor > 4)
        return karst_point_source_complain(source, error, "LAS %u.%u: versions 1.0 to 1.4 are read", head[24], minor);
    if (head[104] >> 6)
        return karst_point_source_complain(source, error,
                                           "this is compressed (LAZ): unpack it first, with laszip -i "
                                           "in.laz -o out.las, or with pdal translate in.laz out.las");
    if (format >= NUM_FORMATS)
        return karst_point_source_complain(source, error, "points of format %u: 0 to 10 are read", format);
    source->as.las.format = format;
    source->as.las.record_bytes = read_uint(head + 105, 2);
    if (source->as.las.record_bytes < formats[format].bytes)
        return karst_point_source_complain(source, error, "records of %u bytes: format %u has %u at least",
                                           source->as.las.record_bytes, format, formats[format].bytes);
    source->as.las.colour_offset = formats[format].colour;
    source->has_colours = formats[format].colour != 0;
    source->as.las.colour_shift = -1;
    source->as.las.num_all = read_uint(head + 107, 4);
    for (int a = 0; a < 3; a++) {
        source->as.las.scale[a] = read_double(head + 131 + 8 * a);
        source->as.las.offset[a] = read_double(head + 155 + 8 * a);
        if (!isfinite(source->as.las.scale[a]) || !isfinite(source->as.las.offset[a]) || source->as.las.scale[a] == 0)
            return karst_point_source_complain(source, error, "a scale of %g, an offset of %g", source->as.las.scale[a],
                                               source->as.las.offset[a]);
    }
    if (head_bytes < (minor >= 4 ? 375u : 227u))
        return karst_point_source_complain(source, error, "a head of %u bytes", head_bytes);
    return true;
}

bool karst_points_open_las(karst_point_source *source, karst_error *error)
{
    static const karst_point_reader reader = {"LAS", read_las};
    uint8_t head[227];
    source->reader = &reader;
    const uint8_t *bytes = karst_point_source_bytes(source, sizeof head);
    if (!bytes || memcmp(bytes, "LASF", 4) != 0)
        return karst_point_source_complain(source, error, "no LAS: a file of at least 227 bytes that begins with LASF");
    memcpy(head, bytes, sizeof head);
    if (!read_head(source, head, error))
        return false;
    uint64_t data_offset = read_uint(head + 96, 4);
    if (head[25] >= 4) {
        const uint8_t *more = karst_point_source_bytes(source, 375 - sizeof head);
        if (!more)
            return karst_point_source_complain(source, error, "the file ends within its head");
        uint64_t count = read_uint64(more + 247 - 227);
        source->as.las.num_all = count ? count : source->as.las.num_all;
    }
    if (data_offset < source->offset)
        return karst_point_source_complain(source, error, "points that begin at byte %llu, within the head",
                                           (unsigned long long)data_offset);
    while (source->offset < data_offset) {
        uint64_t num = data_offset - source->offset < 4096 ? data_offset - source->offset : 4096;
        if (!karst_point_source_bytes(source, num))
            return karst_point_source_complain(source, error, "the file ends before its points, at byte %llu",
                                               (unsigned long long)data_offset);
    }
    source->as.las.num_left = source->as.las.num_all;
    return true;
}
