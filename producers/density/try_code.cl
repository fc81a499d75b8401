/* A density program, or a world's colours, and an empty kernel: compilers read all of it and translate none. See
 * try_code.h. */
#include "core/device/lanes.clh"
#include "producers/steps/density.clh"
#include "world.clh"

__kernel void try_code(void) {}
