/* Points of texts: the vertices of an OBJ, and lines of numbers (XYZ, CSV, PTS). */
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
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

/* Vertices of larger files have their normals found from neighbours: their faces would take too much memory. */
#define MOST_VERTICES_OF_FACES 20000000u
#define MAX_FACE_CORNERS 256

/* A file's vertices, and what their faces add up to: each its normal, as long as twice its area. */
typedef struct {
    float (*at)[3], (*normals)[3];
    uint64_t num, capacity;
    bool has_faces;
} face_sums;

static bool is_vertex(const char *text) { return text[0] == 'v' && (text[1] == ' ' || text[1] == '\t'); }

static bool add_vertex(face_sums *sums, const double v[3])
{
    if (sums->num == sums->capacity) {
        uint64_t capacity = sums->capacity ? 2 * sums->capacity : 1024;
        void *at = realloc(sums->at, capacity * sizeof *sums->at);
        sums->at = at ? at : sums->at;
        void *normals = at ? realloc(sums->normals, capacity * sizeof *sums->normals) : NULL;
        if (!normals)
            return false;
        sums->normals = normals;
        sums->capacity = capacity;
    }
    for (int a = 0; a < 3; a++) {
        sums->at[sums->num][a] = (float)v[a];
        sums->normals[sums->num][a] = 0;
    }
    sums->num++;
    return true;
}

static void add_triangle(face_sums *sums, const uint64_t corner[3])
{
    float u[3], v[3];
    for (int a = 0; a < 3; a++) {
        u[a] = sums->at[corner[1]][a] - sums->at[corner[0]][a];
        v[a] = sums->at[corner[2]][a] - sums->at[corner[0]][a];
    }
    const float normal[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++)
            sums->normals[corner[i]][a] += normal[a];
    sums->has_faces = true;
}

/* "f 1/2/3 4//5 -1": numbers of vertices, from 1 on, or back from the last. Faces of vertices that are not there are
 * left out. */
static void add_face(face_sums *sums, const char *text)
{
    uint64_t corner[3];
    int num = 0;
    for (text += 1; num < MAX_FACE_CORNERS; num++) {
        char *end;
        long long number = strtoll(text, &end, 10);
        if (end == text)
            return;
        /* wraps where there is no such vertex, to a number far beyond the last */
        uint64_t index = number < 0 ? sums->num + (uint64_t)number : (uint64_t)number - 1;
        if (index >= sums->num)
            return;
        corner[num < 2 ? num : 2] = index;
        if (num >= 2) {
            add_triangle(sums, corner);
            corner[1] = corner[2];
        }
        text = end + strcspn(end, " \t");
    }
}

/* Reads the file once, for its faces, and goes back to its begin. A file that cannot be read twice has none. */
static bool find_normals(karst_point_source *source, karst_error *error)
{
    face_sums sums = {0};
    bool has_line = true, is_small = true;
    if (fseek(source->file, 0, SEEK_SET) != 0)
        return true;
    while (has_line && is_small) {
        double v[3];
        if (!karst_point_source_line(source, &has_line, error)) {
            free(sums.at);
            free(sums.normals);
            return false;
        }
        if (has_line && is_vertex(source->text) && karst_point_source_numbers(source->text + 1, v, 3) == 3)
            is_small = sums.num < MOST_VERTICES_OF_FACES && add_vertex(&sums, v);
        else if (has_line && source->text[0] == 'f' && (source->text[1] == ' ' || source->text[1] == '\t'))
            add_face(&sums, source->text);
    }
    free(sums.at);
    if (is_small && sums.has_faces) {
        source->normals = sums.normals;
        source->num_normals = sums.num;
        source->has_normals = true;
    } else {
        free(sums.normals);
    }
    source->begin = source->end = 0;
    source->offset = source->line = 0;
    return fseek(source->file, 0, SEEK_SET) == 0 ||
           karst_point_source_complain(source, error, "it cannot be read a second time");
}

static bool read_obj(karst_point_source *source, karst_file_point *points, size_t most, size_t *num, karst_error *error)
{
    bool has_line = true;
    for (*num = 0; *num < most;) {
        double values[7];
        if (!karst_point_source_line(source, &has_line, error))
            return false;
        if (!has_line)
            return true;
        if (!is_vertex(source->text))
            continue;
        int count = karst_point_source_numbers(source->text + 1, values, 7);
        if (count < 3)
            return karst_point_source_complain(source, error, "a vertex is \"v X Y Z\"");
        karst_file_point *point = &points[(*num)++];
        *point = (karst_file_point){.at = {values[0], values[1], values[2]}, .rgb = {255, 255, 255}};
        if (source->next_vertex < source->num_normals)
            memcpy(point->normal, source->normals[source->next_vertex++], sizeof point->normal);
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
    source->reader = &reader;
    return find_normals(source, error);
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
