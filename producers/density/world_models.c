#include "producers/density/world_models.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/beside.h"

static bool make_model(const karst_world_file *file, const karst_header_model *from, karst_model *model,
                       karst_error *error)
{
    char *path = malloc(KARST_BESIDE_BYTES);
    *model = (karst_model){.path = path, .scale = from->scale};
    memcpy(model->turn_deg, from->turn_deg, sizeof model->turn_deg);
    if (!path)
        return karst_fail(error, KARST_FAILED, "out of memory");
    return karst_path_beside(file->program->name, from->points, path, error) &&
           karst_position_parse(from->at[0], from->at[1], from->at[2], file->info.voxel_log2_m, &model->at, error);
}

karst_model *karst_world_models(const karst_world_file *file, size_t *num, karst_error *error)
{
    const karst_world_header *header = &file->program->header;
    karst_model *models = calloc(header->num_models + 1, sizeof *models);
    bool done = models || karst_fail(error, KARST_FAILED, "out of memory");
    *num = header->num_models;
    for (uint32_t i = 0; done && i < header->num_models; i++)
        done = make_model(file, &header->models[i], &models[i], error);
    if (done)
        return models;
    karst_world_models_free(models, *num);
    return NULL;
}

void karst_world_models_free(karst_model *models, size_t num)
{
    for (size_t i = 0; models && i < num; i++)
        free((char *)models[i].path);
    free(models);
}
