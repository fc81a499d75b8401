/* Models that are shown as discs: what the caster of the land meets beside it (raycast/cast/splats.h). */
#include <stdlib.h>
#include <string.h>

#include "core/engine/engine_parts.h"
#include "producers/points/points_kind.h"
#include "raycast/cast/splats.h"

/* Of the device's memory, and of a buffer. */
static uint64_t most_bytes(const karst_context *context)
{
    const uint64_t share = context->global_memory_bytes / 4;
    return share < context->max_allocation_bytes ? share : context->max_allocation_bytes;
}

bool karst_engine_world_has_splats(const karst_engine_world *world)
{
    const karst_world_header *header = &world->file->program->header;
    for (uint32_t i = 0; i < header->num_models; i++)
        if (header->models[i].is_splats)
            return true;
    return false;
}

void karst_engine_world_show_models(karst_engine_world *world, karst_models_as as)
{
    karst_world_header *header = &world->file->program->header;
    world->models_as = as;
    if (as == KARST_MODELS_NONE)
        header->num_models = 0;
    for (uint32_t i = 0; as != KARST_MODELS_OF_WORLD && i < header->num_models; i++) {
        karst_header_model *model = &header->models[i];
        if (model->is_clear) /* a body, whatever the rest is shown as */
            continue;
        model->is_splats = as != KARST_MODELS_SURFACE;
        model->is_shallow = as == KARST_MODELS_SPLATS_LEAF || as == KARST_MODELS_SPLATS_LEAF_CULLED;
        model->culls = as == KARST_MODELS_SPLATS_CULLED || as == KARST_MODELS_SPLATS_LEAF_CULLED;
    }
}

static karst_splats *make(const karst_splat_list *list, karst_context *context, karst_error *error)
{
    karst_splat_place *places = calloc(list->num_models, sizeof *places);
    if (!places) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    for (uint32_t i = 0; i < list->num_models; i++) {
        const karst_model_record *from = &list->places[i];
        places[i].shift = from->shift;
        for (int a = 0; a < 3; a++) {
            places[i].at[a] = from->at[a];
            places[i].offset[a] = from->offset[a];
        }
        for (int k = 0; k < 9; k++)
            places[i].matrix[k] = from->matrix[k];
    }
    karst_splats *splats =
        karst_splats_create(context, list->data, list->size_bytes, places, list->num_models, error);
    free(places);
    return splats;
}

bool karst_engine_world_build_splats(karst_engine_world *world, karst_context *context, karst_error *error)
{
    const int voxel_log2_m = world->file->info.voxel_log2_m;
    karst_splat_list list = {.data = NULL};
    size_t num;
    if (!karst_engine_world_has_splats(world))
        return true;
    karst_splat_source *sources = karst_named_splats(world->file->program, voxel_log2_m, &num, error);
    const bool done = sources && karst_splat_list_init(&list, sources, num, voxel_log2_m, most_bytes(context),
                                                       context->log, error) &&
                      (world->splats = make(&list, context, error)) != NULL;
    if (done)
        world->splat_stats = (karst_stats_splats){.num_points = list.counts.num_points,
                                                  .num_discs = list.counts.num_discs,
                                                  .num_copies = list.counts.num_copies,
                                                  .num_culled = list.counts.num_culled,
                                                  .num_leaves = list.counts.num_leaves,
                                                  .size_bytes = list.size_bytes};
    karst_splat_list_finish(&list);
    karst_named_splats_free(sources, num);
    return done;
}
