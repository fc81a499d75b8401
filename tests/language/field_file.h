/* Fields as files, for tests: samples in a NanoVDB file, or anything at all in one. */
#ifndef KARST_TESTS_FIELD_FILE_H
#define KARST_TESTS_FIELD_FILE_H

#include "core/export/nano_file.h"
#include "core/export/out_file.h"
#include "core/files/nano_layout.h"

/* Writes samples, rows along x, then y, then z, as a grid that is called "x", `voxel_m` apart, the first of them half a
 * voxel from the origin. Sides are at most 128. */
static inline bool write_field_file(const char *path, const float *samples, const int size[3], double voxel_m)
{
    const karst_nano_about about = {
        .name = "x", .voxel_m = voxel_m, .origin_m = {voxel_m / 2, voxel_m / 2, voxel_m / 2}};
    FILE *parts[KARST_NANO_PARTS];
    karst_nano_writer *w = karst_nano_begin(path, &about, NULL);
    if (!w)
        return false;
    bool done = true;
    karst_nano_begin_lower(w, (const int32_t[3]){0, 0, 0});
    for (int32_t x = 0; x < size[0]; x += 8)
        for (int32_t y = 0; y < size[1]; y += 8)
            for (int32_t z = 0; z < size[2]; z += 8) {
                float values[512] = {0};
                uint64_t active[8] = {0};
                for (int i = 0; i < 512; i++) {
                    const int at[3] = {x + (i >> 6), y + (i >> 3 & 7), z + (i & 7)};
                    if (at[0] >= size[0] || at[1] >= size[1] || at[2] >= size[2])
                        continue;
                    values[i] = samples[(at[2] * size[1] + at[1]) * size[0] + at[0]];
                    active[i >> 6] |= (uint64_t)1 << (i & 63);
                }
                done = done && karst_nano_add_leaf(w, (const int32_t[3]){x, y, z}, values, active, NULL);
            }
    done = done && karst_nano_end_lower(w, NULL) && karst_nano_finish(w, parts, NULL) &&
           karst_out_assemble(path, "", 0, parts, KARST_NANO_PARTS, NULL, NULL, NULL);
    karst_nano_end(w);
    return done;
}

#endif
