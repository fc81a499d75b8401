/* Files of points: which reader takes which. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "core/files/point_source_internal.h"

bool karst_point_format_of(const char *name, karst_point_format *format, karst_error *error)
{
    static const struct {
        const char *suffix;
        karst_point_format format;
    } formats[] = {{".ply", KARST_POINTS_PLY}, {".obj", KARST_POINTS_OBJ}, {".xyz", KARST_POINTS_XYZ},
                   {".txt", KARST_POINTS_XYZ}, {".csv", KARST_POINTS_XYZ}, {".pts", KARST_POINTS_XYZ},
                   {".asc", KARST_POINTS_XYZ}, {".las", KARST_POINTS_LAS}};
    const char *suffix = strrchr(name, '.');
    for (size_t i = 0; suffix && i < sizeof formats / sizeof *formats; i++)
        if (strcasecmp(suffix, formats[i].suffix) == 0) {
            *format = formats[i].format;
            return true;
        }
    if (suffix && strcasecmp(suffix, ".laz") == 0)
        return karst_fail(error, KARST_USAGE,
                          "%s: LAZ is compressed LAS, which Karst does not read: unpack it first, with laszip -i "
                          "in.laz -o out.las, or with pdal translate in.laz out.las",
                          name);
    if (suffix && strcasecmp(suffix, ".e57") == 0)
        return karst_fail(error, KARST_USAGE,
                          "%s: Karst does not read E57: turn it into LAS first, with pdal translate in.e57 out.las",
                          name);
    return karst_fail(error, KARST_USAGE,
                      "%s: points are read from .ply, .obj, .las, and from text in .xyz, .txt, .csv, "
                      ".pts or .asc",
                      name);
}

karst_point_source *karst_point_source_open(FILE *file, const char *name, karst_point_format format, karst_error *error)
{
    bool (*const openers[])(karst_point_source *, karst_error *) = {karst_points_open_ply, karst_points_open_obj,
                                                                    karst_points_open_xyz, karst_points_open_las,
                                                                    karst_points_open_particles};
    karst_point_source *source = calloc(1, sizeof *source);
    struct stat about;
    if (!source) {
        fclose(file);
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    source->file = file;
    source->name = name;
    if (fileno(file) >= 0 && fstat(fileno(file), &about) == 0 && S_ISREG(about.st_mode))
        source->length = (uint64_t)about.st_size;
    if (openers[format](source, error))
        return source;
    karst_point_source_close(source);
    return NULL;
}

bool karst_point_source_read(karst_point_source *source, karst_file_point *points, size_t most, size_t *num,
                             karst_error *error)
{
    return source->reader->read(source, points, most, num, error);
}

bool karst_point_source_has_normals(const karst_point_source *source) { return source->has_normals; }
bool karst_point_source_has_colours(const karst_point_source *source) { return source->has_colours; }
bool karst_point_source_has_radius(const karst_point_source *source) { return source->has_radius; }
bool karst_point_source_has_more(const karst_point_source *source) { return source->has_more; }
uint64_t karst_point_source_num_withheld(const karst_point_source *source) { return source->num_withheld; }

double karst_point_source_share(const karst_point_source *source)
{
    return source->length ? fmin((double)source->offset / (double)source->length, 1) : 0;
}

void karst_point_source_close(karst_point_source *source)
{
    if (!source)
        return;
    fclose(source->file);
    free(source->normals);
    free(source);
}
