/* Where the levels of a model lie while it is made: their points in the model, how far these reach beside it. */
#include "core/points/import_internal.h"

points_work_file karst_points_extents_of(uint32_t level) { return level % 2 ? POINTS_COVERS_ODD : POINTS_COVERS; }

bool karst_points_open_level(points_import *import, uint32_t level, points_level_files *files, karst_error *error)
{
    *files = (points_level_files){import, &import->head->levels[level],
                                  karst_points_file(import, POINTS_MODEL, error), -1};
    if (level > 0)
        files->extents = karst_points_file(import, karst_points_extents_of(level), error);
    return files->model >= 0 && (level == 0 || files->extents >= 0);
}

bool karst_points_read_level(const points_level_files *files, uint64_t first, size_t num, karst_point *points,
                             points_extent *extents, karst_error *error)
{
    if (!karst_points_read(files->import, files->model, points, num * sizeof *points,
                           files->level->offset + first * sizeof *points, error))
        return false;
    if (files->extents >= 0)
        return karst_points_read(files->import, files->extents, extents, num * sizeof *extents,
                                 first * sizeof *extents, error);
    for (size_t i = 0; i < num; i++)
        extents[i] = (points_extent){karst_point_reach(points[i].radius), 0};
    return true;
}
