/* Particles that a world's header names. */
#include "core/engine/engine_particles.h"

#include <stdlib.h>
#include <string.h>

/* ---- what the header says ---- */

static double number_of(const karst_program_graph *program, const karst_number *values, karst_header_number number)
{
    for (uint32_t i = 0; number.parameter && i < program->num_parameters; i++)
        if (!program->parameters[i].is_implicit && strcmp(program->parameters[i].name, number.parameter) == 0)
            return values[i].value;
    return number.value;
}

static bool make_group(const karst_world_file *file, const karst_number *values, const karst_header_particles *from,
                       karst_particle_group *to, char path[KARST_BESIDE_BYTES], karst_error *error)
{
    static const karst_emitter_shape shapes[KARST_NUM_HEADER_EMITTERS] = {KARST_EMITTER_BALL, KARST_EMITTER_BOX,
                                                                          KARST_EMITTER_DISC};
    const karst_program_graph *program = file->program;
    karst_emitter *emitter = &to->emitter;
    *to = (karst_particle_group){.path = from->file ? path : NULL, .is_sum = from->is_sum};
    *emitter = (karst_emitter){.shape = shapes[from->emitter],
                               .spread_m_s = from->spread,
                               .stray_m = from->stray,
                               .count = number_of(program, values, from->count),
                               .life_s = from->life,
                               .radius_m = {number_of(program, values, from->radius[0]),
                                            number_of(program, values, from->radius[1])},
                               .extinction = number_of(program, values, from->extinction),
                               .fade = from->fade,
                               .seed = from->seed};
    memcpy(emitter->size_m, from->size, sizeof emitter->size_m);
    memcpy(emitter->velocity_m_s, from->velocity, sizeof emitter->velocity_m_s);
    return (!from->file || karst_path_beside(program->name, from->file, path, error)) &&
           karst_position_parse(from->at[0], from->at[1], from->at[2], file->info.voxel_log2_m, &to->at, error);
}

bool karst_world_groups_init(karst_world_groups *groups, const karst_world_file *file, const karst_number *values,
                             karst_error *error)
{
    const karst_world_header *header = &file->program->header;
    bool done;
    groups->num = header->num_particles;
    groups->groups = calloc(groups->num + 1, sizeof *groups->groups);
    groups->paths = calloc(groups->num + 1, sizeof *groups->paths);
    done = (groups->groups && groups->paths) || karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; done && i < groups->num; i++)
        done = make_group(file, values, &header->particles[i], &groups->groups[i], groups->paths[i], error);
    return done;
}

void karst_world_groups_finish(karst_world_groups *groups)
{
    free(groups->groups);
    free(groups->paths);
    *groups = (karst_world_groups){0};
}

bool karst_engine_world_has_particles(const karst_engine_world *world)
{
    return world->file->program->header.num_particles > 0;
}

static bool names_parameters(const karst_world_header *header)
{
    for (uint32_t i = 0; i < header->num_particles; i++) {
        const karst_header_particles *p = &header->particles[i];
        if (p->count.parameter || p->radius[0].parameter || p->radius[1].parameter || p->extinction.parameter)
            return true;
    }
    return false;
}

/* ---- the layer ---- */

bool karst_engine_world_set_particles(karst_engine *engine, karst_engine_world *world, karst_error *error)
{
    karst_producer *producer = world->content[KARST_CONTENT_AIR].producer;
    const karst_world_file *file = world->file->content[KARST_CONTENT_AIR];
    karst_world_groups groups;
    if (!karst_engine_world_has_particles(world) || !producer || world->particles)
        return true;
    if (karst_world_groups_init(&groups, world->file, world->values, error))
        world->particles = karst_particles_layer_create(engine->context, KARST_SHAPE_AUTO, groups.groups, groups.num,
                                                        world->file->info.voxel_log2_m, engine->time_s, error);
    karst_world_groups_finish(&groups);
    char finalise[64];
    const karst_world_build build = karst_engine_air_build(
        karst_store_get_buffers(engine->stores[KARST_CONTENT_AIR].store), finalise);
    return world->particles && karst_finish(engine->context, error) &&
           karst_world_file_set_layers(producer, file, &build, &world->particles, 1, NULL, error);
}

/* What changed is forgotten, as drop_dirty (engine_edit.c) does it, in the air alone. */
static bool drop_dirty(karst_engine *engine, karst_error *error)
{
    karst_layer *particles = engine->shown.particles;
    const karst_drop_box *boxes;
    const size_t num = particles->ops->take_dirty(particles, &boxes);
    karst_dropped dropped = {0};
    if (num == 0)
        return true;
    engine->view_changed = true;
    engine->media_moves = true;
    return karst_store_drop(engine->stores[KARST_CONTENT_AIR].store, boxes, num, engine->serial, &dropped, error);
}

bool karst_engine_move_particles(karst_engine *engine, const karst_number *values, karst_error *error)
{
    karst_engine_world *world = &engine->shown;
    karst_world_groups groups;
    if (!world->particles || (values && !names_parameters(&world->file->program->header)))
        return true;
    if (!karst_finish(engine->context, error))
        return false;
    if (!values)
        return karst_particles_layer_set_time(world->particles, engine->time_s, error) && drop_dirty(engine, error);
    const bool moved = karst_world_groups_init(&groups, world->file, values, error) &&
                       karst_particles_layer_set_groups(world->particles, groups.groups, groups.num, engine->time_s,
                                                        error);
    karst_world_groups_finish(&groups);
    return moved && drop_dirty(engine, error);
}

bool karst_program_put_time(const karst_program_graph *program, double time_s, karst_number *values)
{
    for (uint32_t i = 0; i < program->num_parameters; i++)
        if (program->parameters[i].is_implicit && strcmp(program->parameters[i].name, "iTime") == 0) {
            values[i] = karst_number_shortest(time_s);
            return true;
        }
    return false;
}
