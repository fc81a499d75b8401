/* What tests of saved worlds share: a folder, edits that are functions of a number, and what a file must hold. */
#ifndef KARST_TESTS_SAVED_RIG_H
#define KARST_TESTS_SAVED_RIG_H

#include <limits.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/saved.h"
#include "tests/support/ok.h"

#define RIG_VOXEL_LOG2_M (-4) /* hills */
#ifndef RIG_IN_MEMORY
#define RIG_IN_MEMORY false
#endif

/* It fails with this code, and says this. */
#define assert_fails(code, words, call)                                                                      \
    do {                                                                                                     \
        karst_error error = {0};                                                                             \
        if (call)                                                                                            \
            fail_msg("%s: worked", #call);                                                                   \
        if (error.status != (code) || !strstr(error.message, words))                                         \
            fail_msg("%s: %d, %s; not %d, %s", #call, (int)error.status, error.message, (int)(code), words); \
    } while (0)

/* A folder that goes when the program ends; and a path in it. */
static char rig_folder[64];
static inline void rig_remove_folder(void)
{
    char line[200];
    snprintf(line, sizeof line, "chmod -R u+rwX %s && rm -rf %s", rig_folder, rig_folder);
    if (system(line) != 0)
        fprintf(stderr, "%s is left\n", rig_folder);
}
static inline const char *rig_path(const char *name)
{
    static struct {
        const char *name;
        char path[160];
    } paths[64];
    if (!*rig_folder) {
        /* Small files need no disk that takes its time. */
        bool in_memory = RIG_IN_MEMORY && access("/dev/shm", W_OK | X_OK) == 0;
        strcpy(rig_folder, in_memory ? "/dev/shm/karst-saved-XXXXXX" : "/tmp/karst-saved-XXXXXX");
        assert_non_null(mkdtemp(rig_folder));
        atexit(rig_remove_folder);
    }
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        if (!paths[i].name) {
            paths[i].name = name;
            snprintf(paths[i].path, sizeof paths[i].path, "%s/%s", rig_folder, name);
        }
        if (strcmp(paths[i].name, name) == 0)
            return paths[i].path;
    }
    fail_msg("too many names");
    return NULL;
}

static inline uint64_t rig_mix(uint64_t x)
{
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return x ^ x >> 31;
}

/* Edit number n of variant v: all shapes, modes and fields. */
static inline karst_edit rig_edit(uint64_t n, uint64_t v)
{
    uint64_t bits = rig_mix(n * 1000003 + v);
    karst_edit e = {.shape = (karst_edit_shape)(bits % 5), .mode = (karst_edit_mode)(bits / 5 % 2)};
    e.scale_m = e.strength = 1;
    if (e.shape <= KARST_EDIT_BOX && bits / 10 % 3 == 0)
        e.mode = KARST_EDIT_FLATTEN;
    for (int a = 0; a < 3; a++) {
        e.at.voxel[a] = (int64_t)(rig_mix(bits + 1 + (uint64_t)a) >> 3) - ((int64_t)1 << 60);
        e.at.fraction[a] = (uint32_t)rig_mix(bits + 4 + (uint64_t)a);
    }
    if (e.shape == KARST_EDIT_SPHERE || e.shape == KARST_EDIT_CAPSULE || e.shape == KARST_EDIT_NOISE)
        e.radius_m = 1 + (double)(bits % 1000) / 7;
    for (int a = 0; a < 3; a++) {
        if (e.shape == KARST_EDIT_BOX)
            e.half_m[a] = 0.5 + (double)(bits % 77) / 3 + a;
        if (e.shape == KARST_EDIT_CAPSULE)
            e.to_m[a] = (double)(bits % 1024) / 16 - a;
        if (e.shape == KARST_EDIT_PLANE || e.mode == KARST_EDIT_FLATTEN)
            e.normal[a] = a == 1 ? 1 : (double)(bits % 11) / 13;
    }
    if (e.shape == KARST_EDIT_NOISE) {
        e.amplitude_m = 0.5;
        e.scale_m = 1 + (double)(bits % 9);
        e.seed = (uint32_t)bits;
    }
    e.blend_m = bits / 64 % 2 ? 0.25 : 0;
    if (v > 0 && e.mode == KARST_EDIT_ADD && bits / 128 % 2) { /* variant 0 is what version 1 knew */
        e.mode = bits / 256 % 2 ? KARST_EDIT_PAINT : e.mode;
        e.has_colour = true;
        for (int c = 0; c < 3; c++)
            e.colour[c] = (double)(bits / 512 % 97 + (uint64_t)c) / 100;
        e.strength = bits / 1024 % 2 ? 1 : 0.375;
    }
    if (v > 1 && e.shape == KARST_EDIT_SPHERE && !e.has_colour && bits / 2048 % 2) { /* nor did it know these */
        e.mode = KARST_EDIT_SMOOTH;
        e.blend_m = 0;
        e.strength = bits / 4096 % 2 ? 1 : 0.0625;
        e.normal[0] = e.normal[2] = bits / 8192 % 2 ? 0 : 0.5;
        e.normal[1] = bits / 8192 % 2 ? 0 : -1;
    }
    return e;
}

static inline bool rig_is_same(const karst_edit *a, const karst_edit *b)
{
    return a->shape == b->shape && a->mode == b->mode && memcmp(&a->at.voxel, &b->at.voxel, sizeof a->at.voxel) == 0 &&
           memcmp(&a->at.fraction, &b->at.fraction, sizeof a->at.fraction) == 0 &&
           memcmp(&a->radius_m, &b->radius_m, sizeof a->radius_m) == 0 &&
           memcmp(a->half_m, b->half_m, sizeof a->half_m) == 0 && memcmp(a->to_m, b->to_m, sizeof a->to_m) == 0 &&
           memcmp(a->normal, b->normal, sizeof a->normal) == 0 && a->blend_m == b->blend_m &&
           a->amplitude_m == b->amplitude_m && a->scale_m == b->scale_m && a->seed == b->seed &&
           a->has_colour == b->has_colour && memcmp(a->colour, b->colour, sizeof a->colour) == 0 &&
           a->strength == b->strength;
}

static inline void rig_create(const char *path)
{
    const karst_saved_config config = {.world = "hills"};
    assert_ok(karst_saved_create(path, &config, &error));
}

static inline karst_saved *rig_open(const char *path, bool for_writing)
{
    karst_saved *saved;
    assert_ok(saved = karst_saved_open(path, for_writing, NULL, &error));
    return saved;
}

static inline void rig_append(karst_saved *saved, uint64_t first, size_t num, uint64_t variant)
{
    for (size_t i = 0; i < num; i++) {
        karst_edit edit = rig_edit(first + i, variant);
        assert_ok(karst_saved_append(saved, &edit, 1, RIG_VOXEL_LOG2_M, &error));
    }
}

static inline size_t rig_count_wrong(karst_saved *saved)
{
    size_t num_wrong;
    assert_ok(karst_saved_check(saved, NULL, NULL, &num_wrong, &error));
    return num_wrong;
}

static inline size_t rig_number(size_t full, size_t usual, size_t quick)
{
    return getenv("KARST_TEST_FULL") ? full : getenv("KARST_TEST_QUICK") ? quick : usual;
}

#endif
