/* Models that a world's header names. */
#include "producers/points/points_kind.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/beside.h"

static bool make_model(const karst_program_graph *program, const karst_header_model *from, int voxel_log2_m,
                       karst_model *model, karst_error *error)
{
    char *path = malloc(KARST_BESIDE_BYTES);
    *model = (karst_model){.path = path, .scale = from->scale, .is_whole = from->is_clear};
    memcpy(model->turn_deg, from->turn_deg, sizeof model->turn_deg);
    if (!path)
        return karst_fail(error, KARST_FAILED, "out of memory");
    return karst_path_beside(program->name, from->points, path, error) &&
           karst_position_parse(from->at[0], from->at[1], from->at[2], voxel_log2_m, &model->at, error);
}

/* The first model from number i on that is shown as a surface. */
static uint32_t next_surface(const karst_world_header *header, bool is_clear, uint32_t i)
{
    while (i < header->num_models && (header->models[i].is_splats || header->models[i].is_clear != is_clear))
        i++;
    return i;
}

karst_model *karst_named_models(const karst_program_graph *program, bool is_clear, int voxel_log2_m, size_t *num,
                                karst_error *error)
{
    const karst_world_header *header = &program->header;
    karst_model *models = calloc(header->num_models + 1, sizeof *models);
    bool done = models || karst_fail(error, KARST_FAILED, "out of memory");
    *num = 0;
    for (uint32_t i = next_surface(header, is_clear, 0); done && i < header->num_models;
         i = next_surface(header, is_clear, i + 1))
        done = make_model(program, &header->models[i], voxel_log2_m, &models[(*num)++], error);
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

karst_splat_source *karst_named_splats(const karst_program_graph *program, int voxel_log2_m, size_t *num,
                                       karst_error *error)
{
    const karst_world_header *header = &program->header;
    karst_splat_source *sources = calloc(header->num_models + 1, sizeof *sources);
    bool done = sources || karst_fail(error, KARST_FAILED, "out of memory");
    *num = 0;
    for (uint32_t i = 0; done && i < header->num_models; i++) {
        const karst_header_model *from = &header->models[i];
        if (!from->is_splats)
            continue;
        karst_splat_source *source = &sources[(*num)++];
        source->culls = from->culls;
        source->is_deep = !from->is_shallow;
        source->has_backs = from->has_backs;
        done = make_model(program, from, voxel_log2_m, &source->model, error);
    }
    if (done)
        return sources;
    karst_named_splats_free(sources, *num);
    return NULL;
}

void karst_named_splats_free(karst_splat_source *sources, size_t num)
{
    for (size_t i = 0; sources && i < num; i++)
        free((char *)sources[i].model.path);
    free(sources);
}

static bool names(const karst_program_graph *program, bool is_clear)
{
    return next_surface(&program->header, is_clear, 0) < program->header.num_models;
}

static karst_layer *create(const karst_layer_scene *scene, bool is_clear, karst_error *error)
{
    size_t num;
    karst_model *models = karst_named_models(scene->program, is_clear, scene->voxel_log2_m, &num, error);
    karst_layer *layer = models ? karst_points_layer_create(scene->context, KARST_SHAPE_AUTO, models, num,
                                                            scene->voxel_log2_m, scene->log, error)
                                : NULL;
    karst_named_models_free(models, num);
    return layer;
}

/* What they are made of is the program's. */
static bool same(const karst_program_graph *a, const karst_program_graph *b, bool is_clear)
{
    const karst_world_header *one = &a->header, *other = &b->header;
    bool same = strcmp(a->name, b->name) == 0;
    uint32_t i = next_surface(one, is_clear, 0), k = next_surface(other, is_clear, 0);
    for (; same && i < one->num_models && k < other->num_models; i = next_surface(one, is_clear, i + 1),
                                                                k = next_surface(other, is_clear, k + 1)) {
        const karst_header_model *m = &one->models[i], *n = &other->models[k];
        same = strcmp(m->points, n->points) == 0 && m->scale == n->scale &&
               memcmp(m->turn_deg, n->turn_deg, sizeof m->turn_deg) == 0;
        for (int axis = 0; axis < 3; axis++)
            same = same && strcmp(m->at[axis], n->at[axis]) == 0;
    }
    return same && i >= one->num_models && k >= other->num_models;
}

/* ---- in the land ---- */

static bool names_land(const karst_program_graph *program) { return names(program, false); }

static karst_layer *create_land(const karst_layer_scene *scene, karst_error *error)
{
    return create(scene, false, error);
}

static bool same_land(const karst_program_graph *a, const karst_program_graph *b) { return same(a, b, false); }

static bool has_colours(const karst_layer *layer)
{
    return karst_model_list_has_colours(karst_points_layer_list(layer));
}

const karst_layer_kind karst_points_kind = {.place = KARST_LAYER_LAND,
                                            .is_named = names_land,
                                            .create = create_land,
                                            .is_same = same_land,
                                            .has_colours = has_colours};

/* ---- of clear matter, whose surface has no colour ---- */

static bool names_clear(const karst_program_graph *program) { return names(program, true); }

static karst_layer *create_clear(const karst_layer_scene *scene, karst_error *error)
{
    return create(scene, true, error);
}

static bool same_clear(const karst_program_graph *a, const karst_program_graph *b) { return same(a, b, true); }

const karst_layer_kind karst_clear_points_kind = {
    .place = KARST_LAYER_CLEAR, .is_named = names_clear, .create = create_clear, .is_same = same_clear};
