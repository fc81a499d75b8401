/* Lists of particles from inside: what their files have in common. */
#ifndef KARST_PRODUCERS_PARTICLE_INTERNAL_H
#define KARST_PRODUCERS_PARTICLE_INTERNAL_H

#include "producers/particles/particle_list.h"

struct karst_particle_row {
    double at_m[3], radius_m, extinction, velocity_m_s[3];
};

/* particle_rows.c. A file's particles, malloc'ed. Errors: as karst_particle_list_init. */
karst_particle_row *karst_particle_rows_load(const char *path, uint64_t *num, karst_error *error);
/* particle_emit.c. Where particle number i of an emitter is, and what; from the emitter. */
void karst_emitter_particle(const karst_emitter *emitter, uint32_t i, double time_s, karst_ball *ball);
/* particle_block.c. Makes list->data from list->balls. Errors: KARST_USAGE, KARST_FAILED. */
bool karst_particle_block_make(karst_particle_list *list, karst_error *error);

#endif
