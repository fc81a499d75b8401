/* Particles of worlds, for what follows single rays, too. Only core/engine/ includes this. */
#ifndef KARST_CORE_ENGINE_PARTICLES_H
#define KARST_CORE_ENGINE_PARTICLES_H

#include "core/base/beside.h"
#include "core/engine/engine_parts.h"
#include "producers/particles/particles.h"

/* The groups that a world's header names, with these values of its parameters. */
typedef struct {
    karst_particle_group *groups;
    char (*paths)[KARST_BESIDE_BYTES];
    size_t num;
} karst_world_groups;

/* Errors: KARST_BAD_DATA (a path that is too long), KARST_FAILED; there is something to finish all the same. */
bool karst_world_groups_init(karst_world_groups *groups, const karst_world_file *file, const karst_number *values,
                             karst_error *error);
void karst_world_groups_finish(karst_world_groups *groups);

/* Where a text asks for iTime: that. Returns whether it does. */
bool karst_program_put_time(const karst_program_graph *program, double time_s, karst_number *values);

#endif
