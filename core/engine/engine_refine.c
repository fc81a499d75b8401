/* What refining hits needs of a world: its gradient as generated code, and the data that this reads. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/engine/engine_layers.h"
#include "producers/edits/edits.h"
#include "producers/language/emit/emit.h"
#include "producers/points/points_kind.h"

bool karst_engine_update_refining(karst_engine_refining *refining, const karst_engine_world *world,
                                  karst_error *error)
{
    if (!refining->data)
        return true;
    const karst_world_layout *layout = &refining->layout;
    const size_t size_bytes = layout->num_words * sizeof(uint64_t),
                 header_bytes = KARST_DATA_HEADER_WORDS * sizeof(uint64_t);
    char *words = calloc(1, size_bytes);
    bool done =
        words && karst_world_data_fill(layout, world->values, world->seed, world->file->info.voxel_log2_m, words)
            ? karst_buffer_write(refining->data, header_bytes, words + header_bytes, size_bytes - header_bytes, error)
            : karst_fail(error, KARST_FAILED, "out of memory");
    free(words);
    return done;
}

bool karst_engine_world_update_refiner(karst_engine_world *world, karst_error *error)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        if (!karst_engine_update_refining(&world->content[i].refining, world, error))
            return false;
    karst_engine_refining *const others[] = {&world->bending.index, &world->bending.sides, &world->refining,
                                             &world->photon_refining};
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        if (!karst_engine_update_refining(others[i], world, error))
            return false;
    return true;
}

/* What a refiner is for: land with these layers, or rays, and those into clear matter. */
enum { OF_EDITS = 1, OF_MODELS = 2, OF_RAYS = 4, OF_CLEAR = 8 };

static karst_refiner *make_refiner(const karst_engine_refining *refining, const karst_world_file *file, unsigned what,
                                   karst_context *context, karst_error *error)
{
    static const char of_layers[] = "\n#include \"core/engine/engine_refine_layers.clh\"\n";
    const bool has_layers = (what & (OF_EDITS | OF_MODELS)) != 0;
    char *source = NULL, options[80];
    if (!karst_emit_surface(&refining->layout, &source, error))
        return NULL;
    if (has_layers) {
        const size_t length = strlen(source);
        char *both = realloc(source, length + sizeof of_layers);
        if (!both) {
            free(source);
            karst_fail(error, KARST_FAILED, "out of memory");
            return NULL;
        }
        source = both;
        memcpy(source + length, of_layers, sizeof of_layers);
    }
    snprintf(options, sizeof options, "-DWORLD_HAS_DATA%s%s", what & OF_EDITS ? " -DREFINE_EDITS" : "",
             what & OF_MODELS ? " -DREFINE_MODELS" : "");
    const karst_refine_world refined = {.source = source,
                                        .options = options,
                                        .data = refining->data,
                                        .voxel_m = ldexp(1, file->info.voxel_log2_m),
                                        .has_layer = has_layers,
                                        .may_be_thin = what & OF_CLEAR};
    karst_refiner *refiner = what & OF_RAYS ? karst_refiner_create_for_rays(context, &refined, error)
                                            : karst_refiner_create(context, &refined, error);
    free(source);
    return refiner;
}

bool karst_engine_derive(karst_engine_refining *refining, const karst_engine_world *world,
                         const karst_resolved_world *density, karst_context *context, karst_error *error)
{
    refining->gradient = karst_derive(density, error);
    if (!refining->gradient)
        return false;
    if (!karst_world_layout_init(&refining->layout, &refining->gradient->world))
        return karst_fail(error, KARST_BAD_WORLD, "%.300s: its gradient needs too much memory", world->file->info.name);
    refining->data = karst_buffer_create(context, "refine", refining->layout.num_words * sizeof(uint64_t), NULL, error);
    return refining->data && karst_engine_update_refining(refining, world, error);
}

static bool build(karst_engine_refining *refining, const karst_engine_world *world, const karst_world_file *file,
                  unsigned what, karst_context *context, karst_error *error)
{
    if (!karst_engine_derive(refining, world, &file->program->world, context, error))
        return false;
    refining->refiner = make_refiner(refining, file, what, context, error);
    return refining->refiner != NULL;
}

void karst_engine_finish_refining(karst_engine_refining *refining)
{
    karst_refiner_destroy(refining->refiner);
    karst_buffer_destroy(refining->data);
    karst_gradient_world_destroy(refining->gradient);
    *refining = (karst_engine_refining){.refiner = NULL};
}

bool karst_engine_world_make_refining(const karst_engine_world *world, karst_context *context, bool has_edits,
                                      karst_engine_refining *refining, karst_error *error)
{
    *refining = (karst_engine_refining){.refiner = NULL};
    const unsigned what =
        (has_edits ? OF_EDITS : 0u) | (karst_points_kind.is_named(world->file->program) ? (unsigned)OF_MODELS : 0u);
    if (build(refining, world, world->file, what, context, error))
        return true;
    karst_engine_finish_refining(refining);
    return false;
}

/* None where the gradient is too large. */
static bool build_for_rays(karst_engine_refining *refining, const karst_engine_world *world,
                           const karst_world_file *file, karst_context *context, karst_error *error)
{
    karst_error why = {0};
    const unsigned models = file == world->file->content[KARST_CONTENT_CLEAR] &&
                                    karst_clear_points_kind.is_named(world->file->program)
                                ? OF_MODELS
                                : 0u;
    const unsigned clear = file == world->file->content[KARST_CONTENT_CLEAR] ? OF_CLEAR : 0u;
    if (!file || build(refining, world, file, OF_RAYS | models | clear, context, &why))
        return true;
    karst_engine_finish_refining(refining);
    return why.status == KARST_BAD_WORLD || karst_fail(error, why.status, "%s", why.message);
}

bool karst_engine_world_build_clear_refiner(karst_engine_world *world, karst_context *context, karst_error *error)
{
    return build_for_rays(&world->content[KARST_CONTENT_CLEAR].refining, world,
                          world->file->content[KARST_CONTENT_CLEAR], context, error);
}

bool karst_engine_world_build_photon_refiner(karst_engine_world *world, karst_context *context, karst_error *error)
{
    return build_for_rays(&world->photon_refining, world, world->file, context, error);
}

void karst_engine_world_close_refiner(karst_engine_world *world)
{
    karst_engine_finish_refining(&world->refining);
    karst_engine_finish_refining(&world->photon_refining);
    karst_engine_finish_refining(&world->content[KARST_CONTENT_CLEAR].refining);
}

bool karst_engine_refine(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                         karst_error *error)
{
    return karst_engine_refine_hits(engine, view, pinhole, engine->hits, error);
}

bool karst_engine_refine_hits(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                              karst_buffer *hits, karst_error *error)
{
    karst_shade_anchor anchor = {.pad = 0};
    memcpy(anchor.voxel, engine->drawn.position.voxel, sizeof anchor.voxel);
    memcpy(anchor.fraction, engine->drawn.position.fraction, sizeof anchor.fraction);
    karst_refiner *refiner = engine->shown.refining.refiner;
    const karst_layer *points = karst_engine_world_layer(&engine->shown, &karst_points_kind);
    const karst_buffer *models = points ? karst_points_layer_data(points) : NULL;
    if (refiner && engine->edits)
        karst_refiner_set_layer(refiner, karst_edits_data(engine->edits), models);
    else if (refiner && models)
        karst_refiner_set_layer(refiner, models, NULL);
    return !refiner || karst_refine_hits(refiner, view, pinhole, &anchor, hits, error);
}
