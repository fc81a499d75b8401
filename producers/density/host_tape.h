/* Values of a tape at all samples of a brick, on the host.
 *
 * Each instruction runs for a block of samples before the next one does, in loops that the compiler turns into vectors
 * of whatever width the processor has. The bits are those of the interpreter (language/tape_values.clh), whose ops
 * these are: every one is exact or rounds as IEEE says, so no width changes any. */
#ifndef KARST_PRODUCERS_HOST_TAPE_H
#define KARST_PRODUCERS_HOST_TAPE_H

#include "karst/position.h"

#include "cache/layout_shared.h"
#include "producers/language/tape/tape.clh"
#include "producers/language/tape/tape.h"

/* What instructions it is compiled for. */
typedef enum {
    KARST_HOST_PLAIN, /* those that every processor of the architecture has */
    KARST_HOST_AVX2,
    KARST_HOST_AVX512,
    KARST_NUM_HOST_WIDTHS
} karst_host_width;

/* Whether this processor has them. Thread-safe. */
bool karst_host_width_is_there(karst_host_width width);
/* The widest that is there. Thread-safe. */
karst_host_width karst_host_width_best(void);

/* Writes KARST_BRICK_SAMPLES samples, x fastest, of the density that `output` names, band-limited to voxels of `level`;
 * sample (0, 0, 0) lies on level-0 voxel corner `origin`, samples are 2^level apart. `steps` and `count` as in
 * tape_values_of_rows; the tape needs at most KARST_TAPE_MOST_SLOTS slots, of which it brings none. `width` is there.
 * Thread-safe; works on some 700 KiB of the thread's stack. */
void karst_host_tape_samples(karst_host_width width, const tape_program *tape, const uint *steps, uint count,
                             uint output, const long origin[3], int level, float samples[KARST_BRICK_SAMPLES]);
/* The same at `num` points anywhere: outputs[k] of point i goes to values[k][i]. `level` is -1 for all detail. */
void karst_host_tape_points(karst_host_width width, const tape_program *tape, const uint *outputs, uint num_outputs,
                            const karst_position *at, size_t num, int level, float *const *values);

#endif
