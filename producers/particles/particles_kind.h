/* The particles that a world's header names: see docs/WORLDS.md. */
#ifndef KARST_PRODUCERS_PARTICLES_KIND_H
#define KARST_PRODUCERS_PARTICLES_KIND_H

#include "producers/layer_kind.h"
#include "producers/particles/particles.h"

extern const karst_layer_kind karst_particles_kind;

#endif
