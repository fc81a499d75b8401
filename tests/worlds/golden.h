/* Of each shipped world: hashes of its samples and of its encoded bricks (test_golden.c). */
#ifndef KARST_TESTS_WORLDS_GOLDEN_H
#define KARST_TESTS_WORLDS_GOLDEN_H

#include <stdint.h>

typedef struct {
    const char *name;
    uint64_t samples, bricks;
} golden_hashes;

static const golden_hashes golden[] = {
    {"alps", 0xb8c3f2a1f5bd3018, 0x94860efe1a989cee},
    {"asteroid", 0x5bb7e1ca6f51b161, 0x92000413475ec179},
    {"canyons", 0x167470cbe698bbb4, 0xd7513ebb561b1a12},
    {"dunes", 0x4772f469b5fbab41, 0x0de87386c6bb0a30},
    {"hills", 0xdbb0ffe311a8874f, 0x38eb5a9d4c114bae},
    {"islands", 0xed3783b4ebcd5987, 0x49f7809a60960bbc},
    {"karst", 0x70f0c0007da2a422, 0xc5aa588692583ec1},
    {"lattice", 0x5c8441b3f84196a1, 0x0b265596470d8a41},
    {"planet", 0x4360d13b25763af3, 0x43d0d4389f3ccfc3},
    {"regions", 0xe6cfe07be05d0e48, 0x04e3cc5b563436bc},
    {"ruins", 0x211628742251bd8d, 0xbd68fb8ded0ae487},
    {"thesis", 0x14f12d3d02c31b8b, 0x08fd86af7b1c978c},
};

#endif
