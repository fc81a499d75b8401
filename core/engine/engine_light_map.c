/* Light maps that worlds name. */
#include <math.h>
#include <stdlib.h>

#include "core/base/beside.h"
#include "core/engine/engine_parts.h"
#include "core/files/light_points.h"

bool karst_engine_wants_light_map(const karst_engine_config *config, const karst_world_info *world)
{
    return world->has_light_map && config->integrator == KARST_INTEGRATOR_DIRECT;
}

static karst_position position_of(const double at_m[3], int voxel_log2_m)
{
    const karst_position origin = {{0}, {0}};
    return karst_position_add_m(origin, at_m, voxel_log2_m);
}

static karst_light_map_point point_of(const karst_light_point *from, const karst_position *anchor, int voxel_log2_m)
{
    karst_light_map_point to = {.radius = ldexp(from->radius_m, -voxel_log2_m)};
    karst_position_difference_m(*anchor, position_of(from->at_m, voxel_log2_m), voxel_log2_m, to.place);
    for (int i = 0; i < 3; i++) {
        to.place[i] = ldexp(to.place[i], -voxel_log2_m);
        to.normal[i] = (double)from->normal[i];
        to.light[i] = (double)from->light[i];
    }
    return to;
}

bool karst_engine_world_open_light_map(karst_engine_world *world, karst_context *context, karst_error *error)
{
    const karst_world_header *header = &world->file->program->header;
    const int voxel_log2_m = world->file->info.voxel_log2_m;
    char path[KARST_BESIDE_BYTES];
    size_t num = 0;
    if (!header->light_map)
        return true;
    if (!karst_path_beside(world->file->program->name, header->light_map, path, error))
        return false;
    karst_light_point *from = karst_light_points_load(path, header->light_reach_m, KARST_LIGHT_MAP_MOST, &num, error);
    karst_light_map_point *points = from ? malloc(num * sizeof *points) : NULL;
    if (from && !points)
        karst_fail(error, KARST_FAILED, "out of memory for the light map %s", path);
    if (points) {
        world->light_map_anchor = position_of(from[num / 2].at_m, voxel_log2_m);
        for (size_t i = 0; i < num; i++)
            points[i] = point_of(&from[i], &world->light_map_anchor, voxel_log2_m);
        world->light_map = karst_light_map_create(context, points, num, error);
    }
    free(points);
    free(from);
    return world->light_map != NULL;
}

bool karst_engine_gather_light_map(karst_engine *engine, const karst_path_picture *picture, const karst_buffer *rays,
                                   const karst_buffer *count, const karst_buffer *hits, karst_error *error)
{
    const karst_engine_world *world = &engine->shown;
    const int voxel_log2_m = world->file->info.voxel_log2_m;
    karst_path_stream at;
    double away_m[3];
    float offset[3];
    if (!world->light_map || picture->again)
        return true;
    karst_position_difference_m(world->light_map_anchor, engine->camera.position, voxel_log2_m, away_m);
    for (int axis = 0; axis < 3; axis++)
        offset[axis] = (float)ldexp(away_m[axis], -voxel_log2_m);
    return karst_paths_look_along_normals(engine->paths, picture, rays, count, hits, &at, error) &&
           karst_light_map_gather(world->light_map, at.rays, at.count, at.max_rays, offset, picture->pinhole,
                                  picture->light, picture->parts, error);
}
