/* Particles as a layer (producers/layer.h) of the air: their extinction is added to the world's own. */
#ifndef KARST_PRODUCERS_PARTICLES_H
#define KARST_PRODUCERS_PARTICLES_H

#include "producers/layer.h"
#include "producers/particles/particle_list.h"
#include "producers/steps/shape.h"

/* A layer of what these groups have at a time. Its kernels are built here. Errors: as karst_particle_list_init. */
karst_layer *karst_particles_layer_create(karst_context *context, karst_shape shape, const karst_particle_group *groups,
                                          size_t num, int voxel_log2_m, double time_s, karst_error *error);
const karst_particle_list *karst_particles_layer_list(const karst_layer *layer);
/* Moves the particles to another time, and remembers which boxes changed. Work that is enqueued must be done. Errors:
 * KARST_USAGE (then nothing has moved), KARST_FAILED. */
bool karst_particles_layer_set_time(karst_layer *layer, double time_s, karst_error *error);
/* The same with other groups: what is different is dirty. */
bool karst_particles_layer_set_groups(karst_layer *layer, const karst_particle_group *groups, size_t num,
                                      double time_s, karst_error *error);

#endif
