/* Models that a world's header names. */
#include "producers/points/points_kind.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/beside.h"

static bool make_model(const karst_program_graph *program, const karst_header_model *from, int voxel_log2_m,
                       karst_model *model, karst_error *error)
{
    char *path = malloc(KARST_BESIDE_BYTES);
    *model = (karst_model){.path = path, .scale = from->scale};
    memcpy(model->turn_deg, from->turn_deg, sizeof model->turn_deg);
    if (!path)
        return karst_fail(error, KARST_FAILED, "out of memory");
    return karst_path_beside(program->name, from->points, path, error) &&
           karst_position_parse(from->at[0], from->at[1], from->at[2], voxel_log2_m, &model->at, error);
}

karst_model *karst_named_models(const karst_program_graph *program, int voxel_log2_m, size_t *num, karst_error *error)
{
    const karst_world_header *header = &program->header;
    karst_model *models = calloc(header->num_models + 1, sizeof *models);
    bool done = models || karst_fail(error, KARST_FAILED, "out of memory");
    *num = header->num_models;
    for (uint32_t i = 0; done && i < header->num_models; i++)
        done = make_model(program, &header->models[i], voxel_log2_m, &models[i], error);
    if (done)
        return models;
    karst_named_models_free(models, *num);
    return NULL;
}

void karst_named_models_free(karst_model *models, size_t num)
{
    for (size_t i = 0; models && i < num; i++)
        free((char *)models[i].path);
    free(models);
}

static bool is_named(const karst_program_graph *program) { return program->header.num_models > 0; }

static karst_layer *create(const karst_layer_scene *scene, karst_error *error)
{
    size_t num;
    karst_model *models = karst_named_models(scene->program, scene->voxel_log2_m, &num, error);
    karst_layer *layer = models ? karst_points_layer_create(scene->context, KARST_SHAPE_AUTO, models, num,
                                                            scene->voxel_log2_m, scene->log, error)
                                : NULL;
    karst_named_models_free(models, num);
    return layer;
}

static bool is_same(const karst_program_graph *a, const karst_program_graph *b)
{
    const karst_world_header *one = &a->header, *other = &b->header;
    bool same = one->num_models == other->num_models && strcmp(a->name, b->name) == 0;
    for (uint32_t i = 0; same && i < one->num_models; i++) {
        const karst_header_model *m = &one->models[i], *n = &other->models[i];
        same = strcmp(m->points, n->points) == 0 && m->scale == n->scale &&
               memcmp(m->turn_deg, n->turn_deg, sizeof m->turn_deg) == 0;
        for (int axis = 0; axis < 3; axis++)
            same = same && strcmp(m->at[axis], n->at[axis]) == 0;
    }
    return same;
}

static bool has_colours(const karst_layer *layer)
{
    return karst_model_list_has_colours(karst_points_layer_list(layer));
}

const karst_layer_kind karst_points_kind = {
    .is_named = is_named, .create = create, .is_same = is_same, .has_colours = has_colours};
