/* Of each shipped world: hashes of its samples and of its encoded bricks (test_golden.c). */
#ifndef KARST_TESTS_WORLDS_GOLDEN_H
#define KARST_TESTS_WORLDS_GOLDEN_H

#include <stdint.h>

typedef struct {
    const char *name;
    uint64_t samples, bricks;
} golden_hashes;

static const golden_hashes golden[] = {
    {"alps", 0x2457dbf38f54fea7, 0x888ec07408a90400},
    {"asteroid", 0x5bb7e1ca6f51b161, 0x92000413475ec179},
    {"canyons", 0x19d8dc7e2046b4c3, 0x639740988715bb19},
    {"caustics", 0x07948486500ad856, 0x2f7b835931326857},
    {"clouds", 0xfcadf2f28e755f97, 0xef8b04c9aad79f1c},
    {"dunes", 0x35ae260de0f26a14, 0x0de87386c6bb0a30},
    {"fog", 0xfe048f4ce62380f6, 0x93596dd3a2967811},
    {"glass", 0x0cdde755679f3985, 0x3e1f7c0e54664a65},
    {"hills", 0x99693168f9bf77f8, 0x2c5c0d99ef88c20b},
    {"ice", 0xa06f3de92a4f782b, 0x382face1785841b9},
    {"islands", 0x847a82b562378561, 0x9eb9b97f4c07293f},
    {"karst", 0xc83c2d09163d38cb, 0x336e1c38159e2673},
    {"lake", 0xfc0fcc15eee89d6c, 0x620c307d0a6b3319},
    {"lanterns", 0xa167af5b4c2c646b, 0xbd1053268c2198c6},
    {"lattice", 0x5c8441b3f84196a1, 0x0b265596470d8a41},
    {"lens", 0xf6bf7a12f492a769, 0x4a914f03d773aa5d},
    {"menagerie", 0xfe177a2ed4a3cd2b, 0x5f9e8f71fdf6539d},
    {"nebula", 0x1cd222812bd8ae02, 0x5b776c437a87fb9e},
    {"planet", 0x4360d13b25763af3, 0x43d0d4389f3ccfc3},
    {"regions", 0xe6cfe07be05d0e48, 0x04e3cc5b563436bc},
    {"ruins", 0x211628742251bd8d, 0xbd68fb8ded0ae487},
    {"scan", 0xdaca2bc2f63d58f1, 0x2482fc4434631914},
    {"smoke", 0xe8cf6e2f2978d60d, 0xb38fe124d956da94},
    {"sunbeams", 0x9985cc0199a5ef77, 0xc59efbaedfec7f83},
    {"survey", 0x737a2faf390fcab2, 0xc3e6357a1c01a74c},
    {"thesis", 0x14f12d3d02c31b8b, 0x08fd86af7b1c978c},
};

#endif
