/* Models made of points that a world's header names: see docs/POINTS.md. */
#include <string.h>

#include "core/engine/engine_parts.h"
#include "producers/density/world_models.h"
#include "producers/points/points.h"

bool karst_engine_world_has_models(const karst_engine_world *world)
{
    return world->file->program->header.num_models > 0;
}

bool karst_engine_world_load_models(karst_engine *engine, karst_engine_world *world, karst_error *error)
{
    size_t num;
    if (!karst_engine_world_has_models(world) || world->models)
        return true;
    karst_model *models = karst_world_models(world->file, &num, error);
    if (models)
        world->models = karst_points_layer_create(engine->context, KARST_SHAPE_AUTO, models, num,
                                                  world->file->info.voxel_log2_m, engine->log, error);
    karst_world_models_free(models, num);
    return world->models != NULL;
}

bool karst_engine_world_has_coloured_models(const karst_engine_world *world)
{
    return world->models && karst_model_list_has_colours(karst_points_layer_list(world->models));
}

bool karst_engine_world_same_models(const karst_engine_world *a, const karst_engine_world *b)
{
    const karst_world_header *one = &a->file->program->header, *other = &b->file->program->header;
    bool same = one->num_models == other->num_models &&
                (one->num_models == 0 || strcmp(a->file->program->name, b->file->program->name) == 0);
    for (uint32_t i = 0; same && i < one->num_models; i++) {
        const karst_header_model *m = &one->models[i], *n = &other->models[i];
        same = strcmp(m->points, n->points) == 0 && m->scale == n->scale &&
               memcmp(m->turn_deg, n->turn_deg, sizeof m->turn_deg) == 0;
        for (int axis = 0; axis < 3; axis++)
            same = same && strcmp(m->at[axis], n->at[axis]) == 0;
    }
    return same;
}
