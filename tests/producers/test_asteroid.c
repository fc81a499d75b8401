/* The world 'asteroid' on every shape of device and on the host. */
#define WORLD_NAME "asteroid"
#define WORLD_SEED 1u
#define WORLD_VOXEL_LOG2_M (-4)
#include "producers/worlds/asteroid.clh"

#include "tests/producers/world_suite.h"

int main(void) { return run_world_suite(0x41bc0f374d550a25u, 0xe24395be2d0c8f25u); }
