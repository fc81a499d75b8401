/* Particles as text: a line that names the columns, then a line for each. */
#include <string.h>

#include "core/files/point_source_internal.h"

#define MAX_COLUMNS 32
#define NEEDED 5 /* of the names */
#define SEPARATORS " \t,;\r"

static const char *const names[8] = {"x", "y", "z", "radius", "extinction", "vx", "vy", "vz"};

static bool is_passed_over(const char *text)
{
    text += strspn(text, " \t");
    return !*text || *text == '#';
}

static bool next_line(karst_point_source *source, bool *has_line, karst_error *error)
{
    do {
        if (!karst_point_source_line(source, has_line, error))
            return false;
    } while (*has_line && is_passed_over(source->text));
    return true;
}

static bool read_particles(karst_point_source *source, karst_file_point *points, size_t most, size_t *num,
                           karst_error *error)
{
    const int *of = source->as.particles.of;
    for (*num = 0; *num < most;) {
        double values[MAX_COLUMNS + 1];
        bool has_line;
        if (!next_line(source, &has_line, error))
            return false;
        if (!has_line)
            return true;
        const int count = karst_point_source_numbers(source->text, values, MAX_COLUMNS + 1);
        if (count != source->as.particles.num_columns)
            return karst_point_source_complain(source, error, "%d numbers, where the first line names %d columns",
                                               count, source->as.particles.num_columns);
        karst_file_point *point = &points[(*num)++];
        *point = (karst_file_point){.at = {values[of[0]], values[of[1]], values[of[2]]}};
        for (int i = 0; i < 5; i++)
            point->more[i] = of[3 + i] < 0 ? 0 : values[of[3 + i]];
        if (!(point->more[0] > 0))
            return karst_point_source_complain(source, error, "a radius of %g m: it is above 0", point->more[0]);
        if (!(point->more[1] >= 0))
            return karst_point_source_complain(source, error, "an extinction of %g per metre: it is 0 or more",
                                               point->more[1]);
    }
    return true;
}

bool karst_points_open_particles(karst_point_source *source, karst_error *error)
{
    static const karst_point_reader reader = {"CSV", read_particles};
    int *of = source->as.particles.of, count = 0;
    bool has_line;
    source->reader = &reader;
    for (int i = 0; i < 8; i++)
        of[i] = -1;
    if (!next_line(source, &has_line, error))
        return false;
    if (!has_line)
        return karst_point_source_complain(source, error, "the file ends without a particle");
    for (char *save = NULL, *word = strtok_r(source->text, SEPARATORS, &save); word;
         word = strtok_r(NULL, SEPARATORS, &save)) {
        for (int i = 0; i < 8; i++)
            if (strcmp(word, names[i]) == 0)
                of[i] = count;
        if (++count > MAX_COLUMNS)
            return karst_point_source_complain(source, error, "more than %d columns", MAX_COLUMNS);
    }
    for (int i = 0; i < NEEDED; i++)
        if (of[i] < 0)
            return karst_point_source_complain(source, error,
                                               "the first line names the columns, such as "
                                               "x,y,z,radius,extinction, and no column is called \"%s\"",
                                               names[i]);
    source->as.particles.num_columns = count;
    source->has_more = true;
    return true;
}
