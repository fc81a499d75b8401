/* Points of texts: the vertices of an OBJ, and lines of numbers (XYZ, CSV, PTS). */
#include <ctype.h>
#include <math.h>
#include <string.h>

#include "core/files/point_source_internal.h"

#define MAX_COLUMNS 12

static void take_colour(const double *values, double most, uint8_t rgb[3])
{
    for (int i = 0; i < 3; i++) {
        double scaled = values[i] * 255 / most;
        rgb[i] = scaled >= 255 ? 255 : scaled > 0 ? (uint8_t)(scaled + 0.5) : 0;
    }
}

/* ---- OBJ ---- */

static bool read_obj(karst_point_source *source, karst_file_point *points, size_t most, size_t *num, karst_error *error)
{
    bool has_line = true;
    for (*num = 0; *num < most;) {
        double values[7];
        if (!karst_point_source_line(source, &has_line, error))
            return false;
        if (!has_line)
            return true;
        if (source->text[0] != 'v' || (source->text[1] != ' ' && source->text[1] != '\t'))
            continue;
        int count = karst_point_source_numbers(source->text + 1, values, 7);
        if (count < 3)
            return karst_point_source_complain(source, error, "a vertex is \"v X Y Z\"");
        karst_file_point *point = &points[(*num)++];
        *point = (karst_file_point){.at = {values[0], values[1], values[2]}, .rgb = {255, 255, 255}};
        if (count >= 6) { /* a common extension: colours from 0 to 1 */
            take_colour(values + 3, 1, point->rgb);
            source->has_colours = true;
        }
    }
    return true;
}

bool karst_points_open_obj(karst_point_source *source, karst_error *error)
{
    static const karst_point_reader reader = {"OBJ", read_obj};
    (void)error;
    source->reader = &reader;
    return true;
}

/* ---- XYZ ---- */

static bool is_comment(const char *text)
{
    text += strspn(text, " \t");
    return !*text || *text == '#' || (text[0] == '/' && text[1] == '/');
}

/* Three columns from `at` on that are a direction, as the first line has them. */
static bool is_direction(const double *v)
{
    double square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    return square > 0.9 && square < 1.1;
}

static bool is_colour(const double *v)
{
    for (int i = 0; i < 3; i++)
        if (!(v[i] >= 0 && v[i] <= 255))
            return false;
    return true;
}

/* X Y Z, then in any number and order: an intensity, a colour, a normal. */
static void guess_columns(karst_point_source *source, const double *v, int count)
{
    source->as.xyz.num_columns = count;
    source->as.xyz.normal_column = source->as.xyz.colour_column = -1;
    for (int at = 3; at + 3 <= count; at++) {
        if (source->as.xyz.normal_column < 0 && is_direction(v + at) &&
            (v[at] != floor(v[at]) || v[at + 1] != floor(v[at + 1]) || v[at + 2] != floor(v[at + 2]) ||
             v[at] + v[at + 1] + v[at + 2] < 0 || count == 6)) {
            source->as.xyz.normal_column = at;
            at += 2;
        } else if (source->as.xyz.colour_column < 0 && is_colour(v + at) && (count != 4 + 3 || at == 4)) {
            source->as.xyz.colour_column = at;
            at += 2;
        }
    }
    source->has_normals = source->as.xyz.normal_column >= 0;
    source->has_colours = source->as.xyz.colour_column >= 0;
}

static bool read_xyz(karst_point_source *source, karst_file_point *points, size_t most, size_t *num, karst_error *error)
{
    for (*num = 0; *num < most;) {
        double values[MAX_COLUMNS];
        bool has_line = source->as.xyz.has_first;
        source->as.xyz.has_first = false;
        if (!has_line && !karst_point_source_line(source, &has_line, error))
            return false;
        if (!has_line)
            return true;
        if (is_comment(source->text))
            continue;
        int count = karst_point_source_numbers(source->text, values, MAX_COLUMNS);
        if (count < source->as.xyz.num_columns)
            return karst_point_source_complain(source, error, "%d numbers, where the first point has %d", count,
                                               source->as.xyz.num_columns);
        karst_file_point *point = &points[(*num)++];
        *point = (karst_file_point){.at = {values[0], values[1], values[2]}};
        for (int a = 0; source->has_normals && a < 3; a++)
            point->normal[a] = (float)values[source->as.xyz.normal_column + a];
        if (source->has_colours)
            take_colour(values + source->as.xyz.colour_column, 255, point->rgb);
    }
    return true;
}

bool karst_points_open_xyz(karst_point_source *source, karst_error *error)
{
    static const karst_point_reader reader = {"XYZ", read_xyz};
    bool has_line, has_title = false;
    source->reader = &reader;
    for (;;) {
        double values[MAX_COLUMNS];
        if (!karst_point_source_line(source, &has_line, error))
            return false;
        if (!has_line)
            return karst_point_source_complain(source, error, "the file ends without a point");
        if (is_comment(source->text))
            continue;
        int count = karst_point_source_numbers(source->text, values, MAX_COLUMNS);
        if (count >= 3) {
            guess_columns(source, values, count);
            source->as.xyz.has_first = true;
            return true;
        }
        /* A line of titles, or of PTS's count. */
        if (has_title)
            return karst_point_source_complain(source, error, "a point is three numbers, X Y Z, and this is none");
        has_title = true;
    }
}
