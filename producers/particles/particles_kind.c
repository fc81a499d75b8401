/* Particles that a world's header names. */
#include "producers/particles/particles_kind.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/beside.h"

/* What a header names, with these values of its parameters. */
typedef struct {
    karst_particle_group *groups;
    char (*paths)[KARST_BESIDE_BYTES];
    size_t num;
} named_groups;

static double number_of(const karst_layer_scene *scene, karst_header_number number)
{
    const karst_program_graph *program = scene->program;
    for (uint32_t i = 0; number.parameter && i < program->num_parameters; i++)
        if (!program->parameters[i].is_implicit && strcmp(program->parameters[i].name, number.parameter) == 0)
            return scene->values[i].value;
    return number.value;
}

static bool make_group(const karst_layer_scene *scene, const karst_header_particles *from, karst_particle_group *to,
                       char path[KARST_BESIDE_BYTES], karst_error *error)
{
    static const karst_emitter_shape shapes[KARST_NUM_HEADER_EMITTERS] = {KARST_EMITTER_BALL, KARST_EMITTER_BOX,
                                                                          KARST_EMITTER_DISC};
    karst_emitter *emitter = &to->emitter;
    *to = (karst_particle_group){.path = from->file ? path : NULL, .is_sum = from->is_sum};
    *emitter = (karst_emitter){.shape = shapes[from->emitter],
                               .spread_m_s = from->spread,
                               .stray_m = from->stray,
                               .count = number_of(scene, from->count),
                               .life_s = from->life,
                               .radius_m = {number_of(scene, from->radius[0]), number_of(scene, from->radius[1])},
                               .extinction = number_of(scene, from->extinction),
                               .fade = from->fade,
                               .seed = from->seed};
    memcpy(emitter->size_m, from->size, sizeof emitter->size_m);
    memcpy(emitter->velocity_m_s, from->velocity, sizeof emitter->velocity_m_s);
    return (!from->file || karst_path_beside(scene->program->name, from->file, path, error)) &&
           karst_position_parse(from->at[0], from->at[1], from->at[2], scene->voxel_log2_m, &to->at, error);
}

/* There is something to finish whether it succeeds or not. */
static bool init_groups(named_groups *groups, const karst_layer_scene *scene, karst_error *error)
{
    const karst_world_header *header = &scene->program->header;
    groups->num = header->num_particles;
    groups->groups = calloc(groups->num + 1, sizeof *groups->groups);
    groups->paths = calloc(groups->num + 1, sizeof *groups->paths);
    bool done = (groups->groups && groups->paths) || karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; done && i < groups->num; i++)
        done = make_group(scene, &header->particles[i], &groups->groups[i], groups->paths[i], error);
    return done;
}

static void finish_groups(named_groups *groups)
{
    free(groups->groups);
    free(groups->paths);
}

static bool is_named(const karst_program_graph *program) { return program->header.num_particles > 0; }

static karst_layer *create(const karst_layer_scene *scene, karst_error *error)
{
    named_groups groups;
    karst_layer *layer = NULL;
    if (init_groups(&groups, scene, error))
        layer = karst_particles_layer_create(scene->context, KARST_SHAPE_AUTO, groups.groups, groups.num,
                                             scene->voxel_log2_m, scene->time_s, error);
    finish_groups(&groups);
    return layer;
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

static bool move(karst_layer *layer, const karst_layer_scene *scene, karst_error *error)
{
    named_groups groups;
    if (!scene->values)
        return karst_particles_layer_set_time(layer, scene->time_s, error);
    if (!names_parameters(&scene->program->header))
        return true;
    const bool moved = init_groups(&groups, scene, error) &&
                       karst_particles_layer_set_groups(layer, groups.groups, groups.num, scene->time_s, error);
    finish_groups(&groups);
    return moved;
}

const karst_layer_kind karst_particles_kind = {
    .place = KARST_LAYER_AIR, .is_named = is_named, .create = create, .move = move};
