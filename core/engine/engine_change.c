/* Changing the world that an engine shows. */
#include "karst/change.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/engine/engine_layers.h"
#include "producers/particles/particle_list.h"

void karst_engine_adopt_world(karst_engine *engine, const karst_engine_world *world)
{
    karst_engine_uncover(engine);
    engine->shown = *world;
    engine->world = &engine->shown.file->info;
    engine->producer = engine->shown.producer;
    engine->shader = engine->shown.shader;
    if (engine->colours && engine->shader)
        karst_shader_set_colours(engine->shader, engine->colours, karst_cache_get_buffers(engine->cache));
    karst_caster_set_splats(engine->caster, engine->shown.splats);
    if (engine->counting)
        karst_caster_set_splats(engine->counting, engine->shown.splats);
    engine->view_changed = true;
}

/* Forgets what was made of another density. */
static bool drop_content(karst_engine *engine, karst_error *error)
{
    engine->root_placed = false;
    engine->has_content = false;
    engine->view_changed = true;
    karst_cost_init(&engine->cost);
    return karst_cache_clear(engine->cache, error);
}

/* The same place in voxels of another width. A place too far away for them stays at the last that there is. */
static void rescale_position(karst_position *position, int from_log2_m, int to_log2_m)
{
    int finer = from_log2_m - to_log2_m; /* voxels become 2^finer times as many */
    for (int axis = 0; axis < 3; axis++) {
        __int128 fixed = (__int128)position->voxel[axis] * ((__int128)1 << 32) + position->fraction[axis];
        __int128 limit = (__int128)KARST_ENGINE_MAX_VOXEL << 32;
        for (int i = 0; i < finer && fixed < limit && fixed > -limit; i++)
            fixed *= 2;
        fixed >>= finer < 0 ? (-finer < 126 ? -finer : 126) : 0;
        fixed = fixed > limit ? limit : fixed < -limit ? -limit : fixed;
        position->voxel[axis] = (int64_t)(fixed >> 32);
        position->fraction[axis] = (uint32_t)fixed;
    }
}

/* Replaces the shown world by a built one, of which it takes everything. */
static bool replace_world(karst_engine *engine, karst_engine_world *world, bool *kept, karst_error *error)
{
    const karst_world_info *info = &world->file->info;
    if (!karst_engine_set_view_distance(engine, info, error))
        return false;
    bool same = karst_fingerprint_same(&engine->shown.fingerprint, &world->fingerprint) &&
                karst_engine_world_same_layers(&engine->shown, world, KARST_LAYER_LAND);
    bool changed[KARST_NUM_CONTENTS];
    karst_engine_changed_contents(&engine->shown, world, changed);
    if (!karst_engine_world_same_layers(&engine->shown, world, KARST_LAYER_CLEAR))
        changed[KARST_CONTENT_CLEAR] = true;
    if (!karst_engine_world_same_layers(&engine->shown, world, KARST_LAYER_AIR))
        changed[KARST_CONTENT_AIR] = true;
    karst_finish(engine->context, NULL); /* nothing may run of what goes */
    rescale_position(&engine->camera.position, engine->world->voxel_log2_m, info->voxel_log2_m);
    karst_engine_world_close(&engine->shown);
    karst_engine_adopt_world(engine, world);
    *world = (karst_engine_world){0};
    engine->reported_non_finite = false;
    engine->photons.is_aimed = false;
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        engine->stores[i].reported_non_finite = false;
    if (kept)
        *kept = same;
    return same ? karst_engine_forget_contents(engine, changed, error) : drop_content(engine, error);
}

static bool build(karst_engine *engine, karst_engine_world *world, karst_error *error)
{
    const karst_engine_wishes wishes = {engine->shade, engine->refine, engine->budget_bricks,
                                         engine->budget_ns > 0, engine->edits != NULL,
                                         karst_engine_contents(engine),
                                         karst_engine_has_caustics(engine),
                                         engine->paths && engine->integrator == KARST_INTEGRATOR_DIRECT};
    return karst_engine_world_build(world, engine->context, karst_cache_get_buffers(engine->cache), &wishes, error) &&
           karst_engine_world_set_layers(engine, world, error);
}

/* ---- parameters ---- */

static const karst_world_parameter *find_parameter(const karst_engine *engine, const char *name, karst_error *error)
{
    const karst_program_graph *program = engine->shown.file->program;
    for (uint32_t i = 0; i < program->num_parameters; i++)
        if (!program->parameters[i].is_implicit && !strcmp(program->parameters[i].name, name))
            return &program->parameters[i];
    karst_fail(error, KARST_USAGE, "the world %s has no parameter '%s'", engine->world->name, name);
    return NULL;
}

bool karst_engine_parameter(const karst_engine *engine, const char *name, double *value, karst_error *error)
{
    const karst_world_parameter *parameter = find_parameter(engine, name, error);
    if (!parameter)
        return false;
    *value = engine->shown.values[parameter - engine->shown.file->program->parameters].value;
    return true;
}

/* The values in force with those given in their place; malloc'ed. */
static karst_number *merge_values(const karst_engine *engine, const karst_parameter *parameters, size_t num_parameters,
                                  bool *needs_compiling, karst_error *error)
{
    const karst_engine_world *shown = &engine->shown;
    size_t size = (shown->file->program->num_parameters + 1) * sizeof *shown->values;
    karst_number *values = malloc(size);
    if (!values) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    memcpy(values, shown->values, size);
    *needs_compiling = false;
    for (size_t i = 0; i < num_parameters; i++) {
        const karst_world_parameter *parameter = find_parameter(engine, parameters[i].name, error);
        if (!parameter || isnan(parameters[i].value)) {
            if (parameter)
                karst_fail(error, KARST_USAGE, "parameter %s: not a number", parameters[i].name);
            free(values);
            return NULL;
        }
        karst_number *value = &values[parameter - shown->file->program->parameters];
        karst_number wanted = karst_number_shortest(fmin(fmax(parameters[i].value, parameter->min), parameter->max));
        *needs_compiling = *needs_compiling || (parameter->is_structural && !karst_number_same(*value, wanted));
        *value = wanted;
    }
    return values;
}

static bool apply_time(karst_engine *engine, karst_error *error);

/* Takes the values. */
static bool recompile(karst_engine *engine, karst_number *values, karst_error *error)
{
    karst_engine_world world;
    bool done = karst_engine_world_recompile(&world, &engine->shown, values, error);
    if (done && !(done = build(engine, &world, error) && replace_world(engine, &world, NULL, error)))
        karst_engine_world_close(&world);
    free(values);
    return done && apply_time(engine, error);
}

bool karst_engine_set_parameters(karst_engine *engine, const karst_parameter *parameters, size_t num_parameters,
                                 karst_error *error)
{
    bool needs_compiling;
    karst_number *values = merge_values(engine, parameters, num_parameters, &needs_compiling, error);
    if (!values)
        return false;
    return needs_compiling ? recompile(engine, values, error) : karst_engine_take_values(engine, values, error);
}

bool karst_engine_take_values(karst_engine *engine, karst_number *values, karst_error *error)
{
    karst_engine_world *shown = &engine->shown;
    karst_fingerprint fingerprint;
    if (!karst_engine_move_layers(engine, values, error)) {
        free(values);
        return false;
    }
    if (!karst_fingerprint_init(&fingerprint, shown->file->program, values, shown->seed)) {
        free(values);
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    if (!karst_world_file_set_parameters(engine->producer, shown->file, values, shown->seed, error)) {
        karst_fingerprint_finish(&fingerprint);
        free(values);
        return false;
    }
    bool same = karst_fingerprint_same(&shown->fingerprint, &fingerprint);
    if (!karst_engine_set_content_parameters(engine, values, error)) {
        karst_fingerprint_finish(&fingerprint);
        free(values);
        return false;
    }
    free(shown->values);
    karst_fingerprint_finish(&shown->fingerprint);
    shown->values = values;
    shown->fingerprint = fingerprint;
    if (!karst_engine_world_update_refiner(shown, error))
        return false;
    engine->view_changed = true;
    return same || drop_content(engine, error);
}

/* ---- the time ---- */

bool karst_program_put_time(const karst_program_graph *program, double time_s, karst_number *values)
{
    for (uint32_t i = 0; i < program->num_parameters; i++)
        if (program->parameters[i].is_implicit && strcmp(program->parameters[i].name, "iTime") == 0) {
            values[i] = karst_number_shortest(time_s);
            return true;
        }
    return false;
}

/* iTime becomes the engine's time. Errors: KARST_USAGE, KARST_FAILED. */
static bool apply_time(karst_engine *engine, karst_error *error)
{
    const karst_program_graph *program = engine->shown.file->program;
    const size_t size = (program->num_parameters + 1) * sizeof(karst_number);
    karst_number *values = malloc(size);
    if (!values)
        return karst_fail(error, KARST_FAILED, "out of memory");
    memcpy(values, engine->shown.values, size);
    if (!karst_program_put_time(program, engine->time_s, values) || !memcmp(values, engine->shown.values, size)) {
        free(values);
        return true;
    }
    for (uint32_t i = 0; i < program->num_parameters; i++)
        if (program->parameters[i].is_implicit && program->parameters[i].is_structural &&
            strcmp(program->parameters[i].name, "iTime") == 0) {
            free(values);
            return karst_fail(error, KARST_USAGE, "%s: iTime decides what is compiled, so time stands still there",
                              engine->world->name);
        }
    return karst_engine_take_values(engine, values, error);
}

bool karst_engine_set_time(karst_engine *engine, double time_s, karst_error *error)
{
    const double before_s = engine->time_s;
    if (!(time_s >= -KARST_MOST_TIME_S && time_s <= KARST_MOST_TIME_S))
        return karst_fail(error, KARST_USAGE, "a time of %g s: times go from -1e9 to 1e9 s", time_s);
    if (time_s == before_s)
        return true;
    engine->time_s = time_s;
    if (apply_time(engine, error) && karst_engine_move_layers(engine, NULL, error))
        return true;
    engine->time_s = before_s;
    apply_time(engine, NULL);
    return false;
}

double karst_engine_time(const karst_engine *engine) { return engine->time_s; }

/* ---- another world ---- */

struct karst_prepared_world {
    karst_engine_world world;
};

karst_prepared_world *karst_engine_prepare_world(karst_engine *engine, const karst_world_config *config,
                                                 karst_error *error)
{
    karst_prepared_world *prepared = calloc(1, sizeof *prepared);
    if (!prepared) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    if (karst_engine_world_open(&prepared->world, config, engine->shown.thin, engine->shown.models_as, error) &&
        karst_engine_try_world(engine, &prepared->world, error))
        return prepared;
    karst_prepared_world_destroy(prepared);
    return NULL;
}

void karst_prepared_world_destroy(karst_prepared_world *world)
{
    if (!world)
        return;
    karst_engine_world_close(&world->world);
    free(world);
}

bool karst_engine_change_world(karst_engine *engine, karst_prepared_world *world, bool *kept, karst_error *error)
{
    bool done = build(engine, &world->world, error) && replace_world(engine, &world->world, kept, error) &&
                karst_engine_colour_layers(engine, error) && apply_time(engine, error);
    karst_prepared_world_destroy(world);
    return done;
}

/* ---- other colours, at once ---- */

bool karst_engine_prepare_colours(karst_engine *engine, karst_error *error)
{
    if (!engine->has_tape_colours && !karst_engine_try_tape_colours(engine, error))
        return false;
    engine->has_tape_colours = true;
    return true;
}

/* Shows an open world in place of one with the same density, if that is so; takes it over then. */
static bool take_colours(karst_engine *engine, karst_engine_world *world, bool *shown, karst_error *error)
{
    karst_engine_world *old = &engine->shown;
    if (!world->file->has_tape_colours || karst_engine_contents(engine) || engine->refine ||
        world->file->info.has_atmosphere || old->splats || karst_engine_world_has_splats(world) ||
        world->file->info.voxel_log2_m != engine->world->voxel_log2_m ||
        !karst_fingerprint_same(&old->fingerprint, &world->fingerprint) ||
        !karst_engine_world_same_layers(old, world, KARST_LAYER_LAND) ||
        !karst_engine_set_view_distance(engine, &world->file->info, error))
        return true;
    bool is_same = false;
    if (!karst_finish(engine->context, error) ||
        !karst_world_file_convert(old->producer, old->file, world->file, world->seed, &is_same, error))
        return false;
    if (!is_same)
        return karst_engine_set_view_distance(engine, engine->world, error);
    world->producer = old->producer;
    old->producer = NULL;
    karst_engine_world_hand_layers(old, world);
    world->shader = karst_engine_tape_shader(engine->context, engine->shade, world->producer->data[0], error);
    karst_engine_world_close(old);
    karst_engine_adopt_world(engine, world);
    *world = (karst_engine_world){0};
    *shown = engine->shader != NULL;
    return *shown;
}

bool karst_engine_show_colours(karst_engine *engine, const karst_world_config *config, bool *shown, karst_error *error)
{
    karst_engine_world world;
    *shown = false;
    if (!engine->has_tape_colours)
        return true;
    if (!karst_engine_world_open(&world, config, engine->shown.thin, engine->shown.models_as, error))
        return false;
    bool done = take_colours(engine, &world, shown, error);
    karst_engine_world_close(&world);
    return done;
}
