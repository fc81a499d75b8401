/* The world 'hills' on every shape of device and on the host. */
#define WORLD_NAME "hills"
#define WORLD_SEED 1u
#define WORLD_VOXEL_LOG2_M (-4)
#include "producers/worlds/hills.clh"

#include "tests/producers/world_suite.h"

int main(void) { return run_world_suite(0xe21c8d0775b8286cu, 0x77d73d2cc89ee992u); }
