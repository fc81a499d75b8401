/* Models made of points that a world's header names: see docs/POINTS.md. */
#include <stdlib.h>
#include <string.h>

#include "core/base/beside.h"
#include "core/engine/engine_parts.h"
#include "producers/points/points.h"

bool karst_engine_world_has_models(const karst_engine_world *world)
{
    return world->file->program->header.num_models > 0;
}

/* What the header says of one, with its path from the world's own folder on. */
static bool make_model(const karst_engine_world *world, const karst_header_model *from, karst_model *model,
                       char path[KARST_BESIDE_BYTES], karst_error *error)
{
    *model = (karst_model){.path = path, .scale = from->scale};
    memcpy(model->turn_deg, from->turn_deg, sizeof model->turn_deg);
    return karst_path_beside(world->file->program->name, from->points, path, error) &&
           karst_position_parse(from->at[0], from->at[1], from->at[2], world->file->info.voxel_log2_m, &model->at,
                                error);
}

bool karst_engine_world_load_models(karst_engine *engine, karst_engine_world *world, karst_error *error)
{
    const karst_world_header *header = &world->file->program->header;
    if (header->num_models == 0 || world->models)
        return true;
    if (engine->refine)
        return karst_fail(error, KARST_USAGE,
                          "models and refined hits: these know the world's own density alone; "
                          "leave one of the two out");
    karst_model *models = calloc(header->num_models, sizeof *models);
    char(*paths)[KARST_BESIDE_BYTES] = calloc(header->num_models, sizeof *paths);
    bool done = (models && paths) || karst_fail(error, KARST_FAILED, "out of memory");
    for (uint32_t i = 0; done && i < header->num_models; i++)
        done = make_model(world, &header->models[i], &models[i], paths[i], error);
    if (done)
        world->models = karst_points_layer_create(engine->context, KARST_SHAPE_AUTO, models, header->num_models,
                                                  world->file->info.voxel_log2_m, engine->log, error);
    free(models);
    free(paths);
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
