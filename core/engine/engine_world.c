/* Which world an engine shows: finding its file, compiling it, and what draws and produces it. */
#include <math.h>
#include <stdlib.h>

#include "core/engine/engine_layers.h"
#include "producers/density/world_find.h"
#include "raycast/cast/splats.h"

static bool remember_values(karst_engine_world *world, const karst_world_config *config, karst_error *error)
{
    const karst_program_graph *program = world->file->program;
    world->seed = config->has_seed ? config->seed : program->header.seed;
    world->values = calloc(program->num_parameters + 1, sizeof *world->values);
    for (uint32_t i = 0; world->values && i < program->num_parameters; i++)
        world->values[i] = program->parameters[i].value;
    return (world->values && karst_fingerprint_init(&world->fingerprint, program, world->values, world->seed) &&
            karst_engine_world_mark_contents(world, world->values, world->seed)) ||
           karst_fail(error, KARST_FAILED, "out of memory");
}

static void show_what_samples_miss(karst_world_file *file, karst_thin thin)
{
    karst_world_file_raise_thin(file, thin);
    karst_world_file_smooth_jumps(file);
}

bool karst_engine_world_open(karst_engine_world *world, const karst_world_config *config, karst_thin thin,
                             karst_models_as as, karst_error *error)
{
    char path[PATH_MAX];
    *world = (karst_engine_world){.thin = thin};
    world->file = karst_world_find(config, path, error);
    if (world->file) {
        show_what_samples_miss(world->file, thin);
        karst_engine_world_show_models(world, as);
    }
    if (world->file && remember_values(world, config, error))
        return true;
    karst_engine_world_close(world);
    return false;
}

bool karst_engine_world_recompile(karst_engine_world *world, const karst_engine_world *old, const karst_number *values,
                                  karst_error *error)
{
    const karst_program_graph *program = old->file->program;
    karst_world_config config = {.has_seed = true, .seed = old->seed};
    *world = (karst_engine_world){.thin = old->thin};
    karst_parameter_value *given = calloc(program->num_parameters + 1, sizeof *given);
    if (!given)
        return karst_fail(error, KARST_FAILED, "out of memory");
    size_t num_given = 0;
    for (uint32_t i = 0; i < program->num_parameters; i++)
        if (!program->parameters[i].is_implicit)
            given[num_given++] = (karst_parameter_value){program->parameters[i].name, values[i].value};
    const karst_source *source = &program->source;
    world->file = karst_world_file_compile(program->name, source->text + source->user_begin,
                                           source->length - source->user_begin, given, num_given, NULL, error);
    free(given);
    if (world->file) {
        show_what_samples_miss(world->file, world->thin);
        karst_engine_world_show_models(world, old->models_as);
    }
    if (world->file && remember_values(world, &config, error))
        return true;
    karst_engine_world_close(world);
    return false;
}

void karst_engine_world_close(karst_engine_world *world)
{
    karst_engine_world_close_refiner(world);
    karst_engine_world_close_bending(world);
    karst_clear_shader_destroy(world->clear_shader);
    karst_engine_world_close_contents(world);
    karst_shader_destroy(world->shader);
    karst_skies_destroy(world->skies);
    karst_light_map_destroy(world->light_map);
    karst_producer_destroy(world->producer);
    karst_engine_world_close_layers(world);
    karst_splats_destroy(world->splats);
    karst_fingerprint_finish(&world->fingerprint);
    free(world->values);
    karst_world_file_destroy(world->file);
    *world = (karst_engine_world){0};
}

karst_shader *karst_engine_world_shader(const karst_engine_world *world, karst_context *context, unsigned ways,
                                        const karst_buffer *data, karst_error *error)
{
    if (world->file->info.has_atmosphere)
        ways |= KARST_SHADE_ATMOSPHERE;
    if (karst_engine_world_has_splats(world))
        ways |= KARST_SHADE_PAINT | KARST_SHADE_SPLATS;
    if (!world->file->code.colour_source)
        return karst_shader_create(context, ways, error);
    char options[KARST_WORLD_FILE_OPTIONS_BYTES];
    karst_world_file_colour_options(world->file, options);
    karst_shade_colour colour = {.source = world->file->code.colour_source, .options = options, .data = data};
    return karst_shader_create_coloured(context, ways, &colour, error);
}

karst_shader *karst_engine_tape_shader(karst_context *context, unsigned ways, const karst_buffer *data,
                                       karst_error *error)
{
    const karst_shade_colour colour = {
        .source = karst_tape_colours_source, .options = karst_tape_colours_options, .data = data};
    return karst_shader_create_coloured(context, ways, &colour, error);
}

bool karst_engine_world_build_skies(karst_engine_world *world, karst_context *context, karst_error *error)
{
    const karst_world_info *info = &world->file->info;
    if (!info->has_atmosphere)
        return true;
    if (!world->skies)
        world->skies = karst_skies_create(context, info->haze_globe_m, info->dust, error);
    if (world->skies)
        karst_shader_set_skies(world->shader, world->skies);
    if (world->skies && world->clear_shader)
        karst_clear_shader_set_skies(world->clear_shader, world->skies);
    return world->skies != NULL;
}

bool karst_engine_world_build(karst_engine_world *world, karst_context *context, const karst_cache_buffers *buffers,
                              const karst_engine_wishes *wishes, karst_error *error)
{
    const bool has_layers = wishes->has_layers || karst_engine_world_names_layers(world, KARST_LAYER_LAND);
    const karst_world_build build = {.shape = KARST_SHAPE_AUTO,
                                     .finalise_options = karst_cache_brick_option(buffers),
                                     .in_two_steps = has_layers,
                                     .start_on_host = wishes->start_on_host && !has_layers};
    world->producer =
        karst_world_file_producer_built(context, world->file, world->seed, wishes->max_loads, &build, error);
    /* After the producer, whose data a world's colours read. */
    world->shader = world->producer
                        ? karst_engine_world_shader(world, context, wishes->shade, world->producer->data[0], error)
                        : NULL;
    return world->shader && karst_engine_world_build_contents(world, context, buffers, wishes, error) &&
           karst_engine_world_build_clear(world, context, wishes, error) &&
           karst_engine_world_build_skies(world, context, error) &&
           (!wishes->has_light_map || karst_engine_world_open_light_map(world, context, error)) &&
           karst_engine_world_build_splats(world, context, error) &&
           (!wishes->refine ||
            karst_engine_world_make_refining(world, context, wishes->has_layers, &world->refining, error)) &&
           (!(wishes->has_photons && (world->file->info.has_own_mirror || world->file->info.mirror > 0)) ||
            karst_engine_world_build_photon_refiner(world, context, error));
}

bool karst_engine_set_view_distance(karst_engine *engine, const karst_world_info *info, karst_error *error)
{
    double voxel_m = exp2(info->voxel_log2_m);
    double distance_m = engine->view_distance_m != 0 ? engine->view_distance_m : info->view_distance_m;
    double distance_voxels = distance_m / voxel_m;
    if (!(distance_voxels >= 16 && distance_voxels <= 0x1p56))
        return karst_fail(error, KARST_USAGE, "a view distance of %g m: this world's goes from %g to %g", distance_m,
                          16 * voxel_m, 0x1p56 * voxel_m);
    engine->view_distance_voxels = distance_voxels;
    return true;
}
